"""Descent of many problems at once on one body: a globalised separable Newton method.

Problem: 0 ∈ ∂L̃(v) = Ãv − l̃ + ∂Ψ(v)

Ψ(v) = Σ c_i j(v_i) is separable: all that is nonsmooth are the law's exact one-dimensional pieces.
One step of a row
  1. lets the nodes stick whose one-sided slopes hold them on an up-jump (left ≤ 0 ≤ right),
  2. solves Newton's equations on the pieces of all others (newton.py),
  3. goes along that direction, where each node stops on the first up-jump that it would cross, and
     accepts by Armijo's rule on the exact energy difference,
  4. if a few halvings give no decrease, goes along the step that each node would take alone, which
     lowers the energy once it is short enough,
  5. after several such or shortened steps goes to the minimum of a convex model (convex_step), by
     interior points: under thin layers, and where Ã is dense and badly conditioned, steps 3 and 4
     settle few nodes at a time.
Every accepted step lowers L̃, so no iterate returns and cycles are impossible. Where energies can
no longer tell two points apart the residual judges. A row ends with the best point that it has
seen. A point at which no node descends is first-order stationary in every direction, because
L̃′(v; d) is the sum of the nodes' one-sided slopes. One that fails the second-order test is left,
on request, along a direction of negative curvature.

A solution has ξ_i/c_i ∈ b̂(v_i) *and* left_i ≤ 0 ≤ right_i at every node. On an up-jump and inside
a piece both say the same. On a down-jump (concave kink) the inclusion alone would also admit local
maxima of a node's energy; there one side always descends and the method leaves. So the method finds
a local minimum (up to a singular matrix), not every solution. Path following finds the others.

Literature: Gräser & Kornhuber, J. Comput. Math. 27 (2009) 1–44 (truncated nonsmooth Newton, convex
case); Bertsekas, SIAM J. Control Optim. 20 (1982) 221–246 (projected Newton).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.newton import ROUNDINGS, Slopes, convex_step, directions, leave_saddles, slopes
from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import Place

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

TOLERANCE = 1e-12
"""Residual that descent aims at; tcstudy/scene/study.py says up to which one is accepted."""
_COARSE_TOLERANCE = 1e-6
"""Residual on coarse bodies; below it Newton's method converges, if rounding lets it."""
_MAX_STEPS = 300
"""Steps of a descent."""
_MAX_SADDLES = 20
"""Saddles that a descent to a minimum leaves."""
_NEWTON_HALVINGS = 4
"""Halvings of Newton's step."""
_ALONE_HALVINGS = 40
"""Lengths that are tried of the step that each node would take alone."""
_ARMIJO_SHARE = 1e-4
"""Share of the first-order decrease that a step must realise."""
_ROUNDING = 1e-13
"""Changes of energy below this part of the work of ξ are rounding."""
_FLAT = 1e-11
"""Part of the work of ξ by which a step must change the energy, or else lower the residual."""
_MAX_IDLE_STEPS = 10
"""Steps in a row that may do neither.

This happens where rounding of Ãv is all that is left: bodies that friction alone holds, or ones
with soft directions. Once the residual is small, all steps that do not lower it count; in a descent
over no barrier, all whole ones.
"""
_MAX_LEVEL_STEPS = 3
"""Steps at rounding level that may follow each other as long as they lower the residual."""
_MAX_SLOW_STEPS = 6
"""Slow steps (shortened, or not Newton's) before the minimum of a convex model is tried."""
_MODEL_PAUSE = 20
"""More of them after a convex model that was of no use."""
_CREEPING_STEPS = 20
"""Steps of a descent over no barrier after which a row is helped out of a flat place."""
_DOWNHILL_FACTOR = 4
"""Factor of _MAX_STEPS in a descent over no barrier."""


