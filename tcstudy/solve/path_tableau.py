"""Linear algebra of one cell and its neighbours: a swept matrix plus a small exact correction.

In a cell every node is either free (displacement u_i moves, force g_i = k_i u_i + const with k_i = c_i × slope of b)
or held (u_i fixed, force g_i moves). Increments satisfy Ãu + g = r. For one *base* choice of free nodes F and held
nodes V, with H = A_FF + diag(k), the symmetric swept matrix

    P = [[H⁻¹, H⁻¹A_FV], [A_VF H⁻¹, −(A_VV − A_VF H⁻¹ A_FV)]]

gives the moving coordinates of the base for every r. A cell that differs from the base in the nodes K needs a dense
system of size |K| only, and |K| columns of P: O(m|K|) a cell, and nothing accumulates from cell to cell. When K is
full the base moves to the present cell by one block pivot, O(m²|K|), so a cell costs O(m²) on average, in matrix
products. A fresh factorisation is made when the caller finds the accuracy lost.

The direction along a path is fixed by the speed of one node, not of t: a piece on which the matrix is singular
(t stands still) is nothing special.

Sources: principal pivoting, Cottle, Pang & Stone, The Linear Complementarity Problem (1992), §2.3; inertia through
Haynsworth's formula, Linear Algebra Appl. 1 (1968) 73–81.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

CAPACITY = 48
"""Nodes that may differ from the base: small systems below, matrix products of good width above."""

WORST_GROWTH = 1e8
"""A base whose swept matrix is this much larger than its inverse stiffness should be is not used."""


class SingularCellError(ArithmeticError):
    """No direction exists: the equations of the cell have lost rank."""


class Tableau:
    """Solves the equations of the present cell; `change` moves one node to another piece.

    A:    (m, m) symmetric positive definite stiffness, scaled to O(1)
    load: (m,) load per unit of t, in the same units
    free: (m,) nodes whose displacement moves
    k:    (m,) stiffness that the law adds at a free node (c × slope), 0 at a held one
    """

    def __init__(self, A: Array, load: Array, free: Mask, k: Array) -> None:
        self.A, self.load = A, load
        self.free, self.k = free.copy(), k.copy()
        self.m = len(load)
        self.factorisations = 0
        self.refactor()

    # -- the base ----------------------------------------------------------------------------------

    def refactor(self) -> None:
        """A new base at the present cell, from Ã itself. Nodes that make it singular stay held in the base."""
        base = self.free.copy()
        for _ in range(4):
            swept, negatives, culprit = self._sweep(base)
            if culprit is None:
                break
            base[culprit] = False
        else:
            raise SingularCellError
        self.P = swept
        self.base_negatives = negatives
        self._new_base(base)
        z = self._respond(self.load)
        self.y = z
        for i in np.flatnonzero(self.free & ~base):
            self.change(int(i), True, float(self.k[i]))

    def _new_base(self, base: Mask) -> None:
        self.base_free, self.base_k = base, np.where(base, self.k, 0.0)
        self.sign = np.where(base, 1.0, -1.0)
        self.size = 0
        self.nodes = np.zeros(CAPACITY, dtype=np.intp)
        self.position = np.full(self.m, -1, dtype=np.intp)
        self.columns = np.zeros((self.m, CAPACITY), order="F")
        self.rho, self.nu = np.zeros(CAPACITY), np.zeros(CAPACITY)

    def _sweep(self, base: Mask) -> tuple[Array, int, int | None]:
        """(P, negative eigenvalues of H, None) or (…, …, node to hold) where H is close to singular."""
        self.factorisations += 1
        F, V = np.flatnonzero(base), np.flatnonzero(~base)
        P = np.empty((self.m, self.m), order="F")
        if not len(F):
            np.negative(self.A, out=P)
            return P, 0, None
        H = self.A[np.ix_(F, F)]
        H[np.diag_indices(len(F))] += self.k[F]
        inverse, negatives, info = _inverse(H)
        if inverse is None:
            return P, 0, int(F[info])
        largest = int(np.argmax(np.abs(np.diagonal(inverse))))
        if not np.max(np.abs(inverse)) * np.max(np.abs(np.diagonal(self.A))) < WORST_GROWTH * self.m:
            return P, 0, int(F[largest])
        P[np.ix_(F, F)] = inverse
        if len(V):
            A_FV = self.A[np.ix_(F, V)]
            X = inverse @ A_FV
            P[np.ix_(F, V)], P[np.ix_(V, F)] = X, X.T
            S = A_FV.T @ X
            P[np.ix_(V, V)] = 0.5 * (S + S.T) - self.A[np.ix_(V, V)]
        return P, negatives, None

    def rebase(self) -> None:
        """Move the base to the present cell by one block pivot on the nodes that differ."""
        n = self.size
        if n == 0:
            return
        negatives = self.negatives()
        K = self.nodes[:n].copy()
        sign, rho, nu = self.sign[K], self.rho[:n], self.nu[:n]
        capacitance = self._capacitance()
        rows = self.P[:, K].T
        try:
            solved = np.linalg.solve(capacitance, np.concatenate([rows, np.diag(sign)], axis=1))
        except np.linalg.LinAlgError:
            return self.refactor()
        W, inverse = solved[:, : self.m], solved[:, self.m :]
        if not np.max(np.abs(W)) < WORST_GROWTH * self.m:
            return self.refactor()
        out, slope = self.base_free[K] & ~self.free[K], self.base_free[K] & self.free[K]
        mu = np.where(slope, -rho, 1.0)
        shift = np.where(out, self.base_k[K], np.where(slope, -rho, 0.0))
        y_K = inverse @ self.y[K]
        y = self.y - self.columns[:, :n] @ y_K
        y[K] = nu * y_K
        self.P = scipy.linalg.blas.dgemm(-1.0, rows, W, beta=1.0, c=self.P, trans_a=1, overwrite_c=1)
        turned = np.where(self.free[K], 1.0, -1.0)
        block = (turned * nu)[:, None] * W
        corner = turned[:, None] * (nu[:, None] * inverse * mu[None, :] - np.diag(shift))
        block[:, K] = 0.5 * (corner + corner.T)
        self.P[K, :] = block
        self.P[:, K] = block.T
        self.y, self.base_negatives = y, negatives
        self._new_base(self.free.copy())

    # -- the present cell --------------------------------------------------------------------------

    def change(self, i: int, free: bool, k: float) -> None:
        """Move node i to a piece on which it is free with stiffness k, or held."""
        if self.position[i] < 0 and self.size == CAPACITY:
            self.rebase()
        self.free[i], self.k[i] = free, k
        base_free, at = self.base_free[i], int(self.position[i])
        if free == base_free and (not free or k == self.base_k[i]):
            if at >= 0:
                self._drop(at)
            return
        if at < 0:
            at = self.size
            self.size += 1
            self.nodes[at], self.position[i] = i, at
            np.multiply(self.sign, self.P[:, i], out=self.columns[:, at])
        if not free:
            self.rho[at], self.nu[at] = 0.0, 1.0
        elif base_free:
            self.rho[at] = self.nu[at] = 1.0 / (k - self.base_k[i])
        else:
            self.rho[at], self.nu[at] = k, 1.0

    def change_many(self, nodes: Index, free: Mask, k: Array) -> None:
        """Move several nodes; with more than fit beside the base it is made anew."""
        if len(nodes) > CAPACITY // 2:
            self.free[nodes], self.k[nodes] = free, k
            return self.refactor()
        if self.size + len(nodes) > CAPACITY:
            self.rebase()
        for i, is_free, stiffness in zip(nodes, free, k, strict=True):
            self.change(int(i), bool(is_free), float(stiffness))

    def _drop(self, at: int) -> None:
        last = self.size - 1
        self.position[self.nodes[at]] = -1
        if at != last:
            self.nodes[at] = self.nodes[last]
            self.position[self.nodes[at]] = at
            self.columns[:, at] = self.columns[:, last]
            self.rho[at], self.nu[at] = self.rho[last], self.nu[last]
        self.size = last

    def direction(self, node: int | None, speed: float) -> tuple[Array, float]:
        """(dx, dt): motion of the moving coordinates and of t along the path, with dx[node] = speed.

        node: None fixes dt = speed instead. Raises SingularCellError if the cell has no such direction.
        """
        return self._solve(None, node, speed)

    def correction(self, r: Array, node: int | None) -> tuple[Array, float]:
        """(δx, δt) that removes the residual r of Ãu + g = l̃ with node (or t, if None) held where it is."""
        return self._solve(self._respond(r), node, 0.0)

    def _solve(self, z: Array | None, node: int | None, speed: float) -> tuple[Array, float]:
        n = self.size
        K = self.nodes[:n]
        columns = self.columns[:, :n]
        system = np.zeros((n + 1, n + 1), order="F")
        rhs = np.zeros(n + 1)
        system[:n, :n] = columns[K]
        system[np.arange(n), np.arange(n)] += self.rho[:n]
        system[:n, n] = -self.y[K]
        rhs[n] = speed
        if z is not None:
            rhs[:n] = z[K]
        if node is None:
            system[n, n] = 1.0
        elif self.position[node] >= 0:
            system[n, self.position[node]] = self.nu[self.position[node]]
        else:
            system[n, :n], system[n, n] = -columns[node], self.y[node]
            if z is not None:
                rhs[n] -= z[node]
        _, _, solution, info = scipy.linalg.lapack.dgesv(system, rhs, overwrite_a=1, overwrite_b=1)
        if info != 0:
            raise SingularCellError
        excess, dt = solution[:n], float(solution[n])
        dx = self.y * dt - columns @ excess
        if z is not None:
            dx += z
        dx[K] = self.nu[:n] * excess
        if not (np.isfinite(dt) and np.all(np.isfinite(dx))):
            raise SingularCellError
        return dx, dt

    def _respond(self, r: Array) -> Array:
        """Moving coordinates of the base for the load r."""
        on_free = np.where(self.base_free, r, 0.0)
        return self.sign * (self.P @ on_free) + np.where(self.base_free, 0.0, r)

    def _capacitance(self) -> Array:
        K, n = self.nodes[: self.size], self.size
        small = self.P[np.ix_(K, K)]
        small[np.arange(n), np.arange(n)] += self.sign[K] * self.rho[:n]
        return small

    def negatives(self) -> int:
        """Negative eigenvalues of A_FF + diag(k) over the free nodes of the present cell."""
        if self.size == 0:
            return self.base_negatives
        K = self.nodes[: self.size]
        small = self._capacitance()
        positive = int(np.count_nonzero(np.linalg.eigvalsh(small) > 0.0))
        out = self.base_free[K] & ~self.free[K]
        stiffer = self.base_free[K] & self.free[K] & (self.k[K] > self.base_k[K])
        return self.base_negatives + positive - int(np.count_nonzero(out | stiffer))


def _inverse(H: Array) -> tuple[Array | None, int, int]:
    """(H⁻¹, number of negative eigenvalues, 0), or (None, 0, index of a zero pivot)."""
    factor, info = scipy.linalg.lapack.dpotrf(H, lower=1, clean=0)
    if info == 0:
        inverse, _ = scipy.linalg.lapack.dpotri(factor, lower=1, overwrite_c=1)
        lower = np.tril(inverse)
        return lower + np.tril(lower, -1).T, 0, 0
    _, D, _ = scipy.linalg.ldl(H, check_finite=False)
    negatives = int(np.count_nonzero(scipy.linalg.eigvals_banded(_bands(D)) < 0.0))
    lu, pivots, info = scipy.linalg.lapack.dgetrf(H)
    if info != 0:
        return None, 0, info - 1
    inverse, _ = scipy.linalg.lapack.dgetri(lu, pivots, overwrite_lu=1)
    return 0.5 * (inverse + inverse.T), negatives, 0


def _bands(D: Array) -> Array:
    """The block-diagonal factor D of LDLᵀ as upper bands."""
    return np.stack([np.concatenate([[0.0], np.diagonal(D, 1)]), np.diagonal(D)])
