"""Plane shapes: loops of lines and circular arcs, their exact measures and normals, and what is wrong with a body.

The mesher hangs, crashes or silently meshes something else when the outline is open, crossed, clockwise or has
slivers; so a body is judged here first, and every fault is named with its place and its remedy.
Left out on purpose: faces read from STEP or BREP files, which only their reader can judge.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from tcstudy.scene.records import Body, Edge, Loop, Point

Array = NDArray[np.float64]

TOLERANCE = 1e-6
"""Shortest edge and smallest gap, relative to the size of the body."""
FLATNESS = 1e-7
"""Largest distance of an arc from its polygon in the checks, relative to the size of the body."""
MAX_SEGMENTS = 20_000
"""Most straight pieces of one arc in the checks."""
MAX_FAULTS = 20
"""Most faults of one kind that are named for one loop."""
SHARPEST = 1e-4
"""Smallest angle of a corner [rad]."""


@dataclass(frozen=True)
class Fault:
    """What is wrong with a body: where ("body.outline[2]"), what, and what to do about it."""

    where: str
    what: str
    remedy: str


@dataclass(frozen=True)
class Arc:
    """A circular arc: centre, radius, angle of its start and the angle it sweeps, positive counter-clockwise."""

    center: Point
    radius: float
    start: float
    sweep: float


def circle_loop(center: Point, radius: float, name: str) -> Loop:
    """A full circle as two half circles of one name; ValueError unless the radius is positive and finite."""
    _positive("radius", radius)
    x, y = center
    right, top, left, bottom = (x + radius, y), (x, y + radius), (x - radius, y), (x, y - radius)
    return Loop((Edge(right, left, name, through=top), Edge(left, right, name, through=bottom)))


def rectangle_loop(
    corner: Point,
    width: float,
    height: float,
    names: Sequence[str] = ("bottom", "right", "top", "left"),
) -> Loop:
    """An upright rectangle from its lower left corner; ValueError unless width and height are positive.

    names: of the bottom, right, top and left edge
    """
    _positive("width", width)
    _positive("height", height)
    (x, y), (x1, y1) = corner, (corner[0] + width, corner[1] + height)
    return polygon_loop([(x, y), (x1, y), (x1, y1), (x, y1)], names)


def polygon_loop(points: Sequence[Point], names: str | Sequence[str]) -> Loop:
    """A polygon; edge i leads from point i to the next. `names` is one for each edge, or one for all."""
    each = [names] * len(points) if isinstance(names, str) else list(names)
    following = [*points[1:], *points[:1]]
    return Loop(tuple(Edge(a, b, name) for a, b, name in zip(points, following, each, strict=True)))


def _positive(name: str, value: float) -> None:
    if not 0.0 < value < math.inf:
        raise ValueError(f"{name} must be positive and finite, not {value:g}")


def edge_arc(edge: Edge) -> Arc | None:
    """The arc of an edge, from start, through-point and end; None if the edge is straight.

    The sweep is 2·atan2(a × b, a · b) with the chords a = through − start, b = end − through (inscribed angle).
    Raises ValueError if the three points lie on a line.
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
    """Exact length of a line or an arc."""
    arc = edge_arc(edge)
    return math.dist(edge.start, edge.end) if arc is None else arc.radius * abs(arc.sweep)


def edge_points(edge: Edge, count: int) -> Array:
    """(count+1, 2) points on the edge at equal distances, its two ends included exactly."""
    t = np.linspace(0.0, 1.0, count + 1)[:, None]
    start, end = np.array(edge.start), np.array(edge.end)
    arc = edge_arc(edge)
    if arc is None:
        points: Array = start + t * (end - start)
    else:
        angle = arc.start + t * arc.sweep
        points = np.array(arc.center) + arc.radius * np.hstack([np.cos(angle), np.sin(angle)])
    points[0], points[-1] = start, end
    return points


def edge_normal(edge: Edge, points: ArrayLike) -> Array:
    """(n, 2) unit normals at (n, 2) points on the edge, to its right: outward for a counter-clockwise loop.

    Exact for lines and arcs. On a hole they point out of the hole, into the body.
    """
    points = np.asarray(points, dtype=float)
    arc = edge_arc(edge)
    if arc is None:
        dx, dy = _minus(edge.end, edge.start)
        return np.broadcast_to(np.array([dy, -dx]) / math.hypot(dx, dy), points.shape).copy()
    radial = (points - np.array(arc.center)) * math.copysign(1.0, arc.sweep)
    normal: Array = radial / np.linalg.norm(radial, axis=1, keepdims=True)
    return normal


