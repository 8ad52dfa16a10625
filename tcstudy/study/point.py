"""One point of a sweep on one level, solved by itself: by any solver, by several, for comparison."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from tcstudy.condense import NotPositiveDefinite
from tcstudy.data.records import PointRecord, PointStatus
from tcstudy.offline.level import Level
from tcstudy.scene.friction import sticking
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study
from tcstudy.solvers.certificates import certify
from tcstudy.solvers.contact import solve_contact
from tcstudy.study.measures import Timed, friction_forces, numbers, point_status

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
    temperature = level.temperature(scene) if scene.material.beta != 0.0 else None
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
