"""What supports must hold, and what a mesh says of rigid edges."""

from dataclasses import replace

import pytest

from tcstudy.errors import GeometryFailed, StudyError
from tcstudy.fem.forms import constrain, contact_line
from tcstudy.fem.geometry import build
from tcstudy.read.study import read_study_text
from tcstudy.scene.records import Contact
from tests.verification.scenes import mesh_family

PLATE = "body: {rectangle: {width: 1, height: 0.4, edges: {bottom: film, right: end}}}\n"
REST = "material: {E: 210 GPa, nu: 0.3}\nfriction: {law: tresca, tau: 20 MPa}\nmesh: {maxh: 0.2}\n"


@pytest.mark.parametrize("end", ["{role: traction, spring: {normal: 2}}", "contact"])
def test_a_spring_or_a_second_contact_edge_holds_the_body(end: str) -> None:
    assert read_study_text(
        f"{PLATE}boundary: {{film: contact, end: {end}, top: free, left: free}}\n{REST}"
    ).scenes


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("force: [5 N/m, 0]", r"end cannot move in y: another edge constrains it .*give it u_y: 0"),
        (
            "moment: 5 N",
            r"end cannot rotate: another edge constrains it at \(1, 0\); leave out its moment",
        ),
    ],
)
def test_a_rigid_edge_that_contact_holds_is_refused(given: str, said: str) -> None:
    boundary = (
        f"boundary: {{film: contact, left: symmetry, end: {{role: rigid, {given}}}, top: free}}\n"
    )
    study = read_study_text(f"{PLATE}{boundary}{REST}")
    mesh = next(mesh_family(build(study.scenes[0].body), study.mesh))
    with pytest.raises(GeometryFailed, match=said):
        constrain(mesh, study.scenes[0].boundary)


@pytest.mark.parametrize("height", [0.14, 0.2, 0.224, 0.226, 0.3])
@pytest.mark.parametrize("side", ["contact", "clamped"])
def test_a_contact_edge_of_one_element_between_held_corners_is_refused_before_the_mesh(
    height: float, side: str
) -> None:
    """By the reader where the mesher would make one, and only there."""
    edges = f"left: {side}, right: contact, top: contact, bottom: {side}"
    text = (
        f"body: {{rectangle: {{width: 0.6, height: {height}}}}}\nboundary: {{{edges}}}\n"
        + REST.replace("0.2", "0.15")
    )
    study = read_study_text(text.replace("0.15", "0.01"))
    scene = study.scenes[0]
    mesh = next(mesh_family(build(scene.body), replace(study.mesh, maxh=(0.15,))))
    try:
        contact_line(mesh, constrain(mesh, scene.boundary), scene.edges(Contact))
    except GeometryFailed:
        with pytest.raises(StudyError, match="would be one element") as refused:
            read_study_text(text)
        [fault] = refused.value.problems
        example = fault.remedy.partition("example ")[2].partition(" m,")[0]
        assert read_study_text(text.replace("0.15", example)).scenes
    else:
        assert read_study_text(text).scenes
