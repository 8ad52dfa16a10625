"""Run a study into its result file: what is finished is kept at once, the netCDF file appears whole at the end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from tcstudy.data.files import StoreError
from tcstudy.data.journal import Journal
from tcstudy.data.provenance import collect
from tcstudy.data.records import BlockRecord, LevelRecord, PointStatus
from tcstudy.data.store import write
from tcstudy.scene.study import Study
from tcstudy.study.jobs import choosing
from tcstudy.study.plan import faults, output_of, warnings
from tcstudy.study.run import Key, LevelWork, Watcher, run


@dataclass(frozen=True)
class Summary:
    """What came of a run: where the data are and how many points there are, failed and resumed ones counted."""

    output: Path
    points: int
    failed: int
    resumed: int


class Quiet:
    """A watcher that shows nothing."""

    def begin(self, work: Sequence[LevelWork], warnings: Sequence[str]) -> None:
        """Nothing to show."""

    def level(self, record: LevelRecord) -> None:
        """Nothing to show."""

    def block(self, record: BlockRecord) -> None:
        """Nothing to show."""


def execute(
    study: Study,
    output: Path | None = None,
    watcher: Watcher | None = None,
    command: Sequence[str] = ("tcstudy",),
    jobs: int | None = None,
) -> Summary:
    """Run all points of a study and write the result file.

    jobs: worker processes, None for as many as pay; only this process writes, and the numbers are the same to the bit
    A run that was killed or interrupted leaves its finished points beside the output; the same study then goes on
    where it stopped. Raises StoreError if the results cannot be kept, GeometryFailed if the body has no mesh;
    WorkersFailed if there are no worker processes; KeyboardInterrupt passes through after the
    finished points are on the disk.
    """
    output = output if output is not None else output_of(study)
    watcher = watcher if watcher is not None else Quiet()
    problems = faults(study, output)
    if problems:
        raise StoreError("\n".join(problems))
    # Two BLAS threads make the many small dense operations of a sweep slower, not faster.
    with (
        threadpool_limits(1, user_api="blas"),
        Journal.open(output, study) as journal,
        choosing(jobs) as executor,
    ):
        # what broke down unexpectedly is tried again; what failed by its own numbers would fail again
        known = (block for block in journal.blocks() if not np.any(block.status == PointStatus.ERROR))
        finished = {(block.level, block.number): without_fields(block) for block in known}
        watcher.begin(_work(study, finished), [*journal.warnings, *warnings(study)])
        for record in run(study, finished, executor):
            journal.add(record)
            if isinstance(record, LevelRecord):
                if not record.stop:  # one that says why the level was the last follows its points
                    watcher.level(record)
            else:
                watcher.block(record)
        journal.flush()
        statuses = np.concatenate([np.empty(0, dtype=np.int8), *(block.status for block in journal.blocks())])
        levels = journal.levels()
        write(output, _with_levels(study, levels), levels, journal.blocks, collect(study, command))
        journal.discard()
    failed = int(np.count_nonzero(statuses != PointStatus.OK))
    return Summary(output, len(statuses), failed, sum(len(block) for block in finished.values()))


def _with_levels(study: Study, levels: Sequence[LevelRecord]) -> Study:
    """The study without the levels that its tolerance did not need."""
    if not study.mesh.estimates or study.mesh.listed or not levels:
        return study
    return replace(study, mesh=replace(study.mesh, levels=levels[-1].level + 1))


def without_fields(block: BlockRecord) -> BlockRecord:
    """A block as a start for others: its whole-body fields stay on the disk."""
    return replace(block, fields={}, numbers={})


def _work(study: Study, finished: Mapping[Key, BlockRecord]) -> list[LevelWork]:
    """Points of every level; a point costs about as much as its mesh has nodes."""
    mesh, points = study.mesh, len(study.scenes)
    done = [sum(len(block) for block in finished.values() if block.level == i) for i in range(mesh.levels)]
    growth = mesh.strategy.growth
    finer = [(mesh.maxh[0] / mesh.maxh[i]) ** 2 if mesh.listed else growth**i for i in range(mesh.levels)]
    return [LevelWork(points, done[i], finer[i], not mesh.open_ended) for i in range(mesh.levels)]
