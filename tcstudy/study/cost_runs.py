"""One scene on the meshes of one family, timed stage by stage: what accuracy costs is measured on these steps.

Every walk starts from nothing: geometry, meshes, assembly, factorisation and solutions are made anew, as a run of this
one scene makes them. What a solver costs on top of the shared work is timed apart, so that solvers compare on the
same mesh, factor and machine noise.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from tcstudy.data.records import PointRecord, PointStatus
from tcstudy.scene.records import MeshPlan, Scene, Study
from tcstudy.study.family import Family
from tcstudy.study.level import Level
from tcstudy.study.point import solve_point

Progress = Callable[[str, float | None], None]
"""(what is being done, seconds left if known)."""
Wanted = Callable[[str, int], bool]
"""(solver, level) → whether the solver is to be run there."""


@dataclass(frozen=True)
class Stages:
    """Wall time of one solution, from the body to its displacements [s].

    mesh:     geometry and meshing;  assemble: matrices and contact line
    condense: factorisation, temperature, condensed load, certificates and the way back to the body
    solve:    the contact problem;  steps: all levels before, with their estimates, where the mesh depends on them
    """

    mesh: float
    assemble: float
    condense: float
    solve: float
    steps: float

    @property
    def total(self) -> float:
        """Everything [s]."""
        return self.mesh + self.assemble + self.condense + self.solve + self.steps


@dataclass(frozen=True)
class Step:
    """One level of a walk.

    records, stages: what came of the solvers that were run, and how long it took, by name
    estimate:        estimated relative error in the energy norm, NaN where the family needs none
    stop:            why it is the last level, empty if it is not
    """

    level: Level
    records: dict[str, PointRecord]
    stages: dict[str, Stages]
    estimate: float
    stop: str

    @property
    def n_dof(self) -> int:
        """Displacement unknowns."""
        return self.level.frames.n_dof


def depends_on_solutions(plan: MeshPlan) -> bool:
    """Whether a mesh, or the decision to stop at it, follows from the solutions on those before."""
    return plan.family == "adaptive" or plan.tolerance is not None


def walk(study: Study, plan: MeshPlan, scene: Scene, wanted: Wanted) -> Iterator[Step]:
    """Solve a scene level by level with the study's solvers; the first of them decides about meshes.

    wanted: which other solvers to run on which level. Raises GeometryFailed if the body cannot be meshed.
    """
    first, *others = study.solver.names
    alone = replace(study, mesh=plan, scenes=(scene,), axes=(), output=replace(study.output, fields=True))
    clock = time.perf_counter()
    family = Family(alone)
    geometry = time.perf_counter() - clock
    meshing, before = 0.0, dict.fromkeys(study.solver.names, 0.0)
    for i in range(plan.levels):
        clock = time.perf_counter()
        mesh = family.next(i)
        own = time.perf_counter() - clock
        meshing = meshing + own if len(plan.maxh) == 1 else own
        clock = time.perf_counter()
        level = Level(mesh, scene, (scene,))
        assembly = time.perf_counter() - clock
        solved = {first: _timed(alone, level, scene, first)}
        solved |= {name: _timed(alone, level, scene, name) for name in others if wanted(name, i)}
        shared = solved[first].total - solved[first].solve
        estimation, estimate, stop = _estimate(alone, family, level, scene, solved[first].record, i)
        stages, chained = {}, depends_on_solutions(plan)
        for name, timed in solved.items():
            solve = timed.solve
            made = geometry + (own if chained else meshing)
            steps = before[name] + (estimation if plan.tolerance is not None else 0.0)
            stages[name] = Stages(made, assembly, shared, solve, steps)
            if chained:
                before[name] += own + assembly + shared + solve + estimation
        records = {name: timed.record for name, timed in solved.items()}
        yield Step(level, records, stages, estimate, stop)
        if stop:
            return


@dataclass(frozen=True)
class _Timed:
    """The record of a solution, all it took, and the contact problem alone [s], NaN if it was not solved."""

    record: PointRecord
    total: float
    solve: float


def _timed(study: Study, level: Level, scene: Scene, solver: str) -> _Timed:
    study = replace(study, solver=replace(study.solver, names=(solver,)))
    clock = time.perf_counter()
    record = solve_point(study, level, (), scene)
    total = time.perf_counter() - clock
    solve = record.numbers.get("time_solve", float("nan"))
    assert isinstance(solve, float)
    return _Timed(record, total, solve)


def _estimate(
    study: Study, family: Family, level: Level, scene: Scene, record: PointRecord, i: int
) -> tuple[float, float, str]:
    """Time of the error estimate, if the family needs one, the estimate, and why there is no further level."""
    clock = time.perf_counter()
    survey = family.survey(level)
    if survey is None:
        return 0.0, float("nan"), ""
    estimate = float("nan")
    if record.status == PointStatus.OK:
        estimate = survey.look((), scene, level.condensed(scene), record.u_T)["error_estimate"]
    stop = survey.stop(i + 1 == study.mesh.levels)
    return time.perf_counter() - clock, estimate, stop
