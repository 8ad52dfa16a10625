"""Swept parameters that change nothing, which the user should know before he reads equal rows as a finding."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from tcstudy.expressions.expression import Expression
from tcstudy.scene.points import combinations, distinct
from tcstudy.scene.records import Convection, Scene
from tcstudy.scene.study import Study

SECTIONS = ("heat", "material")
"""Sections of which a scene may need only a part."""
FELT = ("boundary", *SECTIONS)
"""Sections that decide what a scene needs of heat."""


def needs_heat_solve(scene: Scene) -> bool:
    """True if the temperature must be computed and is not simply known."""
    heat = scene.heat
    if scene.material.beta == 0.0 or heat.theta is not None or not scene.edges(Convection):
        return False
    return isinstance(heat.theta_bar, Expression) or isinstance(heat.q, Expression) or heat.q != 0.0


def why_no_heat(scenes: Sequence[Scene]) -> str:
    """Why the first scene without a heat problem has none."""
    scene = next(s for s in distinct(scenes, *FELT) if not needs_heat_solve(s))
    if scene.material.beta == 0.0:
        return "beta is 0, so temperature does not load the body"
    if scene.heat.theta is not None:
        return "theta is known"
    if not scene.edges(Convection):
        return "the study has no heat"
    return "q is 0 and theta_bar is constant, so theta = theta_bar exactly"


def idle_notes(study: Study) -> list[str]:
    """One sentence for every axis of a grid whose values all give the same solutions, because heat is left out."""
    if study.mode != "grid":
        return []
    return [
        f"{axis.name} changes nothing ({why_no_heat(study.scenes)}): its {len(axis.labels)} values give equal solutions"
        for d, axis in enumerate(study.axes)
        if len(axis.labels) > 1 and axis.path[0] in SECTIONS and _idle(study, d)
    ]


def _idle(study: Study, d: int) -> bool:
    """Whether all scenes along dimension d are the same to the solver."""
    scenes, of = combinations(study.scenes, *FELT)
    numbers: dict[tuple[object, ...], int] = {}
    felt = np.array([numbers.setdefault(tuple(_felt(scene)), len(numbers)) for scene in scenes])
    points = felt[of].reshape(study.shape)
    return bool(np.all(points == points.take([0], axis=d)))


def _felt(scene: Scene) -> Iterator[object]:
    """What of heat and material the solution depends on."""
    material, heat = scene.material, scene.heat
    yield material.lam, material.mu
    if needs_heat_solve(scene):
        yield material.beta, heat, material.k
    elif material.beta != 0.0:
        yield material.beta, heat.theta if heat.theta is not None else (scene.edges(Convection) and heat.theta_bar)
