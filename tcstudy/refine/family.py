"""The meshes of a study, one after the other: each may depend on what was found on the one before."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.transfer import located
from tcstudy.fem.meshes import PlaneMesh, refine_marked
from tcstudy.fem.study_meshes import Meshes
from tcstudy.offline.level import Level
from tcstudy.refine.ends import Hidden
from tcstudy.refine.error_estimator import ErrorEstimator, marked
from tcstudy.scene.study import Study

Array = NDArray[np.float64]


ROUNDS = 12
"""Bisections of one place from level to level at most."""


def bisected(mesh: PlaneMesh, shares: Array, aim: float, marking: float, hidden: Hidden | None = None) -> PlaneMesh:
    """The mesh, one level on, bisected where the shares (t,) are large until their sum should be `aim` times as much.

    Each round marks triangles for the fraction `marking` of the sum, or for as much as is still needed. A part gets
    what smooth solutions leave it, share·(area ratio)², so that few triangles with much of the error, at a held end of
    Γ_C or at a front, are cut several times on the way to one level. What end cells hide goes with their lengths.
    """
    total, level, elapsed = math.nan, mesh.level + 1, 0.0
    for _ in range(ROUNDS):
        both = shares + hidden.on(mesh) if hidden is not None else shares
        own = float(both.sum())
        if math.isnan(total):
            total = own
        elif own <= ENOUGH * aim * total:
            break
        fraction = min(marking, 2.0 * (1.0 - aim * total / own)) if own > 0.0 else 0.0
        finer = refine_marked(mesh, marked(both, fraction))
        elapsed += finer.time_mesh
        of, _ = located(mesh, finer.centres)
        ratio = finer.area / mesh.area[of]
        mesh, shares = finer, shares[of] * ratio**2
    return replace(mesh, level=level, time_mesh=elapsed)


ENOUGH = 1.05
"""The sum that ends the rounds, over the sum aimed at: no round for a rest of nothing."""


class Family(Meshes):
    """The meshes of one run, each of an adaptive family after the estimates on the one before.

    An adaptive mesh follows from the solutions on the mesh before and from nothing else, so that a run that is resumed
    comes to the same meshes.
    """

    def __init__(self, study: Study) -> None:
        """Raises GeometryFailed if the body cannot be made."""
        super().__init__(study)
        self._study = study
        self._estimator: ErrorEstimator | None = None

    def next(self, level: int) -> PlaneMesh:
        """The mesh of a level, after those of all levels before. Raises GeometryFailed if the mesher fails."""
        plan, estimator = self._study.mesh, self._estimator
        if not plan.strategy.adapts or level == 0:
            return super().next(level)
        assert self.mesh is not None
        assert estimator is not None
        self.mesh = bisected(self.mesh, estimator.shares(), estimator.aim(), plan.marking, estimator.hidden())
        return self.mesh

    def estimator(self, level: Level) -> ErrorEstimator | None:
        """An estimator of the errors of a level's solutions; None if the study estimates no errors."""
        study = self._study
        if not study.mesh.estimates:
            return None
        before = self._estimator.estimates if self._estimator is not None else {}
        self._estimator = ErrorEstimator(level, study.mesh, dict(before), study.scenes, study.exact)
        return self._estimator
