"""The search for less energy after descent from the plain starts: convexified problems, then moves of single nodes.

Descent ends in the well that the start lies in; down-jumps and steep falls give L̃ many wells. Two steps follow, and
both only ever lower the energy that is reported:
  1. `hull_start`, by graduated nonconvexity along the proximal hulls of the law (hulls.py): with κ below λ₁ the problem
     of b_κ is convex and sees all wells of j at once. Then κ grows by a fixed factor, each problem starting from the
     solution of the one before, until b_κ is b at all nodes, or κ the stiffness of a single node, from where on wells
     can no longer merge but node by node (Blake & Zisserman, Visual Reconstruction, MIT Press 1987);
  2. `node_moves`, as long as it helps, of one node to another piece or kink of b while all others relax (moves.py).
Nothing here is random. Cost: a Newton run for every κ (two to five), one for what they lead to, and for every move one
and about three factorisations more; none where the answer seems global. Left out: moves of several nodes that only
together lower the energy, and any proof that nothing lower exists (certificates).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache
from itertools import islice

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.bounds import bend_below_tangent, first_box, tables_of
from tcstudy.contact.certificates import positive_definite
from tcstudy.contact.hulls import proximal_hulls
from tcstudy.contact.loop import Outcome
from tcstudy.contact.moves import best_places, follow, relaxed_stiffness
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.separable.pieces import energy_change, factor_free, slopes

Array = NDArray[np.float64]
Index = NDArray[np.intp]

LOOSE = 1e-3
"""Tolerance of the convexified problems; 1e-6 led to the same energies in trials, 1e-2 to higher ones."""
GROWTH = 4.0
"""Factor from one κ to the next. Of 486 problems 2, 4, 8 left 9, 11, 22 above the lowest energy known, before moves
of single nodes; 92 were above it before."""
MOVES, PROMISES = 20, 2
"""Moves of single nodes at most (trials needed two), and how many promises of a move are put to the test."""
_ROUNDING = 1e-12
"""Differences of energy below this part of their terms are none."""
_SAFELY, _ITERATIONS, _TURNS = 0.9, 4, np.array([0.0, 2.0, 0.7])
"""Share of the estimate of λ₁ that is below it; steps of the estimate, and angles that draw its first vectors."""
_PARTS = 4
"""Parts of an exponential piece on which its bend is bounded."""

Solve = Callable[[ContactProblem, Array, float], Outcome]
"""Descent on a problem from a start, and from nowhere else, to a tolerance."""


def escape(problem: ContactProblem, best: Array | None, tolerance: float, solve: Solve) -> Outcome | None:
    """The lowest solution that the two steps find; None where none lower than `best` is to be expected.

    best:      (m,) the solution to be undercut, None if there is none
    tolerance: of what is found; the convexified problems need less

    If no move improves on `best`, the outcome is that of the convexified start, be it lower or not. Iterations and
    evaluations are those of the whole phase.
    """
    if problem.m == 0 or problem.law.omega == 0.0:
        return None
    try:
        lambda_1 = estimate_lambda_1(problem)
    except scipy.linalg.LinAlgError:
        return None
    if best is not None and seems_global(problem, best, lambda_1):
        return None
    runs: list[Outcome] = []

    def run(changed: ContactProblem, x0: Array, accuracy: float) -> Outcome:
        runs.append(solve(changed, x0, accuracy))
        return runs[-1]

    begin = np.zeros(problem.m) if best is None else best
    start, lowest = hull_start(problem, begin, lambda_1, lambda smoothed, x0: run(smoothed, x0, LOOSE))
    found = run(problem, start, tolerance)
    if found.converged and (best is None or _lower(problem, best, found.x)):
        best = found.x
    if best is not None and not lowest:
        found = _moved(problem, best, lambda x0: run(problem, x0, tolerance)) or found
    iterations, evaluations = sum(r.iterations for r in runs), sum(r.evaluations for r in runs)
    return replace(found, iterations=iterations, evaluations=evaluations)


def _moved(problem: ContactProblem, v: Array, solve: Callable[[Array], Outcome]) -> Outcome | None:
    """Where moves of single nodes lead from v as long as they lower the energy; None if the first does not."""
    last = None
    for _ in range(MOVES):
        tried = (solve(promise) for promise in islice(node_moves(problem, v), PROMISES))
        better = next((outcome for outcome in tried if outcome.converged and _lower(problem, v, outcome.x)), None)
        if better is None:
            break
        last, v = better, better.x
    return last


def seems_global(problem: ContactProblem, v: Array, lambda_1: float) -> bool:
    """The certificate of a global minimum on a box that is known cheaply: a guess, since λ₁ is about right only."""
    law, below = problem.law, _SAFELY * lambda_1
    if law.omega < below:
        return True
    low, high = first_box(problem, below)
    zeta = np.clip(problem.xi(v) / problem.c, *law.interval(v))
    bend = bend_below_tangent(law, v, zeta, np.minimum(low, v), np.maximum(high, v), _PARTS)
    return bool(np.all(np.isfinite(bend))) and positive_definite(problem, -bend, lambda_1, margin=0.0)


def _lower(problem: ContactProblem, v: Array, w: Array) -> bool:
    """Whether L̃(w) < L̃(v), beyond the rounding of the terms of their difference."""
    step, xi = w - v, problem.xi(v)
    A_step = problem.A_tilde @ step
    terms = problem.c * problem.law.integral(v, w), -xi * step, 0.5 * step * A_step
    size = sum(float(np.sum(np.abs(term))) for term in terms)
    return energy_change(problem, v, xi, step, A_step) < -_ROUNDING * size


def hull_start(
    problem: ContactProblem, x0: Array, lambda_1: float, solve: Callable[[ContactProblem, Array], Outcome]
) -> tuple[Array, bool]:
    """(displacements to start from (m,), whether they have the least energy) of convexified problems, one by one.

    x0:       (m,) where the first one begins; its solution does not depend on it, the work does
    lambda_1: about λ₁; only the first problem's convexity hangs on it
    solve:    solves one convexified problem from a start; no accuracy is needed

    Where the first, convex problem has b_κ = b at its solution, that has the least energy of the original one, too (as
    far as the estimate of λ₁ and the hull are exact).
    """
    v, kappa, first = x0, _SAFELY * lambda_1, True
    stiffest = min(problem.law.omega, float(np.max(np.diagonal(problem.A_tilde) / problem.c)))
    tables, index = tables_of(problem.law, problem.m)
    while True:
        hulls, bridges = _hulls(tables, kappa)
        law = hulls.laws[0] if problem.law.one else hulls.at(index)
        outcome = solve(replace(problem, law=law), v)
        v, kappa = outcome.x, GROWTH * kappa
        settled = not np.any(bridges.cover(index, v))
        if settled or kappa >= stiffest:
            return v, first and settled and outcome.converged
        first = False


_hulls = lru_cache(maxsize=64)(proximal_hulls)
"""Cached, since a sweep asks for few laws and bodies many times."""


def estimate_lambda_1(problem: ContactProblem) -> float:
    """λ₁ from above, to a few per cent, by inverse iteration of a small subspace [Pa/m].

    It begins with a rigid slip, which nearly is the softest mode of most bodies, and with vectors that look random,
    because where neighbours push each other apart the softest mode may be perpendicular to it. A factorisation and a
    few solves, where the exact value takes an eigenvalue solver.
    """
    factor = scipy.linalg.cho_factor(problem.A_tilde, lower=True, check_finite=False)
    root = np.sqrt(problem.c)[:, None]
    x, softness = root * np.cos(np.outer(np.arange(problem.m) ** 2, _TURNS)), np.eye(1)
    for _ in range(_ITERATIONS):
        x = np.linalg.qr(x)[0]
        y = root * scipy.linalg.cho_solve(factor, root * x, check_finite=False)
        softness = x.T @ y
        x = y
    return 1.0 / float(np.linalg.eigvalsh(softness)[-1])


def node_moves(problem: ContactProblem, v: Array) -> Iterator[Array]:
    """Points (m,) that promise less energy than v, one node moved and the others relaxed; the best promise first.

    None where H is not positive definite. A promise is broken where another node leaves its piece on the way.
    """
    xi, c = problem.xi(v), problem.c
    relaxed = _relaxed(problem, v, xi)
    if relaxed is None:
        return
    free, factor, stiffness = relaxed
    gain, target = best_places(*tables_of(problem.law, problem.m), v, xi / c, stiffness / c)
    for node in np.argsort(c * gain, kind="stable")[: np.count_nonzero(gain)]:
        step = follow(problem.A_tilde, free, factor, int(node), float(target[node] - v[node]))
        yield v + step


def _relaxed(problem: ContactProblem, v: Array, xi: Array) -> tuple[Index, Array, Array] | None:
    """(free nodes, Cholesky factor of H, all k_i (m,)): how the free nodes follow one; three factorisations' work."""
    s = slopes(problem, v, xi)
    free, resting = np.flatnonzero(~s.at_rest), np.flatnonzero(s.at_rest)
    law, c, A = problem.law, problem.c, problem.A_tilde
    q = law.slope(v, np.where(s.descent <= 0.0, law.piece(v, +1), law.piece(v, -1)))[free]
    factor, info = factor_free(A, free, c[free] * q)
    if info != 0:
        return None
    return free, factor, relaxed_stiffness(A, free, resting, factor, c[free] * q)
