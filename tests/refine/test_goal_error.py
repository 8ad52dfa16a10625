"""The finer level that goals are compared on, what is estimated when it fails, and goals of exact solutions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from tcstudy.contact.block import Answer
from tcstudy.contact.contact import solve_contact
from tcstudy.contact.status import Status
from tcstudy.data.records import LevelRecord
from tcstudy.offline.level import Level
from tcstudy.refine import goal_error as goal_error_module
from tcstudy.refine.error_estimator import ErrorEstimator
from tcstudy.refine.family import Family
from tcstudy.refine.goal_error import SMOOTH, regions
from tcstudy.refine.goals import goal_value, steps, torn
from tcstudy.refine.halved import Halved
from tcstudy.scene.study import Goal, MeshPlan
from tcstudy.study.run import run
from tests.verification.closed_forms import stick_slip
from tests.verification.goal_scenes import RESULTANT, front_resultant, front_study
from tests.verification.scenes import HEATED_BRACKET, study_of

PULLED = """
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, top: {role: traction, g: ["0.03*x", -0.01]}, right: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 0.01}
mesh: {maxh: 0.5, levels: 3, family: adaptive, goal: friction_resultant}
"""


def bracket() -> tuple[Level, Halved]:
    """A body with arcs, a hole and a region, after a step of bisection."""
    study = study_of(HEATED_BRACKET, "mesh={maxh: 0.4, levels: 3, family: adaptive}")
    family, scene = Family(study), study.scenes[0]
    for i in range(2):
        level = Level(family.next(i), scene)
        estimator = family.estimator(level)
        assert estimator is not None
        condensed = level.condensed(scene)
        estimator.look((), scene, solve_contact(condensed.problem).v)
    return level, Halved(level, scene)


def look(goal: Goal = RESULTANT, levels: int = 2) -> dict[str, float]:
    study = study_of(PULLED)
    study = replace(study, mesh=replace(study.mesh, goal=goal))
    family, scene = Family(study), study.scenes[0]
    for i in range(levels):
        level = Level(family.next(i), scene)
        estimator = family.estimator(level)
        assert estimator is not None
        condensed = level.condensed(scene)
        stored = estimator.look((), scene, solve_contact(condensed.problem).v)
    assert np.any(estimator.shares() > 0.0)
    return stored


def test_a_finer_problem_that_fails_makes_the_error_infinite(monkeypatch: pytest.MonkeyPatch) -> None:
    """Never a silent number; refinement then follows the energy norm."""

    def fail(*args: object, **more: object) -> Answer:
        return replace(solve_contact(*args, **more), status=Status.INCLUSION_VIOLATED)  # type: ignore[arg-type]

    monkeypatch.setattr(goal_error_module, "solve_contact", fail)
    stored = look()
    assert stored["goal_estimate"] == math.inf
    assert np.isfinite(stored["error_estimate"])


def test_a_turning_point_leaves_the_estimate(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a dual solution the shares are those of the energy norm, and the number is estimated all the same."""

    def singular(*_: object) -> None:
        raise scipy.linalg.LinAlgError("made singular")

    whole = look(levels=1)
    monkeypatch.setattr(goal_error_module, "dual", singular)
    without = look(levels=1)
    assert without["goal_estimate"] == pytest.approx(whole["goal_estimate"], rel=0.5)
    assert 0.0 < look()["goal_estimate"] < math.inf


def test_no_error_at_all_on_the_first_mesh_is_not_believed() -> None:
    """A front that both meshes of the estimate miss leaves no error; three meshes are looked at all the same."""
    plan = "mesh={maxh: 0.5, tolerance: 0.01, of: slip_length}"
    study = study_of(PULLED.replace("tau: 0.01", "tau: 10"), plan)  # everything sticks: the slip length is 0
    levels = [record for record in run(study) if isinstance(record, LevelRecord)]
    assert [record.level for record in levels] == [0, 1, 2, 2]
    assert levels[-1].stop.startswith("tolerance 0.01 met: estimated relative error 0 ")
    assert levels[1].n_dof > 1.2 * levels[0].n_dof


