"""Friction laws as one record: one law, a law per node, or a law per row and node.

`pieces` has their numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tcstudy.laws.pieces import BEND, NARROW, UP, Array, Fact, Flags, Index, LawPieces, Place, Slips

MAX_SLIPS_AT_ONCE = 1_000
"""Slips of laws with more than ten kinks that are compared with all kinks at once."""


@dataclass(frozen=True, eq=False)
class Made:
    """The definition of a law: its shape, the values of all parameters, and a factor of b.

    closing: of a one-sided law, as of `Laws`
    """

    shape: str
    values: dict[str, Any]
    strength: float = 1.0
    closing: float | None = None


@dataclass(frozen=True, eq=False)
class Laws(LawPieces):
    """Friction laws b with their jumps filled in; equal if all numbers are.

    The pieces are those of `LawPieces`.

    index: which law a slip has: of one law for all () with arrays (K,); of L laws (m,), (R, 1) or
           (R, m) with arrays (L, K)
    made:  the definition of a law, None if it is not known; it does not count for equality
    closing: stiffness of a one-sided law for s < 0, ∞ for a ray, which no strength factor changes;
           None for a law of slip in either direction (`shapes.one_sided`) [Pa/m]
    """

    index: Index = field(default_factory=lambda: np.zeros((), dtype=np.intp), kw_only=True)
    made: Made | None = field(default=None, repr=False, kw_only=True)
    closing: float | None = field(default=None, repr=False, kw_only=True)

    @classmethod
    def of(cls, laws: Sequence[Laws], index: ArrayLike = 0) -> Laws:
        """Return the tables of laws, each one for all, in their order.

        index: which of them every slip has
        """
        laws = list(laws) or [NONE]  # also where there are no nodes
        width = max(1, *(len(law.kinks) for law in laws))
        has_second = any(law.a_2 is not None for law in laws)
        pieces = []
        for law in laws:
            second = [0.0 * law.a] * 2 if has_second and law.a_2 is None else []
            pieces.append([*law.pieces, *second])
        names = " | ".join(dict.fromkeys(law.name for law in laws))
        kinks = _padded([law.kinks for law in laws], width, np.inf)
        columns = [_padded(rows, width + 1) for rows in zip(*pieces, strict=True)]
        tables = cls(names, kinks, *columns).at(index)
        tables.facts["laws"] = tuple(laws)
        return tables

    def at(self, index: ArrayLike) -> Laws:
        """Return the tables with another index."""
        laws = object.__new__(Laws)
        vars(laws).update(vars(self), index=np.asarray(index, dtype=np.intp))
        return laws

    def of_nodes(self, nodes: Any) -> Laws:
        """Return the laws of the numbered nodes, or rows; one law for all is that of any."""
        return self if self.one else self.at(self.index[nodes])

    def known(self, **facts: Any) -> Laws:
        """Return this new record with facts that are more precise than those of its arrays."""
        self.facts.update(facts, known=(*self.facts.get("known", ()), *facts))
        return self

    def smooth_to(self, noise: Array) -> Laws:
        """Return the laws with jumps of up to `noise` (broadcasts with the kinks) as bends."""
        left, right, rounding = self._beside
        jump = right - left
        is_small = np.abs(jump) <= np.maximum(noise, rounding)
        return self.known(kind_above=np.where(is_small, BEND, np.sign(jump)).astype(np.int8))

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Laws)
            and self._bytes == other._bytes
            and self.closing == other.closing
            and np.array_equal(self.index, other.index)
        )

    def __hash__(self) -> int:
        return hash(self._bytes)

    @Fact
    def tables(self) -> Laws:
        """The laws with one row each, at least one kink wide, also if there is only one law."""
        return Laws.of([self]) if self.one else self

    @Fact
    def laws(self) -> tuple[Laws, ...]:
        """All laws, each as one for all."""
        if self.one:
            return (self,)
        laws = []
        for row, kinks in enumerate(self.kinks):
            is_kink = np.isfinite(kinks)
            is_piece = np.append(True, is_kink)
            columns = [column[row][is_piece] for column in self.pieces]
            laws.append(Laws("row", kinks[is_kink], *columns))
        return tuple(laws)

    def single(self, node: int) -> Laws:
        """Return the law of one node, as one for all."""
        return self if self.one else self.laws[int(self.index[node])]

    def of_row(self, row: int) -> Laws:
        """Return the laws of one row's nodes, or the law that all have."""
        table_rows, index = np.unique(self.index[row], return_inverse=True)
        laws = [self.laws[k] for k in table_rows]
        return laws[0] if len(laws) == 1 else Laws.of(laws, index)

    def groups(self, m: int) -> list[tuple[Laws, Index]]:
        """Return every law that some of m nodes have, as one for all, with its nodes."""
        index = self.node_index(m)
        return [(self.laws[k], np.flatnonzero(index == k)) for k in np.unique(index)]

    def node_index(self, m: int) -> Index:
        """Return (m,) which of the tables every node has."""
        return np.broadcast_to(self.index, m)

    def mapped(self, change: Callable[[Laws], Laws]) -> Laws:
        """Return the laws with every one changed."""
        if self.one:
            return change(self)
        return Laws.of([change(law) for law in self.laws], self.index)

    @property
    def vanishes(self) -> bool:
        """True if b ≡ 0 everywhere: a film without friction."""
        amplitudes = [a for a, _ in self.exponentials]
        columns = (self.b_0, self.q, *amplitudes)
        return not any(np.any(self._used(column)) for column in columns)

    def _used(self, of_laws: Array) -> Array:
        """Return the rows of an array (L, …) that the index names."""
        return of_laws if self.one else of_laws[self.index]

    @property
    def omega(self) -> float:
        """Largest maximum softening slope ω of all laws [Pa/m]."""
        return float(np.max(self._used(self.falls), initial=0.0))

    @property
    def omega_by_row(self) -> Array:
        """(R,) maximum softening slope of every row [Pa/m]."""
        return np.asarray(np.max(self.falls[self.index], axis=1))

    @property
    def b_scale(self) -> float:
        """Largest scale of b of all laws [Pa]."""
        return float(np.max(self._used(self.scales), initial=0.0))

    @property
    def s_scale(self) -> float:
        """Smallest distance of two kinks or decay length of all laws; 0 without either [m]."""
        with np.errstate(invalid="ignore"):  # behind the last kink of a law
            distances = np.diff(np.atleast_2d(self._used(self.kinks))).ravel()
        lengths = [distances]
        for a, r in self.exponentials:
            rates = self._used(r)[self._used(a) != 0.0]
            lengths.append(1.0 / np.abs(rates))
        all_lengths = np.concatenate(lengths)
        finite_lengths = all_lengths[np.isfinite(all_lengths)]
        return float(np.min(finite_lengths)) if len(finite_lengths) else 0.0

    def locate(self, s: Slips, law: Index | None = None) -> Place:
        """Return where slips sit.

        law: which of the tables each has, by default the index (broadcasts with s)
        """
        s = np.asarray(s)
        if self.one:
            piece = np.asarray(np.searchsorted(self.kinks.real, s, side="left"))
            return Place(piece, s == self.upper.real.take(piece))
        law = self.index if law is None else law
        shape = s.shape if s.shape == law.shape else np.broadcast_shapes(s.shape, law.shape)
        piece = np.empty(shape, dtype=np.intp)
        piece[...] = self.first.take(law)
        if piece.size <= MAX_SLIPS_AT_ONCE < 100 * self.kinks.shape[1]:
            piece += np.count_nonzero(s[..., None] > self.kinks[law], axis=-1)
        else:
            for kinks in self.kinks.T:
                piece += s > kinks[law]
        return Place(piece, s == self.upper.take(piece))

    def piece(self, s: Slips, side: int = 1) -> Index:
        """Return the address of the piece that holds s.

        side: at a kink the piece to its right (1) or left (−1)
        """
        place = self.locate(s)
        return place.piece + place.on if side > 0 else place.piece

    def b(self, s: Slips, side: int = 1) -> Array:
        """Return one selection of b̂: the right limit of b (side=1) or the left one (side=−1)."""
        return self.value(s, self.piece(s, side))

    def interval(
        self, s: Slips, tolerance: float = 0.0, place: Place | None = None
    ) -> tuple[Array, Array]:
        """Return the filled interval b̂(s) = [b⁻(s), b⁺(s)].

        tolerance: slips within this distance of a kink count as on it [m]
        place:     what `locate` returns for s
        """
        s = np.asarray(s, dtype=float)
        place = place or self.locate(s)
        left = self.value(s, place.piece)
        right = left
        if np.any(place.on):
            right = np.where(place.on, self.value(s, place.piece + place.on), left)
        if tolerance:
            kink = self.nearest_kink(s)
            on_kink = np.abs(s - self.kink(kink)) <= tolerance
            left_limit, right_limit = self.limits(kink)
            left = np.where(on_kink, left_limit, left)
            right = np.where(on_kink, right_limit, right)
        return np.minimum(left, right), np.maximum(left, right)

    def nearest_kink(self, s: Slips) -> Index:
        """Return the address of the kink closest to each s, of two as close the right one.

        It is not the address of a kink if the law has none.
        """
        piece = self.locate(s).piece
        left_is_nearer = s - self.lower.take(piece) < self.upper.take(piece) - s
        return np.asarray(piece - left_is_nearer)

    def sticking(self, v: Array) -> Flags:
        """Return (m,) nodes that sit on an up-jump of b."""
        return np.asarray(self.kind(self.locate(v)) == UP)

    def integral(
        self, x: Slips, y: Slips, x_place: Place | None = None, y_place: Place | None = None
    ) -> Array:
        """Return j(y) − j(x) = ∫_x^y b without cancellation [Pa·m].

        x_place, y_place: what `locate` returns for x and y
        """
        x = np.asarray(x)
        y = np.asarray(y)
        x_place = x_place or self.locate(x)
        y_place = y_place or self.locate(y)
        rising = y >= x
        first = x_place.toward(rising)
        last_crossed = y_place.toward(~rising)
        last_piece = np.where(x == y, first, last_crossed)
        in_one_piece = first == last_piece
        total = np.asarray(self.piece_integral(first, x, np.where(in_one_piece, y, x)))
        crossing = np.nonzero(~in_one_piece)
        if len(crossing[0]):
            start = x if x.shape == total.shape else np.broadcast_to(x, total.shape)
            end = y if y.shape == total.shape else np.broadcast_to(y, total.shape)
            total[crossing] = self._integral_over_kinks(
                start[crossing],
                end[crossing],
                first[crossing],
                last_piece[crossing],
                rising[crossing],
            )
        return total

    def _integral_over_kinks(
        self, x: Array, y: Array, first: Index, last_piece: Index, rising: Flags
    ) -> Array:
        """Return ∫_x^y b from the piece `first` to another one [Pa·m]."""
        exit_slip = np.where(rising, self.upper.take(first), self.lower.take(first))
        entry_slip = np.where(rising, self.lower.take(last_piece), self.upper.take(last_piece))
        to_lower, to_upper = self.primitive
        between = np.where(
            rising,
            to_lower.take(last_piece) - to_upper.take(first),
            to_upper.take(last_piece) - to_lower.take(first),
        )
        before = self.piece_integral(first, x, exit_slip)
        after = self.piece_integral(last_piece, entry_slip, y)
        return np.asarray(before + between + after)

    def j(self, s: Slips) -> Array:
        """Return the primitive j(s) = ∫₀ˢ b, exact, eq. (17) (shape of s) [Pa·m]."""
        s = np.asarray(s)
        flat = np.atleast_1d(s)
        return self.integral(np.zeros(flat.shape), flat).reshape(s.shape)

    @Fact
    def mirrored(self) -> Laws:
        """The tables of the laws −b(−s)."""
        signs = (-1.0, -1.0, 1.0, -1.0, -1.0, -1.0, -1.0)  # of `pieces`
        columns = []
        for sign, column in zip(signs, self.pieces, strict=False):
            columns.append(np.ascontiguousarray(sign * column[..., ::-1]))
        kinks = np.ascontiguousarray(-self.kinks[..., ::-1])
        kinds = np.concatenate([self.kinds[..., ::-1], self.kind_above[..., -1:]], axis=-1)
        return Laws(self.name, kinks, *columns).known(
            kind_above=np.ascontiguousarray(kinds), scales=self.scales, falls=self.falls
        )

    def placed(self, strength: float = 1.0, stretch: float = 1.0, shift: float = 0.0) -> Laws:
        """Return the laws strength · b((s − shift)/stretch).

        A narrow piece whose ends are rounded keeps the values there: slope and rate follow its
        width. Two kinks that become one are a jump.
        """
        if (strength, stretch, shift) == (1.0, 1.0, 0.0):
            return self
        if not self.one:
            return self.mapped(lambda law: law.placed(strength, stretch, shift))
        kinks = self.kinks * stretch + shift
        s_0 = self.s_0 * stretch + shift
        exact_width = np.diff(self.kinks) * stretch
        rounded_width = np.diff(kinks)
        has_width = rounded_width > 0.0
        outer_rate = [1.0 / stretch]
        inner_rate = exact_width / np.where(has_width, rounded_width, exact_width) / stretch
        rate = np.concatenate([outer_rate, inner_rate, outer_rate if len(kinks) else []])
        is_kept = np.concatenate([[True], has_width, [True]])[: len(self.q)]
        columns = [s_0, self.b_0 * strength, self.q * strength * rate]
        for amplitude, decay_rate in zip(self.pieces[3::2], self.pieces[4::2], strict=True):
            columns += [amplitude * strength, decay_rate * rate]
        closing = None if self.closing is None else self.closing * strength / stretch
        columns = [column[is_kept] for column in columns]
        return Laws(self.name, kinks[is_kept[1:]], *columns, closing=closing)

    def strengthened(self, strength: Any) -> Laws:
        """Return the law `strength` × b, of a one-sided law for s ≥ 0 alone.

        strength: ≥ 0, or complex in derivatives
        """
        if self.closing is None:
            return self.placed(strength) if strength != 0.0 else NONE
        columns = list(self.pieces)
        for k in (1, 2, 3, 5)[: 3 if self.a_2 is None else 4]:  # b_0, q and the amplitudes
            columns[k] = np.append(columns[k][:1], columns[k][1:] * strength)
        kinks = self.kinks
        if strength == 0.0:
            kinks = kinks[:1]
            columns = [column[:2] for column in columns]
        return Laws(self.name, kinks, *columns, closing=self.closing)

    def times(self, strength: float) -> Laws:
        """Return the law `strength` × b, b ≡ 0 for 0; of a one-sided law for s ≥ 0 alone."""
        if strength == 0.0 and self.closing is None:
            return NONE
        definition = self.made
        if definition is not None:
            definition = replace(definition, strength=strength * definition.strength)
        return replace(self.strengthened(strength), made=definition)

    def admissible(self, s: Array) -> Array:
        """Return slips (shape of s) with those beyond a ray put on it."""
        if not self.has_rays:
            return s
        return np.maximum(s, self._used(self._ends))

    def walled(self, pressure: float) -> Laws:
        """Return the laws with a jump from −pressure in place of every ray."""
        if not self.has_rays:
            return self
        b_0 = np.where(self.outside, -pressure, self.b_0)
        return Laws(self.name, self.kinks, self.s_0, b_0, *self.pieces[2:]).at(self.index)

    @Fact
    def _ends(self) -> Array:
        """(…) left end of the domain of every law, −∞ without a ray [m]."""
        return np.asarray(np.where(self.closed, self.kinks[..., 0], -np.inf))

    def inside(self, piece: Index) -> Index:
        """Return the addresses with those to the left of a ray replaced by the next ones."""
        return piece + self.outside.take(piece) if self.has_rays else piece

    @property
    def is_closed(self) -> Flags:
        """Which of the laws in use are closed (shape of the index)."""
        return self.closed if self.one else self.closed[self.index]

    @property
    def without_rays(self) -> Laws:
        """The laws whose limit b(s_1 + 0) at a ray goes on to the left in its place.

        It is for what is asked of b beside a ray. The laws themselves where there is none.
        """
        return self._without_rays.at(self.index) if self.has_rays else self

    @Fact
    def _without_rays(self) -> Laws:
        b_0 = self.b_0.copy()
        s_0 = self.s_0.copy()
        b_0[..., 0] = np.where(self.closed, self.b_right[..., 0], b_0[..., 0])
        s_0[..., 0] = np.where(self.closed, self.kinks[..., 0], s_0[..., 0])
        return Laws(self.name, self.kinks, s_0, b_0, *self.pieces[2:])

    @Fact
    def _narrow(self) -> Flags:
        """(…, K−1) pieces between kinks that are no wider than NARROW roundings of the slip."""
        size = np.abs(self.kinks)
        with np.errstate(invalid="ignore"):  # of kinks at infinity, behind the last of a law
            rounding = np.spacing(np.maximum(size[..., :-1], size[..., 1:]))
            return np.diff(self.kinks) <= NARROW * rounding

    @property
    def has_narrow_pieces(self) -> bool:
        """Whether some piece is no wider than NARROW roundings of the slip."""
        return bool(np.any(self._narrow))

    def narrow(self, piece: Index) -> Flags:
        """Return whether the addressed pieces are no wider than NARROW roundings of the slip."""
        outer = np.zeros((*self._narrow.shape[:-1], 1), dtype=bool)
        return np.concatenate([outer, self._narrow, outer], axis=-1).take(piece)

    @property
    def without_narrow_pieces(self) -> Laws:
        """The laws with pieces of up to NARROW roundings of the slip as jumps.

        No double lies inside the narrowest of them, so that a descent cannot come to rest there. On
        a jump it can.
        """
        if not self.has_narrow_pieces:
            return self
        if not self.one:
            return self.mapped(lambda law: law.without_narrow_pieces)
        narrow = self._narrow
        is_kept = np.concatenate([[True], ~narrow, [True]])
        # of the two ends of a narrow piece the one nearer to 0 stays
        stays_if_negative = np.append(~narrow, True)
        stays_otherwise = np.append(True, ~narrow)
        kink_stays = np.where(self.kinks < 0.0, stays_if_negative, stays_otherwise)
        return Laws(self.name, self.kinks[kink_stays], *(column[is_kept] for column in self.pieces))


NONE = Laws("none", np.zeros(0), *(np.zeros(1) for _ in range(5)))
"""b ≡ 0: an unbonded patch."""


def _padded(rows: Sequence[Array], width: int, padding: float | None = None) -> Array:
    """Return rows of one width, filled up with `padding` or each row's last value."""
    table = np.empty((len(rows), width))
    for table_row, row in zip(table, rows, strict=True):
        table_row[: len(row)] = row
        table_row[len(row) :] = row[-1] if padding is None else padding
    return table
