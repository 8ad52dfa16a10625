"""Exact numbers on curved bodies against closed forms, and where stick turns into slip."""

import math

import pytest

from tcstudy.accuracy.norms import Triangles
from tcstudy.exact.numbers import exact_energy, exact_slip_length
from tcstudy.fem.geometry import build
from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Study
from tests.verification import closed_forms
from tests.verification.scenes import mesh_family

MU, A, B = closed_forms.MU, closed_forms.A, closed_forms.B

ANNULUS = f"""
units: none
body:
  outline:
    - {{from: [1, 0], edge: rim, through: [0, 1]}}
    - {{from: [-1, 0], edge: rim, through: [0, -1]}}
  holes: [{{circle: {{center: [0, 0], radius: 0.5, edge: bore}}}}]
boundary: {{rim: contact, bore: clamped}}
material: {{lambda: {closed_forms.LAM}, mu: {MU}}}
friction: {{law: tresca, tau: {2 * MU * B}}}
mesh: {{maxh: 0.25, levels: 3}}
exact: {{u: ["-({A} + {B}/(x^2 + y^2))*y", "({A} + {B}/(x^2 + y^2))*x"], loads: derived}}
"""


def meshes(study: Study) -> list[Triangles]:
    found = mesh_family(build(study.scenes[0].body), study.mesh)
    return [Triangles(mesh.points, mesh.triangles) for mesh in found]


@pytest.mark.parametrize(
    ("study", "angle"), [(closed_forms.ring(3), math.radians(70)), (read_study_text(ANNULUS), 2 * math.pi)]
)
def test_energy_of_turning_rings(study: Study, angle: float) -> None:
    """½a(u, u) = ∫2μB²/r⁴ = 3μB² per radian, ∫j = 2μB (A + B) per radian; quadrature of degree 5 on the triangles."""
    assert study.exact is not None
    expected = (3 * MU * B**2 + 2 * MU * B * (A + B)) * angle
    off = [abs(exact_energy(study.exact, study.scenes[0], mesh) / expected - 1) for mesh in meshes(study)]
    assert off[-1] < 2e-8
    assert off[0] / off[-1] > 16**2  # two refinements at order four at least: no error of the geometry is left


@pytest.mark.parametrize(
    ("u_x", "law", "expected"),
    [
        ("max(0, x - 0.3)", "{law: tresca, tau: 1}", 0.7),
        ("max(0, 0.2 - x) - max(0, x - 0.3)", "{law: tresca, tau: 1}", 0.9),
        ("x - 0.25", "{law: tresca, tau: 1}", 1.0),  # passes 0 at one point
        ("0*x", "{law: tresca, tau: 1}", 0.0),
        ("0*x", "{law: linear, k: 1}", 1.0),  # a law without a jump never sticks
        ("0.1 + max(0, x - 0.5)", "{law: piecewise-linear, points: [[0, 1], [0.1, 1], [0.1, 2]], odd: true}", 0.5),
        ("0.1 + max(0, x - 0.5)", "{law: piecewise-linear, points: [[0, 2], [0.1, 2], [0.1, 1]], odd: true}", 1.0),
    ],
)
def test_slip_length_by_hand(u_x: str, law: str, expected: float) -> None:
    """Sticking is resting on an up-jump of b, at 0 or elsewhere; a down-jump does not hold."""
    study = read_study_text(
        "units: none\nbody: {rectangle: {width: 1, height: 1}}\n"
        "boundary: {bottom: contact, right: free, top: clamped, left: free}\nmaterial: {E: 1, nu: 0.3}\n"
        f'friction: {law}\nmesh: {{maxh: 0.5}}\nexact: {{u: ["{u_x}", 0]}}\n'
    )
    assert study.exact is not None
    assert exact_slip_length(study.exact, study.scenes[0]) == pytest.approx(expected, abs=1e-12)
