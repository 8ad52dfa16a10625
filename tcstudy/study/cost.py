"""Measure accuracy against cost for one scene of a study: mesh families, solvers, levels.

Errors are measured against the exact solution if the study gives one, else against an adaptive mesh
with at least FINER times the unknowns of the finest mesh measured. Every walk along the meshes of
one family starts from nothing: geometry, meshes, assembly, factorisation and solutions are made
again. The time of a solver on top of the shared work is measured apart, so that solvers compare on
the same mesh, factor and machine noise. Families take turns, so that a slow spell of the machine
does not fall on one of them alone.
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
from tcstudy.data.tables import BOUND, COST_TABLE, ESTIMATE, MEASURES, OWN
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
"""Takes what is being done, and the seconds left if they are known."""
Array = NDArray[np.float64]
Times = dict[str, float]
"""Wall time of one solution, from the body to its displacements, by solver [s]."""

MAX_GROWTH = 4.2
"""Largest ratio of the unknowns of a curve to those of the study's own mesh.

It allows one uniform refinement.
"""
USUAL_MAX_DOFS = 40_000
"""Largest number of unknowns of a curve where the study's own mesh has fewer."""
MAX_LEVELS = 60
"""Levels of a family that are tried."""
MAX_SOLVE_SECONDS = 3.0
MAX_SOLVE_SHARE = 4.0
"""A solver is left out on finer meshes once it takes more seconds, and more times other work."""
FINER = 10
"""Ratio of the unknowns of the reference to those of the finest mesh compared with it."""
LEAST_FINER = 2
"""The least such ratio, for the sake of MAX_REFERENCE_DOFS."""
MAX_REFERENCE_DOFS = 1_500_000
REFERENCE_MARKING = 0.7
"""Least bulk marking parameter of the reference: few levels lead to its mesh."""
PROVED_OR_ESTIMATED = ((ESTIMATE, "error_estimate"), (BOUND, "error_bound_relative"))
"""Errors of a study with a guarantee that need no reference, and their names in a run."""
MAX_U_DIFFERENCE = 1e-8
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

    index, point: the point, by place and in words;  runs: how often all of it is timed
    lock: that of the file, if it is taken already
    Raises CostError, StoreError, GeometryFailed.
    """
    check_bilateral(study)
    point_study = at_point(study, index)

    def compute() -> Record:
        return measure(point_study, runs, progress, {"point": point})

    to_file(path, study, command, compute, point_study, lock=lock)


def check_bilateral(study: Study) -> None:
    """Raise CostError for a study with edges that are not held along their normal."""
    if not study.scenes[0].holds_normal:  # roles are the same at all points
        problem = "errors are measured for bilateral contact"
        remedy = "measure them with tcstudy converge, and compare times of levels with tcstudy run"
        raise CostError(f"{problem}; {remedy}")


def at_point(study: Study, index: tuple[int, ...]) -> Study:
    """Return the study of one point of the sweep alone, on its own geometry.

    Raises GeometryFailed where that is refused.
    """
    place = int(np.ravel_multi_index(index, study.shape))
    if not study.variants:
        return replace(study, scenes=(study.scenes[place],), axes=())
    variant = next(variant for variant in study.variants if place in variant.places)
    if variant.study is None:
        remedy = "name another geometry by --at, or take this one out of the sweep"
        raise GeometryFailed(f"{variant.words}: {variant.reason}; {remedy}", ("sweep",))
    row = int(np.flatnonzero(variant.places == place)[0])
    return replace(variant.study, scenes=(variant.study.scenes[row],), axes=())


def measure(
    study: Study, runs: int, progress: Progress, attributes: dict[str, Any] | None = None
) -> Record:
    """Return errors and wall times of a study of one point, for all families and solvers.

    runs:       how often all of it is timed
    attributes: further attributes of the file

    Raises CostError if no mesh could be solved, GeometryFailed if the body cannot be meshed.
    """
    _check_goal(study)
    solvers = tuple(dict.fromkeys((*study.solver.names, *SOLVERS)))
    study = replace(study, solver=replace(study.solver, names=solvers))
    notes = list[str]()
    clock = time.perf_counter()
    curves = first_run(study, progress, notes)
    run_seconds = time.perf_counter() - clock
    reference = reference_of(study, curves, progress)
    values = errors_of(study, curves, reference.solution, runs, progress)
    _put_times(values, study, curves, runs, run_seconds, progress)
    if any(_is_uncertified(curve.levels[-1].solutions[solvers[0]]) for curve in curves):
        notes.append(
            "The solution is not certified to be the only one: meshes and solvers may have found "
            "different ones, which shows as an error that does not decrease."
        )
    for quantity in MEASURES:
        error = values.get(f"error_{quantity.name}")
        if error is not None:
            values[f"dominated_{quantity.name}"] = _dominated(values, error)
    study_curve = next(curve for curve in curves if curve.study_level is not None)
    all_attributes = {
        "reference": reference.words,
        "reference_error": reference.relative_error,
        "runs": np.int32(runs),
        **(attributes or {}),
        "own_family": study_curve.family,
        "own_solver": solvers[0],
        "own_level": np.int32(study_curve.study_level or 0),
        "notes": "\n".join(notes),
    }
    return Record("cost", COST_TABLE, values, all_attributes)


def _check_goal(study: Study) -> None:
    """Raise CostError where the error of the goal of the meshes cannot be estimated."""
    if study.mesh.goal.quantity == "energy":
        return
    (scene,) = study.scenes
    if scene.material.regions:
        reason = "materials differ by region"
    elif isinstance(scene.friction, EdgeLaws):
        reason = "friction differs along the contact line"
    else:
        return
    remedy = "set mesh.goal=energy"
    raise CostError(f"{reason}, and errors of goals are not estimated then; {remedy}")


def _is_uncertified(solution: Solution) -> bool:
    return solution.numbers.get("unique") == 0


def _put_times(
    values: dict[str, Any],
    study: Study,
    curves: Sequence[CostCurve],
    runs: int,
    run_seconds: float,
    progress: Progress,
) -> None:
    """Put the wall times of all runs into the values of the file; the first run is done already."""
    for run in range(runs):
        if run:
            progress(f"run {run + 1} of {runs}", run_seconds * (runs - run))
        first_turn = run % len(curves)
        turns = [*range(first_turn, len(curves)), *range(first_turn)]
        for number in turns:
            curve = curves[number]
            times_by_level = _times_of_another_run(study, curve) if run else curve.times
            for level, times in enumerate(times_by_level):
                for name, seconds in times.items():
                    solver = study.solver.names.index(name)
                    values["time"][number, solver, level, run] = seconds


def _times_of_another_run(study: Study, curve: CostCurve) -> list[Times]:
    """Make the levels of a curve again with the solvers that it has, and return their times."""
    plan = curve.plan
    if curve.family != OWN:
        plan = replace(plan, guarantee="none", estimate=False)
    steps = walk(study, plan, partial(_has_solution, curve.levels))
    return [times for _, times in islice(steps, len(curve.levels))]


def _has_solution(levels: list[SolvedLevel], name: str, level: int) -> bool:
    return name in levels[level].solutions


def _dominated(values: dict[str, Any], error: Array) -> NDArray[np.bool_]:
    """Return (family, solver, level) which settings are beaten by another in an error.

    Settings of one solver on equal meshes are one: all their runs count.
    """
    is_solved = values["status"] == PointStatus.OK
    time = np.where(is_solved, np.min(values["time"], axis=-1), np.nan)
    solver = np.arange(error.shape[1])[:, None]
    sizes = (solver, *(values[name][:, None] for name in ("n_dof", "n_contact", "h_max")))
    columns = [np.broadcast_to(size, error.shape).ravel().astype(float) for size in sizes]
    first_equal = equal_settings(np.stack(columns, axis=1), error.ravel())
    least_time = np.full(error.size, np.inf)
    np.fmin.at(least_time, first_equal, time.ravel())
    least_time[np.isinf(least_time)] = np.nan
    return dominated(least_time[first_equal], error.ravel()).reshape(error.shape)


@dataclass
class CostCurve:
    """The measured levels of one family.

    study_level: level of the study's own settings, None if the family is not the study's
    levels:      what the solvers found on them, by name
    times:       of each solver in the first run
    """

    family: str
    plan: MeshPlan
    study_level: int | None = None
    levels: list[SolvedLevel] = field(default_factory=list)
    times: list[Times] = field(default_factory=list)

    @property
    def next_dofs(self) -> float:
        """Unknowns to expect of the next level.

        A uniform one has four times as many, an adaptive step may add few.
        """
        last = self.levels[-1].n_dof
        if len(self.levels) == 1:
            return last * self.plan.strategy.least_growth
        return last * (last / self.levels[-2].n_dof)


def first_run(study: Study, progress: Progress, notes: list[str]) -> list[CostCurve]:
    """Solve everything once, and return the curves.

    The study's own meshes come first, since they say how far the others go. What must be known of
    the curves is added to the notes.
    """
    mesh = study.mesh
    curves = _curves(study, notes)
    steps = [follow(curve, study, progress, notes) for curve in curves]
    study_curve = curves[0]
    for n_dof in steps[0]:
        is_last = mesh.strategy.adapts and n_dof > mesh.max_dofs
        if is_last or len(study_curve.levels) == mesh.levels:
            break
    study_curve.study_level = len(study_curve.levels) - 1
    finest = study_curve.levels[-1].n_dof
    limit = max(finest, min(MAX_GROWTH * finest, USUAL_MAX_DOFS))
    for curve, step in zip(curves, steps, strict=True):
        while not curve.levels or curve.next_dofs <= limit:
            if next(step, None) is None:
                break
    return sorted(curves, key=lambda curve: (*FAMILIES, OWN).index(curve.family))


def _curves(study: Study, notes: list[str]) -> list[CostCurve]:
    """Return the curves to measure, without levels: the study's own first, equal ones once."""
    mesh = study.mesh
    study_curve = CostCurve(OWN, mesh)
    if mesh.tolerance is None and not mesh.listed and not mesh.estimate:
        # the study's finest mesh is a level of its family's curve
        study_curve = CostCurve(mesh.family, family_plan(mesh, mesh.family))
    twin = ""
    if not graded_points(replace(study, mesh=family_plan(mesh, "graded"))):
        twin = "uniform" if study_curve.family == "graded" else "graded"
        notes.append(
            "Graded and uniform meshes are the same here, as nothing is singular; "
            "they are shown once."
        )
    others = [name for name in FAMILIES if name not in (study_curve.family, twin)]
    return [study_curve, *(CostCurve(name, family_plan(mesh, name)) for name in others)]


