"""How far j bends below its tangent, for many nodes with laws in tables: D_i of tcstudy/solve/bounds.py.

D_i = sup over s in [low_i, high_i] of 2 [j(v_i) + ζ_i (s − v_i) − j(s)] / (s − v_i)²,  ζ_i ∈ b̂(v_i)

On a linear piece the quotient is a parabola in 1/(s − v_i). An exponential piece is cut into parts, on which b is
bounded from below by a line through its value at the near end (the tangent where b is convex, the chord where it is
concave), while j there is exact: an upper bound of D_i for any number of parts, so that few will do where they suffice.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.online.law_tables import LawTables

Array = NDArray[np.float64]
Index = NDArray[np.intp]

PARTS = 48
"""Parts of an exponential piece of the careful bound."""
_DECAY, _ROUNDINGS = 16.0, 64.0
"""Decay lengths that the parts cover (one more takes the rest), and roundings of j by which every D is enlarged."""


def bend_below_tangent(
    tables: LawTables, law: Index, v: Array, zeta: Array, low: Array, high: Array, parts: int = PARTS
) -> Array:
    """(n,) upper bounds of D_i for slips between low and high [Pa/m]; inf where v_i sits on a down-jump.

    law: (n,) rows of the tables;  zeta: (n,) elements of b̂(v), exactly b(v) off the kinks [Pa]
    """
    right = _one_side(tables, law, v, zeta, high, parts)
    left = _one_side(tables.mirrored, law, -v, -zeta, -low, parts)
    return np.maximum(right, left)


@dataclass
class _March:
    """Nodes on their way from v to the right: where they are and the gap h = j(v) + ζ(s − v) − j(s) there."""

    tables: LawTables
    v: Array
    zeta: Array
    at: Array
    gap: Array
    D: Array
    size: Array

    def advance(self, nodes: Index, piece: Index, width: Array) -> None:
        """Take the part [at, at + width] of the pieces (n,) of the named nodes into account and go to its end."""
        tables, at, gap = self.tables, self.at[nodes], self.gap[nodes]
        v, zeta = self.v[nodes], self.zeta[nodes]
        value, slope = tables.value(at, piece), tables.slope(at, piece)
        excess = np.where(at == v, _start_excess(value, zeta), zeta - value)
        concave = tables.a.take(piece) < 0.0
        if np.any(concave):
            chord = (tables.value(at + width, piece) - value) / np.where(width > 0.0, width, 1.0)
            slope = np.where(concave & (width > 0.0), np.minimum(chord, slope), slope)
        self.size[nodes] = np.maximum(self.size[nodes], np.abs(value))
        distance = at - v
        with np.errstate(divide="ignore"):
            noise = _ROUNDINGS * np.finfo(float).eps * self.size[nodes] / distance
        largest = _quotient(gap, excess, slope, distance, width) + np.where(distance > 0.0, noise, 0.0)
        self.D[nodes] = np.maximum(self.D[nodes], np.where(width > 0.0, largest, -np.inf))
        self.gap[nodes] = gap + width * zeta - tables.piece_integral(piece, at, at + width)
        self.at[nodes] = at + width


def _one_side(tables: LawTables, law: Index, v: Array, zeta: Array, high: Array, parts: int) -> Array:
    """sup of the quotient over s ∈ (v, high] (−∞ where that is empty)."""
    at = tables.locate(law, v)
    begin = at.piece + at.on
    march = _March(tables, v, zeta, v.copy(), np.zeros(len(v)), np.full(len(v), -np.inf), np.abs(zeta))
    for column in range(tables.q.shape[1]):
        piece = tables.first[law] + column
        end = np.minimum(tables.upper.take(piece), high)
        active = np.flatnonzero((begin <= piece) & (march.at < end))
        bent = tables.a.take(piece[active]) != 0.0
        for nodes, count in ((active[~bent], 1), (active[bent], parts)):
            if len(nodes):
                for width in _parts(tables.r.take(piece[nodes]), end[nodes] - march.at[nodes], count):
                    march.advance(nodes, piece[nodes], width)
                march.at[nodes] = end[nodes]
    return march.D


def _parts(rate: Array, width: Array, count: int) -> list[Array]:
    """Widths of the parts into which [at, at + width] is cut: fine on the side where b changes fast."""
    if count == 1:
        return [width]
    with np.errstate(divide="ignore"):
        fine = np.minimum(width, _DECAY / np.abs(rate))
    rest, inner = width - fine, [fine / count] * count
    return [np.where(rate < 0.0, rest, 0.0), *inner, np.where(rate > 0.0, rest, 0.0)]


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
            apart = np.maximum(apart, 2.0 * (gap + w * (excess - 0.5 * slope * w)) / (distance + w) ** 2)
    return np.where(distance == 0.0, touching, apart)
