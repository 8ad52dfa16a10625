"""Accuracy against cost for one scene of a study: mesh families × solvers × levels, timed several times.

Errors are measured against the exact solution if the study gives one, else against an adaptive mesh with at least
FINER times the unknowns of the finest mesh measured. Every walk along the meshes of one family starts from nothing:
geometry, meshes, assembly, factorisation and solutions are made anew. What a solver costs on top of the shared work is
timed apart, so that solvers compare on the same mesh, factor and machine noise. Families take turns, so that a slow
spell of the machine does not fall on one of them alone.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tcstudy.accuracy.orders import dominated
from tcstudy.data.files import check_writable
from tcstudy.data.measured import BOUND, COST_TABLE, MEASURES, OWN, STAGES
from tcstudy.data.provenance import collect, tell
from tcstudy.data.records import PointStatus
from tcstudy.data.store import Record, missing, write_record
from tcstudy.errors import CostError, GeometryFailed, StoreError
from tcstudy.fem.meshes import graded_points
from tcstudy.laws.composed import EdgeLaws
from tcstudy.scene.study import FAMILIES, SOLVERS, TO_TOLERANCE, FamilyName, Goal, MeshPlan, Study
from tcstudy.study.lint import warnings
from tcstudy.study.point import solve_point
from tcstudy.study.reference import Errors, ExactReference, FineReference, Reference, with_meaning
from tcstudy.study.run import stages
from tcstudy.study.solved_levels import SolvedLevel, empty_level, solution_of

Array = NDArray[np.float64]
Progress = Callable[[str, float | None], None]
"""(what is being done, seconds left if known)."""

RUNS = 5
"""How often everything is timed."""
BEYOND = 4.2
"""How far beyond the study's own unknowns the curves go: one uniform refinement."""
MOST = 40_000
"""Unknowns up to which curves are drawn where the study's own mesh does not ask for more."""
LEVELS = 60
PATIENCE, WORTH = 3.0, 4.0
"""A solver is not followed to finer meshes once it takes this many seconds and this many times all other work."""
FINER = 10
LARGEST = 1_500_000
LEAST = 2
"""Unknowns of the reference over those of the finest mesh compared with it: FINER, but less for the sake of LARGEST."""
SAME = 1e-8
"""Relative difference of two solvers' u_T that makes no difference to an error."""


def cost_to_file(
    study: Study, index: tuple[int, ...], point: str, runs: int, path: Path, progress: Progress, command: Sequence[str]
) -> int:
    """Measure accuracy against cost at one sweep point into a file; returns the number of solutions that failed.

    Raises CostError, StoreError if the file cannot be written, GeometryFailed if the body cannot be meshed.
    """
    if problems := check_writable(path, 1_000_000):
        raise StoreError("; ".join(problems))
    tell(remarks := warnings(at_point(study, index)))
    with threadpool_limits(1, user_api="blas"):
        cost = measure(study, index, runs, progress)
    cost = replace(cost, attributes={**cost.attributes, "point": point})
    write_record(path, study, cost, collect(study, command, remarks=remarks))
    return int(np.count_nonzero(~np.isin(cost.values["status"], (PointStatus.OK, PointStatus.NOT_RUN))))


def at_point(study: Study, index: tuple[int, ...]) -> Study:
    """The study of one point of the sweep alone, on its own geometry.

    Raises GeometryFailed with the reason where the geometry is refused.
    """
    row = place = int(np.ravel_multi_index(index, study.shape))
    if study.variants:
        variant = next(one for one in study.variants if place in one.places)
        if variant.study is None:
            remedy = "name another geometry by --at, or take this one out of the sweep"
            raise GeometryFailed(f"{variant.words}: {variant.reason}; {remedy}", ("sweep",))
        study, row = variant.study, int(np.flatnonzero(variant.places == place)[0])
    return replace(study, scenes=(study.scenes[row],), axes=())


def measure(study: Study, index: tuple[int, ...], runs: int, progress: Progress) -> Record:
    """Errors and wall times of one sweep point on all families with all solvers.

    index: which sweep point;  runs: how often everything is timed
    Raises CostError if no mesh could be solved, GeometryFailed if the body cannot be meshed.
    """
    study = at_point(study, index)
    (scene,) = study.scenes
    what = "materials differ by region" if scene.material.regions else "friction differs along the contact line"
    if (scene.material.regions or isinstance(scene.friction, EdgeLaws)) and study.mesh.goal.quantity != "energy":
        raise CostError(f"{what}, and errors of goals are not estimated then; set mesh.goal=energy")
    names = dict.fromkeys((*study.solver.names, *SOLVERS))
    study = replace(study, solver=replace(study.solver, names=tuple(names)))
    clock, notes = time.perf_counter(), list[str]()
    curves = first_run(study, progress, notes)
    first = time.perf_counter() - clock
    errors, words, own_error = errors_of(study, curves, progress)
    if study.mesh.guarantee:
        for curve in curves:
            add_bounds(study, curve, errors, progress)
    for run in range(1, runs):
        progress(f"run {run + 1} of {runs}", first * (runs - run))
        turn = run % len(curves)
        for curve in curves[turn:] + curves[:turn]:
            curve.time_again(study)
    return _record(study, curves, errors, notes, {"reference": words, "reference_error": float(own_error)})


