"""From an approximate solution to an exact one, and how a solution moves with the data.

A solution of 0 ∈ Ãv − l̃ + ∂Ψ(v) puts every node either on an up-jump of b (v_i = kink, bitwise) or
on one smooth piece k with (Ãv − l̃)_i + c_i b_k(v_i) = 0. Once the place of every node is known the
rest is a smooth system: one linear solve for a piecewise-linear law, a few steps of Newton's method
for exponential pieces. A method that ends with it has an inclusion residual at rounding level.
Method: active-set identification as in Hintermüller, Ito & Kunisch, SIAM J. Optim. 13 (2002)
865–888, without its globalisation. A start too far away is returned unchanged.

Double precision does not hold all digits. The same Newton step (A_FF + C b_F′) d_F = (ξ − c b)_F
with v as a sum of two doubles, ξ in twice the precision and the factor in one is iterative
refinement (Wilkinson, Rounding Errors in Algebraic Processes, HMSO 1963). One step turns a residual
of 1e-10 into 1e-14 where v keeps its low part. Where v is rounded to one double it gains little.

A contact problem linearised at a solution gives the exact derivatives of this by the data, while
its pieces stay. With F the nodes that slide, H = A_FF + diag(c b′) on their pieces, and the other
nodes R on kinks of b,

    dv_F = H⁻¹ (r_F − A_FR dv_R),   dv_R = ∂(kink)/∂p,   r = ∂l̃/∂p − (∂Ã/∂p) v − c ∂b/∂p.

H is factorised once. A parameter then costs two triangular solves and a product, O(m²).

v is continuous and piecewise smooth in the data. Where a node begins to slide, begins to stick or
passes a kink, the derivatives of the two sides differ. Such nodes are counted as events, and the
derivatives hold for the pieces that are found. Where H is singular, at a fold, there is none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.extended import extended_residual, friction_defect, two_sum
from tcstudy.contact.newton import factor_free, with_diagonal
from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.pieces import UP
from tcstudy.scene.solver_plan import TOLERANCE

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

_TWO_DOUBLE_ROUNDING = 2.0**-96
"""Rounding of sums in two doubles, relative."""
_MAX_STEPS = 20
"""Most Newton steps. Two suffice on the right pieces, the others put nodes on other pieces."""


MAX_RESISTANCE = 1e-5
"""Largest resistance of a loose body to a rigid motion, over the work of its loads."""
MAX_ROUNDING = 1e-3
"""Rounding of ξ over the scale of b beyond which fewer than three digits of the friction hold."""


@dataclass(frozen=True)
class Acceptance:
    """The test of an inclusion residual: one rule for all solvers, paths and certificates.

    tolerance: as a study writes it, then strict; None for the default

    The default is TOLERANCE or what rounding of the problem allows, whichever is larger. Rounding
    of v to doubles, where Ã and l̃ are doubles too, changes ξ by √m ε max_i (|l̃| + |Ã||v|)_i/c_i,
    relative to the scale of b (`ContactProblem.xi_rounding`).
    """

    tolerance: float | None = None

    @property
    def aim(self) -> float:
        """Largest residual of a solution as if there were no rounding."""
        return TOLERANCE if self.tolerance is None else self.tolerance

    def limit(self, rounding: Any) -> Any:
        """Return the largest residual of a solution, or of each of many.

        rounding: what rounding of the problem allows, `problem.xi_rounding(v)`
        """
        if self.tolerance is not None:
            return self.tolerance
        return np.maximum(TOLERANCE, np.minimum(rounding, MAX_ROUNDING))

    def accepts(self, residual: Any, rounding: Any) -> Any:
        """Return whether a point with this residual is a solution; with NaN it is not."""
        return residual <= self.limit(rounding)


@dataclass(frozen=True)
class Point:
    """A point with its friction forces and its residual.

    v, v_low:   (m,) displacements v + v_low [m], each |v_low| at most half a unit in the last place
                of v, 0 on a kink
    xi, xi_low: (m,) ξ = l̃ − Ã(v + v_low) [N/m]; xi is the sum, rounded once
    residual:   inclusion residual of v + v_low; that of an extended point includes what its own
                rounding may hide
    """

    v: Array
    v_low: Array
    xi: Array
    xi_low: Array
    residual: float


def plain(problem: ContactProblem, v: Array) -> Point:
    """Return the point v (m,) in double precision."""
    xi = problem.xi(v)
    zero = np.zeros(problem.m)
    return Point(v, zero, xi, zero, problem.inclusion_residual(v, xi=xi))


def extended(problem: ContactProblem, v: Array, v_low: Array | None = None) -> Point:
    """Return the point v + v_low in twice the precision; v_low is 0 by default."""
    law, c = problem.law, problem.c
    low = np.zeros(problem.m) if v_low is None else v_low
    xi, xi_low = extended_residual(problem.l_tilde, problem.A_tilde, v, v_low)
    left_piece, right_piece = law.piece(v, -1), law.piece(v, +1)
    # a low part puts a node beside its kink
    first_piece = np.where(low > 0.0, right_piece, left_piece)
    last_piece = np.where(low < 0.0, left_piece, right_piece)
    v_sum, xi_sum = (v, low), (xi, xi_low)
    first_numbers = law.numbers(law.inside(first_piece))
    last_numbers = law.numbers(law.inside(last_piece))
    first_defect, first_error = friction_defect(first_numbers, c, v_sum, xi_sum)
    last_defect, last_error = friction_defect(last_numbers, c, v_sum, xi_sum)
    if law.has_rays:
        first_defect = np.where(law.outside.take(first_piece), -np.inf, first_defect)
        last_defect = np.where(law.outside.take(last_piece), -np.inf, last_defect)
    least = np.minimum(first_defect, last_defect)
    largest = np.maximum(first_defect, last_defect)
    forces = np.abs(problem.l_tilde) + np.abs(problem.A_tilde) @ np.abs(v)
    size = forces + c * law.terms(v, last_piece)
    error = np.maximum(first_error, last_error)
    distance = np.maximum(least, -largest) + error + _TWO_DOUBLE_ROUNDING * size
    residual = problem.relative(np.maximum(distance, 0.0) / c, xi)
    return Point(v, low, xi, xi_low, residual)


def identify(problem: ContactProblem, v: Array, xi: Array) -> tuple[Index, Index]:
    """Return (m,) address of the up-jump on which a node sticks, and of the piece of a free node.

    The address of the up-jump is −1 for a free node.

    Each place is predicted from v with the other nodes held. Candidates are the stationary point on
    the piece that v_i lies in (one Newton step, if it stays in the piece) and the two adjacent
    up-jumps s with c b⁻ ≤ ξ_i − Ã_ii (s − v_i) ≤ c b⁺, where the node's own energy has a minimum.
    The nearest candidate wins. Without any the node stays on its piece, on a kink on that of the
    descending side.
    """
    law, c = problem.law, problem.c
    diagonal = np.diagonal(problem.A_tilde)
    place = law.locate(v)
    right_force = c * law.value(v, place.piece + place.on)
    piece = law.inside(place.toward(right_force < xi))
    left_end, right_end = law.ends(piece)
    with np.errstate(divide="ignore", invalid="ignore"):
        step = (xi - c * law.value(v, piece)) / (diagonal + c * law.slope(v, piece))
        is_inside = (left_end <= v + step) & (v + step <= right_end)
    nearest = np.where(is_inside, np.abs(step), np.inf)
    kink = np.full(len(v), -1, dtype=np.intp)

    is_on_up_jump = place.on & (law.kind(place) == UP)
    jump_to_right = np.where(is_on_up_jump, v, law.next_up_jump(place, 1.0))
    jump_to_left = law.next_up_jump(place, -1.0)
    for jump in (jump_to_right, jump_to_left):
        exists = np.isfinite(jump)
        if not np.any(exists):
            continue
        s = np.where(exists, jump, v)
        move = s - v
        candidate = law.locate(s).piece
        force = xi - diagonal * move
        low, high = law.limits(candidate)
        is_held = exists & (c * low <= force) & (force <= c * high)
        is_nearer = is_held & (np.abs(move) < nearest)
        kink = np.where(is_nearer, candidate, kink)
        nearest = np.where(is_nearer, np.abs(move), nearest)
    return kink, piece


def polished(problem: ContactProblem, v: Array, aim: float = 0.0, exact: bool = True) -> Point:
    """Return the best point of Newton's steps on identified pieces from v (m,), which counts too.

    It is a stationary point near v, not necessarily the one with the least energy.

    aim:   residual that is enough
    exact: judge and step in twice the precision
    """
    v = problem.law.admissible(v)
    point = extended(problem, v) if exact else plain(problem, v)
    best = point
    tried = set[bytes]()
    for _ in range(_MAX_STEPS):
        kink, piece = identify(problem, point.v, point.xi)
        places = np.where(kink >= 0, -1 - kink, piece).tobytes()
        is_repeated = places in tried and point is not best
        if best.residual <= aim or is_repeated:
            break
        tried.add(places)
        sum_of_two = _newton_step(problem, point, kink, piece)
        if sum_of_two is None:
            break
        v, v_low = sum_of_two
        point = extended(problem, v, v_low) if exact else plain(problem, v)
        if point.residual < best.residual:
            best = point
    return best


def _newton_step(
    problem: ContactProblem, point: Point, kink: Index, piece: Index
) -> tuple[Array, Array] | None:
    """Return (v, v_low) after a Newton step on the pieces, None if the step is not finite.

    kink, piece: as of `identify`
    """
    law, c = problem.law, problem.c
    sticks = kink >= 0
    free = np.flatnonzero(~sticks)
    slope = law.slope(point.v, piece)
    solve = linear_solver(problem, free, c[free] * slope[free])
    if solve is None:
        return None
    v, xi = (point.v, point.v_low), (point.xi, point.xi_low)
    defect, _ = friction_defect(law.numbers(piece), c, v, xi)
    step = np.where(sticks, law.kink(kink) - point.v, 0.0)
    with np.errstate(over="ignore", invalid="ignore"):
        step[free] = -solve((defect + problem.A_tilde @ step)[free])
        high, low = two_sum(point.v, point.v_low + step)
    if not np.all(np.isfinite(high)):
        return None
    return np.where(sticks, law.kink(kink), high), np.where(sticks, 0.0, low)


def linear_solver(
    problem: ContactProblem, free: Index, slope: Array
) -> Callable[[Array], Array] | None:
    """Return the function x = (A_FF + diag(slope))⁻¹ rhs, None where the matrix is singular.

    It solves by Cholesky, or by LU where the matrix is indefinite.
    """
    factor, info = factor_free(problem.A_tilde, free, slope)
    if info == 0 and not len(free):
        return lambda rhs: rhs
    if info == 0:
        return lambda rhs: scipy.linalg.lapack.dpotrs(factor, rhs, lower=1)[0]
    matrix = with_diagonal(problem.A_tilde, free, slope)
    lu, pivots, info = scipy.linalg.lapack.dgetrf(matrix.T, overwrite_a=1)
    if info != 0:
        return None
    return lambda rhs: scipy.linalg.lapack.dgetrs(lu, pivots, rhs)[0]


@dataclass(frozen=True, eq=False)
class Judged:
    """Points with the verdict of the inclusion test.

    v, v_low: (R, m) displacements v + v_low [m];  xi: (R, m) ξ there [N/m]
    residual: (R,) inclusion residuals;  rounding: (R,) what rounding allows of them
    accepted: (R,) which points are solutions
    """

    v: Array
    v_low: Array
    xi: Array
    residual: Array
    rounding: Array
    accepted: Flags


def judge(
    problem: ContactProblem, v: Array, acceptance: Acceptance, refine: bool = False
) -> Judged:
    """Return the inclusion test of rows v (R, m), in extended precision where rounding matters.

    refine: polish what misses the aim, in the end with v as a sum of two doubles
    """
    v, v_low = v.copy(), np.zeros(v.shape)
    xi = problem.xi(v)
    residual = problem.residual_bound(v)
    rounding = problem.xi_rounding(v)
    aim = acceptance.aim
    for row in np.flatnonzero(~(residual <= aim)).tolist():
        single = problem.single(row)
        point = polished(single, v[row], aim) if refine else extended(single, v[row])
        if not np.array_equal(point.v, v[row]):
            rounding[row] = single.xi_rounding(point.v)
        v[row], v_low[row] = point.v, point.v_low
        xi[row], residual[row] = point.xi, point.residual
    residual[np.isnan(residual)] = np.inf
    limits = np.array([acceptance.limit(float(share)) for share in rounding])
    accepted = (residual <= limits) & is_in_balance(problem, v, rounding)
    return Judged(v, v_low, xi, residual, rounding, accepted)


def is_in_balance(problem: ContactProblem, v: Array, rounding: Array) -> Flags:
    """Return (R,) whether points v (R, m) of a loose body may be solutions; all of other bodies.

    Ã is singular to rounding alone, so that far away it seems to resist a rigid motion r. A
    solution has rᵀÃv = 0, so that contact alone is in balance with the load.
    """
    # of other problems it is not worth a factorisation
    is_known = problem.law.has_rays or "loose" in vars(problem.body)
    if not (is_known and problem.body.loose):
        return np.ones(rounding.shape, dtype=bool)
    has_digits = np.asarray(rounding <= MAX_ROUNDING)
    if not (problem.law.has_rays or "motions" in vars(problem.body)):
        return has_digits
    motions = problem.body.motions
    resistance = np.abs((v @ problem.A_tilde) @ motions)
    work = np.abs(problem.l_tilde) @ np.abs(motions)
    return has_digits & np.all(resistance <= MAX_RESISTANCE * work, axis=-1)


EVENT = 1e-9
"""Distance of an event that counts as none.

