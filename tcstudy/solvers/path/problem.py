"""The contact problem along a parameter t in which the load is affine: l̃(t) = l̃₀ + t l̃₁.

The filled graph of b̂ of a piecewise-linear law as a polygonal line in the (s, ξ/c) plane.

A law with K kinks has the pieces 0 … 2K in the order in which the line runs from s = −∞ to s = +∞: piece 2k is the
segment of slopes between kink k−1 and kink k, piece 2k+1 the vertical side at kink k (absent where b only bends).
On a segment the coordinate that moves is s, on a vertical side it is ξ/c.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.friction import BEND, DOWN, FrictionLaw
from tcstudy.solvers.problem import ContactProblem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ParametricProblem:
    """Ãv + ξ = l̃₀ + t l̃₁ with ξ_i/c_i ∈ b̂(v_i), for all t at once.

    A_tilde: (m, m) symmetric positive definite, condensed stiffness [Pa]
    l_0:     (m,) load at t = 0 [N/m]
    l_1:     (m,) load per unit of t [N/m per unit of t], not zero
    c:       (m,) segment lengths > 0 [m]
    law:     friction law b [Pa] of the slip [m]

    t is anything the load is affine in: a load factor, θ̄, the strength of a source.
    """

    A_tilde: Array
    l_0: Array
    l_1: Array
    c: Array
    law: FrictionLaw

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

    def with_law(self, law: FrictionLaw) -> ParametricProblem:
        """The same body and loads under another law."""
        return replace(self, law=law)


Codes = NDArray[np.int32]


@dataclass(frozen=True)
class LawGraph:
    """The line's pieces as arrays over the piece code (2K+1,).

    free:         True on a segment, False on a vertical side
    low, high:    bounds of the moving coordinate (s [m] on a segment, ξ/c [Pa] on a vertical side)
    sense:        sign of the moving coordinate's change along the line: +1, on the side of a down-jump −1
    after_low, after_high: code of the piece that follows at either bound (−1 where the bound is infinite)
    slope, anchor, start: b = start + slope·(s − anchor) on a segment; 0 on a vertical side [Pa/m, m, Pa]
    kink:         s of a vertical side, 0 on a segment [m]
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

    def traction(self, codes: Codes, s: Array, side: Array) -> Array:
        """ξ/c: the segment's b(s) where a node is free, the given value on a vertical side."""
        return np.where(self.free[codes], self.on_segment(codes, s), side)

    def on_segment(self, codes: Codes, s: Array) -> Array:
        """b(s) of the named segments [Pa]."""
        return np.asarray(self.start[codes] + self.slope[codes] * (s - self.anchor[codes]))


def law_graph(law: FrictionLaw) -> LawGraph:
    """The graph of a piecewise-linear law; raises ValueError for exponential pieces."""
    if not law.piecewise_linear:
        raise ValueError(
            f"the law {law.name} is not piecewise linear; replace it by path.smooth.piecewise_linear(law, …) first"
        )
    count = len(law.kinks)
    codes = np.arange(2 * count + 1)
    free = codes % 2 == 0
    ends = np.concatenate([[-np.inf], law.kinks, [np.inf]])
    low, high, slope, anchor, start, kink = (np.zeros(len(codes)) for _ in range(6))
    low[0::2], high[0::2] = ends[:-1], ends[1:]
    slope[0::2], anchor[0::2], start[0::2] = law.q, law.s_0, law.b_0
    low[1::2] = np.minimum(law.b_left, law.b_right)
    high[1::2] = np.maximum(law.b_left, law.b_right)
    kink[1::2] = law.kinks
    sense = np.ones(len(codes), dtype=np.int8)
    sense[1::2] = np.where(law.kinds == DOWN, -1, 1)
    before, after = (codes - 1).astype(np.int32), (codes + 1).astype(np.int32)
    after[-1] = -1
    bends = np.flatnonzero(law.kinds == BEND)
    after[2 * bends] += 1
    before[2 * bends + 2] -= 1
    falls = sense < 0
    return LawGraph(
        free,
        low,
        high,
        sense,
        np.where(falls, after, before),
        np.where(falls, before, after),
        slope,
        anchor,
        start,
        kink,
    )
