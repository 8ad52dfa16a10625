"""What a path is followed on: a load affine in t, l̃(t) = l̃₀ + t l̃₁, and a law of straight pieces.

The filled graph of b̂ of such a law is a polygonal line in the (s, ξ/c) plane. With K kinks it has the pieces 0 … 2K in
the order in which the line runs from s = −∞ to s = +∞: piece 2k is the segment of slopes between kink k−1 and kink k,
piece 2k+1 the vertical side at kink k (absent where b only bends). On a segment the coordinate that moves is s, on a
vertical side it is ξ/c.

Where nodes have laws of their own (scene/nodal_laws.py) the pieces of all of them are numbered through, law after
law, so that a piece's code says of which law it is and whatever is asked by code needs no law.

A law with exponential pieces gets a stand-in of straight ones with a guaranteed error.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.friction import BEND, DOWN, FrictionLaw
from tcstudy.scene.nodal_laws import Law, LawTable
from tcstudy.solvers.problem import ContactProblem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ParametricProblem:
    """Ãv + ξ = l̃₀ + t l̃₁ with ξ_i/c_i ∈ b̂(v_i), for all t at once.

    A_tilde: (m, m) symmetric positive definite, condensed stiffness [Pa]
    l_0:     (m,) load at t = 0 [N/m]
    l_1:     (m,) load per unit of t [N/m per unit of t], not zero
    c:       (m,) segment lengths > 0 [m]
    law:     friction law b [Pa] of the slip [m], or the laws of the nodes (scene/nodal_laws.py)

    t is anything the load is affine in: a load factor, θ̄, the strength of a source, the share of a load step.
    """

    A_tilde: Array
    l_0: Array
    l_1: Array
    c: Array
    law: Law

    @property
    def m(self) -> int:
        """Number of contact unknowns."""
        return len(self.c)

    def load(self, t: float) -> Array:
        """l̃(t) (m,)."""
        return self.l_0 + t * self.l_1

    def at(self, t: float) -> ContactProblem:
        """The problem of one t."""
        return ContactProblem(self.A_tilde, self.load(t), self.c, self.law)

    def with_law(self, law: Law) -> ParametricProblem:
        """The same body and loads under another law."""
        return replace(self, law=law)

    @cached_property
    def graph(self) -> LawGraph:
        """The law's pieces by their codes; raises ValueError for exponential pieces."""
        return law_graph(self.law)


Codes = NDArray[np.int32]


@dataclass(frozen=True)
class LawGraph:
    """The line's pieces as arrays over the piece code (2K+1,), of several laws one after the other.

    free:         True on a segment, False on a vertical side
    low, high:    bounds of the moving coordinate (s [m] on a segment, ξ/c [Pa] on a vertical side)
    sense:        sign of the moving coordinate's change along the line: +1, on the side of a down-jump −1
    after_low, after_high: code of the piece that follows at either bound (−1 where the bound is infinite)
    slope, anchor, start: b = start + slope·(s − anchor) on a segment; 0 on a vertical side [Pa/m, m, Pa]
    kink:         s of a vertical side, 0 on a segment [m]
    first:        code of the first piece of every node's law (m,), or of the only law (1,)
    """

    free: NDArray[np.bool_]
    low: Array
    high: Array
    sense: NDArray[np.int8]
    after_low: Codes
    after_high: Codes
    slope: Array
    anchor: Array
    start: Array
    kink: Array
    first: Codes

    @cached_property
    def rows(self) -> list[tuple[bool, float, float, int, int, int, float, float, float, float]]:
        """The arrays as one tuple a code, for the one node that changes its piece."""
        columns = (getattr(self, f.name).tolist() for f in fields(self) if f.name != "first")
        return list(zip(*columns, strict=True))

    def points(self, codes: Codes, x: Array, weight: Array) -> tuple[Array, Array]:
        """(u, ξ/c) where the moving coordinates are x, forces in units of `weight` on a vertical side.

        What a piece does not have is 0 in its row, so that sums take the place of choices, which are slow.
        """
        moves = self.free[codes].astype(float)
        u = moves * x + self.kink[codes]
        return u, self.on_segment(codes, u) + (1.0 - moves) * (x / weight)

    def traction(self, codes: Codes, s: Array, side: Array) -> Array:
        """ξ/c: the segment's b(s) where a node is free, the given value on a vertical side."""
        return np.where(self.free[codes], self.on_segment(codes, s), side)

    def on_segment(self, codes: Codes, s: Array) -> Array:
        """b(s) of the named segments [Pa]."""
        return np.asarray(self.start[codes] + self.slope[codes] * (s - self.anchor[codes]))


