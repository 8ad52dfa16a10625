"""The multivalued friction law −S_T ∈ b̂(u_T): values, filled interval, exact primitive, growth.

Law:        b piecewise smooth with finitely many kinks; b̂(s) fills its jumps vertically, eq. (4)
Primitive:  j(s) = ∫₀ˢ b(t) dt, exact, eq. (17)
Growth:     eqs. (15) and (16)
Literature: Šestak & Jovanović, Appl. Math. Mech. 31 (2010), doi 10.3879/j.issn.1000-0887.2010.01.008

Every law of the package is one record: K kinks and K + 1 pieces, piece k being

    b_k(s) = b0_k + q_k (s − s0_k) + a_k exp(−r_k (s − s0_k))        between kink k−1 and kink k,

which contains piecewise-linear laws (a = 0) and exponential decay in closed form. A piece hangs on its anchor s0_k,
as a rule one of its ends, because the difference s − s0_k is exact where it matters: a piece a few roundings wide keeps
the values at both ends, where p + q s would have lost all digits.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

UP, BEND, DOWN = 1, 0, -1
"""Kinds of kink: up-jump (convex kink of j, sticking), change of slope only, down-jump (concave)."""

NARROW = 32.0
"""Roundings of the slip up to which a piece is narrow (`FrictionLaw.without_narrow_pieces`)."""


class GrowthError(ValueError):
    """The law violates growth condition (15) or (16); the text says where and why."""


@dataclass(frozen=True, eq=False)
class Made:
    """What a law was made of: the name of its shape, the values of all its parameters, and a factor of b."""

    shape: str
    values: dict[str, Any]
    strength: float = 1.0


@dataclass(frozen=True, eq=False)
class FrictionLaw:
    """A friction law b with its jumps filled in, as arrays over kinks and pieces; equal if all numbers are.

    name:   the shape's name, for reports
    kinks:  (K,) slips at which b jumps or bends, strictly increasing [m]
    s_0:    (K+1,) anchor of each piece: an end of it, or another slip not far from it [m]
    b_0:    (K+1,) value of the linear part of each piece at its anchor [Pa]
    q:      (K+1,) slope of each piece [Pa/m]
    a:      (K+1,) amplitude of the exponential part at the anchor [Pa]
    r:      (K+1,) rate of the exponential part [1/m], 0 where a = 0
    made:   what it was made of, None if that is not known; it is no part of what the law is
    """

    name: str
    kinks: Array
    s_0: Array
    b_0: Array
    q: Array
    a: Array
    r: Array
    made: Made | None = field(default=None, repr=False, kw_only=True)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, FrictionLaw) and self._numbers == other._numbers

    def __hash__(self) -> int:
        return hash(self._numbers)

    @property
    def _numbers(self) -> tuple[str | bytes, ...]:
        """Name and bytes of the arrays; adding 0.0 makes −0.0 and 0.0 one number."""
        arrays = (self.kinks, self.s_0, self.b_0, self.q, self.a, self.r)
        return (self.name, *((np.asarray(x, dtype=float) + 0.0).tobytes() for x in arrays))

    @cached_property
    def piecewise_linear(self) -> bool:
        """True if no piece has an exponential part."""
        return not np.any(self.a)

    @cached_property
    def vanishes(self) -> bool:
        """True if b ≡ 0: a film without friction."""
        return not (np.any(self.b_0) or np.any(self.q) or np.any(self.a))

    def piece(self, s: ArrayLike, side: int = 1) -> NDArray[np.intp]:
        """Index of the piece that holds s; at a kink the piece to its right (side=1) or left (side=-1)."""
        return np.searchsorted(self.kinks, np.asarray(s), side="right" if side > 0 else "left")

    def value(self, s: ArrayLike, piece: ArrayLike) -> Array:
        """b_k(s) of the named pieces, without asking whether s lies in them (shape of s)."""
        s, k = np.asarray(s, dtype=float), np.asarray(piece)
        apart = s - self.s_0[k]
        value: Array = self.b_0[k] + self.q[k] * apart
        if not self.piecewise_linear:
            value = value + self.a[k] * np.exp(-self.r[k] * apart)
        return value

    def slope(self, s: ArrayLike, piece: ArrayLike) -> Array:
        """b_k′(s) of the named pieces (shape of s)."""
        s, k = np.asarray(s, dtype=float), np.asarray(piece)
        slope: Array = self.q[k] + 0.0 * s
        if not self.piecewise_linear:
            slope = slope - self.r[k] * (self.a[k] * np.exp(-self.r[k] * (s - self.s_0[k])))
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

    def of(self, nodes: object) -> FrictionLaw:
        """The law of the named nodes: all have this one (`NodalLaws.of`)."""
        return self

    def single(self, node: int) -> FrictionLaw:
        """The law of one node."""
        return self

    def kink(self, index: NDArray[np.intp]) -> Array:
        """Slips of the named kinks [m]."""
        return np.asarray(self.kinks[index])

    def limits(self, index: NDArray[np.intp]) -> tuple[Array, Array]:
        """(left, right) limits of b at the named kinks [Pa]."""
        return self.b_left[index], self.b_right[index]

    def ends(self, piece: NDArray[np.intp]) -> tuple[Array, Array]:
        """(left, right) ends of the named pieces [m]."""
        ends = np.concatenate([[-np.inf], self.kinks, [np.inf]])
        return ends[piece], ends[piece + 1]

    def on_kink(self, s: Array) -> NDArray[np.bool_]:
        """Whether s is a kink, to the bit (shape of s)."""
        return np.isin(s, self.kinks)

    def kind_at(self, s: Array) -> NDArray[np.int8]:
        """UP, BEND or DOWN where s is a kink to the bit, BEND elsewhere (shape of s)."""
        if not len(self.kinks):
            return np.full(np.shape(s), BEND, dtype=np.int8)
        near = self.nearest_kink(s)
        return np.where(self.kinks[near] == s, self.kinds[near], BEND).astype(np.int8)

    def next_up_jump(self, s: Array, direction: Array) -> Array:
        """First up-jump strictly beyond s in the sign of `direction`, ±∞ if there is none (shape of s) [m]."""
        jumps = np.concatenate([[-np.inf], self.kinks[self.kinds == UP], [np.inf]])
        above = jumps[np.searchsorted(jumps, s, side="right")]
        below = jumps[np.searchsorted(jumps, s, side="left") - 1]
        return np.where(direction > 0, above, below)

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
        step, s_0 = y - x, self.s_0[k]
        total: Array = step * (self.b_0[k] + self.q[k] * ((x - s_0) + 0.5 * step))
        return total if self.piecewise_linear else total + decay_integral(s_0, self.a[k], self.r[k], x, y)

    @cached_property
    def from_first(self) -> Array:
        """(K,) ∫ b from the first kink to each [Pa·m]."""
        inner = self.piece_integral(np.arange(1, len(self.kinks)), self.kinks[:-1], self.kinks[1:])
        return np.concatenate([[0.0], np.cumsum(inner)])[: len(self.kinks)]

    def between_kinks(self, first: NDArray[np.intp], last: NDArray[np.intp]) -> Array:
        """∫ b from one named kink to another [Pa·m]."""
        return np.asarray(self.from_first[last] - self.from_first[first])

    @cached_property
    def _inner_ends(self) -> tuple[Array, Array]:
        """(K+1,) the end of each piece nearer to 0 (0 itself for the pieces that touch it), and j there."""
        near, j_near = np.zeros(len(self.q)), np.zeros(len(self.q))
        for k in range(int(self.piece(0.0, +1)) + 1, len(self.q)):
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
        noise = 8 * np.finfo(float).eps * (self.terms(self.kinks, left) + self.terms(self.kinks, left + 1))
        return np.where(np.abs(jump) <= noise, BEND, np.sign(jump)).astype(np.int8)

    def numbers(self, piece: NDArray[np.intp]) -> tuple[Array, ...]:
        """(s_0, b_0, q, a, r) of the named pieces."""
        return tuple(x[piece] for x in (self.s_0, self.b_0, self.q, self.a, self.r))

    def terms(self, s: Array, piece: NDArray[np.intp]) -> Array:
        """Sum of the magnitudes that b_k(s) of the named pieces is made of: what rounding goes with (shape of s)."""
        return terms_of(s, *self.numbers(piece))

    @cached_property
    def omega(self) -> float:
        """Steepest fall ω = −inf (b(s₁)−b(s₂))/(s₁−s₂) ≥ 0 [Pa/m]; infinite with a down-jump (method §5).

        A piece's slope is monotone, so its ends decide, limits at ±∞ included.
        """
        if np.any(self.kinds == DOWN):
            return float("inf")
        pieces, ends, slopes = np.arange(len(self.q)), np.concatenate([[-np.inf], self.kinks, [np.inf]]), []
        for s in (ends[:-1], ends[1:]):
            finite = np.isfinite(s)
            slopes.append(np.where(finite, self.slope(np.where(finite, s, 0.0), pieces), self.q))
        return max(0.0, -float(np.min(slopes)))

    @cached_property
    def b_scale(self) -> float:
        """Largest |b| at the kinks and, where bounded, at infinity [Pa]; 0 for a law without either."""
        ends = [abs(float(self.b_0[k])) for k in (0, -1) if self.q[k] == 0.0]
        return float(np.max(np.abs(np.concatenate([self.b_left, self.b_right, ends])), initial=0.0))

    @cached_property
    def s_scale(self) -> float:
        """Slip over which b changes: least kink spacing or decay length [m]; 0 if the law has none."""
        lengths = np.concatenate([np.diff(self.kinks), 1.0 / np.abs(self.r[self.r != 0.0])])
        return float(lengths.min()) if len(lengths) else 0.0

    def scaled(self, s_unit: float, b_unit: float) -> FrictionLaw:
        """The same law with slips measured in s_unit and tractions in b_unit.

        Division rounds the kinks, so that a narrow piece changes its width: slope and rate follow, which keeps the
        values at its ends; two kinks that become one are a jump.
        """
        kinks = self.kinks / s_unit
        width, rounded = np.diff(self.kinks), np.diff(kinks) * s_unit
        stretch = np.ones(len(self.q))
        stretch[1:-1] = width / np.where(rounded > 0.0, rounded, width)
        kept = np.concatenate([[True], rounded > 0.0, [True]]) if len(kinks) else np.ones(1, dtype=bool)
        return FrictionLaw(
            self.name,
            kinks[kept[1:]] if len(kinks) else kinks,
            self.s_0[kept] / s_unit,
            self.b_0[kept] / b_unit,
            (self.q * stretch)[kept] * (s_unit / b_unit),
            self.a[kept] / b_unit,
            (self.r * stretch)[kept] * s_unit,
        )

    @cached_property
    def without_narrow_pieces(self) -> FrictionLaw:
        """The law with pieces of up to NARROW roundings of the slip as jumps; the law itself where there are none.

        No double lies inside the narrowest of them, so that a descent cannot come to rest there; on a jump it can.
        """
        narrow = narrow_pieces(self.kinks)
        if not np.any(narrow):
            return self
        kept = np.concatenate([[True], ~narrow, [True]])
        outer = np.append(narrow, False) & (self.kinks < 0.0)  # of the two ends the one nearer to 0 stays
        held = np.where(self.kinks < 0.0, ~outer, np.concatenate([[True], ~narrow]))
        arrays = (x[kept] for x in (self.s_0, self.b_0, self.q, self.a, self.r))
        return FrictionLaw(self.name, self.kinks[held], *arrays)

    def check_growth(self) -> None:
        """Raise GrowthError unless (15) and (16) hold: b eventually opposes slip and grows at most linearly."""
        arrays = (self.kinks, self.s_0, self.b_0, self.q, self.a, self.r)
        if not all(np.all(np.isfinite(x)) for x in arrays):
            raise GrowthError("the law has a value that is not finite, so |b(s)| ≤ C(1+|s|), eq. (16), fails")
        if np.any(np.diff(self.kinks) <= 0):
            raise GrowthError("the kinks of the law are not in increasing order of slip")
        for piece, sign, side in ((-1, 1.0, "s → +∞"), (0, -1.0, "s → −∞")):
            b_0, q, a = sign * self.b_0[piece], self.q[piece], sign * self.a[piece]
            rate = sign * self.r[piece]
            if a != 0.0 and rate < 0.0:
                raise GrowthError(f"b grows exponentially as {side}, so |b(s)| ≤ C(1+|s|), eq. (16), fails")
            if q < 0.0 or (q == 0.0 and (b_0 < 0.0 or (b_0 == 0.0 and a < 0.0))):
                raise GrowthError(
                    f"b ends with the wrong sign as {side} (last slope {q:g}, last value {sign * b_0:g}), "
                    "so eq. (15) fails: friction must not push the slip on for large |s|"
                )


def terms_of(s: Array, s_0: Array, b_0: Array, q: Array, a: Array, r: Array) -> Array:
    """Sum of the magnitudes that b_0 + q (s − s_0) + a exp(−r (s − s_0)) is made of: what rounding goes with [Pa]."""
    apart = s - s_0
    terms: Array = np.abs(b_0) + np.abs(q * apart)
    if not np.any(a):
        return terms
    rs = np.where(a == 0.0, 0.0, r * apart)
    return np.asarray(terms + np.abs(a) * np.exp(-rs) * (1.0 + np.abs(rs)))


def narrow_pieces(kinks: Array) -> NDArray[np.bool_]:
    """Whether a piece between kinks (…, K) is no wider than NARROW roundings of the slip (…, K−1)."""
    with np.errstate(invalid="ignore"):  # of kinks at infinity, behind the last of a law
        return np.diff(kinks) <= NARROW * np.spacing(np.maximum(np.abs(kinks[..., :-1]), np.abs(kinks[..., 1:])))


def decay_integral(s_0: Array, a: Array, r: Array, x: Array, y: Array) -> Array:
    """∫_x^y of a exp(−r (s − s_0)), all of one shape [Pa·m]."""
    step = y - x
    # from the end where the exponential is larger, so that expm1 cannot overflow
    larger = np.where(r * step >= 0.0, x, y)
    decay = np.abs(r * step)
    length = np.where(decay == 0.0, step, step * -np.expm1(-decay) / np.where(decay == 0.0, 1.0, decay))
    return np.asarray(a * np.exp(-r * (larger - s_0)) * length)
