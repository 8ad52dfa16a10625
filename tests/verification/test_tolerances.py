"""Tolerances of goals on whole scenes, where parts of the body cancel on the way to the limit.

The L: re-entrant clamped corner (u ~ r^0.3) and the rest of the body move the front to opposite sides, so that halving
all triangles barely moves it while it is still 3 % off. Its reference is that of an adaptive mesh of 32,829 unknowns.

The film: beside the clamp it passes the whole fall of friction within the first cell, so that ∫ξ is the same on all
coarse meshes. Its reference is that of tests.benchmarks.tolerances.
"""

from __future__ import annotations

import pytest

from tests.benchmarks.tolerance_scenes import draw_scene
from tests.benchmarks.tolerances import judged
from tests.verification.goal_scenes import RESULTANT, SLIP_LENGTH, scene_of

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
  bore: {role: traction, pressure: -5643.0}
material: {E: 29600000.0, nu: 0.0221, plane: stress}
friction: {law: exponential, a: 513.2, b: 289.1, delta: 0.002851}
"""
FRONT = 40.5174

FILM = """
units: none
body: {rectangle: {width: 3.148, height: 1}}
boundary: {bottom: contact, right: clamped, left: convection, top: convection}
material: {E: 1, nu: 0.391, k: 1, alpha_T: 0.1}
heat: {alpha: 0.2185, theta_bar: -0.1573, q: 0.8325}
friction: {law: slip-weakening, tau_s: 0.04069, tau_k: 0.01652, delta: 0.08833}
mesh: {maxh: 0.5, levels: 1}
"""


@pytest.mark.parametrize("maxh", [4.93, 3.03])
def test_a_front_that_corner_and_body_move_to_opposite_sides(maxh: float) -> None:
    study = scene_of(CANCELS + f"mesh: {{maxh: {maxh}, levels: 1}}\n")
    trial = judged(0, study, SLIP_LENGTH, 1e-2, FRONT)
    assert trial.met
    assert trial.ratio <= 1.0, trial
    assert trial.n_dof < 4000


def test_no_plateau_of_a_coarse_cell_at_a_clamp_is_believed() -> None:
    trial = judged(0, scene_of(FILM), RESULTANT, 1e-3, -0.0535319)
    assert trial.met
    assert trial.ratio <= 1.0, trial
    assert trial.n_dof < 1000


def test_a_zone_shorter_than_every_cell_is_looked_for() -> None:
    """Tresca, a held corner: the line slips as a whole until the cell beside it is 1/40 of the starting mesh's."""
    drawn = draw_scene(4002, 16)
    trial = judged(16, drawn.study, RESULTANT, 1e-3, 0.618826)
    assert trial.met
    assert trial.ratio <= 1.0, trial
    assert trial.n_dof < 1000
