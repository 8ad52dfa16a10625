"""The quadratic subproblem of a bundle method, by its dual on the unit simplex, and its metric.

Primal:     min_q  ½qᵀWq + hᵀq + max_j (c_j + a_jᵀq),   W = LLᵀ symmetric positive definite
Dual:       min_λ  ½‖Tᵀλ‖² − bᵀλ  over λ ≥ 0, Σλ_j = 1
            with rows T_j = L⁻¹a_j, b = c − T L⁻¹h and q = −L⁻ᵀ(L⁻¹h + Tᵀλ)
Method:     dual active set (Goldfarb & Idnani, Math. Programming 27 (1983)) on the orthogonal
            factors of the active rows; TTᵀ, whose condition number is the square of theirs, is
            never formed
Literature: Lukšan & Vlček, Math. Programming 83 (1998), the direction-finding subproblem and its
            dual

Consecutive subproblems differ little: with the old multipliers as the first working set most of
them end after a few exchanges. Only rows in the working set are ever whitened; all others cost one
product a_jᵀq. A working set never becomes dependent: a piece enters only where that pays before
another one leaves. So of many multipliers for the same q the method finds those of affinely
independent pieces.
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
"""Multiplier above which a piece counts as active."""
MIN_PIVOT = 1e-8
"""Pivot of the scaled slopes of a guess below which a piece depends on the others."""
MAX_EXCHANGES = 10
"""Pieces that may enter, per piece and dimension."""
MAX_SLOPE = 1024.0
"""Largest slope of an entering piece in units of s; s grows with steeper ones."""
EPS = float(np.finfo(float).eps)
TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True, eq=False)
class Metric:
    """W = LLᵀ with its root L⁻¹ on rows and on a vector.

    matrix: (n, n) W
    factor: (n, n) L in Fortran order (upper part not meaningful)
    """

    matrix: Array
    factor: Array

    def whiten(self, vectors: Array) -> Array:
        """Return L⁻¹ applied to each row (or to one vector)."""
        columns = np.atleast_2d(vectors).T
        white: Array = scipy.linalg.blas.dtrsm(1.0, self.factor, columns, lower=1).T
        return white if vectors.ndim == 2 else white[0]

    def unwhiten(self, z: Array) -> Array:
        """Return L⁻ᵀz."""
        vector: Array = scipy.linalg.blas.dtrsv(self.factor, z, lower=1, trans=1)
        return vector


def positive_definite(H: Array, shift: float, pivot: float, least: float) -> Metric:
    """Return W: H with negative eigenvalues reversed, plus shift·I, and eigenvalues bounded below.

    The bound is `least` and pivot times the largest eigenvalue. If H + (shift − floor)·I has a
    Cholesky factor, no eigenvalue needs a change, at a tenth of the cost. The floor there uses the
    norm ‖H‖_∞, which is no smaller than the largest eigenvalue: it errs to the side of the
    eigenvalues.
    """
    identity = np.eye(len(H))
    norm = float(np.max(np.sum(np.abs(H), axis=1)))
    floor = max(pivot * (norm + shift), least)
    W = H + shift * identity
    if not (floor > 0.0 and cholesky(W - floor * identity)[1] == 0):
        eigenvalues, V = np.linalg.eigh(H)
        eigenvalues = np.abs(eigenvalues) + shift
        # if all slopes and curvatures are 0 any W will do
        floor = max(pivot * float(eigenvalues.max()), least) or 1.0
        W = (V * np.maximum(eigenvalues, floor)) @ V.T
    return Metric(W, cholesky(W.copy())[0])


def dual_decrease(c: Array, A: Array, lam: Array, metric: Metric) -> float:
    """Return ½‖Σλ_j a_j‖²_{W⁻¹} − cᵀλ ≥ 0.

    By weak duality no q lowers ½qᵀWq + max_j (c_j + a_jᵀq) by more.
    """
    return float(0.5 * np.sum(metric.whiten(lam @ A) ** 2) - c @ lam)


def direction(c: Array, A: Array, h: Array, metric: Metric, likely: Array) -> tuple[Array, Array]:
    """Return multipliers λ (N,) and the minimiser q (n,) of ½qᵀWq + hᵀq + max_j (c_j + a_jᵀq).

    c:      (N,) values of the linear pieces at q = 0
    A:      (N, n) their slopes a_j in rows
    h:      (n,) slope of the smooth part
    likely: (N,) guess of the multipliers

    The piece that lies above the active ones by the longest distance (value over slope) enters
    next. The method ends where none does by more than rounding or, since the last exchange, could
    enter for rounding. The answer is the one of least duality gap on the way.
    """
    start = np.flatnonzero(likely > ACTIVE)
    if not len(start):
        start = np.array([int(np.argmax(c))])
    working = WorkingSet(c, A, h, metric)
    working.restart(start, np.maximum(likely[start], ACTIVE))
    lam = np.zeros(len(c))
    q = np.zeros(len(h))
    least_gap = np.inf
    refused = np.zeros(len(c), dtype=bool)
    trial, values = working.minimum()
    for _ in range(MAX_EXCHANGES * (len(c) + len(h))):
        active = values[working.index]
        gap = float(np.max(values) - working.lam @ active)
        if gap < least_gap:
            lam = np.zeros(len(c))
            lam[working.index] = working.lam
            q = trial
            least_gap = gap
        excess = values - np.max(active) - working.rounding(trial)
        excess[refused] = excess[working.index] = -np.inf
        highest = int(np.argmax(excess / working.scales))
        if not excess[highest] > 0.0:
            break
        working.enter(highest)
        trial, values = working.minimum()
        if highest in working.index:
            refused[:] = False
        else:
            refused[highest] = True
    return lam, q


class WorkingSet:
    """Affinely independent pieces with positive multipliers, and factors of their whitened slopes.

    Mᵀ = QR with rows M_j = (T_j, s) of the working set. Where Σλ = 1 the s adds a constant to
    ‖Mᵀλ‖², and it turns affine independence into linear. It is of the size of the T_j, and only
    rounding depends on it.

    index, lam, b: (k,) the pieces, their multipliers and b_j
    Q, R, s:       the orthogonal factors (n + 1, k), (k, k), and the last column of M
    """

    index: Index
    lam: Array
    b: Array
    Q: Array
    R: Array
    s: float

    def __init__(self, c: Array, A: Array, h: Array, metric: Metric) -> None:
        self.c = c
        self.A = A
        self.metric = metric
        self.h_white = metric.whiten(h)
        self.sizes = np.linalg.norm(A, axis=1)
        # slopes to divide by, none 0
        self.scales = np.maximum(self.sizes, EPS * float(np.max(self.sizes)) or 1.0)

    def rounding(self, q: Array) -> Array:
        """Return (N,) the rounding error of c_j + a_jᵀq."""
        length = float(np.linalg.norm(q))
        return np.asarray(4.0 * EPS * (np.abs(self.c) + self.sizes * length))

    def restart(self, index: Index, shares: Array, least: float = 0.0) -> None:
        """Take these pieces as the working set, but none that depends on others.

        shares: their multipliers > 0, of any sum;  least: smallest s
        """
        T = self.metric.whiten(self.A[index])
        size = float(np.median(np.linalg.norm(T, axis=1)))
        self.s = max(size, least) or 1.0
        M = np.column_stack([T, np.full(len(T), self.s)])
        scaled = M / np.linalg.norm(M, axis=1)[:, None]
        R, order = scipy.linalg.qr(scaled.T, mode="r", pivoting=True)
        rank = int(np.sum(np.abs(np.diagonal(R)) > MIN_PIVOT))
        independent = np.sort(order[:rank])
        self.Q, self.R = scipy.linalg.qr(M[independent].T, mode="economic", check_finite=False)
        self.index = index[independent]
        self.lam = shares[independent] / shares[independent].sum()
        self.b = self.c[self.index] - T[independent] @ self.h_white

    def solve(self, right: Array, total: float) -> Array:
        """Return w = Rλ with MQw = right + any constant and Σλ = total."""
        w = scipy.linalg.blas.dtrsv(self.R, right - self.lam @ right, trans=1)
        last_row = self.Q[-1]
        missing = self.s * total - float(last_row @ w)
        return w + last_row * (missing / float(last_row @ last_row))

    def minimum(self) -> tuple[Array, Array]:
        """Return q and c + Aq at the minimum over the working set.

        The set first loses the pieces that would need λ_j ≤ 0. q = −L⁻ᵀ(L⁻¹h + Tᵀλ) may cancel, so
        it is refined until the active pieces are equal to rounding.
        """
        while True:
            w = self.solve(self.b, 1.0)
            lam = scipy.linalg.blas.dtrsv(self.R, w)
            if len(lam) == 1 or not np.min(lam) <= 0.0:
                break
            self.walk(lam - self.lam, 1.0)
        self.lam = lam / lam.sum()
        z = -(self.Q @ w)[:-1] - self.h_white
        spread = np.inf
        while True:
            q = self.metric.unwhiten(z)
            values = self.c + self.A @ q
            active = values[self.index]
            last_spread, spread = spread, float(np.ptp(active))
            rounding = float(np.max(self.rounding(q)[self.index]))
            if not rounding < spread <= 0.5 * last_spread:
                return q, values
            z -= (self.Q @ self.solve(active, 0.0))[:-1]

    def walk(self, change: Array, longest: float) -> float:
        """Move λ along `change` until a piece has no share, which leaves, and return the length.

        longest: length at which the move ends before that
        """
        lengths = np.full(len(change), np.inf)
        falls = change < 0.0
        lengths[falls] = self.lam[falls] / -change[falls]
        first = int(np.argmin(lengths))
        leaves = bool(lengths[first] <= longest)
        length = float(lengths[first]) if leaves else longest
        self.lam = np.maximum(self.lam + length * change, TINY)
        if leaves:
            Q, R = scipy.linalg.qr_delete(
                self.Q, self.R, first, which="col", overwrite_qr=True, check_finite=False
            )
            count = len(self.index) - 1
            self.Q = Q[:, :count]
            self.R = R[:count]
            self.index = np.delete(self.index, first)
            self.lam = np.delete(self.lam, first)
            self.b = np.delete(self.b, first)
        return length

    def enter(self, piece: int) -> None:
        """Raise the multiplier of a piece above the others from 0 until it joins them.

        Others vanish meanwhile and leave. A dependent piece never joins by itself (bend = 0): one
        of the others vanishes first, as Σθ_j = 1.
        """
        T = self.metric.whiten(self.A[piece])
        b = float(self.c[piece] - T @ self.h_white)
        least = float(np.linalg.norm(T)) / MAX_SLOPE
        if self.s < least:
            self.restart(self.index, self.lam, least)
        m = np.append(T, self.s)
        share = 0.0
        has_lost = True
        while has_lost and len(self.index):
            count = len(self.index)
            along, normal = self.split(m)
            last_row = self.Q[-1]
            tilt = last_row * (float(normal[-1]) / float(last_row @ last_row))
            theta = scipy.linalg.blas.dtrsv(self.R, along + tilt)
            free = normal - self.Q @ tilt
            x = self.Q @ (self.R @ self.lam) + share * m
            slope = b - float(theta @ self.b) - float(free @ x)
            bend = float(free @ free)
            share += self.walk(-theta, slope / bend if slope < bend / TINY else np.inf)
            has_lost = len(self.index) < count
        if not len(self.index):
            along, normal = np.zeros(0), m
        size = float(np.linalg.norm(normal))
        R = np.zeros((len(self.index) + 1, len(self.index) + 1), order="F")
        R[:-1, :-1] = self.R
        R[:-1, -1] = along
        R[-1, -1] = size
        self.R = R
        self.Q = np.column_stack([self.Q, normal / size])
        self.index = np.append(self.index, piece)
        self.lam = np.append(self.lam, max(share, TINY))
        self.b = np.append(self.b, b)

    def split(self, m: Array) -> tuple[Array, Array]:
        """Return Qᵀm and m − QQᵀm; Gram and Schmidt twice is enough."""
        first = m @ self.Q
        normal = m - self.Q @ first
        second = normal @ self.Q
        return first + second, normal - self.Q @ second
