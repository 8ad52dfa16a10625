"""Error of a displacement in the energy norm, all parts together: stress, temperature, and where materials differ.

Temperature, triangle by triangle, and what its error does to the displacement:
Estimate:   η_K² = k‖q* − ∇θ_h‖²_K + (h_K/π)²/k ‖qχ_ω + k div q*‖²_K + Σ_e h_e/(πk) ‖k q*·n + α(θ_h − θ̄)‖²_e,
            q* the recovered gradient, α = 0 off Γ_θ; as for the stress in estimators.py
Coupling:   ‖θ − θ_h‖_K ≈ (h_K/π) η_K/√k: temperature loads the body through its L² error, one order of h better than
            its gradient (Aubin–Nitsche, in its local form)
Left out:   pollution: at a re-entrant corner the L² error is larger than its local part

Materials that differ by region: recovery stops at interfaces, where tractions must agree.
Within each region: η_K² of `tcstudy.fem.estimators`, with the stress σ* recovered from its own triangles alone, since
            σ jumps along an interface where λ, μ or β do
Interface:  + Σ_e h_e/(2π max μ) ‖[σ*n − βθn]‖²_e, half of it to either side: only the traction is continuous there. The
            stiffer side bounds v − Iv on e, hence its μ
Heat:       + β²/(λ+μ) (h_K/π)²/k · h_e/(π max k) ‖[k ∇θ* · n]‖²_e, as the temperature's error loads the body
Left out:   singular ends of interfaces and corners of regions, beyond what refinement there leaves
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.expression import Expression
from tcstudy.fem.boundary import values_at
from tcstudy.fem.estimators import (
    ContactTraction,
    dirichlet_residual,
    edge_residual,
    element_residual,
    energy_norm,
    on_segments,
    strain,
    strain_energy,
    stress_of,
    traction_of,
)
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.fem.recovery import GAUSS, ElementGeometry
from tcstudy.scene.points import needs_heat_solve
from tcstudy.scene.records import Material, Scene

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def heat_estimate(triangles: ElementGeometry, theta: Array, scene: Scene) -> Array:
    """(t,) η_K² of a temperature (n,) that was solved for [W K/m]."""
    k, mesh, edges = scene.material.k, triangles.mesh, triangles.boundary
    assert k is not None
    own = triangles.gradient(theta)
    recovered = triangles.recovery @ own
    excess = recovered[mesh.triangles] - own[:, None]
    squares = np.einsum("tkd,tkd->t", excess, excess) + np.einsum("tkd,tjd->t", excess, excess)

    slope = triangles.gradient(recovered)
    q = values_at(scene.heat.q, triangles.inner_points)
    if scene.heat.omega:
        q = q * triangles.inside(scene.heat.omega)[:, None]
    rest = np.mean((q + k * (slope[:, 0, 0] + slope[:, 1, 1])[:, None]) ** 2, axis=1) * triangles.area

    flux = k * np.einsum("sqd,sd->sq", on_segments(recovered, mesh.segments), edges.normal)
    for name, alpha, theta_bar in scene.exchange:
        robin = mesh.on(name)
        flux[robin] += alpha * (on_segments(theta, mesh.segments)[robin] - values_at(theta_bar, edges.at[robin]))
    for name, into in scene.flux:
        flux[mesh.on(name)] -= values_at(into, edges.at[mesh.on(name)])
    for name, _ in scene.held_theta:
        flux[mesh.on(name)] = 0.0
    return (
        k * triangles.area / 12.0 * squares
        + (triangles.diameter / np.pi) ** 2 / k * rest
        + triangles.from_segments(edges.length**2 / (np.pi * k) * np.mean(flux**2, axis=1))
    )


def coupling(triangles: ElementGeometry, theta: Array, scene: Scene) -> Array:
    """(t,) β²/(λ+μ) ‖θ − θ_h‖²_K, the error that temperature puts into the displacement [J/m].

    θ comes from the heat problem, or it is known, and θ_h is its interpolant.
    """
    material = scene.material
    factor = material.beta**2 / (material.lam + material.mu)
    if needs_heat_solve(scene):
        assert material.k is not None
        return factor * (triangles.diameter / np.pi) ** 2 / material.k * heat_estimate(triangles, theta, scene)
    if not isinstance(scene.heat.theta, Expression):
        return np.zeros(len(triangles.area))
    exact = values_at(scene.heat.theta, triangles.inner_points)
    return factor * triangles.area * np.mean((exact - triangles.at_inner_points(theta)) ** 2, axis=1)


@dataclass(frozen=True)
class RegionMesh:
    """A piece of the body as a mesh of its own: which triangles, nodes and segments of the whole mesh it has.

    piece: its number in the scene's pieces, as whose materials differ from point to point
    """

    piece: int
    triangles: Indices
    nodes: Indices
    segments: Indices
    geometry: ElementGeometry


def parts_of(whole: ElementGeometry, scene: Scene) -> list[RegionMesh]:
    """The pieces of a body, by material, that have triangles; the same for all scenes of a study."""
    mesh, found = whole.mesh, list[RegionMesh]()
    if not scene.material.regions:
        triangles, nodes, segments = (np.arange(len(x)) for x in (mesh.triangles, mesh.points, mesh.segments))
        return [RegionMesh(0, triangles, nodes, segments, whole)]
    for piece, (where, _) in enumerate(scene.pieces):
        triangles = np.flatnonzero(mesh.inside(where))
        if not len(triangles):
            continue
        nodes, segments = np.unique(mesh.triangles[triangles]), np.flatnonzero(np.isin(whole.owner, triangles))
        number = np.full(mesh.n_points, -1, dtype=np.intp)
        number[nodes] = np.arange(len(nodes))
        own = replace(
            mesh,
            points=mesh.points[nodes],
            triangles=number[mesh.triangles[triangles]],
            segments=number[mesh.segments[segments]],
            segment_curve=mesh.segment_curve[segments],
        )
        found.append(RegionMesh(piece, triangles, nodes, segments, ElementGeometry(own, triangles)))
    return found


def energy_squares(
    parts: list[RegionMesh], mesh: PlaneMesh, u: Array, theta: Array, scene: Scene, friction: ContactTraction
) -> tuple[Array, float]:
    """(t,) η_K² of the energy norm [J/m] and ‖u_h‖ [√(J/m)] of a displacement u (2n,) at a temperature θ (n,)."""
    squares, norm, n = np.zeros(len(mesh.triangles)), 0.0, mesh.n_points
    materials = [scene.pieces[part.piece][1] for part in parts]
    tractions, flows = np.full((len(parts), n, 3), np.nan), np.full((len(parts), n, 2), np.nan)
    solved = scene.material.expands and needs_heat_solve(scene)
    for number, (part, material) in enumerate(zip(parts, materials, strict=True)):
        one, own, heat = replace(scene, material=material), part.geometry, theta[part.nodes]
        w, lam, mu, beta = np.concatenate([u[part.nodes], u[n + part.nodes]]), material.lam, material.mu, material.beta
        found = strain(own, w)
        terms = strain_energy(own, found.excess, lam, mu)
        on = friction.on(part.segments)
        terms += element_residual(own, found, heat, one) + edge_residual(own, found, heat, one, on)
        terms += dirichlet_residual(own, w, one)
        if beta != 0.0:
            terms += coupling(own, heat, one)
        squares[part.triangles] = terms
        norm += energy_norm(own, found, lam, mu) ** 2
        tractions[number, part.nodes] = stress_of(found.recovered, lam, mu) - beta * heat[:, None] * [1.0, 1.0, 0.0]
        if solved and material.k:
            flows[number, part.nodes] = material.k * (own.recovery @ own.gradient(heat))
    if len(parts) > 1:
        squares += _jumps(parts, materials, mesh, tractions, flows if solved else None)
    return squares, float(np.sqrt(norm))


def _jumps(
    parts: list[RegionMesh], materials: list[Material], mesh: PlaneMesh, stress: Array, flow: Array | None
) -> Array:
    """(t,) the terms of interfaces. stress, flow: (parts, n, 3) and (parts, n, 2) recovered at the nodes of a part."""
    of = np.empty(len(mesh.triangles), dtype=np.intp)
    for number, part in enumerate(parts):
        of[part.triangles] = number
    first, second, a, b = _interfaces(mesh, of)
    along = mesh.points[b] - mesh.points[a]
    length = np.linalg.norm(along, axis=1)
    normal = np.column_stack([along[:, 1], -along[:, 0]]) / length[:, None]

    def jump(nodal: Array) -> Array:
        """(e, 2, …) the difference of both sides at the Gauss points."""
        ends = [nodal[of[first], at] - nodal[of[second], at] for at in (a, b)]
        return np.stack([(1.0 - w) * ends[0] + w * ends[1] for w in GAUSS], axis=1)

    def of_parts(name: str) -> Array:
        return np.array([getattr(material, name) or 0.0 for material in materials], dtype=float)

    traction = traction_of(jump(stress), normal)
    mu = of_parts("mu")
    term = length**2 / (2.0 * np.pi * np.maximum(mu[of[first]], mu[of[second]])) * np.mean(np.sum(traction**2, -1), 1)
    both = [0.5 * term, 0.5 * term]
    if flow is not None:
        k, heat = of_parts("k"), np.sum(jump(flow) * normal[:, None], axis=-1)
        term = length**2 / (np.pi * np.maximum(k[of[first]], k[of[second]])) * np.mean(heat**2, axis=1)
        factor = of_parts("beta") ** 2 / (of_parts("lam") + mu) / np.where(k > 0.0, k, 1.0)
        for side, triangle in enumerate((first, second)):
            both[side] = both[side] + 0.5 * factor[of[triangle]] * (length / np.pi) ** 2 * term
    found = np.zeros(len(of))
    for triangle, value in zip((first, second), both, strict=True):
        np.add.at(found, triangle, value)
    return found


def _interfaces(mesh: PlaneMesh, of: Indices) -> tuple[Indices, Indices, Indices, Indices]:
    """Both triangles and both nodes of every edge between different parts."""
    t = mesh.triangles
    edges = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1)
    owner = np.tile(np.arange(len(t)), 3)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    edges, owner = edges[order], owner[order]
    twin = np.flatnonzero((edges[1:] == edges[:-1]).all(axis=1))
    between = twin[of[owner[twin]] != of[owner[twin + 1]]]
    return owner[between], owner[between + 1], edges[between, 0], edges[between, 1]
