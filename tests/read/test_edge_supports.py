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


@pytest.mark.parametrize(
    ("old", "new", "more", "said"),
    [
        ("top: free", "top: symmetry", "", "boundary.top: a symmetry edge is straight, but this is an arc; use {role"),
        ("[3 kN/m, 0]", '["x", 0]', "", "boundary.end.force: a resultant is one number in x and one in y; give g"),
        ("[3 kN/m, 0]", "[3 kN, 0]", "", "boundary.end.force[0]: 'kN' is not a unit of a force per length (N/m)"),
        ("{normal: 2 GPa/m}", "{}", "", "boundary.end.spring: says nothing; give normal or tangential"),
        ("normal: 2 GPa/m", "normal: -2", "", "boundary.end.spring.normal: must be 0 or more, but is -2"),
        ("normal: 2 GPa/m", "nrmal: 2", "", "boundary.end.spring.nrmal: unknown key; did you mean 'normal'?"),
        (
            "top: free",
            "top: {role: free, spring: {normal: 1}}",
            "",
            "the role free takes no spring; a support is",
        ),
        (LEFT, "left: {role: symmetry, u_N: 0}", "", "the role symmetry takes no u_N"),
        (END, "{role: rigid, u: [0, 0]}", "", "boundary.end: both components are given, so nothing is left"),
        (END, "{role: rigid, u_y: 0, force: [1, 2]}", "", "u_y is given, so a force in y would not be used"),
        (
            END,
            "{role: rigid, u_y: 0, moment: 3 N}",
            "",
            "boundary.end.moment: an edge that turns moves as its forces and",
        ),
        (END, "{role: rigid, moment: 3 kg}", "", "boundary.end.moment: 'kg' is not a unit of a moment per length (N)"),
        ("top: free", "top: {role: free, moment: 3 N}", "", "the role free takes no moment; an edge that turns under"),
        (END, '{role: rigid, u_y: "x"}', "", "a rigid edge moves as a whole, by one number; use the role clamped"),
        ("top: free", "top: free", "output: {live: true}\n", "an edge rests on springs, and a live page takes none"),
        (
            "top: free",
            "top: free",
            'exact: {u: ["0", "0"]}\n',
            "on springs, and an exact solution has no",
        ),
    ],
)
def test_faults_are_one_line(old: str, new: str, more: str, said: str) -> None:
    assert old in TEXT
    with pytest.raises(StudyError) as caught:
        read_study_text(TEXT.replace(old, new) + more)
    assert said in str(caught.value)
    assert len(caught.value.problems) == 1


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


def test_errors_of_goals_are_estimated_on_springs_uneven_films_and_with_a_rigid_edge() -> None:
    goal = TEXT.replace("mesh: {maxh: 0.2}", "mesh: {maxh: 0.2, estimate: true, goal: slip_length}")
    assert read_study_text(goal).mesh.estimates
    assert read_study_text(goal.replace("friction: {", 'friction: {strength: "2 + x", ')).mesh.estimates
    assert read_study_text(goal.replace(END, "{role: rigid, u_y: 0, force: [5 N/m, 0]}")).mesh.estimates
