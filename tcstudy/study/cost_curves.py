"""The meshes that a chart of accuracy against cost compares, solved level by level and timed.

Every walk is a run of one scene on the meshes of one family, from nothing: geometry, meshes, assembly, factorisation
and solutions are made anew. What a solver costs on top of the shared work is timed apart, so that solvers compare on
the same mesh, factor and machine noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from tcstudy.data.measured import OWN
from tcstudy.errors import GeometryFailed
from tcstudy.offline.level import Level
from tcstudy.scene.families import FAMILIES, FamilyName
from tcstudy.scene.study import MeshPlan, SolverPlan, Study
from tcstudy.study.point import solve_point
from tcstudy.study.run import stages
from tcstudy.study.solved_levels import Solution, SolvedLevel, empty_level, solution_of

BEYOND = 4.2
"""How far beyond the study's own unknowns the curves go: one uniform refinement."""
MOST = 40_000
"""Unknowns up to which curves are drawn where the study's own mesh does not ask for more."""
LEVELS = 60
PATIENCE, WORTH = 3.0, 4.0
"""A solver is not followed to finer meshes once it takes this many seconds and this many times all other work."""


@dataclass
class CostCurve:
    """The measured levels of one family: sizes and solutions of the first run, stages of every run.

    own: level of the study's own settings, None if the family is not the study's
    """

    family: str
    plan: MeshPlan
    own: int | None = None
    steps: list[tuple[float, int, int]] = field(default_factory=list)
    solved: list[dict[str, SolvedLevel]] = field(default_factory=list)
    stages: list[list[dict[str, Stages]]] = field(default_factory=list)


def first_run(study: Study, progress: Progress) -> tuple[list[CostCurve], list[str]]:
    """Solve everything once; the study's own meshes come first, since they say how far the others go."""
    notes: list[str] = []
    mesh = study.mesh
    own = CostCurve(OWN, mesh)
    if mesh.tolerance is None and not mesh.listed and not mesh.estimate:  # their finest is a point of a family's curve
        own = CostCurve(mesh.family, family_plan(mesh, mesh.family))
    for step in _steps(study, own, progress, notes):
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
            for _ in _steps(study, curves[-1], progress, notes):
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


def family_plan(plan: MeshPlan, family: FamilyName) -> MeshPlan:
    """A family from the study's coarsest mesh, with its own grading, marking and goal."""
    own = replace(plan, maxh=plan.maxh[:1], levels=LEVELS, family=family)
    return replace(own, tolerance=None, max_dofs=10**9, estimate=False, guarantee=False)


def _steps(study: Study, curve: CostCurve, progress: Progress, notes: list[str]) -> Iterator[MeasuredLevel]:
    """Solve the levels of a curve for the first time and keep them, as far as the caller goes on."""
    dropped: set[str] = set()
    curve.stages.append([])
    try:
        for step in walk(study, curve.plan, lambda name, _: name not in dropped):
            progress(f"{curve.family}, level {len(curve.steps)}: {step.n_dof} dofs", None)
            curve.stages[-1].append(step.stages)
            curve.steps.append((step.level.mesh.h_max, step.n_dof, step.level.line.m))
            curve.solved.append(step.solved(study))
            dropped.update(_too_slow(step, curve, notes))
            yield step
    except GeometryFailed as error:
        if not curve.steps:
            raise
        notes.append(f"{curve.family} meshes end at level {len(curve.steps) - 1}: {error}")


def _next(curve: CostCurve) -> float:
    """Unknowns to expect of the next level: a uniform one has four times as many, an adaptive step may add few."""
    sizes = [n_dof for _, n_dof, _ in curve.steps]
    return sizes[-1] * (sizes[-1] / sizes[-2] if len(sizes) > 1 else curve.plan.strategy.least_growth)


def _too_slow(step: MeasuredLevel, curve: CostCurve, notes: list[str]) -> set[str]:
    """Solvers that are not worth waiting for on finer meshes of this family."""
    found = set()
    for name, taken in list(step.stages.items())[1:]:
        other = taken.total - taken.solve
        if taken.solve > PATIENCE and taken.solve > WORTH * other:
            found.add(name)
            notes.append(
                f"{name} is not followed beyond level {len(curve.steps) - 1} of the {curve.family} meshes: there its "
                f"solution took {taken.solve:.1f} s, {taken.solve / other:.0f} times all other work."
            )
    return found


def time_again(study: Study, curve: CostCurve) -> None:
    """Time the levels of a curve once more, from nothing."""
    curve.stages.append([])
    for step in walk(study, curve.plan, lambda name, level: name in curve.solved[level]):
        curve.stages[-1].append(step.stages)
        if len(curve.stages[-1]) == len(curve.steps):
            break


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

    solutions, stages: what came of the solvers that were run, and how long it took, by name
    estimate:        estimated relative error in the energy norm, NaN where the family needs none
    stop:            why it is the last level, empty if it is not
    """

    level: Level
    solutions: dict[str, Solution]
    stages: dict[str, Stages]
    estimate: float
    stop: str

    @property
    def n_dof(self) -> int:
        """Displacement unknowns."""
        return self.level.frames.n_dof

    def solved(self, study: Study) -> dict[str, SolvedLevel]:
        """What the solvers found, for comparison, by name."""
        empty = empty_level(study, self.level)
        return {name: replace(empty, solutions={(): solution}) for name, solution in self.solutions.items()}


def walk(study: Study, plan: MeshPlan, wanted: Wanted) -> Iterator[MeasuredLevel]:
    """Run a study of one point level by level; the first of its solvers decides about meshes, others take turns there.

    wanted: which other solvers to run on which level. Raises GeometryFailed if the body cannot be meshed.
    """
    first, *others = study.solver.names
    output = replace(study.output, fields=True, live=False)
    alone = replace(study, mesh=plan, output=output, solver=_only(study, first))
    meshing, before = 0.0, dict.fromkeys(study.solver.names, 0.0)
    for i, stage in enumerate(stages(alone)):
        level, times = stage.level, stage.times
        if level is None:
            raise GeometryFailed(next(stage.blocks).reasons[0])
        [block] = stage.blocks
        stop = stage.stop()
        found = {first: solution_of(alone, level, block)}
        for name in others:
            if wanted(name, i):
                block = solve_point(replace(alone, solver=_only(study, name)), level, 0)
                found[name] = solution_of(alone, level, block)
        meshing = times.mesh if plan.listed else meshing + times.mesh
        shared = times.points - found[first].numbers.get("time_solve", math.nan)
        taken, chained = {}, plan.open_ended
        for name, one in found.items():
            solve = one.numbers.get("time_solve", math.nan)
            made = times.geometry + (times.mesh if chained else meshing)
            steps = before[name] + (times.estimate if plan.tolerance is not None else 0.0)
            taken[name] = Stages(made, times.assemble, shared, solve, steps)
            if chained:
                before[name] += times.mesh + times.assemble + shared + solve + times.estimate
        yield MeasuredLevel(level, found, taken, found[first].numbers.get("error_estimate", math.nan), stop)
        if stop:
            return


def _only(study: Study, solver: str) -> SolverPlan:
    return replace(study.solver, names=(solver,))
