"""Friction laws as one record: of one law, of a law a node, of a law a row and node; `pieces` has
their numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tcstudy.laws.pieces import BEND, NARROW, UP, Array, Fact, Flags, Index, LawPieces, Place, Slips

_AT_ONCE = 1_000
"""Slips up to which those of laws with more than ten kinks are compared with all kinks at once."""


@dataclass(frozen=True, eq=False)
class Made:
    """What a law was made of: the name of its shape, the values of all its parameters, and a factor
    of b."""

    shape: str
    values: dict[str, Any]
    strength: float = 1.0


@dataclass(frozen=True, eq=False)
class Laws(LawPieces):
    """Friction laws b with their jumps filled in; equal if all numbers are. The pieces are those of
    `LawPieces`.

    index: which law a slip has: of one law for all () with arrays (K,); of L laws (m,), (R, 1) or
    (R, m) with
           arrays (L, K)
    made:  what a law was made of, None if that is not known; it is no part of what the law is
    """

    index: Index = field(default_factory=lambda: np.zeros((), dtype=np.intp), kw_only=True)
    made: Made | None = field(default=None, repr=False, kw_only=True)

    @classmethod
    def of(cls, laws: Sequence[Laws], index: ArrayLike = 0) -> Laws:
        """Tables of laws, each one for all, in the order given, and which of them every slip
        has."""
        laws = list(laws) or [NONE]  # no nodes have none
        most = max(1, *(len(law.kinks) for law in laws))

        def table(rows: list[Array], width: int, beyond: float | None = None) -> Array:
            filled = np.empty((len(rows), width))
            for row, values in zip(filled, rows, strict=True):
                row[: len(values)] = values
                row[len(values) :] = values[-1] if beyond is None else beyond
            return filled

        second = any(law.a_2 is not None for law in laws)
        pieces = [
            [*law.pieces, *([0.0 * law.a] * 2 if second and law.a_2 is None else [])]
            for law in laws
        ]
        names = " | ".join(dict.fromkeys(law.name for law in laws))
        columns = (table(list(rows), most + 1) for rows in zip(*pieces, strict=True))
        found = cls(names, table([law.kinks for law in laws], most, np.inf), *columns).at(index)
        found.facts["laws"] = tuple(laws)
        return found

    def at(self, index: ArrayLike) -> Laws:
        """The tables with another index."""
        found = object.__new__(Laws)
        vars(found).update(vars(self), index=np.asarray(index, dtype=np.intp))
        return found

    def of_nodes(self, nodes: Any) -> Laws:
        """The laws of the named nodes, or rows; one law for all is that of any."""
        return self if self.one else self.at(self.index[nodes])

    def known(self, **facts: Any) -> Laws:
        """This new record with facts that are known better than its arrays tell."""
        self.facts.update(facts, known=(*self.facts.get("known", ()), *facts))
        return self

    def smooth_to(self, noise: Array) -> Laws:
        """The same with jumps of up to `noise` (broadcasts with the kinks) as bends."""
        left, right, rounding = self._beside
        small = np.abs(right - left) <= np.maximum(noise, rounding)
        return self.known(kind_above=np.where(small, BEND, np.sign(right - left)).astype(np.int8))

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Laws)
            and self._bytes == other._bytes
            and np.array_equal(self.index, other.index)
        )

    def __hash__(self) -> int:
        return hash(self._bytes)

    @Fact
    def tables(self) -> Laws:
        """The same with a row a law, at least a kink wide, also of one law."""
        return Laws.of([self]) if self.one else self

    @Fact
    def laws(self) -> tuple[Laws, ...]:
        """All laws, each as one for all."""
        if self.one:
            return (self,)
        used = [np.isfinite(kinks) for kinks in self.kinks]
        kept = [np.append(True, real) for real in used]
        return tuple(
            Laws("row", self.kinks[k][used[k]], *(x[k][kept[k]] for x in self.pieces))
            for k in range(len(used))
        )

    def single(self, node: int) -> Laws:
        """The law of one node, as one for all."""
        return self if self.one else self.laws[int(self.index[node])]

    def of_row(self, row: int) -> Laws:
        """The laws of one row's nodes, or the law that all have."""
        used, index = np.unique(self.index[row], return_inverse=True)
        own = [self.laws[k] for k in used]
        return own[0] if len(own) == 1 else Laws.of(own, index)

    def groups(self, m: int) -> list[tuple[Laws, Index]]:
        """Every law that some of m nodes have, as one for all, with its nodes."""
        index = self.node_index(m)
        return [(self.laws[k], np.flatnonzero(index == k)) for k in np.unique(index)]

    def node_index(self, m: int) -> Index:
        """(m,) which of the tables every node has."""
        return np.broadcast_to(self.index, m)

    def mapped(self, change: Callable[[Laws], Laws]) -> Laws:
        """The same with every law changed."""
        return change(self) if self.one else Laws.of([change(law) for law in self.laws], self.index)

    @property
    def vanishes(self) -> bool:
        """True if b ≡ 0 everywhere: a film without friction."""
        parts = (
            x if self.one else x[self.index]
            for x in (self.b_0, self.q, *(a for a, _ in self.exponentials))
        )
        return not any(np.any(part) for part in parts)

    def _used(self, of_laws: Array) -> Array:
        return of_laws if self.one else of_laws[self.index]

    @property
    def omega(self) -> float:
        """Steepest fall ω of all [Pa/m]."""
        return float(np.max(self._used(self.falls), initial=0.0))

    @property
    def omega_by_row(self) -> Array:
        """(R,) steepest fall of every row [Pa/m]."""
        return np.asarray(np.max(self.falls[self.index], axis=1))

    @property
    def b_scale(self) -> float:
        """Largest scale of b of all [Pa]."""
        return float(np.max(self._used(self.scales), initial=0.0))

    @property
    def s_scale(self) -> float:
        """Least slip over which a b changes: least kink spacing or decay length; 0 if there is none
        [m]."""
        kinks, found = np.atleast_2d(self._used(self.kinks)), []
        with np.errstate(invalid="ignore"):
            found.append(np.diff(kinks).ravel())
        for a, r in self.exponentials:
            found.append(1.0 / np.abs(self._used(r)[self._used(a) != 0.0]))
        lengths = np.concatenate(found)
        return (
            float(np.min(lengths[np.isfinite(lengths)], initial=np.inf))
            if np.any(np.isfinite(lengths))
            else 0.0
        )

    def locate(self, s: Slips, law: Index | None = None) -> Place:
        """Where slips sit; law: which of the tables each has, by default the index (broadcasts with
        s)."""
        s = np.asarray(s)
        if self.one:
            piece = np.asarray(np.searchsorted(self.kinks.real, s, side="left"))
            return Place(piece, s == self.upper.real.take(piece))
        law = self.index if law is None else law
        shape = s.shape if s.shape == law.shape else np.broadcast_shapes(s.shape, law.shape)
        piece = np.empty(shape, dtype=np.intp)
        piece[...] = self.first.take(law)
        if piece.size <= _AT_ONCE < 100 * self.kinks.shape[1]:
            piece += np.count_nonzero(s[..., None] > self.kinks[law], axis=-1)
        else:
            for kinks in self.kinks.T:
                piece += s > kinks[law]
        return Place(piece, s == self.upper.take(piece))

    def piece(self, s: Slips, side: int = 1) -> Index:
        """Address of the piece that holds s; at a kink the piece to its right (side=1) or left
        (side=-1)."""
        at = self.locate(s)
        return at.piece + at.on if side > 0 else at.piece

    def b(self, s: Slips, side: int = 1) -> Array:
        """One selection of b̂: the right limit of b (side=1) or the left one (side=-1)."""
        return self.value(s, self.piece(s, side))

    def interval(
        self, s: Slips, tolerance: float = 0.0, at: Place | None = None
    ) -> tuple[Array, Array]:
        """The filled interval b̂(s) = [b⁻(s), b⁺(s)]; slips within `tolerance` of a kink count as
        on it.

        at: what `locate` says of s
        """
        s = np.asarray(s, dtype=float)
        at = at or self.locate(s)
        left = self.value(s, at.piece)
        right = np.where(at.on, self.value(s, at.piece + at.on), left) if np.any(at.on) else left
        if tolerance:
            near = self.nearest_kink(s)
            on = np.abs(s - self.kink(near)) <= tolerance
            left, right = (
                np.where(on, limit, b)
                for limit, b in zip(self.limits(near), (left, right), strict=True)
            )
        return np.minimum(left, right), np.maximum(left, right)

    def nearest_kink(self, s: Slips) -> Index:
        """Address of the kink closest to each s, of two as close that to the right; without one
        none to be used."""
        piece = self.locate(s).piece
        return np.asarray(piece - (s - self.lower.take(piece) < self.upper.take(piece) - s))

    def sticking(self, v: Array) -> Flags:
        """(m,) nodes that rest on an up-jump of b."""
        return np.asarray(self.kind(self.locate(v)) == UP)

    def integral(
        self, x: Slips, y: Slips, x_at: Place | None = None, y_at: Place | None = None
    ) -> Array:
        """j(y) − j(x) = ∫_x^y b without cancellation; x_at, y_at: what `locate` says of x and y
        [Pa·m]."""
        x, y = np.asarray(x), np.asarray(y)
        x_at, y_at = x_at or self.locate(x), y_at or self.locate(y)
        rising = y >= x
        first = x_at.toward(rising)
        last = np.where(x == y, first, y_at.toward(~rising))
        total = np.asarray(self.piece_integral(first, x, np.where(first == last, y, x)))
        crossed = np.nonzero(first != last)
        if len(crossed[0]):
            x, y = (
                (s if s.shape == total.shape else np.broadcast_to(s, total.shape))[crossed]
                for s in (x, y)
            )
            up, start, end = rising[crossed], first[crossed], last[crossed]
            leave = np.where(up, self.upper.take(start), self.lower.take(start))
            enter = np.where(up, self.lower.take(end), self.upper.take(end))
            at_lower, at_upper = self.primitive
            between = np.where(
                up,
                at_lower.take(end) - at_upper.take(start),
                at_upper.take(end) - at_lower.take(start),
            )
            total[crossed] = (
                self.piece_integral(start, x, leave) + between + self.piece_integral(end, enter, y)
            )
        return total

    def j(self, s: Slips) -> Array:
        """The primitive j(s) = ∫₀ˢ b, exact, eq. (17) (shape of s) [Pa·m]."""
        s = np.asarray(s)
        flat = np.atleast_1d(s)
        return self.integral(np.zeros(flat.shape), flat).reshape(s.shape)

    @Fact
    def mirrored(self) -> Laws:
        """The tables of the laws −b(−s)."""
        signs = (-1.0, -1.0, 1.0, -1.0, -1.0, -1.0, -1.0)
        pieces = [
            np.ascontiguousarray(sign * x[..., ::-1])
            for sign, x in zip(signs, self.pieces, strict=False)
        ]
        found = Laws(self.name, np.ascontiguousarray(-self.kinks[..., ::-1]), *pieces)
        kinds = np.concatenate([self.kinds[..., ::-1], self.kind_above[..., -1:]], axis=-1)
        return found.known(
            kind_above=np.ascontiguousarray(kinds), scales=self.scales, falls=self.falls
        )

    def placed(self, strength: float = 1.0, stretch: float = 1.0, moved: float = 0.0) -> Laws:
        """The laws strength · b((s − moved)/stretch).

        A narrow piece whose ends are rounded keeps the values there: slope and rate follow its
        width. Two kinks that become one are a jump.
        """
        if (strength, stretch, moved) == (1.0, 1.0, 0.0):
            return self
        if not self.one:
            return self.mapped(lambda law: law.placed(strength, stretch, moved))
        kinks, s_0 = (s * stretch + moved for s in (self.kinks, self.s_0))
        width, rounded = np.diff(self.kinks) * stretch, np.diff(kinks)
        ends = [[1.0 / stretch]] * min(len(kinks), 1)
        rate = np.concatenate(
            [[1.0 / stretch], width / np.where(rounded > 0.0, rounded, width) / stretch, *ends]
        )
        kept = np.concatenate([[True], rounded > 0.0, [True]])[: len(self.q)]
        columns = [s_0, self.b_0 * strength, self.q * strength * rate]
        columns += [part * (rate if k % 2 else strength) for k, part in enumerate(self.pieces[3:])]
        return Laws(self.name, kinks[kept[1:]], *(column[kept] for column in columns))

    def times(self, strength: float) -> Laws:
        """The law `strength` × b, b ≡ 0 for 0."""
        if strength == 0.0:
            return NONE
        made = (
            self.made
            if self.made is None
            else replace(self.made, strength=strength * self.made.strength)
        )
        return replace(self.placed(strength), made=made)

    @Fact
    def _narrow(self) -> Flags:
        """(…, K−1) pieces between kinks that are no wider than NARROW roundings of the slip."""
        size = np.abs(self.kinks)
        with np.errstate(invalid="ignore"):  # of kinks at infinity, behind the last of a law
            return np.diff(self.kinks) <= NARROW * np.spacing(
                np.maximum(size[..., :-1], size[..., 1:])
            )

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
        """The laws with pieces of up to NARROW roundings of the slip as jumps; the same where there
        are none.

        No double lies inside the narrowest of them, so that a descent cannot come to rest there; on
        a jump it can.
        """
        if not self.has_narrow_pieces:
            return self
        if not self.one:
            return self.mapped(lambda law: law.without_narrow_pieces)
        narrow = self._narrow
        kept = np.concatenate([[True], ~narrow, [True]])
        outer = np.append(narrow, False) & (
            self.kinks < 0.0
        )  # of the two ends the one nearer to 0 stays
        held = np.where(self.kinks < 0.0, ~outer, np.concatenate([[True], ~narrow]))
        return Laws(self.name, self.kinks[held], *(x[kept] for x in self.pieces))


NONE = Laws("none", np.zeros(0), *(np.zeros(1) for _ in range(5)))
"""b ≡ 0: a gap in the bond."""
