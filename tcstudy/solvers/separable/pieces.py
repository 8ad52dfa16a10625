"""Exact one-dimensional pieces of Ψ at the nodes: integrals of b, next up-jump, one-sided slopes and energies.

Ψ(v) = Σ c_i j(v_i) is separable, so everything nonsmooth in L̃ happens node by node and is known in closed form.
Differences of energy are summed from small terms instead of subtracting two energies: near a solution the
difference is far below the rounding of L̃ itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.friction import BEND, UP, FrictionLaw
from tcstudy.solvers.problem import ContactProblem

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def integral(law: FrictionLaw, x: Array, y: Array) -> Array:
    """j(y) − j(x) = ∫_x^y b(s) ds without cancellation (shape of x) [Pa·m]."""
    rising = y >= x
    first = np.where(rising, law.piece(x, +1), law.piece(x, -1))
    last = np.where(rising, law.piece(y, -1), law.piece(y, +1))
    last = np.where(x == y, first, last)
    total = law.piece_integral(first, x, np.where(first == last, y, x))
    crossed = np.flatnonzero(first != last)
    if not len(crossed):
        return total
    inner = law.piece_integral(np.arange(1, len(law.kinks)), law.kinks[:-1], law.kinks[1:])
    at_kink = np.concatenate([[0.0], np.cumsum(inner)])
    up, start, end = rising[crossed], first[crossed], last[crossed]
    leave = np.where(up, start, start - 1)
    enter = np.where(up, end - 1, end)
    total[crossed] = (
        law.piece_integral(start, x[crossed], law.kinks[leave])
        + (at_kink[enter] - at_kink[leave])
        + law.piece_integral(end, law.kinks[enter], y[crossed])
    )
    return total


def next_up_jump(law: FrictionLaw, v: Array, direction: Array) -> Array:
    """First up-jump strictly beyond v in the sign of `direction`; ±inf if there is none (shape of v) [m]."""
    jumps = np.concatenate([[-np.inf], law.kinks[law.kinds == UP], [np.inf]])
    above = jumps[np.searchsorted(jumps, v, side="right")]
    below = jumps[np.searchsorted(jumps, v, side="left") - 1]
    return np.where(direction > 0, above, below)


@dataclass(frozen=True)
class Slopes:
    """One-sided first-order information at v, all (m,).

    left, right: derivatives of L̃ in v_i from the left and from the right [N/m]
    descent:     the steeper descending one of both (the derivative itself where L̃ is smooth), 0 at rest
    at_jump:     v_i sits bitwise on a jump of b
    """

    left: Array
    right: Array
    descent: Array
    at_jump: NDArray[np.bool_]

    @property
    def at_rest(self) -> NDArray[np.bool_]:
        """Nodes on an up-jump that hold: left ≤ 0 ≤ right."""
        return self.at_jump & (self.descent == 0.0)


def slopes(problem: ContactProblem, v: Array, xi: Array) -> Slopes:
    """One-sided slopes c b(v∓0) − ξ of L̃ and the descending one of both."""
    law = problem.law
    left = problem.c * law.b(v, -1) - xi
    right = problem.c * law.b(v, +1) - xi
    at_jump = np.zeros(len(v), dtype=bool)
    if len(law.kinks):
        near = law.nearest_kink(v)
        at_jump = (law.kinks[near] == v) & (law.kinds[near] != BEND)
    climb_right, climb_left = np.maximum(-right, 0.0), np.maximum(left, 0.0)
    descent = np.where(climb_right >= climb_left, -climb_right, climb_left)
    return Slopes(left, right, np.where(at_jump, descent, right), at_jump)


def energy_change(problem: ContactProblem, v: Array, xi: Array, step: Array, A_step: Array) -> float:
    """L̃(v + step) − L̃(v), summed from the small terms −ξᵀstep + ½ stepᵀÃ step + Σ c_i ∫ b [J/m]."""
    friction = problem.c * integral(problem.law, v, v + step)
    return float(np.sum(friction - xi * step + 0.5 * step * A_step))


def relative_residual(problem: ContactProblem, v: Array) -> float:
    """Inclusion residual with nothing counted as "near a kink"; infinite if it is nonzero and b has no scale."""
    if problem.m == 0:
        return 0.0
    if problem.traction_scale == 0.0:
        return float("inf") if np.any(problem.distance(v) != 0.0) else 0.0
    return problem.inclusion_residual(v)
