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
instead of O(Nn²) and the bundle stores N vectors instead of N matrices: the oracle then returns h (n,) in place of G.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.bundle.simplex_qp import direction, dual_decrease, positive_definite

Array = NDArray[np.float64]

FAR = 4.0
"""Multiple of the radius beyond which a step is not worth completing."""
DAMPING = 5.0
"""Decrease of ρ_j per relative overestimate of f(x) by the piece's curvature."""
INNER, INNER_TOLERANCE = 40, 1e-3
"""Quadratic programmes per minimisation of the model at most; the relative change at which that counts as minimised."""
PIVOT, LEAST_CURVATURE, LOOSER = 1e-8, 1e-2, 0.25
"""Smallest eigenvalue of W relative to its largest and, where no piece is curved, to (largest slope)/(first length);
factor of the latter after each full step, as W must not hold back steps along pieces much flatter than the steepest."""


@dataclass(frozen=True, eq=False)
class Bundle:
    """What the oracle said at N points.

    y, f, g: (N, n) points, (N,) values, (N, n) subgradients
    G:       (N, n, n) second derivatives of the active pieces; with a base (N, n) the diagonals beside it
    base:    (n, n) symmetric B that all share, or None
    """

    y: Array
    f: Array
    g: Array
    G: Array
    base: Array | None = None

    def __len__(self) -> int:
        return len(self.f)

    @property
    def finite(self) -> bool:
        """True if f, g and G are all finite."""
        return all(bool(np.all(np.isfinite(x))) for x in (self.f, self.g, self.G))

    def take(self, which: NDArray[np.intp] | slice) -> Bundle:
        """The named ones."""
        return Bundle(self.y[which], self.f[which], self.g[which], self.G[which], self.base)

    def with_one(self, new: Bundle) -> Bundle:
        """These and others behind them."""
        pairs = (self.y, new.y), (self.f, new.f), (self.g, new.g), (self.G, new.G)
        y, f, g, G = (np.concatenate(pair) for pair in pairs)
        return Bundle(y, f, g, G, self.base)

    def times(self, d: Array) -> Array:
        """(N, n) G_j d_j, of rows d (N, n) or one d (n,) for all."""
        return np.asarray((self.G @ d[..., None])[..., 0] if self.base is None else d @ self.base + self.G * d)

    def combined(self, weights: Array) -> Array:
        """(n, n) Σ w_j G_j as a new matrix."""
        if self.base is None:
            return np.asarray(np.tensordot(weights, self.G, 1))
        return weights.sum() * self.base + np.diag(weights @ self.G)


@dataclass(frozen=True, eq=False)
class Model:
    """The pieces about a centre.

    c:     (N,) −α_j
    A:     (N, n) g_j in rows
    rho:   (N,) ρ_j
    s:     (N,) localities
    curvature: ‖Σλ_jG_j‖₂ of the multipliers at hand
    """

    pieces: Bundle
    c: Array
    A: Array
    rho: Array
    s: Array
    curvature: float

    @classmethod
    def about(cls, x: Array, f: float, pieces: Bundle, gamma: float, curvature: float) -> Model:
        """About the centre x with value f: f_j, g_j, the largest ρ_j that keeps a piece at or below f, and −α_j.

        gamma: weight γ of distances
        """
        delta = x - pieces.y
        turn = pieces.times(delta)
        bend, linear = 0.5 * _rowwise(delta, turn), pieces.f + _rowwise(pieces.g, delta)
        over = linear + bend - f
        damped = (over > 0.0) & (bend > 0.0)
        rho = np.ones(len(pieces))
        rho[damped] = np.maximum(0.0, 1.0 - DAMPING * over[damped] / bend[damped])
        s = np.linalg.norm(delta, axis=1)
        alpha = np.maximum(np.abs(linear + rho * bend - f), gamma * curvature * s * s)
        return cls(pieces, -alpha, pieces.g + rho[:, None] * turn, rho, s, curvature)

    def bend(self, d: Array) -> Array:
        """(N, n) ρ_jG_jd."""
        return self.rho[:, None] * self.pieces.times(d)

    def value(self, d: Array) -> float:
        """max_j −α_j + g_jᵀd + ½ρ_j dᵀG_jd, the predicted change of f."""
        return float(np.max(self.c + self.A @ d + 0.5 * (self.bend(d) @ d)))


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


def smoothly_joined(pieces: Bundle, q: Bundle) -> NDArray[np.bool_]:
    """(N,) True where f looks smooth between a piece's point and q's: then the nearer Taylor expansion is enough.

    f(q) − f(p) is compared with its fifth-order quadrature ½(g_p+g_q)ᵀd + (1/12)dᵀ(G_p−G_q)d and the change
    of g with its trapezoidal rule; a kink between the points leaves an error as large as a Taylor expansion's.
    """
    g, f, d = pieces.g, pieces.f, q.y - pieces.y
    Gp, Gq = pieces.times(d), q.times(d)
    change, mean = q.f - f, 0.5 * _rowwise(g + q.g, d)
    hermite = np.abs(change - mean - _rowwise(Gp - Gq, d) / 12.0)
    forward = np.abs(change - _rowwise(g, d) - 0.5 * _rowwise(Gp, d))
    backward = np.abs(change - _rowwise(q.g, d) + 0.5 * _rowwise(Gq, d))
    eps = np.finfo(float).eps
    values = hermite <= 0.1 * np.maximum(forward, backward) + 50 * eps * (np.abs(f) + np.abs(q.f))
    turn = q.g - g
    taylor = np.maximum(np.linalg.norm(turn - Gp, axis=1), np.linalg.norm(turn - Gq, axis=1))
    noise = 500 * eps * np.maximum(np.linalg.norm(g, axis=1), np.linalg.norm(q.g))
    return values & (np.linalg.norm(turn - 0.5 * (Gp + Gq), axis=1) <= 0.5 * taylor + noise)


def _rowwise(a: Array, b: Array) -> Array:
    """(N,) a_jᵀb_j of the rows."""
    return np.asarray(np.sum(a * b, axis=1))


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
        metric = positive_definite(model.pieces.combined(lam * model.rho), shift, PIVOT, least)
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
