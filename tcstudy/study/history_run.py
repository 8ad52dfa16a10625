"""Follow the load history of every sweep point, step by step, into its file; go on where a file
ends.

The condensed load is affine in what changes, so that it is computed at the ends of the lines only,
and between them it lies on the straight line. All steps of all points share the mesh, and those of
one material its factor.

Of a sweep whole histories are work for workers, where these pay: each makes the mesh once and
follows one point after the other; this process takes their steps in the order of the sweep and
alone writes.

Derivatives are differences of whole histories on the same mesh, all side by side. These are exact
to rounding, and smooth in a number p but for events, where one-sided derivatives differ. With D± =
±(f(p ± h) − f(p))/h at two steps h the part of D⁺ − D⁻ that stays as h → 0 is such a difference;
what falls like h is curvature, which D at both steps gives on either side, also where an event lies
between the steps of the other one. Of the values that either step gives that is taken which errs
least. Where a number can only grow, or only fall, D is looked at on one side, at three steps: for a
smooth f they lie on a line. What errs by more than AGREES is NaN.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import closing, suppress
from dataclasses import fields, replace
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tcstudy.condense import NotPositiveDefinite
from tcstudy.contact.history.memory import HistoryProblem, HistoryStep, MemoryModel
from tcstudy.contact.history.steps import history
from tcstudy.contact.problem import CondensedBody
from tcstudy.data.files import OTHER_OUTPUT, attributes, collect, holds, study_sha256, tell
from tcstudy.data.reading import stored_steps
from tcstudy.data.records import BlockRecord, Journal, remove_finished
from tcstudy.data.schema import AT_EVENT, DIFFERENTIABLE, STEP_QUANTITIES, PointStatus, name_of
from tcstudy.data.schema import SENSITIVITY_STATUS as SLOPES_STATUS
from tcstudy.data.store import write_record
from tcstudy.data.tables import history_record, step_record
from tcstudy.errors import HistoryError, StoreError, StudyError, UserFault
from tcstudy.executors.processes import in_order
from tcstudy.laws.composed import row_laws
from tcstudy.offline.level import Level
from tcstudy.offline.requested_outputs import debonded_front, region_lengths
from tcstudy.offline.slopes import WholeBody, change_of, is_load
from tcstudy.read.scenes import SceneReader
from tcstudy.scene.fit_plan import Sensitivity
from tcstudy.scene.histories import AT_REST, HistoryPlan, Keys, UnfitLaw
from tcstudy.scene.parameters import loaded_scene, numbers
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study
from tcstudy.study.append import DECIDE_NOTHING, differences, stored_study
from tcstudy.study.level_solver import STATUS
from tcstudy.study.lint import warnings
from tcstudy.study.run import Summary, level_of, level_record
from tcstudy.study.workers import WorkerPool, history_resources, submit

Array = NDArray[np.float64]
STIFFNESS = ("history", "stiffness")
"""Key path of k, the number of a memory."""
FREE = ("history.steps", "history.repeat", *DECIDE_NOTHING)
"""Keys in which a study may differ from that of the file it goes on from; the steps themselves are
compared."""
NAMES = {field.name for field in fields(HistoryStep)} - {"status", "reason"}


HistoryWatcher = Callable[[int, int, int, int], None]
"""Told after every step (point, points, step, steps)."""
Steps = dict[tuple[int, int], BlockRecord]
"""What is known by point and step, which is the level of its record."""


def execute_history(
    study: Study,
    output: Path,
    watcher: HistoryWatcher | None = None,
    command: Sequence[str] = ("tcstudy",),
    force: bool = False,
    jobs: int | None = None,
    dask: str | None = None,
    wait: bool = False,
) -> Summary:
    """Follow the histories of a study and write their file; until it is there, a journal beside it
    keeps what is done.

    force: compute again what the file holds;  jobs, dask: as of a run;  wait: as of `Journal.open`
    Returns how many points there are, how many histories ended early, and how many steps were there before.
    Raises HistoryError if the study has none, StoreError where the file holds something else or cannot be written,
    GeometryFailed if the body has no mesh, WorkersFailed if there are no workers.
    """
    plan, points = study.history, len(study.scenes)
    if plan is None:
        raise HistoryError(
            "the study has no section history; add history: {memory: friction, steps: [...]}"
        )
    tell(remarks := warnings(study))
    if not force:
        done, is_whole = _known(output, study)
        if is_whole:
            remove_finished(output, study)
            return _summary(points, done, len(done))
    with (
        threadpool_limits(1, user_api="blas"),
        closing(WorkerPool(jobs, dask)) as staff,
        Journal.open(output, None, wait) as journal,
    ):
        # looked at again: another process may have written it before the lock was taken
        done, is_whole = (Steps(), False) if force else _known(output, study)
        if is_whole:
            return _summary(points, done, len(done))
        journal.begin(study)
        tell(journal.warnings)
        done |= _sound(journal.blocks())
        before = len(done)
        staff.ready(study)
        clock = time.perf_counter()
        level = level_of(study, study.scenes[0], plan.level, not plan.loose)
        built = time.perf_counter() - clock
        for record in _steps(study, level, _ends(study, done), staff, built):
            journal.add(record)
            done[int(record.points[0]), record.level] = record
            if watcher is not None:
                watcher(int(record.points[0]), points, record.level, plan.steps)
        found = history_record(study, level_record(study, level.mesh, level), done.values())
        attributes = collect(study, command, remarks=remarks)
        write_record(output, study, found, attributes, None if force else journal.seen)
        journal.discard()
    return _summary(points, done, before)


def _summary(points: int, done: Steps, before: int) -> Summary:
    return Summary(points, sum(one.status[0] != PointStatus.OK for one in done.values()), before)


def _sound(records: Iterable[BlockRecord]) -> Steps:
    """The steps but those that broke down by no number's fault, which are to be tried again."""
    return {
        (int(one.points[0]), one.level): one
        for one in records
        if one.status[0] != PointStatus.ERROR
    }


