"""One point of a sweep on one level, solved by itself: by any solver, by several, for comparison.

And the numbers that a study stores of it, or of a block of points.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.condense import NotPositiveDefinite
from tcstudy.data.records import PointRecord, PointStatus
from tcstudy.data.schema import BALANCED, HEAT_BOUND, LIMITED, MET, NOT_JUDGED, UNBALANCED
from tcstudy.offline.level import Condensed, CondensedBlock, Level
from tcstudy.offline.thermal import Temperature
from tcstudy.online import BlockAnswers, RowLaws
from tcstudy.scene.friction import UP
from tcstudy.scene.nodal_laws import sticking
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study
from tcstudy.solvers.certificates import Certificate, certify
from tcstudy.solvers.contact import Answer, solve_contact
from tcstudy.solvers.loop import Status
from tcstudy.solvers.problem import ContactProblem

Array = NDArray[np.float64]


def solve_point(
    study: Study,
    level: Level,
    index: tuple[int, ...],
    scene: Scene,
    neighbour: Array | None = None,
    exact: Array | None = None,
) -> PointRecord:
    """Solve one scene on one level; every failure becomes a status with its reason.

    neighbour: the contact solution of a neighbouring point, a start where the study's branch asks for one
    exact:     the exact solution at the contact nodes, a start where the study gives one
    """
    try:
        return _solve_point(study, level, index, scene, neighbour, exact)
    except NotPositiveDefinite as error:
        status, reason = PointStatus.SINGULAR, str(error)
    except Exception as error:  # one point must not end a sweep; what it was stands in the data
        status, reason = PointStatus.ERROR, f"{type(error).__name__}: {error}"
    return PointRecord(index, level.mesh.level, status, reason, {}, np.empty(0), np.empty(0))


def _solve_point(
    study: Study,
    level: Level,
    index: tuple[int, ...],
    scene: Scene,
    neighbour: Array | None,
    exact: Array | None,
) -> PointRecord:
    condensed = level.condensed(scene)
    problem, plan = condensed.problem, study.solver
    solved = []
    for name in plan.names:
        start = time.perf_counter()
        answer = solve_contact(problem, name, plan.tolerance, plan.max_iterations, plan.branch, neighbour, exact=exact)
        solved.append(Timed(answer, time.perf_counter() - start))
    answer = solved[0].answer
    temperature = level.temperature(scene) if scene.material.expands else None
    certificate = certify(
        problem,
        answer.v,
        level.lambda_1(scene),
        plan.tolerance,
        inverse=level.A_inverse(scene),
        residual=answer.inclusion_residual,
    )
    values = numbers(condensed, solved, temperature, certificate)
    status = PointStatus(int(point_status(np.array([answer.status]))[0]))
    fields = level.fields(scene, condensed, answer.v) if study.output.fields else {}
    traction = friction_forces(problem, answer) / level.line.c
    sticks = sticking(problem.law, answer.v).astype(np.int8)
    return PointRecord(index, level.mesh.level, status, answer.reason, values, answer.v, traction, fields, sticks)


Numbers = dict[str, float | tuple[float, ...]]


@dataclass(frozen=True)
class Timed:
    """The answer of one solver and its wall time [s]."""

    answer: Answer
    time: float


def friction_forces(problem: ContactProblem, answer: Answer) -> Array:
    """(m,) nodal friction forces ξ = l̃ − Ãv [N/m], and 0 where the law b ≡ 0 leaves a solution nothing but rounding.

    How far from 0 the forces of that solution are is its inclusion residual.
    """
    if problem.law.vanishes and answer.status == Status.CONVERGED:
        return np.zeros(problem.m)
    return answer.xi


def inclusion_status(answer: Answer) -> int:
    """What the inclusion residual says of a solution; nothing of a failure."""
    if answer.status != Status.CONVERGED:
        return NOT_JUDGED
    return LIMITED if answer.limited else MET


def heat_status(balance: float) -> int:
    """What the heat balance says of a temperature; NaN where there is no heat problem."""
    if np.isnan(balance):
        return NOT_JUDGED
    return BALANCED if balance <= HEAT_BOUND else UNBALANCED


def numbers(
    condensed: Condensed, solved: Sequence[Timed], temperature: Temperature | None, certificate: Certificate
) -> Numbers:
    """Results by variable name, units as in data.schema; the first of `solved` is the stored solution."""
    problem, answer = condensed.problem, solved[0].answer
    xi = friction_forces(problem, answer)
    balance = temperature.heat_balance if temperature is not None else float("nan")
    values: Numbers = {
        "energy": answer.energy + condensed.constant,
        "inclusion_residual": answer.inclusion_residual,
        "inclusion_rounding": answer.rounding,
        "inclusion_status": inclusion_status(answer),
        "iterations": answer.iterations,
        "evaluations": answer.evaluations,
        "u_T_max": float(np.max(np.abs(answer.v), initial=0.0)),
        "friction_resultant": float(xi.sum()),
        "slip_length": float(problem.c[~sticking(problem.law, answer.v)].sum()),
        "lambda_1": certificate.lambda_1,
        "omega": certificate.omega,
        "uniqueness_margin": certificate.margin,
        "unique": int(certificate.unique),
        "strict_minimum": int(certificate.strict_minimum),
        "global_minimum": int(certificate.global_minimum),
        "start_used": answer.start,
        "start_energy": tuple(energy + condensed.constant for energy in answer.energies),
        "theta_mean": temperature.mean if temperature is not None else float("nan"),
        "heat_balance": balance,
        "heat_status": heat_status(balance),
        "time_condense": condensed.time,
        "time_solve": solved[0].time,
    }
    return values | _by_solver(condensed, solved) if len(solved) > 1 else values


def point_status(status: NDArray[np.int8]) -> NDArray[np.int8]:
    """(P,) statuses of the data for those of a solver."""
    table = np.full(max(Status) + 1, int(PointStatus.NOT_CONVERGED), dtype=np.int8)
    table[Status.CONVERGED] = PointStatus.OK
    table[Status.INCLUSION_VIOLATED] = PointStatus.INCLUSION_VIOLATED
    table[Status.NOT_POSITIVE_DEFINITE] = PointStatus.SINGULAR
    return table[status]


def line_values(
    answers: BlockAnswers, laws: RowLaws, factor: Array, vanishing: NDArray[np.bool_]
) -> tuple[Array, NDArray[np.bool_]]:
    """ξ (P, m) [N/m] as `friction_forces` has it, and which nodes rest on an up-jump, of a block of points.

    factor: (P,) stiffness of a point's body over that of the block's;  vanishing: (P,) whether b ≡ 0
    """
    nothing = vanishing & (answers.status == Status.CONVERGED)
    xi = np.where(nothing[:, None], 0.0, answers.xi * factor[:, None])
    return xi, laws.kind(laws.locate(answers.v)) == UP


def block_numbers(
    condensed: CondensedBlock, factor: Array, answers: BlockAnswers, xi: Array, sticks: NDArray[np.bool_], time: float
) -> dict[str, Array]:
    """Results of a block of points by variable name, units as in data.schema, (P,) each; see `numbers`.

    factor: (P,) as in `line_values`, whose results are xi and sticks;  time: wall time a point [s]
    """
    proved = answers.certificates
    lambda_1, omega = condensed.mu * condensed.lambda_1, proved.omega * factor
    converged = answers.status == Status.CONVERGED
    met = np.where(answers.limited, LIMITED, MET)
    balance = condensed.heat_balance
    heat = np.where(np.isnan(balance), NOT_JUDGED, np.where(balance <= HEAT_BOUND, BALANCED, UNBALANCED))
    values: dict[str, Array] = {
        "energy": answers.energy * factor + condensed.constant,
        "inclusion_residual": answers.inclusion_residual,
        "inclusion_rounding": answers.rounding,
        "inclusion_status": np.where(converged, met, NOT_JUDGED).astype(float),
        "iterations": answers.steps.astype(float),
        "u_T_max": np.max(np.abs(answers.v), axis=1, initial=0.0),
        "friction_resultant": xi.sum(axis=1),
        "slip_length": np.where(sticks, 0.0, condensed.c).sum(axis=1),
        "lambda_1": lambda_1,
        "omega": omega,
        "uniqueness_margin": np.where(np.isnan(proved.margin), lambda_1 - omega, proved.margin * factor),
        "unique": proved.unique.astype(float),
        "strict_minimum": proved.strict_minimum.astype(float),
        "global_minimum": proved.global_minimum.astype(float),
        "start_used": answers.start.astype(float),
        "start_energy": answers.start_energies * factor[:, None] + condensed.constant[:, None],
        "theta_mean": condensed.theta_mean,
        "heat_balance": balance,
        "heat_status": heat.astype(float),
        "time_condense": np.full(len(factor), condensed.time / len(factor)),
        "time_solve": np.full(len(factor), time),
    }
    return values


def _by_solver(condensed: Condensed, solved: Sequence[Timed]) -> Numbers:
    """What each solver found, and how far from the first one's solution."""
    answers = [s.answer for s in solved]
    first = answers[0].v
    scale = float(np.max(np.abs(first), initial=0.0))
    apart = [float(np.max(np.abs(a.v - first), initial=0.0)) for a in answers]
    return {
        "solver_residual": tuple(a.inclusion_residual for a in answers),
        "solver_energy": tuple(a.energy + condensed.constant for a in answers),
        "solver_iterations": tuple(a.iterations for a in answers),
        "solver_time": tuple(s.time for s in solved),
        "solver_difference": tuple(d / scale if scale > 0.0 else d for d in apart),
    }