def follow(curve: CostCurve, study: Study, progress: Progress, notes: list[str]) -> Iterator[int]:
    """Solve the levels of a curve, keep them in it, and yield the unknowns of each.

    The caller decides how far it goes. Solvers that are too slow are left out on finer levels.
    """
    left_out = set[str]()
    try:
        for level, times in walk(study, curve.plan, lambda name, _: name not in left_out):
            curve.times.append(times)
            curve.levels.append(level)
            number = len(curve.levels) - 1
            progress(f"{curve.family}, level {number}: {level.n_dof} DOFs", None)
            _, *other_solvers = level.solutions
            for name in other_solvers:
                solve = level.solutions[name].numbers.get("time_solve", 0.0)
                other_work = times[name] - solve
                if solve > MAX_SOLVE_SECONDS and solve > MAX_SOLVE_SHARE * other_work:
                    left_out.add(name)
                    notes.append(
                        f"{name} is not followed beyond level {number} of the {curve.family} "
                        f"meshes: there its solution took {solve:.1f} s, "
                        f"{solve / other_work:.0f} times all other work."
                    )
            yield level.n_dof
    except GeometryFailed as error:
        if not curve.levels:
            raise
        notes.append(f"{curve.family} meshes end at level {len(curve.levels) - 1}: {error}")


