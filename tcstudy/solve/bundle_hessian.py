"""Second derivatives of the pieces of a bundle: dense matrices, or one shared matrix plus a diagonal each.

Where all pieces share the curvature of a smooth part, G_j = B + diag(h_j), products with N pieces cost O(n² + Nn)
instead of O(Nn²) and the bundle stores N vectors instead of N matrices. An oracle says so by returning a
`DiagonalShift`; every other oracle returns a dense symmetric matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DiagonalShift:
    """G = B + diag(h).

    base:     (n, n) symmetric B, the same object for all pieces of a run
    diagonal: (n,) h
    """

    base: Array
    diagonal: Array

    def __matmul__(self, vector: Array) -> Array:
        product: Array = self.base @ vector + self.diagonal * vector
        return product

    def __array__(self, dtype: object = None, copy: bool | None = None) -> Array:
        return self.base + np.diag(self.diagonal)


Hessian = Array | DiagonalShift


def shared_base(hessians: Sequence[Hessian]) -> Array | None:
    """B if all are DiagonalShifts of one and the same matrix object, else None."""
    first = hessians[0]
    if not isinstance(first, DiagonalShift):
        return None
    same = all(isinstance(G, DiagonalShift) and G.base is first.base for G in hessians)
    return first.base if same else None


def combine(hessians: Sequence[Hessian], weights: Array) -> Hessian:
    """Σ w_j G_j; a DiagonalShift of the same base if all are and Σ w_j = 1 (then nothing is lost), else dense."""
    base = shared_base(hessians)
    if base is not None and abs(float(weights.sum()) - 1.0) <= 1e-12:
        return DiagonalShift(base, weights @ np.array([G.diagonal for G in hessians if isinstance(G, DiagonalShift)]))
    return Stack.of(hessians).combine(weights)


@dataclass(frozen=True, eq=False)
class Stack:
    """The G_j of a bundle, ready for products with all of them; base and diagonals, or dense.

    base:      (n, n) B, None if dense
    diagonals: (N, n) h_j in rows, without rows if dense
    dense:     the N matrices if there is no common base
    """

    base: Array | None
    diagonals: Array
    dense: Sequence[Array]

    @staticmethod
    def of(hessians: Sequence[Hessian]) -> Stack:
        """The stack of the given matrices (nothing of size n² is copied unless structured and dense are mixed)."""
        base = shared_base(hessians)
        if base is not None:
            return Stack(base, np.array([G.diagonal for G in hessians if isinstance(G, DiagonalShift)]), ())
        return Stack(None, np.zeros((0, 0)), tuple(np.asarray(G) for G in hessians))

    def times(self, d: Array) -> Array:
        """(N, n) G_j d; one d (n,) for all pieces."""
        if self.base is not None:
            return self.base @ d + self.diagonals * d
        return np.array([G @ d for G in self.dense])

    def times_rows(self, rows: Array) -> Array:
        """(N, n) G_j δ_j; a row δ_j (N, n) for each piece."""
        if self.base is not None:
            return rows @ self.base + self.diagonals * rows
        return np.array([G @ row for G, row in zip(self.dense, rows, strict=True)])

    def combine(self, weights: Array) -> Array:
        """(n, n) Σ w_j G_j as a new dense matrix."""
        if self.base is not None:
            total = float(weights.sum()) * self.base
            total[np.diag_indices(len(total))] += weights @ self.diagonals
            return total
        used = np.flatnonzero(weights)
        total = np.zeros_like(self.dense[0], dtype=float)
        for j in map(int, used):
            total += weights[j] * self.dense[j]
        return total
