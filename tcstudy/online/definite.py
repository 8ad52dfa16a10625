"""Which of many matrices Ã + C diag(s_r − μ) are positive definite, with as few factorisations as may be.

If the matrix with the pointwise least diagonal of a group is positive definite, all of the group are. If its Cholesky
factorisation breaks down, the direction d of negative curvature refutes every row with dᵀ(Ã + C diag(s_r − μ))d ≤ 0 at
the price of a product; what is left is halved.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.online.body import Body
from tcstudy.solve.separable.system import cholesky

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]


def definite(body: Body, slope: Array, margin: float) -> Flags:
    """(R,) whether Ã + C diag(slope − μ) ≻ 0 is proved, for rows of slopes (R, m) [Pa/m]."""
    proved = np.zeros(len(slope), dtype=bool)
    if body.m == 0:
        return ~proved
    diagonal = np.diagonal(body.A_tilde)
    lowered = diagonal + body.c * (slope - body.shift(margin))
    open_ = np.flatnonzero(np.all(lowered > 0.0, axis=1))
    groups = [open_[np.argsort(lowered[open_].sum(axis=1), kind="stable")]]
    while groups:
        group = groups.pop()
        if not len(group):
            continue
        direction = _refutation(body.A_tilde, lowered[group].min(axis=0))
        if direction is None:
            proved[group] = True
            continue
        squares = direction**2
        fixed = float(direction @ (body.A_tilde @ direction) - diagonal @ squares)
        groups = [own[fixed + lowered[own] @ squares > 0.0] for own in groups]
        if len(group) > 1:
            group = group[fixed + lowered[group] @ squares > 0.0]
            half = (len(group) + 1) // 2
            groups += [group[:half], group[half:]]
    return proved


def _refutation(A: Array, diagonal: Array) -> Array | None:
    """None if A with that diagonal has a Cholesky factor, else the direction of its failing pivot (m,)."""
    matrix = A.copy()
    matrix.reshape(-1)[:: len(A) + 1] = diagonal
    factor, info = cholesky(matrix)
    if info == 0:
        return None
    k = info - 1
    direction = np.zeros(len(A))
    direction[k] = 1.0
    if k:
        direction[:k] = -scipy.linalg.lapack.dpotrs(np.asfortranarray(factor[:k, :k]), A[k, :k], lower=1)[0]
    return direction
