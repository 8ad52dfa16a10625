"""The inverse of one cell's equations, kept from cell to cell by changes of rank one.

In a cell every node is *free* (its displacement u_i moves, the force is g_i = k_i u_i + const with
k_i = c_i × slope of b) or *held* (u_i is fixed on a kink, g_i moves). With x_i = u_i of a free node
and x_i = g_i of a held one, increments satisfy Au + g = τ l + r. These m equations for the m + 1
coordinates (x, τ) have a line as their solutions. Any coordinate may measure this line (the
*driver*): τ or that of any node. If the driver is fast, the system is regular whenever the line is
unique, at folds and on vertical sides too. A node that passes to its next piece drives both cells,
so that only its column changes. To let it drive is a change of rank one. What is asked of the
inverse costs O(m), and changes enter it many at a time, in matrix products.

Sources: Lemke, Manage. Sci. 11 (1965) 681–689 (what has left a piece drives the next one);
Cottle, Pang & Stone, The Linear Complementarity Problem (1992), §2.3 (principal pivots);
Haynsworth, Linear Algebra Appl. 1 (1968) 73–81 (inertia);
Bunch & Kaufman, Math. Comp. 31 (1977) 163–179 (LDLᵀ of indefinite matrices).
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

CAPACITY = 32
"""Changes of rank one that wait before they enter the inverse as one matrix product."""

MIN_DRIVER_SPEED = 2e-2
"""A slower coordinate does not become the driver: as many digits would be lost.

