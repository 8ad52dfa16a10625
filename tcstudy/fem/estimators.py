"""Strain and stress of P1 displacements, tractions at the Gauss points of edges, and ξ_h between the contact nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.fem.boundary import ContactLine, values_at
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.fem.rigid import edge_arms
from tcstudy.laws.composed import EdgeLaws, law_along
from tcstudy.laws.laws import Laws
from tcstudy.scene.records import Role
from tcstudy.shapes.triangles import GAUSS, TriangleGeometry

Array = NDArray[np.float64]


def own_strain(mesh: TriangleGeometry, u: Array) -> Array:
    """(t, 3) strain of a displacement u (2n,) on triangles."""
    gradient = mesh.gradient(u.reshape(2, -1).T)
    shear = 0.5 * (gradient[:, 0, 1] + gradient[:, 1, 0])
    return np.column_stack([gradient[:, 0, 0], gradient[:, 1, 1], shear])


def strain_energy(mesh: TriangleGeometry, a: Array, lam: Array, mu: Array) -> Array:
    """(t,) ∫_K a:c a of a strain that is linear on K and given at its corners (t, 3, 3) [J/m]; moduli (t,)."""
    trace = a[..., 0] + a[..., 1]
    total = np.einsum("tkc,tkc->tc", a, a) + a.sum(axis=1) * a.sum(axis=1)
    volume = np.einsum("tk,tk->t", trace, trace) + trace.sum(axis=1) * trace.sum(axis=1)
    return mesh.area / 12.0 * (lam * volume + 2.0 * mu * (total @ np.array([1.0, 1.0, 2.0])))


def stress_of(strain: Array, lam: Array, mu: Array) -> Array:
    """cε, (…, 3) → (…, 3) [Pa]; moduli (…,)."""
    stress: Array = 2.0 * mu[..., None] * strain
    stress[..., :2] += (lam * (strain[..., 0] + strain[..., 1]))[..., None]
    return stress


def traction_of(stress: Array, normal: Array) -> Array:
    """σn at the Gauss points of segments (s, 2, 2) of stresses (s, 2, 3) there, normals (s, 2) [Pa]."""
    n = normal[:, None]
    rows = [stress[..., i] * n[..., 0] + stress[..., j] * n[..., 1] for i, j in ((0, 2), (2, 1))]
    return np.stack(rows, axis=-1)


def tangent(normal: Array) -> Array:
    """t = (−n₂, n₁) of normals (s, 2)."""
    return np.column_stack([-normal[:, 1], normal[:, 0]])


def on_segments(nodal: Array, segments: NDArray[np.intp]) -> Array:
    """P1 values at the Gauss points of segments, (n, …) → (s, 2, …)."""
    first, second = nodal[segments[:, 0]], nodal[segments[:, 1]]
    return np.stack([(1.0 - w) * first + w * second for w in GAUSS], axis=1)


def acting(mesh: PlaneMesh, name: str, role: Role, at: Array, normal: Array) -> Array:
    """(s, 2, 2) g − p n of an edge, and what its resultant and its moment spread over it, at points (s, 2, 2) [Pa]."""
    found = np.stack([values_at(component, at) for component in role.g], axis=-1)
    found = found - values_at(role.pressure, at)[..., None] * normal[:, None]
    found = found + np.array(role.force) / sum(curve.length for curve in mesh.geometry.curves if curve.name == name)
    if role.moment:
        length, (nodes, _, arms) = mesh.boundary.length[mesh.on(name)], edge_arms(mesh, name)
        arm = at - (mesh.points[nodes[0]] - arms[0])
        turn = np.stack([-arm[..., 1], arm[..., 0]], axis=-1)
        found = found + role.moment * turn / np.einsum("s,sgd,sgd->", 0.5 * length, arm, arm)
    return found


@dataclass(frozen=True)
class ContactTraction:
    """ξ_h on the boundary segments: linear between contact nodes, zero off Γ_C.

    xi:     (s, 2) ξ_h at the Gauss points [Pa]
    defect: (s, 2) dist(ξ_h, b̂(u_h,T)) there [Pa]
    """

    xi: Array
    defect: Array


def contact_traction(
    mesh: PlaneMesh, line: ContactLine, law: Laws | EdgeLaws, u_T: Array, xi: Array, u: Array
) -> ContactTraction:
    """ξ_h between the nodes from u_T (m,) and the tractions ξ_i/c_i (m,); u (2n,) gives u_T of held nodes."""
    edges, on, segments = mesh.boundary, line.which, line.segments
    ends_xi, ends_slip = (line.nodal(x, mesh.n_points, np.nan)[segments] for x in (xi, u_T))
    # A held end has no ξ of its own: its half cell belongs to the other end (method §2).
    ends_xi = np.where(np.isnan(ends_xi), ends_xi[:, ::-1], ends_xi)
    held = np.einsum("ksd,sd->sk", u.reshape(2, -1).T[segments.T], tangent(edges.normal[on]))
    ends_slip = np.where(np.isnan(ends_slip), held, ends_slip)
    traction = np.stack([(1.0 - w) * ends_xi[:, 0] + w * ends_xi[:, 1] for w in GAUSS], axis=1)
    slip = np.stack([ends_slip[:, 0] + w * (ends_slip[:, 1] - ends_slip[:, 0]) for w in GAUSS], axis=1)
    at = np.repeat(line.segment_edge, 2), edges.at[on].reshape(-1, 2)
    low, high = law_along(law, line.edge_names, *at).interval(slip.ravel())
    result, defect = np.zeros((2, len(mesh.segments), 2))
    result[on] = traction
    off = np.maximum(low.reshape(-1, 2) - traction, traction - high.reshape(-1, 2))
    defect[on] = np.maximum(0.0, off)
    return ContactTraction(result, defect)
