"""Plane shapes: loops of lines and circular arcs, their exact measures, distances and normals;
polygons close to them, and points inside a body at which expressions are looked at.

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
SHIFT = 0.38
"""Where the points lie between lines of the grid: not in the middle, where symmetric functions
vanish or bend."""

INWARD = 1e-10
"""Share of the body's size, or of a grid's width, by which points lie off edges and kinks where
slopes are taken: there abs(y) or atan2 may round to the other side."""


@dataclass(frozen=True)
class Arc:
    """A circular arc; start: the angle where it begins;  sweep: positive counter-clockwise"""

    center: Point
    radius: float
    start: float
    sweep: float


@dataclass(frozen=True)
class Side:
    """What leaves a corner: name of an edge and tag of its piece, no name of an interface; its unit
    tangent there."""

    name: str
    away: Point
    tag: str = ""


@dataclass(frozen=True)
class Junction:
    """Where pieces of the boundary, or interfaces of regions, end.

    sides:  what leaves it, counter-clockwise, the body counter-clockwise of the first and clockwise of the last
    wedges: opening angle [rad] and region between each side and the next one; within the body also behind the last
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
        """Whether it is a corner of interfaces alone, which may end at one piece of the
        boundary."""
        return self.within or self.sides[0].tag == self.sides[-1].tag


def circle_loop(center: Point, radius: float, name: str) -> Loop:
    """A full circle of positive radius as two half circles of one name."""
    x, y = center
    right, top, left, bottom = (x + radius, y), (x, y + radius), (x - radius, y), (x, y - radius)
    return Loop((Edge(right, left, name, through=top), Edge(left, right, name, through=bottom)))


SIDES = ("bottom", "right", "top", "left")


def rectangle_loop(
    corner: Point, width: float, height: float, names: Sequence[str] = SIDES
) -> Loop:
    """An upright rectangle from its lower left corner."""
    (x, y), (x1, y1) = corner, (corner[0] + width, corner[1] + height)
    return polygon_loop([(x, y), (x1, y), (x1, y1), (x, y1)], names)


def polygon_loop(points: Sequence[Point], names: str | Sequence[str]) -> Loop:
    """A polygon; edge i leads from point i to the next. `names` is one for each edge, or one for
    all."""
    each = [names] * len(points) if isinstance(names, str) else list(names)
    following = [*points[1:], *points[:1]]
    return Loop(tuple(Edge(a, b, name) for a, b, name in zip(points, following, each, strict=True)))


def edge_arc(edge: Edge) -> Arc | None:
    """The arc of an edge, from start, through-point and end; None if the edge is straight.

    The sweep is 2·atan2(a × b, a · b) with the chords a = through − start, b = end − through
    (inscribed angle). Raises ValueError if the three points lie on a line.
    """
    if edge.through is None:
        return None
    (ax, ay), (bx, by) = _minus(edge.through, edge.start), _minus(edge.end, edge.through)
    cx, cy = ax + bx, ay + by
    cross = ax * by - ay * bx
    if cross == 0.0:
        raise ValueError("start, through and end of an arc lie on a line")
    aa, cc = ax * ax + ay * ay, cx * cx + cy * cy
    ux, uy = (cy * aa - ay * cc) / (2.0 * cross), (ax * cc - cx * aa) / (2.0 * cross)
    radius = math.hypot(ax, ay) * math.hypot(bx, by) * math.hypot(cx, cy) / (2.0 * abs(cross))
    center = (edge.start[0] + ux, edge.start[1] + uy)
    return Arc(center, radius, math.atan2(-uy, -ux), 2.0 * math.atan2(cross, ax * bx + ay * by))


def edge_length(edge: Edge) -> float:
    arc = edge_arc(edge)
    return math.dist(edge.start, edge.end) if arc is None else arc.radius * abs(arc.sweep)


def edge_at(edge: Edge, t: Array) -> Array:
    """(n, 2) points at the shares t (n,) of the length of a line or an arc."""
    arc, t = edge_arc(edge), t[:, None]
    if arc is None:
        start, end = np.array(edge.start), np.array(edge.end)
        return np.asarray(start + t * (end - start))
    angle = arc.start + t * arc.sweep
    return np.asarray(np.array(arc.center) + arc.radius * np.hstack([np.cos(angle), np.sin(angle)]))


def edge_points(edge: Edge, count: int) -> Array:
    """(count+1, 2) points on the edge at equal distances, its two ends included exactly."""
    points = edge_at(edge, np.linspace(0.0, 1.0, count + 1))
    points[0], points[-1] = edge.start, edge.end
    return points


