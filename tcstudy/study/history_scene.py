"""The load history of one scene: its problem and loads, and its steps with their derivatives, for fits and sensitivity.

What the loads, the body and the law do with a number is `offline.slopes`, how the memory carries it on from step to
step `solvers.history.moving`. Steps in equal parts are differentiated part by part, as they are solved.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.on_request import (
    AT_EVENT,
    AT_FOLD,
    DIFFERENTIABLE,
    STATUS,
    STEP_QUANTITIES,
    TURNED_BACK,
    name_of,
)
from tcstudy.offline.level import Level
from tcstudy.offline.slopes import load_slope, virgin_slope
from tcstudy.offline.whole_slopes import WholeBody
from tcstudy.scene.fits import Sensitivity
from tcstudy.scene.histories import HistoryPlan, Keys
from tcstudy.scene.parameters import loaded_scene
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study
from tcstudy.solvers.history.moving import EVENT, FOLD, TURNED, Moved, StepSlope, moved
from tcstudy.solvers.history.problem import HistoryProblem, HistoryStep
from tcstudy.solvers.history.steps import next_step
from tcstudy.study.sensitivities import of_largest

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
    problem = HistoryProblem(
        first.A_tilde,
        first.c,
        first.law,
        plan.memory,
        plan.branch,
        plan.substeps,
        tolerance,
        lambda_1,
        held=not plan.loose,
        A_error=first.A_error,
    )
    l_tilde = [one.problem.l_tilde for one in at]
    loads = [l_tilde[0]]
    for i, j, share, *_ in plan.schedule():
        loads.append(l_tilde[j] if share == 1.0 else l_tilde[i] + share * (l_tilde[j] - l_tilde[i]))
    return problem, loads


@dataclass(frozen=True, eq=False)
class MovingStep:
    """A step, the scene with its loads, and by every number the derivatives of its state and of the mean θ."""

    step: HistoryStep
    scene: Scene
    by: list[Moved]
    theta_mean: list[float]


def with_stiffness(plan: HistoryPlan, values: dict[Keys, float]) -> HistoryPlan:
    """The plan with the k of these values, if they have one."""
    stiffness = values.get(STIFFNESS, plan.memory.stiffness)
    return replace(plan, memory=replace(plan.memory, stiffness=stiffness))


def moving_steps(
    plan: HistoryPlan, level: Level, scene: Scene, tolerance: float | None, numbers: Sequence[Sensitivity]
) -> Iterator[MovingStep]:
    """Step 0 and all others; one that fails is the last.

    Raises NotPositiveDefinite, UnfitLaw, and KeyError for a number that the scene does not have.
    """
    body, loads = problem_of(plan, level, scene, tolerance)
    parts = 1 if body.follows_paths else body.substeps or 1
    body = body if body.follows_paths else replace(body, substeps=1)
    virgin = [virgin_slope(level, scene, number) for number in numbers]
    last, old = HistoryStep.virgin(body.m), [Moved.virgin(body.m) for _ in numbers]
    before: dict[Keys, float] = {}
    for values, load in zip(_values(plan), loads, strict=True):
        begin = last.load
        for part in range(1, parts + 1):
            share = part / parts
            step = next_step(body, last, load if part == parts else begin + share * (load - begin))
            between = {keys: before[keys] + share * (values[keys] - before[keys]) for keys in values if before}
            here = loaded_scene(scene, values if part == parts or not before else between)
            whole = 1.0 if before else share  # the loads of step 0 begin at nothing, whatever the scene says
            if not step.solved:
                yield MovingStep(step, here, old, [])
                return
            v = step.state.v / whole
            extended = WholeBody(level, here, v)
            slopes = [load_slope(level, here, number, v, extended) for number in numbers]
            given = [
                StepSlope(whole * slope.right, own, number.path == STIFFNESS)
                for slope, own, number in zip(slopes, virgin, numbers, strict=True)
            ]
            old, last = moved(body, last, step, old, given), step
        before = values
        yield MovingStep(last, here, old, [slope.theta_mean for slope in slopes])


def step_derivatives(study: Study, level: Level, scene: Scene) -> Iterator[dict[str, float]]:
    """Of every step of a scene what its study asks for, by variable name; without what its law does not have.

    They begin with step 0 wherever the history goes on, since files keep what nodes remember, but not its derivatives.
    """
    plan, numbers = study.history, []
    assert plan is not None
    for number in study.output.sensitivity:
        with suppress(KeyError):  # a law of the sweep that has no such parameter
            virgin_slope(level, scene, number)
            numbers.append(number)
    for at in moving_steps(plan, level, scene, study.solver.tolerance, numbers):
        reason = next((one.reason for one in at.by if one.reason), "")
        found: dict[str, float] = {STATUS: VERDICTS[reason]}
        for number, one, theta_mean in zip(numbers, at.by, at.theta_mean, strict=True):
            values = of_largest(at.step.state.v, one.v), float(one.xi.sum()), theta_mean
            found |= {name_of(q, number.name): x for q, x in zip(STEP_QUANTITIES, values, strict=True)}
        yield found


VERDICTS = {"": DIFFERENTIABLE, EVENT: AT_EVENT, FOLD: AT_FOLD, TURNED: TURNED_BACK}
"""What files call the reasons why there is no derivative."""


def _values(plan: HistoryPlan) -> Iterator[dict[Keys, float]]:
    """The loads of every step, by key path."""
    at = plan.stations()
    yield at[0]
    for i, j, share, *_ in plan.schedule():
        yield {keys: at[i][keys] + share * (at[j][keys] - at[i][keys]) for keys in at[i]} if share < 1.0 else at[j]
