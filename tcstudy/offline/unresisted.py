"""Rigid motions that a load sets off where contact alone holds a body.

With Ãr = 0 for a rigid motion r at the contact nodes, an equilibrium has rᵀξ = rᵀl̃. The force of
friction along r is at most
    Σ sup c_i r_i b̂_i over all slips,
and no load beyond that has an equilibrium. Below it, a softening bond can still fail, from its
loaded end on. A descent then runs along r without end, and rounding hides where it is: Ãv is the
difference of large numbers. Answers are therefore accepted only if their forces along r balance.
"""

from __future__ import annotations

from collections.abc import Sequence
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
    answers: Answer, loads: Array, laws: Laws, c: Array, motions: Array, names: Sequence[str]
) -> Answer:
    """Return the answers of a loose body, those that are no equilibria as failed with the reason.

    loads:   (P, m) l̃ [N/m];  laws: of the rows
    motions: (k, m) rigid motions r at the contact DOFs;  names: these in words
    """
    push = loads @ motions.T
    strength = _strength(laws, c, motions, push)
    low, high = laws.interval(answers.v)
    friction = np.clip(answers.xi, c * low, c * high) @ motions.T
    size = laws.b_scale * (np.abs(motions) @ c)
    is_balanced = np.abs(push - friction) <= MAX_RESIDUAL * (np.abs(push) + size)
    is_solution = answers.status == Status.CONVERGED
    is_solution &= answers.inclusion_residual <= MAX_RESIDUAL
    is_solution &= np.all(is_balanced, axis=1)
    excess = np.where(push == 0.0, 0.0, np.inf)
    is_finite = strength > MAX_RESIDUAL * np.abs(push)
    np.divide(np.abs(push), strength, out=excess, where=is_finite)
    worst = np.argmax(excess, axis=1)
    reasons = list(answers.reason)
    for row in np.flatnonzero(~is_solution).tolist():
        reasons[row] = _reason(names[worst[row]], float(excess[row, worst[row]]))
    status = np.where(is_solution, answers.status, Status.NOT_POSITIVE_DEFINITE)
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


def step_reason(words: str, reason: str) -> str:
    """Return why a step of a history of a loose body has no equilibrium.

    words: its motions;  reason: of the solver
    """
    fault = f"it can {words}, and no equilibrium was found in this step"
    return f"{fault} ({reason.partition(': ')[0]}); {REMEDY}"


def _reason(name: str, excess: float) -> str:
    """Return why there is no equilibrium.

    name: the motion in words;  excess: load along it over the largest force of contact
    """
    if not np.isfinite(excess):
        return f"it can {name}, and nothing resists that; {REMEDY}"
    if excess > 1.0:
        ratio = f"{excess:.3g} times what contact can resist"
        return f"it can {name}: the load along that is {ratio}; {REMEDY}"
    fault = f"it can {name} once the bond has failed, and no equilibrium was found before that"
    return f"{fault}; {REMEDY}, or follow the path of the load to its peak"


def _strength(laws: Laws, c: Array, motions: Array, push: Array) -> Array:
    """Return (P, k) the largest force of friction against a push along motions [N/m]."""
    reach = np.broadcast_to(far(laws)[laws.index], push.shape[:1] + c.shape)
    least, largest = value_range(laws, -reach, reach)
    last = laws.locate(reach)
    least = np.where(laws.slope(-reach, laws.locate(-reach).piece) > 0.0, -np.inf, least)
    largest = np.where(laws.slope(reach, last.piece + last.on) > 0.0, np.inf, largest)
    strength = np.zeros(push.shape)
    for k, motion in enumerate(motions):
        moves = motion != 0.0
        forces = [(c * motion)[moves] * b[:, moves] for b in (least, largest)]
        against = np.maximum(*forces).sum(axis=1), -np.minimum(*forces).sum(axis=1)
        strength[:, k] = np.where(push[:, k] >= 0.0, *against)
    return strength
