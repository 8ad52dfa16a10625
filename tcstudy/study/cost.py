"""Accuracy against cost for one scene of a study: mesh families × solvers × levels, timed several
times.

Errors are measured against the exact solution if the study gives one, else against an adaptive mesh
with at least FINER times the unknowns of the finest mesh measured. Every walk along the meshes of
one family starts from nothing: geometry, meshes, assembly, factorisation and solutions are made
anew. What a solver costs on top of the shared work is timed apart, so that solvers compare on the
same mesh, factor and machine noise. Families take turns, so that a slow spell of the machine does
not fall on one of them alone.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.orders import dominated, equal_settings
from tcstudy.data.records import Journal, Record
from tcstudy.data.schema import PointStatus, missing
from tcstudy.data.tables import BOUND, COST_TABLE, MEASURES, OWN
from tcstudy.errors import CostError, GeometryFailed
from tcstudy.fem.meshes import graded_points
from tcstudy.laws.composed import EdgeLaws
from tcstudy.scene.mesh_plan import FAMILIES, FamilyName, Goal, MeshPlan
from tcstudy.scene.solver_plan import SOLVERS
from tcstudy.scene.study import Study
from tcstudy.study.level_solver import solve_point
from tcstudy.study.reference import (
    Errors,
    ExactReference,
    FineReference,
    Reference,
    Solution,
    SolvedLevel,
    solution_of,
)
from tcstudy.study.run import stages, to_file

Progress = Callable[[str, float | None], None]
"""(what is being done, seconds left if known)."""
Array = NDArray[np.float64]
Times = dict[str, float]
"""Wall time of one solution, from the body to its displacements, by solver [s]."""

BEYOND = 4.2
"""How far beyond the study's own unknowns the curves go: one uniform refinement."""
MOST = 40_000
"""Unknowns up to which curves are drawn where the study's own mesh does not ask for more."""
LEVELS = 60
PATIENCE, WORTH = 3.0, 4.0
"""A solver is not followed to finer meshes once it takes this many seconds and this many times all
other work."""
FINER = 10
LARGEST = 1_500_000
LEAST = 2
"""Unknowns of the reference over those of the finest mesh compared with it: FINER, but less for the
sake of LARGEST."""
SAME = 1e-8
"""Relative difference of two solvers' u_T that makes no difference to an error."""


def cost_to_file(
    study: Study,
    index: tuple[int, ...],
    point: str,
    runs: int,
    path: Path,
    progress: Progress,
    command: Sequence[str],
    lock: Journal | None = None,
) -> None:
    """Measure accuracy against cost at a sweep point into a file.

    lock: that of the file, if it was taken before
    Raises CostError, StoreError, GeometryFailed.
    """
    alone = at_point(study, index)

    def find() -> Record:
        return measure(alone, runs, progress, {"point": point})

    to_file(path, study, command, find, alone, lock=lock)


def at_point(study: Study, index: tuple[int, ...]) -> Study:
    """The study of one point of the sweep alone, on its own geometry. Raises GeometryFailed where
    that is refused."""
    row = place = int(np.ravel_multi_index(index, study.shape))
    if study.variants:
        variant = next(one for one in study.variants if place in one.places)
        if variant.study is None:
            remedy = "name another geometry by --at, or take this one out of the sweep"
            raise GeometryFailed(f"{variant.words}: {variant.reason}; {remedy}", ("sweep",))
        study, row = variant.study, int(np.flatnonzero(variant.places == place)[0])
    return replace(study, scenes=(study.scenes[row],), axes=())


