"""How far j bends below its tangent at a solution, on a box that holds all solutions: what certificates are made of.

D_i = sup over s in [low_i, high_i] of 2 [j(v_i) + ζ_i (s − v_i) − j(s)] / (s − v_i)²,  ζ_i ∈ b̂(v_i), so that
j(s) ≥ j(v_i) + ζ_i (s − v_i) − ½ D_i (s − v_i)² there. Summed over the nodes:
L̃(w) − L̃(v) ≥ ½ (w−v)ᵀ(Ã − C diag D)(w−v) for every w in the box.

On a linear piece the quotient is a parabola in 1/(s − v_i): its largest value is known in closed form. An exponential
piece is cut into parts; on each b is bounded from below by a line through its value at the near end (the tangent
where b is convex, the chord where it is concave), while j at the near end is exact. A smaller b makes the
quotient larger, so the result is an upper bound of D_i, too large by O(part length²).

The box: every solution satisfies v = Ã⁻¹(l̃ − Cζ) with ζ_i ∈ b̂(v_i), so a box for v gives an interval for ζ and that
gives a better box; the iteration starts from what the energy allows. All bounds are widened by the rounding of the
inverse, so that a box is never too small.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.scene.friction import DOWN, FrictionLaw
from tcstudy.scene.nodal_laws import Law, NodalLaws, each
from tcstudy.solvers.problem import ContactProblem

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_PARTS = 48
_DECAY = 16.0
_ROUNDINGS = 64.0
"""Parts of an exponential piece, decay lengths that they cover (one more part takes the rest), and the number of
roundings of j by which every D is enlarged."""


def bend_below_tangent(law: Law, v: Array, zeta: Array, low: Array, high: Array, parts: int = _PARTS) -> Array:
    """Upper bounds of D_i for slips between low and high (m,) [Pa/m]; inf where v_i sits on a down-jump.

    zeta:  (m,) elements of b̂(v), exactly b(v) off the kinks [Pa]
    parts: of an exponential piece
    """
    return np.maximum(*bends_by_side(law, v, zeta, low, high, parts))


def bends_by_side(law: Law, v: Array, zeta: Array, low: Array, high: Array, parts: int = _PARTS) -> tuple[Array, Array]:
    """(right, left): the same with s > v_i and with s < v_i alone, −∞ where the box has no such s."""

    def of_one(law: Law, v: Array, zeta: Array, low: Array, high: Array) -> tuple[Array, Array]:
        return _one_side(law, v, zeta, high, parts), _one_side(mirrored(law), -v, -zeta, -low, parts)

    right, left = _at_once(law, of_one, v, zeta, low, high)
    return right, left


def _at_once(law: Law, answer: Callable[..., Any], *arrays: Array) -> Any:
    """answer(law, *arrays), which takes laws by node if they are piecewise linear; asked of each law if not."""
    return answer(law, *arrays) if law.piecewise_linear else each(law, answer, *arrays)


def mirrored(law: Law) -> Law:
    """The law −b(−s)."""
    if isinstance(law, NodalLaws):
        return NodalLaws(law.table.mirrored, law.index)
    return law.mirrored


def _right_ends(law: Law) -> Array:
    """(K+1, 1) or, of laws by node, (K+1, m) right ends of the pieces."""
    return law.table.ends[law.index, 1:].T if isinstance(law, NodalLaws) else np.append(law.kinks, np.inf)[:, None]


@dataclass
class _March:
    """Nodes on their way from v to the right: where they are and the gap h = j(v) + ζ(s − v) − j(s) there."""

    at: Array
    gap: Array
    D: Array
    size: Array


def _one_side(law: Law, v: Array, zeta: Array, high: Array, parts: int) -> Array:
    """sup of the quotient over s ∈ (v, high] (−∞ where that is empty)."""
    first, ends = law.piece(v, +1), _right_ends(law)
    march = _March(v.copy(), np.zeros(len(v)), np.full(len(v), -np.inf), np.abs(zeta))
    for piece in range(len(ends)):
        end = np.minimum(ends[piece], high)
        active = np.flatnonzero((first <= piece) & (march.at < end))
        if not len(active):
            continue
        for width in _parts(law, piece, end[active] - march.at[active], parts):
            _advance(law, piece, march, active, v, zeta, width)
        march.at[active] = end[active]
    return march.D


def _parts(law: Law, piece: int, width: Array, number: int) -> list[Array]:
    """Widths of the parts into which [at, at + width] is cut: one for a linear piece, fine where b changes fast."""
    if not isinstance(law, FrictionLaw) or law.a[piece] == 0.0:
        return [width]
    fine = np.minimum(width, _DECAY / abs(float(law.r[piece])))
    parts = [fine / number] * number
    return [*parts, width - fine] if law.r[piece] > 0.0 else [width - fine, *parts]


def _advance(law: Law, piece: int, march: _March, active: Index, v: Array, zeta: Array, width: Array) -> None:
    """Take the part [at, at + width] of one piece into account and go to its end."""
    at, gap = march.at[active], march.gap[active]
    own, k = law.of(active), np.full(len(active), piece)
    value = own.value(at, k)
    excess = np.where(at == v[active], start_excess(value, zeta[active]), zeta[active] - value)
    slope = np.asarray(own.slope(at, k))
    if isinstance(law, FrictionLaw) and law.a[piece] < 0.0:
        chord = (law.value(at + width, k) - value) / np.where(width > 0.0, width, 1.0)
        slope = np.where(width > 0.0, np.minimum(chord, slope), slope)
    march.size[active] = np.maximum(march.size[active], np.abs(value))
    distance = at - v[active]
    largest = quotient(gap, excess, slope, distance, width)
    noise = _ROUNDINGS * np.finfo(float).eps * march.size[active] / np.where(distance > 0.0, distance, 1.0)
    largest = largest + np.where(distance > 0.0, noise, 0.0)
    march.D[active] = np.maximum(march.D[active], np.where(width > 0.0, largest, -np.inf))
    march.gap[active] = gap + _gap_gain(law, piece, at, excess, slope, width)
    march.at[active] = at + width


def start_excess(value: Array, zeta: Array) -> Array:
    """ζ − b(v + 0) at v itself: 0 inside a piece, negative on an up-jump; rounding above 0 is removed."""
    excess = zeta - value
    rounding = _ROUNDINGS * np.finfo(float).eps * np.maximum(np.abs(zeta), np.abs(value))
    return np.where(np.abs(excess) <= rounding, np.minimum(excess, 0.0), excess)


def quotient(gap: Array, excess: Array, slope: Array, distance: Array, width: Array) -> Array:
    """sup over 0 < w ≤ width of 2 (gap + excess w − ½ slope w²)/(distance + w)², a parabola in 1/(distance + w)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        touching = np.where(excess > 0.0, np.inf, 2.0 * excess / width - slope)
        h_0 = gap - excess * distance - 0.5 * slope * distance**2
        vertex = -2.0 * h_0 / (excess + slope * distance) - distance
        apart = np.full(len(gap), -np.inf)
        for w in (np.zeros(len(gap)), width, np.clip(np.nan_to_num(vertex), 0.0, width)):
            value = 2.0 * (gap + w * (excess - 0.5 * slope * w)) / (distance + w) ** 2
            apart = np.maximum(apart, value)
    return np.where(distance == 0.0, touching, apart)


