"""A friction law at every contact node: edges with laws of their own, strength that varies, laws that slip has moved.

At node i the traction is b_i(s) = β_i b((s − a_i)/σ_i), b one of a few shared laws: β_i its strength there, σ_i its
stretch in slip, a_i the slip at which it begins. The distinct b_i are laws of their own and the arrays of their
pieces one table, so that values of many laws cost what values of one do.

`NodalLaws` answers what `FrictionLaw` answers, for slips (m,) one a node: solvers take either. What is rarely needed is
asked of every distinct law on its own nodes (`each`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tcstudy.scene.friction import BEND, UP, FrictionLaw, narrow_pieces
from tcstudy.scene.law_tables import LawTables

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

NONE = FrictionLaw("none", np.zeros(0), *(np.zeros(1) for _ in range(5)))
"""b ≡ 0: a gap in the bond."""


@dataclass(frozen=True, eq=False)
class NodalLaws:
    """The friction laws of m contact nodes.

    table: the laws in use, each once, or laws as they were made, a row a node
    index: (m,) the law of every node among them
    """

    table: LawTables
    index: Index

    def __len__(self) -> int:
        return len(self.index)

    def of(self, nodes: Index | Flags | slice) -> NodalLaws:
        """The laws of the named nodes."""
        return NodalLaws(self.table, self.index[nodes])

    def single(self, node: int) -> FrictionLaw:
        """The law of one node."""
        return self.table.laws[int(self.index[node])]

    def mapped(self, change: Callable[[FrictionLaw], FrictionLaw]) -> NodalLaws:
        """The same with every distinct law changed."""
        return NodalLaws(LawTables.of([change(law) for law in self.table.laws]), self.index)

    @cached_property
    def groups(self) -> list[tuple[FrictionLaw, Index]]:
        """Every law that some node has, with its nodes."""
        used = [(law, np.flatnonzero(self.index == k)) for k, law in enumerate(self.table.laws)]
        return [(law, nodes) for law, nodes in used if len(nodes)]

    @cached_property
    def kinks(self) -> Array:
        """(m, K) kinks, +∞ where a law has fewer [m]."""
        return self.table.kinks[self.index]

    @cached_property
    def _first(self) -> Index:
        """(m,) address of the first piece of every node's law."""
        return self.table.first[self.index]

    @cached_property
    def kinds(self) -> NDArray[np.int8]:
        """(m, K) UP, BEND or DOWN."""
        return self.table.kinds[self.index]

    @property
    def piecewise_linear(self) -> bool:
        """True if no law has an exponential part."""
        return self.table.linear

    @property
    def vanishes(self) -> bool:
        """True if b ≡ 0 at all nodes."""
        return not any(np.any(part[self.index]) for part in (self.table.b_0, self.table.q, self.table.a))

    @property
    def name(self) -> str:
        """The laws' names, for reports."""
        return " | ".join(dict.fromkeys(law.name for law, _ in self.groups))

    @cached_property
    def omega_by_node(self) -> Array:
        """(m,) steepest fall ω_i of every node's law [Pa/m]."""
        return self.table.omega[self.index]

    @property
    def omega(self) -> float:
        """Steepest fall of all [Pa/m]."""
        return float(np.max(self.omega_by_node, initial=0.0))

    @property
    def b_scale(self) -> float:
        """Largest scale of b [Pa]."""
        return float(np.max(self.table.b_scale[self.index], initial=0.0))

    @property
    def s_scale(self) -> float:
        """Least slip over which a b changes [m]; 0 if none has one."""
        return min((law.s_scale for law, _ in self.groups if law.s_scale > 0.0), default=0.0)

    @property
    def without_narrow_pieces(self) -> NodalLaws:
        """As `FrictionLaw.without_narrow_pieces`."""
        if not np.any(narrow_pieces(self.kinks)):
            return self
        return self.mapped(lambda law: law.without_narrow_pieces)

    def scaled(self, s_unit: float, b_unit: float) -> NodalLaws:
        """As `FrictionLaw.scaled`."""
        return self.mapped(lambda law: law.scaled(s_unit, b_unit))

    def piece(self, s: ArrayLike, side: int = 1) -> Index:
        """(m,) index of the piece that holds s, at a kink that to its right (side=1) or left (side=-1)."""
        s = np.broadcast_to(np.asarray(s, dtype=float), len(self))[:, None]
        return np.count_nonzero(s >= self.kinks if side > 0 else s > self.kinks, axis=1)

    def value(self, s: ArrayLike, piece: Index) -> Array:
        """b_k(s) of the named pieces (m,)."""
        return self.table.value(np.asarray(s, dtype=float), self._first + piece)

    def slope(self, s: ArrayLike, piece: Index) -> Array:
        """b_k′(s) of the named pieces (m,)."""
        return self.table.slope(np.asarray(s, dtype=float), self._first + piece)

    def numbers(self, piece: Index) -> tuple[Array, ...]:
        """(s_0, b_0, q, a, r) of the named pieces, (m,) each."""
        return self.table.numbers(self._first + piece)

    def terms(self, s: Array, piece: Index) -> Array:
        """As `FrictionLaw.terms` (m,)."""
        return self.table.terms(s, self._first + piece)

    def b(self, s: ArrayLike, side: int = 1) -> Array:
        """The right (side=1) or left limit of b (m,)."""
        return self.value(s, self.piece(s, side))

    def nearest_kink(self, s: ArrayLike) -> Index:
        """(m,) index of the kink closest to each s, of two as close that to the right; any where there is none."""
        apart = np.abs(np.asarray(s, dtype=float)[:, None] - self.kinks)[:, ::-1]
        return apart.shape[1] - 1 - np.argmin(apart, axis=1)

    def interval(self, s: ArrayLike, tolerance: float = 0.0) -> tuple[Array, Array]:
        """The filled interval b̂(s), slips within `tolerance` of a kink count as on it (m,)."""
        s = np.asarray(s, dtype=float)
        near = self.nearest_kink(s)
        on = np.abs(s - self.kink(near)) <= tolerance
        left, right = self.limits(near)
        left, right = np.where(on, left, self.b(s, -1)), np.where(on, right, self.b(s, +1))
        return np.minimum(left, right), np.maximum(left, right)

    def kink(self, index: Index) -> Array:
        """(m,) slip of the named kink of every node [m]."""
        return np.asarray(self.table.kinks[self.index, index])

    def ends(self, piece: Index) -> tuple[Array, Array]:
        """(left, right) end of the named piece of every node (m,) [m]."""
        return self.table.lower.take(self._first + piece), self.table.upper.take(self._first + piece)

    def on_kink(self, s: Array) -> Flags:
        """(m,) whether s is a kink, to the bit."""
        return np.any(s[:, None] == self.kinks, axis=1)

    def kind_at(self, s: Array) -> NDArray[np.int8]:
        """(m,) UP, BEND or DOWN where s is a kink to the bit, BEND elsewhere."""
        return np.sum(np.where(s[:, None] == self.kinks, self.kinds, BEND), axis=1).astype(np.int8)

    def next_up_jump(self, s: Array, direction: Array) -> Array:
        """(m,) first up-jump strictly beyond s in the sign of `direction`, ±∞ if there is none [m]."""
        up, at = self.kinds == UP, s[:, None]
        above = np.min(np.where(up & (self.kinks > at), self.kinks, np.inf), axis=1)
        below = np.max(np.where(up & (self.kinks < at), self.kinks, -np.inf), axis=1)
        return np.where(direction > 0, above, below)

    def limits(self, index: Index) -> tuple[Array, Array]:
        """(left, right) limit of b at the named kink of every node (m,) [Pa]."""
        left, right = self.table.limits
        return left[self.index, index], right[self.index, index]

    def piece_integral(self, piece: Index, x: Array, y: Array) -> Array:
        """∫_x^y b_k of the named pieces (m,) [Pa·m]."""
        return self.table.piece_integral(self._first + piece, x, y)

    def between_kinks(self, first: Index, last: Index) -> Array:
        """∫ b from one kink of every node to another (m,) [Pa·m]."""
        _, upper = self.table.primitive
        return upper.take(self._first + last) - upper.take(self._first + first)

    def j(self, s: ArrayLike) -> Array:
        """The primitive j(s) of slips (m,) or (m, …) [Pa·m]."""
        return each(self, FrictionLaw.j, np.asarray(s, dtype=float))


