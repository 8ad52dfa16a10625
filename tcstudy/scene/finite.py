"""Expressions must have a finite value where they are used: found at sample points before any work starts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.expressions import Expression
from tcstudy.scene.loop_faults import loop_polygon
from tcstudy.scene.node import Node, deepest
from tcstudy.scene.records import Body, Edge
from tcstudy.scene.shapes import edge_points, loop_size
from tcstudy.scene.walker import Context

Array = NDArray[np.float64]

EDGE_POINTS, GRID = 64, 40


def check_finite(ctx: Context, root: Node, section: str, value: object, body: Body) -> None:
    """Record every expression of a section with a value that is not finite at a sample point of its edges or the body.

    Samples cannot see every singularity between them; a load that is not finite after all is a failed point.
    """
    if body.outline is None:
        return
    for keys, edge, expression in _expressions(section, value):
        points = _on_edges(body, edge) if edge else _inside(body)
        result = np.broadcast_to(expression.evaluate(points[:, 0], points[:, 1]), len(points))
        bad = np.flatnonzero(~np.isfinite(result))
        if len(bad):
            x, y = points[bad[0]]
            what = f"the expression {str(expression)!r} has no finite value at ({x:g}, {y:g})"
            ctx.errors.once(deepest(root, keys), what, "change it so that it is finite wherever it is used")


def _expressions(section: str, value: object) -> Iterator[tuple[tuple[str, ...], str | None, Expression]]:
    """(key path, edge or None for the body, expression) of a section's record."""
    if section == "boundary":
        assert isinstance(value, tuple)
        for name, role in value:
            yield from (((section, name), name, e) for e in _in(role))
    elif section == "loads":
        yield from (((section, "f"), None, e) for e in _in(value))
    elif is_dataclass(value):
        for field in fields(value):
            yield from (((section, field.name), None, e) for e in _in(getattr(value, field.name)))


def _in(value: Any) -> Iterator[Expression]:
    """All expressions inside a scalar, a tuple or a record."""
    if isinstance(value, Expression):
        yield value
    elif isinstance(value, tuple):
        for item in value:
            yield from _in(item)
    elif is_dataclass(value):
        for field in fields(value):
            yield from _in(getattr(value, field.name))


def _edges(body: Body) -> Iterator[Edge]:
    assert body.outline is not None
    for loop in (body.outline, *body.holes):
        yield from loop.edges


def _on_edges(body: Body, name: str) -> Array:
    return np.concatenate([edge_points(e, EDGE_POINTS) for e in _edges(body) if e.name == name])


def _inside(body: Body) -> Array:
    """A grid over the body, and points on its edges."""
    import shapely

    assert body.outline is not None
    polygon = loop_polygon(body.outline, loop_size(body.outline))
    x0, y0, x1, y1 = polygon.bounds
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(x0, x1, GRID), np.linspace(y0, y1, GRID)))
    inside = shapely.contains_xy(polygon, x, y)
    edges = [edge_points(edge, EDGE_POINTS) for edge in _edges(body)]
    return np.concatenate([np.column_stack([x, y])[inside], *edges])
