"""The metric W of the quadratic subproblem: a symmetric positive definite matrix and its inverse root.

Wherever Σλ_jρ_jG_j + μI is positive definite it is W itself, and a Cholesky factor is all that is needed. Only
where it is not, its eigenvalues are reversed and bounded from below, at some ten times the cost.

Second derivatives of the pieces of a bundle: dense matrices, or one shared matrix plus a diagonal each.

Where all pieces share the curvature of a smooth part, G_j = B + diag(h_j), products with N pieces cost O(n² + Nn)
instead of O(Nn²) and the bundle stores N vectors instead of N matrices. An oracle says so by returning a
`DiagonalShift`; every other oracle returns a dense symmetric matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Metric(Protocol):
    """W, W^{−½} on rows and its transpose on a vector, with (W^{−½})ᵀ W^{−½} = W⁻¹."""

    @property
    def matrix(self) -> Array: ...
    def whiten(self, vectors: Array) -> Array: ...
    def unwhiten(self, z: Array) -> Array: ...


@dataclass(frozen=True, eq=False)
class EigenMetric:
    """W = V diag(w) Vᵀ with w > 0.

    w: (n,) eigenvalues
    V: (n, n) eigenvectors in columns
    """

    w: Array
    V: Array

    @cached_property
    def matrix(self) -> Array:
        """W as a dense matrix (n, n)."""
        return (self.V * self.w) @ self.V.T

    def whiten(self, vectors: Array) -> Array:
        """W^{−½} applied to each row."""
        return (vectors @ self.V) / np.sqrt(self.w)

    def unwhiten(self, z: Array) -> Array:
        """W^{−½} from the left, back to the original coordinates."""
        return self.V @ (z / np.sqrt(self.w))


@dataclass(frozen=True, eq=False)
class CholeskyMetric:
    """W = LLᵀ.

    matrix: (n, n) W
    factor: (n, n) L in Fortran order (upper part not meaningful)
    """

    matrix: Array
    factor: Array

    def whiten(self, vectors: Array) -> Array:
        """L⁻¹ applied to each row (or to one vector)."""
        solved: Array = scipy.linalg.blas.dtrsm(1.0, self.factor, np.atleast_2d(vectors).T, lower=1).T
        return solved if vectors.ndim == 2 else solved[0]

    def unwhiten(self, z: Array) -> Array:
        """L⁻ᵀz."""
        solved: Array = scipy.linalg.blas.dtrsv(self.factor, z, lower=1, trans=1)
        return solved


def cholesky(matrix: Array) -> Array | None:
    """Lower factor of a symmetric matrix, Fortran order, upper part not meaningful; None if not positive definite."""
    factor, info = scipy.linalg.lapack.dpotrf(matrix.T, lower=1, clean=0)
    return factor if info == 0 else None


def positive_definite(H: Array, shift: float, pivot: float, least: float) -> Metric:
    """W: H with negative eigenvalues reversed, plus shift·I; eigenvalues at least pivot·largest and `least`.

    If H + (shift − floor)·I has a Cholesky factor, no eigenvalue needs a change. The floor there uses the norm
    ‖H‖_∞ ≥ largest eigenvalue, so it errs to the side of the eigenvalues.
    """
    n = len(H)
    floor = max(pivot * (float(np.max(np.sum(np.abs(H), axis=1))) + shift), least)
    if floor > 0.0:
        tested = H.copy()
        tested[np.diag_indices(n)] += shift - floor
        if np.min(np.diagonal(tested)) > 0.0 and cholesky(tested) is not None:
            tested[np.diag_indices(n)] = np.diagonal(H) + shift
            factor = cholesky(tested)
            if factor is not None:
                return CholeskyMetric(tested, factor)
    w, V = np.linalg.eigh(H)
    w = np.abs(w) + shift
    floor = max(pivot * float(w.max()), least)
    return EigenMetric(np.maximum(w, floor if floor > 0.0 else 1.0), V)  # all slopes and curvatures 0: any W will do


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
