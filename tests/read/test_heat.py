"""What a study says of heat edge by edge."""

from __future__ import annotations

import pytest

from tcstudy.read.study import read_study_text
from tcstudy.scene.points import needs_heat_solve
from tcstudy.scene.records import EdgeHeat

TEXT = """
parameters: {mu: 0.3, p: 2 MPa, v: 0.5 m/s, h: 50 W/(m^2*K)}
body: {rectangle: {width: 1, height: 0.4}}
boundary:
  bottom: {role: contact, heat: {flux: "mu*p*v"}}
  left: {role: clamped, heat: {theta: 80 K}}
  right: {role: convection, alpha: "2*h", theta_bar: 20 K}
  top: free
material: {E: 210 GPa, nu: 0.3, k: 45 W/(m*K), alpha_T: 12e-6 1/K}
friction: {law: tresca, tau: 20 MPa}
mesh: {maxh: 0.2}
"""


def test_role_and_heat_are_two_things() -> None:
    scene = read_study_text(TEXT).scenes[0]
    assert (scene.flux, scene.held_theta) == ((("bottom", pytest.approx(3e5)),), (("left", 80.0),))
    assert scene.exchange == (("right", 100.0, 20.0),)
    assert needs_heat_solve(scene)
    assert dict(scene.boundary)["top"].heat is None
    mixed = read_study_text(TEXT.replace("theta_bar: 20 K}", "flux: 7 W/m^2}") + "heat: {theta_bar: 5 K}\n").scenes[0]
    assert mixed.exchange == (("right", 100.0, 5.0),)
    assert dict(mixed.boundary)["right"].heat == EdgeHeat(flux=7.0, alpha=100.0)
    alike = TEXT.replace("{theta: 80 K}", "{theta: 20 K}").replace('"mu*p*v"', "0")
    assert not needs_heat_solve(read_study_text(alike).scenes[0])  # one temperature everywhere


def test_edges_are_swept_by_path() -> None:
    study = read_study_text(
        TEXT + "sweep: {boundary.left.heat.theta: [60 K, 80 K], boundary.right.alpha: [1, 2], mu: [1, 2]}"
    )
    assert [axis.name for axis in study.axes] == ["theta", "alpha", "mu"]
    last = study.scenes[7]
    assert (last.held_theta[0][1], last.exchange[0][1], last.flux[0][1]) == (80.0, 2.0, pytest.approx(2e6))