def measure(
    study: Study, runs: int, progress: Progress, told: dict[str, Any] | None = None
) -> Record:
    """Errors and wall times of a study of one point on all families with all solvers, all of it
    timed `runs` times.

    Raises CostError if no mesh could be solved, GeometryFailed if the body cannot be meshed.
    """
    (scene,) = study.scenes
    what = (
        "materials differ by region"
        if scene.material.regions
        else "friction differs along the contact line"
    )
    if (
        scene.material.regions or isinstance(scene.friction, EdgeLaws)
    ) and study.mesh.goal.quantity != "energy":
        raise CostError(f"{what}, and errors of goals are not estimated then; set mesh.goal=energy")
    solvers = tuple(dict.fromkeys((*study.solver.names, *SOLVERS)))
    study = replace(study, solver=replace(study.solver, names=solvers))
    clock, notes = time.perf_counter(), list[str]()
    curves = first_run(study, progress, notes)
    first = time.perf_counter() - clock
    reference, words, own_error = reference_of(study, curves, progress)
    values = errors_of(study, curves, reference, runs, progress)
    for run in range(runs):
        if run:
            progress(f"run {run + 1} of {runs}", first * (runs - run))
        turn = run % len(curves)
        for f, curve in [*enumerate(curves)][turn:] + [*enumerate(curves)][:turn]:
            known, plan = (
                curve.levels,
                curve.plan if curve.family == OWN else replace(curve.plan, guarantee=False),
            )
            already_solved = partial(_has_solution, known)
            steps = walk(study, plan, already_solved)
            for i, times in enumerate(
                [times for _, times in islice(steps, len(known))] if run else curve.times
            ):
                for name, taken in times.items():
                    values["time"][f, solvers.index(name), i, run] = taken
    if any(curve.levels[-1].solutions[solvers[0]].numbers.get("unique") == 0 for curve in curves):
        notes.append(
            "The solution is not certified to be the only one: meshes and solvers may have found different ones, "
            "which shows as an error that does not fall."
        )
    for name in [m.name for m in MEASURES if f"error_{m.name}" in values]:
        values[f"dominated_{name}"] = _dominated(values, values[f"error_{name}"])
    chosen = next(curve for curve in curves if curve.own is not None)
    said = {
        "reference": words,
        "reference_error": own_error,
        "runs": np.int32(runs),
        **(told or {}),
    }
    said |= {
        "own_family": chosen.family,
        "own_solver": solvers[0],
        "own_level": np.int32(chosen.own or 0),
    }
    return Record("cost", COST_TABLE, values, said | {"notes": "\n".join(notes)})


def _dominated(values: dict[str, Any], error: Array) -> NDArray[np.bool_]:
    """Return (family, solver, level) which settings another one beats in an error.

    Settings of one solver on equal meshes are one: all their runs count.
    """
    time = np.where(values["status"] == PointStatus.OK, np.min(values["time"], axis=-1), np.nan)
    solver = np.arange(error.shape[1])[:, None]
    sizes = [
        np.broadcast_to(size, error.shape).ravel().astype(float)
        for size in (solver, *(values[name][:, None] for name in ("n_dof", "n_contact", "h_max")))
    ]
    first = equal_settings(np.stack(sizes, axis=1), error.ravel())
    shared = np.full(error.size, np.inf)
    np.fmin.at(shared, first, time.ravel())
    shared[np.isinf(shared)] = np.nan
    return dominated(shared[first], error.ravel()).reshape(error.shape)


@dataclass
class CostCurve:
    """The measured levels of one family.

    own:    level of the study's own settings, None if the family is not the study's
    levels: what the solvers found on them, by name;  times: of each solver in the first run
    """

    family: str
    plan: MeshPlan
    own: int | None = None
    levels: list[SolvedLevel] = field(default_factory=list)
    times: list[Times] = field(default_factory=list)

    @property
    def next(self) -> float:
        """Unknowns to expect of the next level: a uniform one has four times as many, an adaptive
        step may add few."""
        *before, last = (level.n_dof for level in self.levels)
        return last * (last / before[-1] if before else self.plan.strategy.least_growth)


