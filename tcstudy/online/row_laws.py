"""The laws of rows of nodes: which law of the tables every row or node has.

Edges with laws of their own, and strength that varies, name a law by node; most sweeps one by row.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.friction import BEND, FrictionLaw
from tcstudy.scene.law_tables import LawTables, Place
from tcstudy.scene.nodal_laws import Law, NodalLaws, nodal

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class RowLaws:
    """The friction law of every node of R rows.

    tables: the laws;  law: (R, 1) or (R, m) row of the tables
    """

    tables: LawTables
    law: Index

    @property
    def by_node(self) -> bool:
        """True if the nodes of a row may have different laws."""
        return self.law.shape[1] > 1

    def take(self, rows: Index | Flags) -> RowLaws:
        """The named rows."""
        return RowLaws(self.tables, self.law[rows])

    def nodes(self, row: Index, node: Index) -> RowLaws:
        """The laws of single nodes (n,), each as a row of its own."""
        return RowLaws(self.tables, self.law[row, np.minimum(node, self.law.shape[1] - 1)][:, None])

    def every_second(self) -> RowLaws:
        """The laws of the nodes 0, 2, 4, …"""
        return RowLaws(self.tables, self.law[:, ::2])

    def in_use(self) -> RowLaws:
        """The same laws with tables that hold those in use."""
        used, law = np.unique(self.law, return_inverse=True)
        return RowLaws(self.tables.take(used), law.reshape(self.law.shape))

    def of_row(self, row: int) -> Law:
        """The laws of one row's nodes as the single solve takes them."""
        if not self.by_node:
            return self.tables.law(int(self.law[row, 0]))
        used, index = np.unique(self.law[row], return_inverse=True)
        return nodal([self.tables.law(int(k)) for k in used], index)

    def omega(self) -> Array:
        """(R,) steepest fall of b in every row [Pa/m]."""
        return np.asarray(np.max(self.tables.omega[self.law], axis=1))

    def locate(self, s: Array) -> Place:
        """Where slips (R, m) sit."""
        return self.tables.locate(self.law, s)

    def kind(self, at: Place) -> NDArray[np.int8]:
        """UP, BEND or DOWN where a slip sits on a kink, BEND elsewhere (R, m)."""
        return np.where(at.on, self.tables.kind_above.take(at.piece), BEND).astype(np.int8)

    def interval(self, s: Array, at: Place) -> tuple[Array, Array]:
        """The filled interval b̂(s) (R, m)."""
        left = self.tables.value(s, at.piece)
        right = np.where(at.on, self.tables.value(s, at.piece + at.on), left)
        return np.minimum(left, right), np.maximum(left, right)


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