def _known(path: Path, study: Study) -> tuple[Steps, bool]:
    """Return what a file has of this study, and whether that is all of it.

    Raises StoreError if it has another one.
    """
    if not holds(path, "history", None):
        return {}, False
    same = attributes(path)["study_sha256"] == study_sha256(study)
    if not same and (
        apart := differences(stored_study(path, study.source, "history"), study, FREE)
    ):
        raise StoreError(f"{path} holds the history of another study ({apart[0]}); {OTHER_OUTPUT}")
    done = _sound(stored_steps(path, study))
    return done, same and not any(_goes_on(study, last) for last in _ends(study, done))


def _ends(study: Study, done: Steps) -> list[BlockRecord | None]:
    """The last step of every point that is known."""
    last = {point: done[point, step] for point, step in sorted(done)}
    return [last.get(point) for point in range(len(study.scenes))]


def _goes_on(study: Study, last: BlockRecord | None) -> bool:
    """Whether there are steps to do after the last one known."""
    assert study.history is not None
    return last is None or (last.status[0] == PointStatus.OK and last.level < study.history.steps)


def _steps(
    study: Study, level: Level, ends: Sequence[BlockRecord | None], staff: WorkerPool, built: float
) -> Iterator[BlockRecord]:
    """The steps after the last one known of every point, here, or all of a point at once by a
    worker.

    A worker gets the first scene as well, which makes the level. built: seconds that that took
    """
    todo = [point for point, last in enumerate(ends) if _goes_on(study, last)]
    each = history_resources(study, level.frames.n_dof, level.line.m)
    who = staff.executor_of_calls([each] * len(todo), built)
    if who is None:
        for point in todo:
            yield from _follow(study, level, study.scenes[point], point, ends[point])
        return
    key = study_sha256(study)

    def sent(point: int) -> Future[list[BlockRecord]]:
        pair = replace(study, scenes=(study.scenes[0], study.scenes[point]))
        return submit(
            who,
            follow_point,
            pair,
            key,
            point,
            ends[point],
            name=f"history {point}",
            seconds=each.seconds,
        )

    for point, answer in zip(todo, in_order(who, map(sent, todo)), strict=True):
        try:
            yield from answer.result()
        except UserFault:
            raise
        except Exception as error:  # as in `_follow`; of a worker that died
            yield _broken(study, point, ends[point], error)


_kept: dict[str, Level] = {}
"""The level of a worker, by the study that it follows."""


def follow_point(study: Study, key: str, point: int, last: BlockRecord | None) -> list[BlockRecord]:
    """All steps of the second scene of a study after the last one known, on the level that the
    first makes.

    key: of the whole study, whose level stays for the next point;  point: of its sweep
    """
    plan = study.history
    assert plan is not None
    if key not in _kept:
        _kept.clear()
        _kept[key] = level_of(study, study.scenes[0], plan.level, not plan.loose)
    return [*_follow(study, _kept[key], study.scenes[1], point, last)]


def _broken(study: Study, point: int, last: BlockRecord | None, error: Exception) -> BlockRecord:
    """The step at which a history ends by this error."""
    status, reason = PointStatus.ERROR, f"{type(error).__name__}: {error}"
    if isinstance(error, NotPositiveDefinite | UnfitLaw):
        status, reason = PointStatus.SINGULAR, str(error)
    return step_record(
        study, point, 0 if last is None else last.level + 1, {"status": status}, reason
    )


