"""The laws of nodes that remember: as many distinct laws as nodes, new at every step, made as arrays.

Every one is odd about its own origin: N pieces for s > 0, their mirror images for s < 0, and between them an up-jump at
0 or a straight piece through it. `NodalLaws` asks a table of laws; here the table's rows are the nodes, written down
at once instead of being collected from laws, which the solvers' slow paths get when they ask for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.friction import FrictionLaw
from tcstudy.scene.nodal_laws import Flags, Index, LawTable, NodalLaws

Array = NDArray[np.float64]
PARTS = ("s_0", "b_0", "q", "a", "r")
MIRROR = np.array([-1.0, -1.0, 1.0, -1.0, -1.0])[:, None, None]
"""Signs of s_0, b_0, q, a, r in the mirrored piece −b(−s)."""


@dataclass(frozen=True)
class HalfRows:
    """The laws of n nodes for s > 0.

    nodes:  (n,) which nodes;  count: (n,) pieces of each, N ≥ 1
    starts: (n, P) slip at which piece i begins; the first is 0 where there is no centre [m]
    pieces: (5, n, P) s_0, b_0, q, a, r
    centre: (n,) slope of the straight piece through 0, None for an up-jump or a bend there [Pa/m]
    """

    nodes: Index
    count: Index
    starts: Array
    pieces: Array
    centre: Array | None = None

    def whole(self) -> tuple[Array, Array]:
        """(kinks, pieces) for all s, rows filled to the right with kinks at +∞ and their last piece."""
        n, P = self.starts.shape
        middle = 0 if self.centre is None else 1
        N, row = self.count[:, None], np.arange(n)[:, None]
        column = np.arange(2 * P + middle)[None, :]
        left, inner = column < N, (column == N) & (middle == 1)
        at = np.where(left, N - 1 - column, np.clip(column - N - middle, 0, N - 1))
        pieces = self.pieces[:, row, at] * np.where(left, MIRROR, 1.0)
        if self.centre is not None:
            pieces = np.where(inner, 0.0, pieces)
            pieces[2] = np.where(inner, self.centre[:, None], pieces[2])
        column = column[:, :-1]
        below = column < N - 1 + middle
        at = np.where(below, N - 1 - column, np.clip(column - N + 1 - middle, 0, N - 1))
        kinks = self.starts[row, at] * np.where(below, -1.0, 1.0)
        return np.where(column < 2 * N - 1 + middle, kinks, np.inf), pieces + 0.0


class RowTable(LawTable):
    """One law a row, given as arrays.

    kinks: (L, K) with +∞ where a row has fewer;  pieces: five of (L, K+1);  omega: (L,)
    """

    def __init__(self, kinks: Array, pieces: Array, omega: Array) -> None:
        self.__dict__.update(kinks=kinks, pieces=tuple(pieces), omega=omega)

    @cached_property
    def laws(self) -> tuple[FrictionLaw, ...]:
        """The rows as laws, made when somebody asks."""
        finite = np.isfinite(self.kinks).sum(axis=1)
        return tuple(
            FrictionLaw("remembering", self.kinks[i, :k], *(part[i, : k + 1] for part in self.pieces))
            for i, k in enumerate(finite)
        )

    @cached_property
    def linear(self) -> bool:
        """True if no row has an exponential part."""
        return not np.any(self.pieces[3])


@dataclass(frozen=True, eq=False)
class RememberedLaws(NodalLaws):
    """The laws of nodes that remember.

    scale: scale of b of the law that they all come from [Pa]: what a film has lost does not make its residuals larger
    """

    scale: float = 0.0

    @property
    def b_scale(self) -> float:
        """Scale of b before anything was forgotten [Pa]."""
        return self.scale

    @property
    def vanishes(self) -> bool:
        """True if b ≡ 0 at all nodes."""
        return not any(np.any(part[self.index]) for part in (self.table.pieces[i] for i in (1, 2, 3)))

    @property
    def without_narrow_pieces(self) -> RememberedLaws:
        """The laws themselves: they are made without pieces as narrow as rounding."""
        return self

    def of(self, nodes: Index | Flags | slice) -> RememberedLaws:
        """The laws of the named nodes."""
        return RememberedLaws(self.table, self.index[nodes], self.scale)


def laws_of(halves: Sequence[HalfRows], m: int, omega: Array, scale: float) -> RememberedLaws:
    """The laws of m nodes from those of groups of them, which together are all.

    omega: (m,) steepest fall of every node's law [Pa/m];  scale: of b [Pa]
    """
    whole = [half.whole() for half in halves]
    K = max(kinks.shape[1] for kinks, _ in whole)
    kinks, pieces = np.full((m, K), np.inf), np.empty((5, m, K + 1))
    for half, (own_kinks, own_pieces) in zip(halves, whole, strict=True):
        k = own_kinks.shape[1]
        kinks[half.nodes, :k] = own_kinks
        pieces[:, half.nodes, : k + 1] = own_pieces
        pieces[:, half.nodes, k + 1 :] = own_pieces[:, :, -1:]
    return RememberedLaws(RowTable(kinks, pieces, omega), np.arange(m, dtype=np.intp), scale)
