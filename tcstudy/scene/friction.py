"""The multivalued friction law −S_T ∈ b̂(u_T): values, filled interval, exact primitive, growth.

Law:        b piecewise smooth with finitely many kinks; b̂(s) fills its jumps vertically, eq. (4)
Primitive:  j(s) = ∫₀ˢ b(t) dt, exact, eq. (17)
Growth:     eqs. (15) and (16)
Literature: Šestak & Jovanović, Appl. Math. Mech. 31 (2010), doi 10.3879/j.issn.1000-0887.2010.01.008

Every law of the package is one record: K kinks and K + 1 pieces, piece k being

    b_k(s) = p_k + q_k s + a_k exp(−r_k s)        between kink k−1 and kink k,

which contains piecewise-linear laws (a = 0) and exponential decay in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

UP, BEND, DOWN = 1, 0, -1
"""Kinds of kink: up-jump (convex kink of j, sticking), change of slope only, down-jump (concave)."""


class GrowthError(ValueError):
    """The law violates growth condition (15) or (16); the text says where and why."""


@dataclass(frozen=True, eq=False)
class FrictionLaw:
    """A friction law b with its jumps filled in, as arrays over kinks and pieces; equal if all numbers are.

    name:   the shape's name, for reports
    kinks:  (K,) slips at which b jumps or bends, strictly increasing [m]
    p:      (K+1,) constant part of each piece [Pa]
    q:      (K+1,) slope of each piece [Pa/m]
    a:      (K+1,) amplitude of the exponential part [Pa]
    r:      (K+1,) rate of the exponential part [1/m], 0 where a = 0
    """

    name: str
    kinks: Array
    p: Array
    q: Array
    a: Array
    r: Array

    def __eq__(self, other: object) -> bool:
        return isinstance(other, FrictionLaw) and self._numbers == other._numbers

    def __hash__(self) -> int:
        return hash(self._numbers)

    @property
    def _numbers(self) -> tuple[str | bytes, ...]:
        """Name and bytes of the arrays; adding 0.0 makes −0.0 and 0.0 one number."""
        arrays = (self.kinks, self.p, self.q, self.a, self.r)
        return (self.name, *((np.asarray(x, dtype=float) + 0.0).tobytes() for x in arrays))

    @property
    def piecewise_linear(self) -> bool:
        """True if no piece has an exponential part."""
        return not np.any(self.a)

    @property
    def vanishes(self) -> bool:
        """True if b ≡ 0: a film without friction."""
        return not (np.any(self.p) or np.any(self.q) or np.any(self.a))

    def piece(self, s: ArrayLike, side: int = 1) -> NDArray[np.intp]:
        """Index of the piece that holds s; at a kink the piece to its right (side=1) or left (side=-1)."""
        return np.searchsorted(self.kinks, np.asarray(s), side="right" if side > 0 else "left")

    def value(self, s: ArrayLike, piece: ArrayLike) -> Array:
        """b_k(s) of the named pieces, without asking whether s lies in them (shape of s)."""
        s, k = np.asarray(s, dtype=float), np.asarray(piece)
        value: Array = self.p[k] + self.q[k] * s
        if not self.piecewise_linear:
            value = value + self.a[k] * np.exp(-self.r[k] * s)
        return value

    def slope(self, s: ArrayLike, piece: ArrayLike) -> Array:
        """b_k′(s) of the named pieces (shape of s)."""
        s, k = np.asarray(s, dtype=float), np.asarray(piece)
        slope: Array = self.q[k] + 0.0 * s
        if not self.piecewise_linear:
            slope = slope - self.a[k] * self.r[k] * np.exp(-self.r[k] * s)
        return slope

    def b(self, s: ArrayLike, side: int = 1) -> Array:
        """One selection of b̂: the right limit of b (side=1) or the left one (side=-1)."""
        return self.value(s, self.piece(s, side))

    def interval(self, s: ArrayLike, tolerance: float = 0.0) -> tuple[Array, Array]:
        """The filled interval b̂(s) = [b⁻(s), b⁺(s)]; slips within `tolerance` of a kink count as on it."""
        s = np.asarray(s, dtype=float)
        if not len(self.kinks):
            value = self.b(s)
            return value, value.copy()
        near = self.nearest_kink(s)
        on = np.abs(s - self.kinks[near]) <= tolerance
        left = np.where(on, self.b_left[near], self.b(s, -1))
        right = np.where(on, self.b_right[near], self.b(s, +1))
        return np.minimum(left, right), np.maximum(left, right)

    def nearest_kink(self, s: ArrayLike) -> NDArray[np.intp]:
        """Index of the kink closest to each s (the law must have one)."""
        s = np.asarray(s, dtype=float)
        right = np.minimum(np.searchsorted(self.kinks, s), len(self.kinks) - 1)
        left = np.maximum(right - 1, 0)
        return np.where(np.abs(s - self.kinks[left]) < np.abs(s - self.kinks[right]), left, right)

    def j(self, s: ArrayLike) -> Array:
        """The primitive j(s) = ∫₀ˢ b, exact, eq. (17) (shape of s) [Pa·m].

        Summed outwards from 0, piece by piece, so that j of an odd law is even to the bit.
        """
        s = np.asarray(s, dtype=float)
        k = np.where(s < 0.0, self.piece(s, -1), self.piece(s, +1))
        near, j_near = self._inner_ends
        return j_near[k] + self.piece_integral(k, near[k], s)

    def piece_integral(self, piece: ArrayLike, x: ArrayLike, y: ArrayLike) -> Array:
        """∫_x^y b_k(s) ds of the named pieces, accurate for small y − x (shape of x) [Pa·m]."""
        k, x = np.asarray(piece), np.asarray(x, dtype=float)
        y = np.asarray(y, dtype=float)
        step = y - x
        total = step * (self.p[k] + self.q[k] * (x + 0.5 * step))
        if not self.piecewise_linear:
            # from the end where the exponential is larger, so that expm1 cannot overflow
            rate = self.r[k]
            larger = np.where(rate * step >= 0.0, x, y)
            decay = np.abs(rate * step)
            length = np.where(decay == 0.0, step, step * -np.expm1(-decay) / np.where(decay == 0.0, 1.0, decay))
            total = total + self.a[k] * np.exp(-rate * larger) * length
        return total

    @cached_property
    def _inner_ends(self) -> tuple[Array, Array]:
        """(K+1,) the end of each piece nearer to 0 (0 itself for the pieces that touch it), and j there."""
        near, j_near = np.zeros(len(self.p)), np.zeros(len(self.p))
        for k in range(int(self.piece(0.0, +1)) + 1, len(self.p)):
            near[k] = self.kinks[k - 1]
            j_near[k] = j_near[k - 1] + self.piece_integral(k - 1, near[k - 1], near[k])
        for k in range(int(self.piece(0.0, -1)) - 1, -1, -1):
            near[k] = self.kinks[k]
            j_near[k] = j_near[k + 1] + self.piece_integral(k + 1, near[k + 1], near[k])
        return near, j_near

    @cached_property
    def b_left(self) -> Array:
        """(K,) left limits of b at the kinks [Pa]."""
        return self.value(self.kinks, np.arange(len(self.kinks)))

    @cached_property
    def b_right(self) -> Array:
        """(K,) right limits of b at the kinks [Pa]."""
        return self.value(self.kinks, np.arange(len(self.kinks)) + 1)

    @cached_property
    def kinds(self) -> NDArray[np.int8]:
        """(K,) kind of each kink: UP, DOWN, or BEND where b is continuous to rounding."""
        jump = self.b_right - self.b_left
        left = np.arange(len(self.kinks))
        noise = 8 * np.finfo(float).eps * (self._terms_at_kinks(left) + self._terms_at_kinks(left + 1))
        return np.where(np.abs(jump) <= noise, BEND, np.sign(jump)).astype(np.int8)

    def _terms_at_kinks(self, piece: NDArray[np.intp]) -> Array:
        """(K,) sum of the magnitudes that b of the named pieces is made of at the kinks: what rounding goes with."""
        rs = self.r[piece] * self.kinks
        exponential = np.where(self.a[piece] == 0.0, 0.0, np.abs(self.a[piece]) * np.exp(-rs) * (1.0 + np.abs(rs)))
        return np.abs(self.p[piece]) + np.abs(self.q[piece] * self.kinks) + exponential

    @cached_property
    def omega(self) -> float:
        """Steepest fall ω = −inf (b(s₁)−b(s₂))/(s₁−s₂) ≥ 0 [Pa/m]; infinite with a down-jump (method §5)."""
        if np.any(self.kinds == DOWN):
            return float("inf")
        return max(0.0, -self.least_slope)

    @cached_property
    def least_slope(self) -> float:
        """Smallest b′ inside the pieces [Pa/m] (a piece's slope is monotone, so its ends decide)."""
        return float(min(self._slope_ends().min(), np.inf))

    def _slope_ends(self) -> Array:
        """(2(K+1),) slopes at both ends of every piece, limits at ±∞ included."""
        pieces = np.arange(len(self.p))
        ends = np.concatenate([[-np.inf], self.kinks, [np.inf]])
        slopes = []
        for s in (ends[:-1], ends[1:]):
            finite = np.isfinite(s)
            at = self.slope(np.where(finite, s, 0.0), pieces)
            slopes.append(np.where(finite, at, self.q))
        return np.concatenate(slopes)

    @cached_property
    def b_scale(self) -> float:
        """Largest |b| at the kinks and, where bounded, at infinity [Pa]; 0 for a law without either."""
        ends = [abs(float(self.p[k])) for k in (0, -1) if self.q[k] == 0.0]
        index = np.arange(len(self.kinks))
        limits = [self.value(self.kinks, index + side) for side in (0, 1)]
        return float(np.max(np.abs(np.concatenate([*limits, ends])), initial=0.0))

    @cached_property
    def s_scale(self) -> float:
        """Slip over which b changes: least kink spacing or decay length [m]; 0 if the law has none."""
        lengths = np.concatenate([np.diff(self.kinks), 1.0 / np.abs(self.r[self.r != 0.0])])
        return float(lengths.min()) if len(lengths) else 0.0

    def scaled(self, s_unit: float, b_unit: float) -> FrictionLaw:
        """The same law with slips measured in s_unit and tractions in b_unit."""
        return FrictionLaw(
            self.name,
            self.kinks / s_unit,
            self.p / b_unit,
            self.q * (s_unit / b_unit),
            self.a / b_unit,
            self.r * s_unit,
        )

    def check_growth(self) -> None:
        """Raise GrowthError unless (15) and (16) hold: b eventually opposes slip and grows at most linearly."""
        arrays = (self.kinks, self.p, self.q, self.a, self.r)
        if not all(np.all(np.isfinite(x)) for x in arrays):
            raise GrowthError("the law has a value that is not finite, so |b(s)| ≤ C(1+|s|), eq. (16), fails")
        if np.any(np.diff(self.kinks) <= 0):
            raise GrowthError("the kinks of the law are not in increasing order of slip")
        for piece, sign, side in ((-1, 1.0, "s → +∞"), (0, -1.0, "s → −∞")):
            p, q, a = sign * self.p[piece], self.q[piece], sign * self.a[piece]
            rate = sign * self.r[piece]
            if a != 0.0 and rate < 0.0:
                raise GrowthError(f"b grows exponentially as {side}, so |b(s)| ≤ C(1+|s|), eq. (16), fails")
            if q < 0.0 or (q == 0.0 and (p < 0.0 or (p == 0.0 and a < 0.0))):
                raise GrowthError(
                    f"b ends with the wrong sign as {side} (last slope {q:g}, last value {sign * p:g}), "
                    "so eq. (15) fails: friction must not push the slip on for large |s|"
                )
