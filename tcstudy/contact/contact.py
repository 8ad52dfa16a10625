"""Solve one contact problem with the method a study names, and judge the answer by its inclusion (21)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.loop import Outcome, Status, iterate
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.search import escape
from tcstudy.contact.separable.finish import Refined, finish, refined
from tcstudy.contact.separable.newton import COARSEST, SeparableNewton
from tcstudy.scene.study import (
    ESCAPE,
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
FAR = 100.0
"""Multiples of the rounding of ξ up to which a residual that is too large is put down to it."""
_OTHERWISE = "raise solver.tolerance or try the other solver"
TIE = 1e-12
"""Relative difference of energies up to which two answers count as equally low; the earlier start then wins."""


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
    acceptance = Acceptance(tolerance)
    accuracy = min(ACCURACY, acceptance.aim)
    answers: list[Answer] = []
    for start, x0 in _starts(problem, branch, neighbour):
        stay = branch == "continued" and start == NEIGHBOUR
        if stay and problem.inclusion_residual(x0) <= acceptance.aim:
            outcome = _unmoved(problem, x0)  # a descent would leave one that is no minimum
        else:
            outcome = (
                _separable(problem, x0, accuracy, stay, log)
                if solver == SEPARABLE
                else _bundle(problem, x0, accuracy, max_iterations, log)
            )
        answers.append(replace(_judge(problem, outcome, acceptance), start=start))
        if branch != "lowest" and answers[-1].status == Status.CONVERGED:
            break
    if branch == "lowest" and solver == SEPARABLE:
        answers += _escape(problem, _together(answers), acceptance, log)
    if branch == "lowest" and exact is not None:
        outcome = _unmoved(problem, finish(problem, exact)[0])
        answers.append(replace(_judge(problem, outcome, acceptance), start=EXACT))
    return _together(answers)


def _unmoved(problem: ContactProblem, v: Array) -> Outcome:
    """A point that solves the problem already."""
    return Outcome(v, problem.energy(v), Status.CONVERGED, "", 0, 1)


def _starts(problem: ContactProblem, branch: Branch, neighbour: Array | None) -> Iterator[tuple[int, Array]]:
    """Starts in the order in which they are tried; a body that can move freely has no frictionless solution."""
    known = [] if neighbour is None else [(NEIGHBOUR, np.asarray(neighbour, dtype=float))]
    yield from known if branch == "continued" else []
    yield ZERO, np.zeros(problem.m)
    with suppress(scipy.linalg.LinAlgError):
        yield FRICTIONLESS, problem.frictionless()
    yield from known if branch != "continued" else []


def _escape(problem: ContactProblem, best: Answer, acceptance: Acceptance, log: Log | None) -> list[Answer]:
    """What the escape phase finds, if it has any business; where rounding decides or the data are bad it has none."""
    if best.status not in (Status.CONVERGED, Status.ITERATION_LIMIT, Status.STALLED):
        return []

    def solve(changed: ContactProblem, x0: Array, accuracy: float) -> Outcome:
        return _separable(changed, x0, accuracy, True, log)

    known = best.v if best.status == Status.CONVERGED else None
    found = escape(problem, known, min(ACCURACY, acceptance.aim), solve)
    return [] if found is None else [replace(_judge(problem, found, acceptance), start=ESCAPE)]


def _separable(problem: ContactProblem, x0: Array, accuracy: float, stay: bool, log: Log | None) -> Outcome:
    coarsest = 0 if stay else COARSEST  # coarse copies of the problem would look for a lower basin
    method = SeparableNewton(accuracy, coarsest=coarsest)
    return iterate(method, replace(problem, law=problem.law.without_narrow_pieces), x0, log)


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
        reason = _failure(outcome, point.residual, rounding, acceptance)
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


def _failure(outcome: Outcome, residual: float, rounding: float, acceptance: Acceptance) -> str:
    """Why an answer misses the tolerance and what to try; more iterations do not help against rounding."""
    limit = acceptance.limit(rounding)
    missed = f"inclusion residual {residual:.1e} above the tolerance {limit:.1e}"
    if limit < residual <= FAR * rounding:
        return (
            f"{missed}; rounding alone leaves about {rounding:.0e} because friction is small against the forces in the "
            "body or elements on the contact line are very thin: raise solver.tolerance, check the units, or coarsen"
        )
    if outcome.converged:
        return f"{missed}: the pieces of the law on which the method ended do not hold to that accuracy; {_OTHERWISE}"
    return f"{missed}: {outcome.reason}"


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
