"""Pictures of a sweep: curves of a variable over one parameter, by another, and maps over two.

Points without a solution have no value: they are left out, and counted by their status.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.reading import by_point, open_results
from tcstudy.data.schema import EXISTENCE_RADIUS, NOT_ALL, PointStatus
from tcstudy.data.store import BRANCH, GUARANTEE, SWEPT_LOADS
from tcstudy.errors import DrawError
from tcstudy.reports.figures import style
from tcstudy.reports.figures.panels import BESIDE, Array, Panel, Scale, Sheet, scale
from tcstudy.reports.rounding import floors_of
from tcstudy.reports.select_point import (
    Value,
    axis_names,
    axis_symbol,
    axis_symbols,
    fitting,
    labels_by_point,
    level_number,
    parameter,
    quantity,
)
from tcstudy.reports.sentences import least_energy_words, proved_object, several
from tcstudy.reports.text import (
    axis_unit,
    counted,
    headed,
    labels,
    named,
    spelled,
    study_unit,
    with_unit,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Flags = NDArray[np.bool_]

COUNTS = ("solutions", "stable_solutions")
"""Variables that count equilibria."""
MARKERS = "osD^vPX"
MAX_NAMED_CURVES = 10
"""Curves that a legend names; of more it names some."""
MAX_MARKED_POINTS = 60
"""Points of a curve up to which each one gets a marker."""
MAX_LOG_TICKS = 9
"""Ticks of a logarithmic axis."""
COLOURS = "viridis"
"""Evenly light for every kind of colour vision, and in grey."""
FAILED: dict[str, Any] = {"hatch": "xxx", "edgecolor": style.PALE, "linewidth": 0.0}
OPEN: dict[str, Any] = {"hatch": "//", "edgecolor": "white", "linewidth": 0.0}
OPEN_KEY: dict[str, Any] = {"hatch": "///", "facecolor": "#31688e"}
INFINITE: dict[str, Any] = {"hatch": "..", "edgecolor": style.INK, "linewidth": 0.0}
INFINITE_KEY: dict[str, Any] = {"hatch": "...", "facecolor": "white"}
SEVERAL: dict[str, Any] = {"edgecolor": style.VERMILLION, "linewidth": 1.8, "zorder": 4}
SEVERAL_FOUND = "several solutions found"
RING: dict[str, Any] = {
    "marker": "o",
    "markersize": 9,
    "fillstyle": "none",
    "linestyle": "none",
    "color": style.VERMILLION,
}
EQUILIBRIUM: dict[str, Any] = {
    "marker": "o",
    "markersize": 4.5,
    "linestyle": "none",
    "color": style.BLUE,
}
PROVED_EQUILIBRIUM: dict[str, Any] = {
    "marker": "o",
    "markersize": 9,
    "markeredgewidth": 2.6,
    "fillstyle": "none",
    "linestyle": "none",
    "color": style.BLUE,
}
"""Bold rings of equilibria near which the body itself is proved to have one."""
FOLD: dict[str, Any] = {"color": style.VERMILLION, "linewidth": 1.4}
EQUAL: dict[str, Any] = {"color": "black", "linewidth": 1.4, "linestyle": "--"}
BOUND: dict[str, Any] = {"color": "black", "linewidth": 0.8, "linestyle": "-"}
OF_EQUILIBRIA: dict[str, Callable[[Any], Array]] = {
    "u_T_max": lambda level: np.abs(level["solution_u_T"].values).max(axis=1),
    "energy": lambda level: level["solution_energy"].values,
}
"""Quantities of all equilibria of a level."""
BAND = ("lambda_1_low", "lambda_1_high")
"""Proved bounds of λ₁ of the body."""


@dataclass(frozen=True)
class SweptParameter:
    """A swept parameter of a picture.

    labels:    its different values, ascending if they are numbers
    numbers:   the same as numbers in `unit`, None if one of them is a text
    place:     (P,) index of the value of every point
    is_random: sampled from a distribution, so that neighbours have nothing in common
    """

    name: str
    symbol: str
    labels: tuple[str, ...]
    numbers: Array | None
    unit: str
    place: NDArray[np.intp]
    is_random: bool = False

    @property
    def title(self) -> str:
        """Symbol and unit, for an axis."""
        return headed(self.symbol, self.unit)


@dataclass(frozen=True)
class AllEquilibria:
    """All equilibria of the points of a sweep.

    point:  (S,) index of the point of each;  values: (S,) of the quantity, in the units of the file
    stable: (S,) strict local minimum
    radius: (S,) of the ball in which the body itself has one, NaN without a proof
    body:   what the proofs are of;  units: of the radius
    """

    point: NDArray[np.intp]
    values: Array
    stable: Flags
    radius: Array
    body: str
    units: str

    @property
    def proved_words(self) -> str:
        """What is proved where rings are bold, for a key."""
        radii = self.radius[np.isfinite(self.radius)]
        largest = with_unit(float(radii.max()), self.units, 2)
        return f"bold: proved for {self.body},\nradius ≤ {largest} (energy norm)"


@dataclass(frozen=True)
class SweepPicture:
    """P points of a sweep on one level, and the value of one quantity at each of them.

    quantity: name of the quantity;  axis: its symbol and scale in pictures
    symbols:  symbols of the parameters, by name
    fixed:    values that the points have in common, in words
    left_out: number of points without a value, and the reasons; empty if all have one
    values:   (P,) values in the units of the file, NaN where there is none
    proved:   (P,) whether it is the only solution
    several:  (P,) whether starts led to solutions of different energies
    at_least: (P,) whether a number of equilibria is a lower bound; None for other quantities
    excess:   (P,) ω − λ₁, below 0 where one solution is proved, NaN where it is not known; then the
              same with the lower and the upper bound of λ₁ of the body, where they are known
    infinite: (P,) whether the value is infinite, as ω of a law with a down-jump
    infinity: "∞" or "−∞"
    loading:  note that the curve is no loading curve, where it is none
    every:    all equilibria of the points, None where the file has not that quantity of each
    """

    title: str
    quantity: str
    axis: Scale
    parameters: tuple[SweptParameter, ...]
    symbols: dict[str, str]
    fixed: tuple[str, ...]
    left_out: str
    values: Array
    proved: Flags
    several: Flags
    at_least: Flags | None
    excess: tuple[Array, ...]
    infinite: Flags
    infinity: str
    loading: str
    every: AllEquilibria | None

    @property
    def words(self) -> str:
        """Words on the quantity, the parameters, and the values that the points have in common."""
        over = " and ".join(axis.name for axis in self.parameters)
        facts = [f"{self.quantity} over {over}", *self.fixed, self.left_out, self.infinite_words]
        return ", ".join(filter(None, [*facts, self.loading]))

    @property
    def infinite_words(self) -> str:
        """Number of points with an infinite value, in words; empty if there are none."""
        count = int(self.infinite.sum())
        return f"{self.infinite_value} at {counted(count, 'point')}" if count else ""

    @property
    def infinite_value(self) -> str:
        """The quantity with its infinite value: "ω = ∞"."""
        return f"{style.symbol(self.quantity)} = {self.infinity}"


def _left_out(status: NDArray[Any], has_no_value: Flags) -> str:
    """Return the number of points without a value, with their reasons; empty if all have one."""
    codes, counts = np.unique(status[has_no_value], return_counts=True)
    if not len(codes):
        return ""
    reasons = []
    for code, count in zip(codes, counts, strict=True):
        is_solved = code == PointStatus.OK
        reason = "without a value" if is_solved else named(PointStatus(int(code)))
        reasons.append(f"{count} {reason}")
    points = counted(len(status), "point")
    return f"{int(has_no_value.sum())} of {points} left out: {', '.join(reasons)}"


def read_sweep(
    path: Path, along: tuple[str, ...], number: str, point: Mapping[str, Value] | None, level: int
) -> SweepPicture:
    """Read the points of a sweep with the labels `point`, along the parameters `along`.

    The points are those of `fitting`.

    Raises StoreError if `path` is no complete result file, DrawError for names that it does not
    have.
    """
    with open_results(path) as tree:
        data = tree.to_dataset()
        names = _parameter_names(data, along)
        level = level_number(data, level)
        group = tree.children.get(f"level_{level}")
        of_level = () if group is None else {str(key) for key in group.data_vars}
        name = quantity(data, number, of_level)
        is_shown, fixed = fitting(data, point, names)
        columns = (name, "status", "unique", "start_energy", "complete", "omega", "lambda_1", *BAND)
        stored = [key for key in dict.fromkeys(columns) if key in data]
        values = data[stored].isel(level=level).load()
        cleared = floors_of(data).cleared(name, by_point(values[name], values), level)
        label_of_point = labels_by_point(data)
        parameters = [_parameter(data, key, label_of_point[key][is_shown]) for key in names]
        every = None if group is None else _equilibria(group, name, is_shown, data.attrs)

    def flat(key: str) -> NDArray[Any]:
        if key not in values:
            return np.full(int(is_shown.sum()), np.nan)
        return by_point(values[key], values)[is_shown]

    shown = cleared[is_shown]
    status, unique, energy = flat("status"), flat("unique") == 1, flat("start_energy")
    has_count = (shown != -1) | (shown.dtype.kind == "f")
    has_value = (status == PointStatus.OK) & np.isfinite(shown) & has_count
    infinite = (status == PointStatus.OK) & np.isinf(shown)
    is_several = several(energy, unique)
    at_least = None
    if name in COUNTS and "complete" in values:
        at_least = flat("complete") == NOT_ALL
    loading = ""
    if data.attrs.get(BRANCH, "") in ("lowest", "all"):
        swept_loads = str(data.attrs.get(SWEPT_LOADS, "")).split()
        loads = [key for key in names[:1] if key in swept_loads]
        loading = least_energy_words(loads, energy, is_several)
    stiffnesses = ["lambda_1", *(key for key in BAND if key in values)]
    with np.errstate(invalid="ignore"):
        excess = [flat("omega") - flat(key) for key in stiffnesses]
    attrs = {"long_name": name, "units": "1"} | data[name].attrs
    title, units = spelled(str(attrs["long_name"])), str(attrs["units"])
    return SweepPicture(
        title=str(data.attrs["title"]),
        quantity=name,
        axis=scale(title, shown[has_value].astype(float), units),
        parameters=tuple(parameters),
        symbols=axis_symbols(data),
        fixed=(*fixed, f"level {level}"),
        left_out=_left_out(status, ~(has_value | infinite)),
        values=np.where(has_value, shown.astype(float), np.nan),
        proved=unique,
        several=is_several,
        at_least=at_least,
        excess=tuple(np.where(has_value, difference, np.nan) for difference in excess),
        infinite=infinite,
        infinity="−∞" if np.any(shown[infinite] < 0.0) else "∞",
        loading=loading,
        every=every,
    )


def _equilibria(
    group: Any, name: str, is_shown: Flags, attrs: Mapping[str, Any]
) -> AllEquilibria | None:
    """Return all equilibria of the points shown, None where a level does not list the quantity."""
    if "solution_point" not in group or name not in OF_EQUILIBRIA:
        return None
    point = group["solution_point"].values
    own = np.flatnonzero(is_shown[point])
    values = OF_EQUILIBRIA[name](group)[own]
    radius, units = np.full(len(own), np.nan), ""
    if EXISTENCE_RADIUS.name in group:
        radius = group[EXISTENCE_RADIUS.name].values[own]
        units = str(group[EXISTENCE_RADIUS.name].attrs["units"])
    return AllEquilibria(
        point=(np.cumsum(is_shown) - 1)[point[own]],
        values=values,
        stable=group["solution_stable"].values[own] == 1,
        radius=radius,
        body=proved_object(str(attrs.get(GUARANTEE, ""))),
        units=units,
    )


def _parameter_names(data: Any, along: Sequence[str]) -> tuple[str, ...]:
    """Return the names of requested parameters in the file. Raises DrawError."""
    if not axis_names(data):
        raise DrawError(
            "the file has one point and no swept parameter; draw the point, without x, y and map"
        )
    names = tuple(parameter(data, given_name) for given_name in along)
    if len(set(names)) < len(names):
        raise DrawError(f"{names[0]} is named twice; name two different swept parameters")
    return names


def _parameter(data: Any, name: str, label_of_point: NDArray[Any]) -> SweptParameter:
    """Return a parameter with the different labels among those of the points."""
    axis, title = data[name], axis_symbol(data, name)
    if label_of_point.dtype.kind in "OUS":
        labels_of_points = set(label_of_point.tolist())
        texts = dict.fromkeys(str(text) for text in axis.values if text in labels_of_points)
        index_of_text = {text: index for index, text in enumerate(texts)}
        place = np.array([index_of_text[str(text)] for text in label_of_point], dtype=np.intp)
        return SweptParameter(name, title, tuple(texts), None, "1", place)
    values, place = np.unique(label_of_point, return_inverse=True)
    divisor, unit = study_unit(axis.attrs) or axis_unit(values, str(axis.attrs["units"]))
    numbers = values / divisor
    texts_of_numbers = tuple(labels(numbers.tolist()))
    is_random = "distribution" in axis.attrs
    return SweptParameter(name, title, texts_of_numbers, numbers, unit, place.ravel(), is_random)


def _sheet(sweep: SweepPicture, look: style.Look) -> tuple[Sheet, Axes]:
    fixed = [style.point_words(words, sweep.symbols) for words in sweep.fixed]
    left_out = f"{sweep.left_out} (×)" if sweep.left_out else ""
    facts = [",  ".join(fixed), left_out, sweep.infinite_words, sweep.loading]
    sheet = Sheet(look, sweep.title, facts)
    return sheet, sheet.panels[""]


# -- curves ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SweepCurve:
    """The points of one curve, in the order of x."""

    points: NDArray[np.intp]
    name: str
    colour: Any
    marker: str


def curves_figure(sweep: SweepPicture, look: style.Look) -> Figure:
    """Return the curves of a quantity over the first parameter, one per value of a second."""
    x = sweep.parameters[0]
    by = sweep.parameters[1] if len(sweep.parameters) > 1 else None
    sheet, axes = _sheet(sweep, look)
    panel = Panel(Scale(x.title), sweep.axis, grid=True)
    positions = x.numbers
    if positions is None:
        positions = np.arange(len(x.labels), dtype=float)
    has_several = False
    every = sweep.every if by is None else None
    for curve in _curves(x, by, "lowest energy" if every else ""):
        places = positions[x.place[curve.points]]
        _draw_curve(panel, sweep, curve, places)
        is_several = sweep.several[curve.points] & np.isfinite(sweep.values[curve.points])
        if is_several.any() and every is None:
            label = "" if has_several else SEVERAL_FOUND
            values = sweep.values[curve.points]
            panel.line(places[is_several], values[is_several], label=label, **RING)
            has_several = True
        _draw_missing(axes, sweep, curve, places)
    if every is not None:
        _draw_equilibria(panel, every, positions[x.place])
    _set_ticks(panel, x, positions)
    panel.draw(axes)
    if panel.log[0]:
        axes.minorticks_off()
    if by or has_several or every is not None:
        place = "right upper" if sheet.columns >= BESIDE else "lower center"
        sheet.key(place=place, title=by.title if by else "")
    return sheet.finish()


def _curves(x: SweptParameter, by: SweptParameter | None, name: str = "") -> list[SweepCurve]:
    """Return the curve of every value of `by`, or one of all points, with this name."""
    order = np.argsort(x.place, kind="stable")
    if by is None:
        return [SweepCurve(order, name, style.SERIES[0], MARKERS[0])]
    colours = _colours(by)
    stride = -(-len(by.labels) // MAX_NAMED_CURVES)
    curves = []
    for index, label in enumerate(by.labels):
        shown = label if index % stride == 0 else ""
        marker = MARKERS[index % len(MARKERS)]
        points = order[by.place[order] == index]
        curves.append(SweepCurve(points, shown, colours[index % len(colours)], marker))
    return curves


def _colours(by: SweptParameter) -> Sequence[Any]:
    """Return distinct colours, or shades for more numbers than there are distinct colours."""
    from matplotlib import colormaps

    if by.numbers is None or len(by.labels) <= len(style.SERIES):
        return style.SERIES
    return list(colormaps[COLOURS](np.linspace(0.0, 0.92, len(by.labels))))


def _draw_curve(panel: Panel, sweep: SweepPicture, curve: SweepCurve, places: Array) -> None:
    x = sweep.parameters[0]
    has_equal_places = len(np.unique(places)) < len(places)  # the points of a list may share x
    is_joined = x.numbers is not None and not x.is_random and not has_equal_places
    has_markers = len(places) <= MAX_MARKED_POINTS or not is_joined
    look = {
        "color": curve.colour,
        "linestyle": "-" if is_joined else "none",
        "linewidth": 1.3,
        "marker": curve.marker if has_markers else "",
        "markersize": 4,
    }
    panel.line(places, sweep.values[curve.points], label=curve.name, **look)


def _draw_equilibria(panel: Panel, every: AllEquilibria, places: Array) -> None:
    """Draw all equilibria, those not stable open, in bold rings those proved for the body itself.

    places: (P,) of the points on the x axis
    """
    proved = np.isfinite(every.radius)
    x = places[every.point]
    looks: tuple[tuple[Flags, str, dict[str, Any]], ...] = (
        (every.stable, "stable equilibria", {}),
        (~every.stable, "unstable equilibria", {"markerfacecolor": "white"}),
    )
    for is_drawn, label, look in looks:
        if is_drawn.any():
            panel.line(x[is_drawn], every.values[is_drawn], **EQUILIBRIUM | look, label=label)
    if proved.any():
        label = every.proved_words
        panel.line(x[proved], every.values[proved], **PROVED_EQUILIBRIUM, label=label)


def _draw_missing(axes: Axes, sweep: SweepPicture, curve: SweepCurve, places: Array) -> None:
    """Mark points without a value, and infinite values, at the lower or the upper edge."""
    look: dict[str, Any] = {"clip_on": False, "transform": axes.get_xaxis_transform()}
    look |= {"color": curve.colour, "linestyle": "none"}
    infinite = sweep.infinite[curve.points]
    missing = np.isnan(sweep.values[curve.points]) & ~infinite
    if missing.any():
        axes.plot(places[missing], 0.0 * places[missing], marker="x", markersize=5, **look)
    if infinite.any():
        edge = np.full_like(places[infinite], float(sweep.infinity == "∞"))
        axes.plot(places[infinite], edge, marker=r"$\infty$", markersize=9, **look)


def _set_ticks(panel: Panel, x: SweptParameter, positions: Array) -> None:
    """Set ticks at texts, or a logarithmic axis for numbers with equal ratios."""
    if x.numbers is None:
        panel.ticks = positions.tolist(), list(x.labels)
        panel.limits[0] = -0.5, len(positions) - 0.5
    elif not x.is_random and has_equal_ratios(positions):
        panel.log = True, False
        some = slice(None, None, -(-len(positions) // MAX_LOG_TICKS))
        panel.ticks = positions[some].tolist(), x.labels[some]


def has_equal_ratios(values: Array) -> bool:
    """Return whether different values are spaced by ratios rather than by differences.

    A logarithmic axis then suits them.
    """
    different = np.unique(values)
    if len(different) <= 2 or different[0] <= 0.0:
        return False
    steps, log_steps = np.diff(different), np.diff(np.log(different))
    linear = float(np.ptp(steps) / np.mean(steps))
    logarithmic = float(np.ptp(log_steps) / np.mean(log_steps))
    return logarithmic < linear


# -- maps ------------------------------------------------------------------------------------------


def map_figure(sweep: SweepPicture, look: style.Look) -> Figure:
    """Return a map of a quantity over two parameters.

    It has a cell for each pair of values, or a mark for each point of random ones. Hatched cells:
    not proved to be the only solution, or a number of equilibria not proved to be all. Outlined
    cells: starts led to solutions of different energies. Crosses: no solution. Blank: the sweep
    does not have the pair. A line parts cells with different numbers of equilibria, as folds lie
    there. On a dashed line ω = λ₁, below which one solution is proved.
    """
    from matplotlib.colors import BoundaryNorm

    sheet, axes = _sheet(sweep, look)
    x, y = sweep.parameters
    values = sweep.axis(sweep.values)
    colours: dict[str, Any] = {"cmap": COLOURS}
    counts = np.zeros(0)
    if sweep.at_least is not None:
        counts = np.unique(values[np.isfinite(values)])
    if len(counts):
        # a colour for each number of equilibria
        middles = 0.5 * (counts[1:] + counts[:-1])
        colours["norm"] = BoundaryNorm([counts[0] - 1.0, *middles, counts[-1] + 1.0], 256)
    if x.is_random and y.is_random and x.numbers is not None and y.numbers is not None:
        places = np.stack([x.numbers[x.place], y.numbers[y.place]])
        image = _draw_dots(axes, sweep, places, values, colours)
    else:
        image = _draw_cells(sheet, axes, sweep, values, colours)
    axes.set(xlabel=style.math(x.title), ylabel=style.math(y.title))
    bar = sheet.bar(axes, image, sweep.axis.label)
    if len(counts):
        bar.set_ticks(counts.tolist(), labels=[f"{count:.0f}" for count in counts])
    sheet.key()
    return sheet.finish()


def _draw_dots(
    axes: Axes, sweep: SweepPicture, places: Array, values: Array, colours: dict[str, Any]
) -> Any:
    """Draw a dot for each point at places (2, P)."""
    has_value = np.isfinite(values)
    x, y = places[:, has_value]
    dots = axes.scatter(x, y, 20, values[has_value], linewidths=0, **colours)
    look: dict[str, Any] = {"color": style.INK, "fillstyle": "none", "markersize": 4.6}
    for is_marked, label, marker in (
        (has_value & sweep.proved, "proved unique", "o"),
        (~has_value & ~sweep.infinite, "no solution", "x"),
        (sweep.infinite, sweep.infinite_value, "s"),
    ):
        if is_marked.any():
            axes.plot(*places[:, is_marked], marker, **look, label=label)
    return dots


@dataclass(frozen=True)
class CellMark:
    """A mark of cells (rows, columns): hatches or an outline; key_look: the style of its key."""

    cells: Flags
    look: dict[str, Any]
    label: str
    key_look: dict[str, Any] = field(default_factory=dict)


def _draw_cells(
    sheet: Sheet, axes: Axes, sweep: SweepPicture, values: Array, colours: dict[str, Any]
) -> Any:
    grid = _grid(sweep)
    has_point = grid >= 0
    cells = np.where(has_point, values[grid], np.nan)
    has_counts = sweep.at_least is not None
    linewidth = 0.0 if has_counts else 0.4
    image = axes.pcolormesh(
        np.ma.masked_invalid(cells), edgecolors="white", linewidth=linewidth, **colours
    )
    _draw_marks(axes, _marks(sweep, grid, has_point, np.isfinite(cells)))
    if has_counts:
        _draw_folds(axes, cells)
    _draw_bounds(axes, sweep, grid)
    _set_cell_ticks(sheet, axes, *sweep.parameters)
    return image


def _grid(sweep: SweepPicture) -> NDArray[np.intp]:
    """Return the index of the point of every cell (rows, columns), or −1.

    Raises DrawError for two points of one cell.
    """
    x, y = sweep.parameters
    grid = np.full((len(y.labels), len(x.labels)), -1, dtype=int)
    for index, (row, column) in enumerate(zip(y.place, x.place, strict=True)):
        if grid[row, column] >= 0:
            where = f"{x.name} = {x.labels[column]} and {y.name} = {y.labels[row]}"
            raise DrawError(
                f"several points of the list have {where}; choose one value of another parameter"
            )
        grid[row, column] = index
    return grid


def _marks(
    sweep: SweepPicture, grid: NDArray[np.intp], has_point: Flags, has_value: Flags
) -> list[CellMark]:
    infinite = sweep.infinite[grid]
    failed, infinite_cells = has_point & ~has_value & ~infinite, has_point & infinite
    marks = [
        CellMark(failed, FAILED, "no solution"),
        CellMark(infinite_cells, INFINITE, sweep.infinite_value, INFINITE_KEY),
    ]
    if sweep.at_least is not None:
        is_open = has_value & sweep.at_least[grid]
        return [*marks, CellMark(is_open, OPEN, "at least so many", OPEN_KEY)]
    is_open = has_value & ~sweep.proved[grid]
    label = "not proved unique" + _of_mesh(sweep, " on the mesh")
    is_several = has_value & sweep.several[grid]
    return [
        *marks,
        CellMark(is_open, OPEN, label, OPEN_KEY),
        CellMark(is_several, SEVERAL, SEVERAL_FOUND),
    ]


def _of_mesh(sweep: SweepPicture, words: str) -> str:
    """Return words where bounds of λ₁ of the body are drawn beside those of the mesh."""
    return words if len(sweep.excess) > 1 else ""


def _draw_marks(axes: Axes, marks: Sequence[CellMark]) -> None:
    from matplotlib.patches import Rectangle

    for mark in marks:
        for row, column in np.argwhere(mark.cells):
            axes.add_patch(Rectangle((column, row), 1.0, 1.0, facecolor="none", **mark.look))
        if mark.cells.any():
            look = {"facecolor": "none"} | mark.look | mark.key_look
            axes.fill([], [], **look, label=mark.label)


def _draw_folds(axes: Axes, cells: Array) -> None:
    """Draw lines between cells with different numbers of equilibria."""
    for counts, is_transposed in ((cells, False), (cells.T, True)):
        right, left = counts[:, 1:], counts[:, :-1]
        is_fold = np.isfinite(right) & np.isfinite(left) & (right != left)
        for row, column in np.argwhere(is_fold):
            across, along = [column + 1] * 2, [row, row + 1]
            line = (along, across) if is_transposed else (across, along)
            axes.plot(*line, **FOLD)


def _draw_bounds(axes: Axes, sweep: SweepPicture, grid: NDArray[np.intp]) -> None:
    """Draw the line ω = λ₁ and its proved bounds where all cells have a value."""
    middles = [np.arange(size) + 0.5 for size in grid.shape[::-1]]
    looks = (
        (EQUAL, "ω = $λ_1$" + _of_mesh(sweep, " of the mesh")),
        (BOUND, "proved bounds of $λ_1$"),
        (BOUND, None),
    )
    for excess_of_point, (look, label) in zip(sweep.excess, looks, strict=False):
        excess = np.where(grid >= 0, excess_of_point[grid], np.nan)
        if min(grid.shape) > 1 and np.isfinite(excess).all() and excess.min() < 0.0 < excess.max():
            contour_look = {f"{key}s": value for key, value in look.items()}
            axes.contour(*middles, excess, levels=[0.0], **contour_look)
            axes.plot([], [], **look, label=label)


def _set_cell_ticks(sheet: Sheet, axes: Axes, x: SweptParameter, y: SweptParameter) -> None:
    """Set as many labels at the middles of the cells as there is room for."""
    longest = max(map(len, x.labels))
    max_columns = max(2, sheet.look.columns(0.6 * sheet.width) // (longest + 2))
    max_rows = max(2, int(0.6 * sheet.height / (1.6 * sheet.em)))
    for axis, values, max_ticks in ((axes.xaxis, x, max_columns), (axes.yaxis, y, max_rows)):
        some = range(0, len(values.labels), -(-len(values.labels) // max_ticks))
        texts = [style.math(values.labels[index]) for index in some]
        axis.set_ticks([index + 0.5 for index in some], texts)
    axes.tick_params(length=0)
