"""The digits of a solution that double precision does not hold: v as a sum of two doubles, ξ in twice the precision.

From a point near a solution, Newton's method on the pieces that its nodes are on, (A_FF + C b_F′) d_F = (ξ − c b)_F,
with the right-hand side in two doubles and the factor in one: iterative refinement. One step turns a residual of 1e-10
into 1e-14 where v keeps its low part, and into little less than it was where v is rounded to one double.
Literature: Wilkinson, Rounding Errors in Algebraic Processes, HMSO 1963 (iterative refinement).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.solve.active_pieces import linear_solver
from tcstudy.solve.extended import two_sum
from tcstudy.solve.nodal_pieces import next_up_jump, slopes
from tcstudy.solve.problem import ContactProblem

Array = NDArray[np.float64]

_STEPS = 8
"""Most steps; two do where the nodes are on the right pieces, the others put nodes on other ones."""


@dataclass(frozen=True)
class Refined:
    """A point and what is known of it in extended precision.

    v, v_low: (m,) displacements v + v_low [m], each |v_low| at most half a unit in the last place of v, 0 on a kink
    xi:       (m,) ξ = l̃ − Ã(v + v_low) [N/m], rounded once
    residual: inclusion residual of v + v_low
    """

    v: Array
    v_low: Array
    xi: Array
    residual: float


def extended(problem: ContactProblem, v: Array, v_low: Array | None = None) -> Refined:
    """What is known of v + v_low; without v_low of v itself."""
    low = np.zeros(problem.m) if v_low is None else v_low
    xi = problem.xi_extended(v, v_low)
    law = problem.law
    piece = np.where(low < 0.0, law.piece(v, -1), law.piece(v, +1))
    moved = xi - problem.c * np.where(low == 0.0, 0.0, law.slope(v, piece) * low)  # b at v + v_low, from b at v
    return Refined(v, low, xi, problem.inclusion_residual(v, xi=moved))


def refined(problem: ContactProblem, v: Array, aim: float) -> Refined:
    """v (m,) itself if its residual in extended precision is at most `aim`, else the best point of refinement.

    A node leaves the up-jump on which its slopes no longer hold it, and stops on the first that it would cross.
    """
    best = current = extended(problem, v)
    for _ in range(_STEPS):
        if best.residual <= aim:
            break
        following = _step(problem, current)
        if following is None:
            break
        current = following
        if current.residual < best.residual:
            best = current
    return best


def _step(problem: ContactProblem, at: Refined) -> Refined | None:
    """One step of refinement; None where the equations of the pieces are singular or lead nowhere."""
    law, c = problem.law, problem.c
    s = slopes(problem, at.v, at.xi)
    free = np.flatnonzero(~s.at_rest)
    if not len(free):
        return None
    right = (at.v_low > 0.0) | ((at.v_low == 0.0) & (s.descent <= 0.0))
    piece = np.where(right, law.piece(at.v, +1), law.piece(at.v, -1))[free]
    slope = c[free] * law.slope(at.v[free], piece)
    solve = linear_solver(problem, free, slope)
    if solve is None:
        return None
    direction = np.zeros(problem.m)
    direction[free] = -solve(s.descent[free] + slope * at.v_low[free])
    if not np.all(np.isfinite(direction)):
        return None
    v, v_low = two_sum(at.v, at.v_low + direction)
    stop = next_up_jump(law, at.v, direction)
    reached = (direction != 0.0) & np.where(direction > 0.0, v >= stop, v <= stop)
    return extended(problem, np.where(reached, stop, v), np.where(reached, 0.0, v_low))
