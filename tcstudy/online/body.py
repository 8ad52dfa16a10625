"""One condensed body as plain arrays, with everything that all of its contact problems share.

Nothing here knows a load, a law or a mesh: the record is made once (offline), pickles, and serves any number of
problems 0 ∈ Ãv − l̃ + ∂Ψ(v) on this body. A body whose E varies is one body, too: divide the problem by E.

The coarse copies are Galerkin restrictions to every second contact node with linear interpolation P, Ã_c = PᵀÃP and
c_c = Pᵀc (solvers/separable/newton.py), which give starts; another order of the nodes costs their quality, never
correctness.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.solvers.problem import least_eigenvalue
from tcstudy.solvers.separable.newton import interpolation

Array = NDArray[np.float64]

COARSEST = 40
"""Bodies with at most so many contact nodes have no coarser copy."""


@dataclass(frozen=True, eq=False)
class CondensedBody:
    """What all contact problems on one body share.

    A_tilde:  (m, m) symmetric positive definite, condensed stiffness [Pa]
    c:        (m,) segment lengths meas(S_i) > 0 [m]
    inverse:  (m, m) Ã⁻¹ [1/Pa]
    lambda_1: λ_min(C^{−½}ÃC^{−½}) [Pa/m]
    coarse:   its Galerkin copy on every second node, None for a small body
    """

    A_tilde: Array
    c: Array
    inverse: Array
    lambda_1: float
    coarse: CondensedBody | None

    @classmethod
    def of(cls, A_tilde: Array, c: Array) -> CondensedBody:
        """The record of Ã (m, m) and c (m,); two factorisations and an eigenvalue.

        Raises ValueError if Ã is not positive definite: then the body can move freely.
        """
        A, c = np.array(A_tilde, dtype=float, order="C"), np.array(c, dtype=float)
        factor, info = scipy.linalg.lapack.dpotrf(A, lower=1)
        if info != 0:
            raise ValueError("the condensed stiffness is not positive definite: the body can move freely (clamp it)")
        half = scipy.linalg.lapack.dpotri(factor, lower=1)[0] if len(c) else A
        inverse = np.ascontiguousarray(np.tril(half) + np.tril(half, -1).T)
        return cls(A, c, inverse, least_eigenvalue(A, c), _coarse(A, c) if len(c) > COARSEST else None)

    @property
    def m(self) -> int:
        """Number of contact nodes."""
        return len(self.c)

    def shift(self, margin: float) -> float:
        """μ = margin·λ₁, by how much a matrix must be positive definite, and no less than rounding [Pa/m].

        As in tcstudy/solvers/certificates.py.
        """
        largest = float(np.max(np.diagonal(self.A_tilde) / self.c))
        return max(margin * self.lambda_1, 8.0 * self.m * float(np.finfo(float).eps) * largest)

    def inverse_rounding(self) -> float:
        """Relative rounding of products with Ã⁻¹."""
        condition = float(np.linalg.norm(self.A_tilde, 1) * np.linalg.norm(self.inverse, 1))
        return 8.0 * self.m * float(np.finfo(float).eps) * condition


def _coarse(A: Array, c: Array) -> CondensedBody:
    P = interpolation(len(c))
    coarse = P.T @ (P.T @ A).T
    return CondensedBody.of(0.5 * (coarse + coarse.T), P.T @ c)


def restricted(rows: Array) -> Array:
    """Pᵀ of every row (R, m): loads of the coarser copy (R, ⌈m/2⌉)."""
    coarse = np.array(rows[:, ::2])
    half = 0.5 * rows[:, 1::2]
    coarse[:, : half.shape[1]] += half
    after = half[:, : coarse.shape[1] - 1]
    coarse[:, 1 : 1 + after.shape[1]] += after
    if half.shape[1] == coarse.shape[1]:
        coarse[:, -1] += half[:, -1]  # m is even: the last node has one coarse neighbour only
    return coarse


def prolonged(rows: Array, m: int) -> Array:
    """P of every row (R, ⌈m/2⌉): displacements of m nodes."""
    fine = np.empty((len(rows), m))
    fine[:, ::2] = rows
    right = np.concatenate([rows[:, 1:], rows[:, -1:]], axis=1)
    fine[:, 1::2] = 0.5 * (rows + right)[:, : m // 2]
    return fine
