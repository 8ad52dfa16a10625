"""`tcstudy draw`: a picture of a result file of any kind, and what may be asked of each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tcstudy.data.files import attributes, reading
from tcstudy.data.provenance import Kind, kind_of, remarks_of
from tcstudy.data.reading import load_root
from tcstudy.errors import UsageError, tell
from tcstudy.reports.figures import style
from tcstudy.reports.figures.accuracy import convergence_figure, cost_figure
from tcstudy.reports.figures.path import draw_history, fit_figure, path_figure
from tcstudy.reports.figures.point import Ends, law_figure, laws_of, point_figure, profile_figure
from tcstudy.reports.figures.sweep import curves_figure, map_figure, read_sweep
from tcstudy.reports.picture import read_picture
from tcstudy.reports.terminal.accuracy import SYMBOLS, measure_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

OF_RUN = ("x", "y", "by", "map", "of", "law", "deform", "along")
"""What chooses among the pictures of a run."""
LOOK = ("size", "ax", "panel")
"""What all pictures take."""
DRAWN_BY = {
    "run": ("at", "level", *OF_RUN, *LOOK),
    "path": ("y", *LOOK),
    "convergence": ("at", *LOOK),
    "cost": ("y", *LOOK),
    "fit": LOOK,
    "history": ("at", "x", "y", *LOOK),
}
"""Options that a picture of each kind of file depends on."""


@dataclass(frozen=True)
class Wanted:
    """What is asked of a picture, as of `tcstudy.draw`; None and False for what is not."""

    at: Mapping[str, Any] | None = None
    level: int | None = None
    x: str | None = None
    y: str | None = None
    by: str | None = None
    map: tuple[str, str] | None = None
    of: str | None = None
    law: bool = False
    deform: float | None = None
    along: str | Ends | None = None
    size: str | tuple[float, float] | None = None
    ax: Axes | None = None
    panel: str | None = None

    def check(self, kind: str) -> None:
        """Raise UsageError for what does not go together or does not matter to a file of this kind."""
        given = [name for name in vars(self) if getattr(self, name) not in (None, False)]
        if self.panel is not None and self.ax is None:
            raise UsageError("panel: give ax, too, the axes of your figure that it is drawn into")
        for name in given:
            if name not in DRAWN_BY[kind] and not (name == "at" and not self.at):
                raise UsageError(f"{name}: the picture of a {kind} file does not depend on it; leave it out")
        if kind != "run":
            return
        for one, other in (("x", "y"), ("y", "x"), ("map", "of"), ("by", "x")):
            if one in given and other not in given:
                raise UsageError(f"{one}: give {other}, too, for example {EXAMPLES[other]}")
        modes: list[str] = [name for name in ("x", "map", "law", "deform", "along") if name in given]
        modes += ["of"] * ("of" in given and modes in (["x"], ["law"]))  # a map, a body and a profile are of something
        if len(modes) > 1:
            raise UsageError(f"{modes[0]}: {modes[1]} is another picture; choose one of them")


EXAMPLES = {"x": "x = theta_bar", "y": "y = slip_length", "map": "map = alpha,theta_bar", "of": "of = u_T_max"}


def picture(file: Path, target: Path, wanted: Wanted | None = None) -> str:
    """Draw a file of any kind into `target` (.png, .svg or .pdf by its suffix); returns one line on what was drawn.

    Raises StoreError if `file` is no complete result file, DrawError if it does not have what is wanted, `target`
    cannot be written or matplotlib is not installed, UsageError for what does not go together.
    """
    style.check_target(target)
    with _figure(file, wanted or Wanted()) as (figure, words, dpi):
        style.save(figure, target, dpi)
    return f"{target}: {words}"


def figure_of(file: Path, wanted: Wanted) -> Figure:
    """The same as a figure, which a notebook shows (`_repr_png_`). Raises as `picture` does."""
    with _figure(file, wanted) as (figure, _, dpi):
        return figure if wanted.ax is not None else style.shown(figure, dpi)


@contextmanager
def _figure(file: Path, wanted: Wanted) -> Iterator[tuple[Figure, str, int]]:
    """The figure, one line on what it shows, and its pixels per inch, in the style in which it must be saved."""
    kind = kind_of(file)
    wanted.check(kind)
    size = style.size_in_inches(wanted.size) if isinstance(wanted.size, str) else wanted.size
    remarks = remarks_of(attributes(file))
    said = () if size is not None or wanted.ax is not None else tuple(f"Warning: {one}" for one in remarks)
    look = style.Look(size, said, wanted.ax, wanted.panel)
    tell(remarks)
    with reading(file), style.styled(look):
        yield *_drawn(file, kind, wanted, look), look.dpi


def _drawn(file: Path, kind: Kind, wanted: Wanted, look: style.Look) -> tuple[Figure, str]:
    data: Any = None if kind == "run" else load_root(file, kind)
    match kind:
        case "path":
            words = f"{data.attrs['title']}, path along {data.attrs['parameter']}"
            return path_figure(data, wanted.y or "mean-slip", look), words
        case "history":
            return draw_history(data, wanted.at, wanted.x, wanted.y, look)
        case "fit":
            return fit_figure(data, look), f"{data.attrs['title']}, fitted to {data.attrs['data_file']}"
        case "cost":
            name = measure_of(data, wanted.y)
            return cost_figure(data, name, look), f"{SYMBOLS[name]}, {data.attrs['point'] or data.attrs['title']}"
        case "convergence":
            return convergence_figure(data, wanted.at, look)
    level = -1 if wanted.level is None else wanted.level
    if along := wanted.map or tuple(filter(None, (wanted.x, wanted.by))):
        sweep = read_sweep(file, along, wanted.of or wanted.y or "", wanted.at, level)
        over = " and ".join(one.name for one in sweep.parameters)
        figure = (map_figure if wanted.map else curves_figure)(sweep, look)
        return figure, f"{sweep.quantity} over {over}, {sweep.words}"
    point = read_picture(file, wanted.at, level)
    where = f"{point.point or point.title}, level {point.level}"
    if wanted.law:
        laws = laws_of(point)
        names = ", ".join(f"{edge}: {law.name}" if edge else law.name for edge, law in laws[0])
        return law_figure(point, laws, look), f"law {names}, {where}"
    if wanted.along is not None:
        return profile_figure(point, look, wanted.along, wanted.of), f"profile along a line, {where}"
    fields = "" if point.body else " (contact line only: the run kept no fields, see output.fields)"
    return point_figure(point, look, wanted.of, wanted.deform), f"{where}{fields}"
