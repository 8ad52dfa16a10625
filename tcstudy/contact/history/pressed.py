"""Histories of bodies whose friction knows the pressure, step after step.

Friction remembers the last slip: with w = u_T − u_Tⁿ⁻¹ the inclusion of a step has σⁿ φ̂(w), with
the pressure of the step itself (backward Euler of Coulomb's law in the rate of the slip). Bonds
have the memory of their edges (memory.py). There is no energy of friction, so that no path is
followed inside a step and no jump is seen: a step goes to the state found from the last one.

Dissipation: D = Σ c σⁿ ∫φ over w; what the pressure changes within a step is in the closure, which
falls with the steps.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.history.memory import HistoryProblem, HistoryStep, with_energies
from tcstudy.contact.pressure_friction import (
    PressureFriction,
    as_answer,
    solve_with_pressure,
)
from tcstudy.contact.problem import ContactProblem

Array = NDArray[np.float64]


def pressed_history(
    history: HistoryProblem,
    friction: PressureFriction,
    loads: Sequence[Array],
    start: HistoryStep | None = None,
) -> Iterator[HistoryStep]:
    """Yield the steps to the loads (m,), up to one without a solution.

    history:  with the bonds that do not know the pressure
    friction: its origins are not used
    start:    the last step before the first load; None for the virgin body
    """
    step = HistoryStep.virgin(history.body.m) if start is None else start
    for load in loads:
        step = pressed_step(history, friction, step, load)
        yield step
        if not step.solved:
            return


def pressed_step(
    history: HistoryProblem, friction: PressureFriction, last_step: HistoryStep, load: Array
) -> HistoryStep:
    """Return the step after the last one to a load (m,)."""
    body, model = history.body, history.model
    origin = model.origin(last_step)
    last_w = last_step.v - origin
    shifted_load = load - body.A_tilde @ origin
    problem = ContactProblem.on(body, shifted_load, model.next_law(last_step))
    here = replace(friction, origin=last_w[friction.slip])
    solved = solve_with_pressure(problem, here, history.tolerance, last_w, prove=False)
    answer, _ = as_answer(problem, here, solved, history.tolerance)
    step = with_energies(history, last_step, load, answer)
    return _with_dissipation(history, here, step, step.v - last_step.v, solved.strengths)


def _with_dissipation(
    history: HistoryProblem,
    friction: PressureFriction,
    step: HistoryStep,
    change: Array,
    strengths: Array,
) -> HistoryStep:
    """Return the step with what friction of pressed nodes dissipates.

    change: (m,) slips of the step [m];  strengths: (k,) σ
    """
    slip = change[friction.slip]
    friction_work = strengths * friction.laws.integral(np.zeros(len(slip)), slip)
    dissipation = step.dissipation.copy()
    np.add.at(dissipation, friction.slip, friction_work)
    dissipated = float(history.body.c[friction.slip] @ friction_work)
    return replace(
        step,
        dissipation=dissipation,
        dissipated=step.dissipated + dissipated,
        closure=step.closure - dissipated,
    )
