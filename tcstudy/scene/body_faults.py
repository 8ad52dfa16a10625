"""What is wrong with a body, found before the mesher sees it.

The mesher hangs, crashes or silently meshes something else when the outline is open, crossed, clockwise or has
slivers; so a body is judged here first, and every fault is named with its place and its remedy.
Left out: faces read from STEP or BREP files, whose shape only their reader knows (see tcstudy.study.built_body).
"""

from __future__ import annotations

from itertools import combinations

import shapely
from shapely.geometry.base import BaseGeometry

from tcstudy.scene.loop_faults import (
    TOLERANCE,
    Fault,
    coordinate_faults,
    loop_faults,
    loop_polygon,
    rough_size,
    spot,
)
from tcstudy.scene.records import Body, Region


def check_body(body: Body) -> list[Fault]:
    """Everything that is wrong with a body and its regions; empty if it can be meshed.

    Lengths are compared with the size of the body. Holes and regions are compared with one another and with the
    outline only where each is sound by itself.
    """
    if body.outline is None:
        return _regions_alone(body.regions)
    faults = coordinate_faults(body.outline, "body.outline")
    if faults or not body.outline.edges:
        return faults or [Fault("body.outline", "the outline has no edge", "give at least three edges")]
    size = rough_size(body.outline)
    faults = loop_faults(body.outline, "body.outline", size)
    places = [f"body.holes[{i}]" for i in range(len(body.holes))]
    places += [f"body.regions.{region.name}" for region in body.regions]
    shapes: list[BaseGeometry | None] = []
    for loop, place in zip((*body.holes, *(region.loop for region in body.regions)), places, strict=True):
        own = coordinate_faults(loop, place) or loop_faults(loop, place, size)
        faults += own
        shapes.append(None if own else loop_polygon(loop, size))
    if any(fault.where.startswith("body.outline") for fault in faults):
        return faults
    outline, count = loop_polygon(body.outline, size), len(body.holes)
    gap = TOLERANCE * size
    holes = [(place, shape) for place, shape in zip(places[:count], shapes[:count], strict=True) if shape]
    regions = [(place, shape) for place, shape in zip(places[count:], shapes[count:], strict=True) if shape]
    return faults + _hole_faults(outline, holes, gap) + _region_faults(outline, holes, regions, gap)


def _regions_alone(regions: tuple[Region, ...]) -> list[Fault]:
    """What is wrong with regions, each by itself and among one another, where the body is not known yet."""
    named = [(f"body.regions.{region.name}", region.loop) for region in regions]
    faults = [fault for place, loop in named for fault in coordinate_faults(loop, place)]
    if faults or not named:
        return faults
    size = max(rough_size(loop) for _, loop in named)
    sound: list[_Named] = []
    for place, loop in named:
        own = loop_faults(loop, place, size)
        faults += own
        if not own:
            sound.append((place, loop_polygon(loop, size)))
    return faults + _overlap_faults(sound, TOLERANCE * size)


_Named = tuple[str, BaseGeometry]


def _hole_faults(outline: BaseGeometry, holes: list[_Named], gap: float) -> list[Fault]:
    """Holes outside the body, across or at its outline, or at one another."""
    faults = []
    for place, hole in holes:
        point = spot(shapely.get_coordinates(shapely.shortest_line(hole.exterior, outline.exterior))[0])
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
            point = spot(shapely.get_coordinates(shapely.shortest_line(b, a))[0])
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
    return faults + _overlap_faults(regions, gap)


def _overlap_faults(regions: list[_Named], gap: float) -> list[Fault]:
    """Regions that overlap one another; they may share boundary."""
    faults = []
    for (first, a), (second, b) in combinations(regions, 2):
        common = shapely.intersection(a, b)
        if common.area > min(gap * a.length, gap * b.length, 0.1 * a.area, 0.1 * b.area):
            faults.append(Fault(second, f"the region overlaps {first} near {_inside(common)}",
                                "regions must not overlap; they may share an edge"))  # fmt: skip
    return faults


def _inside(shape: BaseGeometry) -> str:
    return spot(shapely.get_coordinates(shapely.point_on_surface(shape))[0])
