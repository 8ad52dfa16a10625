"""P1 elasticity with thermal stress.

Domain:         Ω, held on Γ_D and (normally) on Γ_C
PDE:            div σ + f = 0,  σ = λ tr ε(u) I + 2μ ε(u) − βθI, eqs. (1), (3)
Weak form:      a(u,v) = ∫cε(u):ε(v),  l_θ(v) = ∫f·v + β∫θ tr ε(v) + ∫_{Γ_N} g·v, eqs. (10), (11)
Discretisation: P1 for each component, numbering component-blocked (x of all nodes, then y); products of gradients
                are assembled once (gradients.py), so that a material costs one linear combination
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
from tcstudy.fem.coefficients import bonus, coefficient, is_zero, vector
from tcstudy.fem.gradients import GradientProducts
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
