"""P1 elasticity with thermal stress.

Domain:         Ω, held on Γ_D and (normally) on Γ_C
PDE:            div σ + f = 0,  σ = λ tr ε(u) I + 2μ ε(u) − βθI, eqs. (1), (3)
Weak form:      a(u,v) = ∫cε(u):ε(v),  l_θ(v) = ∫f·v + β∫θ tr ε(v) + ∫_{Γ_N} g·v, eqs. (10), (11)
Discretisation: P1 for each component, numbering component-blocked (x of all nodes, then y); the λ and μ parts of
                the stiffness are assembled once, so that a material costs one linear combination
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

from tcstudy.fem.coefficients import bonus, coefficient, csr, is_zero, vector
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.scene.records import Convection, Role, Scalar, Traction

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ElasticForms:
    """The matrices and loads of the elastic problem on one mesh, in x and y (2n rows)."""

    mesh: PlaneMesh

    @cached_property
    def _space(self) -> Any:
        return ngs.VectorH1(self.mesh.mesh, order=1)

    @cached_property
    def _parts(self) -> tuple[sp.csr_array, Array]:
        """∫div u div v as a matrix, and the entries of ∫2ε(u):ε(v) on the same pattern."""
        u, v = self._space.TnT()
        volumetric = csr(ngs.BilinearForm(ngs.div(u) * ngs.div(v) * ngs.dx).Assemble())
        strain = ngs.InnerProduct(ngs.Sym(ngs.Grad(u)), ngs.Sym(ngs.Grad(v)))
        shear = csr(ngs.BilinearForm(2 * strain * ngs.dx).Assemble())
        if not np.array_equal(volumetric.indices, shear.indices):
            raise RuntimeError("the two parts of the stiffness have different patterns")
        return volumetric, shear.data

    def stiffness(self, lam: float, mu: float) -> sp.csr_array:
        """a(φ_i, φ_j) for Lamé moduli lam, mu [Pa], (2n, 2n) [Pa]."""
        volumetric, shear = self._parts
        data = lam * volumetric.data + mu * shear
        return sp.csr_array((data, volumetric.indices, volumetric.indptr), shape=volumetric.shape)

    @cached_property
    def thermal_coupling(self) -> sp.csr_array:
        """B with (Bθ)_i = ∫θ div φ_i, (2n, n) [m]; the thermal load is β B θ."""
        theta = ngs.H1(self.mesh.mesh, order=1).TrialFunction()
        v = self._space.TestFunction()
        form = ngs.BilinearForm(trialspace=theta.space, testspace=self._space)
        form += theta * ngs.div(v) * ngs.dx
        return csr(form.Assemble())

    def body_force(self, f: tuple[Scalar, Scalar]) -> Array:
        """∫f·φ_i, (2n,) [N/m] for f in N/m³."""
        v = self._space.TestFunction()
        density = ngs.CF((coefficient(f[0]), coefficient(f[1])))
        return vector(ngs.LinearForm(density * v * ngs.dx(bonus_intorder=bonus(*f))).Assemble())

    def traction(self, name: str, role: Traction | Convection) -> Array:
        """∫_{Γ}(g − p n)·φ_i over the study edge `name`, (2n,) [N/m]."""
        v = self._space.TestFunction()
        stress = ngs.CF((coefficient(role.g[0]), coefficient(role.g[1])))
        if not is_zero(role.pressure):
            stress = stress - coefficient(role.pressure) * ngs.specialcf.normal(2)
        order = bonus(*role.g, role.pressure)
        where = ngs.ds(self.mesh.region(name), bonus_intorder=order)
        return vector(ngs.LinearForm(stress * v * where).Assemble())


def loads_something(role: Role) -> bool:
    """True if an edge carries a traction or a pressure that is not plainly zero."""
    return isinstance(role, Traction | Convection) and not (
        is_zero(role.g[0]) and is_zero(role.g[1]) and is_zero(role.pressure)
    )
