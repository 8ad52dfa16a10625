"""The picture of a scene before any work: everything has its label, no label lies on another,
faults are marked."""

import re
from itertools import combinations
from pathlib import Path

import pytest

import tcstudy
from tcstudy.errors import StudyError
from tcstudy.pictures import draw_picture
from tcstudy.read.study import read_study_text
from tests.commands import CONFIGS

pytest.importorskip("matplotlib")


@pytest.mark.parametrize("name", ["quickstart", "two_films", "ring", "coated_block"])
def test_labels_stand_apart_and_say_what_edges_do(name: str) -> None:
    study = tcstudy.load(CONFIGS / f"{name}.yaml")
    figure = draw_picture(study, None)
    texts = [text for text in figure.axes[0].texts if text.get_text()]
    boxes = [text.get_window_extent() for text in texts]
    for (one, a), (two, b) in combinations(zip(texts, boxes, strict=True), 2):
        across = min(a.x1, b.x1) - max(a.x0, b.x0), min(a.y1, b.y1) - max(a.y0, b.y0)
        assert min(across) < 3.0, (one.get_text(), two.get_text())
    told = [text.get_text().split("\n")[:2] for text in texts]
    assert all([edge, role.word] in told for edge, role in study.scenes[0].boundary)
    assert "λ₁ ≈" in " ".join(text.get_text() for text in figure.texts)


def test_values_are_said_where_they_act() -> None:
    """θ = 0 on an edge is not an insulated one; a source of one region is no fact of the body."""
    held = {"boundary.bolted": {"role": "clamped", "heat": {"theta": 0}}, "path": None}
    figure = draw_picture(tcstudy.load(CONFIGS / "isola.yaml").with_(held), None)
    edges = {text.get_text().split("\n")[0]: text.get_text() for text in figure.axes[0].texts}
    assert "θ = 0 K" in edges["bolted"]
    assert "$g_{x}$ = 2 MPa" in edges["end"]
    assert "q = 500 kW" in edges["heater"]
    assert "q =" not in " ".join(text.get_text() for text in figure.texts)
    swept = {"friction": {"law": "tresca"}, "sweep": {"tau": [1e6, 2e6]}, "path": None}
    legend = (
        draw_picture(tcstudy.load(CONFIGS / "isola.yaml").with_(swept), None).axes[1].get_legend()
    )
    assert [text.get_text() for text in legend.get_texts()] == [
        "tresca τ = 1 MPa",
        "tresca τ = 2 MPa",
    ]


MIXED = """
body: {outline: [
  {from: [0 mm, 0 mm], edge: base}, {from: [30 mm, 0 mm], edge: bond}, {from: [70 mm, 0 mm], edge: glide},
  {from: [100 mm, 0 mm], edge: right}, {from: [100 mm, 10 mm], edge: top}, {from: [0 mm, 10 mm], edge: end}]}
boundary: {base: {role: contact, normal: unilateral}, bond: contact, glide: {role: contact, normal: free},
           right: clamped, top: free, end: {role: traction, pressure: 1 MPa}}
material: {E: 70 GPa, nu: 0.3}
friction: {bond: {law: bilinear, tau: 20 MPa, s0: 8 um, sf: 30 um}, base: {law: linear, k: 0},
           glide: {law: linear, k: 0}}
adhesion: {bond: {law: bilinear, sigma: 20 MPa, s0: 4 um, sf: 14 um}}
mesh: {maxh: 5 mm}
"""
CROSSED = """
body: {outline: [
  {from: [0 mm, 0 mm], edge: bottom},
  {from: [200 mm, 0 mm], edge: end}, {from: [200 mm, 60 mm], edge: top}, {from: [-20 mm, -30 mm], edge: left}]}
boundary: {bottom: contact, end: free, top: free, left: clampd}
material: {E: 1 GPa, nu: 0.3}
friction: {law: tresca, tau: 1 MPa}
mesh: {maxh: 20 mm}
"""


@pytest.mark.parametrize(
    ("text", "message", "marks"),
    [
        (CROSSED, "cross or touch", ["line 3: edge 1", "did you mean"]),
        (
            CROSSED.replace("[-20 mm, -30 mm]", "[0 mm, 60 mm]").replace(
                "left: clampd", "lfet: clamped"
            ),
            "no edge 'lfet'; did you mean 'left'",
            [
                "line 5: boundary.lfet: the body has",
                "line 5: the body has",
            ],  # above, and at the edge that may be meant
        ),
    ],
)
def test_edges_with_faults_are_marked(
    tmp_path: Path, text: str, message: str, marks: list[str]
) -> None:
    file, target = tmp_path / "faulty.yaml", tmp_path / "faulty.svg"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(StudyError, match=message):
        draw_picture(file, target)
    drawn = re.sub(r"\s+", " ", re.sub(r"<[^>]*>", "", target.read_text(encoding="utf-8")))
    assert all(mark in drawn for mark in marks)


def test_edges_that_open_are_named_and_both_laws_are_drawn() -> None:
    study = read_study_text(MIXED, "mixed", [])
    figure = draw_picture(study, None)
    edges = {text.get_text().split("\n")[0]: text.get_text() for text in figure.axes[0].texts}
    assert "contact, unilateral" in edges["base"]
    assert "contact, adhesive" in edges["bond"]
    assert "frictional" in edges["glide"]
    labels = [(axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes[1:]]
    assert labels == [
        ("slip s [µm]", "b(s) [MPa]"),
        ("opening $s_{N}$ [µm]", "$b_{N}$($s_{N}$) [MPa]"),
    ]
    texts = " ".join(text.get_text() for text in figure.texts)
    assert "ω = 2000 GPa" in texts
    pressed = read_study_text(MIXED, "mixed", ["friction.base={law: coulomb, mu: 0.3}"])
    assert draw_picture(pressed, None).axes[1].get_ylabel() == "b(s) [MPa]"
    without_bond = ["friction.base={law: coulomb, mu: 0.3}", "friction.bond={law: linear, k: 0}"]
    pressed = read_study_text(MIXED, "mixed", without_bond)
    figure = draw_picture(pressed, None)
    assert figure.axes[1].get_ylabel() == "b(s) / pressure"
    assert "Friction follows the pressure" in " ".join(text.get_text() for text in figure.texts)
