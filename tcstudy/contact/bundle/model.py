"""The model of the bundle-Newton method: the largest of damped quadratic pieces, and its minimiser.

Model:      f(x) + max_j { −α_j + g_jᵀd + ½ρ_j dᵀG_j d },   x the centre, d the step
Pieces:     f_j = f(y_j) + g(y_j)ᵀδ + ½ρ_j δᵀG_jδ,  g_j = g(y_j) + ρ_j G_j δ,  δ = x − y_j,  0 ≤ ρ_j ≤ 1
Locality:   α_j = max{ |f(x) − f_j|, γ‖W‖ s_j² },  s_j the distance of y_j from x
Literature: Lukšan & Vlček, A bundle-Newton method for nonsmooth unconstrained minimization,
            Math. Programming 83 (1998) 373–391 (quadratic model, damping, subgradient locality measures)

Differences from the publication, each because it saves evaluations:
  * ‖W‖ in the locality measure makes γ a pure number; s_j is the distance, not the length of the path.
  * ρ_j is not 0 or 1: it is lowered in proportion to the amount by which the piece lies above f(x).
  * The published step solves one quadratic programme with W = Σλ_jρ_jG_j of the previous multipliers. Here the
    programme is repeated about its own solution until the quadratic model itself is minimised: W is then the
    Hessian of the present Lagrangian and the curvature of the kinks (the second-order correction) is in the step.
    This costs quadratic programmes but no evaluation.

Where all pieces share the curvature of a smooth part, G_j = B + diag(h_j), products with N pieces cost O(n² + Nn)
instead of O(Nn²) and the bundle stores N vectors instead of N matrices. An oracle says so by returning a
`DiagonalShift`; every other oracle returns a dense symmetric matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.bundle.simplex_qp import direction, dual_decrease, positive_definite

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DiagonalShift:
    """G = B + diag(h).

    base:     (n, n) symmetric B, the same object for all pieces of a run
    diagonal: (n,) h
    """

    base: Array
    diagonal: Array

    def __matmul__(self, vector: Array) -> Array:
        product: Array = self.base @ vector + self.diagonal * vector
        return product

    def __array__(self, dtype: object = None, copy: bool | None = None) -> Array:
        return self.base + np.diag(self.diagonal)


Hessian = Array | DiagonalShift


@dataclass(frozen=True, eq=False)
class Stack:
    """The G_j of a bundle, ready for products with all of them; base and diagonals, or dense.

    base:      (n, n) B, None if dense
    diagonals: (N, n) h_j in rows, without rows if dense
    dense:     the N matrices if there is no common base
    """

    base: Array | None
    diagonals: Array
    dense: Sequence[Array]

    @staticmethod
    def of(hessians: Sequence[Hessian]) -> Stack:
        """The stack of the given matrices (nothing of size n² is copied unless structured and dense are mixed)."""
        shifts = [G for G in hessians if isinstance(G, DiagonalShift)]
        if len(shifts) == len(hessians) and all(G.base is shifts[0].base for G in shifts):
            return Stack(shifts[0].base, np.array([G.diagonal for G in shifts]), ())
        return Stack(None, np.zeros((0, 0)), tuple(np.asarray(G) for G in hessians))

    def times(self, d: Array) -> Array:
        """(N, n) G_j d; one d (n,) for all pieces."""
        if self.base is not None:
            return self.base @ d + self.diagonals * d
        return np.array([G @ d for G in self.dense])

    def times_rows(self, rows: Array) -> Array:
        """(N, n) G_j δ_j; a row δ_j (N, n) for each piece."""
        if self.base is not None:
            return rows @ self.base + self.diagonals * rows
        return np.array([G @ row for G, row in zip(self.dense, rows, strict=True)])

    def combine(self, weights: Array) -> Array:
        """(n, n) Σ w_j G_j as a new dense matrix."""
        if self.base is not None:
            total = float(weights.sum()) * self.base
            total[np.diag_indices(len(total))] += weights @ self.diagonals
            return total
        used = np.flatnonzero(weights)
        total = np.zeros_like(self.dense[0], dtype=float)
        for j in map(int, used):
            total += weights[j] * self.dense[j]
        return total


FAR = 4.0
"""Multiple of the radius beyond which a step is not worth completing."""
DAMPING = 5.0
"""Decrease of ρ_j per relative overestimate of f(x) by the piece's curvature."""
INNER, INNER_TOLERANCE = 40, 1e-3
"""Quadratic programmes per minimisation of the model at most; the relative change at which that counts as minimised."""
PIVOT, LEAST_CURVATURE, LOOSER = 1e-8, 1e-2, 0.25
"""Smallest eigenvalue of W relative to its largest and, where no piece is curved, to (largest slope)/(first length);
factor of the latter after each full step, as W must not hold back steps along pieces much flatter than the steepest."""


