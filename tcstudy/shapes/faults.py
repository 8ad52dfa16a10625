"""What is wrong with a body, found before the mesher sees it: with each closed chain of edges by itself (open, crossed,
clockwise, with slits or without area), and with holes and regions among one another.

The mesher hangs, crashes or silently meshes something else when the outline is open, crossed, clockwise or has
slivers; so a body is judged here first, and every fault is named with its place and its remedy.
Left out: faces read from STEP or BREP files, whose shape only their reader knows (see tcstudy.study.lint).

Snapping: corners of regions are meant to lie on the boundary of the body, or of one another, and miss it by rounding.
Six digits of a corner on a slanted edge miss it by 1e-7 of the body. The kernel would cut a sliver there, or take the
region's edge for a piece of the boundary. So corners of regions within NEAR of a corner or an edge are moved there, and
edges of regions that pass a corner of another loop so closely get a corner there. Arcs of regions stay as they are.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from tcstudy.scene.records import Body, Edge, Loop, Point, Region
from tcstudy.shapes.edges import (
    edge_arc,
    edge_distance,
    edge_length,
    edge_line,
    edge_normal,
    loop_area,
    loop_polygon,
    loop_size,
)

Array = NDArray[np.float64]

TOLERANCE = 1e-6
"""Shortest edge and smallest gap, relative to the size of the body."""

MAX_FAULTS = 20
"""Most faults of one kind that are named for one loop."""

LARGEST, SMALLEST = (bound**0.25 for bound in (sys.float_info.max, sys.float_info.min))
"""Numbers whose fourth powers, as shapes and energies need them, are still floating-point numbers."""

SHARPEST = 1e-4
"""Smallest angle of a corner [rad]."""


@dataclass(frozen=True)
class Fault:
    """What is wrong with a body: where ("body.outline[2]"), what, and what to do about it."""

    where: str
    what: str
    remedy: str


def coordinate_faults(loop: Loop, place: str) -> list[Fault]:
    """Coordinates that are not finite or whose products are not; to be looked for before anything else."""
    faults = []
    for i, edge in enumerate(loop.edges):
        points = (edge.start, edge.end) if edge.through is None else (edge.start, edge.end, edge.through)
        if not np.all(np.isfinite(points)):
            faults.append(Fault(_place(place, i), "a coordinate is not finite", "give finite numbers"))
        elif not faults and (largest := float(np.max(np.abs(points)))) > LARGEST:
            what = f"the coordinate {largest:.3g} is too large to compute with"
            faults.append(Fault(_place(place, i), what, "check the number and its unit"))
    if not faults and loop.edges and 0.0 < (size := rough_size(loop)) < SMALLEST:
        what = f"the size {size:.3g} is too small to compute with"
        faults.append(Fault(place, what, "check the numbers and their unit"))
    return faults


def _place(place: str, i: int) -> str:
    """Where edge i of a loop is in the study: only an outline's edges have entries of their own there."""
    return f"{place}[{i}]" if place == "body.outline" else place


def _label(loop: Loop, i: int) -> str:
    return f"edge {i + 1} ({loop.edges[i].name})"


def spot(point: ArrayLike) -> str:
    """A point in words."""
    x, y = np.asarray(point, dtype=float)
    return f"({x:.6g}, {y:.6g})"


def rough_size(loop: Loop) -> float:
    """Size of a loop that may be faulty: bounding box of the points that are given."""
    points = [point for e in loop.edges for point in (e.start, e.end, e.through or e.start)]
    return math.hypot(*(np.max(points, axis=0) - np.min(points, axis=0)))


def loop_faults(loop: Loop, place: str, size: float) -> list[Fault]:
    """Faults of one loop by itself; finer ones are looked for only when the coarser are absent."""
    for kind in (_chain_faults, _edge_faults, _vertex_faults, _crossing_faults, _corner_faults, _turn_faults):
        if faults := list(kind(loop, place, size)):
            return faults
    return []


def _chain_faults(loop: Loop, place: str, _: float) -> Iterator[Fault]:
    least = 2 if any(edge.through for edge in loop.edges) else 3
    if len(loop.edges) < least:
        yield Fault(place, f"{len(loop.edges)} edges do not enclose an area", f"give at least {least} edges")
        return
    for i, (edge, following) in enumerate(loop.corners):
        if edge.end != following.start:
            what = f"{_label(loop, i)} ends at {spot(edge.end)}, but the next begins at {spot(following.start)}"
            yield Fault(_place(place, i), what, "let every edge begin where the one before ends")


