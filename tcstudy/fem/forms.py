"""P1 elasticity with thermal stress.

Domain:         Ω, held on Γ_D and (normally) on Γ_C
PDE:            div σ + f = 0,  σ = λ tr ε(u) I + 2μ ε(u) − βθI, eqs. (1), (3)
Weak form:      a(u,v) = ∫cε(u):ε(v),  l_θ(v) = ∫f·v + β∫θ tr ε(v) + ∫_{Γ_N} g·v, eqs. (10), (11)
Discretisation: P1 for each component, numbering component-blocked (x of all nodes, then y); products of gradients
                are assembled once (gradients.py), so that a material costs one linear combination
Literature:     Šestak & Jovanović, Appl. Math. Mech. 31 (2010)

P1 heat conduction.

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

from tcstudy.fem.boundary import Frames
from tcstudy.fem.coefficients import GradientProducts, bonus, coefficient, csr, is_zero, vector
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.scene.records import Convection, Role, Scalar, Traction

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ElasticForms:
    """The matrices and loads of the elastic problem on one mesh, in x and y (2n rows)."""

    gradients: GradientProducts

    @property
    def mesh(self) -> PlaneMesh:
        """The mesh."""
        return self.gradients.mesh

    @cached_property
    def _space(self) -> Any:
        return ngs.H1(self.mesh.mesh, order=1, dim=2)  # one vector a node: cheaper than the compound VectorH1

    def stiffness(self, lam: float, mu: float, frames: Frames | None = None) -> sp.csr_array:
        """a(φ_i, φ_j) for Lamé moduli lam, mu [Pa], (2n, 2n) [Pa]; in the local rows of `frames` if given."""
        return self.gradients.stiffness(lam, mu, frames)

    def thermal_load(self, theta: Array) -> Array:
        """∫θ div φ_i for nodal values θ (n,) or (n, r), (2n,) or (2n, r) [K m]; the load is β times that."""
        return self.gradients.expansion(theta)

    def body_force(self, f: tuple[Scalar, Scalar]) -> Array:
        """∫f·φ_i, (2n,) [N/m] for f in N/m³."""
        v = self._space.TestFunction()
        density = ngs.CF((coefficient(f[0]), coefficient(f[1])))
        return _blocked(ngs.LinearForm(density * v * ngs.dx(bonus_intorder=bonus(*f))).Assemble())

    def traction(self, name: str, role: Traction | Convection) -> Array:
        """∫_{Γ}(g − p n)·φ_i over the study edge `name`, (2n,) [N/m]."""
        v = self._space.TestFunction()
        stress = ngs.CF((coefficient(role.g[0]), coefficient(role.g[1])))
        if not is_zero(role.pressure):
            stress = stress - coefficient(role.pressure) * ngs.specialcf.normal(2)
        order = bonus(*role.g, role.pressure)
        where = ngs.ds(self.mesh.region(name), bonus_intorder=order)
        return _blocked(ngs.LinearForm(stress * v * where).Assemble())


def _blocked(form: Any) -> Array:
    """(2n,) the vector of a form, x of all nodes, then y."""
    return np.array(vector(form).reshape(-1, 2).T, order="C").ravel()


def loads_something(role: Role) -> bool:
    """True if an edge carries a traction or a pressure that is not plainly zero."""
    return isinstance(role, Traction | Convection) and not (
        is_zero(role.g[0]) and is_zero(role.g[1]) and is_zero(role.pressure)
    )


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
