"""Descent of many problems at once on one body: a globalised separable Newton method for 0 ∈ Ãv −
l̃ + ∂Ψ(v).

Ψ(v) = Σ c_i j(v_i) is separable: what is nonsmooth are the law's own exact one-dimensional pieces.
One step of a row
  1. rests the nodes whose one-sided slopes hold them on an up-jump (left ≤ 0 ≤ right),
  2. solves Newton's equations on the pieces of all others (newton.py),
  3. goes along that direction, each node stopping on the first up-jump it would cross, and accepts
    by Armijo's
     rule on the exact energy difference; if the path gives no decrease within a few halvings,
  4. goes along the step that each node would take by itself, which lowers the energy once it is
    short enough,
  5. after several such or shortened steps goes to the minimum of a convex model (convex_step), by
    interior points:
     under thin layers, and where Ã is dense and badly conditioned, steps 3 and 4 settle few nodes
     at a time.
Every accepted step lowers L̃, so no iterate returns and cycles are impossible. Where energies can
no longer tell two points apart the residual judges, and a row ends with the best point that it has
seen. A point at which no node descends is first-order stationary in every direction, because L̃′(v;
d) is the sum of the nodes' one-sided slopes; one that fails the second-order test is left, on
request, along a direction of negative curvature.

What counts as a solution: ξ_i/c_i ∈ b̂(v_i) *and* left_i ≤ 0 ≤ right_i at every node. On an up-jump
and inside a piece both say the same. On a down-jump (concave kink) the inclusion alone would also
admit local maxima of a node's energy; there one side always descends and the method leaves. So what
it finds is a local minimum (up to a singular matrix), not every solution; solutions of other kinds
are the business of path following.

Literature: Gräser & Kornhuber, J. Comput. Math. 27 (2009) 1–44 (truncated nonsmooth Newton, convex
case); Bertsekas, SIAM J. Control Optim. 20 (1982) 221–246 (projected Newton).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.newton import ROUNDINGS, Slopes, convex_step, directions, leave_saddles, slopes
from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.pieces import Place

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

TOLERANCE = 1e-12
"""Residual that descent aims at; what is accepted as a solution is up to tcstudy/scene/study.py."""
_COARSE_TOLERANCE = 1e-6
"""Of the coarse problem of nested iteration; and from where on Newton's method converges, if
rounding lets it."""
_STEPS, _SADDLES, _HALVINGS, _SHORTEST, _ARMIJO = 300, 20, 4, 40, 1e-4
"""Steps at most, saddles that are left at most, halvings of Newton's step and of the other one, and
the share of the first-order decrease that a step must realise."""
_ROUNDING = 1e-13
"""Changes of energy below this part of the work of ξ are rounding."""
_FLAT, _IDLE = 1e-11, 10
"""Part of the work of ξ by which a step must change the energy, or else lower the residual; steps
in a row that may do neither, as where rounding of Ãv is all that is left (bodies that friction
alone holds, or ones with soft ways). All steps that do not lower the residual count once it is
small, and whole ones in a descent over no barrier."""
_POLISHED = 3
"""Steps at rounding level that may follow each other as long as they lower the residual."""
_PATIENCE, _PUT_OFF = 6, 20
"""Slow steps (shortened, or not Newton's) before the minimum of a convex model is gone to, and more
of them where that was of no use."""
_CREEPS, _LONGER = 20, 4
"""Steps of a descent over no barrier after which it is helped out of flat places, and how much
longer it may take."""


@dataclass(frozen=True, eq=False)
class Descended:
    """Ends of R descents: v (R, m) [m], first-order residual (R,), steps taken (R,)."""

    v: Array
    residual: Array
    steps: Index


def descend(
    rows: ContactProblem,
    start: Array,
    tolerance: float = TOLERANCE,
    minima: bool = False,
    downhill: bool = False,
) -> Descended:
    """Descend from `start` (R, m) until the residual is at most `tolerance`.

    minima:   go on from stationary points that fail the second-order test, which costs a factorisation a row
    downhill: along ways on which the energy falls all along: to the well that is nearest downhill, over no barrier
              (Armijo's rule takes any lower point, also one behind a barrier); for laws of straight
              pieces
    """
    ended = _descend(rows, start, tolerance, minima, downhill)
    open_ = np.flatnonzero(ended.residual <= tolerance) if minima else np.empty(0, dtype=np.intp)
    for _ in range(_SADDLES if len(open_) else 0):
        own, v = rows.take(open_), ended.v[open_]
        xi = own.xi(v)
        v, left = leave_saddles(own, v, xi, slopes(own, v, xi))
        open_ = open_[left]
        if not len(open_):
            break
        again = _descend(rows.take(open_), v[left], tolerance, minima, downhill)
        ended.v[open_], ended.residual[open_] = again.v, again.residual
        ended.steps[open_] += again.steps + 1
        open_ = open_[again.residual <= tolerance]
    return ended


def _descend(
    rows: ContactProblem, start: Array, tolerance: float, careful: bool, downhill: bool
) -> Descended:
    """Newton's method to a first-order stationary point; careful: as newton.directions has it."""
    count = len(start)
    best, residual, taken = start.copy(), np.full(count, np.inf), np.zeros(count, dtype=np.intp)
    at, v = np.arange(count), start
    polished, slow, idle = (np.zeros(count, dtype=np.intp) for _ in range(3))
    most = _LONGER * _STEPS if downhill else _STEPS
    patience = (
        4 * _CREEPS if downhill and rows.law.omega > 0.0 else _IDLE
    )  # no law that does not fall lets steps creep
    for step in range(most + 1):
        xi = rows.xi(v)
        s = slopes(rows, v, xi)
        better = s.residual < residual[at]
        best[at[better]], residual[at[better]], taken[at] = v[better], s.residual[better], step
        idle[better] = 0
        going = (
            (s.residual > tolerance)
            & (polished < _POLISHED)
            & ((polished == 0) | better)
            & (idle < patience)
        )
        if step == most or not np.any(going):
            break
        if not np.all(going):
            on = np.flatnonzero(going)
            s, rows, at = s.take(on), rows.take(on), at[on]
            v, xi, polished, slow, idle = v[on], xi[on], polished[on], slow[on], idle[on]
        new, level, whole, flat = _step(rows, v, xi, s, careful)
        for i in np.flatnonzero((slow >= _PATIENCE) & ~level):
            target = _on_model(rows.single(int(i)), v[i], xi[i])
            new[i], slow[i] = (new[i], -_PUT_OFF - 1) if target is None else (target, -1)
        if downhill:
            for i in np.flatnonzero(~level):
                if step % _CREEPS == _CREEPS - 1:
                    new[i] = _out_of_flat(
                        rows.take(np.array([i])), v[[i]], xi[[i]], s.take(np.array([i]))
                    )
                else:
                    new[i] = _first_rest(rows.single(int(i)), v[i], xi[i], s.descent[i], new[i])
        v, polished, slow = new, np.where(level, polished + 1, 0), np.where(whole, 0, slow + 1)
        idle = np.where(
            flat | (residual[at] <= _COARSE_TOLERANCE) | (whole & downhill), idle + 1, 0
        )
    return Descended(best, residual, taken)


def descend_nested(
    rows: ContactProblem,
    start: Array,
    tolerance: float = TOLERANCE,
    minima: bool = False,
    coarse: float = _COARSE_TOLERANCE,
) -> Descended:
    """`descend` from the interpolated solution of the coarser body where that has less energy than
    `start`, and so on.

    coarse: tolerance on the coarser bodies
    """
    copies = rows.coarse()
    if copies is not None:
        ended = descend_nested(copies, start[:, ::2], max(tolerance, coarse), minima, coarse)
        v = ended.v @ rows.body.P.T
        lower = rows.energy(v) < rows.energy(start)
        start = np.where(lower[:, None], v, start)
    return descend(rows, start, tolerance, minima)


def _step(
    rows: ContactProblem, v: Array, xi: Array, s: Slopes, careful: bool
) -> tuple[Array, Flags, Flags, Flags]:
    """Of every row: next v, whether its residual is rounding, the step was whole, the step changed
    nothing."""
    d, length = _newton(rows, v, s, careful), 1.0
    new, (level, whole, flat), todo = v.copy(), np.zeros((3, len(v)), dtype=bool), np.arange(len(v))
    for halving in range(_HALVINGS + _SHORTEST):
        if halving == _HALVINGS + 1:
            d, length = _relaxed(rows, s.descent), 1.0
        if halving in (0, _HALVINGS + 1):
            first_order, stop = np.where(d > 0.0, s.right, s.left), rows.law.next_up_jump(s.at, d)
        x, direction, end = v[todo], length * d[todo], stop[todo]
        target = x + direction
        reached = np.where(direction > 0.0, target >= end, target <= end) & (direction != 0.0)
        target = np.where(reached, end, target)
        at = Place(s.at.piece[todo], s.at.on[todo])
        change, work = (rows if halving == 0 else rows.take(todo)).energy_change(
            x, target, xi[todo], at
        )
        needed = _ARMIJO * np.abs(np.einsum("ri,ri->r", first_order[todo], target - x))
        accepted = (change < 0.0) & (change <= -needed)
        within = ~accepted & (np.abs(change) <= _ROUNDING * work) & (halving == 0)
        if np.any(within):  # and residuals are no more than rounding of the largest terms of ξ
            terms = (
                np.diagonal(rows.body.A_tilde) * np.abs(x)
                + np.abs(rows.l_tilde[todo])
                + np.abs(xi[todo])
            )
            rounding = (
                np.finfo(float).eps
                * np.max(terms / rows.body.c, axis=1, initial=0.0)
                / rows.scale(xi)[todo]
            )
            within &= s.residual[todo] <= ROUNDINGS * rounding
        taken = accepted | within
        new[todo[taken]], level[todo[within]], whole[todo[taken]] = (
            target[taken],
            True,
            halving == 0,
        )
        flat[todo[taken]] = (np.abs(change) <= _FLAT * work)[taken] & (halving == 0)
        todo, length = todo[~taken], 0.5 * length
        if not len(todo):
            break
    flat[todo] = True
    return new, level, whole, flat


def _relaxed(rows: ContactProblem, descent: Array) -> Array:
    """The step that each node would take by itself: it descends, where Newton's may not, once it is
    short enough."""
    return np.asarray(-descent / np.diagonal(rows.body.A_tilde))


def _newton(rows: ContactProblem, v: Array, s: Slopes, careful: bool) -> Array:
    """(R, m) Newton directions; nodes on a jump that would go uphill stay."""
    free = s.free
    stiffness = np.where(free, rows.body.c * rows.law.slope(v, s.piece), 0.0)
    d = directions(rows.body, free, stiffness, s.descent, careful)
    d[s.jump & (np.where(d > 0.0, s.right, -s.left) > 0.0)] = 0.0
    return d


# -- what a row does by itself where Newton's steps are slow
# ----------------------------------------


def _on_model(problem: ContactProblem, v: Array, xi: Array) -> Array | None:
    """The first of the step lengths 1, ½, ¼ … towards the minimum of the convex model that lowers
    the energy."""
    minimum = convex_step(problem, v)
    if minimum is None:
        return None
    for halving in range(_HALVINGS + 1):
        target = minimum if halving == 0 else v + 0.5**halving * (minimum - v)
        if problem.energy_change(v, target, xi)[0] < 0.0:
            return target
    return None


def _out_of_flat(row: ContactProblem, v: Array, xi: Array, s: Slopes) -> Array:
    """Where one row (1, m) is helped to where its steps creep: along the negative curvature, to the
    end of the piece.

    Without one Newton's own step, however flat the energy is, as far as it falls.
    """
    new, left = leave_saddles(row, v, xi, s)
    if left[0]:
        return np.asarray(new[0])
    return _first_rest(
        row.single(0), v[0], xi[0], s.descent[0], v[0] + _newton(row, v, s, careful=True)[0]
    )


def _first_rest(
    problem: ContactProblem, v: Array, xi: Array, descent: Array | None, target: Array
) -> Array:
    """Where on the straight way to `target` the energy first stops falling (m,).

    On that of `_relaxed` if it rises at once.

    Where it bends down along the way, as beside a fold where Newton's steps on a convex model
    creep, the way goes on to
    the end of the pieces.
    On straight pieces the slope of the energy along the way is a line between the kinks that nodes
    pass; a node that
    stops on a kink is there to the bit.
    """
    law, c, step = problem.law, problem.c, target - v
    piece = np.where(step > 0.0, law.piece(v, +1), law.piece(v, -1))
    if np.any(step) and not step @ (problem.A_tilde @ step + c * law.slope(v, piece) * step) > 0.0:
        end = np.where(step > 0.0, law.upper.take(piece), law.lower.take(piece))
        with np.errstate(over="ignore"):
            reach = np.divide(end - v, step, out=np.full(len(v), np.inf), where=step != 0.0)
        furthest = int(np.argmin(reach))
        if 1.0 < reach[furthest] < np.inf:
            target = v + reach[furthest] * step
            target[furthest] = end[furthest]
            step = target - v
    moving = np.flatnonzero(step)
    tables, index = law.tables, law.node_index(problem.m)
    kinks = tables.kinks[index[moving]]
    shares = (kinks - v[moving, None]) / step[moving, None]
    row, kink = np.nonzero((shares > 0.0) & (shares < 1.0))
    order = np.argsort(shares[row, kink], kind="stable")
    row, kink = row[order], kink[order]
    node, s, at = moving[row], kinks[row, kink], shares[row, kink]
    kink, on = tables.first[index[node]] + kink, (step[node] > 0.0).astype(np.intp)
    weight = c[node] * step[node]
    jump = weight * (tables.value(s, kink + on) - tables.value(s, kink + 1 - on))
    bend = weight * step[node] * (tables.slope(s, kink + on) - tables.slope(s, kink + 1 - on))
    begins = np.append(0.0, at)
    curvature = step @ (problem.A_tilde @ step + c * law.slope(v, piece) * step) + np.append(
        0.0, np.cumsum(bend)
    )
    rise = curvature * np.diff(np.append(begins, 1.0))
    first = step @ (c * law.value(v, piece) - xi) + np.append(0.0, np.cumsum(rise[:-1] + jump))
    k = int(np.argmax(first + rise > 0.0))
    if not first[k] + rise[k] > 0.0:
        return target
    if first[k] < 0.0:
        return np.asarray(v + (begins[k] - first[k] / curvature[k]) * step)
    if k == 0:
        return (
            v
            if descent is None
            else _first_rest(problem, v, xi, None, v + _relaxed(problem, descent))
        )
    found = v + at[k - 1] * step
    found[node[k - 1]] = s[k - 1]
    return np.asarray(found)
