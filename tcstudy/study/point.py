"""One point of a sweep on one level, solved by itself: by any solver, by several, for comparison.

And the numbers that a study stores of it, or of a block of points.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.condense import NotPositiveDefinite
from tcstudy.contact.block import BlockAnswers, Certificates
from tcstudy.contact.certificates import Certificate, certify
from tcstudy.contact.contact import Answer, solve_contact
from tcstudy.contact.every import Every
from tcstudy.contact.loop import Status
from tcstudy.contact.problem import kept
from tcstudy.data.records import BlockRecord, PointStatus
from tcstudy.data.schema import (
    ALL_PROVED,
    BALANCED,
    HEAT_BOUND,
    LIMITED,
    MET,
    NOT_ALL,
    NOT_JUDGED,
    OF_POLYGON,
    UNBALANCED,
)
from tcstudy.laws.composed import row_laws
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import UP
from tcstudy.offline.level import Condensed, CondensedBlock, Level
from tcstudy.offline.line_numbers import line_numbers
from tcstudy.offline.thermal import Temperature
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study

Array = NDArray[np.float64]
Number = float | Array


def solve_point(
    study: Study, level: Level, place: int, neighbour: Array | None = None, exact: Array | None = None
) -> BlockRecord:
    """Solve one point of the sweep on one level; every failure becomes a status with its reason.

    neighbour: the contact solution of a neighbouring point, a start where the study's branch asks for one
    exact:     the exact solution at the contact nodes, a start where the study gives one
    """
    found: dict[str, Any] = {}
    try:
        scene, plan, solved = study.scenes[place], study.solver, list[Timed]()
        condensed = level.condensed(scene)
        problem = condensed.problem
        for name in plan.names:
            start = time.perf_counter()
            given = plan.tolerance, plan.max_iterations, plan.branch
            answer = solve_contact(problem, name, *given, neighbour, exact=exact)
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
        # no friction leaves a solution nothing but rounding of ξ; how far from 0 that is is its inclusion residual
        nothing = problem.law.vanishes and answer.status == Status.CONVERGED
        xi = np.zeros(problem.m) if nothing else answer.xi
        fields = level.fields(scene, answer.v) if study.output.fields else {}
        numbers = _one_row(_numbers(condensed, solved, xi, temperature, certificate))
        laws, traction = row_laws([problem.law], np.ones(1)), (xi / level.line.c)[None]
        found = {
            "numbers": numbers | line_numbers(level, [scene], laws, answer.v[None], traction),
            "u_T": answer.v[None],
            "xi": traction,
            "sticks": problem.law.sticking(answer.v).astype(np.int8)[None],
            "fields": _one_row(fields),
        }
        status, reason = PointStatus(int(STATUS[answer.status])), answer.reason
    except NotPositiveDefinite as error:
        status, reason = PointStatus.SINGULAR, str(error)
    except Exception as error:  # one point must not end a sweep; what it was stands in the data
        status, reason = PointStatus.ERROR, f"{type(error).__name__}: {error}"
    about = 0, level.mesh.level, study.shape, np.array([place]), np.array([status], dtype=np.int8)
    return BlockRecord(*about, {0: reason} if reason else {}, **{"numbers": {}, **found})


def _one_row(values: Mapping[str, Any]) -> dict[str, Array]:
    return {name: np.array([value], dtype=float) for name, value in values.items()}


@dataclass(frozen=True)
class Timed:
    """The answer of one solver and its wall time [s]."""

    answer: Answer
    time: float


STATUS = np.full(max(Status) + 1, int(PointStatus.NOT_CONVERGED), dtype=np.int8)
"""Statuses of the data by those of a solver."""
STATUS[Status.CONVERGED] = PointStatus.OK
STATUS[Status.INCLUSION_VIOLATED] = PointStatus.INCLUSION_VIOLATED
STATUS[Status.NOT_POSITIVE_DEFINITE] = PointStatus.SINGULAR


def heat_status(balance: Number) -> NDArray[np.intp]:
    """What the heat balance says of a temperature; NaN where there is no heat problem."""
    return np.where(np.isnan(balance), NOT_JUDGED, np.where(balance <= HEAT_BOUND, BALANCED, UNBALANCED))


def _results(
    answers: Answer | BlockAnswers, proved: Certificate | Certificates, xi: Array, constant: Number, factor: Number
) -> dict[str, Any]:
    """What a point and a block of points store alike, by variable name: numbers, or (P,) of them.

    xi: (…, m) nodal friction forces [N/m];  constant: what the energy has beside L̃ [J/m]
    factor: stiffness of the body over that of the body that the answers are of
    """
    met = np.where(answers.limited, LIMITED, MET)
    return {
        "energy": answers.energy * factor + constant,
        "inclusion_residual": answers.inclusion_residual,
        "inclusion_rounding": answers.rounding,
        "inclusion_status": np.where(np.equal(answers.status, Status.CONVERGED), met, NOT_JUDGED),
        "u_T_max": np.max(np.abs(answers.v), axis=-1, initial=0.0),
        "friction_resultant": xi.sum(axis=-1),
        "omega": proved.omega * factor,
        "unique": proved.unique,
        "strict_minimum": proved.strict_minimum,
        "global_minimum": proved.global_minimum,
        "start_used": answers.start,
    }


def _numbers(
    condensed: Condensed, solved: Sequence[Timed], xi: Array, temperature: Temperature | None, certificate: Certificate
) -> dict[str, float | tuple[float, ...]]:
    """Results by variable name, units as in data.schema; the first of `solved` is the stored solution."""
    answer = solved[0].answer
    balance = temperature.heat_balance if temperature is not None else float("nan")
    values = _results(answer, certificate, xi, condensed.constant, 1.0) | {
        "iterations": answer.iterations,
        "evaluations": answer.evaluations,
        "lambda_1": certificate.lambda_1,
        "lambda_1_error": certificate.lambda_1_error,
        "uniqueness_margin": certificate.margin,
        "theta_mean": temperature.mean if temperature is not None else float("nan"),
        "heat_balance": balance,
        "heat_status": heat_status(balance),
        "time_condense": condensed.time,
        "time_solve": solved[0].time,
    }
    if condensed.band is not None:
        values |= condensed.band.numbers(certificate.omega)
    energies = tuple(energy + condensed.constant for energy in answer.energies)
    found: dict[str, float | tuple[float, ...]] = {name: float(value) for name, value in values.items()}
    return found | {"start_energy": energies} | (_by_solver(condensed, solved) if len(solved) > 1 else {})


def _block_numbers(condensed: CondensedBlock, factor: Array, answers: BlockAnswers, xi: Array) -> dict[str, Array]:
    """Results of a block of points by variable name, units as in data.schema, (P,) each; see `_numbers`.

    factor: (P,) stiffness of a point's body over that of the block's;  xi: (P, m) [N/m]
    """
    proved, constant, balance = answers.certificates, condensed.constant, condensed.heat_balance
    lambda_1, error = condensed.mu * condensed.lambda_1, condensed.lambda_1_error
    margin = np.where(np.isnan(proved.margin), kept(error) * lambda_1 - proved.omega * factor, proved.margin * factor)
    values = _results(answers, proved, xi, constant, factor) | {
        "iterations": answers.steps,
        "lambda_1": lambda_1,
        "lambda_1_error": np.full(len(factor), error),
        "uniqueness_margin": margin,
        "start_energy": answers.start_energies * factor[:, None] + constant[:, None],
        "theta_mean": condensed.theta_mean,
        "heat_balance": balance,
        "heat_status": heat_status(balance),
        "time_condense": np.full(len(factor), condensed.time / len(factor)),
    }
    if condensed.band is not None:
        values |= condensed.band.numbers(proved.omega * factor, condensed.mu)
    return {name: np.asarray(value, dtype=float) for name, value in values.items()}


def block_record(
    study: Study,
    level: Level,
    points: NDArray[np.intp],
    scenes: Sequence[Scene],
    condensed: CondensedBlock,
    laws: Laws,
    found: BlockAnswers | Every,
    seconds: float,
) -> BlockRecord:
    """The record of a block of answers. laws: of its rows;  seconds: for all of them."""
    answers = found.answers if isinstance(found, Every) else found
    factor = condensed.mu / condensed.mu[0]
    # as of a single point
    vanishing = np.array([scene.friction.vanishes for scene in scenes])
    nothing = vanishing & (answers.status == Status.CONVERGED)
    xi = np.where(nothing[:, None], 0.0, answers.xi * factor[:, None])
    sticks = laws.kind(laws.locate(answers.v)) == UP
    numbers, solutions = _block_numbers(condensed, factor, answers, xi), dict[str, Array]()
    numbers |= line_numbers(level, scenes, laws, answers.v, xi / condensed.c)
    if isinstance(found, Every):
        more, solutions = _every(found, factor, condensed)
        numbers |= more
    return BlockRecord(
        number=0,
        level=level.mesh.level,
        shape=study.shape,
        points=points,
        status=STATUS[answers.status],
        reasons={row: reason for row, reason in enumerate(answers.reasons) if reason},
        numbers=numbers | {"time_solve": np.full(len(points), seconds / len(points))},
        u_T=answers.v,
        xi=xi / condensed.c,
        sticks=sticks.astype(np.int8),
        solutions=solutions,
    )


def _every(found: Every, factor: Array, condensed: CondensedBlock) -> tuple[dict[str, Array], dict[str, Array]]:
    """What a block stores of all solutions of its points: (P,) by variable name, and one row a solution.

    factor: as in `_block_numbers`
    """
    count = np.array([len(one) for one in found.solutions])
    complete = np.array([one.complete for one in found.solutions], dtype=bool)
    numbers = {
        "solutions": count,
        "stable_solutions": np.array([np.count_nonzero(one.stable) for one in found.solutions]),
        "complete": np.where(complete, np.where(found.polygon, OF_POLYGON, ALL_PROVED), NOT_ALL),
    }
    row = np.repeat(np.arange(len(count)), count)
    solutions: dict[str, Any] = {
        "row": row,
        "energy": np.concatenate([one.energy for one in found.solutions]) * factor[row] + condensed.constant[row],
        "stable": np.concatenate([one.stable for one in found.solutions]).astype(np.int8),
        "u_T": np.concatenate([one.v for one in found.solutions]),
        "xi": np.concatenate([one.xi for one in found.solutions]) * factor[row, None] / condensed.c,
        "piece": np.concatenate([one.sides for one in found.solutions]).astype(np.int32),
    }
    return {name: np.asarray(values, dtype=float) for name, values in numbers.items()}, solutions


def _by_solver(condensed: Condensed, solved: Sequence[Timed]) -> dict[str, tuple[float, ...]]:
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
