"""Maps of the contact line's state: of the solution of least energy over the parameter, and along the whole path."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.path_records import ContactState
from tcstudy.report import style
from tcstudy.report.path_folds import seen_folds
from tcstudy.report.path_picture import PathPicture
from tcstudy.report.text import number

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

COLOURS = {
    ContactState.STICK: ("#dedede", "sticks"),
    ContactState.SLIP: ("#7fb8de", "slips"),
    ContactState.SOFTEN: ("#f2c14e", "slips and softens"),
    ContactState.DROP: ("#d55e00", "on a drop of b"),
    ContactState.WEAKENED: ("#b7a3d6", "slips, weakened"),
}
TICKS = 9
"""Values of the parameter that are written below the map along the path."""


def draw_states(over: Axes, along: Axes, picture: PathPicture, divisor: float, label: str) -> None:
    """Both maps.

    over:    over the parameter, the solution of least energy on the path
    along:   along the path, whose length is counted in the plane of the response curve
    divisor: of the parameter;  label: of the parameter with its unit
    """
    data = picture.data
    node = np.argsort(data["arclength"].values, kind="stable")
    ends = np.concatenate([[0.0], np.cumsum(data["c"].values[node])])
    metre, unit = style.axis_unit([ends[-1]], data["arclength"].attrs["units"])
    states = data["state"].values[:, node].astype(float)
    edges, pieces = _least(picture)
    _map(over, edges / divisor, ends / metre, states, pieces)
    over.set_title("State of the contact line: least energy on the path", loc="left")
    position, shown = _positions(picture)
    _map(along, position, ends / metre, states, shown)
    along.set_title("State of the contact line along the path (dashed: folds)", loc="left")
    _ticks(along, picture, position, shown, divisor)
    along.set_xlabel(f"{label}, in the order of the path")
    for axes in (over, along):
        axes.set_ylim(0.0, ends[-1] / metre)
        axes.set_ylabel(style.labelled("arclength", unit))
    _key(along, states)


def _map(axes: Axes, x: Array, y: Array, states: Array, pieces: NDArray[np.intp]) -> None:
    """Columns of states between the edges x; a piece of −1 leaves a gap."""
    from matplotlib.colors import BoundaryNorm, ListedColormap

    colours = ListedColormap([colour for colour, _ in COLOURS.values()])
    values = np.where((pieces >= 0)[:, None], states[pieces], np.nan)
    if len(values):
        norm = BoundaryNorm(np.arange(len(COLOURS) + 1) - 0.5, len(COLOURS))
        axes.pcolormesh(x, y, np.ma.masked_invalid(values.T), cmap=colours, norm=norm, rasterized=True)


def _least(picture: PathPicture) -> tuple[Array, NDArray[np.intp]]:
    """(edges, pieces) of the solution of least energy; −1 where the path has none."""
    data = picture.data
    if not data.sizes.get("interval", 0):
        return np.zeros(1), np.zeros(0, dtype=np.intp)
    edges: list[float] = []
    pieces: list[int] = []
    columns = (data[name].values for name in ("lowest_begin", "lowest_end", "lowest_piece"))
    for begin, end, piece in zip(*columns, strict=True):
        if edges and begin > edges[-1]:
            edges.append(begin)
            pieces.append(-1)
        edges += [end] if edges else [begin, end]
        pieces.append(int(piece))
    return np.array(edges), np.array(pieces, dtype=np.intp)


def _positions(picture: PathPicture) -> tuple[Array, NDArray[np.intp]]:
    """Position of the vertices along the drawn part of the path, and its pieces."""
    shown, t, y = picture.shown()
    wide, tall = float(np.ptp(t)) if len(t) else 1.0, float(np.ptp(y)) if len(y) else 1.0
    step = np.hypot(np.diff(t, axis=1)[:, 0] / (wide or 1.0), np.diff(y, axis=1)[:, 0] / (tall or 1.0))
    return np.concatenate([[0.0], np.cumsum(step)]), shown


def _ticks(axes: Axes, picture: PathPicture, position: Array, shown: NDArray[np.intp], divisor: float) -> None:
    """Values of the parameter below the map, and thin lines at folds that lie apart."""
    if not len(shown):
        return
    low, high = picture.span
    places = np.linspace(0.0, position[-1], TICKS)
    values = []
    for place in places:
        i = min(int(np.searchsorted(position, place, side="right")) - 1, len(shown) - 1)
        part = (place - position[i]) / (position[i + 1] - position[i] or 1.0)
        ends = np.clip(picture.t[shown[i] : shown[i] + 2], low, high)
        values.append(ends[0] + part * (ends[1] - ends[0]))
    axes.set_xticks(places, [number(value / divisor, 3) for value in values])
    axes.set_xlim(0.0, position[-1])
    last = -np.inf
    for vertex in seen_folds(picture.data)[0]:
        at = np.flatnonzero(shown == vertex)
        if len(at) and position[at[0]] - last > 0.01 * position[-1]:
            last = position[at[0]]
            axes.axvline(last, color=style.VERMILLION, linewidth=0.8, linestyle=(0, (4, 2)))


def _key(axes: Axes, states: Array) -> None:
    """What the colours mean, below the lower map."""
    from matplotlib.patches import Patch

    present = [state for state in ContactState if np.any(states == state)]
    patches = [Patch(color=COLOURS[state][0], label=COLOURS[state][1]) for state in present]
    axes.legend(
        handles=patches,
        loc="upper left",
        bbox_to_anchor=(0.0, -0.36),
        ncols=len(patches),
        fontsize=8,
        frameon=False,
        borderaxespad=0.0,
        handlelength=1.2,
    )
