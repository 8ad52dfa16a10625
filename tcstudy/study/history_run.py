"""Follow the load history of every sweep point, step by step, into its file; go on where a file ends.

The condensed load is affine in what changes, so that it is computed at the ends of the lines only, and between them it
lies on the straight line. All steps of all points share the mesh, and those of one material its factor.

Of a sweep whole histories are work for workers, where these pay: each makes the mesh once and follows one point after
the other; this process takes their steps in the order of the sweep and alone writes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import closing
from dataclasses import dataclass, fields, replace
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tcstudy.condense import NotPositiveDefinite
from tcstudy.contact.history.problem import HistoryStep
from tcstudy.contact.history.steps import history
from tcstudy.data.history_store import HistoryRecord, read_known, steps_done, write_history
from tcstudy.data.journal import Journal
from tcstudy.data.on_request import step_variables
from tcstudy.data.provenance import collect, study_sha256, tell
from tcstudy.data.records import PointStatus
from tcstudy.data.tables import NODES, STEPS
from tcstudy.errors import HistoryError, StoreError, StudyError, UserFault
from tcstudy.executors import SerialExecutor, in_order
from tcstudy.fem.study_meshes import Meshes
from tcstudy.laws.composed import row_laws
from tcstudy.offline.level import Level
from tcstudy.offline.line_numbers import region_lengths
from tcstudy.read.study import read_study_text
from tcstudy.scene.histories import UnfitLaw
from tcstudy.scene.parameters import loaded_scene
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study
from tcstudy.study.append import differences
from tcstudy.study.history_scene import problem_of, step_derivatives
from tcstudy.study.lint import warnings
from tcstudy.study.point import STATUS
from tcstudy.study.run import level_record
from tcstudy.study.sizes import of_history
from tcstudy.study.workers import WorkerPool, submit

Array = NDArray[np.float64]
FREE = ("history.steps", "history.repeat")
"""Keys in which a study may differ from that of the file it goes on from; the steps themselves are compared."""
NAMES = sorted({f.name for f in fields(HistoryStep)} & {v.name for v in (*STEPS, *NODES)} - {"status"})
"""Variables of the file that a step has under the same name."""


HistoryWatcher = Callable[[int, int, int, int], None]
"""Told after every step (point, points, step, steps)."""


@dataclass(frozen=True)
class HistorySummary:
    """What came of it.

    points, steps: of the study, step 0 included in the steps;  ended: points whose history ended early
    found: steps that stood in the file or its journal before
    """

    points: int
    steps: int
    ended: int
    found: int


def execute_history(
    study: Study,
    output: Path,
    watcher: HistoryWatcher | None = None,
    command: Sequence[str] = ("tcstudy",),
    force: bool = False,
    jobs: int | None = None,
    dask: str | None = None,
) -> HistorySummary:
    """Follow the histories of a study and write their file; until it is there, a journal beside it keeps what is done.

    force: compute again what the file holds;  jobs, dask: as of a run
    Raises HistoryError if the study has none, StoreError where the file holds something else or cannot be written,
    GeometryFailed if the body has no mesh, WorkersFailed if there are no workers.
    """
    plan = study.history
    if plan is None:
        raise HistoryError("the study has no section history; add history: {memory: friction, steps: [...]}")
    tell(remarks := warnings(study))
    known, whole = (None, False) if force else _known(output, study, plan.steps + 1)
    done = 0 if known is None else int(steps_done(known).sum())
    if known is not None and all(_finished(known, p) for p in range(len(study.scenes))) and whole:
        return _summary(study, known, done)
    provenance = collect(study, command, remarks=remarks)
    with threadpool_limits(1, user_api="blas"), closing(WorkerPool(jobs, dask)) as staff:
        staff.ready(study)
        clock = time.perf_counter()
        level = _level(study)
        built = time.perf_counter() - clock
        line, asked = level_record(study, level.mesh, level), step_variables(study)
        record = known or HistoryRecord.empty(len(study.scenes), plan.steps + 1, level.line.m, asked)
        with Journal.open(output, study) as journal:
            tell(journal.warnings)
            for row in journal.steps():
                record.take_row(row)
            _again(record)
            found, kept = int(steps_done(record).sum()), steps_done(record)
            try:
                for point, step in _steps(study, level, record, staff, built):
                    for n in range(int(kept[point]), step + 1):
                        journal.add(record.row(point, n))
                    kept[point] = step + 1
                    if watcher is not None:
                        watcher(point, len(study.scenes), step, plan.steps)
            finally:
                if int(steps_done(record).sum()) > done or known is not None:
                    write_history(output, study, line, record, provenance)
                    journal.discard()
    return _summary(study, record, found)


def _summary(study: Study, record: HistoryRecord, found: int) -> HistorySummary:
    ended = sum(bool(reason) for reason in record.reason)
    return HistorySummary(len(study.scenes), record.status.shape[1], ended, found)


def _finished(record: HistoryRecord, point: int) -> bool:
    return bool(record.reason[point]) or int(steps_done(record)[point]) == record.status.shape[1]


def _known(path: Path, study: Study, steps: int) -> tuple[HistoryRecord | None, bool]:
    """What the file has of this study, and whether it is of this very study, steps and all; raises StoreError if it has
    another one."""
    if (found := read_known(path, study, steps)) is None:
        return None, False
    known, attrs = found
    _again(known)
    if attrs["study_sha256"] == study_sha256(study):
        return known, True
    try:
        overrides = [one for one in str(attrs["overrides"]).split("\n") if one]
        other = read_study_text(str(attrs["study_yaml"]), str(path), overrides, study.source)
        apart = [line for line in differences(other, study) if not line.startswith(FREE)]
    except StudyError:
        apart = ["its study cannot be read again"]
    if apart:
        remedy = "give another --output, or --force to replace it"
        raise StoreError(f"{path} holds the history of another study ({apart[0]}); {remedy}")
    return known, False


def _again(record: HistoryRecord) -> None:
    """Steps that broke down by no number's fault are to be tried again."""
    broken = record.status == PointStatus.ERROR
    record.status[broken] = PointStatus.NOT_RUN
    for point in np.flatnonzero(broken.any(axis=1)).tolist():
        record.reason[point] = ""


