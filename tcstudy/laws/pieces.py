"""Pieces of friction laws −S_T ∈ b̂(u_T): values, integrals and slopes by address.

Law:        b piecewise smooth with finitely many kinks; b̂(s) fills its jumps vertically, eq. (4)
Primitive:  j(s) = ∫₀ˢ b(t) dt, exact, eq. (17)
Growth:     eqs. (15) and (16)
Literature: Šestak & Jovanović, Appl. Math. Mech. 31 (2010),
            doi 10.3879/j.issn.1000-0887.2010.01.008

A law is K kinks and K + 1 pieces, piece k being

    b_k(s) = b0_k + q_k (s − s0_k) + a_k exp(−r_k (s − s0_k))        between kink k−1 and kink k,

which contains piecewise-linear laws (a = 0) and exponential decay in closed form. Where edges with
different laws meet, a piece may have a second exponential. b′ is monotone on every piece. A piece
is anchored at s0_k, as a rule one of its ends, because the difference s − s0_k is exact where it
matters: a piece a few roundings wide keeps the values at both ends, where p + q s would have lost
all digits.

Many laws are padded tables, one row per law. An index says which of them a node, or a row and node,
has. A piece is named by its address, law·(K+1) + piece, so that values of a thousand laws cost as
much as values of one. A kink has the address of the piece to its left. The numbers may be complex,
with a derivative in their imaginary parts (`composed`).

Ray: a closed law is of slips that cannot be below its first kink, b̂(s_1) = (−∞, b(s_1 + 0)], as of
an opening under non-penetration. The piece to the left of that kink has b_0 = −∞ and no slope: no
slip of a solution is on it, j is +∞ there, and no scale, slope or growth of the law knows it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]
Slips = Array | float

UP, BEND, DOWN = 1, 0, -1
"""Kinds of kink: up-jump (convex kink of j, sticking), change of slope only, down-jump
(concave)."""

REGIONS = ("bare", "elastic", "yielded", "softening", "debonded")
BARE, ELASTIC, YIELDED, SOFTENING, DEBONDED = range(len(REGIONS))
"""Regimes of a law on its pieces, outwards from s = 0.

