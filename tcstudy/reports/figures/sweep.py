"""Pictures of a whole sweep: curves of one number over one parameter, families by another; a map
over two parameters.

Points without a solution have no number: they are left out, counted, and said with their status.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.reading import by_point, open_results
from tcstudy.data.schema import NOT_ALL, PointStatus
from tcstudy.data.store import BRANCH, SWEPT_LOADS
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
from tcstudy.reports.sentences import least_energy_words, several
from tcstudy.reports.text import axis_unit, counted, headed, labels, named, spelled, study_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Flags = NDArray[np.bool_]

COUNTS = ("solutions", "stable_solutions")
"""Numbers of equilibria."""
MARKS = "osD^vPX"
MOST_NAMED, MOST_MARKS = 10, 60
"""Curves that a legend names, of more some; points that get marks."""
COLOURS = "viridis"
"""Evenly light for every kind of colour vision, and in grey."""
GONE: dict[str, Any] = {"hatch": "xxx", "edgecolor": style.PALE, "linewidth": 0.0}
OPEN: dict[str, Any] = {"hatch": "//", "edgecolor": "white", "linewidth": 0.0}
OPEN_KEY: dict[str, Any] = {"hatch": "///", "facecolor": "#31688e"}
INFINITE: dict[str, Any] = {"hatch": "..", "edgecolor": style.INK, "linewidth": 0.0}
INFINITE_KEY: dict[str, Any] = {"hatch": "...", "facecolor": "white"}
SEVERAL: dict[str, Any] = {"edgecolor": style.VERMILLION, "linewidth": 1.8, "zorder": 4}
SEVERAL_FOUND = "several solutions found"
RING: dict[str, Any] = {"marker": "o", "markersize": 9, "fillstyle": "none", "linestyle": "none",
                        "color": style.VERMILLION}  # fmt: skip
FOLD: dict[str, Any] = {"color": style.VERMILLION, "linewidth": 1.4}
EQUAL: dict[str, Any] = {"color": "black", "linewidth": 1.4, "linestyle": "--"}
BOUND: dict[str, Any] = {"color": "black", "linewidth": 0.8, "linestyle": "-"}
BAND = ("lambda_1_low", "lambda_1_high")


@dataclass(frozen=True)
class Along:
    """A swept parameter that is drawn.

    symbol:  how it is written
    labels:  its different values, ascending if they are numbers
    numbers: the same as numbers in `unit`, None if one of them is a text
    place:   (P,) which of them each point has
    random:  drawn from a distribution, so that neighbours have nothing in common
    """

    name: str
    symbol: str
    labels: tuple[str, ...]
    numbers: Array | None
    unit: str
    place: NDArray[np.intp]
    random: bool = False

    @property
    def title(self) -> str:
        """The parameter with its unit, for an axis."""
        return headed(self.symbol, self.unit)


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
    """

    title: str
    quantity: str
    axis: Scale
    parameters: tuple[Along, ...]
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

    @property
    def words(self) -> str:
        """What it shows, and what the points have in common."""
        over = " and ".join(one.name for one in self.parameters)
        facts = [f"{self.quantity} over {over}", *self.fixed, self.left_out, self.infinite_words]
        return ", ".join(filter(None, [*facts, self.loading]))

    @property
    def infinite_words(self) -> str:
        """Return at how many points the number is infinite; empty if at none."""
        count = int(self.infinite.sum())
        return f"{self.infinite_value} at {counted(count, 'point')}" if count else ""

    @property
    def infinite_value(self) -> str:
        """Return the number with its infinite value: "ω = ∞"."""
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
    """Read the points of a sweep with the labels `point`, along the parameters `along` (see
    `fitting`).

    Raises StoreError if `path` is no complete result file, DrawError for names that it does not
    have.
    """
    with open_results(path) as tree:
        data = tree.to_dataset()
        if not axis_names(data):
            raise DrawError(
                "the file has one point and no swept parameter; "
                "draw the point, without x, y and map"
            )
        names = tuple(parameter(data, given) for given in along)
        if len(set(names)) < len(names):
            raise DrawError(f"{names[0]} is named twice; name two different swept parameters")
        n = level_number(data, level)
        group = tree.children.get(f"level_{n}")
        of_level = () if group is None else {str(name) for name in group.data_vars}
        name = quantity(data, number, of_level)
        keep, fixed = fitting(data, point, names)
        needed = (name, "status", "unique", "start_energy", "complete", "omega", "lambda_1", *BAND)
        at = data[[key for key in dict.fromkeys(needed) if key in data]].isel(level=n).load()
        shown = floors_of(data).cleared(name, by_point(at[name], at), n)[keep]
        labelled, about = (
            labels_by_point(data),
            {"long_name": name, "units": "1"} | data[name].attrs,
        )

    def flat(key: str) -> NDArray[Any]:
        return by_point(at[key], at)[keep] if key in at else np.full(int(keep.sum()), np.nan)

    status, values, unique = flat("status"), shown, flat("unique") == 1
    good = (
        (status == PointStatus.OK)
        & np.isfinite(values)
        & ((values != -1) | (values.dtype.kind == "f"))
    )
    infinite = (status == PointStatus.OK) & np.isinf(values)
    energy, more_than_one = flat("start_energy"), several(flat("start_energy"), unique)
    loads = [name for name in names[:1] if name in str(data.attrs.get(SWEPT_LOADS, "")).split()]
    lowest = data.attrs.get(BRANCH, "") == "lowest"
    left_out = _left_out(status, ~(good | infinite))
    with np.errstate(invalid="ignore"):
        of = ["lambda_1", *(one for one in BAND if one in at)]
        excess = tuple(np.where(good, flat("omega") - flat(one), np.nan) for one in of)
    return SweepPicture(
        title=str(data.attrs["title"]),
        quantity=name,
        axis=scale(
            spelled(str(about["long_name"])), values[good].astype(float), str(about["units"])
        ),
        parameters=tuple(_along(data, one, labelled[one][keep]) for one in names),
        symbols=axis_symbols(data),
        fixed=(*fixed, f"level {n}"),
        left_out=left_out,
        values=np.where(good, values.astype(float), np.nan),
        proved=unique,
        several=more_than_one,
        at_least=flat("complete") == NOT_ALL if name in COUNTS and "complete" in at else None,
        excess=excess,
        infinite=infinite,
        infinity="−∞" if np.any(values[infinite] < 0.0) else "∞",
        loading=least_energy_words(loads, energy, more_than_one) if lowest else "",
    )


