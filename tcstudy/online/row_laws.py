"""The laws of rows of nodes: which law every row or node has, and where and how large it is there.

At node i the friction traction is b(s) = β b_law((s − s_p)/σ): a law of the tables, moved by the slip s_p, stretched by
σ in slip and by β in traction. Rows of one sweep have neither; histories move a law with the slip that has passed, and
edges with laws of their own name a law by node.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.friction import BEND, FrictionLaw
from tcstudy.scene.law_tables import LawTables, Place
from tcstudy.scene.nodal_laws import Law, NodalLaws, nodal
from tcstudy.solvers.bounds import far, largest_push, least_slopes, value_range

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class RowLaws:
    """The friction law of every node of R rows.

    tables:     the laws
    law:        (R, 1) or (R, m) row of the tables
    moved:      slip s_p by which the law is moved, (R, 1) or (R, m); None for 0 [m]
    stretched:  factor σ > 0 of its slips, likewise; None for 1
    stronger:   factor β > 0 of its tractions, likewise; None for 1
    """

    tables: LawTables
    law: Index
    moved: Array | None = None
    stretched: Array | None = None
    stronger: Array | None = None

    def __len__(self) -> int:
        return len(self.law)

    @property
    def plain(self) -> bool:
        """True if every row has one law of the tables, as it stands there."""
        return self.law.shape[1] == 1 and self.moved is None and self.stretched is None and self.stronger is None

    @property
    def by_node(self) -> bool:
        """True if the nodes of a row differ in their laws' steepest falls."""
        factors = (x for x in (self.law, self.stretched, self.stronger) if x is not None)
        return any(x.shape[1] > 1 for x in factors)

    def _each(self, pick: Callable[[Any], Any]) -> RowLaws:
        """The laws of the places that `pick` takes from an array of rows."""
        placed = (x if x is None else pick(x) for x in (self.moved, self.stretched, self.stronger))
        return RowLaws(self.tables, pick(self.law), *placed)

    def take(self, rows: Index | Flags) -> RowLaws:
        """The named rows."""
        return self._each(lambda x: x[rows])

    def nodes(self, row: Index, node: Index) -> RowLaws:
        """The laws of single nodes (n,), each as a row of its own."""
        return self._each(lambda x: x[row, np.minimum(node, x.shape[1] - 1)][:, None])

    def every_second(self) -> RowLaws:
        """The laws of the nodes 0, 2, 4, …"""
        return self._each(lambda x: x if x.shape[1] == 1 else x[:, ::2])

    def placing(self) -> tuple[Array, Array, Array]:
        """(β, σ, s_p) of all rows, (R, 1) or (R, m) each."""
        given = ((self.stronger, 1.0), (self.stretched, 1.0), (self.moved, 0.0))
        beta, sigma, s_p = (np.full((len(self), 1), fill) if x is None else x for x, fill in given)
        return beta, sigma, s_p

    def tabulated(self) -> RowLaws:
        """The same laws with tables that hold those in use, stretched and stronger as they are, and are moved only."""
        if self.stretched is None and self.stronger is None:
            used, law = np.unique(self.law, return_inverse=True)
            return RowLaws(self.tables.take(used), law.reshape(self.law.shape), self.moved)
        each = np.broadcast_arrays(self.law, *self.placing()[1::-1])
        rows = np.stack([x.ravel() for x in each], axis=1).astype(float)
        used, law = np.unique(rows, axis=0, return_inverse=True)
        sigma, beta = (np.asarray(used[:, k], dtype=float) for k in (1, 2))
        tables = self.tables.take(used[:, 0].astype(np.intp)).scaled(sigma, beta)
        return RowLaws(tables, law.reshape(each[0].shape), self.moved)

    @property
    def in_place(self) -> bool:
        """True if no law is moved or stretched in slip: slips are those of the tables."""
        return self.moved is None and self.stretched is None

    def of_row(self, row: int, m: int) -> Law:
        """The laws of one row's m nodes as the single solve takes them."""
        if self.plain:
            return self.tables.law(int(self.law[row, 0]))
        used, index = np.unique(np.broadcast_to(self.law[row], m), return_inverse=True)
        placed = (np.broadcast_to(x[row], m) for x in self.placing())
        return nodal([self.tables.law(int(k)) for k in used], index, *placed)

    def omega_by_node(self) -> Array:
        """(R, 1) or (R, m) steepest fall of every node's law [Pa/m]."""
        return self.traction(self.tables.omega[self.law], -1)

    def own_slip(self, s: Array) -> Array:
        """Slips as the tables count them."""
        s = s if self.moved is None else s - self.moved
        return s if self.stretched is None else s / self.stretched

    def slip(self, t: Array) -> Array:
        """Slips of the nodes from those of the tables."""
        t = t if self.stretched is None else t * self.stretched
        return t if self.moved is None else t + self.moved

    def own_traction(self, value: Array) -> Array:
        """Tractions as the tables count them."""
        return value if self.stronger is None else value / self.stronger

    def traction(self, value: Array, slips: int = 0) -> Array:
        """Tractions of the nodes from those of the tables, times σ to the power of `slips`."""
        value = value if self.stronger is None else value * self.stronger
        return value if self.stretched is None or slips == 0 else value * self.stretched**slips

    def b_scale(self) -> Array:
        """(R,) scale of b in every row [Pa]."""
        return np.asarray(np.max(self.traction(self.tables.b_scale[self.law]), axis=1))

    def omega(self) -> Array:
        """(R,) steepest fall of b in every row [Pa/m]."""
        return np.asarray(np.max(self.omega_by_node(), axis=1))

    def locate(self, s: Array) -> Place:
        """Where slips (R, m) sit; on a kink means bitwise on what `kink` gives."""
        if self.moved is None and self.stretched is None:
            return self.tables.locate(self.law, s)
        piece = np.empty(s.shape, dtype=np.intp)
        piece[...] = self.tables.first[self.law]
        for kinks in self.tables.kinks.T:
            piece += s > self.slip(kinks[self.law])
        return Place(piece, s == self.slip(self.tables.upper.take(piece)))

    def value(self, s: Array, piece: Index) -> Array:
        """b of the addressed pieces (R, m) [Pa]."""
        return self.traction(self.tables.value(self.own_slip(s), piece))

    def slope(self, s: Array, piece: Index) -> Array:
        """b′ of the addressed pieces (R, m) [Pa/m]."""
        return self.traction(self.tables.slope(self.own_slip(s), piece), -1)

    def integral(self, x: Array, y: Array, x_at: Place, y_at: Place) -> Array:
        """∫_x^y b (R, m) [Pa·m]."""
        return self.traction(self.tables.integral(self.own_slip(x), self.own_slip(y), x_at, y_at), 1)

    def next_up_jump(self, at: Place, direction: Array) -> Array:
        """First up-jump strictly beyond the slips at `at` in the sign of `direction`, else ±∞ (R, m) [m]."""
        return self.slip(self.tables.next_up_jump(at, direction))

    def ends(self, piece: Index) -> tuple[Array, Array]:
        """(left, right) ends of the addressed pieces (R, m) [m]."""
        return self.slip(self.tables.lower.take(piece)), self.slip(self.tables.upper.take(piece))

    def kind(self, at: Place) -> NDArray[np.int8]:
        """UP, BEND or DOWN where a slip sits on a kink, BEND elsewhere (R, m)."""
        return np.where(at.on, self.tables.kind_above.take(at.piece), BEND).astype(np.int8)

    def interval(self, s: Array, at: Place) -> tuple[Array, Array]:
        """The filled interval b̂(s) (R, m)."""
        left = self.value(s, at.piece)
        right = np.where(at.on, self.value(s, at.piece + at.on), left)
        return np.minimum(left, right), np.maximum(left, right)

    def value_range(self, low: Array, high: Array) -> tuple[Array, Array]:
        """(least, largest) value of the filled graph of b on [low, high] (R, m) [Pa]."""
        least, largest = value_range(self.tables, self.law, self.own_slip(low), self.own_slip(high))
        return self.traction(least), self.traction(largest)

    def least_slope(self, low: Array, high: Array) -> Array:
        """Least slope of b on [low, high], −∞ with a down-jump in it (R, m) [Pa/m]."""
        return self.traction(least_slopes(self.tables, self.law, self.own_slip(low), self.own_slip(high)), -1)

    def largest_push(self) -> Array:
        """(R,) sup over s of −sign(s) b(s), at least 0 [Pa]."""
        if self.moved is None:
            return np.asarray(np.max(self.traction(largest_push(self.tables)[self.law]), axis=1))
        own = far(self.tables)[self.law]  # from `moved`: beyond it b is as it is far away
        reach = np.abs(self.moved) + (own if self.stretched is None else own * self.stretched)
        zero = np.zeros(reach.shape)
        least, _ = self.value_range(zero, reach)
        _, largest = self.value_range(-reach, zero)
        return np.asarray(np.maximum(0.0, np.max(np.maximum(-least, largest), axis=1)))


