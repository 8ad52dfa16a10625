"""The load history of one scene: its problem and loads, its steps, and derivatives of these by numbers of the study.

Derivatives are differences of whole histories on the same mesh (`contact.history.differences`), all side by side.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
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
from tcstudy.scene.fits import Sensitivity
from tcstudy.scene.histories import HistoryPlan, Keys
from tcstudy.scene.parameters import loaded_scene, numbers
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study

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
    l_tilde = [one.problem.l_tilde for one in at]
    loads = [l_tilde[0]]
    for i, j, share, *_ in plan.schedule():
        loads.append(l_tilde[j] if share == 1.0 else l_tilde[i] + share * (l_tilde[j] - l_tilde[i]))
    return problem, loads


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
    at = [level.temperature(loaded_scene(scene, values)).mean for values in plan.stations()]
    means = [at[0], *(at[i] + share * (at[j] - at[i]) for i, j, share, *_ in plan.schedule())]
    yield from zip(history(problem, loads), means, strict=False)


def step_derivatives(study: Study, level: Level, scene: Scene, point: int) -> Iterator[dict[str, float]]:
    """Of every step of a scene what its study asks for, by variable name; without what its law does not have.

    They begin with step 0 wherever the history goes on. Histories of other numbers that end early have no more of them.
    """
    varied = _Varied(study, level, scene, point)
    middle, beside = varied.steps(None, 0.0), dict[str, tuple[float, list[Iterator[Array]]]]()
    for number in study.output.sensitivity:
        with suppress(KeyError):  # a law of the sweep that has no such parameter
            beside[number.name] = varied.beside(number)
    for row in middle:
        found: dict[str, float] = {STATUS: DIFFERENTIABLE}
        for name, (scale, others) in beside.items():
            rows = np.array([next(other, np.full(len(row), np.nan)) for other in others])
            one = one_sided(row, rows, scale) if len(rows) == 3 else two_sided(row, rows[:2], rows[2:], scale)
            found |= {name_of(q, name): float(x) for q, x in zip(STEP_QUANTITIES, one, strict=True)}
        if not np.all(np.isfinite(list(found.values()))):
            found[STATUS] = AT_EVENT
        yield found


@dataclass(frozen=True)
class _Varied:
    """A history of the scene of a point with other numbers."""

    study: Study
    level: Level
    scene: Scene
    point: int

    def steps(self, number: Sensitivity | None, value: float) -> Iterator[Array]:
        """The STEP_QUANTITIES of all steps with this value of a number, as far as they are solved.

        Raises StudyError, UnfitLaw or NotPositiveDefinite where it cannot have the value.
        """
        plan, scene = self.study.history, self.scene
        assert plan is not None
        if number is not None and number.path == STIFFNESS:
            plan = with_stiffness(plan, {STIFFNESS: value})
        elif number is not None:
            scene = self._scenery.at(scene, {number.path: value}, self.point)
        for step, mean in followed(plan, self.level, scene, self.study.solver.tolerance):
            if step.solved:
                yield np.array([np.max(np.abs(step.v), initial=0.0), self.level.line.c @ step.xi, mean])

    @cached_property
    def _scenery(self) -> Scenery:
        return Scenery.of(self.study)

    def beside(self, number: Sensitivity) -> tuple[float, list[Iterator[Array]]]:
        """The scale of a number, and the histories above and below it, or on the one side where it can be.

        Raises KeyError for a number that the scene does not have.
        """
        value, scale = self._value(number)
        up, down = ([self._begun(number, value + way * h * scale) for h in STEPS] for way in (1.0, -1.0))
        if all(up) and all(down):
            return scale, [one for one in (*up, *down) if one]
        one, way = (up, 1.0) if all(up) else (down, -1.0)
        third = self._begun(number, value + way * HALFWAY * scale)
        return way * scale, [each or iter(()) for each in (*one, third)]

    def _begun(self, number: Sensitivity, value: float) -> Iterator[Array] | None:
        """Its steps; None where it cannot have this value."""
        steps = self.steps(number, value)
        try:
            first = next(steps)
        except (StudyError, ValueError, NotPositiveDefinite, StopIteration):
            return None
        return chain([first], steps)

    def _value(self, number: Sensitivity) -> tuple[float, float]:
        """(value, scale) of a number; of a load at least that which is as much as friction bears."""
        if number.path == STIFFNESS:
            assert self.study.history is not None
            value = float(self.study.history.memory.stiffness or 0.0)
            return value, value
        value, level, scene = float(dict(numbers(self.scene))[number.path].value), self.level, self.scene  # type: ignore[arg-type]
        law, units = level.law(scene), {"1": 1.0, "Pa": scene.laws[0].b_scale, "m": scene.laws[0].s_scale}
        if is_load(number.path):
            right = WholeBody(level, scene, np.zeros(level.line.m)).right_side(change_of(level, scene, number))
            change = np.max(np.abs(right), initial=0.0)
            full = law.b_scale * float(np.max(level.condensed(scene).problem.c)) / change if change else abs(value)
            return value, max(abs(value), full) or 1.0
        return value, abs(value) or units.get(number.units, 0.0) or level.lambda_1(scene)
