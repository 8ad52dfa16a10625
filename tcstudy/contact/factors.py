"""Cholesky factors of parts of Ã with something added on the diagonal, and directions in which there is none."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def with_diagonal(M: Array, nodes: Index, added: Array) -> Array:
    """M[nodes, nodes] + diag `added`."""
    matrix = M.take(nodes, axis=0).take(nodes, axis=1)  # faster than one fancy index
    matrix.reshape(-1)[:: len(nodes) + 1] += added
    return matrix


def cholesky(matrix: Array) -> tuple[Array, int]:
    """Lower factor of a symmetric C-ordered matrix (overwritten) and LAPACK's info (0 if positive definite)."""
    factor, info = scipy.linalg.lapack.dpotrf(matrix.T, lower=1, clean=0, overwrite_a=1)
    return factor, int(info)


def factor_free(A_tilde: Array, free: Index, added: Array) -> tuple[Array, int]:
    """Cholesky factor of A_FF + diag `added` and LAPACK's info (0 if positive definite)."""
    return cholesky(with_diagonal(A_tilde, free, added)) if len(free) else (np.zeros((0, 0)), 0)


def negative_curvature(A_tilde: Array, free: Index, added: Array) -> Array | None:
    """(n,) d with dᵀ(A_FF + diag `added`)d ≤ 0, None if that matrix is positive definite.

    Where the factorisation breaks down at a pivot, d solves the equations of the nodes before it.
    """
    diagonal = np.diagonal(A_tilde)[free]
    if np.any(diagonal + added <= 0.0):
        return np.where(np.arange(len(free)) == np.argmin((diagonal + added) / diagonal), 1.0, 0.0)
    factor, info = factor_free(A_tilde, free, added)
    if info == 0:
        return None
    k, direction = info - 1, np.zeros(len(free))
    direction[k] = 1.0
    if k:
        row = A_tilde[free[k], free[:k]]
        direction[:k] = -scipy.linalg.lapack.dpotrs(np.asfortranarray(factor[:k, :k]), row, lower=1)[0]
    return direction