def _edge_faults(loop: Loop, place: str, size: float) -> Iterator[Fault]:
    """Edges of no length, and arcs whose three points do not make a circle."""
    for i, edge in enumerate(loop.edges):
        chord = math.dist(edge.start, edge.end)
        if chord <= TOLERANCE * size:
            what = f"{_label(loop, i)} has length {chord:.3g}" if chord else f"{_label(loop, i)} has no length"
            remedy = f"its ends must be more than {TOLERANCE * size:.3g} apart; remove a point, or split a full circle"
            yield Fault(_place(place, i), f"{what}: it ends where it begins, at {spot(edge.start)}", remedy)
        elif edge.through is not None:
            (ax, ay), (cx, cy) = np.subtract(edge.through, edge.start), np.subtract(edge.end, edge.start)
            if abs(ax * cy - ay * cx) <= TOLERANCE * chord * chord:
                what = f"the through-point {spot(edge.through)} of {_label(loop, i)} lies on the line of its ends"
                yield Fault(_place(place, i), what, "leave out through for a straight edge")


def _vertex_faults(loop: Loop, place: str, size: float) -> Iterator[Fault]:
    """Vertices that the loop passes twice."""
    vertices = shapely.points([edge.start for edge in loop.edges])
    pairs = shapely.STRtree(vertices).query(vertices, predicate="dwithin", distance=TOLERANCE * size)
    for i, j in _sorted_pairs(pairs)[:MAX_FAULTS]:
        what = f"the vertex {spot(loop.edges[j].start)} begins both {_label(loop, i)} and {_label(loop, j)}"
        yield Fault(_place(place, j), what, "the boundary must not touch itself: move one of the two")


def _sorted_pairs(pairs: NDArray[np.intp]) -> list[tuple[int, int]]:
    """The pairs (i, j) with i < j, in order."""
    return sorted((int(i), int(j)) for i, j in pairs.T if i < j)


def _crossing_faults(loop: Loop, place: str, size: float) -> Iterator[Fault]:
    """Pairs of edges that cross, touch or come closer than the tolerance away from a common vertex."""
    gap, lines, found = TOLERANCE * size, [edge_line(edge, size) for edge in loop.edges], 0
    for i, j in _sorted_pairs(shapely.STRtree(lines).query(lines, predicate="dwithin", distance=gap)):
        shared = [loop.edges[j].start] if j == i + 1 else []
        if (j + 1) % len(lines) == i:
            shared.append(loop.edges[i].start)
        meeting = shapely.shortest_line(lines[i], lines[j])
        if shared:
            common = shapely.intersection(lines[i], lines[j])
            meeting = shapely.difference(common, shapely.multipoints(shared).buffer(10.0 * gap))
        if len(points := shapely.get_coordinates(meeting)):
            what = f"{_label(loop, i)} and {_label(loop, j)} cross or touch at {spot(points[0])}"
            yield Fault(_place(place, i), what, "the boundary must not meet itself: check the order of points")
            if (found := found + 1) == MAX_FAULTS:
                return


def _corner_faults(loop: Loop, place: str, _: float) -> Iterator[Fault]:
    """Corners without an angle, where an edge runs back along the one before."""
    for i, (edge, following) in enumerate(loop.corners):
        arriving, leaving = edge_normal(edge, [edge.end])[0], edge_normal(following, [following.start])[0]
        turn = math.atan2(arriving[0] * leaving[1] - arriving[1] * leaving[0], float(arriving @ leaving))
        if abs(turn) > math.pi - SHARPEST:
            j = (i + 1) % len(loop.edges)
            what = f"{_label(loop, j)} runs back along {_label(loop, i)} from {spot(edge.end)}"
            yield Fault(_place(place, j), what, "give the corner an angle")


def _turn_faults(loop: Loop, place: str, _: float) -> Iterator[Fault]:
    if loop_area(loop) > 0.0:
        return
    what, remedy = "the points run clockwise", "reverse the order of the points: counter-clockwise is expected"
    if loop_area(Loop(tuple(replace(edge, through=None) for edge in loop.edges))) > 0.0:
        what = "an arc goes around the body on its wrong side: the points run counter-clockwise, the boundary clockwise"
        remedy = "an edge's through lies between its from and the from of the next edge"
    yield Fault(place, what, remedy)


def has_edges(loop: Loop) -> bool:
    """Whether every edge of a loop has a length and every arc a circle, whatever the loop encloses."""
    if not loop.edges or coordinate_faults(loop, ""):
        return False
    return not [fault for kind in (_chain_faults, _edge_faults) for fault in kind(loop, "", rough_size(loop))]


def turned(loop: Loop) -> Loop:
    """The loop with its edges the other way round if it is clockwise and nothing else is wrong with it."""
    if not has_edges(loop) or loop_area(loop) >= 0.0:
        return loop
    edges = (replace(edge, start=edge.end, end=edge.start) for edge in reversed(loop.edges))
    other = Loop(tuple(edges), turned=True)
    straight = Loop(tuple(replace(edge, through=None) for edge in loop.edges))
    wrong_arc = len(loop.edges) > 2 and loop_area(straight) > 0.0
    return loop if wrong_arc or loop_faults(other, "", rough_size(other)) else other