def edge_normal(edge: Edge, points: ArrayLike) -> Array:
    """(n, 2) unit normals at (n, 2) points on the edge, to its right: outward for a
    counter-clockwise loop.

    Exact for lines and arcs. On a hole they point out of the hole, into the body.
    """
    points = np.asarray(points, dtype=float)
    arc = edge_arc(edge)
    if arc is None:
        dx, dy = _minus(edge.end, edge.start)
        return np.broadcast_to(np.array([dy, -dx]) / math.hypot(dx, dy), points.shape).copy()
    radial = (points - np.array(arc.center)) * math.copysign(1.0, arc.sweep)
    return np.asarray(radial / np.linalg.norm(radial, axis=1, keepdims=True))


def edge_distance(edge: Edge, points: ArrayLike) -> Array:
    """(n,) exact distances of (n, 2) points from the line or arc, its ends included."""
    points, start, end = np.asarray(points, dtype=float), np.array(edge.start), np.array(edge.end)
    arc = edge_arc(edge)
    if arc is None:
        chord = end - start
        t = np.clip((points - start) @ chord / (chord @ chord), 0.0, 1.0)
        return np.asarray(np.linalg.norm(points - start - t[:, None] * chord, axis=1))
    radial = points - np.array(arc.center)
    swept = (
        math.copysign(1.0, arc.sweep)
        * (np.arctan2(radial[:, 1], radial[:, 0]) - arc.start)
        % (2.0 * math.pi)
    )
    ends = np.minimum(np.linalg.norm(points - start, axis=1), np.linalg.norm(points - end, axis=1))
    off = np.abs(np.linalg.norm(radial, axis=1) - arc.radius)
    return np.where(swept <= abs(arc.sweep), off, ends)


def loop_area(loop: Loop) -> float:
    """Exact area, negative if the loop is clockwise: polygon of the vertices plus the segments
    under the arcs."""
    area, origin = 0.0, loop.edges[0].start
    for edge in loop.edges:
        (ax, ay), (bx, by) = _minus(edge.start, origin), _minus(edge.end, origin)
        area += 0.5 * (ax * by - ay * bx)
        arc = edge_arc(edge)
        if arc is not None:
            area += 0.5 * arc.radius**2 * (arc.sweep - math.sin(arc.sweep))
    return area


def body_area(body: Body) -> float:
    return loop_area(_outline(body)) - sum(loop_area(hole) for hole in body.holes)


def body_size(body: Body) -> float:
    """Diagonal of the bounding box of the outline, arcs included exactly."""
    return loop_size(_outline(body))


def loop_size(loop: Loop) -> float:
    points = [point for edge in loop.edges for point in (edge.start, *_extremes(edge))]
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    return math.hypot(*(high - low))


def boundary_lengths(body: Body) -> dict[str, float]:
    """Exact total length of the edges of each name, outline and holes, in the order of the
    study."""
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
    """The points of an arc with a level or upright tangent, where its bounding box may touch."""
    arc = edge_arc(edge)
    if arc is None:
        return []
    first, last = sorted((arc.start, arc.start + arc.sweep))
    quarters = range(math.ceil(first / (math.pi / 2)), math.floor(last / (math.pi / 2)) + 1)
    unit = ((1, 0), (0, 1), (-1, 0), (0, -1))
    (x, y), r = arc.center, arc.radius
    return [(x + r * unit[i % 4][0], y + r * unit[i % 4][1]) for i in quarters]


def edge_line(edge: Edge, size: float) -> BaseGeometry:
    """The edge as a fine polygonal line: no farther than FLATNESS · size from an arc."""
    arc = edge_arc(edge)
    exact = (
        math.ceil(abs(arc.sweep) * math.sqrt(arc.radius / (8.0 * FLATNESS * size))) if arc else 0
    )
    count = min(8 + exact, MAX_SEGMENTS) if arc else 1
    return shapely.linestrings(edge_points(edge, count))


def loop_polygon(loop: Loop, size: float) -> BaseGeometry:
    """The loop as a polygon; arcs deviate by at most FLATNESS·size."""
    lines = [shapely.get_coordinates(edge_line(edge, size))[:-1] for edge in loop.edges]
    polygon = shapely.polygons(np.vstack(lines))
    shapely.prepare(polygon)
    return polygon


