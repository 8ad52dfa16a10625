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


def test_what_a_line_does_not_name_stays_from_one_cycle_to_the_next() -> None:
    plan = read_study_text(BASE).history
    assert plan is not None
    pressure = ("boundary", "top", "pressure")
    hot = [plan.stations()[end][pressure] for _, end, share, name, _ in plan.schedule() if name == "hot"]
    assert hot == [1e6, 2e6, 2e6]
    assert plan.stations()[2] == plan.stations()[4]


def test_only_friction_may_hold_a_body_with_a_memory() -> None:
    loose = BASE.replace("left: clamped", "left: free")
    plan = read_study_text(loose).history
    assert plan is not None
    assert plan.loose
    for text in (loose.replace("memory: friction", "memory: damage"), loose[: loose.index("history:")]):
        with pytest.raises(StudyError, match="contact does not hold the body"):
            read_study_text(text)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("memory: friction", "memory: frictoin", "8:11: history.memory: must be one of friction, elastic-plastic"),
        ("memory: friction", "memory: elastic-plastic", "history.stiffness: is missing; add stiffness"),
        ("memory: friction", "memory: elastic-plastic\n  stiffness: 1 GPa/m", "spring is too soft for the law"),
        ("memory: friction", "memory: friction\n  stiffness: 1 GPa/m", "9:3: history.stiffness: belongs to memory"),
        ("memory: friction", "memory: friction\n  healing: true", "9:3: history.healing: is gone: films do not heal"),
        (
            "{theta: 60 K, in: 8, name: hot}",
            "{theta: 5 K, in: 8}",
            "10:7: history.steps[0]: changes nothing: the loads",
        ),
        ("{theta: 60 K, in: 8, name: hot}", "{in: 8}", "10:7: history.steps[0]: changes nothing: no load is named"),
        ("{theta: 60 K, in: 8, name: hot}", "{thetta: 60 K}", "10:8: history.steps[0].thetta: is no load of this"),
        ("{theta: 60 K, in: 8, name: hot}", "{theta: 60 MPa}", "10:15: history.steps[0].theta: 'MPa' is not a unit"),
        ("{theta: 60 K, in: 8, name: hot}", "{theta: 60 K, in: 0}", "10:25: history.steps[0].in: must be"),
        (
            "{theta: 60 K, in: 8, name: hot}\n    - {theta: 5 K, boundary.top.pressure: 2 MPa}",
            "{theta: 60 K, in: 0}\n    - {theta: 5 K}",
            "10:25: history.steps[0].in: must be",
        ),
        ("{theta: 60 K, in: 8, name: hot}", "{load: 2}", "9:3: history.steps: load is a factor of all"),
        ("{theta: 60 K, in: 8, name: hot}", "{E: 1 GPa}", "10:8: history.steps[0].E: is no load"),
        ("theta: 5 K}\nfriction", "theta: 5*x}\nfriction", "varies in space (5*x), but in a history it is one number"),
        ("repeat: 3", "repeat: 3\n  substeps: 2", "13:3: history.substeps: is gone: every step follows its exact path"),
        ("repeat: 3", "repeat: 99999", "9:3: history.steps: the history has 899991 steps; 100000 are possible"),
        ("repeat: 3", "level: 2", "12:10: history.level: must be from 0 to 1"),
        ("repeat: 3", "repeat: 3\nsweep: {theta: [1 K, 2 K]}", "10:8: history.steps[0].theta: is swept, too"),
        ("repeat: 3", "repeat: 3\nsolver: bundle-newton", "13:1: solver: a history is solved by separable-newton"),
        ("repeat: 3", "repeat: 3\nsolver: {branch: continued}", "13:10: solver.branch: is of single points"),
        ("repeat: 3", "repeat: 3\noutput: {fields: true}", "13:10: output.fields: is not kept of a history"),
        ("levels: 2", "levels: 2, estimate: true", "6:1: mesh: errors are not estimated in a history"),
        ("memory: friction", "memory: plastic\n  stiffness: 1 GPa/m", "did you mean 'elastic-plastic'?"),
        ("levels: 2", "family: adaptive", "adaptive meshes follow from the solutions of a run"),
        ("tau_k: 1 MPa", "tau_k: 3 MPa", ""),
    ],
)
def test_one_fault_gives_one_line(old: str, new: str, said: str) -> None:
    text = BASE.replace(old, new, 1)
    assert text != BASE
    if not said:
        assert read_study_text(text).history
        return
    with pytest.raises(StudyError) as info:
        read_study_text(text, "study.yaml")
    first, *more = str(info.value).split("\n")
    assert said in first
    assert len(more) == ("theta: 5*x" in new or "sweep" in new)  # of both lines


def test_load_and_the_force_on_a_rigid_edge_do_not_change_together() -> None:
    plate = BASE.replace("top: {role: traction, pressure: 1 MPa}", "top: {role: rigid, force: [2 MN/m, 0]}")
    both = plate.replace("boundary.top.pressure: 2 MPa", "boundary.top.force_x: 3 MN/m")
    assert read_study_text(both).history
    with pytest.raises(StudyError, match=r"load is a factor of all .*, and boundary\.top\.force_x is one"):
        read_study_text(both.replace("{theta: 60 K, in: 8, name: hot}", "{load: 2}"))


def test_laws_that_a_memory_cannot_be_made_of() -> None:
    law = "law: slip-weakening, tau_s: 2 MPa, tau_k: 1 MPa, delta: 1 mm"
    rising = BASE.replace(law, "points: [[0 mm, 0 MPa], [1 mm, 1 MPa], [2 mm, 3 MPa]], law: piecewise-linear")
    assert read_study_text(rising).history
    with pytest.raises(StudyError, match=r"8:11: history.memory: damage needs a law whose secant b\(s\)/s never rises"):
        read_study_text(rising.replace("memory: friction", "memory: damage"), "study.yaml")
    one_sided = BASE.replace(law, "points: [[-1 mm, -1 MPa], [1 mm, 2 MPa]], law: piecewise-linear, odd: false")
    with pytest.raises(StudyError, match="a history needs an odd law"):
        read_study_text(one_sided, "study.yaml")