@dataclass(frozen=True)
class Piece:
    """What the oracle said at y.

    y:      (n,) point
    f:      value at y
    g:      (n,) subgradient at y
    G:      (n, n) second derivatives of the active piece at y, dense or a DiagonalShift
    """

    y: Array
    f: float
    g: Array
    G: Hessian

    @property
    def finite(self) -> bool:
        """True if f, g and G are all finite."""
        return bool(np.isfinite(self.f) and np.all(np.isfinite(self.g)) and np.all(np.isfinite(self.G)))


@dataclass(frozen=True)
class Model:
    """Arrays of the model about a centre.

    c:     (N,) −α_j
    A:     (N, n) g_j in rows
    rho:   (N,) ρ_j
    stack: the N matrices G_j
    s:     (N,) localities
    curvature: ‖Σλ_jG_j‖₂ of the multipliers at hand
    """

    c: Array
    A: Array
    rho: Array
    stack: Stack
    s: Array
    curvature: float

    def bend(self, d: Array) -> Array:
        """(N, n) ρ_jG_jd."""
        return self.rho[:, None] * self.stack.times(d)

    def values(self, d: Array) -> Array:
        """(N,) −α_j + g_jᵀd + ½ρ_j dᵀG_jd."""
        return self.c + self.A @ d + 0.5 * (self.bend(d) @ d)

    def value(self, d: Array) -> float:
        """max_j −α_j + g_jᵀd + ½ρ_j dᵀG_jd, the predicted change of f."""
        return float(np.max(self.values(d)))


@dataclass(frozen=True)
class Step:
    """A minimiser of the model.

    d:         (n,) step
    lam:       (N,) multipliers
    decrease:  predicted decrease of f, −model(d) ≥ 0
    promise:   w = ½‖Σλ_jg_j‖²_{W⁻¹} + Σλ_jα_j of the first quadratic programme without shift: the published
               stopping quantity
    shift:     multiple μ of the identity that kept d within the radius, 0 if the radius did not bind
    factorisations: quadratic programmes solved, each with a factorisation of W
    """

    d: Array
    lam: Array
    decrease: float
    promise: float
    shift: float
    factorisations: int

    @property
    def length(self) -> float:
        """‖d‖."""
        return float(np.linalg.norm(self.d))


def assemble(pieces: Sequence[Piece], lam: Array, x: Array, f: float, gamma: float) -> Model:
    """The model of all pieces about (x, f); lam (N,) are the latest multipliers, γ the weight of distances."""
    stack = Stack.of([p.G for p in pieces])
    curvature = float(np.max(np.abs(np.linalg.eigvalsh(stack.combine(lam)))))
    return carry(pieces, stack, x, f, gamma, curvature)


def carry(pieces: Sequence[Piece], stack: Stack, x: Array, f: float, gamma: float, curvature: float) -> Model:
    """Every piece at the centre x with value f: f_j, g_j, the largest ρ_j that keeps it at or below f, and −α_j."""
    g, values = np.array([p.g for p in pieces]), np.array([p.f for p in pieces])
    delta = x - np.array([p.y for p in pieces])
    turn = stack.times_rows(delta)
    bend = 0.5 * _rowwise(delta, turn)
    linear = values + _rowwise(g, delta)
    over = linear + bend - f
    damped = (over > 0.0) & (bend > 0.0)
    rho = np.ones(len(pieces))
    rho[damped] = np.maximum(0.0, 1.0 - DAMPING * over[damped] / bend[damped])
    s = np.linalg.norm(delta, axis=1)
    alpha = np.maximum(np.abs(linear + rho * bend - f), gamma * curvature * s * s)
    return Model(-alpha, g + rho[:, None] * turn, rho, stack, s, curvature)


