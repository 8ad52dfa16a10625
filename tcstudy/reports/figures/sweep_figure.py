"""Pictures of a whole sweep: curves over one parameter, families by another; a map over two parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.reports.figures import style
from tcstudy.reports.figures.sheet import BESIDE, Sheet
from tcstudy.reports.sweep import DrawnParameter, SweepPicture
from tcstudy.reports.text import axis_unit, pretty

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

MARKS = "osD^vPX"
MOST_NAMED = 10
"""Curves that a legend names; more of them, by a number, are told apart by a colour bar."""
SHORT = {"u_T_max": "max $|u_T|$", "theta_mean": r"mean $\theta$", "lambda_1": r"$\lambda_1$", "omega": r"$\omega$"}
"""Numbers on small sheets whose names are no words."""
COLOURS = "viridis"
"""Evenly light for every kind of colour vision, and in grey."""
GONE: dict[str, Any] = {"hatch": "xxx", "edgecolor": style.PALE, "linewidth": 0.0}
SEVERAL: dict[str, Any] = {"edgecolor": style.VERMILLION, "linewidth": 1.8}
MISSING: dict[str, Any] = {"marker": "x", "linestyle": "none", "markersize": 5, "clip_on": False, "zorder": 5}


def axis_title(one: DrawnParameter) -> str:
    """A swept parameter with its unit, for an axis."""
    return style.labelled(style.symbol(one.name), one.unit)


def facts(picture: SweepPicture) -> list[str]:
    """What is the same at all points drawn, and how many are left out."""
    parts = [
        f"{style.symbol(one.name)} = {style.plain(one.label)}{' ' + pretty(one.unit) if one.unit != '1' else ''}"
        + (" (its first value)" if one.first else "")
        for one in picture.fixed
    ]
    return [",  ".join([*parts, f"level {picture.level}"]), picture.left_out]


def number_labels(picture: SweepPicture, unit: str) -> tuple[str, str]:
    """The number drawn in words, and shorter, with its unit."""
    short = SHORT.get(picture.quantity, picture.quantity.replace("_", " "))
    return style.labelled(style.with_symbols(picture.long_name), unit), style.labelled(short, unit)


def curves_figure(picture: SweepPicture, look: style.Look) -> Figure:
    """One number over the first parameter of the picture, a curve for each value of the second if there is one."""
    x, by = picture.parameters[0], picture.parameters[1] if len(picture.parameters) > 1 else None
    missing = " (×)" if picture.left_out else ""
    told = [fact + missing if fact == picture.left_out else fact for fact in facts(picture)]
    sheet = Sheet(look, picture.title, told)
    (axes,) = sheet.panels.values()
    divisor, unit = axis_unit(picture.values[np.isfinite(picture.values)], picture.units)
    across = x.numbers if x.numbers is not None else np.arange(len(x.labels), dtype=float)
    colours = _colours(by)
    for k in range(len(by.labels) if by else 1):
        own = np.flatnonzero(by.place == k) if by else np.arange(len(picture.values))
        own = own[np.argsort(x.place[own], kind="stable")]
        at, y = across[x.place[own]], picture.values[own] / divisor
        joined = x.numbers is not None and not x.drawn and len(np.unique(at)) == len(at)  # a list may share its x
        mark = MARKS[k % len(MARKS)] if len(at) <= 60 or not joined else ""
        how: dict[str, Any] = {"color": colours[k], "marker": mark, "markersize": 4, "linewidth": 1.3}
        how |= {"linestyle": "-" if joined else "none", "label": style.plain(by.labels[k]) if by else None}
        axes.plot(at, y, **how)
        if len(gone := at[np.isnan(y)]):
            axes.plot(gone, 0.0 * gone, color=colours[k], transform=axes.get_xaxis_transform(), **MISSING)
    axes.set_xlabel(axis_title(x))
    sheet.label(axes, *number_labels(picture, unit))
    _scale(axes, x, across)
    if np.isfinite(picture.values).any() and np.ptp(picture.values[np.isfinite(picture.values)]) == 0.0:
        axes.margins(y=0.5)
    axes.grid(color=style.SHADE, linewidth=0.6)
    axes.set_axisbelow(True)
    if by:
        _families(sheet, axes, by)
    return sheet.finish()


def _colours(by: DrawnParameter | None) -> list[Any]:
    if by is None or not _many(by):
        return [style.SERIES[k % len(style.SERIES)] for k in range(len(by.labels) if by else 1)]
    import matplotlib

    return list(matplotlib.colormaps[COLOURS](np.linspace(0.0, 0.92, len(by.labels))))


def _many(by: DrawnParameter) -> bool:
    return by.numbers is not None and len(by.labels) > len(style.SERIES)


def _scale(axes: Axes, x: DrawnParameter, across: Array) -> None:
    """Names at their places; a logarithmic axis where the values were spaced like that."""
    if x.numbers is None:
        axes.set_xticks(across, [style.plain(text) for text in x.labels])
        axes.set_xlim(-0.5, len(across) - 0.5)
    elif len(across) > 2 and across.min() > 0.0 and not x.drawn:
        spread = [float(np.ptp(step) / np.mean(step)) for step in (np.diff(across), np.diff(np.log(across)))]
        if spread[1] < spread[0]:
            axes.set_xscale("log")
            axes.minorticks_off()
            few = range(0, len(across), -(-len(across) // 9))
            axes.set_xticks(across[few], [x.labels[i] for i in few])


def _families(sheet: Sheet, axes: Axes, by: DrawnParameter) -> None:
    """What tells the curves apart: a key, or a colour bar for many numbers."""
    if _many(by) and len(by.labels) > MOST_NAMED:
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize

        assert by.numbers is not None
        scale = Normalize(float(by.numbers.min()), float(by.numbers.max()))
        sheet.bar(axes, ScalarMappable(scale, COLOURS), axis_title(by))
        return
    handles = [line for line in axes.lines if not str(line.get_label()).startswith("_")]
    sheet.key(handles, "right upper" if sheet.wide >= BESIDE else "lower center", axis_title(by))


def map_figure(picture: SweepPicture, look: style.Look) -> Figure:
    """One number over two parameters, a cell for each pair of values.

    Hatched: not proved to be the only solution, of a number of equilibria not proved to be all. Outlined: starts led to
    solutions of different energies. White with crosses: no solution. Blank: a pair that the sweep does not have. A line
    parts cells with different numbers of equilibria: folds lie there.
    """
    x, y = picture.parameters
    grid = np.full((len(y.labels), len(x.labels)), -1, dtype=int)
    for i, (row, column) in enumerate(zip(y.place, x.place, strict=True)):
        if grid[row, column] >= 0:
            where = f"{x.name} = {x.labels[column]} and {y.name} = {y.labels[row]}"
            raise style.DrawError(f"several points of the list have {where}; choose one value of another parameter")
        grid[row, column] = i
    sheet = Sheet(look, picture.title, facts(picture))
    (axes,) = sheet.panels.values()
    known = picture.values[np.isfinite(picture.values)]
    divisor, unit = axis_unit(known, picture.units)
    values = np.where(grid >= 0, picture.values[grid] / divisor, np.nan)
    counts, how = picture.at_least is not None, dict[str, Any](cmap=COLOURS, edgecolors="white", linewidth=0.4)
    if counts and len(known):
        how |= _steps(known) | {"linewidth": 0.0}
    cells = axes.pcolormesh(np.ma.masked_invalid(values), **how)
    there = grid >= 0
    gone, solved = there & np.isnan(values), there & np.isfinite(values)
    open_ = solved & (picture.at_least[grid] if picture.at_least is not None else ~picture.proved[grid])
    several = solved & picture.several[grid] & (not counts)
    _cells(axes, gone, GONE)
    _cells(axes, open_, {"hatch": "//", "edgecolor": "white", "linewidth": 0.0})
    _cells(axes, several, SEVERAL | {"zorder": 4})
    bar = sheet.bar(axes, cells, *number_labels(picture, unit))
    if counts:
        bar.set_ticks(np.unique(known).tolist(), labels=[f"{n:.0f}" for n in np.unique(known)])
        _fold_lines(axes, values)
    _cell_ticks(sheet, axes, x, y)
    _cell_key(sheet, bool(gone.any()), bool(open_.any()), bool(several.any()), counts)
    return sheet.finish()


def _steps(known: Array) -> dict[str, Any]:
    """A colour for each number of equilibria."""
    from matplotlib import colormaps
    from matplotlib.colors import BoundaryNorm

    numbers = np.unique(known)
    edges = np.concatenate([[numbers[0] - 1.0], 0.5 * (numbers[1:] + numbers[:-1]), [numbers[-1] + 1.0]])
    return {"cmap": colormaps[COLOURS].resampled(len(numbers)), "norm": BoundaryNorm(edges, len(numbers))}


def _fold_lines(axes: Axes, values: Array) -> None:
    """Lines between cells with different numbers of equilibria."""
    both = np.isfinite(values[:, 1:]) & np.isfinite(values[:, :-1])
    for row, column in np.argwhere(both & (values[:, 1:] != values[:, :-1])):
        axes.plot([column + 1, column + 1], [row, row + 1], color=style.VERMILLION, linewidth=1.4)
    both = np.isfinite(values[1:]) & np.isfinite(values[:-1])
    for row, column in np.argwhere(both & (values[1:] != values[:-1])):
        axes.plot([column, column + 1], [row + 1, row + 1], color=style.VERMILLION, linewidth=1.4)


def _cells(axes: Axes, which: NDArray[np.bool_], how: dict[str, Any]) -> None:
    from matplotlib.patches import Rectangle

    for row, column in np.argwhere(which):
        axes.add_patch(Rectangle((column, row), 1.0, 1.0, facecolor="none", **how))


def _cell_ticks(sheet: Sheet, axes: Axes, x: DrawnParameter, y: DrawnParameter) -> None:
    """The labels at the middles of the cells, as many as find room."""
    most_across = max(2, sheet.look.columns(0.6 * sheet.width) // (max(map(len, x.labels)) + 2))
    most_up = max(2, int(0.6 * sheet.height / (1.6 * sheet.em)))
    for axis, one, most in ((axes.xaxis, x, most_across), (axes.yaxis, y, most_up)):
        few = range(0, len(one.labels), -(-len(one.labels) // most))
        axis.set_ticks([i + 0.5 for i in few], [style.plain(one.labels[i]) for i in few])
    axes.set(xlabel=axis_title(x), ylabel=axis_title(y))
    axes.tick_params(length=0)


def _cell_key(sheet: Sheet, gone: bool, unproved: bool, several: bool, counts: bool) -> None:
    """What hatches and outlines mean, where there are some."""
    from matplotlib.patches import Patch

    kinds: tuple[tuple[bool, str, dict[str, Any]], ...] = (
        (
            unproved,
            "at least so many" if counts else "not proved unique",
            {"facecolor": "#31688e", "edgecolor": "white", "hatch": "///"},
        ),
        (several, "several solutions found", {"facecolor": "none"} | SEVERAL),
        (gone, "no solution", {"facecolor": "none"} | GONE),
    )
    if handles := [Patch(label=label, **how) for there, label, how in kinds if there]:
        sheet.key(handles)
