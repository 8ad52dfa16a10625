"""Scenes that several verification tests share."""

from collections.abc import Iterator
from pathlib import Path

import tcstudy
from tcstudy.contact.problem import ContactProblem
from tcstudy.fem.geometry import Geometry, build
from tcstudy.fem.meshes import PlaneMesh, mesh_at
from tcstudy.offline.level import Level
from tcstudy.read.study import read_study_text
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.study import Study
from tcstudy.study.run import stages

RECTANGLE = """
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, top: free, right: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.01}
mesh: {maxh: 0.1, levels: 3}
"""

HEATED_BRACKET = """
units: none
body:
  outline:
    - {from: [0, 0], edge: slope}
    - {from: [1, -0.3], edge: curve, through: [1.6, -0.2]}
    - {from: [2, 0.3], edge: right}
    - {from: [2, 1], edge: top}
    - {from: [0, 1], edge: left}
  holes:
    - circle: {center: [0.9, 0.5], radius: 0.15, edge: bore}
  regions:
    heater: {rectangle: {corner: [1.3, 0.4], width: 0.4, height: 0.3}}
boundary:
  slope: contact
  curve: contact
  right: {role: convection, g: [0.01, "0.02*y"], pressure: 0.03}
  top: {role: clamped, u: [0.002, "-0.001*x"]}
  left: {role: traction, g: [0.02, -0.01]}
  bore: convection
material: {E: 2, nu: 0.25, plane: stress, k: 0.7, alpha_T: 0.05}
loads: {f: [0.01, "-0.02*x"]}
heat: {alpha: 0.8, theta_bar: "0.2 + 0.1*x", q: 0.6, omega: heater}
friction: {law: exponential, a: 0.004, b: 0.002, delta: 0.02}
mesh: {maxh: 0.2, levels: 2}
"""


def mesh_family(geometry: Geometry, plan: MeshPlan) -> Iterator[PlaneMesh]:
    """The meshes of a plan, uniform or of given sizes, coarse to fine, made one at a time."""
    mesh: PlaneMesh | None = None
    for level in range(plan.levels):
        mesh = mesh_at(geometry, plan, level, mesh)
        yield mesh


def levels_of(study: Study) -> list[Level]:
    scene = study.scenes[0]
    return [Level(mesh, scene) for mesh in mesh_family(build(scene.body), study.mesh)]


def study_of(text: str, *overrides: str) -> Study:
    return read_study_text(text, "test", overrides)


QUICKSTART = Path(__file__).parents[2] / "configs" / "quickstart.yaml"
BRITTLE = "[[0 um, 40 MPa], [10 um, 40 MPa], [10 um, 10 MPa]]"


def quickstart_problems(sweep: str) -> list[ContactProblem]:
    """The condensed problems of quickstart's body on a brittle film, m = 13 on its first mesh."""
    law = f"friction={{law: piecewise-linear, points: {BRITTLE}}}"
    study = tcstudy.load(QUICKSTART, ["mesh.levels=1", f"sweep={sweep}", law])
    *_, last = stages(study)
    return [last.level.condensed(scene).problem for scene in study.scenes]  # type: ignore[union-attr]
