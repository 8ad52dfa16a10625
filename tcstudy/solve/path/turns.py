"""How large the turns of the parameter along a path are, and which of them rounding alone makes.

A turn and its neighbour that comes back the least are one small step back: the pair is taken away, smallest first, and
what it stepped back is the size of both (persistence, Edelsbrunner, Letscher & Zomorodian, Discrete Comput. Geom. 28
(2002) 511–533). So a wiggle at a large fold is small, and the fold itself stays large.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.solve.path.record import Path

Array = NDArray[np.float64]
Index = NDArray[np.intp]

ROUNDINGS = 8.0
"""A step back of t is rounding up to this many times what one rounding of every term in the balance does to t."""


def turn_sizes(t: Array, turns: Index) -> tuple[Array, Index]:
    """(size, partner) of every turn: how far t steps back, and the turn with which the step ends (−1: with no other).

    t: (k,) parameter at the vertices;  turns: (f,) vertices at which it turns, growing
    """
    where = [0, *(int(v) for v in turns), len(t) - 1]
    left = list(range(len(where)))
    size, partner = np.zeros(len(where)), np.full(len(where), -1, dtype=np.intp)
    while len(left) > 3:
        steps = np.abs(np.diff(t[[where[i] for i in left]]))
        at = 1 + int(np.argmin(steps[1:-1]))
        i, j = left[at], left[at + 1]
        size[[i, j]] = steps[at]
        partner[i], partner[j] = j - 1, i - 1
        del left[at : at + 2]
    if len(left) == 3:
        size[left[1]] = float(np.min(np.abs(np.diff(t[[where[i] for i in left]]))))
    return size[1:-1], partner[1:-1]


def real_turns(path: Path) -> tuple[Index, Array]:
    """(vertices, sizes) of the turns of t that are more than rounding."""
    turns = path.folds
    size, partner = turn_sizes(path.t, turns)
    real = np.ones(len(turns), dtype=bool)
    small = size <= 1e-6 * float(np.ptp(path.t)) if len(turns) else real  # rounding is never larger than that
    for i in np.flatnonzero(small & (partner >= 0)):
        real[i] = size[i] > _rounding(path, int(turns[i]), int(turns[partner[i]]))
    return turns[real], size[real]


def _rounding(path: Path, one: int, other: int) -> float:
    """What rounding of the balance does to t between two vertices.

    A defect r shifts the t at which a direction w is in balance by wᵀr/(wᵀl̃₁).
    """
    p = path.problem
    way = path.u[other] - path.u[one]
    work = abs(float(way @ p.l_1))
    terms = np.abs(p.load(float(path.t[one]))) + np.abs(p.A_tilde) @ np.abs(path.u[one])
    blur = ROUNDINGS * np.finfo(float).eps * float(np.abs(way) @ terms)
    return blur / work if work > 0.0 else float("inf")