def edge_distance(edge: Edge, points: ArrayLike) -> Array:
    """(n,) exact distances of (n, 2) points from the line or arc, its ends included."""
    points, start, end = np.asarray(points, dtype=float), np.array(edge.start), np.array(edge.end)
    arc = edge_arc(edge)
    distance: Array
    if arc is None:
        chord = end - start
        t = np.clip((points - start) @ chord / (chord @ chord), 0.0, 1.0)
        distance = np.linalg.norm(points - start - t[:, None] * chord, axis=1)
        return distance
    radial = points - np.array(arc.center)
    swept = math.copysign(1.0, arc.sweep) * (np.arctan2(radial[:, 1], radial[:, 0]) - arc.start) % (2.0 * math.pi)
    ends = np.minimum(np.linalg.norm(points - start, axis=1), np.linalg.norm(points - end, axis=1))
    off = np.abs(np.linalg.norm(radial, axis=1) - arc.radius)
    distance = np.where(swept <= abs(arc.sweep), off, ends)
    return distance


def loop_area(loop: Loop) -> float:
    """Exact area, negative if the loop is clockwise: polygon of the vertices plus the segments under the arcs."""
    origin = loop.edges[0].start
    area = 0.0
    for edge in loop.edges:
        (ax, ay), (bx, by) = _minus(edge.start, origin), _minus(edge.end, origin)
        area += 0.5 * (ax * by - ay * bx)
        arc = edge_arc(edge)
        if arc is not None:
            area += 0.5 * arc.radius**2 * (arc.sweep - math.sin(arc.sweep))
    return area


def body_area(body: Body) -> float:
    """Exact area of the outline less its holes."""
    return loop_area(_outline(body)) - sum(loop_area(hole) for hole in body.holes)


def body_size(body: Body) -> float:
    """Diagonal of the bounding box of the outline, arcs included exactly."""
    return loop_size(_outline(body))


def loop_size(loop: Loop) -> float:
    """Diagonal of the bounding box, arcs included exactly."""
    points = [point for edge in loop.edges for point in (edge.start, *_extremes(edge))]
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    return math.hypot(*(high - low))


def boundary_lengths(body: Body) -> dict[str, float]:
    """Exact total length of the edges of each name, outline and holes, in the order of the study."""
    lengths: dict[str, float] = {}
    for loop in (_outline(body), *body.holes):
        for edge in loop.edges:
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


def check_body(body: Body) -> list[Fault]:
    """Everything that is wrong with a body and its regions; empty if it can be meshed.

    Lengths are compared with the size of the body. Holes and regions are compared with one another and with the
    outline only where each is sound by itself.
    """
    if body.outline is None:
        return []
    faults = _coordinate_faults(body.outline, "body.outline")
    if faults or not body.outline.edges:
        return faults or [Fault("body.outline", "the outline has no edge", "give at least three edges")]
    size = _rough_size(body.outline)
    faults = _loop_faults(body.outline, "body.outline", size)
    places = [f"body.holes[{i}]" for i in range(len(body.holes))]
    places += [f"body.regions.{region.name}" for region in body.regions]
    shapes: list[BaseGeometry | None] = []
    for loop, place in zip((*body.holes, *(region.loop for region in body.regions)), places, strict=True):
        own = _coordinate_faults(loop, place) or _loop_faults(loop, place, size)
        faults += own
        shapes.append(None if own else _polygon(loop, size))
    if any(fault.where.startswith("body.outline") for fault in faults):
        return faults
    outline, count = _polygon(body.outline, size), len(body.holes)
    gap = TOLERANCE * size
    holes = [(place, shape) for place, shape in zip(places[:count], shapes[:count], strict=True) if shape]
    regions = [(place, shape) for place, shape in zip(places[count:], shapes[count:], strict=True) if shape]
    return faults + _hole_faults(outline, holes, gap) + _region_faults(outline, holes, regions, gap)


def _coordinate_faults(loop: Loop, place: str) -> list[Fault]:
    faults = []
    for i, edge in enumerate(loop.edges):
        points = (edge.start, edge.end) if edge.through is None else (edge.start, edge.end, edge.through)
        if not np.all(np.isfinite(points)):
            faults.append(Fault(_place(place, i), "a coordinate is not finite", "give finite numbers"))
    return faults


def _place(place: str, i: int) -> str:
    """Where edge i of a loop is in the study: only an outline's edges have entries of their own there."""
    return f"{place}[{i}]" if place == "body.outline" else place


def _label(loop: Loop, i: int) -> str:
    return f"edge {i + 1} ({loop.edges[i].name})"


