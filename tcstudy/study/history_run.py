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
from tcstudy.data.history_store import (
    Values,
    at_step,
    empty,
    history_record,
    journal_row,
    read_known,
    steps_done,
    take_row,
)
from tcstudy.data.journal import Journal
from tcstudy.data.provenance import collect, study_sha256, tell
from tcstudy.data.records import PointStatus
from tcstudy.data.store import write_record
from tcstudy.errors import HistoryError, StoreError, StudyError, UserFault
from tcstudy.executors import in_order
from tcstudy.fem.meshes import Meshes
from tcstudy.laws.composed import row_laws
from tcstudy.offline.level import Level
from tcstudy.offline.requested_outputs import debonded_front, region_lengths
from tcstudy.read.study import read_study_text
from tcstudy.scene.histories import AT_REST, UnfitLaw
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
    plan, points = study.history, len(study.scenes)
    if plan is None:
        raise HistoryError("the study has no section history; add history: {memory: friction, steps: [...]}")
    tell(remarks := warnings(study))
    known, same = (None, False) if force else _known(output, study)
    done = 0 if known is None else int(steps_done(known).sum())
    if known is not None and same and all(_finished(known, point) for point in range(points)):
        return HistorySummary(points, plan.steps + 1, int(np.count_nonzero(known["reason"])), done)
    provenance = collect(study, command, remarks=remarks)
    with threadpool_limits(1, user_api="blas"), closing(WorkerPool(jobs, dask)) as staff:
        staff.ready(study)
        clock = time.perf_counter()
        level = _level(study)
        built = time.perf_counter() - clock
        line, values = level_record(study, level.mesh, level), known or empty(study, level.line.m, points)
        with Journal.open(output, study) as journal:
            tell(journal.warnings)
            for row in journal.steps():
                take_row(values, row)
            _again(values)
            kept = steps_done(values)
            found = int(kept.sum())
            try:
                for point, step in _steps(study, level, values, staff, built):
                    for n in range(int(kept[point]), step + 1):
                        journal.add(journal_row(values, point, n))
                    kept[point] = step + 1
                    if watcher is not None:
                        watcher(point, points, step, plan.steps)
            finally:
                if int(steps_done(values).sum()) > done or known is not None:
                    write_record(output, study, history_record(study, line, values), provenance)
                    journal.discard()
    return HistorySummary(points, plan.steps + 1, int(np.count_nonzero(values["reason"])), found)


def _finished(values: Values, point: int) -> bool:
    return bool(values["reason"][point]) or PointStatus.NOT_RUN not in values["status"][point]


def _known(path: Path, study: Study) -> tuple[Values | None, bool]:
    """What the file has of this study, and whether it is of this very study, steps and all; raises StoreError if it has
    another one."""
    if (found := read_known(path, study)) is None:
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


def _again(values: Values) -> None:
    """Steps that broke down by no number's fault are to be tried again."""
    broken = values["status"] == PointStatus.ERROR
    values["status"][broken] = PointStatus.NOT_RUN
    values["reason"][broken.any(axis=1)] = ""


def _level(study: Study) -> Level:
    """The mesh level of the history; coarser ones are only stations on the way."""
    plan, meshes = study.history, Meshes(study)
    assert plan is not None
    last = study.mesh.levels - 1 if plan.level is None else plan.level
    mesh = [meshes.next(i) for i in range(last + 1)][-1]
    return Level(mesh, study.scenes[0], held=not plan.loose)


def _steps(study: Study, level: Level, values: Values, staff: WorkerPool, built: float) -> Iterator[tuple[int, int]]:
    """(point, step) after every step that is solved here, and after the last that a worker solved of a point.

    `values` has it then. A worker gets the first scene as well, which makes the level. built: seconds that that took
    """
    todo = [point for point in range(len(study.scenes)) if not _finished(values, point)]
    rows = {point: {name: every[point : point + 1] for name, every in values.items()} for point in todo}
    each = of_history(study, level.frames.n_dof, level.line.m)
    who = staff.whole([each] * len(todo), built)
    if who is None:
        for point in todo:
            for step in _follow(study, level, study.scenes[point], rows[point], point):
                yield point, step
        return
    key = study_sha256(study)

    def sent(point: int) -> Future[Values]:
        pair = replace(study, scenes=(study.scenes[0], study.scenes[point]))
        return submit(who, follow_point, pair, key, rows[point], point, name=f"history {point}")

    for point, answer in zip(todo, in_order(who, map(sent, todo)), strict=True):
        try:
            for name, own in answer.result().items():
                values[name][point] = own[0]
        except UserFault:
            raise
        except Exception as error:  # as in `_follow`; of a worker that died
            _end(rows[point], PointStatus.ERROR, f"{type(error).__name__}: {error}")
        yield point, int(steps_done(values)[point]) - 1


