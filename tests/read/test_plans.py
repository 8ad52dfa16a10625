"""The sections `mesh` and `path`: what they are read as, and numbers of a path put into its
scene."""

import pytest

from tcstudy.read.study import read_study_text
from tcstudy.scene.mesh_plan import Goal, MeshPlan
from tcstudy.scene.parameters import path_scene
from tcstudy.scene.path_plan import PathPlan
from tcstudy.scene.records import Traction

BASE = """
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, top: free, right: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.01}
"""


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
        ("{maxh: 0.5, marking: 0.4, tolerance: 1e-3, of: energy}\nsweep: {tau: [0.01, 0.02]}",
         MeshPlan((0.5,), 30, "adaptive", marking=0.4, tolerance=1e-3)),
    ],
)  # fmt: skip
def test_plans(text: str, plan: MeshPlan) -> None:
    study = read_study_text(f"{BASE}mesh: {text}\n")
    assert (study.mesh, len(study.axes)) == (plan, text.count("sweep"))


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
"""


def path_of(said: str, study: str = STUDY) -> PathPlan:
    return read_study_text(f"{study}path: {{parameter: {said}}}\n").path  # type: ignore[return-value]


def test_a_path_with_all_its_keys_belongs_to_the_base_study() -> None:
    plan = path_of("theta_bar, from: 0 K, to: 40 K", STUDY + "sweep: {tau: [2 MPa, 3 MPa]}\n")
    assert plan == PathPlan(("heat", "theta_bar"), "K", 0.0, 40.0, (-40.0, 80.0), plan.scene)
    assert plan.scene.one_law.b_scale == 1e6
    more = path_of(
        "boundary.top.pressure, from: 0 MPa, to: -4 MPa, at: [-1 MPa, -2 MPa], start: lowest, within: [-5 MPa, 1 MPa],"
        " direction: forward, max_pieces: 50, hysteresis: false, level: 1, law_error: 1e-4"
    )
    assert more == PathPlan(
        *(
            ("boundary", "top", "pressure"),
            "Pa",
            0.0,
            -4e6,
            (-5e6, 1e6),
            plan.scene,
            (-1e6, -2e6),
            "lowest",
            "forward",
        ),
        *(50, False, 1, 1e-4),
    )


def test_the_load_factor_multiplies_mechanical_loads_alone() -> None:
    plan = path_of("load, from: 0, to: 2")
    scene = path_scene(plan.scene, plan.parameter, -2.0)
    assert path_scene(path_scene(scene, ("loads", "f_x"), 7.0), ("load",), 1.0).f == (7.0, 0.0)
    top = dict(scene.boundary)["top"]
    assert (plan.units, scene.f, top.g[0], top.pressure, scene.heat) == (
        "1",
        (-2e3, 0.0),
        -4e6,
        -6e6,
        plan.scene.heat,
    )
    assert top.g[1].evaluate(0.25, 0.0) == -0.5e6  # type: ignore[union-attr]
    assert dict(path_scene(plan.scene, plan.parameter, 0.0).boundary)["top"] == Traction()