def first_run(study: Study, progress: Progress, notes: list[str]) -> list[CostCurve]:
    """Solve everything once; the study's own meshes come first, since they say how far the others go."""
    mesh = study.mesh
    own = CostCurve(OWN, mesh)
    if mesh.tolerance is None and not mesh.listed and not mesh.estimate:  # their finest is a point of a family's curve
        own = CostCurve(mesh.family, family_plan(mesh, mesh.family))
    for _ in own.first_run(study, progress, notes):
        full = mesh.strategy.adapts and own.n_dof > mesh.max_dofs
        if own.own is None and (len(own.solved) == mesh.levels or full):
            own.own, limit = len(own.solved) - 1, _limit(own)
        if own.own is not None and own.next > limit:
            break
    if own.own is None:
        own.own, limit = len(own.solved) - 1, _limit(own)
    twin = ""
    if not graded_points(replace(study, mesh=family_plan(mesh, "graded"))):
        twin = "uniform" if own.family == "graded" else "graded"
        notes.append("Graded and uniform meshes are the same here, as nothing is singular; they are shown once.")
    others = [CostCurve(name, family_plan(mesh, name)) for name in FAMILIES if name not in (own.family, twin)]
    for curve in others:
        for _ in curve.first_run(study, progress, notes):
            if curve.next > limit:
                break
    return sorted((own, *others), key=lambda curve: (*FAMILIES, OWN).index(curve.family))


def _limit(own: CostCurve) -> float:
    """Unknowns up to which curves go, as the study's own mesh, reached just now, has so many."""
    return max(float(own.n_dof), min(BEYOND * own.n_dof, MOST))


def family_plan(plan: MeshPlan, family: FamilyName) -> MeshPlan:
    """A family from the study's coarsest mesh, with its own grading, marking and goal."""
    own = replace(plan, maxh=plan.maxh[:1], levels=LEVELS, family=family)
    return replace(own, tolerance=None, max_dofs=10**9, estimate=False, guarantee=False)


@dataclass
class CostCurve:
    """The measured levels of one family.

    own:    level of the study's own settings, None if the family is not the study's
    solved: by level what its solvers found, by name;  stages: by run and level what that took
    """

    family: str
    plan: MeshPlan
    own: int | None = None
    solved: list[dict[str, SolvedLevel]] = field(default_factory=list)
    stages: list[list[dict[str, Stages]]] = field(default_factory=list)

    @property
    def sizes(self) -> list[int]:
        """Unknowns by level."""
        return [next(iter(found.values())).n_dof for found in self.solved]

    @property
    def n_dof(self) -> int:
        """Unknowns of the last level."""
        return self.sizes[-1]

    @property
    def next(self) -> float:
        """Those to expect of the next: a uniform level has four times as many, an adaptive step may add few."""
        sizes = self.sizes
        return sizes[-1] * (sizes[-1] / sizes[-2] if len(sizes) > 1 else self.plan.strategy.least_growth)

    def first_run(self, study: Study, progress: Progress, notes: list[str]) -> Iterator[None]:
        """Solve the levels and keep them, as far as the caller goes on, with all solvers that are worth the wait."""
        dropped: set[str] = set()
        self.stages.append([])
        try:
            for step in walk(study, self.plan, lambda name, _: name not in dropped):
                self.stages[-1].append(step.stages)
                self.solved.append(step.solved)
                progress(f"{self.family}, level {len(self.solved) - 1}: {self.n_dof} dofs", None)
                for name, taken in list(step.stages.items())[1:]:
                    other = taken.total - taken.solve
                    if taken.solve > PATIENCE and taken.solve > WORTH * other:
                        dropped.add(name)
                        notes.append(
                            f"{name} is not followed beyond level {len(self.solved) - 1} of the {self.family} meshes: "
                            f"there its solution took {taken.solve:.1f} s, {taken.solve / other:.0f} times all other "
                            "work."
                        )
                yield
        except GeometryFailed as error:
            if not self.solved:
                raise
            notes.append(f"{self.family} meshes end at level {len(self.solved) - 1}: {error}")

    def time_again(self, study: Study) -> None:
        """Time the levels once more, from nothing."""
        self.stages.append([])
        for step in walk(study, self.plan, lambda name, level: name in self.solved[level]):
            self.stages[-1].append(step.stages)
            if len(self.stages[-1]) == len(self.solved):
                break


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


