"""What can be proved about a solution v of a contact problem: unique, strict local minimum, global minimum.

Uniqueness:      ω < λ₁ makes L̃ strictly convex. Otherwise every solution lies in a box (solution_box), and two
                 solutions v, w in it have (v−w)ᵀ(Ã + C diag b′_min)(v−w) ≤ 0 with the least slopes of b on the
                 box; if that matrix is positive definite there is only one.
Strict minimum:  A_FF + C b′ ≻ 0 on the free nodes, and every other node rests on an up-jump with left < 0 < right.
Global minimum:  L̃(w) − L̃(v) ≥ ½ (w−v)ᵀ(Ã − C diag D)(w−v) − Σ (ξ_i − c_i ζ_i)(w_i − v_i), D from bounds.py and
                 ζ the element of b̂(v) nearest to ξ/c. If Ã − C diag(D + μ) ⪰ 0 no point of the box, so no point
                 at all, has an energy below L̃(v) − ‖ξ/c − ζ‖²/(2μ) in the norm weighted by c: `energy_gap`,
                 rounding squared.

Every flag is one-sided: True is proved, False says "not certified". Positive definiteness is decided by Cholesky with
the diagonal lowered by μ = margin·λ₁ and never by less than the rounding of the factorisation, so that it holds in
floating-point arithmetic too; where Ã has lost more digits than that to stiff springs or materials, it is taken softer
by its relative error. Left out: interval arithmetic (the inclusion residual of v enters through
`energy_gap` only) and branch and bound for what is not certified.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.active_set import extended
from tcstudy.contact.bounds import FEW, PARTS, bend_below_tangent, least_slope, solution_box
from tcstudy.contact.factors import factor_free
from tcstudy.contact.newton import slopes
from tcstudy.contact.problem import MARGIN, ContactProblem, kept, least_lowered, pivot_shift
from tcstudy.laws.pieces import UP
from tcstudy.scene.study import Acceptance

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class Certificate:
    """Proved properties of one solution; a flag that is False means "not certified", not the opposite.

    residual:        inclusion residual of v; above the tolerance no flag is set except `convex` and `unique`
    lambda_1, omega: uniqueness threshold of the body and steepest fall of the law [Pa/m] (method §5)
    lambda_1_error:  relative error of λ₁; above 1e-6 every proof takes the body softer by that
    margin:          λ_min(C^{−½}ÃC^{−½} − diag ω_i) with the steepest fall of every node's law, λ₁ − ω where all have
                     one law [Pa/m]: positive if every load has one solution; −∞ with a down-jump
    convex:          margin > 0: one solution for every load
    unique:          one solution for this load (convex, or convex on the box of all solutions)
    strict_minimum:  v is a strict local minimum of L̃
    global_minimum:  no point has an energy below L̃(v) − energy_gap
    energy_gap:      what rounding in v leaves open [J/m]; nan if not certified
    least_slack:     smallest of −left and right over the resting nodes, relative to c·(scale of b); inf without any
    resting:         number of nodes on an up-jump
    """

    residual: float
    lambda_1: float
    omega: float
    convex: bool
    unique: bool
    strict_minimum: bool
    global_minimum: bool
    energy_gap: float
    least_slack: float
    resting: int
    margin: float
    lambda_1_error: float = 0.0


def certify(
    problem: ContactProblem,
    v: Array,
    lambda_1: float | None = None,
    tolerance: float | None = None,
    inverse: Array | None = None,
    residual: float | None = None,
) -> Certificate:
    """Certificate of the solution v (m,).

    lambda_1:  λ₁ if known (it depends on the body only), whose error then is `A_error`, else it is computed
    tolerance: largest inclusion residual that counts as a solution, None for the default of scene/study.py
    residual:  inclusion residual if known better than from v in double precision, else it is computed
    inverse:   Ã⁻¹ if known (it depends on the body only), else it is computed
    """
    threshold = problem.lambda_1 if lambda_1 is None else lambda_1
    error = problem.lambda_1_error if lambda_1 is None else problem.A_error
    problem = replace(problem, A_error=error)
    residual, omega = extended(problem, v).residual if residual is None else residual, problem.law.omega
    slack, resting = _resting_slack(problem, v)
    apart = uniqueness_margin(problem, threshold)
    convex = omega < (1.0 - MARGIN) * kept(error) * threshold or (
        problem.m > 0 and apart > pivot_shift(problem.A_tilde, problem.c, threshold)
    )
    if problem.m == 0:
        return Certificate(residual, threshold, omega, convex, True, True, True, 0.0, slack, 0, apart, error)
    low, high = solution_box(problem, threshold, inverse=inverse)
    unique = convex or positive_definite(problem, least_slope(problem.law, low, high), threshold)
    solved = Acceptance(tolerance).accepts(residual, problem.xi_rounding(v))
    strict = solved and (unique or _strict_minimum(problem, v, threshold))
    gap = _global_gap(problem, v, low, high, threshold, unique) if solved else float("nan")
    lowest = bool(np.isfinite(gap))
    return Certificate(residual, threshold, omega, convex, unique, strict, lowest, gap, slack, resting, apart, error)


def uniqueness_margin(problem: ContactProblem, lambda_1: float) -> float:
    """λ_min(C^{−½}ÃC^{−½} − diag ω_i) [Pa/m], which is λ₁ − ω with one law and else at least λ₁ − max ω.

    Where Ã has lost digits it is that of the softer body (`kept`).
    """
    share = kept(problem.A_error)
    if problem.law.one:
        return share * lambda_1 - problem.law.omega
    return least_lowered(share * problem.A_tilde, problem.c, problem.law.falls[problem.law.index])


def positive_definite(
    problem: ContactProblem, slope: Array, lambda_1: float, named: Index | None = None, margin: float = MARGIN
) -> bool:
    """Whether Ã + C diag(slope − μ) is positive definite on the named nodes (all by default)."""
    nodes = np.arange(problem.m, dtype=np.intp) if named is None else named
    shift = pivot_shift(problem.A_tilde, problem.c, lambda_1, margin)
    lowered = problem.c[nodes] * (slope - shift) / kept(problem.A_error)
    possible = np.all(np.diagonal(problem.A_tilde)[nodes] + lowered > 0.0)
    return bool(possible) and factor_free(problem.A_tilde, nodes, lowered)[1] == 0


def _resting_slack(problem: ContactProblem, v: Array) -> tuple[float, int]:
    """(least relative slack of the nodes on up-jumps, their number)."""
    on = problem.law.kind_at(v) == UP
    if not np.any(on):
        return float("inf"), 0
    s = slopes(problem, v, problem.xi(v))
    slack = np.minimum(-s.left, s.right)[on] / problem.c[on]
    return float(np.min(slack)) / problem.traction_scale, int(np.count_nonzero(on))


def _strict_minimum(problem: ContactProblem, v: Array, lambda_1: float) -> bool:
    """Second-order test with the nodes that rest without slack counted as free (sufficient, not necessary)."""
    law, xi = problem.law, problem.xi(v)
    s = slopes(problem, v, xi)
    noise = 1e3 * np.finfo(float).eps * (np.diagonal(problem.A_tilde) * np.abs(v) + np.abs(xi))
    on_up = law.kind_at(v) == UP
    held = on_up & (s.left < -noise) & (s.right > noise)
    if np.any(s.jump & ~on_up):
        return False
    free = np.flatnonzero(~held)
    own, at = law.of_nodes(free), v[free]
    slope = np.minimum(own.slope(at, own.piece(at, -1)), own.slope(at, own.piece(at, +1)))
    return positive_definite(problem, slope, lambda_1, free)


def _global_gap(problem: ContactProblem, v: Array, low: Array, high: Array, lambda_1: float, unique: bool) -> float:
    """The energy gap ‖ξ/c − ζ‖²/(2μ) if v is certified to be a global minimum, else nan."""
    traction = problem.xi(v) / problem.c
    zeta = np.clip(traction, *problem.law.interval(v))
    gap = float(problem.c @ (traction - zeta) ** 2) / (2.0 * pivot_shift(problem.A_tilde, problem.c, lambda_1))
    low, high = np.minimum(low, v), np.maximum(high, v)
    if unique:
        return gap
    for parts in (PARTS,) if problem.law.piecewise_linear else (FEW, PARTS):
        bend = bend_below_tangent(problem.law, v, zeta, low, high, parts)
        if np.all(np.isfinite(bend)) and positive_definite(problem, -bend, lambda_1):
            return gap
    return float("nan")
