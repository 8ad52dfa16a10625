"""A box that holds every solution of a contact problem, and the range and steepest fall of b on intervals.

Every solution satisfies v = Ã⁻¹(l̃ − Cζ) with ζ_i ∈ b̂(v_i), so a box for v gives an interval for ζ and that gives a
better box; the iteration starts from what the energy allows. All bounds are widened by the rounding of the
inverse, so that a box is never too small.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.scene.friction import DOWN, FrictionLaw
from tcstudy.solve.problem import ContactProblem

Array = NDArray[np.float64]


def solution_box(
    problem: ContactProblem,
    lambda_1: float,
    rounds: int = 30,
    inverse: Array | None = None,
    others: Array | None = None,
    common: bool = False,
) -> tuple[Array, Array]:
    """(low, high), (m,) each: every solution lies between them [m].

    lambda_1: λ_min(C^{−½}ÃC^{−½}) [Pa/m], for the first box: with B = sup −sign(s) b(s) a solution has
              λ₁‖v‖² ≤ vᵀÃv = vᵀ(l̃ − Cζ) ≤ (‖l̃/c‖ + B‖1‖)‖v‖ in the norm weighted by c
    inverse:  Ã⁻¹ if known (many problems share one Ã)
    rounds:   at most so many improvements; ends when the box no longer shrinks by a hundredth
    others:   (k, m) more loads l̃: the box holds for them, for the problem's own, and for all loads between them
    common:   the part that the boxes of all these loads have in common instead (low > high where there is none)
    """
    law, c = problem.law, problem.c
    loads = problem.l_tilde[None, :] if others is None else np.vstack([problem.l_tilde, others])
    widest, narrowest = (np.min, np.max) if common else (np.max, np.min)
    load = float(widest(np.sqrt((loads / c) ** 2 @ c)))
    driving = load + _largest_push(law) * np.sqrt(c.sum())
    high = (1.0 + 1e-6) * driving / lambda_1 / np.sqrt(c)
    low = -high
    inverse = np.asarray(scipy.linalg.inv(problem.A_tilde)) if inverse is None else inverse
    condition = np.linalg.norm(problem.A_tilde, 1) * np.linalg.norm(inverse, 1)
    rounding = 8.0 * problem.m * np.finfo(float).eps * condition
    size = np.abs(inverse)
    answers = loads @ inverse
    least_answer, largest_answer = narrowest(answers, axis=0), widest(answers, axis=0)
    largest_load = np.max(np.abs(loads), axis=0)
    for _ in range(rounds):
        least, largest = (-c * b for b in b_range(law, low, high)[::-1])
        middle, radius = inverse @ (0.5 * (least + largest)), size @ (0.5 * (largest - least))
        slack = rounding * (size @ (largest_load + np.maximum(np.abs(least), np.abs(largest))))
        new_low = np.maximum(low, least_answer + middle - radius - slack)
        new_high = np.minimum(high, largest_answer + middle + radius + slack)
        new_high = new_high if common else np.maximum(new_high, new_low)
        gain = float(np.max(np.maximum(new_low - low, high - new_high), initial=0.0))
        shrinks = gain > 0.01 * float(np.max(high - low, initial=0.0))
        low, high = new_low, new_high
        if not shrinks or np.any(low > high):
            break
    return low, high


def _largest_push(law: FrictionLaw) -> float:
    """sup over s of −sign(s) b(s), at least 0: how hard friction may push the slip on (finite by eq. (15))."""
    ends = np.concatenate([law.kinks, [0.0]])
    decays = np.abs(law.r[law.r != 0.0])
    reach = 2.0 * float(np.max(np.abs(ends))) + float(np.max(40.0 / decays, initial=0.0))
    least, _ = b_range(law, np.zeros(1), np.array([reach]))
    _, largest = b_range(law, np.array([-reach]), np.zeros(1))
    return max(0.0, -float(least[0]), float(largest[0]))


def b_range(law: FrictionLaw, low: Array, high: Array) -> tuple[Array, Array]:
    """(least, largest) value of the filled graph of b on [low, high] (shape of low) [Pa]."""
    ends = [law.b(low, -1), law.b(low, +1), law.b(high, -1), law.b(high, +1)]
    least, largest = np.minimum.reduce(ends), np.maximum.reduce(ends)
    turning, values = _turning_points(law)
    points = np.concatenate([law.kinks, law.kinks, turning])
    order = np.argsort(points, kind="stable")
    points, values = points[order], np.concatenate([law.b_left, law.b_right, values])[order]
    first, last = np.searchsorted(points, low, side="left"), np.searchsorted(points, high, side="right")
    inside = first < last
    if not np.any(inside):
        return least, largest
    slices = np.stack([first[inside], last[inside]], axis=1).ravel()  # reduceat: every other slice is one of ours
    for extreme, found in ((np.minimum, least), (np.maximum, largest)):
        found[inside] = extreme(found[inside], extreme.reduceat(np.append(values, values[-1]), slices)[::2])
    return least, largest


def _turning_points(law: FrictionLaw) -> tuple[Array, Array]:
    """Slips where b′ = q − a r exp(−r s) vanishes inside a piece, and b there (both pieces' ends excluded)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        s = law.s_0 - np.log(law.q / (law.a * law.r)) / law.r
    ends = np.concatenate([[-np.inf], law.kinks, [np.inf]])
    piece = np.flatnonzero(np.isfinite(s) & (ends[:-1] < s) & (s < ends[1:]))
    return s[piece], law.value(s[piece], piece)


def least_slope(law: FrictionLaw, low: Array, high: Array) -> Array:
    """inf (b(s₁)−b(s₂))/(s₁−s₂) over [low, high]: −∞ with a down-jump in it (m,) [Pa/m].

    The slope of a piece is monotone, so its ends within the interval decide.
    """
    ends = np.concatenate([[-np.inf], law.kinks, [np.inf]])
    least = np.full(len(low), np.inf)
    for piece in range(len(law.q)):
        first, last = np.maximum(low, ends[piece]), np.minimum(high, ends[piece + 1])
        met = np.flatnonzero(first <= last)
        index = np.full(len(met), piece)
        slope = np.minimum(law.slope(first[met], index), law.slope(last[met], index))
        least[met] = np.minimum(least[met], slope)
    for kink in law.kinks[law.kinds == DOWN]:
        least = np.where((low <= kink) & (kink <= high), -np.inf, least)
    return least
