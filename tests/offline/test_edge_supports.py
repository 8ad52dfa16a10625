"""Resultants, springs, symmetry and rigid edges: bars in closed form, balances, and studies that must be the same."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.solve import solve_contact
from tcstudy.offline.level import Level
from tcstudy.scene.parameters import path_scene
from tcstudy.scene.records import Scene
from tcstudy.study.path_run import affine_load
from tests.verification.scenes import levels_of, study_of

BAR = """
units: none
body: {rectangle: {width: 4, height: 0.5}}
boundary: {bottom: contact, left: LEFT, right: RIGHT, top: free}
material: {E: 5, nu: 0, plane: stress, alpha_T: 0.01}
heat: {theta: 2}
friction: {law: linear, k: 0}
mesh: {maxh: 0.5}
"""
EPS, D = 0.02, 2.5
"""Thermal strain, and axial stiffness E H."""


def solved(text: str) -> tuple[Scene, Level, np.ndarray, np.ndarray]:
    """Scene, coarse level, slip and the displacement of the body (2, n)."""
    study = study_of(text)
    scene, level = study.scenes[0], levels_of(study)[0]
    v = solve_contact(level.condensed(scene).problem).v
    return scene, level, v, level.displacement(scene, v).reshape(2, -1)


@pytest.mark.parametrize(
    ("left", "right", "at_left", "strain"),
    [
        ("{role: traction, spring: {normal: 2}}", "{role: traction, force: [0.3, 0]}", 0.3, EPS + 0.3 / D),
        ("{role: traction, spring: {normal: 2}}", "{role: convection, g: [0.6, 0]}", 0.3, EPS + 0.3 / D),
        ("{role: rigid, force: [-0.3, 0], u_y: 0}", "{role: clamped, u_x: 0}", -4 * 0.3 / D, 0.3 / D),
        ("symmetry", "{role: traction, spring: {normal: 2}}", 0.0, EPS / (1 + 4 / D)),
    ],
)
def test_bars(left: str, right: str, at_left: float, strain: float) -> None:
    """u is linear: exact on P1. A spring of 2 Pa/m on the height 0.5 has the stiffness 1."""
    text = BAR.replace("LEFT", left).replace("RIGHT", right)
    if "convection" in right:
        text = text.replace("theta: 2", "alpha: 1, theta_bar: 2").replace("nu: 0", "nu: 0, k: 1")
    warm = "rigid" not in left + right  # which would not let its edge grow
    _, level, _, u = solved(text if warm else text.replace("theta: 2", "theta: 0"))
    assert u[0] == pytest.approx(at_left + strain * level.mesh.points[:, 0], abs=1e-13)
    assert u[1] == pytest.approx(warm * EPS * level.mesh.points[:, 1], abs=1e-13)


RIGID = """
units: none
body:
  outline: [{from: [0, 0], edge: foot}, {from: [0.5, 0], edge: film}, {from: [2, 0], edge: right},
    {from: [2, 1], edge: top}, {from: [0, 1], edge: left}]
boundary: {foot: clamped, film: contact, left: free, top: PLATE, right: END}
material: {E: 1, nu: 0.3, alpha_T: 0.01}
heat: {theta: "x*y"}
friction: {law: slip-weakening, tau_s: 0.02, tau_k: 0.005, delta: 0.2}
mesh: {maxh: 0.3}
"""


def test_an_edge_that_turns_is_the_clamped_one_whose_reactions_are_its_resultants() -> None:
    """The plate moves as u = a + phi × (x − 1, 0) under its force and moment; a path runs along either."""
    free = RIGID.replace("END", "free")
    scene, level, v, u = solved(free.replace("PLATE", "{role: rigid, force: [0.05, -0.1], moment: 0.03}"))
    plate = level.mesh.points[:, 1] > 1 - 1e-12
    s, U = level.mesh.points[plate, 0] - 1.0, u[:, plate]
    phi = float((U[1, s.argmax()] - U[1, s.argmin()]) / 2.0)
    a = U.mean(axis=1) - [0.0, phi * s.mean()]
    assert np.abs(U - np.array([a[0] + 0 * s, a[1] + phi * s])).max() < 1e-14
    assert phi > 1e-3
    given = f'{{role: clamped, u: [{float(a[0])!r}, "{float(a[1])!r} + {phi!r}*(x - 1)"]}}'
    other, same, w, moved = solved(free.replace("PLATE", given))
    assert w == pytest.approx(v, abs=1e-11)
    assert moved == pytest.approx(u, abs=1e-11)
    K = same.elastic.stiffness_of((((), other.material.lam, other.material.mu),))
    forces = (K @ moved.ravel() - same.load(other)).reshape(2, -1)[:, plate]
    assert [*forces.sum(axis=1), forces[1] @ s] == pytest.approx([0.05, -0.1, 0.03], abs=1e-11)
    keys = ("boundary", "top", "moment")
    assert affine_load(level, lambda t: path_scene(scene, keys, t), -1.0, 3.0, "moment").defect < 1e-12