class MeasuredLevel(NamedTuple):
    """One level of a walk: what came of the solvers that were run, and how long it took, by name.

    estimate: estimated relative error in the energy norm, NaN where the family needs none
    """

    solved: dict[str, SolvedLevel]
    stages: dict[str, Stages]
    estimate: float


def walk(study: Study, plan: MeshPlan, wanted: Callable[[str, int], bool]) -> Iterator[MeasuredLevel]:
    """Run a study of one point level by level; the first of its solvers decides about meshes, others take turns there.

    wanted: which other solvers to run on which level. Raises GeometryFailed if the body cannot be meshed.
    """
    first, *others = study.solver.names
    only = {name: replace(study.solver, names=(name,)) for name in study.solver.names}
    output = replace(study.output, fields=True, live=False)
    alone = replace(study, mesh=plan, output=output, solver=only[first])
    meshing, before = 0.0, dict.fromkeys(study.solver.names, 0.0)
    for i, stage in enumerate(stages(alone)):
        level, times = stage.level, stage.times
        if level is None:
            raise GeometryFailed(next(stage.blocks).reasons[0])
        [block] = stage.blocks
        stop = stage.stop()
        blocks = {first: block}
        blocks |= {n: solve_point(replace(alone, solver=only[n]), level, 0) for n in others if wanted(n, i)}
        found = {name: solution_of(alone, level, one) for name, one in blocks.items()}
        spent = {name: one.numbers.get("time_solve", math.nan) for name, one in found.items()}
        meshing = times.mesh if plan.listed else meshing + times.mesh
        shared, taken = times.points - spent[first], dict[str, Stages]()
        for name, solve in spent.items():
            made = times.geometry + (times.mesh if plan.open_ended else meshing)
            steps = before[name] + (times.estimate if plan.tolerance is not None else 0.0)
            taken[name] = Stages(made, times.assemble, shared, solve, steps)
            if plan.open_ended:
                before[name] += times.mesh + times.assemble + shared + solve + times.estimate
        empty = empty_level(study, level)
        solved = {name: replace(empty, solutions={(): one}) for name, one in found.items()}
        yield MeasuredLevel(solved, taken, found[first].numbers.get("error_estimate", math.nan))
        if stop:
            return


def errors_of(
    study: Study, curves: list[CostCurve], progress: Progress
) -> tuple[dict[tuple[str, int, str], dict[str, float]], str, float]:
    """Relative errors by (family, level, solver), what they are measured against, and the reference's own error.

    Raises CostError if there is no solution to compare with.
    """
    words, own_error, scene = "the exact solution", 0.0, study.scenes[0]
    if study.exact is not None:
        reference: Reference = ExactReference(study.exact)
    else:
        finest_dofs = max(curve.n_dof for curve in curves)
        least = max(LEAST * finest_dofs, min(FINER * finest_dofs, LARGEST))
        best, own_error = _reference(study, least, progress)
        reference = FineReference(best)
        words = f"adaptive mesh of {best.n_dof} dofs, with an estimated error of {100 * own_error:.2g} % in energy"
    found, sizes, finest = {}, {}, 0
    for curve in curves:
        for level, by_solver in enumerate(curve.solved):
            progress(f"errors of {curve.family}, level {level}", None)
            known: list[tuple[SolvedLevel, Errors]] = []
            for name, one in by_solver.items():
                errors = next((e for other, e in known if _same(one, other)), None)
                if errors is None:
                    errors = reference.errors(one, (), scene)
                    for what, value in reference.numbers(scene).items():
                        if math.isfinite(value):
                            errors[what] = abs(one.solutions[()].numbers.get(what, math.nan) - value), abs(value)
                    known.append((one, errors := with_meaning(errors, scene)))
                found[curve.family, level, name] = errors
                if one.n_dof > finest and errors:
                    finest, sizes = one.n_dof, {measure: size for measure, (_, size) in errors.items()}
    relative = {
        key: {measure: e / sizes[measure] for measure, (e, _) in errors.items() if sizes.get(measure, 0.0) > 0.0}
        for key, errors in found.items()
    }
    if not any(relative.values()):
        remedy = "give it a load, for example by --set, or name a sweep point that has one by --at"
        raise CostError(f"nothing loads this scene: its solution is zero, and errors have no size; {remedy}")
    return relative, words, own_error


