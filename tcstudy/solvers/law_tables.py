"""Many friction laws as padded tables, so that values of a thousand different laws cost what values of one do.

Table:      one row a law, one column a kink or a piece; short laws are padded with kinks at infinity
Addresses:  a piece is one flat number, law·(K+1) + piece, and every lookup is one `take`
Literature: the laws are those of tcstudy/scene/friction.py; eqs. (4), (17) of Šestak & Jovanović (2010)

Bounds:     range and least slope of b on intervals of slip, as in tcstudy/solvers/bounds.py: a piece has a monotone
            slope, so that its ends within an interval, and for the range the one slip where b′ = 0, decide

All functions take slips of any shape, and law indices or addresses of a shape that broadcasts with it: laws by row and
laws by node are the same thing here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.friction import BEND, DOWN, UP, FrictionLaw
from tcstudy.scene.nodal_laws import LawTable

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

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
    def of(cls, laws: Sequence[FrictionLaw] | LawTable) -> LawTables:
        """The laws' own numbers, in the order given."""
        table = laws if isinstance(laws, LawTable) else LawTable(tuple(laws))
        s_0, b_0, q, a, r = table.pieces
        return cls(table.kinks, table.kinds.astype(np.int8), s_0, b_0, q, a, r, table.scales, table.omega)

    def law(self, k: int, name: str = "row") -> FrictionLaw:
        """The k-th law as a record of its own."""
        used = np.isfinite(self.kinks[k])
        pieces = np.concatenate([[True], used])
        return FrictionLaw(
            name, self.kinks[k][used], *(x[k][pieces] for x in (self.s_0, self.b_0, self.q, self.a, self.r))
        )

    def take(self, laws: Index) -> LawTables:
        """The named laws."""
        return LawTables(*(np.ascontiguousarray(getattr(self, field.name)[laws]) for field in fields(self)))

    def scaled(self, stretched: Array, stronger: Array) -> LawTables:
        """The laws β b(s/σ), factors (L,)."""
        sigma, beta = stretched[:, None], stronger[:, None]
        pieces = self.s_0 * sigma, self.b_0 * beta, self.q * (beta / sigma), self.a * beta, self.r / sigma
        scales = self.b_scale * stronger, self.omega * (stronger / stretched)
        return LawTables(self.kinks * sigma, self.kinds, *pieces, *scales)

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
    def _primitive(self) -> tuple[Array, Array]:
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
        step, from_anchor = y - x, x - self.s_0.take(piece)
        total: Array = step * (self.b_0.take(piece) + self.q.take(piece) * (from_anchor + 0.5 * step))
        if self.linear:
            return total
        amplitude = np.broadcast_to(self.a.take(piece), total.shape).reshape(-1)
        bent: Index | slice = slice(None) if np.all(amplitude) else amplitude.nonzero()[0]
        if isinstance(bent, slice) or len(bent):
            step, from_anchor, rate = (
                np.broadcast_to(x, total.shape).reshape(-1)[bent] for x in (step, from_anchor, self.r.take(piece))
            )
            decay = rate * step  # from the end where the exponential is larger: expm1 cannot overflow
            larger = from_anchor + np.where(decay >= 0.0, 0.0, step)
            decay = np.abs(decay)
            length = np.where(decay == 0.0, step, step * -np.expm1(-decay) / np.where(decay == 0.0, 1.0, decay))
            total.reshape(-1)[bent] += amplitude[bent] * np.exp(-rate * larger) * length
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
            at_lower, at_upper = self._primitive
            between = np.where(up, at_lower.take(end) - at_upper.take(start), at_upper.take(end) - at_lower.take(start))
            total[crossed] = (
                self.piece_integral(start, x[crossed], leave) + between + self.piece_integral(end, enter, y[crossed])
            )
        return total

    def next_up_jump(self, at: Place, direction: Array) -> Array:
        """First up-jump strictly beyond the slips at `at` in the sign of `direction`, ±∞ if there is none [m]."""
        before, after = self._up_jumps
        return np.where(direction > 0.0, after.take(at.piece + at.on), before.take(at.piece))


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
