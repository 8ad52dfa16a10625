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

from tcstudy.fem.boundary import values_at
from tcstudy.fem.estimators import GAUSS
from tcstudy.fem.recovery import Triangles
from tcstudy.scene.expressions import Expression
from tcstudy.scene.records import Convection, Scene

Array = NDArray[np.float64]


def heat_estimate(triangles: Triangles, theta: Array, scene: Scene) -> Array:
    """(t,) η_K² of a temperature (n,) that was solved for [W K/m]."""
    k = scene.material.k
    assert k is not None
    own = triangles.gradient(theta)
    recovered = triangles.recovery @ own
    return (
        k * gradient_product(triangles, *(2 * (excess(triangles, theta),)))
        + _element_residual(triangles, recovered, scene, k)
        + _edge_residual(triangles, recovered, theta, scene, k)
    )


def excess(triangles: Triangles, theta: Array) -> Array:
    """(t, 3, 2) the recovered gradient at the corners of each triangle, less its own."""
    own = triangles.gradient(theta)
    return (triangles.recovery @ own)[triangles.mesh.triangles] - own[:, None]


def gradient_product(triangles: Triangles, a: Array, b: Array) -> Array:
    """(t,) ∫_K a·b of vectors that are linear on K and given at its corners (t, 3, 2)."""
    total = np.einsum("tkd,tkd->t", a, b) + np.einsum("td,td->t", a.sum(axis=1), b.sum(axis=1))
    return triangles.area / 12.0 * total


def _element_residual(triangles: Triangles, recovered: Array, scene: Scene, k: float) -> Array:
    slope = triangles.gradient(recovered)
    q = values_at(scene.heat.q, triangles.inner_points.reshape(-1, 2)).reshape(-1, 3)
    if scene.heat.omega:
        inside = [str(element.mat) in scene.heat.omega for element in triangles.mesh.mesh.Elements()]
        q = q * np.array(inside)[:, None]
    square = np.mean((q + k * (slope[:, 0, 0] + slope[:, 1, 1])[:, None]) ** 2, axis=1) * triangles.area
    return (triangles.diameter / np.pi) ** 2 / k * square


def _edge_residual(triangles: Triangles, recovered: Array, theta: Array, scene: Scene, k: float) -> Array:
    mesh = triangles.mesh
    ends = mesh.points[mesh.segments]
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    normal = np.column_stack([along[:, 1], -along[:, 0]]) / length[:, None]
    at = ends[:, None, 0] + GAUSS[None, :, None] * along[:, None]
    ends_flux = k * np.einsum("skd,sd->sk", recovered[mesh.segments], normal)
    flux = ends_flux[:, :1] + GAUSS * (ends_flux[:, 1:] - ends_flux[:, :1])
    ends_theta = theta[mesh.segments]
    theta_at = ends_theta[:, :1] + GAUSS * (ends_theta[:, 1:] - ends_theta[:, :1])
    curves = [i for i, c in enumerate(mesh.geometry.curves) if c.name in scene.edges(Convection)]
    robin = np.isin(mesh.segment_curve, curves)
    theta_bar = values_at(scene.heat.theta_bar, at[robin].reshape(-1, 2)).reshape(-1, 2)
    flux[robin] += scene.heat.alpha * (theta_at[robin] - theta_bar)
    weighted = length / (np.pi * k) * length * np.mean(flux**2, axis=1)
    return triangles.from_segments(weighted)


def coupling(triangles: Triangles, theta: Array, scene: Scene, solved: bool) -> Array:
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
