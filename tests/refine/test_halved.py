"""The parts of what the finer mesh changes of a number: their sum, their places, and what cancels between them."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.contact import solve_contact
from tcstudy.offline.level import Level
from tcstudy.refine.family import Family
from tcstudy.refine.goals import dual, goal_value
from tcstudy.refine.halved import Halved, Pair
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


def changes(text: str, goal: Goal) -> tuple[float, np.ndarray, Halved]:
    """J(u_{h/2}) − J(u_h), its parts, and the finer level."""
    study = study_of(text)
    scene = study.scenes[0]
    coarse = Level(Family(study).next(0), scene)
    halved = Halved(coarse, scene)
    fine = halved.level
    condensed, finer = coarse.condensed(scene), fine.condensed(scene)
    v, w = solve_contact(condensed.problem).v, solve_contact(finer.problem).v
    u = (halved.carry(coarse.displacement(scene, v)), fine.displacement(scene, w))
    z_T = dual(goal, finer.problem, fine.line, w)
    parts = Pair(goal, halved, scene, (condensed.problem, finer.problem), (v, w), u, z_T).contributions()
    values = goal_value(goal, finer.problem, fine.line, w), goal_value(goal, condensed.problem, coarse.line, v)
    return values[0] - values[1], parts, halved


@pytest.mark.parametrize("goal", GOALS, ids=["resultant", "slip"])
def test_parts_sum_to_the_change_where_the_problem_is_linear(goal: Goal) -> None:
    change, parts, _ = changes(PULLED, goal)
    assert float(parts.sum()) == pytest.approx(change, rel=1e-8)
    assert float(np.abs(parts).sum()) > abs(change)


SPRUNG = PULLED.replace("right: free", "right: {role: traction, spring: {normal: 0.7, tangential: 0.3}}")
PUSHED = PULLED.replace("right: free", "right: {role: rigid, u_y: 0, force: [0.02, 0]}")
TURNED = SPRUNG.replace("left: clamped", "left: free").replace(
    'top: {role: traction, g: ["0.03*x", -0.01]}', "top: {role: rigid, force: [0.02, -0.01], moment: 0.005}"
)
GRADED = PULLED.replace("k: 0.4}", 'k: 0.4, strength: "2 + sin(3*x)"}')


@pytest.mark.parametrize("text", [SPRUNG, SPRUNG.replace("left: clamped", "left: symmetry"), GRADED, PUSHED, TURNED])
@pytest.mark.parametrize("goal", GOALS, ids=["resultant", "slip"])
def test_springs_rigid_edges_and_strength_by_place_have_their_parts(text: str, goal: Goal) -> None:
    """The problem stays linear; a sum without springs, or with a rigid edge node by node, is wrong."""
    change, parts, _ = changes(text, goal)
    assert float(parts.sum()) == pytest.approx(change, rel=1e-8)


@pytest.mark.parametrize("goal", GOALS, ids=["resultant", "slip"])
def test_sticking_and_slipping_nodes_have_their_parts(goal: Goal) -> None:
    """Tresca friction keeps the problem linear as long as no node changes sides."""
    change, parts, _ = changes(PULLED.replace("{law: linear, k: 0.4}", "{law: tresca, tau: 1e6}"), goal)
    assert float(parts.sum()) == pytest.approx(change, rel=1e-8, abs=1e-14)
    change, parts, _ = changes(PULLED.replace("{law: linear, k: 0.4}", "{law: tresca, tau: 1e-9}"), goal)
    assert float(parts.sum()) == pytest.approx(change, rel=1e-8)


def test_segments_of_the_contact_line_have_a_middle_and_two_parts() -> None:
    _, _, halved = changes(PULLED, GOALS[0])
    coarse, fine = halved.coarse.line, halved.level.line
    assert halved.level.mesh.points[halved.middles] == pytest.approx(coarse.ends.mean(axis=1), abs=1e-15)
    lengths = [line.lengths for line in (coarse, fine)]
    assert halved.on_segments(lengths[1]) == pytest.approx(lengths[0], rel=1e-12)
