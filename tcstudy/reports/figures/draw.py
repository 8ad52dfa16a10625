"""`tcstudy draw`: a picture of a result file of any kind.

The parameters of a function that makes a picture are the options of that picture.
"""

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
from tcstudy.reports.text import in_sentences

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Drawn = tuple["Figure", str]
"""A figure and one line on its content."""
Point = Mapping[str, Value] | None


@contextmanager
def drawn(
    file: Path,
    size: style.Size | None = None,
    ax: Any = None,
    panel: str | None = None,
    **options: Any,
) -> Iterator[tuple[Figure, str, style.Look]]:
    """Yield the figure of a result file, one line on it, and its looks, in the style to save it in.

    options: as of `tcstudy.draw`; None and False count as not given

    Raises StoreError if `file` is no complete result file, DrawError if it lacks the requested
    data or matplotlib is not installed, UsageError for options that do not go together.
    """
    kind = kind_of(file)
    options = {
        name: value for name, value in options.items() if value is not None and value is not False
    }
    make = _maker(kind, options)
    warnings: tuple[str, ...] = ()
    if size is None and ax is None:
        remarks = remarks_of(attributes(file))
        warnings = tuple(f"Warning: {in_sentences(str(remark))}" for remark in remarks)
    look = style.look_of(size, warnings, ax, panel)
    with reading(file), style.styled(look):
        figure, words = make(file, look, **options)
        yield figure, words, look


def _maker(kind: Kind, options: Mapping[str, Any]) -> Callable[..., Drawn]:
    """Return the function that makes a picture. Raises UsageError for options it does not take."""
    key = ""
    if kind == "run":
        key = next((name for name in RUN if name in options), "")
    make = RUN[key] if key else KINDS[kind]
    parameters = list(signature(make).parameters.values())[2:]
    accepted = {parameter.name for parameter in parameters}
    for name in options:
        if name not in accepted:
            picture = f"{kind} file by {key}" if key else f"{kind} file"
            raise UsageError(
                f"{name}: the picture of a {picture} does not depend on it; leave it out"
            )
    for parameter in parameters:
        if parameter.default is parameter.empty and parameter.name not in options:
            example = EXAMPLES[parameter.name]
            raise UsageError(f"{key}: give {parameter.name}, too, for example {example}")
    return make


EXAMPLES = {"y": "y = slip_length", "of": "of = u_T_max"}


def _path(file: Path, look: style.Look, y: str | None = None) -> Drawn:
    data = load_root(file)
    words = f"{data.attrs['title']}, path along {data.attrs['parameter']}"
    return path_figure(data, y, look), words


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
    measure = measure_of(data, y)
    words = f"{SYMBOLS[measure]}, {data.attrs['point'] or data.attrs['title']}"
    return cost_figure(data, measure, look), words


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
    """Return the two parameters of a map, from a text "alpha,theta_bar" or two names.

    Raises UsageError for another number of names.
    """
    split_names = names.split(",") if isinstance(names, str) else names
    pair = tuple(str(name).strip() for name in split_names)
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


def _law(
    file: Path,
    look: style.Look,
    law: bool,  # noqa: ARG001
    at: Point = None,
    level: int = -1,
) -> Drawn:
    point = read_picture(file, at, level)
    operating = laws_of(point)
    names = [f"{edge}: {law.name}" if edge else law.name for edge, law in operating.laws]
    figure = law_figure(point, operating, look)
    return figure, f"law {', '.join(names)}, {point.words}"


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
"""Pictures of a run other than a point, by the option that requests them."""
KINDS: dict[Kind, Callable[..., Drawn]] = {
    "run": _body,
    "path": _path,
    "history": _history,
    "fit": _fit,
    "convergence": _convergence,
    "cost": _cost,
}
