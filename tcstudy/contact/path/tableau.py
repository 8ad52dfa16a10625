"""Linear algebra of one cell and its neighbours: a swept matrix plus a small exact correction.

In a cell every node is either free (displacement u_i moves, force g_i = k_i u_i + const with k_i = c_i × slope of b)
or held (u_i fixed, force g_i moves). Increments satisfy Ãu + g = r. For one *base* choice of free nodes F and held
nodes V, with H = A_FF + diag(k), the symmetric swept matrix

    P = [[H⁻¹, H⁻¹A_FV], [A_VF H⁻¹, −(A_VV − A_VF H⁻¹ A_FV)]]

gives the moving coordinates of the base for every r. A cell that differs from the base in the nodes K needs a dense
system of size |K| only, and |K| columns of P: O(m|K|) a cell, and nothing accumulates from cell to cell. When K is
full the base moves to the present cell by one block pivot, O(m²|K|), so a cell costs O(m²) on average, in matrix
products. The caller asks for a fresh factorisation when it finds the accuracy lost. P itself is made when the base
first moves: few cells need few of its columns, which the factor of H gives.

The direction along a path is fixed by the speed of one node, not of t: a piece on which the matrix is singular
(t stands still) is nothing special.

Sources: principal pivoting, Cottle, Pang & Stone, The Linear Complementarity Problem (1992), §2.3; inertia through
Haynsworth's formula, Linear Algebra Appl. 1 (1968) 73–81.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.factors import submatrix
from tcstudy.contact.path.dense import (
    MOST_GROWTH,
    SingularCellError,
    definite_inverse,
    indefinite_inverse,
    inverse_of,
    positive_eigenvalues,
    solved,
    sound_factor,
    sound_pivots,
)

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
_dgesv, _dgemv = scipy.linalg.lapack.dgesv, scipy.linalg.blas.dgemv

CAPACITY = 32
"""Nodes that may differ from the base: small systems below, matrix products of good width above."""

GROWTH = 30.0
"""H⁻¹ of a base may exceed the body's own compliance by this much; near a fold nodes are held in the base."""

WORST_GROWTH = 1e8
"""By more than this it is worthless."""

MAX_HELD = 6
"""Nodes held in the base at most to make it definite and well conditioned."""


