"""Error of a P1 displacement in the energy norm, triangle by triangle; its strain and stress,
tractions on edges.

Estimate:   η_K² = ‖σ* − σ_h‖²_{c⁻¹,K} + (h_K/π)²/(2μ) ‖f + div σ*‖²_K + Σ_e h_e/(2πμ) ‖r_e‖²_e
            σ* recovered stress (continuous P1) less βθI, r_e = what σ* leaves of the boundary
            condition on the edge e:
            σ*n − g + k_N u_N n + k_T u_T t on Γ_N, σ*_T + ξ_h on Γ_C, the free components on
            rollers; none on a rigid
            edge, whose tractions balance as a whole
Contact:    + h_e/(2πμ) ‖dist(ξ_h, b̂(u_h,T))‖²_e, since the inclusion (4) holds at the nodes only
Dirichlet:  + Σ_e 2πμ/h_e ‖u_D − u_h‖²_e, since given displacements hold at the nodes only
Why:        for v and an interpolant Iv, a(u − u_h, v) = ∫(σ* − σ_h):ε(v − Iv) + ∫(f + div σ*)·(v − Iv)
            − Σ_e ∫ r_e·(v − Iv), so that the sum bounds the error up to a constant; the second and
            third term hold the
            oscillation of f and g, because div σ* is constant on K, and are of higher order where u
            is smooth
Heat:       η_K² = k‖q* − ∇θ_h‖²_K + (h_K/π)²/k ‖qχ_ω + k div q*‖²_K + Σ_e h_e/(πk) ‖k q*·n + α(θ_h − θ̄)‖²_e,
            q* the recovered gradient, α = 0 off Γ_θ
Coupling:   + β²/(λ+μ) ‖θ − θ_h‖²_K with ‖θ − θ_h‖_K ≈ (h_K/π) η_K/√k: temperature loads the body through its L² error,
            one order of h better than its gradient (Aubin–Nitsche, in its local form)
Interfaces: recovery stops there, nodes being one for each material (`Pieces`), since σ jumps where
λ, μ or β do; the
            traction is continuous: + Σ_e h_e/(2π max μ) ‖[σ*n]‖²_e, half of it to either side (the
            stiffer side bounds
            v − Iv), and the flux: + β²/(λ+μ) (h_K/π)²/k · h_e/(π max k) ‖[k ∇θ* · n]‖²_e
Literature: Zienkiewicz & Zhu, Int. J. Numer. Methods Eng. 33 (1992) 1331–1364; Carstensen &
Bartels, Math. Comp. 71
            (2002) 945–969 (every averaging is reliable up to oscillation); Bartels & Carstensen,
            Numer. Math. 99
            (2004) 225–249 (contact)
Left out:   the amplification 1/(1 − ω/λ₁) by softening (Céa's constant), what arcs lose as polygons, the energy of
            springs (of higher order); the pollution of θ from re-entrant corners; singular ends of
            interfaces
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.expression import Expression
from tcstudy.fem.forms import ContactLine, edge_arms, values_at
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.laws.composed import EdgeLaws, law_along
from tcstudy.laws.laws import Laws
from tcstudy.scene.points import needs_heat_solve
from tcstudy.scene.records import Clamped, Rigid, Role, Scene
from tcstudy.shapes.edges import GAUSS, INNER, TriangleGeometry

Array = NDArray[np.float64]


def own_strain(mesh: TriangleGeometry, u: Array) -> Array:
    """(t, 3) strain of a displacement u (2n,) on triangles."""
    gradient = mesh.gradient(u.reshape(2, -1).T)
    shear = 0.5 * (gradient[:, 0, 1] + gradient[:, 1, 0])
    return np.column_stack([gradient[:, 0, 0], gradient[:, 1, 1], shear])


def strain_energy(mesh: TriangleGeometry, a: Array, lam: Array, mu: Array) -> Array:
    """(t,) ∫_K a:c a of a strain that is linear on K and given at its corners (t, 3, 3) [J/m];
    moduli (t,)."""
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
    """σn at the Gauss points of segments (s, 2, 2) of stresses (s, 2, 3) there, normals (s, 2)
    [Pa]."""
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
    """(s, 2, 2) g − p n of an edge, and what its resultant and its moment spread over it, at points
    (s, 2, 2) [Pa]."""
    found = role.traction(normal[:, None], lambda value: values_at(value, at))
    found = found + np.array(role.force) / sum(
        curve.length for curve in mesh.geometry.curves if curve.name == name
    )
    if role.moment:
        length, (nodes, _, arms) = mesh.boundary.length[mesh.on(name)], edge_arms(mesh, name)
        arm = at - (mesh.points[nodes[0]] - arms[0])
        turn = np.stack([-arm[..., 1], arm[..., 0]], axis=-1)
        found = found + role.moment * turn / np.einsum("s,sgd,sgd->", 0.5 * length, arm, arm)
    return found


ContactTraction = tuple[Array, Array]
"""(s, 2) ξ_h at the Gauss points of the boundary segments, linear between contact nodes and zero
off Γ_C, and dist(ξ_h, b̂(u_h,T)) there [Pa]."""


def contact_traction(
    mesh: PlaneMesh, line: ContactLine, law: Laws | EdgeLaws, u_T: Array, xi: Array, u: Array
) -> ContactTraction:
    """ξ_h between the nodes from u_T (m,) and the tractions ξ_i/c_i (m,); u (2n,) gives u_T of held
    nodes."""
    edges, on, segments = mesh.boundary, line.which, line.segments
    ends_xi, ends_slip = (line.nodal(x, mesh.n_points, np.nan)[segments] for x in (xi, u_T))
    # A held end has no ξ of its own: its half cell belongs to the other end (method §2).
    ends_xi = np.where(np.isnan(ends_xi), ends_xi[:, ::-1], ends_xi)
    held = np.einsum("ksd,sd->sk", u.reshape(2, -1).T[segments.T], tangent(edges.normal[on]))
    ends_slip = np.where(np.isnan(ends_slip), held, ends_slip)
    traction = np.stack([(1.0 - w) * ends_xi[:, 0] + w * ends_xi[:, 1] for w in GAUSS], axis=1)
    slip = np.stack(
        [ends_slip[:, 0] + w * (ends_slip[:, 1] - ends_slip[:, 0]) for w in GAUSS], axis=1
    )
    at = np.repeat(line.segment_edge, 2), edges.at[on].reshape(-1, 2)
    low, high = law_along(law, line.edge_names, *at).interval(slip.ravel())
    result, defect = np.zeros((2, len(mesh.segments), 2))
    result[on] = traction
    off = np.maximum(low.reshape(-1, 2) - traction, traction - high.reshape(-1, 2))
    defect[on] = np.maximum(0.0, off)
    return result, defect


Indices = NDArray[np.intp]


@dataclass(frozen=True)
class Pieces:
    """The mesh of a body whose nodes on interfaces are one for each material that meets there.

    mesh:      its triangles are those of the whole mesh, in their order;  node: (n',) which of its nodes
    piece:     (n',) number of the scene's piece that a node belongs to
    interface: (2, e, 2) nodes on both sides of the edges between pieces, and (2, e) the triangles there
    """

    mesh: PlaneMesh
    node: Indices
    piece: Indices
    interface: tuple[Indices, Indices]


def pieces_of(mesh: PlaneMesh, scene: Scene) -> Pieces:
    """The same for all scenes of a study."""
    n = mesh.n_points
    of = np.zeros(len(mesh.triangles), dtype=np.intp)
    for number, (where, _) in enumerate(scene.pieces):
        of[mesh.inside(where)] = number
    keys, corners = np.unique(of[:, None] * n + mesh.triangles, return_inverse=True)
    segments = np.searchsorted(keys, of[mesh.owner][:, None] * n + mesh.segments)
    split = mesh
    if len(scene.pieces) > 1:
        split = replace(
            mesh, points=mesh.points[keys % n], triangles=corners.reshape(-1, 3), segments=segments
        )
    twin = mesh.sides_at(mesh.sides[:, ::-1])
    first = np.flatnonzero((twin >= 0) & (of[np.arange(len(twin)) // 3] < of[twin // 3]))
    ends = np.stack([split.sides[first], split.sides[twin[first], ::-1]])
    return Pieces(split, keys % n, keys // n, (ends, np.stack([first, twin[first]]) // 3))


def energy_squares(
    pieces: Pieces, u: Array, theta: Array, scene: Scene, friction: ContactTraction
) -> tuple[Array, float]:
    """(t,) η_K² of the energy norm [J/m] and ‖u_h‖ [√(J/m)] of a displacement u (2n,) at a
    temperature θ (n,)."""
    mesh = pieces.mesh
    u, theta = u.reshape(2, -1)[:, pieces.node].ravel(), theta[pieces.node]
    lam, mu = (mesh.of_material(scene, name) for name in ("lam", "mu"))
    own = own_strain(mesh, u)
    recovered = mesh.recovery @ own
    at_nodes = (
        np.array([getattr(m, name) for _, m in scene.pieces])[pieces.piece]
        for name in ("lam", "mu", "beta")
    )
    lam_n, mu_n, beta_n = at_nodes
    sigma = stress_of(recovered, lam_n, mu_n) - (beta_n * theta)[:, None] * [1.0, 1.0, 0.0]
    squares = strain_energy(mesh, recovered[mesh.triangles] - own[:, None], lam, mu)
    slope = mesh.gradient(sigma)
    divergence = np.column_stack([slope[:, 0, 0] + slope[:, 2, 1], slope[:, 2, 0] + slope[:, 1, 1]])
    f = np.stack([values_at(component, mesh.inner_points) for component in scene.f], axis=-1)
    residual = np.sum((f + divergence[:, None]) ** 2, axis=(1, 2)) / 3.0 * mesh.area
    squares += (mesh.diameter / np.pi) ** 2 / (2.0 * mu) * residual
    squares += edge_residual(mesh, u, sigma, scene, friction)
    squares += _jumps(pieces, sigma, theta, scene)
    if scene.material.expands:
        squares += coupling(mesh, theta, scene)
    norm = strain_energy(mesh, np.repeat(own[:, None], 3, axis=1), lam, mu).sum()
    return squares, float(np.sqrt(norm))


def edge_residual(
    mesh: PlaneMesh, u: Array, sigma: Array, scene: Scene, friction: ContactTraction
) -> Array:
    """(t,) Σ_e h_e/(2πμ) (‖r_e‖² + ‖dist(ξ_h, b̂)‖²) + 2πμ/h_e ‖u_D − u_h‖²_e over the boundary
    edges of each triangle [J/m]; a component has r_e where it is free, u_D where it is given.

    u: (2n,) the displacement;  sigma: (n, 3) σ* at the nodes
    """
    edges, curves, roles, (xi, defect) = (
        mesh.boundary,
        mesh.geometry.curves,
        dict(scene.boundary),
        friction,
    )
    traction = traction_of(on_segments(sigma, mesh.segments), edges.normal)
    moved, square, gap = (
        on_segments(u.reshape(2, -1).T, mesh.segments),
        defect**2,
        np.zeros_like(xi),
    )
    for index, curve in enumerate(curves):
        here, role = mesh.segment_curve == index, roles[curve.name]
        at, axes = edges.at[here], (edges.normal[here], tangent(edges.normal[here]))
        # what σn should be where it is free: what acts on the edge, −ξ_h t, and what springs take
        target = acting(
            mesh, curve.name, replace(role, moment=None) if role.moment else role, at, axes[0]
        )
        target = target - xi[here][..., None] * axes[1][:, None]
        for k, d in zip(role.spring, axes, strict=True):
            target = target - k * np.einsum("sqd,sd->sq", moved[here], d)[..., None] * d[:, None]
        if role.frame != "nt":
            axes = np.tile([1.0, 0.0], (len(at), 1)), np.tile([0.0, 1.0], (len(at), 1))
        for given, d in zip(role.u, axes, strict=True):
            if given is None and not isinstance(role, Rigid):
                square[here] += np.einsum("sqd,sd->sq", traction[here] - target, d) ** 2
            elif isinstance(role, Clamped) and given is not None and curve.straight:
                gap[here] += (values_at(given, at) - np.einsum("sqd,sd->sq", moved[here], d)) ** 2
    mu = mesh.of_material(scene, "mu")[mesh.owner]
    terms = edges.length**2 / (2.0 * np.pi * mu) * square.mean(
        axis=1
    ) + 2.0 * np.pi * mu * gap.mean(axis=1)
    return mesh.from_segments(terms)


def heat_estimate(mesh: PlaneMesh, theta: Array, scene: Scene) -> Array:
    """(t,) η_K² of a temperature (n,) that was solved for [W K/m], 0 where nothing conducts."""
    k, edges = mesh.of_material(scene, "k"), mesh.boundary
    own = mesh.gradient(theta)
    recovered = mesh.recovery @ own
    excess = recovered[mesh.triangles] - own[:, None]
    squares = np.einsum("tkd,tkd->t", excess, excess) + np.einsum("tkd,tjd->t", excess, excess)

    slope = mesh.gradient(recovered)
    q = values_at(scene.heat.q, mesh.inner_points)
    if scene.heat.omega:
        q = q * mesh.inside(scene.heat.omega)[:, None]
    rest = np.mean((q + (k * (slope[:, 0, 0] + slope[:, 1, 1]))[:, None]) ** 2, axis=1) * mesh.area

    k_e = k[mesh.owner]
    flux = k_e[:, None] * np.einsum(
        "sqd,sd->sq", on_segments(recovered, mesh.segments), edges.normal
    )
    for name, alpha, theta_bar in scene.exchange:
        robin = mesh.on(name)
        flux[robin] += alpha * (
            on_segments(theta, mesh.segments)[robin] - values_at(theta_bar, edges.at[robin])
        )
    for name, into in scene.flux:
        flux[mesh.on(name)] -= values_at(into, edges.at[mesh.on(name)])
    for name, _ in scene.held_theta:
        flux[mesh.on(name)] = 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        inside = k * mesh.area / 12.0 * squares + (mesh.diameter / np.pi) ** 2 / k * rest
        edge = edges.length**2 / (np.pi * k_e) * np.mean(flux**2, axis=1)
    return np.where(k > 0.0, inside, 0.0) + mesh.from_segments(np.where(k_e > 0.0, edge, 0.0))


def coupling(mesh: PlaneMesh, theta: Array, scene: Scene) -> Array:
    """(t,) β²/(λ+μ) ‖θ − θ_h‖²_K, the error that a temperature, computed or known, puts into the
    displacement [J/m]."""
    lam, mu, beta, k = (mesh.of_material(scene, name) for name in ("lam", "mu", "beta", "k"))
    factor = beta**2 / (lam + mu)
    if needs_heat_solve(scene):
        own = factor * (mesh.diameter / np.pi) ** 2 / np.where(k > 0.0, k, 1.0)
        return own * heat_estimate(mesh, theta, scene)
    if not isinstance(scene.heat.theta, Expression):
        return np.zeros(len(mesh.area))
    exact = values_at(scene.heat.theta, mesh.inner_points)
    return factor * mesh.area * np.mean((exact - theta[mesh.triangles] @ INNER.T) ** 2, axis=1)


def _jumps(pieces: Pieces, sigma: Array, theta: Array, scene: Scene) -> Array:
    """(t,) the terms of interfaces, of stresses (n', 3) and temperatures (n',) at the nodes."""
    mesh, (ends, at) = pieces.mesh, pieces.interface
    found = np.zeros(len(mesh.area))
    if not at.size:
        return found
    lam, mu, beta, k = (mesh.of_material(scene, name)[at] for name in ("lam", "mu", "beta", "k"))
    along = mesh.points[ends[0, :, 1]] - mesh.points[ends[0, :, 0]]
    length = np.linalg.norm(along, axis=1)
    normal = np.column_stack([along[:, 1], -along[:, 0]]) / length[:, None]
    traction = traction_of(on_segments(sigma, ends[0]) - on_segments(sigma, ends[1]), normal)
    term = 0.5 * length**2 / (2.0 * np.pi * mu.max(axis=0)) * np.mean(np.sum(traction**2, -1), 1)
    both = np.stack([term, term])
    if needs_heat_solve(scene):
        gradient = mesh.recovery @ mesh.gradient(theta)
        flows = (
            k_i[:, None, None] * on_segments(gradient, side)
            for k_i, side in zip(k, ends, strict=True)
        )
        heat = np.sum(np.subtract(*flows) * normal[:, None], axis=-1)
        term = 0.5 * length**2 / (np.pi * k.max(axis=0)) * np.mean(heat**2, axis=1)
        both += beta**2 / (lam + mu) / np.where(k > 0.0, k, 1.0) * (length / np.pi) ** 2 * term
    np.add.at(found, at, both)
    return found
