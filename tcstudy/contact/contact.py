"""Solve one contact problem with the method a study names, and judge the answer by its inclusion (21)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.active_set import judge
from tcstudy.contact.block import NOT_POSITIVE_DEFINITE, Answer, SolutionBlock, solve_block
from tcstudy.contact.descent import descend
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.status import Outcome, Status
from tcstudy.scene.study import (
    FRICTIONLESS,
    NEIGHBOUR,
    SEPARABLE,
    SOLVERS,
    START_NAMES,
    ZERO,
    Acceptance,
    Branch,
)

Array = NDArray[np.float64]

ACCURACY = 1e-12
"""Residual that methods work for, whatever larger one is accepted."""
SEMIDEFINITE = 1e-9
"""Negative eigenvalues up to this part of the largest entry of Ã are rounding: the body lies loose."""
UNFIT = (
    "the pieces of the law on which the method ended do not hold to that accuracy; raise solver.tolerance or try the "
    "other solver"
)
NOT_FINITE = "a load, the stiffness or the law has a value that is not finite; check them, and units that overflow"


def solve_contact(
    problem: ContactProblem,
    solver: str = SEPARABLE,
    tolerance: float | None = None,
    max_iterations: int | None = None,
    branch: Branch = "lowest",
    neighbour: Array | None = None,
    exact: Array | None = None,
) -> Answer:
    """Find v with 0 ∈ Ãv − l̃ + ∂Ψ(v) and an inclusion residual that is accepted.

    tolerance: largest inclusion residual, strict; None for 1e-10 or what rounding allows (scene/study.py)
    max_iterations: steps of bundle-newton, None for its own limit; separable-newton has one of its own
    branch:    "lowest": of the solutions found from zero, from the frictionless solution, from the neighbour, beside
               the exact one and, unless the best of them seems global or the solver is bundle-newton, by the escape
               phase the lowest found; "continued": from the neighbour, without leaving its basin on purpose,
               and not moved at all if it is a solution; "from-zero": from zero. These two try zero, the frictionless
               solution and the neighbour, too, but only where theirs fails
    neighbour: (m,) a solution of a neighbouring problem, if there is one
    exact:     (m,) the exact solution at the contact nodes, where it is known; its own branch may be a saddle

    An answer that misses the tolerance is solved again to higher accuracy, in the end with v as a sum of two doubles;
    one that still misses it is returned as failed, with its residual. Raises ValueError for an unknown solver.
    """
    if solver not in SOLVERS:
        raise ValueError(f"unknown solver {solver!r}; use one of {', '.join(SOLVERS)}")
    if problem.m == 0:
        return unsolved(problem, Status.CONVERGED, "", 0.0)
    near = None if neighbour is None else np.asarray(neighbour, dtype=float)
    if solver != SEPARABLE:
        return _by_bundle(problem, Acceptance(tolerance), max_iterations, branch, near, exact)
    if not all(np.all(np.isfinite(x)) for x in (problem.A_tilde, problem.l_tilde, problem.c)):
        return unsolved(problem, Status.NOT_FINITE, NOT_FINITE, np.nan)
    rows = problem.rows
    if rows.body.loose and np.linalg.eigvalsh(problem.A_tilde)[0] < -SEMIDEFINITE * np.max(np.abs(problem.A_tilde)):
        return unsolved(problem, Status.NOT_POSITIVE_DEFINITE, NOT_POSITIVE_DEFINITE, 0.0)
    near = None if near is None else near[None]
    return solve_block(rows.body, rows.l_tilde, rows.law, branch, tolerance, near, exact, prove=False).row(0)


def unsolved(problem: ContactProblem, status: Status, reason: str, energy: float) -> Answer:
    """The answer to a problem without nodes, or to one that cannot be solved."""
    v, residual = np.full(problem.m, 0.0 * energy), 0.0 if status == Status.CONVERGED else np.inf
    none = np.full(len(START_NAMES), np.nan)
    return Answer(v, 0.0 * v, 0.0 * v, residual, 0.0, False, energy, status, reason, ZERO, none, 0, 0)


def nearest_minimum(
    problem: ContactProblem, v: Array, tolerance: float, over_barriers: bool = True
) -> tuple[Array, int]:
    """(minimum to which descent leads from v (m,), steps); over no barriers: laws of straight pieces."""
    ended = descend(problem.rows, v[None].copy(), tolerance, minima=True, downhill=not over_barriers)
    return ended.v[0], int(ended.steps[0])


def as_it_is(problem: ContactProblem, v: Array, tolerance: float | None = None) -> Answer | None:
    """v as `solve_contact` has it where it starts from a solution, without its energies; None if v is none."""
    acceptance = Acceptance(tolerance)
    one = judge(problem.rows, v[None], acceptance, refine=True)
    if not one.residual[0] <= acceptance.aim:
        return None
    return replace(
        unsolved(problem, Status.CONVERGED, "", np.nan),
        v=one.v[0], v_low=one.v_low[0], xi=one.xi[0], inclusion_residual=one.residual[0], rounding=one.rounding[0],
        start=NEIGHBOUR,
    )  # fmt: skip


def _by_bundle(
    problem: ContactProblem,
    acceptance: Acceptance,
    max_iterations: int | None,
    branch: Branch,
    neighbour: Array | None,
    exact: Array | None,
) -> Answer:
    """The least solution from all starts, or the first; what fails has the least residual, and work is summed."""
    from tcstudy.contact.bundle.contact import solve_with_bundle  # needs the QP library

    block, here = SolutionBlock(problem.rows, branch, acceptance.tolerance, prove=False), np.zeros(1, dtype=np.intp)
    tried, missed, least = list[Outcome](), None, np.inf
    for start, x0 in _starts(problem, branch, neighbour):
        tried.append(outcome := solve_with_bundle(problem, x0, max_iterations, min(ACCURACY, acceptance.aim)))
        judged = judge(problem.rows, outcome.x[None], acceptance, refine=True)
        if missed is None or judged.residual[0] < least:
            missed = (Status.INCLUSION_VIOLATED, UNFIT) if outcome.converged else (outcome.status, outcome.reason)
            least = judged.residual[0]
            block.energy[~block.solved] = np.inf  # so that it takes the place of what has more
        block.offer(here, judged.v, judged.residual, start)
        if branch != "lowest" and block.solved[0]:
            break
    if branch == "lowest" and exact is not None:
        block.begin_at(exact)
    work = {name: sum(getattr(one, name) for one in tried) for name in ("iterations", "evaluations")}
    return replace(block.answer(prove=False, otherwise=missed).row(0), **work)


def _starts(problem: ContactProblem, branch: Branch, neighbour: Array | None) -> Iterator[tuple[int, Array]]:
    """Starts in the order in which they are tried; a body that can move freely has no frictionless solution."""
    known = [] if neighbour is None else [(NEIGHBOUR, neighbour)]
    yield from known if branch == "continued" else []
    yield ZERO, np.zeros(problem.m)
    with suppress(scipy.linalg.LinAlgError):
        yield FRICTIONLESS, problem.frictionless()
    yield from known if branch != "continued" else []