_kept: dict[str, Level] = {}
"""The level of a worker, by the study that it follows."""


def follow_point(study: Study, key: str, row: Values, point: int) -> Values:
    """All steps of the second scene of a study, on the level that the first makes, after those that its row has.

    key: of the whole study, whose level stays for the next point;  point: of its sweep
    """
    if key not in _kept:
        _kept.clear()
        _kept[key] = _level(study)
    row = {name: every.copy() for name, every in row.items()}
    for _ in _follow(study, _kept[key], study.scenes[1], row, point):
        pass
    return row


def _follow(study: Study, level: Level, scene: Scene, row: Values, point: int) -> Iterator[int]:
    """Every step of a point that is solved; its row (1, …) has it then, or the reason why there is no further one."""
    try:
        yield from _of_point(study, level, scene, row, point)
    except UserFault:
        raise
    except (NotPositiveDefinite, UnfitLaw) as error:
        _end(row, PointStatus.SINGULAR, str(error))
    except Exception as error:  # as of a block of points: one history must not end a sweep
        _end(row, PointStatus.ERROR, f"{type(error).__name__}: {error}")


def _end(row: Values, status: PointStatus, reason: str) -> None:
    row["status"][0, steps_done(row)[0]], row["reason"][0] = status, reason


def _of_point(study: Study, level: Level, scene: Scene, row: Values, point: int) -> Iterator[int]:
    """The steps of one point that are still to do."""
    plan, output, requested = study.history, study.output, None
    assert plan is not None
    problem, loads = problem_of(plan, level, scene, study.solver.tolerance)
    body = problem.body
    row["lambda_1"][0], row["lambda_1_error"][0], row["margin"][0] = body.lambda_1, body.A_error, problem.margin
    laws, beside = row_laws([problem.law], np.ones(1)), np.full((1, np.count_nonzero(level.line.unknowns < 0)), np.nan)
    if output.probes or output.quantities:
        from tcstudy.offline.requested_outputs import RequestedOutputs  # only for a study that asks for more

        requested, at = RequestedOutputs(level, output), plan.loads()
    first = int(steps_done(row)[0])
    slopes = islice(step_derivatives(study, level, scene, point), first, None) if output.sensitivity else iter(())
    start = _state(row, first - 1, loads[first - 1]) if first else None
    for n, step in enumerate(history(problem, loads[first:], start), first):
        before, found = row["u_T"][0, n - 1] if n else 0.0, dict(vars(step))
        found |= {"status": STATUS[step.status], "u_T": step.v, "u_T_max": np.max(np.abs(step.v), initial=0.0)}
        moved = np.abs(step.v - before) > AT_REST * max(np.abs(step.v).max(initial=0.0), np.max(np.abs(before)))
        found |= {"friction_resultant": body.c @ step.xi, "slip_length": body.c[moved].sum()}
        found |= {name: length for name, (length,) in region_lengths(level, laws, step.kappa[None], beside).items()}
        found |= debonded_front(level.line, problem.law, step.kappa)
        if step.solved:
            found |= requested.of(loaded_scene(scene, at[n]), step.v) if requested is not None else {}
            found |= next(slopes, {})
        for name, every in row.items():
            if name in found:
                every[at_step(every, 0, n)] = found[name]
        yield n


def _state(row: Values, n: int, load: Array) -> HistoryStep:
    """The step n of a file, as the next one needs it."""
    names = {field.name for field in fields(HistoryStep)} & row.keys() - {"status", "reason"}
    return HistoryStep(v=row["u_T"][0, n], load=load, **{"plastic": 0.0 * load} | {k: row[k][0, n] for k in names})
