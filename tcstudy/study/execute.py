"""Run a study into its result file: what is finished is kept at once, the netCDF file appears whole at the end."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from threadpoolctl import threadpool_limits

from tcstudy.data.files import StoreError
from tcstudy.data.journal import Journal
from tcstudy.data.provenance import collect
from tcstudy.data.records import LevelRecord, PointRecord, PointStatus
from tcstudy.data.store import write
from tcstudy.scene.records import Study
from tcstudy.study.plan import output_of, warnings
from tcstudy.study.preflight import faults
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

    def point(self, record: PointRecord) -> None:
        """Nothing to show."""


def execute(
    study: Study, output: Path | None = None, watcher: Watcher | None = None, command: Sequence[str] = ("tcstudy",)
) -> Summary:
    """Run all points of a study and write the result file.

    A run that was killed or interrupted leaves its finished points beside the output; the same study then goes on
    where it stopped. Raises StoreError if the results cannot be kept, GeometryFailed if the body has no mesh;
    KeyboardInterrupt passes through after the finished points are on the disk.
    """
    output = output if output is not None else output_of(study)
    watcher = watcher if watcher is not None else Quiet()
    problems = faults(study, output)
    if problems:
        raise StoreError("\n".join(problems))
    # Two BLAS threads make the many small dense operations of a sweep slower, not faster.
    with threadpool_limits(1, user_api="blas"), Journal.open(output, study) as journal:
        # what broke down unexpectedly is tried again; what failed by its own numbers would fail again
        known = (p for p in journal.points() if p.status != PointStatus.ERROR) if journal.finished else ()
        finished = {(p.level, p.index): p.u_T if p.status == PointStatus.OK else p.u_T[:0] for p in known}
        watcher.begin(_work(study, finished), [*journal.warnings, *warnings(study)])
        for record in run(study, finished):
            journal.add(record)
            if isinstance(record, LevelRecord):
                if not record.stop:  # one that says why the level was the last follows its points
                    watcher.level(record)
            else:
                watcher.point(record)
        journal.flush()
        statuses = [point.status for point in journal.points()]
        levels = journal.levels()
        write(output, _with_levels(study, levels), levels, journal.points(), collect(study, command))
        journal.discard()
    failed = sum(status != PointStatus.OK for status in statuses)
    return Summary(output, len(statuses), failed, len(finished))


def _with_levels(study: Study, levels: Sequence[LevelRecord]) -> Study:
    """The study without the levels that its tolerance did not need."""
    if not study.mesh.estimates or len(study.mesh.maxh) > 1 or not levels:
        return study
    return replace(study, mesh=replace(study.mesh, levels=levels[-1].level + 1))


def _work(study: Study, finished: Collection[Key]) -> list[LevelWork]:
    """Points of every level; a point costs about as much as its mesh has nodes."""
    mesh, points = study.mesh, len(study.scenes)
    done = [sum(level == i for level, _ in finished) for i in range(mesh.levels)]
    growth = 2.0 if mesh.family == "adaptive" else 4.0
    single = len(mesh.maxh) == 1
    finer = [growth**i if single else (mesh.maxh[0] / mesh.maxh[i]) ** 2 for i in range(mesh.levels)]
    sure = mesh.family != "adaptive" and mesh.tolerance is None
    return [LevelWork(points, done[i], finer[i], sure) for i in range(mesh.levels)]
