"""Corners where two edges prescribe displacements: they must agree there, or the problem has no solution."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.expressions import Expression
from tcstudy.scene.node import Node, deepest
from tcstudy.scene.records import Body, Clamped, Contact, Edge, Point, Role, Scalar
from tcstudy.scene.shapes import edge_normal
from tcstudy.scene.walker import Context

Array = NDArray[np.float64]


def check_corners(ctx: Context, node: Node, body: Body, boundary: tuple[tuple[str, Role], ...]) -> None:
    """Record every corner of a polygon body at which the constraints d·u = value have no common solution u."""
    if body.outline is None:
        return
    roles = dict(boundary)
    for loop in (body.outline, *body.holes):
        for edge, following in zip(loop.edges, (*loop.edges[1:], loop.edges[0]), strict=True):
            rows = [*_constraints(edge, roles, edge.end), *_constraints(following, roles, edge.end)]
            if len(rows) > 1 and not _solvable(np.array(rows)):
                x, y = edge.end
                others = f"{edge.name} and {following.name}"
                what = f"{others} prescribe different displacements at their common corner ({x:g}, {y:g})"
                clamped = following if isinstance(roles.get(following.name), Clamped) else edge
                ctx.errors.at(deepest(node, (clamped.name,)), what, "make them agree there, or free a component")


def _constraints(edge: Edge, roles: Mapping[str, Role], at: Point) -> Iterator[tuple[float, float, float]]:
    """(d₁, d₂, value) of every component that an edge holds at a point."""
    role = roles.get(edge.name)
    n = edge_normal(edge, np.array([at]))[0]
    normal, tangent = (float(n[0]), float(n[1])), (-float(n[1]), float(n[0]))
    if isinstance(role, Contact):
        yield (*normal, 0.0)
    elif isinstance(role, Clamped):
        directions = ((1.0, 0.0), (0.0, 1.0)) if role.frame == "xy" else (normal, tangent)
        for direction, component in zip(directions, role.u, strict=True):
            if component is not None:
                yield (*direction, _value(component, at))


def _value(scalar: Scalar, at: Point) -> float:
    return float(scalar.evaluate(at[0], at[1])) if isinstance(scalar, Expression) else float(scalar)


def _solvable(rows: Array) -> bool:
    """Whether d·u = value has a solution; near-parallel directions (a smooth junction) count as parallel."""
    directions, values = rows[:, :2], rows[:, 2]
    if not np.all(np.isfinite(values)):
        return True  # refused elsewhere, as an expression without a finite value
    u = np.linalg.lstsq(directions, values, rcond=1e-6)[0]
    return bool(np.max(np.abs(directions @ u - values)) <= 1e-9 * np.max(np.abs(values), initial=0.0))