def _level(study: Study) -> Level:
    """The mesh level of the history; coarser ones are only stations on the way."""
    plan, meshes = study.history, Meshes(study)
    assert plan is not None
    last = study.mesh.levels - 1 if plan.level is None else plan.level
    mesh = [meshes.next(i) for i in range(last + 1)][-1]
    return Level(mesh, study.scenes[0], held=not plan.loose)


def _steps(
    study: Study, level: Level, record: HistoryRecord, staff: WorkerPool, built: float
) -> Iterator[tuple[int, int]]:
    """(point, step) after every step that is solved here, and after the last that a worker solved of a point.

    The record has it then. built: seconds that the level took
    """
    todo = [point for point in range(len(study.scenes)) if not _finished(record, point)]
    each = of_history(study, level.frames.n_dof, level.line.m)
    who = staff.whole([each] * len(todo), built)
    if who is None:
        for point in todo:
            for step in _follow(study, level, study.scenes[point], record, point):
                yield point, step
        return
    key = study_sha256(study)
    sent = (_submit(who, study, key, record, point) for point in todo)
    for point, answer in zip(todo, in_order(who, sent), strict=True):
        try:
            record.take(point, answer.result())
        except UserFault:
            raise
        except Exception as error:  # as in `_follow`; of a worker that died
            record.reason[point] = f"{type(error).__name__}: {error}"
            record.status[point, int(steps_done(record)[point])] = PointStatus.ERROR
        yield point, int(steps_done(record)[point]) - 1


def _submit(
    executor: SerialExecutor, study: Study, key: str, record: HistoryRecord, point: int
) -> Future[HistoryRecord]:
    """Have the rest of the history of one point followed; the first scene goes along, which makes the level."""
    pair = replace(study, scenes=(study.scenes[0], study.scenes[point]), axes=())
    row = record.of(point) if steps_done(record)[point] else None
    return submit(executor, follow_point, pair, key, row, name=f"history {point}")


