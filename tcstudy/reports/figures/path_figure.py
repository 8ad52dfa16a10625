"""The picture of a path: response curve with folds and hysteresis loop, and the state of the contact line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import DrawError
from tcstudy.reports.figures import style
from tcstudy.reports.figures.path_states import RESPONSES, PathPicture, draw_states, read_path_picture
from tcstudy.reports.figures.sheet import Sheet
from tcstudy.reports.terminal.path_summary import seen_folds
from tcstudy.reports.text import axis_unit, counted, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

Array = NDArray[np.float64]

CURVE, MAP = 3.4, 1.25
"""Heights of the response curve and of a map of states [inch]."""

LOW, LOWER = "#c3dff2", "#5aa9dc"
"""The least energy on the path, and proved to be the least of all."""

Mark = dict[str, Any]
STABLE: Mark = {"color": style.INK, "linewidth": 1.3}
UNSTABLE: Mark = {"color": style.VERMILLION, "linewidth": 0.9, "linestyle": (0, (4, 2))}
APART: Mark = {"color": style.BLUE, "linewidth": 1.3}
FOLD: Mark = {"color": style.VERMILLION, "marker": "o", "markersize": 3.2, "markerfacecolor": "white"}
FOLD |= {"markeredgewidth": 0.9, "linestyle": "none"}
ASKED: Mark = {"color": style.BLUE, "marker": "D", "markersize": 5.5, "linestyle": "none"}
"""How the lines and points of the response curve look, there and in its legend."""


def draw_path(path: Path, response: str, look: style.Look) -> tuple[Figure, str]:
    """The picture of a path's file, and what it shows; response: one of RESPONSES, which stands over the parameter."""
    if response not in RESPONSES:
        raise DrawError(f"there is no response {response!r}; use one of {', '.join(RESPONSES)}")
    picture = read_path_picture(path, response)
    return path_figure(picture, look), f"{picture.data.attrs['title']}, path along {picture.name}"


def path_figure(picture: PathPicture, look: style.Look | None = None) -> Figure:
    """The figure of a path; call it within `style.styled()` for its letters."""
    data = picture.data
    rows = (["curve"], ["over"], ["along"])
    sheet = Sheet(look or style.Look(), data.attrs["title"], [_caption(picture)], rows, (CURVE, MAP, MAP))
    curve, over, along = sheet.panels.values()
    divisor, unit = axis_unit(picture.span, picture.units)
    label = style.labelled(symbol(picture.name), unit)
    _draw_curve(curve, picture, divisor)
    sheet.key(_handles(picture), "upper left")
    sheet.key(draw_states(over, along, picture, divisor, label), "lower left")
    over.set_xlim(curve.get_xlim())
    over.set_xlabel(label)
    curve.tick_params(labelbottom=False)
    return sheet.finish()


def symbol(name: str) -> str:
    """The parameter for an axis: its symbol, and the edge that it belongs to."""
    keys = name.split(".")
    text = "load factor" if name == "load" else style.symbol(name)
    return f"{text} of {keys[1].replace('_', ' ')}" if keys[0] == "boundary" else text


def _caption(picture: PathPicture) -> str:
    data = picture.data
    t = picture.t[seen_folds(data)[0]]
    t = t[(t >= picture.span[0]) & (t <= picture.span[1])]
    parts = [
        f"{data.sizes.get('piece', 0)} pieces",
        counted(len(t), "fold"),
        f"{int(data['n_contact'])} contact nodes, level {int(data['level'])}",
        f"worst residual {number(float(data['residual'].max()), 2)}",
    ]
    if "energy_lost" in data:
        lost = style.with_unit(float(data["energy_lost"]), data["energy_lost"].attrs["units"])
        parts.append(f"{lost} lost in one loop")
    if float(data["law_error"]) > 0.0:
        parts.append(f"law approximated to {float(data['law_error']):.1g}")
    return ",  ".join(parts)


def _draw_curve(axes: Axes, picture: PathPicture, divisor: float) -> None:
    data, t = picture.data, picture.t / divisor
    seen = picture.shown()[2].ravel()
    if picture.branches is not None:
        seen = np.concatenate([seen, picture.branches])
    seen = seen if len(seen) else picture.response
    size, unit = axis_unit(seen, picture.response_units)
    y, room = picture.response / size, 0.05 * (float(np.ptp(seen)) or size) / size
    axes.axhline(0.0, color=style.SHADE, linewidth=0.8, zorder=0)
    _lowest(axes, picture, divisor, size)
    stable = data["stable"].values.astype(bool)
    _pieces(axes, t, y, ~stable, zorder=3, **UNSTABLE)
    _pieces(axes, t, y, stable, zorder=4, **STABLE)
    folds, _ = seen_folds(data)
    axes.plot(t[folds], y[folds], zorder=5, **FOLD)
    if picture.loop is not None:
        _loop(axes, picture, divisor, size)
    _others(axes, picture, divisor, size)
    _asked(axes, picture, divisor, size)
    axes.set_ylabel(style.labelled(picture.label, unit))
    axes.set_xlim(*(x / divisor for x in picture.span))
    axes.set_ylim(seen.min() / size - room, seen.max() / size + room)


