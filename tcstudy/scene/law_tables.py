"""Many friction laws as padded tables, so that values of a thousand different laws cost what values of one do.

Table:      one row a law, one column a kink or a piece; short laws are padded with kinks at infinity
Addresses:  a piece is one flat number, law·(K+1) + piece, and every lookup is one `take`
Literature: the laws are those of tcstudy/scene/friction.py; eqs. (4), (17) of Šestak & Jovanović (2010)

All functions take slips of any shape, and law indices or addresses of a shape that broadcasts with it: laws by row and
laws by node are the same thing here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.friction import BEND, UP, FrictionLaw, decay_integral, terms_of

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

PARTS = ("s_0", "b_0", "q", "a", "r")
"""The numbers of a piece."""
_SELDOM = 3
"""Exponentials are formed one by one where fewer than one in so many slips has one."""


class Place(NamedTuple):
    """Where slips sit.

    piece: address of the piece that holds the slip, on a kink of the one to its left
    on:    the slip sits bitwise on a kink; the piece to its right is `piece` + 1 there
    """

    piece: Index
    on: Flags

    def toward(self, side: Flags) -> Index:
        """Address of the piece to the right where `side` is True, else to the left."""
        return self.piece + (self.on & side)


@dataclass(frozen=True, eq=False)
class LawTables:
    """L laws with at most K kinks: b(s) = b_0 + q (s − s_0) + a exp(−r (s − s_0)) on every piece.

    kinks:          (L, K) slips at which b jumps or bends, +∞ where a law has fewer (−∞ in front if mirrored) [m]
    kinds:          (L, K) UP, BEND or DOWN
    s_0, b_0, q, a, r: (L, K+1) the pieces [m, Pa, Pa/m, Pa, 1/m]
    b_scale, omega: (L,) scale of b [Pa] and steepest fall [Pa/m]
    """

    kinks: Array
    kinds: NDArray[np.int8]
    s_0: Array
    b_0: Array
    q: Array
    a: Array
    r: Array
    b_scale: Array
    omega: Array

    @classmethod
    def of(cls, laws: Sequence[FrictionLaw]) -> LawTables:
        """The laws' own numbers, in the order given."""
        most = max([1, *(len(law.kinks) for law in laws)])

        def table(name: str, width: int, beyond: float | None = None) -> Array:
            filled = np.empty((len(laws), width))
            for row, law in zip(filled, laws, strict=True):
                values = getattr(law, name)
                row[: len(values)] = values
                row[len(values) :] = values[-1] if beyond is None else beyond
            return filled

        pieces = [table(name, most + 1) for name in PARTS]
        scales = (np.array([getattr(law, name) for law in laws]) for name in ("b_scale", "omega"))
        found = cls.of_arrays(table("kinks", most, np.inf), pieces, *scales)
        vars(found)["laws"] = tuple(laws)
        return found

    @classmethod
    def of_arrays(
        cls, kinks: Array, pieces: Sequence[Array], b_scale: Array, omega: Array, noise: Array | float = 0.0
    ) -> LawTables:
        """Laws whose kinks follow from the jumps of their pieces; those up to `noise` or rounding are bends."""
        s_0, b_0, q, a, r = pieces
        plain = cls(kinks, np.full(kinks.shape, BEND, dtype=np.int8), s_0, b_0, q, a, r, b_scale, omega)
        (left, terms), (right, others) = plain._beside_kinks
        small = np.abs(right - left) <= np.maximum(noise, 8 * np.finfo(float).eps * (terms + others))
        return replace(plain, kinds=np.where(small, BEND, np.sign(right - left)).astype(np.int8))

    @cached_property
    def laws(self) -> tuple[FrictionLaw, ...]:
        """All laws as records of their own."""
        return tuple(self.law(k) for k in range(len(self.q)))

    def law(self, k: int) -> FrictionLaw:
        """The k-th law as a record of its own."""
        used = np.isfinite(self.kinks[k])
        pieces = np.concatenate([[True], used])
        return FrictionLaw("row", self.kinks[k][used], *(x[k][pieces] for x in self.pieces))

    @property
    def pieces(self) -> tuple[Array, ...]:
        """s_0, b_0, q, a, r."""
        return self.s_0, self.b_0, self.q, self.a, self.r

    def take(self, laws: Index) -> LawTables:
        """The named laws."""
        return LawTables(*(np.ascontiguousarray(getattr(self, field.name)[laws]) for field in fields(self)))

    @cached_property
    def mirrored(self) -> LawTables:
        """The laws −b(−s)."""
        s_0, b_0, a, r = (np.ascontiguousarray(-x[:, ::-1]) for x in (self.s_0, self.b_0, self.a, self.r))
        kinks, kinds = np.ascontiguousarray(-self.kinks[:, ::-1]), np.ascontiguousarray(self.kinds[:, ::-1])
        q = np.ascontiguousarray(self.q[:, ::-1])
        return LawTables(kinks, kinds, s_0, b_0, q, a, r, self.b_scale, self.omega)

    @cached_property
    def linear(self) -> bool:
        """True if no piece has an exponential part."""
        return not np.any(self.a)

    @cached_property
    def lower(self) -> Array:
        """(L, K+1) left end of every piece [m]."""
        return np.concatenate([np.full((len(self.kinks), 1), -np.inf), self.kinks], axis=1)

    @cached_property
    def upper(self) -> Array:
        """(L, K+1) right end of every piece [m]."""
        return np.concatenate([self.kinks, np.full((len(self.kinks), 1), np.inf)], axis=1)

    @cached_property
    def kind_above(self) -> NDArray[np.int8]:
        """(L, K+1) kind of the kink at the right end of every piece."""
        return np.concatenate([self.kinds, np.full((len(self.kinks), 1), BEND, dtype=np.int8)], axis=1)

    @cached_property
    def limits(self) -> tuple[Array, Array]:
        """(L, K) left and right limits of b at the kinks, 0 beyond a law's last [Pa]."""
        return self._beside_kinks[0][0], self._beside_kinks[1][0]

    @property
    def _beside_kinks(self) -> list[tuple[Array, Array]]:
        """(b, the magnitudes that it is made of), (L, K) each, of the pieces to the left and right of the kinks."""
        found, count, real = [], self.kinks.shape[1], np.isfinite(self.kinks)
        for side in (0, 1):
            s_0, b_0, q, a, r = (x[:, side : side + count] for x in self.pieces)
            apart = np.where(real, self.kinks, s_0) - s_0
            linear, decays = b_0 + q * apart, a * np.exp(-r * apart)
            terms = np.abs(b_0) + np.abs(q * apart) + np.abs(decays) * (1.0 + np.abs(r * apart))
            found.append((np.where(real, linear if self.linear else linear + decays, 0.0), terms))
        return found

    @cached_property
    def primitive(self) -> tuple[Array, Array]:
        """(L, K+1) each: ∫ b from a law's first kink to the left and to the right end of every piece, 0 outside."""
        pieces = self.first[:, None] + np.arange(self.q.shape[1])
        inner = np.isfinite(self.lower) & np.isfinite(self.upper)
        x, y = np.where(inner, self.lower, 0.0), np.where(inner, self.upper, 0.0)
        upper = np.cumsum(np.where(inner, self.piece_integral(pieces, x, y), 0.0), axis=1)
        return np.concatenate([np.zeros((len(upper), 1)), upper[:, :-1]], axis=1), upper

    @cached_property
    def _up_jumps(self) -> tuple[Array, Array]:
        """(L, K+1) each: last up-jump up to the left end of every piece, first from its right end on; ∓∞ if none."""
        jumps = np.where(self.kinds == UP, self.kinks, np.nan)
        edge = np.full((len(jumps), 1), np.inf)
        before = np.fmax.accumulate(np.concatenate([-edge, jumps], axis=1), axis=1)
        after = np.fmin.accumulate(np.concatenate([jumps, edge], axis=1)[:, ::-1], axis=1)[:, ::-1]
        return before, np.ascontiguousarray(after)

    @cached_property
    def first(self) -> Index:
        """(L,) address of every law's first piece."""
        return np.arange(len(self.q), dtype=np.intp) * self.q.shape[1]

    def locate(self, law: Index, s: Array) -> Place:
        """Where the slips s sit on the named laws (shape of s)."""
        piece = np.empty(s.shape, dtype=np.intp)
        piece[...] = self.first[law]
        for kinks in self.kinks.T:
            piece += s > kinks[law]
        return Place(piece, s == self.upper.take(piece))

    def value(self, s: Array, piece: Index) -> Array:
        """b of the addressed pieces, without asking whether s lies in them [Pa]."""
        apart = s - self.s_0.take(piece)
        value: Array = self.b_0.take(piece) + self.q.take(piece) * apart
        return value if self.linear else value + self._exponential(apart, piece)

    def slope(self, s: Array, piece: Index) -> Array:
        """b′ of the addressed pieces [Pa/m]."""
        q: Array = self.q.take(piece)
        if self.linear:
            return q + 0.0 * s
        return q - self.r.take(piece) * self._exponential(s - self.s_0.take(piece), piece)

    def numbers(self, piece: Index) -> tuple[Array, ...]:
        """(s_0, b_0, q, a, r) of the addressed pieces."""
        return tuple(x.take(piece) for x in self.pieces)

    def terms(self, s: Array, piece: Index) -> Array:
        """As `FrictionLaw.terms` of the addressed pieces."""
        return terms_of(s, *self.numbers(piece))

    def value_and_slope(self, s: Array, piece: Index) -> tuple[Array, Array]:
        """`value` and `slope` with one exponential for both; all of one shape."""
        apart, q = s - self.s_0.take(piece), self.q.take(piece)
        value: Array = self.b_0.take(piece) + q * apart
        if self.linear:
            return value, q + 0.0 * s
        part = self._exponential(apart, piece)
        return value + part, q - self.r.take(piece) * part

    def _exponential(self, apart: Array, piece: Index) -> Array:
        """a exp(−r (s − s_0)), 0 where a = 0; formed only where it is not if that is seldom."""
        part: Array = self.a.take(piece)
        count = np.count_nonzero(part)
        if count == part.size:
            return np.asarray(part * np.exp(-self.r.take(piece) * apart))
        if not count:
            return np.broadcast_to(part, np.broadcast_shapes(part.shape, apart.shape))
        if _SELDOM * count >= part.size or part.shape != apart.shape:
            return np.asarray(part * np.exp(np.where(part != 0.0, -self.r.take(piece) * apart, 0.0)))
        flat = part.reshape(-1)
        bent = flat.nonzero()[0]
        flat[bent] *= np.exp(-self.r.take(piece.reshape(-1).take(bent)) * apart.reshape(-1).take(bent))
        return part

    def piece_integral(self, piece: Index, x: Array, y: Array) -> Array:
        """∫_x^y b of the addressed pieces, accurate for small y − x [Pa·m]."""
        step, s_0 = y - x, self.s_0.take(piece)
        total: Array = step * (self.b_0.take(piece) + self.q.take(piece) * (x - s_0 + 0.5 * step))
        if self.linear:
            return total
        a, r = self.a.take(piece), self.r.take(piece)
        if np.all(a):
            return total + decay_integral(s_0, a, r, x, y)
        flat = [np.broadcast_to(part, total.shape).reshape(-1) for part in (s_0, a, r, x, y)]
        bent = flat[1].nonzero()[0]
        if len(bent):
            total.reshape(-1)[bent] += decay_integral(*(part[bent] for part in flat))
        return total

    def integral(self, x: Array, y: Array, x_at: Place, y_at: Place) -> Array:
        """j(y) − j(x) = ∫_x^y b without cancellation; x_at, y_at: what `locate` says of x and y [Pa·m]."""
        rising = y >= x
        first = x_at.toward(rising)
        last = np.where(x == y, first, y_at.toward(~rising))
        total = self.piece_integral(first, x, np.where(first == last, y, x))
        crossed = np.nonzero(first != last)
        if len(crossed[0]):
            up, start, end = rising[crossed], first[crossed], last[crossed]
            leave = np.where(up, self.upper.take(start), self.lower.take(start))
            enter = np.where(up, self.lower.take(end), self.upper.take(end))
            at_lower, at_upper = self.primitive
            between = np.where(up, at_lower.take(end) - at_upper.take(start), at_upper.take(end) - at_lower.take(start))
            total[crossed] = (
                self.piece_integral(start, x[crossed], leave) + between + self.piece_integral(end, enter, y[crossed])
            )
        return total

    def next_up_jump(self, at: Place, direction: Array) -> Array:
        """First up-jump strictly beyond the slips at `at` in the sign of `direction`, ±∞ if there is none [m]."""
        before, after = self._up_jumps
        return np.where(direction > 0.0, after.take(at.piece + at.on), before.take(at.piece))