def _along(data: Any, name: str, held: NDArray[Any]) -> Along:
    """The different labels among those that the points have."""
    axis, symbol = data[name], axis_symbol(data, name)
    if held.dtype.kind in "OUS":
        texts = list(dict.fromkeys(str(one) for one in axis.values if one in set(held.tolist())))
        place = np.array([texts.index(str(one)) for one in held], dtype=np.intp)
        return Along(name, symbol, tuple(texts), None, "1", place)
    different, place = np.unique(held, return_inverse=True)
    divisor, unit = study_unit(axis.attrs) or axis_unit(different, str(axis.attrs["units"]))
    numbers = different / divisor
    return Along(
        name,
        symbol,
        tuple(labels(numbers.tolist())),
        numbers,
        unit,
        place.ravel(),
        "distribution" in axis.attrs,
    )


def _sheet(sweep: SweepPicture, look: style.Look) -> tuple[Sheet, Axes]:
    same = ",  ".join(style.point_words(one, sweep.symbols) for one in sweep.fixed)
    left_out = sweep.left_out + " (×)" * bool(sweep.left_out)
    lines = [same, left_out, sweep.infinite_words, sweep.loading]
    sheet = Sheet(look, sweep.title, lines)
    return sheet, sheet.panels[""]


def curves_figure(sweep: SweepPicture, look: style.Look) -> Figure:
    """One number over the first parameter of the sweep, a curve for each value of the second if
    there is one."""
    from matplotlib import colormaps

    x, by = sweep.parameters[0], sweep.parameters[1] if len(sweep.parameters) > 1 else None
    (sheet, axes), panel = _sheet(sweep, look), Panel(Scale(x.title), sweep.axis, grid=True)
    across = x.numbers if x.numbers is not None else np.arange(len(x.labels), dtype=float)
    shaded = by is not None and by.numbers is not None and len(by.labels) > len(style.SERIES)
    colours = (
        list(colormaps[COLOURS](np.linspace(0.0, 0.92, len(by.labels))))
        if by and shaded
        else style.SERIES
    )
    every = -(-len(by.labels) // MOST_NAMED) if by else 1
    several_label = SEVERAL_FOUND
    for k in range(len(by.labels) if by else 1):
        own = np.flatnonzero(by.place == k) if by else np.arange(len(sweep.values))
        own = own[np.argsort(x.place[own], kind="stable")]
        at, values = across[x.place[own]], sweep.values[own]
        joined = (
            x.numbers is not None and not x.random and len(np.unique(at)) == len(at)
        )  # a list may share its x
        mark = MARKS[k % len(MARKS)] if len(at) <= MOST_MARKS or not joined else ""
        how = {
            "color": colours[k % len(colours)],
            "linestyle": "-" if joined else "none",
            "linewidth": 1.3,
        }
        name = by.labels[k] if by and k % every == 0 else ""
        panel.line(at, values, marker=mark, markersize=4, label=name, **how)
        ambiguous = sweep.several[own] & np.isfinite(values)
        if ambiguous.any():
            panel.line(at[ambiguous], values[ambiguous], label=several_label, **RING)
            several_label = ""
        look_of: dict[str, Any] = {"clip_on": False, "transform": axes.get_xaxis_transform()}
        look_of |= {"color": how["color"], "linestyle": "none"}
        infinite = sweep.infinite[own]
        if len(missing := at[np.isnan(values) & ~infinite]):
            axes.plot(missing, 0.0 * missing, marker="x", markersize=5, **look_of)
        if len(above := at[infinite]):
            axes.plot(
                above,
                np.full_like(above, float(sweep.infinity == "∞")),
                marker=r"$\infty$",
                markersize=9,
                **look_of,
            )
    if x.numbers is None:
        panel.ticks = across.tolist(), list(x.labels)
        panel.limits[0] = -0.5, len(across) - 0.5
    elif not x.random and has_equal_ratios(across):
        panel.log = True, False
        few = slice(None, None, -(-len(across) // 9))
        panel.ticks = across[few].tolist(), x.labels[few]
    panel.draw(axes)
    if panel.log[0]:
        axes.minorticks_off()
    if by or not several_label:
        sheet.key(
            place="right upper" if sheet.wide >= BESIDE else "lower center",
            title=by.title if by else "",
        )
    return sheet.finish()


def has_equal_ratios(values: Array) -> bool:
    """Return whether different values are spaced by ratios rather than by differences, so that a
    logarithmic axis suits them."""
    across = np.unique(values)
    if len(across) <= 2 or across[0] <= 0.0:
        return False
    linear, logarithmic = (
        float(np.ptp(step) / np.mean(step)) for step in (np.diff(across), np.diff(np.log(across)))
    )
    return logarithmic < linear


def map_figure(sweep: SweepPicture, look: style.Look) -> Figure:
    """One number over two parameters: a cell for each pair of values, of random ones a mark for
    each point.

    Hatched: not proved to be the only solution, of a number of equilibria not proved to be all.
    Outlined: starts led to solutions of different energies. Crosses: no solution. Blank: a pair
    that the sweep does not have. A line parts cells with different numbers of equilibria, as folds
    lie there; on a dashed one ω = λ₁, below which one is proved.
    """
    from matplotlib.colors import BoundaryNorm

    sheet, axes = _sheet(sweep, look)
    values, (x, y) = sweep.axis(sweep.values), sweep.parameters
    known, how = np.isfinite(values), dict[str, Any](cmap=COLOURS)
    counts = np.unique(values[known]) if sweep.at_least is not None else np.zeros(0)
    if len(counts):  # a colour for each number of equilibria
        edges = [counts[0] - 1.0, *(0.5 * (counts[1:] + counts[:-1])), counts[-1] + 1.0]
        how["norm"] = BoundaryNorm(edges, 256)
    if x.random and y.random and x.numbers is not None and y.numbers is not None:
        at = np.stack([x.numbers[x.place], y.numbers[y.place]])
        drawn: Any = axes.scatter(
            at[0, known], at[1, known], 20, values[known], linewidths=0, **how
        )
        for which, name, mark in (
            (known & sweep.proved, "proved unique", "o"),
            (~known & ~sweep.infinite, "no solution", "x"),
            (sweep.infinite, sweep.infinite_value, "s"),
        ):
            if which.any():
                axes.plot(
                    *at[:, which],
                    mark,
                    color=style.INK,
                    fillstyle="none",
                    markersize=4.6,
                    label=name,
                )
    else:
        drawn = _cells(sheet, axes, sweep, values, how)
    axes.set(xlabel=style.math(x.title), ylabel=style.math(y.title))
    bar = sheet.bar(axes, drawn, sweep.axis.label)
    if len(counts):
        bar.set_ticks(counts.tolist(), labels=[f"{n:.0f}" for n in counts])
    sheet.key()
    return sheet.finish()


def _cells(
    sheet: Sheet, axes: Axes, sweep: SweepPicture, values: Array, how: dict[str, Any]
) -> Any:
    from matplotlib.patches import Rectangle

    x, y = sweep.parameters
    grid = np.full((len(y.labels), len(x.labels)), -1, dtype=int)
    for i, (row, column) in enumerate(zip(y.place, x.place, strict=True)):
        if grid[row, column] >= 0:
            where = f"{x.name} = {x.labels[column]} and {y.name} = {y.labels[row]}"
            raise DrawError(
                f"several points of the list have {where}; choose one value of another parameter"
            )
        grid[row, column] = i
    there, shown = grid >= 0, np.where(grid >= 0, values[grid], np.nan)
    known, counts, mesh = (
        there & np.isfinite(shown),
        sweep.at_least is not None,
        len(sweep.excess) > 1,
    )
    open_ = known & (sweep.at_least[grid] if sweep.at_least is not None else ~sweep.proved[grid])
    drawn = axes.pcolormesh(
        np.ma.masked_invalid(shown), edgecolors="white", linewidth=0.0 if counts else 0.4, **how
    )
    kinds: tuple[tuple[Flags, dict[str, Any], dict[str, Any], str], ...] = (
        (there & ~known & ~sweep.infinite[grid], GONE, {}, "no solution"),
        (
            there & sweep.infinite[grid],
            INFINITE,
            INFINITE_KEY,
            sweep.infinite_value,
        ),
        (
            open_,
            OPEN,
            OPEN_KEY,
            "at least so many" if counts else "not proved unique" + " on the mesh" * mesh,
        ),
        (known & sweep.several[grid] & (not counts), SEVERAL, {}, SEVERAL_FOUND),
    )
    for which, look, in_key, name in kinds:  # hatches or outlines of the cells (rows, columns)
        for row, column in np.argwhere(which):
            axes.add_patch(Rectangle((column, row), 1.0, 1.0, facecolor="none", **look))
        if which.any():
            axes.fill([], [], **{"facecolor": "none"} | look | in_key, label=name)
    for cells, turned in (
        ((shown, False), (shown.T, True)) if counts else ()
    ):  # between different numbers of equilibria
        a, b = cells[:, 1:], cells[:, :-1]
        for row, column in np.argwhere(np.isfinite(a) & np.isfinite(b) & (a != b)):
            ends = [column + 1] * 2, [row, row + 1]
            axes.plot(*(ends[::-1] if turned else ends), **FOLD)
    looks = (
        (EQUAL, "ω = $λ_1$" + " of the mesh" * mesh),
        (BOUND, "proved bounds of $λ_1$"),
        (BOUND, None),
    )
    for above, (line, label) in zip(sweep.excess, looks, strict=False):
        excess = np.where(there, above[grid], np.nan)
        if min(grid.shape) > 1 and np.isfinite(excess).all() and excess.min() < 0.0 < excess.max():
            middles = [np.arange(size) + 0.5 for size in grid.shape[::-1]]
            axes.contour(
                *middles, excess, levels=[0.0], **{f"{key}s": value for key, value in line.items()}
            )
            axes.plot([], [], **line, label=label)
    most_across = max(2, sheet.look.columns(0.6 * sheet.width) // (max(map(len, x.labels)) + 2))
    most_up = max(2, int(0.6 * sheet.height / (1.6 * sheet.em)))
    for axis, one, most in ((axes.xaxis, x, most_across), (axes.yaxis, y, most_up)):
        few = range(0, len(one.labels), -(-len(one.labels) // most))
        axis.set_ticks([i + 0.5 for i in few], [style.math(one.labels[i]) for i in few])
    axes.tick_params(length=0)
    return drawn
