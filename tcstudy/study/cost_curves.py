"""The meshes that a chart of accuracy against cost compares, solved level by level and timed.

One scene on the meshes of one family, timed stage by stage: what accuracy costs is measured on these steps.

Every walk starts from nothing: geometry, meshes, assembly, factorisation and solutions are made anew, as a run of this
one scene makes them. What a solver costs on top of the shared work is timed apart, so that solvers compare on the
same mesh, factor and machine noise.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from tcstudy.data.cost import OWN
from tcstudy.data.records import PointRecord, PointStatus
from tcstudy.errors import GeometryFailed
from tcstudy.offline.level import Level
from tcstudy.refine.family import Family
from tcstudy.scene.families import FAMILIES, FamilyName
from tcstudy.scene.records import Scene
from tcstudy.scene.study import MeshPlan, Study
from tcstudy.study.point import solve_point
from tcstudy.study.solved_levels import SolvedLevel, empty_level, solution_of

BEYOND = 4.2
"""How far beyond the study's own unknowns the curves go: one uniform refinement."""
MOST = 40_000
"""Unknowns up to which curves are drawn where the study's own mesh does not ask for more."""
LEVELS = 60
PATIENCE, WORTH = 3.0, 4.0
"""A solver is not followed to finer meshes once it takes this many seconds and this many times all other work."""


@dataclass
class CostCurve:
    """The measured levels of one family: sizes, records and solutions of the first run, stages of every run.

    own: level of the study's own settings, None if the family is not the study's
    """

    family: str
    plan: MeshPlan
    own: int | None = None
    steps: list[tuple[float, int, int]] = field(default_factory=list)
    records: list[dict[str, PointRecord]] = field(default_factory=list)
    solved: list[dict[str, SolvedLevel]] = field(default_factory=list)
    stages: list[list[dict[str, Stages]]] = field(default_factory=list)

    @property
    def finest(self) -> int:
        """Unknowns of the finest mesh."""
        return self.steps[-1][1]


def first_run(study: Study, scene: Scene, progress: Progress) -> tuple[list[CostCurve], list[str]]:
    """Solve everything once; the study's own meshes come first, since they say how far the others go."""
    notes: list[str] = []
    listed = on_a_curve(study.mesh)
    name = study.mesh.family if listed else OWN
    own = CostCurve(name, family_plan(study.mesh, study.mesh.family) if listed else study.mesh)
    for step in _steps(study, scene, own, progress, notes):
        full = study.mesh.strategy.adapts and step.n_dof > study.mesh.max_dofs
        if own.own is None and (len(own.steps) == study.mesh.levels or full):
            own.own = len(own.steps) - 1
        if own.own is not None and _next(own) > _limit(own.steps[own.own][1]):
            break
    if own.own is None:
        own.own = len(own.steps) - 1
    limit = _limit(own.steps[own.own][1])
    curves = [own]
    for family in FAMILIES:
        if family != own.family:
            curves.append(CostCurve(family, family_plan(study.mesh, family)))
            for _ in _steps(study, scene, curves[-1], progress, notes):
                if _next(curves[-1]) > limit:
                    break
    curves = sorted(curves, key=lambda c: (*FAMILIES, OWN).index(c.family))
    return _without_twins(curves, notes), notes


def _without_twins(curves: list[CostCurve], notes: list[str]) -> list[CostCurve]:
    """The curves without graded ones that are uniform (nothing is singular) or the other way round, if that is own."""
    uniform, graded = curves[0], curves[1]
    if any(a != b for a, b in zip(uniform.steps, graded.steps, strict=False)):
        return curves
    twin = uniform if graded.own is not None else graded
    notes.append("Graded and uniform meshes are the same here, as nothing is singular; they are shown once.")
    return [curve for curve in curves if curve is not twin]


def _limit(own: int) -> float:
    """Unknowns up to which curves go, if the study's own mesh has so many."""
    return max(float(own), min(BEYOND * own, MOST))


def on_a_curve(plan: MeshPlan) -> bool:
    """Whether the study's own meshes are those of a family, so that their finest is a point of its curve."""
    return plan.tolerance is None and not plan.listed and not plan.estimate