def family_plan(plan: MeshPlan, family: FamilyName) -> MeshPlan:
    """Return the meshes of a family that starts from the study's coarsest mesh.

    It has the study's grading, marking, goal and guarantee; errors are estimated beside bounds.
    """
    return replace(
        plan,
        maxh=plan.maxh[:1],
        levels=MAX_LEVELS,
        family=family,
        tolerance=None,
        max_dofs=10**9,
        estimate=plan.bounds_errors,
    )


def walk(
    study: Study, plan: MeshPlan, is_wanted: Callable[[str, int], bool] | None = None
) -> Iterator[tuple[SolvedLevel, Times]]:
    """Run a study of one point level by level, and yield each level with the times of its solvers.

    The first solver decides about meshes; others take turns on its levels.
    is_wanted: whether another solver is to run on a level, by their name and number; None for never

    A time has five parts: geometry and meshing; matrices and contact line; factorisation,
    temperature, condensed load, certificates and the way back to the body; the contact problem;
    and, where the mesh depends on solutions, all levels before with their estimates.
    Raises GeometryFailed if the body cannot be meshed.
    """
    first, *others = study.solver.names
    output = replace(study.output, fields=True, live=False)
    first_study = replace(_with_solver(study, first), mesh=plan, output=output)
    meshing = 0.0
    seconds_before = dict.fromkeys(study.solver.names, 0.0)
    for i, stage in enumerate(stages(first_study)):
        level, times = stage.level, stage.times
        if level is None:
            raise GeometryFailed(next(stage.blocks).reasons[0])
        [block] = stage.blocks
        stage.stop()  # which takes time
        blocks = {first: block}
        for name in others:
            if is_wanted is not None and is_wanted(name, i):
                blocks[name] = solve_point(_with_solver(first_study, name), level, 0)
        solutions = {name: solution_of(first_study, level, one) for name, one in blocks.items()}
        solve_seconds = {
            name: solution.numbers.get("time_solve", math.nan)
            for name, solution in solutions.items()
        }
        starts_from_nothing = plan.listed or plan.open_ended
        meshing = times.mesh + (0.0 if starts_from_nothing else meshing)
        shared = meshing + times.assemble + times.points - solve_seconds[first]
        seconds = Times()
        for name, solve in solve_seconds.items():
            seconds[name] = times.geometry + seconds_before[name] + shared + solve
            if plan.tolerance is not None:
                seconds[name] += times.estimate
            if plan.open_ended:
                seconds_before[name] += shared + solve + times.estimate
        yield SolvedLevel.of(level, solutions), seconds


