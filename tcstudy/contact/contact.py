"""Solve one contact problem with the method a study names, and judge the answer by its inclusion (21)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.active_set import Refined, finish, refined
from tcstudy.contact.block import NOT_POSITIVE_DEFINITE, TIE, Options, failure, solve_block
from tcstudy.contact.descent import descend
from tcstudy.contact.loop import Outcome, Status
from tcstudy.contact.problem import ContactProblem
from tcstudy.scene.study import (
    EXACT,
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
Log = Callable[[str], None]

ROUNDING = 0.01
"""Share of the tolerance that the rounding of ξ may have before the residual is formed in extended precision."""
ACCURACY = 1e-12
"""Residual that methods work for, whatever larger one is accepted."""
SEMIDEFINITE = 1e-9
"""Negative eigenvalues up to this part of the largest entry of Ã are rounding: the body lies loose."""
UNFIT = (
    "the pieces of the law on which the method ended do not hold to that accuracy; raise solver.tolerance or try the "
    "other solver"
)
NOT_FINITE = "a load, the stiffness or the law has a value that is not finite; check them, and units that overflow"


@dataclass(frozen=True)
class Answer:
    """A judged solution.

    v, v_low:           (m,) tangential displacements v + v_low [m]; the low part is 0 where one double is enough
    xi:                 (m,) nodal friction forces l̃ − Ã(v + v_low) [N/m]
    inclusion_residual: max_i dist(ξ_i/c_i, b̂(v_i)) / (scale of b), with what rounding may hide in it: in exact
                        arithmetic v + v_low has no larger one
    rounding:           what rounding of the problem allows of it, `ContactProblem.xi_rounding`
    limited:            accepted only because rounding allows no better (scene/study.py)
    energy:             L̃(v) [J/m]
    status, reason:     CONVERGED, or why not; reason is empty for a solution
    iterations, evaluations: of all attempts together
    start:              ZERO, FRICTIONLESS, NEIGHBOUR, ESCAPE or EXACT: where the run that found it began
    energies:           L̃ of the solutions found from these starts, in this order; NaN where none was sought or found
    """

    v: Array
    inclusion_residual: float
    energy: float
    status: Status
    reason: str
    iterations: int
    evaluations: int
    start: int = ZERO
    energies: tuple[float, ...] = (float("nan"),) * len(START_NAMES)
    v_low: Array = field(default_factory=lambda: np.zeros(0))
    xi: Array = field(default_factory=lambda: np.zeros(0))
    rounding: float = 0.0
    limited: bool = False


def solve_contact(
    problem: ContactProblem,
    solver: str = SEPARABLE,
    tolerance: float | None = None,
    max_iterations: int | None = None,
    branch: Branch = "lowest",
    neighbour: Array | None = None,
    log: Log | None = None,
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
    if solver == SEPARABLE:
        return _as_row(problem, Options(branch, tolerance), neighbour, exact)
    acceptance = Acceptance(tolerance)
    answers: list[Answer] = []
    for start, x0 in _starts(problem, branch, neighbour):
        outcome = _bundle(problem, x0, min(ACCURACY, acceptance.aim), max_iterations, log)
        answers.append(replace(_judge(problem, outcome, acceptance), start=start))
        if branch != "lowest" and answers[-1].status == Status.CONVERGED:
            break
    if branch == "lowest" and exact is not None:
        v = finish(problem, exact)[0]
        outcome = Outcome(v, problem.energy(v), Status.CONVERGED, "", 0, 1)
        answers.append(replace(_judge(problem, outcome, acceptance), start=EXACT))
    return _together(answers)


def _as_row(problem: ContactProblem, options: Options, neighbour: Array | None, exact: Array | None) -> Answer:
    """The problem as a block of one row."""
    if problem.m == 0:
        return Answer(np.zeros(0), 0.0, 0.0, Status.CONVERGED, "", 0, 0)
    if not all(np.all(np.isfinite(x)) for x in (problem.A_tilde, problem.l_tilde, problem.c)):
        return Answer(np.full(problem.m, np.nan), np.inf, np.nan, Status.NOT_FINITE, NOT_FINITE, 0, 0)
    rows = problem.rows
    if rows.body.loose and np.linalg.eigvalsh(problem.A_tilde)[0] < -SEMIDEFINITE * np.max(np.abs(problem.A_tilde)):
        return Answer(np.zeros(problem.m), np.inf, 0.0, Status.NOT_POSITIVE_DEFINITE, NOT_POSITIVE_DEFINITE, 0, 0)
    near = None if neighbour is None else np.asarray(neighbour, dtype=float)[None]
    found = solve_block(rows.body, rows.l_tilde, rows.law, options, near, exact, prove=False)
    return Answer(
        found.v[0], float(found.inclusion_residual[0]), float(found.energy[0]), Status(int(found.status[0])),
        found.reasons[0], int(found.steps[0]), int(found.steps[0]), int(found.start[0]),
        tuple(found.start_energies[0].tolist()), found.v_low[0], found.xi[0], float(found.rounding[0]),
        bool(found.limited[0]),
    )  # fmt: skip


def nearest_minimum(
    problem: ContactProblem, v: Array, tolerance: float, over_barriers: bool = True
) -> tuple[Array, int]:
    """(minimum to which descent leads from v (m,), steps); over no barriers: laws of straight pieces."""
    ended = descend(problem.rows, v[None].copy(), tolerance, minima=True, downhill=not over_barriers)
    return ended.v[0], int(ended.steps[0])


def _starts(problem: ContactProblem, branch: Branch, neighbour: Array | None) -> Iterator[tuple[int, Array]]:
    """Starts in the order in which they are tried; a body that can move freely has no frictionless solution."""
    known = [] if neighbour is None else [(NEIGHBOUR, np.asarray(neighbour, dtype=float))]
    yield from known if branch == "continued" else []
    yield ZERO, np.zeros(problem.m)
    with suppress(scipy.linalg.LinAlgError):
        yield FRICTIONLESS, problem.frictionless()
    yield from known if branch != "continued" else []


def _bundle(
    problem: ContactProblem, x0: Array, accuracy: float, max_iterations: int | None, log: Log | None
) -> Outcome:
    from tcstudy.contact.bundle.contact import solve_with_bundle  # needs the QP library

    return solve_with_bundle(problem, x0, max_iterations=max_iterations, log=log, inclusion=accuracy)


def as_it_is(problem: ContactProblem, v: Array, tolerance: float | None = None) -> Answer | None:
    """v as `solve_contact` has it where it starts from a solution, without its energies; None if v is none."""
    acceptance = Acceptance(tolerance)
    point, rounding = _looked_at(problem, v, acceptance)
    if not point.residual <= acceptance.aim:
        return None
    limited = acceptance.limited(point.residual, rounding)
    return Answer(point.v, point.residual, float("nan"), Status.CONVERGED, "", 0, 1, NEIGHBOUR,
                  v_low=point.v_low, xi=point.xi, rounding=rounding, limited=limited)  # fmt: skip


def _judge(problem: ContactProblem, outcome: Outcome, acceptance: Acceptance) -> Answer:
    """End on the exact active pieces if that is better, then apply the inclusion test."""
    point, rounding = _looked_at(problem, outcome.x, acceptance)
    if not point.residual <= acceptance.aim:
        other, blur = _looked_at(problem, finish(problem, outcome.x)[0], acceptance)
        point, rounding = (other, blur) if other.residual < point.residual else (point, rounding)
    status, reason = Status.CONVERGED, ""
    if not acceptance.accepts(point.residual, rounding):
        status = Status.INCLUSION_VIOLATED if outcome.converged else outcome.status
        reason = failure(point.residual, rounding, acceptance, UNFIT if outcome.converged else outcome.reason)
    return Answer(
        point.v,
        point.residual,
        problem.energy(point.v),
        status,
        reason,
        outcome.iterations,
        outcome.evaluations,
        v_low=point.v_low,
        xi=point.xi,
        rounding=rounding,
        limited=acceptance.limited(point.residual, rounding),
    )


def _looked_at(problem: ContactProblem, v: Array, acceptance: Acceptance) -> tuple[Refined, float]:
    """v with its residual and what rounding allows of that, in extended precision and refined where rounding is no
    longer small beside the tolerance."""
    rounding, residual = problem.xi_rounding(v), problem.residual_bound(v)
    if rounding > ROUNDING * acceptance.aim or not residual <= acceptance.aim:
        point = refined(problem, v, acceptance.aim)
        return point, problem.xi_rounding(point.v)
    return Refined(v, np.zeros(problem.m), problem.xi(v), residual), rounding


def _together(answers: list[Answer]) -> Answer:
    """The solution of least energy, or the failure with the least residual; work is summed."""
    solutions = [a for a in answers if a.status == Status.CONVERGED]
    if solutions:
        least = min(a.energy for a in solutions)
        slack = TIE * max(abs(a.energy) for a in solutions)
        best = next(a for a in solutions if a.energy <= least + slack)
    else:
        best = min(answers, key=lambda a: a.inclusion_residual)
    found = {a.start: a.energy for a in solutions}
    return replace(
        best,
        energies=tuple(found.get(start, float("nan")) for start in range(len(START_NAMES))),
        iterations=sum(a.iterations for a in answers),
        evaluations=sum(a.evaluations for a in answers),
    )
