"""One point of a sweep on one level, solved by itself: by any solver, by several, for comparison.

And the numbers that a study stores of it, or of a block of points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.condense import NotPositiveDefinite
from tcstudy.contact.all_solutions import Equilibria
from tcstudy.contact.certificates import as_row, certify
from tcstudy.contact.problem import Status
from tcstudy.contact.solution import EVENT, Linearised
from tcstudy.contact.solve import Answer, solve_contact
from tcstudy.data.records import BlockRecord
from tcstudy.data.schema import (
    ALL_PROVED,
    AT_EVENT,
    AT_FOLD,
    BALANCED,
    DIFFERENTIABLE,
    HEAT_BOUND,
    LIMITED,
    MET,
    NOT_ALL,
    NOT_JUDGED,
    OF_POLYGON,
    SENSITIVITY_EVENTS,
    SENSITIVITY_STATUS,
    UNBALANCED,
    UNKNOWN,
    PointStatus,
    name_of,
)
from tcstudy.executors.processes import timed
from tcstudy.laws.composed import row_laws
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import UP
from tcstudy.offline.level import CondensedBlock, Level
from tcstudy.offline.requested_outputs import line_numbers
from tcstudy.offline.slopes import Change, WholeBody, change_of, friction_slopes
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Sensitivity, Study

Array = NDArray[np.float64]


def solve_point(
    study: Study, level: Level, place: int, neighbour: Array | None = None, exact: Array | None = None
) -> BlockRecord:
    """Solve one point of the sweep on one level; every failure becomes a status with its reason.

    neighbour: the contact solution of a neighbouring point, a start where the study's branch asks for one
    exact:     the exact solution at the contact nodes, a start where the study gives one
    """
    plan, points = study.solver, np.array([place])
    try:
        scene = study.scenes[place]
        problem, condensed = level.condensed(scene).problem, level.block([scene])
        given = plan.tolerance, plan.max_iterations, plan.branch, neighbour, exact
        solved = [timed(solve_contact, problem, name, *given) for name in plan.names]
        answer, seconds = solved[0]
        lambda_1, residual = level.lambda_1(scene), answer.inclusion_residual
        proved = certify(problem, answer.v, lambda_1, plan.tolerance, residual=residual)
        row, laws = as_row(replace(answer, certificate=proved)), row_laws([problem.law], np.ones(1))
        record = block_record(study, level, points, [scene], condensed, laws, row, seconds)
        more = {"evaluations": answer.evaluations} | (_by_solver(condensed, solved) if len(solved) > 1 else {})
        fields = level.fields(scene, answer.v) if study.output.fields else {}
        return replace(record, numbers=record.numbers | _one_row(more), fields=_one_row(fields))
    except NotPositiveDefinite as error:
        status, reason = PointStatus.SINGULAR, str(error)
    except Exception as error:  # one point must not end a sweep; what it was stands in the data
        status, reason = PointStatus.ERROR, f"{type(error).__name__}: {error}"
    return all_failed(study, level.mesh.level, points, status, reason)


def _one_row(values: Mapping[str, Any]) -> dict[str, Array]:
    return {name: np.array([value], dtype=float) for name, value in values.items()}


def all_failed(study: Study, level: int, points: NDArray[np.intp], status: PointStatus, reason: str) -> BlockRecord:
    """Points of a level without results."""
    count = len(points)
    failed = np.full(count, int(status), dtype=np.int8)
    return BlockRecord(level, study.shape, points, failed, dict.fromkeys(range(count), reason), {})


STATUS = np.full(max(Status) + 1, int(PointStatus.NOT_CONVERGED), dtype=np.int8)
"""Statuses of the data by those of a solver."""
STATUS[Status.CONVERGED] = PointStatus.OK
STATUS[Status.INCLUSION_VIOLATED] = PointStatus.INCLUSION_VIOLATED
STATUS[Status.NOT_POSITIVE_DEFINITE] = PointStatus.SINGULAR


def block_record(
    study: Study,
    level: Level,
    points: NDArray[np.intp],
    scenes: Sequence[Scene],
    condensed: CondensedBlock,
    laws: Laws,
    answers: Answer,
    seconds: float,
) -> BlockRecord:
    """The record of a block of answers, units as in data.schema. laws: of its rows;  seconds: for all of them."""
    proved, error, count = answers.certificate, condensed.lambda_1_error, len(points)
    assert proved is not None
    factor = condensed.mu / condensed.mu[0]  # stiffness of a point's body over that of the block's
    solved = answers.status == Status.CONVERGED
    # no friction leaves a solution nothing but rounding of ξ; how far from 0 that is is its inclusion residual
    nothing = solved & np.array([scene.friction.vanishes for scene in scenes])
    xi = np.where(nothing[:, None], 0.0, answers.xi * factor[:, None])
    sticks = np.where(np.isnan(answers.v), UNKNOWN, laws.kind(laws.locate(answers.v)) == UP)
    lambda_1, omega, balance = condensed.mu * condensed.lambda_1, proved.omega * factor, condensed.heat_balance
    unbalanced = np.where(balance <= HEAT_BOUND, BALANCED, UNBALANCED)
    values = {
        "energy": answers.energy * factor + condensed.constant,
        "inclusion_residual": answers.inclusion_residual,
        "inclusion_rounding": answers.rounding,
        "inclusion_status": np.where(solved, np.where(answers.limited, LIMITED, MET), NOT_JUDGED),
        "iterations": answers.iterations,
        "u_T_max": np.max(np.abs(answers.v), axis=-1, initial=0.0),
        "friction_resultant": xi.sum(axis=-1),
        "lambda_1": lambda_1,
        "lambda_1_error": np.full(count, error),
        "omega": omega,
        "uniqueness_margin": proved.margin * factor,
        "unique": proved.unique,
        "strict_minimum": proved.strict_minimum,
        "global_minimum": proved.global_minimum,
        "start_used": answers.start,
        "start_energy": answers.energies * factor[:, None] + condensed.constant[:, None],
        "theta_mean": condensed.theta_mean,
        "heat_balance": balance,
        "heat_status": np.where(np.isnan(balance), NOT_JUDGED, unbalanced),
        "time_condense": np.full(count, condensed.time / count),
        "time_solve": np.full(count, seconds / count),
        **line_numbers(level, scenes, laws, answers.v, xi / condensed.c),
    }
    if condensed.band is not None:
        values |= condensed.band.numbers(omega, condensed.mu)
    solutions: dict[str, Array] = {}
    if answers.solutions is not None:
        more, solutions = _every(answers.solutions, points, factor, condensed)
        values |= more
    return BlockRecord(
        level=level.mesh.level,
        shape=study.shape,
        points=points,
        status=STATUS[answers.status],
        reasons={row: reason for row, reason in enumerate(answers.reason) if reason},
        numbers={name: np.asarray(value, dtype=float) for name, value in values.items()},
        u_T=answers.v,
        xi=xi / condensed.c,
        sticks=sticks.astype(np.int8),
        solutions=solutions,
    )


def _every(
    found: Sequence[Equilibria], points: NDArray[np.intp], factor: Array, condensed: CondensedBlock
) -> tuple[dict[str, Array], dict[str, Array]]:
    """What a block stores of all solutions of its points by variable name: (P,), and one row a solution.
    points: (P,) places in the sweep;  factor: (P,) stiffness of a point's body over that of the block's"""
    count = np.array([len(one) for one in found])
    complete = np.array([one.complete for one in found], dtype=bool)
    polygon = np.array([one.law_error > 0.0 for one in found], dtype=bool)
    numbers = {
        "solutions": count,
        "stable_solutions": np.array([np.count_nonzero(one.stable) for one in found]),
        "complete": np.where(complete, np.where(polygon, OF_POLYGON, ALL_PROVED), NOT_ALL),
    }
    row = np.repeat(np.arange(len(count)), count)
    solutions: dict[str, Any] = {
        "solution_point": points[row].astype(np.int32),
        "solution_energy": np.concatenate([one.energy for one in found]) * factor[row] + condensed.constant[row],
        "solution_stable": np.concatenate([one.stable for one in found]).astype(np.int8),
        "solution_u_T": np.concatenate([one.v for one in found]),
        "solution_xi": np.concatenate([one.xi for one in found]) * factor[row, None] / condensed.c,
        "solution_piece": np.concatenate([one.sides for one in found]).astype(np.int32),
    }
    return numbers, solutions


def _by_solver(condensed: CondensedBlock, solved: Sequence[tuple[Answer, float]]) -> dict[str, Any]:
    """What each solver found, and how far from the first one's solution."""
    answers, times = zip(*solved, strict=True)
    first = answers[0].v
    scale = float(np.max(np.abs(first), initial=0.0))
    apart = [float(np.max(np.abs(a.v - first), initial=0.0)) for a in answers]
    return {
        "solver_residual": [a.inclusion_residual for a in answers],
        "solver_energy": [a.energy + float(condensed.constant[0]) for a in answers],
        "solver_iterations": [a.iterations for a in answers],
        "solver_time": times,
        "solver_difference": [d / scale if scale > 0.0 else d for d in apart],
    }


