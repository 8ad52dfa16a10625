"""Rigid motions that a load sets off where contact alone holds a body.

With Ãr = 0 for a rigid motion r at the contact nodes, an equilibrium has rᵀξ = rᵀl̃. The force of
contact along r is at most
    Σ sup c_i r_i b̂_i over all slips,
and no load beyond that has an equilibrium. Of several motions, the sum that exceeds it most is
found by a linear program. Below it, a softening bond can still fail, from its
loaded end on. A descent then runs along r without end, and rounding hides where it is: Ãv is the
difference of large numbers. Answers are therefore accepted only if their forces along r balance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.certificates import far, value_range
from tcstudy.contact.problem import Status
from tcstudy.contact.solve import Answer
from tcstudy.laws.laws import Laws

Array = NDArray[np.float64]

MAX_RESIDUAL = 1e-6
"""Largest inclusion residual of an equilibrium of a loose body, however much rounding allows.

As much of the forces along a motion may be left without balance.
"""
REMEDY = "pull by a displacement (a rigid edge with u_x or u_y), or lower the load"


def judged(
    answers: Answer,
    loads: Array,
    laws: Laws,
    c: Array,
    motions: Array,
    name_of: Callable[[Array], str],
    knows_pressure: bool = False,
) -> Answer:
    """Return the answers of a loose body, those that are no equilibria as failed with the reason.

    Where contact resists the load along every motion, the reason of the solver stays.


    loads:   (P, m) l̃ [N/m];  laws: of the rows
    motions: (k, m) rigid motions r at the contact DOFs
    name_of: words for a sum of the motions with weights (k,)
    knows_pressure: whether the laws have the strength of pressures that are no equilibrium
    """
    push = loads @ motions.T
    low, high = laws.interval(answers.v)
    friction = np.clip(answers.xi, c * low, c * high) @ motions.T
    size = np.abs(loads) @ np.abs(motions.T) + laws.b_scale * (np.abs(motions) @ c)
    is_balanced = np.abs(push - friction) <= MAX_RESIDUAL * size
    is_solution = answers.status == Status.CONVERGED
    is_solution &= answers.inclusion_residual <= MAX_RESIDUAL
    is_solution &= np.all(is_balanced, axis=1)
    least, largest = _extremes(laws, loads.shape)
    reasons = list(answers.reason)
    status = np.where(is_solution, answers.status, Status.NOT_POSITIVE_DEFINITE)
    for row in np.flatnonzero(~is_solution).tolist():
        forces = c * least[row], c * largest[row]
        weights, excess = worst_motion(push[row], motions, *forces)
        is_pushed = np.any(np.abs(push[row]) > MAX_RESIDUAL * size[row])
        if reasons[row] and is_pushed and excess <= MAX_RESIDUAL:  # it is pressed on all the same
            status[row] = answers.status[row]
            continue
        reasons[row] = _reason(name_of(weights), excess, knows_pressure)
    certificate = answers.certificate
    if certificate is not None:
        unproved = {
            name: getattr(certificate, name) & is_solution
            for name in ("unique", "strict_minimum", "global_minimum")
        }
        certificate = replace(certificate, **unproved)
    return replace(
        answers,
        status=status.astype(np.int8),
        reason=tuple(reasons),
        limited=answers.limited & is_solution,
        certificate=certificate,
    )


def worst_motion(push: Array, motions: Array, least: Array, largest: Array) -> tuple[Array, float]:
    """Return weights (k,) of the motion along which the load exceeds contact most, and how far.

    The excess is rᵀl̃ over Σ max(r_i ξ_i); above 1 no equilibrium exists. One of the motions is
    taken if it tells that, else one of their sums, from a linear program.

    push:           (k,) rᵀl̃ of the motions [N/m];  motions: (k, m) r
    least, largest: (m,) forces of contact over all slips [N/m]
    """
    singles = np.diag(np.where(push < 0.0, -1.0, 1.0))
    excesses = [_excess(weights, push, motions, least, largest) for weights in singles]
    worst = int(np.argmax(excesses))
    if excesses[worst] > 1.0 or len(push) == 1:
        return singles[worst], excesses[worst]
    weights = _freed(push, motions, least, largest)
    excess = _excess(weights, push, motions, least, largest)
    if excess > 1.0:
        return weights, excess
    return singles[worst], excesses[worst]


def _excess(weights: Array, push: Array, motions: Array, least: Array, largest: Array) -> float:
    """Return the load along a motion over the largest force of contact against it."""
    load = float(weights @ push)
    if load <= 0.0:
        return 0.0
    motion = weights @ motions
    moves = np.abs(motion) > MAX_RESIDUAL * np.max(np.abs(motions))
    forces = [motion[moves] * force[moves] for force in (least, largest)]
    strength = float(np.sum(np.maximum(*forces)))
    return load / strength if strength > MAX_RESIDUAL * load else np.inf


def _freed(push: Array, motions: Array, least: Array, largest: Array) -> Array:
    """Return weights (k,) in [−1, 1] that maximise rᵀl̃ − Σ max(r_i ξ_i)."""
    from scipy.optimize import linprog  # only for points that fail

    k, m = motions.shape
    rows = []
    for force, sign in ((least, -1.0), (largest, 1.0)):
        is_finite = np.isfinite(force)
        bounded = np.where(is_finite, force, sign)
        # r_i ξ_i ≤ t_i, or where ξ_i has no bound r_i must not work against it
        rows.append(np.hstack([bounded[:, None] * motions.T, -np.diag(is_finite.astype(float))]))
    bounds = [(-1.0, 1.0)] * k + [(None if np.isfinite(f) else 0.0, None) for f in least]
    objective = np.concatenate([-push, np.ones(m)])
    program = linprog(objective, A_ub=np.vstack(rows), b_ub=np.zeros(2 * m), bounds=bounds)
    return np.zeros(k) if program.x is None else np.asarray(program.x[:k])


def step_reason(words: str, reason: str) -> str:
    """Return why a step of a history of a loose body has no equilibrium.

    words: its motions;  reason: of the solver
    """
    fault = f"it can {words}, and no equilibrium was found in this step"
    return f"{fault} ({reason.partition(': ')[0]}); {REMEDY}"


def _reason(name: str, excess: float, knows_pressure: bool) -> str:
    """Return why there is no equilibrium.

    name: the motion in words;  excess: load along it over the largest force of contact
    """
    remedy = REMEDY
    separates = name.startswith("separate")
    if separates:
        remedy = "press the body onto its foundation, or support it"
    if not np.isfinite(excess):
        return f"it can {name}, and nothing resists that; {remedy}"
    if separates and excess <= 0.0:
        return f"it can {name}, and no load presses it on; {remedy}"
    if knows_pressure and not separates:
        found = "no state was found in which the friction of the pressed edge balances the load"
        return f"it can {name}: {found}; {remedy}"
    if excess > 1.0:
        ratio = f"{excess:.3g} times what contact can resist"
        return f"it can {name}: the load along that is {ratio}; {remedy}"
    fault = f"it can {name} once the bond has failed, and no equilibrium was found before that"
    if knows_pressure:  # along which no path is followed
        return f"{fault}; {remedy}"
    return f"{fault}; {remedy}, or follow the path of the load to its peak"


def _extremes(laws: Laws, shape: tuple[int, ...]) -> tuple[Array, Array]:
    """Return (P, m) least and largest tractions of contact over all slips [Pa]."""
    reach = np.broadcast_to(far(laws)[laws.index], shape)
    least, largest = value_range(laws, -reach, reach)
    last = laws.locate(reach)
    least = np.where(laws.slope(-reach, laws.locate(-reach).piece) > 0.0, -np.inf, least)
    largest = np.where(laws.slope(reach, last.piece + last.on) > 0.0, np.inf, largest)
    return least, largest
