"""P1 forms: elasticity with thermal stress, and the products of gradients that it and heat conduction are made of.

Elasticity
Domain:         Ω, held on Γ_D and (normally) on Γ_C
PDE:            div σ + f = 0,  σ = λ tr ε(u) I + 2μ ε(u) − βθI, eqs. (1), (3)
Weak form:      a(u,v) = ∫cε(u):ε(v),  l_θ(v) = ∫f·v + β∫θ tr ε(v) + ∫_{Γ_N} g·v, eqs. (10), (11)
Discretisation: P1 for each component, numbering component-blocked (x of all nodes, then y); products of gradients
                are assembled once, so that a material costs one linear combination
Literature:     Šestak & Jovanović, Appl. Math. Mech. 31 (2010)

Products of gradients on one mesh
Definition: G_cd[i, j] = ∫∂_cφ_i ∂_dφ_j,   D_c[T, j] = ∫_T ∂_cφ_j
Use:        ∫∇θ·∇φ has the entries G_xx + G_yy; ∫div u div v has the blocks G_cd; ∫2ε(u):ε(v) has G_xy and G_yx
            exchanged off the diagonal. So one assembly (div·div on vector-valued P1) serves all materials and the
            heat problem, and D every thermal load.

P1 forms of heat conduction, with what edges do to heat.

Heat conduction
Domain:         Ω with convection on Γ_θ, temperature or flux given on other edges, insulated elsewhere
PDE:            kΔθ + qχ_ω = 0 in Ω,  −k∂θ/∂n = α(θ − θ̄) on Γ_θ, eqs. (2), (5)
Weak form:      k∫∇θ·∇φ + α∫_{Γ_θ}θφ = ∫_ω qφ + α∫_{Γ_θ}θ̄φ + ∫ flux φ, eq. (8)
Discretisation: continuous P1; only k and α enter the matrix, so its two parts are assembled once
Literature:     Šestak & Jovanović, Appl. Math. Mech. 31 (2010)
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import ngsolve as ngs
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.expressions.expression import Expression
from tcstudy.fem.boundary import values_at
from tcstudy.fem.meshes import Frames, PlaneMesh
from tcstudy.scene.records import Scalar, Where

Array = NDArray[np.float64]

BONUS_ORDER = 4
"""Extra quadrature order for data given as expressions; products of numbers and P1 functions are exact without it."""

Indices = NDArray[np.int32]
Moduli = tuple[tuple[Where, float, float], ...]
"""Where the body has which λ and μ [Pa]."""
Springs = tuple[tuple[str, float, float], ...]
"""(edge, k_N, k_T) of edges on springs [Pa/m]."""
Conductivity = tuple[tuple[Where, float], ...]
"""Where the body has which k; () where k is the same everywhere."""


NodeGraph = tuple[Indices, Indices]
"""CSR pattern of G, which nodes share a triangle: where rows start, and columns, ascending."""


@dataclass(frozen=True)
class ElasticForms:
    """The matrices and loads of the elastic problem on one mesh, in x and y (2n rows), and products of gradients."""

    mesh: PlaneMesh
    _products: dict[Where, tuple[NodeGraph, Array]] = field(default_factory=dict, repr=False, compare=False)

    def products(self, where: Where = ()) -> tuple[NodeGraph, Array]:
        """The graph of the nodes and G on it, (2, 2, nnz): [c, d, entry], with integrals over some regions."""
        if where not in self._products:
            u, v = self._space.TnT()
            divergences = ngs.Trace(ngs.grad(u)) * ngs.Trace(ngs.grad(v))
            if where:  # a factor 0 elsewhere, since a form that is not defined there has no entries there either
                divergences = self.mesh.mesh.MaterialCF(dict.fromkeys(where, 1.0), default=0.0) * divergences
            if not where or self.mesh.inside(where).any():
                graph, G = _blocks(ngs.BilinearForm(divergences * ngs.dx).Assemble())
            else:  # of a factor that is 0 everywhere NGSolve makes no form
                graph, G = self.products()
                G = np.zeros_like(G)
            self._products[where] = graph, G
        return self._products[where]

    @cached_property
    def _space(self) -> Any:
        return ngs.H1(self.mesh.mesh, order=1, dim=2)  # one vector a node: cheaper than the compound VectorH1

    def conduction(self, k: Conductivity = ()) -> sp.csr_array:
        """∫k∇φ_i·∇φ_j, (n, n), dimensionless; k = 1 if none is given."""
        (starts, columns), n = self.products()[0], self.mesh.n_points
        pairs = ((value, self.products(where)[1]) for where, value in k or (((), 1.0),))
        entries = sum(value * (G[0, 0] + G[1, 1]) for value, G in pairs)
        return sp.csr_array((entries, columns, starts), shape=(n, n))

    def stiffness_of(self, moduli: Moduli, frames: Frames | None = None) -> sp.csr_array:
        """a(φ_i, φ_j) = ∫λ div φ_i div φ_j + 2μ ε(φ_i):ε(φ_j), (2n, 2n) [Pa], in x and y, or RᵀAR in local rows."""
        graph, whole = self.products()
        A = np.empty_like(whole)
        for number, (where, lam, mu) in enumerate(moduli):
            G, part = self.products(where)[1], A if number == 0 else np.empty_like(A)
            for c, d in ((0, 1), (1, 0)):
                part[c, c] = (lam + 2.0 * mu) * G[c, c] + mu * G[d, d]
                part[c, d] = lam * G[c, d] + mu * G[d, c]
            if number:
                A += part
        return _matrix(graph, A, frames)

    def expansion(self, theta: Array, where: Where = ()) -> Array:
        """∫θ div φ_i over some regions for nodal values θ (n,): (2n,) [K m]; the load is β times that."""
        mesh, whole = self.mesh, self.mesh.area * theta[self.mesh.triangles].mean(axis=1)
        pulled = (whole * mesh.inside(where) if where else whole)[:, None, None] * mesh.slopes
        corners = mesh.triangles.ravel()
        return np.concatenate([np.bincount(corners, pulled[..., c].ravel(), mesh.n_points) for c in (0, 1)])

    def springs(self, springs: Springs, frames: Frames | None = None) -> sp.csr_array:
        """Σ_Γ ∫k_N u_N v_N + k_T u_T v_T over study edges, (2n, 2n) [Pa], in x and y or in local rows."""
        u, v = self._space.TnT()
        n = ngs.specialcf.normal(2)
        t = ngs.CF((-n[1], n[0]))
        form = ngs.BilinearForm(self._space, check_unused=False)
        for name, normal, tangential in springs:
            energy = normal * (u * n) * (v * n) + tangential * (u * t) * (v * t)
            form += energy * ngs.ds(self.mesh.region(name))
        form.Assemble()
        graph, S = _blocks(form)
        return _matrix(graph, self.mesh.geometry.unit * S, frames)


def edge_load(mesh: PlaneMesh, density: Scalar, names: tuple[str, ...], normal: int | None = None) -> Array:
    """∫ q φ_i over study edges, (n,); of q times a component of the outward normal where one is named."""
    on, edges = mesh.on(*names), mesh.boundary
    size = edges.length[on] if normal is None else edges.length[on] * edges.normal[on, normal]
    return _load(mesh, density, mesh.segments[on], size, ngs.SEGM)


def source_load(mesh: PlaneMesh, density: Scalar, omega: tuple[str, ...]) -> Array:
    """∫_ω q φ_i, (n,); an empty omega means the whole body."""
    inside = mesh.inside(omega)
    return _load(mesh, density, mesh.triangles[inside], 2.0 * mesh.area[inside], ngs.TRIG)


def _load(mesh: PlaneMesh, density: Scalar, nodes: NDArray[np.intp], size: Array, kind: Any) -> Array:
    """∫ q φ_i over segments or triangles with these nodes (e, k) and sizes over that of the unit one (e,)."""
    rule = ngs.IntegrationRule(kind, 1 + BONUS_ORDER * isinstance(density, Expression))
    corners, parts = mesh.points[nodes], np.zeros(nodes.shape)
    for at, weight in zip(rule.points, rule.weights, strict=True):
        phi = np.array([*at, 1.0 - sum(at)])
        parts += np.outer(weight * size * values_at(density, phi @ corners), phi)
    return np.asarray(np.bincount(nodes.ravel(), parts.ravel(), mesh.n_points), dtype=float)


def _blocks(form: Any) -> tuple[NodeGraph, Array]:
    """The pattern and the blocks (2, 2, nnz) of an assembled form of vectors."""
    values, columns, starts = form.mat.CSR()  # views, which die with the form
    graph = np.array(np.asarray(starts).view(np.int64), dtype=np.int32), np.array(columns, dtype=np.int32)
    return graph, np.array(np.asarray(values).reshape(-1, 2, 2).transpose(1, 2, 0), order="C")


def _matrix(graph: NodeGraph, A: Array, frames: Frames | None) -> sp.csr_array:
    """The matrix of blocks A (2, 2, nnz) in the numbering x of all nodes, then y; every row has x, then y columns.

    With frames A_ij ← R_iᵀ A_ij R_j, in place, on the entries that a turned node has part in.
    """
    (starts, columns), n = graph, len(graph[0]) - 1
    if frames is not None:
        axes, rows = frames.axes, np.repeat(np.arange(n), np.diff(starts))
        turned = (axes != np.eye(2)).any(axis=(1, 2))
        entries = np.flatnonzero(turned[rows] | turned[columns])
        left, right = axes[rows[entries]], axes[columns[entries]]
        A[:, :, entries] = np.einsum("eac,abe,ebd->cde", left, A[:, :, entries], right)
    blocks = [[sp.csr_array((A[c, d], columns, starts), shape=(n, n)) for d in (0, 1)] for c in (0, 1)]
    return sp.csr_array(sp.block_array(blocks, format="csr"))
