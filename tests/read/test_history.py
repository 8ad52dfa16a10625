"""history: what is read of it, and one fault at its place for each thing that is wrong."""

from __future__ import annotations

import pytest

from tcstudy.errors import StudyError
from tcstudy.read.study import read_study_text

BASE = """\
body: {rectangle: {width: 20 m, height: 1 m}}
boundary: {bottom: contact, left: clamped, top: {role: traction, pressure: 1 MPa}, right: free}
material: {E: 210 GPa, nu: 0.3, alpha_T: 1.2e-5 1/K}
heat: {theta: 5 K}
friction: {law: slip-weakening, tau_s: 2 MPa, tau_k: 1 MPa, delta: 1 mm}
mesh: {maxh: 0.5 m, levels: 2}
history:
  memory: friction
  steps:
    - {theta: 60 K, in: 8, name: hot}
    - {theta: 5 K, boundary.top.pressure: 2 MPa}
  repeat: 3
"""


def test_a_history_is_read_with_its_lines() -> None:
    plan = read_study_text(BASE).history
    assert plan is not None
    assert (plan.steps, plan.repeat, plan.names, plan.loose) == (27, 3, ("theta", "pressure"), False)
    assert plan.stations()[0] == {("heat", "theta"): 5.0, ("boundary", "top", "pressure"): 1e6}
    assert [line.name for line in plan.lines] == ["hot", "theta 5 K, boundary.top.pressure 2 MPa"]
    schedule = list(plan.schedule())
    assert schedule[0] == (0, 1, 0.125, "", 1)
    assert schedule[9] == (2, 3, 0.125, "", 2)
    assert schedule[18] == (2, 3, 0.125, "", 3)
    pressure = ("boundary", "top", "pressure")  # what a line does not name stays from one cycle to the next
    assert [plan.stations()[j][pressure] for _, j, _, name, _ in schedule if name == "hot"] == [1e6, 2e6, 2e6]


def test_only_friction_may_hold_a_body_with_a_memory() -> None:
    loose = BASE.replace("left: clamped", "left: free")
    plan = read_study_text(loose).history
    assert plan is not None
    assert plan.loose
    for text in (loose.replace("memory: friction", "memory: damage"), loose[: loose.index("history:")]):
        with pytest.raises(StudyError, match="contact does not hold the body"):
            read_study_text(text)


def test_load_and_the_force_on_a_rigid_edge_do_not_change_together() -> None:
    plate = BASE.replace("top: {role: traction, pressure: 1 MPa}", "top: {role: rigid, force: [2 MN/m, 0]}")
    both = plate.replace("boundary.top.pressure: 2 MPa", "boundary.top.force_x: 3 MN/m")
    assert read_study_text(both).history
    with pytest.raises(StudyError, match=r"load is a factor of all .*, and boundary\.top\.force_x is one"):
        read_study_text(both.replace("{theta: 60 K, in: 8, name: hot}", "{load: 2}"))


BY_EDGE = BASE.replace(
    "rectangle: {width: 20 m, height: 1 m}",
    "outline: [{from: [0, 0], edge: bond}, {from: [9, 0], edge: joint}, {from: [20, 0], edge: right}, "
    "{from: [20, 1], edge: top}, {from: [0, 1], edge: left}]",
).replace("bottom: contact", "bond: contact, joint: contact")


@pytest.mark.parametrize(
    ("memory", "said"),
    [
        ("{bond: damage, joint: friction}", ""),
        ("{bond: friction, joint: friction}", ""),
        ("{bond: damage}", "memory: says nothing of joint, which is in contact, too; add joint: friction"),
        ("{bond: damage, joints: friction}", "memory.joints: joints is no contact edge; use bond, joint"),
        ("{bond: damage, joint: glue}", "memory.joint: must be one of friction, elastic-plastic, damage"),
        ("{bond: elastic-plastic, joint: friction}", "stiffness: is missing"),
    ],
)
def test_memory_by_edge(memory: str, said: str) -> None:
    text = BY_EDGE.replace("memory: friction", f"memory: {memory}")
    if said:
        with pytest.raises(StudyError) as info:
            read_study_text(text)
        assert said in str(info.value)
        return
    plan = read_study_text(text).history
    assert plan is not None
    assert plan.memory.words == ("bond: damage, joint: friction" if "damage" in memory else "friction")
    if "damage" not in memory:
        assert read_study_text(text.replace("left: clamped", "left: free")).history.loose  # type: ignore[union-attr]


def test_a_load_in_two_lines_has_a_fault_in_each() -> None:
    for old, new, said in (
        ("theta: 5 K}\nfriction", "theta: 5*x}\nfriction", "varies in space (5*x), but in a history it is one number"),
        ("repeat: 3", "repeat: 3\nsweep: {theta: [1 K, 2 K]}", "10:8: history.steps[0].theta: is swept, too"),
    ):
        with pytest.raises(StudyError) as info:
            read_study_text(BASE.replace(old, new), "study.yaml")
        first, _ = str(info.value).split("\n")
        assert said in first
