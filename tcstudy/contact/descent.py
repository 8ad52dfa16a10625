"""Descent of many rows at once: the separable Newton method of tcstudy/contact/separable/newton.py in a batch.

Every step is the same for all rows (rest, Newton's equations, clipped path with Armijo's rule, node by node where that
gives no decrease, and on request the step along negative curvature at a saddle); rows that are done drop out. Where
energies can no longer tell two points apart the residual judges, and a row ends with the best point that it has seen.
Left out: the convex model of thin layers; rows that would need it end unsolved and are left to the single solve.

The search for less energy starts descents elsewhere, by the two steps of tcstudy/contact/search.py: descent on the
problems with the laws' proximal hulls b_κ, κ growing from below λ₁, knows all wells of j; a move puts one node on
another piece or up-jump of b while all others relax.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.body import Rows
from tcstudy.contact.hulls import proximal_hulls
from tcstudy.contact.moves import best_places, follow, relaxed_stiffness
from tcstudy.contact.newton import BlockSlopes, directions, leave_saddles, slopes
from tcstudy.contact.search import GROWTH, LOOSE, PROMISES
from tcstudy.contact.separable.descent import descend_nodes
from tcstudy.contact.separable.pieces import factor_free
from tcstudy.laws.pieces import Place

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

TOLERANCE = 1e-12
"""Residual that descent aims at; what is accepted as a solution is up to tcstudy/scene/study.py."""
_COARSE_TOLERANCE = 1e-6
_STEPS, _SADDLES, _HALVINGS, _ARMIJO = 80, 20, 4, 1e-4
"""Steps at most, saddles that are left at most, step lengths 1, ½, ¼ … tried, and the share of the first-order decrease
that a step must realise."""
_ROUNDING = 1e-13
"""Changes of energy below this part of the work of ξ are rounding."""
_POLISHED, _CREPT = 3, 10
"""Steps at rounding level that may follow each other as long as they lower the residual; steps node by node of a row:
one that needs more of them creeps, and is left to the single solve."""
_BELOW = 0.9
"""First κ over λ₁."""


@dataclass(frozen=True, eq=False)
class Descended:
    """Ends of R descents: v (R, m) [m], first-order residual (R,), steps taken (R,)."""

    v: Array
    residual: Array
    steps: Index


def descend(rows: Rows, start: Array, tolerance: float = TOLERANCE, minima: bool = False) -> Descended:
    """Descend from `start` (R, m) until the residual is at most `tolerance`.

    minima: go on from stationary points that fail the second-order test, which costs a factorisation a row
    """
    ended = _descend(rows, start, tolerance, minima)
    open_ = np.flatnonzero(ended.residual <= tolerance) if minima else np.empty(0, dtype=np.intp)
    for _ in range(_SADDLES):
        if not len(open_):
            break
        own, v = rows.take(open_), ended.v[open_]
        xi = own.xi(v)
        s = slopes(own, v, xi)
        v, left = leave_saddles(own, v, xi, s)
        open_ = open_[left]
        again = _descend(rows.take(open_), v[left], tolerance, minima)
        ended.v[open_], ended.residual[open_] = again.v, again.residual
        ended.steps[open_] += again.steps + 1
        open_ = open_[again.residual <= tolerance]
    return ended


def _descend(rows: Rows, start: Array, tolerance: float, careful: bool) -> Descended:
    """Newton's method to a first-order stationary point; careful: as newton.directions has it."""
    count = len(start)
    best, residual, taken = start.copy(), np.full(count, np.inf), np.zeros(count, dtype=np.intp)
    at, v = np.arange(count), start
    polished, crept = np.zeros(count, dtype=np.intp), np.zeros(count, dtype=np.intp)
    for step in range(_STEPS + 1):
        xi = rows.xi(v)
        s = slopes(rows, v, xi)
        better = s.residual < residual[at]
        best[at[better]], residual[at[better]], taken[at] = v[better], s.residual[better], step
        going = (s.residual > tolerance) & (polished < _POLISHED) & ((polished == 0) | better) & (crept < _CREPT)
        if step == _STEPS or not np.any(going):
            break
        if not np.all(going):
            on = np.flatnonzero(going)
            s, rows, at = s.take(on), rows.take(on), at[on]
            v, xi, polished, crept = v[on], xi[on], polished[on], crept[on]
        v, level, node_by_node = _step(rows, v, xi, s, careful)
        polished, crept = np.where(level, polished + 1, 0), crept + node_by_node
    return Descended(best, residual, taken)


