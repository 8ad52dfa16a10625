"""Equilibrium elements, and what they prove of λ₁ of the body.

Equilibrium elements: the dual of a plane elastic body, condensed onto its contact line.

Stress:     on every triangle, cut into three at its barycentre, symmetric, linear on each part, div τ = 0 in it and τn
            continuous: 9 coefficients a triangle, one for each self-balanced linear traction on its
            three edges. They
            are found once on the reference triangle and moved by τ = B τ̂ Bᵀ, which keeps both.
Hybrid:     unknowns w are displacements at the two Gauss points of every edge, multipliers that make τn continuous:
            K̂ = Σ_K P G⁻¹Pᵀ, G = ∫c⁻¹N:N, P the moments of tractions; wᵀK̂w = ‖τ‖² in the norm of
            complementary energy.
Contact:    the normal displacement is held, the tangential ones are kept: Â (2s, 2s) for s segments of Γ_C, with the
            weights c = h/2, is a contact problem like that of P1. Its compliance is less than the
            body's where that of
            P1 is more: energies come from the other side, and nothing locks for ν → ½, as c⁻¹ stays
            bounded.
Loads:      f constant, βθ linear on a triangle: τ = N G⁻¹(Pᵀw − q) + τ_p, τ_p = −diag(f_x (x − x_z), f_y (y − y_z)),
            q = ∫c⁻¹N:(τ_p + βθI); K̂w = ĝ + Σ_K (P G⁻¹q − P_p), P_p the moments of τ_p, and div τ +
            f = 0 exactly.
Literature: C. Johnson and B. Mercier, Numer. Math. 30 (1978) 103-116; B. Fraeijs de Veubeke (1965);
J. P. M. de Almeida
            and E. A. W. Maunder, Equilibrium Finite Element Formulations, Wiley 2017.
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
from typing import Any, Literal

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.condense import Condensation, condense
from tcstudy.contact.problem import CondensedBody, least_eigenpair
from tcstudy.errors import GeometryFailed
from tcstudy.fem.forms import ContactLine, edge_arms, unknown
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.scene.records import Point, Role, Scene
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

    elements:  the triangles;  number: (s,) which of the edges the segments of the boundary are
    axes:      (s, 2, 2) theirs, an axis a column, (t, n) on Γ_C;  held: (4e,) rows whose displacement is prescribed
    ties:      (4e, 4e) T of rigid edges, w = T w', or None
    K:         (4e, 4e) K̂ with springs, rigid edges not tied [Pa];  diagonal: (4e,) of TᵀK̂T
    c:         (2k,) weights of the Gauss points of Γ_C, half the length of a segment [m]
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
        """That of the tangential displacements at the Gauss points of Γ_C, in order."""
        return CondensedBody.of(self.condensation.A_tilde, self.c)

    @cached_property
    def gauss_points(self) -> Array:
        """(s, 2, 2) those of the segments of the boundary, from the lower node on [m]."""
        ends = self.elements.mesh.points[self.elements.mesh.edges[0][self.number]]
        return ends[:, :1] + GAUSS[None, :, None] * (ends[:, 1:] - ends[:, :1])

    def rows(self, u: Array) -> Array:
        """(4e,) P1 displacements (n, 2) in x and y at the Gauss points of the edges, in local
        axes."""
        a, b = np.moveaxis(u[self.elements.mesh.edges[0]], 1, 0)
        at = np.stack([(1.0 - g) * a + g * b for g in GAUSS], axis=1)
        return np.einsum("egd,edk->gke", at, self.elements.axes).ravel()


@cache
def _reference() -> tuple[Array, Array]:
    """Stresses of the reference triangle: (3, 3, 3, 9) by part, corner, component xx, yy, xy, and
    coefficient, and what they do at the sides: (3, 2, 2, 9) τ̂n̂|ê|/2 at the Gauss points."""
    rows = []
    for k, part in enumerate(PARTS):
        gradients = np.linalg.inv(np.column_stack([np.ones(3), CORNERS[part]]))[1:]
        for first, second in ((0, 2), (2, 1)):  # div τ = 0
            row = np.zeros((3, 3, 3))
            row[k, :, first], row[k, :, second] = gradients
            rows.append(row.ravel())
        across = CORNERS[3] - CORNERS[part[1]]  # the inner side that it shares with the next part
        for mine, other in ((1, 0), (2, 2)):
            for line in _traction(np.array([across[1], -across[0]])):
                row = np.zeros((3, 3, 3))
                row[k, mine], row[(k + 1) % 3, other] = line, -line
                rows.append(row.ravel())
    N = scipy.linalg.null_space(np.array(rows)).reshape(3, 3, 3, 9)
    d = CORNERS[SIDES[:, 1]] - CORNERS[SIDES[:, 0]]
    ends = np.array(
        [[_traction(np.array([y, -x])) @ N[k, end] for end in (0, 1)] for k, (x, y) in enumerate(d)]
    )
    return N, 0.5 * np.einsum("ge,keij->kgij", np.column_stack([1.0 - GAUSS, GAUSS]), ends)


def _traction(n: Array) -> Array:
    """(2, 3): (xx, yy, xy) → σn."""
    return np.array([[n[0], 0.0, n[1]], [0.0, n[1], n[0]]])


@dataclass(frozen=True)
class Elements:
    """Triangles with their moduli (t,). axes: (e, 2, 2) of the edges"""

    mesh: TriangleGeometry
    lam: Array
    mu: Array
    axes: Array

    @property
    def local_rows(self) -> Indices:
        """(t, 12) local rows of every triangle by side, Gauss point in its direction and axis."""
        first, second = np.moveaxis(self.mesh.sides.reshape(-1, 3, 2), 2, 0)
        gauss = (
            np.arange(2) ^ (first > second)[..., None]
        )  # (t, 3, 2) of the edge, in its own direction
        rows = (2 * gauss[..., None] + np.arange(2)) * len(self.axes) + self.mesh.edges[1][
            ..., None, None
        ]
        return rows.reshape(-1, 12)

    def stiffness(self) -> Array:
        """(t, 12, 12) P G⁻¹Pᵀ of every triangle."""
        half = self._factors("r")[0]
        return np.matmul(np.swapaxes(half, 1, 2), half)

    def volume_load(self, f: Array, theta: Array) -> tuple[Array, float]:
        """Of f (2,) [N/m³] and βθ (t, 3) at the corners [Pa]: their load (4e,), and ‖(I − Π)ρ‖² of
        ρ = τ_p + βθI.

        Π: projection onto the stresses N in the norm of complementary energy
        """
        half, Q = self._factors("reduced")
        corners = np.concatenate([self.mesh.corners, self.mesh.centres[:, None]], axis=1)
        tau = f * (corners[:, 3:] - corners)  # (t, 4, 2) xx and yy of τ_p
        rho = tau + np.column_stack([theta, theta.mean(axis=1)])[..., None]
        xx, yy = np.einsum("ij,tpjc->ctpi", WEIGHT, rho[:, PARTS])
        samples = self._samples(xx, yy, np.zeros_like(xx))
        inner = np.einsum("tsn,ts->tn", Q, samples)
        rest = samples - np.einsum("tsn,tn->ts", Q, inner)
        side, first = corners[:, SIDES[:, 1]] - corners[:, SIDES[:, 0]], tau[:, SIDES[:, 0]]
        change = tau[:, SIDES[:, 1]] - first
        at = first[:, :, None] + GAUSS[None, None, :, None] * change[:, :, None]  # (t, 3, 2, 2)
        outward = 0.5 * np.stack([side[..., 1], -side[..., 0]], axis=-1)
        moments = np.einsum(
            "tkga,tka,tkab->tkgb", at, outward, self.axes[self.mesh.edges[1]]
        ).reshape(-1, 12)
        own = np.einsum("tnk,tn->tk", half, inner) - moments
        load = np.zeros(4 * len(self.axes))
        np.add.at(load, self.local_rows, own)
        return load, float(np.sum(rest**2))

    def _factors(self, mode: Literal["r", "reduced"]) -> tuple[Array, Array]:
        """(t, 9, 12) R⁻ᵀPᵀ and, in mode "reduced", (t, 27, 9) Q.

        With τ = B τ̂ Bᵀ the traction is τn|e| = det B · B τ̂n̂|ê|. G = RᵀR by QR of the stresses
        themselves, which loses half the digits that their products would lose where a triangle is
        flat.
        """
        N, sides = _reference()
        B, det = self._maps
        P = np.einsum(
            "t,tkja,tjb,kgbn->tkgan", det, self.axes[self.mesh.edges[1]], B, sides, optimize=True
        ).reshape(len(B), 12, 9)
        moved = np.einsum("tab,cbd,ted->tcae", B, TENSORS, B)  # B E_c Bᵀ
        stress = np.einsum("tcae,ij,pjcn->aetpin", moved, WEIGHT, N, optimize=True)
        found = np.linalg.qr(self._samples(stress[0, 0], stress[1, 1], stress[0, 1]), mode=mode)
        Q, R = found if mode == "reduced" else (np.empty(0), found)
        return np.linalg.solve(np.swapaxes(R, 1, 2), np.swapaxes(P, 1, 2)), Q

    @property
    def _maps(self) -> tuple[Array, Array]:
        """(t, 2, 2) B of the maps from the reference triangle, and (t,) their determinants."""
        corners = self.mesh.corners
        B = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1)
        return B, np.linalg.det(B)

    def _samples(self, xx: Array, yy: Array, xy: Array) -> Array:
        """(t, 27, …) whose squares sum to ∫c⁻¹σ : σ, c⁻¹σ : σ = |dev σ|²/2μ + (tr σ)²/4(λ + μ).

        xx, yy, xy: (t, 3, 3, …) a stress that is linear on the parts of the triangles, by part and
        weighted corner
        """
        det = self._maps[1]
        shear, bulk = np.sqrt(det / (2.0 * self.mu)), np.sqrt(det / (4.0 * (self.lam + self.mu)))
        shear, bulk = (x.reshape(-1, *(1,) * (xx.ndim - 1)) for x in (shear, bulk))
        parts = np.sqrt(0.5) * shear * (xx - yy), np.sqrt(2.0) * shear * xy, bulk * (xx + yy)
        return np.concatenate(parts, axis=2).reshape(len(xx), 27, *xx.shape[3:])


ROUNDINGS = 4.0
"""Of K̂, by which the error of λ̂ is estimated."""
REFINED = 3
"""Times that a triangle is refined for its constant."""
SHAPES = 16
"""Shapes of triangles are told apart by so many places along the edge, and their heights by as many
a factor of e."""


@dataclass(frozen=True)
class Band:
    """low ≤ λ₁ of the body ≤ high [Pa/m];  hat: λ̂ of the equilibrium elements, nearer to λ₁ than λ₁ of P1."""

    low: float
    hat: float
    high: float

    def times(self, factor: float) -> Band:
        """That of a body which is so many times as stiff."""
        return Band(self.low * factor, self.hat * factor, self.high * factor)

    def numbers(self, omega: Array | float, factor: Array | float = 1.0) -> dict[str, Any]:
        """What is stored of it; ω of the law [Pa/m], and how many times as stiff the bodies are."""
        low, high, hat = (value * factor for value in (self.low, self.high, self.hat))
        proved = np.less(omega, low)
        return {
            "lambda_1_low": low,
            "lambda_1_high": high,
            "lambda_1_dual": hat,
            "proved_unique": proved,
        }


def dual_body(mesh: PlaneMesh, scene: Scene, line: ContactLine) -> EquilibriumBody:
    """The equilibrium elements of a scene on a mesh, condensed onto Γ_C, all moduli those of the
    scene.

    Raises NotPositiveDefinite if the body can move other than along Γ_C.
    """
    (edges, sides), points, segments, s = mesh.edges, mesh.points, mesh.segments, len(mesh.segments)
    number, e, half = sides.ravel()[mesh.sides_at(segments)], len(edges), 0.5 * mesh.boundary.length
    normal = mesh.boundary.normal
    tn = np.stack([np.column_stack([-normal[:, 1], normal[:, 0]]), normal], axis=2)
    axes, held, springs = (
        np.tile(np.eye(2), (s, 1, 1)),
        np.zeros((s, 2), dtype=bool),
        np.zeros((s, 2)),
    )
    for name, role in scene.boundary:
        on, given = mesh.on(name), np.array([component is not None for component in role.u])
        if role.frame == "nt":
            axes[on], held[on], springs[on] = tn[on], given[::-1], role.spring[::-1]
        else:
            held[on] = given
    axes_of_edges = np.tile(np.eye(2), (e, 1, 1))
    axes_of_edges[number] = axes
    lam, mu = (mesh.of_material(scene, name) for name in ("lam", "mu"))
    elements = Elements(mesh, lam, mu, axes_of_edges)
    local, rows = elements.stiffness(), elements.local_rows
    at = np.repeat(rows, 12, axis=1).ravel(), np.tile(rows, (1, 12)).ravel()
    K = sp.coo_array((local.ravel(), at), shape=(4 * e, 4 * e)).tocsr()
    if np.any(springs):
        stiffness = np.zeros((2, 2, e))
        stiffness[:, :, number] = (springs * half[:, None]).T
        K = sp.csr_array(K + sp.diags_array(stiffness.ravel()))
    given_rows = np.zeros((2, 2, e), dtype=bool)
    given_rows[:, :, number] = held.T
    eliminate, own = ~given_rows, number[line.which]
    eliminate[:, 0, own] = False
    active, tied, ties = eliminate.ravel(), K, _ties(mesh, scene.boundary)
    if ties is not None:
        tied = sp.csr_array(ties.T @ K @ ties)
        active = active & (np.diff(ties.tocsc().indptr) > 0)
    backwards = segments[line.which, 0] > segments[line.which, 1]
    along = np.arange(2) ^ backwards[:, None]
    kept = (2 * along * e + own[:, None]).ravel()
    found = condense(tied, points[edges].mean(axis=1), kept, active, components=4)
    c = np.repeat(half[line.which], 2)
    return EquilibriumBody(
        elements, number, axes, given_rows.ravel(), ties, K, tied.diagonal(), c, found
    )


def lambda_1_band(
    body: EquilibriumBody, mesh: PlaneMesh, line: ContactLine, A_tilde: Array
) -> Band:
    """λ₁ of the body from both sides. A_tilde: (m, m) that of P1 on the mesh with the moduli of
    `body` [Pa]"""
    hat, x, error = least_eigenpair(body.condensation.A_tilde, body.c)
    whole = body.condensation.expand(x)
    error += ROUNDINGS * float(np.finfo(float).eps) * float(body.diagonal @ whole**2) / hat
    lam, mu = body.elements.lam, body.elements.mu
    C2, M = (
        neglected(mesh, line, np.minimum(mu, lam + mu)),
        segment_mass(line.unknowns, line.lengths, line.m),
    )
    v = scipy.linalg.eigh(A_tilde, M, subset_by_index=[0, 0])[1][:, 0]
    high = float(v @ A_tilde @ v) / float(v @ M @ v)  # no less than the eigenvalue whatever v is
    return Band(hat * (1.0 - error) / (1.0 + C2 * hat), hat, high * (1.0 + error))


def require_straight(mesh: PlaneMesh) -> None:
    """Raise GeometryFailed for curved edges: their polygon is another body."""
    curved = sorted({curve.name for curve in mesh.geometry.curves if not curve.straight})
    if curved:
        what = (
            f"a guarantee needs straight edges, but the mesh of {', '.join(curved)} is another body"
        )
        raise GeometryFailed(
            f"{what}; draw straight edges, or leave guarantee out", ("mesh", "guarantee")
        )


def _ties(mesh: PlaneMesh, boundary: tuple[tuple[str, Role], ...]) -> sp.csr_array | None:
    """T of w = T w': the displacements of a rigid edge in rows of its first segment, a_x, a_y and,
    if it turns, φℓ."""
    edges, sides = mesh.edges
    e = len(edges)
    rest, parts = np.ones(4 * e, dtype=bool), []
    for name, role in boundary:
        if not unknown(role):
            continue
        number = sides.ravel()[mesh.sides_at(mesh.segments[mesh.on(name)])]
        ends = mesh.points[edges[number]]
        at = ends[:, :1] + GAUSS[None, :, None] * (
            ends[:, 1:] - ends[:, :1]
        )  # (k, 2, 2) by edge and Gauss point
        rows = 2 * e * np.arange(2) + number[:, None]
        nodes, _, arms = edge_arms(mesh, name)
        middle, length = mesh.points[nodes[0]] - arms[0], float(np.hypot(*arms.T).max())
        for c in unknown(role):
            parts.append(
                (rows + c * e, np.full(rows.shape, number[0] + c * e), np.ones(rows.shape))
            )
            rest[rows + c * e] = False
            if role.moment is not None:
                arm = (at - middle)[..., 1 - c] * (-1.0 if c == 0 else 1.0) / length
                parts.append((rows + c * e, np.full(rows.shape, 2 * e + number[0]), arm))
    if not parts:
        return None
    kept = np.flatnonzero(rest)
    row, column, value = (
        np.concatenate([a.ravel() for a in part]) for part in zip(*parts, strict=True)
    )
    entries = (
        np.append(value, np.ones(len(kept))),
        (np.append(row, kept), np.append(column, kept)),
    )
    return sp.csr_array(entries, shape=(4 * e, 4 * e))


# -- what linear tractions leave out ---------------------------------------------------------------


def neglected(mesh: PlaneMesh, line: ContactLine, stiffness: Array) -> float:
    """C² = max_K Σ_e sup_v ‖(I − π)v_T‖²_e/a_K(v,v) over triangles at Γ_C [m/Pa].

    stiffness: (t,) half the least of c, min(μ, λ + μ) [Pa]
    """
    owner, (a, b) = mesh.owner[line.which], np.moveaxis(line.ends, 1, 0)
    corners, ends = mesh.triangles[owner], line.segments
    apex = mesh.points[corners[(corners != ends[:, :1]) & (corners != ends[:, 1:])]]
    h = np.hypot(*(b - a).T)
    along, across = (b - a) / h[:, None], apex - a
    x = np.einsum("ij,ij->i", along, across) / h
    y = (along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]) / h
    x = np.minimum(x, 1.0 - x)
    # apexes within those, of few kinds; at this height the triangle reaches from x·share to 1 − (1
    # − x)·share, which is 1/SHAPES wide or more
    low = np.exp(np.floor(np.log(y * (1.0 - 1.0 / SHAPES)) * SHAPES) / SHAPES)
    share = low / y
    inner = np.ceil(x * share * SHAPES) / SHAPES
    assert np.all((x * share <= inner) & (inner <= 1.0 - (1.0 - x) * share))
    shapes, which = np.unique(np.column_stack([inner, low]), axis=0, return_inverse=True)
    C2 = shape_constants(tuple(map(tuple, shapes.tolist())))[which]
    return float(np.bincount(owner, C2 * h / (2.0 * stiffness[owner])).max())


CHILDREN = np.array([[0, 6, 5], [1, 2, 7], [8, 3, 4], [8, 6, 7]])
"""Sides of the four parts of a triangle: 0 to 5 are halves of its own sides, in order; the last
part is in the middle, its sides run backwards; it is turned by 180°, which leaves its stiffness as
it is."""


@lru_cache(maxsize=64)
def shape_constants(shapes: tuple[Point, ...]) -> Array:
    """(n,) C₀²: ‖(I − π)v_T‖²_e ≤ C₀² h_e ‖ε(v)‖²_K for v_N = 0 on the side e of a triangle with
    its apex at (x, y)h_e.

    The stiffness of a refined triangle at its boundary is that of four parts, each refined once
    less.
    """
    n, none = len(shapes), np.zeros(len(shapes))
    points = np.stack([none, none, none + 1.0, none, *np.array(shapes).T], axis=1).reshape(-1, 2)
    apart = TriangleGeometry(points, np.arange(3 * n).reshape(n, 3))
    K = Elements(apart, none, none + 0.5, np.tile(np.eye(2), (3 * n, 1, 1))).stiffness()
    for level in range(REFINED):
        side = np.arange(2 * 2**level)  # Gauss points of a part's side
        whole = np.zeros((n, 18 * len(side), 18 * len(side)))
        for part, numbers in enumerate(CHILDREN):
            points_of = len(side) * numbers[:, None] + (side[::-1] if part == 3 else side)
            rows = (2 * points_of[..., None] + np.arange(2)).ravel()
            whole[:, rows[:, None], rows] += K
        K = _condensed(whole, np.arange(18 * len(side)) < 12 * len(side))
    k = 2 * 2**REFINED
    A = (
        _condensed(
            K, (np.arange(6 * k) % 2 == 0) & (np.arange(6 * k) < 2 * k), held=slice(1, 2 * k, 2)
        )
        * k
    )
    at = (np.arange(k // 2)[:, None] + GAUSS).ravel() / (k // 2)
    Q = np.linalg.qr(np.column_stack([np.ones(k), at]))[
        0
    ]  # linear functions on e, rigid motion first
    trace = np.trace(A, axis1=1, axis2=2)[:, None, None]
    left = np.eye(k) - Q @ Q.T
    nu = np.linalg.eigvalsh(left @ np.linalg.inv(A + trace * np.outer(Q[:, 0], Q[:, 0])) @ left)[
        :, -1
    ]
    return np.asarray(nu / (1.0 - 0.5**REFINED))


def _condensed(K: Array, keep: NDArray[np.bool_], held: slice = slice(0)) -> Array:
    """(n, m, m) K (n, r, r) condensed onto some rows, others held at 0."""
    inner = ~keep
    inner[held] = False
    k, i = np.flatnonzero(keep), np.flatnonzero(inner)
    K_ik = K[:, i[:, None], k]
    return np.asarray(
        K[:, k[:, None], k] - np.swapaxes(K_ik, 1, 2) @ np.linalg.solve(K[:, i[:, None], i], K_ik)
    )
