"""Error of a P1 temperature, estimated triangle by triangle, and what it does to the displacement.

Estimate:   η_K² = k‖q* − ∇θ_h‖²_K + (h_K/π)²/k ‖qχ_ω + k div q*‖²_K + Σ_e h_e/(πk) ‖k q*·n + α(θ_h − θ̄)‖²_e,
            q* the recovered gradient, α = 0 off Γ_θ; as for the stress in estimators.py
Coupling:   ‖θ − θ_h‖_K ≈ (h_K/π) η_K/√k: temperature loads the body through its L² error, one order of h better than
            its gradient (Aubin–Nitsche, in its local form)
Left out:   pollution: at a re-entrant corner the L² error is larger than its local part
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.expression import Expression
from tcstudy.fem.boundary import values_at
from tcstudy.fem.estimators import boundary_edges, on_segments
from tcstudy.fem.recovery import ElementGeometry
from tcstudy.scene.records import Scalar, Scene

Array = NDArray[np.float64]


def heat_estimate(triangles: ElementGeometry, theta: Array, scene: Scene) -> Array:
    """(t,) η_K² of a temperature (n,) that was solved for [W K/m]."""
    k = scene.material.k
    assert k is not None
    own = triangles.gradient(theta)
    recovered = triangles.recovery @ own
    excess = recovered[triangles.mesh.triangles] - own[:, None]
    squares = np.einsum("tkd,tkd->t", excess, excess) + np.einsum("tkd,tjd->t", excess, excess)
    return (
        k * triangles.area / 12.0 * squares
        + _element_residual(triangles, recovered, scene, k)
        + _edge_residual(triangles, recovered, theta, scene, k)
    )


def _element_residual(triangles: ElementGeometry, recovered: Array, scene: Scene, k: float) -> Array:
    slope = triangles.gradient(recovered)
    q = values_at(scene.heat.q, triangles.inner_points.reshape(-1, 2)).reshape(-1, 3)
    if scene.heat.omega:
        q = q * triangles.inside(scene.heat.omega)[:, None]
    square = np.mean((q + k * (slope[:, 0, 0] + slope[:, 1, 1])[:, None]) ** 2, axis=1) * triangles.area
    return (triangles.diameter / np.pi) ** 2 / k * square


def _edge_residual(triangles: ElementGeometry, recovered: Array, theta: Array, scene: Scene, k: float) -> Array:
    mesh, edges = triangles.mesh, boundary_edges(triangles)
    flux = k * np.einsum("sqd,sd->sq", on_segments(recovered, mesh.segments), edges.normal)

    def given(scalar: Scalar, some: NDArray[np.bool_]) -> Array:
        return values_at(scalar, edges.at[some].reshape(-1, 2)).reshape(-1, 2)

    for name, alpha, theta_bar in scene.exchange:
        robin = mesh.on(name)
        flux[robin] += alpha * (on_segments(theta, mesh.segments)[robin] - given(theta_bar, robin))
    for name, into in scene.flux:
        flux[mesh.on(name)] -= given(into, mesh.on(name))
    for name, _ in scene.held_theta:
        flux[mesh.on(name)] = 0.0
    weighted = edges.length**2 / (np.pi * k) * np.mean(flux**2, axis=1)
    return triangles.from_segments(weighted)


def coupling(triangles: ElementGeometry, theta: Array, scene: Scene, solved: bool) -> Array:
    """(t,) β²/(λ+μ) ‖θ − θ_h‖²_K, the error that temperature puts into the displacement [J/m].

    solved: θ comes from the heat problem; else it is known, and θ_h is its interpolant
    """
    material = scene.material
    factor = material.beta**2 / (material.lam + material.mu)
    if solved:
        assert material.k is not None
        return factor * (triangles.diameter / np.pi) ** 2 / material.k * heat_estimate(triangles, theta, scene)
    if not isinstance(scene.heat.theta, Expression):
        return np.zeros(len(triangles.area))
    exact = values_at(scene.heat.theta, triangles.inner_points.reshape(-1, 2)).reshape(-1, 3)
    return factor * triangles.area * np.mean((exact - triangles.at_inner_points(theta)) ** 2, axis=1)
