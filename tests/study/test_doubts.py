"""What a plan and a run say of studies that their authors may not have meant."""

from __future__ import annotations

import math

import pytest

from tcstudy.read.study import read_study_text
from tcstudy.study.doubts import doubts, loaded
from tcstudy.study.plan import plan, warnings
from tests.verification.scenes import HEATED_BRACKET, RECTANGLE, study_of

ARC = """\
units: none
material: {E: 1, nu: 0.3}
body:
  outline:
    - {from: [0, 0], edge: bot}
EDGES
    - {from: [1.5, 1.5], edge: top}
    - {from: [0, 1.5], edge: left}
boundary: {bot: contact, top: {role: traction, g: [0, 0.1]}, left: clamped}
friction: {law: tresca, tau: 0.001}
mesh: {maxh: 0.1}
"""
CHORDS = [(1.5 * math.sin(i * math.pi / 16), 1.5 - 1.5 * math.cos(i * math.pi / 16)) for i in range(1, 8)]
SI = """\
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, right: convection, top: free, left: clamped}
material: {E: 1 GPa, nu: 0.25, k: 10, alpha_T: 1e-5}
heat: {alpha: 10, theta_bar: 293 K}
friction: {law: tresca, tau: 1 MPa}
mesh: {maxh: 0.5}
"""


def test_every_corner_of_a_chain_of_chords_is_counted_and_arcs_are_named() -> None:
    edges = "\n".join(f"    - {{from: [{x:.9f}, {y:.9f}], edge: bot}}" for x, y in CHORDS)
    study = read_study_text(ARC.replace("EDGES", edges))
    [note] = [note for note in plan(study).notes if "pinned" in note]
    assert note.startswith("7 corners of the contact line are pinned")
    assert "through: [x, y]" in note
    assert note in warnings(study)


def test_a_smooth_junction_of_arcs_is_no_corner() -> None:
    arcs = "    - {from: [%.9f, %.9f], edge: bot, through: [%.9f, %.9f]}" % (*CHORDS[3], *CHORDS[5])  # noqa: UP031
    text = ARC.replace("EDGES", arcs).replace(
        "{from: [0, 0], edge: bot}",
        "{from: [0, 0], edge: bot, through: [%.9f, %.9f]}" % CHORDS[1],  # noqa: UP031
    )
    assert not any("pinned" in note for note in doubts(read_study_text(text)))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("boundary.top=free", "nothing loads this scene"),
        ("boundary.top={role: traction, g: [0, 0]}", "nothing loads this scene"),
        ("boundary.left={role: clamped, u_x: 0.1, u_y: 0}", ""),
        ("loads.f=[0, -1]", ""),
        ("friction={law: piecewise-linear, points: [[-1, -1], [1, 2]], odd: false, slopes: [1, 1]}", ""),
    ],
)
def test_a_scene_that_nothing_loads(change: str, words: str) -> None:
    study = study_of(RECTANGLE, change)
    found = [note for note in warnings(study) if "nothing loads" in note]
    assert [note.split(":")[0] for note in found] == ([words] if words else [])


def test_temperature_loads_a_body_only_with_beta() -> None:
    assert loaded(study_of(HEATED_BRACKET).scenes).all()
    text = SI.replace(", alpha_T: 1e-5", "")
    assert not loaded(read_study_text(text).scenes).any()
    swept = read_study_text(SI + "sweep: {theta_bar: [0, 20], E: [1 GPa, 2 GPa]}\n")
    assert loaded(swept.scenes).tolist() == [False, False, True, True]
    assert any(note.startswith("nothing loads 2 of 4 points") for note in doubts(swept))


def test_room_temperature_is_taken_for_an_absolute_one() -> None:
    [note] = doubts(read_study_text(SI))
    assert note.startswith("theta_bar = 293 K: temperatures count from the stress-free state")
    assert doubts(read_study_text(SI, "a.yaml", ["heat.theta_bar=20"])) == []
    plain = SI.replace(" GPa", "e9").replace(" MPa", "e6").replace(" K", "")
    assert doubts(read_study_text("units: none\n" + plain)) == []