@dataclass(frozen=True, eq=False)
class Descended:
    """Ends of R descents.

    v:        (R, m) best points [m]
    residual: (R,) their first-order residuals
    steps:    (R,) steps taken
    """

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

    minima:   go on from stationary points that fail the second-order test, which costs a
              factorisation a row
    downhill: only along ways on which the energy falls throughout: to the well that is nearest
              downhill, over no barrier (Armijo's rule takes any lower point, also one behind a
              barrier); for laws of straight pieces
    """
    start = rows.law.admissible(start)
    ended = _descend(rows, start, tolerance, minima, downhill)
    if not minima:
        return ended
    stationary = np.flatnonzero(ended.residual <= tolerance)
    for _ in range(_MAX_SADDLES):
        if not len(stationary):
            break
        tested = rows.take(stationary)
        v = ended.v[stationary]
        xi = tested.xi(v)
        v, is_saddle = leave_saddles(tested, v, xi, slopes(tested, v, xi))
        saddles = stationary[is_saddle]
        if not len(saddles):
            break
        again = _descend(rows.take(saddles), v[is_saddle], tolerance, minima, downhill)
        ended.v[saddles] = again.v
        ended.residual[saddles] = again.residual
        ended.steps[saddles] += again.steps + 1
        stationary = saddles[again.residual <= tolerance]
    return ended


def _descend(
    rows: ContactProblem, start: Array, tolerance: float, careful: bool, downhill: bool
) -> Descended:
    """Run Newton's method to first-order stationary points; careful: as in newton.directions."""
    count = len(start)
    best = start.copy()
    residual = np.full(count, np.inf)
    steps_taken = np.zeros(count, dtype=np.intp)
    max_steps = _DOWNHILL_FACTOR * _MAX_STEPS if downhill else _MAX_STEPS
    # steps creep only under laws that soften
    creeps = downhill and rows.law.omega > 0.0
    max_idle_steps = 4 * _CREEPING_STEPS if creeps else _MAX_IDLE_STEPS
    v = start
    row = np.arange(count)  # those that still descend
    level_steps, slow_steps, idle_steps = np.zeros((3, count), dtype=np.intp)
    for n in range(max_steps + 1):
        xi = rows.xi(v)
        s = slopes(rows, v, xi)
        is_better = s.residual < residual[row]
        better_row = row[is_better]
        best[better_row] = v[is_better]
        residual[better_row] = s.residual[is_better]
        steps_taken[row] = n
        idle_steps[is_better] = 0
        goes_on = s.residual > tolerance
        goes_on &= (level_steps == 0) | (is_better & (level_steps < _MAX_LEVEL_STEPS))
        goes_on &= idle_steps < max_idle_steps
        if n == max_steps or not np.any(goes_on):
            break
        if not np.all(goes_on):
            on = np.flatnonzero(goes_on)
            rows, row = rows.take(on), row[on]
            v, xi, s = v[on], xi[on], s.take(on)
            level_steps, slow_steps, idle_steps = level_steps[on], slow_steps[on], idle_steps[on]
        step = _step(rows, v, xi, s, careful)
        for i in np.flatnonzero((slow_steps >= _MAX_SLOW_STEPS) & ~step.is_level):
            target = _toward_model(rows.single(int(i)), v[i], xi[i])
            if target is None:
                slow_steps[i] = -_MODEL_PAUSE - 1
            else:
                step.v[i] = target
                slow_steps[i] = -1
        if downhill:
            is_helped = n % _CREEPING_STEPS == _CREEPING_STEPS - 1
            _stay_downhill(rows, v, xi, s, step, is_helped)
        v = step.v
        level_steps = np.where(step.is_level, level_steps + 1, 0)
        slow_steps = np.where(step.is_whole, 0, slow_steps + 1)
        is_idle = step.is_flat | (residual[row] <= _COARSE_TOLERANCE) | (step.is_whole & downhill)
        idle_steps = np.where(is_idle, idle_steps + 1, 0)
    return Descended(best, residual, steps_taken)


def descend_nested(
    rows: ContactProblem,
    start: Array,
    tolerance: float = TOLERANCE,
    minima: bool = False,
    coarse: float = _COARSE_TOLERANCE,
) -> Descended:
    """Descend from the solution of the coarser body, or from `start` (R, m) where that is lower.

    The coarser body is solved likewise; its solution is interpolated.

    coarse: tolerance on the coarser bodies
    """
    copies = rows.coarse()
    if copies is not None:
        coarse_start = start[:, rows.body.coarse_nodes]
        ended = descend_nested(copies, coarse_start, max(tolerance, coarse), minima, coarse)
        v = ended.v @ rows.body.P.T
        is_lower = rows.energy(v) < rows.energy(start)
        start = np.where(is_lower[:, None], v, start)
    return descend(rows, start, tolerance, minima)


@dataclass(frozen=True, eq=False)
class _Step:
    """One step of R rows.

    v:        (R, m) the points that it leads to
    is_level: (R,) the residual is rounding
    is_whole: (R,) it is Newton's step, not shortened
    is_flat:  (R,) the energy hardly changes, or no length lowers it
    """

    v: Array
    is_level: Flags
    is_whole: Flags
    is_flat: Flags


