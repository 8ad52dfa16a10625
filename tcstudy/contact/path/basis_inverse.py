"""The inverse of one cell's equations, kept from cell to cell by changes of rank one.

In a cell every node is *free* (displacement u_i moves, force g_i = k_i u_i + const with k_i = c_i × slope of b) or
*held* (u_i fixed on a kink, force g_i moves). With x_i = u_i of a free node, g_i of a held one, increments satisfy
Au + g = τ l + r: m equations for m + 1 coordinates (x, τ), one line. Which coordinate measures the line (the *driver*)
is free, τ or that of any node: with a fast one the system is regular whenever the line is unique, at folds and on
upright pieces too. A node that passes to its next piece, or another driver, is a change of rank one: O(m) for what is
asked of the inverse, and changes enter it many at a time, in matrix products.

Sources: Lemke, Manage. Sci. 11 (1965) 681–689 (what has left a piece drives the next one); Cottle, Pang & Stone, The
Linear Complementarity Problem (1992), §2.3 (principal pivots); Haynsworth, Linear Algebra Appl. 1 (1968) 73–81
(inertia); Bunch & Kaufman, Math. Comp. 31 (1977) 163–179 (LDLᵀ of indefinite matrices).
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
_dgemv, _dgemm, _dgecon = scipy.linalg.blas.dgemv, scipy.linalg.blas.dgemm, scipy.linalg.lapack.dgecon

CAPACITY = 32
"""Changes of rank one that wait before they enter the inverse as one matrix product."""

SOUND = 0.02
"""A coordinate may drive a cell if it is no slower than this part of the fastest one."""

LOST_RANK = 1e-14
"""Reciprocal condition number below which a cell, its rows scaled, has no unique line."""

STILL = 1e-13
"""Speeds below this part of the fastest are rounding."""


class SingularCellError(ArithmeticError):
    """No direction exists: the equations of the cell have lost rank."""


class BasisInverse:
    """(x, τ) of the present cell by (ν, z): z is the driver's coordinate, ν_i what a node is off its piece.

    A free node's u = x, g = k x + ν, a held one's u = ν, g = x. A node that changes its piece has (x, ν) = R (x′, ν′)
    with R of size two, so that all else follows by one elimination.

    A:    (m, m) symmetric positive definite stiffness, scaled to O(1)
    load: (m,) load per unit of τ, in the same units, its largest entry 1
    free: (m,) nodes whose displacement moves;  k: (m,) stiffness that the law adds there, 0 at a held one
    way:  (m + 1,) (dx, dτ) along the line of the cell, that of the driver 1 or −1
    """

    def __init__(self, A: Array, load: Array, free: Flags, k: Array) -> None:
        self.A, self.load, self.m, self.free, self.k = A, load, len(load), free.copy(), k.copy()
        self.left, self.right = (np.zeros((self.m + one, CAPACITY), order="F") for one in (1, 0))
        self.factorisations = 0
        self.refactor()

    def refactor(self) -> None:
        """The inverse from A itself, by the fastest coordinate. Raises SingularCellError if the line is not unique."""
        self.factorisations += 1
        self.size, self.stale, before = 0, True, getattr(self, "way", None)
        self._negatives: int | None = None
        m, F, R = self.m, np.flatnonzero(self.free), np.flatnonzero(~self.free)
        n, scale = len(F), 1.0 / np.sqrt(1.0 + np.abs(self.k[F]))
        S = np.empty((n + 1, n + 1), order="F")
        S[:n, :n], S[:n, n] = self._H(F) * scale[:, None] * scale, -self.load[F] * scale
        S[n] = np.random.default_rng(n).uniform(0.5, 1.0, n + 1)  # any border that the line does not lie in
        S[n, ::2] *= -1.0
        norm = float(np.max(np.sum(np.abs(S), axis=0)))
        lu, pivots, info = scipy.linalg.lapack.dgetrf(S)
        if info != 0 or not _dgecon(lu, norm)[0] > LOST_RANK:
            raise SingularCellError
        inverse, _ = scipy.linalg.lapack.dgetri(lu, pivots, overwrite_lu=1)
        inverse[:n] *= scale[:, None]
        moving = np.append(F, m)
        self.T = T = np.empty((m + 1, m), order="F")
        way = np.empty(m + 1)
        by_force = inverse[:, :n] * -scale
        T[np.ix_(moving, F)], way[moving] = by_force, inverse[:, n]
        if len(R):
            T[np.ix_(moving, R)] = by_force @ self.A[np.ix_(F, R)]
            onto = np.concatenate([-self.A[np.ix_(R, F)], self.load[R, None]], axis=1)
            T[R], way[R] = onto @ T[moving], onto @ way[moving]
            T[np.ix_(R, R)] -= self.A[np.ix_(R, R)]
        fastest = int(np.argmax(np.abs(way)))
        kept = before is None or before[fastest] * way[fastest] >= 0.0
        self.stale, self.way = False, way if kept else -way
        self.drive(fastest)

    def _H(self, F: NDArray[np.intp]) -> Array:
        H = self.A[np.ix_(F, F)]
        H[np.arange(len(F)), np.arange(len(F))] += self.k[F]
        return H

    def reload(self, load: Array) -> None:
        """Another load per unit of τ."""
        self.load = load
        if not abs(self.way[self.m]) > SOUND * np.max(np.abs(self.way)):
            return self.refactor()
        self.drive(self.m)
        self.way = self.moved(load)
        self.way[self.m] = 1.0
        return self.drive(int(np.argmax(np.abs(self.way))))

    def drive(self, i: int) -> None:
        """Let the coordinate of node i (m: τ) measure the line."""
        row, speed = self._row(i), self.way.item(i)
        at = self._add(self.way / -speed, row)
        self.T[i], self.left[i, : at + 1] = 0.0, 0.0
        self.way /= abs(speed)
        self.driver = i

    def place(self, i: int, free: bool, k: float) -> None:
        """Move node i to a piece on which it is free with stiffness k, or held; it goes on in the same sense.

        Of the node, the driver and all others that drives which is fast in both cells: no digits are lost on the way.
        """
        was_free, before = self.free.item(i), self.k.item(i)
        self.free[i], self.k[i] = free, k
        if (free == was_free and k == before) or self.stale:
            return
        if free:
            a, b, c, d = (1.0, 0.0, k - before, 1.0) if was_free else (k, 1.0, 1.0, 0.0)
        else:
            a, b, c, d = 0.0, 1.0, 1.0, -before
        row, column, speed = self._row(i), self._column(i), self.way.item(i)
        pivot = a - row.item(i) * c
        after = pivot * self.way + (c * speed) * column
        after[i] = speed
        fast, faster = np.abs(self.way), np.abs(after)
        most = fast.item(fast.argmax()), faster.item(faster.argmax())
        if not 0.0 < most[1] < np.inf:
            self.stale = True
            return
        turned = self.way.item(self.m) / most[0], after.item(self.m) / most[1]
        if self._negatives is None or min(abs(turned[0]), abs(turned[1])) <= STILL:
            self._negatives = None
        elif turned[0] * turned[1] < 0.0:  # their quotient is det H′/det H: one eigenvalue has changed its sign
            both = was_free and free
            self._negatives += (-1 if k > before else 1) if both else -1 if was_free else 1
        driver, clear = self.driver, SOUND * (abs(a) + abs(a - pivot))
        if not (min(1.0 / most[0], faster.item(driver) / most[1]) >= SOUND and abs(pivot) >= clear):
            share = np.minimum(fast / most[0], faster / most[1])
            driver = i if abs(speed) >= SOUND * max(most) else int(share.argmax())
            if not share[driver] > STILL:
                self.stale = True
                return
            if driver != self.driver:
                self.drive(driver)
                row, column, speed = self._row(i), self._column(i), self.way.item(i)
        pivot = a - row.item(i) * c
        if driver == i:
            self.way, new = a * self.way + (c * speed) * column, (b * speed) * self.way + d * column
            self.way[i], new[i] = speed, 0.0
        else:
            own = (row.item(i) * d - b) / pivot
            self.way = pivot * self.way + (c * speed) * column
            self.way[i], new = speed, (d + c * own) * column
            at = self._add((c / pivot) * column, row)
            row /= pivot
            new[i] = row[i] = own
            self.T[i], self.left[i, : at + 1] = row, 0.0
        self.way /= abs(self.way[driver])
        self.T[:, i], self.right[i, : self.size] = new, 0.0

    def settle(self) -> None:
        """After several changes, of which some may have been singular: the inverse of the last cell."""
        if self.stale:
            self.refactor()

    def become(self, free: Flags, k: Array) -> None:
        """Move to the cell in which these nodes are free, with this stiffness."""
        changed = np.flatnonzero((free != self.free) | (k != self.k))
        self.stale |= len(changed) > CAPACITY
        for i in changed.tolist():
            self.place(i, bool(free[i]), float(k[i]))
        self.settle()

    def moved(self, r: Array) -> Array:
        """(m + 1,) what (x, τ) have to move for Au + g to grow by r (m,), the driver at rest."""
        off, n = np.where(self.free, -r, 0.0), self.size
        moved = _dgemv(1.0, self.left[:, :n], off @ self.right[:, :n], 1.0, self.T @ off) if n else self.T @ off
        moved[: self.m] += np.where(self.free, 0.0, r)
        moved -= self.way * (moved[self.driver] / self.way[self.driver])
        return moved

    @property
    def negatives(self) -> int:
        """Negative eigenvalues of H = A_FF + diag(k) over the free nodes."""
        if self._negatives is None:
            F = np.flatnonzero(self.free)
            self._negatives = len(F) - positive_eigenvalues(self._H(F))
        return self._negatives

    def _row(self, i: int) -> Array:
        n = self.size
        return _dgemv(1.0, self.right[:, :n], self.left[i, :n], 1.0, self.T[i]) if n else self.T[i].copy()

    def _column(self, i: int) -> Array:
        n = self.size
        return _dgemv(1.0, self.left[:, :n], self.right[i, :n], 1.0, self.T[:, i]) if n else self.T[:, i].copy()

    def _add(self, left: Array, right: Array) -> int:
        """T + left rightᵀ; its place among the changes that wait."""
        if self.size == CAPACITY:
            self.T = _dgemm(1.0, self.left, self.right, 1.0, self.T, trans_b=1, overwrite_c=1)
            self.size = 0
        at = self.size
        self.left[:, at], self.right[:, at] = left, right
        self.size += 1
        return at


def positive_eigenvalues(matrix: Array) -> int:
    """How many a symmetric matrix has, by the signs of the pivots of LDLᵀ (a block of two has one of either)."""
    ldu, pivots, _ = scipy.linalg.lapack.dsytrf(matrix, lower=1)
    single = pivots > 0
    return int(np.count_nonzero(ldu.diagonal()[single] > 0.0) + np.count_nonzero(~single) // 2)
