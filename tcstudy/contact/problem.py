"""The condensed contact problem on plain arrays, and the test that judges every solution of it.

Problem:    0 ∈ ∂L̃(v),  L̃(v) = ½vᵀÃv − l̃ᵀv + Ψ(v),  Ψ(v) = Σ c_i j(v_i)
Acceptance: ξ = l̃ − Ãv with ξ_i ∈ c_i b̂(v_i), i = 1..m, eq. (21)
Literature: Šestak & Jovanović, Appl. Math. Mech. 31 (2010), §3
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.extended import extended_residual
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import BEND

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ContactProblem:
    """0 ∈ Ãv − l̃ + ∂Ψ(v) for the tangential displacements v of the m contact nodes.

    A_tilde: (m, m) symmetric positive definite, condensed stiffness [Pa]
    l_tilde: (m,) condensed load [N/m]
    c:       (m,) segment lengths meas(S_i) > 0 [m]
    law:     friction law b [Pa] of the slip [m], or the laws of the nodes (tcstudy/laws)
    A_error: relative error of Ã in its softest direction, and so of λ₁: proofs hold for (1 − A_error) Ã, too
    """

    A_tilde: Array
    l_tilde: Array
    c: Array
    law: Laws
    A_error: float = 0.0

    @property
    def m(self) -> int:
        """Number of contact unknowns."""
        return len(self.c)

    def energy(self, v: Array) -> float:
        """L̃(v) [J/m]."""
        stored = self.law.integral(np.zeros_like(v), v)
        return float(0.5 * v @ (self.A_tilde @ v) - self.l_tilde @ v + self.c @ stored)

    def xi(self, v: Array) -> Array:
        """Nodal friction forces ξ = l̃ − Ãv, eq. (21) [N/m]; ξ_i/c_i is the traction −S_T."""
        return self.l_tilde - self.A_tilde @ v

    @cached_property
    def traction_scale(self) -> float:
        """What is known of `scale` before v is: the law's own, else the largest load per length or b(0) [Pa]."""
        own = self.law.b_scale
        if own > 0.0:
            return own
        return float(np.max(np.abs([*self.l_tilde / self.c, *np.ravel(self.law.b(0.0))]), initial=0.0))

    def xi_rounding(self, v: Array) -> float:
        """What rounding v to doubles does to the inclusion residual, about: the bound of scene/study.py.

        √m ε max_i ((|l̃| + |Ã||v|)_i/c_i + |b′(v_i) v_i|) / (scale of b), the slope of b only off its jumps.
        """
        scale = self.scale(self.xi(v))
        return self.rounding(v) / scale if scale > 0.0 else 0.0

    def rounding(self, v: Array, load: Array | None = None) -> float:
        """The same before it is divided by the scale of b [Pa].

        load: (m,) sizes of what l̃ is summed from, |l̃| without [N/m]
        """
        load = np.abs(self.l_tilde) if load is None else load
        law, size = self.law, (load + np.abs(self.A_tilde) @ np.abs(v)) / self.c
        slope = np.abs(np.stack([law.slope(v, law.piece(v, side)) for side in (-1, +1)])).max(axis=0)
        size += np.where(law.kind_at(v) == BEND, slope * np.abs(v), 0.0)
        return float(np.sqrt(self.m) * np.finfo(float).eps * np.max(size, initial=0.0))

    def distance(self, v: Array, tolerance: float = 0.0, xi: Array | None = None) -> Array:
        """(m,) dist(ξ_i/c_i, b̂(v_i)) [Pa]; nodes within `tolerance` of a kink are tested on the filled interval."""
        traction = (self.xi(v) if xi is None else xi) / self.c
        low, high = self.law.interval(v, tolerance)
        return np.maximum(0.0, np.maximum(low - traction, traction - high))

    def inclusion_residual(self, v: Array, tolerance: float = 0.0, xi: Array | None = None) -> float:
        """max_i dist(ξ_i/c_i, b̂(v_i)) / (scale of b), the acceptance test of every solution (method §3).

        xi: ξ if it is known better than double precision gives it
        """
        return self.relative(self.distance(v, tolerance, xi), self.xi(v) if xi is None else xi)

    def residual_bound(self, v: Array) -> float:
        """The same, no smaller than it is in exact arithmetic: with what rounding may hide in it (`distance_bound`)."""
        law, xi = self.law, self.xi(v)
        terms = np.maximum(*(law.terms(v, law.piece(v, side)) for side in (-1, +1)))
        size = (np.abs(self.l_tilde) + np.abs(self.A_tilde) @ np.abs(v)) / self.c
        return self.relative(distance_bound(xi / self.c, *law.interval(v), size, terms), xi)

    def scale(self, xi: Array) -> float:
        """The law's own scale of b where it has one; else the largest of loads and of ξ per length, or b(0) [Pa]."""
        own = self.law.b_scale
        if own > 0.0:
            return own
        forces = np.maximum(np.abs(self.l_tilde), np.abs(xi)) / self.c
        return float(np.max(forces, initial=0.0)) or self.traction_scale

    def relative(self, traction: Array, xi: Array) -> float:
        """max |traction_i| / (scale of b); infinite where that is no number."""
        worst, scale = float(np.max(np.abs(traction), initial=0.0)), self.scale(xi)
        if worst == 0.0:
            return 0.0
        return worst / scale if np.isfinite(worst) and scale > 0.0 else float("inf")

    @cached_property
    def lambda_1(self) -> float:
        """λ₁ = λ_min(C^{−½}ÃC^{−½}), the body's uniqueness threshold (method §5) [Pa/m]."""
        return self._least[0]

    @property
    def lambda_1_error(self) -> float:
        """Relative error of `lambda_1`: that of Ã and the residual of the eigenpair."""
        return self.A_error + self._least[2]

    @cached_property
    def _least(self) -> tuple[float, Array, float]:
        return least_eigenpair(self.A_tilde, self.c)

    def frictionless(self) -> Array:
        """Ã⁻¹ l̃, the solution without friction (m,)."""
        return scipy.linalg.cho_solve(scipy.linalg.cho_factor(self.A_tilde, lower=True), self.l_tilde)


