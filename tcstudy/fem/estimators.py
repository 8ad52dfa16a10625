"""Error of a P1 displacement in the energy norm, estimated triangle by triangle.

Estimate:   η_K² = ‖σ* − σ_h‖²_{c⁻¹,K} + (h_K/π)²/(2μ) ‖f + div σ*‖²_K + Σ_e h_e/(2πμ) ‖r_e‖²_e
            σ* recovered stress (continuous P1), r_e = what σ* leaves of the boundary condition on the edge e:
            σ*n − g + k_N u_N n + k_T u_T t on Γ_N, σ*_T + ξ_h on Γ_C, the free components on rollers; none on a rigid
            edge, whose tractions balance as a whole
Contact:    + h_e/(2πμ) ‖dist(ξ_h, b̂(u_h,T))‖²_e, since the inclusion (4) holds at the nodes only
Dirichlet:  + Σ_e 2πμ/h_e ‖u_D − u_h‖²_e, since given displacements hold at the nodes only
Coupling:   + β²/(λ+μ) ‖θ − θ_h‖²_K, see energy_error.py
Why:        for v and an interpolant Iv, a(u − u_h, v) = ∫(σ* − σ_h):ε(v − Iv) + ∫(f + div σ*)·(v − Iv)
            − Σ_e ∫ r_e·(v − Iv), so that the sum bounds the error up to a constant; the second and third term hold the
            oscillation of f and g, because div σ* is constant on K, and are of higher order where u is smooth
Literature: Zienkiewicz & Zhu, Int. J. Numer. Methods Eng. 33 (1992) 1331–1364; Carstensen & Bartels, Math. Comp. 71
            (2002) 945–969 (every averaging is reliable up to oscillation); Bartels & Carstensen, Numer. Math. 99
            (2004) 225–249 (contact)
Left out:   the amplification 1/(1 − ω/λ₁) by softening (Céa's constant of the problem), what arcs lose as polygons, and
            the energy of springs, of higher order in the error
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.fem.boundary import ContactLine, values_at
from tcstudy.fem.recovery import GAUSS, ElementGeometry
from tcstudy.laws.composed import EdgeLaws, law_along
from tcstudy.laws.laws import Laws
from tcstudy.scene.records import Clamped, Rigid, Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Strain:
    """A displacement's strain (ε_xx, ε_yy, ε_xy) on triangles and recovered at nodes.

    u:         (n, 2) the displacement [m]
    own:       (t, 3) of the P1 displacement;  recovered: (n, 3)
    excess:    (t, 3, 3) recovered at the corners of each triangle, less its own
    """

    u: Array
    own: Array
    recovered: Array
    excess: Array


def strain(triangles: ElementGeometry, u: Array) -> Strain:
    """Strain of a displacement u (2n,)."""
    own = own_strain(triangles, u)
    recovered = triangles.recovery @ own
    return Strain(u.reshape(2, -1).T, own, recovered, recovered[triangles.mesh.triangles] - own[:, None])


def own_strain(triangles: ElementGeometry, u: Array) -> Array:
    """(t, 3) strain of a displacement u (2n,) on triangles."""
    gradient = triangles.gradient(u.reshape(2, -1).T)
    shear = 0.5 * (gradient[:, 0, 1] + gradient[:, 1, 0])
    return np.column_stack([gradient[:, 0, 0], gradient[:, 1, 1], shear])


def strain_energy(triangles: ElementGeometry, a: Array, lam: float, mu: float) -> Array:
    """(t,) ∫_K a:c a of a strain that is linear on K and given at its corners (t, 3, 3) [J/m]."""
    trace = a[..., 0] + a[..., 1]
    total = np.einsum("tkc,tkc->tc", a, a) + a.sum(axis=1) * a.sum(axis=1)
    volume = np.einsum("tk,tk->t", trace, trace) + trace.sum(axis=1) * trace.sum(axis=1)
    return triangles.area / 12.0 * (lam * volume + 2.0 * mu * (total @ np.array([1.0, 1.0, 2.0])))


def energy_norm(triangles: ElementGeometry, u: Strain, lam: float, mu: float) -> float:
    """√a(u_h, u_h) [√(J/m)]."""
    return float(np.sqrt(strain_energy(triangles, np.repeat(u.own[:, None], 3, axis=1), lam, mu).sum()))


def stress_of(strain: Array, lam: float | Array, mu: float | Array) -> Array:
    """cε, (…, 3) → (…, 3) [Pa]; moduli one for all, or (…,)."""
    stress = 2.0 * np.asarray(mu)[..., None] * strain
    stress[..., :2] += np.asarray(lam * (strain[..., 0] + strain[..., 1]))[..., None]
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


def element_residual(triangles: ElementGeometry, u: Strain, theta: Array, scene: Scene) -> Array:
    """(t,) (h_K/π)²/(2μ) ‖f + div σ*‖²_K [J/m]."""
    lam, mu, beta = scene.material.lam, scene.material.mu, scene.material.beta
    slope = triangles.gradient(stress_of(u.recovered, lam, mu))
    divergence = np.column_stack([slope[:, 0, 0] + slope[:, 2, 1], slope[:, 2, 0] + slope[:, 1, 1]])
    divergence -= beta * triangles.gradient(theta)
    f = np.stack([values_at(component, triangles.inner_points) for component in scene.f], axis=-1)
    square = np.sum((f + divergence[:, None]) ** 2, axis=(1, 2)) / 3.0 * triangles.area
    return (triangles.diameter / np.pi) ** 2 / (2.0 * mu) * square


def edge_residual(
    triangles: ElementGeometry, u: Strain, theta: Array, scene: Scene, friction: ContactTraction
) -> Array:
    """(t,) Σ_e h_e/(2πμ) (‖r_e‖² + ‖dist(ξ_h, b̂)‖²) over the boundary edges of each triangle [J/m]."""
    mesh, lam, mu, edges = triangles.mesh, scene.material.lam, scene.material.mu, triangles.boundary
    traction = traction_of(on_segments(stress_of(u.recovered, lam, mu), mesh.segments), edges.normal)
    traction -= scene.material.beta * on_segments(theta, mesh.segments)[..., None] * edges.normal[:, None]
    square, roles, curves = friction.defect**2, dict(scene.boundary), mesh.geometry.curves
    for index, curve in enumerate(curves):
        here, role = mesh.segment_curve == index, roles[curve.name]
        free = np.array([component is None and not isinstance(role, Rigid) for component in role.u])
        if not np.any(here):
            continue
        at, axes = edges.at[here], (edges.normal[here], tangent(edges.normal[here]))
        # what σn should be where it is free: g − p n − ξ_h t, what acts on the whole edge, and what springs take
        target = np.stack([values_at(component, at) for component in role.g], axis=-1)
        target = target - values_at(role.pressure, at)[..., None] * axes[0][:, None]
        target = target - friction.xi[here][..., None] * axes[1][:, None]
        if any(role.force):  # also where regions cut the edge
            target = target + np.array(role.force) / sum(c.length for c in curves if c.name == curve.name)
        if any(role.spring):
            moved = on_segments(u.u, mesh.segments[here])
            along = zip(role.spring, axes, strict=True)
            target = target - sum(k * np.einsum("sqd,sd->sq", moved, d)[..., None] * d[:, None] for k, d in along)
        rest = traction[here] - target
        if role.frame == "nt" and not free.all():
            rest = np.stack([np.einsum("sqd,sd->sq", rest, d) for d in axes], axis=-1)
        square[here] += np.sum(rest[..., free] ** 2, axis=-1)
    return triangles.from_segments(edges.length / (2.0 * np.pi * mu) * edges.length * square.mean(axis=1))


def dirichlet_residual(triangles: ElementGeometry, u: Array, scene: Scene) -> Array:
    """(t,) Σ_e 2πμ/h_e ‖u_D − u_h‖²_e over the boundary edges of each triangle; components that are free have no u_D
    [J/m]."""
    mesh, edges, roles = triangles.mesh, triangles.boundary, dict(scene.boundary)
    gap, own = np.zeros_like(edges.at), on_segments(u.reshape(2, -1).T, mesh.segments)
    for index, curve in enumerate(mesh.geometry.curves):
        role, here = roles[curve.name], mesh.segment_curve == index
        if not isinstance(role, Clamped) or not curve.straight:
            continue
        normal = edges.normal[here]
        axes = (
            (normal, tangent(normal)) if role.frame == "nt" else (np.tile(axis, (len(normal), 1)) for axis in np.eye(2))
        )
        for component, direction in zip(role.u, axes, strict=True):
            if component is not None:
                missing = values_at(component, edges.at[here]) - np.einsum("sqd,sd->sq", own[here], direction)
                gap[here] += missing[..., None] * direction[:, None]
    return triangles.from_segments(2.0 * np.pi * scene.material.mu * np.mean(np.sum(gap**2, axis=-1), axis=1))


@dataclass(frozen=True)
class ContactTraction:
    """ξ_h on the boundary segments: linear between contact nodes, zero off Γ_C.

    xi:     (s, 2) ξ_h at the Gauss points [Pa]
    defect: (s, 2) dist(ξ_h, b̂(u_h,T)) there [Pa]
    """

    xi: Array
    defect: Array

    def on(self, segments: NDArray[np.intp]) -> ContactTraction:
        """That of some of the segments."""
        return ContactTraction(self.xi[segments], self.defect[segments])


def contact_traction(
    triangles: ElementGeometry, line: ContactLine, law: Laws | EdgeLaws, u_T: Array, xi: Array, u: Array
) -> ContactTraction:
    """ξ_h between the nodes from u_T (m,) and the tractions ξ_i/c_i (m,); u (2n,) gives u_T of held nodes."""
    mesh, edges, on, segments = triangles.mesh, triangles.boundary, line.which, line.segments
    ends_xi, ends_slip = (line.nodal(x, mesh.n_points, np.nan)[segments] for x in (xi, u_T))
    # A held end has no ξ of its own: its half cell belongs to the other end (method §2).
    ends_xi = np.where(np.isnan(ends_xi), ends_xi[:, ::-1], ends_xi)
    held = np.einsum("ksd,sd->sk", u.reshape(2, -1).T[segments.T], tangent(edges.normal[on]))
    ends_slip = np.where(np.isnan(ends_slip), held, ends_slip)
    traction = np.stack([(1.0 - w) * ends_xi[:, 0] + w * ends_xi[:, 1] for w in GAUSS], axis=1)
    slip = np.stack([ends_slip[:, 0] + w * (ends_slip[:, 1] - ends_slip[:, 0]) for w in GAUSS], axis=1)
    names = [curve.name for curve in mesh.geometry.curves]
    edge = np.array([line.edge_names.index(name) if name in line.edge_names else -1 for name in names])
    at = np.repeat(edge[mesh.segment_curve[on]], 2), edges.at[on].reshape(-1, 2)
    low, high = law_along(law, line.edge_names, *at).interval(slip.ravel())
    result, defect = np.zeros((2, len(mesh.segments), 2))
    result[on] = traction
    off = np.maximum(low.reshape(-1, 2) - traction, traction - high.reshape(-1, 2))
    defect[on] = np.maximum(0.0, off)
    return ContactTraction(result, defect)
