"""Starts of the search for less energy, for many rows at once: convexified problems, and moves of single nodes.

The same two steps as tcstudy/solvers/search.py: descent on the problems with the laws' proximal hulls b_κ, κ growing
from below λ₁, knows all wells of j; a move puts one node on another piece or up-jump of b while all others relax.
Both give starts; what they are worth is found by descent.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.online.descent import descend, descend_nested
from tcstudy.online.newton import factor_free, slopes
from tcstudy.online.problems import Rows
from tcstudy.online.row_laws import RowLaws
from tcstudy.solvers.hulls import proximal_hulls
from tcstudy.solvers.moves import best_places, follow, relaxed_stiffness
from tcstudy.solvers.search import GROWTH, LOOSE, PROMISES

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

_BELOW = 0.9
"""First κ over λ₁."""


def hull_starts(rows: Rows, v: Array) -> tuple[Array, Flags]:
    """(starts (R, m), whether the first, convex problem is the original one at its solution, which then is the lowest).

    v: (R, m) where the first problem begins
    """
    lowest = np.zeros(len(v), dtype=bool)
    found, at, kappa, nested = v.copy(), np.arange(len(v)), _BELOW * rows.body.lambda_1, True
    stiffest = float(np.max(np.diagonal(rows.body.A_tilde) / rows.body.c))
    ceiling = np.minimum(rows.laws.omega(), stiffest)
    while len(at):
        laws = rows.laws.tabulated()
        hulls, bridges = proximal_hulls(laws.tables, kappa, passes=1)
        smooth = Rows(rows.body, RowLaws(hulls, laws.law, laws.moved), rows.loads)
        ended = descend_nested(smooth, v, LOOSE, coarse=LOOSE) if nested else descend(smooth, v, LOOSE, minima=True)
        on_bridge = np.any(bridges.cover(laws.law, laws.own_slip(ended.v)), axis=1)
        found[at] = ended.v
        if nested:
            lowest[at] = ~on_bridge & (ended.residual <= LOOSE)
        kappa, nested = GROWTH * kappa, False
        on = np.flatnonzero(on_bridge & (kappa < ceiling[at]))
        rows, at, v = rows.take(on), at[on], ended.v[on]
    return found, lowest


def move_starts(rows: Rows, v: Array) -> tuple[Array, Index, Index]:
    """(starts (n, m), the rows they belong to (n,), which promise of its row each is (n,)), the best promise first.

    None for rows whose free nodes have no positive definite matrix, or where no move promises less energy.
    """
    body, xi = rows.body, rows.xi(v)
    s = slopes(rows, v, xi)
    free, added = s.free, body.c * rows.laws.slope(v, s.piece)
    stiffness, factors = np.full(v.shape, np.nan), {}
    for i in range(len(v)):
        nodes = np.flatnonzero(free[i])
        factor, info = factor_free(body, nodes, added[i, nodes])
        if info == 0:
            stiffness[i] = relaxed_stiffness(body.A_tilde, nodes, np.flatnonzero(~free[i]), factor, added[i, nodes])
            factors[i] = nodes, factor
    known = np.array(sorted(factors), dtype=np.intp)
    c = body.c
    gain, place = _best_places(rows.laws.take(known), v[known], xi[known] / c, stiffness[known] / c)
    gain = gain * c
    starts, owners, promises = [], [], []
    for i, own_gain, own_place in zip(known, gain, place, strict=True):
        order = np.argsort(own_gain, kind="stable")[: min(PROMISES, np.count_nonzero(own_gain))]
        for promise, node in enumerate(order):
            step = follow(body.A_tilde, *factors[int(i)], int(node), float(own_place[node] - v[i, node]))
            starts.append(v[i] + step)
            owners.append(i)
            promises.append(promise)
    shape = len(starts), v.shape[1]
    return np.array(starts).reshape(shape), np.array(owners, dtype=np.intp), np.array(promises, dtype=np.intp)


def _best_places(laws: RowLaws, v: Array, force: Array, k: Array) -> tuple[Array, Array]:
    """(gain per length, slip), (R, m): where single nodes would go; force = ξ/c [Pa], stiffness k [Pa/m]."""
    sigma = 1.0 if laws.stretched is None else laws.stretched
    own = laws.own_slip(v), laws.own_traction(force), laws.own_traction(k * sigma)
    gain, place = best_places(laws.tables, laws.law, *own)
    return laws.traction(gain, 1), np.where(gain < 0.0, laws.slip(place), v)
