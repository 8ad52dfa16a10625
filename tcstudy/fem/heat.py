"""P1 heat conduction.

Domain:         Ω with convection on Γ_θ, insulated elsewhere
PDE:            kΔθ + qχ_ω = 0 in Ω,  −k∂θ/∂n = α(θ − θ̄) on Γ_θ, eqs. (2), (5)
Weak form:      k∫∇θ·∇φ + α∫_{Γ_θ}θφ = ∫_ω qφ + α∫_{Γ_θ}θ̄φ, eq. (8)
Discretisation: continuous P1; only k and α enter the matrix, so its two parts are assembled once
Literature:     Šestak & Jovanović, Appl. Math. Mech. 31 (2010)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import ngsolve as ngs
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.fem.coefficients import bonus, coefficient, csr, vector
from tcstudy.fem.gradients import GradientProducts
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.scene.records import Scalar

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HeatForms:
    """The matrices and loads of the heat problem on one mesh (n nodes).

    gradients: products of gradients on the mesh;  convection: study names of the edges that make up Γ_θ
    """

    gradients: GradientProducts
    convection: tuple[str, ...]

    @property
    def mesh(self) -> PlaneMesh:
        """The mesh."""
        return self.gradients.mesh

    @cached_property
    def _space(self) -> Any:
        return ngs.H1(self.mesh.mesh, order=1)

    @cached_property
    def conduction(self) -> sp.csr_array:
        """K = ∫∇φ_i·∇φ_j, (n, n), dimensionless: the matrix for k = 1."""
        return self.gradients.conduction()

    @cached_property
    def robin_nodes(self) -> NDArray[np.intp]:
        """Mesh nodes on the closure of Γ_θ, ascending (r,)."""
        curves = [i for i, c in enumerate(self.mesh.geometry.curves) if c.name in self.convection]
        on = np.isin(self.mesh.segment_curve, curves)
        return np.unique(self.mesh.segments[on])

    @cached_property
    def robin_mass(self) -> Array:
        """M = ∫_{Γ_θ}φ_iφ_j restricted to robin_nodes, dense (r, r) [m]."""
        theta, phi = self._space.TnT()
        boundary = self.mesh.region(*self.convection)
        full = csr(ngs.BilinearForm(theta * phi * ngs.ds(boundary), check_unused=False).Assemble())
        nodes = self.robin_nodes
        return full[nodes][:, nodes].toarray()

    def surroundings(self, theta_bar: Scalar) -> Array:
        """∫_{Γ_θ} θ̄ φ_i on robin_nodes, (r,) [K m]."""
        phi = self._space.TestFunction()
        boundary = self.mesh.region(*self.convection)
        form = ngs.LinearForm(coefficient(theta_bar) * phi * ngs.ds(boundary, bonus_intorder=bonus(theta_bar)))
        return vector(form.Assemble())[self.robin_nodes]

    def source(self, q: Scalar, omega: tuple[str, ...]) -> Array:
        """∫_ω q φ_i, (n,) [W/m]; an empty omega means the whole body."""
        phi = self._space.TestFunction()
        domain = ngs.dx("|".join(omega), bonus_intorder=bonus(q)) if omega else ngs.dx(bonus_intorder=bonus(q))
        return vector(ngs.LinearForm(coefficient(q) * phi * domain).Assemble())

    @cached_property
    def nodal_area(self) -> Array:
        """∫φ_i, (n,) [m²]; its product with nodal values is the exact integral of a P1 function."""
        return vector(ngs.LinearForm(self._space.TestFunction() * ngs.dx).Assemble())
