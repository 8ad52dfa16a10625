"""The quadratic subproblem of a bundle method, through its dual on the unit simplex, and the metric W in it.

Primal:     min_q  ½qᵀWq + hᵀq + max_j (c_j + a_jᵀq),   W symmetric positive definite
Dual:       min_λ  ½λᵀQλ − bᵀλ  over λ ≥ 0, Σλ_j = 1;   Q = TTᵀ, T = W^{−½} on the rows a_j, b = c − T W^{−½}h,
            q = −W⁻¹(h + Σλ_j a_j)
Method:     DAQP (Arnström, Bemporad & Axehill, IEEE Trans. Automat. Control 67 (2022)) on few of the pieces
Literature: Lukšan & Vlček, Math. Programming 83 (1998), the direction-finding subproblem and its dual

Consecutive subproblems differ little: the pieces of the old multipliers, and few more, are most often the active ones,
and all others cost one product a_jᵀq. Where W is nearly singular across the kinks Q is badly conditioned, so the
optimality system of the active pieces is then solved directly, which needs W only along the kinks.
"""

from __future__ import annotations

from dataclasses import dataclass

import daqp
import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.solvers.separable.pieces import cholesky

Array = NDArray[np.float64]
Index = NDArray[np.intp]

ACTIVE = 1e-9
"""A multiplier above this share of 1 counts as active."""
ATTEMPTS = ((1e-14, 1e-11), (1e-14, 1e-9), (1e-11, 1e-9), (1e-8, 1e-8))
"""Shift of the scaled dual matrix and DAQP's feasibility tolerance, sharpest first."""
EQUALITY = 5
"""DAQP's mark of an equality constraint."""


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
        solved: Array = scipy.linalg.blas.dtrsm(1.0, self.factor, np.atleast_2d(vectors).T, lower=1).T
        return solved if vectors.ndim == 2 else solved[0]

    def unwhiten(self, z: Array) -> Array:
        """L⁻ᵀz."""
        solved: Array = scipy.linalg.blas.dtrsv(self.factor, z, lower=1, trans=1)
        return solved


def positive_definite(H: Array, shift: float, pivot: float, least: float) -> Metric:
    """W: H with negative eigenvalues reversed, plus shift·I; eigenvalues at least pivot·largest and `least`.

    If H + (shift − floor)·I has a Cholesky factor, no eigenvalue needs a change, at a tenth of the cost. The floor
    there uses the norm ‖H‖_∞ ≥ largest eigenvalue, so it errs to the side of the eigenvalues.
    """
    floor = max(pivot * (float(np.max(np.sum(np.abs(H), axis=1))) + shift), least)
    W = H + shift * np.eye(len(H))
    if not (floor > 0.0 and cholesky(W - floor * np.eye(len(H)))[1] == 0):
        w, V = np.linalg.eigh(H)
        w = np.abs(w) + shift
        floor = max(pivot * float(w.max()), least) or 1.0  # all slopes and curvatures 0: any W will do
        W = (V * np.maximum(w, floor)) @ V.T
    return Metric(W, cholesky(W.copy())[0])


def direction(c: Array, A: Array, h: Array, metric: Metric, likely: Array) -> tuple[Array, Array]:
    """Multipliers λ (N,) and the minimiser q (n,) of ½qᵀWq + hᵀq + max_j (c_j + a_jᵀq).

    c: (N,) values of the linear pieces at q = 0
    A: (N, n) their slopes a_j in rows
    h: (n,) slope of the smooth part
    likely: (N,) guess of the multipliers

    DAQP on the pieces of the guess, then with the most violated one added, until none is; never on all at once: steep
    ones that play no part would spoil the scaling.
    """
    chosen = likely > ACTIVE
    chosen[np.argmax(c)] = True
    while True:
        index = np.flatnonzero(chosen)
        share, q = on_pieces(c[index], A[index], h, metric)
        worst = int(np.argmax(c + A @ q))
        if chosen[worst]:
            lam = np.zeros(len(c))
            lam[index] = share
            return lam, q
        chosen[worst] = True


