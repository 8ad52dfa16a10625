"""Estimate the error of a P1 displacement in the energy norm, triangle by triangle.

Also here: its strain and stress, and the tractions on edges.

Estimate:   η_K² = ‖σ* − σ_h‖²_{c⁻¹,K} + (h_K/π)²/(2μ) ‖f + div σ*‖²_K + Σ_e h_e/(2πμ) ‖r_e‖²_e with
            the recovered stress σ* (continuous P1) less βθI, and r_e what σ* leaves of the boundary
            condition on the edge e: σ*n − g + k_N u_N n + k_T u_T t on Γ_N, σ*_T + ξ_h on Γ_C, and
            σ*_N − S_N,h where it is not held, the free components on rollers; none on a rigid edge,
            whose tractions balance as a whole
Contact:    + h_e/(2πμ) ‖dist(ξ_h, b̂(u_h,T))‖²_e, since the inclusion (4) holds at the nodes only;
            the same of S_N,h and b̂_N(s_h,N), so that a pressure beside an opening counts
Dirichlet:  + Σ_e 2πμ/h_e ‖u_D − u_h‖²_e, since given displacements hold at the nodes only
Why:        for v and an interpolant Iv, a(u − u_h, v) = ∫(σ* − σ_h):ε(v − Iv) + ∫(f + div σ*)·(v −
            Iv) − Σ_e ∫ r_e·(v − Iv), so that the sum bounds the error up to a constant; the second
            and third term hold the oscillation of f and g, because div σ* is constant on K, and are
            of higher order where u is smooth
Heat:       η_K² = k‖q* − ∇θ_h‖²_K + (h_K/π)²/k ‖qχ_ω + k div q*‖²_K + Σ_e h_e/(πk) ‖k q*·n + α(θ_h
            − θ̄)‖²_e, q* the recovered gradient, α = 0 off Γ_θ
Coupling:   + β²/(λ+μ) ‖θ − θ_h‖²_K with ‖θ − θ_h‖_K ≈ (h_K/π) η_K/√k: temperature loads the body
            through its L² error, one order of h better than its gradient (Aubin–Nitsche, in its
            local form)
Interfaces: recovery stops there, nodes being one for each material (`Pieces`), since σ jumps where
            λ, μ or β do; the traction is continuous: + Σ_e h_e/(2π max μ) ‖[σ*n]‖²_e, half of it to
            either side (the stiffer side bounds v − Iv), and the flux: + β²/(λ+μ) (h_K/π)²/k ·
            h_e/(π max k) ‖[k ∇θ* · n]‖²_e
Literature: Zienkiewicz & Zhu, Int. J. Numer. Methods Eng. 33 (1992) 1331–1364; Carstensen &
            Bartels, Math. Comp. 71 (2002) 945–969 (every averaging is reliable up to oscillation);
            Bartels & Carstensen, Numer. Math. 99 (2004) 225–249 (contact, of one side)
Left out:   the amplification 1/(1 − ω/λ₁) by softening (Céa's constant), what arcs lose as
            polygons, the energy of springs (of higher order); the pollution of θ from re-entrant
            corners; singular ends of interfaces
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.expression import Expression
from tcstudy.fem.forms import ContactLine, edge_arms, values_at
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.fem.openings import OpeningLine
from tcstudy.laws.composed import EdgeLaws, law_along
from tcstudy.laws.laws import Laws
from tcstudy.scene.points import needs_heat_solve
from tcstudy.scene.records import Clamped, Rigid, Role, Scene
from tcstudy.shapes.edges import GAUSS, INNER, TriangleGeometry

Array = NDArray[np.float64]


def own_strain(mesh: TriangleGeometry, u: Array) -> Array:
    """Return the strain (t, 3) of a displacement u (2n,) on triangles: xx, yy, xy."""
    gradient = mesh.gradient(u.reshape(2, -1).T)
    shear = 0.5 * (gradient[:, 0, 1] + gradient[:, 1, 0])
    return np.column_stack([gradient[:, 0, 0], gradient[:, 1, 1], shear])


def strain_energy(mesh: TriangleGeometry, a: Array, lam: Array, mu: Array) -> Array:
    """Return ∫_K a:c a (t,) of a strain that is linear on each triangle K [J/m].

    a: (t, 3, 3) strain by corner and component;  lam, mu: (t,) moduli
    """
    trace = a[..., 0] + a[..., 1]
    components = np.einsum("tkc,tkc->tc", a, a) + a.sum(axis=1) * a.sum(axis=1)
    volume = np.einsum("tk,tk->t", trace, trace) + trace.sum(axis=1) * trace.sum(axis=1)
    shear_part = components @ np.array([1.0, 1.0, 2.0])
    return mesh.area / 12.0 * (lam * volume + 2.0 * mu * shear_part)


def stress_of(strain: Array, lam: Array, mu: Array) -> Array:
    """Return the stress cε (…, 3) of a strain (…, 3) with the moduli (…,) [Pa]."""
    stress: Array = 2.0 * mu[..., None] * strain
    stress[..., :2] += (lam * (strain[..., 0] + strain[..., 1]))[..., None]
    return stress


def traction_of(stress: Array, normal: Array) -> Array:
    """Return σn (s, 2, 2) of stresses (s, 2, 3) at the Gauss points of segments [Pa].

    normal: (s, 2) of the segments
    """
    n_x = normal[:, None, 0]
    n_y = normal[:, None, 1]
    xx, yy, xy = np.moveaxis(stress, -1, 0)
    return np.stack([xx * n_x + xy * n_y, xy * n_x + yy * n_y], axis=-1)


def tangent(normal: Array) -> Array:
    """Return the tangents t = (−n₂, n₁) of normals (s, 2)."""
    return np.column_stack([-normal[:, 1], normal[:, 0]])


def on_segments(nodal: Array, segments: NDArray[np.intp]) -> Array:
    """Return P1 functions (s, 2, …) at the Gauss points of segments from nodal values (n, …)."""
    first = nodal[segments[:, 0]]
    second = nodal[segments[:, 1]]
    return np.stack([(1.0 - w) * first + w * second for w in GAUSS], axis=1)


def acting(mesh: PlaneMesh, name: str, role: Role, points: Array, normal: Array) -> Array:
    """Return the traction (s, 2, 2) on an edge, resultant and moment included, at points [Pa].

    points: (s, 2, 2) Gauss points of the segments of the edge;  normal: (s, 2) of the segments
    """
    traction = role.traction(normal[:, None], lambda value: values_at(value, points))
    length = sum(curve.length for curve in mesh.geometry.curves if curve.name == name)
    traction = traction + np.array(role.force) / length
    if role.moment:
        lengths = mesh.boundary.length[mesh.on(name)]
        nodes, _, arms = edge_arms(mesh, name)
        middle = mesh.points[nodes[0]] - arms[0]
        arm = points - middle
        turned = np.stack([-arm[..., 1], arm[..., 0]], axis=-1)
        inertia = np.einsum("s,sgd,sgd->", 0.5 * lengths, arm, arm)
        traction = traction + role.moment * turned / inertia
    return traction


ContactTraction = tuple[Array, Array]
"""(s, 2) ξ_h at the Gauss points of the boundary segments, linear between contact nodes and zero
off Γ_C, and dist(ξ_h, b̂(u_h,T)) there [Pa]."""


def contact_traction(
    mesh: PlaneMesh, line: ContactLine, law: Laws | EdgeLaws, u_T: Array, xi: Array, u: Array
) -> ContactTraction:
    """Return ξ_h between the nodes, and its distance from the law.

    u_T: (m,) slips;  xi: (m,) tractions ξ_i/c_i;  u: (2n,), which gives u_T of held nodes
    """
    on_line = line.which
    segments = line.segments
    end_xi = line.nodal(xi, mesh.n_points, np.nan)[segments]
    end_slips = line.nodal(u_T, mesh.n_points, np.nan)[segments]
    end_u = u.reshape(2, -1).T[segments.T]
    held_slips = np.einsum("ksd,sd->sk", end_u, tangent(mesh.boundary.normal[on_line]))
    end_slips = np.where(np.isnan(end_slips), held_slips, end_slips)
    law_of_edge = partial(law_along, law, line.edge_names)
    return _between_nodes(mesh, on_line, line.segment_edge, law_of_edge, end_slips, end_xi)


def opening_traction(
    mesh: PlaneMesh,
    lines: tuple[ContactLine, OpeningLine],
    law: Laws | EdgeLaws,
    s_N: Array,
    S_N: Array,
    u: Array,
) -> ContactTraction:
    """Return S_N of edges that may lift off, as `contact_traction` does ξ_h.

    lines: the contact line and its openings
    s_N, S_N: (k,) openings and their tractions;  u: (2n,), which gives s_N of held nodes
    """
    line, opening = lines
    on_line = line.which[opening.which]
    segments = line.segments[opening.which]
    is_held = opening.unknowns < 0
    end_S_N = np.where(is_held, np.nan, S_N[opening.unknowns])
    end_u = u.reshape(2, -1).T[segments.T]
    held_s_N = -np.einsum("ksd,sd->sk", end_u, mesh.boundary.normal[on_line])
    end_s_N = np.where(is_held, held_s_N, s_N[opening.unknowns])
    law_of_edge = partial(law_along, law, line.edge_names)
    edge = line.segment_edge[opening.which]
    return _between_nodes(mesh, on_line, edge, law_of_edge, end_s_N, end_S_N)


def _between_nodes(
    mesh: PlaneMesh,
    on_line: NDArray[np.intp],
    edge: NDArray[np.integer],
    law_of_edge: Callable[[NDArray[np.integer], Array], Laws],
    end_slips: Array,
    end_xi: Array,
) -> ContactTraction:
    """Return tractions at the Gauss points of all segments, and their distance from the law.

    on_line, edge:     (s,) segments of the boundary, and the contact edges they are on
    end_slips, end_xi: (s, 2) displacement and traction at their ends, NaN for a traction where held
    """
    # A held end has no ξ of its own: its half cell belongs to the other end (method §2).
    end_xi = np.where(np.isnan(end_xi), end_xi[:, ::-1], end_xi)
    first_xi, second_xi = end_xi.T
    traction = np.stack([(1.0 - w) * first_xi + w * second_xi for w in GAUSS], axis=1)
    change = end_slips[:, 1] - end_slips[:, 0]
    slip = np.stack([end_slips[:, 0] + w * change for w in GAUSS], axis=1)
    points = mesh.boundary.at[on_line].reshape(-1, 2)
    low, high = law_of_edge(np.repeat(edge, 2), points).interval(slip.ravel())
    xi_h, distance = np.zeros((2, len(mesh.segments), 2))
    xi_h[on_line] = traction
    outside = np.maximum(low.reshape(-1, 2) - traction, traction - high.reshape(-1, 2))
    distance[on_line] = np.maximum(0.0, outside)
    return xi_h, distance


Indices = NDArray[np.intp]


@dataclass(frozen=True)
class Pieces:
    """The mesh of a body with one node for each material that meets at a place.

    mesh:      with the triangles of the whole mesh, in their order
    node:      (n',) nodes of the whole mesh
    piece:     (n',) number of the scene's piece that a node belongs to
    interface: (2, e, 2) nodes on both sides of the edges between pieces, and (2, e) the triangles
               there
    """

    mesh: PlaneMesh
    node: Indices
    piece: Indices
    interface: tuple[Indices, Indices]


def pieces_of(mesh: PlaneMesh, scene: Scene) -> Pieces:
    """Return the pieces of a mesh by material, which all scenes of a study share."""
    n = mesh.n_points
    piece = np.zeros(len(mesh.triangles), dtype=np.intp)
    for number, (where, _) in enumerate(scene.pieces):
        piece[mesh.inside(where)] = number
    node_keys = piece[:, None] * n + mesh.triangles
    keys, corners = np.unique(node_keys, return_inverse=True)
    segments = np.searchsorted(keys, piece[mesh.owner][:, None] * n + mesh.segments)
    split = mesh
    if len(scene.pieces) > 1:
        triangles = corners.reshape(-1, 3)
        split = replace(mesh, points=mesh.points[keys % n], triangles=triangles, segments=segments)
    twin = mesh.sides_at(mesh.sides[:, ::-1])
    triangle = np.arange(len(twin)) // 3
    first = np.flatnonzero((twin >= 0) & (piece[triangle] < piece[twin // 3]))
    ends = np.stack([split.sides[first], split.sides[twin[first], ::-1]])
    triangles_beside = np.stack([first, twin[first]]) // 3
    return Pieces(split, keys % n, keys // n, (ends, triangles_beside))


def energy_squares(
    pieces: Pieces,
    u: Array,
    theta: Array,
    scene: Scene,
    friction: ContactTraction,
    adhesion: ContactTraction | None = None,
) -> tuple[Array, float]:
    """Return η_K² (t,) of the energy norm [J/m] and ‖u_h‖ [√(J/m)].

    u: (2n,) displacement;  theta: (n,) temperature, both on the whole mesh
    friction, adhesion: ξ_h, and S_N,h where an edge may lift off
    """
    mesh = pieces.mesh
    u = u.reshape(2, -1)[:, pieces.node].ravel()
    theta = theta[pieces.node]
    lam = mesh.of_material(scene, "lam")
    mu = mesh.of_material(scene, "mu")
    strain = own_strain(mesh, u)
    recovered = mesh.recovery @ strain
    sigma = _recovered_stress(pieces, recovered, theta, scene)
    squares = strain_energy(mesh, recovered[mesh.triangles] - strain[:, None], lam, mu)
    slope = mesh.gradient(sigma)
    x_divergence = slope[:, 0, 0] + slope[:, 2, 1]
    y_divergence = slope[:, 2, 0] + slope[:, 1, 1]
    divergence = np.column_stack([x_divergence, y_divergence])
    f = np.stack([values_at(component, mesh.inner_points) for component in scene.f], axis=-1)
    residual = f + divergence[:, None]
    residual_square = np.sum(residual**2, axis=(1, 2)) / 3.0 * mesh.area
    squares += (mesh.diameter / np.pi) ** 2 / (2.0 * mu) * residual_square
    squares += edge_residual(mesh, u, sigma, scene, friction, adhesion)
    squares += _jumps(pieces, sigma, theta, scene)
    if scene.material.expands:
        squares += coupling(mesh, theta, scene)
    constant_strain = np.repeat(strain[:, None], 3, axis=1)
    energy = strain_energy(mesh, constant_strain, lam, mu).sum()
    return squares, float(np.sqrt(energy))


def _recovered_stress(pieces: Pieces, strain: Array, theta: Array, scene: Scene) -> Array:
    """Return σ* (n', 3) at the nodes of pieces from the recovered strain (n', 3) and θ (n',)."""

    def at_nodes(name: str) -> Array:
        moduli = np.array([getattr(material, name) for _, material in scene.pieces])
        return np.asarray(moduli[pieces.piece])

    stress = stress_of(strain, at_nodes("lam"), at_nodes("mu"))
    return stress - (at_nodes("beta") * theta)[:, None] * [1.0, 1.0, 0.0]


def edge_residual(
    mesh: PlaneMesh,
    u: Array,
    sigma: Array,
    scene: Scene,
    friction: ContactTraction,
    adhesion: ContactTraction | None = None,
) -> Array:
    """Return the boundary terms of η_K² (t,), summed over the edges of each triangle [J/m]:

    Σ_e h_e/(2πμ) (‖r_e‖² + ‖dist(ξ_h, b̂)‖²) + 2πμ/h_e ‖u_D − u_h‖²_e,
    with r_e for the free components of an edge and u_D for the given ones; likewise of openings.

    u: (2n,) displacement;  sigma: (n, 3) σ* at the nodes
    """
    edges = mesh.boundary
    roles = dict(scene.boundary)
    xi, distance = friction
    traction = traction_of(on_segments(sigma, mesh.segments), edges.normal)
    displacement = on_segments(u.reshape(2, -1).T, mesh.segments)
    square = distance**2
    S_N = np.zeros_like(xi)
    if adhesion is not None:
        S_N, distance_N = adhesion
        square += distance_N**2
    gap = np.zeros_like(xi)

    def component(vectors: Array, directions: Array) -> Array:
        return np.asarray(np.einsum("sqd,sd->sq", vectors, directions))

    for index, curve in enumerate(mesh.geometry.curves):
        on_curve = mesh.segment_curve == index
        role = roles[curve.name]
        points = edges.at[on_curve]
        normal = edges.normal[on_curve]
        axes = normal, tangent(normal)
        # what σn should be where it is free: the load, S_N,h n − ξ_h t, and the force of springs
        unmoved = replace(role, moment=None) if role.moment else role
        target = acting(mesh, curve.name, unmoved, points, normal)
        target = target - xi[on_curve][..., None] * axes[1][:, None]
        if adhesion is not None:
            target = target + S_N[on_curve][..., None] * normal[:, None]
        for k, axis in zip(role.spring, axes, strict=True):
            target = target - k * component(displacement[on_curve], axis)[..., None] * axis[:, None]
        if role.frame != "nt":
            x_axis = np.tile([1.0, 0.0], (len(points), 1))
            y_axis = np.tile([0.0, 1.0], (len(points), 1))
            axes = x_axis, y_axis
        for prescribed, axis in zip(role.u, axes, strict=True):
            if prescribed is None and not isinstance(role, Rigid):
                square[on_curve] += component(traction[on_curve] - target, axis) ** 2
            elif isinstance(role, Clamped) and prescribed is not None and curve.straight:
                gap[on_curve] += (
                    values_at(prescribed, points) - component(displacement[on_curve], axis)
                ) ** 2
    mu = mesh.of_material(scene, "mu")[mesh.owner]
    free_terms = edges.length**2 / (2.0 * np.pi * mu) * square.mean(axis=1)
    held_terms = 2.0 * np.pi * mu * gap.mean(axis=1)
    return mesh.from_segments(free_terms + held_terms)


def heat_estimate(mesh: PlaneMesh, theta: Array, scene: Scene) -> Array:
    """Return η_K² (t,) of a computed temperature (n,) [W K/m], 0 where nothing conducts."""
    k = mesh.of_material(scene, "k")
    edges = mesh.boundary
    gradient = mesh.gradient(theta)
    recovered = mesh.recovery @ gradient
    excess = recovered[mesh.triangles] - gradient[:, None]
    squares = np.einsum("tkd,tkd->t", excess, excess) + np.einsum("tkd,tjd->t", excess, excess)

    slope = mesh.gradient(recovered)
    q = values_at(scene.heat.q, mesh.inner_points)
    if scene.heat.omega:
        q = q * mesh.inside(scene.heat.omega)[:, None]
    divergence = k * (slope[:, 0, 0] + slope[:, 1, 1])
    residual = np.mean((q + divergence[:, None]) ** 2, axis=1) * mesh.area

    k_e = k[mesh.owner]
    edge_gradient = on_segments(recovered, mesh.segments)
    flux = k_e[:, None] * np.einsum("sqd,sd->sq", edge_gradient, edges.normal)
    edge_theta = on_segments(theta, mesh.segments)
    for name, alpha, theta_bar in scene.exchange:
        on = mesh.on(name)
        flux[on] += alpha * (edge_theta[on] - values_at(theta_bar, edges.at[on]))
    for name, heat_flux in scene.flux:
        on = mesh.on(name)
        flux[on] -= values_at(heat_flux, edges.at[on])
    for name, _ in scene.held_theta:
        flux[mesh.on(name)] = 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        inside = k * mesh.area / 12.0 * squares + (mesh.diameter / np.pi) ** 2 / k * residual
        edge = edges.length**2 / (np.pi * k_e) * np.mean(flux**2, axis=1)
    inside = np.where(k > 0.0, inside, 0.0)
    edge = np.where(k_e > 0.0, edge, 0.0)
    return inside + mesh.from_segments(edge)


def coupling(mesh: PlaneMesh, theta: Array, scene: Scene) -> Array:
    """Return β²/(λ+μ) ‖θ − θ_h‖²_K (t,), the error of θ that enters the displacement [J/m]."""
    lam, mu, beta, k = (mesh.of_material(scene, name) for name in ("lam", "mu", "beta", "k"))
    factor = beta**2 / (lam + mu)
    if needs_heat_solve(scene):
        weight = factor * (mesh.diameter / np.pi) ** 2 / np.where(k > 0.0, k, 1.0)
        return weight * heat_estimate(mesh, theta, scene)
    if not isinstance(scene.heat.theta, Expression):
        return np.zeros(len(mesh.area))
    exact = values_at(scene.heat.theta, mesh.inner_points)
    difference = exact - theta[mesh.triangles] @ INNER.T
    return factor * mesh.area * np.mean(difference**2, axis=1)


def _jumps(pieces: Pieces, sigma: Array, theta: Array, scene: Scene) -> Array:
    """Return the terms of interfaces (t,) of stresses (n', 3) and temperatures (n',) at nodes."""
    mesh = pieces.mesh
    ends, triangles = pieces.interface
    squares = np.zeros(len(mesh.area))
    if not triangles.size:
        return squares
    lam = mesh.of_material(scene, "lam")[triangles]
    mu = mesh.of_material(scene, "mu")[triangles]
    beta = mesh.of_material(scene, "beta")[triangles]
    k = mesh.of_material(scene, "k")[triangles]
    along = mesh.points[ends[0, :, 1]] - mesh.points[ends[0, :, 0]]
    length = np.linalg.norm(along, axis=1)
    normal = np.column_stack([along[:, 1], -along[:, 0]]) / length[:, None]
    traction = traction_of(on_segments(sigma, ends[0]) - on_segments(sigma, ends[1]), normal)
    mean_square = np.mean(np.sum(traction**2, -1), 1)
    term = 0.5 * length**2 / (2.0 * np.pi * mu.max(axis=0)) * mean_square
    both_sides = np.stack([term, term])
    if needs_heat_solve(scene):
        gradient = mesh.recovery @ mesh.gradient(theta)
        flux_first = k[0][:, None, None] * on_segments(gradient, ends[0])
        flux_second = k[1][:, None, None] * on_segments(gradient, ends[1])
        jump = np.sum((flux_first - flux_second) * normal[:, None], axis=-1)
        mean_square = np.mean(jump**2, axis=1)
        term = 0.5 * length**2 / (np.pi * k.max(axis=0)) * mean_square
        coupled = beta**2 / (lam + mu) / np.where(k > 0.0, k, 1.0)
        both_sides += coupled * (length / np.pi) ** 2 * term
    np.add.at(squares, triangles, both_sides)
    return squares
