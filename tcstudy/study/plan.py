"""What a run would do, found out without doing it: counts, sizes, what is left out and why, and
what it takes.

Time is measured: some points of the study on one mesh small enough to wait for, scaled to all of
its own. Mesh and factor grow like N^1.08 (results/speed.md), a point with m as in
results/online.md. Not known before a run: how many meshes an estimate asks for, what steps of a
history and of the bundle method take.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

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
    MEMORY,
    NODE,
    POINT,
    STAGES,
    START,
    UNKNOWN,
    LevelForecast,
    Resources,
    expected_bytes,
    for_blocks,
    for_calls,
    meshing_seconds,
    of_geometry,
    of_history,
    predicted,
    refined,
    sizes,
)

TRIAL = 6_000
"""Displacement unknowns of the mesh of a trial at most, about."""
FEW, MANY = 8, 64
"""Points of a trial and of its repetition at most."""
FEW_SHARE, MANY_SHARE = 8, 3
"""One of so many points of a study is in the trial, and in its repetition: a dry run costs less
than the run."""
ENOUGH = 2.0
"""Seconds that FEW points take, from which on no more are tried."""
FACTOR = 0.5
"""Of what grows with N, what every ratio of moduli takes again: factor and loads
(results/speed.md)."""
WRITTEN = 6e-5
"""Seconds that a point takes to the file (tcstudy/README.md, Many machines)."""


@dataclass(frozen=True)
class Plan:
    """The forecast of a run.

    points:          sweep points per level
    levels:          the mesh levels whose number is known beforehand, counted where their meshes are small
    left_out:        what is not computed, each with its reason
    notes:           what the user may want to know before starting
    bytes:           expected size of the result file; the most to expect where an estimate decides about meshes; 0 for
                     a path or a fit, which are small
    asked:           what a run does in place of solving points, in words; empty for a sweep
    """

    points: int
    levels: tuple[LevelForecast, ...]
    left_out: tuple[str, ...]
    notes: tuple[str, ...]
    bytes: int
    asked: str = ""


def plan(study: Study) -> Plan:
    """The forecast of a study that the reader has accepted; of geometries the sizes of the largest.
    Raises GeometryFailed where a run would before it solves anything."""
    if not study.variants:
        return _of_body(study, sizes(study))
    own, largest = _geometries(study)
    found = [_of_body(one, predicted(one)) for one in own]
    words = [one.words for one in study.variants if one.study is not None]
    meshes = f"{len(own)} {'geometry' if len(own) == 1 else 'geometries'}: {len(own) * study.mesh.levels} meshes"
    note = f"{meshes}, which the points of a geometry share. Sizes are those of the largest"
    refused = [f"refused, {one.words}: {one.reason}" for one in study.variants if one.study is None]
    said = map(str, once([(name, one.notes) for name, one in zip(words, found, strict=True)]))
    return replace(
        found[own.index(largest)],
        points=len(study.scenes),
        levels=sizes(largest),
        notes=(note, *refused, *unused(study), *said),
        bytes=sum(one.bytes for one in found),
    )


def _geometries(study: Study) -> tuple[list[Study], Study]:
    """The studies of the geometries that are not refused, without the text that they share, and the
    largest of them."""
    kept = [one.study for one in study.variants if one.study is not None]
    own = [replace(one, scenes=Scenes.of(one.scenes), text="", overrides=()) for one in kept]
    return own, max(own, key=lambda one: predicted(one)[-1].n_dof)


def _of_body(study: Study, levels: tuple[LevelForecast, ...]) -> Plan:
    """The forecast of a study with one body, whose meshes have these sizes."""
    if study.kind == "path" and (path := study.path) is not None:  # of one scene and one level
        study = replace(study, scenes=(path.scene,), axes=())
        levels = levels if path.level is None else levels[: path.level + 1]
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
    cold = count_points(scenes, FELT, lambda s: not needs_heat_solve(s))
    if cold:
        where = f" at {cold} of {len(scenes)} points" if cold < len(scenes) else ""
        yield f"heat problem{where}: {why_no_heat(scenes)}"
    if mesh.tolerance is not None:
        yield (
            f"meshes finer than needed: {mesh.strategy.how} from maxh = {mesh.maxh[0]:g}"
            f"{'' if study.units == 'none' else ' m'} until the {mesh.goal.kind} relative error of "
            f"{mesh.goal.quantity} is at most {mesh.tolerance:g} at every point, {mesh.max_dofs} dofs are passed or "
            f"there are {mesh.levels} levels"
        )


WORTH_SAYING = 2.0
"""Seconds of meshing from which on a forecast says so."""
LONG = 2.0
"""Lengths of elements over the height of a strip above which path and lowest state may differ
(configs/howto/histories.md)."""


def _notes(study: Study, levels: tuple[LevelForecast, ...]) -> Iterator[str]:
    scenes, mesh = study.scenes, study.mesh
    if study.exact is not None and study.exact.derived:
        yield "loads, and what edges hold, are derived from the exact solution"
    if study.design is not None:
        yield study.design.note
    yield from (*idle_notes(study), *lint(study))
    if mesh.strategy.note:  # what the table of levels does not say
        yield mesh.strategy.note.format(goal=mesh.goal.quantity, power=1 - mesh.grading)
    if study.kind != "run":
        others = [
            name
            for name in ("history", "path")
            if getattr(study, name) is not None and name != study.kind
        ]
        left = f"section {others[0]}" if others else "points of the sweep"
        yield f"{asked(study)}: run does this; for the {left} add --set {study.kind}=null"
    if study.history is not None and (body := scenes[0].body).brep is None:
        lengths = boundary_lengths(body)
        contact = sum(lengths[name] for name in scenes[0].edges(Contact))
        ratio = contact**2 / (
            study.history.of(levels).n_contact * body_area(body)
        )  # its height: area over Γ_C
        if ratio > LONG:
            yield (
                f"elements on the contact line are {ratio:.2g} times as long as the body is high there: they push "
                "nodes back before the front that comes to them, so that path and lowest state may differ by some per "
                "cent; choose a smaller mesh.maxh or more levels"
            )
    yield from locking_notes(scenes)
    if (seconds := meshing_seconds(mesh, levels)) >= WORTH_SAYING:
        more = mesh.refine + math.ceil(math.log(seconds / WORTH_SAYING, 4)) + 1
        remedy = f"mesh.refine: {more} makes meshes of this size from coarser ones, much faster"
        yield f"meshing takes about {seconds:.0f} s; {remedy}"


def asked(study: Study) -> str:
    """What a run does in place of solving points, in words; empty for a sweep."""
    if study.kind == "fit" and study.fit is not None:
        return f"fit of {', '.join(one.number.name for one in study.fit.parameters)} to {study.fit.file}"
    if study.kind == "history" and study.history is not None:
        points = f" at each of {len(study.scenes)} points" if len(study.scenes) > 1 else ""
        return (
            f"load history, {study.history.steps} steps of {', '.join(study.history.names)}{points}"
        )
    if study.kind == "path" and (path := study.path) is not None:
        units = f" {path.units}" if path.units != "1" else ""
        return f"path along {path.name} from {path.begin:.6g}{units} to {path.end:.6g}{units}"
    return ""


def hands(study: Study, levels: Sequence[LevelForecast], jobs: int | None) -> tuple[int, str]:
    """How many processes will do the work, and in words who does what; empty if this one does
    all."""
    scheduler = "or by those of a scheduler (--dask)"
    if not study.variants and study.history is None:
        most = max((for_blocks(study, level.n_contact, jobs) for level in levels), default=1)
        return (
            most,
            f"contact problems solved by {most} worker processes (--jobs), {scheduler}"
            if most > 1
            else "",
        )
    if study.history is None:
        what, each = (
            "geometries",
            [of_geometry(one.study) for one in study.variants if one.study is not None],
        )
    else:
        one = study.history.of(levels)
        what, each = "histories", [of_history(study, one.n_dof, one.n_contact)] * len(study.scenes)
    if len(each) < 2 or (count := for_calls(each, jobs)) == 1:
        return 1, ""
    return (
        count,
        f"{len(each)} {what}, each whole by one of {count} worker processes (--jobs), {scheduler}",
    )


def resources(study: Study, found: Plan, workers: int = 1) -> Resources:
    """What a run of a study takes with so many workers, whose forecast is `found`, by a trial on
    its largest geometry.

    The trial runs few and then more of its points on one mesh (`_trial_mesh`), which tells mesh and
    factor from points.
    """
    own, largest = _geometries(study) if study.variants else ([study], study)
    levels = [
        refined(found.levels if one is largest else predicted(one), study.mesh) for one in own
    ]
    memory = MEMORY + UNKNOWN * max(level.n_dof for one in levels for level in one)
    if workers > 1:
        memory += workers * (memory if len(own) > 1 or study.history is not None else MEMORY)
    if why := unknown(study):
        return Resources(math.nan, memory, why)
    mesh = _trial_mesh(refined(found.levels, study.mesh), study.mesh)
    points = len(largest.scenes)
    few = replace(_sample(largest, min(FEW, max(1, points // FEW_SHARE))), mesh=mesh)
    many = replace(_sample(largest, min(MANY, max(1, points // MANY_SHARE))), mesh=mesh)
    try:
        with threadpool_limits(1, user_api="blas"):
            n_dof, m, body, point = _timed(few, many)
    except GeometryFailed:
        return Resources(math.nan, memory, "the coarser meshes of a trial cannot be made")
    seconds = START
    for one, sizes_of in zip(own, levels, strict=True):
        seconds += meshing_seconds(one.mesh, sizes_of) if study.mesh.nested else 0.0
        factors = (1.0 + FACTOR * (_factorisations(one) - 1)) / (
            1.0 + FACTOR * (_factorisations(few) - 1)
        )
        for size in sizes_of:
            each = point * (POINT + NODE * size.n_contact) / (POINT + NODE * m) + WRITTEN
            seconds += (
                body * factors * (size.n_dof / n_dof) ** STAGES[1]
                + max(0, len(one.scenes) - len(few.scenes)) * each
            )
    return Resources(seconds, memory)


def unknown(study: Study) -> str:
    """Why nobody can tell how long a run takes; empty if a trial tells."""
    if study.history is not None:
        return "a step of a history takes as long as what slips and jumps in it asks for"
    if study.kind in ("path", "fit"):
        return f"a {study.kind} takes as many steps as what slips and jumps on it asks for"
    if study.mesh.open_ended:
        return "the estimated error decides about the meshes"
    if not study.solver.in_blocks:
        return "the points are solved one by one, and the steps of their solvers are not known"
    return ""


def _factorisations(study: Study) -> int:
    return len(
        {Level.ratio(scene) for scene in distinct(study.scenes, *of_stiffness(study.scenes))}
    )


def _sample(study: Study, count: int) -> Study:
    """The study with so many of its points, spread over all."""
    places = np.unique(np.linspace(0, len(study.scenes) - 1, count).astype(int))
    scenes = tuple(study.scenes[int(i)] for i in places)
    return replace(
        study, scenes=scenes, axes=(), design=None, output=replace(study.output, live=False)
    )


def _trial_mesh(levels: Sequence[LevelForecast], mesh: MeshPlan) -> MeshPlan:
    """Return the mesh of a trial: the finest of a study that has at most TRIAL unknowns, made by
    refinement as the study makes it, or one of that size where all have more."""
    finest = levels[-1]
    coarser = max(0, math.ceil(math.log(finest.n_dof / TRIAL, 4)))
    refinements = mesh.refine + len(levels) - 1 if mesh.nested else 0
    if coarser <= refinements:
        maxh = finest.h * 2**coarser
        return replace(mesh, maxh=(maxh,), levels=1, refine=refinements - coarser)
    maxh = finest.h * math.sqrt(max(1.0, finest.n_dof / TRIAL))
    return replace(mesh, maxh=(maxh,), levels=1, refine=0)


def _timed(few: Study, many: Study) -> tuple[int, int, float, float]:
    """Return N and m of the one mesh of two studies, the CPU seconds of a run of the few points,
    and those of each point more.

    The many points are solved on what the few have left, which takes the time of points alone.
    """
    begin = time.process_time()
    mesh = meshes_of(few).next(0)
    level = Level(mesh, many.scenes[0], many.scenes, guarantee=many.mesh.guarantee)
    _solve(few, level)
    body = time.process_time() - begin
    point = 0.0
    if len(many.scenes) > len(few.scenes) and body < ENOUGH:
        begin = time.process_time()
        _solve(many, level)
        point = (time.process_time() - begin) / len(many.scenes)
    return level.frames.n_dof, level.line.m, body, point


def _solve(study: Study, level: Level) -> None:
    """Solve the points of a study on a level, and keep nothing."""
    meshes = meshes_of(study) if study.mesh.estimates else None
    estimator = meshes.estimator(level) if isinstance(meshes, Family) else None
    for _ in LevelSolver(study, level, estimator).solve():
        pass
