"""What a study says of heat edge by edge: what is read, and faults of one line."""

from __future__ import annotations

import pytest

from tcstudy.errors import StudyError
from tcstudy.read.study import read_study_text
from tcstudy.scene.points import needs_heat_solve
from tcstudy.scene.records import EdgeHeat
from tcstudy.scene.study import Study

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


def study_with(old: str = "", new: str = "", more: str = "") -> Study:
    assert old in TEXT
    return read_study_text(TEXT.replace(old, new) + more)


def test_role_and_heat_are_two_things() -> None:
    scene = study_with().scenes[0]
    assert scene.flux == (("bottom", pytest.approx(3e5)),)
    assert scene.held_theta == (("left", 80.0),)
    assert scene.exchange == (("right", 100.0, 20.0),)
    assert needs_heat_solve(scene)
    assert dict(scene.boundary)["top"].heat is None
    mixed = study_with("theta_bar: 20 K}", "flux: 7 W/m^2}", "heat: {theta_bar: 5 K}\n").scenes[0]
    assert mixed.exchange == (("right", 100.0, 5.0),)
    assert dict(mixed.boundary)["right"].heat == EdgeHeat(flux=7.0, alpha=100.0)


def test_edges_are_swept_by_path() -> None:
    sweep = "sweep: {boundary.left.heat.theta: [60 K, 80 K], boundary.right.alpha: [1, 2], parameters.mu: [0.1, 0.2]}\n"
    study = study_with(more=sweep)
    assert [axis.name for axis in study.axes] == ["theta", "alpha", "mu"]
    last = study.scenes[7]
    assert (last.held_theta[0][1], last.exchange[0][1], last.flux[0][1]) == (80.0, 2.0, pytest.approx(2e5))


def test_one_temperature_everywhere_is_no_heat_problem() -> None:
    text = TEXT.replace("{theta: 80 K}", "{theta: 20 K}").replace('"mu*p*v"', "0")
    assert not needs_heat_solve(read_study_text(text).scenes[0])


@pytest.mark.parametrize(
    ("old", "new", "more", "said"),
    [
        ("{theta: 80 K}", "{}", "", "boundary.left.heat: says nothing; give theta, or flux, or alpha and theta_bar"),
        ("{theta: 80 K}", "{theta: 80 K, flux: 3}", "", "boundary.left.heat.theta: theta is held on the edge, so flux"),
        ("{theta: 80 K}", "{theta: 80 MPa}", "", "boundary.left.heat.theta: 'MPa' is not a unit of a temperature"),
        ("{theta: 80 K}", "{tetha: 80 K}", "", "boundary.left.heat.tetha: unknown key; did you mean 'theta'?"),
        ("{theta: 80 K}", "80 K", "", "boundary.left.heat: must be a mapping"),
        ('"mu*p*v"', '"mu*p"', "", "boundary.bottom.heat.flux"),
        (
            "top: free",
            "top: {role: free, alpha: 3}",
            "",
            "the role free takes no alpha; write alpha, theta_bar",
        ),
        ('alpha: "2*h", ', "heat: {theta: 3}, ", "", "the role convection takes no heat; write alpha, theta_bar and"),
        ('"2*h"', "0", "", "boundary.right.alpha: must be greater than 0, but is 0"),
        (
            "theta_bar: 20 K}",
            "theta_bar: 20 K}",
            "heat: {theta: 5 K}\n",
            "has no meaning, because the temperature theta",
        ),
        ('"2*h", theta_bar: 20 K', '"2*h"', "heat: {q: 5}\n", "heat.theta_bar: is missing; add theta_bar: 20 K"),
        ("top: free", "top: convection", "heat: {alpha: 0, theta_bar: 1 K}\n", "heat.alpha: with alpha = 0 the edges"),
        ("k: 45 W/(m*K), ", "", "", "material.k: is missing, but heat needs it"),
        (
            "top: free",
            "top: {role: free, heat: {theta: 3 K}}",
            "",
            "hold different temperatures at their corner (0, 0.4)",
        ),
        (
            "top: free",
            "top: {role: free, heat: {theta_bar: 3 K}}",
            "",
            "boundary.top.heat.alpha: is missing, and",
        ),
        ("top: free", "top: {role: free, heat: {alpha: 3}}", "", "boundary.top.heat.theta_bar: is missing, and"),
        ("top: free", "top: free", "output: {live: true}\n", "a live page takes one alpha and one theta_bar"),
        (
            *("top: free", "top: free"),
            'exact: {u: ["0", "0"], theta: "x", loads: derived}\n',
            "loads are derived for the section heat only",
        ),
    ],
)
def test_faults_are_one_line(old: str, new: str, more: str, said: str) -> None:
    with pytest.raises(StudyError) as caught:
        study_with(old, new, more)
    assert said in str(caught.value)
    assert len(caught.value.problems) == 1


def test_heat_that_cannot_leave_is_refused() -> None:
    text = TEXT.replace("{role: clamped, heat: {theta: 80 K}}", "clamped")
    with pytest.raises(StudyError, match="none holds a temperature: no heat can leave"):
        read_study_text(text.replace('{role: convection, alpha: "2*h", theta_bar: 20 K}', "free"))
