"""The load history of one scene: its problem and loads, its steps, and derivatives of these by numbers of the study.

Derivatives are differences of whole histories on the same mesh (`contact.history.differences`), all side by side.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from tcstudy.condense import NotPositiveDefinite
from tcstudy.contact.history.differences import HALFWAY, STEPS, one_sided, two_sided
from tcstudy.contact.history.problem import HistoryProblem, HistoryStep
from tcstudy.contact.history.steps import history
from tcstudy.contact.problem import CondensedBody
from tcstudy.data.on_request import AT_EVENT, DIFFERENTIABLE, STATUS, STEP_QUANTITIES, name_of
from tcstudy.errors import StudyError
from tcstudy.offline.level import Level
from tcstudy.offline.slopes import WholeBody, change_of, is_load
from tcstudy.read.scenes import Scenery
from tcstudy.scene.histories import HistoryPlan, Keys
from tcstudy.scene.parameters import loaded_scene, numbers
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Sensitivity, Study

Array = NDArray[np.float64]
STIFFNESS = ("history", "stiffness")
"""Key path of k, the number of a memory."""


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
    problem = HistoryProblem(body, first.law, plan.memory, plan.branch, tolerance, names)
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
    scenery, tolerance, c = Scenery.of(study), study.solver.tolerance, level.line.c
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

    def beside(number: Sensitivity) -> tuple[float, list[Iterator[Array]]]:
        """The scale of a number, and the histories above and below it, or on the one side where it can be."""
        value, scale = _value(plan, level, scene, number)
        up, down = ([begun(number, value + way * h * scale) for h in STEPS] for way in (1.0, -1.0))
        if all(up) and all(down):
            return scale, [one for one in (*up, *down) if one]
        one, way = (up, 1.0) if all(up) else (down, -1.0)
        third = begun(number, value + way * HALFWAY * scale)
        return way * scale, [each or iter(()) for each in (*one, third)]

    varied = dict[str, tuple[float, list[Iterator[Array]]]]()
    for number in study.output.sensitivity:
        with suppress(KeyError):  # a law of the sweep that has no such parameter
            varied[number.name] = beside(number)
    for row in steps():
        found: dict[str, float] = {STATUS: DIFFERENTIABLE}
        for name, (scale, others) in varied.items():
            rows = np.array([next(other, np.full(len(row), np.nan)) for other in others])
            one = one_sided(row, rows, scale) if len(rows) == 3 else two_sided(row, rows[:2], rows[2:], scale)
            found |= {name_of(q, name): float(x) for q, x in zip(STEP_QUANTITIES, one, strict=True)}
        if not np.all(np.isfinite(list(found.values()))):
            found[STATUS] = AT_EVENT
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