def test_factors_are_those_of_smooth_solutions_and_of_corners() -> None:
    study, nowhere = stick_slip(1), np.empty((0, 2))
    level = Level(Family(study).next(0), study.scenes[0])
    scene = study.scenes[0]
    factors, region = regions(Halved(level, scene), scene, np.zeros(level.line.m, dtype=bool), nowhere)
    assert np.all(factors == SMOOTH)
    assert len(np.unique(region)) == 4  # as many as the body has corners
    level, halved = bracket()
    scene = study_of(HEATED_BRACKET).scenes[0]
    factors, region = regions(halved, scene, np.zeros(level.line.m, dtype=bool), nowhere)
    node = int(np.argmin(np.linalg.norm(level.mesh.points - [1.0, -0.3], axis=1)))
    touching = np.any(level.mesh.triangles == node, axis=1)
    around = np.unique(halved.level.mesh.triangles[touching[halved.parent]])
    lam = 180.0 / 174.21486877 - 1.0  # π/ω − 1 between slipping edges
    assert factors[around] == pytest.approx(1.0 / (1.0 - 2.0 ** (-2.0 * lam)), rel=1e-6)
    assert set(np.flatnonzero(region == region[node])) == set(around)


@pytest.mark.parametrize("pick", [lambda p: p, lambda p: replace(p, goal=replace(p.goal, known=0.5))])
def test_an_estimator_compares_with_the_exact_solution(pick: Callable[[MeshPlan], MeshPlan]) -> None:
    """What the study says is known goes first."""
    study = front_study(0.4)
    plan = pick(MeshPlan((0.2,), 1, goal=RESULTANT, estimate=True))
    scene = study.scenes[0]
    level = Level(Family(study).next(0), scene)
    condensed = level.condensed(scene)
    v = solve_contact(condensed.problem).v
    stored = ErrorEstimator(level, plan, exact=study.exact).look((), scene, v)
    known = front_resultant(0.4) if plan.goal.known is None else plan.goal.known
    error = abs(goal_value(RESULTANT, condensed.problem, level.line, v) - known)
    assert stored["goal_error"] == pytest.approx(error, rel=1e-2)
    assert stored["goal_effectivity"] == pytest.approx(stored["goal_estimate"] / stored["goal_error"])


def test_falls_and_turns_between_two_nodes_are_tears_and_bends_are_not() -> None:
    study = study_of(
        PULLED.replace("law: tresca, tau: 0.01", "law: slip-weakening, tau_s: 0.01, tau_k: 0.004, delta: 0.1")
    )
    level = Level(Family(study).next(0), study.scenes[0])
    problem = level.condensed(study.scenes[0]).problem
    right = level.line.xy[:, 0] > level.line.xy[1, 0]

    def tear(left: float, slip: float) -> float:
        return float((torn(level.line, problem, np.where(right, slip, left)) / width).sum())

    width = level.line.lengths
    assert tear(0.0, 100.0) == pytest.approx(0.5 * 0.006, rel=2e-3)  # all of the fall in a cell
    assert tear(0.09, 0.11) == pytest.approx(0.5 * 0.5 * 0.006 * 0.1, rel=1e-6)  # a bend
    assert tear(-1e-9, 1e-9) == pytest.approx(0.5 * 0.02, rel=1e-6)  # a turn without a node that sticks
    assert tear(0.0, 0.05) == 0.0


def test_a_step_of_strength_is_told_from_smooth_growth_and_from_nodes_that_stick() -> None:
    def found(strength: str, v: float) -> list[float]:
        study = study_of(PULLED.replace("tau: 0.01", f'tau: 0.01, strength: "{strength}"').replace("0.5", "0.2"))
        level = Level(Family(study).next(0), study.scenes[0])
        problem = level.condensed(study.scenes[0]).problem
        at = steps(level.line, problem, np.full(level.line.m, v))
        x = level.line.ends[:, :, 0]
        assert all(x[i].min() < 0.91 < x[i].max() for i in np.flatnonzero(at))
        return [float(step) for step in at[at > 0.0]]

    step = "1 - 0.6*max(0, min(1, (x - 0.91)*1e9))"
    assert found(step, 0.1) == pytest.approx([0.006])
    assert found(f"({step})*(1 + 0.1*x)", -0.1) == pytest.approx([0.006], rel=0.1)
    assert found("1 + 0.5*sin(4*x)", 0.1) == []
    assert found("1 + x", 0.1) == []
    assert found(step, 0.0) == []
