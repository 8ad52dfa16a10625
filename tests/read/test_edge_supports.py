"""Resultants, springs, symmetry and rigid edges in a study: what is read, what is refused, in one line."""

from __future__ import annotations

import pytest

from tcstudy.errors import GeometryFailed, StudyError
from tcstudy.fem.boundary import constrain
from tcstudy.fem.geometry import build
from tcstudy.read.study import read_study_text
from tcstudy.scene.records import Rigid, Symmetry
from tests.verification.scenes import mesh_family

TEXT = """
body:
  outline: [{from: [0, 0], edge: film}, {from: [1, 0], edge: end}, {from: [1, 0.4], edge: top, through: [0.5, 0.6]},
    {from: [0, 0.4], edge: left}]
boundary:
  film: contact
  left: symmetry
  end: {role: traction, force: [3 kN/m, 0], spring: {normal: 2 GPa/m}}
  top: free
material: {E: 210 GPa, nu: 0.3}
friction: {law: tresca, tau: 20 MPa}
mesh: {maxh: 0.2}
"""
END, LEFT = "{role: traction, force: [3 kN/m, 0], spring: {normal: 2 GPa/m}}", "left: symmetry"


def test_roles_are_read() -> None:
    scene = read_study_text(TEXT).scenes[0]
    roles = dict(scene.boundary)
    assert roles["left"] == Symmetry()
    assert scene.springs == (("end", 2e9, 0.0),)
    sweep = "sweep: {boundary.end.force: [[0, 0], [1 kN/m, 0]], boundary.end.spring.tangential: [0, 1 GPa/m]}\n"
    last = read_study_text(TEXT + sweep).scenes[-1]
    assert dict(last.boundary)["end"].force == (1e3, 0.0)  # type: ignore[union-attr]
    assert last.springs == (("end", 2e9, 1e9),)
    rigid = read_study_text(TEXT.replace(END, "{role: rigid, u_y: 0, force: [5 N/m, 0]}")).scenes[0]
    assert dict(rigid.boundary)["end"] == Rigid((None, 0.0), force=(5.0, 0.0))


def test_what_neither_springs_nor_symmetry_hold_is_said() -> None:
    with pytest.raises(StudyError, match="it can still slide along x"):
        read_study_text(TEXT.replace(LEFT, "left: free").replace("spring: {normal: 2 GPa/m}", "pressure: 0"))
    read_study_text(TEXT.replace(LEFT, "left: free"))  # the spring holds it


def test_a_rigid_edge_that_contact_holds_is_refused() -> None:
    scene = read_study_text(TEXT.replace(END, "{role: rigid, force: [5 N/m, 0]}")).scenes[0]
    study = read_study_text(TEXT)
    mesh = next(mesh_family(build(scene.body), study.mesh))
    with pytest.raises(GeometryFailed, match=r"end cannot move in y: another edge holds it .*give it u_y: 0"):
        constrain(mesh, scene.boundary)
    turns = read_study_text(TEXT.replace(END, "{role: rigid, moment: 5 N}")).scenes[0]
    with pytest.raises(
        GeometryFailed, match=r"end cannot turn: another edge holds it at \(1, 0\); leave out its moment"
    ):
        constrain(mesh, turns.boundary)
