"""Netgen meshes of a body: one coarse mesh refined, or one mesh per element size.

Meshes are refined uniformly or where marked. Marked triangles are bisected (netgen's longest-edge
bisection, with as many neighbours as conformity asks for): old nodes keep their numbers, new ones
on arcs are put on the arc, names of edges and regions stay. Meshes are checked. Also here: the
local frames of their nodes (made in fem/forms.py), and the meshes of a study that follow from its
body.

Graded meshes are finer towards the points where stresses are singular:

Size:       h(r) = h (r/R)^(1−μ) at distance r < R from a singular point, h beyond, with h halved
            from level to level and μ kept: about N ~ h⁻² triangles whatever μ, the smallest of size
            R (h/R)^(1/μ). P1 elements regain ‖u − u_h‖ ~ N^(−½) if μ is less than the least
            singular exponent λ, u ~ r^λ; μ = λ/2 spreads the error evenly
Points:     corners with an interior angle above π between equal edges, above π/2 where one of them
            slides (reflected at it, the corner is one of twice the angle), and at any angle where
            clamped and free edges meet. Where friction's shear meets an edge without any, u ~ r log
            r: graded with μ of ½ at least
Literature: Babuška, Kellogg & Pitkäranta, Numer. Math. 33 (1979) 447–471; Raugel, C. R. Acad. Sci.
            Paris 286 (1978); Williams, J. Appl. Mech. 19 (1952) 526–528 (angles)
Left out:   ends of slip zones, which no one knows before; jumps of tractions along a straight edge
            (r log r)
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import Any, NamedTuple

import ngsolve as ngs
import numpy as np
import scipy.sparse as sp
from netgen.occ import OCCGeometry, WorkPlane
from numpy.typing import NDArray

from tcstudy.errors import GeometryFailed
from tcstudy.fem.geometry import Geometry, build
from tcstudy.scene.mesh_plan import GRADED, MeshPlan
from tcstudy.scene.records import Clamped, Contact, Point, Role, Scene, Where
from tcstudy.scene.study import Study
from tcstudy.shapes.edges import GAUSS, INNER, TriangleGeometry, doubled_areas
from tcstudy.shapes.recovery import recovery_matrix

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class BoundaryEdges(NamedTuple):
    """Length (s,), outer normal (s, 2) and Gauss points (s, 2, 2) of boundary segments.

    On arcs the segments are chords.
    """

    length: Array
    normal: Array
    at: Array


@dataclass(frozen=True, eq=False)
class PlaneMesh(TriangleGeometry):
    """A triangle mesh of the body with its arrays copied out of NGSolve.

    mesh:          the NGSolve mesh, in units of the geometry, for assembly and refinement only
    geometry:      the geometry it was made of
    level:         position in the study's family, 0 is the coarsest
    segments:      (s, 2) boundary edges, with the body on their left
    segment_curve: (s,) index of their curve
    time_mesh:     wall time of meshing or refining [s]
    ancestor:      the finest mesh with at most MAX_ANCESTOR triangles of which this finer one is a
                   refinement; None for a smaller mesh, and where there is none
    """

    mesh: Any
    geometry: Geometry
    level: int
    segments: Indices
    segment_curve: Indices
    time_mesh: float
    ancestor: PlaneMesh | None = None

    @property
    def n_points(self) -> int:
        """Return the number of nodes."""
        return len(self.points)

    @property
    def h_max(self) -> float:
        """Return the longest edge [m]."""
        return float(np.max(self.diameter))

    def region(self, *names: str) -> str:
        """Return the NGSolve pattern of the boundary curves of the study edges `names`."""
        return "|".join(
            f"c{i}" for i, curve in enumerate(self.geometry.curves) if curve.name in names
        )

    def on(self, *names: str) -> NDArray[np.bool_]:
        """Return the boundary segments (s,) on the study edges of these names."""
        has_name = np.array([curve.name in names for curve in self.geometry.curves])
        return has_name[self.segment_curve]

    def nodes_on(self, *names: str) -> Indices:
        """Return the nodes on the closure of the study edges of these names, ascending."""
        return np.unique(self.segments[self.on(*names)])

    def inside(self, where: Where) -> NDArray[np.bool_]:
        """Return the triangles (t,) in regions, all for none."""
        inside = np.array([not where or name in where for name in self.mesh.GetMaterials()])
        return inside[self.mesh.ngmesh.Elements2D().NumPy()["index"] - 1]

    def numbered(self, regions: Where) -> Indices:
        """Return the number (t,) of the region of each triangle, from 1; 0 outside of all."""
        number = np.zeros(len(self.triangles), int)
        for i, name in enumerate(regions, 1):
            number = number + i * self.inside((name,))
        return number

    def of_material(self, scene: Scene, name: str) -> Array:
        """Return a number of the material of each triangle (t,), 0 where it is not given."""
        values = np.zeros(len(self.triangles))
        for where, material in scene.pieces:
            values[self.inside(where)] = getattr(material, name) or 0.0
        return values

    @cached_property
    def boundary(self) -> BoundaryEdges:
        ends = self.points[self.segments]
        along = ends[:, 1] - ends[:, 0]
        length = np.linalg.norm(along, axis=1)
        normal = np.column_stack([along[:, 1], -along[:, 0]]) / length[:, None]
        at = ends[:, None, 0] + GAUSS[None, :, None] * along[:, None]
        return BoundaryEdges(length, normal, at)

    @cached_property
    def end_normals(self) -> Array:
        """Return the outward unit normals (s, 2, 2) of the exact curves at the ends of segments."""
        normals = np.empty((len(self.segments), 2, 2))
        for i, curve in enumerate(self.geometry.curves):
            on_curve = self.segment_curve == i
            nodes, node_of_end = np.unique(self.segments[on_curve], return_inverse=True)
            normals[on_curve] = curve.normal(self.points[nodes])[node_of_end.reshape(-1, 2)]
        sign = np.sign(np.einsum("sed,sd->se", normals, self.boundary.normal))
        return normals * sign[..., None]

    @cached_property
    def owner(self) -> Indices:
        """Return the triangle (s,) at each boundary segment."""
        return self.sides_at(self.segments) // 3

    def from_segments(self, values: Array, which: Indices | slice = slice(None)) -> Array:
        """Return sums (t,) of values on boundary segments over those of each triangle.

        which: the segments, by default all
        """
        sums = np.bincount(self.owner[which], values, minlength=len(self.triangles))
        return np.asarray(sums, dtype=float)

    @cached_property
    def inner_points(self) -> Array:
        """Return points (t, 3, 2) of a quadrature of degree 2, with equal weights [m]."""
        return np.einsum("qk,tkd->tqd", INNER, self.corners)

    @cached_property
    def recovery(self) -> sp.csr_array:
        """Return the map (n, t) from values on triangles to recovered values at nodes."""
        return recovery_matrix(self, self.segments)


EDGES = ("boundary",)
"""Key of the study for faults of edges."""
SMOOTH = 1e-6
"""Sine of the angle below which two directions at a node are one (a smooth junction of curves)."""


@dataclass(frozen=True)
class Frames:
    """Local displacement DOFs w with u = R w; row c·n + i is component c of node i.

    axes:   (n, 2, 2) blocks of the orthogonal R, a local axis a column
    fixed:  (2n,) local rows that carry no unknown
    values: (2n,) prescribed local displacements on the fixed rows, zero elsewhere [m]
    ties:   (2n, 2n) T of rigid edges, None without: all rows of an edge and a component are ± that
            of one node, and fixed but for that one; then u = R T w
    corners: (k,) nodes at which two contact edges that are not held meet at an angle; their rows
            are the openings of the edge that begins and, n rows later, of that which ends
    """

    axes: Array
    fixed: NDArray[np.bool_]
    values: Array
    ties: sp.csr_array | None = None
    corners: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.intp))

    @property
    def slides(self) -> NDArray[np.bool_]:
        """Return the nodes (n,) whose first row is free and no opening of a corner."""
        slides = ~self.fixed[: len(self.axes)]
        slides[self.corners] = False
        return slides

    @property
    def n_dof(self) -> int:
        """Return the number of degrees of freedom."""
        return int(np.count_nonzero(~self.fixed))

    def local(self, F: Array) -> Array:
        """Return a load F in x and y in local rows: RᵀF, or TᵀRᵀF."""
        rows = self.rows(F)
        return rows if self.ties is None else self.ties.T @ rows

    def rows(self, u: Array) -> Array:
        """Return displacements in x and y in local rows, those of rigid edges included: Rᵀu."""
        return np.einsum("ncd,cn->dn", self.axes, u.reshape(2, -1)).ravel()

    def cartesian(self, w: Array) -> Array:
        """Return local displacements (2n,) or (2n, k) in x and y: R w, or R T w."""
        rows = w if self.ties is None else self.ties @ w
        pairs = rows.reshape(2, -1, *w.shape[1:])
        return np.einsum("ncd,dn...->cn...", self.axes, pairs).reshape(rows.shape)


def mesh_at(geometry: Geometry, plan: MeshPlan, level: int, coarser: PlaneMesh | None) -> PlaneMesh:
    """Return the mesh of one level, refined from the coarser one if levels are nested.

    Raises GeometryFailed if the mesher fails or its mesh is not the body.
    """
    if coarser is not None and plan.nested:
        return refine(coarser)
    start = time.perf_counter()
    maxh = plan.maxh[level]
    first_maxh = maxh * 2**plan.refine / geometry.unit
    try:  # uniform refinements of a coarser mesh, which put new nodes on arcs
        ngmesh = OCCGeometry(geometry.shape, dim=2).GenerateMesh(maxh=first_maxh)
        for _ in range(plan.refine):
            ngmesh.Refine()
        mesh = ngs.Mesh(ngmesh)
    except Exception as error:
        raise GeometryFailed(
            f"the mesher failed at maxh = {maxh:g} ({error}); try a smaller maxh"
        ) from error
    return _extract(mesh, geometry, level, start)


def refine(coarser: PlaneMesh, marked: NDArray[np.bool_] | None = None) -> PlaneMesh:
    """Return the next level, with new nodes on arcs.

    Every triangle is cut into four congruent ones, or the marked ones (t,) are bisected.
    Raises GeometryFailed if the mesh is not the body.
    """
    start, finer = time.perf_counter(), coarser.mesh.ngmesh.Copy()  # the coarse mesh stays usable
    if marked is None:
        finer.Refine()
    mesh = ngs.Mesh(finer)
    if marked is not None:
        mesh.SetRefinementFlags(marked.tolist())
        mesh.Refine()
    finer_mesh = _extract(mesh, coarser.geometry, coarser.level + 1, start)
    if len(finer_mesh.triangles) <= MAX_ANCESTOR:
        return finer_mesh
    is_small = len(coarser.triangles) <= MAX_ANCESTOR
    return replace(finer_mesh, ancestor=coarser if is_small else coarser.ancestor)


MAX_ANCESTOR = 1_500
"""Most triangles of the coarser mesh that a mesh keeps."""


@cache
def triangles_a_second() -> float:
    """Return how many triangles Netgen makes per second, timed once on about SAMPLE of them.

    The timing takes an eighth of a second. A mesh with a hundred times as many triangles has a rate
    a quarter lower; refinement is a hundred times as fast.
    """
    square = OCCGeometry(WorkPlane().Rectangle(1.0, 1.0).Face(), dim=2)
    start = time.process_time()
    mesh = square.GenerateMesh(maxh=1.5 / SAMPLE**0.5)
    return len(mesh.Elements2D()) / max(time.process_time() - start, 1e-3)


SAMPLE = 1000
"""Triangles of the timed mesh."""


def _extract(mesh: Any, geometry: Geometry, level: int, start: float) -> PlaneMesh:
    """Copy the arrays out (views die with their owner) and check that the mesh is the body."""
    ngmesh = mesh.ngmesh
    points = geometry.unit * np.array(ngmesh.Coordinates()[:, :2])
    triangles = ngmesh.Elements2D().NumPy()["nodes"][:, :3].astype(np.intp) - 1
    lines = ngmesh.Elements1D().NumPy()
    names = mesh.GetBoundaries()
    curves = [int(name[1:]) if name[0] == "c" else -1 for name in names]
    curve_of = np.array(curves, dtype=np.intp)
    curve = curve_of[lines["index"] - 1]
    outer = curve >= 0
    segments = lines["nodes"][outer, :2].astype(np.intp) - 1
    if not len(triangles):
        raise GeometryFailed("the mesh is empty; try a smaller maxh")
    twice = doubled_areas(points[triangles])
    if np.any(twice == 0.0):
        raise GeometryFailed("the mesh has a triangle without area; try a smaller maxh")
    triangles = np.where((twice < 0)[:, None], triangles[:, [0, 2, 1]], triangles)
    # the body is on the left of a segment
    is_side = TriangleGeometry(points, triangles).sides_at(segments) >= 0
    segments = np.where(is_side[:, None], segments, segments[:, ::-1])
    # a bad geometry can give a mesh of another body
    along = points[segments[:, 1]] - points[segments[:, 0]]
    chords = np.linalg.norm(along, axis=1)
    curve = curve[outer]
    slack = 1e-9 * geometry.area
    area = 0.5 * float(np.abs(twice).sum())
    for i, exact in enumerate(geometry.curves):
        length = float(chords[curve == i].sum())
        low = exact.length * (1 - 1e-9 if exact.straight else 0.8)
        if not low <= length <= exact.length * (1 + 1e-6):
            raise GeometryFailed(
                f"edge {exact.name!r} has length {length:g} in the mesh, {exact.length:g} in the "
                "body; try a smaller maxh"
            )
        slack += 0.0 if exact.straight else exact.length * float(chords[curve == i].max())
    if abs(area - geometry.area) > slack:
        raise GeometryFailed(
            f"the mesh has area {area:g}, the body {geometry.area:g}; "
            "try a smaller maxh or simplify the outline"
        )
    return PlaneMesh(
        points, triangles, mesh, geometry, level, segments, curve, time.perf_counter() - start
    )


REACH = 0.25
"""R over the size of the body."""
WEAK = 0.5
"""Least μ where stresses jump or grow like a logarithm only."""
SLACK = 1e-3
"""Angle [rad] by which a corner must be beyond the critical one."""

Boundary = tuple[tuple[str, Role], ...]


def singular_points(geometry: Geometry, boundary: Boundary, grading: float) -> dict[Point, float]:
    """Return the corners where stresses may be infinite [m], each with the exponent μ of meshes."""
    roles = dict(boundary)
    singular = dict[Point, float]()
    for corner in geometry.corners:
        if corner.cut:
            continue
        angle = math.fsum(angle for angle, _ in corner.wedges)
        sides = corner.sides[0], corner.sides[-1]
        supports = {_support(roles[side.name]) for side in sides}
        # the interior angle above which stresses between such edges may be infinite
        if supports & {"sliding", "contact"}:
            critical = np.pi / 2
        elif len(supports) == 1:
            critical = np.pi
        else:
            critical = 0.0
        if angle > critical + SLACK:
            singular[corner.at] = grading
        elif supports == {"contact", "free"}:
            singular[corner.at] = max(WEAK, grading)
    return singular


def _support(role: Role) -> str:
    """Return the kind of support of an edge."""
    if isinstance(role, Contact):
        return "contact"
    free = sum(component is None for component in role.u) if isinstance(role, Clamped) else 2
    return ("held", "sliding", "free")[free]


def graded_mesh(
    first: PlaneMesh, plan: MeshPlan, level: int, coarser: PlaneMesh | None, boundary: Boundary
) -> PlaneMesh:
    """Return the coarser mesh refined uniformly, then bisected until no triangle is too large.

    first: the mesh of size maxh, without grading;  coarser: the graded mesh of the level before
    Raises GeometryFailed if the mesher fails.
    """
    start = time.perf_counter()
    mesh = first if coarser is None else refine(coarser)
    singular = singular_points(first.geometry, boundary, plan.grading)
    points = np.array(list(singular)).reshape(-1, 2)
    mu = np.array(list(singular.values()))
    h = first.h_max / 2**level
    reach = REACH * first.geometry.size
    while True:
        r = np.linalg.norm(mesh.centres[:, None] - points[None], axis=2)
        target = h * np.min(np.minimum(1.0, r / reach) ** (1.0 - mu), axis=1, initial=1.0)
        large = mesh.diameter > target * (1.0 + 1e-9)
        if not np.any(large):
            return replace(mesh, level=level, time_mesh=time.perf_counter() - start)
        mesh = refine(mesh, large)


def graded_points(study: Study) -> dict[Point, float]:
    """Return the points towards which a study's meshes are graded, each with its μ.

    Raises GeometryFailed.
    """
    if study.mesh.strategy is not GRADED:
        return {}
    scene = study.scenes[0]
    return singular_points(build(scene.body), scene.boundary, study.mesh.grading)


class Meshes:
    """The meshes of a study in order, as far as they follow from the body and not from solutions.

    geometry: the body;  mesh: the latest mesh. Of an adaptive family the first mesh is made.
    """

    def __init__(self, study: Study) -> None:
        """Raises GeometryFailed if the body cannot be made, or if there are several."""
        if study.variants:
            fault = "the sweep varies the body or its meshes, and this takes one geometry"
            remedy = "fix it by --set sweep=null, or by --set sweep={...} without its numbers"
            raise GeometryFailed(f"{fault}; {remedy}", ("sweep",))
        scene = study.scenes[0]
        self.geometry = build(scene.body)
        self.mesh: PlaneMesh | None = None
        self._plan = study.mesh
        self._boundary = scene.boundary
        self._first: PlaneMesh | None = None

    def next(self, level: int) -> PlaneMesh:
        """Return the mesh of a level, after those of all levels before.

        Raises GeometryFailed if the mesher fails.
        """
        if self._plan.strategy is GRADED:
            self._first = self._first or mesh_at(self.geometry, self._plan, 0, None)
            self.mesh = graded_mesh(self._first, self._plan, level, self.mesh, self._boundary)
        else:
            self.mesh = mesh_at(self.geometry, self._plan, level, self.mesh)
        return self.mesh
