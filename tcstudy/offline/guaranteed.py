"""Equilibrium elements, and bounds of λ₁ of the body by them.

Equilibrium elements: the dual of a plane elastic body, condensed onto its contact line.

Stress:     on every triangle, cut into three at its barycentre, symmetric, linear on each part, div
            τ = 0 in it and τn continuous: 9 coefficients a triangle, one for each self-balanced
            linear traction on its three edges. They are found once on the reference triangle and
            moved by τ = B τ̂ Bᵀ, which keeps both.
Hybrid:     unknowns w are displacements at the two Gauss points of every edge, multipliers that
            make τn continuous: K̂ = Σ_K P G⁻¹Pᵀ, G = ∫c⁻¹N:N, P the moments of tractions; wᵀK̂w =
            ‖τ‖² in the norm of complementary energy.
Contact:    the normal displacement is held, the tangential ones are kept: Â (2s, 2s) for s segments
            of Γ_C, with the weights c = h/2, is a contact problem like that of P1. Its compliance
            is more than the body's where that of P1 is less: energies come from the other side, and
            nothing locks for ν → ½, as c⁻¹ stays bounded.
Loads:      f constant, βθ linear on a triangle: τ = N G⁻¹(Pᵀw − q) + τ_p, τ_p = −diag(f_x (x −
            x_z), f_y (y − y_z)), q = ∫c⁻¹N:(τ_p + βθI); K̂w = ĝ + Σ_K (P G⁻¹q − P_p), P_p the
            moments of τ_p, and div τ + f = 0 exactly.
Literature: C. Johnson and B. Mercier, Numer. Math. 30 (1978) 103-116; B. Fraeijs de Veubeke (1965);
            J. P. M. de Almeida and E. A. W. Maunder, Equilibrium Finite Element Formulations, Wiley
            2017.
Left out:   curved edges.

What is proved of the body, not of its mesh: λ₁ from both sides.

λ₁ = min a(v,v)/‖v_T‖² over Γ_C decides uniqueness: one solution for every ω < λ₁. P1 displacements
are a subset, so that λ_min(Ã, M) with the exact mass matrix M of Γ_C bounds it from above. From
below, with λ̂ of the equilibrium elements: 1/λ₁ = sup_g ‖u_g‖²_a/‖g‖² over tangential tractions g;
split g = πg + (g − πg), π the L² projection onto linear functions on every segment. ‖u_πg‖² ≤
‖πg‖²/λ̂, as the dual overestimates compliance, ‖u_{g−πg}‖ ≤ C‖g − πg‖ with C² = max_K Σ_e sup_v ‖(I
− π)v_T‖²_e/a_K(v,v), so that
    λ̂/(1 + C²λ̂) ≤ λ₁ ≤ λ_min(Ã, M).
A triangle gives C² ≤ C₀² h_e/2μ, C₀ of its shape alone. C₀ is bounded without a constant of Korn:
refine the triangle k times, and its parts at e are copies of it, 2⁻ᵏ as large; hence C₀² ≤ ν_k +
2⁻ᵏC₀², ν_k that of piecewise πv on the equilibrium elements of the refinement. A triangle that
holds a smaller one on the same edge has no greater constant, so that a few shapes serve all. All up
to rounding, which is estimated.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.condense import Condensation, condense
from tcstudy.contact.problem import CondensedBody, least_eigenpair
from tcstudy.errors import GeometryFailed
from tcstudy.fem.forms import ContactLine, edge_arms, unknown
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.offline.oscillation import TRIANGLE_POINTS, TRIANGLE_WEIGHTS
from tcstudy.scene.records import Body, Point, Role, Scene
from tcstudy.shapes.edges import GAUSS, TriangleGeometry, segment_mass

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

SIDES = np.array([[0, 1], [1, 2], [2, 0]])
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1 / 3, 1 / 3]])
PARTS = np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3]])
"""Corners of the three parts of the reference triangle; side k belongs to part k."""
TENSORS = np.array([[[1.0, 0], [0, 0]], [[0, 0], [0, 1.0]], [[0, 1.0], [1.0, 0]]])
"""Symmetric tensors from their components xx, yy, xy."""
WEIGHT = np.linalg.cholesky((np.ones((3, 3)) + np.eye(3)) / 72.0).T
"""Its square is the mass matrix of linear functions on a part of the reference triangle, a third of
½."""


@dataclass(frozen=True)
class EquilibriumBody:
    """Triangles of equilibrium elements, condensed onto Γ_C.

    Local rows (4e,) run over the Gauss points of the edges, from the lower node on, then over axes,
    then over edges.

    elements:     the triangles
    loads:        of βθ and a constant f
    number:       (s,) numbers of the edges that are boundary segments
    axes:         (s, 2, 2) of these edges, an axis a column, (t, n) on Γ_C
    held:         (4e,) rows whose displacement is prescribed
    ties:         (4e, 4e) T of rigid edges, w = T w', or None
    K:            (4e, 4e) K̂ with springs, rigid edges not tied [Pa]
    diagonal:     (4e,) of TᵀK̂T
    c:            (2k,) weights of the Gauss points of Γ_C, half the length of a segment [m]
    condensation: of TᵀK̂T
    """

    elements: Elements
    loads: UnitLoads
    number: Indices
    axes: Array
    held: NDArray[np.bool_]
    ties: sp.csr_array | None
    K: sp.csr_array
    diagonal: Array
    c: Array
    condensation: Condensation

    @cached_property
    def contact(self) -> CondensedBody:
        """Return the body of the tangential displacements at the Gauss points of Γ_C, in order."""
        return CondensedBody.of(self.condensation.A_tilde, self.c)

    @cached_property
    def gauss_points(self) -> Array:
        """Return the Gauss points (s, 2, 2) of boundary segments, from the lower node on [m]."""
        edges, _ = self.elements.mesh.edges
        ends = self.elements.mesh.points[edges[self.number]]
        along = ends[:, 1:] - ends[:, :1]
        return ends[:, :1] + GAUSS[None, :, None] * along

    @cached_property
    def _linear_loads(self) -> UnitLoads:
        """Return the unit loads of a linear f as well."""
        _, loads = self.elements.factorised(N_LINEAR)
        return loads

    def volume_load(
        self, f: Array, theta: Array, slope: Array | None = None
    ) -> tuple[Array, float]:
        """Return the load (4e,) of f and βθ, and Σ_K ‖(I − Π)ρ‖² of ρ = τ_p + βθI.

        f:     (2,) or (t, 2), at the centres [N/m³];  theta: (t, 3) βθ at the corners [Pa]
        slope: (t, 2, 2) ∂f_i/∂x_c of a linear f [N/m⁴]
        """
        n_triangles = len(theta)
        loads = self.loads
        columns = [theta, np.broadcast_to(f, (n_triangles, 2))]
        if slope is not None:
            loads = self._linear_loads
            columns.append(slope.reshape(n_triangles, 4))
        unit_data = np.concatenate(columns, axis=1)[..., None]
        moments = np.matmul(loads.moments, unit_data)
        remainders = np.matmul(loads.remainders, unit_data)
        rows = self.elements.local_rows.ravel()
        load = np.zeros(len(self.held))
        np.add.at(load, rows, moments.ravel())
        return load, float(np.sum(remainders**2))

    def rows(self, u: Array) -> Array:
        """Return P1 displacements (n, 2) at the Gauss points of the edges, in local axes (4e,)."""
        edges, _ = self.elements.mesh.edges
        first, second = np.moveaxis(u[edges], 1, 0)
        at_gauss = np.stack([(1.0 - g) * first + g * second for g in GAUSS], axis=1)
        return np.einsum("egd,edk->gke", at_gauss, self.elements.axes).ravel()


@cache
def _reference() -> tuple[Array, Array]:
    """Return the stresses of the reference triangle and their tractions at its sides.

    Stresses: (3, 3, 3, 9) by part, corner, component xx, yy, xy, and coefficient
    Tractions: (3, 2, 2, 9) τ̂n̂|ê|/2 at the Gauss points
    """
    conditions = []
    for k, part in enumerate(PARTS):
        linear = np.column_stack([np.ones(3), CORNERS[part]])
        gradients = np.linalg.inv(linear)[1:]
        for first, second in ((0, 2), (2, 1)):  # div τ = 0
            condition = np.zeros((3, 3, 3))
            condition[k, :, first], condition[k, :, second] = gradients
            conditions.append(condition.ravel())
        # τn is continuous at the inner side that the part shares with the next one
        inner_side = CORNERS[3] - CORNERS[part[1]]
        for corner, next_corner in ((1, 0), (2, 2)):
            for traction in _traction(np.array([inner_side[1], -inner_side[0]])):
                condition = np.zeros((3, 3, 3))
                condition[k, corner] = traction
                condition[(k + 1) % 3, next_corner] = -traction
                conditions.append(condition.ravel())
    N = scipy.linalg.null_space(np.array(conditions)).reshape(3, 3, 3, 9)
    end_tractions = []
    side_vectors = CORNERS[SIDES[:, 1]] - CORNERS[SIDES[:, 0]]
    for k, (x, y) in enumerate(side_vectors):
        traction_of = _traction(np.array([y, -x]))
        end_tractions.append([traction_of @ N[k, end] for end in (0, 1)])
    at_gauss = np.column_stack([1.0 - GAUSS, GAUSS])
    return N, 0.5 * np.einsum("ge,keij->kgij", at_gauss, np.array(end_tractions))


MIDDLES = np.array([[0, 1], [1, 2], [2, 0]])
"""Corners of a part between which its quadratic functions have their other nodes."""


class QuadraticFields(NamedTuple):
    """Stresses τ̂ of the reference triangle with div τ̂ = −(x̂_c − ⅓)e_i, by i and c.

    They are quadratic on the parts; their tractions are continuous inside and linear on the sides.

    stress:   (3, 6, 3, 2, 2) by part, node (corners, then middles), component xx, yy, xy, and i, c
    traction: (3, 2, 2, 2, 2) τ̂n̂|ê|/2 by side, Gauss point and axis, and i, c
    """

    stress: Array
    traction: Array


@cache
def _quadratic_fields() -> QuadraticFields:
    conditions = list[Array]()
    values = list[Array]()

    def require(condition: Array, value: Array) -> None:
        conditions.append(condition.ravel())
        values.append(value.ravel())

    nothing = np.zeros((2, 2))
    for k, part in enumerate(PARTS):
        for corner in CORNERS[part]:  # the divergence is linear: three points
            for axis, (first, second) in enumerate(((0, 2), (2, 1))):
                condition, value = np.zeros((3, 3, 6)), np.zeros((2, 2))
                condition[k, first], condition[k, second] = _monomial_slopes(corner)
                value[axis] = 1.0 / 3.0 - corner
                require(condition, value)
        # τn is continuous at the inner side that the part shares with the next one
        inner_side = CORNERS[3] - CORNERS[part[1]]
        for share in (0.0, 0.5, 1.0):
            monomials = _monomials(CORNERS[part[1]] + share * inner_side)
            for traction in _traction(np.array([inner_side[1], -inner_side[0]])):
                condition = np.zeros((3, 3, 6))
                condition[k] = np.outer(traction, monomials)
                condition[(k + 1) % 3] = -condition[k]
                require(condition, nothing)
        # no second difference of τn along the outer side
        start, end = CORNERS[part[0]], CORNERS[part[1]]
        bend = _monomials(start) - 2.0 * _monomials(0.5 * (start + end)) + _monomials(end)
        for traction in _traction(np.array([end[1] - start[1], start[0] - end[0]])):
            condition = np.zeros((3, 3, 6))
            condition[k] = np.outer(traction, bend)
            require(condition, nothing)
    coefficients = np.linalg.lstsq(np.array(conditions), np.array(values), rcond=None)[0]
    coefficients = coefficients.reshape(3, 3, 6, 2, 2)
    nodes = CORNERS[PARTS]
    nodes = np.concatenate([nodes, nodes[:, MIDDLES].mean(axis=2)], axis=1)
    at_nodes = np.array([[_monomials(node) for node in part_nodes] for part_nodes in nodes])
    stress = np.einsum("pnm,pcmij->pncij", at_nodes, coefficients)
    tractions = []
    for k, (start, end) in enumerate(CORNERS[SIDES]):
        of_stress = _traction(np.array([end[1] - start[1], start[0] - end[0]]))
        at_gauss = np.array([_monomials((1.0 - g) * start + g * end) for g in GAUSS])
        tractions.append(0.5 * np.einsum("ac,gm,cmij->gaij", of_stress, at_gauss, coefficients[k]))
    return QuadraticFields(stress, np.array(tractions))


def _monomials(point: Array) -> Array:
    """Return 1, x, y, x², xy, y² (6,) at a point."""
    x, y = point
    return np.array([1.0, x, y, x * x, x * y, y * y])


def _monomial_slopes(point: Array) -> tuple[Array, Array]:
    """Return ∂/∂x and ∂/∂y (6,) of the monomials at a point."""
    x, y = point
    return np.array([0.0, 1.0, 0.0, 2.0 * x, y, 0.0]), np.array([0.0, 0.0, 1.0, 0.0, x, 2.0 * y])


@cache
def _quadratic_samples() -> tuple[Array, Array]:
    """Return the maps (3, 6) and (6, 6) from the nodes of quadratic functions on a part.

    The first gives the weighted corner values (WEIGHT) of the L² projection onto linear functions,
    the second numbers whose squares sum to the square of the rest.
    """
    bary = TRIANGLE_POINTS
    roots = np.sqrt(TRIANGLE_WEIGHTS / 6.0)[:, None]
    corner_functions = bary * (2.0 * bary - 1.0)
    middle_functions = 4.0 * bary[:, MIDDLES[:, 0]] * bary[:, MIDDLES[:, 1]]
    quadratic = roots * np.column_stack([corner_functions, middle_functions])
    orthonormal = roots * bary @ np.linalg.inv(WEIGHT)
    projected = orthonormal.T @ quadratic
    return projected, np.asarray(np.linalg.qr(quadratic - orthonormal @ projected, mode="r"))


def _traction(n: Array) -> Array:
    """Return the map (2, 3) from (xx, yy, xy) to σn."""
    return np.array([[n[0], 0.0, n[1]], [0.0, n[1], n[0]]])


BLOCK = 512
"""Triangles that are factorised together, so that their arrays fit into a cache."""
N_CONSTANT = 5
"""Data of a triangle: βθ at its three corners, f_x, f_y; then ∂f_i/∂x_c of a linear f."""
N_LINEAR = 9


class UnitLoads(NamedTuple):
    """What each datum of a triangle does if it is 1 and the others are 0.

    moments:    (t, 12, d) P G⁻¹q − P_p
    remainders: (t, d, d) R with ‖(I − Π)ρ‖² = |Ra|² for data a (d,) and ρ = τ_p + βθI,
                Π the projection onto the stresses N in the norm of complementary energy
    """

    moments: Array
    remainders: Array


@dataclass(frozen=True)
class Elements:
    """Triangles with their moduli (t,) and the axes (e, 2, 2) of their edges."""

    mesh: TriangleGeometry
    lam: Array
    mu: Array
    axes: Array

    @property
    def local_rows(self) -> Indices:
        """Return the rows (t, 12) of each triangle by side, Gauss point along it, and axis."""
        first, second = np.moveaxis(self.mesh.sides.reshape(-1, 3, 2), 2, 0)
        _, edge_of_side = self.mesh.edges
        # (t, 3, 2) Gauss points in the direction of the edge
        gauss = np.arange(2) ^ (first > second)[..., None]
        in_edge = (2 * gauss[..., None] + np.arange(2)) * len(self.axes)
        rows = in_edge + edge_of_side[..., None, None]
        return rows.reshape(-1, 12)

    def factorised(self, n_data: int = N_CONSTANT) -> tuple[Array, UnitLoads]:
        """Return P G⁻¹Pᵀ (t, 12, 12) of every triangle, and its unit loads.

        n_data: N_CONSTANT, or N_LINEAR for a linear f as well
        """
        n_triangles = len(self.lam)
        stiffness = np.empty((n_triangles, 12, 12))
        moments = np.empty((n_triangles, 12, n_data))
        remainders = np.empty((n_triangles, n_data, n_data))
        _, edge_of_side = self.mesh.edges
        for start in range(0, n_triangles, BLOCK):
            some = slice(start, start + BLOCK)
            axes = self.axes[edge_of_side[some]]
            block = _Triangles(self.mesh.corners[some], self.lam[some], self.mu[some], axes)
            stiffness[some], moments[some], remainders[some] = block.factorised(n_data)
        return stiffness, UnitLoads(moments, remainders)


@dataclass(frozen=True)
class _Triangles:
    """Triangles with the axes (t, 3, 2, 2) of their sides, an axis a column."""

    corners: Array
    lam: Array
    mu: Array
    axes: Array

    def factorised(self, n_data: int) -> tuple[Array, Array, Array]:
        """Return P G⁻¹Pᵀ (t, 12, 12), and `moments` and `remainders` of UnitLoads.

        With [S, Φ] the square roots of energy of the stresses N and of ρ of unit data,
        [S, Φ] = Q[R, C; 0, R'] gives G = RᵀR, the projections C and the rest R'. This is by QR of
        the stresses themselves: products SᵀS would lose twice as many digits where a triangle is
        flat.
        """
        P = self._tractions()
        stresses = self._samples(self._stresses())
        data, moments, complement = self._unit_stresses(n_data)
        samples = np.concatenate([stresses, self._samples(data)], axis=2)
        if complement is not None:  # orthogonal to all that is linear
            below = np.zeros((len(P), complement.shape[1], 9 + n_data))
            below[..., 9 + N_CONSTANT :] = complement
            samples = np.concatenate([samples, below], axis=1)
        R = np.asarray(np.linalg.qr(samples, mode="r"))
        projections, remainders = np.split(R[..., 9:], [9], axis=1)
        half = np.linalg.solve(np.swapaxes(R[:, :9, :9], 1, 2), np.swapaxes(P, 1, 2))
        transposed = np.swapaxes(half, 1, 2)
        moments = np.matmul(transposed, projections) - moments
        return np.matmul(transposed, half), moments, remainders

    def _tractions(self) -> Array:
        """Return P (t, 12, 9): τn|e| = det B · B τ̂n̂|ê| with τ = B τ̂ Bᵀ."""
        _, sides = _reference()
        B, det = self._maps
        turned = np.einsum("t,tkja,tjb->tkab", det, self.axes, B)
        moments = np.einsum("tkab,kgbn->tkgan", turned, sides, optimize=True)
        return np.asarray(moments.reshape(-1, 12, 9))

    def _stresses(self) -> Array:
        """Return the stresses N (t, 3, 9, 9) by component, weighted corner and number."""
        N, _ = _reference()
        weighted = np.einsum("ij,pjcn->cpin", WEIGHT, N).reshape(3, -1)
        return np.asarray(np.matmul(self._tensor_maps, weighted).reshape(-1, 3, 9, 9))

    def _unit_stresses(self, n_data: int) -> tuple[Array, Array, Array | None]:
        """Return ρ = τ_p + βθI of unit data, the moments P_p, and what is not linear of ρ.

        ρ:    (t, 3, 9, d) by component and weighted corner of a part
        P_p:  (t, 12, d)
        rest: (t, 54, d − N_CONSTANT) numbers whose squares sum to its square, or None
        """
        centres = self.corners.mean(axis=1, keepdims=True)
        # of unit f: xx and yy of τ_p at the corners and the centre
        tau = centres - np.concatenate([self.corners, centres], axis=1)
        rho = np.zeros((len(tau), 3, 3, 3, n_data))  # by component, part, corner
        rho[:, :2, :, :, :3] = WEIGHT @ np.vstack([np.eye(3), np.full(3, 1.0 / 3.0)])[PARTS]
        weighted = np.matmul(WEIGHT, tau[:, PARTS])
        rho[:, 0, :, :, 3], rho[:, 1, :, :, 4] = np.moveaxis(weighted, -1, 0)
        moments = np.zeros((len(tau), 12, n_data))
        moments[..., 3:5] = self._side_moments(tau)
        complement = None
        if n_data > N_CONSTANT:
            linear, complement, moments[..., N_CONSTANT:] = self._quadratic_stresses()
            rho[..., N_CONSTANT:] = linear
        return rho.reshape(-1, 3, 9, n_data), moments, complement

    def _side_moments(self, tau: Array) -> Array:
        """Return the moments (t, 12, 2) of diag(tau, 0) and diag(0, tau) at the Gauss points.

        tau: (t, 4, 2) xx and yy at the corners and the centre
        """
        first, last = SIDES.T
        side = self.corners[:, last] - self.corners[:, first]
        outward = 0.5 * np.stack([side[..., 1], -side[..., 0]], axis=-1)
        change = tau[:, last] - tau[:, first]
        at_gauss = tau[:, first, None] + GAUSS[:, None] * change[:, :, None]
        moments = np.einsum("tkga,tka,tkab->tkgba", at_gauss, outward, self.axes)
        return np.asarray(moments.reshape(-1, 12, 2))

    def _quadratic_stresses(self) -> tuple[Array, Array, Array]:
        """Return what τ_p of f_i = x_c − x_zc is, by i and c.

        Its projection onto linear functions on the parts (t, 3, 3, 3, 4) by component, part and
        weighted corner, the rest (t, 54, 4) as samples, and its moments (t, 12, 4).
        """
        fields = _quadratic_fields()
        B, det = self._maps
        # div(Bτ̂Bᵀ) = B div τ̂, so that the reference triangle carries B⁻¹f
        unit_slopes = np.eye(4).reshape(4, 2, 2)
        slopes = np.linalg.solve(B[:, None], np.matmul(unit_slopes, B[:, None]))
        components = np.einsum("pncij,tsij->tcpns", fields.stress, slopes)
        stress = np.einsum("tdc,tcpns->tdpns", self._tensor_maps, components)
        projection, complement = _quadratic_samples()
        linear = np.einsum("mn,tcpns->tcpms", projection, stress)
        remainders = np.einsum("mn,tcpns->tcpms", complement, stress)
        traction = np.einsum("kgaij,tsij->tkgas", fields.traction, slopes)
        moments = np.einsum("t,tab,tkac,tkgbs->tkgcs", det, B, self.axes, traction, optimize=True)
        return linear, self._samples(remainders), moments.reshape(-1, 12, 4)

    @cached_property
    def _maps(self) -> tuple[Array, Array]:
        """Return B (t, 2, 2) of the maps from the reference triangle, and the determinants (t,)."""
        first = self.corners[:, 1] - self.corners[:, 0]
        second = self.corners[:, 2] - self.corners[:, 0]
        B = np.stack([first, second], axis=-1)
        return B, np.linalg.det(B)

    @cached_property
    def _tensor_maps(self) -> Array:
        """Return the maps (t, 3, 3) from the components xx, yy, xy of τ̂ to those of B τ̂ Bᵀ."""
        B, _ = self._maps
        tensors = np.einsum("tab,cbd,ted->taec", B, TENSORS, B, optimize=True)
        return np.stack([tensors[:, 0, 0], tensors[:, 1, 1], tensors[:, 0, 1]], axis=1)

    def _samples(self, stress: Array) -> Array:
        """Return numbers (t, 3k, d) whose squares sum to ∫c⁻¹σ : σ of d stresses.

        c⁻¹σ : σ = |dev σ|²/2μ + (tr σ)²/4(λ + μ)
        stress: (t, 3, …, d) components of σ at k weighted values, three a part of a linear stress
        """
        _, det = self._maps
        n_triangles, n_stresses = len(stress), stress.shape[-1]
        roots = np.empty((n_triangles, 3, 3))
        shear = np.sqrt(det / (2.0 * self.mu))[:, None]
        bulk = np.sqrt(det / (4.0 * (self.lam + self.mu)))[:, None]
        roots[:, 0] = np.sqrt(0.5) * shear * [1.0, -1.0, 0.0]
        roots[:, 1] = np.sqrt(2.0) * shear * [0.0, 0.0, 1.0]
        roots[:, 2] = bulk * [1.0, 1.0, 0.0]
        samples = np.matmul(roots, stress.reshape(n_triangles, 3, -1))
        return samples.reshape(n_triangles, -1, n_stresses)


ROUNDINGS = 4.0
"""Rounding errors of K̂ by which the error of λ̂ is estimated."""
REFINEMENTS = 3
"""Refinements of a triangle for its constant."""
SHAPES = 16
"""Classes of shapes of triangles: places along the edge, and heights in a factor of e."""


@dataclass(frozen=True)
class Band:
    """Bounds low ≤ λ₁ of the body ≤ high [Pa/m].

    hat: λ̂ of the equilibrium elements, nearer to λ₁ than λ₁ of P1
    """

    low: float
    hat: float
    high: float

    def times(self, factor: float) -> Band:
        """Return the band of a body that is `factor` times as stiff."""
        return Band(self.low * factor, self.hat * factor, self.high * factor)

    def numbers(self, omega: Array | float, factor: Array | float = 1.0) -> dict[str, Any]:
        """Return the stored variables by name.

        omega: ω of the law [Pa/m];  factor: stiffness of the bodies relative to that of the band
        """
        low, high, hat = (value * factor for value in (self.low, self.high, self.hat))
        proved = np.less(omega, low)
        return {
            "lambda_1_low": low,
            "lambda_1_high": high,
            "lambda_1_dual": hat,
            "proved_unique": proved,
        }


def dual_body(mesh: PlaneMesh, scene: Scene, line: ContactLine) -> EquilibriumBody:
    """Return the equilibrium elements of a scene on a mesh, condensed onto Γ_C.

    Raises NotPositiveDefinite if the body can move other than along Γ_C.
    """
    edges, edge_of_side = mesh.edges
    e = len(edges)
    s = len(mesh.segments)
    number = edge_of_side.ravel()[mesh.sides_at(mesh.segments)]
    half = 0.5 * mesh.boundary.length
    normal = mesh.boundary.normal
    tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
    tn = np.stack([tangent, normal], axis=2)
    axes = np.tile(np.eye(2), (s, 1, 1))
    held = np.zeros((s, 2), dtype=bool)
    springs = np.zeros((s, 2))
    for name, role in scene.boundary:
        on = mesh.on(name)
        is_given = np.array([component is not None for component in role.u])
        if role.frame == "nt":
            axes[on] = tn[on]
            held[on] = is_given[::-1]
            springs[on] = role.spring[::-1]
        else:
            held[on] = is_given
    edge_axes = np.tile(np.eye(2), (e, 1, 1))
    edge_axes[number] = axes
    lam = mesh.of_material(scene, "lam")
    mu = mesh.of_material(scene, "mu")
    elements = Elements(mesh, lam, mu, edge_axes)
    rows = elements.local_rows
    row_numbers = np.repeat(rows, 12, axis=1).ravel()
    column_numbers = np.tile(rows, (1, 12)).ravel()
    stiffness, loads = elements.factorised()
    K = sp.coo_array(
        (stiffness.ravel(), (row_numbers, column_numbers)), shape=(4 * e, 4 * e)
    ).tocsr()
    if np.any(springs):
        spring_rows = np.zeros((2, 2, e))
        spring_rows[:, :, number] = (springs * half[:, None]).T
        K = sp.csr_array(K + sp.diags_array(spring_rows.ravel()))
    held_rows = np.zeros((2, 2, e), dtype=bool)
    held_rows[:, :, number] = held.T
    eliminated = ~held_rows
    contact_edges = number[line.which]
    eliminated[:, 0, contact_edges] = False
    is_eliminated = eliminated.ravel()
    tied_K = K
    ties = _ties(mesh, scene.boundary)
    if ties is not None:
        tied_K = sp.csr_array(ties.T @ K @ ties)
        is_eliminated = is_eliminated & (np.diff(ties.tocsc().indptr) > 0)
    runs_backwards = mesh.segments[line.which, 0] > mesh.segments[line.which, 1]
    gauss = np.arange(2) ^ runs_backwards[:, None]
    contact_rows = (2 * gauss * e + contact_edges[:, None]).ravel()
    middles = mesh.points[edges].mean(axis=1)
    condensation = condense(tied_K, middles, contact_rows, is_eliminated, components=4)
    return EquilibriumBody(
        elements,
        loads,
        number,
        axes,
        held_rows.ravel(),
        ties,
        K,
        tied_K.diagonal(),
        np.repeat(half[line.which], 2),
        condensation,
    )


def lambda_1_band(
    body: EquilibriumBody, mesh: PlaneMesh, line: ContactLine, A_tilde: Array
) -> Band:
    """Return lower and upper bounds of λ₁ of the body.

    A_tilde: (m, m) of P1 on the mesh with the moduli of `body` [Pa]
    """
    hat, mode, error = least_eigenpair(body.condensation.A_tilde, body.c)
    w = body.condensation.expand(mode)
    error += ROUNDINGS * float(np.finfo(float).eps) * float(body.diagonal @ w**2) / hat
    lam = body.elements.lam
    mu = body.elements.mu
    C2 = neglected(mesh, line, np.minimum(mu, lam + mu))
    M = segment_mass(line.unknowns, line.lengths, line.m)
    v = scipy.linalg.eigh(A_tilde, M, subset_by_index=[0, 0])[1][:, 0]
    high = float(v @ A_tilde @ v) / float(v @ M @ v)  # no less than the eigenvalue for any v
    return Band(hat * (1.0 - error) / (1.0 + C2 * hat), hat, high * (1.0 + error))


def require_straight(mesh: PlaneMesh, body: Body) -> None:
    """Raise GeometryFailed for curved edges and regions: their polygons are another body."""
    curved = [*mesh.geometry.curved, *body.curved_regions]
    if curved:
        names = ", ".join(curved)
        fault = f"a guarantee needs straight edges, but the mesh of {names} is another body"
        remedy = "write guarantee: polygon for what is true of that polygon, or leave it out"
        raise GeometryFailed(f"{fault}; {remedy}", ("mesh", "guarantee"))


def _ties(mesh: PlaneMesh, boundary: tuple[tuple[str, Role], ...]) -> sp.csr_array | None:
    """Return T of w = T w' for rigid edges, None without.

    The unknowns a_x, a_y and, if the edge turns, φℓ are in rows of its first segment.
    """
    edges, edge_of_side = mesh.edges
    e = len(edges)
    untied = np.ones(4 * e, dtype=bool)
    parts = list[tuple[Indices, Indices, Array]]()
    for name, role in boundary:
        if not unknown(role):
            continue
        number = edge_of_side.ravel()[mesh.sides_at(mesh.segments[mesh.on(name)])]
        ends = mesh.points[edges[number]]
        # (k, 2, 2) by edge and Gauss point
        along = ends[:, 1:] - ends[:, :1]
        at_gauss = ends[:, :1] + GAUSS[None, :, None] * along
        rows = 2 * e * np.arange(2) + number[:, None]
        nodes, _, arms = edge_arms(mesh, name)
        middle = mesh.points[nodes[0]] - arms[0]
        length = float(np.hypot(*arms.T).max())
        for c in unknown(role):
            own_rows = rows + c * e
            translation = np.full(rows.shape, number[0] + c * e)
            parts.append((own_rows, translation, np.ones(rows.shape)))
            untied[own_rows] = False
            if role.moment is not None:
                sign = -1.0 if c == 0 else 1.0
                arm = (at_gauss - middle)[..., 1 - c] * sign / length
                rotation = np.full(rows.shape, 2 * e + number[0])
                parts.append((own_rows, rotation, arm))
    if not parts:
        return None
    identity = np.flatnonzero(untied)
    parts.append((identity, identity, np.ones(len(identity))))
    row = np.concatenate([rows.ravel() for rows, _, _ in parts])
    column = np.concatenate([columns.ravel() for _, columns, _ in parts])
    value = np.concatenate([values.ravel() for _, _, values in parts])
    return sp.csr_array((value, (row, column)), shape=(4 * e, 4 * e))


# -- the part of tractions that is not linear on a segment -----------------------------------------


def neglected(mesh: PlaneMesh, line: ContactLine, stiffness: Array) -> float:
    """Return C² = max_K Σ_e sup_v ‖(I − π)v_T‖²_e/a_K(v,v) over triangles at Γ_C [m/Pa].

    stiffness: (t,) half the least of c, min(μ, λ + μ) [Pa]
    """
    owner = mesh.owner[line.which]
    return float(np.bincount(owner, neglected_by_segment(mesh, line, stiffness)).max())


def neglected_by_segment(mesh: PlaneMesh, line: ContactLine, stiffness: Array) -> Array:
    """Return bounds (s,) of sup_v ‖(I − π)v_T‖²_e/a_K(v,v) of the segments e of Γ_C [m/Pa].

    stiffness: as for `neglected`
    """
    owner = mesh.owner[line.which]
    first, second = np.moveaxis(line.ends, 1, 0)
    corners = mesh.triangles[owner]
    ends = line.segments
    is_apex = (corners != ends[:, :1]) & (corners != ends[:, 1:])
    apex = mesh.points[corners[is_apex]]
    h = np.hypot(*(second - first).T)
    along = (second - first) / h[:, None]
    across = apex - first
    x = np.einsum("ij,ij->i", along, across) / h
    y = (along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]) / h
    x = np.minimum(x, 1.0 - x)
    # Apexes of few classes inside these triangles: at the height `low` a triangle reaches from
    # x·share to 1 − (1 − x)·share, which is 1/SHAPES wide or more.
    low = np.exp(np.floor(np.log(y * (1.0 - 1.0 / SHAPES)) * SHAPES) / SHAPES)
    share = low / y
    inner = np.ceil(x * share * SHAPES) / SHAPES
    assert np.all((x * share <= inner) & (inner <= 1.0 - (1.0 - x) * share))
    shapes, which = np.unique(np.column_stack([inner, low]), axis=0, return_inverse=True)
    C2 = shape_constants(tuple(map(tuple, shapes.tolist())))[which]
    return np.asarray(C2 * h / (2.0 * stiffness[owner]))


CHILDREN = np.array([[0, 6, 5], [1, 2, 7], [8, 3, 4], [8, 6, 7]])
"""Sides of the four parts of a triangle: 0 to 5 are halves of its own sides, in order.

The last part is in the middle, and its sides run backwards: it is turned by 180°, which does not
change its stiffness."""


@lru_cache(maxsize=64)
def shape_constants(shapes: tuple[Point, ...]) -> Array:
    """Return C₀² (n,) of ‖(I − π)v_T‖²_e ≤ C₀² h_e ‖ε(v)‖²_K for v_N = 0 on a side e.

    The triangle has its apex at (x, y)h_e. The stiffness of a refined triangle at its boundary is
    that of four parts, each refined once less.
    """
    n = len(shapes)
    zero = np.zeros(n)
    corners = np.stack([zero, zero, zero + 1.0, zero, *np.array(shapes).T], axis=1)
    triangles = TriangleGeometry(corners.reshape(-1, 2), np.arange(3 * n).reshape(n, 3))
    axes = np.tile(np.eye(2), (3 * n, 1, 1))
    K, _ = Elements(triangles, zero, zero + 0.5, axes).factorised()
    for level in range(REFINEMENTS):
        gauss = np.arange(2 * 2**level)  # Gauss points of a part's side
        size = 18 * len(gauss)
        assembled = np.zeros((n, size, size))
        for part, sides in enumerate(CHILDREN):
            points = len(gauss) * sides[:, None] + (gauss[::-1] if part == 3 else gauss)
            rows = (2 * points[..., None] + np.arange(2)).ravel()
            assembled[:, rows[:, None], rows] += K
        K = _condensed(assembled, np.arange(size) < 12 * len(gauss))
    k = 2 * 2**REFINEMENTS
    row = np.arange(6 * k)
    tangential = (row % 2 == 0) & (row < 2 * k)
    A = _condensed(K, tangential, held=slice(1, 2 * k, 2)) * k
    x = (np.arange(k // 2)[:, None] + GAUSS).ravel() / (k // 2)
    # linear functions on e, the rigid motion first
    Q, _ = np.linalg.qr(np.column_stack([np.ones(k), x]))
    trace = np.trace(A, axis1=1, axis2=2)[:, None, None]
    projection = np.eye(k) - Q @ Q.T
    definite = A + trace * np.outer(Q[:, 0], Q[:, 0])
    nu = np.linalg.eigvalsh(projection @ np.linalg.inv(definite) @ projection)[:, -1]
    return np.asarray(nu / (1.0 - 0.5**REFINEMENTS))


def _condensed(K: Array, keep: NDArray[np.bool_], held: slice = slice(0)) -> Array:
    """Return K (n, r, r) condensed onto some rows (n, m, m), others held at 0."""
    inner = ~keep
    inner[held] = False
    k = np.flatnonzero(keep)
    i = np.flatnonzero(inner)
    K_ik = K[:, i[:, None], k]
    solved = np.linalg.solve(K[:, i[:, None], i], K_ik)
    schur = np.swapaxes(K_ik, 1, 2) @ solved
    return np.asarray(K[:, k[:, None], k] - schur)
