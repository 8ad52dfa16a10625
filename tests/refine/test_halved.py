"""The parts of what the finer mesh changes of a number: their sum, their places, and what cancels between them."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.contact import solve_contact
from tcstudy.offline.level import Level
from tcstudy.refine.family import Family
from tcstudy.refine.goals import dual, goal_value
from tcstudy.refine.halved import Halved, contributions
from tcstudy.scene.study import Goal
from tests.verification.scenes import study_of

PULLED = """
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, top: {role: traction, g: ["0.03*x", -0.01]}, right: free}
material: {E: 1, nu: 0.3}
friction: {law: linear, k: 0.4}
mesh: {maxh: 0.4, levels: 1}
"""
GOALS = (Goal("friction_resultant"), Goal("u_T", (1.4, 0.0)))


def changes(text: str, goal: Goal) -> tuple[float, np.ndarray]:
    """J(u_{h/2}) − J(u_h) and its parts."""
    study = study_of(text)
    scene = study.scenes[0]
    coarse = Level(Family(study).next(0), scene)
    halved = Halved(coarse, scene)
    fine = halved.level
    condensed, finer = coarse.condensed(scene), fine.condensed(scene)
    v, w = solve_contact(condensed.problem).v, solve_contact(finer.problem).v
    u = (halved.carry(coarse.displacement(scene, v)), fine.displacement(scene, w))
    z_T = dual(goal, finer.problem, fine.line, w)
    z = fine.extension(scene, z_T)
    parts = contributions(goal, halved, scene, (condensed.problem, finer.problem), (v, w), u, z)
    values = goal_value(goal, finer.problem, fine.line, w), goal_value(goal, condensed.problem, coarse.line, v)
    return values[0] - values[1], parts


SPRUNG = PULLED.replace("right: free", "right: {role: traction, spring: {normal: 0.7, tangential: 0.3}}")
PUSHED = PULLED.replace("right: free", "right: {role: rigid, u_y: 0, force: [0.02, 0]}")
TURNED = SPRUNG.replace("left: clamped", "left: free").replace(
    'top: {role: traction, g: ["0.03*x", -0.01]}', "top: {role: rigid, force: [0.02, -0.01], moment: 0.005}"
)
GRADED = PULLED.replace("k: 0.4}", 'k: 0.4, strength: "2 + sin(3*x)"}')


STICKS, SLIPS = (PULLED.replace("{law: linear, k: 0.4}", f"{{law: tresca, tau: {tau}}}") for tau in ("1e6", "1e-9"))
TEXTS = (PULLED, SPRUNG, SPRUNG.replace("left: clamped", "left: symmetry"), GRADED, PUSHED, TURNED, STICKS, SLIPS)


@pytest.mark.parametrize("text", TEXTS)
@pytest.mark.parametrize("goal", GOALS, ids=["resultant", "slip"])
def test_parts_sum_to_the_change_where_the_problem_is_linear(text: str, goal: Goal) -> None:
    """As that of Tresca friction is while no node changes sides; a sum without springs, or with a rigid edge node by
    node, is wrong."""
    change, parts = changes(text, goal)
    assert float(parts.sum()) == pytest.approx(change, rel=1e-8, abs=1e-14)
    assert float(np.abs(parts).sum()) >= abs(change)