def distance_bound(traction: Array, low: Array, high: Array, size: Array, terms: Array) -> Array:
    """max_i dist(traction_i, [low_i, high_i]) from above, in spite of the rounding in its numbers (…,) [Pa].

    traction:  ξ/c in double precision;  low, high: b̂(v) (…, m)
    size:      (|l̃| + |Ã||v|)/c;  terms: the magnitudes that b(v) is made of (…, m)

    Sums of m products are taken to be off by up to √m ε of their magnitudes: the probabilistic bound of Higham & Mary,
    SIAM J. Sci. Comput. 41 (2019) A2815–A2835, with λ = 2, for sums one by one; BLAS sums in blocks, which is better.
    """
    error = np.finfo(float).eps * ((np.sqrt(traction.shape[-1]) + 1.0) * size + 2.0 * terms)
    apart = np.maximum(low - traction, traction - high) + error
    return np.asarray(np.max(apart, axis=-1, initial=0.0))


MARGIN = 1e-6
"""μ/λ₁: by how much a matrix must be positive definite in a proof."""


def kept(error: float) -> float:
    """1 − error, the share of Ã and λ₁ that proofs lean on; 1 where the error is within the margin that they have."""
    return 1.0 if error <= MARGIN else max(1.0 - error, float(np.finfo(float).tiny))


def pivot_shift(A_tilde: Array, c: Array, lambda_1: float, margin: float = MARGIN) -> float:
    """μ = margin·λ₁, but no less than the rounding of a Cholesky factorisation [Pa/m]."""
    largest = float(np.max(np.diagonal(A_tilde) / c))
    return max(margin * lambda_1, 8.0 * len(c) * float(np.finfo(float).eps) * largest)


def inverse_rounding(A_tilde: Array, inverse: Array, A_error: float) -> float:
    """Relative error of products with Ã⁻¹: rounding, and what Ã itself has lost."""
    condition = float(np.linalg.norm(A_tilde, 1) * np.linalg.norm(inverse, 1))
    return 8.0 * len(A_tilde) * float(np.finfo(float).eps) * condition + (1.0 - kept(A_error))


def least_eigenvalue(A_tilde: Array, c: Array) -> float:
    """Smallest eigenvalue of Ãw = λCw with C = diag(c); inf for an empty matrix."""
    if len(c) == 0:
        return float("inf")
    root = 1.0 / np.sqrt(c)
    scaled = A_tilde * root[:, None] * root[None, :]
    return float(scipy.linalg.eigh(scaled, eigvals_only=True, subset_by_index=[0, 0])[0])


def least_eigenpair(A_tilde: Array, c: Array) -> tuple[float, Array, float]:
    """(λ, x, error) of the smallest λ with Ãx = λCx and xᵀCx = 1: no eigenvalue is nearer than λ(1 ± error).

    error: ‖C^{−½}(Ãx − λCx)‖/λ with a residual of twice the precision; inf for λ ≤ 0
    """
    if len(c) == 0:
        return float("inf"), c, 0.0
    root = 1.0 / np.sqrt(c)
    values, vectors = scipy.linalg.eigh(A_tilde * root[:, None] * root[None, :], subset_by_index=[0, 0])
    value, x = float(values[0]), root * vectors[:, 0]
    residual, _ = extended_residual(value * c * x, A_tilde, x)
    return value, x, float(np.linalg.norm(root * residual)) / value if value > 0.0 else float("inf")


def least_lowered(A_tilde: Array, c: Array, omega: Array) -> float:
    """λ_min(C^{−½}ÃC^{−½} − diag ω_i) [Pa/m]: above 0 every load has one solution; −∞ with a down-jump."""
    if not np.all(np.isfinite(omega)):
        return -float("inf")
    return least_eigenvalue(A_tilde - np.diag(c * omega), c)
