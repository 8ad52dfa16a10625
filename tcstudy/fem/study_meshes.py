"""The meshes of a study that follow from its body: uniform refinements of one, one for each size, or graded ones.

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
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import GeometryFailed
from tcstudy.fem.geometry import build
from tcstudy.fem.meshes import PlaneMesh, curve_ends, mesh_at, refine_marked, refine_uniformly
from tcstudy.scene.records import Clamped, Contact, Point, Role
from tcstudy.scene.study import GRADED, MeshPlan, Study

Array = NDArray[np.float64]
REACH = 0.25
"""R over the size of the body."""
WEAK = 0.5
"""Least μ where stresses jump or grow like a logarithm only."""
SLACK = 1e-3
"""Angle [rad] by which a corner must be beyond the critical one."""

Boundary = tuple[tuple[str, Role], ...]


def singular_points(mesh: PlaneMesh, boundary: Boundary, grading: float) -> tuple[Array, Array]:
    """Corners of the body where stresses may be infinite (p, 2) [m], and μ of meshes with this exponent there (p,)."""
    roles, found = dict(boundary), dict[int, float]()
    for corner in curve_ends(mesh):
        (a, b), (c, d) = corner.normals
        angle = np.pi - np.arctan2(a * d - b * c, a * c + b * d)
        pair = {_support(roles[mesh.geometry.curves[i].name]) for i in corner.curves}
        # the interior angle above which stresses between such edges may be infinite
        critical = np.pi / 2 if pair & {"sliding", "contact"} else np.pi if len(pair) == 1 else 0.0
        if angle > critical + SLACK:
            found[corner.node] = grading
        elif pair == {"contact", "free"}:
            found[corner.node] = max(WEAK, grading)
    return mesh.points[list(found)].reshape(-1, 2), np.array(list(found.values()))


def _support(role: Role) -> str:
    """How an edge of this role is held."""
    if isinstance(role, Contact):
        return "contact"
    free = sum(component is None for component in role.u) if isinstance(role, Clamped) else 2
    return ("held", "sliding", "free")[free]


def graded_mesh(
    first: PlaneMesh, plan: MeshPlan, level: int, coarser: PlaneMesh | None, boundary: Boundary
) -> PlaneMesh:
    """The mesh of one level: the coarser one refined uniformly, then bisected until no triangle is too large.

    first: the mesh of size maxh, without grading;  coarser: the graded mesh of the level before
    Raises GeometryFailed if the mesher fails.
    """
    start = time.perf_counter()
    mesh = first if coarser is None else refine_uniformly(coarser)
    points, mu = singular_points(first, boundary, plan.grading)
    h, reach = first.h_max / 2**level, REACH * first.geometry.size
    while True:
        r = np.linalg.norm(mesh.centres[:, None] - points[None], axis=2)
        target = h * np.min(np.minimum(1.0, r / reach) ** (1.0 - mu), axis=1, initial=1.0)
        large = mesh.diameter > target * (1.0 + 1e-9)
        if not np.any(large):
            return replace(mesh, level=level, time_mesh=time.perf_counter() - start)
        mesh = refine_marked(mesh, large)


def graded_points(study: Study) -> list[tuple[Point, float]]:
    """Places that the meshes of a graded study are graded towards, each with its μ. Raises GeometryFailed."""
    if study.mesh.strategy is not GRADED:
        return []
    scene, plan = study.scenes[0], study.mesh
    points, mus = singular_points(mesh_at(build(scene.body), plan, 0, None), scene.boundary, plan.grading)
    return [((float(x), float(y)), float(mu)) for (x, y), mu in zip(points, mus, strict=True)]


class Meshes:
    """The meshes of a study, one after the other, as far as they follow from the body and not from solutions.

    geometry: the body;  mesh: the one made last. Of an adaptive family the first mesh is made.
    """

    def __init__(self, study: Study) -> None:
        """Raises GeometryFailed if the body cannot be made, or if there are several."""
        if study.variants:
            what = "the sweep varies the body or its meshes, and this takes one geometry"
            remedy = "fix it by --set sweep=null, or by --set sweep={...} without its numbers"
            raise GeometryFailed(f"{what}; {remedy}", ("sweep",))
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