def _with_solver(study: Study, name: str) -> Study:
    return replace(study, solver=replace(study.solver, names=(name,)))


@dataclass(frozen=True)
class CostReference:
    """What errors are measured against, in words too, and its own estimated relative error."""

    solution: Reference
    words: str
    relative_error: float


def reference_of(study: Study, curves: list[CostCurve], progress: Progress) -> CostReference:
    """Return the exact solution, or the solution on an adaptive mesh that is fine enough.

    Raises CostError if it is not solved, GeometryFailed if there is no such mesh.
    """
    if study.exact is not None:
        return CostReference(ExactReference(study.exact), "the exact solution", 0.0)
    finest = max(curve.levels[-1].n_dof for curve in curves)
    level = _reference_level(study, finest, progress)
    (solution,) = level.solutions.values()
    if solution.status != PointStatus.OK:
        reason = solution.reason or solution.status.name.lower()
        mesh = f"an adaptive mesh of {level.n_dof} DOFs"
        raise CostError(f"the reference, {mesh}, was not solved: {reason}")
    error = solution.numbers.get("error_estimate", math.nan)
    words = (
        f"adaptive mesh of {level.n_dof} DOFs, "
        f"with an estimated error of {100 * error:.2g} % in energy"
    )
    solutions = dict.fromkeys(study.solver.names, solution)
    return CostReference(FineReference(replace(level, solutions=solutions)), words, error)


def _reference_level(study: Study, finest: int, progress: Progress) -> SolvedLevel:
    """Solve adaptive meshes up to one that is fine enough beside `finest` unknowns."""
    least_dofs = max(LEAST_FINER * finest, min(FINER * finest, MAX_REFERENCE_DOFS))
    plan = family_plan(study.mesh, "adaptive")
    marking = max(plan.marking, REFERENCE_MARKING)
    plan = replace(plan, guarantee="none", goal=Goal(), marking=marking, estimate=False)
    last: SolvedLevel | None = None
    try:
        for level, _ in walk(study, plan):
            last = level
            progress(f"reference: {level.n_dof} of at least {least_dofs:.0f} DOFs", None)
            if level.n_dof >= least_dofs:
                break
    except GeometryFailed:
        # triangles became too small for the mesher: the mesh before may be fine enough
        if last is None or last.n_dof < least_dofs * LEAST_FINER / FINER:
            raise
    assert last is not None
    return last


