"""The section `mesh`: families, tolerances and goals, and what is said of a wrong one."""

from __future__ import annotations

import pytest

from tcstudy.errors import StudyError
from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Goal, MeshPlan

BASE = """
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, top: free, right: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.01}
"""


def mesh_of(text: str, more: str = "") -> MeshPlan:
    return read_study_text(f"{BASE}mesh: {text}\n{more}", "test").mesh


def faults(text: str, more: str = "") -> list[str]:
    with pytest.raises(StudyError) as info:
        mesh_of(text, more)
    return str(info.value).splitlines()


@pytest.mark.parametrize(
    ("text", "plan"),
    [
        ("{maxh: 0.5, levels: 3}", MeshPlan((0.5,), 3)),
        ("{maxh: 0.5, levels: 3, estimate: true}", MeshPlan((0.5,), 3, estimate=True)),
        ("{maxh: 0.5, levels: 3, family: graded}", MeshPlan((0.5,), 3, "graded")),
        ("{maxh: 0.5, levels: 3, family: graded, grading: 0.4}", MeshPlan((0.5,), 3, "graded", grading=0.4)),
        (
            "{maxh: 0.5, levels: 20, family: adaptive, marking: 0.3, goal: friction_resultant, max_dofs: 1000}",
            MeshPlan((0.5,), 20, "adaptive", marking=0.3, goal=Goal("friction_resultant"), max_dofs=1000),
        ),
        (
            "{maxh: 0.5, levels: 4, family: adaptive, goal: {u_T: [1.5, 0]}}",
            MeshPlan((0.5,), 4, "adaptive", goal=Goal("u_T", (1.5, 0.0))),
        ),
        ("{maxh: 0.5, tolerance: 1e-3}", MeshPlan((0.5,), 30, "adaptive", tolerance=1e-3)),
        (
            "{maxh: 0.5, tolerance: 1e-3, of: slip_length, max_levels: 12, known: 0.7, family: uniform}",
            MeshPlan((0.5,), 12, "uniform", goal=Goal("slip_length", None, 0.7), tolerance=1e-3),
        ),
        ("{maxh: [0.5, 0.25]}", MeshPlan((0.5, 0.25), 2)),
    ],
)
def test_plans(text: str, plan: MeshPlan) -> None:
    assert mesh_of(text) == plan


def test_a_tolerance_as_h_of_the_sweep() -> None:
    more = "sweep: {h: {tolerance: 1e-3, of: friction_resultant, known: 0.02}, tau: [0.01, 0.02]}\n"
    goal = Goal("friction_resultant", None, 0.02)
    assert mesh_of("{maxh: 0.5, marking: 0.4}", more) == MeshPlan(
        (0.5,), 30, "adaptive", marking=0.4, goal=goal, tolerance=1e-3
    )
    study = read_study_text(f"{BASE}mesh: {{maxh: 0.5}}\n{more}")
    assert [axis.name for axis in study.axes] == ["tau"]


