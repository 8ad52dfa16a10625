"""How far j bends below its tangent at a solution: the numbers D_i of the global-minimum certificate.

D_i = sup over s in [low_i, high_i] of 2 [j(v_i) + ζ_i (s − v_i) − j(s)] / (s − v_i)²,  ζ_i ∈ b̂(v_i), so that
j(s) ≥ j(v_i) + ζ_i (s − v_i) − ½ D_i (s − v_i)² there. Summed over the nodes:
L̃(w) − L̃(v) ≥ ½ (w−v)ᵀ(Ã − C diag D)(w−v) for every w in the box.

On a linear piece the quotient is a parabola in 1/(s − v_i): its largest value is known in closed form. An exponential
piece is cut into parts; on each b is bounded from below by a line through its value at the near end (the tangent
where b is convex, the chord where it is concave), while j at the near end is exact. A smaller b makes the
quotient larger, so the result is an upper bound of D_i, too large by O(part length²).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.friction import FrictionLaw

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_PARTS = 48
_DECAY = 16.0
_ROUNDINGS = 64.0
"""Parts of an exponential piece, decay lengths that they cover (one more part takes the rest), and the number of
roundings of j by which every D is enlarged."""


def bend_below_tangent(law: FrictionLaw, v: Array, zeta: Array, low: Array, high: Array) -> Array:
    """Upper bounds of D_i for slips between low and high (m,) [Pa/m]; inf where v_i sits on a down-jump.

    zeta: (m,) elements of b̂(v), exactly b(v) off the kinks [Pa]
    """
    return np.maximum(*bends_by_side(law, v, zeta, low, high))


def bends_by_side(law: FrictionLaw, v: Array, zeta: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """(right, left): the same with s > v_i and with s < v_i alone, −∞ where the box has no such s."""
    return _one_side(law, v, zeta, high), _one_side(mirrored(law), -v, -zeta, -low)


def mirrored(law: FrictionLaw) -> FrictionLaw:
    """The law −b(−s)."""
    kinks, s_0, b_0, a, r = (-x[::-1] for x in (law.kinks, law.s_0, law.b_0, law.a, law.r))
    return FrictionLaw(law.name, kinks, s_0, b_0, law.q[::-1], a, r)


@dataclass
class _March:
    """Nodes on their way from v to the right: where they are and the gap h = j(v) + ζ(s − v) − j(s) there."""

    at: Array
    gap: Array
    D: Array
    size: Array


def _one_side(law: FrictionLaw, v: Array, zeta: Array, high: Array) -> Array:
    """sup of the quotient over s ∈ (v, high] (−∞ where that is empty)."""
    first = law.piece(v, +1)
    ends = np.append(law.kinks, np.inf)
    march = _March(v.copy(), np.zeros(len(v)), np.full(len(v), -np.inf), np.abs(zeta))
    for piece in range(len(law.q)):
        end = np.minimum(ends[piece], high)
        active = np.flatnonzero((first <= piece) & (march.at < end))
        if not len(active):
            continue
        for width in _parts(law, piece, end[active] - march.at[active]):
            _advance(law, piece, march, active, v, zeta, width)
        march.at[active] = end[active]
    return march.D


def _parts(law: FrictionLaw, piece: int, width: Array) -> list[Array]:
    """Widths of the parts into which [at, at + width] is cut: one for a linear piece, fine where b changes fast."""
    if law.a[piece] == 0.0:
        return [width]
    fine = np.minimum(width, _DECAY / abs(float(law.r[piece])))
    parts = [fine / _PARTS] * _PARTS
    return [*parts, width - fine] if law.r[piece] > 0.0 else [width - fine, *parts]


def _advance(law: FrictionLaw, piece: int, march: _March, active: Index, v: Array, zeta: Array, width: Array) -> None:
    """Take the part [at, at + width] of one piece into account and go to its end."""
    at, gap = march.at[active], march.gap[active]
    k = np.full(len(active), piece)
    value = law.value(at, k)
    excess = np.where(at == v[active], _start_excess(value, zeta[active]), zeta[active] - value)
    slope = np.asarray(law.slope(at, k))
    if law.a[piece] < 0.0:
        chord = (law.value(at + width, k) - value) / np.where(width > 0.0, width, 1.0)
        slope = np.where(width > 0.0, np.minimum(chord, slope), slope)
    march.size[active] = np.maximum(march.size[active], np.abs(value))
    distance = at - v[active]
    largest = _quotient(gap, excess, slope, distance, width)
    noise = _ROUNDINGS * np.finfo(float).eps * march.size[active] / np.where(distance > 0.0, distance, 1.0)
    largest = largest + np.where(distance > 0.0, noise, 0.0)
    march.D[active] = np.maximum(march.D[active], np.where(width > 0.0, largest, -np.inf))
    march.gap[active] = gap + _gap_gain(law, piece, at, excess, width)
    march.at[active] = at + width


def _start_excess(value: Array, zeta: Array) -> Array:
    """ζ − b(v + 0) at v itself: 0 inside a piece, negative on an up-jump; rounding above 0 is removed."""
    excess = zeta - value
    rounding = _ROUNDINGS * np.finfo(float).eps * np.maximum(np.abs(zeta), np.abs(value))
    return np.where(np.abs(excess) <= rounding, np.minimum(excess, 0.0), excess)


def _quotient(gap: Array, excess: Array, slope: Array, distance: Array, width: Array) -> Array:
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


def _gap_gain(law: FrictionLaw, piece: int, at: Array, excess: Array, width: Array) -> Array:
    """∫ (ζ − b) over the part, exact."""
    gain = width * (excess - 0.5 * law.q[piece] * width)
    if law.a[piece] == 0.0:
        return gain
    rate = law.r[piece]
    return gain - law.a[piece] * np.exp(-rate * (at - law.s_0[piece])) * (-np.expm1(-rate * width) / rate - width)
