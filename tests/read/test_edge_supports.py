"""What supports must hold, and what a mesh says of rigid edges."""

from __future__ import annotations

import pytest

from tcstudy.errors import GeometryFailed, StudyError
from tcstudy.fem.boundary import constrain
from tcstudy.fem.geometry import build
from tcstudy.read.study import read_study_text
from tests.verification.scenes import mesh_family

END, LEFT = "{role: traction, spring: {normal: 2 GPa/m}}", "left: symmetry"
TEXT = f"""
body: {{rectangle: {{width: 1, height: 0.4, edges: {{bottom: film, right: end}}}}}}
boundary: {{film: contact, {LEFT}, end: {END}, top: free}}
material: {{E: 210 GPa, nu: 0.3}}
friction: {{law: tresca, tau: 20 MPa}}
mesh: {{maxh: 0.2}}
"""


def test_what_neither_springs_nor_symmetry_hold_is_said() -> None:
    with pytest.raises(StudyError, match="it can still slide along x"):
        read_study_text(TEXT.replace(LEFT, "left: free").replace("spring: {normal: 2 GPa/m}", "pressure: 0"))
    read_study_text(TEXT.replace(LEFT, "left: free"))  # the spring holds it


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("force: [5 N/m, 0]", r"end cannot move in y: another edge holds it .*give it u_y: 0"),
        ("moment: 5 N", r"end cannot turn: another edge holds it at \(1, 0\); leave out its moment"),
    ],
)
def test_a_rigid_edge_that_contact_holds_is_refused(given: str, said: str) -> None:
    study = read_study_text(TEXT.replace(END, f"{{role: rigid, {given}}}"))
    mesh = next(mesh_family(build(study.scenes[0].body), study.mesh))
    with pytest.raises(GeometryFailed, match=said):
        constrain(mesh, study.scenes[0].boundary)