bare:      b is 0
elastic:   the initial branch, on which b rises from 0
softening: b falls
debonded:  b has fallen and does not fall on this piece or further out
yielded:   any other piece: a plateau, hardening, or a part before the first fall
"""

NARROW = 32.0
"""Largest width of a narrow piece in roundings of the slip (`Laws.without_narrow_pieces`)."""
ROUNDINGS = 8 * np.finfo(float).eps
"""Rounding error of b relative to the magnitudes of its terms (`LawPieces.terms`)."""


class GrowthError(ValueError):
    """The law violates growth condition (15) or (16); the text says where and why."""


class Place(NamedTuple):
    """Where slips sit.

    piece: address of the piece that holds the slip, on a kink of the one to its left
    on:    the slip is equal to a kink; the piece to its right is `piece` + 1 there
    """

    piece: Index
    on: Flags

    def toward(self, right: Flags) -> Index:
        """Return the address of the piece to the right where `right` is True, else to the left."""
        return self.piece + (self.on & right)


if TYPE_CHECKING:
    Fact = cached_property
else:

    class Fact:
        """A property of the tables alone, computed once for all records that share them."""

        def __init__(self, function):
            self.function = function
            self.name = function.__name__
            self.__doc__ = function.__doc__

        def __get__(self, laws, owner=None):
            if laws is None:
                return self
            if self.name not in laws.facts:
                laws.facts[self.name] = self.function(laws)
            vars(laws)[self.name] = laws.facts[self.name]
            return laws.facts[self.name]


@dataclass(frozen=True, eq=False)
class LawPieces:
    """The pieces of friction laws, by address.

    name:     the shape's name, for reports
    kinks:    (…, K) slips at which b jumps or bends, strictly increasing, +∞ behind the last of a
              law with fewer [m]
    s_0:      (…, K+1) anchor of each piece: an end of it, or another slip not far from it [m]
    b_0, q:   (…, K+1) value of the linear part of each piece at its anchor [Pa], its slope [Pa/m]
    a, r:     (…, K+1) amplitude of the exponential part at the anchor [Pa], its rate [1/m]
    a_2, r_2: the same of a second exponential, None where no piece has one
    """

    name: str
    kinks: Array
    s_0: Array
    b_0: Array
    q: Array
    a: Array
    r: Array
    a_2: Array | None = None
    r_2: Array | None = None
    facts: dict[str, Any] = field(default_factory=dict, repr=False, init=False)

    @property
    def one(self) -> bool:
        """True for one law that all slips have."""
        return self.kinks.ndim == 1

    @property
    def pieces(self) -> tuple[Array, ...]:
        """The columns s_0, b_0, q, a, r, and a_2, r_2 where a piece has a second exponential."""
        first = (self.s_0, self.b_0, self.q, self.a, self.r)
        return first if self.a_2 is None or self.r_2 is None else (*first, self.a_2, self.r_2)

    @Fact
    def _bytes(self) -> tuple[Any, ...]:
        """Name and bytes of the arrays; adding 0.0 makes −0.0 and 0.0 one number."""
        arrays = [np.asarray(column, dtype=float) + 0.0 for column in (self.kinks, *self.pieces)]
        known_facts = [self.facts[name] for name in self.facts.get("known", ())]
        contents = [array.tobytes() for array in (*arrays, *known_facts)]
        return (self.name, self.kinks.shape, *contents)

    @Fact
    def outside(self) -> Flags:
        """(…, K+1) pieces to the left of a ray, where there is no b."""
        return np.isneginf(np.real(self.b_0))

    @Fact
    def closed(self) -> Flags:
        """(…) laws whose first kink is the left end of their domain: b̂ reaches to −∞ there."""
        return np.asarray(self.outside[..., 0])

    @Fact
    def has_rays(self) -> bool:
        """Whether some law is closed."""
        return bool(np.any(self.closed))

    @Fact
    def _levels(self) -> Array:
        """(…, K+1) |b_0|; −∞ is exact, and counts as 0."""
        return np.where(self.outside, 0.0, np.abs(self.b_0))

    @Fact
    def exponentials(self) -> tuple[tuple[Array, Array], ...]:
        """(a, r) of the exponentials that some piece has."""
        pairs = [(self.a, self.r)]
        if self.a_2 is not None and self.r_2 is not None:
            pairs.append((self.a_2, self.r_2))
        return tuple((a, r) for a, r in pairs if np.any(a))

    @property
    def piecewise_linear(self) -> bool:
        """True if no piece has an exponential part."""
        return not self.exponentials

    @Fact
    def bent(self) -> Flags:
        """(…, K+1) pieces with an exponential part."""
        none = np.zeros(self.q.shape, dtype=bool)
        return np.asarray(sum((a != 0.0 for a, _ in self.exponentials), none))

    @Fact
    def rate(self) -> Array:
        """(…, K+1) |r| of the exponential that decays most slowly, 0 where there is none [1/m]."""
        rates = [np.where(a != 0.0, np.abs(r), np.inf) for a, r in self.exponentials]
        lowest = np.min([np.full(self.q.shape, np.inf), *rates], axis=0)
        return np.where(np.isfinite(lowest), lowest, 0.0)

    @Fact
    def concave(self) -> Flags:
        """(…, K+1) pieces on which b″ < 0; b″ has one sign on each."""
        if self.a_2 is None:
            return np.asarray(self.a < 0.0)
        has_lower = np.isfinite(self.lower)
        has_upper = np.isfinite(self.upper)
        decay_length = 1.0 / np.where(self.rate > 0.0, self.rate, 1.0)
        inside = np.where(has_upper, self.upper - decay_length, self.s_0)
        inside = np.where(has_lower, self.lower + decay_length, inside)
        bounded = has_lower & has_upper
        inside[bounded] = 0.5 * (self.lower[bounded] + self.upper[bounded])
        return np.asarray(self.bend(inside, self.addresses) < 0.0)

    @Fact
    def lower(self) -> Array:
        """(…, K+1) left end of every piece [m]."""
        infinity = np.full((*self.q.shape[:-1], 1), np.inf)
        return np.concatenate([-infinity, self.kinks], axis=-1)

    @Fact
    def upper(self) -> Array:
        """(…, K+1) right end of every piece [m]."""
        infinity = np.full((*self.q.shape[:-1], 1), np.inf)
        return np.concatenate([self.kinks, infinity], axis=-1)

    @Fact
    def first(self) -> Index:
        """(L,) address of every law's first piece."""
        n_pieces = self.q.shape[-1]
        return np.arange(self.q.size // n_pieces, dtype=np.intp) * n_pieces

    @Fact
    def addresses(self) -> Index:
        """(…, K+1) addresses of all pieces."""
        return np.arange(self.q.size, dtype=np.intp).reshape(self.q.shape)

    @Fact
    def _beside(self) -> tuple[Array, Array, Array]:
        """(…, K+1) each: b left and right of the kink at the end of every piece, and its rounding.

        b is 0 where a piece does not end.
        """
        has_kink = np.isfinite(self.upper)
        s = np.where(has_kink, self.upper, self.s_0)
        limits = []
        magnitude = np.zeros(self.q.shape)
        for address in (self.addresses, self.addresses + has_kink):
            limits.append(np.where(has_kink, self.value(s, address), 0.0))
            magnitude += self.terms(s, address)
        return limits[0], limits[1], ROUNDINGS * magnitude

    @property
    def b_left(self) -> Array:
        """(…, K) left limits of b at the kinks, 0 at infinity [Pa]."""
        return self._beside[0][..., :-1]

    @property
    def b_right(self) -> Array:
        """(…, K) right limits of b at the kinks, 0 at infinity [Pa]."""
        return self._beside[1][..., :-1]

    @Fact
    def kind_above(self) -> NDArray[np.int8]:
        """(…, K+1) kind of the kink at the right end of every piece.

        BEND where b is continuous to rounding, else UP or DOWN.
        """
        left, right, rounding = self._beside
        jump = np.real(right - left)
        return np.where(np.abs(jump) <= rounding, BEND, np.sign(jump)).astype(np.int8)

    @property
    def kinds(self) -> NDArray[np.int8]:
        """(…, K) kind of every kink: UP, BEND or DOWN."""
        return self.kind_above[..., :-1]

    @Fact
    def end_slopes(self) -> Array:
        """(2, …, K+1) b′ at both ends of every piece, limits at ±∞ included [Pa/m].

        They bound b′ in between.
        """
        slopes = []
        for ends in (self.lower, self.upper):
            is_finite = np.isfinite(ends)
            s = np.where(is_finite, ends, self.s_0)
            slope = np.where(is_finite, self.slope(s, self.addresses), self.q)
            slopes.append(np.where(self.outside, np.inf, slope))
        return np.stack(slopes)

    @Fact
    def falls(self) -> Array:
        """(…) maximum softening slope ω = −inf (b(s₁)−b(s₂))/(s₁−s₂) ≥ 0 [Pa/m].

        It is infinite with a sudden drop (method §5).
        """
        steepest = 0.0 + np.maximum(0.0, -np.min(self.end_slopes, axis=(0, -1)))
        has_drop = np.any(self.kinds == DOWN, axis=-1)
        return np.asarray(np.where(has_drop, np.inf, steepest))

    @Fact
    def regions(self) -> NDArray[np.int8]:
        """(…, K+1) which of REGIONS every piece is."""
        nearest = np.clip(0.0, self.lower, self.upper)  # the slip of every piece nearest to 0
        nearest = np.where(np.isfinite(nearest), nearest, self.s_0)
        value = self.value(nearest, self.addresses)
        rounding = ROUNDINGS * self.terms(nearest, self.addresses)

        softens = self.end_slopes.sum(axis=0) < 0.0  # b′ is monotone on a piece
        flat = np.all(self.end_slopes == 0.0, axis=0)
        regions = np.where(flat & (value == 0.0), BARE, YIELDED).astype(np.int8)
        regions[(nearest == 0.0) & (np.abs(value) <= rounding) & ~flat] = ELASTIC
        regions[softens] = SOFTENING
        for sign, side in ((1, self.lower >= 0.0), (-1, self.upper <= 0.0)):
            regions[self._past_all_falls(softens & side, sign) & side] = DEBONDED
        return regions

    def _past_all_falls(self, softens: Flags, sign: int) -> Flags:
        """Return (…, K+1) pieces on which b has fallen and does not fall any more.

        softens: (…, K+1) pieces of the side on which b falls
        sign:    of the slips of that side
        """
        outwards = (..., slice(None, None, sign))
        drops = (self.kinds == DOWN) & (sign * self.kinks >= 0.0)
        softens, drops = softens[outwards], drops[outwards]
        none = np.zeros((*drops.shape[:-1], 1), dtype=bool)
        falls_before = np.append(none, softens[..., :-1] | drops, axis=-1)
        falls_after = np.append(drops, none, axis=-1) | softens
        has_fallen = np.logical_or.accumulate(falls_before, axis=-1)
        falls_on = np.logical_or.accumulate(falls_after[..., ::-1], axis=-1)[..., ::-1]
        return np.asarray((has_fallen & ~falls_on)[outwards])

    @Fact
    def scales(self) -> Array:
        """(…) largest |b| at the kinks and, where bounded, at infinity; 0 without either [Pa].

        A ray is left out.
        """
        limits = []
        for k in (0, -1):
            is_bounded = self.q[..., k] == 0.0
            limits.append(np.where(is_bounded, self._levels[..., k], 0.0)[..., None])
        b_left = np.where(self.outside[..., :-1], 0.0, self.b_left)
        b = np.concatenate([b_left, self.b_right, *limits], axis=-1)
        return np.asarray(np.max(np.abs(b), axis=-1))

    def value(self, s: Slips, piece: Index | int) -> Array:
        """Return b of the addressed pieces, also where s lies outside them [Pa]."""
        piece = np.asarray(piece)
        distance = s - self.s_0.take(piece)
        value: Array = self.b_0.take(piece) + self.q.take(piece) * distance
        for a, r in self.exponentials:
            value = value + _decay(a, r, distance, piece)
        return value

    def numbers(self, piece: Index) -> tuple[Array, ...]:
        """Return the columns `pieces` at the addressed pieces."""
        return tuple(column.take(piece) for column in self.pieces)

    def terms(self, s: Array, piece: Index) -> Array:
        """Return the sum of the magnitudes of the terms of b, the scale of its rounding [Pa]."""
        distance = s - self.s_0.take(piece)
        magnitude = self._levels.take(piece) + np.abs(self.q.take(piece) * distance)
        for a, r in self.exponentials:
            decay = np.abs(_decay(a, r, distance, piece))
            magnitude += decay * (1.0 + np.abs(r.take(piece) * distance))
        return np.asarray(magnitude)

    def slope(self, s: Slips, piece: Index | int) -> Array:
        """Return b′ of the addressed pieces [Pa/m]."""
        piece = np.asarray(piece)
        distance = s - self.s_0.take(piece)
        slope: Array = self.q.take(piece) + 0.0 * distance
        for a, r in self.exponentials:
            slope = slope - r.take(piece) * _decay(a, r, distance, piece)
        return slope

    def bend(self, s: Array, piece: Index) -> Array:
        """Return b″ of the addressed pieces [Pa/m²]."""
        distance = s - self.s_0.take(piece)
        bend: Array = 0.0 * s
        for a, r in self.exponentials:
            bend = bend + r.take(piece) ** 2 * _decay(a, r, distance, piece)
        return np.asarray(bend)

    def kink(self, address: Index) -> Array:
        """Return the slips of the addressed kinks, ∞ without one [m]."""
        return self.upper.take(address)

    def limits(self, address: Index) -> tuple[Array, Array]:
        """Return the (left, right) limits of b at the addressed kinks [Pa]."""
        left, right, _ = self._beside
        return left.take(address), right.take(address)

    def ends(self, piece: Index) -> tuple[Array, Array]:
        """Return the (left, right) ends of the addressed pieces [m]."""
        return self.lower.take(piece), self.upper.take(piece)

    def end_values(self, piece: Index) -> tuple[Array, Array]:
        """Return b at the left and the right end of the addressed pieces, NaN at infinity [Pa]."""
        lower, upper = self.ends(piece)
        left = self.value(np.where(np.isfinite(lower), lower, np.nan), piece)
        right = self.value(np.where(np.isfinite(upper), upper, np.nan), piece)
        return left, right

    def kind(self, place: Place) -> NDArray[np.int8]:
        """Return UP, BEND or DOWN where a slip sits on a kink, BEND elsewhere."""
        return np.where(place.on, self.kind_above.take(place.piece), np.int8(BEND))

    def next_up_jump(self, place: Place, direction: Array | float) -> Array:
        """Return the first up-jump strictly beyond the slips in the sign of `direction` [m].

        It is ±∞ if there is none.
        """
        before, after = self._up_jumps
        forward = np.asarray(direction) > 0.0
        return np.where(forward, after.take(place.piece + place.on), before.take(place.piece))

    @Fact
    def _up_jumps(self) -> tuple[Array, Array]:
        """(…, K+1) each: last up-jump up to a piece's left end, first from its right end on.

        ∓∞ if there is none.
        """
        jumps = np.where(self.kinds == UP, self.kinks, np.nan)
        infinity = np.full((*jumps.shape[:-1], 1), np.inf)
        up_to_lower = np.concatenate([-infinity, jumps], axis=-1)
        from_upper = np.concatenate([jumps, infinity], axis=-1)
        before = np.fmax.accumulate(up_to_lower, axis=-1)
        after = np.fmin.accumulate(from_upper[..., ::-1], axis=-1)[..., ::-1]
        return before, np.ascontiguousarray(after)

    def piece_integral(self, piece: Index | int, x: Slips, y: Slips) -> Array:
        """Return ∫_x^y b of the addressed pieces, accurate for small y − x [Pa·m]."""
        piece = np.asarray(piece)
        x = np.asarray(x)
        y = np.asarray(y)
        step = y - x
        s_0 = self.s_0.take(piece)
        mean = self.b_0.take(piece) + self.q.take(piece) * (x - s_0 + 0.5 * step)
        total: Array = step * mean
        for a, r in self.exponentials:
            total = total + _decay_integral(s_0, a.take(piece), r.take(piece), x, y)
        return total

    @Fact
    def primitive(self) -> tuple[Array, Array]:
        """(…, K+1) each: ∫ b from the kink next to 0 to the left and right end of every piece.

        The outer pieces count as 0. Summed outwards, so that it is even to the bit for an odd law.
        """
        is_inner = np.isfinite(self.lower) & np.isfinite(self.upper)
        is_right = np.real(self.upper) > 0.0
        x = np.where(is_inner, self.lower, 0.0)
        y = np.where(is_inner, self.upper, 0.0)
        with np.errstate(invalid="ignore"):  # to the left of a ray
            integral = np.where(is_inner, self.piece_integral(self.addresses, x, y), 0.0)
        right = np.cumsum(np.where(is_right, integral, 0.0), axis=-1)
        left = np.cumsum(np.where(is_right, 0.0, integral)[..., ::-1], axis=-1)[..., ::-1]
        none = np.zeros((*integral.shape[:-1], 1))
        to_lower = np.concatenate([none, right[..., :-1]], axis=-1) - left
        to_upper = right - np.concatenate([left[..., 1:], none], axis=-1)
        return to_lower, to_upper

    def check_growth(self) -> None:
        """Raise GrowthError unless (15) and (16) hold.

        They say that b eventually opposes slip and grows at most linearly. A ray does so at −∞.
        """
        columns = (self.kinks, *self.pieces, self._levels)
        is_finite = [np.all(np.isfinite(column)) for column in columns if column is not self.b_0]
        if not all(is_finite):
            raise GrowthError(
                "the law has a value that is not finite, so |b(s)| ≤ C(1+|s|), eq. (16), fails"
            )
        if np.any(np.diff(self.kinks) <= 0):
            raise GrowthError("the kinks of the law are not in increasing order of slip")
        sides = [(-1, 1.0, "s → +∞"), (0, -1.0, "s → −∞")]
        for piece, sign, side in sides[: 1 if self.has_rays else 2]:
            b_0 = sign * self.b_0[piece]
            q = self.q[piece]
            tails = [
                (sign * r[piece], sign * a[piece]) for a, r in self.exponentials if a[piece] != 0.0
            ]
            if any(rate < 0.0 for rate, _ in tails):
                raise GrowthError(
                    f"b grows exponentially as {side}, so |b(s)| ≤ C(1+|s|), eq. (16), fails"
                )
            _, slowest_amplitude = min(tails, default=(0.0, 0.0))
            wrong_limit = b_0 < 0.0 or (b_0 == 0.0 and slowest_amplitude < 0.0)
            if q < 0.0 or (q == 0.0 and wrong_limit):
                raise GrowthError(
                    f"b ends with the wrong sign as {side} (last slope {q:g}, "
                    f"last value {sign * b_0:g}), so eq. (15) fails: b must oppose large slip"
                )


def _decay(amplitudes: Array, rates: Array, distance: Any, piece: Index) -> Array:
    """Return a exp(−r (s − s_0)), 0 where a = 0."""
    a = amplitudes.take(piece)
    exponent = np.where(a != 0.0, -rates.take(piece) * distance, 0.0)
    return np.asarray(a * np.exp(exponent))


def _decay_integral(s_0: Array, a: Array, r: Array, x: Array, y: Array) -> Array:
    """Return ∫_x^y of a exp(−r (s − s_0)), all of one shape [Pa·m]."""
    step = y - x
    # from the end where the exponential is larger, so that expm1 cannot overflow
    falls = np.real(r * step) >= 0.0
    start = np.where(falls, x, y)
    decay = np.where(falls, r * step, -r * step)
    divisor = np.where(decay == 0.0, 1.0, decay)
    length = np.where(decay == 0.0, step, step * -np.expm1(-decay) / divisor)
    return np.asarray(a * np.exp(-r * (start - s_0)) * length)
