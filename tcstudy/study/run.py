"""Run a study: level by level, block by block, each result handed on as soon as it is there.

`run` gives the records, `stages` the levels themselves; `study.execute` writes them into a file.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.records import BlockRecord, LevelRecord, PointStatus
from tcstudy.data.schema import LIVE_PREFIX
from tcstudy.errors import GeometryFailed
from tcstudy.executors import SerialExecutor
from tcstudy.fem.boundary import held_ends
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.fem.study_meshes import Meshes
from tcstudy.offline.level import Level, live_arrays
from tcstudy.refine.error_estimator import ErrorEstimator
from tcstudy.refine.family import Family
from tcstudy.scene.study import Study
from tcstudy.study.append import ExistingResults
from tcstudy.study.level_solver import LevelSolver, Times, all_failed, keeps_solutions
from tcstudy.study.workers import BlockExecutor


@dataclass(frozen=True)
class LevelWork:
    """What a level holds in store: its points, those finished before, and the relative cost of one of them.

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


class Quiet:
    """A watcher that shows nothing."""

    def begin(self, work: Sequence[LevelWork]) -> None:
        """Nothing to show."""

    def level(self, record: LevelRecord, geometry: str = "") -> None:
        """Nothing to show."""

    def block(self, record: BlockRecord) -> None:
        """Nothing to show."""


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
    kept: ExistingResults | None = None,
) -> Iterator[LevelRecord | BlockRecord]:
    """Yield each level's record, then its points, block by block.

    finished: blocks to leave out; their solutions start their neighbours as if they had been found in this run
    executor: who solves the blocks of a level; None for this process
    kept:     what a file has of the study; only the other points are solved

    A point that fails is recorded with its status and reason, and the rest goes on. Points come in an order that
    reuses factors and loads, not in the order of the sweep.
    Raises GeometryFailed if the body cannot be meshed, WorkersFailed if the executor has no workers.
    """
    for stage in stages(study, finished, executor, kept):
        if stage.record is not None:
            yield stage.record
        yield from stage.blocks
        if stage.record is not None and (stop := stage.stop()):
            yield replace(stage.record, stop=stop)


def stages(
    study: Study,
    finished: Sequence[BlockRecord] = (),
    executor: BlockExecutor | None = None,
    kept: ExistingResults | None = None,
    first: int = 0,
) -> Iterator[Stage]:
    """The levels of a study one after the other; take all blocks of one before the next is asked for.

    first: the first level that is wanted; those before are meshes on the way to it, which must not need solutions
    Where nothing is estimated, and neither points nor times are wanted, blocks may be left.
    Raises GeometryFailed if the body cannot be meshed.
    """
    clock = time.perf_counter()
    meshes = meshes_of(study)
    geometry = time.perf_counter() - clock
    for i in range(study.mesh.levels):
        known = [block for block in finished if block.level == i]
        times = Times(geometry)
        todo = np.arange(len(study.scenes)) if kept is None else np.flatnonzero(kept.todo[:, i])
        try:
            clock = time.perf_counter()
            mesh = meshes.next(i)
            times.mesh = time.perf_counter() - clock
            if i < first:
                continue
            whole = sum(map(len, known)) == len(todo)
            if whole and not study.mesh.estimates and (kept is None or not study.output.live):
                continue
            clock = time.perf_counter()
            level = Level(mesh, study.scenes[0], study.scenes, guarantee=study.mesh.guarantee)
            times.assemble = time.perf_counter() - clock
        except GeometryFailed as error:
            if i == 0 or not study.mesh.listed:
                raise
            failed = all_failed(study, i, todo, PointStatus.MESH_FAILED, str(error))
            yield Stage(None, None, iter(() if known else (failed,)), str)
            continue
        clock = time.perf_counter()
        estimator = meshes.estimator(level) if isinstance(meshes, Family) else None
        times.estimate = time.perf_counter() - clock
        who = executor(study, level.line.m) if executor is not None else SerialExecutor()
        solver = LevelSolver(study, level, estimator, who, times, todo=todo)
        if kept is not None and solver.solutions is not None:
            for block in kept.blocks(study, i):
                solver.solutions.take(block)
        stop = partial(_stop, estimator, i + 1 == study.mesh.levels, times)
        yield Stage(level, level_record(study, mesh, level), _timed(solver.solve(known), times), stop, times)
        if stop() and study.mesh.open_ended:
            return


def meshes_of(study: Study) -> Meshes:
    """The meshes of a run. Raises GeometryFailed if the body cannot be made."""
    return Family(study) if study.mesh.estimates else Meshes(study)


def _timed(blocks: Iterator[BlockRecord], times: Times) -> Iterator[BlockRecord]:
    """The blocks; what they took goes to `points`, estimates left out."""
    while True:
        clock, estimate = time.perf_counter(), times.estimate
        block = next(blocks, None)
        times.points += time.perf_counter() - clock - (times.estimate - estimate)
        if block is None:
            return
        yield block


def _stop(estimator: ErrorEstimator | None, last: bool, times: Times) -> str:
    """Why refinement ends on this level; empty if it goes on."""
    clock = time.perf_counter()
    words = estimator.stop(last) if estimator is not None else ""
    times.estimate += time.perf_counter() - clock
    return words


def level_record(study: Study, mesh: PlaneMesh, level: Level) -> LevelRecord:
    """What the data keep of a level: sizes, the contact line, and the mesh if fields are kept."""
    line = level.line
    fields: dict[str, NDArray[np.generic]] = held_ends(mesh, line, study.scenes[0].boundary)
    fields |= {f"joint_{name}": values for name, values in line.joints._asdict().items() if len(values)}
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
    """What the run needs of a finished block: which points, and their solutions if others begin from them.

    Copies, since a journal's arrays are views of all that the block has; the rest stays on the disk.
    """
    needed = study.mesh.estimates or keeps_solutions(study)
    return replace(
        block,
        points=block.points.copy(),
        status=block.status.copy(),
        numbers={},
        u_T=None if block.u_T is None or not needed else block.u_T.copy(),
        xi=None,
        sticks=None,
        fields={},
    )


def work_of(study: Study, finished: Sequence[BlockRecord], kept: ExistingResults | None) -> list[LevelWork]:
    """Points of every level; a point costs about as much as its mesh has nodes."""
    mesh, growth = study.mesh, study.mesh.strategy.growth
    points = [len(study.scenes)] * mesh.levels if kept is None else kept.todo.sum(axis=0).tolist()
    done = [sum(len(block) for block in finished if block.level == i) for i in range(mesh.levels)]
    finer = [(mesh.maxh[0] / mesh.maxh[i]) ** 2 if mesh.listed else growth**i for i in range(mesh.levels)]
    return [LevelWork(points[i], done[i], finer[i], not mesh.open_ended) for i in range(mesh.levels)]