# -- derivatives by numbers of the study, for the variables of `data.schema` --------------------------
# A point is linearised once at its solution (`contact.linearised`); a number then costs O(m²).

Rates = tuple[Array, Array, float]
"""(m,) derivatives of v and ξ by a number, and that of the mean θ."""


def rates_of(whole: WholeBody, number: Sensitivity, at: Linearised, change: Change) -> Rates:
    """Derivatives by a number at a solution. Raises KeyError for one that the scene does not have."""
    right = whole.right_side(change)
    friction = friction_slopes(whole.level, whole.scene, number, at)
    dv = at.step(right - at.problem.c * friction.b, friction.kinks)
    return dv, right - at.problem.A_tilde @ dv, change.theta_mean


def derivatives_of(level: Level, scene: Scene, v: Array, numbers: tuple[Sensitivity, ...]) -> dict[str, float]:
    """Derivatives at the solution v (m,) of a scene by variable name, with the verdict on them; NaN at an event."""
    at = Linearised.at(level.condensed(scene).problem, v)
    verdict = AT_FOLD if at.singular else AT_EVENT if at.events else DIFFERENTIABLE
    found: dict[str, float] = {SENSITIVITY_STATUS: verdict, SENSITIVITY_EVENTS: at.events}
    if verdict != DIFFERENTIABLE:
        return found
    whole = WholeBody(level, scene, v)
    for number in numbers:
        try:
            change = change_of(level, scene, number)
            dv, dxi, theta_mean = rates_of(whole, number, at, change)
            friction = friction_slopes(level, scene, number, at)
        except KeyError:  # a law of the sweep that has no such parameter
            continue
        values = {
            "u_T_max": _of_largest(v, dv),
            "friction_resultant": float(dxi.sum()),
            "theta_mean": theta_mean,
            "lambda_1": whole.lambda_1(change),
            "omega": friction.omega,
            "energy": whole.energy(change) + friction.energy,
        }
        found |= {name_of(quantity, number.name): value for quantity, value in values.items()}
    return found


def _of_largest(v: Array, dv: Array) -> float:
    """Derivative of max |v|; NaN where several nodes have it and do not agree."""
    if not len(v):
        return 0.0
    size = np.abs(v)
    change = np.sign(v) * dv
    own = change[size >= (1.0 - EVENT) * size.max()]
    return float(own[0]) if np.ptp(own) <= EVENT * np.max(np.abs(change)) else float("nan")