def _at(point: ArrayLike) -> str:
    x, y = np.asarray(point, dtype=float)
    return f"({x:.6g}, {y:.6g})"


def _rough_size(loop: Loop) -> float:
    """Size of a loop that may be faulty: bounding box of the points that are given."""
    points = [point for e in loop.edges for point in (e.start, e.end, e.through or e.start)]
    return math.hypot(*(np.max(points, axis=0) - np.min(points, axis=0)))


def _loop_faults(loop: Loop, place: str, size: float) -> list[Fault]:
    """Faults of one loop by itself; finer ones are looked for only when the coarser are absent."""
    return (
        _chain_faults(loop, place)
        or _edge_faults(loop, place, size)
        or _vertex_faults(loop, place, size)
        or _crossing_faults(loop, place, size)
        or _corner_faults(loop, place)
        or _turn_faults(loop, place)
    )


def _chain_faults(loop: Loop, place: str) -> list[Fault]:
    edges = loop.edges
    least = 2 if any(edge.through for edge in edges) else 3
    if len(edges) < least:
        return [Fault(place, f"{len(edges)} edges do not enclose an area", f"give at least {least} edges")]
    faults = []
    for i, edge in enumerate(edges):
        following = (i + 1) % len(edges)
        if edge.end != edges[following].start:
            what = f"{_label(loop, i)} ends at {_at(edge.end)}, but the next begins at {_at(edges[following].start)}"
            faults.append(Fault(_place(place, i), what, "let every edge begin where the one before ends"))
    return faults


def _edge_faults(loop: Loop, place: str, size: float) -> list[Fault]:
    """Edges of no length, and arcs whose three points do not make a circle."""
    faults = []
    for i, edge in enumerate(loop.edges):
        chord = math.dist(edge.start, edge.end)
        if chord <= TOLERANCE * size:
            what = f"{_label(loop, i)} has length {chord:.3g}" if chord else f"{_label(loop, i)} has no length"
            remedy = f"its ends must be more than {TOLERANCE * size:.3g} apart; remove a point, or split a full circle"
            faults.append(Fault(_place(place, i), f"{what}: it ends where it begins, at {_at(edge.start)}", remedy))
        elif edge.through is not None:
            (ax, ay), (cx, cy) = _minus(edge.through, edge.start), _minus(edge.end, edge.start)
            if abs(ax * cy - ay * cx) <= TOLERANCE * chord * chord:
                what = f"the through-point {_at(edge.through)} of {_label(loop, i)} lies on the line of its ends"
                faults.append(Fault(_place(place, i), what, "leave out through for a straight edge"))
    return faults


def _vertex_faults(loop: Loop, place: str, size: float) -> list[Fault]:
    """Vertices that the loop passes twice."""
    vertices = shapely.points([edge.start for edge in loop.edges])
    pairs = shapely.STRtree(vertices).query(vertices, predicate="dwithin", distance=TOLERANCE * size)
    faults = []
    for i, j in _sorted_pairs(pairs)[:MAX_FAULTS]:
        what = f"the vertex {_at(loop.edges[j].start)} begins both {_label(loop, i)} and {_label(loop, j)}"
        faults.append(Fault(_place(place, j), what, "the boundary must not touch itself: move one of the two"))
    return faults


def _sorted_pairs(pairs: NDArray[np.intp]) -> list[tuple[int, int]]:
    """The pairs (i, j) with i < j, in order."""
    return sorted((int(i), int(j)) for i, j in pairs.T if i < j)


def _line(edge: Edge, size: float) -> BaseGeometry:
    """The edge as a fine polygonal line: no farther than FLATNESS · size from an arc."""
    arc = edge_arc(edge)
    count = 1
    if arc is not None:
        count = 8 + math.ceil(abs(arc.sweep) * math.sqrt(arc.radius / (8.0 * FLATNESS * size)))
        count = min(count, MAX_SEGMENTS)
    return shapely.linestrings(edge_points(edge, count))


def _polygon(loop: Loop, size: float) -> BaseGeometry:
    lines = [shapely.get_coordinates(_line(edge, size))[:-1] for edge in loop.edges]
    polygon = shapely.polygons(np.vstack(lines))
    shapely.prepare(polygon)
    return polygon


def _crossing_faults(loop: Loop, place: str, size: float) -> list[Fault]:
    """Pairs of edges that cross, touch or come closer than the tolerance away from a common vertex."""
    gap = TOLERANCE * size
    lines = [_line(edge, size) for edge in loop.edges]
    pairs = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=gap)
    faults: list[Fault] = []
    for i, j in _sorted_pairs(pairs):
        point = _meeting(loop, lines, i, j, gap)
        if point is not None and len(faults) < MAX_FAULTS:
            what = f"{_label(loop, i)} and {_label(loop, j)} cross or touch at {_at(point)}"
            faults.append(Fault(_place(place, i), what, "the boundary must not meet itself: check the order of points"))
    return faults