def _follow(
    study: Study, level: Level, scene: Scene, point: int, last: BlockRecord | None
) -> Iterator[BlockRecord]:
    """Every step of a point after the last one known, up to one without a solution."""
    plan, output, requested = study.history, study.output, None
    assert plan is not None
    try:
        problem, loads = problem_of(plan, level, scene, study.solver.tolerance)
        body, laws = problem.body, row_laws([problem.model.law], np.ones(1))
        once = {"lambda_1": body.lambda_1, "lambda_1_error": body.A_error, "margin": problem.margin}
        beside = np.full((1, np.count_nonzero(level.line.unknowns < 0)), np.nan)
        if output.probes or output.quantities:
            from tcstudy.offline.requested_outputs import (
                RequestedOutputs,
            )  # only for a study that asks for more

            requested, at = RequestedOutputs(level, output), plan.loads()
        first, start, before = 0, None, np.zeros(body.m)
        if last is not None:  # as the next one needs it
            own = {name: value for name, (value,) in last.numbers.items() if name in NAMES}
            first, before = last.level + 1, last.numbers["u_T"][0]
            start = HistoryStep(
                **{"v": before, "load": loads[last.level], "plastic": 0.0 * before} | own
            )
        slopes = (
            islice(step_derivatives(study, level, scene, point), first, None)
            if output.sensitivity
            else iter(())
        )
        for n, step in enumerate(history(problem, loads[first:], start), first):
            found = once | vars(step) | {"status": STATUS[step.status], "u_T": step.v}
            found |= {
                "u_T_max": np.max(np.abs(step.v), initial=0.0),
                "jumped": np.broadcast_to(step.jumped, body.m),
            }
            moved = np.abs(step.v - before) > AT_REST * max(
                np.abs(step.v).max(initial=0.0), np.max(np.abs(before))
            )
            found |= {"friction_resultant": body.c @ step.xi, "slip_length": body.c[moved].sum()}
            lengths = region_lengths(level, laws, step.kappa[None], beside)
            found |= {name: length for name, (length,) in lengths.items()}
            found |= debonded_front(level.line, problem.model.law, step.kappa)
            if step.solved:
                found |= (
                    requested.of(loaded_scene(scene, at[n]), step.v)
                    if requested is not None
                    else {}
                )
                found |= next(slopes, {})
            last, before = step_record(study, point, n, found, step.reason), step.v
            yield last
    except UserFault:
        raise
    except Exception as error:  # as of a block of points: one history must not end a sweep
        yield _broken(study, point, last, error)


def problem_of(
    plan: HistoryPlan, level: Level, scene: Scene, tolerance: float | None
) -> tuple[HistoryProblem, list[Array]]:
    """What all steps of a scene share, and the loads l̃ of all steps. Raises
    NotPositiveDefinite."""
    at = [level.condensed(loaded_scene(scene, values)) for values in plan.stations()]
    first = at[0].problem
    lambda_1 = None if plan.loose else level.lambda_1(scene)
    body = CondensedBody.known(
        first.A_tilde, first.c, first.A_error, lambda_1=lambda_1, loose=plan.loose
    )
    line = level.line
    names = plan.memory.by_node(first.law, line.edge_names, line.edge, line.joints)
    problem = HistoryProblem(
        body, MemoryModel(plan.memory, first.law, body.m, names), plan.branch, tolerance
    )
    return problem, plan.along([one.problem.l_tilde for one in at])


def followed(
    plan: HistoryPlan,
    level: Level,
    scenery: SceneReader,
    scene: Scene,
    tolerance: float | None,
    values: Mapping[Keys, float],
    point: int | None = None,
) -> Iterator[tuple[HistoryStep, float]]:
    """Step 0 and all others of the scene with other numbers, with the mean θ of each; one that
    fails is the last.

    values, point: as of `SceneReader.at`
    Raises StudyError, NotPositiveDefinite, UnfitLaw, and KeyError for a load that the scene does
    not have.
    """
    stiffness, scene = (
        values.get(STIFFNESS, plan.memory.stiffness),
        scenery.at(scene, values, point),
    )
    problem, loads = problem_of(
        replace(plan, memory=replace(plan.memory, stiffness=stiffness)), level, scene, tolerance
    )
    means = [level.temperature(loaded_scene(scene, values)).mean for values in plan.stations()]
    return zip(history(problem, loads), plan.along(means), strict=False)


