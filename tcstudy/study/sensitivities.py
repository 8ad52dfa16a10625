"""Sensitivities of a point with respect to parameters, for the variables of `data.schema`.

A point is linearised once at its solution (`contact.solution.Linearised`). A parameter then costs
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
"""(m,) derivatives of v and ξ by a parameter, and that of the mean θ."""


def rates_of(whole: WholeBody, number: Sensitivity, at: Linearised, change: Change) -> Rates:
    """Return the derivatives by a parameter at a solution.

    Raises KeyError for a parameter that the scene does not have.
    """
    right_side = whole.right_side(change)
    friction = friction_slopes(whole.level, whole.scene, number, at)
    dv = at.step(right_side - at.problem.c * friction.b, friction.kinks)
    dxi = right_side - at.problem.A_tilde @ dv
    return dv, dxi, change.theta_mean


def derivatives_of(
    level: Level, scene: Scene, v: Array, numbers: tuple[Sensitivity, ...]
) -> dict[str, float]:
    """Return the derivatives at the solution v (m,) of a scene by variable name, with a verdict.

    At an event or a fold there are none.
    """
    linearised = Linearised.at(level.condensed(scene).problem, v)
    verdict = DIFFERENTIABLE
    if linearised.singular:
        verdict = AT_FOLD
    elif linearised.events:
        verdict = AT_EVENT
    derivatives: dict[str, float] = {
        SENSITIVITY_STATUS: verdict,
        SENSITIVITY_EVENTS: linearised.events,
    }
    if verdict != DIFFERENTIABLE:
        return derivatives
    whole = WholeBody(level, scene, v)
    for number in numbers:
        try:
            change = change_of(level, scene, number)
            dv, dxi, theta_mean = rates_of(whole, number, linearised, change)
            friction = friction_slopes(level, scene, number, linearised)
        except KeyError:  # a law of the sweep that has no such parameter
            continue
        values = opening_slopes(level, linearised, dv, dxi) | {
            "u_T_max": _derivative_of_largest(level.split(v)[0], level.split(dv)[0]),
            "friction_resultant": float(level.split(dxi)[0].sum()),
            "theta_mean": theta_mean,
            "lambda_1": whole.lambda_1(change),
            "omega": friction.omega,
            "energy": whole.energy(change) + friction.energy,
        }
        for quantity, value in values.items():
            derivatives[name_of(quantity, number.name)] = value
    return derivatives


def opening_slopes(level: Level, at: Linearised, dv: Array, dxi: Array) -> dict[str, float]:
    """Return the derivatives of results along openings by name, none without openings.

    dv, dxi: (m,) derivatives of the contact DOFs and of their nodal forces
    """
    opening = level.opening
    if opening is None:
        return {}
    _, s_N = level.split(at.v)
    _, ds_N = level.split(dv)
    _, force = level.split(at.problem.xi(at.v))
    _, dforce = level.split(dxi)
    S_N = force / opening.c
    peel = 0.0
    if np.max(S_N) > 0.0:
        peel = _derivative_of_maximum(S_N, dforce / opening.c)
    return {
        "opening_max": _derivative_of_maximum(s_N, ds_N),
        "peel_stress_max": peel,
        "adhesion_resultant": float(dforce.sum()),
    }


def _derivative_of_maximum(values: Array, changes: Array) -> float:
    """Return the derivative of the maximum, NaN where several have it and do not agree."""
    allowed = EVENT * float(np.max(np.abs(values)))
    of_largest = changes[values >= np.max(values) - allowed]
    agree = np.ptp(of_largest) <= EVENT * np.max(np.abs(changes))
    return float(of_largest[0]) if agree else float("nan")


def _derivative_of_largest(v: Array, dv: Array) -> float:
    """Return the derivative of max |v|, NaN where several nodes have it and do not agree."""
    if not len(v):
        return 0.0
    size = np.abs(v)
    change = np.sign(v) * dv
    of_largest = change[size >= (1.0 - EVENT) * size.max()]
    agree = np.ptp(of_largest) <= EVENT * np.max(np.abs(change))
    return float(of_largest[0]) if agree else float("nan")