Law = FrictionLaw | NodalLaws
"""One law for all nodes, or one a node."""


def each(law: Law, answer: Callable[..., Any], *arrays: Array | Index) -> Any:
    """answer(law, *arrays) for what is independent node by node: of laws by node, asked of each on its own nodes.

    arrays: (m, …); answer gives an array (nodes, …) or a tuple of such
    """
    if isinstance(law, FrictionLaw):
        return answer(law, *arrays)
    parts = [(nodes, answer(own, *(x[nodes] for x in arrays))) for own, nodes in law.groups]
    if not parts:
        return answer(NONE, *arrays)
    if isinstance(parts[0][1], tuple):
        columns = zip(*(part for _, part in parts), strict=True)
        return tuple(_joined(len(law), [nodes for nodes, _ in parts], column) for column in columns)
    return _joined(len(law), [nodes for nodes, _ in parts], [part for _, part in parts])


def _joined(m: int, nodes: list[Index], parts: Sequence[Array]) -> Array:
    whole = np.empty((m, *parts[0].shape[1:]), dtype=parts[0].dtype)
    for own, part in zip(nodes, parts, strict=True):
        whole[own] = part
    return whole


def nodal(
    laws: Sequence[FrictionLaw],
    index: ArrayLike,
    stronger: ArrayLike = 1.0,
    stretched: ArrayLike = 1.0,
    moved: ArrayLike = 0.0,
) -> Law:
    """The laws b_i(s) = β_i b((s − a_i)/σ_i) of nodes; the law itself where all nodes have the same.

    laws:      the shared laws b
    index:     (m,) which of them a node has
    stronger:  strength β_i ≥ 0, 0 for a gap in the bond
    stretched: σ_i > 0;  moved: a_i [m];  all (m,) or one number

    Raises ValueError for a strength below 0, a stretch that is not above 0, or numbers that are not finite.
    """
    index = np.asarray(index, dtype=np.intp)
    beta, sigma, a = (np.broadcast_to(np.asarray(x, dtype=float), index.shape) for x in (stronger, stretched, moved))
    if not (np.all(np.isfinite([beta, sigma, a])) and np.all(beta >= 0.0) and np.all(sigma > 0.0)):
        raise ValueError("a node's law needs finite numbers, a strength of at least 0 and a stretch above 0")
    same: dict[FrictionLaw, int] = {}
    first = np.array([same.setdefault(law, k) for k, law in enumerate(laws)], dtype=np.intp)
    gap = (beta == 0.0) | np.array([law.vanishes for law in laws])[index]
    rows = np.stack([np.where(gap, -1, first[index]), *(np.where(gap, 1.0, x) for x in (beta, sigma, a))], axis=1)
    used, at = np.unique(rows, axis=0, return_inverse=True)
    distinct = tuple(NONE if k < 0 else placed(laws[int(k)], b, s, shift) for k, b, s, shift in used.tolist())
    return distinct[0] if len(distinct) == 1 else NodalLaws(LawTables.of(distinct), at.reshape(-1).astype(np.intp))


def times(law: FrictionLaw, strength: float) -> FrictionLaw:
    """The law `strength` × b, b ≡ 0 for 0."""
    if strength == 0.0:
        return NONE
    made = law.made if law.made is None else replace(law.made, strength=strength * law.made.strength)
    return replace(placed(law, strength, 1.0, 0.0), made=made)


def placed(law: FrictionLaw, beta: float, sigma: float, a: float) -> FrictionLaw:
    """The law β b((s − a)/σ); kinks that rounding makes one are a jump."""
    if (beta, sigma, a) == (1.0, 1.0, 0.0):
        return law
    kinks = law.kinks * sigma + a
    kept = np.concatenate([[True], np.diff(kinks) > 0.0, [True]]) if len(kinks) else np.ones(1, dtype=bool)
    pieces = law.s_0 * sigma + a, law.b_0 * beta, law.q * (beta / sigma), law.a * beta, law.r / sigma
    return FrictionLaw(law.name, kinks[kept[1:]], *(x[kept] for x in pieces))


def sticking(law: FrictionLaw | NodalLaws, v: Array) -> NDArray[np.bool_]:
    """(m,) nodes that rest on an up-jump of b."""
    return np.asarray(law.kind_at(v) == UP)