def smoothly_joined(pieces: Sequence[Piece], q: Piece) -> NDArray[np.bool_]:
    """(N,) True where f looks smooth between a piece's point and q's: then the nearer Taylor expansion is enough.

    f(q) − f(p) is compared with its fifth-order quadrature ½(g_p+g_q)ᵀd + (1/12)dᵀ(G_p−G_q)d and the change
    of g with its trapezoidal rule; a kink between the points leaves an error as large as a Taylor expansion's.
    """
    g, f = np.array([p.g for p in pieces]), np.array([p.f for p in pieces])
    d = q.y - np.array([p.y for p in pieces])
    Gp, Gq = Stack.of([p.G for p in pieces]).times_rows(d), Stack.of([q.G] * len(pieces)).times_rows(d)
    change, mean = q.f - f, 0.5 * _rowwise(g + q.g, d)
    hermite = np.abs(change - mean - _rowwise(Gp - Gq, d) / 12.0)
    forward = np.abs(change - _rowwise(g, d) - 0.5 * _rowwise(Gp, d))
    backward = np.abs(change - d @ q.g + 0.5 * _rowwise(Gq, d))
    eps = np.finfo(float).eps
    values = hermite <= 0.1 * np.maximum(forward, backward) + 50 * eps * (np.abs(f) + abs(q.f))
    turn = q.g - g
    taylor = np.maximum(np.linalg.norm(turn - Gp, axis=1), np.linalg.norm(turn - Gq, axis=1))
    noise = 500 * eps * np.maximum(np.linalg.norm(g, axis=1), np.linalg.norm(q.g))
    return values & (np.linalg.norm(turn - 0.5 * (Gp + Gq), axis=1) <= 0.5 * taylor + noise)


def _rowwise(a: Array, b: Array) -> Array:
    """(N,) a_jᵀb_j of the rows."""
    return np.einsum("ji,ji->j", a, b)


def minimise(model: Model, lam: Array, shift: float, unit: float, limit: float) -> Step:
    """A local minimiser of model + ½·shift·‖d‖² by repeated quadratic programmes with halving, from d = 0.

    limit: ends as soon as ‖d‖ exceeds this, because such a step will be rejected
    """

    def merit(d: Array) -> float:
        return model.value(d) + 0.5 * shift * float(d @ d)

    d = np.zeros(model.A.shape[1])
    best, used = merit(d), 0
    least = LEAST_CURVATURE * float(np.max(np.abs(model.A))) / unit
    promise = 0.0
    for used in range(1, INNER + 1):
        Gd = model.bend(d)
        metric = positive_definite(model.stack.combine(lam * model.rho), shift, PIVOT, least)
        lam, q = direction(model.c + model.A @ d + 0.5 * (Gd @ d), model.A + Gd, shift * d, metric, lam)
        if used == 1:
            promise = dual_decrease(model.c, model.A, lam, metric)
        t = 1.0
        while t > 1e-15 and not (trial := merit(d + t * q)) < best:
            t *= 0.5
        if t <= 1e-15:
            if used > 1:
                break
            continue
        d = d + t * q
        least *= LOOSER if t == 1.0 else 1.0
        small = t * np.linalg.norm(q) <= INNER_TOLERANCE * np.linalg.norm(d)
        flat = best - trial <= INNER_TOLERANCE * abs(trial)
        best = trial
        if (used > 1 and (small or flat)) or np.linalg.norm(d) > limit:
            break
    return Step(d, lam, -model.value(d), promise, shift, used)


def bounded_step(model: Model, lam: Array, radius: float, unit: float, likely_shift: float = 0.0) -> Step:
    """The model's minimiser, shifted by the smallest μI found that keeps ‖d‖ ≤ 1.2·radius (μ by bisection).

    likely_shift: μ of the step before, tried second
    A nonconvex model may jump past the radius as μ falls; then the longest step found below it counts.
    """
    far = FAR * radius
    step = minimise(model, lam, 0.0, unit, far)
    used, promise, inside = step.factorisations, step.promise, None
    shift, low, high = 0.0, 0.0, np.inf
    for _ in range(25):
        failed = step.length == 0.0 < promise
        if step.length > 1.2 * radius or failed:
            low = shift
        else:
            inside, high = step, shift
            if shift == 0.0 or step.length >= 0.6 * radius or high <= 1e-6 * model.curvature:
                break
        if high < 1.3 * low:
            break
        if np.isfinite(high):
            shift = float(np.sqrt(high * max(low, 1e-3 * high)))
        elif shift == 0.0 < likely_shift and not failed:
            shift = likely_shift
        else:
            slope = float(np.max(np.abs(model.A)) if failed else np.linalg.norm(step.lam @ model.A))
            shift = max(slope / radius, 10.0 * shift)
        step = minimise(model, lam, shift, unit, far)
        used += step.factorisations
    found = inside or cut_back(model, step, radius)
    return replace(found, promise=promise, factorisations=used)


def cut_back(model: Model, step: Step, radius: float) -> Step:
    """A step that is too long, shortened to the radius and on until the model falls."""
    t = min(1.0, radius / step.length) if step.length > 0.0 else 0.0
    while t > 1e-15 and model.value(t * step.d) >= 0.0:
        t *= 0.5
    d = t * step.d
    return replace(step, d=d, decrease=-model.value(d))
