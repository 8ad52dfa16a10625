"""One cell of the piecewise-linear system: its line of solutions, and the inverse that is kept from cell to cell.

In a cell every node is on one straight piece of its graph: *free* (displacement u_i moves, force g_i = k_i u_i + const
with k_i = c_i × slope of b) or *held* (u_i fixed on a kink, force g_i moves). With x_i = u_i of a free node, g_i of a
held one, Ãu + g = l̃₀ + t l̃₁ are m equations M x − t l̃₁ = r for m + 1 coordinates (x, t): one line, cut by the ends of
the pieces. Which coordinate measures the line (the *driver*) is free, t or that of any node; with the fastest one
B = [M, −l̃₁; e_driverᵀ] is regular whenever the line is unique, at folds and on upright pieces too.

`segments` gives the exact segment of any cells and the facets where it ends, with bounds of rounding that prove it.
`BasisInverse` holds B⁻¹: a node that passes to its next piece, or another driver, is a change of rank one.

Sources: Lemke, Manage. Sci. 11 (1965) 681–689 (what has left a piece drives the next one); Cottle, Pang & Stone, The
Linear Complementarity Problem (1992), §2.3 (principal pivots); Rump, Acta Numer. 19 (2010) 287–449, §10 (verified
linear systems); inertia: Haynsworth, Linear Algebra Appl. 1 (1968) 73–81.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.path.dense import SingularCellError, positive_eigenvalues
from tcstudy.contact.path.problem import ParametricProblem
from tcstudy.contact.separable.pieces import submatrix

Array = NDArray[np.float64]
Index = NDArray[np.intp]
_dgemv, _dgemm, _dgecon = scipy.linalg.blas.dgemv, scipy.linalg.blas.dgemm, scipy.linalg.lapack.dgecon
EPS = float(np.finfo(float).eps)

CAPACITY = 32
"""Changes of rank one that wait before they enter the inverse as one matrix product."""

SOUND = 0.02
"""A coordinate may drive a cell if it is no slower than this part of the fastest one."""

LOST_RANK = 1e-14
"""Reciprocal condition number below which a cell, its rows scaled, has no unique line."""

AT_REST = 1e-13
"""Speeds below this part of the fastest are rounding."""


class Found(IntEnum):
    """What is proved of a cell: no solution, one segment, or nothing (a corner within rounding, or a lost rank)."""

    NONE = 0
    ONE = 1
    UNDECIDED = 2


@dataclass(frozen=True)
class Segments:
    """The solutions of n cells, t falling or growing from the first end to the second.

    found: (n,) of Found; where it is not ONE the rest means nothing
    u:     (n, 2, m) displacements at both ends [m];  t: (n, 2) the parameter there
    node:  (n, 2) the node that ends its piece there, m where t reaches the end of its range
    upper: (n, 2) whether that is the upper end of its piece (of the range)
    """

    found: NDArray[np.int8]
    u: Array
    t: Array
    node: Index
    upper: NDArray[np.bool_]


def segments(problem: ParametricProblem, codes: NDArray[np.integer], t_min: float, t_max: float) -> Segments:
    """The exact segment of every cell and the facets in which it ends, t between t_min and t_max.

    codes: (n, m) code of a piece that every node's law has, as `ParametricProblem.graph` counts them; behind the facet
           of a node the path goes on in the cell with graph.after_low or graph.after_high of its code
    Proof: with x measured by its largest component and Y the inverse of the rest S, ‖I − YS‖ < 0.01 bounds the error
    of every coordinate; ONE and NONE hold whatever rounding does within that.
    """
    graph, A, c, m, n = problem.graph, problem.A_tilde, problem.c, problem.m, len(codes)
    own, rows, free = np.arange(m), np.arange(n), graph.free[codes]
    moves, slope, kink = free.astype(float), c * graph.slope[codes], graph.kink[codes]
    unit = np.where(free, 1.0, c)  # bounds of a held node are tractions
    low, high = graph.low[codes] * unit, graph.high[codes] * unit
    width = np.where(
        np.isfinite(high - low), high - low, problem.traction_scale * c * (1.0 / A[own, own] * moves + 1.0 - moves)
    )
    start = moves * c * (graph.start[codes] - graph.slope[codes] * graph.anchor[codes])
    length = t_max - t_min
    # unknowns in units of their pieces: x = base + width · y, t = t_min + length · y_m, every y in [0, 1] at best
    base = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high - width, 0.0))
    M = A * (moves * width)[:, None, :]
    M[:, own, own] += np.where(free, slope, 1.0) * width
    N = np.concatenate([M, np.broadcast_to(-problem.l_1[:, None] * length, (n, m, 1))], axis=-1)
    fixed = moves * base + kink
    load = problem.load(t_min)
    rhs = load - fixed @ A - start - np.where(free, slope, 1.0) * base
    size = np.abs(problem.l_0) + (abs(t_min) + length) * np.abs(problem.l_1) + np.abs(fixed) @ np.abs(A)
    size += np.abs(moves * c * graph.start[codes]) + np.abs(slope * graph.anchor[codes]) + np.abs(slope) * np.abs(base)
    size += np.where(free, 0.0, np.abs(base))
    row_size = np.abs(N).max(axis=-1)
    N, rhs, size = N / row_size[..., None], rhs / row_size, size / row_size
    way = np.array([scipy.linalg.qr(one.T, check_finite=False)[0][:, -1] for one in N])  # about the line's direction
    pivot = np.argmax(np.abs(way), axis=-1)
    rest = np.array([np.delete(np.arange(m + 1), j) for j in pivot])
    S = np.take_along_axis(N, rest[:, None, :].repeat(m, axis=1), axis=-1)
    column = np.take_along_axis(N, pivot[:, None, None].repeat(m, axis=1), axis=-1)[..., 0]
    Y = np.array([scipy.linalg.pinv(one) if np.linalg.matrix_rank(one) < m else np.linalg.inv(one) for one in S])
    rho = np.abs(np.eye(m) - Y @ S).sum(axis=-1).max(axis=-1)
    rho += 2 * m * EPS * (np.abs(Y) @ np.abs(S)).sum(axis=-1).max(axis=-1)
    alpha, gamma = (Y @ rhs[..., None])[..., 0], -(Y @ column[..., None])[..., 0]
    noise = (np.abs(Y) @ (4 * m * EPS * size)[..., None])[..., 0]
    noise += (rho / (1 - np.minimum(rho, 0.5)))[:, None] * (np.abs(alpha) + np.abs(gamma)).max(axis=-1, keepdims=True)
    first = np.concatenate([(low - base) / width, np.zeros((n, 1))], axis=-1)
    last = np.concatenate([(high - base) / width, np.ones((n, 1))], axis=-1)
    order = np.concatenate([rest, pivot[:, None]], axis=-1)
    first, last = np.take_along_axis(first, order, axis=-1), np.take_along_axis(last, order, axis=-1)
    one = np.ones((n, 1))
    alpha, gamma, noise = (
        np.concatenate([x, y], axis=-1) for x, y in ((alpha, 0 * one), (gamma, one), (noise, 0 * one))
    )
    flat, rising = np.abs(gamma) <= noise, gamma > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        to_first, to_last, error = (first - alpha) / gamma, (last - alpha) / gamma, noise / np.abs(gamma)
    enter = np.where(flat, -np.inf, np.where(rising, to_first, to_last))
    leave, error = np.where(flat, np.inf, np.where(rising, to_last, to_first)), np.where(flat, 0.0, error)
    out = (flat & ((alpha < first - 2 * noise) | (alpha > last + 2 * noise))).any(axis=-1)
    doubt = (flat & ~((alpha > first + 2 * noise) & (alpha < last - 2 * noise))).any(axis=-1)
    at = np.argmax(enter, axis=-1), np.argmin(leave, axis=-1)
    x = enter[rows, at[0]], leave[rows, at[1]]
    out |= (enter - error).max(axis=-1) > (leave + error).min(axis=-1)
    sure = (enter + error).max(axis=-1) < (leave - error).min(axis=-1)
    later, sooner = enter + error, leave - error  # which facet comes first has to be sure as well
    later[rows, at[0]], sooner[rows, at[1]] = -np.inf, np.inf
    sure &= (later.max(axis=-1) < x[0] - error[rows, at[0]]) & (sooner.min(axis=-1) > x[1] + error[rows, at[1]])
    decided = np.where(out, Found.NONE, np.where(sure & ~doubt, Found.ONE, Found.UNDECIDED))
    ends = np.empty((n, 2, m + 1))
    for h in (0, 1):
        along = np.where(flat, alpha, alpha + gamma * np.where(np.isfinite(x[h]), x[h], 0.0)[:, None])
        np.put_along_axis(ends[:, h], order, along, axis=-1)
    node = np.stack([order[rows, j] for j in at], axis=1)
    upper = np.stack([~rising[rows, at[0]], rising[rows, at[1]]], axis=1)
    y = base[:, None] + width[:, None] * ends[..., :m]
    return Segments(
        np.where(rho < 0.01, decided, Found.UNDECIDED).astype(np.int8),
        np.where(free[:, None], y, kink[:, None]),
        t_min + length * ends[..., m],
        node,
        upper,
    )


class BasisInverse:
    """B⁻¹ of the present cell, (x, t) by (ν, z): z is the driver's coordinate, ν_i what a node is off its piece.

    A free node's u = x, g = k x + ν, a held one's u = ν, g = x. A node that changes its piece has (x, ν) = R (x′, ν′)
    with R of size two, so that all else follows by one elimination.

    A:    (m, m) symmetric positive definite stiffness, scaled to O(1)
    load: (m,) load per unit of t, in the same units;  t counts in units of 1/`load_size`
    free: (m,) nodes whose displacement moves;  k: (m,) stiffness that the law adds there, 0 at a held one
    way:  (m + 1,) (dx, dt) for dz = 1: the line of the cell, that of the driver 1
    """

    def __init__(self, A: Array, load: Array, free: NDArray[np.bool_], k: Array) -> None:
        self.A, self.m, self.free, self.k = A, len(load), free.copy(), k.copy()
        self.load_size = float(np.max(np.abs(load)))
        self.load, self.unit_load = load, load / self.load_size
        self.left, self.right = (np.zeros((self.m + one, CAPACITY), order="F") for one in (1, 0))
        self.factorisations = 0
        self.refactor()

    def refactor(self) -> None:
        """B⁻¹ from Ã itself, by the fastest coordinate. Raises SingularCellError where the line is not unique."""
        self.factorisations += 1
        self.size, self.stale = 0, True
        self._negatives: int | None = None
        m, F, R = self.m, np.flatnonzero(self.free), np.flatnonzero(~self.free)
        n, scale = len(F), 1.0 / np.sqrt(1.0 + np.abs(self.k[F]))
        S = np.empty((n + 1, n + 1), order="F")
        S[:n, :n], S[:n, n] = submatrix(self.A, F), -self.unit_load[F] * scale
        S[np.arange(n), np.arange(n)] += self.k[F]
        S[:n, :n] *= scale[:, None] * scale
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
        self.way = np.empty(m + 1)
        by_force = inverse[:, :n] * -scale
        T[np.ix_(moving, F)], self.way[moving] = by_force, inverse[:, n]
        if len(R):
            T[np.ix_(moving, R)] = by_force @ self.A[np.ix_(F, R)]
            onto = np.concatenate([-self.A[np.ix_(R, F)], self.unit_load[R, None]], axis=1)
            T[R], self.way[R] = onto @ T[moving], onto @ self.way[moving]
            T[np.ix_(R, R)] -= submatrix(self.A, R)
        self.stale = False
        self.drive(int(np.argmax(np.abs(self.way))))

    def reload(self, load: Array) -> None:
        """Another load per unit of t."""
        if np.array_equal(load, self.load):
            return None
        self.load, self.load_size = load, float(np.max(np.abs(load)))
        self.unit_load = load / self.load_size
        if not abs(self.way[self.m]) > SOUND * np.max(np.abs(self.way)):
            return self.refactor()
        self.drive(self.m)
        self.way = self.correction(self.unit_load)
        self.way[self.m] = 1.0
        self.drive(int(np.argmax(np.abs(self.way))))
        return None

    def drive(self, i: int) -> None:
        """Let the coordinate of node i (m: t) measure the line."""
        row = self._row(i)
        self.way /= self.way[i]
        self.way[i] = 1.0
        at = self._add(self.way, -row)
        self.T[i], self.left[i, : at + 1] = 0.0, 0.0
        self.driver = i

    def place(self, i: int, free: bool, k: float) -> None:
        """Move node i to a piece on which it is free with stiffness k, or held; `way` is then another one.

        Of the node, the driver and all others that drives which is fast in both cells: no digits are lost on the way.
        """
        was_free, before = self.free.item(i), self.k.item(i)
        self.free[i], self.k[i] = free, k
        if (free == was_free and (not free or k == before)) or self.stale:
            return
        if free:
            a, b, c, d = (1.0, 0.0, k - before, 1.0) if was_free else (k, 1.0, 1.0, 0.0)
        else:
            a, b, c, d = 0.0, 1.0, 1.0, -before
        row, column, way = self._row(i), self._column(i), self.way
        pivot, speed = a - row.item(i) * c, way.item(i)
        after = pivot * way + (c * speed) * column
        after[i] = speed
        driver, (fast, faster) = self.driver, (np.abs(way), np.abs(after))
        most = fast.item(fast.argmax()), faster.item(faster.argmax())
        if not 0.0 < most[1] < np.inf:
            self.stale = True
            return
        turned = way.item(self.m) / most[0], after.item(self.m) / most[1]
        if self._negatives is None or min(abs(turned[0]), abs(turned[1])) <= AT_REST:
            self._negatives = None
        elif turned[0] * turned[1] < 0.0:  # their quotient is det H′/det H: one eigenvalue has changed its sign
            both = was_free and free
            self._negatives += (-1 if k > before else 1) if both else -1 if was_free else 1
        if abs(speed) >= SOUND * max(most):
            driver = i
        elif not min(1.0 / most[0], faster.item(driver) / most[1]) >= SOUND:
            share = np.minimum(fast / most[0], faster / most[1])
            driver = int(share.argmax())
            if not share[driver] > AT_REST:
                self.stale = True
                return
        if driver != self.driver:
            self.drive(driver)
            row, column = self._row(i), self._column(i)
        if driver == i:
            self.way, new = a * self.way + c * column, b * self.way + d * column
            self.way[i], new[i] = 1.0, 0.0
        else:
            pivot, speed = a - row.item(i) * c, self.way.item(i)
            own = (row.item(i) * d - b) / pivot
            self.way = self.way + (c / pivot * speed) * column
            self.way[i], new = speed / pivot, (d + c * own) * column
            at = self._add((c / pivot) * column, row)
            row /= pivot
            new[i] = row[i] = own
            self.T[i], self.left[i, : at + 1] = row, 0.0
        self.T[:, i], self.right[i, : self.size] = new, 0.0

    def settle(self) -> None:
        """After several changes, of which some may have been singular: the inverse of the last cell."""
        if self.stale:
            self.refactor()

    def become(self, free: NDArray[np.bool_], k: Array) -> None:
        """Move to the cell in which these nodes are free, with this stiffness."""
        changed = np.flatnonzero((free != self.free) | (k != self.k))
        self.stale |= len(changed) > CAPACITY
        for i in changed.tolist():
            self.place(i, bool(free[i]), float(k[i]))
        self.settle()

    def correction(self, defect: Array) -> Array:
        """(m + 1,) what (x, t) have to move for the defect l̃ − Ãu − g (m,) to vanish, the driver's at rest."""
        off = np.where(self.free, -defect, 0.0)
        n = self.size
        moved = _dgemv(1.0, self.left[:, :n], off @ self.right[:, :n], 1.0, self.T @ off) if n else self.T @ off
        moved[: self.m] += np.where(self.free, 0.0, defect)
        if moved[self.driver]:
            moved -= self.way * moved[self.driver]
        return moved

    @property
    def negatives(self) -> int:
        """Negative eigenvalues of H = A_FF + diag(k) over the free nodes."""
        if self._negatives is None:
            F = np.flatnonzero(self.free)
            H = submatrix(self.A, F)
            H[np.arange(len(F)), np.arange(len(F))] += self.k[F]
            self._negatives = len(F) - positive_eigenvalues(H)
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
