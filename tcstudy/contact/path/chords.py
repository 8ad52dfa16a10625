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
    ends = np.concatenate([[-np.inf], law.kinks, [np.inf]])
    kinks: list[float] = []
    pieces: list[tuple[float, float, float]] = []
    for k in range(len(law.q)):
        nodes, offsets = _nodes(law, k, float(ends[k]), float(ends[k + 1]), s_max, allowed)
        kinks += [*nodes[1:-1], *([nodes[-1]] if k + 1 < len(law.q) else [])]
        pieces += _sides(law, k, nodes, offsets)
    s_0, b_0, q = (np.array(column) for column in zip(*pieces, strict=True))
    zero = np.zeros(len(q))
    return Laws(f"{law.name}, piecewise linear", np.array(kinks), s_0, b_0, q, zero, zero)


Corners = tuple[list[float], list[float]]


def _nodes(law: Laws, k: int, left: float, right: float, s_max: float, allowed: float) -> Corners:
    """Ends of the sides of piece k, its own ends included (±∞ where it has none), and how far |b| is below there."""
    a, r, anchor = abs(float(law.a[k])), float(law.r[k]), float(law.s_0[k])
    if a == 0.0 or r == 0.0:
        return [left, right], [0.0, 0.0]
    if r < 0.0:  # the mirror image, so that an odd law stays odd to the bit
        nodes, offsets = _decaying(a, -r, -anchor, -right, -left, s_max, allowed)
        return [-s for s in nodes[::-1]], offsets[::-1]
    return _decaying(a, r, anchor, left, right, s_max, allowed)


def _decaying(a: float, r: float, anchor: float, left: float, right: float, s_max: float, allowed: float) -> Corners:
    """Corners for a exp(−r (s − anchor)), a, r > 0, between left and right."""
    faded = anchor + float(np.log(a / (2.0 * allowed))) / r  # a constant serves for all that is left beyond
    first, last = max(left, -s_max), min(right, s_max)
    fades = not np.isfinite(right) and faded < last
    last = max(faded, first) if fades else last
    if last <= first:
        return [left, right], [0.0, 0.0]
    height = a * float(np.exp(-r * (first - anchor)))
    tail = allowed if fades else 0.0
    cuts, error = _equal(allowed / height, r * (last - first), tail / height)
    inner = [first + x / r for x in cuts[1:-1]]
    nodes = [first, *inner, last]
    offsets = [0.0, *[error * height] * len(inner), tail]
    if left < first:
        nodes, offsets = [left, *nodes], [0.0, *offsets]
    if right > last:
        nodes, offsets = [*nodes, right], [*offsets, 0.0]
    return nodes, offsets


def _equal(allowed: float, length: float, tail: float) -> tuple[list[float], float]:
    """(corners of the polygon for exp(−x) on [0, length], its error ≤ allowed): the fewest sides, the least error.

    tail: how far the last corner lies below the curve
    """
    cuts = _march(allowed, length, tail)
    low, high, best = 0.0, allowed, allowed
    for _ in range(20 if len(cuts) < 300 else 0):
        middle = 0.5 * (low + high)
        tried = _march(middle, length, tail)
        if len(tried) == len(cuts):
            high, best, cuts = middle, middle, tried
        else:
            low = middle
    return cuts, best


def _march(error: float, length: float, tail: float) -> list[float]:
    """Corners one after the other, every side as long as the error allows."""
    cuts, begin = [0.0], 0.0
    while True:
        height = float(np.exp(-cuts[-1]))
        rest = length - cuts[-1]
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


def _sides(law: Laws, k: int, nodes: list[float], offsets: list[float]) -> list[tuple[float, float, float]]:
    """(anchor, value there, slope) of the lines between consecutive nodes, each hung on its end nearer to s = 0.

    Beyond the first and last finite node it is the linear part that goes on.
    """
    q, a = float(law.q[k]), float(law.a[k])
    way = math.copysign(1.0, a)
    sides = []
    for (x, z_x), (y, z_y) in pairwise(zip(nodes, offsets, strict=True)):
        inner = bool(np.isfinite(x) and np.isfinite(y))
        from_x = abs(x) <= abs(y) if inner else bool(np.isfinite(x))
        anchor, offset = (x, z_x) if from_x else (y, z_y)
        if a == 0.0 or not np.isfinite(anchor):
            sides.append((float(law.s_0[k]), float(law.b_0[k]) + a, q))
            continue
        slope = q
        if inner:
            slope = (float(law.value(y, k) - law.value(x, k)) - way * (z_y - z_x)) / (y - x)
        sides.append((anchor, float(law.value(anchor, k)) - way * offset, slope))
    return sides
