"""Regions whose corners are meant to lie on the boundary of the body, or of one another, and miss it by rounding.

Six digits of a corner on a slanted edge miss it by 1e-7 of the body. The kernel would cut a sliver there, or take the
region's edge for a piece of the boundary. So corners of regions within NEAR of a corner or an edge are moved there, and
edges of regions that pass a corner of another loop so closely get a corner there. Arcs of regions stay as they are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from tcstudy.scene.records import Body, Edge, Loop, Point, Region
from tcstudy.shapes.edges import edge_arc, edge_distance, edge_length, loop_size
from tcstudy.shapes.faults import has_edges

NEAR = 1e-5
"""Distance within which corners are moved, relative to the size of the body."""
SHARE = 0.1
"""The same, relative to the shortest edge: what is drawn so finely is meant."""


def snapped(body: Body) -> Body:
    """The body with corners of its regions on what they nearly meet."""
    loops = [*body.loops] if body.outline is not None else []
    if not all(map(has_edges, [*loops, *(region.loop for region in body.regions)])):
        return body
    size = max((loop_size(loop) for loop in loops or [region.loop for region in body.regions]), default=0.0)
    regions: list[Region] = []
    for region in body.regions:
        edges = [edge for loop in (*loops, region.loop) for edge in loop.edges]
        near = min(NEAR * size, SHARE * min(map(edge_length, edges)))
        loop, moved = _onto(region.loop, loops, near)
        regions.append(replace(region, loop=loop, moved=moved if moved > 1e-12 * size else 0.0))
        loops.append(loop)
    return replace(body, regions=tuple(regions))


def _onto(loop: Loop, others: Sequence[Loop], near: float) -> tuple[Loop, float]:
    """The loop with corners on the others, and how far the farthest of its points was moved."""
    targets = [edge for other in others for edge in other.edges]
    if not targets or any(edge.through for edge in loop.edges):
        return loop, 0.0
    given = np.array([edge.start for edge in loop.edges])
    corners = np.array([edge.start for edge in targets])
    away = np.array([edge_distance(edge, given) for edge in targets])
    placed, moved = list[Point](), 0.0
    for i, point in enumerate(given):
        distance = np.linalg.norm(corners - point, axis=1)
        own: Point = (float(point[0]), float(point[1]))
        if distance.min() <= near:
            own = targets[int(distance.argmin())].start
        elif away[:, i].min() <= near:
            own = _nearest(targets[int(away[:, i].argmin())], own)
        moved = max(moved, math.dist(own, point))
        placed.append(own)
    edges: list[Edge] = []
    for edge, start, end in zip(loop.edges, placed, [*placed[1:], placed[0]], strict=True):
        straight = replace(edge, start=start, end=end)
        distance = edge_distance(straight, corners)
        passed = {targets[k].start for k in np.flatnonzero(distance <= near)} - {*placed}
        inner = sorted(passed, key=lambda point: math.dist(point, start))
        moved = max([moved, *(float(edge_distance(straight, [point])[0]) for point in inner)])
        chain = [start, *inner, end]
        edges += [replace(edge, start=a, end=b) for a, b in pairwise(chain)]
    return replace(loop, edges=tuple(edges)), moved


def _nearest(edge: Edge, point: Point) -> Point:
    """The point of an edge that is nearest to one close to it, and at neither end."""
    arc, at = edge_arc(edge), np.array(point)
    if arc is None:
        start, chord = np.array(edge.start), np.subtract(edge.end, edge.start)
        x, y = start + chord * float((at - start) @ chord / (chord @ chord))
    else:
        radial = at - arc.center
        x, y = arc.center + arc.radius * radial / np.linalg.norm(radial)
    return float(x), float(y)
