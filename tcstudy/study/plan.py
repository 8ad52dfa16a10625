"""Forecast a run without doing it: counts, sizes, what is left out and why, time and memory.

The time is measured: some points of the study on one mesh small enough to wait for, scaled to all
of its meshes. Mesh and factor grow like N^1.08 (results/speed.md), the time of a point with m as in
results/online.md. A forecast does not know how many meshes an estimate asks for, nor how long the
steps of a history and of the bundle method take.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from tcstudy.errors import GeometryFailed
from tcstudy.offline.level import Level
from tcstudy.refine.family import Family
from tcstudy.scene.points import (
    FELT,
    Scenes,
    count_points,
    distinct,
    idle_notes,
    needs_heat_solve,
    of_stiffness,
    why_no_heat,
)
from tcstudy.scene.records import Contact
from tcstudy.scene.study import MeshPlan, Study
from tcstudy.shapes.edges import body_area, boundary_lengths
from tcstudy.study.level_solver import LevelSolver
from tcstudy.study.lint import lint, locking_notes, once, unused
from tcstudy.study.run import meshes_of
from tcstudy.study.workers import (
    BYTES_PER_UNKNOWN,
    PROGRAM_BYTES,
    SECONDS_PER_NODE,
    SECONDS_PER_POINT,
    STAGE_EXPONENT,
    START_SECONDS,
    LevelForecast,
    Resources,
    block_workers,
    call_workers,
    counted_sizes,
    expected_bytes,
    geometry_resources,
    history_resources,
    meshing_seconds,
    predicted_sizes,
    with_refinement,
)

MAX_TRIAL_UNKNOWNS = 6_000
"""Displacement unknowns of the mesh of a trial, about."""
FEW = 8
"""Largest number of points of a trial."""
MANY = 64
"""Largest number of points of its repetition."""
POINTS_PER_FEW = 8
"""Points of a study for each of the trial: a dry run costs less than the run."""
POINTS_PER_MANY = 3
"""Points of a study for each of the repetition."""
MAX_TRIAL_SECONDS = 2.0
"""Time of FEW points from which on no more are tried."""
FACTOR_SHARE = 0.5
"""Share of factor and loads, which every ratio of moduli takes again (results/speed.md)."""
SECONDS_TO_WRITE = 6e-5
"""Time that a point takes to the file (tcstudy/README.md, Many machines)."""
MIN_NOTED_SECONDS = 2.0
"""Time of meshing from which on a forecast names it."""
MAX_LENGTH_TO_HEIGHT = 2.0
"""Element length over the height of a strip above which path and lowest state may differ
(configs/howto/histories.md)."""


@dataclass(frozen=True)
class Plan:
    """The forecast of a run.

    points:   sweep points per level
    levels:   the mesh levels whose number is known beforehand, counted where meshes are small
    left_out: what is not computed, each with its reason
    notes:    what the user may want to know before the start
    bytes:    expected size of the result file, its largest where an estimate decides about meshes;
              0 for a path or a fit, which are small
    asked:    what a run does in place of solving points, in words; empty for a sweep
    """

    points: int
    levels: tuple[LevelForecast, ...]
    left_out: tuple[str, ...]
    notes: tuple[str, ...]
    bytes: int
    asked: str = ""


def plan(study: Study) -> Plan:
    """Return the forecast of a valid study; of geometries the sizes of the largest.

    Raises GeometryFailed where a run would before it solves anything.
    """
    if not study.variants:
        return _plan_of_body(study, counted_sizes(study))
    geometries = _geometries(study)
    largest = _largest(geometries)
    plans = [_plan_of_body(geometry, predicted_sizes(geometry)) for geometry in geometries]
    return replace(
        plans[largest],
        points=len(study.scenes),
        levels=counted_sizes(geometries[largest]),
        notes=tuple(_notes_of_geometries(study, plans)),
        bytes=sum(forecast.bytes for forecast in plans),
    )


def _geometries(study: Study) -> list[Study]:
    """Return the studies of the valid geometries, without the text that they share."""
    geometries = list[Study]()
    for variant in study.variants:
        if variant.study is not None:
            scenes = Scenes.of(variant.study.scenes)
            geometries.append(replace(variant.study, scenes=scenes, text="", overrides=()))
    return geometries


def _largest(geometries: Sequence[Study]) -> int:
    """Return the position of the geometry with the largest finest mesh."""
    n_dofs = [predicted_sizes(geometry)[-1].n_dof for geometry in geometries]
    return n_dofs.index(max(n_dofs))


def _notes_of_geometries(study: Study, plans: Sequence[Plan]) -> Iterator[str]:
    count = len(plans)
    name = "geometry" if count == 1 else "geometries"
    meshes = f"{count} {name}: {count * study.mesh.levels} meshes"
    yield f"{meshes}, which the points of a geometry share. Sizes are those of the largest"
    for variant in study.variants:
        if variant.study is None:
            yield f"refused, {variant.words}: {variant.reason}"
    yield from unused(study)
    words = [variant.words for variant in study.variants if variant.study is not None]
    notes = [(name, forecast.notes) for name, forecast in zip(words, plans, strict=True)]
    yield from map(str, once(notes))


def _plan_of_body(study: Study, levels: tuple[LevelForecast, ...]) -> Plan:
    """Return the forecast of a study with one body, whose meshes have these sizes."""
    path = study.path
    if study.kind == "path" and path is not None:  # of one scene and one level
        study = replace(study, scenes=(path.scene,), axes=())
        if path.level is not None:
            levels = levels[: path.level + 1]
    return Plan(
        points=len(study.scenes),
        levels=levels,
        left_out=tuple(_left_out(study)),
        notes=tuple(_notes(study, levels)),
        bytes=0 if study.kind in ("path", "fit") else expected_bytes(study, levels),
        asked=asked(study),
    )


def _left_out(study: Study) -> Iterator[str]:
    scenes, mesh = study.scenes, study.mesh
    cold = count_points(scenes, FELT, lambda scene: not needs_heat_solve(scene))
    if cold:
        where = f" at {cold} of {len(scenes)} points" if cold < len(scenes) else ""
        yield f"heat problem{where}: {why_no_heat(scenes)}"
    if mesh.tolerance is not None:
        unit = "" if study.units == "none" else " m"
        yield (
            f"meshes finer than needed: {mesh.strategy.how} from maxh = {mesh.maxh[0]:g}{unit} "
            f"until the {mesh.goal.kind} relative error of {mesh.goal.quantity} is at most "
            f"{mesh.tolerance:g} at every point, {mesh.max_dofs} dofs are passed or there are "
            f"{mesh.levels} levels"
        )


def _notes(study: Study, levels: tuple[LevelForecast, ...]) -> Iterator[str]:
    mesh = study.mesh
    if study.exact is not None and study.exact.derived:
        yield "loads and prescribed values are derived from the exact solution"
    if study.design is not None:
        yield study.design.note
    yield from idle_notes(study)
    yield from lint(study)
    if mesh.strategy.note:  # which the table of levels does not tell
        yield mesh.strategy.note.format(goal=mesh.goal.quantity, power=1 - mesh.grading)
    if study.kind != "run":
        yield _note_on_sections(study)
    yield from _notes_on_elements(study, levels)
    yield from locking_notes(study.scenes)
    seconds = meshing_seconds(mesh, levels)
    if seconds >= MIN_NOTED_SECONDS:
        refinements = math.ceil(math.log(seconds / MIN_NOTED_SECONDS, 4)) + 1
        yield (
            f"meshing takes about {seconds:.0f} s; mesh.refine: {mesh.refine + refinements} makes "
            "meshes of this size from coarser ones, much faster"
        )


def _note_on_sections(study: Study) -> str:
    """Return which section the run follows, and how to follow another one."""
    for name in ("history", "path"):
        if name != study.kind and getattr(study, name) is not None:
            idle = f"section {name}"
            break
    else:
        idle = "points of the sweep"
    return f"{asked(study)}: run does this; for the {idle} add --set {study.kind}=null"


def _notes_on_elements(study: Study, levels: tuple[LevelForecast, ...]) -> Iterator[str]:
    """Yield a note where elements of a history are long beside the height of the body."""
    scene = study.scenes[0]
    if study.history is None or scene.body.brep is not None:
        return
    lengths = boundary_lengths(scene.body)
    contact = sum(lengths[name] for name in scene.edges(Contact))
    n_contact = study.history.of(levels).n_contact
    ratio = contact**2 / (n_contact * body_area(scene.body))  # its height: area over Γ_C
    if ratio > MAX_LENGTH_TO_HEIGHT:
        yield (
            f"elements on the contact line are {ratio:.2g} times as long as the body is high "
            "there: nodes ahead of the front slip backwards, an artefact, so that path and "
            "lowest state may differ by some per cent; choose a smaller mesh.maxh or more levels"
        )


def asked(study: Study) -> str:
    """Return what a run does in place of solving points, in words; empty for a sweep."""
    if study.kind == "fit" and study.fit is not None:
        names = ", ".join(parameter.number.name for parameter in study.fit.parameters)
        return f"fit of {names} to {study.fit.file}"
    if study.kind == "history" and study.history is not None:
        points = f" at each of {len(study.scenes)} points" if len(study.scenes) > 1 else ""
        names = ", ".join(study.history.names)
        return f"load history, {study.history.steps} steps of {names}{points}"
    if study.kind == "path" and study.path is not None:
        path = study.path
        units = f" {path.units}" if path.units != "1" else ""
        return f"path along {path.name} from {path.begin:.6g}{units} to {path.end:.6g}{units}"
    return ""


def hands(study: Study, levels: Sequence[LevelForecast], jobs: int | None) -> tuple[int, str]:
    """Return the number of processes that do the work, and their work in words.

    The words are empty if this process does all.
    """
    if study.history is not None:
        level = study.history.of(levels)
        resources = history_resources(study, level.n_dof, level.n_contact)
        calls = [resources] * len(study.scenes)
        work = f"{len(calls)} histories, each whole by one of"
        workers = call_workers(calls, jobs) if len(calls) > 1 else 1
    elif study.variants:
        geometries = [variant.study for variant in study.variants if variant.study is not None]
        calls = [geometry_resources(geometry) for geometry in geometries]
        work = f"{len(calls)} geometries, each whole by one of"
        workers = call_workers(calls, jobs) if len(calls) > 1 else 1
    else:
        work = "contact problems solved by"
        counts = [block_workers(study, level.n_contact, jobs) for level in levels]
        workers = max(counts, default=1)
    if workers <= 1:
        return workers, ""
    return (
        workers,
        f"{work} {workers} worker processes (--jobs), or by those of a scheduler (--dask)",
    )


def resources(study: Study, forecast: Plan, workers: int = 1) -> Resources:
    """Return what a run of a study takes, by a trial on its largest geometry.

    forecast: of the study;  workers: number of worker processes

    The trial runs few and then many of its points on one mesh (`_trial_mesh`), which tells the time
    of mesh and factor from that of points.
    """
    geometries = _geometries(study) if study.variants else [study]
    position = _largest(geometries) if study.variants else 0
    largest = geometries[position]
    levels = [
        forecast.levels if i == position else predicted_sizes(geometry)
        for i, geometry in enumerate(geometries)
    ]
    levels = [with_refinement(levels_of_geometry, study.mesh) for levels_of_geometry in levels]
    max_dofs = max(level.n_dof for levels_of_geometry in levels for level in levels_of_geometry)
    memory = PROGRAM_BYTES + BYTES_PER_UNKNOWN * max_dofs
    if workers > 1:
        has_bodies = len(geometries) > 1 or study.history is not None
        memory += workers * (memory if has_bodies else PROGRAM_BYTES)
    if why := unknown(study):
        return Resources(math.nan, memory, why)
    mesh = _trial_mesh(with_refinement(forecast.levels, study.mesh), study.mesh)
    n_points = len(largest.scenes)
    n_few = min(FEW, max(1, n_points // POINTS_PER_FEW))
    n_many = min(MANY, max(1, n_points // POINTS_PER_MANY))
    few = replace(_sample(largest, n_few), mesh=mesh)
    many = replace(_sample(largest, n_many), mesh=mesh)
    try:
        with threadpool_limits(1, user_api="blas"):
            trial = _timed(few, many)
    except GeometryFailed:
        return Resources(math.nan, memory, "the coarser meshes of a trial cannot be made")
    seconds = START_SECONDS
    for geometry, levels_of_geometry in zip(geometries, levels, strict=True):
        seconds += _seconds_of_geometry(geometry, levels_of_geometry, few, trial)
    return Resources(seconds, memory)


class Trial(NamedTuple):
    """The time of points on a small mesh.

    n_dof, n_contact: its displacement and contact DOFs
    body:  CPU time of a run of few points [s]
    point: CPU time of each further point [s]
    """

    n_dof: int
    n_contact: int
    body: float
    point: float


def _seconds_of_geometry(
    geometry: Study, levels: Sequence[LevelForecast], few: Study, trial: Trial
) -> float:
    """Return the time of all levels of a geometry, scaled from a trial of few points."""
    seconds = meshing_seconds(geometry.mesh, levels) if geometry.mesh.nested else 0.0
    factors = _factor_cost(geometry) / _factor_cost(few)
    n_points = max(0, len(geometry.scenes) - len(few.scenes))
    for level in levels:
        body = trial.body * factors * (level.n_dof / trial.n_dof) ** STAGE_EXPONENT
        point = trial.point * _point_cost(level.n_contact) / _point_cost(trial.n_contact)
        seconds += body + n_points * (point + SECONDS_TO_WRITE)
    return seconds


def _point_cost(m: int) -> float:
    return SECONDS_PER_POINT + SECONDS_PER_NODE * m


def _factor_cost(study: Study) -> float:
    """Return the cost of a level without its points; 1 for a study with one ratio of moduli."""
    scenes = distinct(study.scenes, *of_stiffness(study.scenes))
    ratios = {Level.ratio(scene) for scene in scenes}
    return 1.0 + FACTOR_SHARE * (len(ratios) - 1)


def unknown(study: Study) -> str:
    """Return why the time of a run cannot be forecast; empty if a trial tells it."""
    if study.history is not None:
        return "the time of a history step depends on its slips and jumps"
    if study.kind in ("path", "fit"):
        return f"a {study.kind}: the number of segments depends on the solution"
    if study.mesh.open_ended:
        return "the estimated error decides about the meshes"
    if not study.in_blocks:
        return "the points are solved one by one, and the steps of their solvers are not known"
    return ""


def _sample(study: Study, count: int) -> Study:
    """Return the study with some of its points, spread over all."""
    places = np.unique(np.linspace(0, len(study.scenes) - 1, count).astype(int))
    scenes = tuple(study.scenes[place] for place in places.tolist())
    output = replace(study.output, live=False)
    return replace(study, scenes=scenes, axes=(), design=None, output=output)


def _trial_mesh(levels: Sequence[LevelForecast], mesh: MeshPlan) -> MeshPlan:
    """Return the mesh of a trial.

    It is the finest of a study that has at most MAX_TRIAL_UNKNOWNS, made by refinement as the study
    makes it, or one of that size where all have more.
    """
    finest = levels[-1]
    coarser = max(0, math.ceil(math.log(finest.n_dof / MAX_TRIAL_UNKNOWNS, 4)))
    refinements = mesh.refine + len(levels) - 1 if mesh.nested else 0
    if coarser <= refinements:
        maxh = finest.h * 2**coarser
        return replace(mesh, maxh=(maxh,), levels=1, refine=refinements - coarser)
    maxh = finest.h * math.sqrt(max(1.0, finest.n_dof / MAX_TRIAL_UNKNOWNS))
    return replace(mesh, maxh=(maxh,), levels=1, refine=0)


def _timed(few: Study, many: Study) -> Trial:
    """Run few and then many points on the one mesh of both studies.

    The many points are solved on what the few have left, which takes the time of points alone.
    """
    begin = time.process_time()
    mesh = meshes_of(few).next(0)
    level = Level(mesh, many.scenes[0], many.scenes, guarantee=many.mesh.guarantee)
    _solve(few, level)
    body = time.process_time() - begin
    point = 0.0
    if len(many.scenes) > len(few.scenes) and body < MAX_TRIAL_SECONDS:
        begin = time.process_time()
        _solve(many, level)
        point = (time.process_time() - begin) / len(many.scenes)
    return Trial(level.frames.n_dof, level.m, body, point)


def _solve(study: Study, level: Level) -> None:
    """Solve the points of a study on a level, and keep nothing."""
    meshes = meshes_of(study) if study.mesh.estimates else None
    estimator = meshes.estimator(level) if isinstance(meshes, Family) else None
    for _ in LevelSolver(study, level, estimator).solve():
        pass
