"""Numbers of an exact solution, by quadrature that uses no discrete field; u_T and ξ as functions of place and normal.

L_θ(u) = ½a(u,u) − ∫f·u − β∫θ div u − ∫g·u + ∫_{Γ_C} j(u_T) of a body with straight edges; ∫ξ over Γ_C; the length of
Γ_C that slips; with these the value of a goal, so that estimates can be compared with true errors.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.norms import LineFunction, integral
from tcstudy.exact.loads import body_edges, outward
from tcstudy.expressions.expression import value_and_gradient, value_of
from tcstudy.laws.composed import law_along
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import UP
from tcstudy.scene.records import Contact, Edge, Loaded, Scene
from tcstudy.scene.study import Exact, Goal
from tcstudy.shapes.edges import TriangleGeometry, edge_at, edge_distance, edge_length

Array = NDArray[np.float64]

PANELS = 200
STICKS = 64 * np.finfo(float).eps
"""Distance from an up-jump, relative to the largest displacement on Γ_C, that is rounding."""
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(5)


def exact_energy(exact: Exact, scene: Scene, mesh: TriangleGeometry) -> float:
    """L_θ(u) [J/m]; NaN for a body that no mesh fills (with arcs, from a file), and without the θ that loads it."""
    theta = exact.theta if exact.theta is not None else scene.heat.theta
    straight = scene.body.outline is not None and all(edge.through is None for edge in scene.body.edges)
    if not straight or (scene.material.expands and theta is None):
        return math.nan

    def density(x: Array, y: Array) -> Array:
        (ux, gx), (uy, gy) = (value_and_gradient(component, x, y) for component in exact.u)
        f_x, f_y, heat = (value_of(data, x, y) for data in (*scene.f, 0.0 if theta is None else theta))
        lam, mu, beta = scene.material.lam, scene.material.mu, scene.material.beta
        divergence, strain = gx[0] + gy[1], gx[0] ** 2 + gy[1] ** 2 + 0.5 * (gx[1] + gy[0]) ** 2
        return np.asarray(0.5 * lam * divergence**2 + mu * strain - f_x * ux - f_y * uy - beta * heat * divergence)

    return integral(mesh, density) + sum(_on_edge(exact, scene, *edge) for edge in body_edges(scene.body))


def exact_friction_resultant(scene: Scene, xi: LineFunction) -> float:
    """∫ξ over the exact Γ_C [N/m]; NaN for a body from a file."""
    if scene.body.outline is None:
        return math.nan
    pieces = (_samples(*edge) for edge in body_edges(scene.body, scene.edges(Contact)))
    return sum(float(weights @ xi(points[:, 0], points[:, 1], n)) for points, n, weights in pieces)


def exact_slip_length(exact: Exact, scene: Scene) -> float:
    """Length of Γ_C where u_T is not at an up-jump of b [m]; NaN for a body from a file.

    Changes between stick and slip are found at 5·PANELS points of every edge and bisected until floats end; pairs of
    changes between two points are missed. u_T counts as at the jump within its rounding, so that where slip begins
    like r^p the change lies off by (rounding / amplitude)^(1/p).
    """
    if scene.body.outline is None:
        return math.nan
    edges = body_edges(scene.body, scene.edges(Contact))
    at = [edge_at(edge, _places()) for edge, _ in edges]
    size = max((float(np.max(np.abs(value_of(u, *points.T)))) for points in at for u in exact.u), default=0.0)

    def slips(edge: Edge, hole: bool, places: Array) -> NDArray[np.bool_]:
        points = edge_at(edge, places)
        u_T = exact_u_T(exact)(points[:, 0], points[:, 1], outward(edge, hole, points))
        law = _law(scene, edge, points)
        at, tables = law.node_index(len(points)), law.tables
        near = np.abs(u_T[:, None] - tables.kinks[at]) <= STICKS * size
        return ~np.any(near & (tables.kinds[at] == UP), axis=1)

    return sum(edge_length(edge) * _share(partial(slips, edge, hole)) for edge, hole in edges)


def _law(scene: Scene, edge: Edge, points: Array) -> Laws:
    """The law at points of a contact edge."""
    return law_along(scene.friction, (edge.name,), np.zeros(len(points), dtype=np.intp), points)


def _share(slips: Callable[[Array], NDArray[np.bool_]]) -> float:
    """Share of [0, 1] where a predicate holds, its changes bisected."""
    places = np.concatenate([[0.0], _places(), [1.0]])
    inner = slips(places[1:-1])
    holds = np.concatenate([inner[:1], inner, inner[-1:]])  # an end may be a corner where all is held
    change = np.flatnonzero(holds[1:] != holds[:-1])
    low, high = places[change], places[change + 1]
    for _ in range(64):
        middle = 0.5 * (low + high)
        same = slips(middle) == holds[change]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    borders = np.concatenate([[0.0], high, [1.0]])
    return float(np.diff(borders)[0 if holds[0] else 1 :: 2].sum())


def _on_edge(exact: Exact, scene: Scene, edge: Edge, hole: bool) -> float:
    """What an edge adds: −∫g·u + ∫p u_N, or ∫j(u_T) on Γ_C."""
    role = dict(scene.boundary)[edge.name]
    if not isinstance(role, Contact | Loaded):
        return 0.0
    points, n, weights = _samples(edge, hole)
    x, y = points.T
    if isinstance(role, Contact):
        return float(weights @ _law(scene, edge, points).j(exact_u_T(exact)(x, y, n)))
    ux, uy = (value_of(component, x, y) for component in exact.u)
    work = value_of(role.g[0], x, y) * ux + value_of(role.g[1], x, y) * uy
    work -= value_of(role.pressure, x, y) * (ux * n[:, 0] + uy * n[:, 1])
    return -float(weights @ work)


def _places() -> Array:
    """Gauss points of PANELS equal parts of [0, 1]."""
    return np.asarray(((np.arange(PANELS)[:, None] + 0.5 * (1 + _GAUSS)) / PANELS).ravel())


def _samples(edge: Edge, hole: bool) -> tuple[Array, Array, Array]:
    """Gauss points (q, 2) on a line or an arc in PANELS equal parts, outward normals (q, 2) and weights (q,)."""
    points, weights = edge_at(edge, _places()), np.tile(0.5 * _WEIGHTS / PANELS, PANELS) * edge_length(edge)
    return points, outward(edge, hole, points), weights


def exact_u_T(exact: Exact) -> LineFunction:
    """u·t with t = (−n₂, n₁) [m]."""

    def slip(x: Array, y: Array, n: Array) -> Array:
        ux, uy = (value_of(component, x, y) for component in exact.u)
        return np.asarray(uy * n[..., 0] - ux * n[..., 1])

    return slip


def exact_xi(exact: Exact, scene: Scene) -> LineFunction:
    """−S_T [Pa]: as given, or −t·2με(u)n; λ and the temperature only act normally."""
    given, mu = exact.xi, scene.material.mu
    if given is not None:
        return lambda x, y, n: value_of(given, x, y)

    def traction(x: Array, y: Array, n: Array) -> Array:
        gx, gy = (value_and_gradient(component, x, y)[1] for component in exact.u)
        shear = 0.5 * (gx[1] + gy[0])
        n1, n2 = n[..., 0], n[..., 1]
        return np.asarray(-2 * mu * (-n2 * (gx[0] * n1 + shear * n2) + n1 * (shear * n1 + gy[1] * n2)))

    return traction


def known_goal(goal: Goal, exact: Exact, scene: Scene) -> float | None:
    """J(u), by quadrature on the exact Γ_C; None for the energy norm and where the body comes from a file."""
    if scene.body.outline is None or goal.quantity == "energy":
        return None
    if goal.quantity == "u_T":
        point = np.array([goal.at])
        edges = body_edges(scene.body, scene.edges(Contact))
        edge, hole = min(edges, key=lambda one: float(edge_distance(one[0], point)[0]))
        value = float(exact_u_T(exact)(point[:, 0], point[:, 1], outward(edge, hole, point))[0])
    elif goal.quantity == "friction_resultant":
        value = exact_friction_resultant(scene, exact_xi(exact, scene))
    else:
        value = exact_slip_length(exact, scene)
    return value if math.isfinite(value) else None