Relative to the fastest coordinate, in units in which the node's own stiffness A_ii is one.
"""

LOST_DRIVER_SPEED = 1e-3
"""A driver slower than this part of the fastest coordinate does not stay the driver."""

MIN_PIVOT = 0.02
"""Part of its terms below which the pivot of a node that does not drive has lost digits."""

MIN_RECIPROCAL_CONDITION = 1e-14
"""Reciprocal condition number below which a cell, its rows scaled, has no unique line."""

STILL = 1e-13
"""Speeds below this part of the fastest are rounding."""


class SingularCellError(ArithmeticError):
    """The equations of the cell have lost rank, so that no direction exists."""


class BasisInverse:
    """(x, τ) = T ν + z direction in the present cell.

    z is the coordinate of the driver, and ν_i is how far node i is off its piece: a free node has
    u = x and g = k x + ν, a held one u = ν and g = x. T waits for `size` changes left rightᵀ.

    A:         (m, m) symmetric positive definite stiffness, scaled to O(1)
    load:      (m,) load per unit of τ, in the same units, its largest entry 1
    free:      (m,) nodes whose displacement moves
    k:         (m,) stiffness that the law adds there, 0 at a held node
    direction: (m + 1,) (dx, dτ) along the line of the cell, that of the driver 1 or −1
    """

    def __init__(self, A: Array, load: Array, free: Flags, k: Array) -> None:
        self.A = A
        self.load = load
        self.m = len(load)
        self.free = free.copy()
        self.k = k.copy()
        self.left = np.zeros((self.m + 1, CAPACITY), order="F")
        self.right = np.zeros((self.m, CAPACITY), order="F")
        self.direction = np.zeros(self.m + 1)
        self.root = np.sqrt(np.diagonal(A))
        self.refactor()

    def refactor(self) -> None:
        """Invert the equations of the cell afresh, and let the fastest coordinate drive.

        Raises SingularCellError if the line is not unique.
        """
        self.size = 0
        self.stale = True
        self.driver = -1
        self._negatives: int | None = None
        previous_direction = self.direction
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
        condition = np.linalg.norm(S, 1) * np.linalg.norm(inverse, 1)
        if not condition * MIN_RECIPROCAL_CONDITION < 1.0:
            raise SingularCellError
        inverse[:n] *= scale[:, None]

        # rows: displacements of free nodes, τ, forces of held nodes
        T = np.empty((m + 1, m))
        T[: n + 1, :n] = inverse[:, :n] * -scale
        T[: n + 1, n:] = T[: n + 1, :n] @ A[:n, n:]
        onto_held = np.concatenate([-A[n:, :n], load[n:, None]], axis=1)
        T[n + 1 :] = onto_held @ T[: n + 1]
        T[n + 1 :, n:] -= A[n:, n:]
        direction = np.concatenate([inverse[:, n], onto_held @ inverse[:, n]])

        position = np.argsort(order)
        row = np.append(np.where(self.free, position, position + 1), n)
        self.T = np.asfortranarray(T[row].take(position, axis=1))
        direction = direction[row]
        self.unit = np.append(np.where(self.free, self.root, 1.0 / self.root), 1.0)
        fastest = int(np.argmax(np.abs(direction * self.unit)))
        self.stale = False
        keeps_sense = previous_direction[fastest] * direction[fastest] >= 0.0
        self.direction = direction if keeps_sense else -direction
        self.fastest = float(np.abs(self.direction * self.unit).max())
        self.drive(fastest)

    def _is_slow(self, i: int, part: float) -> bool:
        """Return whether coordinate i is slower than a part of the fastest, or none moves."""
        return not abs(self.direction.item(i)) * self.unit.item(i) > part * self.fastest

    def drive(self, i: int) -> None:
        """Let the coordinate of node i (m: τ) measure the line."""
        if i != self.driver:
            row = self._row(i)
            n = self._next_change()
            self.left[:, n] = self.direction / -self.direction[i]
            self.right[:, n] = row
            self.T[i] = 0.0
            self.left[i, : n + 1] = 0.0
            self.size = n + 1
            self.driver = i
        speed = abs(self.direction.item(i))
        self.direction /= speed
        self.fastest /= speed

    def place(self, i: int, free: bool, k: float) -> None:
        """Move node i to a piece on which it is free with stiffness k, or held.

        It goes on in the same sense. A slow node lets another one drive. Where the driver is slow
        in the next cell, or the pivot has lost digits, the inverse becomes stale and waits for
        `settle`.
        """
        was_free = self.free.item(i)
        k_before = self.k.item(i)
        self.free[i] = free
        self.k[i] = k
        if (free == was_free and k == k_before) or self.stale:
            return
        if not self._is_slow(i, MIN_DRIVER_SPEED):
            self.drive(i)
        self.unit[i] = self.root[i] if free else 1.0 / self.root[i]
        t_speed = self.direction.item(self.m)
        t_rests = abs(t_speed) <= STILL * self.fastest
        column: Array | None
        R = _coordinate_change(was_free, k_before, free, k)
        if i == self.driver:
            column = self._exchange_driver(i, R)
        else:
            column = self._exchange(i, R)
            if column is None:
                self.stale = True
                return
        self.T[:, i] = column
        self.right[i, : self.size] = 0.0
        self.fastest = float(np.abs(self.direction * self.unit).max())
        self.stale = self._is_slow(self.driver, LOST_DRIVER_SPEED)

        t_speed_after = self.direction.item(self.m)
        if t_rests or abs(t_speed_after) <= STILL * self.fastest:
            self._negatives = None
        elif self._negatives is not None and t_speed * t_speed_after < 0.0:
            # their quotient is det H′/det H: one eigenvalue has changed its sign
            stiffens = k > k_before if free and was_free else was_free
            self._negatives += -1 if stiffens else 1

    def _exchange_driver(self, i: int, R: tuple[float, float, float, float]) -> Array:
        """Put the driver on its next piece; return its column of T there."""
        a, b, c, d = R
        old = self.direction
        column = self._column(i)
        speed = old.item(i)
        self.direction = a * old + (c * speed) * column
        new_column = (b * speed) * old + d * column
        self.direction[i] = speed
        new_column[i] = 0.0
        return new_column

    def _exchange(self, i: int, R: tuple[float, float, float, float]) -> Array | None:
        """Put a node that does not drive on its next piece; return its column of T there.

        None, and nothing is changed, if the pivot has lost digits.
        """
        a, b, c, d = R
        old = self.direction
        column = self._column(i)
        speed = old.item(i)
        row = self._row(i)
        pivot = a - row.item(i) * c
        if not abs(pivot) > MIN_PIVOT * (abs(a) + abs(a - pivot)):
            return None
        entry = (row.item(i) * d - b) / pivot
        n = self._next_change()
        self.direction = pivot * old + (c * speed) * column
        new_column = (d + c * entry) * column
        self.left[:, n] = (c / pivot) * column
        self.right[:, n] = row
        self.direction[i] = speed
        new_column[i] = entry
        self.size = n + 1
        row /= pivot
        row[i] = entry
        self.T[i] = row
        self.left[i, : n + 1] = 0.0
        self.direction /= abs(self.direction.item(self.driver)) or 1.0
        return new_column

    def settle(self) -> None:
        """Invert afresh if the changes since the last time have made the inverse stale.

        Cells in between may have been singular.
        """
        if self.stale:
            self.refactor()

    def become(self, free: Flags, k: Array) -> None:
        """Move to the cell in which these nodes are free, with this stiffness."""
        changed = np.flatnonzero((free != self.free) | (k != self.k))
        self.stale |= len(changed) > CAPACITY
        for i in changed.tolist():
            self.place(i, bool(free[i]), float(k[i]))
        self.settle()

    def correction(self, r: Array) -> Array:
        """Return (m + 1,) the change of (x, τ) by which Au + g grows by r (m,).

        The driver is at rest.
        """
        off_piece = np.where(self.free, -r, 0.0)
        n = self.size
        change = self.T @ off_piece + self.left[:, :n] @ (off_piece @ self.right[:, :n])
        change[: self.m] += np.where(self.free, 0.0, r)
        change -= self.direction * (change[self.driver] / self.direction[self.driver])
        return change

    @property
    def negatives(self) -> int:
        """Number of negative eigenvalues of H = A_FF + diag(k) over the free nodes."""
        if self._negatives is None:
            F = np.flatnonzero(self.free)
            H = self.A[np.ix_(F, F)]
            H[np.arange(len(F)), np.arange(len(F))] += self.k[F]
            # signs of the pivots of LDLᵀ; a block of size two has one of either sign
            ldu, pivots, _ = scipy.linalg.lapack.dsytrf(H, lower=1)
            single = pivots > 0
            positive_singles = np.count_nonzero(ldu.diagonal()[single] > 0.0)
            blocks = np.count_nonzero(~single) // 2
            self._negatives = len(F) - int(positive_singles + blocks)
        return self._negatives

    def _row(self, i: int) -> Array:
        return self.T[i] + self.right[:, : self.size] @ self.left[i, : self.size]

    def _column(self, i: int) -> Array:
        return self.T[:, i] + self.left[:, : self.size] @ self.right[i, : self.size]

    def _next_change(self) -> int:
        """Return the place of the next change; if none is left, all enter the inverse first."""
        if self.size == CAPACITY:
            self.T = scipy.linalg.blas.dgemm(
                1.0, self.left, self.right, 1.0, self.T, trans_b=1, overwrite_c=1
            )
            self.size = 0
        return self.size


def _coordinate_change(
    was_free: bool, k_before: float, free: bool, k: float
) -> tuple[float, float, float, float]:
    """Return (a, b, c, d) of a node: x = a x′ + b ν′ and ν = c x′ + d ν′, with ′ on the next piece.

    All else is as before, as the driver's z is x or −x.
    """
    if not free:
        return 0.0, 1.0, 1.0, -k_before
    if was_free:
        return 1.0, 0.0, k - k_before, 1.0
    return k, 1.0, 1.0, 0.0