def on_pieces(c: Array, A: Array, h: Array, metric: Metric) -> tuple[Array, Array]:
    """`direction` with all given pieces; from the optimality system of the active ones where that is lower."""
    T, h_white = metric.whiten(A), metric.whiten(h)
    lam = simplex_qp(T @ T.T, c - T @ h_white)
    q, W = -metric.unwhiten(T.T @ lam + h_white), metric.matrix
    polished = solve_active_set(c, A, h, W, np.flatnonzero(lam > ACTIVE))
    if polished is not None and primal(polished[1], c, A, h, W) < primal(q, c, A, h, W):
        return polished
    return lam, q


def primal(q: Array, c: Array, A: Array, h: Array, W: Array) -> float:
    """The primal objective at q."""
    return float(0.5 * q @ W @ q + h @ q + np.max(c + A @ q))


def dual_decrease(c: Array, A: Array, lam: Array, metric: Metric) -> float:
    """½‖Σλ_j a_j‖²_{W⁻¹} − cᵀλ ≥ 0: no q lowers ½qᵀWq + max_j (c_j + a_jᵀq) by more (weak duality)."""
    return float(0.5 * np.sum(metric.whiten(lam @ A) ** 2) - c @ lam)


def solve_active_set(c: Array, A: Array, h: Array, W: Array, active: Index) -> tuple[Array, Array] | None:
    """λ and q from the optimality system of the active pieces, or None if no such λ is a multiplier.

    Wq + Σλ_j a_j = −h,   a_jᵀq − v = −c_j (j active),   Σλ_j = 1; pieces with λ_j < 0 leave the set.
    """
    n, W_scale = len(h), float(np.max(np.abs(W)))
    while len(active):
        k = len(active)
        A_scale = float(np.max(np.abs(A[active]))) or 1.0
        K = np.zeros((n + 1 + k, n + 1 + k))
        K[:n, :n] = W / W_scale
        K[:n, n + 1 :] = A[active].T / A_scale
        K[n + 1 :, :n] = A[active] / A_scale
        K[n, n + 1 :] = K[n + 1 :, n] = -1.0
        right = np.concatenate([-h / A_scale, [-1.0], -c[active] * (W_scale / A_scale**2)])
        try:
            solution = np.linalg.solve(K, right)
        except np.linalg.LinAlgError:
            solution = np.linalg.lstsq(K, right, rcond=None)[0]
        share = solution[n + 1 :]
        if np.min(share) >= -1e-3 * ACTIVE:
            lam = np.zeros(len(c))
            lam[active] = np.maximum(share, 0.0)
            return lam / lam.sum(), solution[:n] * (A_scale / W_scale)
        active = active[share > 0.0]
    return None


def simplex_qp(Q: Array, c: Array) -> Array:
    """argmin ½λᵀQλ − cᵀλ over the unit simplex, λ (N,); Q (N, N) positive semidefinite.

    Scaled by N/trace(Q), so that the solver's absolute tolerances become relative. If the solver fails (it cycles
    on some singular Q) the next of ATTEMPTS, at last the best vertex: always a feasible λ.
    """
    N = len(c)
    trace = float(np.trace(Q))
    if N == 1 or not trace > 0.0:
        return np.eye(N)[np.argmax(c)]
    scale = N / trace
    for shift, primal_tol in ATTEMPTS:
        shifted = np.ascontiguousarray(Q * scale + shift * np.eye(N))
        lam = call_daqp(shifted, (np.max(c) - c) * scale, primal_tol)
        if lam is not None:
            return lam
    return np.eye(N)[np.argmax(c - 0.5 * np.diag(Q))]


def call_daqp(Q: Array, q: Array, primal_tol: float) -> Array | None:
    """argmin ½λᵀQλ + qᵀλ over the simplex by DAQP, None if it reports no solution."""
    N = len(q)
    upper = np.concatenate([np.full(N, 1e30), [1.0]])
    lower = np.concatenate([np.zeros(N), [1.0]])
    sense = np.zeros(N + 1, dtype=np.int32)
    sense[N] = EQUALITY
    lam, _, flag, _ = daqp.solve(Q, q, np.ones((1, N)), upper, lower, sense, primal_tol=primal_tol, dual_tol=1e-14)
    lam = np.maximum(np.asarray(lam, dtype=float), 0.0)
    if flag <= 0 or not np.all(np.isfinite(lam)) or not lam.sum() > 0.0:
        return None
    return lam / lam.sum()
