"""Run a study into its result file: one body, or one geometry after the other and then one file of all.

Where workers pay, each makes the mesh of a geometry and solves all its points, and this process writes the file of
each in the order of the study. Else, and where a geometry is long or large, its run is one like any other, with
a journal of its own and its blocks for the workers. Files lie in a folder beside the output; what is finished there
stays, so that a stopped sweep goes on where it was. The folder goes when the file of all geometries stands.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.provenance import Provenance, collect, holds
from tcstudy.data.reading import PARTIAL
from tcstudy.data.records import BlockRecord, LevelRecord, PointStatus
from tcstudy.data.store import write
from tcstudy.data.variants import write_variants
from tcstudy.data.writer import axis_problems
from tcstudy.errors import GeometryFailed, StoreError, UserFault, tell
from tcstudy.executors import SerialExecutor, in_order
from tcstudy.scene.study import Study, Variant
from tcstudy.study.doubts import built_faults
from tcstudy.study.expected import of_geometry
from tcstudy.study.grow import Kept
from tcstudy.study.jobs import Staff, forecast, submit
from tcstudy.study.jobs import seconds as contact_seconds
from tcstudy.study.plan import expected_bytes, faults, output_of, warnings
from tcstudy.study.run import LevelWork, Quiet, Summary, Watcher, into_file, run, work_of
from tcstudy.study.workshop import all_failed

LONG, LARGE = 60.0, 2**28
"""Seconds of contact problems, and bytes of results, from which a geometry is solved and kept block by block."""


def execute(
    study: Study,
    output: Path | None = None,
    watcher: Watcher | None = None,
    command: Sequence[str] = ("tcstudy",),
    jobs: int | None = None,
    dask: str | None = None,
    kept: Kept | None = None,
    staff: Staff | None = None,
) -> Summary:
    """Run all points of a study and write the result file.

    jobs: worker processes, None for as many as pay;  dask: address of a scheduler whose workers are to do it instead
    kept: what the output has of the study already and keeps (study.grow), None for nothing
    staff: who works, if some have begun to. Only this process writes, and the numbers are the same to the bit.
    A run that was killed or interrupted leaves its finished points beside the output; the same study then goes on
    where it stopped. Raises StoreError if the results cannot be kept, GeometryFailed if the body has no mesh,
    WorkersFailed if there are no workers; KeyboardInterrupt passes through after the finished points are on the disk.
    """
    output, watcher = output or output_of(study), watcher or Quiet()
    with closing((staff or Staff(jobs, dask)).ready(study)) as staff:
        if study.variants:
            if problems := faults(study, output):
                raise StoreError("\n".join(problems))
            return _geometries(study, output, watcher, command, staff, kept)
        return into_file(study, output, watcher, command, staff, kept)


def _geometries(
    study: Study, output: Path, watcher: Watcher, command: Sequence[str], staff: Staff, kept: Kept | None = None
) -> Summary:
    """Run all geometries and join their files.

    kept: what the output has of the study already and keeps
    Raises as `execute`; a geometry without a mesh, or one that kills its workers, is a status of its points.
    """
    if problems := axis_problems(study):
        raise StoreError("; ".join(problems))
    folder = output.with_name(f"{output.name}.geometries")
    todo = np.ones((len(study.scenes), study.mesh.levels), dtype=bool) if kept is None else kept.todo
    one, remarks = _OneSweep(study, watcher, todo), warnings(study)
    tell(remarks)
    folder.mkdir(parents=True, exist_ok=True)
    before = [None] * len(study.variants) if kept is None else kept.of_geometries(study, folder)
    works = [
        _Geometry.of(number, *pair, folder) for number, pair in enumerate(zip(study.variants, before, strict=True))
    ]
    files: list[Path | None] = []
    failed = [] if kept is None else kept.without_geometry(study)
    for work, answer in _answers(works, staff):
        one.variant = work.variant
        status, reason = PointStatus.MESH_FAILED, work.variant.reason
        try:
            if answer is not None:
                work.write(one, command, answer)
            elif not work.finished and not reason:
                work.run(one, command, staff)
        except GeometryFailed as error:
            reason = str(error)
        except _NoAnswer as error:
            status, reason = PointStatus.ERROR, str(error)
        files.append(None if reason else work.file)
        if reason:
            wanted = todo[work.variant.places]
            for level in np.flatnonzero(wanted.any(axis=0)).tolist():
                failed.append(all_failed(study, level, work.variant.places[wanted[:, level]], status, reason))
                one.lost(failed[-1])
    staff.close()
    provenance = collect(study, command, remarks=remarks)
    provenance = provenance if kept is None else kept.before(provenance)
    points, bad = write_variants(output, study, files, failed, provenance)
    shutil.rmtree(folder, ignore_errors=True)
    return Summary(output, points, bad, one.resumed)


Records = list[LevelRecord | BlockRecord]


def solve_geometry(study: Study) -> Records:
    """All records of the run of a study with one geometry, in their order. Raises GeometryFailed."""
    for keys, what, remedy in built_faults(study):
        raise GeometryFailed(f"{what}; {remedy}", tuple(map(str, keys)))
    return list(run(study))


class _NoAnswer(Exception):
    """A geometry broke down where it was worked, for no reason that its body or mesh gives."""


def _answers(works: Sequence[_Geometry], staff: Staff) -> Iterator[tuple[_Geometry, Future[Records] | None]]:
    """The geometries in their order, each with the answer that a worker owes; None where this process does the work."""
    sent = [work for work in works if work.travels]
    expected = [of_geometry(work.study) for work in sent]
    who = staff.whole(expected)
    pairs = zip(sent, expected, strict=True)
    answers = in_order(who, (work.submit(who, one.seconds) for work, one in pairs)) if who is not None else iter(())
    for work in works:
        yield work, next(answers) if who is not None and work.travels else None


@dataclass(frozen=True)
class _Geometry:
    """One geometry at work. kept: what the file that grows has of it;  finished: whether its own file stands."""

    number: int
    variant: Variant
    kept: Kept | None
    file: Path
    finished: bool

    @classmethod
    def of(cls, number: int, variant: Variant, kept: Kept | None, folder: Path) -> _Geometry:
        file = folder / (f"{number}.nc" if kept is None else f"{kept.mark[:16]}-{number}.nc")
        return cls(number, variant, kept, file, variant.study is not None and _finished(file, variant.study))

    @property
    def study(self) -> Study:
        """Its study; it has one unless it was refused."""
        assert self.variant.study is not None
        return self.variant.study

    @cached_property
    def travels(self) -> bool:
        """Whether a worker may make its mesh and solve all its points; what is half done goes on here."""
        if self.variant.study is None or self.finished or self.file.with_name(self.file.name + PARTIAL).exists():
            return False
        if self.kept is not None and (len(self.kept.places) or not self.kept.todo.all()):
            return False
        took = sum(contact_seconds(self.study, level.n_contact) for level in forecast(self.study))
        return took < LONG and expected_bytes(self.study) < LARGE

    def submit(self, executor: SerialExecutor, seconds: float) -> Future[Records]:
        """Have all its work done by a worker."""
        name = f"geometry-{self.number} {self.variant.words}"
        return submit(executor, solve_geometry, self.study, name=name, seconds=seconds)

    def write(self, watcher: _OneSweep, command: Sequence[str], answer: Future[Records]) -> None:
        """Its file, of what a worker found. Raises GeometryFailed, _NoAnswer, WorkersFailed."""
        try:
            records = answer.result()
        except UserFault:
            raise
        except Exception as error:  # as of a block: one geometry must not end a sweep
            raise _NoAnswer(f"{type(error).__name__}: {error}") from error
        watcher.begin(work_of(self.study, {}, None))
        levels = {record.level: record for record in records if isinstance(record, LevelRecord)}
        blocks = [record for record in records if isinstance(record, BlockRecord)]
        write(self.file, self.study, [levels[i] for i in sorted(levels)], blocks, self._provenance(command))
        for level in levels.values():
            watcher.level(level)
        for block in blocks:
            watcher.block(block)

    def run(self, watcher: Watcher, command: Sequence[str], staff: Staff) -> None:
        """Its file, by a run of its own; without a mesh where nothing is left to solve."""
        if self.kept is None or self.kept.todo.any() or self.study.output.live:
            into_file(self.study, self.file, watcher, command, staff, self.kept, alone=False)
        else:
            self.kept.write(self.file, self.study, self._provenance(command))

    def _provenance(self, command: Sequence[str]) -> Provenance:
        return collect(self.study, command, remarks=warnings(self.study, False))


def _finished(file: Path, study: Study) -> bool:
    """Whether the file of a geometry stands; one of another study or version is made again."""
    try:
        return holds(file, "run", study)
    except StoreError:
        file.unlink()
        return False


class _OneSweep:
    """Shows the runs of all geometries as one."""

    def __init__(self, study: Study, watcher: Watcher, todo: NDArray[np.bool_]) -> None:
        """todo: (points, levels) which solutions are sought."""
        self._study, self._watcher = study, watcher
        self.begun = False
        self._todo = todo.sum(axis=0).tolist()
        self.variant: Variant = study.variants[0]
        self.resumed = 0
        self._lost: list[BlockRecord] = []

    def begin(self, work: Sequence[LevelWork]) -> None:
        """The first geometry stands for all."""
        self.resumed += sum(level.done for level in work)
        if not self.begun:
            whole = [replace(level, points=points) for level, points in zip(work, self._todo, strict=True)]
            self._watcher.begin(whole)
            for record in self._lost:
                self._watcher.block(record)
        self.begun = True

    def lost(self, record: BlockRecord) -> None:
        """Points without a mesh, which are shown after the beginning."""
        if self.begun:
            self._watcher.block(record)
        else:
            self._lost.append(record)

    def level(self, record: LevelRecord, geometry: str = "") -> None:
        """A level of the geometry at work."""
        self._watcher.level(record, self.variant.words)

    def block(self, record: BlockRecord) -> None:
        """Points of it, by their places in the whole sweep."""
        points, shape = self.variant.places[record.points], self._study.shape
        self._watcher.block(replace(record, points=points, shape=shape, u_T=None, xi=None, sticks=None, fields={}))
