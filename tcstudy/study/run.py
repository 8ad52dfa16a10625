"""Run a study: level by level, point by point, each result handed on as soon as it is there."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tcstudy.condense import NotPositiveDefinite
from tcstudy.data.records import LevelRecord, PointRecord, PointStatus
from tcstudy.fem.geometry import GeometryFailed
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.scene.points import combinations
from tcstudy.scene.records import Scene, Study
from tcstudy.solve.certificates import certify
from tcstudy.solve.contact import solve_contact
from tcstudy.solve.outcome import Status
from tcstudy.study.family import Family
from tcstudy.study.level import Level
from tcstudy.study.live import live_arrays
from tcstudy.study.measures import Timed, friction_forces, numbers, sticking
from tcstudy.study.survey import Survey

Array = NDArray[np.float64]
Key = tuple[int, tuple[int, ...]]
"""A point at a level: (level, index)."""


@dataclass(frozen=True)
class LevelWork:
    """What a level holds in store: its points, those finished before, and the relative cost of one of them.

    sure: whether there will be this level, which refinement up to a tolerance may not need
    """

    points: int
    done: int
    weight: float
    sure: bool = True


class Watcher(Protocol):
    """What a run reports while it works; a terminal shows it, a test ignores it."""

    def begin(self, work: Sequence[LevelWork], warnings: Sequence[str]) -> None: ...
    def level(self, record: LevelRecord) -> None: ...
    def point(self, record: PointRecord) -> None: ...


def run(study: Study, finished: Mapping[Key, Array] | None = None) -> Iterator[LevelRecord | PointRecord]:
    """Yield each level's record, then the records of its points.

    finished: points to leave out, with their contact solutions (empty where they failed), which start their
              neighbours as if they had been solved in this run

    A point that fails is yielded with its status and reason, and the rest goes on. Points come in an order that
    reuses factors and loads, not in the order of the sweep.
    Raises GeometryFailed if the body cannot be meshed.
    """
    solutions = dict(finished or {})
    done = set(solutions)
    order = _order(study)
    family = Family(study)
    for i in range(study.mesh.levels):
        todo = [(index, scene) for index, scene in order if (i, index) not in done]
        try:
            mesh = family.next(i)
            level = Level(mesh, study.scenes[0], study.scenes) if todo or study.mesh.estimates else None
        except GeometryFailed as error:
            if i == 0 or len(study.mesh.maxh) == 1:
                raise
            yield from (_failed(index, i, PointStatus.MESH_FAILED, str(error)) for index, _ in todo)
            continue
        if level is None:
            continue
        record = level_record(study, mesh, level)
        yield record
        survey = family.survey(level)
        if survey is not None:
            known = ((index, scene) for index, scene in order if (i, index) in done)
            _look_again(survey, level, [(index, scene, solutions[i, index]) for index, scene in known])
        for index, scene in todo:
            point = solve_point(study, level, index, scene, _neighbour(solutions, i, index), survey)
            solutions[i, index] = point.u_T if point.status == PointStatus.OK else np.empty(0)
            yield point
        if survey is not None and (stop := survey.stop(i + 1 == study.mesh.levels)):
            yield replace(record, stop=stop)
            if study.mesh.family == "adaptive" or study.mesh.tolerance is not None:
                return


def _look_again(survey: Survey, level: Level, known: list[tuple[tuple[int, ...], Scene, Array]]) -> None:
    """Estimate what an earlier run has solved, since the next mesh depends on it."""
    for index, scene, v in known:
        if len(v):
            survey.look(index, scene, level.condensed(scene), v)


def _neighbour(solutions: Mapping[Key, Array], level: int, index: tuple[int, ...]) -> Array | None:
    """The solution one step back along the last sweep dimension that has a step back and a solution there.

    The order of the points sees to it that every step back has been solved before.
    """
    for d in reversed(range(len(index))):
        before = (level, (*index[:d], index[d] - 1, *index[d + 1 :]))
        if index[d] > 0 and len(solutions.get(before, ())):
            return solutions[before]
    return None


def _failed(index: tuple[int, ...], level: int, status: PointStatus, reason: str) -> PointRecord:
    """The record of a point without results."""
    return PointRecord(index, level, status, reason, {}, np.empty(0), np.empty(0))


def _order(study: Study) -> list[tuple[tuple[int, ...], Scene]]:
    """Points sorted so that those that share a factorisation and temperatures follow one another."""
    indices = list(np.ndindex(study.shape))
    scenes, of = combinations(study.scenes, "material", "heat")
    keys: dict[object, int] = {}
    material = [keys.setdefault(("material", s.material.lam, s.material.mu), len(keys)) for s in scenes]
    thermal = [keys.setdefault(("thermal", s.heat.alpha, s.material.k), len(keys)) for s in scenes]
    ranked = np.lexsort((np.array(thermal)[of], np.array(material)[of]))
    return [(indices[i], study.scenes[int(i)]) for i in ranked]


def solve_point(
    study: Study,
    level: Level,
    index: tuple[int, ...],
    scene: Scene,
    neighbour: Array | None = None,
    survey: Survey | None = None,
) -> PointRecord:
    """Solve one scene on one level; every failure becomes a status with its reason.

    neighbour: the contact solution of a neighbouring point, a start where the study's branch asks for one
    survey:    estimates the error of the solution, if that is asked for
    """
    try:
        return _solve_point(study, level, index, scene, neighbour, survey)
    except NotPositiveDefinite as error:
        status, reason = PointStatus.SINGULAR, str(error)
    except Exception as error:  # one point must not end a sweep; what it was stands in the data
        status, reason = PointStatus.ERROR, f"{type(error).__name__}: {error}"
    return _failed(index, level.mesh.level, status, reason)


def _solve_point(
    study: Study, level: Level, index: tuple[int, ...], scene: Scene, neighbour: Array | None, survey: Survey | None
) -> PointRecord:
    condensed = level.condensed(scene)
    problem, plan = condensed.problem, study.solver
    solved = []
    for name in plan.names:
        start = time.perf_counter()
        answer = solve_contact(problem, name, plan.tolerance, plan.max_iterations, plan.branch, neighbour)
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
    status = _POINT_STATUS.get(answer.status, PointStatus.NOT_CONVERGED)
    if survey is not None and status == PointStatus.OK:
        values |= survey.look(index, scene, condensed, answer.v)
    fields: dict[str, Array] = {}
    if study.output.fields:
        u = level.displacement(scene, condensed, answer.v)
        n = level.mesh.n_points
        fields = {"u_x": u[:n], "u_y": u[n:]}
        if temperature is not None:
            fields["theta"] = temperature.theta
    traction = friction_forces(problem, answer) / level.line.c
    sticks = sticking(problem.law, answer.v).astype(np.int8)
    return PointRecord(index, level.mesh.level, status, answer.reason, values, answer.v, traction, fields, sticks)


_POINT_STATUS = {
    Status.CONVERGED: PointStatus.OK,
    Status.INCLUSION_VIOLATED: PointStatus.INCLUSION_VIOLATED,
    Status.NOT_POSITIVE_DEFINITE: PointStatus.SINGULAR,
}


def level_record(study: Study, mesh: PlaneMesh, level: Level) -> LevelRecord:
    """What the data keep of a level: sizes, the contact line, and the mesh if fields are kept."""
    line = level.line
    fields: dict[str, NDArray[np.generic]] = {}
    if study.output.fields:
        fields = {
            "node_x": mesh.points[:, 0],
            "node_y": mesh.points[:, 1],
            "triangle": mesh.triangles.astype(np.int32),
        }
    if study.output.live:
        fields |= live_arrays(study, level)
    return LevelRecord(
        level=mesh.level,
        h_max=mesh.h_max,
        n_dof=level.frames.n_dof,
        n_contact=line.m,
        arclength=line.arclength,
        x=line.xy[:, 0],
        y=line.xy[:, 1],
        c=line.c,
        edge=line.edge,
        edge_names=line.edge_names,
        time_mesh=mesh.time_mesh,
        time_assemble=level.time_assemble,
        fields=fields,
    )
