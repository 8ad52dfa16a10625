"""The finer level that goals are compared on, parts of what it changes, and what is estimated when
it fails."""

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from tcstudy.contact.problem import Status
from tcstudy.contact.solve import Answer, solve_contact
from tcstudy.data.records import LevelRecord
from tcstudy.offline.level import Level
from tcstudy.refine import goal_error as goal_error_module
from tcstudy.refine.family import ErrorEstimator, Family
from tcstudy.refine.goal_error import SMOOTH, Halved, contributions, regions
from tcstudy.refine.goals import dual, goal_value, steps, torn
from tcstudy.scene.mesh_plan import Goal, MeshPlan
from tcstudy.scene.records import Scene
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


def refined(text: str, plan: str, levels: int) -> tuple[Level, Scene, dict[str, float]]:
    """The last of some levels that follow from solutions, and what is estimated on it."""
    study = study_of(text, f"mesh={{{plan}, family: adaptive}}")
    family, scene = Family(study), study.scenes[0]
    for i in range(levels):
        level = Level(family.next(i), scene)
        estimator = family.estimator(level)
        stored = estimator.look((), scene, solve_contact(level.condensed(scene).problem).v)
    assert np.any(estimator.shares() > 0.0)
    return level, scene, stored


def test_a_finer_problem_that_fails_makes_the_error_infinite_a_turning_point_does_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Never a silent number; refinement then follows the energy norm, as without a dual
    solution."""

    def singular(*_: object) -> None:
        raise scipy.linalg.LinAlgError("made singular")

    def fail(*args: object, **more: object) -> Answer:
        return replace(solve_contact(*args, **more), status=Status.INCLUSION_VIOLATED)  # type: ignore[arg-type]

    def look(levels: int) -> dict[str, float]:
        return refined(PULLED, "maxh: 0.5, levels: 3, goal: friction_resultant", levels)[2]

    whole = look(1)
    with monkeypatch.context() as patch:
        patch.setattr(goal_error_module, "dual", singular)
        assert look(1)["goal_estimate"] == pytest.approx(whole["goal_estimate"], rel=0.5)
    monkeypatch.setattr(goal_error_module, "solve_contact", fail)
    stored = look(2)
    assert stored["goal_estimate"] == math.inf
    assert np.isfinite(stored["error_estimate"])


def test_no_error_at_all_on_the_first_mesh_is_not_believed() -> None:
    """A front that both meshes of the estimate miss leaves no error; three meshes are looked at all
    the same."""
    plan = "mesh={maxh: 0.5, tolerance: 0.01, of: slip_length}"
    study = study_of(
        PULLED.replace("tau: 0.01", "tau: 10"), plan
    )  # everything sticks: the slip length is 0
    levels = [record for record in run(study) if isinstance(record, LevelRecord)]
    assert [record.level for record in levels] == [0, 1, 2, 2]
    assert levels[-1].stop.startswith("tolerance 0.01 met: estimated relative error 0 ")
    assert levels[1].n_dof > 1.2 * levels[0].n_dof


def test_factors_are_those_of_smooth_solutions_and_of_corners() -> None:
    none = np.empty((0, 2))
    study = stick_slip(1)
    level, scene = Level(Family(study).next(0), study.scenes[0]), study.scenes[0]
    factors, region = regions(Halved(level, scene), scene, np.zeros(level.line.m, dtype=bool), none)
    assert np.all(factors == SMOOTH)
    assert len(np.unique(region)) == 4  # as many as the body has corners
    level, scene, _ = refined(
        HEATED_BRACKET, "maxh: 0.4, levels: 3", 2
    )  # with arcs, a hole and a region
    halved = Halved(level, scene)
    factors, region = regions(halved, scene, np.zeros(level.line.m, dtype=bool), none)
    node = int(np.argmin(np.linalg.norm(level.mesh.points - [1.0, -0.3], axis=1)))
    touching = np.any(level.mesh.triangles == node, axis=1)
    around = np.unique(halved.level.mesh.triangles[touching[halved.parent]])
    lam = 180.0 / 174.21486877 - 1.0  # π/ω − 1 between slipping edges
    assert factors[around] == pytest.approx(1.0 / (1.0 - 2.0 ** (-2.0 * lam)), rel=1e-6)
    assert set(np.flatnonzero(region == region[node])) == set(around)


@pytest.mark.parametrize("known", [None, 0.5])
def test_an_estimator_compares_with_the_exact_solution(known: float | None) -> None:
    study = front_study(0.4)
    plan = MeshPlan((0.2,), 1, goal=replace(RESULTANT, known=known), estimate=True)
    scene = study.scenes[0]
    level = Level(Family(study).next(0), scene)
    condensed = level.condensed(scene)
    v = solve_contact(condensed.problem).v
    stored = ErrorEstimator(level, plan, exact=study.exact).look((), scene, v)
    error = abs(
        goal_value(RESULTANT, condensed.problem, level.line, v) - (known or front_resultant(0.4))
    )
    assert stored["goal_error"] == pytest.approx(error, rel=1e-2)
    assert stored["goal_effectivity"] == pytest.approx(
        stored["goal_estimate"] / stored["goal_error"]
    )


def test_falls_and_turns_between_two_nodes_are_tears_and_bends_are_not() -> None:
    weakens = "law: slip-weakening, tau_s: 0.01, tau_k: 0.004, delta: 0.1"
    study = study_of(PULLED.replace("law: tresca, tau: 0.01", weakens))
    level = Level(Family(study).next(0), study.scenes[0])
    problem = level.condensed(study.scenes[0]).problem
    right = level.line.xy[:, 0] > level.line.xy[1, 0]

    def tear(left: float, slip: float) -> float:
        return float((torn(level.line, problem, np.where(right, slip, left)) / width).sum())

    width = level.line.lengths
    assert tear(0.0, 100.0) == pytest.approx(0.5 * 0.006, rel=2e-3)  # all of the fall in a cell
    assert tear(0.09, 0.11) == pytest.approx(0.5 * 0.5 * 0.006 * 0.1, rel=1e-6)  # a bend
    assert tear(-1e-9, 1e-9) == pytest.approx(
        0.5 * 0.02, rel=1e-6
    )  # a turn without a node that sticks
    assert tear(0.0, 0.05) == 0.0


def test_a_step_of_strength_is_told_from_smooth_growth_and_from_nodes_that_stick() -> None:
    def found(strength: str, v: float) -> list[float]:
        study = study_of(
            PULLED.replace("tau: 0.01", f'tau: 0.01, strength: "{strength}"').replace("0.5", "0.2")
        )
        level = Level(Family(study).next(0), study.scenes[0])
        problem = level.condensed(study.scenes[0]).problem
        at = steps(level.line, problem, np.full(level.line.m, v))
        x = level.line.ends[:, :, 0]
        assert all(x[i].min() < 0.91 < x[i].max() for i in np.flatnonzero(at))
        return [float(step) for step in at[at > 0.0]]

    step = "1 - 0.6*max(0, min(1, (x - 0.91)*1e9))"
    assert found(step, 0.1) == pytest.approx([0.006])
    assert found(f"({step})*(1 + 0.1*x)", -0.1) == pytest.approx([0.006], rel=0.1)
    assert (found("1 + 0.5*sin(4*x)", 0.1), found("1 + x", 0.1), found(step, 0.0)) == ([], [], [])


LINEAR = PULLED.replace("{law: tresca, tau: 0.01}", "{law: linear, k: 0.4}")
SPRUNG = LINEAR.replace(
    "right: free", "right: {role: traction, spring: {normal: 0.7, tangential: 0.3}}"
)
TURNED = SPRUNG.replace("left: clamped", "left: free").replace(
    'top: {role: traction, g: ["0.03*x", -0.01]}',
    "top: {role: rigid, force: [0.02, -0.01], moment: 0.005}",
)
GRADED = LINEAR.replace("k: 0.4}", 'k: 0.4, strength: "2 + sin(3*x)"}').replace(
    "left: clamped", "left: symmetry"
)
STICKS = LINEAR.replace("{law: linear, k: 0.4}", "{law: tresca, tau: 1e6}")


@pytest.mark.parametrize("text", [SPRUNG, TURNED, GRADED, STICKS])
@pytest.mark.parametrize("goal", [RESULTANT, Goal("u_T", (1.4, 0.0))], ids=["resultant", "slip"])
def test_parts_sum_to_the_change_where_the_problem_is_linear(text: str, goal: Goal) -> None:
    """As that of Tresca friction is while no node changes sides; a sum without springs, or with a
    rigid edge node by node, is wrong."""
    study = study_of(text, "mesh={maxh: 0.4, levels: 1}")
    scene = study.scenes[0]
    coarse = Level(Family(study).next(0), scene)
    halved = Halved(coarse, scene)
    fine = halved.level
    condensed, finer = coarse.condensed(scene), fine.condensed(scene)
    v, w = solve_contact(condensed.problem).v, solve_contact(finer.problem).v
    u = (halved.carry(coarse.displacement(scene, v)), fine.displacement(scene, w))
    z = fine.extension(scene, dual(goal, finer.problem, fine.line, w))
    parts = contributions(goal, halved, scene, (condensed.problem, finer.problem), (v, w), u, z)
    change = goal_value(goal, finer.problem, fine.line, w) - goal_value(
        goal, condensed.problem, coarse.line, v
    )
    assert float(parts.sum()) == pytest.approx(change, rel=1e-8, abs=1e-14)
    assert float(np.abs(parts).sum()) >= abs(change)
