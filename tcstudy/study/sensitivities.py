"""Derivatives by numbers of a study at the solution of a point, for the variables of `data.schema`.

A point is linearised once at its solution (`contact.solution.Linearised`); a number then costs
O(m²).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.solution import EVENT, Linearised
from tcstudy.data.schema import (
    AT_EVENT,
    AT_FOLD,
    DIFFERENTIABLE,
    SENSITIVITY_EVENTS,
    SENSITIVITY_STATUS,
    name_of,
)
from tcstudy.offline.level import Level
from tcstudy.offline.slopes import Change, WholeBody, change_of, friction_slopes
from tcstudy.scene.fit_plan import Sensitivity
from tcstudy.scene.records import Scene

Array = NDArray[np.float64]

Rates = tuple[Array, Array, float]
"""(m,) derivatives of v and ξ by a number, and that of the mean θ."""


def rates_of(whole: WholeBody, number: Sensitivity, at: Linearised, change: Change) -> Rates:
    """Derivatives by a number at a solution. Raises KeyError for one that the scene does not
    have."""
    right = whole.right_side(change)
    friction = friction_slopes(whole.level, whole.scene, number, at)
    dv = at.step(right - at.problem.c * friction.b, friction.kinks)
    return dv, right - at.problem.A_tilde @ dv, change.theta_mean


def derivatives_of(
    level: Level, scene: Scene, v: Array, numbers: tuple[Sensitivity, ...]
) -> dict[str, float]:
    """Derivatives at the solution v (m,) of a scene by variable name, with the verdict on them; NaN
    at an event."""
    at = Linearised.at(level.condensed(scene).problem, v)
    verdict = AT_FOLD if at.singular else AT_EVENT if at.events else DIFFERENTIABLE
    found: dict[str, float] = {SENSITIVITY_STATUS: verdict, SENSITIVITY_EVENTS: at.events}
    if verdict != DIFFERENTIABLE:
        return found
    whole = WholeBody(level, scene, v)
    for number in numbers:
        try:
            change = change_of(level, scene, number)
            dv, dxi, theta_mean = rates_of(whole, number, at, change)
            friction = friction_slopes(level, scene, number, at)
        except KeyError:  # a law of the sweep that has no such parameter
            continue
        values = {
            "u_T_max": _of_largest(v, dv),
            "friction_resultant": float(dxi.sum()),
            "theta_mean": theta_mean,
            "lambda_1": whole.lambda_1(change),
            "omega": friction.omega,
            "energy": whole.energy(change) + friction.energy,
        }
        found |= {name_of(quantity, number.name): value for quantity, value in values.items()}
    return found


def _of_largest(v: Array, dv: Array) -> float:
    """Derivative of max |v|; NaN where several nodes have it and do not agree."""
    if not len(v):
        return 0.0
    size = np.abs(v)
    change = np.sign(v) * dv
    own = change[size >= (1.0 - EVENT) * size.max()]
    return float(own[0]) if np.ptp(own) <= EVENT * np.max(np.abs(change)) else float("nan")
