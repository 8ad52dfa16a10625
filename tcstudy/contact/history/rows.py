"""The laws of nodes that remember: as many distinct laws as nodes, new at every step, made as arrays.

Every one is odd about its own origin: N pieces for s > 0, their mirror images for s < 0, and between them an up-jump at
0 or a straight piece through it. The rows of the tables are the nodes, written down at once instead of being
collected from laws.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import Index

Array = NDArray[np.float64]
MIRROR = np.array([-1.0, -1.0, 1.0, -1.0, -1.0, -1.0, -1.0])[:, None, None]
"""Signs of s_0, b_0, q, a, r, a_2, r_2 in the mirrored piece −b(−s)."""


@dataclass(frozen=True)
class HalfRows:
    """The laws of n nodes for s > 0.

    nodes:  (n,) which nodes;  count: (n,) pieces of each, N ≥ 1
    starts: (n, P) slip at which piece i begins; the first is 0 where there is no centre [m]
    pieces: (5, n, P) s_0, b_0, q, a, r, or (7, n, P) with a_2, r_2
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
        pieces = self.pieces[:, row, at] * np.where(left, MIRROR[: len(self.pieces)], 1.0)
        if self.centre is not None:
            pieces = np.where(inner, 0.0, pieces)
            pieces[2] = np.where(inner, self.centre[:, None], pieces[2])
        column = column[:, :-1]
        below = column < N - 1 + middle
        at = np.where(below, N - 1 - column, np.clip(column - N + 1 - middle, 0, N - 1))
        kinks = self.starts[row, at] * np.where(below, -1.0, 1.0)
        return np.where(column < 2 * N - 1 + middle, kinks, np.inf), pieces + 0.0


def laws_of(halves: Sequence[HalfRows], m: int, omega: Array, scale: float) -> Laws:
    """The laws of m nodes from those of groups of them, which together are all.

    omega: (m,) steepest fall of every node's law [Pa/m]
    scale: of b before anything was forgotten: what a film has lost does not make its residuals larger [Pa]
    """
    whole = [half.whole() for half in halves]
    K = max(kinks.shape[1] for kinks, _ in whole)
    kinks, pieces = np.full((m, K), np.inf), np.zeros((max(len(own) for _, own in whole), m, K + 1))
    for half, (own_kinks, own_pieces) in zip(halves, whole, strict=True):
        k = own_kinks.shape[1]
        kinks[half.nodes, :k] = own_kinks
        pieces[: len(own_pieces), half.nodes, : k + 1] = own_pieces
        pieces[: len(own_pieces), half.nodes, k + 1 :] = own_pieces[:, :, -1:]
    found = Laws("row", kinks, *pieces, index=np.arange(m, dtype=np.intp))
    return found.known(scales=np.full(m, scale), falls=omega)
