"""What supports must hold, and what a mesh says of rigid edges."""

from __future__ import annotations

import pytest

from tcstudy.errors import GeometryFailed, StudyError
from tcstudy.fem.boundary import constrain
from tcstudy.fem.geometry import build
from tcstudy.read.study import read_study_text
from tests.verification.scenes import mesh_family

PLATE = "rectangle: {width: 1, height: 0.4, edges: {bottom: film, right: end}}"
DISC = "outline: [{from: [0, 0], edge: film, through: [1, -1]}, {from: [2, 0], edge: film, through: [1, 1]}]"
REST = "material: {E: 210 GPa, nu: 0.3}\nfriction: {law: tresca, tau: 20 MPa}\nmesh: {maxh: 0.2}\n"


@pytest.mark.parametrize(
    ("body", "others", "motion"),
    [
        (PLATE, ", end: {role: traction, spring: {normal: 2}}, top: free, left: free", ""),  # the spring holds it
        (PLATE, ", end: contact, top: free, left: free", ""),
        (PLATE, ", end: {role: traction, pressure: 0}, top: free, left: free", r"slide along x"),
        (DISC, "", r"turn about \(1, "),
    ],
)
def test_supports_must_hold_the_body(body: str, others: str, motion: str) -> None:
    text = f"body: {{{body}}}\nboundary: {{film: contact{others}}}\n{REST}"
    if not motion:
        assert len(read_study_text(text).scenes) == 1
        return
    with pytest.raises(StudyError, match=rf"2:11: boundary: no edge is clamped .* it can still {motion}"):
        read_study_text(text)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("force: [5 N/m, 0]", r"end cannot move in y: another edge holds it .*give it u_y: 0"),
        ("moment: 5 N", r"end cannot turn: another edge holds it at \(1, 0\); leave out its moment"),
    ],
)
def test_a_rigid_edge_that_contact_holds_is_refused(given: str, said: str) -> None:
    boundary = f"boundary: {{film: contact, left: symmetry, end: {{role: rigid, {given}}}, top: free}}"
    study = read_study_text(f"body: {{{PLATE}}}\n{boundary}\n{REST}")
    mesh = next(mesh_family(build(study.scenes[0].body), study.mesh))
    with pytest.raises(GeometryFailed, match=said):
        constrain(mesh, study.scenes[0].boundary)
