"""How the meshes of every family are made, as far as they follow from the body and not from solutions."""

from __future__ import annotations

from collections.abc import Callable

from tcstudy.fem.geometry import Geometry
from tcstudy.fem.grading import graded_mesh
from tcstudy.fem.meshes import PlaneMesh, mesh_at
from tcstudy.scene.families import GRADED, MeshFamily
from tcstudy.scene.records import Role
from tcstudy.scene.study import MeshPlan

Maker = Callable[[int, PlaneMesh | None], PlaneMesh]
"""(level, the mesh of the level before) → the mesh of the level. Raises GeometryFailed if the mesher fails."""
Boundary = tuple[tuple[str, Role], ...]


def maker(geometry: Geometry, plan: MeshPlan, boundary: Boundary) -> Maker:
    """The maker of a study's meshes; of an adaptive family it makes the first one.

    boundary: roles of the edges, which say where stresses are singular
    """
    return _MAKERS.get(plan.strategy, _plain)(geometry, plan, boundary)


def _plain(geometry: Geometry, plan: MeshPlan, boundary: Boundary) -> Maker:
    """Uniform refinements of the first mesh, or one mesh for each size."""
    del boundary
    return lambda level, before: mesh_at(geometry, plan, level, before)


def _graded(geometry: Geometry, plan: MeshPlan, boundary: Boundary) -> Maker:
    """Graded meshes; where to is asked of the first mesh, without grading."""
    first: list[PlaneMesh] = []

    def make(level: int, before: PlaneMesh | None) -> PlaneMesh:
        if not first:
            first.append(mesh_at(geometry, plan, 0, None))
        return graded_mesh(first[0], plan, level, before, boundary)

    return make


_MAKERS: dict[MeshFamily, Callable[[Geometry, MeshPlan, Boundary], Maker]] = {GRADED: _graded}
