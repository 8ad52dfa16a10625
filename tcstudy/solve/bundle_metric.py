"""The metric W of the quadratic subproblem: a symmetric positive definite matrix and its inverse root.

Wherever Σλ_jρ_jG_j + μI is positive definite it is W itself, and a Cholesky factor is all that is needed. Only
where it is not, its eigenvalues are reversed and bounded from below, at some ten times the cost.
"""

from __future__ import annotations

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