def _pieces(axes: Axes, t: Array, y: Array, which: NDArray[np.bool_], **line: Any) -> None:
    """The chosen pieces as lines broken where others lie between."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], which.astype(int), [0]])))
    x_all: list[float] = []
    y_all: list[float] = []
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        x_all += [*t[first : last + 1], np.nan]
        y_all += [*y[first : last + 1], np.nan]
    axes.plot(x_all, y_all, **line)


def _others(axes: Axes, picture: PathPicture, divisor: float, size: float) -> None:
    """Branches that the path does not meet."""
    if picture.branches is None:
        return
    data = picture.data
    of, stable = data["branch_of"].values, data["branch_stable"].values.astype(bool)
    for k in np.flatnonzero(data["branch_on_path"].values == 0):
        own = np.flatnonzero(of == k)
        t, y, good = data["branch_parameter"].values[own] / divisor, picture.branches[own] / size, stable[own[:-1]]
        _pieces(axes, t, y, ~good, zorder=3, **APART | {"linestyle": UNSTABLE["linestyle"]})
        _pieces(axes, t, y, good, zorder=4, **APART)


def _lowest(axes: Axes, picture: PathPicture, divisor: float, size: float) -> None:
    """A broad band behind the curve where the solution has the least energy on the path."""
    data = picture.data
    if "lowest_begin" not in data:
        return
    begin, end = data["lowest_begin"].values, data["lowest_end"].values
    piece, proved = data["lowest_piece"].values, data["lowest_certified"].values.astype(bool)
    for kind, colour in ((False, LOW), (True, LOWER)):
        x: list[float] = []
        y: list[float] = []
        for a, b, i in zip(begin[proved == kind], end[proved == kind], piece[proved == kind], strict=True):
            order = np.argsort(picture.t[i : i + 2])
            values = np.interp([a, b], picture.t[i : i + 2][order], picture.response[i : i + 2][order])
            x += [a / divisor, b / divisor, np.nan]
            y += [*(values / size), np.nan]
        axes.plot(x, y, color=colour, linewidth=6.0, solid_capstyle="butt", zorder=1)


def _loop(axes: Axes, picture: PathPicture, divisor: float, size: float) -> None:
    """Arrows: along the stable branches, and where the body falls."""
    assert picture.loop is not None
    data = picture.data
    t, y = data["loop_parameter"].values / divisor, picture.loop / size
    branch, span = data["loop_branch"].values, np.ptp(np.array(picture.span)) / divisor
    for b in np.unique(branch):
        at = np.flatnonzero(branch == b)
        if np.ptp(t[at]) < 0.1 * span:
            continue
        rising = t[at[-1]] > t[at[0]]
        middle = t[at[0]] + (0.6 if rising else 0.4) * (t[at[-1]] - t[at[0]])
        order = np.argsort(t[at], kind="stable")
        step = 0.012 * span * (1.0 if rising else -1.0)
        ends = np.interp([middle - step, middle + step], t[at][order], y[at][order])
        _arrow(axes, (middle - step, float(ends[0])), (middle + step, float(ends[1])), 15.0, 0.0)
    for vertex in data["jump_vertex"].values if "jump_vertex" in data else []:
        _arrow(axes, (t[vertex], y[vertex]), (t[vertex + 1], y[vertex + 1]), 12.0, 1.1)


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], head: float, shaft: float) -> None:
    shape = {"arrowstyle": "-|>", "mutation_scale": head, "color": style.GREEN, "linewidth": shaft}
    axes.annotate("", end, start, arrowprops=shape | {"shrinkA": 0, "shrinkB": 0}, zorder=6)


def _asked(axes: Axes, picture: PathPicture, divisor: float, size: float) -> None:
    """Solutions at the requested values: filled if stable."""
    data = picture.data
    if "solution_parameter" not in data:
        return
    t, y = data["solution_parameter"].values / divisor, picture.asked / size
    stable = data["solution_stable"].values.astype(bool)
    for value in data["at"].values:
        axes.axvline(value / divisor, color=style.PALE, linewidth=0.6, linestyle=":", zorder=0)
    axes.plot(t[stable], y[stable], zorder=7, **ASKED)
    axes.plot(t[~stable], y[~stable], zorder=7, markerfacecolor="white", **ASKED)


def _handles(picture: PathPicture) -> list[Line2D]:
    """The lines and points of the curve for its key."""
    from matplotlib.lines import Line2D

    data = picture.data
    proved = data["lowest_certified"].values.astype(bool) if "lowest_certified" in data else np.zeros(0, dtype=bool)
    entries: list[tuple[bool, Mark, str]] = [
        (True, STABLE, "stable"),
        (not data["stable"].values.all(), UNSTABLE, "unstable"),
        (picture.branches is not None and not data["branch_on_path"].values.all(), APART, "not met by the path"),
        (bool(proved.any()), {"color": LOWER, "linewidth": 6.0}, "global minimum (proved)"),
        (not proved.all(), {"color": LOW, "linewidth": 6.0}, "least energy on the path"),
        (bool(len(seen_folds(data)[0])), FOLD, "fold"),
        (bool(data.sizes.get("solution", 0)), ASKED | {"markersize": 5}, "requested (open: unstable)"),
        (
            picture.loop is not None,
            {"color": style.GREEN, "marker": ">", "markersize": 6},
            "slow loading and unloading",
        ),
    ]
    return [Line2D([], [], label=label, **look) for there, look, label in entries if there]
