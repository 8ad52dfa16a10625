"""Where a single node would go while all others relax, for many nodes with laws in tables.

φ(s) = ½ k (s − v)² − f (s − v) + j(s) − j(v) per length of the node's segment, k its stiffness with the others relaxed
and f = ξ/c, is minimised over all pieces and up-jumps of b other than the piece that v is on, as in
tcstudy/solvers/search.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.online.law_tables import LawTables
from tcstudy.scene.friction import UP

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_NEWTON = 5
"""Newton steps for the stationary point on an exponential piece; a linear one needs one."""
_NOISE = 1e-10
"""Gains below this part of the terms that they are made of are rounding."""


def best_places(tables: LawTables, law: Index, v: Array, force: Array, k: Array) -> tuple[Array, Array]:
    """(φ, s), shape of v: the least φ, 0 where nothing is gained, and where it is taken [Pa·m, m]."""
    gain, place, at = np.zeros(v.shape), v.copy(), tables.locate(law, v)

    def consider(s: Array) -> None:
        known = np.isfinite(s)
        s = np.where(known, s, v)
        move = s - v
        parts = 0.5 * k * move**2, -force * move, tables.integral(v, s, at, tables.locate(law, s))
        phi = parts[0] + parts[1] + parts[2]
        size = np.abs(parts[0]) + np.abs(parts[1]) + np.abs(parts[2])
        better = known & (phi < -_NOISE * size) & (phi < gain)
        gain[better], place[better] = phi[better], s[better]

    for column in range(tables.q.shape[1]):
        if not np.all(np.isinf(tables.lower[:, column])) or column == 0:
            for s in _stationary(tables, law, column, v, force, k):
                consider(s)
    for column in np.flatnonzero(np.any(tables.kinds == UP, axis=0)).tolist():
        s = np.where(tables.kinds[:, column] == UP, tables.kinks[:, column], np.nan)[law]
        consider(np.broadcast_to(s, v.shape))
    return gain, place


def _stationary(tables: LawTables, law: Index, column: int, v: Array, force: Array, k: Array) -> list[Array]:
    """Stationary slips of φ inside one piece of every law, NaN where there is none or v is on that piece.

    Newton begins at the end of the piece that is nearest to v. A law that falls like an exponential is steepest there
    and φ concave; so it begins also where the slip would be without the exponential, beyond the minimum.
    """
    piece = np.broadcast_to((tables.first + column)[law], v.shape)
    low, high = tables.lower.take(piece), tables.upper.take(piece)
    elsewhere = ((v <= low) | (v >= high)) & (low < high)
    starts, steps = [np.clip(v, low, high)], 1
    if np.any(tables.a[:, column]):
        with np.errstate(divide="ignore", invalid="ignore"):
            q = tables.q.take(piece)
            beyond = (force + k * v - tables.b_0.take(piece) + q * tables.s_0.take(piece)) / (q + k)
        starts, steps = [starts[0], np.clip(beyond, low, high)], _NEWTON
    found = []
    for s in starts:
        s = np.where(elsewhere & np.isfinite(s), s, np.nan)
        for _ in range(steps):
            slope = tables.slope(s, piece) + k
            defect = tables.value(s, piece) + k * (s - v) - force
            s = np.where(slope > 0.0, np.clip(s - defect / np.where(slope > 0.0, slope, 1.0), low, high), np.nan)
        found.append(np.where((low < s) & (s < high), s, np.nan))
    return found
