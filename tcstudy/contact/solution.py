"""From an approximate solution to an exact one, by Newton on the pieces that its nodes are on; its
derivatives.

A solution of 0 ∈ Ãv − l̃ + ∂Ψ(v) puts every node either on an up-jump of b (v_i = kink, bitwise) or
on one smooth
piece k with (Ãv − l̃)_i + c_i b_k(v_i) = 0. Once every node's place is known the rest is a smooth
system:
one linear solve for a piecewise-linear law, a few Newton steps for exponential pieces. Whoever ends
with it has
an inclusion residual at rounding level, whatever method came before.
Method: active-set identification as in Hintermüller, Ito & Kunisch, SIAM J. Optim. 13 (2002)
865–888, without its
globalisation; a start too far away is returned unchanged.

Digits that double precision does not hold: the same Newton step (A_FF + C b_F′) d_F = (ξ − c b)_F
with v as a sum of two doubles, ξ in twice the precision and the factor in one is iterative
refinement (Wilkinson, Rounding Errors in Algebraic Processes, HMSO 1963). One step turns a residual
of 1e-10 into 1e-14 where v keeps its low part, and into little less than it was where v is rounded
to one double.

A contact problem linearised at a solution says how this moves with the data, exactly, while its
pieces stay. With F the nodes that slide, H = A_FF + diag(c b′) on their pieces and the others
resting on kinks of b,

    dv_F = H⁻¹ (r_F − A_FR dv_R),   dv_R = ∂(kink)/∂p,   r = ∂l̃/∂p − (∂Ã/∂p) v − c ∂b/∂p.

H is factorised once; a parameter then costs two triangular solves and a product, O(m²).

v is continuous and piecewise smooth in the data. Where a node begins to slide, comes to rest or
passes a kink, the derivatives of the two sides differ: such nodes are counted as events, and what
is said is true of the pieces found. Where H is singular, at a fold, there is no derivative.
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

_TINY = 2.0**-96
"""Rounding of sums in two doubles."""
_STEPS = 20
"""Most steps; two do where the nodes are on the right pieces, the others put nodes on other
ones."""


MAX_ROUNDING = 1e-3
"""Rounding of ξ over the scale of b beyond which fewer than three digits of the friction are
known."""


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
        """Return whether a point with this residual is a solution; one with NaN is none."""
        return residual <= self.limit(rounding)


@dataclass(frozen=True)
class Point:
    """A point and what is known of it.

    v, v_low:   (m,) displacements v + v_low [m], each |v_low| at most half a unit in the last place of v, 0 on a kink
    xi, xi_low: (m,) ξ = l̃ − Ã(v + v_low) [N/m]; xi is the sum, rounded once
    residual:   inclusion residual of v + v_low; of an extended one with what the rounding of this may hide
    """

    v: Array
    v_low: Array
    xi: Array
    xi_low: Array
    residual: float


def plain(problem: ContactProblem, v: Array) -> Point:
    """v (m,) in double precision."""
    xi, zero = problem.xi(v), np.zeros(problem.m)
    return Point(v, zero, xi, zero, problem.inclusion_residual(v, xi=xi))


def extended(problem: ContactProblem, v: Array, v_low: Array | None = None) -> Point:
    """What is known of v + v_low in twice the precision; without v_low of v itself."""
    law, c = problem.law, problem.c
    low = np.zeros(problem.m) if v_low is None else v_low
    xi = extended_residual(problem.l_tilde, problem.A_tilde, v, v_low)
    to_left, to_right = law.piece(v, -1), law.piece(v, +1)
    pieces = np.where(low > 0.0, to_right, to_left), np.where(low < 0.0, to_left, to_right)
    (left, one), (right, other) = (friction_defect(law.numbers(k), c, (v, low), xi) for k in pieces)
    size = (
        np.abs(problem.l_tilde) + np.abs(problem.A_tilde) @ np.abs(v) + c * law.terms(v, pieces[1])
    )
    apart = (
        np.maximum(np.minimum(left, right), -np.maximum(left, right))
        + np.maximum(one, other)
        + _TINY * size
    )
    return Point(v, low, *xi, problem.relative(np.maximum(apart, 0.0) / c, xi[0]))


def identify(problem: ContactProblem, v: Array, xi: Array) -> tuple[Index, Index]:
    """(m,) address of the up-jump on which a node rests, −1 for a free one; of the piece of a free
    node.

    Predicted from v node by node with the others held. Candidates are the stationary point on the
    piece that v_i lies in (one Newton step, if it stays in the piece) and the two adjacent up-jumps
    s with c b⁻ ≤ ξ_i − Ã_ii (s − v_i) ≤ c b⁺, where the node's own energy has a minimum. The
    nearest wins; without any the node stays on its piece, on a kink on the descending side's.
    """
    law, c, diagonal = problem.law, problem.c, np.diagonal(problem.A_tilde)
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
            kink, nearest = (
                np.where(closer, candidate, kink),
                np.where(closer, np.abs(move), nearest),
            )
    return kink, piece


def polished(problem: ContactProblem, v: Array, aim: float = 0.0, exact: bool = True) -> Point:
    """The best point of Newton's steps on identified pieces from v (m,), v itself among them.

    A stationary point near v, not necessarily the one with the least energy.

    aim:   residual that is enough
    exact: judge and step in twice the precision
    """
    best = at = extended(problem, v) if exact else plain(problem, v)
    seen, law, c = set[bytes](), problem.law, problem.c
    for _ in range(_STEPS):
        kink, piece = identify(problem, at.v, at.xi)
        key = np.where(kink >= 0, -1 - kink, piece).tobytes()
        if best.residual <= aim or (key in seen and at is not best):
            break
        seen.add(key)
        rests, free = kink >= 0, np.flatnonzero(kink < 0)
        solve = linear_solver(problem, free, c[free] * law.slope(at.v, piece)[free])
        if solve is None:
            break
        step = np.where(rests, law.kink(kink) - at.v, 0.0)
        defect, _ = friction_defect(law.numbers(piece), c, (at.v, at.v_low), (at.xi, at.xi_low))
        with np.errstate(over="ignore", invalid="ignore"):
            step[free] = -solve((defect + problem.A_tilde @ step)[free])
            v, v_low = two_sum(at.v, at.v_low + step)
        if not np.all(np.isfinite(v)):
            break
        v, v_low = np.where(rests, law.kink(kink), v), np.where(rests, 0.0, v_low)
        at = extended(problem, v, v_low) if exact else plain(problem, v)
        best = at if at.residual < best.residual else best
    return best


def linear_solver(
    problem: ContactProblem, free: Index, slope: Array
) -> Callable[[Array], Array] | None:
    """x = (A_FF + diag(slope))⁻¹ rhs by Cholesky, by LU where the matrix is indefinite, None where
    it is singular."""
    factor, info = factor_free(problem.A_tilde, free, slope)
    if info == 0:
        return lambda rhs: scipy.linalg.lapack.dpotrs(factor, rhs, lower=1)[0] if len(free) else rhs
    lu, pivots, info = scipy.linalg.lapack.dgetrf(
        with_diagonal(problem.A_tilde, free, slope).T, overwrite_a=1
    )
    return (lambda rhs: scipy.linalg.lapack.dgetrs(lu, pivots, rhs)[0]) if info == 0 else None


@dataclass(frozen=True, eq=False)
class Judged:
    """Points v + v_low (R, m) and ξ there; residuals, what rounding allows, whether solutions
    (R,)."""

    v: Array
    v_low: Array
    xi: Array
    residual: Array
    rounding: Array
    accepted: NDArray[np.bool_]


def judge(
    problem: ContactProblem, v: Array, acceptance: Acceptance, refine: bool = False
) -> Judged:
    """The inclusion test of rows v (R, m), in extended precision where rounding leaves it open.

    refine: what misses the aim is polished, in the end with v as a sum of two doubles
    """
    v, aim, v_low = v.copy(), acceptance.aim, np.zeros(v.shape)
    xi, residual, rounding = problem.xi(v), problem.residual_bound(v), problem.xi_rounding(v)
    for i in np.flatnonzero(~(residual <= aim)):
        one = problem.single(int(i))
        point = polished(one, v[i], aim) if refine else extended(one, v[i])
        rounding[i] = rounding[i] if np.array_equal(point.v, v[i]) else one.xi_rounding(point.v)
        v[i], v_low[i], xi[i], residual[i] = point.v, point.v_low, point.xi, point.residual
    residual[np.isnan(residual)] = np.inf
    limits = np.array([acceptance.limit(float(x)) for x in rounding])
    return Judged(v, v_low, xi, residual, rounding, residual <= limits)


EVENT = 1e-9
"""How near an event is: of the largest |v| for a slip and its kink, of the scale of b for a
traction and its bound."""
SINGULAR = 1e-13
"""Reciprocal condition of H below which the solution is at a fold."""


@dataclass(frozen=True, eq=False)
class Linearised:
    """A solution v (m,) of a contact problem and the factor of H.

    free: (f,) nodes that slide;  rest: (m − f,) nodes on an up-jump;  piece: (m,) pieces of b, at kinks on the right
    near: (m,) nodes within EVENT of an event;  singular: whether H is, to SINGULAR
    """

    problem: ContactProblem
    v: Array
    free: Index
    rest: Index
    piece: Index
    near: NDArray[np.bool_]
    singular: bool
    _factor: tuple[Array, Index]

    @classmethod
    def at(cls, problem: ContactProblem, v: Array) -> Linearised:
        """The problem linearised at its solution v."""
        rests = problem.law.sticking(v)
        free, rest = np.flatnonzero(~rests), np.flatnonzero(rests)
        piece = np.asarray(problem.law.piece(v), dtype=np.intp)
        H = problem.A_tilde[np.ix_(free, free)]
        norm = float(np.linalg.norm(H, 1)) if len(free) else 0.0
        slope = np.asarray(problem.law.slope(v, piece))[free]
        H[np.diag_indices(len(free))] += problem.c[free] * slope
        # LU, since at an unstable solution H is indefinite; a zero pivot is judged by the condition
        lu, pivots, _ = scipy.linalg.lapack.dgetrf(H) if len(free) else (H, free, 0)
        singular = len(free) > 0 and bool(scipy.linalg.lapack.dgecon(lu, norm)[0] < SINGULAR)
        return cls(
            problem, v, free, rest, piece, _events(problem, v, rests), singular, (lu, pivots)
        )

    @property
    def events(self) -> int:
        """How many nodes are near an event."""
        return int(np.count_nonzero(self.near))

    def step(self, r: Array, kinks: Array | None = None) -> Array:
        """(m,) dv/dp of a right side r (m,); kinks: (m,) ∂(kink)/∂p of the nodes that rest, 0 by
        default."""
        dv = np.zeros(len(self.v))
        rhs = r[self.free]
        if kinks is not None and np.any(kinks[self.rest]):
            dv[self.rest] = kinks[self.rest]
            rhs = rhs - self.problem.A_tilde[np.ix_(self.free, self.rest)] @ dv[self.rest]
        if len(rhs):
            dv[self.free] = scipy.linalg.lapack.dgetrs(*self._factor, rhs)[0]
        return dv


def _events(problem: ContactProblem, v: Array, rests: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(m,) nodes that slide at a kink, or rest with the traction at a bound of what the kink can
    bear."""
    law = problem.law
    if not np.size(law.kinks):
        return np.zeros(len(v), dtype=bool)
    kink = law.nearest_kink(v)
    apart = np.abs(v - law.kink(kink))
    near = ~rests & (apart <= EVENT * float(np.max(np.abs(v), initial=0.0)))
    traction = problem.xi(v) / problem.c
    left, right = law.limits(kink)
    slack = np.minimum(np.abs(traction - left), np.abs(traction - right))
    return near | (rests & (slack <= EVENT * problem.traction_scale))