def _gap_gain(law: Law, piece: int, at: Array, excess: Array, slope: Array, width: Array) -> Array:
    """∫ (ζ − b) over the part, exact; slope: of b at its beginning."""
    if not isinstance(law, FrictionLaw) or law.a[piece] == 0.0:
        return width * (excess - 0.5 * slope * width)
    gain = width * (excess - 0.5 * law.q[piece] * width)
    rate = law.r[piece]
    return gain - law.a[piece] * np.exp(-rate * (at - law.s_0[piece])) * (-np.expm1(-rate * width) / rate - width)


def solution_box(
    problem: ContactProblem,
    lambda_1: float,
    rounds: int = 30,
    inverse: Array | None = None,
    others: Array | None = None,
    common: bool = False,
) -> tuple[Array, Array]:
    """(low, high), (m,) each: every solution lies between them [m].

    lambda_1: λ_min(C^{−½}ÃC^{−½}) [Pa/m]
    inverse:  Ã⁻¹ if known (many problems share one Ã)
    rounds:   at most so many improvements; ends when the box no longer shrinks by a hundredth
    others:   (k, m) more loads l̃: the box holds for them, for the problem's own, and for all loads between them
    common:   the part that the boxes of all these loads have in common instead (low > high where there is none)
    """
    law, c = problem.law, problem.c
    loads = problem.l_tilde[None, :] if others is None else np.vstack([problem.l_tilde, others])
    widest, narrowest = (np.min, np.max) if common else (np.max, np.min)
    low, high = first_box(problem, lambda_1, float(widest(np.sqrt((loads / c) ** 2 @ c))))
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


