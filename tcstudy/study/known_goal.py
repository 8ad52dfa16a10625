"""The value of a goal in the exact solution that a study gives, so that estimates can be compared with true errors."""

from __future__ import annotations

import math

import numpy as np

from tcstudy.scene.records import Contact, Exact, Goal, Point, Scene
from tcstudy.scene.shapes import edge_distance, edge_normal
from tcstudy.study.exact_energy import exact_friction_resultant, exact_slip_length
from tcstudy.study.exact_line import exact_u_T, exact_xi


def known_goal(goal: Goal, exact: Exact, scene: Scene) -> float | None:
    """J(u), by quadrature on the exact Γ_C; None for the energy norm and where the body comes from a file."""
    if scene.body.outline is None or goal.quantity == "energy":
        return None
    if goal.quantity == "u_T":
        assert goal.at is not None
        value = _exact_slip(exact, scene, goal.at)
    elif goal.quantity == "friction_resultant":
        value = exact_friction_resultant(scene, exact_xi(exact, scene))
    else:
        value = exact_slip_length(exact, scene)
    return value if math.isfinite(value) else None


def _exact_slip(exact: Exact, scene: Scene, at: Point) -> float:
    """u·t at a point of Γ_C, t = (−n₂, n₁) of the nearest contact edge."""
    assert scene.body.outline is not None
    point = np.array([at])
    names = scene.edges(Contact)
    loops = [(scene.body.outline, 1.0), *((hole, -1.0) for hole in scene.body.holes)]  # a hole has the body outside
    edges = [(edge, side) for loop, side in loops for edge in loop.edges if edge.name in names]
    edge, side = min(edges, key=lambda item: float(edge_distance(item[0], point)[0]))
    n = side * edge_normal(edge, point)[0]
    return float(exact_u_T(exact)(point[:, 0], point[:, 1], n[None])[0])
