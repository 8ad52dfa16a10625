"""Range and least slope of b on intervals of slip, for laws in tables; as tcstudy/solvers/bounds.py, law by law.

A piece q (s − s_0) + b_0 + a exp(−r (s − s_0)) has a monotone slope, so that its ends within an interval, and for the
range the one slip where b′ = 0, decide.

How far j bends below its tangent, for many nodes with laws in tables: D_i of tcstudy/solvers/bounds.py.

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
from tcstudy.scene.friction import DOWN
from tcstudy.solvers.bounds import quotient, start_excess

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def value_range(tables: LawTables, law: Index, low: Array, high: Array) -> tuple[Array, Array]:
    """(least, largest) value of the filled graph of b on [low, high] (shape of low); law broadcasts with low [Pa]."""
    least, largest = np.full(low.shape, np.inf), np.full(low.shape, -np.inf)

    def meet(inside: NDArray[np.bool_] | bool, value: Array) -> None:
        np.minimum(least, value, out=least, where=inside)
        np.maximum(largest, value, out=largest, where=inside)

    for s in (low, high):
        at = tables.locate(law, s)
        meet(True, tables.value(s, at.piece))
        if np.any(at.on):
            meet(at.on, tables.value(s, at.piece + at.on))
    for kink in range(tables.kinks.shape[1]):
        s = tables.kinks[:, kink]
        inside = (low <= s[law]) & (s[law] <= high)
        if np.any(inside):
            s, piece = np.where(np.isfinite(s), s, 0.0), tables.first + kink
            meet(inside, tables.value(s, piece)[law])
            meet(inside, tables.value(s, piece + 1)[law])
    if not tables.linear:
        turning, value = _turning_points(tables)
        for column in np.flatnonzero(np.any(np.isfinite(turning), axis=0)):
            s = turning[:, column][law]
            meet((low <= s) & (s <= high), value[:, column][law])
    return least, largest


def _turning_points(tables: LawTables) -> tuple[Array, Array]:
    """(L, K+1) slip where b′ = q − a r exp(−r (s − s_0)) vanishes inside a piece, NaN where it does not; b there."""
    with np.errstate(divide="ignore", invalid="ignore"):
        s = tables.s_0 - np.log(tables.q / (tables.a * tables.r)) / tables.r
        s = np.where(np.isfinite(s) & (tables.lower < s) & (s < tables.upper), s, np.nan)
    piece = tables.first[:, None] + np.arange(s.shape[1])
    return s, tables.value(np.where(np.isnan(s), 0.0, s), piece)


def least_slope(tables: LawTables, law: Index, low: Array, high: Array) -> Array:
    """inf (b(s₁) − b(s₂))/(s₁ − s₂) over [low, high]: −∞ with a down-jump in it (shape of low) [Pa/m]."""
    least = np.full(low.shape, np.inf)
    for piece in range(tables.q.shape[1]):
        first, last = (tables.lower[:, piece])[law], (tables.upper[:, piece])[law]
        met = (low <= last) & (first <= high)
        if tables.linear:
            np.minimum(least, tables.q[:, piece][law], out=least, where=met)
        elif np.any(met):
            address = np.broadcast_to((tables.first + piece)[law], low.shape)[met]
            for s in (np.maximum(low, first)[met], np.minimum(high, last)[met]):
                least[met] = np.minimum(least[met], tables.slope(s, address))
    for kink in np.flatnonzero(np.any(tables.kinds == DOWN, axis=0)):
        s = np.where(tables.kinds[:, kink] == DOWN, tables.kinks[:, kink], np.nan)[law]
        least[(low <= s) & (s <= high)] = -np.inf
    return least


def largest_push(tables: LawTables) -> Array:
    """(L,) sup over s of −sign(s) b(s), at least 0: how hard friction may push slip on (finite by (15)) [Pa]."""
    reach, every = far(tables), np.arange(len(tables.q), dtype=np.intp)
    least, _ = value_range(tables, every, np.zeros(len(reach)), reach)
    _, largest = value_range(tables, every, -reach, np.zeros(len(reach)))
    return np.maximum(0.0, np.maximum(-least, largest))


def far(tables: LawTables) -> Array:
    """(L,) slip beyond which a law has no kink and its exponentials have decayed [m]."""
    kinks = np.where(np.isfinite(tables.kinks), np.abs(tables.kinks), 0.0)
    decays = np.divide(40.0, np.abs(tables.r), out=np.zeros(tables.r.shape), where=tables.r != 0.0)
    return np.asarray(2.0 * np.max(kinks, axis=1) + np.max(decays, axis=1))


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
        excess = np.where(at == v, start_excess(value, zeta), zeta - value)
        concave = tables.a.take(piece) < 0.0
        if np.any(concave):
            chord = (tables.value(at + width, piece) - value) / np.where(width > 0.0, width, 1.0)
            slope = np.where(concave & (width > 0.0), np.minimum(chord, slope), slope)
        self.size[nodes] = np.maximum(self.size[nodes], np.abs(value))
        distance = at - v
        noise = np.zeros(len(nodes))  # of the quotient, which at v itself is a limit
        np.divide(_ROUNDINGS * np.finfo(float).eps * self.size[nodes], distance, out=noise, where=distance > 0.0)
        largest = quotient(gap, excess, slope, distance, width) + noise
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
