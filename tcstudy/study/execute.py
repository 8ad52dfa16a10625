"""Run a study into its result file: one body, or one geometry after the other and then one file of all.

What is finished is kept in a journal at once, and the netCDF file appears whole at the end. A geometry is a study like
any other, with the swept numbers put in and a file of its own in a folder beside the output; what is finished there
stays, so that a stopped sweep goes on where it was. The folder goes when the file of all geometries stands. Where
workers pay, each makes the mesh of a geometry and solves all its points, and this process alone writes; a geometry that
is long or large is solved here, and its blocks by the workers.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from tcstudy.data.journal import Journal
from tcstudy.data.provenance import collect, holds, tell
from tcstudy.data.reading import PARTIAL
from tcstudy.data.records import BlockRecord, LevelRecord, PointStatus
from tcstudy.data.store import write
from tcstudy.data.variants import write_variants
from tcstudy.data.writer import axis_problems
from tcstudy.errors import GeometryFailed, StoreError, UserFault
from tcstudy.executors import in_order
from tcstudy.scene.study import Study, Variant
from tcstudy.study.append import ExistingResults, all_but_broken, appended
from tcstudy.study.level_solver import all_failed
from tcstudy.study.lint import built_faults, faults, output_of, warnings
from tcstudy.study.run import LevelWork, Quiet, Watcher, as_start, run, work_of
from tcstudy.study.sizes import contact_seconds, expected_bytes, of_geometry, predicted
from tcstudy.study.workers import WorkerPool, submit

LONG, LARGE = 60.0, 2**28
"""Seconds of contact problems, and bytes of results, from which a geometry is solved and kept block by block."""
Records = Iterable[LevelRecord | BlockRecord]


@dataclass(frozen=True)
class Summary:
    """What came of a run: where the data are and how many points there are, failed and resumed ones counted."""

    output: Path
    points: int
    failed: int
    resumed: int


def what_is_left(study: Study, output: Path, force: bool, append: bool) -> tuple[Study, ExistingResults | None, bool]:
    """(the study of the whole file, what the file keeps, whether it has all points already).

    append: the file may have other points of the study, which stay. Raises StoreError if it holds something else.
    """
    if append:
        study, kept = appended(output, study)
        return study, kept, not kept.todo.any()
    if force or not holds(output, "run", study):
        return study, None, False
    broken = all_but_broken(output, study)
    return study, broken, broken is None


def execute(
    study: Study,
    output: Path | None = None,
    watcher: Watcher | None = None,
    command: Sequence[str] = ("tcstudy",),
    jobs: int | None = None,
    dask: str | None = None,
    kept: ExistingResults | None = None,
    pool: WorkerPool | None = None,
) -> Summary:
    """Run all points of a study and write the result file.

    jobs: worker processes, None for as many as pay;  dask: address of a scheduler whose workers are to do it instead
    kept: what the output has of the study already and keeps (study.append), None for nothing
    pool: who works, if some have begun to. Only this process writes, and the numbers are the same to the bit.
    A run that was killed or interrupted leaves its finished points beside the output; the same study then goes on
    where it stopped. Raises StoreError if the results cannot be kept, GeometryFailed if the body has no mesh,
    WorkersFailed if there are no workers; KeyboardInterrupt passes through after the finished points are on the disk.
    """
    output, watcher = output or output_of(study), watcher or Quiet()
    with closing((pool or WorkerPool(jobs, dask)).ready(study)) as pool:
        if study.variants:
            if problems := faults(study, output):
                raise StoreError("\n".join(problems))
            return _geometries(study, output, watcher, command, pool, kept)
        return _into_file(study, output, watcher, command, pool, kept)


def _into_file(
    study: Study,
    output: Path,
    watcher: Watcher,
    command: Sequence[str],
    pool: WorkerPool,
    kept: ExistingResults | None,
    alone: bool = True,
    solved: Records | None = None,
) -> Summary:
    """Run all points of a study with one body.

    alone:  whether this is the whole run: its warnings are said, and the workers may go when all points are solved
    solved: what a worker found already, in the order of a run
    """
    if problems := faults(study, output):
        raise StoreError("\n".join(problems))
    # Two BLAS threads make the many small dense operations of a sweep slower, not faster.
    with (
        threadpool_limits(1, user_api="blas"),
        Journal.open(output, study, kept.digest if kept is not None else "") as journal,
    ):
        # what broke down unexpectedly is tried again; what failed by its own numbers would fail again
        known = (block for block in journal.blocks() if not np.any(block.status == PointStatus.ERROR))
        finished = {(block.level, block.number): as_start(study, block) for block in known}
        remarks = warnings(study, alone)
        tell([*journal.warnings, *(remarks if alone else ())])
        watcher.begin(work_of(study, finished, kept))
        if kept is not None and not kept.todo.any() and not study.output.live:  # not even a mesh is needed
            solved = ()
        for record in run(study, finished, pool.blocks, kept) if solved is None else solved:
            if isinstance(record, LevelRecord):
                record = record if kept is None else kept.joined(record)
            journal.add(record)
            if isinstance(record, BlockRecord):
                watcher.block(record)
            elif not record.stop:  # one that says why the level was the last follows its points
                watcher.level(record)
        if alone:
            pool.close()  # before the file, which takes memory, is written
        journal.flush()
        levels, records, provenance = journal.levels(), journal.blocks, collect(study, command, remarks=remarks)
        if kept is not None:
            levels, provenance = kept.with_levels(levels), kept.before(provenance)
            records = lambda: chain(kept.blocks(study), journal.blocks())  # noqa: E731
        if study.mesh.estimates and not study.mesh.listed and levels:  # without those that its tolerance did not need
            study = replace(study, mesh=replace(study.mesh, levels=levels[-1].level + 1))
        points, failed = write(output, study, levels, records, provenance)
        journal.discard()
    return Summary(output, points, failed, sum(len(block) for block in finished.values()))


def _geometries(
    study: Study, output: Path, watcher: Watcher, command: Sequence[str], pool: WorkerPool, kept: ExistingResults | None
) -> Summary:
    """Run all geometries and join their files.

    Raises as `execute`; a geometry without a mesh, or one that kills its workers, is a status of its points.
    """
    if problems := [*faults(study, output), *axis_problems(study)]:
        raise StoreError("\n".join(problems))
    tell(remarks := warnings(study))
    folder = output.with_name(f"{output.name}.geometries")
    folder.mkdir(parents=True, exist_ok=True)
    before = [None] * len(study.variants) if kept is None else kept.of_geometries(study, folder)
    works = [_Geometry.of(i, *pair, folder) for i, pair in enumerate(zip(study.variants, before, strict=True))]
    todo = np.ones((len(study.scenes), study.mesh.levels), dtype=bool) if kept is None else kept.todo
    failed, files, resumed = [] if kept is None else kept.without_geometry(study), list[Path | None](), 0
    watcher.begin(work_of(study, {}, kept))
    for work, answer in _answers(works, pool):
        status, reason = PointStatus.MESH_FAILED, work.variant.reason
        part = _Part(study, work.variant, watcher)
        try:
            if answer is not None:  # shown when it is safe
                solved = answer.result()
                _into_file(work.study, work.file, Quiet(), command, pool, work.kept, False, solved)
                part.show(solved)
            elif not work.finished and not reason:
                resumed += _into_file(work.study, work.file, part, command, pool, work.kept, False).resumed
        except GeometryFailed as error:
            reason = str(error)
        except UserFault:
            raise
        except Exception as error:  # as of a block: one geometry must not end a sweep
            status, reason = PointStatus.ERROR, f"{type(error).__name__}: {error}"
        files.append(None if reason else work.file)
        if reason:
            wanted = todo[work.variant.places]
            for level in np.flatnonzero(wanted.any(axis=0)).tolist():
                failed.append(all_failed(study, level, work.variant.places[wanted[:, level]], status, reason))
                watcher.block(failed[-1])
    pool.close()
    provenance = collect(study, command, remarks=remarks)
    points, bad = write_variants(output, study, files, failed, provenance if kept is None else kept.before(provenance))
    shutil.rmtree(folder, ignore_errors=True)
    return Summary(output, points, bad, resumed)


def solve_geometry(study: Study) -> list[LevelRecord | BlockRecord]:
    """All records of the run of a study with one geometry, in their order. Raises GeometryFailed."""
    for keys, what, remedy in built_faults(study):
        raise GeometryFailed(f"{what}; {remedy}", tuple(map(str, keys)))
    return list(run(study))


Answer = Future[list[LevelRecord | BlockRecord]]


@dataclass(frozen=True)
class _Geometry:
    """One geometry. kept: what the file that grows has of it;  file: its own;  finished: whether that stands."""

    number: int
    variant: Variant
    kept: ExistingResults | None
    file: Path
    finished: bool

    @classmethod
    def of(cls, number: int, variant: Variant, kept: ExistingResults | None, folder: Path) -> _Geometry:
        file = folder / (f"{number}.nc" if kept is None else f"{kept.mark[:16]}-{number}.nc")
        finished = False
        if variant.study is not None:
            try:
                finished = holds(file, "run", variant.study)
            except StoreError:  # one of another study or version is made again
                file.unlink()
        return cls(number, variant, kept, file, finished)

    @property
    def study(self) -> Study:
        """Its study; it has one unless it was refused."""
        assert self.variant.study is not None
        return self.variant.study

    def travels(self) -> bool:
        """Whether a worker may make its mesh and solve all its points; what is half done goes on here."""
        if self.variant.study is None or self.finished or self.file.with_name(self.file.name + PARTIAL).exists():
            return False
        if self.kept is not None and (len(self.kept.places) or not self.kept.todo.all()):
            return False
        took = sum(contact_seconds(self.study, level.n_contact) for level in predicted(self.study))
        return took < LONG and expected_bytes(self.study) < LARGE


def _answers(works: Sequence[_Geometry], pool: WorkerPool) -> Iterator[tuple[_Geometry, Answer | None]]:
    """The geometries in their order, each with the answer that a worker owes; None where this process does the work."""
    sent = [work for work in works if work.travels()]
    expected = [of_geometry(work.study) for work in sent]
    if (who := pool.whole(expected)) is None:
        yield from ((work, None) for work in works)
        return

    def submitted(work: _Geometry, seconds: float) -> Answer:
        name = f"geometry-{work.number} {work.variant.words}"
        return submit(who, solve_geometry, work.study, name=name, seconds=seconds)

    answers = in_order(who, (submitted(work, one.seconds) for work, one in zip(sent, expected, strict=True)))
    numbers = {work.number for work in sent}
    yield from ((work, next(answers) if work.number in numbers else None) for work in works)


@dataclass(frozen=True)
class _Part:
    """Shows the run of one geometry as a part of the whole."""

    study: Study
    variant: Variant
    watcher: Watcher

    def begin(self, work: Sequence[LevelWork]) -> None:
        """The whole has begun before."""

    def level(self, record: LevelRecord, geometry: str = "") -> None:
        """A level of this geometry."""
        self.watcher.level(record, self.variant.words)

    def block(self, record: BlockRecord) -> None:
        """Points of it, by their places in the whole sweep."""
        self.watcher.block(replace(record, points=self.variant.places[record.points], shape=self.study.shape))

    def show(self, records: Records) -> None:
        """All of a run that is over."""
        for record in records:
            if isinstance(record, BlockRecord):
                self.block(record)
            elif not record.stop:
                self.level(record)
