"""From an approximate solution to an exact one: identify the active piece of every node, then Newton on the pieces.

A solution of 0 ∈ Ãv − l̃ + ∂Ψ(v) puts every node either on an up-jump of b (v_i = kink, bitwise) or on one smooth
piece k with (Ãv − l̃)_i + c_i b_k(v_i) = 0. Once every node's place is known the rest is a smooth system:
one linear solve for a piecewise-linear law, a few Newton steps for exponential pieces. Whoever ends with it has
an inclusion residual at rounding level, whatever method came before.
Method: active-set identification as in Hintermüller, Ito & Kunisch, SIAM J. Optim. 13 (2002) 865–888, without its
globalisation; a start too far away is returned unchanged.

Digits that double precision does not hold: the same Newton step (A_FF + C b_F′) d_F = (ξ − c b)_F with v as a sum of
two doubles, ξ in twice the precision and the factor in one is iterative refinement (Wilkinson, Rounding Errors in
Algebraic Processes, HMSO 1963). One step turns a residual of 1e-10 into 1e-14 where v keeps its low part, and into
little less than it was where v is rounded to one double.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.extended import extended_residual, friction_defect, two_sum
from tcstudy.contact.factors import factor_free, with_diagonal
from tcstudy.contact.newton import steeper
from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.pieces import BEND, UP
from tcstudy.scene.study import Acceptance

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class ActivePieces:
    """Where every node sits.

    kink:  (m,) address of the up-jump a node rests on, −1 for a free node
    piece: (m,) address of the smooth piece of a free node (for a resting node the piece to its right)
    """

    kink: Index
    piece: Index

    @property
    def key(self) -> bytes:
        """Equal for equal identifications."""
        return np.where(self.kink >= 0, 2 * self.kink + 1, 2 * self.piece).tobytes()


def identify(problem: ContactProblem, v: Array) -> ActivePieces:
    """Active pieces predicted from v, node by node with the other nodes held.

    Candidates are the stationary point on the piece that v_i lies in (one Newton step, if it stays in the piece)
    and the two adjacent up-jumps s with c b⁻ ≤ ξ_i − Ã_ii (s − v_i) ≤ c b⁺, where the node's own energy has a
    minimum. The nearest wins; without any the node stays on its piece, on a kink on the descending side's.
    """
    law, c, xi, diagonal = problem.law, problem.c, problem.xi(v), np.diagonal(problem.A_tilde)
    at = law.locate(v)
    piece = at.toward(c * law.value(v, at.piece + at.on) < xi)
    left, right = law.ends(piece)
    with np.errstate(divide="ignore", invalid="ignore"):
        move = (xi - c * law.value(v, piece)) / (diagonal + c * law.slope(v, piece))
        inside = (left <= v + move) & (v + move <= right)
    nearest, kink = np.where(inside, np.abs(move), np.inf), np.full(len(v), -1, dtype=np.intp)
    here = at.on & (law.kind(at) == UP)
    for s in (np.where(here, v, law.next_up_jump(at, 1.0)), law.next_up_jump(at, -1.0)):
        known = np.isfinite(s)
        if np.any(known):
            s = np.where(known, s, v)
            move = s - v
            candidate, force = law.locate(s).piece, xi - diagonal * move
            low, high = law.limits(candidate)
            closer = known & (c * low <= force) & (force <= c * high) & (np.abs(move) < nearest)
            kink, nearest = np.where(closer, candidate, kink), np.where(closer, np.abs(move), nearest)
    return ActivePieces(kink, np.where(kink >= 0, kink + 1, piece))


def solve_on(problem: ContactProblem, active: ActivePieces, v: Array, newton_steps: int) -> Array | None:
    """The point that satisfies the smooth equations of the identified pieces, by Newton's method from v (m,).

    Returns None if the equations are singular or the iteration leaves the finite numbers. Nothing checks here
    whether the point lies in its pieces; the inclusion residual does.
    """
    resting = active.kink >= 0
    v = np.where(resting, problem.law.kink(active.kink), v) if np.any(resting) else v.copy()
    free = np.flatnonzero(~resting)
    law, c, piece, solver = problem.law.of_nodes(free), problem.c[free], active.piece[free], None
    for _ in range(newton_steps if len(free) else 0):
        # Outside its piece an exponential may overflow; the test on finite numbers catches it.
        with np.errstate(over="ignore", invalid="ignore"):
            defect = c * law.value(v[free], piece) - problem.xi(v)[free]
            if solver is None or not law.piecewise_linear:  # one factor serves a linear law
                solver = linear_solver(problem, free, c * law.slope(v[free], piece))
            if solver is None:
                return None
            correction = solver(defect)
            v[free] -= correction
        if not np.all(np.isfinite(v)):
            return None
        if np.max(np.abs(correction)) <= 4 * np.finfo(float).eps * np.max(np.abs(v)):
            break
    return v


def linear_solver(problem: ContactProblem, free: Index, slope: Array) -> Callable[[Array], Array] | None:
    """x = (A_FF + diag(slope))⁻¹ rhs by Cholesky, by LU where the matrix is indefinite, None where it is singular."""
    factor, info = factor_free(problem.A_tilde, free, slope)
    if info == 0:
        return lambda rhs: scipy.linalg.lapack.dpotrs(factor, rhs, lower=1)[0]
    matrix = with_diagonal(problem.A_tilde, free, slope)
    lu, pivots, info = scipy.linalg.lapack.dgetrf(matrix.T, overwrite_a=1)
    if info != 0:
        return None
    return lambda rhs: scipy.linalg.lapack.dgetrs(lu, pivots, rhs)[0]


_ROUNDS = 10
"""Most identifications; they end when one repeats."""


def finish(problem: ContactProblem, v: Array, newton_steps: int = 8) -> tuple[Array, float]:
    """(point, inclusion residual) after identification and Newton on the pieces; never worse than v.

    newton_steps: Newton steps on one identification (a piecewise-linear law needs one, a second refines it)

    The point is a stationary point near v, not necessarily the one with the least energy.
    """
    best, least = np.array(v, dtype=float), problem.inclusion_residual(v)
    seen: set[bytes] = set()
    current = best
    for _ in range(_ROUNDS):
        active = identify(problem, current)
        if least == 0.0 or active.key in seen:
            break
        seen.add(active.key)
        solved = solve_on(problem, active, current, newton_steps)
        if solved is None:
            break
        current = solved
        residual = problem.inclusion_residual(current)
        if residual < least:
            best, least = current, residual
    return best, least


_TINY = 2.0**-96
"""Rounding of sums in two doubles."""
_STEPS = 8
"""Most steps; two do where the nodes are on the right pieces, the others put nodes on other ones."""


@dataclass(frozen=True)
class Refined:
    """A point and what is known of it in extended precision.

    v, v_low: (m,) displacements v + v_low [m], each |v_low| at most half a unit in the last place of v, 0 on a kink
    xi:       (m,) ξ = l̃ − Ã(v + v_low) [N/m], rounded once
    residual: inclusion residual of v + v_low, with what the rounding of this may hide
    descent:  (m,) as in `Slopes`;  rests: which nodes rest on an up-jump
    """

    v: Array
    v_low: Array
    xi: Array
    residual: float
    descent: Array
    rests: NDArray[np.bool_]


def extended(problem: ContactProblem, v: Array, v_low: Array | None = None) -> Refined:
    """What is known of v + v_low; without v_low of v itself."""
    law, c = problem.law, problem.c
    low = np.zeros(problem.m) if v_low is None else v_low
    xi = extended_residual(problem.l_tilde, problem.A_tilde, v, v_low)
    to_left, to_right = law.piece(v, -1), law.piece(v, +1)
    pieces = np.where(low > 0.0, to_right, to_left), np.where(low < 0.0, to_left, to_right)
    (left, one), (right, other) = (friction_defect(law.numbers(k), c, (v, low), xi) for k in pieces)
    size = np.abs(problem.l_tilde) + np.abs(problem.A_tilde) @ np.abs(v) + c * law.terms(v, pieces[1])
    apart = np.maximum(np.minimum(left, right), -np.maximum(left, right)) + np.maximum(one, other) + _TINY * size
    jump = (low == 0.0) & (law.kind_at(v) != BEND)
    descent = steeper(left, right, jump)
    return Refined(v, low, xi[0], problem.relative(np.maximum(apart, 0.0) / c, xi[0]), descent, jump & (descent == 0.0))


def refined(problem: ContactProblem, v: Array, aim: float) -> Refined:
    """v (m,) itself if its residual in extended precision is at most `aim`, else the best point of refinement.

    A node leaves the up-jump on which its slopes no longer hold it, and stops on the first that it would cross.
    """
    best = current = extended(problem, v)
    for _ in range(_STEPS):
        if best.residual <= aim:
            break
        following = _step(problem, current)
        if following is None:
            break
        current = following
        if current.residual < best.residual:
            best = current
    return best


def _step(problem: ContactProblem, at: Refined) -> Refined | None:
    """One step of refinement; None where the equations of the pieces are singular or lead nowhere."""
    law, c, descent = problem.law, problem.c, at.descent
    free = np.flatnonzero(~at.rests)
    if not len(free):
        return None
    right = (at.v_low > 0.0) | ((at.v_low == 0.0) & (descent <= 0.0))
    piece = np.where(right, law.piece(at.v, +1), law.piece(at.v, -1))[free]
    slope = c[free] * law.of_nodes(free).slope(at.v[free], piece)
    solve = linear_solver(problem, free, slope)
    if solve is None:
        return None
    direction = np.zeros(problem.m)
    direction[free] = -solve(descent[free])
    if not np.all(np.isfinite(direction)):
        return None
    v, v_low = two_sum(at.v, at.v_low + direction)
    stop = law.next_up_jump(law.locate(at.v), direction)
    reached = (direction != 0.0) & np.where(direction > 0.0, v >= stop, v <= stop)
    return extended(problem, np.where(reached, stop, v), np.where(reached, 0.0, v_low))


@dataclass(frozen=True, eq=False)
class Judged:
    """Points v + v_low (R, m) and ξ there; residuals, what rounding allows, whether solutions (R,)."""

    v: Array
    v_low: Array
    xi: Array
    residual: Array
    rounding: Array
    accepted: NDArray[np.bool_]


def judge(
    problem: ContactProblem, v: Array, acceptance: Acceptance, refine: bool = False, finishing: bool = False
) -> Judged:
    """The inclusion test of rows v (R, m), in extended precision where rounding leaves it open.

    refine: what misses the aim is refined, in the end with v as a sum of two doubles
    finishing: and after that looked for on the active pieces
    """
    v, aim, v_low = v.copy(), acceptance.aim, np.zeros(v.shape)
    xi, residual, rounding = problem.xi(v), problem.residual_bound(v), problem.xi_rounding(v)
    for i in np.flatnonzero(~(residual <= aim)):
        one = problem.single(int(i))
        point = refined(one, v[i], aim) if refine else extended(one, v[i])
        if finishing and not point.residual <= aim:
            other = refined(one, finish(one, v[i])[0], aim)
            point = other if other.residual < point.residual else point
        rounding[i] = rounding[i] if np.array_equal(point.v, v[i]) else one.xi_rounding(point.v)
        v[i], v_low[i], xi[i], residual[i] = point.v, point.v_low, point.xi, point.residual
    residual[np.isnan(residual)] = np.inf
    limits = np.array([acceptance.limit(float(x)) for x in rounding])
    return Judged(v, v_low, xi, residual, rounding, residual <= limits)