def family_plan(plan: MeshPlan, family: FamilyName) -> MeshPlan:
    """A family from the study's coarsest mesh, with its own grading, marking and goal."""
    own = replace(plan, maxh=plan.maxh[:1], levels=LEVELS, family=family)
    return replace(own, tolerance=None, max_dofs=10**9, estimate=False)


def _steps(
    study: Study, scene: Scene, curve: CostCurve, progress: Progress, notes: list[str]
) -> Iterator[MeasuredLevel]:
    """Solve the levels of a curve for the first time and keep them, as far as the caller goes on."""
    dropped: set[str] = set()

    def wanted(name: str, level: int) -> bool:  # noqa: ARG001
        return name not in dropped

    curve.stages.append([])
    try:
        for step in walk(study, curve.plan, scene, wanted):
            progress(f"{curve.family}, level {len(curve.steps)}: {step.n_dof} dofs", None)
            curve.stages[-1].append(step.stages)
            _keep(study, scene, curve, step)
            dropped |= _too_slow(step, curve, notes)
            yield step
    except GeometryFailed as error:
        if not curve.steps:
            raise
        notes.append(f"{curve.family} meshes end at level {len(curve.steps) - 1}: {error}")


def _next(curve: CostCurve) -> float:
    """Unknowns to expect of the next level: a uniform one has four times as many, an adaptive step may add few."""
    sizes = [n_dof for _, n_dof, _ in curve.steps]
    return sizes[-1] * (sizes[-1] / sizes[-2] if len(sizes) > 1 else curve.plan.strategy.least_growth)


def _keep(study: Study, scene: Scene, curve: CostCurve, step: MeasuredLevel) -> None:
    curve.steps.append((step.level.mesh.h_max, step.n_dof, step.level.line.m))
    curve.records.append(step.records)
    empty = empty_level(study, step.level)
    solved = {
        name: replace(empty, solutions={(): solution_of(study, step.level, scene, record)})
        for name, record in step.records.items()
    }
    curve.solved.append(solved)


def _too_slow(step: MeasuredLevel, curve: CostCurve, notes: list[str]) -> set[str]:
    """Solvers that are not worth waiting for on finer meshes of this family."""
    found = set()
    for name, stages in list(step.stages.items())[1:]:
        other = stages.total - stages.solve
        if stages.solve > PATIENCE and stages.solve > WORTH * other:
            found.add(name)
            notes.append(
                f"{name} is not followed beyond level {len(curve.steps) - 1} of the {curve.family} meshes: there its "
                f"solution took {stages.solve:.1f} s, {stages.solve / other:.0f} times all other work."
            )
    return found


def time_again(study: Study, scene: Scene, curve: CostCurve) -> None:
    """Time the levels of a curve once more, from nothing."""
    run: list[dict[str, Stages]] = []
    last = len(curve.steps)
    for step in walk(study, curve.plan, scene, lambda name, level: name in curve.records[level]):
        run.append(step.stages)
        if len(run) == last:
            break
    curve.stages.append(run)


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
class MeasuredLevel:
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


def walk(study: Study, plan: MeshPlan, scene: Scene, wanted: Wanted) -> Iterator[MeasuredLevel]:
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
        meshing = own if plan.listed else meshing + own
        clock = time.perf_counter()
        level = Level(mesh, scene, (scene,))
        assembly = time.perf_counter() - clock
        solved = {first: _timed(alone, level, scene, first)}
        solved |= {name: _timed(alone, level, scene, name) for name in others if wanted(name, i)}
        shared = solved[first].total - solved[first].solve
        estimation, estimate, stop = _estimate(alone, family, level, scene, solved[first].record, i)
        stages, chained = {}, plan.open_ended
        for name, timed in solved.items():
            solve = timed.solve
            made = geometry + (own if chained else meshing)
            steps = before[name] + (estimation if plan.tolerance is not None else 0.0)
            stages[name] = Stages(made, assembly, shared, solve, steps)
            if chained:
                before[name] += own + assembly + shared + solve + estimation
        records = {name: timed.record for name, timed in solved.items()}
        yield MeasuredLevel(level, records, stages, estimate, stop)
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
