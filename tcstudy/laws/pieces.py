"""Friction laws −S_T ∈ b̂(u_T) as one record: of one law, of a law a node, of a law a row and node.

Law:        b piecewise smooth with finitely many kinks; b̂(s) fills its jumps vertically, eq. (4)
Primitive:  j(s) = ∫₀ˢ b(t) dt, exact, eq. (17)
Growth:     eqs. (15) and (16)
Literature: Šestak & Jovanović, Appl. Math. Mech. 31 (2010), doi 10.3879/j.issn.1000-0887.2010.01.008

A law is K kinks and K + 1 pieces, piece k being

    b_k(s) = b0_k + q_k (s − s0_k) + a_k exp(−r_k (s − s0_k))        between kink k−1 and kink k,

which contains piecewise-linear laws (a = 0) and exponential decay in closed form; where edges with
different laws meet a piece may have a second exponential. b′ is monotone on every piece. A piece
hangs on its anchor s0_k, as a rule one of its ends, because the difference s − s0_k is exact where
it matters: a piece a few roundings wide keeps the values at both ends, where p + q s would have
lost all digits.

Many laws are padded tables, one row a law; an index says which of them a node, or a row and node,
has. A piece is named by its address, law·(K+1) + piece, so that values of a thousand laws cost what
values of one do; a kink has the address of the piece to its left. The numbers may be complex, with
a derivative in their imaginary parts (`composed`).
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
"""What a law does on a piece, outwards from s = 0: it is 0; it rises from 0 along its first piece;
it does neither that nor fall, and falls further out or nowhere; it falls; it has fallen and does
not fall any more."""

NARROW = 32.0
"""Roundings of the slip up to which a piece is narrow (`Laws.without_narrow_pieces`)."""


class GrowthError(ValueError):
    """The law violates growth condition (15) or (16); the text says where and why."""


class Place(NamedTuple):
    """Where slips sit.

    piece: address of the piece that holds the slip, on a kink of the one to its left
    on:    the slip sits bitwise on a kink; the piece to its right is `piece` + 1 there
    """

    piece: Index
    on: Flags

    def toward(self, right: Flags) -> Index:
        """Address of the piece to the right where `right` is True, else to the left."""
        return self.piece + (self.on & right)


if TYPE_CHECKING:
    Fact = cached_property
else:

    class Fact:
        """What is known of the tables alone: made once for all records that share them."""

        def __init__(self, function):
            self.function, self.name, self.__doc__ = function, function.__name__, function.__doc__

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
    kinks:    (…, K) slips at which b jumps or bends, strictly increasing, +∞ behind the last of a law with fewer [m]
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
        """True for one law for all."""
        return self.kinks.ndim == 1

    @property
    def pieces(self) -> tuple[Array, ...]:
        """s_0, b_0, q, a, r, and a_2, r_2 where there are some."""
        first = (self.s_0, self.b_0, self.q, self.a, self.r)
        return first if self.a_2 is None or self.r_2 is None else (*first, self.a_2, self.r_2)

    @Fact
    def _bytes(self) -> tuple[Any, ...]:
        """Name and bytes of the arrays; adding 0.0 makes −0.0 and 0.0 one number."""
        arrays = (np.asarray(x, dtype=float) + 0.0 for x in (self.kinks, *self.pieces))
        known = (self.facts[name].tobytes() for name in self.facts.get("known", ()))
        return (self.name, self.kinks.shape, *(x.tobytes() for x in arrays), *known)

    @Fact
    def exponentials(self) -> tuple[tuple[Array, Array], ...]:
        """(a, r) of the exponentials that some piece has."""
        pairs = (
            (self.a, self.r),
            *([(self.a_2, self.r_2)] if self.a_2 is not None and self.r_2 is not None else []),
        )
        return tuple((a, r) for a, r in pairs if np.any(a))

    @property
    def piecewise_linear(self) -> bool:
        """True if no piece has an exponential part."""
        return not self.exponentials

    @Fact
    def bent(self) -> Flags:
        """(…, K+1) pieces with an exponential part."""
        return np.asarray(
            sum((a != 0.0 for a, _ in self.exponentials), np.zeros(self.q.shape, dtype=bool))
        )

    @Fact
    def rate(self) -> Array:
        """(…, K+1) |r| of the exponential that decays most slowly, 0 where there is none [1/m]."""
        rates = [np.where(a != 0.0, np.abs(r), np.inf) for a, r in self.exponentials]
        least = np.min([np.full(self.q.shape, np.inf), *rates], axis=0)
        return np.where(np.isfinite(least), least, 0.0)

    @Fact
    def concave(self) -> Flags:
        """(…, K+1) pieces on which b″ < 0, which has one sign on each."""
        if self.a_2 is None:
            return np.asarray(self.a < 0.0)
        low, high, apart = self.lower, self.upper, 1.0 / np.where(self.rate > 0.0, self.rate, 1.0)
        inside = np.where(
            np.isfinite(low), low + apart, np.where(np.isfinite(high), high - apart, self.s_0)
        )
        both = np.isfinite(low) & np.isfinite(high)
        inside[both] = 0.5 * (low[both] + high[both])
        return np.asarray(self.bend(inside, self.addresses) < 0.0)

    @Fact
    def lower(self) -> Array:
        """(…, K+1) left end of every piece [m]."""
        return np.concatenate([np.full((*self.q.shape[:-1], 1), -np.inf), self.kinks], axis=-1)

    @Fact
    def upper(self) -> Array:
        """(…, K+1) right end of every piece [m]."""
        return np.concatenate([self.kinks, np.full((*self.q.shape[:-1], 1), np.inf)], axis=-1)

    @Fact
    def first(self) -> Index:
        """(L,) address of every law's first piece."""
        return np.arange(self.q.size // self.q.shape[-1], dtype=np.intp) * self.q.shape[-1]

    @Fact
    def addresses(self) -> Index:
        """(…, K+1) of all pieces."""
        return np.arange(self.q.size, dtype=np.intp).reshape(self.q.shape)

    @Fact
    def _beside(self) -> tuple[Array, Array, Array]:
        """(…, K+1) each: b left and right of the kink at the end of every piece, 0 without one, and
        their rounding."""
        real = np.isfinite(self.upper)
        s, found, noise = np.where(real, self.upper, self.s_0), [], np.zeros(self.q.shape)
        for address in (self.addresses, self.addresses + real):
            found.append(np.where(real, self.value(s, address), 0.0))
            noise += self.terms(s, address)
        return found[0], found[1], 8 * np.finfo(float).eps * noise

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
        """(…, K+1) UP, BEND where b is continuous to rounding, or DOWN: of the kink at the right
        end of every piece."""
        left, right, noise = self._beside
        jump = np.real(right - left)
        return np.where(np.abs(jump) <= noise, BEND, np.sign(jump)).astype(np.int8)

    @property
    def kinds(self) -> NDArray[np.int8]:
        """(…, K) UP, BEND or DOWN."""
        return self.kind_above[..., :-1]

    @Fact
    def end_slopes(self) -> Array:
        """(2, …, K+1) b′ at both ends of every piece, which bound it in between, limits at ±∞
        included [Pa/m]."""
        finite = [np.isfinite(ends) for ends in (self.lower, self.upper)]
        at = [
            np.where(known, s, self.s_0)
            for known, s in zip(finite, (self.lower, self.upper), strict=True)
        ]
        slopes = (self.slope(s, self.addresses) for s in at)
        return np.stack(
            [np.where(known, b, self.q) for known, b in zip(finite, slopes, strict=True)]
        )

    @Fact
    def falls(self) -> Array:
        """(…) steepest fall ω = −inf (b(s₁)−b(s₂))/(s₁−s₂) ≥ 0; infinite with a down-jump (method
        §5) [Pa/m]."""
        steepest = 0.0 + np.maximum(0.0, -np.min(self.end_slopes, axis=(0, -1)))
        return np.asarray(np.where(np.any(self.kinds == DOWN, axis=-1), np.inf, steepest))

    @Fact
    def regions(self) -> NDArray[np.int8]:
        """(…, K+1) which of REGIONS every piece is."""
        slopes, zero = self.end_slopes, np.clip(0.0, self.lower, self.upper)
        zero = np.where(np.isfinite(zero), zero, self.s_0)
        value, noise = (
            self.value(zero, self.addresses),
            8 * np.finfo(float).eps * self.terms(zero, self.addresses),
        )
        softens, flat = (
            slopes.sum(axis=0) < 0.0,
            np.all(slopes == 0.0, axis=0),
        )  # b′ is monotone on a piece
        found = np.where(flat & (value == 0.0), BARE, YIELDED).astype(np.int8)
        found[(zero == 0.0) & (np.abs(value) <= noise) & ~flat] = ELASTIC
        found[softens] = SOFTENING
        for outwards, side in ((1, self.lower >= 0.0), (-1, self.upper <= 0.0)):
            turn = (..., slice(None, None, outwards))
            ends = (self.kinds == DOWN) & (outwards * self.kinks >= 0.0)
            falls, ends = (softens & side)[turn], ends[turn]
            none = np.zeros((*ends.shape[:-1], 1), dtype=bool)
            inside = np.logical_or.accumulate(
                np.append(none, falls[..., :-1] | ends, axis=-1), axis=-1
            )
            beyond = np.append(ends, none, axis=-1) | falls
            beyond = np.logical_or.accumulate(beyond[..., ::-1], axis=-1)[..., ::-1]
            found[(inside & ~beyond)[turn] & side] = DEBONDED
        return found

    @Fact
    def scales(self) -> Array:
        """(…) largest |b| at the kinks and, where bounded, at infinity; 0 for a law without either
        [Pa]."""
        ends = [
            np.where(self.q[..., k] == 0.0, np.abs(self.b_0[..., k]), 0.0)[..., None]
            for k in (0, -1)
        ]
        return np.asarray(
            np.max(np.abs(np.concatenate([self.b_left, self.b_right, *ends], axis=-1)), axis=-1)
        )

    def value(self, s: Slips, piece: Index | int) -> Array:
        """b of the addressed pieces, without asking whether s lies in them [Pa]."""
        piece = np.asarray(piece)
        apart = s - self.s_0.take(piece)
        value: Array = self.b_0.take(piece) + self.q.take(piece) * apart
        for a, r in self.exponentials:
            value = value + _decay(a, r, apart, piece)
        return value

    def numbers(self, piece: Index) -> tuple[Array, ...]:
        """`pieces` of the addressed pieces."""
        return tuple(x.take(piece) for x in self.pieces)

    def terms(self, s: Array, piece: Index) -> Array:
        """Sum of the magnitudes that b of the addressed pieces is made of: what rounding goes with
        [Pa]."""
        apart = s - self.s_0.take(piece)
        terms = np.abs(self.b_0.take(piece)) + np.abs(self.q.take(piece) * apart)
        for a, r in self.exponentials:
            terms += np.abs(_decay(a, r, apart, piece)) * (1.0 + np.abs(r.take(piece) * apart))
        return np.asarray(terms)

    def slope(self, s: Slips, piece: Index | int) -> Array:
        """b′ of the addressed pieces [Pa/m]."""
        piece = np.asarray(piece)
        apart = s - self.s_0.take(piece)
        slope: Array = self.q.take(piece) + 0.0 * apart
        for a, r in self.exponentials:
            slope = slope - r.take(piece) * _decay(a, r, apart, piece)
        return slope

    def bend(self, s: Array, piece: Index) -> Array:
        """b″ of the addressed pieces [Pa/m²]."""
        apart = s - self.s_0.take(piece)
        return np.asarray(
            sum(
                (r.take(piece) ** 2 * _decay(a, r, apart, piece) for a, r in self.exponentials),
                0.0 * s,
            )
        )

    def kink(self, address: Index) -> Array:
        """Slips of the named kinks, ∞ without one [m]."""
        return self.upper.take(address)

    def limits(self, address: Index) -> tuple[Array, Array]:
        """(left, right) limits of b at the named kinks [Pa]."""
        left, right, _ = self._beside
        return left.take(address), right.take(address)

    def ends(self, piece: Index) -> tuple[Array, Array]:
        """(left, right) ends of the addressed pieces [m]."""
        return self.lower.take(piece), self.upper.take(piece)

    def end_values(self, piece: Index) -> tuple[Array, Array]:
        """Return b at the left and the right end of the addressed pieces, NaN at infinity [Pa]."""
        ends = (np.where(np.isfinite(end), end, np.nan) for end in self.ends(piece))
        left, right = (self.value(end, piece) for end in ends)
        return left, right

    def kind(self, at: Place) -> NDArray[np.int8]:
        """UP, BEND or DOWN where a slip sits on a kink, BEND elsewhere."""
        return np.where(at.on, self.kind_above.take(at.piece), np.int8(BEND))

    def next_up_jump(self, at: Place, direction: Array | float) -> Array:
        """First up-jump strictly beyond the slips at `at` in the sign of `direction`, ±∞ if there
        is none [m]."""
        before, after = self._up_jumps
        return np.where(
            np.asarray(direction) > 0.0, after.take(at.piece + at.on), before.take(at.piece)
        )

    @Fact
    def _up_jumps(self) -> tuple[Array, Array]:
        """(…, K+1) each: last up-jump up to the left end of every piece, first from its right end
        on; ∓∞ if none."""
        jumps = np.where(self.kinds == UP, self.kinks, np.nan)
        edge = np.full((*jumps.shape[:-1], 1), np.inf)
        before = np.fmax.accumulate(np.concatenate([-edge, jumps], axis=-1), axis=-1)
        after = np.fmin.accumulate(np.concatenate([jumps, edge], axis=-1)[..., ::-1], axis=-1)[
            ..., ::-1
        ]
        return before, np.ascontiguousarray(after)

    def piece_integral(self, piece: Index | int, x: Slips, y: Slips) -> Array:
        """∫_x^y b of the addressed pieces, accurate for small y − x [Pa·m]."""
        piece, x, y = np.asarray(piece), np.asarray(x), np.asarray(y)
        step, s_0 = y - x, self.s_0.take(piece)
        total: Array = step * (self.b_0.take(piece) + self.q.take(piece) * (x - s_0 + 0.5 * step))
        for a, r in self.exponentials:
            total = total + _decay_integral(s_0, a.take(piece), r.take(piece), x, y)
        return total

    @Fact
    def primitive(self) -> tuple[Array, Array]:
        """(…, K+1) each: ∫ b to the left and to the right end of every piece, 0 outside, from the
        kink next to 0.

        Summed outwards, so that it is even to the bit for an odd law.
        """
        lower, upper = self.lower, self.upper
        inner, right = np.isfinite(lower) & np.isfinite(upper), np.real(upper) > 0.0
        x, y = np.where(inner, lower, 0.0), np.where(inner, upper, 0.0)
        part = np.where(inner, self.piece_integral(self.addresses, x, y), 0.0)
        after = np.cumsum(np.where(right, part, 0.0), axis=-1)
        before = np.cumsum(np.where(right, 0.0, part)[..., ::-1], axis=-1)[..., ::-1]
        none = np.zeros((*part.shape[:-1], 1))
        start = np.concatenate([none, after[..., :-1]], axis=-1)
        return start - before, after - np.concatenate([before[..., 1:], none], axis=-1)

    def check_growth(self) -> None:
        """Raise GrowthError unless (15) and (16) hold: b eventually opposes slip and grows at most
        linearly."""
        if not all(np.all(np.isfinite(x)) for x in (self.kinks, *self.pieces)):
            raise GrowthError(
                "the law has a value that is not finite, so |b(s)| ≤ C(1+|s|), eq. (16), fails"
            )
        if np.any(np.diff(self.kinks) <= 0):
            raise GrowthError("the kinks of the law are not in increasing order of slip")
        for piece, sign, side in ((-1, 1.0, "s → +∞"), (0, -1.0, "s → −∞")):
            b_0, q = sign * self.b_0[piece], self.q[piece]
            tails = [
                (sign * r[piece], sign * a[piece]) for a, r in self.exponentials if a[piece] != 0.0
            ]
            if any(rate < 0.0 for rate, _ in tails):
                raise GrowthError(
                    f"b grows exponentially as {side}, so |b(s)| ≤ C(1+|s|), eq. (16), fails"
                )
            if q < 0.0 or (
                q == 0.0 and (b_0 < 0.0 or (b_0 == 0.0 and min(tails, default=(0.0, 0.0))[1] < 0.0))
            ):
                raise GrowthError(
                    f"b ends with the wrong sign as {side} (last slope {q:g}, last value {sign * b_0:g}), "
                    "so eq. (15) fails: friction must not push the slip on for large |s|"
                )


def _decay(a_of: Array, r_of: Array, apart: Any, piece: Index) -> Array:
    """a exp(−r (s − s_0)), 0 where a = 0."""
    a = a_of.take(piece)
    return np.asarray(a * np.exp(np.where(a != 0.0, -r_of.take(piece) * apart, 0.0)))


def _decay_integral(s_0: Array, a: Array, r: Array, x: Array, y: Array) -> Array:
    """∫_x^y of a exp(−r (s − s_0)), all of one shape [Pa·m]."""
    step = y - x
    # from the end where the exponential is larger, so that expm1 cannot overflow
    falls = np.real(r * step) >= 0.0
    decay = np.where(falls, r * step, -r * step)
    length = np.where(
        decay == 0.0, step, step * -np.expm1(-decay) / np.where(decay == 0.0, 1.0, decay)
    )
    return np.asarray(a * np.exp(-r * (np.where(falls, x, y) - s_0)) * length)
