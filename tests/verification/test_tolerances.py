"""Tolerances of goals on whole scenes, where parts of the body cancel on the way to the limit.

The L: re-entrant clamped corner (u ~ r^0.3) and the rest of the body move the front to opposite sides, so that halving
all triangles barely moves it while it is still 3 % off. Its reference is that of an adaptive mesh of 32,829 unknowns.
"""

from __future__ import annotations

import pytest

from tests.benchmarks.tolerance_reference import reference
from tests.benchmarks.tolerance_scenes import draw_scene
from tests.benchmarks.tolerances import SHARP, judged
from tests.verification.goal_scenes import SLIP_LENGTH, scene_of

CANCELS = """
body:
  outline:
    - {from: [0.0, 0.0], edge: c}
    - {from: [68.6, 0.0], edge: right}
    - {from: [68.6, 10.3952], edge: shelf}
    - {from: [32.4556, 10.3952], edge: inner}
    - {from: [32.4556, 25.18], edge: top}
    - {from: [0.0, 25.18], edge: left}
  holes:
    - circle: {center: [16.22779687168009, 8.316189282361558], radius: 3.777, edge: bore}
boundary:
  c: contact
  inner: clamped
  right: free
  shelf: free
  top: free
  left: {role: traction, g: [-4936.0, -6100.0]}
  bore: {role: traction, pressure: 5643.0}
material: {E: 29600000.0, nu: 0.0221, plane: stress}
friction: {law: exponential, a: 513.2, b: 289.1, delta: 0.002851}
"""
FRONT = 40.5174


@pytest.mark.parametrize("maxh", [4.93, 4.17, 3.79, 3.41, 3.03, 2.46, 1.9, 1.52])
def test_a_front_that_corner_and_body_move_to_opposite_sides(maxh: float) -> None:
    study = scene_of(CANCELS + f"mesh: {{maxh: {maxh}, levels: 1}}\n")
    trial = judged(0, study, SLIP_LENGTH, 1e-2, FRONT)
    assert trial.met
    assert trial.ratio <= 1.0, trial
    assert trial.n_dof < 4000


@pytest.mark.parametrize("index", [2, 5, 14])
def test_tolerances_of_scenes_at_random(index: int) -> None:
    """A share of tests.benchmarks.tolerances, small scenes of seed 1."""
    drawn = draw_scene(1, index)
    goal = drawn.goals[index % len(drawn.goals)]
    truth = reference(drawn.study, goal)
    for tolerance in (1e-2, 1e-3):
        assert truth.uncertainty <= SHARP * tolerance
        trial = judged(index, drawn.study, goal, tolerance, truth.value)
        assert trial.met
        assert trial.ratio <= 1.0, trial
