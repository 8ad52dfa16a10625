"""Solve one contact problem with the method a study names, and judge the answer by its inclusion (21)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.solve.active_pieces import finish
from tcstudy.solve.loop import iterate
from tcstudy.solve.outcome import Outcome, Status
from tcstudy.solve.problem import ContactProblem
from tcstudy.solve.separable_newton import SeparableNewton

Array = NDArray[np.float64]
Log = Callable[[str], None]

SOLVERS = ("separable-newton", "bundle-newton")
"""Names that a study may give under `solver`."""


@dataclass(frozen=True)
class Answer:
    """A judged solution.

    v:                  (m,) tangential displacements [m]
    inclusion_residual: max_i dist(ξ_i/c_i, b̂(v_i)) / (scale of b)
    energy:             L̃(v) [J/m]
    status, reason:     CONVERGED, or why not; reason is empty for a solution
    iterations, evaluations: of all attempts together
    """

    v: Array
    inclusion_residual: float
    energy: float
    status: Status
    reason: str
    iterations: int
    evaluations: int


def solve_contact(
    problem: ContactProblem,
    solver: str = "separable-newton",
    tolerance: float = 1e-10,
    max_iterations: int | None = None,
    start: Array | None = None,
    log: Log | None = None,
) -> Answer:
    """Find v with 0 ∈ Ãv − l̃ + ∂Ψ(v) and an inclusion residual of at most `tolerance`.

    start: first iterate; zero if not given, and the frictionless solution if that fails. An answer that misses the
    tolerance is solved again to higher accuracy; one that still misses it is returned as failed, with its residual.
    Raises ValueError for an unknown solver.
    """
    if solver not in SOLVERS:
        raise ValueError(f"unknown solver {solver!r}; use one of {', '.join(SOLVERS)}")
    run = _separable if solver == "separable-newton" else _bundle
    answers: list[Answer] = []
    for x0 in _starts(problem, start):
        outcome = run(problem, x0, min(1e-12, tolerance), max_iterations, log)
        answers.append(_judge(problem, outcome, tolerance))
        if answers[-1].status == Status.CONVERGED:
            break
    return _together(answers)


def _starts(problem: ContactProblem, start: Array | None) -> Sequence[Array]:
    first = np.zeros(problem.m) if start is None else np.asarray(start, dtype=float)
    return (first, problem.frictionless())


def _separable(
    problem: ContactProblem, x0: Array, accuracy: float, max_iterations: int | None, log: Log | None
) -> Outcome:
    method = SeparableNewton(tolerance=accuracy)
    if max_iterations is not None:
        method = replace(method, max_iterations=max_iterations)
    return iterate(method, problem, x0, log)


def _bundle(
    problem: ContactProblem, x0: Array, accuracy: float, max_iterations: int | None, log: Log | None
) -> Outcome:
    from tcstudy.solve.bundle_contact import solve_with_bundle  # needs the QP library

    return solve_with_bundle(problem, x0, max_iterations=max_iterations, log=log)


def _judge(problem: ContactProblem, outcome: Outcome, tolerance: float) -> Answer:
    """End on the exact active pieces if that is better, then apply the inclusion test."""
    v, residual = outcome.x, problem.inclusion_residual(outcome.x)
    if residual > tolerance:
        v, residual = finish(problem, v)
        residual = problem.inclusion_residual(v)
    status, reason = Status.CONVERGED, ""
    if not residual <= tolerance:
        status = Status.INCLUSION_VIOLATED if outcome.converged else outcome.status
        reason = (
            f"inclusion residual {residual:.1e} above the tolerance {tolerance:.1e}: {outcome.reason}"
            if not outcome.converged
            else f"inclusion residual {residual:.1e} stays above the tolerance {tolerance:.1e}; "
            "the condensed problem is too badly conditioned for it, raise solver.tolerance or check the units"
        )
    return Answer(v, residual, problem.energy(v), status, reason, outcome.iterations, outcome.evaluations)


def _together(answers: list[Answer]) -> Answer:
    """The last answer if it is a solution, else the one with the least residual; work is summed."""
    best = answers[-1]
    if best.status != Status.CONVERGED:
        best = min(answers, key=lambda a: a.inclusion_residual)
    return replace(
        best,
        iterations=sum(a.iterations for a in answers),
        evaluations=sum(a.evaluations for a in answers),
    )
