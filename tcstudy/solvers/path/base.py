"""Inverses of the free nodes' matrix for a base of the tableau, and which pivots a base may take."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.solvers.separable.system import cholesky

Array = NDArray[np.float64]
Index = NDArray[np.intp]

SOUND = 0.05
"""Pivots that shrink below this part of their terms are not taken when the base moves: the node stays a difference."""


class SingularCellError(ArithmeticError):
    """No direction exists: the equations of the cell have lost rank."""


def definite_inverse(H: Array, limit: float) -> tuple[Array, int]:
    """(H⁻¹, −1), or (H, row to leave out) where H is not positive definite or H⁻¹ exceeds the limit."""
    if not len(H):
        return H, -1
    factor, info = cholesky(H.copy())
    if info != 0:
        return H, _centre(H, factor, info - 1)
    inverse, _ = scipy.linalg.lapack.dpotri(factor, lower=1, overwrite_c=1)
    worst = int(np.argmax(np.diagonal(inverse)))
    if not inverse[worst, worst] <= limit:
        return H, worst
    lower = np.tril(inverse)
    return lower + np.tril(lower, -1).T, -1


def _centre(H: Array, factor: Array, k: int) -> int:
    """The row that moves most in the direction of negative curvature which the failing pivot k reveals."""
    if k == 0:
        return 0
    leading = np.asfortranarray(factor[:k, :k])
    direction = np.append(scipy.linalg.lapack.dpotrs(leading, H[:k, k], lower=1)[0], 1.0)
    return int(np.argmax(np.abs(direction)))


def indefinite_inverse(H: Array, limit: float) -> tuple[Array, int]:
    """(H⁻¹, number of negative eigenvalues); raises SingularCellError where H⁻¹ exceeds the limit."""
    _, D, _ = scipy.linalg.ldl(H, check_finite=False)
    negatives = int(np.count_nonzero(scipy.linalg.eigvals_banded(_bands(D)) < 0.0))
    lu, pivots, info = scipy.linalg.lapack.dgetrf(H)
    if info != 0:
        raise SingularCellError
    inverse, _ = scipy.linalg.lapack.dgetri(lu, pivots, overwrite_lu=1)
    if not np.max(np.abs(inverse)) <= limit:
        raise SingularCellError
    return 0.5 * (inverse + inverse.T), negatives


def _bands(D: Array) -> Array:
    """The block-diagonal factor D of LDLᵀ as upper bands."""
    return np.stack([np.concatenate([[0.0], np.diagonal(D, 1)]), np.diagonal(D)])


def sound_pivots(matrix: Array, size: Array) -> Index:
    """Rows of a symmetric matrix that can be pivoted on one after the other without loss; `size`: their own terms."""
    rest = matrix.copy()
    open_rows = np.ones(len(rest), dtype=bool)
    chosen: list[int] = []
    for _ in range(len(rest)):
        sound = np.where(open_rows, np.abs(np.diagonal(rest)) / size, 0.0)
        i = int(np.argmax(sound))
        if not sound[i] > SOUND:
            break
        chosen.append(i)
        open_rows[i] = False
        column = rest[:, i].copy()
        rest -= np.outer(column, column / column[i])
    return np.array(chosen, dtype=np.intp)
