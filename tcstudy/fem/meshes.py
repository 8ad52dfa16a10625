"""Netgen meshes of a body: one coarse mesh refined uniformly or where marked, or one mesh per element size.

Marked triangles are bisected (netgen's longest-edge bisection, with as many neighbours as conformity asks for): old
nodes keep their numbers, new ones on arcs are put on the arc, names of edges and regions stay. Meshes are checked.

Graded meshes, towards the points where stresses are singular:

Size:       h(r) = h (r/R)^(1−μ) at distance r < R from a singular point, h beyond, with h halved from level to level
            and μ kept: about N ~ h⁻² triangles whatever μ, the smallest of size R (h/R)^(1/μ). P1 elements regain
            ‖u − u_h‖ ~ N^(−½) if μ is less than the least singular exponent λ, u ~ r^λ; μ = λ/2 spreads the
            error evenly
Points:     corners with an interior angle above π between equal edges, above π/2 where one of them slides (reflected
            at it, the corner is one of twice the angle), and at any angle where clamped and free edges meet. Where
            friction's shear meets an edge without any, u ~ r log r: graded with μ of ½ at least
Literature: Babuška, Kellogg & Pitkäranta, Numer. Math. 33 (1979) 447–471; Raugel, C. R. Acad. Sci. Paris 286 (1978)
            Williams, J. Appl. Mech. 19 (1952) 526–528 (angles)
Left out:   ends of slip zones, which no one knows before; jumps of tractions along a straight edge (r log r)
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Literal

import ngsolve as ngs
import numpy as np
from netgen.occ import OCCGeometry, WorkPlane
from numpy.typing import NDArray

from tcstudy.errors import GeometryFailed
from tcstudy.fem.geometry import Geometry, build
from tcstudy.scene.families import GRADED
from tcstudy.scene.records import Clamped, Contact, Point, Role
from tcstudy.scene.study import MeshPlan, Study

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True)
class PlaneMesh:
    """A triangle mesh of the body with its arrays copied out of NGSolve.

    mesh:      the NGSolve mesh, for assembly only;  kernel: the same in units of `unit` [m], for refinement only
    geometry:  the geometry it was made of
    level:     position in the study's family, 0 is the coarsest
    points:    (n, 2) nodes [m];  triangles: (t, 3), counter-clockwise node indices
    segments:  (s, 2) boundary edges, with the body on their left;  segment_curve: (s,) index of their curve
    h_max:     longest edge [m];  time_mesh: wall time of meshing or refining [s]
    """

    mesh: Any
    geometry: Geometry
    level: int
    points: Array
    triangles: Indices
    segments: Indices
    segment_curve: Indices
    h_max: float
    time_mesh: float
    kernel: Any
    unit: float

    @property
    def n_points(self) -> int:
        """Number of mesh nodes; P1 unknown i belongs to node i."""
        return len(self.points)

    def region(self, *names: str) -> str:
        """NGSolve pattern of the boundary curves that the study edges `names` consist of."""
        tags = [tag for name in names for tag in self.geometry.tags(name)]
        return "|".join(tags)


def mesh_at(geometry: Geometry, plan: MeshPlan, level: int, coarser: PlaneMesh | None) -> PlaneMesh:
    """The mesh of one level; `coarser` is the one before, which nested levels are refined from.

    Raises GeometryFailed if the mesher fails or its mesh is not the body.
    """
    if coarser is not None and plan.nested:
        return refine_uniformly(coarser)
    start = time.perf_counter()
    return _extract(_generate(geometry, plan.maxh[level], plan.refine), geometry, level, start, geometry.unit)


def refine_uniformly(coarser: PlaneMesh) -> PlaneMesh:
    """The next level: four congruent children of every triangle, new nodes put on arcs.

    Raises GeometryFailed if it is not the body.
    """
    start = time.perf_counter()
    finer = coarser.kernel.ngmesh.Copy()  # the coarse mesh stays usable
    finer.Refine()
    return _extract(ngs.Mesh(finer), coarser.geometry, coarser.level + 1, start, coarser.unit)


def refine_marked(coarser: PlaneMesh, marked: NDArray[np.bool_]) -> PlaneMesh:
    """The mesh with the marked triangles (t,) bisected, one level on. Raises GeometryFailed if it is not the body."""
    start = time.perf_counter()
    mesh = ngs.Mesh(coarser.kernel.ngmesh.Copy())  # the coarse mesh stays usable
    mesh.SetRefinementFlags(marked.tolist())
    mesh.Refine()
    return _extract(mesh, coarser.geometry, coarser.level + 1, start, coarser.unit)


def _generate(geometry: Geometry, maxh: float, refine: int = 0) -> Any:
    """A mesh of size maxh [m] by so many uniform refinements, new nodes put on arcs, of one that is coarser."""
    try:
        made = OCCGeometry(geometry.shape, dim=2).GenerateMesh(maxh=maxh * 2**refine / geometry.unit)
        for _ in range(refine):
            made.Refine()
        mesh = ngs.Mesh(made)
    except Exception as error:
        raise GeometryFailed(f"the mesher failed at maxh = {maxh:g} ({error}); try a smaller maxh") from error
    return mesh


@cache
def triangles_a_second() -> float:
    """Triangles that Netgen makes in a second of this processor, timed once on SAMPLE of them (an eighth of a second).

    Of a hundred times as many it makes a quarter fewer in a second; refining makes a hundred times more.
    """
    square = OCCGeometry(WorkPlane().Rectangle(1.0, 1.0).Face(), dim=2)
    start = time.process_time()
    made = square.GenerateMesh(maxh=1.5 / SAMPLE**0.5)
    return len(made.Elements2D()) / max(time.process_time() - start, 1e-3)


SAMPLE = 1000


def _extract(kernel: Any, geometry: Geometry, level: int, start: float, unit: float = 1.0) -> PlaneMesh:
    """Copy the arrays out (views die with their owner) and check that the mesh is the body."""
    mesh = kernel if unit == 1.0 else _scaled(kernel, unit)
    ngmesh = mesh.ngmesh
    points = np.array(ngmesh.Coordinates()[:, :2])
    triangles = ngmesh.Elements2D().NumPy()["nodes"][:, :3].astype(np.intp) - 1
    lines = ngmesh.Elements1D().NumPy()
    names = mesh.GetBoundaries()
    curve_of = np.array([int(name[1:]) if name[0] == "c" else -1 for name in names], dtype=np.intp)
    curve = curve_of[lines["index"] - 1]
    outer = curve >= 0
    segments = lines["nodes"][outer, :2].astype(np.intp) - 1
    if not len(triangles):
        raise GeometryFailed("the mesh is empty; try a smaller maxh")
    corners = points[triangles]
    twice = doubled_areas(corners)
    if np.any(twice == 0.0):
        raise GeometryFailed("the mesh has a triangle without area; try a smaller maxh")
    triangles = np.where((twice < 0)[:, None], triangles[:, [0, 2, 1]], triangles)
    segments = orient(segments, triangles, len(points))
    h_max = float(np.sqrt(np.max(np.sum((corners - np.roll(corners, 1, axis=1)) ** 2, axis=2))))
    _check(geometry, points, segments, curve[outer], 0.5 * float(np.abs(twice).sum()))
    elapsed = time.perf_counter() - start
    return PlaneMesh(mesh, geometry, level, points, triangles, segments, curve[outer], h_max, elapsed, kernel, unit)


def _scaled(kernel: Any, unit: float) -> Any:
    """The mesh in metres; the one for the kernel stays."""
    metres = kernel.ngmesh.Copy()
    metres.Scale(unit)
    return ngs.Mesh(metres)


def doubled_areas(corners: Array) -> Array:
    """Twice the signed areas of triangles given by their corners (t, 3, 2)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def orient(segments: Indices, triangles: Indices, n_points: int) -> Indices:
    """Turn boundary segments so that the (counter-clockwise) triangle at each lies on its left."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    directed = np.sort(edges[:, 0] * n_points + edges[:, 1])
    key = segments[:, 0] * n_points + segments[:, 1]
    position = np.minimum(np.searchsorted(directed, key), len(directed) - 1)
    return np.where((directed[position] == key)[:, None], segments, segments[:, ::-1])


@dataclass(frozen=True)
class CurveEnd:
    """A node where one curve of the boundary ends and the next begins, the body on the left of both.

    curves: index of the one that ends and of the one that begins;  normals: outward unit normals of both there
    """

    node: int
    curves: tuple[int, int]
    normals: tuple[Point, Point]


def curve_ends(mesh: PlaneMesh) -> list[CurveEnd]:
    """All of them, in the order of the curves that begin there."""
    ending = {int(b): i for i, (_, b) in enumerate(mesh.segments)}
    found = []
    for after, (node, _) in enumerate(mesh.segments.tolist()):
        pair = ending[node], after
        curves = int(mesh.segment_curve[pair[0]]), int(mesh.segment_curve[after])
        if curves[0] != curves[1]:
            first, second = (_normal(mesh, i, node) for i in pair)
            found.append(CurveEnd(node, curves, (first, second)))
    return sorted(found, key=lambda end: end.curves[1])


def _normal(mesh: PlaneMesh, segment: int, node: int) -> Point:
    """Outward unit normal of the exact curve of a segment at one of its nodes."""
    along = mesh.points[mesh.segments[segment, 1]] - mesh.points[mesh.segments[segment, 0]]
    x, y = mesh.geometry.curves[mesh.segment_curve[segment]].normal(mesh.points[[node]])[0]
    outward = along[1] * x - along[0] * y > 0.0
    return (float(x), float(y)) if outward else (-float(x), -float(y))


def _check(geometry: Geometry, points: Array, segments: Indices, curve: Indices, area: float) -> None:
    """Compare boundary lengths and area with the exact body; bad geometry can mesh into something else."""
    chords = np.linalg.norm(points[segments[:, 1]] - points[segments[:, 0]], axis=1)
    slack = 1e-9 * geometry.area
    for i, exact in enumerate(geometry.curves):
        own = chords[curve == i]
        length = float(own.sum())
        low = exact.length * (1 - 1e-9 if exact.straight else 0.8)
        if not low <= length <= exact.length * (1 + 1e-6):
            raise GeometryFailed(
                f"edge {exact.name!r} has length {length:g} in the mesh, {exact.length:g} in the body; "
                "try a smaller maxh"
            )
        if not exact.straight:
            slack += exact.length * float(own.max())
    if abs(area - geometry.area) > slack:
        raise GeometryFailed(
            f"the mesh has area {area:g}, the body {geometry.area:g}; try a smaller maxh or simplify the outline"
        )


REACH = 0.25
"""R over the size of the body."""
WEAK = 0.5
"""Least μ where stresses jump or grow like a logarithm only."""
SLACK = 1e-3
"""Angle [rad] by which a corner must be beyond the critical one."""

Support = Literal["held", "sliding", "contact", "free"]
Boundary = tuple[tuple[str, Role], ...]


@dataclass(frozen=True)
class Singular:
    """Singular points (p, 2) [m]; weak: (p,) those with a logarithm only."""

    points: Array
    weak: NDArray[np.bool_]

    def mu(self, grading: float) -> Array:
        """(p,) μ of meshes with this exponent."""
        return np.where(self.weak, max(WEAK, grading), grading)


def singular_points(mesh: PlaneMesh, boundary: Boundary) -> Singular:
    """Corners of the body where stresses may be infinite."""
    support = [_support(dict(boundary)[curve.name]) for curve in mesh.geometry.curves]
    found: dict[int, bool] = {}
    for corner in curve_ends(mesh):
        (a, b), (c, d) = corner.normals
        angle = np.pi - np.arctan2(a * d - b * c, a * c + b * d)
        pair = {support[i] for i in corner.curves}
        if angle > _critical(pair) + SLACK:
            found[corner.node] = False
        elif pair == {"contact", "free"}:
            found[corner.node] = True
    return Singular(mesh.points[list(found)].reshape(-1, 2), np.array(list(found.values()), dtype=bool))


def _support(role: Role) -> Support:
    """How an edge of this role is held."""
    if isinstance(role, Contact):
        return "contact"
    if isinstance(role, Clamped):
        free = sum(component is None for component in role.u)
        return "held" if free == 0 else "sliding" if free == 1 else "free"
    return "free"


def _critical(pair: set[Support]) -> float:
    """Interior angle [rad] above which stresses at a corner between such edges may be infinite."""
    if pair & {"sliding", "contact"}:
        return np.pi / 2
    return np.pi if len(pair) == 1 else 0.0


def graded_mesh(
    first: PlaneMesh, plan: MeshPlan, level: int, coarser: PlaneMesh | None, boundary: Boundary
) -> PlaneMesh:
    """The mesh of one level: the coarser one refined uniformly, then bisected until no triangle is too large.

    first: the mesh of size maxh, without grading;  coarser: the graded mesh of the level before
    Raises GeometryFailed if the mesher fails.
    """
    start = time.perf_counter()
    mesh = first if coarser is None else refine_uniformly(coarser)
    singular = singular_points(first, boundary)
    mu = singular.mu(plan.grading)
    h, reach = first.h_max / 2**level, REACH * first.geometry.size
    while True:
        corners = mesh.points[mesh.triangles]
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        centres = corners.mean(axis=1)
        r = np.linalg.norm(centres[:, None] - singular.points[None], axis=2)
        target = h * np.min(np.minimum(1.0, r / reach) ** (1.0 - mu), axis=1, initial=1.0)
        large = sides.max(axis=1) > target * (1.0 + 1e-9)
        if not np.any(large):
            return replace(mesh, level=level, time_mesh=time.perf_counter() - start)
        mesh = refine_marked(mesh, large)


def graded_points(study: Study) -> list[tuple[Point, float]]:
    """Places that the meshes of a graded study are graded towards, each with its μ. Raises GeometryFailed."""
    if study.mesh.strategy is not GRADED:
        return []
    scene = study.scenes[0]
    found = singular_points(mesh_at(build(scene.body), study.mesh, 0, None), scene.boundary)
    mus = found.mu(study.mesh.grading)
    return [((float(x), float(y)), float(mu)) for (x, y), mu in zip(found.points, mus, strict=True)]


class Meshes:
    """The meshes of a study, one after the other, as far as they follow from the body and not from solutions.

    geometry: the body;  mesh: the one made last. Of an adaptive family the first mesh is made.
    """

    def __init__(self, study: Study) -> None:
        """Raises GeometryFailed if the body cannot be made."""
        scene = study.scenes[0]
        self.geometry = build(scene.body)
        self.mesh: PlaneMesh | None = None
        self._plan, self._boundary = study.mesh, scene.boundary
        self._first: PlaneMesh | None = None

    def next(self, level: int) -> PlaneMesh:
        """The mesh of a level, after those of all levels before. Raises GeometryFailed if the mesher fails."""
        if self._plan.strategy is GRADED:
            self._first = self._first or mesh_at(self.geometry, self._plan, 0, None)
            self.mesh = graded_mesh(self._first, self._plan, level, self.mesh, self._boundary)
        else:
            self.mesh = mesh_at(self.geometry, self._plan, level, self.mesh)
        return self.mesh
