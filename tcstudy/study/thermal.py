"""Temperature for every α, θ̄ and q of a sweep from one condensed heat matrix (method §4, exact).

With S_K the Neumann heat matrix condensed onto Γ_θ, M the mass matrix of Γ_θ and S_K w_k = μ_k M w_k,

    θ|_Γθ = Σ_k w_k (w_kᵀq̃ + α w_kᵀg̃) / (k μ_k + α),    g̃_i = ∫_{Γ_θ} θ̄ φ_i,

where μ₀ = 0 with constant w₀. The constant part is split off: a constant temperature loads the body through one
fixed vector, and the heat balance keeps its digits however small or large α is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.condense import Condensation, condense
from tcstudy.fem.heat import HeatForms
from tcstudy.scene.expressions import Expression
from tcstudy.scene.records import Scalar

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Part:
    """One linear contribution to the temperature: θ = constant + variation, and its heat through Γ_θ.

    constant:  a uniform temperature [K];  variation: (n,) nodal values on top of it [K]
    heat_out:  α∫_{Γ_θ}(θ − θ̄) of this part [W/m]
    """

    constant: float
    variation: Array
    heat_out: float


class Conduction:
    """The heat problem of one mesh, factorised once; parts of θ for given α, k and data."""

    def __init__(self, forms: HeatForms) -> None:
        self._forms = forms
        self._sources: dict[tuple[Scalar, tuple[str, ...]], tuple[Array, Array]] = {}

    @cached_property
    def _condensation(self) -> Condensation:
        n = self._forms.mesh.n_points
        robin = self._forms.robin_nodes
        inner = np.ones(n, dtype=bool)
        inner[robin] = False
        return condense(self._forms.conduction, self._forms.mesh.points, robin, inner, components=1)

    @cached_property
    def _spectrum(self) -> tuple[Array, Array]:
        """(μ, W): generalised eigenpairs, WᵀMW = I; the first made exactly 0 and constant."""
        M = self._forms.robin_mass
        mu, W = scipy.linalg.eigh(self._condensation.A_tilde, M)
        constant = np.full(len(M), 1.0 / np.sqrt(M.sum()))
        W[:, 1:] -= np.outer(constant, constant @ M @ W[:, 1:])
        W[:, 0] = constant
        mu[0] = 0.0
        return np.maximum(mu, 0.0), W

    def source(self, q: Scalar, omega: tuple[str, ...], alpha: float, k: float) -> Part:
        """θ for θ̄ = 0: heated by q in ω [W/m³], cooled to 0 through Γ_θ."""
        load, reduced = self._source_load(q, omega)
        mu, W = self._spectrum
        weights = (W.T @ reduced) / (k * mu + alpha)
        constant = float(weights[0] * W[0, 0])
        weights[0] = 0.0
        variation = self._condensation.expand(W @ weights, load / k)
        return Part(constant, variation, alpha * self._integral(constant + W @ weights))

    def surroundings(self, theta_bar: Scalar, alpha: float, k: float) -> Part:
        """θ for q = 0: surroundings at θ̄. A constant θ̄ gives θ = θ̄ exactly; α = 0 gives the limit, the mean of θ̄."""
        n = self._forms.mesh.n_points
        if not isinstance(theta_bar, Expression):
            return Part(float(theta_bar), np.zeros(n), 0.0)
        mu, W = self._spectrum
        moments = W.T @ self._forms.surroundings(theta_bar)
        constant = float(moments[0] * W[0, 0])
        mu, W, moments = mu[1:], W[:, 1:], moments[1:]
        weights = alpha * moments / (k * mu + alpha)
        # θ − θ̄ mode by mode, so that a large α does not multiply the rounding of a difference
        excess = W @ (-k * mu * moments / (k * mu + alpha))
        return Part(constant, self._condensation.expand(W @ weights), alpha * self._integral(excess))

    def _integral(self, values: Array) -> float:
        """∫_{Γ_θ} of the P1 function with these values on Γ_θ."""
        return float((self._forms.robin_mass @ values).sum())

    def heat_in(self, q: Scalar, omega: tuple[str, ...]) -> float:
        """∫_ω q [W/m]."""
        return float(self._source_load(q, omega)[0].sum())

    def _source_load(self, q: Scalar, omega: tuple[str, ...]) -> tuple[Array, Array]:
        """∫_ω qφ_i and its condensed form on Γ_θ."""
        key = (q, omega)
        if key not in self._sources:
            load = self._forms.source(q, omega)
            self._sources[key] = (load, self._condensation.condense(load))
        return self._sources[key]