def check_body(body: Body) -> list[Fault]:
    """Everything that is wrong with a body and its regions; empty if it can be meshed.

    Lengths are compared with the size of the body. Holes and regions are compared with one another and with the
    outline only where each is sound by itself.
    """
    outline = [] if body.outline is None else [("body.outline", body.outline)]
    named = [(f"body.regions.{region.name}", region.loop) for region in body.regions]
    first = outline or named  # where the body is not known yet, its regions alone
    faults = [fault for place, loop in first for fault in coordinate_faults(loop, place)]
    if faults or not first:
        return faults
    if body.outline is not None and not body.outline.edges:
        return [Fault("body.outline", "the outline has no edge", "give at least three edges")]
    size = max(rough_size(loop) for _, loop in first)
    gap = TOLERANCE * size
    wrong, shapes = _sound(outline, size)
    others, holes = _sound([(f"body.holes[{i}]", hole) for i, hole in enumerate(body.holes)], size)
    more, regions = _sound(named, size)
    faults = [*wrong, *others, *more]
    if not outline:
        return [*faults, *_overlap_faults(regions, gap)]
    for _, shape in shapes:
        faults += [*_hole_faults(shape, holes, gap), *_region_faults(shape, holes, regions, gap)]
    return faults


def _sound(named: list[tuple[str, Loop]], size: float) -> tuple[list[Fault], list[_Named]]:
    """What is wrong with each of some loops by itself, and the others as polygons."""
    faults: list[Fault] = []
    sound: list[_Named] = []
    for place, loop in named:
        own = coordinate_faults(loop, place) or loop_faults(loop, place, size)
        faults += own
        sound += [] if own else [(place, loop_polygon(loop, size))]
    return faults, sound


_Named = tuple[str, BaseGeometry]


def _hole_faults(outline: BaseGeometry, holes: list[_Named], gap: float) -> Iterator[Fault]:
    """Holes outside the body, across or at its outline, or at one another."""
    for place, hole in holes:
        point = spot(shapely.get_coordinates(shapely.shortest_line(hole.exterior, outline.exterior))[0])
        if shapely.dwithin(hole.exterior, outline.exterior, gap):
            remedy = "keep holes inside, or draw the outline around the notch"
            yield Fault(place, f"the hole touches or crosses the outline at {point}", remedy)
        elif not shapely.contains(outline, hole):
            where = "surrounds" if shapely.contains(hole, outline) else "lies outside"
            yield Fault(place, f"the hole {where} the body", "move it inside the outline")
    for (first, a), (second, b) in combinations(holes, 2):
        if shapely.dwithin(a, b, gap):
            point = spot(shapely.get_coordinates(shapely.shortest_line(b, a))[0])
            remedy = "move them apart, or draw them as one hole"
            yield Fault(second, f"the hole overlaps or touches {first} at {point}", remedy)


def _region_faults(outline: BaseGeometry, holes: list[_Named], regions: list[_Named], gap: float) -> Iterator[Fault]:
    """Regions that leave the body, overlap a hole or one another; they may share boundary with all of these."""
    for place, region in regions:
        slack = min(gap * region.length, 0.1 * region.area)
        outside = shapely.difference(region, outline)
        if shapely.intersection(region, outline).area <= slack:
            yield Fault(place, "the region lies outside the body", "move it inside the outline")
        elif outside.area > slack:
            remedy = "keep it within the outline; it may end on it"
            yield Fault(place, f"the region leaves the body near {_inside(outside)}", remedy)
        for hole, shape in holes:
            common = shapely.intersection(region, shape)
            if common.area > slack:
                remedy = "keep it clear of holes; it may end at their edges"
                yield Fault(place, f"the region overlaps {hole} near {_inside(common)}", remedy)
    yield from _overlap_faults(regions, gap)


def _overlap_faults(regions: list[_Named], gap: float) -> Iterator[Fault]:
    """Regions that overlap one another; they may share boundary."""
    for (first, a), (second, b) in combinations(regions, 2):
        common = shapely.intersection(a, b)
        if common.area > min(gap * a.length, gap * b.length, 0.1 * a.area, 0.1 * b.area):
            remedy = "regions must not overlap; they may share an edge"
            yield Fault(second, f"the region overlaps {first} near {_inside(common)}", remedy)


def _inside(shape: BaseGeometry) -> str:
    return spot(shapely.get_coordinates(shapely.point_on_surface(shape))[0])


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
            edge = targets[int(away[:, i].argmin())]
            if (arc := edge_arc(edge)) is None:
                begin, chord = np.array(edge.start), np.subtract(edge.end, edge.start)
                x, y = begin + chord * float((point - begin) @ chord / (chord @ chord))
            else:
                radial = point - arc.center
                x, y = arc.center + arc.radius * radial / np.linalg.norm(radial)
            own = float(x), float(y)
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
