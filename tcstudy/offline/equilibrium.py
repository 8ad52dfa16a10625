"""Equilibrium elements: the dual of a plane elastic body, condensed onto its contact line.

Stress:     on every triangle, cut into three at its barycentre, symmetric, linear on each part, div τ = 0 in it and τn
            continuous: 9 coefficients a triangle, one for each self-balanced linear traction on its three edges. They
            are found once on the reference triangle and moved by τ = B τ̂ Bᵀ, which keeps both.
Hybrid:     unknowns w are displacements at the two Gauss points of every edge, multipliers that make τn continuous:
            K̂ = Σ_K P G⁻¹Pᵀ, G = ∫c⁻¹N:N, P the moments of tractions; wᵀK̂w = ‖τ‖² in the norm of complementary energy.
Contact:    the normal displacement is held, the tangential ones are kept: Â (2s, 2s) for s segments of Γ_C, with the
            weights c = h/2, is a contact problem like that of P1. Its compliance is less than the body's where that of
            P1 is more: energies come from the other side, and nothing locks for ν → ½, as c⁻¹ stays bounded.
Loads:      f constant, βθ linear on a triangle: τ = N G⁻¹(Pᵀw − q) + τ_p, τ_p = −diag(f_x (x − x_z), f_y (y − y_z)),
            q = ∫c⁻¹N:(τ_p + βθI); K̂w = ĝ + Σ_K (P G⁻¹q − P_p), P_p the moments of τ_p, and div τ + f = 0 exactly.
Literature: C. Johnson and B. Mercier, Numer. Math. 30 (1978) 103-116; B. Fraeijs de Veubeke (1965); J. P. M. de Almeida
            and E. A. W. Maunder, Equilibrium Finite Element Formulations, Wiley 2017.
Left out:   curved edges.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Literal

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.condense import Condensation, condense
from tcstudy.shapes.triangles import GAUSS, TriangleGeometry

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

SIDES = np.array([[0, 1], [1, 2], [2, 0]])
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1 / 3, 1 / 3]])
PARTS = np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3]])
"""Corners of the three parts of the reference triangle; side k belongs to part k."""
TENSORS = np.array([[[1.0, 0], [0, 0]], [[0, 0], [0, 1.0]], [[0, 1.0], [1.0, 0]]])
"""Symmetric tensors from their components xx, yy, xy."""
WEIGHT = np.linalg.cholesky((np.ones((3, 3)) + np.eye(3)) / 72.0).T
"""Its square is the mass matrix of linear functions on a part of the reference triangle, a third of ½."""


@dataclass(frozen=True)
class Supports:
    """What holds the segments of the boundary; displacements in local axes, those of contact being (t, n).

    axes:    (s, 2, 2) an axis a column;  held: (s, 2) components that are prescribed
    springs: (s, 2) stiffness along the axes [Pa/m];  contact: (k,) segments of Γ_C in order, the body on their left
    """

    axes: Array
    held: NDArray[np.bool_]
    springs: Array
    contact: Indices


@dataclass(frozen=True)
class EquilibriumBody:
    """Triangles of equilibrium elements, condensed onto Γ_C.

    Local rows (4e,) run over the Gauss points of the edges, from the lower node on, then over axes, then over edges.

    elements:  the triangles;  number: (s,) which of the edges the segments of the boundary are
    supports:  what holds those;  ties: (4e, 4e) T of rigid edges, w = T w', or None
    K:         (4e, 4e) K̂ with springs, rigid edges not tied [Pa];  diagonal: (4e,) of TᵀK̂T
    c:         (2k,) weights of the Gauss points of Γ_C, half the length of a segment [m]
    condensation: of TᵀK̂T
    """

    elements: Elements
    number: Indices
    supports: Supports
    ties: sp.csr_array | None
    K: sp.csr_array
    diagonal: Array
    c: Array
    condensation: Condensation

    @property
    def A_hat(self) -> Array:
        """(2k, 2k) stiffness of the tangential displacements at the Gauss points of Γ_C, in order [Pa]."""
        return self.condensation.A_tilde

    @cached_property
    def gauss_points(self) -> Array:
        """(s, 2, 2) those of the segments of the boundary, from the lower node on [m]."""
        ends = self.elements.mesh.points[self.elements.mesh.edges[0][self.number]]
        return ends[:, :1] + GAUSS[None, :, None] * (ends[:, 1:] - ends[:, :1])

    def traction_load(self, traction: Array) -> Array:
        """(4e,) the load of a traction (s, 2, 2) in x and y at the Gauss points of the segments [N/m]."""
        ends = self.elements.mesh.points[self.elements.mesh.edges[0][self.number]]
        half = 0.5 * np.hypot(*(ends[:, 1] - ends[:, 0]).T)
        load = np.zeros((2, 2, len(self.elements.axes)))
        load[:, :, self.number] = np.einsum("s,sgd,sdk->gks", half, traction, self.supports.axes)
        return load.ravel()

    def rows(self, u: Array) -> Array:
        """(4e,) P1 displacements (n, 2) in x and y at the Gauss points of the edges, in local axes."""
        a, b = np.moveaxis(u[self.elements.mesh.edges[0]], 1, 0)
        at = np.stack([(1.0 - g) * a + g * b for g in GAUSS], axis=1)
        return np.einsum("egd,edk->gke", at, self.elements.axes).ravel()

    @cached_property
    def held(self) -> NDArray[np.bool_]:
        """(4e,) rows whose displacement is prescribed."""
        held = np.zeros((2, 2, len(self.elements.axes)), dtype=bool)
        held[:, :, self.number] = self.supports.held.T
        return held.ravel()


@cache
def _reference() -> tuple[Array, Array]:
    """Stresses of the reference triangle: (3, 3, 3, 9) by part, corner, component xx, yy, xy, and coefficient, and what
    they do at the sides: (3, 2, 2, 9) τ̂n̂|ê|/2 at the Gauss points."""
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
    ends = np.array([[_traction(np.array([y, -x])) @ N[k, end] for end in (0, 1)] for k, (x, y) in enumerate(d)])
    return N, 0.5 * np.einsum("ge,keij->kgij", np.column_stack([1.0 - GAUSS, GAUSS]), ends)


def _traction(n: Array) -> Array:
    """(2, 3): (xx, yy, xy) → σn."""
    return np.array([[n[0], 0.0, n[1]], [0.0, n[1], n[0]]])


def equilibrium_body(mesh: TriangleGeometry, segments: Indices, lam: Array, mu: Array, supports: Supports,
                     ties: sp.csr_array | None = None) -> EquilibriumBody:  # fmt: skip
    """Equilibrium elements on a mesh, condensed onto Γ_C.

    segments: (s, 2) of the boundary, the body on their left;  lam, mu: (t,) [Pa]
    ties:     (4e, 4e) T of rigid edges, w = T w', by `mesh.edges`
    Raises NotPositiveDefinite if the body can move other than along Γ_C.
    """
    (edges, sides), points = mesh.edges, mesh.points
    number, e = sides.ravel()[mesh.sides_at(segments)], len(edges)
    axes = np.tile(np.eye(2), (e, 1, 1))
    axes[number] = supports.axes
    elements = Elements(mesh, lam, mu, axes)
    local, rows = elements.stiffness(), elements.local_rows
    K = sp.coo_array((local.ravel(), (np.repeat(rows, 12, axis=1).ravel(), np.tile(rows, (1, 12)).ravel())),
                     shape=(4 * e, 4 * e)).tocsr()  # fmt: skip
    half = 0.5 * np.hypot(*(points[segments[:, 1]] - points[segments[:, 0]]).T)
    if np.any(supports.springs):
        stiffness = np.zeros((2, 2, e))
        stiffness[:, :, number] = (supports.springs * half[:, None]).T
        K = sp.csr_array(K + sp.diags_array(stiffness.ravel()))
    eliminate = np.ones((2, 2, e), dtype=bool)
    eliminate[:, :, number] = ~supports.held.T
    own = number[supports.contact]
    eliminate[:, 0, own] = False
    active, tied = eliminate.ravel(), K
    if ties is not None:
        tied = sp.csr_array(ties.T @ K @ ties)
        active = active & (np.diff(ties.tocsc().indptr) > 0)
    backwards = segments[supports.contact, 0] > segments[supports.contact, 1]
    along = np.arange(2) ^ backwards[:, None]
    kept = (2 * along * e + own[:, None]).ravel()
    found = condense(tied, points[edges].mean(axis=1), kept, active, components=4)
    c = np.repeat(half[supports.contact], 2)
    return EquilibriumBody(elements, number, supports, ties, K, tied.diagonal(), c, found)


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
        gauss = np.arange(2) ^ (first > second)[..., None]  # (t, 3, 2) of the edge, in its own direction
        rows = (2 * gauss[..., None] + np.arange(2)) * len(self.axes) + self.mesh.edges[1][..., None, None]
        return rows.reshape(-1, 12)

    def stiffness(self) -> Array:
        """(t, 12, 12) P G⁻¹Pᵀ of every triangle."""
        half = self._factors("r")[0]
        return np.matmul(np.swapaxes(half, 1, 2), half)

    def volume_load(self, f: Array, theta: Array) -> tuple[Array, float]:
        """Of f (2,) [N/m³] and βθ (t, 3) at the corners [Pa]: their load (4e,), and ‖(I − Π)ρ‖² of ρ = τ_p + βθI.

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
        moments = np.einsum("tkga,tka,tkab->tkgb", at, outward, self.axes[self.mesh.edges[1]]).reshape(-1, 12)
        own = np.einsum("tnk,tn->tk", half, inner) - moments
        load = np.zeros(4 * len(self.axes))
        np.add.at(load, self.local_rows, own)
        return load, float(np.sum(rest**2))

    def _factors(self, mode: Literal["r", "reduced"]) -> tuple[Array, Array]:
        """(t, 9, 12) R⁻ᵀPᵀ and, in mode "reduced", (t, 27, 9) Q.

        With τ = B τ̂ Bᵀ the traction is τn|e| = det B · B τ̂n̂|ê|. G = RᵀR by QR of the stresses themselves, which loses
        half the digits that their products would lose where a triangle is flat.
        """
        N, sides = _reference()
        B, det = self._maps
        P = np.einsum("t,tkja,tjb,kgbn->tkgan", det, self.axes[self.mesh.edges[1]], B, sides, optimize=True).reshape(
            len(B), 12, 9
        )
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

        xx, yy, xy: (t, 3, 3, …) a stress that is linear on the parts of the triangles, by part and weighted corner
        """
        det = self._maps[1]
        shear, bulk = np.sqrt(det / (2.0 * self.mu)), np.sqrt(det / (4.0 * (self.lam + self.mu)))
        shear, bulk = (x.reshape(-1, *(1,) * (xx.ndim - 1)) for x in (shear, bulk))
        parts = np.sqrt(0.5) * shear * (xx - yy), np.sqrt(2.0) * shear * xy, bulk * (xx + yy)
        return np.concatenate(parts, axis=2).reshape(len(xx), 27, *xx.shape[3:])
