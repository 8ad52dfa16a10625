"""The sections `mesh` and `path`: what they accept, and one line with place and remedy for every fault."""

from __future__ import annotations

import re

import pytest

from tcstudy.errors import StudyError
from tcstudy.read.study import read_study_text
from tcstudy.scene.parameters import path_scene
from tcstudy.scene.records import Clamped, Traction
from tcstudy.scene.study import Goal, MeshPlan, PathPlan

BASE = """
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, top: free, right: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.01}
"""


def mesh_of(text: str, more: str = "") -> MeshPlan:
    return read_study_text(f"{BASE}mesh: {text}\n{more}", "test").mesh


def faults(text: str, more: str = "") -> list[str]:
    with pytest.raises(StudyError) as info:
        mesh_of(text, more)
    return str(info.value).splitlines()


@pytest.mark.parametrize(
    ("text", "plan"),
    [
        ("{maxh: 0.5, levels: 3, family: graded, grading: 0.4}", MeshPlan((0.5,), 3, "graded", grading=0.4)),
        ("{maxh: 0.5, levels: 20, family: adaptive, marking: 0.3, goal: friction_resultant, max_dofs: 1000}",
         MeshPlan((0.5,), 20, "adaptive", marking=0.3, goal=Goal("friction_resultant"), max_dofs=1000)),
        ("{maxh: 0.5, tolerance: 1e-3, of: {u_T: [1, 0]}}",
         MeshPlan((0.5,), 30, "adaptive", goal=Goal("u_T", (1.0, 0.0)), tolerance=1e-3)),
        ("{maxh: 0.5, tolerance: 1e-3, of: slip_length, max_levels: 12, known: 0.7, family: uniform}",
         MeshPlan((0.5,), 12, "uniform", goal=Goal("slip_length", None, 0.7), tolerance=1e-3)),
    ],
)  # fmt: skip
def test_plans(text: str, plan: MeshPlan) -> None:
    assert mesh_of(text) == plan


def test_a_tolerance_as_h_of_the_sweep() -> None:
    more = "sweep: {h: {tolerance: 1e-3, of: friction_resultant, known: 0.02}, tau: [0.01, 0.02]}\n"
    goal = Goal("friction_resultant", None, 0.02)
    assert mesh_of("{maxh: 0.5, marking: 0.4}", more) == MeshPlan(
        (0.5,), 30, "adaptive", marking=0.4, goal=goal, tolerance=1e-3
    )
    study = read_study_text(f"{BASE}mesh: {{maxh: 0.5}}\n{more}")
    assert [axis.name for axis in study.axes] == ["tau"]


def test_faults_of_sizes_have_the_unit_of_the_study() -> None:
    body = "is larger than the body (2.23607 m); choose maxh well below it, for example 0.22 m"
    for size, fault in (("6 km", f"an element of 6000 m {body}"), ("1 um", "; choose maxh above ")):
        with pytest.raises(StudyError, match=re.escape(fault)) as info:
            read_study_text(BASE.replace("units: none\n", "") + f"mesh: {{maxh: {size}}}\n", "test")
        assert re.search(r" m$", str(info.value))
    assert "; choose maxh well below it, for example 0.22" in faults("{maxh: 6000}")[0]
    assert " m" not in faults("{maxh: 6000}")[0].partition("an element of")[2].replace(" maxh", "")


STUDY = """
body: {rectangle: {width: 2 m, height: 1 m}}
boundary:
  bottom: contact
  left: {role: clamped, u_x: 0, u_y: 0}
  top: {role: traction, g: [2 MPa, "1e6*x"], pressure: 3 MPa}
  right: convection
material: {E: 1 GPa, nu: 0.3, k: 1, alpha_T: 1e-5 1/K}
loads: {f: [1 kN/m^3, 0]}
heat: {alpha: 10, theta_bar: 5 K, q: 0}
friction: {law: tresca, tau: 1 MPa}
mesh: {maxh: 0.3 m, levels: 2}
path: {parameter: theta_bar, from: 0 K, to: 40 K}
"""
PATH = "path: {parameter: theta_bar, from: 0 K, to: 40 K}"


def test_a_path_with_all_its_keys_belongs_to_the_base_study() -> None:
    plan = read_study_text(STUDY).path
    assert plan == PathPlan(("heat", "theta_bar"), "K", 0.0, 40.0, (-40.0, 80.0), plan.scene)  # type: ignore[union-attr]
    options = (
        "path: {parameter: boundary.top.pressure, from: 0 MPa, to: -4 MPa, at: [-1 MPa, -2 MPa], start: lowest, "
        "within: [-5 MPa, 1 MPa], direction: forward, max_pieces: 50, hysteresis: false, level: 1, law_error: 1e-4}"
    )
    more = read_study_text(STUDY.replace(PATH, options)).path
    assert more == PathPlan(
        *(("boundary", "top", "pressure"), "Pa", 0.0, -4e6, (-5e6, 1e6), plan.scene, (-1e6, -2e6), "lowest", "forward"),  # type: ignore[union-attr]
        *(50, False, 1, 1e-4),
    )
    study = read_study_text(STUDY + "sweep: {tau: [2 MPa, 3 MPa]}\n")
    assert study.path
    assert study.path.scene.friction.b_scale == 1e6
    assert study.scenes[0].friction.b_scale == 2e6


@pytest.mark.parametrize(
    ("parameter", "value"),
    [
        ("theta_bar", lambda s: s.heat.theta_bar),
        ("f_x", lambda s: s.f[0]),
        ("boundary.left.u_y", lambda s: dict(s.boundary)["left"].u[1]),
        ("boundary.top.pressure", lambda s: dict(s.boundary)["top"].pressure),
        ("boundary.right.g_y", lambda s: dict(s.boundary)["right"].g[1]),
    ],
)
def test_the_value_is_put_where_the_parameter_says(parameter: str, value) -> None:  # type: ignore[no-untyped-def]
    section = f"path: {{parameter: {parameter}, from: 0, to: 1}}"
    text = STUDY.replace(PATH, section)
    if parameter == "boundary.left.u_y":
        with pytest.raises(StudyError, match="prescribe different displacements"):
            read_study_text(text)
        text = text.replace("bottom: contact", "bottom: free").replace("right: convection", "right: contact")
        text = text.replace("heat: {alpha: 10, theta_bar: 5 K, q: 0}\n", "")
    plan = read_study_text(text).path
    assert plan
    scene = path_scene(plan.scene, plan.parameter, 0.7)
    assert value(scene) == 0.7
    assert path_scene(scene, plan.parameter, value(plan.scene)) == plan.scene


def test_the_load_factor_multiplies_mechanical_loads_alone() -> None:
    plan = read_study_text(STUDY.replace("theta_bar, from: 0 K, to: 40 K}", "load, from: 0, to: 2}")).path
    assert plan
    assert plan.units == "1"
    scene = path_scene(plan.scene, plan.parameter, -2.0)
    top, left = dict(scene.boundary)["top"], dict(scene.boundary)["left"]
    assert isinstance(top, Traction)
    assert isinstance(left, Clamped)
    assert (scene.f, top.g[0], top.pressure, scene.heat) == ((-2000.0, 0.0), -4e6, -6e6, plan.scene.heat)
    assert top.g[1].evaluate(0.25, 0.0) == -0.5e6  # type: ignore[union-attr]
    nothing = path_scene(plan.scene, plan.parameter, 0.0)
    assert dict(nothing.boundary)["top"] == Traction()