def descend_nested(
    rows: Rows,
    start: Array,
    tolerance: float = TOLERANCE,
    minima: bool = False,
    coarse: float = _COARSE_TOLERANCE,
) -> Descended:
    """`descend` from the interpolated solution of the coarser body where that has less energy than `start`, and so on.

    coarse: tolerance on the coarser bodies
    """
    copies = rows.coarse()
    if copies is not None:
        ended = descend_nested(copies, start[:, ::2], max(tolerance, coarse), minima, coarse)
        v = ended.v @ rows.body.P.T
        lower = rows.energy(v) < rows.energy(start)
        start = np.where(lower[:, None], v, start)
    return descend(rows, start, tolerance, minima)


def _step(rows: Rows, v: Array, xi: Array, s: BlockSlopes, careful: bool) -> tuple[Array, Flags, Flags]:
    """(next v, whether the change of energy was within rounding, whether it went node by node) of every row."""
    d = _newton(rows, v, s, careful)
    first_order = np.where(d > 0.0, s.right, s.left)
    stop = rows.laws.next_up_jump(s.at, d)
    new, level, node_by_node = v.copy(), np.zeros(len(v), dtype=bool), np.zeros(len(v), dtype=bool)
    todo = np.arange(len(v))
    for halving in range(_HALVINGS + 1):
        x, direction, end = v[todo], 0.5**halving * d[todo], stop[todo]
        target = x + direction
        reached = np.where(direction > 0.0, target >= end, target <= end) & (direction != 0.0)
        target = np.where(reached, end, target)
        at = Place(s.at.piece[todo], s.at.on[todo])
        change, work = (rows if halving == 0 else rows.take(todo)).energy_change(x, xi[todo], target, at)
        needed = _ARMIJO * np.abs(np.einsum("ri,ri->r", first_order[todo], target - x))
        accepted = (change < 0.0) & (change <= -needed)
        within = ~accepted & (np.abs(change) <= _ROUNDING * work) & (halving == 0)
        taken = accepted | within
        new[todo[taken]], level[todo[within]] = target[taken], True
        todo = todo[~taken]
        if not len(todo):
            break
    for i in todo:
        new[i] = descend_nodes(rows.single(int(i)), v[i], xi[i], s.descent[i])
    node_by_node[todo] = True
    return new, level, node_by_node


def _newton(rows: Rows, v: Array, s: BlockSlopes, careful: bool) -> Array:
    """(R, m) Newton directions; nodes on a jump that would go uphill stay."""
    free = s.free
    stiffness = np.where(free, rows.body.c * rows.laws.slope(v, s.piece), 0.0)
    d = directions(rows.body, free, stiffness, s.descent, careful)
    d[s.jump & (np.where(d > 0.0, s.right, -s.left) > 0.0)] = 0.0
    return d


# -- starts of the search for less energy ----------------------------------------------------------


def hull_starts(rows: Rows, v: Array) -> tuple[Array, Flags]:
    """(starts (R, m), whether the first, convex problem is the original one at its solution, which then is the lowest).

    v: (R, m) where the first problem begins
    """
    lowest = np.zeros(len(v), dtype=bool)
    found, at, kappa, nested = v.copy(), np.arange(len(v)), _BELOW * rows.body.lambda_1, True
    stiffest = float(np.max(np.diagonal(rows.body.A_tilde) / rows.body.c))
    ceiling = np.minimum(rows.laws.omega_by_row, stiffest)
    while len(at):
        laws = rows.laws.in_use()
        hulls, bridges = proximal_hulls(laws, kappa, passes=1)
        smooth = Rows(rows.body, hulls.at(laws.index), rows.loads)
        ended = descend_nested(smooth, v, LOOSE, coarse=LOOSE) if nested else descend(smooth, v, LOOSE, minima=True)
        on_bridge = np.any(bridges.cover(laws.index, ended.v), axis=1)
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
        factor, info = factor_free(body.A_tilde, nodes, added[i, nodes])
        if info == 0:
            stiffness[i] = relaxed_stiffness(body.A_tilde, nodes, np.flatnonzero(~free[i]), factor, added[i, nodes])
            factors[i] = nodes, factor
    known = np.array(sorted(factors), dtype=np.intp)
    c = body.c
    laws = rows.laws.of_nodes(known)
    gain, place = best_places(laws, laws.index, v[known], xi[known] / c, stiffness[known] / c)
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
