"""Equilibrium elements: the dual of a plane elastic body, condensed onto its contact line.

Stress:     on every triangle, cut into three at its barycentre, symmetric, linear on each part, div τ = 0 in it and τn
            continuous: 9 coefficients a triangle, one for each self-balanced linear traction on its three edges. They
            are found once on the reference triangle and moved by τ = B τ̂ Bᵀ, which keeps both.
Hybrid:     unknowns w are displacements at the two Gauss points of every edge, multipliers that make τn continuous:
            K̂ = Σ_K P G⁻¹Pᵀ, G = ∫c⁻¹N:N, P the moments of tractions; wᵀK̂w = ‖τ‖² in the norm of complementary energy.
Contact:    the normal displacement is held, the tangential ones are kept: Â (2s, 2s) for s segments of Γ_C, with the
            weights c = h/2, is a contact problem like that of P1. Its compliance is less than the body's where that of
            P1 is more: energies come from the other side, and nothing locks for ν → ½, as c⁻¹ stays bounded.
Literature: C. Johnson and B. Mercier, Numer. Math. 30 (1978) 103-116; B. Fraeijs de Veubeke (1965); J. P. M. de Almeida
            and E. A. W. Maunder, Equilibrium Finite Element Formulations, Wiley 2017.
Left out:   curved edges.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.condense import Condensation, condense
from tcstudy.fem.recovery import GAUSS

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

SIDES = np.array([[0, 1], [1, 2], [2, 0]])
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1 / 3, 1 / 3]])
PARTS = np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3]])
"""Corners of the three parts of the reference triangle; side k belongs to part k."""
TENSORS = np.array([[[1.0, 0], [0, 0]], [[0, 0], [0, 1.0]], [[0, 1.0], [1.0, 0]]])
"""Symmetric tensors from their components xx, yy, xy."""


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

    A_hat:    (2k, 2k) stiffness of the tangential displacements at the Gauss points of Γ_C, in order [Pa]
    c:        (2k,) their weights, half the length of a segment [m]
    diagonal: (4e,) of K̂, local rows;  condensation: of K̂
    """

    c: Array
    diagonal: Array
    condensation: Condensation

    @property
    def A_hat(self) -> Array:
        return self.condensation.A_tilde


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


def equilibrium_body(points: Array, triangles: Indices, segments: Indices, lam: Array, mu: Array, supports: Supports,
                     ties: sp.csr_array | None = None) -> EquilibriumBody:  # fmt: skip
    """Equilibrium elements on a mesh, condensed onto Γ_C.

    points: (n, 2) [m];  triangles: (t, 3) counter-clockwise;  segments: (s, 2) of the boundary, the body on their left
    lam, mu: (t,) [Pa];  ties: (4e, 4e) T of rigid edges, w = T w', by `edges_of`
    Raises NotPositiveDefinite if the body can move other than along Γ_C.
    """
    edges, sides, turned = edges_of(triangles)
    number = numbers_of(edges, segments)
    e = len(edges)
    axes = np.tile(np.eye(2), (e, 1, 1))
    axes[number] = supports.axes
    local = _element_stiffness(points, triangles, lam, mu, axes[sides])
    gauss = np.arange(2) ^ turned[..., None]  # (t, 3, 2) of the edge, in its own direction
    rows = ((2 * gauss[..., None] + np.arange(2)) * e + sides[..., None, None]).reshape(len(triangles), 12)
    K = sp.coo_array((local.ravel(), (np.repeat(rows, 12, axis=1).ravel(), np.tile(rows, (1, 12)).ravel())),
                     shape=(4 * e, 4 * e)).tocsr()  # fmt: skip
    half = 0.5 * np.hypot(*(points[segments[:, 1]] - points[segments[:, 0]]).T)
    if np.any(supports.springs):
        stiffness = np.zeros((2, 2, e))
        stiffness[:, :, number] = (supports.springs * half[:, None]).T
        K = sp.csr_array(K + sp.diags_array(stiffness.ravel()))
    keep = np.zeros((2, 2, e), dtype=bool)
    eliminate = np.ones((2, 2, e), dtype=bool)
    eliminate[:, :, number] = ~supports.held.T
    own = number[supports.contact]
    eliminate[:, 0, own] = False
    keep[:, 0, own] = True
    active = eliminate.ravel()
    if ties is not None:
        K = sp.csr_array(ties.T @ K @ ties)
        active = active & (np.diff(ties.tocsc().indptr) > 0)
    backwards = segments[supports.contact, 0] > segments[supports.contact, 1]
    along = np.arange(2) ^ backwards[:, None]
    kept = (2 * along * e + own[:, None]).ravel()
    found = condense(K, points[edges].mean(axis=1), kept, active, components=4)
    return EquilibriumBody(np.repeat(half[supports.contact], 2), K.diagonal(), found)


def edges_of(triangles: Indices) -> tuple[Indices, Indices, Indices]:
    """(e, 2) the edges, ends ascending; (t, 3) those of every triangle; (t, 3) 1 where it runs along them backwards."""
    ends = triangles[:, SIDES]
    edges, sides = np.unique(np.sort(ends, axis=2).reshape(-1, 2), axis=0, return_inverse=True)
    return edges, sides.reshape(-1, 3), (ends[..., 0] > ends[..., 1]).astype(np.intp)


def numbers_of(edges: Indices, segments: Indices) -> Indices:
    """(s,) which of the edges the segments of the boundary are."""
    span = int(edges.max()) + 1
    low, high = np.sort(segments, axis=1).T
    return np.searchsorted(edges[:, 0] * span + edges[:, 1], low * span + high)


def _element_stiffness(points: Array, triangles: Indices, lam: Array, mu: Array, axes: Array) -> Array:
    """(t, 12, 12) P G⁻¹Pᵀ of every triangle, rows by side, Gauss point in its direction and local axis.

    With τ = B τ̂ Bᵀ the traction is τn|e| = det B · B τ̂n̂|ê|. G = RᵀR by QR of the stresses themselves, which loses half
    the digits that their products would lose where a triangle is flat.
    """
    N, sides = _reference()
    corners = points[triangles]
    B = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1)
    det = np.linalg.det(B)
    P = np.einsum("t,tkja,tjb,kgbn->tkgan", det, axes, B, sides, optimize=True).reshape(len(B), 12, 9)
    moved = np.einsum("tab,cbd,ted->tcae", B, TENSORS, B)  # B E_c Bᵀ
    weight = np.linalg.cholesky((np.ones((3, 3)) + np.eye(3)) / 72.0).T  # of linear functions on a third of ½
    samples = np.einsum("ij,pjcn->picn", weight, N)
    stress = np.einsum("tcae,picn->tpiaen", moved, samples, optimize=True)
    # c⁻¹σ : σ = |dev σ|²/2μ + (tr σ)²/4(λ + μ)
    trace = stress[..., 0, 0, :] + stress[..., 1, 1, :]
    shear, bulk = np.sqrt(det / (2.0 * mu)), np.sqrt(det / (4.0 * (lam + mu)))
    parts = (
        np.sqrt(0.5) * shear[:, None, None, None] * (stress[..., 0, 0, :] - stress[..., 1, 1, :]),
        np.sqrt(2.0) * shear[:, None, None, None] * stress[..., 0, 1, :],
        bulk[:, None, None, None] * trace,
    )
    R = np.linalg.qr(np.concatenate(parts, axis=2).reshape(len(B), 27, 9), mode="r")
    half = np.linalg.solve(np.swapaxes(R, 1, 2), np.swapaxes(P, 1, 2))
    return np.matmul(np.swapaxes(half, 1, 2), half)