def _step(rows: ContactProblem, v: Array, xi: Array, s: Slopes, careful: bool) -> _Step:
    """Return the first of the shorter and shorter steps of every row that lowers the energy."""
    step = _Step(v.copy(), *np.zeros((3, len(v)), dtype=bool))
    waiting = np.arange(len(v))
    d = _newton(rows, v, s, careful)
    length = 1.0
    for halving in range(_NEWTON_HALVINGS + _ALONE_HALVINGS):
        if halving == _NEWTON_HALVINGS + 1:
            d = _alone(rows, s.descent)
            length = 1.0
        if halving in (0, _NEWTON_HALVINGS + 1):
            slope = np.where(d > 0.0, s.right, s.left)
            slope[d == 0.0] = 0.0  # at a ray it is infinite
            stop = rows.law.next_up_jump(s.at, d)
        tried = rows if halving == 0 else rows.take(waiting)
        x = v[waiting]
        move = length * d[waiting]
        end = stop[waiting]
        target = x + move
        reaches_end = np.where(move > 0.0, target >= end, target <= end) & (move != 0.0)
        target = np.where(reaches_end, end, target)
        at = Place(s.at.piece[waiting], s.at.on[waiting])
        change, work = tried.energy_change(x, target, xi[waiting], at)
        needed = _ARMIJO_SHARE * np.abs(np.einsum("ri,ri->r", slope[waiting], target - x))
        is_accepted = (change < 0.0) & (change <= -needed)
        if halving == 0:
            is_level = ~is_accepted & (np.abs(change) <= _ROUNDING * work)
            if np.any(is_level):
                rounding = _residual_rounding(rows, x, xi)
                is_level &= s.residual <= ROUNDINGS * rounding
            step.is_level[is_level] = True
            is_accepted |= is_level
            step.is_whole[is_accepted] = True
            step.is_flat[is_accepted] = (np.abs(change) <= _FLAT * work)[is_accepted]
        step.v[waiting[is_accepted]] = target[is_accepted]
        waiting = waiting[~is_accepted]
        length *= 0.5
        if not len(waiting):
            break
    step.is_flat[waiting] = True
    return step


def _residual_rounding(rows: ContactProblem, v: Array, xi: Array) -> Array:
    """Return (R,) what rounding of the largest terms of ξ leaves of the residual."""
    stiffness = np.diagonal(rows.body.A_tilde)
    terms = stiffness * np.abs(v) + np.abs(rows.l_tilde) + np.abs(xi)
    largest = np.max(terms / rows.body.c, axis=1, initial=0.0)
    return np.asarray(np.finfo(float).eps * largest / rows.scale(xi))


def _alone(rows: ContactProblem, descent: Array) -> Array:
    """Return the steps that each node would take alone.

    They lead down where Newton's may not, once they are short enough.
    """
    return np.asarray(-descent / np.diagonal(rows.body.A_tilde))


def _newton(rows: ContactProblem, v: Array, s: Slopes, careful: bool) -> Array:
    """Return (R, m) Newton directions; nodes on a jump that would go uphill stay."""
    free = s.free
    stiffness = np.where(free, rows.body.c * rows.law.slope(v, s.piece), 0.0)
    d = directions(rows.body, free, stiffness, s.descent, careful)
    d[s.jump & (np.where(d > 0.0, s.right, -s.left) > 0.0)] = 0.0
    return d


# -- steps of a row alone where Newton's are slow or jump over a barrier ---------------------------


def _toward_model(problem: ContactProblem, v: Array, xi: Array) -> Array | None:
    """Return the first lower point of 1, ½, ¼ … of the way to the minimum of the convex model."""
    minimum = convex_step(problem, v)
    if minimum is None:
        return None
    for halving in range(_NEWTON_HALVINGS + 1):
        target = minimum if halving == 0 else v + 0.5**halving * (minimum - v)
        if problem.energy_change(v, target, xi)[0] < 0.0:
            return target
    return None


def _stay_downhill(
    rows: ContactProblem, v: Array, xi: Array, s: Slopes, step: _Step, is_helped: bool
) -> None:
    """Let every row of `step` end where its energy first stops falling.

    is_helped: the rows creep, so look for a way out of a flat place
    """
    for i in np.flatnonzero(~step.is_level):
        if is_helped:
            index = np.array([i])
            step.v[i] = _out_of_flat(rows.take(index), v[index], xi[index], s.take(index))
        else:
            row = rows.single(int(i))
            step.v[i] = _first_rest(row, v[i], xi[i], s.descent[i], step.v[i])


