"""Run a study: level by level, block by block, into its result file.

`stages` are the levels at work, `run` their records, `execute` writes these into a file: of one
body, or of one geometry after the other.

What is finished is kept in a journal at once, and the netCDF file appears whole at the end. A
geometry is a study like any other, with the swept numbers put in. Where workers pay, each makes the
mesh of a geometry and solves all its points, and this process alone writes; a geometry that is long
or large is solved here, and its blocks by the workers.
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
from typing import Any, Protocol

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
from tcstudy.offline.level import Level, live_arrays
from tcstudy.refine.family import ErrorEstimator, Family
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study, Variant
from tcstudy.study.level_solver import LevelSolver, Times, all_failed, keeps_solutions
from tcstudy.study.lint import built_faults, faults, warnings
from tcstudy.study.stored import Kept, output_of
from tcstudy.study.workers import (
    BlockExecutor,
    Resources,
    WorkerPool,
    contact_seconds,
    expected_bytes,
    of_geometry,
    predicted,
    submit,
)


@dataclass(frozen=True)
class LevelWork:
    """What a level holds in store: its points, those finished before, and the relative cost of one
    of them.

    sure: whether there will be this level, which refinement up to a tolerance may not need
    """

    points: int
    done: int
    weight: float
    sure: bool = True


class Watcher(Protocol):
    """What a run reports while it works, with the geometry in words where there are several."""

    def begin(self, work: Sequence[LevelWork]) -> None: ...
    def level(self, record: LevelRecord, geometry: str = "") -> None: ...
    def block(self, record: BlockRecord) -> None: ...


@dataclass(frozen=True)
class Stage:
    """A level at work.

    level:  None if its mesh cannot be made, or all its points were finished before
    record: what the data keep of it
    blocks: its points, each block as soon as it is solved
    stop:   asked when all are: why refinement ends here, in words; empty if it goes on
    times:  what it took so far
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
) -> Iterator[LevelRecord | BlockRecord]:
    """Yield each level's record, then its points, block by block.

    finished: blocks to leave out; their solutions start their neighbours as if they had been found
    in this run executor: who solves the blocks of a level; None for this process

    A point that fails is recorded with its status and reason, and the rest goes on. Points come in
    an order that
    reuses factors and loads, not in the order of the sweep.
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
    """The levels of a study one after the other; take all blocks of one before the next is asked
    for.

    first: the first level that is wanted; those before are meshes on the way to it, which must not
    need solutions Where nothing is estimated, and neither points nor times are wanted, blocks may
    be left. Raises GeometryFailed if the body cannot be meshed.
    """
    clock = time.perf_counter()
    meshes = meshes_of(study)
    geometry = time.perf_counter() - clock
    for i in range(study.mesh.levels):
        known, times = [block for block in finished if block.level == i], Times(geometry)
        try:
            with times.of("mesh"):
                mesh = meshes.next(i)
            whole = sum(map(len, known)) == len(study.scenes)
            if i < first or (whole and not (study.mesh.estimates or study.output.live)):
                continue
            with times.of("assemble"):
                level = Level(mesh, study.scenes[0], study.scenes, guarantee=study.mesh.guarantee)
        except GeometryFailed as error:
            if i == 0 or not study.mesh.listed:
                raise
            left = np.setdiff1d(
                np.arange(len(study.scenes)), [place for one in known for place in one.points]
            )
            failed = all_failed(study, i, left, PointStatus.MESH_FAILED, str(error))
            yield Stage(None, None, iter((failed,) if len(left) else ()), str)
            continue
        with times.of("estimate"):
            estimator = meshes.estimator(level) if isinstance(meshes, Family) else None
        who = executor(study, level.line.m) if executor is not None else SerialExecutor()
        blocks = LevelSolver(study, level, estimator, who, times).solve(known)
        stop = partial(_stop, estimator, i + 1 == study.mesh.levels, times)
        yield Stage(level, level_record(study, mesh, level), _timed(blocks, times), stop, times)
        if stop() and study.mesh.open_ended:
            return


def level_of(study: Study, scene: Scene, number: int | None, held: bool = True) -> Level:
    """One level of a study by its number, None for the finest; held: whether more than friction
    holds the body. Coarser meshes are only stations on the way to it. Raises GeometryFailed."""
    meshes, count = Meshes(study), study.mesh.levels if number is None else number + 1
    return Level([meshes.next(i) for i in range(count)][-1], scene, held=held)


def meshes_of(study: Study) -> Meshes:
    """The meshes of a run. Raises GeometryFailed if the body cannot be made."""
    return Family(study) if study.mesh.estimates else Meshes(study)


def _timed(blocks: Iterator[BlockRecord], times: Times) -> Iterator[BlockRecord]:
    """The blocks; what they took goes to `points`, estimates left out."""
    while True:
        before = times.estimate
        with times.of("points"):
            block = next(blocks, None)
        times.points -= times.estimate - before
        if block is None:
            return
        yield block


def _stop(estimator: ErrorEstimator | None, last: bool, times: Times) -> str:
    """Why refinement ends on this level; empty if it goes on."""
    with times.of("estimate"):
        return estimator.stop(last) if estimator is not None else ""


def _rim(study: Study, mesh: PlaneMesh) -> dict[str, NDArray[np.generic]]:
    """Return the variables of data.schema.RIM: the boundary of the mesh by edges of the study."""
    names = [name for name, _ in study.scenes[0].boundary]
    edge_of_curve = np.array([names.index(curve.name) for curve in mesh.geometry.curves])
    ends = mesh.points[mesh.segments]
    return {
        "rim_x": ends[..., 0],
        "rim_y": ends[..., 1],
        "rim_edge": edge_of_curve[mesh.segment_curve].astype(np.int8),
    }


def level_record(study: Study, mesh: PlaneMesh, level: Level) -> LevelRecord:
    """What the data keep of a level: sizes, the contact line, and the mesh if fields are kept."""
    line = level.line
    (at, side), fields = line.held, dict[str, NDArray[np.generic]]()
    if len(at):
        starts, (x, y) = np.cumsum(line.lengths) - line.lengths, line.ends[at, side].T
        fields = {"held_arclength": starts[at] + side * line.lengths[at], "held_x": x, "held_y": y}
    fields |= {
        f"joint_{name}": values for name, values in line.joints._asdict().items() if len(values)
    }
    if study.scenes[0].body.brep is not None:
        fields |= _rim(study, mesh)
    if study.output.fields:
        fields |= {
            "node_x": mesh.points[:, 0],
            "node_y": mesh.points[:, 1],
            "triangle": mesh.triangles.astype(np.int32),
        }
        if own := study.scenes[0].material.regions:
            fields["region"] = mesh.numbered(tuple(name for name, _ in own)).astype(np.int8)
    if study.output.live:
        kept = live_arrays(level, study.scenes, study.shape)
        fields |= {LIVE_PREFIX + name: values for name, values in kept.items()}
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


def as_start(study: Study, block: BlockRecord) -> BlockRecord:
    """What the run needs of a finished block: which points, and their solutions if others begin
    from them. Copies, since a journal's arrays are views of all that the block has; the rest stays
    on the disk."""
    u_T = block.u_T if study.mesh.estimates or keeps_solutions(study) else None
    own = block.points.copy(), block.status.copy(), block.reasons
    return BlockRecord(
        block.level, block.shape, *own, numbers={}, u_T=None if u_T is None else u_T.copy()
    )


def work_of(study: Study, finished: Iterable[BlockRecord]) -> list[LevelWork]:
    """Points of every level, and those finished before; a point costs about as much as its mesh has
    nodes."""
    mesh, growth, done = study.mesh, study.mesh.strategy.growth, [0] * study.mesh.levels
    for block in finished:
        done[block.level] += len(block)
    finer = [
        (mesh.maxh[0] / mesh.maxh[i]) ** 2 if mesh.listed else growth**i for i in range(mesh.levels)
    ]
    return [
        LevelWork(len(study.scenes), done[i], finer[i], not mesh.open_ended)
        for i in range(mesh.levels)
    ]


def to_file(
    path: Path,
    study: Study,
    command: Sequence[str],
    find: Callable[[], Record],
    alone: Study | None = None,
    said: Sequence[Remark] = (),
    lock: Journal | None = None,
) -> None:
    """Write the file of what `find` finds of a study, or of a part of it alone; its warnings are
    said before, behind others.

    lock: that of the file, if it was taken before

    Raises StoreError if the file cannot be written, before any work as far as that is known.
    """
    if problems := check_writable(path, SMALL):
        raise StoreError("; ".join(problems))
    tell(remarks := [*said, *warnings(alone or study)])
    with lock or Journal.open(path) as journal:
        with threadpool_limits(1, user_api="blas"):
            record = find()
        attributes = collect(study, command, remarks=remarks)
        write_record(path, study, record, attributes, journal.seen)


SMALL = 1_000_000
"""Bytes that a file of errors, costs or a fit has at most."""


@dataclass(frozen=True)
class Summary:
    """What came of a run: how many solutions there are, failed and resumed ones counted."""

    points: int
    failed: int
    resumed: int


LONG, LARGE = 60.0, 2**28
"""Seconds of contact problems, and bytes of results, from which a geometry is solved and kept block
by block."""


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
    """Run all points of a study, of one body or of one geometry after the other, and write the
    result file.

    jobs: worker processes, None for as many as pay;  dask: address of a scheduler whose workers are to do it instead
    kept: what the output has of the study already and keeps (study.append), None for nothing
    pool: who works, if some have begun to;  lock: that of the output, if it was taken before
    Only this process writes, and the numbers are the same to the bit.
    A run that was killed or interrupted leaves its finished points beside the output; the same study then goes on
    where it stopped. Of a sweep, a geometry without a mesh, or one that kills its workers, is a status of its points.
    Raises StoreError if the results cannot be kept, GeometryFailed if the body has no mesh, WorkersFailed if there are
    no workers; KeyboardInterrupt passes through after the finished points are on the disk.
    """
    output, kept, bodies = output or output_of(study), kept or Kept.none(study), study.bodies
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
        tell([*journal.warnings, *(remarks := warnings(study))])
        each = [_results(study, kept, journal, i) for i in range(len(bodies))]
        # what broke down unexpectedly is tried again; what failed by its own numbers would fail
        # again
        finished = [
            [
                as_start(study, one)
                for one in own.blocks()
                if not np.any(one.status == PointStatus.ERROR)
            ]
            for own in each
        ]
        work, failed, meshed = (
            work_of(study, chain.from_iterable(finished)),
            list[BlockRecord](),
            dict[int, Results](),
        )
        if watcher is not None:
            watcher.begin(work)
        for i, (body, found) in enumerate(zip(bodies, _found(study, finished, pool), strict=True)):
            before = {level.level: level for level in each[i].levels()}
            try:
                for record in found():
                    if isinstance(record, LevelRecord) and record.level in before:
                        record = _same_mesh(before[record.level], record)
                    journal.add(record, i)
                    _show(watcher, record, study, body)
            except Exception as error:  # as of a block: one geometry must not end a sweep
                if not study.variants or (
                    isinstance(error, UserFault) and not isinstance(error, GeometryFailed)
                ):
                    raise
                status, reason = PointStatus.MESH_FAILED, str(error)
                if not isinstance(error, GeometryFailed):
                    status, reason = PointStatus.ERROR, f"{type(error).__name__}: {error}"
                for level in range(study.mesh.levels):
                    failed.append(all_failed(study, level, body.places, status, reason))
                    _show(watcher, failed[-1], study)
            else:
                meshed[i] = each[i]
            # meshes and matrices refer to each other in circles, and the command line looks for
            # those rarely: without this each geometry would keep half a megabyte
            gc.collect(0)
        pool.close()  # before the file, which takes memory, is written
        whole = replace(each[0], attributes=kept.before(collect(study, command, remarks=remarks)))
        if study.variants:
            whole = replace(whole, study=study, levels=tuple, blocks=lambda: failed)
        elif (
            study.mesh.estimates
            and not study.mesh.listed
            and (levels := [level.level for level in each[0].levels()])
        ):
            # without those that its tolerance did not need
            whole = replace(
                whole, study=replace(study, mesh=replace(study.mesh, levels=levels[-1] + 1))
            )
        count, bad = write(
            output, whole, meshed if study.variants else {}, kept.close, journal.seen
        )
        journal.discard()
    return Summary(count, bad, sum(one.done for one in work))


def _results(study: Study, kept: Kept, journal: Journal, i: int) -> Results:
    """What a file keeps of a body, then what the journal has of it."""

    def levels() -> Iterable[LevelRecord]:
        return {level.level: level for level in (*kept.levels(i), *journal.levels(i))}.values()

    return Results(
        study.bodies[i].study or study, levels, lambda: chain(kept.blocks(i), journal.blocks(i))
    )


Records = list[LevelRecord | BlockRecord]


def _found(
    study: Study, finished: Sequence[Sequence[BlockRecord]], pool: WorkerPool
) -> Iterator[Callable[[], Iterable[LevelRecord | BlockRecord]]]:
    """What finds the records of every body that are not finished, here or by a worker that makes
    its mesh. A geometry that takes long or has large results, or points from before, is solved
    here, block by block."""
    sent, answers = dict[int, tuple[Study, Resources]](), iter(list[Future[Records]]())
    for i, body in enumerate(study.variants):
        if (own := body.study) is not None and not finished[i]:
            took = sum(contact_seconds(own, level.n_contact) for level in predicted(own))
            if took < LONG and expected_bytes(own) < LARGE:
                sent[i] = own, of_geometry(own)
    if (who := pool.whole([one for _, one in sent.values()])) is not None:
        words = {i: f"geometry-{i} {study.variants[i].words}" for i in sent}
        calls = (
            submit(who, solve_geometry, own, name=words[i], seconds=one.seconds)
            for i, (own, one) in sent.items()
        )
        answers = in_order(who, calls)

    def found(i: int) -> Iterable[LevelRecord | BlockRecord]:
        if (own := study.bodies[i].study) is None:
            raise GeometryFailed(study.bodies[i].reason)
        whole = sum(map(len, finished[i])) == len(own.scenes) * own.mesh.levels
        if whole and not (own.output.live or own.mesh.estimates):  # not even a mesh is needed
            return ()
        return (
            next(answers).result()
            if i in sent and who is not None
            else run(own, finished[i], pool.blocks)
        )

    return (partial(found, i) for i in range(len(study.bodies)))


def _same_mesh(old: LevelRecord, new: LevelRecord) -> LevelRecord:
    """A level that was solved in part before, with what a page needs of all points.
    Raises StoreError for another mesh."""
    if not all(
        np.array_equal(getattr(old, name), getattr(new, name))
        for name in ("n_dof", "x", "y", "c", "edge")
    ):
        what = f"the mesh of level {old.level} is not that of the points solved before, which stay"
        raise StoreError(f"{what}; run the whole study with --force")
    return replace(old, fields=new.fields, stop=new.stop)


def _show(watcher: Watcher | None, record: Any, study: Study, body: Variant | None = None) -> None:
    """Tell of a level, or of points by their places in the whole sweep; body: whose places they
    have, if not that."""
    if watcher is None:
        return
    if isinstance(record, BlockRecord):
        places = record.points if body is None else body.places[record.points]
        watcher.block(replace(record, points=places, shape=study.shape))
    elif not record.stop:  # one that says why the level was the last follows its points
        watcher.level(record, body.words if body is not None else "")


def solve_geometry(study: Study) -> list[LevelRecord | BlockRecord]:
    """All records of the run of a study with one geometry, in their order. Raises
    GeometryFailed."""
    for keys, what, remedy in built_faults(study):
        raise GeometryFailed(f"{what}; {remedy}", tuple(map(str, keys)))
    return list(run(study))
