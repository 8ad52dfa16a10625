"""P1 forms of heat conduction, with what edges do to heat.

Heat conduction
Domain:         Ω with convection on Γ_θ, temperature or flux given on other edges, insulated elsewhere
PDE:            kΔθ + qχ_ω = 0 in Ω,  −k∂θ/∂n = α(θ − θ̄) on Γ_θ, eqs. (2), (5)
Weak form:      k∫∇θ·∇φ + α∫_{Γ_θ}θφ = ∫_ω qφ + α∫_{Γ_θ}θ̄φ + ∫ flux φ, eq. (8)
Discretisation: continuous P1; only k and α enter the matrix, so its two parts are assembled once
Literature:     Šestak & Jovanović, Appl. Math. Mech. 31 (2010)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import ngsolve as ngs
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.fem.forms import Conductivity, ElasticForms, bonus, coefficient, csr, is_zero, vector
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.scene.records import Scalar

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HeatForms:
    """The matrices and loads of the heat problem on one mesh (n nodes).

    gradients: products of gradients on the mesh;  convection: study names of the edges that make up Γ_θ
    k: conductivities over that of the material of the body, where they differ by region
    held:      study names of the edges whose temperature is given
    """

    gradients: ElasticForms
    convection: tuple[str, ...]
    k: Conductivity = ()
    held: tuple[str, ...] = ()

    @property
    def mesh(self) -> PlaneMesh:
        """The mesh."""
        return self.gradients.mesh

    @cached_property
    def _space(self) -> Any:
        return ngs.H1(self.mesh.mesh, order=1)

    @cached_property
    def conduction(self) -> sp.csr_array:
        """K = ∫∇φ_i·∇φ_j, (n, n), dimensionless: the matrix for k = 1 of the body."""
        return self.gradients.conduction(self.k)

    @cached_property
    def kept_nodes(self) -> NDArray[np.intp]:
        """Mesh nodes on the closure of Γ_θ and of the edges whose temperature is given, ascending (r,)."""
        return self.mesh.nodes_on(*self.convection, *self.held)

    @cached_property
    def robin_mass(self) -> Array:
        """M = ∫_{Γ_θ}φ_iφ_j restricted to kept_nodes, dense (r, r) [m]."""
        return self.edge_mass(self.convection) if self.convection else self.exchange({})

    def edge_mass(self, names: tuple[str, ...]) -> Array:
        """∫φ_iφ_j over study edges restricted to kept_nodes, dense (r, r) [m]."""
        theta, phi = self._space.TnT()
        boundary = self.mesh.region(*names)
        full = csr(ngs.BilinearForm(theta * phi * ngs.ds(boundary), check_unused=False).Assemble())
        nodes = self.kept_nodes
        return full[nodes][:, nodes].toarray()

    def exchange(self, weights: Mapping[str, float]) -> Array:
        """Σ w ∫φ_iφ_j over study edges by name, restricted to kept_nodes, dense (r, r)."""
        zero = np.zeros((len(self.kept_nodes), len(self.kept_nodes)))
        return np.asarray(sum((weight * self.edge_mass((edge,)) for edge, weight in weights.items()), zero))

    def surroundings(self, theta_bar: Scalar, names: tuple[str, ...] = ()) -> Array:
        """∫ θ̄ φ_i over study edges, over Γ_θ if none are named, on kept_nodes (r,) [K m]."""
        return self.flux(theta_bar, names or self.convection)[self.kept_nodes]

    def flux(self, flux: Scalar, names: tuple[str, ...]) -> Array:
        """∫ flux φ_i over study edges, (n,) [W/m]."""
        if is_zero(flux):  # which NGSolve makes no form of
            return np.zeros(self.mesh.n_points)
        phi = self._space.TestFunction()
        where = ngs.ds(self.mesh.region(*names), bonus_intorder=bonus(flux))
        return vector(ngs.LinearForm(coefficient(flux) * phi * where).Assemble())

    def source(self, q: Scalar, omega: tuple[str, ...]) -> Array:
        """∫_ω q φ_i, (n,) [W/m]; an empty omega means the whole body."""
        phi = self._space.TestFunction()
        domain = ngs.dx("|".join(omega), bonus_intorder=bonus(q)) if omega else ngs.dx(bonus_intorder=bonus(q))
        return vector(ngs.LinearForm(coefficient(q) * phi * domain).Assemble())

    @cached_property
    def nodal_area(self) -> Array:
        """∫φ_i, (n,) [m²]; its product with nodal values is the exact integral of a P1 function."""
        return vector(ngs.LinearForm(self._space.TestFunction() * ngs.dx).Assemble())
