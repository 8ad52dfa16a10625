"""The meshes of a study, one after the other: each may depend on what was found on the one before."""

from __future__ import annotations

import numpy as np

from tcstudy.fem.geometry import build
from tcstudy.fem.grading import WEAK, graded_mesh, singular_points
from tcstudy.fem.meshes import PlaneMesh, mesh_at, refine_marked
from tcstudy.scene.records import Point, Study
from tcstudy.study.level import Level
from tcstudy.study.survey import Survey


def graded_points(study: Study) -> list[tuple[Point, float]]:
    """Places that the meshes of a graded study are graded towards, each with its μ. Raises GeometryFailed."""
    if study.mesh.family != "graded":
        return []
    scene = study.scenes[0]
    found = singular_points(mesh_at(build(scene.body), study.mesh, 0, None), scene.boundary)
    mus = np.where(found.weak, max(WEAK, study.mesh.grading), study.mesh.grading)
    return [((float(x), float(y)), float(mu)) for (x, y), mu in zip(found.points, mus, strict=True)]


class Family:
    """The meshes of one run.

    An adaptive mesh follows from the solutions on the mesh before and from nothing else, so that a run that is resumed
    comes to the same meshes.
    """

    def __init__(self, study: Study) -> None:
        """Raises GeometryFailed if the body cannot be made."""
        self._scene, self._plan = study.scenes[0], study.mesh
        self._scenes, self._exact = study.scenes, study.exact
        self._geometry = build(self._scene.body)
        self._first: PlaneMesh | None = None
        self._mesh: PlaneMesh | None = None
        self._survey: Survey | None = None

    def next(self, level: int) -> PlaneMesh:
        """The mesh of a level, after those of all levels before. Raises GeometryFailed if the mesher fails."""
        plan = self._plan
        if plan.family == "adaptive" and level > 0:
            assert self._mesh is not None
            assert self._survey is not None
            self._mesh = refine_marked(self._mesh, self._survey.marked())
        elif plan.family == "graded":
            if self._first is None:
                self._first = mesh_at(self._geometry, plan, 0, None)
            self._mesh = graded_mesh(self._first, plan, level, self._mesh, self._scene.boundary)
        else:
            self._mesh = mesh_at(self._geometry, plan, level, self._mesh)
        return self._mesh

    def survey(self, level: Level) -> Survey | None:
        """A new survey of a level, for its solutions; None if the study estimates no errors."""
        if not self._plan.estimates:
            return None
        before = self._survey.estimates if self._survey is not None else {}
        self._survey = Survey(level, self._plan, dict(before), self._scenes, self._exact)
        return self._survey
