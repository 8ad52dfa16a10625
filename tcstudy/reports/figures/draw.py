"""`tcstudy draw`: a picture of a result file of any kind: what may be asked of it are its
function's parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tcstudy.data.files import Kind, attributes, kind_of, reading, remarks_of
from tcstudy.data.reading import load_root
from tcstudy.errors import UsageError
from tcstudy.reports.figures import style
from tcstudy.reports.figures.accuracy import convergence_figure, cost_figure
from tcstudy.reports.figures.path import draw_history, fit_figure, path_figure
from tcstudy.reports.figures.point import Ends, law_figure, laws_of, point_figure, profile_figure
from tcstudy.reports.figures.sweep import curves_figure, map_figure, read_sweep
from tcstudy.reports.picture import read_picture
from tcstudy.reports.select_point import Value
from tcstudy.reports.terminal.accuracy import SYMBOLS, measure_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Drawn = tuple["Figure", str]
"""A figure, and what it shows in words."""
Point = Mapping[str, Value] | None


@contextmanager
def drawn(
    file: Path,
    size: style.Size | None = None,
    ax: Any = None,
    panel: str | None = None,
    **asked: Any,
) -> Iterator[tuple[Figure, str, style.Look]]:
    """The figure of a result file, one line on what it shows, and its looks, in the style in which
    it must be saved.

    asked: as of `tcstudy.draw`; what is None or False is not asked for

    Raises StoreError if `file` is no complete result file, DrawError if it does not have what is
    wanted or matplotlib is not installed, UsageError for what does not go together.
    """
    kind, remarks = kind_of(file), remarks_of(attributes(file))
    asked = {name: one for name, one in asked.items() if one is not None and one is not False}
    make = _maker(kind, asked)
    told = () if size is not None or ax is not None else tuple(f"Warning: {one}" for one in remarks)
    look = style.look_of(size, told, ax, panel)
    with reading(file), style.styled(look):
        yield *make(file, look, **asked), look


def _maker(kind: Kind, asked: Mapping[str, Any]) -> Callable[..., Drawn]:
    """The function of the picture that is asked for. Raises UsageError for what it does not take,
    or lacks."""
    by = next((name for name in RUN if name in asked), "") if kind == "run" else ""
    make = RUN[by] if by else KINDS[kind]
    takes = list(signature(make).parameters.values())[2:]
    for name in asked:
        if name not in {one.name for one in takes}:
            what = f"{kind} file" + f" by {by}" * bool(by)
            raise UsageError(f"{name}: the picture of a {what} does not depend on it; leave it out")
    for one in takes:
        if one.default is one.empty and one.name not in asked:
            raise UsageError(f"{by}: give {one.name}, too, for example {EXAMPLES[one.name]}")
    return make


EXAMPLES = {"y": "y = slip_length", "of": "of = u_T_max"}


def _path(file: Path, look: style.Look, y: str = "mean-slip") -> Drawn:
    data = load_root(file)
    return path_figure(
        data, y, look
    ), f"{data.attrs['title']}, path along {data.attrs['parameter']}"


def _history(
    file: Path, look: style.Look, at: Point = None, x: str | None = None, y: str | None = None
) -> Drawn:
    return draw_history(load_root(file), at, x, y, look)


def _fit(file: Path, look: style.Look) -> Drawn:
    data = load_root(file)
    return fit_figure(data, look), f"{data.attrs['title']}, fitted to {data.attrs['data_file']}"


def _convergence(file: Path, look: style.Look, at: Point = None) -> Drawn:
    return convergence_figure(load_root(file), at, look)


def _cost(file: Path, look: style.Look, y: str | None = None) -> Drawn:
    data = load_root(file)
    name = measure_of(data, y)
    return cost_figure(
        data, name, look
    ), f"{SYMBOLS[name]}, {data.attrs['point'] or data.attrs['title']}"


def _curves(
    file: Path,
    look: style.Look,
    x: str,
    y: str,
    by: str | None = None,
    at: Point = None,
    level: int = -1,
) -> Drawn:
    sweep = read_sweep(file, (x, by) if by else (x,), y, at, level)
    return curves_figure(sweep, look), sweep.words


def pair_of(names: str | Sequence[str]) -> tuple[str, str]:
    """Return the two parameters of a map, of a text "alpha,theta_bar" or of two names. Raises
    UsageError."""
    given = names.split(",") if isinstance(names, str) else names
    pair = tuple(str(name).strip() for name in given)
    if len(pair) != 2 or not all(pair):
        raise UsageError("map: name two swept parameters, for example alpha,theta_bar")
    return pair


def _map(
    file: Path,
    look: style.Look,
    map: str | Sequence[str],
    of: str,
    at: Point = None,
    level: int = -1,
) -> Drawn:
    sweep = read_sweep(file, pair_of(map), of, at, level)
    return map_figure(sweep, look), sweep.words


def _law(file: Path, look: style.Look, law: bool, at: Point = None, level: int = -1) -> Drawn:  # noqa: ARG001
    point = read_picture(file, at, level)
    laws = laws_of(point)
    names = ", ".join(f"{edge}: {law.name}" if edge else law.name for edge, law in laws[0])
    return law_figure(point, laws, look), f"law {names}, {point.words}"


def _profile(
    file: Path,
    look: style.Look,
    along: str | Ends,
    of: str | None = None,
    at: Point = None,
    level: int = -1,
) -> Drawn:
    point = read_picture(file, at, level)
    return profile_figure(point, look, along, of), f"profile along a line, {point.words}"


def _body(
    file: Path,
    look: style.Look,
    of: str | None = None,
    deform: float | None = None,
    at: Point = None,
    level: int = -1,
) -> Drawn:
    point = read_picture(file, at, level)
    fields = "" if point.body else " (contact line only: the run kept no fields, see output.fields)"
    return point_figure(point, look, of, deform), f"{point.words}{fields}"


RUN: dict[str, Callable[..., Drawn]] = {"map": _map, "x": _curves, "law": _law, "along": _profile}
"""By what asks for it, in place of a point."""
KINDS: dict[Kind, Callable[..., Drawn]] = {
    "run": _body, "path": _path, "history": _history, "fit": _fit, "convergence": _convergence, "cost": _cost,
}  # fmt: skip
