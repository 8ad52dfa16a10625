"""Confidence intervals of 1 − D/s² by inverting a test, D the variance of Y at a given X.

Influence:  ψ = r y² − e²/(1 − h), r = D/s²: the efficient influence function of the index (Da Veiga
            & Gamboa, J. Nonparametr. Stat. 25 (2013) 573; Klein & Rochet, arXiv 2306.05842)
Noise:      what the fit has of the noise is a quadratic form with the eigenvalues λ_j of
            Q'ᵀ diag(e²/((1 − h) D)) Q', Q' the basis without the constant (Kline, Saggio &
            Sølvsten, Econometrica 88 (2020) 1859). Only it remains at S = 0, where ψ vanishes
Test:       t is in the interval if |log((1 − t)/(1 − S))| is within a quantile of its distribution,
            variance 2 Σλ² + 4 κ t/N and third cumulant 8 Σλ³ + 24 κ^{3/2} t (1 − t)/N² by Cornish
            and Fisher's expansion; the quantile is Student's with the degrees of freedom of var ψ
κ:          var ψ relative to that of normal noise, 4 r² S/N, towards 1 where S is below the noise

With normal noise κ = λ_j = 1: a noncentral χ² near S = 0 and Fisher's z of R near S = 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from tcstudy.accuracy.indices.bases import Array
from tcstudy.accuracy.indices.fits import BasisFit

EXACT = 1e-12
"""Share of the variance below which the noise is rounding: the index is 1."""
MAX_SKEWNESS = 2.8
"""The expansion is used up to this skewness, that of a χ² with one degree of freedom."""
ALMOST_ONE = 1.0 - 1e-15
BISECTIONS = 50
"""Halvings of [0, 1] until the end of an interval is exact to rounding."""


@dataclass(frozen=True)
class IndexTest:
    """The test whether an index is t.

    value:  estimated index S
    noise:  λ_j/N summed as squares and as cubes: variance and skewness of the fit's noise
    kappa:  variance of the influence relative to that of normal noise
    count:  N points
    degrees_of_freedom: of the variance of the influence
    quantile:           of Student's distribution, two-sided
    """

    value: float
    noise: tuple[float, float]
    kappa: float
    count: int
    degrees_of_freedom: float
    quantile: float

    @classmethod
    def of(cls, fit: BasisFit, variance: float, y: Array, level: float) -> IndexTest:
        """Return the test of a fit of y (mean 0) with the given variance of Y at a given X."""
        count = len(y)
        total = float(y @ y) / (count - 1)
        ratio = variance / total
        value = 1.0 - ratio
        if ratio <= EXACT:
            return cls(value, (0.0, 0.0), 0.0, count, np.inf, 0.0)
        squares = fit.residual**2 / (1.0 - fit.leverage)
        eigenvalues = _noise_eigenvalues(fit.basis, squares / variance) / count
        noise = float(np.sum(eigenvalues**2)), float(np.sum(eigenvalues**3))

        influence = ratio * y**2 - squares
        centred = influence - influence.mean()
        spread = float(np.mean(centred**2))
        kurtosis = float(np.mean(centred**4)) / spread**2 if spread > 0.0 else np.inf
        degrees_of_freedom = 2.0 * count / max(kurtosis - 1.0, 1e-9)

        # the fit's noise counts twice in ψ (Efron & Stein): what is beyond it is due to S
        linear = max(spread / count / total**2 - 4.0 * noise[0] * ratio**2, 0.0)
        normal = 4.0 * ratio**2 / count
        prior = 2.0 * float(np.sum(eigenvalues))
        kappa = (linear + normal * prior) / (normal * (max(value, 0.0) + prior))
        quantile = student.ppf((1.0 + level) / 2.0, max(degrees_of_freedom, 1.0))
        return cls(value, noise, kappa, count, degrees_of_freedom, float(quantile))

    def accepts(self, t: float) -> bool:
        """Return whether the index may be t."""
        if self.quantile == 0.0:
            return t == 1.0
        variance = 2.0 * self.noise[0] + 4.0 * self.kappa * t / self.count
        third = 8.0 * self.noise[1] + 24.0 * self.kappa**1.5 * t * (1.0 - t) / self.count**2
        if variance <= 0.0:
            return bool(t == self.value)
        skewness = min(third / variance**1.5, MAX_SKEWNESS)
        deviation = np.log((1.0 - t) / (1.0 - self.value)) / variance**0.5
        shift = skewness * (self.quantile**2 - 1.0) / 6.0
        low = -(self.quantile - min(shift, self.quantile - 1.0))
        return bool(low <= deviation <= self.quantile + shift)

    def end(self, limit: float) -> float:
        """Return the accepted index that is closest to the limit, 0 or ALMOST_ONE."""
        if self.quantile == 0.0:
            return 1.0
        if self.accepts(limit):
            return round(limit)
        inside, outside = max(self.value, 0.0), limit
        if not self.accepts(inside):
            return inside
        for _ in range(BISECTIONS):
            middle = (inside + outside) / 2.0
            if self.accepts(middle):
                inside = middle
            else:
                outside = middle
        return inside


def _noise_eigenvalues(basis: Array, weights: Array) -> Array:
    """Return the eigenvalues of Q'ᵀ diag(weights) Q', Q' the basis (N, p) without the constant."""
    constant = basis.sum(axis=0) / len(basis) ** 0.5
    projector = np.eye(len(constant)) - np.outer(constant, constant)
    shares, directions = np.linalg.eigh(projector)
    directions = directions[:, shares > 0.5]
    kernel = basis.T @ (weights[:, None] * basis)
    return np.asarray(np.linalg.eigvalsh(directions.T @ kernel @ directions))