def first_run(study: Study, progress: Progress, notes: list[str]) -> list[CostCurve]:
    """Solve everything once; the study's own meshes come first, since they say how far the others
    go."""
    mesh, own = study.mesh, CostCurve(OWN, study.mesh)
    if (
        mesh.tolerance is None and not mesh.listed and not mesh.estimate
    ):  # their finest is a point of a family's curve
        own = CostCurve(mesh.family, family_plan(mesh, mesh.family))
    twin = ""
    if not graded_points(replace(study, mesh=family_plan(mesh, "graded"))):
        twin = "uniform" if own.family == "graded" else "graded"
        notes.append(
            "Graded and uniform meshes are the same here, as nothing is singular; they are shown once."
        )
    curves = [
        own,
        *(
            CostCurve(name, family_plan(mesh, name))
            for name in FAMILIES
            if name not in (own.family, twin)
        ),
    ]
    steps = [follow(curve, study, progress, notes) for curve in curves]
    for n_dof in steps[0]:
        if len(own.levels) == mesh.levels or (mesh.strategy.adapts and n_dof > mesh.max_dofs):
            break
    own.own, finest = len(own.levels) - 1, own.levels[-1].n_dof
    limit = max(finest, min(BEYOND * finest, MOST))
    for curve, step in zip(curves, steps, strict=True):
        while (not curve.levels or curve.next <= limit) and next(step, None) is not None:
            pass
    return sorted(curves, key=lambda curve: (*FAMILIES, OWN).index(curve.family))


def follow(curve: CostCurve, study: Study, progress: Progress, notes: list[str]) -> Iterator[int]:
    """Solve the levels of a curve and keep them, as far as the caller goes on, with all solvers
    that are worth the wait; the unknowns of each."""
    dropped: set[str] = set()
    try:
        for level, times in walk(study, curve.plan, lambda name, _: name not in dropped):
            curve.times.append(times)
            curve.levels.append(level)
            i = len(curve.levels) - 1
            progress(f"{curve.family}, level {i}: {level.n_dof} dofs", None)
            for name, one in list(level.solutions.items())[1:]:
                solve = one.numbers.get("time_solve", 0.0)
                other = times[name] - solve
                if solve > PATIENCE and solve > WORTH * other:
                    dropped.add(name)
                    notes.append(
                        f"{name} is not followed beyond level {i} of the {curve.family} meshes: there its solution "
                        f"took {solve:.1f} s, {solve / other:.0f} times all other work."
                    )
            yield level.n_dof
    except GeometryFailed as error:
        if not curve.levels:
            raise
        notes.append(f"{curve.family} meshes end at level {len(curve.levels) - 1}: {error}")


def family_plan(plan: MeshPlan, family: FamilyName) -> MeshPlan:
    """A family from the study's coarsest mesh, with its own grading, marking, goal and
    guarantee."""
    own = replace(plan, maxh=plan.maxh[:1], levels=LEVELS, family=family)
    return replace(own, tolerance=None, max_dofs=10**9, estimate=False)


