"""Edges of a body as they are drawn: their pieces in order, in the way of their roles, hatched where they are held."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.reports.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

ROLES: dict[str, dict[str, Any]] = {
    "clamped": {"color": style.INK, "linewidth": 2.2},
    "symmetry": {"color": style.INK, "linewidth": 1.6, "linestyle": "dashdot"},
    "rigid": {"color": style.INK, "linewidth": 3.0},
    "contact": {"color": style.BLUE, "linewidth": 3.0},
    "convection": {"color": style.GREEN, "linewidth": 2.4},
    "traction": {"color": style.SERIES[3], "linewidth": 2.4},
    "free": {"color": style.INK, "linewidth": 1.0},
}
"""How edges of each role are drawn."""
FILLS = ("#f3f1ea", "#cfe3f2", "#f6dcc6", "#d3ead9", "#efd4e4", "#f5ebc0", "#d9d9d9")
"""Of the body and of its regions."""
HATCH = 0.1
"""How far apart the ticks of a held edge stand along it [inch]."""


def chained(segments: Array) -> Array:
    """Straight pieces (k, 2, 2) in the order in which one walks along them, whatever that of the mesh is."""
    starts = {tuple(point): i for i, point in enumerate(segments[:, 0].tolist())}
    after = [starts.get(tuple(point)) for point in segments[:, 1].tolist()]
    order = dict[int, None]()
    for first in [*sorted(set(range(len(segments))) - set(after)), *range(len(segments))]:
        at: int | None = first
        while at is not None and at not in order:
            order[at] = None
            at = after[at]
    return segments[list(order)]


def joined(segments: Array) -> Array:
    """(2, n) x and y of pieces in order as one line, broken where they do not meet."""
    gaps = np.flatnonzero(np.any(segments[1:, 0] != segments[:-1, 1], axis=1))
    return np.insert(segments.reshape(-1, 2), 2 * (gaps + 1), np.nan, axis=0).T


def directions(segments: Array) -> tuple[Array, Array, Array]:
    """Lengths (k,), unit vectors along the pieces and unit normals to their right, which is outside (k, 2)."""
    along = segments[:, 1] - segments[:, 0]
    lengths = np.hypot(*along.T)
    along = along / lengths[:, None]
    return lengths, along, np.column_stack([along[:, 1], -along[:, 0]])


def evenly(segments: Array, count: int) -> tuple[Array, NDArray[np.intp]]:
    """Places (count, 2) evenly spread along pieces in order, and which piece each lies on; the middle if it is one."""
    lengths = directions(segments)[0]
    upto = np.cumsum(lengths)
    along = (np.arange(count) + 0.5) / count * upto[-1]
    of = np.searchsorted(upto[:-1], along)
    share = (along - (upto - lengths)[of]) / lengths[of]
    return segments[of, 0] + share[:, None] * (segments[of, 1] - segments[of, 0]), of


def draw_edge(axes: Axes, segments: Array, how: dict[str, Any], held: bool, inch: float = 1.0) -> Array:
    """Draw pieces in order, hatched outside where they are held; inch: what is one of the axes. Returns the ends of
    the hatches (n, 2)."""
    axes.plot(*joined(segments), solid_capstyle="butt", zorder=3, **how)
    lengths, along, normals = directions(segments)
    count = round(float(lengths.sum()) / (HATCH * inch))
    if not held or not count:
        return np.zeros((0, 2))
    starts, of = evenly(segments, count)
    ends = starts + 0.7 * HATCH * inch * (normals - along)[of]
    axes.plot(*joined(np.stack([starts, ends], axis=1)), color=style.INK, linewidth=0.7, zorder=3)
    return ends
