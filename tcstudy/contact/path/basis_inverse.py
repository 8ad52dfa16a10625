"""The inverse of one cell's equations, kept from cell to cell by changes of rank one.

In a cell every node is *free* (displacement u_i moves, force g_i = k_i u_i + const with k_i = c_i ×
slope of b) or *held* (u_i fixed on a kink, force g_i moves). With x_i = u_i of a free node, g_i of
a held one, increments satisfy Au + g = τ l + r: m equations for m + 1 coordinates (x, τ), one line.
Which coordinate measures the line (the *driver*) is free, τ or that of any node: with a fast one
the system is regular whenever the line is unique, at folds and on upright pieces too. A node that
passes to its next piece drives both cells, so that only its own column changes; to let it drive is
a change of rank one: O(m) for what is asked of the inverse, and changes enter it many at a time, in
matrix products.

Sources: Lemke, Manage. Sci. 11 (1965) 681–689 (what has left a piece drives the next one); Cottle,
Pang & Stone, The Linear Complementarity Problem (1992), §2.3 (principal pivots); Haynsworth, Linear
Algebra Appl. 1 (1968) 73–81 (inertia); Bunch & Kaufman, Math. Comp. 31 (1977) 163–179 (LDLᵀ of
indefinite matrices).
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

CAPACITY = 32
"""Changes of rank one that wait before they enter the inverse as one matrix product."""

SLOW, LOST = 2e-2, 1e-3
"""A coordinate slower than this part of the fastest one is not made to drive, and one slower than
the second does not drive on: as many digits would be lost. Slips and forces are compared in units
in which the node's own stiffness A_ii is one."""

CLEAR = 0.02
"""Part of its terms below which the pivot of a node that does not drive has lost digits."""

LOST_RANK = 1e-14
"""Reciprocal condition number below which a cell, its rows scaled, has no unique line."""

STILL = 1e-13
"""Speeds below this part of the fastest are rounding."""


class SingularCellError(ArithmeticError):
    """No direction exists: the equations of the cell have lost rank."""


