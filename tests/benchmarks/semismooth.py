"""Plain semismooth Newton method (primal–dual active set) for 0 ∈ Ãv − l̃ + ∂Ψ(v): a peer, not part of the package.

With ζ = (l̃ − Ãv)/c the inclusion ζ_i ∈ b̂(v_i) says that every (v_i, ζ_i) lies on the completed graph of b, a
polygon of pieces (ζ = p_k + q_k v) and verticals (v = s_k). For 0 < λ < 1/max(−q) the number t_i = v_i + λζ_i is
increasing along a graph without down-jumps, so that t_i names the branch of node i. One step solves the linear
equations of the current branches and reads the next branches from its t; this is Newton's method for the
piecewise-linear equation (v_i, ζ_i) = graph(t_i), and it ends exactly when no branch changes.

Nothing makes it converge: there is no line search, and branch sets may repeat in a cycle.

Literature: Hintermüller, Ito & Kunisch, SIAM J. Optim. 13 (2002) 865–888 (the method); Qi & Sun, Math. Programming
58 (1993) 353–367 (semismooth Newton). At a down-jump t is not monotone; the branch switches in the middle there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.status import Outcome, Status
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import UP

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class SemismoothState:
    """Iterate and the branches that it asks for.

    branch: (m,) 2k on piece k, 2k + 1 on the vertical at kink k
    seen:   branch sets solved so far
    stop:   why to stop, None to go on
    """

    v: Array
    branch: Index
    seen: frozenset[bytes]
    stop: tuple[Status, str] | None


@dataclass(frozen=True)
class SemismoothNewton:
    """Options. Piecewise-linear laws only (raises ValueError).

    max_iterations: linear solves before giving up
    tolerance:      inclusion residual at which returning branches (by rounding) are a solution
    softening:      λ ≤ softening/max(−q), below 1
    compliance:     λ ≤ compliance · median(c/Ã_ii), the local compliance of the body; 3 solved most among 0.3 … 10
    """

    max_iterations: int = 200
    tolerance: float = 1e-10
    softening: float = 0.5
    compliance: float = 3.0

    def run(self, problem: ContactProblem, x0: Array) -> Outcome:
        """Steps from x0 until no branch changes, branches return, or their limit is met."""
        if not problem.law.piecewise_linear:
            raise ValueError(f"{problem.law.name}: the graph of b is not a polygon; use another solver")
        state, taken = SemismoothState(x0, self.branches(problem, x0), frozenset(), None), 0
        while state.stop is None and taken < self.max_iterations:
            state, taken = self.step(problem, state), taken + 1
        stop = state.stop or (Status.ITERATION_LIMIT, f"no solution within {self.max_iterations} iterations")
        return Outcome(state.v, problem.energy(state.v), *stop, taken, 0)

    def weight(self, problem: ContactProblem) -> float:
        """λ in t = v + λζ [m/Pa]."""
        local = self.compliance * float(np.median(problem.c / np.diagonal(problem.A_tilde)))
        fall = -float(np.min(problem.law.q))
        return min(local, self.softening / fall) if fall > 0.0 else local

    def branches(self, problem: ContactProblem, v: Array) -> Index:
        """The branch that t = v + λζ lies on, node by node."""
        weight = self.weight(problem)
        t = v + weight * problem.xi(v) / problem.c
        return np.searchsorted(breakpoints(problem.law, weight), t).astype(np.intp)

    def step(self, problem: ContactProblem, state: SemismoothState) -> SemismoothState:
        """Solve on the branches, then read the next ones."""
        v = solve_branches(problem, state.branch)
        if v is None:
            return replace(state, stop=(Status.NOT_POSITIVE_DEFINITE, "the equations of these branches are singular"))
        branch = self.branches(problem, v)
        seen = state.seen | {state.branch.tobytes()}
        stop = None
        if np.array_equal(branch, state.branch):
            stop = (Status.CONVERGED, "no branch changes")
        elif branch.tobytes() in seen and problem.inclusion_residual(v) <= self.tolerance:
            stop = (Status.CONVERGED, "branches change by rounding only")
        elif branch.tobytes() in seen:
            stop = (Status.STALLED, "the branches repeat: the method cycles; use a globalised one")
        return SemismoothState(v, branch, seen, stop)


def breakpoints(law: Laws, weight: float) -> Array:
    """(2K,) values of t at which the branch changes, two for every kink."""
    middle = 0.5 * (law.b_left + law.b_right)
    up = law.kinds == UP
    enter = law.kinks + weight * np.where(up, law.b_left, middle)
    leave = law.kinks + weight * np.where(up, law.b_right, middle)
    return np.maximum.accumulate(np.column_stack([enter, leave]).ravel())


def solve_branches(problem: ContactProblem, branch: Index) -> Array | None:
    """v on the branches (m,): kinks on verticals, the linear equations of the pieces elsewhere; None if singular."""
    law, c = problem.law, problem.c
    resting = branch % 2 == 1
    v = np.zeros(problem.m)
    v[resting] = law.kinks[branch[resting] // 2]
    free = np.flatnonzero(~resting)
    if not len(free):
        return v
    k = branch[free] // 2
    rows = problem.A_tilde[free]
    matrix = rows[:, free]
    matrix[np.diag_indices(len(free))] += c[free] * law.q[k]
    rhs = problem.l_tilde[free] - c[free] * (law.b_0[k] - law.q[k] * law.s_0[k]) - rows @ v
    factor, info = scipy.linalg.lapack.dpotrf(matrix.T, lower=1)
    if info == 0:
        v[free] = scipy.linalg.lapack.dpotrs(factor, rhs, lower=1)[0]
        return v
    lu, pivots, info = scipy.linalg.lapack.dgetrf(matrix)
    if info != 0:
        return None
    v[free] = scipy.linalg.lapack.dgetrs(lu, pivots, rhs)[0]
    return v
