"""Plain semismooth Newton method (primal–dual active set) for 0 ∈ Ãv − l̃ + ∂Ψ(v): a peer, not part
of the package.

With ζ = (l̃ − Ãv)/c the inclusion ζ_i ∈ b̂(v_i) says that every (v_i, ζ_i) lies on the completed
graph of b, a polygon of pieces (ζ = p_k + q_k v) and verticals (v = s_k). For 0 < λ < 1/max(−q) the
number t_i = v_i + λζ_i is increasing along a graph without down-jumps, so that t_i names the branch
of node i. One step solves the linear equations of the current branches and reads the next branches
from its t; this is Newton's method for the piecewise-linear equation (v_i, ζ_i) = graph(t_i), and
it ends exactly when no branch changes.

Nothing makes it converge: there is no line search, and branch sets may repeat in a cycle.

Literature: Hintermüller, Ito & Kunisch, SIAM J. Optim. 13 (2002) 865–888 (the method); Qi & Sun,
Math. Programming 58 (1993) 353–367 (semismooth Newton). At a down-jump t is not monotone; the
branch switches in the middle there.
"""

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.pieces import UP

Array = NDArray[np.float64]
Index = NDArray[np.intp]
SOFTENING, COMPLIANCE, STEPS, TOLERANCE = 0.5, 3.0, 200, 1e-10
"""λ ≤ SOFTENING/max(−q), and λ ≤ COMPLIANCE · median(c/Ã_ii), the local compliance of the body: 3
solved most among 0.3 … 10; linear solves before giving up; inclusion residual at which returning
branches (by rounding) are a solution."""


def semismooth_newton(problem: ContactProblem, v: Array) -> tuple[Array, str]:
    """(v, why it is no solution: "" if no branch changes) from a start; piecewise-linear laws
    only."""
    law, c, A = problem.law, problem.c, problem.A_tilde
    assert law.piecewise_linear
    fall = -float(np.min(law.q))
    weight = COMPLIANCE * float(np.median(c / np.diagonal(A)))  # λ in t = v + λζ [m/Pa]
    weight = min(weight, SOFTENING / fall) if fall > 0.0 else weight
    middle, up = 0.5 * (law.b_left + law.b_right), law.kinds == UP
    enter = law.kinks + weight * np.where(up, law.b_left, middle)
    leave = law.kinks + weight * np.where(up, law.b_right, middle)
    turns = np.maximum.accumulate(np.column_stack([enter, leave]).ravel())

    def branches(v: Array) -> Index:
        """(m,) 2k on piece k, 2k + 1 on the vertical at kink k."""
        return np.searchsorted(turns, v + weight * problem.xi(v) / c).astype(np.intp)

    branch, seen = branches(v), set[bytes]()
    for _ in range(STEPS):
        solution = solve_branches(problem, branch)
        if solution is None:
            return v, "the equations of these branches are singular"
        v, old = solution, branch
        branch = branches(v)
        seen.add(old.tobytes())
        if np.array_equal(branch, old):
            return v, ""
        if branch.tobytes() in seen:
            return v, "" if problem.inclusion_residual(
                v
            ) <= TOLERANCE else "the branches repeat: the method cycles"
    return v, f"no solution within {STEPS} iterations"


def solve_branches(problem: ContactProblem, branch: Index) -> Array | None:
    """v on the branches (m,): kinks on verticals, the linear equations of the pieces elsewhere;
    None if singular."""
    law, c = problem.law, problem.c
    resting = branch % 2 == 1
    v = np.zeros(problem.m)
    v[resting] = law.kinks[branch[resting] // 2]
    free = np.flatnonzero(~resting)
    if not len(free):
        return v
    k = branch[free] // 2
    rows = problem.A_tilde[free]
    matrix = rows[:, free] + np.diag(c[free] * law.q[k])
    rhs = problem.l_tilde[free] - c[free] * (law.b_0[k] - law.q[k] * law.s_0[k]) - rows @ v
    try:
        v[free] = scipy.linalg.solve(matrix, rhs)
    except np.linalg.LinAlgError:
        return None
    return v