class BasisInverse:
    """(x, τ) = T ν + way z of the present cell: z is the driver's coordinate, ν_i what a node is
    off its piece.

    A free node's u = x, g = k x + ν, a held one's u = ν, g = x.

    A:    (m, m) symmetric positive definite stiffness, scaled to O(1)
    load: (m,) load per unit of τ, in the same units, its largest entry 1
    free: (m,) nodes whose displacement moves;  k: (m,) stiffness that the law adds there, 0 at a held one
    way:  (m + 1,) (dx, dτ) along the line of the cell, that of the driver 1 or −1
    """

    def __init__(self, A: Array, load: Array, free: Flags, k: Array) -> None:
        self.A, self.load, self.m, self.free, self.k = A, load, len(load), free.copy(), k.copy()
        self.left, self.right = (np.zeros((self.m + one, CAPACITY), order="F") for one in (1, 0))
        self.way, self.root = np.zeros(self.m + 1), np.sqrt(np.diagonal(A))
        self.refactor()

    def refactor(self) -> None:
        """The inverse from A itself, by the fastest coordinate. Raises SingularCellError if the
        line is not unique."""
        self.size = 0
        self.stale = True
        self.driver = -1
        self._negatives: int | None = None
        previous_way = self.way
        m = self.m
        free_nodes = np.flatnonzero(self.free)
        n = len(free_nodes)
        # free nodes first: blocks of the equations are slices, and only whole rows are reordered
        order = np.concatenate([free_nodes, np.flatnonzero(~self.free)])
        A = self.A.T[order].take(order, axis=1)
        load = self.load[order]
        k = self.k[free_nodes]
        scale = 1.0 / np.sqrt(np.diagonal(A)[:n] + np.abs(k))
        S = np.empty((n + 1, n + 1))
        S[:n, :n] = A[:n, :n]
        S[np.arange(n), np.arange(n)] += k
        S[:n, :n] *= scale[:, None] * scale
        S[:n, n] = -load[:n] * scale
        # any border that the line does not lie in
        S[n] = np.random.default_rng(n).uniform(0.5, 1.0, n + 1)
        S[n, ::2] *= -1.0
        try:
            inverse = np.linalg.inv(S)
        except np.linalg.LinAlgError:
            raise SingularCellError from None
        if not np.linalg.norm(S, 1) * np.linalg.norm(inverse, 1) * LOST_RANK < 1.0:
            raise SingularCellError
        inverse[:n] *= scale[:, None]
        # rows: displacements of free nodes, τ, forces of held nodes
        T = np.empty((m + 1, m))
        T[: n + 1, :n] = inverse[:, :n] * -scale
        T[: n + 1, n:] = T[: n + 1, :n] @ A[:n, n:]
        onto_held = np.concatenate([-A[n:, :n], load[n:, None]], axis=1)
        T[n + 1 :] = onto_held @ T[: n + 1]
        T[n + 1 :, n:] -= A[n:, n:]
        way = np.concatenate([inverse[:, n], onto_held @ inverse[:, n]])
        position = np.argsort(order)
        row = np.append(np.where(self.free, position, position + 1), n)
        self.T = np.asfortranarray(T[row].take(position, axis=1))
        way = way[row]
        self.unit = np.append(np.where(self.free, self.root, 1.0 / self.root), 1.0)
        fastest = int(np.argmax(np.abs(way * self.unit)))
        self.stale = False
        self.way = way if previous_way[fastest] * way[fastest] >= 0.0 else -way
        self.fastest = float(np.abs(self.way * self.unit).max())
        self.drive(fastest)

    def _H(self, F: NDArray[np.intp]) -> Array:
        H = self.A[np.ix_(F, F)]
        H[np.arange(len(F)), np.arange(len(F))] += self.k[F]
        return H

    def _slow(self, i: int, part: float = SLOW) -> bool:
        """Whether this coordinate is slower than a part of the fastest, or none moves."""
        return not abs(self.way.item(i)) * self.unit.item(i) > part * self.fastest

    def drive(self, i: int) -> None:
        """Let the coordinate of node i (m: τ) measure the line."""
        if i != self.driver:
            row, n = self._row(i), self._room()
            self.left[:, n], self.right[:, n] = self.way / -self.way[i], row
            self.T[i], self.left[i, : n + 1], self.size, self.driver = 0.0, 0.0, n + 1, i
        speed = abs(self.way.item(i))
        self.way /= speed
        self.fastest /= speed

    def place(self, i: int, free: bool, k: float) -> None:
        """Move node i to a piece on which it is free with stiffness k, or held; it goes on in the
        same sense.

        (x, ν) = R (x′, ν′) of this node, R of size two; z = ±x gives all else. A slow node lets
        another one drive. Where the driver is slow in the next cell, or the pivot lost, the inverse
        becomes stale and waits for `settle`.
        """
        was_free, before = self.free.item(i), self.k.item(i)
        self.free[i], self.k[i] = free, k
        if (free == was_free and k == before) or self.stale:
            return
        if not self._slow(i):
            self.drive(i)
        self.unit[i] = self.root[i] if free else 1.0 / self.root[i]
        if free:
            a, b, c, d = (1.0, 0.0, k - before, 1.0) if was_free else (k, 1.0, 1.0, 0.0)
        else:
            a, b, c, d = 0.0, 1.0, 1.0, -before
        way, column, speed, fastest = self.way, self._column(i), self.way.item(i), self.fastest
        if i == self.driver:
            self.way, new = a * way + (c * speed) * column, (b * speed) * way + d * column
            self.way[i], new[i] = speed, 0.0
        else:
            row = self._row(i)
            pivot = a - row.item(i) * c
            if not abs(pivot) > CLEAR * (abs(a) + abs(a - pivot)):
                self.stale = True
                return
            own, n = (row.item(i) * d - b) / pivot, self._room()
            self.way, new = pivot * way + (c * speed) * column, (d + c * own) * column
            self.left[:, n], self.right[:, n] = (c / pivot) * column, row
            self.way[i], new[i], self.size = speed, own, n + 1
            row /= pivot
            row[i] = own
            self.T[i], self.left[i, : n + 1] = row, 0.0
            self.way /= abs(self.way.item(self.driver)) or 1.0
        self.T[:, i], self.right[i, : self.size] = new, 0.0
        self.fastest = float(np.abs(self.way * self.unit).max())
        self.stale, turned = (
            self._slow(self.driver, LOST),
            (way.item(self.m), self.way.item(self.m)),
        )
        if abs(turned[0]) <= STILL * fastest or abs(turned[1]) <= STILL * self.fastest:
            self._negatives = None
        elif self._negatives is not None and turned[0] * turned[1] < 0.0:
            # their quotient is det H′/det H: one eigenvalue has changed its sign
            self._negatives += (
                (-1 if k > before else 1) if was_free and free else -1 if was_free else 1
            )

    def settle(self) -> None:
        """After changes, of which some may have been singular: the inverse of the last cell."""
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
        moved = self.T @ off + self.left[:, :n] @ (off @ self.right[:, :n])
        moved[: self.m] += np.where(self.free, 0.0, r)
        moved -= self.way * (moved[self.driver] / self.way[self.driver])
        return moved

    @property
    def negatives(self) -> int:
        """Negative eigenvalues of H = A_FF + diag(k) over the free nodes."""
        if self._negatives is None:
            F = np.flatnonzero(
                self.free
            )  # signs of the pivots of LDLᵀ; a block of two has one of either
            ldu, pivots, _ = scipy.linalg.lapack.dsytrf(self._H(F), lower=1)
            single = pivots > 0
            positive = (
                np.count_nonzero(ldu.diagonal()[single] > 0.0) + np.count_nonzero(~single) // 2
            )
            self._negatives = len(F) - int(positive)
        return self._negatives

    def _row(self, i: int) -> Array:
        return self.T[i] + self.right[:, : self.size] @ self.left[i, : self.size]

    def _column(self, i: int) -> Array:
        return self.T[:, i] + self.left[:, : self.size] @ self.right[i, : self.size]

    def _room(self) -> int:
        """Place for a change among those that wait."""
        if self.size == CAPACITY:
            self.T = scipy.linalg.blas.dgemm(
                1.0, self.left, self.right, 1.0, self.T, trans_b=1, overwrite_c=1
            )
            self.size = 0
        return self.size
