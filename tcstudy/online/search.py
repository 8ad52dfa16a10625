"""Starts of the search for less energy, for many rows at once: convexified problems, and moves of single nodes.

The same two steps as tcstudy/solvers/search: descent on the problems with the laws' proximal hulls b_κ, κ growing from
below λ₁, knows all wells of j; a move puts one node on another piece or up-jump of b while all others relax on theirs.
Both give starts; what they are worth is found by descent.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.online.descent import descend, descend_nested
from tcstudy.online.law_hulls import proximal_hulls
from tcstudy.online.newton import block_of, factor_free, slopes, traction_scale
from tcstudy.online.problems import Rows
from tcstudy.online.row_laws import RowLaws
from tcstudy.solvers.search import GROWTH, LOOSE, PROMISES

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

_BELOW = 0.9
"""First κ over λ₁."""


def hull_starts(rows: Rows, v: Array) -> tuple[Array, Flags]:
    """(starts (R, m), whether the first, convex problem is the original one at its solution, which then is the lowest).

    v: (R, m) where the first problem begins. Rows whose laws are moved or stretched by node start at v: hulls of such
    laws would be another table for every node.
    """
    lowest = np.zeros(len(v), dtype=bool)
    if rows.laws.moved is not None or rows.laws.stretched is not None or rows.laws.stronger is not None:
        return v, lowest
    found, at, kappa, nested = v.copy(), np.arange(len(v)), _BELOW * rows.body.lambda_1, True
    stiffest = float(np.max(np.diagonal(rows.body.A_tilde) / rows.body.c))
    ceiling = np.minimum(rows.laws.omega(), stiffest)
    while len(at):
        used, law = np.unique(rows.laws.law, return_inverse=True)
        law = law.reshape(rows.laws.law.shape)
        hulls, bridges = proximal_hulls(rows.laws.tables.take(used), kappa)
        smooth = Rows(rows.body, RowLaws(hulls, law), rows.loads)
        ended = descend_nested(smooth, v, LOOSE, coarse=LOOSE) if nested else descend(smooth, v, LOOSE, minima=True)
        on_bridge = np.any(bridges.cover(law, ended.v), axis=1)
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
    s = slopes(body, rows.laws, traction_scale(body, rows.laws, rows.loads), v, xi)
    free, added = s.free, body.c * rows.laws.slope(v, s.piece)
    stiffness, factors = np.full(v.shape, np.nan), {}
    for i in range(len(v)):
        nodes = np.flatnonzero(free[i])
        factor, info = factor_free(body, nodes, added[i, nodes])
        if info == 0:
            stiffness[i] = _relaxed_stiffness(body.A_tilde, nodes, np.flatnonzero(~free[i]), factor, added[i, nodes])
            factors[i] = nodes, factor
    known = np.array(sorted(factors), dtype=np.intp)
    c = body.c
    gain, place = rows.laws.take(known).best_places(v[known], xi[known] / c, stiffness[known] / c)
    gain = gain * c
    starts, owners, promises = [], [], []
    for i, own_gain, own_place in zip(known, gain, place, strict=True):
        order = np.argsort(own_gain, kind="stable")[: min(PROMISES, np.count_nonzero(own_gain))]
        for promise, node in enumerate(order):
            step = _follow(body.A_tilde, *factors[int(i)], int(node), float(own_place[node] - v[i, node]))
            starts.append(v[i] + step)
            owners.append(i)
            promises.append(promise)
    shape = len(starts), v.shape[1]
    return np.array(starts).reshape(shape), np.array(owners, dtype=np.intp), np.array(promises, dtype=np.intp)


def _relaxed_stiffness(A: Array, free: Index, resting: Index, factor: Array, added: Array) -> Array:
    """(m,) k_i of solvers/search.py: a node, stiff as the free ones follow (factor of A_FF + diag added)."""
    stiffness = np.diagonal(A).copy()
    if len(free):
        inverse = np.tril(scipy.linalg.lapack.dtrtri(factor, lower=1)[0])
        stiffness[free] = 1.0 / np.einsum("ij,ij->j", inverse, inverse) - added
        if len(resting):
            held = scipy.linalg.blas.dtrmm(1.0, inverse, block_of(A, free, resting), lower=1)
            stiffness[resting] -= np.einsum("ij,ij->j", held, held)
    return stiffness


def _follow(A: Array, free: Index, factor: Array, node: int, move: float) -> Array:
    """(m,) step of all nodes if one is moved and the free ones relax."""
    step, place = np.zeros(len(A)), int(np.searchsorted(free, node))
    if place < len(free) and free[place] == node:
        unit = np.zeros(len(free))
        unit[place] = 1.0
        response = scipy.linalg.lapack.dpotrs(factor, unit, lower=1)[0]
        step[free] = response * (move / response[place])
    elif len(free):
        step[free] = -move * scipy.linalg.lapack.dpotrs(factor, A[free, node], lower=1)[0]
    step[node] = move
    return step
