"""What is wrong with a body from a STEP or BREP file, found when its face is built and before any work starts.

What an outline is judged by while the study is read needs the kernel here: whether every name has an edge, regions
lie in the face, the supports exclude rigid motions, and maxh gives a sensible number of triangles.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from tcstudy.errors import GeometryFailed
from tcstudy.fem.geometry import Geometry, build
from tcstudy.read.body import edge_names
from tcstudy.read.checks import BoundaryPiece, mesh_faults, support_fault, supports
from tcstudy.read.document import Found
from tcstudy.scene.points import distinct
from tcstudy.scene.records import Body, Contact
from tcstudy.scene.study import Study
from tcstudy.shapes.edges import edge_length, loop_area
from tcstudy.shapes.faults import TOLERANCE
from tcstudy.study.doubts import PARALLEL, pinned_note

ACCURACY = 1e-7
"""Of points and normals of a curve from a file, relative to the body; the kernel's own tolerance."""


def built_faults(study: Study) -> list[Found]:
    """The faults of a study whose body is a file; empty for every other body."""
    body = study.scenes[0].body
    if body.brep is None:
        return []
    try:
        geometry = build(body)
    except GeometryFailed as error:
        what, _, remedy = str(error).partition("; ")
        return [(("body", "file"), what, remedy or "check the file and the number of the face")]
    return [
        *_nameless(body, geometry),
        *_region_faults(body, geometry),
        *_support_faults(study, geometry),
        *_mesh_faults(study, geometry),
    ]


def built_doubts(study: Study) -> list[str]:
    """What such a study says and its author may not have meant; empty for every other body.

    Raises GeometryFailed if there is no such face.
    """
    scene = study.scenes[0]
    if scene.body.brep is None:
        return []
    geometry = build(scene.body)
    corners = pinned_corners(geometry, scene.edges(Contact))
    return list(pinned_note(corners, "make it arcs or splines in the file"))


def pinned_corners(geometry: Geometry, contact: tuple[str, ...]) -> int:
    """Corners of the face between two contact curves of different directions."""
    ends = [(points[i], normals[i]) for name, points, normals in geometry.samples() if name in contact for i in (0, -1)]
    return sum(
        float(np.linalg.norm(p - q)) <= ACCURACY * geometry.size and abs(a[0] * b[1] - a[1] * b[0]) > PARALLEL
        for (p, a), (q, b) in combinations(ends, 2)
    )


def _nameless(body: Body, geometry: Geometry) -> Iterator[Found]:
    """Names that no edge of the face has, since another name's point is nearest to the same edge."""
    assert body.brep is not None
    held = {curve.name for curve in geometry.curves}
    for name in edge_names(body):
        if name not in held:
            own = name != body.brep.other
            keys = ("body", "file", "edges", name) if own else ("body", "file", "other")
            what = f"no edge of the face has the name {name!r}: " + (
                "another name has a point at the same edge" if own else "all edges are named by points"
            )
            remedy = "give a point nearer to the edge that is meant" if own else "leave out other"
            yield keys, what, remedy


def _region_faults(body: Body, geometry: Geometry) -> Iterator[Found]:
    """Regions that leave the face; they may end on its edges."""
    inside = geometry.face_areas()
    for region in body.regions:
        area = loop_area(region.loop)
        slack = min(TOLERANCE * geometry.size * sum(edge_length(edge) for edge in region.loop.edges), 0.1 * area)
        share = inside.get(region.name, 0.0) / area
        keys = ("body", "regions", region.name) if region.name != "omega" else ("heat", "omega")
        if share * area <= slack:
            yield keys, "the region lies outside the face of the file", "move it inside; coordinates are metres"
        elif area - share * area > slack:
            what = f"the region leaves the face of the file: {share:.3g} of its area is inside"
            yield keys, what, "keep it within the face and clear of its holes; it may end on their edges"


def _support_faults(study: Study, geometry: Geometry) -> Iterator[Found]:
    """Rigid motions that the supports leave, once for each kind of support in the sweep."""
    pieces = [BoundaryPiece(*sample) for sample in geometry.samples()]
    centre = (float(pieces[0].points[0, 0]), float(pieces[0].points[0, 1]))
    seen = set()
    for scene in distinct(study.scenes, "boundary"):
        held = supports(scene.boundary)
        if held not in seen:
            seen.add(held)
            fault = support_fault(pieces, scene.boundary, centre, geometry.size, ACCURACY)
            if fault is not None:
                yield ("boundary",), *fault


def _mesh_faults(study: Study, geometry: Geometry) -> Iterator[Found]:
    """Element sizes that do not fit the face."""
    several = study.mesh.listed
    for i, what, remedy in mesh_faults(study.mesh, geometry.area, geometry.size):
        yield ("mesh", "maxh", *([i] if several else [])), what, remedy
