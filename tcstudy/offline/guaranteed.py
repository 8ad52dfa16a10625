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
            is less than the body's where that of P1 is more: energies come from the other side, and
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
from typing import Any, Literal, NamedTuple

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

    def stiffness(self) -> Array:
        """Return P G⁻¹Pᵀ (t, 12, 12) of every triangle."""
        half, _ = self._factors("r")
        return np.matmul(np.swapaxes(half, 1, 2), half)

    def volume_load(
        self, f: Array, theta: Array, slope: Array | None = None
    ) -> tuple[Array, float]:
        """Return the load (4e,) of f and βθ, and ‖(I − Π)ρ‖² of ρ = τ_p + βθI.

        f:     (2,) or, at the centres, (t, 1, 2) [N/m³];  theta: (t, 3) βθ at the corners [Pa]
        slope: (t, 2, 2) ∂f_i/∂x_c of a linear f [N/m⁴]
        Π: projection onto the stresses N in the norm of complementary energy
        """
        half, Q = self._factors("reduced")
        _, edge_of_side = self.mesh.edges
        corners = np.concatenate([self.mesh.corners, self.mesh.centres[:, None]], axis=1)
        tau = f * (corners[:, 3:] - corners)  # (t, 4, 2) xx and yy of τ_p
        rho = tau + np.column_stack([theta, theta.mean(axis=1)])[..., None]
        xx, yy = np.einsum("ij,tpjc->ctpi", WEIGHT, rho[:, PARTS])
        xy, rest2 = np.zeros_like(xx), 0.0
        if slope is not None:
            quadratic, moments_of_slope = self._quadratic_stress(slope)
            projected, complement = _quadratic_samples()
            linear = np.einsum("sn,tpncd->cdtps", projected, quadratic)
            xx, yy, xy = xx + linear[0, 0], yy + linear[1, 1], xy + linear[0, 1]
            rest = np.einsum("sn,tpncd->cdtps", complement, quadratic)
            rest2 = float(np.sum(self._samples(rest[0, 0], rest[1, 1], rest[0, 1]) ** 2))
        samples = self._samples(xx, yy, xy)
        coefficients = np.einsum("tsn,ts->tn", Q, samples)
        remainder = samples - np.einsum("tsn,tn->ts", Q, coefficients)
        side = corners[:, SIDES[:, 1]] - corners[:, SIDES[:, 0]]
        tau_first = tau[:, SIDES[:, 0]]
        tau_change = tau[:, SIDES[:, 1]] - tau_first
        # (t, 3, 2, 2) at the Gauss points of the sides
        tau_gauss = tau_first[:, :, None] + GAUSS[None, None, :, None] * tau_change[:, :, None]
        outward = 0.5 * np.stack([side[..., 1], -side[..., 0]], axis=-1)
        axes = self.axes[edge_of_side]
        moments = np.einsum("tkga,tka,tkab->tkgb", tau_gauss, outward, axes).reshape(-1, 12)
        if slope is not None:
            moments = moments + np.einsum("tkga,tkab->tkgb", moments_of_slope, axes).reshape(-1, 12)
        triangle_loads = np.einsum("tnk,tn->tk", half, coefficients) - moments
        load = np.zeros(4 * len(self.axes))
        np.add.at(load, self.local_rows, triangle_loads)
        return load, float(np.sum(remainder**2)) + rest2

    def _quadratic_stress(self, slope: Array) -> tuple[Array, Array]:
        """Return the stress of f = slope·(x − x_z) and its moments at the sides' Gauss points.

        Stress: (t, 3, 6, 2, 2) by part and node;  moments: (t, 3, 2, 2) in x and y
        """
        fields = _quadratic_fields()
        B, det = self._maps
        # div(Bτ̂Bᵀ) = B div τ̂, so that the reference triangle carries B⁻¹f
        reference_slope = np.linalg.solve(B, slope @ B)
        components = np.einsum("pncij,tij->tpnc", fields.stress, reference_slope)
        stress = np.einsum("tab,cbd,ted,tpnc->tpnae", B, TENSORS, B, components, optimize=True)
        traction = np.einsum("kgaij,tij->tkga", fields.traction, reference_slope)
        return stress, np.einsum("t,tab,tkgb->tkga", det, B, traction)

    def _factors(self, mode: Literal["r", "reduced"]) -> tuple[Array, Array]:
        """Return R⁻ᵀPᵀ (t, 9, 12) and, in mode "reduced", Q (t, 27, 9).

        With τ = B τ̂ Bᵀ the traction is τn|e| = det B · B τ̂n̂|ê|. G = RᵀR by QR of the stresses
        themselves: their products would lose twice as many digits where a triangle is flat.
        """
        N, sides = _reference()
        B, det = self._maps
        _, edge_of_side = self.mesh.edges
        axes = self.axes[edge_of_side]
        moments = np.einsum("t,tkja,tjb,kgbn->tkgan", det, axes, B, sides, optimize=True)
        P = moments.reshape(len(B), 12, 9)
        tensors = np.einsum("tab,cbd,ted->tcae", B, TENSORS, B)  # B E_c Bᵀ
        stress = np.einsum("tcae,ij,pjcn->aetpin", tensors, WEIGHT, N, optimize=True)
        samples = self._samples(stress[0, 0], stress[1, 1], stress[0, 1])
        Q: Array = np.empty(0)
        R: Array
        if mode == "reduced":
            Q, R = np.linalg.qr(samples, mode="reduced")
        else:
            R = np.asarray(np.linalg.qr(samples, mode="r"))
        half = np.linalg.solve(np.swapaxes(R, 1, 2), np.swapaxes(P, 1, 2))
        return half, Q

    @property
    def _maps(self) -> tuple[Array, Array]:
        """Return B (t, 2, 2) of the maps from the reference triangle, and the determinants (t,)."""
        corners = self.mesh.corners
        first = corners[:, 1] - corners[:, 0]
        second = corners[:, 2] - corners[:, 0]
        B = np.stack([first, second], axis=-1)
        return B, np.linalg.det(B)

    def _samples(self, xx: Array, yy: Array, xy: Array) -> Array:
        """Return numbers (t, 9k, …) whose squares sum to ∫c⁻¹σ : σ.

        c⁻¹σ : σ = |dev σ|²/2μ + (tr σ)²/4(λ + μ)
        xx, yy, xy: (t, 3, k, …) a stress on the parts of the triangles, by part and k weighted
        values, three of a linear stress
        """
        _, det = self._maps
        by_triangle = (-1, *(1,) * (xx.ndim - 1))
        shear = np.sqrt(det / (2.0 * self.mu)).reshape(by_triangle)
        bulk = np.sqrt(det / (4.0 * (self.lam + self.mu))).reshape(by_triangle)
        difference = np.sqrt(0.5) * shear * (xx - yy)
        parts = np.concatenate([difference, np.sqrt(2.0) * shear * xy, bulk * (xx + yy)], axis=2)
        return parts.reshape(len(xx), -1, *xx.shape[3:])


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
    entries = elements.stiffness().ravel()
    K = sp.coo_array((entries, (row_numbers, column_numbers)), shape=(4 * e, 4 * e)).tocsr()
    if np.any(springs):
        stiffness = np.zeros((2, 2, e))
        stiffness[:, :, number] = (springs * half[:, None]).T
        K = sp.csr_array(K + sp.diags_array(stiffness.ravel()))
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
    K = Elements(triangles, zero, zero + 0.5, axes).stiffness()
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
