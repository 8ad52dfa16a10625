"""The quadratic subproblem of a bundle method by an active set that starts from the multipliers before.

Primal:     min_q  ½qᵀWq + hᵀq + max_j (c_j + a_jᵀq),   W symmetric positive definite
Dual:       min_λ  ½λᵀQλ − bᵀλ  over λ ≥ 0, Σλ_j = 1;   Q = TTᵀ, T = W^{−½} on the rows a_j, b = c − T W^{−½}h
Method:     primal active set on the dual, as in Lawson & Hanson, Solving Least Squares Problems (1974), ch. 23, with
            the equality constraint and Kiwiel's treatment of affinely dependent pieces (IMA J. Numer. Anal. 6 (1986))

Consecutive subproblems differ little: with the old multipliers as the first working set most of them end after a
few exchanges. Only rows in the working set are ever whitened or enter Q; all others cost one product a_jᵀq.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.solve.bundle_metric import Metric

Array = NDArray[np.float64]
Index = NDArray[np.intp]

DEPENDENT = 1e-13
"""A squared pivot below this share of its diagonal entry: the piece depends affinely on those before it."""


@dataclass
class WorkingSet:
    """Pieces with their multipliers, whitened slopes and Gram matrix, in one order.

    index: (k,) piece
    lam:   (k,) multipliers ≥ 0 with sum 1
    T:     (k, n) whitened slopes
    Q:     (k, k) TTᵀ
    b:     (k,) c_j − T_j·(whitened h)
    """

    index: Index
    lam: Array
    T: Array
    Q: Array
    b: Array

    def add(self, piece: int, row: Array, b: float) -> None:
        """Append a piece with multiplier 0."""
        k = len(self.index)
        column = self.T @ row
        Q = np.empty((k + 1, k + 1))
        Q[:k, :k] = self.Q
        Q[k, :k] = Q[:k, k] = column
        Q[k, k] = row @ row
        self.index, self.lam = np.append(self.index, piece), np.append(self.lam, 0.0)
        self.T, self.Q, self.b = np.vstack([self.T, row]), Q, np.append(self.b, b)

    def drop(self, position: int) -> None:
        """Remove a piece; the remaining multipliers keep the sum 1."""
        keep = np.arange(len(self.index)) != position
        self.index, self.lam = self.index[keep], self.lam[keep]
        self.T, self.Q, self.b = self.T[keep], self.Q[np.ix_(keep, keep)], self.b[keep]
        self.lam = self.lam / self.lam.sum()

    def walk(self, direction: Array, longest: float) -> int | None:
        """Move the multipliers along `direction` until one vanishes and is dropped; its piece, or None."""
        falling = np.flatnonzero(direction < 0.0)
        steps = self.lam[falling] / -direction[falling]
        if not len(falling) or np.min(steps) >= longest:
            self.lam = np.maximum(self.lam + longest * direction, 0.0)
            self.lam /= self.lam.sum()
            return None
        first = int(falling[np.argmin(steps)])
        self.lam = np.maximum(self.lam + np.min(steps) * direction, 0.0)
        piece = int(self.index[first])
        self.drop(first)
        return piece

    def direction(self) -> tuple[Array, float]:
        """Direction to the minimum over Σλ = 1 and its length 1, or a direction of unlimited descent and inf."""
        k = len(self.index)
        border = float(np.trace(self.Q)) / k
        K = self.Q + (border or 1.0)  # the border changes nothing on Σλ = 1 and fills the one allowed null direction
        factor, info = scipy.linalg.lapack.dpotrf(K.T, lower=1, clean=0)
        pivots = np.square(np.diagonal(factor)[: info - 1 if info else k])
        weak = np.flatnonzero(pivots <= DEPENDENT * np.diagonal(K)[: len(pivots)])
        if info or len(weak):
            p = int(weak[0]) if len(weak) else int(info) - 1
            null = np.zeros(k)
            null[p] = 1.0
            if p:
                null[:p] = -scipy.linalg.lapack.dpotrs(factor[:p, :p], K[:p, p], lower=1)[0]
            null[p] -= float(null.sum())
            slope = float(null @ (self.Q @ self.lam - self.b))
            return (null if slope <= 0.0 else -null), float("inf")
        solved = scipy.linalg.lapack.dpotrs(factor, np.array([self.b, np.ones(k)]).T, lower=1)[0]
        free, ones = solved[:, 0], solved[:, 1]
        return free + ones * ((1.0 - float(free.sum())) / float(ones.sum())) - self.lam, 1.0


def active_set(c: Array, A: Array, h: Array, metric: Metric, start: Array) -> tuple[WorkingSet, Array] | None:
    """The final working set and the minimiser q (n,), or None if rounding makes the exchanges go round.

    c: (N,) values of the linear pieces at q = 0
    A: (N, n) their slopes a_j in rows
    h: (n,) slope of the smooth part
    start: (N,) multipliers to start from; at least one positive
    """
    index = np.flatnonzero(start)
    h_white, T = metric.whiten(h), metric.whiten(A[index])
    share = start[index] / start[index].sum()
    working = WorkingSet(index, share, T, T @ T.T, c[index] - T @ h_white)
    added = -1
    for _ in range(2 * len(index) + 2 * len(h) + 10):
        direction, longest = working.direction()
        lost = abs(float(direction.sum())) > 1e-8 * max(1.0, float(np.max(np.abs(direction))))
        if lost or not np.all(np.isfinite(direction)) or (longest == np.inf and not np.any(direction < 0.0)):
            return None
        dropped = working.walk(direction, longest)
        if dropped is not None:
            if dropped == added or not len(working.index):
                return None
            continue
        q = -metric.unwhiten(working.lam @ working.T + h_white)
        values = c + A @ q
        added = int(np.argmax(values))
        inside = values[working.index]
        noise = 4 * np.finfo(float).eps * (np.max(np.abs(c[working.index])) + np.max(np.abs(inside)))
        if added in working.index or values[added] <= np.max(inside) + noise:
            return working, q
        row = metric.whiten(A[added])
        working.add(added, row, float(c[added] - row @ h_white))
    return None
