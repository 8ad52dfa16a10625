"""The value of a goal by a far finer mesh, and how far that may be off.

Mesh:      bisected for the goal and the energy norm together, so that nothing that the goal's own estimate misses stays
           coarse; then at every corner of the body, at the point of u_T and at the fronts; then halved as often as
           MOST allows
Value:     of the finest mesh, and REST of its last change on top; as much again is called its uncertainty
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tcstudy.contact.contact import solve_contact
from tcstudy.fem.geometry import GeometryFailed
from tcstudy.fem.meshes import PlaneMesh, refine_marked, refine_uniformly
from tcstudy.offline.level import Level
from tcstudy.refine.family import Family
from tcstudy.refine.fronts import fronts, slip_length
from tcstudy.refine.goals import goal_value
from tcstudy.scene.records import Point
from tcstudy.scene.study import Goal, MeshPlan, Study

ADAPTIVE, MOST = 2500, 60_000
"""Unknowns of the bisected mesh at least, and of the finest one at most."""
CORNER_STEPS, PLACE_STEPS = 10, 4
"""Bisections at corners, and at the goal's point and fronts."""
REST = 0.4
"""1/(2^p − 1) for p = 1.8."""


@dataclass(frozen=True)
class Reference:
    """J(u) and its uncertainty relative to it; unknowns of the finest mesh."""

    value: float
    uncertainty: float
    n_dof: int


def reference(study: Study, goal: Goal) -> Reference:
    """J of the first scene of a study whose body is given by edges."""
    mesh, places = _bisected(study, goal)
    body = study.scenes[0].body
    assert body.outline is not None
    corners: list[Point] = [edge.start for loop in (body.outline, *body.holes) for edge in loop.edges]
    for k in range(CORNER_STEPS):
        try:
            mesh = _cut_at(mesh, corners + (places if k < PLACE_STEPS else []))
        except GeometryFailed:  # triangles too small for the mesher
            break
    values: list[float] = []
    while True:
        level = Level(mesh, study.scenes[0])
        values.append(_value(study, goal, level))
        n_dof = level.frames.n_dof
        if len(values) > 1 and 4 * n_dof > MOST:
            break
        mesh = refine_uniformly(mesh)
    change = values[-1] - values[-2]
    value = values[-1] + REST * change
    return Reference(value, REST * abs(change / value), n_dof)


def _value(study: Study, goal: Goal, level: Level) -> float:
    """J(u_h), fronts taken where they are found within their cells."""
    problem = level.condensed(study.scenes[0]).problem
    v = solve_contact(problem).v
    if goal.quantity == "slip_length":
        return slip_length(level.line, problem, v)[0]
    return goal_value(goal, problem, level.line, v)


def _bisected(study: Study, goal: Goal) -> tuple[PlaneMesh, list[Point]]:
    """The adaptive mesh, and where the goal's point and the fronts are."""
    scene, corners = study.scenes[0], np.array([edge.start for edge in study.scenes[0].body.outline.edges])  # type: ignore[union-attr]
    size = min(study.mesh.maxh[0], 0.2 * float(np.ptp(corners, axis=0).max()))
    family = Family(replace(study, mesh=MeshPlan((size,), 40, "adaptive", marking=0.5, goal=goal)))
    for i in range(40):
        level = Level(family.next(i), scene)
        condensed = level.condensed(scene)
        v = solve_contact(condensed.problem).v
        estimator = family.estimator(level)
        assert estimator is not None
        estimator.look((), scene, v)
        if level.frames.n_dof > ADAPTIVE:
            break
        found = estimator.estimates[()]
        squares, _ = estimator.energy_squares(scene, condensed.problem, v, level.displacement(scene, v))
        both = found.indicators / max(found.indicators.sum(), 1e-300) + squares / squares.sum()
        estimator.estimates[()] = replace(found, indicators=both, error=1.0, hidden=0.0 * found.hidden)
    at = [level.line.ends[front.segment].mean(axis=0) for front in fronts(level.line, condensed.problem, v)]
    places = [(float(x), float(y)) for x, y in at]
    return level.mesh, places + ([goal.at] if goal.at is not None else [])


def _cut_at(mesh: PlaneMesh, places: list[Point]) -> PlaneMesh:
    """The mesh with the triangles bisected that touch the nodes nearest to the places."""
    nodes = [int(np.argmin(np.linalg.norm(mesh.points - np.array(place), axis=1))) for place in places]
    return refine_marked(mesh, np.any(np.isin(mesh.triangles, nodes), axis=1))
