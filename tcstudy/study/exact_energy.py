"""Numbers of an exact solution, by quadrature that uses no discrete field.

L_θ(u) = ½a(u,u) − ∫f·u − β∫θ div u − ∫g·u + ∫_{Γ_C} j(u_T), over the mesh's triangles and the exact boundary.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.line_norms import Function
from tcstudy.accuracy.norms import Triangles
from tcstudy.scene.gradient import value_and_gradient
from tcstudy.scene.records import Body, Contact, Convection, Edge, Exact, Scalar, Scene, Traction
from tcstudy.scene.shapes import edge_arc, edge_length, edge_normal

Array = NDArray[np.float64]

PANELS = 200
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(5)


def exact_energy(exact: Exact, scene: Scene, mesh: Triangles) -> float:
    """L_θ(u) [J/m]; NaN for a curved body and where the study gives no θ, but it loads the body."""
    theta = exact.theta if exact.theta is not None else scene.heat.theta
    curved = scene.body.outline is None or any(edge.through is not None for edge in _edges(scene.body))
    if curved or (scene.material.beta != 0.0 and theta is None):
        return float("nan")

    def density(x: Array, y: Array) -> Array:
        (ux, gx), (uy, gy) = (value_and_gradient(component, x, y) for component in exact.u)
        divergence = gx[0] + gy[1]
        lam, mu, beta = scene.material.lam, scene.material.mu, scene.material.beta
        strain = gx[0] ** 2 + gy[1] ** 2 + 0.5 * (gx[1] + gy[0]) ** 2
        value: Array = 0.5 * lam * divergence**2 + mu * strain - _at(scene.f[0], x, y) * ux - _at(scene.f[1], x, y) * uy
        return value - beta * _at(theta if theta is not None else 0.0, x, y) * divergence

    return mesh.integral(density) + sum(_on_edge(exact, scene, edge) for edge in _edges(scene.body))


def exact_friction_resultant(scene: Scene, xi: Function) -> float:
    """∫ξ over the exact Γ_C [N/m]; NaN for a body from a file."""
    if scene.body.outline is None:
        return float("nan")
    total = 0.0
    for edge in _edges(scene.body):
        if edge.name in scene.edges(Contact):
            points, weights = _samples(edge)
            total += float(weights @ xi(points[:, 0], points[:, 1], _outward(scene.body, edge, points)))
    return total


def _outward(body: Body, edge: Edge, points: Array) -> Array:
    """Outward unit normals; a hole's edges have the body on their right."""
    n = edge_normal(edge, points)
    return -n if any(edge is e for hole in body.holes for e in hole.edges) else n


def _at(scalar: Scalar, x: Array, y: Array) -> Array:
    return value_and_gradient(scalar, x, y)[0]


def _edges(body: Body) -> list[Edge]:
    assert body.outline is not None
    return [edge for loop in (body.outline, *body.holes) for edge in loop.edges]


def _on_edge(exact: Exact, scene: Scene, edge: Edge) -> float:
    """What an edge adds: −∫g·u + ∫p u_N, or ∫j(u_T) on Γ_C."""
    role = dict(scene.boundary)[edge.name]
    if not isinstance(role, Contact | Traction | Convection):
        return 0.0
    points, weights = _samples(edge)
    x, y = points.T
    n = _outward(scene.body, edge, points)
    ux, uy = (_at(component, x, y) for component in exact.u)
    if isinstance(role, Contact):
        return float(weights @ scene.friction.j(uy * n[:, 0] - ux * n[:, 1]))
    work = _at(role.g[0], x, y) * ux + _at(role.g[1], x, y) * uy
    work -= _at(role.pressure, x, y) * (ux * n[:, 0] + uy * n[:, 1])
    return -float(weights @ work)


def _samples(edge: Edge) -> tuple[Array, Array]:
    """Gauss points (q, 2) and weights (q,) on a line or an arc, in PANELS equal parts."""
    t = ((np.arange(PANELS)[:, None] + 0.5 * (1 + _GAUSS)) / PANELS).ravel()
    weights = np.tile(0.5 * _WEIGHTS / PANELS, PANELS) * edge_length(edge)
    arc = edge_arc(edge)
    if arc is None:
        start, end = np.array(edge.start), np.array(edge.end)
        return start + t[:, None] * (end - start), weights
    angle = arc.start + t * arc.sweep
    return np.array(arc.center) + arc.radius * np.column_stack([np.cos(angle), np.sin(angle)]), weights
