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
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import GeometryFailed
from tcstudy.fem.geometry import build
from tcstudy.fem.meshes import PlaneMesh, curve_ends, mesh_at, refine_marked, refine_uniformly
from tcstudy.scene.families import GRADED
from tcstudy.scene.records import Clamped, Contact, Point, Role
from tcstudy.scene.study import MeshPlan, Study

Array = NDArray[np.float64]
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
