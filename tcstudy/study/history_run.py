"""Follow the load history of every sweep point, step by step, into its file; go on where a file ends.

The condensed load is affine in what changes, so that it is computed at the ends of the lines only, and between them it
lies on the straight line. All steps of all points share the mesh, and those of one material its factor.

Of a sweep whole histories are work for workers, where these pay: each makes the mesh once and follows one point after
the other; this process takes their steps in the order of the sweep and alone writes.

Derivatives are differences of whole histories on the same mesh (`contact.history.steps`), all side by side.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import closing, suppress
from dataclasses import dataclass, fields, replace
from itertools import chain, islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tcstudy.condense import NotPositiveDefinite
from tcstudy.contact.history.memory import MemoryModel
from tcstudy.contact.history.problem import HistoryProblem, HistoryStep
from tcstudy.contact.history.steps import HALFWAY, STEPS, derivative, history
from tcstudy.contact.problem import CondensedBody
from tcstudy.data.provenance import collect, study_sha256, tell
from tcstudy.data.records import Journal
from tcstudy.data.schema import AT_EVENT, DIFFERENTIABLE, STEP_QUANTITIES, PointStatus, name_of
from tcstudy.data.schema import SENSITIVITY_STATUS as SLOPES_STATUS
from tcstudy.data.store import write_record
from tcstudy.data.tables import (
    Steps,
    at_step,
    empty_steps,
    history_record,
    read_known,
    step_block,
    steps_done,
    take_step,
)
from tcstudy.errors import HistoryError, StoreError, StudyError, UserFault
from tcstudy.executors.processes import in_order
from tcstudy.fem.meshes import Meshes
from tcstudy.laws.composed import row_laws
from tcstudy.offline.level import Level
from tcstudy.offline.requested_outputs import debonded_front, region_lengths
from tcstudy.offline.slopes import WholeBody, change_of, is_load
from tcstudy.read.document import changes
from tcstudy.read.scenes import SceneReader
from tcstudy.scene.histories import AT_REST, HistoryPlan, Keys, UnfitLaw
from tcstudy.scene.parameters import loaded_scene, numbers
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Sensitivity, Study
from tcstudy.study.lint import warnings
from tcstudy.study.point import STATUS
from tcstudy.study.run import level_record
from tcstudy.study.workers import WorkerPool, of_history, submit

Array = NDArray[np.float64]
STIFFNESS = ("history", "stiffness")
"""Key path of k, the number of a memory."""
FREE = ("history.steps", "history.repeat", "title", "institution", "path", "output was", "output.path", "output.live")
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
        line, values = level_record(study, level.mesh, level), known or empty_steps(study, level.line.m, points)
        with Journal.open(output, study) as journal:
            tell(journal.warnings)
            for block in journal.blocks():
                take_step(values, block)
            _again(values)
            kept = steps_done(values)
            found = int(kept.sum())
            try:
                for point, step in _steps(study, level, values, staff, built):
                    for n in range(int(kept[point]), step + 1):
                        journal.add(step_block(values, point, n))
                    kept[point] = step + 1
                    if watcher is not None:
                        watcher(point, points, step, plan.steps)
            finally:
                if int(steps_done(values).sum()) > done or known is not None:
                    write_record(output, study, history_record(study, line, values), provenance)
                    journal.discard()
    return HistorySummary(points, plan.steps + 1, int(np.count_nonzero(values["reason"])), found)


def _finished(values: Steps, point: int) -> bool:
    return bool(values["reason"][point]) or PointStatus.NOT_RUN not in values["status"][point]


def _known(path: Path, study: Study) -> tuple[Steps | None, bool]:
    """What the file has of this study, and whether it is of this very study, steps and all; raises StoreError if it has
    another one."""
    if (found := read_known(path, study)) is None:
        return None, False
    known, attrs = found
    _again(known)
    if attrs["study_sha256"] == study_sha256(study):
        return known, True
    overrides = tuple(filter(None, str(attrs["overrides"]).split("\n")))
    apart = [line for line in changes(attrs["study_yaml"], overrides, study) if not line.startswith(FREE)]
    if study.scenes[0].body.brep is not None:
        before = replace(study, text=attrs["study_yaml"], overrides=overrides)
        apart += ["another geometry file"] * (study_sha256(before) != attrs["study_sha256"])
    if apart:
        remedy = "give another --output, or --force to replace it"
        raise StoreError(f"{path} holds the history of another study ({apart[0]}); {remedy}")
    return known, False


def _again(values: Steps) -> None:
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


def _steps(study: Study, level: Level, values: Steps, staff: WorkerPool, built: float) -> Iterator[tuple[int, int]]:
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

    def sent(point: int) -> Future[Steps]:
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


def follow_point(study: Study, key: str, row: Steps, point: int) -> Steps:
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


def _follow(study: Study, level: Level, scene: Scene, row: Steps, point: int) -> Iterator[int]:
    """Every step of a point that is still to do and solved; its row (1, …) has it then, or why there is no further."""
    plan, output, requested = study.history, study.output, None
    assert plan is not None
    try:
        problem, loads = problem_of(plan, level, scene, study.solver.tolerance)
        body, laws = problem.body, row_laws([problem.model.law], np.ones(1))
        row["lambda_1"][0], row["lambda_1_error"][0], row["margin"][0] = body.lambda_1, body.A_error, problem.margin
        beside = np.full((1, np.count_nonzero(level.line.unknowns < 0)), np.nan)
        if output.probes or output.quantities:
            from tcstudy.offline.requested_outputs import RequestedOutputs  # only for a study that asks for more

            requested, at = RequestedOutputs(level, output), plan.loads()
        first, start = int(steps_done(row)[0]), None
        if first:  # the last step of the file, as the next one needs it
            names = {field.name for field in fields(HistoryStep)} & row.keys() - {"status", "reason"}
            own = {"plastic": 0.0 * loads[0]} | {name: row[name][0, first - 1] for name in names}
            start = HistoryStep(v=row["u_T"][0, first - 1], load=loads[first - 1], **own)
        slopes = islice(step_derivatives(study, level, scene, point), first, None) if output.sensitivity else iter(())
        for n, step in enumerate(history(problem, loads[first:], start), first):
            before, found = row["u_T"][0, n - 1] if n else 0.0, dict(vars(step))
            found |= {"status": STATUS[step.status], "u_T": step.v, "u_T_max": np.max(np.abs(step.v), initial=0.0)}
            moved = np.abs(step.v - before) > AT_REST * max(np.abs(step.v).max(initial=0.0), np.max(np.abs(before)))
            found |= {"friction_resultant": body.c @ step.xi, "slip_length": body.c[moved].sum()}
            lengths = region_lengths(level, laws, step.kappa[None], beside)
            found |= {name: length for name, (length,) in lengths.items()}
            found |= debonded_front(level.line, problem.model.law, step.kappa)
            if step.solved:
                found |= requested.of(loaded_scene(scene, at[n]), step.v) if requested is not None else {}
                found |= next(slopes, {})
            for name, every in row.items():
                if name in found:
                    every[at_step(every, 0, n)] = found[name]
            yield n
    except UserFault:
        raise
    except (NotPositiveDefinite, UnfitLaw) as error:
        _end(row, PointStatus.SINGULAR, str(error))
    except Exception as error:  # as of a block of points: one history must not end a sweep
        _end(row, PointStatus.ERROR, f"{type(error).__name__}: {error}")


def _end(row: Steps, status: PointStatus, reason: str) -> None:
    row["status"][0, steps_done(row)[0]], row["reason"][0] = status, reason


def problem_of(
    plan: HistoryPlan, level: Level, scene: Scene, tolerance: float | None
) -> tuple[HistoryProblem, list[Array]]:
    """What all steps of a scene share, and the loads l̃ of all steps. Raises NotPositiveDefinite."""
    at = [level.condensed(loaded_scene(scene, values)) for values in plan.stations()]
    first = at[0].problem
    lambda_1 = None if plan.loose else level.lambda_1(scene)
    body = CondensedBody.known(first.A_tilde, first.c, first.A_error, lambda_1=lambda_1, loose=plan.loose)
    line = level.line
    names = plan.memory.by_node(first.law, line.edge_names, line.edge, line.joints)
    problem = HistoryProblem(body, MemoryModel(plan.memory, first.law, body.m, names), plan.branch, tolerance)
    return problem, plan.along([one.problem.l_tilde for one in at])


def with_stiffness(plan: HistoryPlan, values: dict[Keys, float]) -> HistoryPlan:
    """The plan with the k of these values, if they have one."""
    stiffness = values.get(STIFFNESS, plan.memory.stiffness)
    return replace(plan, memory=replace(plan.memory, stiffness=stiffness))


def followed(
    plan: HistoryPlan, level: Level, scene: Scene, tolerance: float | None
) -> Iterator[tuple[HistoryStep, float]]:
    """Step 0 and all others with the mean θ of each; one that fails is the last.

    Raises NotPositiveDefinite, UnfitLaw, and KeyError for a load that the scene does not have.
    """
    problem, loads = problem_of(plan, level, scene, tolerance)
    means = [level.temperature(loaded_scene(scene, values)).mean for values in plan.stations()]
    yield from zip(history(problem, loads), plan.along(means), strict=False)


def step_derivatives(study: Study, level: Level, scene: Scene, point: int) -> Iterator[dict[str, float]]:
    """Of every step of a scene what its study asks for, by variable name; without what its law does not have.

    They begin with step 0 wherever the history goes on. Histories of other numbers that end early have no more of them.
    """
    scenery, tolerance, c = SceneReader.of(study), study.solver.tolerance, level.line.c
    assert study.history is not None
    plan: HistoryPlan = study.history

    def steps(number: Sensitivity | None = None, value: float = 0.0) -> Iterator[Array]:
        """The STEP_QUANTITIES of all steps with this value of a number, as far as they are solved."""
        own, varied = plan, scene
        if number is not None and number.path == STIFFNESS:
            own = with_stiffness(plan, {STIFFNESS: value})
        elif number is not None:
            varied = scenery.at(scene, {number.path: value}, point)
        for step, mean in followed(own, level, varied, tolerance):
            if step.solved:
                yield np.array([np.max(np.abs(step.v), initial=0.0), c @ step.xi, mean])

    def begun(number: Sensitivity, value: float) -> Iterator[Array] | None:
        """The same; None where the number cannot have this value."""
        found = steps(number, value)
        try:
            return chain([next(found)], found)
        except (StudyError, ValueError, NotPositiveDefinite, StopIteration):
            return None

    varied = dict[str, tuple[float, list[Iterator[Array]]]]()
    for number in study.output.sensitivity:
        with suppress(KeyError):  # a law of the sweep that has no such parameter
            value, scale = _value(plan, level, scene, number)
            up, down = ([begun(number, value + way * h * scale) for h in STEPS] for way in (1.0, -1.0))
            others = [*up, *down]
            if not all(others):  # on the one side on which it can be
                one, way = (up, 1.0) if all(up) else (down, -1.0)
                others, scale = [*one, begun(number, value + way * HALFWAY * scale)], way * scale
            varied[number.name] = scale, [other or iter(()) for other in others]
    for row in steps():
        found: dict[str, float] = {SLOPES_STATUS: DIFFERENTIABLE}
        for name, (scale, each) in varied.items():
            slopes = derivative(row, np.array([next(one, np.full(len(row), np.nan)) for one in each]), scale)
            found |= {name_of(q, name): float(x) for q, x in zip(STEP_QUANTITIES, slopes, strict=True)}
        if not np.all(np.isfinite(list(found.values()))):
            found[SLOPES_STATUS] = AT_EVENT
        yield found


def _value(plan: HistoryPlan, level: Level, scene: Scene, number: Sensitivity) -> tuple[float, float]:
    """(value, scale) of a number; of a load at least that which is as much as friction bears.

    Raises KeyError for a number that the scene does not have.
    """
    if number.path == STIFFNESS:
        value = float(plan.memory.stiffness or 0.0)
        return value, value
    value = float(dict(numbers(scene))[number.path].value)  # type: ignore[arg-type]
    law, units = level.law(scene), {"1": 1.0, "Pa": scene.laws[0].b_scale, "m": scene.laws[0].s_scale}
    if is_load(number.path):
        right = WholeBody(level, scene, np.zeros(level.line.m)).right_side(change_of(level, scene, number))
        change = np.max(np.abs(right), initial=0.0)
        full = law.b_scale * float(np.max(level.condensed(scene).problem.c)) / change if change else abs(value)
        return value, max(abs(value), full) or 1.0
    return value, abs(value) or units.get(number.units, 0.0) or level.lambda_1(scene)