def step_derivatives(
    study: Study, level: Level, scene: Scene, point: int
) -> Iterator[dict[str, float]]:
    """Of every step of a scene what its study asks for, by variable name; without what its law does
    not have.

    They begin with step 0 wherever the history goes on. Histories of other numbers that end early
    have no more of them.
    """
    plan, scenery, tolerance, c = (
        study.history,
        SceneReader.of(study),
        study.solver.tolerance,
        level.line.c,
    )
    assert plan is not None

    def steps(values: Mapping[Keys, float]) -> Iterator[Array] | None:
        """The STEP_QUANTITIES of all steps with these numbers, as far as they are solved; None if
        they cannot be."""
        try:
            found = followed(plan, level, scenery, scene, tolerance, values, point)
        except (StudyError, ValueError, NotPositiveDefinite):
            return None
        return (
            np.array([np.max(np.abs(one.v), initial=0.0), c @ one.xi, mean])
            for one, mean in found
            if one.solved
        )

    varied = dict[str, tuple[float, list[Iterator[Array]]]]()
    for number in study.output.sensitivity:
        with suppress(KeyError):  # a law of the sweep that has no such parameter
            value, scale = _value(plan, level, scene, number)
            up, down = (
                [steps({number.path: value + way * h * scale}) for h in STEPS]
                for way in (1.0, -1.0)
            )
            others = [*up, *down]
            if not all(others):  # on the one side on which it can be
                one, scale = (up, scale) if all(up) else (down, -scale)
                others = [*one, steps({number.path: value + HALFWAY * scale})]
            varied[number.name] = scale, [other or iter(()) for other in others]
    for row in steps({}) or ():
        found: dict[str, float] = {SLOPES_STATUS: DIFFERENTIABLE}
        for name, (scale, each) in varied.items():
            slopes = derivative(
                row, np.array([next(one, np.full(len(row), np.nan)) for one in each]), scale
            )
            found |= {
                name_of(q, name): float(x) for q, x in zip(STEP_QUANTITIES, slopes, strict=True)
            }
        if not np.all(np.isfinite(list(found.values()))):
            found[SLOPES_STATUS] = AT_EVENT
        yield found


STEPS = (1e-4, 1e-5)
"""Of a number, relative to its scale."""
HALFWAY = 0.5 * (STEPS[0] + STEPS[1])
"""The third step where there is but one side."""
AGREES, SMALL = 2e-6, 1e-2
"""Of a derivative, or of this part of f per scale if that is more, by which it may err."""


def derivative(middle: Array, beside: Array, scale: float) -> Array:
    """(n,) df/dp from f (n,) at p and f beside it; NaN where there is none.

    beside: (4, n) at p + STEPS and at p − STEPS times the scale of p; or (3, n) at p + STEPS and
    HALFWAY, scale < 0
            where p can only fall
    """
    one, other = STEPS
    if len(beside) == 4:
        h = np.array(STEPS)[:, None] * scale
        plus, minus = (beside[:2] - middle) / h, (middle - beside[2:]) / h
        (far, near), apart = 0.5 * (plus + minus), plus - minus
        above, below = ((side[0] - side[1]) * other / (one - other) for side in (plus, -minus))
        bend = np.array([0.0 * above, above + below, 2.0 * above, 2.0 * below])
        values, errors = (
            np.array([far, *(near + 0.0 * bend)]),
            np.array([apart[0], *(apart[1] - bend)]),
        )
    else:
        far, near, between = (beside - middle) / (np.array([*STEPS, HALFWAY])[:, None] * scale)
        values = ((one * near - other * far) / (one - other))[None]
        errors = (between - 0.5 * (far + near))[None]
    errors = np.where(np.isfinite(errors), np.abs(errors), np.inf)
    at = np.argmin(errors, axis=0), np.arange(errors.shape[1])
    value, error = values[at], errors[at]
    return np.where(
        error <= AGREES * np.maximum(np.abs(value), SMALL * np.abs(middle / scale)), value, np.nan
    )


def _value(
    plan: HistoryPlan, level: Level, scene: Scene, number: Sensitivity
) -> tuple[float, float]:
    """(value, scale) of a number; of a load at least that which is as much as friction bears.

    Raises KeyError for a number that the scene does not have.
    """
    if number.path == STIFFNESS:
        return (float(plan.memory.stiffness or 0.0),) * 2
    value: float = dict(numbers(scene))[number.path].value  # type: ignore[assignment]
    size, law, units = (
        abs(value),
        level.law(scene),
        {"1": 1.0, "Pa": scene.laws[0].b_scale, "m": scene.laws[0].s_scale},
    )
    if is_load(number.path):
        right = WholeBody(level, scene, np.zeros(level.line.m)).right_side(
            change_of(level, scene, number)
        )
        change = np.max(np.abs(right), initial=0.0)
        size = max(size, law.b_scale * float(np.max(level.line.c)) / change if change else size)
        return value, size or 1.0
    return value, size or units.get(number.units, 0.0) or level.lambda_1(scene)
