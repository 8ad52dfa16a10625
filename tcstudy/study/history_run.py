"""Follow the load history of every sweep point, step by step, into its file; resume where a file
ends.

The condensed load is affine in what changes, so that it is computed at the ends of the ramps only;
between them it lies on the straight line. All steps of all points share the mesh, and those of one
material its factor.

In a sweep, whole histories are work for workers, where these pay: each makes the mesh once and
follows one point after the other. This process takes their steps in the order of the sweep and
alone writes.

Derivatives are differences of whole histories on the same mesh, all side by side. The histories are
exact to rounding, and smooth in a number p but for events, where one-sided derivatives differ. With
D± = ±(f(p ± h) − f(p))/h at two steps h, the part of D⁺ − D⁻ that stays as h → 0 is such a
difference. The part that falls like h is curvature, which D at both steps gives on either side,
also where an event lies between the steps of the other side. Of the values that either step gives
the one with the smallest error is taken. Where a number can only grow, or only fall, D is formed on
one side, at three steps: for a smooth f they lie on a line. A value with an error above MAX_ERROR
is NaN.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import closing, suppress
from dataclasses import fields, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tcstudy.condense import NotPositiveDefinite
from tcstudy.contact.history.memory import (
    UNDETERMINED,
    HistoryProblem,
    HistoryStep,
    MemoryModel,
)
from tcstudy.contact.history.without_law import fast_history
from tcstudy.contact.problem import CondensedBody
from tcstudy.data.files import OTHER_OUTPUT, attributes, collect, holds, study_sha256, tell
from tcstudy.data.reading import stored_steps
from tcstudy.data.records import BlockRecord, Journal, remove_finished
from tcstudy.data.schema import AT_EVENT, DIFFERENTIABLE, PointStatus, name_of, step_quantities
from tcstudy.data.schema import SENSITIVITY_STATUS as SLOPES_STATUS
from tcstudy.data.store import write_record
from tcstudy.data.tables import history_record, step_record
from tcstudy.errors import HistoryError, StoreError, StudyError, UserFault
from tcstudy.executors.processes import in_order
from tcstudy.laws.composed import row_laws
from tcstudy.laws.laws import Laws
from tcstudy.offline.level import Level
from tcstudy.offline.requested_outputs import debonded_front, region_lengths
from tcstudy.offline.slopes import WholeBody, change_of, is_load
from tcstudy.offline.unresisted import step_reason
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

if TYPE_CHECKING:
    from tcstudy.offline.requested_outputs import RequestedOutputs

Array = NDArray[np.float64]
STIFFNESS = ("history", "stiffness")
"""Key path of k, the number of a memory."""
FREE = ("history.steps", "history.repeat", *DECIDE_NOTHING)
"""Keys in which a study may differ from that of the file it resumes; the steps are compared."""
STEP_FIELDS = {field.name for field in fields(HistoryStep)} - {"status", "reason"}
"""Fields of a step that the file has."""

HistoryWatcher = Callable[[int, int, int, int], None]
"""Called after every step with (point, points, step, steps)."""
Steps = dict[tuple[int, int], BlockRecord]
"""Records by point and step; the level of a record is its step."""


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
    """Follow the histories of a study and write their file.

    Until the file is there, a journal beside it keeps the finished steps.
    force: compute again what the file contains
    jobs, dask: as of a run;  wait: as of `Journal.open`

    Returns how many points there are, how many histories ended early, and how many steps were there
    before. Raises HistoryError if the study has none, StoreError where the file contains something
    else or cannot be written, GeometryFailed if the body has no mesh, WorkersFailed if there are no
    workers.
    """
    plan = study.history
    if plan is None:
        raise HistoryError(
            "the study has no section history; add history: {memory: friction, steps: [...]}"
        )
    n_points = len(study.scenes)
    remarks = warnings(study)
    tell(remarks)
    if not force:
        done, is_complete = _stored(output, study)
        if is_complete:
            remove_finished(output, study)
            return _summary(study, done, len(done))
    with (
        threadpool_limits(1, user_api="blas"),
        closing(WorkerPool(jobs, dask)) as pool,
        Journal.open(output, None, wait) as journal,
    ):
        # read again: another process may have written the file before the lock was taken
        done, is_complete = (Steps(), False) if force else _stored(output, study)
        if is_complete:
            return _summary(study, done, len(done))
        journal.begin(study)
        tell(journal.warnings)
        done |= _without_errors(journal.blocks())
        n_before = len(done)
        pool.ready(study)
        clock = time.perf_counter()
        level = level_of(study, study.scenes[0], plan.level)
        seconds = time.perf_counter() - clock
        for record in _steps(study, level, _last_steps(study, done), pool, seconds):
            journal.add(record)
            point = int(record.points[0])
            done[point, record.level] = record
            if watcher is not None:
                watcher(point, n_points, record.level, plan.steps)
        results = history_record(study, level_record(study, level.mesh, level), done.values())
        attributes = collect(study, command, remarks=remarks)
        write_record(output, study, results, attributes, None if force else journal.seen)
        journal.discard()
    return _summary(study, done, n_before)


def _summary(study: Study, done: Steps, n_before: int) -> Summary:
    failed = sum(record.status[0] != PointStatus.OK for record in done.values())
    return Summary(len(study.scenes), failed, n_before)


def _without_errors(records: Iterable[BlockRecord]) -> Steps:
    """Return the steps without those that broke down unexpectedly, which are tried again."""
    steps = Steps()
    for record in records:
        if record.status[0] != PointStatus.ERROR:
            steps[int(record.points[0]), record.level] = record
    return steps


def _stored(path: Path, study: Study) -> tuple[Steps, bool]:
    """Return what a file has of this study, and whether that is all of it.

    Raises StoreError if it has another study.
    """
    if not holds(path, "history", None):
        return {}, False
    is_same = attributes(path)["study_sha256"] == study_sha256(study)
    if not is_same:
        lines = differences(stored_study(path, study.source, "history"), study, FREE)
        if lines:
            raise StoreError(
                f"{path} holds the history of another study ({lines[0]}); {OTHER_OUTPUT}"
            )
    done = _without_errors(stored_steps(path, study))
    is_unfinished = any(_is_unfinished(study, step) for step in _last_steps(study, done))
    return done, is_same and not is_unfinished


def _last_steps(study: Study, done: Steps) -> list[BlockRecord | None]:
    """Return the last finished step of every point."""
    last_steps = {point: done[point, step] for point, step in sorted(done)}
    return [last_steps.get(point) for point in range(len(study.scenes))]


def _is_unfinished(study: Study, last_step: BlockRecord | None) -> bool:
    """Return whether steps follow after the last finished one."""
    assert study.history is not None
    if last_step is None:
        return True
    return bool(last_step.status[0] == PointStatus.OK and last_step.level < study.history.steps)


def _steps(
    study: Study,
    level: Level,
    last_steps: Sequence[BlockRecord | None],
    pool: WorkerPool,
    seconds_of_level: float,
) -> Iterator[BlockRecord]:
    """Yield the steps after the last finished one of every point.

    They are found here, or all of a point at once by a worker, which makes the level itself.
    """
    points = [point for point, step in enumerate(last_steps) if _is_unfinished(study, step)]
    resources = history_resources(study, level.frames.n_dof, level.m)
    executor = pool.executor_of_calls([resources] * len(points), seconds_of_level)
    if executor is None:
        for point in points:
            yield from _follow(study, level, study.scenes[point], point, last_steps[point])
        return
    key = study_sha256(study)

    def submitted(point: int) -> Future[list[BlockRecord]]:
        # the first scene makes the level
        pair = replace(study, scenes=(study.scenes[0], study.scenes[point]))
        return submit(
            executor,
            follow_point,
            pair,
            key,
            point,
            last_steps[point],
            name=f"history {point}",
            seconds=resources.seconds,
        )

    answers = in_order(executor, map(submitted, points))
    for point, answer in zip(points, answers, strict=True):
        try:
            yield from answer.result()
        except UserFault:
            raise
        except Exception as error:  # as in `_follow`; of a worker that died
            yield _failed_step(study, point, last_steps[point], error)


_level_of_worker: dict[str, Level] = {}
"""The level of a worker, by the study that it follows."""


def follow_point(
    study: Study, key: str, point: int, last_step: BlockRecord | None
) -> list[BlockRecord]:
    """Return all steps of the second scene of a study after the last finished one.

    The first scene makes the level.
    key: of the whole study, whose level is kept for the next point;  point: of its sweep
    """
    plan = study.history
    assert plan is not None
    if key not in _level_of_worker:
        _level_of_worker.clear()
        _level_of_worker[key] = level_of(study, study.scenes[0], plan.level)
    return list(_follow(study, _level_of_worker[key], study.scenes[1], point, last_step))


def _failed_step(
    study: Study, point: int, last_step: BlockRecord | None, error: Exception
) -> BlockRecord:
    """Return the step at which a history ends by this error."""
    if isinstance(error, NotPositiveDefinite | UnfitLaw):
        status, reason = PointStatus.SINGULAR, str(error)
    else:
        status, reason = PointStatus.ERROR, f"{type(error).__name__}: {error}"
    number = 0 if last_step is None else last_step.level + 1
    return step_record(study, point, number, {"status": status}, reason)


def _follow(
    study: Study, level: Level, scene: Scene, point: int, last_step: BlockRecord | None
) -> Iterator[BlockRecord]:
    """Yield every step of a point after the last finished one, up to one without a solution."""
    plan = study.history
    assert plan is not None
    try:
        problem, loads = problem_of(plan, level, scene, study.solver.tolerance)
        results = _StepResults(study, level, scene, problem)
        first = 0
        start: HistoryStep | None = None
        previous_v = np.zeros(problem.body.m)
        if last_step is not None:
            first = last_step.level + 1
            start = _start_of(last_step, loads[last_step.level])
            previous_v = start.v
        derivatives: Iterator[dict[str, float]] = iter(())
        if study.output.sensitivity:
            derivatives = islice(step_derivatives(study, level, scene, point), first, None)
        steps = _history_of(level, scene, problem, loads[first:], start)
        for number, step in enumerate(steps, first):
            values = results.values(number, step, previous_v)
            if step.solved:
                values |= next(derivatives, {})
            last_step = step_record(study, point, number, values, results.reason(step))
            previous_v = step.v
            yield last_step
    except UserFault:
        raise
    except Exception as error:  # as of a block of points: one history must not end a sweep
        yield _failed_step(study, point, last_step, error)


def _history_of(
    level: Level,
    scene: Scene,
    problem: HistoryProblem,
    loads: Sequence[Array],
    start: HistoryStep | None,
) -> Iterator[HistoryStep]:
    """Return the steps to the loads, with friction that knows the pressure where there is some."""
    friction = level.pressure_friction(scene)
    if friction is None:
        return fast_history(problem, loads, start)
    # imported only for such scenes
    from tcstudy.contact.history.pressed import pressed_history

    return pressed_history(problem, friction, loads, start)


OF_UNKNOWNS = {
    "v": ("u_T", "opening"),
    "xi": ("xi", "S_N"),
    **{name: (name, f"{name}_N") for name in ("kappa", "dissipation", "jumped", "plastic")},
}
"""Values of a step by unknown, with the names of those of slips and of openings in the file."""


def _start_of(record: BlockRecord, load: Array) -> HistoryStep:
    """Return a finished step as the next one needs it."""
    numbers = {name: row[0] for name, row in record.numbers.items()}
    stored = {name: value for name, value in numbers.items() if name in STEP_FIELDS}
    m = len(load)
    for name, (of_slips, of_openings) in OF_UNKNOWNS.items():
        if of_slips in numbers:
            openings = numbers.get(of_openings, np.zeros(m - len(numbers[of_slips])))
            stored[name] = np.append(numbers[of_slips], openings)
    return HistoryStep(**{"load": load, "plastic": np.zeros(m)} | stored)


class _StepResults:
    """What the file has of the steps of one point."""

    def __init__(self, study: Study, level: Level, scene: Scene, problem: HistoryProblem) -> None:
        assert study.history is not None
        self._level = level
        self._scene = scene
        self._problem = problem
        self._laws = row_laws([problem.model.law], np.ones(1))
        self._slip_laws = self._laws.at(level.split(self._laws.index)[0])
        n_held = np.count_nonzero(level.line.unknowns < 0)
        self._held = np.full((1, n_held), np.nan)
        self._outputs: RequestedOutputs | None = None
        if study.output.probes or study.output.quantities:
            # imported only for a study that requests more
            from tcstudy.offline.requested_outputs import RequestedOutputs

            self._outputs = RequestedOutputs(level, study.output)
            self._loads = study.history.loads()

    def values(self, number: int, step: HistoryStep, previous_v: Array) -> dict[str, Any]:
        """Return the values of a step by variable name.

        previous_v: (m,) slips and openings of the step before
        """
        level = self._level
        body = self._problem.body
        values = {
            "lambda_1": body.lambda_1,
            "lambda_1_error": body.A_error,
            "margin": self._problem.margin,
            **vars(step),
            "status": STATUS[step.status],
        }
        jumped = np.broadcast_to(step.jumped, body.m)
        for name, (of_slips, of_openings) in OF_UNKNOWNS.items():
            by_unknown = jumped if name == "jumped" else values[name]
            values[of_slips], values[of_openings] = level.split(by_unknown)
        values |= self._results(step, previous_v)
        if step.solved and self._outputs is not None:
            scene = loaded_scene(self._scene, self._loads[number])
            values |= self._outputs.of(scene, step.v)
        return values

    def _results(self, step: HistoryStep, previous_v: Array) -> dict[str, Any]:
        """Return results along the contact line by variable name."""
        level = self._level
        line = level.line
        u_T, _ = level.split(step.v)
        change, _ = level.split(step.v - previous_v)
        xi, _ = level.split(step.xi)
        kappa, _ = level.split(step.kappa)
        largest = np.max(np.abs(u_T), initial=0.0)
        size = max(largest, np.max(np.abs(level.split(previous_v)[0]), initial=0.0))
        has_moved = np.abs(change) > AT_REST * size
        lengths = region_lengths(level, self._slip_laws, kappa[None], self._held)
        return {
            "u_T_max": largest,
            "friction_resultant": line.c @ xi,
            "slip_length": line.c[has_moved].sum(),
            **{name: row[0] for name, row in lengths.items()},
            **debonded_front(level, self._problem.model.law, step.kappa),
            **self._results_of_openings(step),
        }

    def _results_of_openings(self, step: HistoryStep) -> dict[str, Any]:
        """Return results along openings; what is debonded is that at κ, in either direction."""
        level = self._level
        if level.opening is None:
            return {}
        # imported only for a study with edges that open
        from tcstudy.offline.openings import debonded_length, numbers_of_openings

        n_held = np.count_nonzero(level.opening.unknowns < 0)
        held = self._held, np.zeros((1, n_held))
        numbers = numbers_of_openings(level, held, self._laws, step.v[None], step.xi[None])
        numbers["debonded_length"] = debonded_length(level, held, self._laws, step.kappa[None])
        return {name: row[0] for name, row in numbers.items()}

    def reason(self, step: HistoryStep) -> str:
        """Return why a step has no solution, with the motion of a body that contact alone holds."""
        is_told = step.solved or step.reason == UNDETERMINED
        if is_told or self._level.is_held(self._scene):
            return step.reason
        return step_reason(self._level.motions(self._scene).words, step.reason)


def problem_of(
    plan: HistoryPlan, level: Level, scene: Scene, tolerance: float | None
) -> tuple[HistoryProblem, list[Array]]:
    """Return the problem that all steps of a scene share, and the loads l̃ of all steps.

    Raises NotPositiveDefinite.
    """
    stations = [level.condensed(loaded_scene(scene, values)) for values in plan.stations()]
    first = stations[0].problem
    body = first.body
    if level.is_held(scene):
        lambda_1 = level.lambda_1(scene)
        body = CondensedBody.known(
            first.A_tilde,
            first.c,
            first.A_error,
            level.blocks,
            lambda_1=lambda_1,
            loose=False,
        )
    model = MemoryModel(plan.memory, first.law, body.m, _memory_of_unknown(plan, level, first.law))
    problem = HistoryProblem(body, model, plan.branch, tolerance)
    return problem, plan.along([station.problem.l_tilde for station in stations])


def _memory_of_unknown(plan: HistoryPlan, level: Level, law: Laws) -> NDArray[np.str_] | None:
    """Return the name of the memory (m,) of every unknown; None where all have one.

    Where edges lift off, an opening remembers its damage, and what has no law for s > 0 nothing.
    """
    line = level.line
    names = plan.memory.by_node(law, line.edge_names, line.edge, line.joints)
    if level.opening is None:
        return names
    if names is None:
        names = np.full(line.m, plan.memory.name)
    names = np.append(names, np.full(level.opening.m, "damage"))
    table = law.tables
    opposes = ((table.b_0 != 0.0) | (table.q != 0.0) | table.bent) & (table.upper > 0.0)
    has_law = np.any(opposes, axis=1)[law.node_index(level.m)]
    return np.where(has_law, names, "none")


def follow_steps(
    plan: HistoryPlan,
    level: Level,
    scenery: SceneReader,
    scene: Scene,
    tolerance: float | None,
    values: Mapping[Keys, float],
    point: int | None = None,
) -> Iterator[tuple[HistoryStep, float]]:
    """Return step 0 and all others of the scene with other values, with the mean θ of each.

    A step that fails is the last.
    values, point: as of `SceneReader.at`
    Raises StudyError, NotPositiveDefinite, UnfitLaw, and KeyError for a load that the scene does
    not have.
    """
    stiffness = values.get(STIFFNESS, plan.memory.stiffness)
    changed_plan = replace(plan, memory=replace(plan.memory, stiffness=stiffness))
    changed_scene = scenery.at(scene, values, point)
    problem, loads = problem_of(changed_plan, level, changed_scene, tolerance)
    means = list[float]()
    for station in plan.stations():
        means.append(level.temperature(loaded_scene(changed_scene, station)).mean)
    return zip(fast_history(problem, loads), plan.along(means), strict=False)


def step_derivatives(
    study: Study, level: Level, scene: Scene, point: int
) -> Iterator[dict[str, float]]:
    """Yield the requested derivatives of every step of a scene by variable name.

    Those by a number that its law does not have are left out. The first are those of step 0,
    wherever the history resumes. Histories of other values may end early; then the derivatives of
    later steps are NaN.
    """
    plan = study.history
    assert plan is not None
    scenery = SceneReader.of(study)

    def quantities(values: Mapping[Keys, float]) -> Iterator[Array] | None:
        """Return `_step_quantities` of all solved steps with these values, None without any."""
        try:
            steps = follow_steps(plan, level, scenery, scene, study.solver.tolerance, values, point)
        except (StudyError, ValueError, NotPositiveDefinite):
            return None
        return (_step_quantities(level, step, mean) for step, mean in steps if step.solved)

    varied = dict[str, tuple[float, list[Iterator[Array]]]]()
    for number in study.output.sensitivity:
        with suppress(KeyError):  # a law of the sweep that has no such parameter
            value, scale = _value_and_scale(plan, level, scene, number)
            path = number.path
            above = [quantities({path: value + step * scale}) for step in STEPS]
            below = [quantities({path: value - step * scale}) for step in STEPS]
            histories = [*above, *below]
            if not all(histories):  # on the one side on which the number can change
                scale = scale if all(above) else -scale
                middle = quantities({path: value + MIDDLE_STEP * scale})
                histories = [*(above if all(above) else below), middle]
            varied[number.name] = scale, [steps or iter(()) for steps in histories]
    for row in quantities({}) or ():
        values: dict[str, float] = {SLOPES_STATUS: DIFFERENTIABLE}
        missing = np.full(len(row), np.nan)
        for name, (scale, histories_of_number) in varied.items():
            beside = np.array([next(steps, missing) for steps in histories_of_number])
            slopes = derivative(row, beside, scale)
            for quantity, slope in zip(step_quantities(study), slopes.tolist(), strict=True):
                values[name_of(quantity, name)] = slope
        if not np.all(np.isfinite(list(values.values()))):
            values[SLOPES_STATUS] = AT_EVENT
        yield values


def _step_quantities(level: Level, step: HistoryStep, mean: float) -> Array:
    """Return the differentiated quantities of a step (schema.step_quantities).

    mean: of θ [K]
    """
    u_T, s_N = level.split(step.v)
    xi, S_N = level.split(step.xi)
    numbers = [np.max(np.abs(u_T), initial=0.0), level.line.c @ xi, mean]
    if level.opening is not None:
        peel_stress = np.max(S_N, initial=0.0)
        numbers += [np.max(s_N), peel_stress, level.opening.c @ S_N]
    return np.array(numbers)


STEPS = (1e-4, 1e-5)
"""Steps of a number, relative to its scale."""
MIDDLE_STEP = 0.5 * (STEPS[0] + STEPS[1])
"""The third step where the number can change on one side only."""
MAX_ERROR = 2e-6
"""Largest error of a derivative, relative to it."""
MIN_DERIVATIVE = 1e-2
"""Derivative to which the error is related at least, relative to f per scale."""


def derivative(middle: Array, beside: Array, scale: float) -> Array:
    """Return (n,) df/dp from f (n,) at p and f beside it; NaN where there is none.

    beside: (4, n) at p + STEPS and at p − STEPS times the scale of p; or (3, n) at p + STEPS and
            MIDDLE_STEP, scale < 0 where p can only fall
    """
    if len(beside) == 4:
        values, errors = _two_sided(middle, beside, scale)
    else:
        values, errors = _one_sided(middle, beside, scale)
    errors = np.where(np.isfinite(errors), np.abs(errors), np.inf)
    best = np.argmin(errors, axis=0)
    columns = np.arange(errors.shape[1])
    value = values[best, columns]
    size = np.maximum(np.abs(value), MIN_DERIVATIVE * np.abs(middle / scale))
    return np.where(errors[best, columns] <= MAX_ERROR * size, value, np.nan)


def _two_sided(middle: Array, beside: Array, scale: float) -> tuple[Array, Array]:
    """Return (5, n) central differences and their errors, with curvature from either side."""
    large, small = STEPS
    h = np.array(STEPS)[:, None] * scale
    plus = (beside[:2] - middle) / h
    minus = (middle - beside[2:]) / h
    at_large, at_small = 0.5 * (plus + minus)
    gap_at_large, gap_at_small = plus - minus
    above = (plus[0] - plus[1]) * small / (large - small)
    below = (minus[1] - minus[0]) * small / (large - small)
    curvature = np.array([0.0 * above, above + below, 2.0 * above, 2.0 * below])
    values = np.array([at_large, *(at_small + 0.0 * curvature)])
    errors = np.array([gap_at_large, *(gap_at_small - curvature)])
    return values, errors


def _one_sided(middle: Array, beside: Array, scale: float) -> tuple[Array, Array]:
    """Return (1, n) extrapolated one-sided differences and their errors."""
    large, small = STEPS
    h = np.array([*STEPS, MIDDLE_STEP])[:, None] * scale
    at_large, at_small, at_middle = (beside - middle) / h
    values = (large * at_small - small * at_large) / (large - small)
    errors = at_middle - 0.5 * (at_large + at_small)
    return values[None], errors[None]


def _value_and_scale(
    plan: HistoryPlan, level: Level, scene: Scene, number: Sensitivity
) -> tuple[float, float]:
    """Return value and scale of a number; a load has at least the scale that friction can bear.

    Raises KeyError for a number that the scene does not have.
    """
    if number.path == STIFFNESS:
        stiffness = float(plan.memory.stiffness or 0.0)
        return stiffness, stiffness
    value: float = dict(numbers(scene))[number.path].value  # type: ignore[assignment]
    scale = abs(value)
    if is_load(number.path):
        body = WholeBody(level, scene, np.zeros(level.m))
        right = body.right_side(change_of(level, scene, number))
        change = np.max(np.abs(right), initial=0.0)
        if change:
            bearable = level.law(scene).b_scale * float(np.max(level.line.c))
            scale = max(scale, bearable / change)
        return value, scale or 1.0
    law = scene.laws[0]
    scale_of_units = {"1": 1.0, "Pa": law.b_scale, "m": law.s_scale}
    return value, scale or scale_of_units.get(number.units, 0.0) or level.lambda_1(scene)
