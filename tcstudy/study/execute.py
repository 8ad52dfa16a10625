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
    if problems := faults(study, output):
        raise StoreError("\n".join(problems))
    with closing((pool or WorkerPool(jobs, dask)).ready(study)) as pool:
        return (_geometries if study.variants else _into_file)(study, output, watcher, command, pool, kept)


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
    # Two BLAS threads make the many small dense operations of a sweep slower, not faster.
    with (
        threadpool_limits(1, user_api="blas"),
        Journal.open(output, study, kept.digest if kept is not None else "") as journal,
    ):
        # what broke down unexpectedly is tried again; what failed by its own numbers would fail again
        known = (block for block in journal.blocks() if not np.any(block.status == PointStatus.ERROR))
        finished = [as_start(study, block) for block in known]
        remarks = warnings(study, alone)
        tell([*journal.warnings, *(remarks if alone else ())])
        watcher.begin(work_of(study, finished, kept))
        if kept is not None and not kept.todo.any() and not study.output.live:  # not even a mesh is needed
            solved = ()
        for record in run(study, finished, pool.blocks, kept) if solved is None else solved:
            if isinstance(record, LevelRecord) and kept is not None:
                record = kept.joined(record)
            journal.add(record)
            _show(watcher, record)
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
    return Summary(output, points, failed, sum(map(len, finished)))


def _show(watcher: Watcher, record: LevelRecord | BlockRecord) -> None:
    if isinstance(record, BlockRecord):
        watcher.block(record)
    elif not record.stop:  # one that says why the level was the last follows its points
        watcher.level(record)


def _geometries(
    study: Study, output: Path, watcher: Watcher, command: Sequence[str], pool: WorkerPool, kept: ExistingResults | None
) -> Summary:
    """Run all geometries, each a study of its own into a file of its own, and join their files.

    Raises as `execute`; a geometry without a mesh, or one that kills its workers, is a status of its points.
    """
    if problems := axis_problems(study):
        raise StoreError("\n".join(problems))
    tell(remarks := warnings(study))
    folder, todo = output.with_name(f"{output.name}.geometries"), np.ones((len(study.scenes), study.mesh.levels), bool)
    folder.mkdir(parents=True, exist_ok=True)
    before: list[ExistingResults | None] = [None] * len(study.variants)
    failed, files, resumed = list[BlockRecord](), list[Path | None](), 0
    if kept is not None:
        before, todo, failed = [*kept.of_geometries(study)], kept.todo, kept.without_geometry(study)
    targets = [folder / (f"{one.mark[:16]}-{i}.nc" if one is not None else f"{i}.nc") for i, one in enumerate(before)]
    there = [_is_there(variant.study, file) for variant, file in zip(study.variants, targets, strict=True)]
    sent = {i: of_geometry(one.study) for i, one in enumerate(study.variants)
            if one.study is not None and not there[i] and _travels(one.study, targets[i], before[i])}  # fmt: skip
    answers: Iterator[Future[list[LevelRecord | BlockRecord]]] = iter(())
    if (who := pool.whole([*sent.values()])) is not None:
        names = {i: f"geometry-{i} {study.variants[i].words}" for i in sent}
        studies = {i: one for i in sent if (one := study.variants[i].study) is not None}
        answers = in_order(
            who, (submit(who, solve_geometry, studies[i], name=names[i], seconds=sent[i].seconds) for i in sent)
        )
    watcher.begin(work_of(study, (), kept))
    for i, (variant, own, file) in enumerate(zip(study.variants, before, targets, strict=True)):
        status, reason = PointStatus.MESH_FAILED, variant.reason
        try:
            if variant.study is not None and not there[i]:
                solved = next(answers).result() if who is not None and i in sent else None
                part = _Part(study, variant, watcher)
                shown = Quiet() if solved is not None else part  # what a worker found is shown when it is safe
                resumed += _into_file(variant.study, file, shown, command, pool, own, False, solved).resumed
                for record in solved or ():
                    _show(part, record)
        except GeometryFailed as error:
            reason = str(error)
        except UserFault:
            raise
        except Exception as error:  # as of a block: one geometry must not end a sweep
            status, reason = PointStatus.ERROR, f"{type(error).__name__}: {error}"
        files.append(None if reason else file)
        wanted = todo[variant.places]
        for level in np.flatnonzero(wanted.any(axis=0)).tolist() if reason else ():
            failed.append(all_failed(study, level, variant.places[wanted[:, level]], status, reason))
            watcher.block(failed[-1])
    pool.close()
    provenance = collect(study, command, remarks=remarks)
    points, bad = write_variants(output, study, files, failed, provenance if kept is None else kept.before(provenance))
    shutil.rmtree(folder, ignore_errors=True)
    return Summary(output, points, bad, resumed)


def _is_there(study: Study | None, file: Path) -> bool:
    """Whether the file of a geometry stands; one of another study or version is made again."""
    try:
        return study is not None and holds(file, "run", study)
    except StoreError:
        file.unlink()
        return False


def _travels(study: Study, file: Path, kept: ExistingResults | None) -> bool:
    """Whether a worker may make the mesh of a geometry and solve all its points; what is half done goes on here."""
    if file.with_name(file.name + PARTIAL).exists() or (kept is not None and (len(kept.places) or not kept.todo.all())):
        return False
    took = sum(contact_seconds(study, level.n_contact) for level in predicted(study))
    return took < LONG and expected_bytes(study) < LARGE


def solve_geometry(study: Study) -> list[LevelRecord | BlockRecord]:
    """All records of the run of a study with one geometry, in their order. Raises GeometryFailed."""
    for keys, what, remedy in built_faults(study):
        raise GeometryFailed(f"{what}; {remedy}", tuple(map(str, keys)))
    return list(run(study))


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