def by_code(law: Law, answer: Callable[[FrictionLaw], NDArray[Any]]) -> NDArray[Any]:
    """What `answer` says of the pieces (2K+1,) of a law, by the codes of its graph."""
    table = _table(law)
    rows = [answer(own) for own in table.laws]
    width = 2 * table.kinks.shape[1] + 1
    return np.concatenate([np.append(row, np.repeat(row[-1:], width - len(row))) for row in rows])


def _table(law: Law) -> LawTable:
    return LawTable((law,)) if isinstance(law, FrictionLaw) else law.table


def law_graph(law: Law) -> LawGraph:
    """The graph of a piecewise-linear law, or of the laws of nodes; raises ValueError for exponential pieces.

    All laws have as many codes as the one with most kinks; nothing leads to those that a law does not need.
    """
    if not law.piecewise_linear:
        raise ValueError(
            f"the law {law.name} is not piecewise linear; replace it by path.problem.piecewise_linear(law, …) first"
        )
    table = _table(law)
    laws, count = table.kinks.shape
    shape, real = (laws, 2 * count + 1), np.isfinite(table.kinks)
    free, codes = np.zeros(shape, dtype=bool), np.arange(laws * shape[1], dtype=np.int32).reshape(shape)
    low, high, slope, anchor, start, kink = (np.zeros(shape) for _ in range(6))
    free[:, 0::2] = True
    low[:, 0::2], high[:, 0::2] = table.ends[:, :-1], table.ends[:, 1:]
    anchor[:, 0::2], start[:, 0::2], slope[:, 0::2] = table.pieces[:3]
    low[:, 1::2], high[:, 1::2] = np.minimum(*table.limits), np.maximum(*table.limits)
    kink[:, 1::2] = np.where(real, table.kinks, 0.0)
    sense = np.ones(shape, dtype=np.int8)
    sense[:, 1::2] = np.where(table.kinds == DOWN, -1, 1)
    before, after = codes - 1, codes + 1
    bends = real & (table.kinds == BEND)
    after[:, :-1:2] += bends
    before[:, 2::2] -= bends
    before[:, 0] = after[np.arange(laws), 2 * np.count_nonzero(real, axis=1)] = -1
    falls = sense < 0
    low_after, high_after = np.where(falls, after, before), np.where(falls, before, after)
    first = codes[:1, 0] if isinstance(law, FrictionLaw) else codes[law.index, 0]
    moving = (free.ravel(), low.ravel(), high.ravel(), sense.ravel(), low_after.ravel(), high_after.ravel())
    return LawGraph(*moving, slope.ravel(), anchor.ravel(), start.ravel(), kink.ravel(), first)


MAX_CELLS = 100_000
"""Cells of one piece; a finer approximation than this is a mistake in the tolerance."""


def piecewise_linear(law: FrictionLaw, tolerance: float, s_max: float) -> FrictionLaw:
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
    allowed = tolerance * law.b_scale
    ends = np.concatenate([[-np.inf], law.kinks, [np.inf]])
    kinks: list[float] = []
    pieces: list[tuple[float, float, float]] = []
    for k in range(len(law.q)):
        nodes, offsets = _nodes(law, k, float(ends[k]), float(ends[k + 1]), s_max, allowed)
        kinks += [*nodes[1:-1], *([nodes[-1]] if k + 1 < len(law.q) else [])]
        pieces += _sides(law, k, nodes, offsets)
    s_0, b_0, q = (np.array(column) for column in zip(*pieces, strict=True))
    zero = np.zeros(len(q))
    result = FrictionLaw(f"{law.name}, piecewise linear", np.array(kinks), s_0, b_0, q, zero, zero)
    result.check_growth()
    return result


Corners = tuple[list[float], list[float]]


def _nodes(law: FrictionLaw, k: int, left: float, right: float, s_max: float, allowed: float) -> Corners:
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


def _sides(law: FrictionLaw, k: int, nodes: list[float], offsets: list[float]) -> list[tuple[float, float, float]]:
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