def walk(
    study: Study, plan: MeshPlan, wanted: Callable[[str, int], bool] = lambda name, level: False
) -> Iterator[tuple[SolvedLevel, Times]]:
    """Run a study of one point level by level; the first of its solvers decides about meshes,
    others take turns there.

    Each level with what came of the solvers that were run, and how long that took: geometry and
    meshing; matrices and contact line; factorisation, temperature, condensed load, certificates and
    the way back to the body; the contact problem; and all levels before, with their estimates,
    where the mesh depends on them. wanted: which other solvers to run on which level. Raises
    GeometryFailed if the body cannot be meshed.
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
        stage.stop()  # which takes time
        blocks = {first: block}
        blocks |= {
            n: solve_point(replace(alone, solver=only[n]), level, 0) for n in others if wanted(n, i)
        }
        found = {name: solution_of(alone, level, one) for name, one in blocks.items()}
        spent = {name: one.numbers.get("time_solve", math.nan) for name, one in found.items()}
        meshing = times.mesh + (0.0 if plan.listed or plan.open_ended else meshing)
        shared, taken = meshing + times.assemble + times.points - spent[first], dict[str, float]()
        for name, solve in spent.items():
            taken[name] = times.geometry + before[name] + shared + solve
            taken[name] += times.estimate if plan.tolerance is not None else 0.0
            if plan.open_ended:
                before[name] += shared + solve + times.estimate
        yield SolvedLevel.of(level, found), taken


def reference_of(
    study: Study, curves: list[CostCurve], progress: Progress
) -> tuple[Reference, str, float]:
    """What errors are measured against, in words too, and its own estimated relative error. Raises
    CostError if it is not solved, GeometryFailed if there is no mesh that is fine enough.
    """
    if study.exact is not None:
        return ExactReference(study.exact), "the exact solution", 0.0
    finest = max(curve.levels[-1].n_dof for curve in curves)
    least = max(LEAST * finest, min(FINER * finest, LARGEST))
    plan = replace(family_plan(study.mesh, "adaptive"), guarantee=False, goal=Goal())
    plan = replace(plan, marking=max(plan.marking, 0.7))
    best: SolvedLevel | None = None
    try:
        for best, _ in walk(study, plan):
            progress(f"reference: {best.n_dof} of at least {least:.0f} dofs", None)
            if best.n_dof >= least:
                break
    except (
        GeometryFailed
    ):  # triangles too small for the mesher: the mesh before serves if it is fine enough
        if best is None or best.n_dof < least * LEAST / FINER:
            raise
    assert best is not None
    (found,) = best.solutions.values()
    if found.status != PointStatus.OK:
        why = found.reason or found.status.name.lower()
        raise CostError(
            f"the reference, an adaptive mesh of {best.n_dof} dofs, was not solved: {why}"
        )
    error = found.numbers.get("error_estimate", math.nan)
    words = f"adaptive mesh of {best.n_dof} dofs, with an estimated error of {100 * error:.2g} % in energy"
    return (
        FineReference(replace(best, solutions=dict.fromkeys(study.solver.names, found))),
        words,
        error,
    )


def errors_of(
    study: Study, curves: list[CostCurve], reference: Reference, runs: int, progress: Progress
) -> dict[str, Any]:
    """The variables of the file but times and what is dominated, padded to the longest curve;
    errors relative to the norms on the finest mesh. Raises CostError if there is no solution to
    compare with.
    """
    solvers, levels = study.solver.names, max(len(curve.levels) for curve in curves)
    sizes = {"family": len(curves), "solver": len(solvers), "level": levels, "run": runs}
    values: dict[str, Any] = {
        v.name: missing(v, tuple(sizes[dim] for dim in v.dims)) for v in COST_TABLE
    }
    values |= {"family": [curve.family for curve in curves], "solver": solvers}
    values |= {"level": np.arange(levels), "run": np.arange(runs)}
    values["reason"][:] = ""
    norms, finest = {BOUND.name: 1.0}, 0
    for (f, curve), i in ((one, i) for one in enumerate(curves) for i in range(len(one[1].levels))):
        level, errors = curve.levels[i], Errors()
        progress(f"errors of {curve.family}, level {i}", None)
        for name, size in (
            ("h_max", level.mesh.h_max),
            ("n_dof", level.n_dof),
            ("n_contact", level.line.m),
        ):
            values[name][f, i] = size
        first = level.solutions[solvers[0]]
        bound = first.numbers.get("error_bound_relative", math.nan)
        for name, one in level.solutions.items():
            at, same = (f, solvers.index(name), i), one is first or _same(one, first)
            if one is first or not same:
                errors = reference.errors(level, name, study.scenes[0])
            if level.n_dof > finest and errors:
                finest, norms = (
                    level.n_dof,
                    norms | {measure: size for measure, (_, size) in errors.items()},
                )
            own = errors | ({BOUND.name: (bound, 1.0)} if same else {})
            values["status"][at], values["reason"][at] = one.status, one.reason
            for measure, (error, _) in own.items():
                values[f"error_{measure}"][at] = error
    for m in MEASURES:
        values[f"error_{m.name}"] /= norms.get(m.name, 0.0) or math.nan
        if not np.isfinite(values[f"error_{m.name}"]).any():
            del values[f"error_{m.name}"], values[f"dominated_{m.name}"]
    if not any(f"error_{m.name}" in values for m in MEASURES):
        remedy = "give it a load, for example by --set, or name a sweep point that has one by --at"
        raise CostError(
            f"nothing loads this scene: its solution is zero, and errors have no size; {remedy}"
        )
    return values


def _has_solution(known: list[SolvedLevel], name: str, level: int) -> bool:
    return name in known[level].solutions


def _same(a: Solution, b: Solution) -> bool:
    """Whether two solvers found the same solution on one mesh."""
    if not a.parts or not b.parts:
        return False
    return float(np.max(np.abs(a.v - b.v), initial=0.0)) <= SAME * float(
        np.max(np.abs(a.v), initial=0.0)
    )
