"""Bounds of λ₁ of the body from one coarse mesh, for all levels of a study.

λ₁ is a number of the body, so that the bounds of any mesh hold for all of them. Those of the
coarsest one are a little wider and cost a part of one factorisation of a finer level.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

from tcstudy.condense import NotPositiveDefinite
from tcstudy.errors import GeometryFailed
from tcstudy.fem.meshes import Meshes, PlaneMesh
from tcstudy.offline.guaranteed import Band
from tcstudy.offline.level import NO_BAND, Level
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Study

MAX_TRIANGLES = 2_000
"""Triangles from which a coarser mesh is made for the bounds."""
TARGET_TRIANGLES = 1_000
"""Triangles of that mesh."""


class BodyBands:
    """Bounds of λ₁ of the bodies of a study."""

    def __init__(self, study: Study, coarsest: PlaneMesh) -> None:
        self._study, self._coarsest = study, coarsest

    def of(self, scene: Scene) -> Band:
        """Return bounds of λ₁ of the body [Pa/m], NaN where friction alone restrains it."""
        try:
            return self._level.band(scene)
        except NotPositiveDefinite:
            return NO_BAND

    @cached_property
    def _level(self) -> Level:
        return Level(self._mesh, self._study.scenes[0])

    @property
    def _mesh(self) -> PlaneMesh:
        """The coarsest mesh of the study, or a coarser one where that is fine."""
        n_triangles = len(self._coarsest.triangles)
        if n_triangles <= MAX_TRIANGLES:
            return self._coarsest
        size = self._study.mesh.maxh[0] * math.sqrt(n_triangles / TARGET_TRIANGLES)
        coarse = replace(self._study, mesh=MeshPlan((size,), levels=1, guarantee="none"))
        try:
            return Meshes(coarse).next(0)
        except GeometryFailed:
            return self._coarsest
