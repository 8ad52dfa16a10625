"""What is wrong with a body, found before the mesher sees it: with each closed chain of edges by
itself (open, crossed, clockwise, with slits or without area), and with holes and regions among one
another.

The mesher hangs, crashes or silently meshes something else when the outline is open, crossed,
clockwise or has slivers; so a body is judged here first, and every fault is named with its place
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
"""Most faults of one kind that are named for one loop."""

LARGEST, SMALLEST = (bound**0.25 for bound in (sys.float_info.max, sys.float_info.min))
"""Numbers whose fourth powers, as shapes and energies need them, are still floating-point
numbers."""

SHARPEST = 1e-4
"""Smallest angle of a corner [rad]."""


@dataclass(frozen=True)
class Fault:
    """What is wrong with a body: where ("body.outline[2]"), what, and what to do about it."""

    where: str
    what: str
    remedy: str


Found = Iterator[tuple[int | None, str, str]]
"""(number of the edge, None for the whole loop; what; remedy)."""
Kind = Callable[[Loop, float], Found]


def loop_faults(loop: Loop, place: str, size: float, kinds: Sequence[Kind] = ()) -> list[Fault]:
    """Faults of one loop by itself; finer ones are looked for only when the coarser are absent.

    Only edges of an outline have entries of their own in the study, where `place` then says which.
    """
    for kind in kinds or KINDS:
        faults = [
            Fault(
                f"{place}[{i}]" if place == "body.outline" and i is not None else place,
                what,
                remedy,
            )
            for i, what, remedy in islice(kind(loop, size), MAX_FAULTS)
        ]
        if faults:
            return faults
    return []


def _label(loop: Loop, i: int) -> str:
    return f"edge {i + 1} ({loop.edges[i].name})"


def spot(point: ArrayLike) -> str:
    """A point in words."""
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
    """Size of a loop that may be faulty: bounding box of the points that are given."""
    return math.hypot(*np.ptp([point for edge in loop.edges for point in _points(edge)], axis=0))


def _coordinates(loop: Loop, _: float) -> Found:
    """Coordinates that are not finite or whose products are not."""
    for i, edge in enumerate(loop.edges):
        if not (largest := float(np.max(np.abs(_points(edge))))) <= LARGEST:
            finite = f"the coordinate {largest:.3g} is too large to compute with"
            what = finite if math.isfinite(largest) else "a coordinate is not finite"
            yield i, what, "give finite numbers; check the number and its unit"
            return
    if loop.edges and 0.0 < (size := rough_size(loop)) < SMALLEST:
        yield (
            None,
            f"the size {size:.3g} is too small to compute with",
            "check the numbers and their unit",
        )


def _chain(loop: Loop, _: float) -> Found:
    least = 2 if any(edge.through for edge in loop.edges) else 3
    if len(loop.edges) < least:
        yield (
            None,
            f"{len(loop.edges) or 'no'} edges do not enclose an area",
            f"give at least {least} edges",
        )
        return
    for i, (edge, following) in enumerate(loop.corners):
        if edge.end != following.start:
            what = f"{_label(loop, i)} ends at {spot(edge.end)}, but the next begins at {spot(following.start)}"
            yield i, what, "let every edge begin where the one before ends"


def _edges(loop: Loop, size: float) -> Found:
    """Edges of no length, and arcs whose three points do not make a circle."""
    for i, edge in enumerate(loop.edges):
        chord = math.dist(edge.start, edge.end)
        if chord <= TOLERANCE * size:
            what = (
                f"{_label(loop, i)} has length {chord:.3g}"
                if chord
                else f"{_label(loop, i)} has no length"
            )
            remedy = f"its ends must be more than {TOLERANCE * size:.3g} apart; remove a point, or split a full circle"
            yield i, f"{what}: it ends where it begins, at {spot(edge.start)}", remedy
        elif edge.through is not None:
            (ax, ay), (cx, cy) = (
                np.subtract(edge.through, edge.start),
                np.subtract(edge.end, edge.start),
            )
            if abs(ax * cy - ay * cx) <= TOLERANCE * chord * chord:
                what = f"the through-point {spot(edge.through)} of {_label(loop, i)} lies on the line of its ends"
                yield i, what, "leave out through for a straight edge"


def _crossings(loop: Loop, size: float) -> Found:
    """Pairs of edges that cross, touch or come closer than the tolerance away from a common vertex,
    each place once."""
    gap, lines, seen = TOLERANCE * size, [edge_line(edge, size) for edge in loop.edges], set[str]()
    pairs = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=gap)
    for i, j in sorted((int(i), int(j)) for i, j in pairs.T if i < j):
        shared = [loop.edges[j].start] if j == i + 1 else []
        if (j + 1) % len(lines) == i:
            shared.append(loop.edges[i].start)
        meeting = shapely.shortest_line(lines[i], lines[j])
        if shared:
            common = shapely.intersection(lines[i], lines[j])
            meeting = shapely.difference(common, shapely.multipoints(shared).buffer(10.0 * gap))
        if len(points := shapely.get_coordinates(meeting)) and (at := spot(points[0])) not in seen:
            seen.add(at)
            what = f"{_label(loop, i)} and {_label(loop, j)} cross or touch at {at}"
            yield i, what, "the boundary must not meet itself: check the order of points"


def _corners(loop: Loop, _: float) -> Found:
    """Corners without an angle, where an edge runs back along the one before."""
    for i, (edge, following) in enumerate(loop.corners):
        arriving, leaving = (
            edge_normal(edge, [edge.end])[0],
            edge_normal(following, [following.start])[0],
        )
        turn = math.atan2(
            arriving[0] * leaving[1] - arriving[1] * leaving[0], float(arriving @ leaving)
        )
        if abs(turn) > math.pi - SHARPEST:
            j = (i + 1) % len(loop.edges)
            what = f"{_label(loop, j)} runs back along {_label(loop, i)} from {spot(edge.end)}"
            yield j, what, "give the corner an angle"


def _turn(loop: Loop, _: float) -> Found:
    if loop_area(loop) > 0.0:
        return
    what, remedy = (
        "the points run clockwise",
        "reverse the order of the points: counter-clockwise is expected",
    )
    if loop_area(_straight(loop)) > 0.0:
        what = "an arc goes around the body on its wrong side: the points run counter-clockwise, the boundary clockwise"
        remedy = "an edge's through lies between its from and the from of the next edge"
    yield None, what, remedy


FORM = (_coordinates, _chain, _edges)
"""Faults without which every edge has a length and every arc a circle, whatever the loop
encloses."""
KINDS = (*FORM, _crossings, _corners, _turn)


def _straight(loop: Loop) -> Loop:
    return Loop(tuple(replace(edge, through=None) for edge in loop.edges))


def has_edges(loop: Loop) -> bool:
    """Whether every edge of a loop has a length and every arc a circle, whatever the loop
    encloses."""
    return bool(loop.edges) and not loop_faults(loop, "", rough_size(loop), FORM)


def turned(loop: Loop) -> Loop:
    """The loop with its edges the other way round if it is clockwise and nothing else is wrong with
    it."""
    if not has_edges(loop) or loop_area(loop) >= 0.0:
        return loop
    edges = (replace(edge, start=edge.end, end=edge.start) for edge in reversed(loop.edges))
    other = Loop(tuple(edges), turned=True)
    wrong_arc = len(loop.edges) > 2 and loop_area(_straight(loop)) > 0.0
    return loop if wrong_arc or loop_faults(other, "", rough_size(other)) else other


def check_body(body: Body) -> list[Fault]:
    """Everything that is wrong with a body and its regions; empty if it can be meshed.

    Lengths are compared with the size of the body. Holes and regions are compared with one another
    and with the outline only where each is sound by itself.
    """
    outline = [] if body.outline is None else [("body.outline", body.outline)]
    holes = [(f"body.holes[{i}]", hole) for i, hole in enumerate(body.holes)]
    regions = [(f"body.regions.{region.name}", region.loop) for region in body.regions]
    first = outline or regions  # where the body is not known yet, its regions alone
    faults = [
        fault for place, loop in first for fault in loop_faults(loop, place, 0.0, (_coordinates,))
    ]
    if faults or not first:
        return faults
    size = max((rough_size(loop) for _, loop in first if loop.edges), default=0.0)
    shapes: dict[str, BaseGeometry] = {}
    for place, loop in (*outline, *holes, *regions):
        own = loop_faults(loop, place, size)
        faults += own
        shapes |= {} if own else {place: loop_polygon(loop, size)}
    whole, gap = shapes.pop("body.outline", None), TOLERANCE * size
    if whole is None and outline:
        return faults
    inner = list(shapes.items())
    for i, (place, shape) in enumerate(inner):
        faults += [Fault(place, *fault) for fault in _placed(place, shape, whole, inner[:i], gap)]
    return faults


def _placed(
    place: str,
    shape: BaseGeometry,
    outline: BaseGeometry | None,
    others: Sequence[tuple[str, BaseGeometry]],
    gap: float,
) -> Iterator[tuple[str, str]]:
    """What is wrong with the place of a hole or a region: holes keep clear of the outline and of
    one another; regions may share boundary with all, but no area."""
    if "holes" in place:
        if outline is not None and shapely.dwithin(shape.exterior, outline.exterior, gap):
            at = spot(
                shapely.get_coordinates(shapely.shortest_line(shape.exterior, outline.exterior))[0]
            )
            what = f"the hole touches or crosses the outline at {at}"
            yield what, "keep holes inside, or draw the outline around the notch"
        elif outline is not None and not shapely.contains(outline, shape):
            where = "surrounds" if shapely.contains(shape, outline) else "lies outside"
            yield f"the hole {where} the body", "move it inside the outline"
        for name, other in others:
            if shapely.dwithin(other, shape, gap):
                at = spot(shapely.get_coordinates(shapely.shortest_line(shape, other))[0])
                yield (
                    f"the hole overlaps or touches {name} at {at}",
                    "move them apart, or draw them as one hole",
                )
        return
    slack = min(gap * shape.length, 0.1 * shape.area)
    if outline is not None and shapely.intersection(shape, outline).area <= slack:
        yield (
            "the region lies outside the body",
            "move it inside the outline; check its numbers and their units",
        )
    elif outline is not None and (outside := shapely.difference(shape, outline)).area > slack:
        remedy = "keep it within the outline, it may end on it; check its numbers and their units"
        yield f"the region leaves the body near {_inside(outside)}", remedy
    for name, other in others:
        common = shapely.intersection(shape, other)
        if common.area > min(slack, gap * other.length, 0.1 * other.area):
            yield (
                f"the region overlaps {name} near {_inside(common)}",
                "keep them apart; they may share an edge",
            )


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
    size = max(
        (loop_size(loop) for loop in loops or [region.loop for region in body.regions]), default=0.0
    )
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
    placed, corners = (
        [edge.start for edge in loop.edges],
        np.array([edge.start for edge in targets]),
    )
    old, away = (
        shapely.polygons(placed),
        np.array([edge_distance(edge, placed) for edge in targets]),
    )
    for i, point in enumerate(placed):
        edge = targets[int(away[:, i].argmin())]
        if away[:, i].min() > near:
            continue
        if (arc := edge_arc(edge)) is None:
            begin, chord = np.array(edge.start), np.subtract(edge.end, edge.start)
            x, y = begin + chord * float((point - begin) @ chord / (chord @ chord))
        else:
            radial = np.subtract(point, arc.center)
            x, y = arc.center + arc.radius * radial / np.linalg.norm(radial)
        placed[i] = float(x), float(y)
    new = shapely.snap(shapely.polygons(placed), shapely.multipoints(corners), near)
    points = [(x, y) for x, y in shapely.get_coordinates(new)[:-1].tolist()]
    made = polygon_loop(points, loop.edges[0].name)
    return replace(loop, edges=made.edges), float(shapely.hausdorff_distance(old, new))