It is relative to the largest |v| for a slip and its kink, to the scale of b for a traction and its
bound.
"""
SINGULAR = 1e-13
"""Reciprocal condition of H below which the solution is at a fold."""


@dataclass(frozen=True, eq=False)
class Linearised:
    """A solution v (m,) of a contact problem and the factor of H.

    free:     (f,) nodes that slide;  stuck: (m − f,) nodes on an up-jump
    piece:    (m,) pieces of b, at kinks those on the right
    near:     (m,) nodes within EVENT of an event
    singular: whether H is singular, to SINGULAR
    """

    problem: ContactProblem
    v: Array
    free: Index
    stuck: Index
    piece: Index
    near: Flags
    singular: bool
    _factor: tuple[Array, Index]

    @classmethod
    def at(cls, problem: ContactProblem, v: Array) -> Linearised:
        """Return the problem linearised at its solution v."""
        law = problem.law
        sticks = law.sticking(v)
        free = np.flatnonzero(~sticks)
        piece = np.asarray(law.piece(v), dtype=np.intp)
        H = problem.A_tilde[np.ix_(free, free)]
        norm = float(np.linalg.norm(H, 1)) if len(free) else 0.0
        slope = np.asarray(law.slope(v, piece))
        H[np.diag_indices(len(free))] += problem.c[free] * slope[free]
        factor, is_singular = (H, free), False
        if len(free):
            # LU, since at an unstable solution H is indefinite; the condition judges a zero pivot
            lu, pivots, _ = scipy.linalg.lapack.dgetrf(H)
            reciprocal_condition, _ = scipy.linalg.lapack.dgecon(lu, norm)
            factor, is_singular = (lu, pivots), bool(reciprocal_condition < SINGULAR)
        return cls(
            problem=problem,
            v=v,
            free=free,
            stuck=np.flatnonzero(sticks),
            piece=piece,
            near=_near_events(problem, v, sticks),
            singular=is_singular,
            _factor=factor,
        )

    @property
    def events(self) -> int:
        """Number of nodes near an event."""
        return int(np.count_nonzero(self.near))

    def step(self, r: Array, kinks: Array | None = None) -> Array:
        """Return (m,) dv/dp of a right side r (m,).

        kinks: (m,) ∂(kink)/∂p of the nodes that stick, 0 by default
        """
        free, stuck = self.free, self.stuck
        dv = np.zeros(len(self.v))
        rhs = r[free]
        if kinks is not None and np.any(kinks[stuck]):
            dv[stuck] = kinks[stuck]
            rhs = rhs - self.problem.A_tilde[np.ix_(free, stuck)] @ dv[stuck]
        if len(rhs):
            dv[free] = scipy.linalg.lapack.dgetrs(*self._factor, rhs)[0]
        return dv


def _near_events(problem: ContactProblem, v: Array, sticks: Flags) -> Flags:
    """Return (m,) nodes that slide at a kink, or stick with their traction at a bound."""
    law = problem.law
    if not np.size(law.kinks):
        return np.zeros(len(v), dtype=bool)
    kink = law.nearest_kink(v)
    distance = np.abs(v - law.kink(kink))
    is_at_kink = distance <= EVENT * float(np.max(np.abs(v), initial=0.0))
    traction = problem.xi(v) / problem.c
    low, high = law.limits(kink)
    slack = np.minimum(np.abs(traction - low), np.abs(traction - high))
    is_at_bound = slack <= EVENT * problem.traction_scale
    return np.where(sticks, is_at_bound, is_at_kink)