class Tableau:
    """Solves the equations of the present cell; `change` moves one node to another piece.

    A:    (m, m) symmetric positive definite stiffness, scaled to O(1)
    load: (m,) load per unit of t, in the same units
    compliance: largest diagonal entry of A⁻¹, roughly
    free: (m,) nodes whose displacement moves
    k:    (m,) stiffness that the law adds at a free node (c × slope), 0 at a held one
    spread: ‖A⁻¹‖₁, roughly; 0 takes the compliance
    """

    def __init__(self, A: Array, load: Array, compliance: float, free: Mask, k: Array, spread: float = 0.0) -> None:
        self.A, self.load, self.compliance, self.spread = A, load, compliance, max(spread, compliance)
        self.free, self.k = free.copy(), k.copy()
        self.m = len(load)
        self.load_size = float(np.max(np.abs(load)))
        self.factorisations = 0
        self.nodes = np.zeros(CAPACITY, dtype=np.intp)
        self.columns = np.zeros((self.m, CAPACITY), order="F")
        self.own, self.gain = np.zeros(CAPACITY), np.zeros(CAPACITY)
        self.small = np.zeros((CAPACITY, CAPACITY), order="F")
        self.matrix = np.zeros((CAPACITY + 1, CAPACITY + 1), order="F")
        self.refactor()

    def refactor(self) -> None:
        """A new base at the present cell, from Ã itself.

        Nodes without which H is positive definite and well conditioned are held in the base; they are few where b
        falls on a short stretch only. If they are not, H itself is inverted, indefinite as it is.
        """
        self.factorisations += 1
        self.inner, self.base_negatives = np.flatnonzero(self.free), 0
        self.P: Array | None = None
        self.factor, base = sound_factor(self._H(self.inner), GROWTH * self.spread), self.free.copy()
        if self.factor is None:
            base = self._inverted()
        self._new_base(base, np.where(base, self.k, 0.0))
        self.y = self._respond(self.load)
        for i in np.flatnonzero(self.free & ~base):
            self.change(int(i), True, float(self.k[i]))

    def _inverted(self) -> Mask:
        """The nodes that are free in the base; P is made of the inverse."""
        base = self.free.copy()
        for _ in range(MAX_HELD):
            F = np.flatnonzero(base)
            inverse, culprit = definite_inverse(self._H(F), GROWTH * self.compliance)
            if culprit < 0:
                self.P = self._swept(base, inverse)
                return base
            base[F[culprit]] = False
        base = self.free.copy()
        limit = WORST_GROWTH * self.compliance
        inverse, self.base_negatives = indefinite_inverse(self._H(np.flatnonzero(base)), limit)
        self.P = self._swept(base, inverse)
        return base

    def reload(self, load: Array) -> None:
        """Another load per unit of t."""
        self.load, self.load_size = load, float(np.max(np.abs(load)))
        self.y = self._respond(load)
        n = self.size
        self.matrix[1 : n + 1, 0] = self.y[self.nodes[:n]] * (-1.0 / self.load_size)

    def _H(self, F: Index) -> Array:
        H = submatrix(self.A, F)
        H[np.diag_indices(len(F))] += self.k[F]
        return H

    def _new_base(self, base: Mask, k: Array) -> None:
        self.base_free, self.base_k = base, k
        self.sign = np.where(base, 1.0, -1.0)
        self.size = 0
        self.position = np.full(self.m, -1, dtype=np.intp)

    def _swept(self, base: Mask, inverse: Array) -> Array:
        """P from H⁻¹."""
        F, V = np.flatnonzero(base), np.flatnonzero(~base)
        if not len(V):
            return np.asfortranarray(inverse)
        if not len(F):
            return np.asfortranarray(-self.A)
        P = np.empty((self.m, self.m), order="F")
        A_FV = self.A[np.ix_(F, V)]
        X = inverse @ A_FV
        P[np.ix_(F, F)], P[np.ix_(F, V)], P[np.ix_(V, F)] = inverse, X, X.T
        S = A_FV.T @ X
        P[np.ix_(V, V)] = 0.5 * (S + S.T) - submatrix(self.A, V)
        return P

    def _column(self, i: int) -> Array:
        """Column i of P."""
        if self.P is not None:
            return np.asarray(self.P[:, i])
        on_free = np.zeros(self.m)
        if len(self.inner):
            rhs = self.A[self.inner, i] if not self.base_free[i] else (self.inner == i).astype(float)
            on_free[self.inner] = self._solved(rhs)
        column = self.A @ on_free if self.base_free[i] else self.A @ on_free - self.A[:, i]
        return np.where(self.base_free, on_free, column)

    def _solved(self, rhs: Array) -> Array:
        """H⁻¹ rhs of the base, from its factor."""
        return np.asarray(scipy.linalg.lapack.dpotrs(self.factor, rhs, lower=1)[0])

    def rebase(self) -> None:
        """Move the base to the present cell by one block pivot on the nodes that differ, except unsound pivots."""
        if (n := self.size) == 0:
            return None
        if self.P is None and self.factor is not None:
            self.P = self._swept(self.base_free, inverse_of(self.factor))
        inverse, capacitance = self._small_inverse()
        if inverse is not None:
            return self._pivot(inverse, capacitance)
        chosen = sound_pivots(*self._capacitance())
        if len(chosen) < n // 2:
            return self.refactor()
        left = [(int(i), bool(self.free[i]), float(self.k[i])) for i in np.delete(self.nodes[:n], chosen)]
        for i, _, _ in left:
            self.change(i, bool(self.base_free[i]), float(self.base_k[i]))
        inverse, capacitance = self._small_inverse(limit=np.inf)
        if inverse is None:
            return self.refactor()
        self._pivot(inverse, capacitance)
        for i, free, k in left:
            self.change(i, free, k)
        return None

    def _small_inverse(self, limit: float = MOST_GROWTH) -> tuple[Array | None, Array]:
        """(inverse of the equations of the nodes that differ, these in symmetric form).

        None for the inverse where it exceeds the limit, every node's equation scaled by its own terms: a pivot on all
        nodes at once would lose digits. On its diagonal stand the reciprocals of the pivots, each taken last.
        """
        n = self.size
        inverse, info = _dgesv(self._system(), np.eye(n))[2:]
        capacitance, size = self._capacitance()
        root, term = np.sqrt(np.abs(self.gain[:n])), np.sqrt(size)
        sound = info == 0 and np.max(np.abs(inverse) * np.outer(root * term, term / root)) < limit
        return (inverse if sound else None), capacitance

    def _pivot(self, inverse: Array, capacitance: Array) -> None:
        """Block pivot on all nodes that differ from the base."""
        n = self.size
        K, gain = self.nodes[:n].copy(), self.gain[:n]
        rows = self.columns[:, :n] * self.sign[:, None]
        exchanged = np.flatnonzero(self.base_free[K] != self.free[K])
        X = (inverse * self.sign[K]) @ rows.T
        X[:, K[exchanged]] = inverse[:, exchanged]
        y_K = inverse @ self.y[K]
        y = _dgemv(-1.0, self.columns[:, :n], gain * y_K, 1.0, self.y)
        y[K] = y_K
        self.P = P = scipy.linalg.blas.dgemm(-1.0, rows, gain[:, None] * X, 1.0, self.P, overwrite_c=1)
        out = np.flatnonzero(self.base_free[K] & ~self.free[K])
        X[out, K[out]] -= self.base_k[K[out]]
        block = np.where(self.free[K], 1.0, -1.0)[:, None] * X
        block[:, K] = 0.5 * (block[:, K] + block[:, K].T)
        P[K, :], P[:, K] = block, block.T
        self.y, self.base_negatives = y, self._negatives(capacitance)
        self._new_base(self.free.copy(), self.k.copy())

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
            column = self.columns[:, at]
            np.multiply(self.sign, self._column(i), out=column)
            self.small[at, : at + 1] = self.columns[i, : at + 1]
            self.small[:at, at] = column[self.nodes[:at]]
            self.matrix[at + 1, 0] = self.y[i] * (-1.0 / self.load_size)
            np.multiply(self.small[at, :at], self.gain[:at], out=self.matrix[at + 1, 1 : at + 1])
        own, gain = (k, 1.0) if not base_free else (1.0, k - self.base_k.item(i))
        self.own[at], self.gain[at] = own, gain = (own, gain) if free else (0.0, 1.0)
        n = self.size
        np.multiply(self.small[:n, at], gain, out=self.matrix[1 : n + 1, at + 1])
        self.matrix[at + 1, at + 1] += own

    def become(self, free: Mask, k: Array) -> None:
        """Move to the cell in which these nodes are free, with this stiffness."""
        changed = np.flatnonzero((free != self.free) | (k != self.k))
        self.change_many([(i, bool(free[i]), float(k[i])) for i in changed.tolist()])

    def change_many(self, changes: Sequence[tuple[int, bool, float]]) -> None:
        """Move several nodes, (i, free, k) each; with more than fit beside the base it is made anew."""
        if len(changes) > CAPACITY // 2:
            for i, free, k in changes:
                self.free[i], self.k[i] = free, k
            return self.refactor()
        if self.size + len(changes) > CAPACITY:
            self.rebase()
        for change in changes:
            self.change(*change)
        return None

    def _drop(self, at: int) -> None:
        last = self.size - 1
        self.position[self.nodes[at]] = -1
        if at != last:
            self.nodes[at] = self.nodes[last]
            self.position[self.nodes[at]] = at
            self.columns[:, at] = self.columns[:, last]
            for whole, i, j in ((self.small, at, last), (self.matrix, at + 1, last + 1)):
                whole[i, : j + 1] = whole[j, : j + 1]
                whole[: j + 1, i] = whole[: j + 1, j]
            self.own[at], self.gain[at] = self.own[last], self.gain[last]
        self.size = last

    def direction(self, node: int | None, speed: float, r: Array | None = None) -> tuple[Array, float]:
        """(dx, dt): motion of the moving coordinates and of t along the path, with dx[node] = speed.

        node: None fixes dt = speed instead;  r: residual of Ãu + g = l̃ that the motion removes
        Raises SingularCellError if the cell has no such direction.
        """
        n = self.size
        K, gain, columns = self.nodes[:n], self.gain[:n], self.columns[:, :n]
        unit = self.load_size  # scales the column of t, so that a small pivot means a lost rank
        system, rhs = self.matrix[: n + 1, : n + 1].copy(order="F"), np.zeros(n + 1)
        system[0], rhs[0] = 0.0, speed
        at = -1 if node is None else self.position.item(node)
        if node is None:
            system[0, 0] = 1.0 / unit
        elif at >= 0:
            system[0, at + 1] = 1.0
        else:
            system[0, 0], system[0, 1:] = self.y[node] / unit, -columns[node] * gain
        z = None if r is None else self._respond(r)
        if z is not None:
            rhs[1:] = z[K]
            rhs[0] -= z[node] if node is not None and at < 0 else 0.0
        solution = solved(system, rhs)
        dt, own = speed if node is None else solution.item(0) / unit, solution[1:]
        dx: Array = _dgemv(-1.0, columns, gain * own, dt, self.y) if n else self.y * dt
        if z is not None:
            dx += z
        dx[K] = own
        if not math.isfinite(dt) or not math.isfinite(float(dx @ dx)):
            raise SingularCellError
        return dx, dt

    def _system(self) -> Array:
        """Equations of the nodes that differ, for their own moving coordinates (n, n).

        With z = z_r − T ε the base's coordinates under the excess ε that the differing nodes bring in: a node with
        another stiffness has ε = Δk z, one that is held z = 0 with its force ε, one that is free z = k ε.
        """
        return self.matrix[1 : self.size + 1, 1 : self.size + 1]

    def _respond(self, r: Array) -> Array:
        """Moving coordinates of the base for the load r."""
        moving = np.zeros(self.m)
        if self.P is None:
            if len(self.inner):
                moving[self.inner] = self._solved(r[self.inner])
            return np.where(self.base_free, moving, r - self.A @ moving)
        on_free = np.where(self.base_free, r, 0.0)
        return self.sign * (self.P @ on_free) + np.where(self.base_free, 0.0, r)

    def _capacitance(self) -> tuple[Array, Array]:
        """(the same equations in symmetric form, size of the terms on its diagonal)."""
        n = self.size
        K, gain = self.nodes[:n], self.gain[:n]
        root = np.sqrt(np.abs(gain))
        small = self.small[:n, :n] * (self.sign[K] * root)[:, None] * root
        own = np.where(self.base_free[K] & self.free[K], np.sign(gain), self.sign[K] * self.own[:n])
        size = np.abs(np.diagonal(small)) + np.abs(own)
        small[np.arange(n), np.arange(n)] += own
        return small, size

    def negatives(self) -> int:
        """Negative eigenvalues of A_FF + diag(k) over the free nodes of the present cell."""
        return self._negatives(self._capacitance()[0]) if self.size else self.base_negatives

    def _negatives(self, capacitance: Array) -> int:
        """The same from the equations in symmetric form."""
        K = self.nodes[: self.size]
        positive = positive_eigenvalues(capacitance)
        out = self.base_free[K] & ~self.free[K]
        stiffer = self.base_free[K] & self.free[K] & (self.k[K] > self.base_k[K])
        return self.base_negatives + positive - int(np.count_nonzero(out | stiffer))
