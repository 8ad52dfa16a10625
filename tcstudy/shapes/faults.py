"""Faults of a body, reported before the mesher sees it, and snapping of regions.

Each closed chain of edges is checked by itself (open, crossed, clockwise, with slits or without
area), then holes and regions among one another.

The mesher hangs, crashes or silently meshes something else when the outline is open, crossed,
clockwise or has slivers. So a body is judged here first, and every fault is named with its place
and its remedy. Left out: faces read from STEP or BREP files, whose shape only their reader knows
(see tcstudy.study.lint).

Snapping: corners of regions are meant to lie on the boundary of the body, or of one another, and
miss it by rounding. Six digits of a corner on a slanted edge miss it by 1e-7 of the body. The
kernel would cut a sliver there, or take the region's edge for a piece of the boundary. So corners
of regions within NEAR of a corner or an edge are moved there, and edges of regions that pass a
corner of another loop so closely get a corner there. Arcs of regions stay as they are.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice

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
    polygon_loop,
)

Array = NDArray[np.float64]

TOLERANCE = 1e-6
"""Shortest edge and smallest gap, relative to the size of the body."""

MAX_FAULTS = 20
"""Largest number of faults of one kind that are reported for one loop."""

LARGEST, SMALLEST = (bound**0.25 for bound in (sys.float_info.max, sys.float_info.min))
"""Bounds of numbers whose fourth powers, as shapes and energies need them, are still floats."""

SHARPEST = 1e-4
"""Smallest angle of a corner [rad]."""


@dataclass(frozen=True)
class Fault:
    """A fault of a body: where it is ("body.outline[2]"), problem it is, and its remedy."""

    where: str
    what: str
    remedy: str


Findings = Iterator[tuple[int | None, str, str]]
"""(number of the edge, None for the whole loop; what is wrong; remedy)."""
Kind = Callable[[Loop, float], Findings]


def loop_faults(loop: Loop, place: str, size: float, kinds: Sequence[Kind] = ()) -> list[Fault]:
    """Return the faults of one loop by itself; finer ones only if there are no coarser ones.

    Only edges of an outline have entries of their own in the study, where `place` then says which.
    """
    for kind in kinds or KINDS:
        faults = []
        for edge_number, problem, remedy in islice(kind(loop, size), MAX_FAULTS):
            where = place
            if place == "body.outline" and edge_number is not None:
                where = f"{place}[{edge_number}]"
            faults.append(Fault(where, problem, remedy))
        if faults:
            return faults
    return []


def _label(loop: Loop, i: int) -> str:
    return f"edge {i + 1} ({loop.edges[i].name})"


def spot(point: ArrayLike) -> str:
    """Return a point in words."""
    x, y = np.asarray(point, dtype=float)
    return f"({x:.6g}, {y:.6g})"


SPOT = re.compile(r"\((-?\d[\d.e+-]*), (-?\d[\d.e+-]*)\)")


def spots_in(text: str, unit: str, metres: float) -> str:
    """Return a text of faults with its places in another unit of so many metres; without one as
    they are."""
    if not unit:
        return text

    def converted(place: re.Match[str]) -> str:
        x, y = (float(coordinate) / metres for coordinate in place.groups())
        return f"({x:.6g}, {y:.6g}) {unit}"

    return SPOT.sub(converted, text)


def _points(edge: Edge) -> tuple[Point, Point, Point]:
    return edge.start, edge.end, edge.through or edge.start


def rough_size(loop: Loop) -> float:
    """Return the size of a loop that may be faulty: that of the points that are given."""
    points = [point for edge in loop.edges for point in _points(edge)]
    return math.hypot(*np.ptp(points, axis=0))


def _coordinates(loop: Loop, _: float) -> Findings:
    """Yield coordinates that are not finite or whose products are not."""
    for i, edge in enumerate(loop.edges):
        largest = float(np.max(np.abs(_points(edge))))
        if not largest <= LARGEST:
            problem = "a coordinate is not finite"
            if math.isfinite(largest):
                problem = f"the coordinate {largest:.3g} is too large to compute with"
            yield i, problem, "give finite numbers; check the number and its unit"
            return
    size = rough_size(loop) if loop.edges else 0.0
    if 0.0 < size < SMALLEST:
        problem = f"the size {size:.3g} is too small to compute with"
        yield None, problem, "check the numbers and their unit"


def _chain(loop: Loop, _: float) -> Findings:
    """Yield edges that do not begin where the one before ends, or that there are too few."""
    min_edges = 2 if any(edge.through for edge in loop.edges) else 3
    if len(loop.edges) < min_edges:
        problem = f"{len(loop.edges) or 'no'} edges do not enclose an area"
        yield None, problem, f"give at least {min_edges} edges"
        return
    for i, (edge, following) in enumerate(loop.corners):
        if edge.end != following.start:
            problem = (
                f"{_label(loop, i)} ends at {spot(edge.end)}, "
                f"but the next begins at {spot(following.start)}"
            )
            yield i, problem, "let every edge begin where the one before ends"


def _edges(loop: Loop, size: float) -> Findings:
    """Yield edges of no length, and arcs whose three points do not make a circle."""
    for i, edge in enumerate(loop.edges):
        chord = math.dist(edge.start, edge.end)
        if chord <= TOLERANCE * size:
            length = f"length {chord:.3g}" if chord else "no length"
            problem = (
                f"{_label(loop, i)} has {length}: it ends where it begins, at {spot(edge.start)}"
            )
            remedy = (
                f"its ends must be more than {TOLERANCE * size:.3g} apart; "
                "remove a point, or split a full circle"
            )
            yield i, problem, remedy
        elif edge.through is not None:
            ax, ay = np.subtract(edge.through, edge.start)
            cx, cy = np.subtract(edge.end, edge.start)
            if abs(ax * cy - ay * cx) <= TOLERANCE * chord * chord:
                problem = (
                    f"the through-point {spot(edge.through)} of {_label(loop, i)} "
                    "lies on the line of its ends"
                )
                yield i, problem, "leave out through for a straight edge"


def _crossings(loop: Loop, size: float) -> Findings:
    """Yield pairs of edges that cross, touch or nearly touch, each place once.

    Edges with a common vertex may touch there.
    """
    gap = TOLERANCE * size
    lines = [edge_line(edge, size) for edge in loop.edges]
    close_pairs = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=gap)
    pairs = sorted((int(i), int(j)) for i, j in close_pairs.T if i < j)
    reported_places: set[str] = set()
    for i, j in pairs:
        shared_vertices = []
        if j == i + 1:
            shared_vertices.append(loop.edges[j].start)
        if (j + 1) % len(lines) == i:
            shared_vertices.append(loop.edges[i].start)
        meeting = shapely.shortest_line(lines[i], lines[j])
        if shared_vertices:
            common = shapely.intersection(lines[i], lines[j])
            around_vertices = shapely.multipoints(shared_vertices).buffer(10.0 * gap)
            meeting = shapely.difference(common, around_vertices)
        points = shapely.get_coordinates(meeting)
        if not len(points):
            continue
        place = spot(points[0])
        if place not in reported_places:
            reported_places.add(place)
            problem = f"{_label(loop, i)} and {_label(loop, j)} cross or touch at {place}"
            yield i, problem, "the boundary must not meet itself: check the order of points"


def _corners(loop: Loop, _: float) -> Findings:
    """Yield corners without an angle, where an edge runs back along the one before."""
    for i, (edge, following) in enumerate(loop.corners):
        arriving = edge_normal(edge, [edge.end])[0]
        leaving = edge_normal(following, [following.start])[0]
        sine = arriving[0] * leaving[1] - arriving[1] * leaving[0]
        turn = math.atan2(sine, float(arriving @ leaving))
        if abs(turn) > math.pi - SHARPEST:
            j = (i + 1) % len(loop.edges)
            problem = f"{_label(loop, j)} runs back along {_label(loop, i)} from {spot(edge.end)}"
            yield j, problem, "give the corner an angle"


def _turn(loop: Loop, _: float) -> Findings:
    """Yield that the loop runs clockwise."""
    if loop_area(loop) > 0.0:
        return
    if loop_area(_straight(loop)) > 0.0:
        problem = (
            "an arc goes around the body on its wrong side: "
            "the points run counter-clockwise, the boundary clockwise"
        )
        remedy = "an edge's through lies between its from and the from of the next edge"
    else:
        problem = "the points run clockwise"
        remedy = "reverse the order of the points: counter-clockwise is expected"
    yield None, problem, remedy


FORM = (_coordinates, _chain, _edges)
"""Kinds of faults without which every edge has a length and every arc a circle."""
KINDS = (*FORM, _crossings, _corners, _turn)


def _straight(loop: Loop) -> Loop:
    """Return the loop with the chords of its arcs."""
    return Loop(tuple(replace(edge, through=None) for edge in loop.edges))


def has_edges(loop: Loop) -> bool:
    """Return whether every edge of a loop has a length and every arc a circle."""
    return bool(loop.edges) and not loop_faults(loop, "", rough_size(loop), FORM)


def turned(loop: Loop) -> Loop:
    """Return a clockwise loop with its edges the other way round.

    It is the loop itself if it is not clockwise, or if something else is wrong with it.
    """
    if not has_edges(loop) or loop_area(loop) >= 0.0:
        return loop
    has_wrong_arc = len(loop.edges) > 2 and loop_area(_straight(loop)) > 0.0
    if has_wrong_arc:
        return loop
    edges = [replace(edge, start=edge.end, end=edge.start) for edge in reversed(loop.edges)]
    reversed_loop = Loop(tuple(edges), turned=True)
    if loop_faults(reversed_loop, "", rough_size(reversed_loop)):
        return loop
    return reversed_loop


def check_body(body: Body) -> list[Fault]:
    """Return the faults of a body and its regions; none if it can be meshed.

    Lengths are compared with the size of the body. Holes and regions are compared with one another
    and with the outline only where each is sound by itself.
    """
    outline = [] if body.outline is None else [("body.outline", body.outline)]
    holes = [(f"body.holes[{i}]", hole) for i, hole in enumerate(body.holes)]
    regions = [(f"body.regions.{region.name}", region.loop) for region in body.regions]
    sizing = outline or regions  # where the body is not known yet, its regions alone
    faults: list[Fault] = []
    for place, loop in sizing:
        faults += loop_faults(loop, place, 0.0, (_coordinates,))
    if faults or not sizing:
        return faults
    size = max((rough_size(loop) for _, loop in sizing if loop.edges), default=0.0)
    sound_shapes: dict[str, BaseGeometry] = {}
    for place, loop in (*outline, *holes, *regions):
        faults_of_loop = loop_faults(loop, place, size)
        faults += faults_of_loop
        if not faults_of_loop:
            sound_shapes[place] = loop_polygon(loop, size)
    outline_shape = sound_shapes.pop("body.outline", None)
    if outline_shape is None and outline:
        return faults
    gap = TOLERANCE * size
    inner_shapes = list(sound_shapes.items())
    for i, (place, shape) in enumerate(inner_shapes):
        check = _hole_faults if place.startswith("body.holes") else _region_faults
        for problem, remedy in check(shape, outline_shape, inner_shapes[:i], gap):
            faults.append(Fault(place, problem, remedy))
    return faults


def _hole_faults(
    hole: BaseGeometry,
    outline: BaseGeometry | None,
    earlier_shapes: Sequence[tuple[str, BaseGeometry]],
    gap: float,
) -> Iterator[tuple[str, str]]:
    """Yield faults of a hole that does not keep clear of the outline and of earlier holes."""
    if outline is not None:
        if shapely.dwithin(hole.exterior, outline.exterior, gap):
            place = _closest(hole.exterior, outline.exterior)
            problem = f"the hole touches or crosses the outline at {place}"
            yield problem, "keep holes inside, or draw the outline around the notch"
        elif not shapely.contains(outline, hole):
            relation = "surrounds" if shapely.contains(hole, outline) else "lies outside"
            yield f"the hole {relation} the body", "move it inside the outline"
    for name, shape in earlier_shapes:
        if shapely.dwithin(shape, hole, gap):
            problem = f"the hole overlaps or touches {name} at {_closest(hole, shape)}"
            yield problem, "move them apart, or draw them as one hole"


def _region_faults(
    region: BaseGeometry,
    outline: BaseGeometry | None,
    earlier_shapes: Sequence[tuple[str, BaseGeometry]],
    gap: float,
) -> Iterator[tuple[str, str]]:
    """Yield faults of a region that shares area with the outside or with earlier shapes.

    It may share boundary with all.
    """
    slack = min(gap * region.length, 0.1 * region.area)
    if outline is not None:
        if shapely.intersection(region, outline).area <= slack:
            remedy = "move it inside the outline; check its numbers and their units"
            yield "the region lies outside the body", remedy
        else:
            outside = shapely.difference(region, outline)
            if outside.area > slack:
                problem = f"the region leaves the body near {_inside(outside)}"
                remedy = (
                    "keep it within the outline, it may end on it; "
                    "check its numbers and their units"
                )
                yield problem, remedy
    for name, shape in earlier_shapes:
        common = shapely.intersection(region, shape)
        if common.area > min(slack, gap * shape.length, 0.1 * shape.area):
            problem = f"the region overlaps {name} near {_inside(common)}"
            yield problem, "keep them apart; they may share an edge"


def _closest(first: BaseGeometry, second: BaseGeometry) -> str:
    """Return in words the point of the first shape that is closest to the second."""
    return spot(shapely.get_coordinates(shapely.shortest_line(first, second))[0])


def _inside(shape: BaseGeometry) -> str:
    """Return in words a point inside a shape."""
    return spot(shapely.get_coordinates(shapely.point_on_surface(shape))[0])


NEAR = 1e-5
"""Distance within which corners are moved, relative to the size of the body."""
SHARE = 0.1
"""The same, relative to the shortest edge: a finer drawing is intended."""


def snapped(body: Body) -> Body:
    """Return the body with corners of its regions on the edges that they nearly meet."""
    loops = [*body.loops] if body.outline is not None else []
    region_loops = [region.loop for region in body.regions]
    if not all(map(has_edges, [*loops, *region_loops])):
        return body
    size = max((loop_size(loop) for loop in loops or region_loops), default=0.0)
    regions: list[Region] = []
    for region in body.regions:
        edges = [edge for loop in (*loops, region.loop) for edge in loop.edges]
        near = min(NEAR * size, SHARE * min(map(edge_length, edges)))
        loop, distance = _onto(region.loop, loops, near)
        is_moved = distance > 1e-12 * size
        regions.append(replace(region, loop=loop, moved=distance if is_moved else 0.0))
        loops.append(loop)
    return replace(body, regions=tuple(regions))


def _onto(loop: Loop, target_loops: Sequence[Loop], near: float) -> tuple[Loop, float]:
    """Return the loop with corners on other loops, and the largest distance of a moved point."""
    targets = [edge for target_loop in target_loops for edge in target_loop.edges]
    if not targets or any(edge.through for edge in loop.edges):
        return loop, 0.0
    corners = [edge.start for edge in loop.edges]
    target_corners = np.array([edge.start for edge in targets])
    old_polygon = shapely.polygons(corners)
    distances = np.array([edge_distance(edge, corners) for edge in targets])
    for i, distance in enumerate(distances.T):
        if distance.min() > near:
            continue
        corners[i] = _projected(corners[i], targets[int(distance.argmin())])
    polygon = shapely.polygons(corners)
    snapped_polygon = shapely.snap(polygon, shapely.multipoints(target_corners), near)
    points = [(x, y) for x, y in shapely.get_coordinates(snapped_polygon)[:-1].tolist()]
    edges = polygon_loop(points, loop.edges[0].name).edges
    largest_distance = float(shapely.hausdorff_distance(old_polygon, snapped_polygon))
    return replace(loop, edges=edges), largest_distance


def _projected(point: Point, edge: Edge) -> Point:
    """Return the nearest point of the line or circle of an edge."""
    arc = edge_arc(edge)
    if arc is None:
        start = np.array(edge.start)
        chord = np.subtract(edge.end, edge.start)
        x, y = start + chord * float((point - start) @ chord / (chord @ chord))
    else:
        radial = np.subtract(point, arc.center)
        x, y = arc.center + arc.radius * radial / np.linalg.norm(radial)
    return float(x), float(y)