def first_box(problem: ContactProblem, lambda_1: float, load: float | None = None) -> tuple[Array, Array]:
    """(low, high), (m,) each: a box of all solutions from what the energy allows alone [m].

    With B = sup −sign(s) b(s) a solution has λ₁‖v‖² ≤ vᵀÃv = vᵀ(l̃ − Cζ) ≤ (‖l̃/c‖ + B‖1‖)‖v‖ in the norm weighted by c.

    load: ‖l̃/c‖, if not that of the problem's own load
    """
    c = problem.c
    load = float(np.sqrt((problem.l_tilde / c) ** 2 @ c)) if load is None else load
    high = (1.0 + 1e-6) * (load + largest_push(problem.law) * np.sqrt(c.sum())) / lambda_1 / np.sqrt(c)
    return -high, high


def largest_push(law: Law) -> float:
    """sup over s of −sign(s) b(s), at least 0: how hard friction may push the slip on (finite by eq. (15))."""
    if isinstance(law, NodalLaws) and not law.piecewise_linear:
        return max(largest_push(own) for own, _ in law.groups)
    kinks = law.kinks if isinstance(law, NodalLaws) else law.kinks[None, :]
    reach = 2.0 * np.max(np.abs(kinks), axis=1, initial=0.0, where=np.isfinite(kinks))
    if isinstance(law, FrictionLaw):
        reach = reach + float(np.max(40.0 / np.abs(law.r[law.r != 0.0]), initial=0.0))
    least, _ = b_range(law, np.zeros(len(reach)), reach)
    _, largest = b_range(law, -reach, np.zeros(len(reach)))
    return max(0.0, -float(np.min(least)), float(np.max(largest)))


def b_range(law: Law, low: Array, high: Array) -> tuple[Array, Array]:
    """(least, largest) value of the filled graph of b on [low, high] (shape of low) [Pa]."""
    least, largest = _at_once(law, _b_range, low, high)
    return least, largest


def _b_range(law: Law, low: Array, high: Array) -> tuple[Array, Array]:
    ends = [law.b(low, -1), law.b(low, +1), law.b(high, -1), law.b(high, +1)]
    least, largest = np.minimum.reduce(ends), np.maximum.reduce(ends)
    if isinstance(law, NodalLaws):
        met = (law.kinks >= low[:, None]) & (law.kinks <= high[:, None])
        for limit in law.table.limits:
            value = limit[law.index]
            least = np.minimum(least, np.min(value, axis=1, initial=np.inf, where=met))
            largest = np.maximum(largest, np.max(value, axis=1, initial=-np.inf, where=met))
        return least, largest
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


def least_slope(law: Law, low: Array, high: Array) -> Array:
    """inf (b(s₁)−b(s₂))/(s₁−s₂) over [low, high]: −∞ with a down-jump in it (m,) [Pa/m].

    The slope of a piece is monotone, so its ends within the interval decide.
    """
    return np.asarray(_at_once(law, _least_slope, low, high))


def _least_slope(law: Law, low: Array, high: Array) -> Array:
    least, right = np.full(len(low), np.inf), _right_ends(law)
    left = np.vstack([np.full((1, right.shape[1]), -np.inf), right[:-1]])
    for piece in range(len(right)):
        first, last = np.maximum(low, left[piece]), np.minimum(high, right[piece])
        met = np.flatnonzero(first <= last)
        own, index = law.of(met), np.full(len(met), piece)
        slope = np.minimum(own.slope(first[met], index), own.slope(last[met], index))
        least[met] = np.minimum(least[met], slope)
    drops = np.where(law.kinds == DOWN, law.kinks, np.inf)
    met_drop = (low[:, None] <= drops) & (drops <= high[:, None]) & (drops < np.inf)
    return np.where(np.any(met_drop, axis=1), -np.inf, least)
