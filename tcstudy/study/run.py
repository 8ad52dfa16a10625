"""Run a study: level by level, block by block, into its result file.

`stages` yields the levels at work, `run` their records, and `execute` writes these into a file: of
one body, or of one geometry after the other.

A journal keeps finished points at once, and the netCDF file appears whole at the end. A geometry is
a study like any other, with the swept values put in. Where workers pay, each makes the mesh of a
geometry and solves all its points, and this process alone writes. A geometry that is long or large
is meshed here, and the workers solve its blocks.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tcstudy.data.files import Remark, check_writable, collect, tell
from tcstudy.data.records import BlockRecord, Journal, LevelRecord, Record
from tcstudy.data.schema import LIVE_PREFIX, PointStatus
from tcstudy.data.store import Results, write, write_record
from tcstudy.errors import GeometryFailed, StoreError, UserFault
from tcstudy.executors.processes import SerialExecutor, in_order
from tcstudy.fem.meshes import Meshes, PlaneMesh
from tcstudy.offline.body_bands import BodyBands
from tcstudy.offline.guaranteed import Band
from tcstudy.offline.level import Level, live_arrays
from tcstudy.refine.family import ErrorEstimator, Family
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study, Variant
from tcstudy.study.level_solver import LevelSolver, Times, all_failed, keeps_solutions
from tcstudy.study.lint import built_faults, faults, warnings
from tcstudy.study.stored import Kept, output_of
from tcstudy.study.workers import (
    BlockExecutor,
    WorkerPool,
    contact_seconds,
    expected_bytes,
    geometry_resources,
    predicted_sizes,
    submit,
)


@dataclass(frozen=True)
class LevelWork:
    """The work of a level: its points, those finished before, and the relative cost of a point.

    sure: whether the run has this level; refinement up to a tolerance may end before it
    """

    points: int
    done: int
    weight: float
    sure: bool = True


AnyRecord = LevelRecord | BlockRecord


class Watcher(Protocol):
    """The reports of a run at work, with the geometry in words where there are several."""

    def begin(self, work: Sequence[LevelWork]) -> None: ...
    def level(self, record: LevelRecord, geometry: str = "") -> None: ...
    def block(self, record: BlockRecord) -> None: ...


@dataclass(frozen=True)
class Stage:
    """A level at work.

    level:  None if its mesh cannot be made
    record: what the data keep of the level
    blocks: its points, each block as soon as it is solved
    stop:   returns why refinement ends here, empty if it goes on; call it when all are solved
    times:  what the level took so far
    """

    level: Level | None
    record: LevelRecord | None
    blocks: Iterator[BlockRecord]
    stop: Callable[[], str]
    times: Times = field(default_factory=Times)


def run(
    study: Study,
    finished: Sequence[BlockRecord] = (),
    executor: BlockExecutor | None = None,
) -> Iterator[AnyRecord]:
    """Yield each level's record, then its points, block by block.

    finished: blocks to leave out; their solutions start neighbours as those of this run do
    executor: who solves the blocks of a level; None for this process

    A point that fails is recorded with its status and reason, and the run goes on. Points come in
    an order that reuses factors and loads, not in the order of the sweep.
    Raises GeometryFailed if the body cannot be meshed, WorkersFailed if the executor has no
    workers.
    """
    for stage in stages(study, finished, executor):
        if stage.record is not None:
            yield stage.record
        yield from stage.blocks
        if stage.record is not None and (stop := stage.stop()):
            yield replace(stage.record, stop=stop)


def stages(
    study: Study,
    finished: Sequence[BlockRecord] = (),
    executor: BlockExecutor | None = None,
    first: int = 0,
) -> Iterator[Stage]:
    """Yield the levels of a study; take all blocks of a level before the next level.

    finished, executor: as of `run`
    first: the first level to yield; coarser meshes are made on the way and must not need solutions

    Blocks may be left untaken where nothing is estimated and neither points nor times are wanted.
    Raises GeometryFailed if the body cannot be meshed.
    """
    clock = time.perf_counter()
    meshes = meshes_of(study)
    geometry_seconds = time.perf_counter() - clock
    band_of: Callable[[Scene], Band] | None = None
    needs_all_levels = study.mesh.estimates or study.output.live
    for number in range(study.mesh.levels):
        earlier_blocks = [block for block in finished if block.level == number]
        is_complete = sum(map(len, earlier_blocks)) == len(study.scenes)
        times = Times(geometry_seconds)
        try:
            with times.measure("mesh"):
                mesh = meshes.next(number)
            if number == 0 and study.encloses_lambda_1 and not study.mesh.bounds_errors:
                band_of = BodyBands(study, mesh).of
            if number < first or (is_complete and not needs_all_levels):
                continue
            with times.measure("assemble"):
                level = Level(
                    mesh,
                    study.scenes[0],
                    study.scenes,
                    guarantee=study.mesh.guarantee,
                    band_of=band_of,
                )
        except GeometryFailed as error:
            if number == 0 or not study.mesh.listed:
                raise
            yield _stage_without_mesh(study, number, earlier_blocks, str(error))
            continue
        with times.measure("estimate"):
            estimator = meshes.estimator(level) if isinstance(meshes, Family) else None
        workers = executor(study, level.m) if executor is not None else SerialExecutor()
        blocks = LevelSolver(study, level, estimator, workers, times).solve(earlier_blocks)
        is_last = number + 1 == study.mesh.levels
        stop = partial(_stop, estimator, is_last, times)
        stage = Stage(level, level_record(study, mesh, level), _timed(blocks, times), stop, times)
        yield stage
        if stage.stop() and study.mesh.open_ended:
            return


def level_of(study: Study, scene: Scene, number: int | None) -> Level:
    """Return a level of a study by its number, None for the finest.

    Coarser meshes are made on the way to it.
    Raises GeometryFailed.
    """
    meshes = Meshes(study)
    finest = study.mesh.levels - 1 if number is None else number
    for coarser in range(finest):
        meshes.next(coarser)
    return Level(meshes.next(finest), scene)


def meshes_of(study: Study) -> Meshes:
    """Return the meshes of a run. Raises GeometryFailed if the body cannot be made."""
    return Family(study) if study.mesh.estimates else Meshes(study)


def _stage_without_mesh(
    study: Study, number: int, earlier_blocks: Sequence[BlockRecord], reason: str
) -> Stage:
    """Return the stage of a level whose mesh fails: its unfinished points fail as well."""
    is_left = np.ones(len(study.scenes), dtype=bool)
    for block in earlier_blocks:
        is_left[block.points] = False
    points = np.flatnonzero(is_left)
    failed = all_failed(study, number, points, PointStatus.MESH_FAILED, reason)
    blocks = [failed] if len(points) else []
    return Stage(None, None, iter(blocks), lambda: "")


def _timed(blocks: Iterator[BlockRecord], times: Times) -> Iterator[BlockRecord]:
    """Yield the blocks; their time counts as that of `points`, without estimates."""
    while True:
        estimate_before = times.estimate
        with times.measure("points"):
            block = next(blocks, None)
        times.points -= times.estimate - estimate_before
        if block is None:
            return
        yield block


def _stop(estimator: ErrorEstimator | None, is_last: bool, times: Times) -> str:
    """Return why refinement ends on this level; empty if it goes on."""
    with times.measure("estimate"):
        return estimator.stop(is_last) if estimator is not None else ""


Fields = dict[str, NDArray[np.generic]]


def level_record(study: Study, mesh: PlaneMesh, level: Level) -> LevelRecord:
    """Return what the data keep of a level: sizes, contact line, and the mesh for fields."""
    line = level.line
    fields = _contact_line_fields(level)
    if study.scenes[0].body.brep is not None:
        fields |= _rim(study, mesh)
    if study.output.fields:
        fields |= _mesh_fields(study, mesh)
    if study.output.live:
        arrays = live_arrays(level, study.scenes, study.shape)
        fields |= {LIVE_PREFIX + name: values for name, values in arrays.items()}
    return LevelRecord(
        level=mesh.level,
        h_max=mesh.h_max,
        n_dof=level.frames.n_dof,
        n_contact=level.m,
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


def _contact_line_fields(level: Level) -> Fields:
    """Return the constrained ends of the contact line, its joints and its openings, if any."""
    line = level.line
    fields: Fields = {}
    segment, side = line.held
    if len(segment):
        starts = np.cumsum(line.lengths) - line.lengths
        ends = line.ends[segment, side]
        fields["held_arclength"] = starts[segment] + side * line.lengths[segment]
        fields["held_x"] = ends[:, 0]
        fields["held_y"] = ends[:, 1]
    for name, values in line.joints._asdict().items():
        if len(values):
            fields[f"joint_{name}"] = values
    opening = level.opening
    if opening is not None:
        fields["opening_arclength"] = opening.arclength
        fields["opening_x"], fields["opening_y"] = opening.xy.T
        fields["opening_edge"] = opening.edge
        fields["c_N"] = opening.c
    return fields


def _rim(study: Study, mesh: PlaneMesh) -> Fields:
    """Return the variables of data.schema.RIM: the boundary of the mesh by edges of the study."""
    names = [name for name, _ in study.scenes[0].boundary]
    edge_of_curve = np.array([names.index(curve.name) for curve in mesh.geometry.curves])
    ends = mesh.points[mesh.segments]
    return {
        "rim_x": ends[..., 0],
        "rim_y": ends[..., 1],
        "rim_edge": edge_of_curve[mesh.segment_curve].astype(np.int8),
    }


def _mesh_fields(study: Study, mesh: PlaneMesh) -> Fields:
    fields: Fields = {
        "node_x": mesh.points[:, 0],
        "node_y": mesh.points[:, 1],
        "triangle": mesh.triangles.astype(np.int32),
    }
    names = tuple(name for name, _ in study.scenes[0].material.regions)
    if names:
        fields["region"] = mesh.numbered(names).astype(np.int8)
    return fields


def as_start(study: Study, block: BlockRecord) -> BlockRecord:
    """Return what a run needs of a finished block: its points, and the starts of other points.

    Arrays are copied, because those of a journal are views of all that the block has.
    """
    starts_others = study.mesh.estimates or keeps_solutions(study)
    u_T = block.u_T.copy() if starts_others and block.u_T is not None else None
    opening = block.opening.copy() if starts_others and block.opening is not None else None
    return BlockRecord(
        block.level,
        block.shape,
        block.points.copy(),
        block.status.copy(),
        block.reasons,
        numbers={},
        u_T=u_T,
        opening=opening,
    )


def work_of(study: Study, finished: Iterable[BlockRecord]) -> list[LevelWork]:
    """Return the work of every level; a point costs about as much as its mesh has nodes."""
    mesh = study.mesh
    n_done = [0] * mesh.levels
    for block in finished:
        n_done[block.level] += len(block)
    if mesh.listed:
        weights = [(mesh.maxh[0] / maxh) ** 2 for maxh in mesh.maxh[: mesh.levels]]
    else:
        weights = [mesh.strategy.growth**i for i in range(mesh.levels)]
    return [
        LevelWork(len(study.scenes), done, weight, sure=not mesh.open_ended)
        for done, weight in zip(n_done, weights, strict=True)
    ]


MAX_RECORD_BYTES = 1_000_000
"""Largest size of a file of errors, costs or a fit."""


def to_file(
    path: Path,
    study: Study,
    command: Sequence[str],
    compute: Callable[[], Record],
    warned_study: Study | None = None,
    earlier_warnings: Sequence[Remark] = (),
    lock: Journal | None = None,
) -> None:
    """Run `compute` and write the record it returns.

    The warnings of `warned_study` (by default of `study`) are issued before the computation, after
    `earlier_warnings`.
    lock: that of the file, if it is taken already

    Raises StoreError if the file cannot be written, before any work as far as that is known.
    """
    if problems := check_writable(path, MAX_RECORD_BYTES):
        raise StoreError("; ".join(problems))
    remarks = [*earlier_warnings, *warnings(warned_study or study)]
    tell(remarks)
    with lock or Journal.open(path) as journal:
        with threadpool_limits(1, user_api="blas"):
            record = compute()
        attributes = collect(study, command, remarks=remarks)
        write_record(path, study, record, attributes, journal.seen)


@dataclass(frozen=True)
class Summary:
    """The outcome of a run: all solutions, and how many of them failed or were there before."""

    points: int
    failed: int
    resumed: int


def execute(
    study: Study,
    output: Path | None = None,
    watcher: Watcher | None = None,
    command: Sequence[str] = ("tcstudy",),
    jobs: int | None = None,
    dask: str | None = None,
    kept: Kept | None = None,
    pool: WorkerPool | None = None,
    lock: Journal | None = None,
) -> Summary:
    """Run all points of a study, of one body or of many geometries, and write the result file.

    jobs: worker processes, None for as many as pay
    dask: address of a scheduler whose workers do the work instead
    kept: what the output has of the study already and keeps (study.append), None for nothing
    pool: the workers, if some have been started
    lock: that of the output, if it is taken already

    Only this process writes, and the numbers are the same to the bit. A run that was killed or
    interrupted leaves its finished points beside the output, and the same study resumes there. In a
    sweep, a geometry without a mesh, or one that kills its workers, is a status of its points.

    Raises StoreError if the results cannot be kept, GeometryFailed if the body has no mesh,
    WorkersFailed if there are no workers. KeyboardInterrupt passes through after the finished
    points are on the disk.
    """
    output = output or output_of(study)
    kept = kept or Kept.none(study)
    if problems := faults(study, output):
        raise StoreError("\n".join(problems))
    with (
        closing(kept),
        closing((pool or WorkerPool(jobs, dask)).ready(study)) as pool,
        # two BLAS threads make the many small dense operations of a sweep slower, not faster
        threadpool_limits(1, user_api="blas"),
        lock or Journal.open(output) as journal,
    ):
        journal.begin(study)
        remarks = warnings(study)
        tell([*journal.warnings, *remarks])
        results = [_results(study, kept, journal, i) for i in range(len(study.bodies))]
        finished = [_finished_blocks(study, body_results) for body_results in results]
        work = work_of(study, chain.from_iterable(finished))
        if watcher is not None:
            watcher.begin(work)
        failed = _solve_bodies(study, results, finished, pool, journal, watcher)
        pool.close()  # before the file, which takes memory, is written
        attributes = kept.before(collect(study, command, remarks=remarks))
        meshed = dict[int, Results]()
        if study.variants:
            meshed = {i: body for i, body in enumerate(results) if i not in failed}
            failed_blocks = list(chain.from_iterable(failed.values()))
            all_results = Results(study, tuple, lambda: failed_blocks, attributes)
        else:
            all_results = replace(_without_unused_levels(study, results[0]), attributes=attributes)
        n_points, n_failed = write(output, all_results, meshed, kept.close, journal.seen)
        journal.discard()
    return Summary(n_points, n_failed, sum(level.done for level in work))


def _results(study: Study, kept: Kept, journal: Journal, i: int) -> Results:
    """Return what the file keeps of a body, then what the journal has of it."""

    def levels() -> Iterable[LevelRecord]:
        records = chain(kept.levels(i), journal.levels(i))
        return {record.level: record for record in records}.values()

    def blocks() -> Iterable[BlockRecord]:
        return chain(kept.blocks(i), journal.blocks(i))

    return Results(study.bodies[i].study or study, levels, blocks)


def _finished_blocks(study: Study, results: Results) -> list[BlockRecord]:
    """Return the blocks to leave out.

    Points that broke down unexpectedly are tried again. Those that the solver reported as failed
    would fail again.
    """
    blocks = list[BlockRecord]()
    for block in results.blocks():
        if not np.any(block.status == PointStatus.ERROR):
            blocks.append(as_start(study, block))
    return blocks


def _without_unused_levels(study: Study, results: Results) -> Results:
    """Return the results without the levels that a tolerance did not need."""
    if not study.mesh.estimates or study.mesh.listed:
        return results
    numbers = [record.level for record in results.levels()]
    if not numbers:
        return results
    mesh = replace(study.mesh, levels=numbers[-1] + 1)
    return replace(results, study=replace(study, mesh=mesh))


def _solve_bodies(
    study: Study,
    results: Sequence[Results],
    finished: Sequence[Sequence[BlockRecord]],
    pool: WorkerPool,
    journal: Journal,
    watcher: Watcher | None,
) -> dict[int, list[BlockRecord]]:
    """Solve the unfinished points of every body into the journal; return the failed ones by body.

    Raises what ends a run: any error of a study with one body, a user's fault of any study.
    """
    failed = dict[int, list[BlockRecord]]()
    sources = _record_sources(study, finished, pool)
    for i, (body, records_of_body) in enumerate(zip(study.bodies, sources, strict=True)):
        earlier_levels = {record.level: record for record in results[i].levels()}
        try:
            for record in records_of_body():
                if isinstance(record, LevelRecord) and record.level in earlier_levels:
                    record = _same_mesh(earlier_levels[record.level], record)
                journal.add(record, i)
                _show(watcher, record, study, body)
        except Exception as error:  # as of a block: one geometry must not end a sweep
            is_fault = isinstance(error, UserFault) and not isinstance(error, GeometryFailed)
            if not study.variants or is_fault:
                raise
            failed[i] = _failed_geometry(study, body, error)
            for block in failed[i]:
                _show(watcher, block, study)
        # meshes and matrices refer to each other in circles, and the command line looks for
        # those rarely: without this each geometry would keep half a megabyte
        gc.collect(0)
    return failed


def _failed_geometry(study: Study, body: Variant, error: Exception) -> list[BlockRecord]:
    if isinstance(error, GeometryFailed):
        status, reason = PointStatus.MESH_FAILED, str(error)
    else:
        status, reason = PointStatus.ERROR, f"{type(error).__name__}: {error}"
    levels = range(study.mesh.levels)
    return [all_failed(study, level, body.places, status, reason) for level in levels]


MAX_SECONDS_PER_CALL = 60.0
"""Time of its contact problems above which a geometry is solved and kept block by block."""
MAX_BYTES_PER_CALL = 2**28
"""Size of its results above which a geometry is solved and kept block by block."""


def _record_sources(
    study: Study, finished: Sequence[Sequence[BlockRecord]], pool: WorkerPool
) -> Iterator[Callable[[], Iterable[AnyRecord]]]:
    """Return for every body a function that solves its unfinished points, here or by a worker."""
    remote = dict[int, Study]()
    for i, body in enumerate(study.variants):
        if body.study is not None and not finished[i] and _fits_a_call(body.study):
            remote[i] = body.study
    resources = {i: geometry_resources(geometry) for i, geometry in remote.items()}
    executor = pool.executor_of_calls(list(resources.values()))
    answers: Iterator[Future[list[AnyRecord]]] = iter(())
    if executor is not None:
        calls = (
            submit(
                executor,
                solve_geometry,
                geometry,
                name=f"geometry-{i} {study.variants[i].words}",
                seconds=resources[i].seconds,
            )
            for i, geometry in remote.items()
        )
        answers = in_order(executor, calls)

    def records_of(i: int) -> Iterable[AnyRecord]:
        geometry = study.bodies[i].study
        if geometry is None:
            raise GeometryFailed(study.bodies[i].reason)
        is_complete = sum(map(len, finished[i])) == len(geometry.scenes) * geometry.mesh.levels
        if is_complete and not (geometry.output.live or geometry.mesh.estimates):
            return ()  # not even a mesh is needed
        if executor is not None and i in remote:
            return next(answers).result()
        return run(geometry, finished[i], pool.executor_of_blocks)

    return (partial(records_of, i) for i in range(len(study.bodies)))


def _fits_a_call(geometry: Study) -> bool:
    """Return whether one call of a worker may solve a geometry and send all its results."""
    seconds = sum(contact_seconds(geometry, level.n_contact) for level in predicted_sizes(geometry))
    return seconds < MAX_SECONDS_PER_CALL and expected_bytes(geometry) < MAX_BYTES_PER_CALL


def _same_mesh(old: LevelRecord, new: LevelRecord) -> LevelRecord:
    """Return a level that was solved in part before, with the arrays of a page for all points.

    Raises StoreError for another mesh.
    """
    names = ("n_dof", "x", "y", "c", "edge")
    if not all(np.array_equal(getattr(old, name), getattr(new, name)) for name in names):
        raise StoreError(
            f"the mesh of level {old.level} is not that of the points solved before, which stay; "
            "run the whole study with --force"
        )
    return replace(old, fields=new.fields, stop=new.stop)


def _show(
    watcher: Watcher | None,
    record: AnyRecord,
    study: Study,
    body: Variant | None = None,
) -> None:
    """Report a level, or points by their places in the whole sweep.

    body: in which the record counts its points; None if it counts them in the whole sweep
    """
    if watcher is None:
        return
    if isinstance(record, BlockRecord):
        places = record.points if body is None else body.places[record.points]
        watcher.block(replace(record, points=places, shape=study.shape))
    elif not record.stop:  # the record with the reason to stop follows the points of its level
        watcher.level(record, body.words if body is not None else "")


def solve_geometry(study: Study) -> list[AnyRecord]:
    """Return all records of a study with one geometry, in their order. Raises GeometryFailed."""
    for keys, fault, remedy in built_faults(study):
        raise GeometryFailed(f"{fault}; {remedy}", tuple(map(str, keys)))
    return list(run(study))
