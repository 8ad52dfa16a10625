"""Plane shapes: loops of lines and circular arcs, their exact measures, distances and normals.

Also polygons close to them, and points inside a body at which expressions are looked at.

Triangles of a mesh: areas, gradients of P1 functions, barycentric coordinates; each once for a
mesh.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from tcstudy.scene.records import Body, Edge, Loop, Point

Array = NDArray[np.float64]

FLATNESS = 1e-7
"""Largest distance of an arc from its polygon in the checks, relative to the size of the body."""

MAX_SEGMENTS = 20_000
"""Most straight pieces of one arc in the checks."""

GRID = 40
"""Lines of the grid in each direction."""
SHIFT = 0.38
"""Position of the points between lines of the grid.

They are not in the middle, where symmetric functions vanish or bend.
"""

INWARD = 1e-10
"""Distance of points from edges and kinks where slopes are taken, relative to the body or grid.

On the edge itself abs(y) or atan2 may round to the other side.
"""


@dataclass(frozen=True)
class Arc:
    """A circular arc.

    start: angle where it begins;  sweep: positive counter-clockwise
    """

    center: Point
    radius: float
    start: float
    sweep: float


@dataclass(frozen=True)
class Side:
    """A piece of the boundary, or an interface, that starts at a corner.

    name: of the edge, "" for an interface;  away: unit tangent at the corner;  tag: of the piece
    """

    name: str
    away: Point
    tag: str = ""


@dataclass(frozen=True)
class Junction:
    """A point where pieces of the boundary, or interfaces of regions, end.

    sides:  the pieces that start there, counter-clockwise; the body lies counter-clockwise of the
            first and clockwise of the last
    wedges: opening angle [rad] and region between each side and the next one; within the body also
            behind the last
    """

    at: Point
    sides: tuple[Side, ...]
    wedges: tuple[tuple[float, str], ...]

    @property
    def within(self) -> bool:
        """Whether the body is all around."""
        return len(self.wedges) == len(self.sides)

    @property
    def cut(self) -> bool:
        """Whether only interfaces meet there; they may end at one piece of the boundary."""
        return self.within or self.sides[0].tag == self.sides[-1].tag


def circle_loop(center: Point, radius: float, name: str) -> Loop:
    """Return a full circle of positive radius as two half circles of one name."""
    x, y = center
    rightmost, leftmost = (x + radius, y), (x - radius, y)
    topmost, lowest = (x, y + radius), (x, y - radius)
    upper_half = Edge(rightmost, leftmost, name, through=topmost)
    lower_half = Edge(leftmost, rightmost, name, through=lowest)
    return Loop((upper_half, lower_half))


SIDES = ("bottom", "right", "top", "left")


def rectangle_loop(
    corner: Point, width: float, height: float, names: Sequence[str] = SIDES
) -> Loop:
    """Return an upright rectangle from its lower left corner."""
    x_0, y_0 = corner
    x_1, y_1 = x_0 + width, y_0 + height
    return polygon_loop([(x_0, y_0), (x_1, y_0), (x_1, y_1), (x_0, y_1)], names)


def polygon_loop(points: Sequence[Point], names: str | Sequence[str]) -> Loop:
    """Return a polygon; edge i leads from point i to the next.

    names: one for each edge, or one for all
    """
    edge_names = [names] * len(points) if isinstance(names, str) else names
    next_points = [*points[1:], *points[:1]]
    sides = zip(points, next_points, edge_names, strict=True)
    return Loop(tuple(Edge(start, end, name) for start, end, name in sides))


def edge_arc(edge: Edge) -> Arc | None:
    """Return the arc of an edge, from start, through-point and end; None if the edge is straight.

    The sweep is 2·atan2(a × b, a · b) with the chords a = through − start, b = end − through
    (inscribed angle). Raises ValueError if the three points lie on a line.
    """
    if edge.through is None:
        return None
    ax, ay = _minus(edge.through, edge.start)
    bx, by = _minus(edge.end, edge.through)
    cx, cy = ax + bx, ay + by
    cross = ax * by - ay * bx
    if cross == 0.0:
        raise ValueError("start, through and end of an arc lie on a line")
    aa = ax * ax + ay * ay
    cc = cx * cx + cy * cy
    to_center_x = (cy * aa - ay * cc) / (2.0 * cross)
    to_center_y = (ax * cc - cx * aa) / (2.0 * cross)
    center = (edge.start[0] + to_center_x, edge.start[1] + to_center_y)
    radius = math.hypot(ax, ay) * math.hypot(bx, by) * math.hypot(cx, cy) / (2.0 * abs(cross))
    start_angle = math.atan2(-to_center_y, -to_center_x)
    sweep = 2.0 * math.atan2(cross, ax * bx + ay * by)
    return Arc(center, radius, start_angle, sweep)


def edge_length(edge: Edge) -> float:
    arc = edge_arc(edge)
    if arc is None:
        return math.dist(edge.start, edge.end)
    return arc.radius * abs(arc.sweep)


def edge_at(edge: Edge, shares: Array) -> Array:
    """Return (n, 2) points at shares (n,) of the length of a line or an arc."""
    arc = edge_arc(edge)
    t = shares[:, None]
    if arc is None:
        start = np.array(edge.start)
        return np.asarray(start + t * (np.array(edge.end) - start))
    angle = arc.start + t * arc.sweep
    direction = np.hstack([np.cos(angle), np.sin(angle)])
    return np.asarray(np.array(arc.center) + arc.radius * direction)


def edge_points(edge: Edge, count: int) -> Array:
    """Return (count+1, 2) points on the edge at equal distances, both ends included exactly."""
    points = edge_at(edge, np.linspace(0.0, 1.0, count + 1))
    points[0] = edge.start
    points[-1] = edge.end
    return points


def edge_normal(edge: Edge, points: ArrayLike) -> Array:
    """Return (n, 2) unit normals at (n, 2) points on the edge, to its right.

    They point outward for a counter-clockwise loop, and out of a hole into the body. They are exact
    for lines and arcs.
    """
    points = np.asarray(points, dtype=float)
    arc = edge_arc(edge)
    if arc is None:
        dx, dy = _minus(edge.end, edge.start)
        normal = np.array([dy, -dx]) / math.hypot(dx, dy)
        return np.broadcast_to(normal, points.shape).copy()
    radial = (points - np.array(arc.center)) * math.copysign(1.0, arc.sweep)
    return np.asarray(radial / np.linalg.norm(radial, axis=1, keepdims=True))


def edge_distance(edge: Edge, points: ArrayLike) -> Array:
    """Return (n,) exact distances of (n, 2) points from the line or arc, its ends included."""
    points = np.asarray(points, dtype=float)
    start = np.array(edge.start)
    end = np.array(edge.end)
    arc = edge_arc(edge)
    if arc is None:
        chord = end - start
        t = np.clip((points - start) @ chord / (chord @ chord), 0.0, 1.0)
        return np.asarray(np.linalg.norm(points - start - t[:, None] * chord, axis=1))
    radial = points - np.array(arc.center)
    turn = np.arctan2(radial[:, 1], radial[:, 0]) - arc.start
    swept_angle = math.copysign(1.0, arc.sweep) * turn % (2.0 * math.pi)
    to_start = np.linalg.norm(points - start, axis=1)
    to_end = np.linalg.norm(points - end, axis=1)
    to_circle = np.abs(np.linalg.norm(radial, axis=1) - arc.radius)
    return np.where(swept_angle <= abs(arc.sweep), to_circle, np.minimum(to_start, to_end))


def loop_area(loop: Loop) -> float:
    """Return the exact area, negative if the loop is clockwise.

    It is that of the polygon of the vertices plus the segments under the arcs.
    """
    area = 0.0
    origin = loop.edges[0].start
    for edge in loop.edges:
        ax, ay = _minus(edge.start, origin)
        bx, by = _minus(edge.end, origin)
        area += 0.5 * (ax * by - ay * bx)
        arc = edge_arc(edge)
        if arc is not None:
            area += 0.5 * arc.radius**2 * (arc.sweep - math.sin(arc.sweep))
    return area


def body_area(body: Body) -> float:
    outline_area = loop_area(_outline(body))
    return outline_area - sum(loop_area(hole) for hole in body.holes)


def body_size(body: Body) -> float:
    """Return the diagonal of the bounding box of the outline, arcs included exactly."""
    return loop_size(_outline(body))


def loop_size(loop: Loop) -> float:
    """Return the diagonal of the bounding box, arcs included exactly."""
    points = [point for edge in loop.edges for point in (edge.start, *_extremes(edge))]
    extent = np.max(points, axis=0) - np.min(points, axis=0)
    return math.hypot(*extent)


def boundary_lengths(body: Body) -> dict[str, float]:
    """Return the exact total length of the edges of each name, in the order of the study.

    Edges of the outline and of holes count.
    """
    lengths: dict[str, float] = {}
    for edge in body.edges:
        lengths[edge.name] = lengths.get(edge.name, 0.0) + edge_length(edge)
    return lengths


def _outline(body: Body) -> Loop:
    if body.outline is None:
        raise ValueError("the body comes from a file; its measures are known when that is read")
    return body.outline


def _minus(a: Point, b: Point) -> Point:
    return a[0] - b[0], a[1] - b[1]


def _extremes(edge: Edge) -> list[Point]:
    """Return the points of an arc with a level or upright tangent.

    There its bounding box may touch it.
    """
    arc = edge_arc(edge)
    if arc is None:
        return []
    x, y = arc.center
    quarter = math.pi / 2
    first_angle, last_angle = sorted((arc.start, arc.start + arc.sweep))
    directions = ((1, 0), (0, 1), (-1, 0), (0, -1))
    points = []
    for i in range(math.ceil(first_angle / quarter), math.floor(last_angle / quarter) + 1):
        direction_x, direction_y = directions[i % 4]
        points.append((x + arc.radius * direction_x, y + arc.radius * direction_y))
    return points


def edge_line(edge: Edge, size: float) -> BaseGeometry:
    """Return the edge as a polygonal line, at most FLATNESS · size from an arc."""
    arc = edge_arc(edge)
    count = 1
    if arc:
        needed = math.ceil(abs(arc.sweep) * math.sqrt(arc.radius / (8.0 * FLATNESS * size)))
        count = min(8 + needed, MAX_SEGMENTS)
    return shapely.linestrings(edge_points(edge, count))


def loop_polygon(loop: Loop, size: float) -> BaseGeometry:
    """Return the loop as a polygon; arcs deviate by at most FLATNESS·size."""
    points = [shapely.get_coordinates(edge_line(edge, size))[:-1] for edge in loop.edges]
    polygon = shapely.polygons(np.vstack(points))
    shapely.prepare(polygon)
    return polygon


def body_polygon(body: Body) -> BaseGeometry:
    loops = (_outline(body), *body.holes)
    polygon, *holes = [loop_polygon(loop, loop_size(loop)) for loop in loops]
    if holes:
        polygon = shapely.difference(polygon, shapely.union_all(holes))
    shapely.prepare(polygon)
    return polygon


def grid(body: Body, count: int = GRID) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the points of a grid over the bounding box and which of them lie inside the body.

    They are x, y and a mask, (count, count) each.
    """
    polygon = body_polygon(body)
    x_0, y_0, x_1, y_1 = polygon.bounds
    t = (np.arange(count) + SHIFT) / count
    x, y = np.meshgrid(x_0 + t * (x_1 - x_0), y_0 + t * (y_1 - y_0))
    return x, y, np.asarray(shapely.contains_xy(polygon, x, y))