def row_laws(laws: Sequence[Law], factor: Array) -> RowLaws:
    """The laws of a block, each scaled by the row's stiffness over that of the body; by node where one has them so."""
    known: dict[tuple[int, float], int] = {}  # by identity: a sweep shares its laws, and equal ones only cost time
    rows = [known.setdefault((id(law), f), len(known)) for law, f in zip(laws, factor.tolist(), strict=True)]
    own = [(laws[row], float(factor[row])) for row in np.unique(rows, return_index=True)[1]]
    scaled = [law if f == 1.0 else law.scaled(1.0, f) for law, f in own]
    if all(isinstance(law, FrictionLaw) for law in scaled):
        return RowLaws(LawTables.of([law.single(0) for law in scaled]), np.array(rows, dtype=np.intp)[:, None])
    m = max(len(law) for law in scaled if isinstance(law, NodalLaws))
    tables: list[FrictionLaw] = []
    index = np.empty((len(scaled), m), dtype=np.intp)
    for row, law in zip(index, scaled, strict=True):
        row[:] = len(tables) + (law.index if isinstance(law, NodalLaws) else 0)
        tables += law.table.laws if isinstance(law, NodalLaws) else [law]
    return RowLaws(LawTables.of(tables), index[np.array(rows, dtype=np.intp)])
