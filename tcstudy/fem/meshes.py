"""Netgen meshes of a body: one coarse mesh refined uniformly or where marked, or one mesh per element size.

Marked triangles are bisected (netgen's longest-edge bisection, with as many neighbours as conformity asks for): old
nodes keep their numbers, new ones on arcs are put on the arc, names of edges and regions stay. Meshes are checked.

Also here: the local frames of the displacements of a mesh's nodes (made in fem/boundary.py).
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, NamedTuple

import ngsolve as ngs
import numpy as np
import scipy.sparse as sp
from netgen.occ import OCCGeometry, WorkPlane
from numpy.typing import NDArray

from tcstudy.errors import GeometryFailed
from tcstudy.fem.geometry import Geometry
from tcstudy.fem.recovery import recovery
from tcstudy.scene.records import Point, Scene, Where
from tcstudy.scene.study import MeshPlan
from tcstudy.shapes.triangles import GAUSS, INNER, TriangleGeometry, doubled_areas

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class BoundaryEdges(NamedTuple):
    """Of the s boundary segments, chords on arcs: length (s,), outer normal (s, 2), Gauss points (s, 2, 2)."""

    length: Array
    normal: Array
    at: Array


@dataclass(frozen=True, eq=False)
class PlaneMesh(TriangleGeometry):
    """A triangle mesh of the body with its arrays copied out of NGSolve.

    mesh:      the NGSolve mesh, for assembly only;  kernel: the same in units of `unit` [m], for refinement only
    geometry:  the geometry it was made of
    level:     position in the study's family, 0 is the coarsest
    segments:  (s, 2) boundary edges, with the body on their left;  segment_curve: (s,) index of their curve
    time_mesh: wall time of meshing or refining [s]
    """

    mesh: Any
    geometry: Geometry
    level: int
    segments: Indices
    segment_curve: Indices
    time_mesh: float
    kernel: Any
    unit: float

    @property
    def n_points(self) -> int:
        """Number of mesh nodes; P1 unknown i belongs to node i."""
        return len(self.points)

    @property
    def h_max(self) -> float:
        """Longest edge [m]."""
        return float(np.max(self.diameter))

    def region(self, *names: str) -> str:
        """NGSolve pattern of the boundary curves that the study edges `names` consist of."""
        tags = [tag for name in names for tag in self.geometry.tags(name)]
        return "|".join(tags)

    def on(self, *names: str) -> NDArray[np.bool_]:
        """(s,) boundary segments on the study edges of these names."""
        return np.array([curve.name in names for curve in self.geometry.curves])[self.segment_curve]

    def nodes_on(self, *names: str) -> Indices:
        """Nodes on the closure of the study edges of these names, ascending."""
        return np.unique(self.segments[self.on(*names)])

    def inside(self, where: Where) -> NDArray[np.bool_]:
        """(t,) triangles in some regions."""
        inside = np.array([not where or name in where for name in self.mesh.GetMaterials()])
        return inside[self.mesh.ngmesh.Elements2D().NumPy()["index"] - 1]

    def numbered(self, regions: Where) -> Indices:
        """(t,) which of some regions a triangle lies in, counted from 1; 0 outside of all."""
        return sum((i * self.inside((name,)) for i, name in enumerate(regions, 1)), np.zeros(len(self.triangles), int))

    def of_material(self, scene: Scene, name: str) -> Array:
        """(t,) a number of the material of each triangle, 0 where it is not given."""
        found = np.zeros(len(self.triangles))
        for where, material in scene.pieces:
            found[self.inside(where)] = getattr(material, name) or 0.0
        return found

    @cached_property
    def boundary(self) -> BoundaryEdges:
        """Geometry of the boundary segments."""
        ends = self.points[self.segments]
        along = ends[:, 1] - ends[:, 0]
        length = np.linalg.norm(along, axis=1)
        normal = np.column_stack([along[:, 1], -along[:, 0]]) / length[:, None]
        return BoundaryEdges(length, normal, ends[:, None, 0] + GAUSS[None, :, None] * along[:, None])

    @cached_property
    def end_normals(self) -> Array:
        """(s, 2, 2) outward unit normals of the exact curves at both ends of every boundary segment."""
        found = np.empty((len(self.segments), 2, 2))
        for i, curve in enumerate(self.geometry.curves):
            own = self.segment_curve == i
            nodes, place = np.unique(self.segments[own], return_inverse=True)
            found[own] = curve.normal(self.points[nodes])[place.reshape(-1, 2)]
        return found * np.sign(np.einsum("sed,sd->se", found, self.boundary.normal))[..., None]

    @cached_property
    def owner(self) -> Indices:
        """(s,) the triangle at each boundary segment."""
        return self.sides_at(self.segments) // 3

    def from_segments(self, values: Array, which: Indices | slice = slice(None)) -> Array:
        """(t,) sums of values on some boundary segments, all without `which`, over those of each triangle."""
        return np.asarray(np.bincount(self.owner[which], values, minlength=len(self.triangles)), dtype=float)

    @cached_property
    def inner_points(self) -> Array:
        """(t, 3, 2) points of a quadrature that is exact for degree 2, with a third of the area each [m]."""
        return np.einsum("qk,tkd->tqd", INNER, self.corners)

    @cached_property
    def recovery(self) -> sp.csr_array:
        """(n, t) the linear map from values on triangles to recovered values at nodes."""
        return recovery(self, self.segments)


EDGES = ("boundary",)
"""Where a study says what is wrong with its edges."""
SMOOTH = 1e-6
"""Sine of the angle below which two directions at a node are one (a smooth junction of curves)."""


@dataclass(frozen=True)
class Frames:
    """Local displacement unknowns w with u = R w; row c·n + i is component c of node i.

    rotation: (2n, 2n) orthogonal R
    fixed:    (2n,) local rows that carry no unknown
    values:   (2n,) prescribed local displacements on the fixed rows, zero elsewhere [m]
    turned:   (k,) nodes whose local frame is not (x, y);  axes: (k, 2, 2) their blocks of R, a local axis a column
    ties:     (2n, 2n) T of rigid edges, None without: all rows of an edge and a component are ± that of one node, and
              fixed but for that one; then u = R T w
    """

    rotation: sp.csr_array
    fixed: NDArray[np.bool_]
    values: Array
    turned: Indices
    axes: Array
    ties: sp.csr_array | None = None

    @property
    def n_dof(self) -> int:
        """Number of displacement unknowns."""
        return int(np.count_nonzero(~self.fixed))

    def local(self, F: Array) -> Array:
        """RᵀF, or TᵀRᵀF: a global load in local rows."""
        rows = self.rotation.T @ F
        return rows if self.ties is None else self.ties.T @ rows

    def rows(self, u: Array) -> Array:
        """Rᵀu: displacements in x and y, rigid edges and all, in local rows."""
        return np.asarray(self.rotation.T @ u)

    def cartesian(self, w: Array) -> Array:
        """R w, or R T w: local displacements in x and y."""
        return self.rotation @ (w if self.ties is None else self.ties @ w)

    def tied(self, A: sp.csr_array) -> sp.csr_array:
        """TᵀAT of a matrix in local rows (2n, 2n)."""
        return A if self.ties is None else sp.csr_array(self.ties.T @ A @ self.ties)


def mesh_at(geometry: Geometry, plan: MeshPlan, level: int, coarser: PlaneMesh | None) -> PlaneMesh:
    """The mesh of one level; `coarser` is the one before, which nested levels are refined from.

    Raises GeometryFailed if the mesher fails or its mesh is not the body.
    """
    if coarser is not None and plan.nested:
        return refine_uniformly(coarser)
    start, maxh = time.perf_counter(), plan.maxh[level]
    try:  # so many uniform refinements, new nodes put on arcs, of a mesh that is coarser
        made = OCCGeometry(geometry.shape, dim=2).GenerateMesh(maxh=maxh * 2**plan.refine / geometry.unit)
        for _ in range(plan.refine):
            made.Refine()
        kernel = ngs.Mesh(made)
    except Exception as error:
        raise GeometryFailed(f"the mesher failed at maxh = {maxh:g} ({error}); try a smaller maxh") from error
    return _extract(kernel, geometry, level, start, geometry.unit)


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


def _extract(kernel: Any, geometry: Geometry, level: int, start: float, unit: float) -> PlaneMesh:
    """Copy the arrays out (views die with their owner) and check that the mesh is the body."""
    mesh = kernel
    if unit != 1.0:  # in metres; the one for the kernel stays
        metres = kernel.ngmesh.Copy()
        metres.Scale(unit)
        mesh = ngs.Mesh(metres)
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
    twice = doubled_areas(points[triangles])
    if np.any(twice == 0.0):
        raise GeometryFailed("the mesh has a triangle without area; try a smaller maxh")
    triangles = np.where((twice < 0)[:, None], triangles[:, [0, 2, 1]], triangles)
    own = TriangleGeometry(points, triangles)
    segments = np.where((own.sides_at(segments) >= 0)[:, None], segments, segments[:, ::-1])  # the body on their left
    _check(geometry, points, segments, curve[outer], 0.5 * float(np.abs(twice).sum()))
    elapsed = time.perf_counter() - start
    return PlaneMesh(points, triangles, mesh, geometry, level, segments, curve[outer], elapsed, kernel, unit)


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
    ending, found = {int(b): i for i, (_, b) in enumerate(mesh.segments)}, []
    for after, (node, _) in enumerate(mesh.segments.tolist()):
        before = ending[node]
        curves = int(mesh.segment_curve[before]), int(mesh.segment_curve[after])
        if curves[0] != curves[1]:
            normals = mesh.end_normals[before, 1].tolist(), mesh.end_normals[after, 0].tolist()
            found.append(CurveEnd(node, curves, normals))
    return sorted(found, key=lambda end: end.curves[1])


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