def body_polygon(body: Body) -> BaseGeometry:
    whole, *holes = (loop_polygon(loop, loop_size(loop)) for loop in (_outline(body), *body.holes))
    polygon = shapely.difference(whole, shapely.union_all(holes)) if holes else whole
    shapely.prepare(polygon)
    return polygon


def grid(body: Body, count: int = GRID) -> tuple[Array, Array, NDArray[np.bool_]]:
    """A grid over the bounding box, x and y (count, count), and which of its points lie inside the
    body."""
    polygon = body_polygon(body)
    x0, y0, x1, y1 = polygon.bounds
    t = (np.arange(count) + SHIFT) / count
    x, y = np.meshgrid(x0 + t * (x1 - x0), y0 + t * (y1 - y0))
    return x, y, np.asarray(shapely.contains_xy(polygon, x, y))


def inside(body: Body) -> Array:
    """(n, 2) points inside the body."""
    x, y, within = grid(body)
    return np.column_stack([x[within], y[within]])


Indices = NDArray[np.intp]

INNER = np.full((3, 3), 1 / 6) + 0.5 * np.eye(3)
"""Barycentric points of a quadrature that is exact for degree 2, with a third of the area each."""
GAUSS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
"""Points on a segment from 0 to 1, of weight ½ each, exact for degree 3."""


def doubled_areas(corners: Array) -> Array:
    """Twice the signed areas of triangles given by their corners (t, 3, 2)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def segment_mass(ends: Indices, lengths: Array, size: int) -> Array:
    """(size, size) ∫φ_iφ_j of P1 over segments. ends: (s, 2) numbers of their nodes, −1 for one
    that is left out"""
    M = np.zeros((size + 1, size + 1))  # what is left out goes to the last row
    for i in (0, 1):
        for j in (0, 1):
            np.add.at(M, (ends[:, i], ends[:, j]), lengths / (3.0 if i == j else 6.0))
    return M[:-1, :-1]


@dataclass(frozen=True, eq=False)
class TriangleGeometry:
    """points: (n, 2) nodes [m];  triangles: (t, 3), counter-clockwise"""

    points: Array
    triangles: Indices

    @cached_property
    def sides(self) -> Indices:
        """(3t, 2) nodes of the sides, the triangle on their left: side 3i + k of triangle i leads
        from its corner k."""
        return self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)

    @cached_property
    def edges(self) -> tuple[Indices, Indices]:
        """(e, 2) the edges, ends ascending, and (t, 3) those of every triangle in the order of
        `sides`."""
        edges, of = np.unique(np.sort(self.sides, axis=1), axis=0, return_inverse=True)
        return edges, of.reshape(-1, 3)

    def sides_at(self, pairs: Indices) -> Indices:
        """(s,) which of the sides leads from one node to the other of pairs (s, 2); −1 where none
        does."""
        n = len(self.points)
        keys, wanted = self.sides[:, 0] * n + self.sides[:, 1], pairs[:, 0] * n + pairs[:, 1]
        order = np.argsort(keys)
        found = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)]
        return np.where(keys[found] == wanted, found, -1)

    @cached_property
    def corners(self) -> Array:
        """(t, 3, 2) [m]."""
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
        """(t,) [m²]."""
        return 0.5 * doubled_areas(self.corners)

    @cached_property
    def slopes(self) -> Array:
        """(t, 3, 2) gradients of the three hat functions of each triangle [1/m]."""
        opposite = np.roll(self.corners, -2, axis=1) - np.roll(self.corners, -1, axis=1)
        turned = np.stack([-opposite[..., 1], opposite[..., 0]], axis=-1)
        return turned / (2.0 * self.area)[:, None, None]

    def gradient(self, nodal: Array) -> Array:
        """∇ of P1 functions: nodal values (n,) or (n, r) → (t, 2) or (t, r, 2)."""
        return np.einsum("tk...,tkd->t...d", nodal[self.triangles], self.slopes)

    @cached_property
    def incidence(self) -> Any:
        """(n, t) with 1 where a node is a corner of a triangle."""
        t = len(self.triangles)
        entries = np.ones(3 * t), (self.triangles.ravel(), np.repeat(np.arange(t), 3))
        import scipy.sparse as sp

        return sp.csr_array(sp.coo_array(entries, shape=(len(self.points), t)))

    def barycentric(self, at: Array, of: Indices | slice = slice(None)) -> Array:
        """(q, 3) barycentric coordinates of points (q, 2), or of one, in the triangles `of`, by
        default all."""
        return 1.0 / 3.0 + np.einsum("tkd,td->tk", self.slopes[of], at - self.centres[of])