def add_bounds(
    study: Study, curve: CostCurve, errors: dict[tuple[str, int, str], dict[str, float]], progress: Progress
) -> None:
    """Add the proved bounds of the error on all levels of a family, found by a walk of its own, which is not timed."""
    plan, first = replace(curve.plan, guarantee=True), study.solver.names[0]
    for level, step in enumerate(islice(walk(study, plan, lambda name, level: False), len(curve.solved))):
        progress(f"bounds of {curve.family}, level {level}", None)
        bound = step.solved[first].solutions[()].numbers.get("error_bound_relative", math.nan)
        for name, one in curve.solved[level].items():
            if math.isfinite(bound) and _same(one, curve.solved[level][first]):
                errors[curve.family, level, name][BOUND.name] = bound


def _same(one: SolvedLevel, other: SolvedLevel) -> bool:
    """Whether two solvers found the same solution on one mesh."""
    a, b = one.solutions[()], other.solutions[()]
    if a.u is None or b.u is None:
        return False
    return float(np.max(np.abs(a.v - b.v), initial=0.0)) <= SAME * float(np.max(np.abs(a.v), initial=0.0))


def _reference(study: Study, least: float, progress: Progress) -> tuple[SolvedLevel, float]:
    """The solution on an adaptive mesh of at least so many unknowns, and its estimated relative error.

    Raises CostError if it is not solved, GeometryFailed if there is no mesh that is fine enough.
    """
    plan = replace(family_plan(study.mesh, TO_TOLERANCE), goal=Goal(), marking=max(study.mesh.marking, 0.7))
    step = None
    try:
        for step in walk(study, plan, lambda name, level: False):
            (best,) = step.solved.values()
            progress(f"reference: {best.n_dof} of at least {least:.0f} dofs", None)
            if best.n_dof >= least:
                break
    except GeometryFailed:  # triangles too small for the mesher: the mesh before serves if it is fine enough
        if step is None or best.n_dof < least * LEAST / FINER:
            raise
    assert step is not None
    found = best.solutions[()]
    if found.status != PointStatus.OK:
        why = found.reason or found.status.name.lower()
        raise CostError(f"the reference, an adaptive mesh of {best.n_dof} dofs, was not solved: {why}")
    return best, step.estimate


def _record(
    study: Study,
    curves: list[CostCurve],
    errors: dict[tuple[str, int, str], dict[str, float]],
    notes: list[str],
    told: dict[str, Any],
) -> Record:
    """All curves as arrays, padded to the longest. told: attributes of the reference."""
    solvers, runs = study.solver.names, len(curves[0].stages)
    levels = max(len(curve.solved) for curve in curves)
    sizes = {"family": len(curves), "solver": len(solvers), "level": levels, "run": runs}
    measured = [m.name for m in MEASURES if any(m.name in one for one in errors.values())]
    wanted = {f"{what}_{name}" for what in ("error", "dominated") for name in measured}
    table = [v for v in COST_TABLE if v.name in wanted or not v.name.startswith(("error_", "dominated_"))]
    values: dict[str, Any] = {v.name: missing(v, tuple(sizes[dim] for dim in v.dims)) for v in table}
    values |= {"family": [curve.family for curve in curves], "solver": solvers}
    values |= {"level": np.arange(levels), "run": np.arange(runs)}
    values["reason"][:] = ""
    for f, curve in enumerate(curves):
        for level, by_solver in enumerate(curve.solved):
            for solver, one in by_solver.items():
                at, own = (f, solvers.index(solver), level), [run[level][solver] for run in curve.stages]
                best, found = min(own, key=lambda taken: taken.total), one.solutions[()]
                row = {"status": found.status, "reason": found.reason, "time": [taken.total for taken in own]}
                row |= {f"time_{stage}": getattr(best, stage) for stage in STAGES}
                row |= {f"error_{name}": error for name, error in errors[curve.family, level, solver].items()}
                for name in row.keys() & values.keys():
                    values[name][at] = row[name]
                for name, size in (("h_max", one.h_max), ("n_dof", one.n_dof), ("n_contact", len(one.line.nodes))):
                    values[name][f, level] = size
    if any(curve.solved[-1][solvers[0]].solutions[()].numbers.get("unique") == 0 for curve in curves):
        notes.append(
            "The solution is not certified to be the only one: meshes and solvers may have found different ones, "
            "which shows as an error that does not fall."
        )
    fastest = np.where(values["status"] == PointStatus.OK, np.min(values["time"], axis=-1), np.nan)
    for name in measured:
        error = values[f"error_{name}"]
        values[f"dominated_{name}"] = dominated(fastest.ravel(), error.ravel()).reshape(error.shape)
    chosen = next(curve for curve in curves if curve.own is not None)
    own_level = {"own_family": chosen.family, "own_solver": solvers[0], "own_level": np.int32(chosen.own or 0)}
    return Record("cost", COST_TABLE, values, told | own_level | {"runs": np.int32(runs), "notes": "\n".join(notes)})