def inside(body: Body) -> Array:
    """Return (n, 2) points inside the body."""
    x, y, within = grid(body)
    return np.column_stack([x[within], y[within]])


Indices = NDArray[np.intp]

INNER = np.full((3, 3), 1 / 6) + 0.5 * np.eye(3)
"""Barycentric points of a quadrature that is exact for degree 2, with a third of the area each."""
GAUSS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
"""Points on a segment from 0 to 1, of weight ½ each, exact for degree 3."""


def doubled_areas(corners: Array) -> Array:
    """Return twice the signed areas of triangles given by their corners (t, 3, 2)."""
    a = corners[:, 1] - corners[:, 0]
    b = corners[:, 2] - corners[:, 0]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def segment_mass(ends: Indices, lengths: Array, size: int) -> Array:
    """Return (size, size) ∫φ_iφ_j of P1 over segments.

    ends: (s, 2) numbers of their nodes, −1 for one that is left out
    """
    mass = np.zeros((size + 1, size + 1))  # what is left out goes to the last row
    for i in (0, 1):
        for j in (0, 1):
            entries = lengths / (3.0 if i == j else 6.0)
            np.add.at(mass, (ends[:, i], ends[:, j]), entries)
    return mass[:-1, :-1]


@dataclass(frozen=True, eq=False)
class TriangleGeometry:
    """Triangles of a mesh and what follows from their nodes.

    points: (n, 2) nodes [m];  triangles: (t, 3), counter-clockwise
    """

    points: Array
    triangles: Indices

    @cached_property
    def sides(self) -> Indices:
        """(3t, 2) nodes of the sides, the triangle on their left.

        Side 3i + k of triangle i starts at its corner k.
        """
        return self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)

    @cached_property
    def edges(self) -> tuple[Indices, Indices]:
        """(e, 2) edges, ends ascending, and (t, 3) those of triangles in the order of `sides`."""
        ascending = np.sort(self.sides, axis=1)
        keys = ascending[:, 0] * len(self.points) + ascending[:, 1]
        _, first, edge_of_side = np.unique(keys, return_index=True, return_inverse=True)
        return ascending[first], edge_of_side.reshape(-1, 3)

    def sides_at(self, pairs: Indices) -> Indices:
        """Return (s,) numbers of the sides between nodes of pairs (s, 2), −1 for none."""
        n = len(self.points)
        side_keys = self.sides[:, 0] * n + self.sides[:, 1]
        pair_keys = pairs[:, 0] * n + pairs[:, 1]
        order = np.argsort(side_keys)
        position = np.searchsorted(side_keys, pair_keys, sorter=order)
        side = order[np.minimum(position, len(side_keys) - 1)]
        return np.where(side_keys[side] == pair_keys, side, -1)

    @cached_property
    def corners(self) -> Array:
        """(t, 3, 2) corners [m]."""
        return self.points[self.triangles]

    @cached_property
    def centres(self) -> Array:
        """(t, 2) centres of gravity [m]."""
        return np.asarray(self.corners.mean(axis=1))

    @cached_property
    def diameter(self) -> Array:
        """(t,) longest sides [m]."""
        sides = self.corners - np.roll(self.corners, 1, axis=1)
        return np.sqrt(np.max(np.sum(sides**2, axis=2), axis=1))

    @cached_property
    def area(self) -> Array:
        """(t,) areas [m²]."""
        return 0.5 * doubled_areas(self.corners)

    @cached_property
    def slopes(self) -> Array:
        """(t, 3, 2) gradients of the three hat functions of each triangle [1/m]."""
        opposite = np.roll(self.corners, -2, axis=1) - np.roll(self.corners, -1, axis=1)
        normal = np.stack([-opposite[..., 1], opposite[..., 0]], axis=-1)
        return normal / (2.0 * self.area)[:, None, None]

    def gradient(self, nodal: Array) -> Array:
        """Return ∇ of P1 functions: nodal values (n,) or (n, r) → (t, 2) or (t, r, 2)."""
        return np.einsum("tk...,tkd->t...d", nodal[self.triangles], self.slopes)

    @cached_property
    def incidence(self) -> Any:
        """(n, t) with 1 where a node is a corner of a triangle."""
        import scipy.sparse as sp

        t = len(self.triangles)
        rows = self.triangles.ravel()
        columns = np.repeat(np.arange(t), 3)
        entries = sp.coo_array((np.ones(3 * t), (rows, columns)), shape=(len(self.points), t))
        return sp.csr_array(entries)

    def barycentric(self, points: Array, triangles: Indices | slice = slice(None)) -> Array:
        """Return (q, 3) barycentric coordinates of points (q, 2), or of one, in triangles.

        triangles: (q,) numbers, by default all
        """
        offset = points - self.centres[triangles]
        return 1.0 / 3.0 + np.einsum("tkd,td->tk", self.slopes[triangles], offset)
