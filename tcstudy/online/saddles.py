"""The second-order test at stationary points of rows, and the step along negative curvature where it fails.

Where A_FF + C b′ is not positive definite on the free nodes, a stationary point is no minimum but for luck, and a
direction d with dᵀ(A_FF + C b′)d ≤ 0 leads down from it: as tcstudy/solvers/newton_path.escape, a row at a time, since
few rows end so.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.online.newton import BlockSlopes, factor_free
from tcstudy.online.problems import Rows

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

_LENGTHS = 1.0, 0.25, 0.05
"""Parts of the way to the next kink that are tried; exponential pieces may need the shorter ones."""
_ROUNDINGS = 64.0
"""Decreases of energy below this many roundings of the work of ξ are none."""


def leave_saddles(rows: Rows, v: Array, xi: Array, s: BlockSlopes) -> tuple[Array, Flags]:
    """(points of less energy where there are such, whether), for stationary points v (R, m)."""
    body, free = rows.body, s.free
    added = np.where(free, body.c * rows.laws.slope(v, s.piece), 0.0)
    new, left = v.copy(), np.zeros(len(v), dtype=bool)
    for i in np.flatnonzero(np.any(added < 0.0, axis=1)):
        nodes = np.flatnonzero(free[i])
        curvature = _negative_curvature(rows, nodes, added[i, nodes])
        if curvature is not None:
            direction = np.zeros(body.m)
            direction[nodes] = curvature
            new[i], left[i] = _lower_along(rows.take(np.array([i])), v[i], xi[i], s.take(np.array([i])), direction)
    return new, left


def _negative_curvature(rows: Rows, free: Index, added: Array) -> Array | None:
    """(n,) d with dᵀ(A_FF + diag `added`)d ≤ 0, None if that matrix is positive definite."""
    A = rows.body.A_tilde
    diagonal = np.diagonal(A)[free]
    direction = np.zeros(len(free))
    if np.any(diagonal + added <= 0.0):
        direction[np.argmin((diagonal + added) / diagonal)] = 1.0
        return direction
    factor, info = factor_free(rows.body, free, added)
    if info == 0:
        return None
    k = info - 1
    direction[k] = 1.0
    direction[:k] = -scipy.linalg.lapack.dpotrs(np.asfortranarray(factor[:k, :k]), A[free[k], free[:k]], lower=1)[0]
    return direction


def _lower_along(row: Rows, v: Array, xi: Array, s: BlockSlopes, direction: Array) -> tuple[Array, bool]:
    """(the point towards the first kink along ±direction, True) if it is lower, else (v, False)."""
    first_order = np.where(direction > 0.0, s.right[0], s.left[0])
    direction = -direction if float(first_order @ direction) > 0.0 else direction
    low, high = row.laws.ends(s.piece)
    end = np.where(direction > 0.0, high[0], low[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(direction != 0.0, (end - v) / direction, np.inf)
    length = float(np.min(reach[reach > 0.0], initial=np.inf))
    if np.isfinite(length):
        for part in _LENGTHS:
            target = v + part * length * direction
            change, work = row.energy_change(v[None], xi[None], target[None], s.at)
            if change[0] < -_ROUNDINGS * np.finfo(float).eps * work[0]:
                return target, True
    return v, False