_kept: dict[str, Level] = {}
"""The level of a worker, by the study that it follows."""


def follow_point(study: Study, key: str, known: HistoryRecord | None) -> HistoryRecord:
    """All steps of the second scene of a study, on the level that the first makes; known: those found before.

    key: of the whole study, whose level stays for the next point
    """
    assert study.history is not None
    if key not in _kept:
        _kept.clear()
        _kept[key] = _level(study)
    level = _kept[key]
    record = known or HistoryRecord.empty(1, study.history.steps + 1, level.line.m, step_variables(study))
    for _ in _follow(study, level, study.scenes[1], record, 0):
        pass
    return record


def _follow(study: Study, level: Level, scene: Scene, record: HistoryRecord, point: int) -> Iterator[int]:
    """Every step that is solved; the record has it then, or the reason why there is no further one."""
    try:
        yield from _of_point(study, level, scene, record, point)
        return
    except UserFault:
        raise
    except (NotPositiveDefinite, UnfitLaw) as error:
        status, reason = PointStatus.SINGULAR, str(error)
    except Exception as error:  # as of a block of points: one history must not end a sweep
        status, reason = PointStatus.ERROR, f"{type(error).__name__}: {error}"
    record.status[point, int(steps_done(record)[point])], record.reason[point] = status, reason


def _of_point(study: Study, level: Level, scene: Scene, record: HistoryRecord, point: int) -> Iterator[int]:
    """The steps of one point that are still to do."""
    assert study.history is not None
    problem, loads = problem_of(study.history, level, scene, study.solver.tolerance)
    record.lambda_1[point], record.margin[point] = problem.body.lambda_1, problem.margin
    record.lambda_1_error[point] = problem.body.A_error
    laws = row_laws([problem.law], np.ones(1))
    beside = np.full((1, np.count_nonzero(level.line.unknowns < 0)), np.nan)
    output, requested = study.output, None
    if output.probes or output.quantities:
        from tcstudy.offline.requested_outputs import RequestedOutputs  # only for a study that asks for more

        requested, values = RequestedOutputs(level, output), study.history.loads()
    first = int(steps_done(record)[point])
    start = None if first == 0 else _state(record, point, first - 1, loads[first - 1])
    slopes: Iterator[dict[str, float]] | None = None
    if study.output.sensitivity:
        slopes = islice(step_derivatives(study, level, scene, point), first, None)
    for n, step in enumerate(history(problem, loads[first:], start), first):
        _put(record, point, n, step, problem.body.c)
        for name, (length,) in region_lengths(level, laws, step.kappa[None], beside).items():
            record.values[name][point, n] = length
        if requested is not None and step.solved:
            for name, value in requested.of(loaded_scene(scene, values[n]), step.v).items():
                record.values[name][point, n] = value
        for name, value in next(slopes).items() if slopes and step.solved else ():
            getattr(record, name)[point, n] = value
        yield n


def _state(record: HistoryRecord, point: int, n: int, load: Array) -> HistoryStep:
    """The step n of a file, as the next one needs it."""
    own = {name: record.values[name][point, n] for name in NAMES if name in record.values}
    own["plastic"] = np.nan_to_num(own["plastic"])
    return HistoryStep(v=record.u_T[point, n], load=load, dissipation=np.zeros(len(load)), **own)


def _put(record: HistoryRecord, point: int, n: int, step: HistoryStep, c: Array) -> None:
    """A step into its row."""
    at = point, n
    record.status[at] = STATUS[step.status]
    if not step.solved:
        record.reason[point] = step.reason
    before = record.u_T[point, n - 1] if n else 0.0
    for name in NAMES:
        record.values[name][at] = getattr(step, name)
    record.u_T[at] = step.v
    record.u_T_max[at] = np.max(np.abs(step.v), initial=0.0)
    record.friction_resultant[at] = c @ step.xi
    record.slip_length[at] = c[step.v != before].sum()
