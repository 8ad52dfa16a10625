"""Run a study: level by level, block by block, each result handed on as soon as it is there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.records import BlockRecord, LevelRecord, PointStatus
from tcstudy.errors import GeometryFailed
from tcstudy.executors import Executor, Here
from tcstudy.fem.meshes import Meshes, PlaneMesh
from tcstudy.offline.level import Level
from tcstudy.offline.live import live_arrays
from tcstudy.refine.family import Family
from tcstudy.refine.survey import Survey
from tcstudy.scene.study import Study
from tcstudy.study.blocks import Solutions
from tcstudy.study.workshop import Workshop, all_failed

Key = tuple[int, int]
"""A block: (level, number)."""
Choice = Callable[[Study, int], Executor]
"""(study, contact unknowns of a level) → who solves its blocks."""


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
    """What a run reports while it works; a terminal shows it, a test ignores it."""

    def begin(self, work: Sequence[LevelWork], warnings: Sequence[str]) -> None: ...
    def level(self, record: LevelRecord) -> None: ...
    def block(self, record: BlockRecord) -> None: ...


@dataclass(frozen=True)
class Stage:
    """A level at work.

    level:  None if its mesh cannot be made, or all its points were finished before
    record: what the data keep of it
    blocks: its points, each block as soon as it is solved
    stop:   asked when all are: why refinement ends here, in words; empty if it goes on
    """

    level: Level | None
    record: LevelRecord | None
    blocks: Iterator[BlockRecord]
    stop: Callable[[], str]


def run(
    study: Study, finished: Mapping[Key, BlockRecord] | None = None, executor: Choice | None = None
) -> Iterator[LevelRecord | BlockRecord]:
    """Yield each level's record, then its points, block by block.

    finished: blocks to leave out; their solutions start their neighbours as if they had been found in this run
    executor: who solves the blocks of a level; None for this process

    A point that fails is recorded with its status and reason, and the rest goes on. Points come in an order that
    reuses factors and loads, not in the order of the sweep.
    Raises GeometryFailed if the body cannot be meshed, WorkersFailed if the executor has no workers.
    """
    for stage in stages(study, finished, executor):
        if stage.record is not None:
            yield stage.record
        yield from stage.blocks
        if stage.record is not None and (stop := stage.stop()):
            yield replace(stage.record, stop=stop)


def stages(
    study: Study, finished: Mapping[Key, BlockRecord] | None = None, executor: Choice | None = None
) -> Iterator[Stage]:
    """The levels of a study one after the other; take all blocks of one before the next is asked for.

    Raises GeometryFailed if the body cannot be meshed.
    """
    meshes = Family(study) if study.mesh.estimates else Meshes(study)
    for i in range(study.mesh.levels):
        known = {number: block for (level, number), block in (finished or {}).items() if level == i}
        try:
            mesh = meshes.next(i)
            whole = sum(len(block) for block in known.values()) == len(study.scenes)
            if whole and not study.mesh.estimates:
                continue
            level = Level(mesh, study.scenes[0], study.scenes)
        except GeometryFailed as error:
            if i == 0 or not study.mesh.listed:
                raise
            failed = all_failed(study, i, PointStatus.MESH_FAILED, str(error))
            yield Stage(None, None, iter(() if 0 in known else (failed,)), str)
            continue
        survey = meshes.survey(level) if isinstance(meshes, Family) else None
        who = executor(study, level.line.m) if executor is not None else Here()
        workshop = Workshop(study, level, Solutions(study, level.line.m), survey, who)

        def stop(survey: Survey | None = survey, last: bool = i + 1 == study.mesh.levels) -> str:
            return survey.stop(last) if survey is not None else ""

        yield Stage(level, level_record(study, mesh, level), workshop.work(known), stop)
        if stop() and study.mesh.open_ended:
            return


def level_record(study: Study, mesh: PlaneMesh, level: Level) -> LevelRecord:
    """What the data keep of a level: sizes, the contact line, and the mesh if fields are kept."""
    line = level.line
    fields: dict[str, NDArray[np.generic]] = {}
    if study.output.fields:
        fields = {
            "node_x": mesh.points[:, 0],
            "node_y": mesh.points[:, 1],
            "triangle": mesh.triangles.astype(np.int32),
        }
    if study.output.live:
        fields |= live_arrays(study, level)
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