def _out_of_flat(row: ContactProblem, v: Array, xi: Array, s: Slopes) -> Array:
    """Return where the negative curvature at v (1, m) leads one row: to the end of the piece.

    Without negative curvature Newton's own step, however flat the energy is, as far as it falls.
    """
    target, is_saddle = leave_saddles(row, v, xi, s)
    if is_saddle[0]:
        return np.asarray(target[0])
    target = v + _newton(row, v, s, careful=True)
    return _first_rest(row.single(0), v[0], xi[0], s.descent[0], target[0])


def _first_rest(
    problem: ContactProblem, v: Array, xi: Array, descent: Array | None, target: Array
) -> Array:
    """Return (m,) where on the straight way to `target` the energy first stops falling.

    If it rises at once, the same on the way of `_alone`. Where it bends down along the way, as
    beside a fold where Newton's steps on a convex model creep, the way goes on to the end of the
    pieces. On straight pieces the slope of the energy along the way is a line between the kinks
    that nodes pass. A node that stops on a kink is there to the bit.
    """
    law, c = problem.law, problem.c
    step = target - v
    piece = np.where(step < 0.0, law.piece(v, -1), law.piece(v, +1))
    bend = _bend(problem, v, piece, step)
    if np.any(step) and not bend > 0.0:
        target = _end_of_pieces(law, piece, v, target)
        step = target - v
        bend = _bend(problem, v, piece, step)
    crossings = _crossings(problem, v, step)
    starts = np.append(0.0, crossings.share)
    curvature = bend + np.append(0.0, np.cumsum(crossings.bend))
    rise = curvature * np.diff(np.append(starts, 1.0))
    first_slope = step @ (c * law.value(v, piece) - xi)
    slope = first_slope + np.append(0.0, np.cumsum(rise[:-1] + crossings.jump))
    k = int(np.argmax(slope + rise > 0.0))
    if not slope[k] + rise[k] > 0.0:
        return target
    if slope[k] < 0.0:
        return np.asarray(v + (starts[k] - slope[k] / curvature[k]) * step)
    if k > 0:
        rest = np.asarray(v + crossings.share[k - 1] * step)
        rest[crossings.node[k - 1]] = crossings.kink[k - 1]
        return rest
    if descent is None:
        return v
    return _first_rest(problem, v, xi, None, v + _alone(problem, descent))


def _bend(problem: ContactProblem, v: Array, piece: Index, step: Array) -> float:
    """Return the second derivative of the energy along `step`."""
    stiffness = problem.c * problem.law.slope(v, piece)
    return float(step @ (problem.A_tilde @ step + stiffness * step))


def _end_of_pieces(law: Laws, piece: Index, v: Array, target: Array) -> Array:
    """Return the target, moved on to where the first node leaves its piece if that lies behind."""
    step = target - v
    end = np.where(step > 0.0, law.upper.take(piece), law.lower.take(piece))
    reach = np.full(len(v), np.inf)
    with np.errstate(over="ignore"):
        np.divide(end - v, step, out=reach, where=step != 0.0)
    node = int(np.argmin(reach))
    if 1.0 < reach[node] < np.inf:
        target = v + reach[node] * step
        target[node] = end[node]
    return target


@dataclass(frozen=True, eq=False)
class _Crossings:
    """Kinks that nodes pass on a straight way, (K,) each in the order of the way.

    share: part of the way behind each;  jump, bend: what each adds to the slope of the energy along
    the way and to its second derivative
    """

    node: Index
    kink: Array
    share: Array
    jump: Array
    bend: Array


def _crossings(problem: ContactProblem, v: Array, step: Array) -> _Crossings:
    tables = problem.law.tables
    index = problem.law.node_index(problem.m)
    moving = np.flatnonzero(step)
    kinks = tables.kinks[index[moving]]
    shares = (kinks - v[moving, None]) / step[moving, None]
    row, column = np.nonzero((shares > 0.0) & (shares < 1.0))
    order = np.argsort(shares[row, column], kind="stable")
    row, column = row[order], column[order]
    node = moving[row]
    kink = kinks[row, column]
    weight = problem.c[node] * step[node]
    is_forward = (step[node] > 0.0).astype(np.intp)
    before = tables.first[index[node]] + column + 1 - is_forward
    after = tables.first[index[node]] + column + is_forward
    return _Crossings(
        node,
        kink,
        shares[row, column],
        jump=weight * (tables.value(kink, after) - tables.value(kink, before)),
        bend=weight * step[node] * (tables.slope(kink, after) - tables.slope(kink, before)),
    )
