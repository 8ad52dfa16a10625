"""history: what is read of it; the faults that need another study than those of bad_studies.txt."""

import pytest

from tcstudy.errors import StudyError
from tcstudy.read.study import read_study_text
from tcstudy.scene.histories import HistoryPlan

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
BY_EDGE = BASE.replace("memory: friction", "memory: {bond: friction, joint: friction}").replace(
    "rectangle: {width: 20 m, height: 1 m}",
    "outline: [{from: [0, 0], edge: bond}, {from: [9, 0], edge: joint}, {from: [20, 0], edge: right}, "
    "{from: [20, 1], edge: top}, {from: [0, 1], edge: left}]",
).replace("bottom: contact", "bond: contact, joint: contact")  # fmt: skip
FORCED = BASE.replace(
    "top: {role: traction, pressure: 1 MPa}", "top: {role: rigid, force: [2 MN/m, 0]}"
)
FORCED = FORCED.replace("boundary.top.pressure: 2 MPa", "boundary.top.force_x: 3 MN/m")


def plan_of(text: str) -> HistoryPlan:
    return read_study_text(text).history  # type: ignore[return-value]


def test_a_history_is_read_with_its_lines() -> None:
    plan = plan_of(BASE)
    assert (plan.steps, plan.repeat, plan.names) == (27, 3, ("theta", "pressure"))
    assert plan.stations()[0] == {("heat", "theta"): 5.0, ("boundary", "top", "pressure"): 1e6}
    assert [line.name for line in plan.lines] == ["hot", "theta 5 K, boundary.top.pressure 2 MPa"]
    schedule = list(plan.schedule())
    assert [schedule[i] for i in (0, 9, 18)] == [
        (0, 1, 0.125, "", 1),
        (2, 3, 0.125, "", 2),
        (2, 3, 0.125, "", 3),
    ]
    pressure = (
        "boundary",
        "top",
        "pressure",
    )  # what a line does not name stays from one cycle to the next
    assert [plan.stations()[j][pressure] for _, j, _, name, _ in schedule if name == "hot"] == [
        1e6,
        2e6,
        2e6,
    ]
    assert plan_of(BY_EDGE).memory.words == "friction"
    assert plan_of(
        BY_EDGE.replace("{bond: f", "{joint: damage, bond: f").replace(", joint: friction", "")
    ).memory.edges
    assert plan_of(FORCED).names == ("theta", "force_x")


def test_a_load_in_two_lines_has_a_fault_in_each() -> None:
    for old, new, said in (
        ("theta: 5 K}\nfriction", "theta: 5*x}\nfriction", r"it varies in space \(5\*x\)"),
        (
            "repeat: 3",
            "repeat: 3\nsweep: {theta: [1 K, 2 K]}",
            r"10:8: history\.steps\[0\]\.theta: is swept, too",
        ),
    ):
        with pytest.raises(StudyError, match=f"{said}.*\n"):
            read_study_text(BASE.replace(old, new), "study.yaml")