def _meeting(loop: Loop, lines: list[BaseGeometry], i: int, j: int, gap: float) -> Array | None:
    """A point at which edges i < j meet, other than a vertex they share; None if there is none."""
    shared = [loop.edges[j].start] if j == i + 1 else []
    if (j + 1) % len(lines) == i:
        shared.append(loop.edges[i].start)
    meeting = shapely.shortest_line(lines[i], lines[j])
    if shared:
        common = shapely.intersection(lines[i], lines[j])
        meeting = shapely.difference(common, shapely.multipoints(shared).buffer(10.0 * gap))
    points: Array = shapely.get_coordinates(meeting)
    return points[0] if len(points) else None


def _corner_faults(loop: Loop, place: str) -> list[Fault]:
    """Corners without an angle, where an edge runs back along the one before."""
    faults = []
    for i, (edge, following) in enumerate(pairwise((*loop.edges, loop.edges[0]))):
        arriving, leaving = edge_normal(edge, [edge.end])[0], edge_normal(following, [following.start])[0]
        turn = math.atan2(arriving[0] * leaving[1] - arriving[1] * leaving[0], float(arriving @ leaving))
        if abs(turn) > math.pi - SHARPEST:
            j = (i + 1) % len(loop.edges)
            what = f"{_label(loop, j)} runs back along {_label(loop, i)} from {_at(edge.end)}"
            faults.append(Fault(_place(place, j), what, "give the corner an angle"))
    return faults


def _turn_faults(loop: Loop, place: str) -> list[Fault]:
    if loop_area(loop) > 0.0:
        return []
    return [Fault(place, "the points run clockwise", "reverse the order of the points: counter-clockwise is expected")]


_Named = tuple[str, BaseGeometry]


def _hole_faults(outline: BaseGeometry, holes: list[_Named], gap: float) -> list[Fault]:
    """Holes outside the body, across or at its outline, or at one another."""
    faults = []
    for place, hole in holes:
        point = _at(shapely.get_coordinates(shapely.shortest_line(hole.exterior, outline.exterior))[0])
        if shapely.dwithin(hole.exterior, outline.exterior, gap):
            faults.append(Fault(place, f"the hole touches or crosses the outline at {point}",
                                "keep holes inside, or draw the outline around the notch"))  # fmt: skip
        elif not shapely.contains(outline, hole):
            what = (
                "the hole surrounds the body" if shapely.contains(hole, outline) else "the hole lies outside the body"
            )
            faults.append(Fault(place, what, "move it inside the outline"))
    for (first, a), (second, b) in combinations(holes, 2):
        if shapely.dwithin(a, b, gap):
            point = _at(shapely.get_coordinates(shapely.shortest_line(b, a))[0])
            faults.append(Fault(second, f"the hole overlaps or touches {first} at {point}",
                                "move them apart, or draw them as one hole"))  # fmt: skip
    return faults


def _region_faults(outline: BaseGeometry, holes: list[_Named], regions: list[_Named], gap: float) -> list[Fault]:
    """Regions that leave the body, overlap a hole or one another; they may share boundary with all of these."""
    faults = []
    for place, region in regions:
        slack = min(gap * region.length, 0.1 * region.area)
        outside = shapely.difference(region, outline)
        if shapely.intersection(region, outline).area <= slack:
            faults.append(Fault(place, "the region lies outside the body", "move it inside the outline"))
        elif outside.area > slack:
            faults.append(Fault(place, f"the region leaves the body near {_inside(outside)}",
                                "keep it within the outline; it may end on it"))  # fmt: skip
        for hole, shape in holes:
            common = shapely.intersection(region, shape)
            if common.area > slack:
                faults.append(Fault(place, f"the region overlaps {hole} near {_inside(common)}",
                                    "keep it clear of holes; it may end at their edges"))  # fmt: skip
    for (first, a), (second, b) in combinations(regions, 2):
        common = shapely.intersection(a, b)
        if common.area > min(gap * a.length, gap * b.length, 0.1 * a.area, 0.1 * b.area):
            faults.append(Fault(second, f"the region overlaps {first} near {_inside(common)}",
                                "regions must not overlap; they may share an edge"))  # fmt: skip
    return faults


def _inside(shape: BaseGeometry) -> str:
    return _at(shapely.get_coordinates(shapely.point_on_surface(shape))[0])