def errors_of(
    study: Study,
    curves: list[CostCurve],
    reference: Reference,
    runs: int,
    progress: Progress,
) -> dict[str, Any]:
    """Return the variables of the file, padded to the longest curve, with times still missing.

    Errors are relative to the norms on the finest mesh. Raises CostError if there is no solution to
    compare with.
    """
    values = _empty_values(study, curves, runs)
    norms = {BOUND.name: 1.0, ESTIMATE.name: 1.0}
    finest = 0
    for number, curve in enumerate(curves):
        for i, level in enumerate(curve.levels):
            progress(f"errors of {curve.family}, level {i}", None)
            values["h_max"][number, i] = level.mesh.h_max
            values["n_dof"][number, i] = level.n_dof
            values["n_contact"][number, i] = level.line.m
            errors = _errors_by_solver(study, level, reference)
            for name, solution in level.solutions.items():
                at = number, study.solver.names.index(name), i
                _put_solution(values, at, solution, errors[name])
            measured = next(filter(None, errors.values()), None)
            if level.n_dof > finest and measured is not None:
                finest = level.n_dof
                norms |= {quantity: norm for quantity, (_, norm) in measured.items()}
            _put_bounds(values, study, number, i, level)
    _divide_by_norms(values, norms)
    return values


def _errors_by_solver(study: Study, level: SolvedLevel, reference: Reference) -> dict[str, Errors]:
    """Return the errors of the solutions on a level, measured once for those that are equal."""
    first_solver = study.solver.names[0]
    first = level.solutions[first_solver]
    errors = {first_solver: reference.errors(level, first_solver, study.scenes[0])}
    for name, solution in level.solutions.items():
        if name == first_solver:
            continue
        if _is_same(solution, first):
            errors[name] = errors[first_solver]
        else:
            errors[name] = reference.errors(level, name, study.scenes[0])
    return errors


def _put_solution(
    values: dict[str, Any], at: tuple[int, int, int], solution: Solution, errors: Errors
) -> None:
    """Put status and absolute errors of a solution at (family, solver, level)."""
    values["status"][at] = solution.status
    values["reason"][at] = solution.reason
    for quantity, (error, _) in errors.items():
        values[f"error_{quantity}"][at] = error


def _put_bounds(
    values: dict[str, Any], study: Study, number: int, i: int, level: SolvedLevel
) -> None:
    """Put estimate and bound of the error of a level beside all solutions that they are of."""
    if not study.mesh.bounds_errors:
        return
    first = level.solutions[study.solver.names[0]]
    for name, solution in level.solutions.items():
        if solution is first or _is_same(solution, first):
            at = number, study.solver.names.index(name), i
            for measure, variable in PROVED_OR_ESTIMATED:
                values[f"error_{measure.name}"][at] = first.numbers.get(variable, math.nan)


def _is_same(solution: Solution, other: Solution) -> bool:
    """Return whether two solvers found the same solution on one mesh."""
    if not solution.parts or not other.parts:
        return False
    difference = float(np.max(np.abs(solution.v - other.v), initial=0.0))
    return difference <= MAX_U_DIFFERENCE * float(np.max(np.abs(solution.v), initial=0.0))


def _divide_by_norms(values: dict[str, Any], norms: dict[str, float]) -> None:
    """Make errors relative, and remove those that are measured nowhere.

    Raises CostError if none is left.
    """
    measured = list[str]()
    for quantity in MEASURES:
        error = f"error_{quantity.name}"
        values[error] /= norms.get(quantity.name, 0.0) or math.nan
        if np.isfinite(values[error]).any():
            measured.append(error)
        else:
            del values[error], values[f"dominated_{quantity.name}"]
    if not measured:
        problem = "nothing loads this scene: its solution is zero, and errors have no size"
        remedy = "give it a load, for example by --set, or name a sweep point that has one by --at"
        raise CostError(f"{problem}; {remedy}")


def _empty_values(study: Study, curves: Sequence[CostCurve], runs: int) -> dict[str, Any]:
    """Return the variables of the file with missing values."""
    levels = max(len(curve.levels) for curve in curves)
    coordinates: dict[str, Any] = {
        "family": [curve.family for curve in curves],
        "solver": study.solver.names,
        "level": np.arange(levels),
        "run": np.arange(runs),
    }
    values = dict[str, Any]()
    for variable in COST_TABLE:
        values[variable.name] = missing(
            variable, tuple(len(coordinates[dim]) for dim in variable.dims)
        )
    values |= coordinates
    values["reason"][:] = ""
    return values
