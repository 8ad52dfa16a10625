"""The quadratic subproblem of a bundle method, through its dual on the unit simplex, and the metric
W in it.

Primal:     min_q  ½qᵀWq + hᵀq + max_j (c_j + a_jᵀq),   W = LLᵀ symmetric positive definite
Dual:       min_λ  ½‖Tᵀλ‖² − bᵀλ  over λ ≥ 0, Σλ_j = 1;   rows T_j = L⁻¹a_j, b = c − T L⁻¹h,
            q = −L⁻ᵀ(L⁻¹h + Tᵀλ)
Method:     dual active set (Goldfarb & Idnani, Math. Programming 27 (1983)) on the orthogonal factors of the active
            rows; TTᵀ, whose condition number is the square of theirs, is never formed
Literature: Lukšan & Vlček, Math. Programming 83 (1998), the direction-finding subproblem and its
dual

Consecutive subproblems differ little: with the old multipliers as the first working set most of
them end after a few exchanges. Only rows in the working set are ever whitened; all others cost one
product a_jᵀq. A working set never becomes dependent: a piece enters only where that pays before
another one leaves, so that of many multipliers for the same q those of affinely independent pieces
are found.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.newton import cholesky

Array = NDArray[np.float64]
Index = NDArray[np.intp]

ACTIVE = 1e-9
"""A multiplier above this share of 1 counts as active."""
DEPENDENT = 1e-8
"""A pivot of the scaled slopes of a guess below this: the piece is left out of it."""
EXCHANGES = 10
"""Pieces that may enter at most, per piece and dimension."""
STEEP = 1024.0
"""Largest slope of an entering piece in units of s; s grows with what is steeper."""
EPS, TINY = float(np.finfo(float).eps), float(np.finfo(float).tiny)


@dataclass(frozen=True, eq=False)
class Metric:
    """W = LLᵀ with its root L⁻¹ on rows and on a vector.

    matrix: (n, n) W
    factor: (n, n) L in Fortran order (upper part not meaningful)
    """

    matrix: Array
    factor: Array

    def whiten(self, vectors: Array) -> Array:
        """L⁻¹ applied to each row (or to one vector)."""
        solved: Array = scipy.linalg.blas.dtrsm(
            1.0, self.factor, np.atleast_2d(vectors).T, lower=1
        ).T
        return solved if vectors.ndim == 2 else solved[0]

    def unwhiten(self, z: Array) -> Array:
        """L⁻ᵀz."""
        solved: Array = scipy.linalg.blas.dtrsv(self.factor, z, lower=1, trans=1)
        return solved


def positive_definite(H: Array, shift: float, pivot: float, least: float) -> Metric:
    """W: H with negative eigenvalues reversed, plus shift·I; eigenvalues at least pivot·largest and
    `least`.

    If H + (shift − floor)·I has a Cholesky factor, no eigenvalue needs a change, at a tenth of the
    cost. The floor there uses the norm ‖H‖_∞ ≥ largest eigenvalue, so it errs to the side of the
    eigenvalues.
    """
    floor = max(pivot * (float(np.max(np.sum(np.abs(H), axis=1))) + shift), least)
    W = H + shift * np.eye(len(H))
    if not (floor > 0.0 and cholesky(W - floor * np.eye(len(H)))[1] == 0):
        w, V = np.linalg.eigh(H)
        w = np.abs(w) + shift
        floor = (
            max(pivot * float(w.max()), least) or 1.0
        )  # all slopes and curvatures 0: any W will do
        W = (V * np.maximum(w, floor)) @ V.T
    return Metric(W, cholesky(W.copy())[0])


def dual_decrease(c: Array, A: Array, lam: Array, metric: Metric) -> float:
    """½‖Σλ_j a_j‖²_{W⁻¹} − cᵀλ ≥ 0: no q lowers ½qᵀWq + max_j (c_j + a_jᵀq) by more (weak
    duality)."""
    return float(0.5 * np.sum(metric.whiten(lam @ A) ** 2) - c @ lam)


def direction(c: Array, A: Array, h: Array, metric: Metric, likely: Array) -> tuple[Array, Array]:
    """Multipliers λ (N,) and the minimiser q (n,) of ½qᵀWq + hᵀq + max_j (c_j + a_jᵀq).

    c: (N,) values of the linear pieces at q = 0
    A: (N, n) their slopes a_j in rows
    h: (n,) slope of the smooth part
    likely: (N,) guess of the multipliers

    The piece that lies above the active ones by the longest distance (value over slope) enters
    next. Ends where none does by more than rounding or, since the last exchange, could enter for
    rounding; the answer is the one of least duality gap on the way.
    """
    start = np.flatnonzero(likely > ACTIVE)
    start = start if len(start) else np.array([int(np.argmax(c))])
    working = WorkingSet(c, A, h, metric)
    working.restart(start, np.maximum(likely[start], ACTIVE))
    lam, q, least = np.zeros(len(c)), np.zeros(len(h)), np.inf
    refused = np.zeros(len(c), dtype=bool)
    trial, values = working.minimum()
    for _ in range(EXCHANGES * (len(c) + len(h))):
        gap = float(np.max(values) - working.lam @ values[working.index])
        if gap < least:
            lam = np.zeros(len(c))
            lam[working.index] = working.lam
            least, q = gap, trial
        excess = values - np.max(values[working.index]) - working.rounding(trial)
        excess[refused] = excess[working.index] = -np.inf
        worst = int(np.argmax(excess / working.scales))
        if not excess[worst] > 0.0:
            break
        working.enter(worst)
        trial, values = working.minimum()
        if worst in working.index:
            refused[:] = False
        else:
            refused[worst] = True
    return lam, q


class WorkingSet:
    """Affinely independent pieces with positive multipliers, and orthogonal factors of their
    whitened slopes.

    Mᵀ = QR with rows M_j = (T_j, s) of the working set. Where Σλ = 1 the s adds a constant to
    ‖Mᵀλ‖², and it turns affine independence into linear; it is of the size of the T_j, and only
    rounding depends on it.
    """

    def __init__(self, c: Array, A: Array, h: Array, metric: Metric) -> None:
        self.c, self.A, self.metric, self.h_white = c, A, metric, metric.whiten(h)
        self.sizes = np.linalg.norm(A, axis=1)
        # slopes to divide by, none 0
        self.scales = np.maximum(self.sizes, EPS * float(np.max(self.sizes)) or 1.0)

    def rounding(self, q: Array) -> Array:
        """(N,) what rounding leaves of c_j + a_jᵀq."""
        bound: Array = 4.0 * EPS * (np.abs(self.c) + self.sizes * float(np.linalg.norm(q)))
        return bound

    def restart(self, index: Index, share: Array, least: float = 0.0) -> None:
        """Take these pieces with the multipliers `share` > 0 of any sum, but none that depends on
        others."""
        T = self.metric.whiten(self.A[index])
        sizes = np.linalg.norm(T, axis=1)
        self.s = max(float(np.median(sizes)), least) or 1.0
        M = np.column_stack([T, np.full(len(T), self.s)])
        factors = scipy.linalg.qr(
            (M / np.linalg.norm(M, axis=1)[:, None]).T, mode="r", pivoting=True
        )
        kept = np.sort(factors[1][: int(np.sum(np.abs(np.diagonal(factors[0])) > DEPENDENT))])
        self.Q, self.R = scipy.linalg.qr(M[kept].T, mode="economic", check_finite=False)
        self.index, self.lam = index[kept], share[kept] / share[kept].sum()
        self.b = self.c[self.index] - T[kept] @ self.h_white

    def solve(self, right: Array, total: float) -> Array:
        """w with MQw = right + any constant and Σλ = total, Rλ = w."""
        w, last = scipy.linalg.blas.dtrsv(self.R, right - self.lam @ right, trans=1), self.Q[-1]
        return w + last * ((self.s * total - float(last @ w)) / float(last @ last))

    def minimum(self) -> tuple[Array, Array]:
        """q and c + Aq at the minimum over the working set, which first loses the pieces that would
        need λ_j ≤ 0.

        q = −L⁻ᵀ(L⁻¹h + Tᵀλ) may cancel, so it is refined until the active pieces are equal to
        rounding.
        """
        while True:
            w = self.solve(self.b, 1.0)
            lam = scipy.linalg.blas.dtrsv(self.R, w)
            if len(lam) == 1 or not np.min(lam) <= 0.0:
                break
            self.walk(lam - self.lam, 1.0)
        self.lam = lam / lam.sum()
        z, spread = -(self.Q @ w)[:-1] - self.h_white, np.inf
        while True:
            q = self.metric.unwhiten(z)
            values = self.c + self.A @ q
            active = values[self.index]
            last, spread = spread, float(np.ptp(active))
            if not float(np.max(self.rounding(q)[self.index])) < spread <= 0.5 * last:
                return q, values
            z -= (self.Q @ self.solve(active, 0.0))[:-1]

    def walk(self, change: Array, longest: float) -> float:
        """Move λ along `change` as far as `longest` or until a piece has no share left, which
        leaves; the length."""
        steps = np.full(len(change), np.inf)
        falling = change < 0.0
        steps[falling] = self.lam[falling] / -change[falling]
        first = int(np.argmin(steps))
        blocked = bool(steps[first] <= longest)
        t = float(steps[first]) if blocked else longest
        self.lam = np.maximum(self.lam + t * change, TINY)
        if blocked:
            Q, R = scipy.linalg.qr_delete(
                self.Q, self.R, first, which="col", overwrite_qr=True, check_finite=False
            )
            k = len(self.index) - 1
            self.Q, self.R = Q[:, :k], R[:k]
            self.index, self.lam, self.b = (
                np.delete(part, first) for part in (self.index, self.lam, self.b)
            )
        return t

    def enter(self, piece: int) -> None:
        """Raise the multiplier of a piece above the others from 0 until it joins them, while others
        vanish and leave.

        A dependent piece has no end of its own (bend = 0): one of the others vanishes first, as
        Σθ_j = 1.
        """
        T, share = self.metric.whiten(self.A[piece]), 0.0
        least = float(np.linalg.norm(T)) / STEEP
        if self.s < least:
            self.restart(self.index, self.lam, least)
        m, b = np.append(T, self.s), float(self.c[piece] - T @ self.h_white)
        along, rest = np.zeros(0), m
        while len(self.index):
            along = m @ self.Q
            rest = m - self.Q @ along
            again = rest @ self.Q  # Gram and Schmidt twice is enough
            along, rest = along + again, rest - self.Q @ again
            last = self.Q[-1]
            tilt = last * (float(rest[-1]) / float(last @ last))
            theta, free = scipy.linalg.blas.dtrsv(self.R, along + tilt), rest - self.Q @ tilt
            x = self.Q @ (self.R @ self.lam) + share * m
            slope, bend = b - float(theta @ self.b) - float(free @ x), float(free @ free)
            count = len(self.index)
            share += self.walk(-theta, slope / bend if slope < bend / TINY else np.inf)
            if len(self.index) == count:
                break
            along, rest = np.zeros(0), m  # in case none is left
        R = np.zeros((len(self.index) + 1, len(self.index) + 1), order="F")
        size = float(np.linalg.norm(rest))
        R[:-1, :-1], R[:-1, -1], R[-1, -1] = self.R, along, size
        self.Q, self.R = np.column_stack([self.Q, rest / size]), R
        self.index, self.lam, self.b = (
            np.append(self.index, piece),
            np.append(self.lam, max(share, TINY)),
            np.append(self.b, b),
        )
