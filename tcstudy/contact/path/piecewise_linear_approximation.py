"""Straight pieces in the place of exponential ones, with a guaranteed error: what makes any law one for paths."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from tcstudy.laws.composed import total
from tcstudy.laws.laws import Laws

MAX_CELLS = 100_000
"""Cells of one piece; a finer approximation than this is a mistake in the tolerance."""


def piecewise_linear(law: Laws, tolerance: float, s_max: float) -> Laws:
    """The law with every exponential piece replaced by chords, |b − b_h| ≤ tolerance · b_scale on [−s_max, s_max].

    tolerance: relative to law.b_scale
    s_max:     largest slip of interest [m]; beyond it the exponential part stays at its last value, and it is
               frozen earlier where what is left of it is below the tolerance

    The exponential part is convex or concave, so the polygon of fewest sides has its inner corners at the distance of
    the error on the side away from the curve's chords, and in the middle of every side the same distance on the other
    (Chebyshev): √2 times fewer sides than chords. Kinks of the law are kept bitwise with the values there, and so is
    an odd law's symmetry.
    Raises ValueError for a tolerance or s_max that is not positive, and GrowthError if the part that is cut off is
    what satisfied (15).
    """
    if not (tolerance > 0.0 and s_max > 0.0 and np.isfinite(s_max)):
        raise ValueError(f"tolerance and s_max must be positive and finite, not {tolerance:g} and {s_max:g}")
    if law.piecewise_linear:
        return law
    result = _polygon(law, tolerance * law.b_scale, s_max)
    result.check_growth()
    return result


def _polygon(law: Laws, allowed: float, s_max: float) -> Laws:
    """The same with an error in Pa; of two exponentials a piece the sum of those of each, with half the error."""
    if law.a_2 is not None and law.r_2 is not None:
        zero = np.zeros(len(law.q))
        one = Laws(law.name, law.kinks, law.s_0, law.b_0, law.q, law.a, law.r)
        two = Laws(law.name, law.kinks, law.s_0, zero, zero, law.a_2, law.r_2)
        return total(_polygon(one, 0.5 * allowed, s_max), _polygon(two, 0.5 * allowed, s_max))
    ends, kinks, sides = np.concatenate([[-np.inf], law.kinks, [np.inf]]), list[float](), list[tuple[float, ...]]()
    for k, (q, a, r, anchor) in enumerate(zip(law.q, law.a, law.r, law.s_0, strict=True)):
        left, right = ends[k : k + 2].tolist()
        corners, below = [left, right], [0.0, 0.0]
        if not (straight := a == 0.0 or r == 0.0):
            corners, below = _corners(abs(a), r, anchor, left, right, s_max, allowed)
        kinks += corners[1:] if k + 1 < len(law.q) else corners[1:-1]
        both = zip(corners, below, strict=True)
        b = [float(law.value(s, k)) - math.copysign(z, a) if math.isfinite(s) else 0.0 for s, z in both]
        for (x, b_x), (y, b_y) in pairwise(zip(corners, b, strict=True)):
            if straight or corners == [-np.inf, np.inf]:
                sides.append((anchor, law.b_0[k] + a, q))
            elif math.isfinite(x) and math.isfinite(y):  # hung on its end nearer to s = 0
                sides.append((*((x, b_x) if abs(x) <= abs(y) else (y, b_y)), (b_y - b_x) / (y - x)))
            else:  # the linear part goes on
                sides.append((*((x, b_x) if math.isfinite(x) else (y, b_y)), q))
    s_0, b_0, slope = (np.array(column) for column in zip(*sides, strict=True))
    zero = np.zeros(len(slope))
    return Laws(f"{law.name}, piecewise linear", np.array(kinks), s_0, b_0, slope, zero, zero)


def _corners(
    a: float, r: float, anchor: float, left: float, right: float, s_max: float, allowed: float
) -> tuple[list[float], list[float]]:
    """Ends of the sides of a piece with a exp(−r (s − anchor)), a > 0, and how far they are below it; left and right
    are the first and the last."""
    if r < 0.0:  # the mirror image, so that an odd law stays odd to the bit
        corners, below = _corners(a, -r, -anchor, -right, -left, s_max, allowed)
        return [-s for s in corners[::-1]], below[::-1]
    faded = anchor + math.log(a / (2.0 * allowed)) / r  # a constant serves for all that is left beyond
    first, last = max(left, -s_max), min(right, s_max)
    fades = not math.isfinite(right) and faded < last
    last = max(faded, first) if fades else last
    if last <= first:
        return [left, right], [0.0, 0.0]
    height, tail = a * math.exp(-r * (first - anchor)), allowed if fades else 0.0
    cuts, error = _equal(allowed / height, r * (last - first), tail / height)
    corners = [first, *(first + x / r for x in cuts[1:-1]), last]
    below = [0.0, *[error * height] * (len(cuts) - 2), tail]
    before, after = ([left] if left < first else []), ([right] if right > last else [])
    return [*before, *corners, *after], [*[0.0] * len(before), *below, *[0.0] * len(after)]


def _equal(allowed: float, length: float, tail: float) -> tuple[list[float], float]:
    """(corners of the polygon for exp(−x) on [0, length], its error ≤ allowed): the fewest sides, the least error.

    tail: how far the last corner lies below the curve
    """
    cuts = _march(allowed, length, tail)
    low, high = 0.0, allowed
    for _ in range(20 if len(cuts) < 300 else 0):
        middle = 0.5 * (low + high)
        tried = _march(middle, length, tail)
        if len(tried) == len(cuts):
            high, cuts = middle, tried
        else:
            low = middle
    return cuts, high


def _march(error: float, length: float, tail: float) -> list[float]:
    """Corners one after the other, every side as long as the error allows."""
    cuts, begin = [0.0], 0.0
    while True:
        height, rest = math.exp(-cuts[-1]), length - cuts[-1]
        if _excess(rest, begin / height, tail / height) <= error / height:
            return [*cuts, length]
        if len(cuts) > MAX_CELLS:
            raise ValueError(f"more than {MAX_CELLS} chords are needed; the tolerance is too small")
        low, high = 0.0, rest
        for _ in range(45):
            middle = 0.5 * (low + high)
            within = _excess(middle, begin / height, error / height) <= error / height
            low, high = (middle, high) if within else (low, middle)
        cuts.append(cuts[-1] + low)
        begin = error


def _excess(h: float, z_0: float, z_1: float) -> float:
    """How far the line from (0, 1 − z₀) to (h, e^(−h) − z₁) rises above exp(−x) between them."""
    if h == 0.0:
        return 0.0
    fall = (float(-np.expm1(-h)) + z_1 - z_0) / h
    where = min(max(-math.log(fall), 0.0), h) if fall > 0.0 else h
    return -z_0 - fall * where - math.expm1(-where)
