"""Dense algebra of one cell: inverses with a limit on their growth, inertia, and what a pivot may lose.

A matrix that is close to singular is no fault here: near a fold, or where b falls on many nodes at once, that is what
cells are like. So every function says what it can vouch for, and the tableau goes another way where it cannot.

Sources: Bunch & Kaufman, Math. Comp. 31 (1977) 163–179 (LDLᵀ of indefinite matrices); Golub & Van Loan, Matrix
Computations (2013), §3.4 (growth in elimination, row scaling).
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.factors import cholesky, negative_direction

Array = NDArray[np.float64]
Index = NDArray[np.intp]
_dgesv, _dgeequ = scipy.linalg.lapack.dgesv, scipy.linalg.lapack.dgeequ

MOST_GROWTH = 100.0
"""Nodes that differ enter the base at once if the inverse of their equations, scaled, is no larger: at most two
digits are lost. Otherwise they are taken one by one, as long as they are sound."""

SOUND = 0.05
"""Pivots that shrink below this part of their terms are not taken when the base moves: the node stays a difference."""

CLEAR = 1e-6
"""Least over largest pivot above which no rank is lost, whatever the scales of rows."""

LOST_RANK = 1e-13
"""Pivots of the small system, its rows scaled to one, below which there is no unique direction."""


class SingularCellError(ArithmeticError):
    """No direction exists: the equations of the cell have lost rank."""


def solved(system: Array, rhs: Array) -> Array:
    """The solution. Raises SingularCellError where the rows, scaled to one, have lost rank.

    Scaling is left out where pivots are far from that without it.
    """
    lu, _, solution, info = _dgesv(system, rhs)
    pivots = np.abs(lu.diagonal())
    if info == 0 and pivots.item(pivots.argmin()) > CLEAR * pivots.item(pivots.argmax()):
        return np.asarray(solution)
    scale, _, _, _, _, info = _dgeequ(system)
    if info != 0 and info <= len(rhs):
        raise SingularCellError
    lu, _, solution, info = _dgesv(system * scale[:, None], rhs * scale)
    if info != 0 or not np.min(np.abs(lu.diagonal())) > LOST_RANK:
        raise SingularCellError
    return np.asarray(solution)


def definite_inverse(H: Array, limit: float) -> tuple[Array, int]:
    """(H⁻¹, −1), or (H, row to leave out) where H is not positive definite or H⁻¹ exceeds the limit."""
    if not len(H):
        return H, -1
    factor, info = cholesky(H.copy())
    if info != 0:
        # the row that moves most in the direction of negative curvature which the failing pivot reveals
        return H, int(np.argmax(np.abs(negative_direction(factor, info, H[info - 1]))))
    inverse = inverse_of(factor)
    worst = int(np.argmax(np.diagonal(inverse)))
    return (inverse, -1) if inverse[worst, worst] <= limit else (H, worst)


def sound_factor(H: Array, limit: float) -> Array | None:
    """Lower factor of H; None where H is not positive definite or ‖H⁻¹‖₁, as it is estimated, exceeds the limit."""
    if not len(H):
        return H
    size = float(np.max(np.sum(np.abs(H), axis=0)))
    factor, info = cholesky(H)
    if info != 0:
        return None
    condition, _ = scipy.linalg.lapack.dpocon(factor, size, uplo="L")
    return factor if condition * size * limit >= 1.0 else None


def inverse_of(factor: Array) -> Array:
    """H⁻¹ from the lower factor of H."""
    if not len(factor):
        return factor
    lower = np.tril(scipy.linalg.lapack.dpotri(factor, lower=1)[0])
    return np.asarray(lower + np.tril(lower, -1).T)


def indefinite_inverse(H: Array, limit: float) -> tuple[Array, int]:
    """(H⁻¹, number of negative eigenvalues); raises SingularCellError where H⁻¹ exceeds the limit."""
    _, D, _ = scipy.linalg.ldl(H, check_finite=False)
    bands = np.stack([np.concatenate([[0.0], np.diagonal(D, 1)]), np.diagonal(D)])
    negatives = int(np.count_nonzero(scipy.linalg.eigvals_banded(bands) < 0.0))
    lu, pivots, info = scipy.linalg.lapack.dgetrf(H)
    if info != 0:
        raise SingularCellError
    inverse, _ = scipy.linalg.lapack.dgetri(lu, pivots, overwrite_lu=1)
    if not np.max(np.abs(inverse)) <= limit:
        raise SingularCellError
    return 0.5 * (inverse + inverse.T), negatives


def positive_eigenvalues(matrix: Array) -> int:
    """How many a symmetric matrix has, by the signs of the pivots of LDLᵀ (a block of two has one of either)."""
    ldu, pivots, _ = scipy.linalg.lapack.dsytrf(matrix, lower=1)
    single = pivots > 0
    return int(np.count_nonzero(ldu.diagonal()[single] > 0.0) + np.count_nonzero(~single) // 2)


def sound_pivots(matrix: Array, size: Array) -> Index:
    """Rows of a symmetric matrix that can be pivoted on one after the other without loss; `size`: their own terms."""
    rest, weight = np.asfortranarray(matrix), 1.0 / size
    chosen: list[int] = []
    for _ in range(len(rest)):
        sound = np.abs(rest.diagonal()) * weight
        i = int(sound.argmax())
        if not sound[i] > SOUND:
            break
        chosen.append(i)
        weight[i] = 0.0
        column = rest[:, i].copy()
        rest = scipy.linalg.blas.dger(-1.0 / column[i], column, column, a=rest, overwrite_a=1)
    return np.array(chosen, dtype=np.intp)