def test_which_plans_estimate_and_which_are_nested() -> None:
    assert not MeshPlan((0.5,), 3).estimates
    assert MeshPlan((0.5,), 3, estimate=True).estimates
    assert MeshPlan((0.5,), 3, "adaptive").estimates
    assert MeshPlan((0.5,), 3, tolerance=0.1).estimates
    assert MeshPlan((0.5,), 3).nested
    assert not MeshPlan((0.5,), 3, "graded").nested
    assert not MeshPlan((0.5, 0.2), 2).nested


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("{maxh: 0.5, family: adaptve}", "test:7:27: mesh.family: must be one of uniform, graded, adaptive"),
        ("{maxh: 0.5, family: adaptve}", "did you mean 'adaptive'?"),
        ("{maxh: 0.5, grading: 0.4}", "test:7:19: mesh.grading: is for graded meshes; add family: graded"),
        ("{maxh: 0.5, family: graded, grading: 1.4}", "mesh.grading: must be less than 1, but is 1.4"),
        ("{maxh: 0.5, family: graded, grading: 0}", "mesh.grading: must be greater than 0"),
        ("{maxh: 0.5, family: graded, grading: 0.01}", "mesh.grading: must be 0.1 or more, but is 0.01"),
        ("{maxh: 0.5, marking: 0.4}", "mesh.marking: is for adaptive meshes; add family: adaptive"),
        ("{maxh: 0.5, family: adaptive, marking: 1}", "mesh.marking: must be less than 1"),
        ("{maxh: 0.5, tolerance: 1e-3, levels: 4}", "mesh.levels: the tolerance decides how many levels there are"),
        ("{maxh: 0.5, tolerance: 2}", "mesh.tolerance: must be less than 1, but is 2; write for example 0.001"),
        ("{maxh: 0.5, max_levels: 4}", "mesh.max_levels: is for a tolerance; use levels"),
        ("{maxh: 0.5, of: slip_length}", "mesh.of: says what the tolerance is of, but there is none; use goal"),
        ("{maxh: 0.5, tolerance: 0.1, of: energy, goal: energy}", "mesh.goal: of names the goal already"),
        ("{maxh: 0.5, tolerance: 0.1, of: friction}", "mesh.of: must be one of energy, friction_resultant"),
        ("{maxh: 0.5, tolerance: 0.1, of: u_T}", "mesh.of: u_T needs its point on a contact edge; write {u_T: ["),
        (
            "{maxh: 0.5, tolerance: 0.1, of: {u_T: [1, 1]}}",
            "mesh.of.u_T: the point (1, 1) is not on a contact edge, but 1",
        ),
        ("{maxh: 0.5, tolerance: 0.1, of: {u_N: [1, 0]}}", "mesh.of.u_N: unknown key; did you mean 'u_T'?"),
        ("{maxh: 0.5, tolerance: 0.1, known: 3}", "mesh.known: a known value needs a goal that is a number"),
        ("{maxh: 0.5, known: 3}", "mesh.known: a known value needs a goal that is a number"),
        ("{maxh: 0.5, goal: slip_length, known: 3}", "mesh.goal: no error is estimated here, so the goal is not used"),
        ("{maxh: [0.5, 0.2], family: adaptive}", "mesh.family: family goes with a single maxh"),
        ("{maxh: [0.5, 0.2], grading: 0.4}", "mesh.grading: grading goes with a single maxh; give one maxh"),
        ("{maxh: [0.5, 0.2], marking: 0.4}", "mesh.marking: marking goes with a single maxh; give one maxh"),
        ("{maxh: [0.5, 0.2], max_dofs: 400}", "mesh.max_dofs: max_dofs goes with a single maxh; give one maxh"),
        ("{maxh: [0.5, 0.2], goal: slip_length}", "mesh.goal: no error is estimated here, so the goal is not used"),
        ("{maxh: [0.5, 0.2], of: slip_length}", "mesh.of: says what the tolerance is of, but there is none; use goal"),
        ("{maxh: 0.5, max_dofs: 400}", "mesh.max_dofs: ends adaptive meshes and those for a tolerance; remove it"),
        ("{maxh: 0.5, refine: -1}", "mesh.refine: "),
        ("{maxh: 0.5, refine: 8}", "is larger than the body"),
        ("{maxh: [0.5, 0.2], tolerance: 0.1}", "mesh.tolerance: tolerance goes with a single maxh"),
        ("{maxh: 0.5, family: adaptive, levels: 1000}", "mesh.levels: must be from 1 to 60, but is 1000"),
        ("{maxh: 0.5, levels: 40}", "mesh.levels: must be from 1 to 15, but is 40"),
        ("{maxh: 0.5, tolernce: 0.1}", "mesh.tolernce: unknown key; did you mean 'tolerance'?"),
    ],
)
def test_faults_name_their_place_and_remedy(text: str, fault: str) -> None:
    lines = faults(text)
    assert len(lines) == 1, lines
    assert fault in lines[0]


def test_faults_in_the_sweep() -> None:
    assert "sweep.h.tolerance: is missing" in faults("{maxh: 0.5}", "sweep: {h: {of: slip_length}}\n")[0]
    twice = faults("{maxh: 0.5, tolerance: 0.1}", "sweep: {h: {tolerance: 1e-3}}\n")
    assert "sweep.h.tolerance: mesh.tolerance is given, too; give it once" in twice[0]
    with pytest.raises(StudyError) as info:
        read_study_text(f"{BASE}sweep: {{h: {{tolerance: 1e-3}}}}\n", "test")
    assert str(info.value).splitlines() == ["test:2:1: mesh: is missing; add mesh: {maxh: 10}"]
