"""Accuracy against cost: what is measured is what a run pays, and what is said of it follows from the numbers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.contact.block import Answer
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.status import Status
from tcstudy.data.records import PointStatus
from tcstudy.data.store import Record
from tcstudy.errors import CostError
from tcstudy.scene.study import Study
from tcstudy.study import point as point_module
from tcstudy.study.convergence import converge
from tcstudy.study.cost import cost_to_file, measure
from tests.verification.scenes import RECTANGLE, study_of
from tests.verification.series import errors, series

CONFIGS = Path(__file__).parents[2] / "configs"
PULLED = RECTANGLE.replace("left: clamped, top: free", "left: clamped, top: {role: traction, g: [0.02, -0.01]}")
WEAK = "friction={law: slip-weakening, tau_s: 0.01, tau_k: 0.005, delta: 1}"
SMALL = ("mesh={maxh: 0.8, levels: 3}",)


def _measure(study: Study, runs: int = 2) -> Record:
    return measure(study, (0,) * len(study.shape), runs, lambda text, left: None)


def own(cost: Record) -> tuple[int, int, int]:
    """(family, solver, level) of the study's settings."""
    told = cost.attributes
    return (*(list(cost.values[k]).index(told[f"own_{k}"]) for k in ("family", "solver")), int(told["own_level"]))  # type: ignore[return-value]


@pytest.fixture(scope="module")
def cost() -> Record:
    return _measure(study_of(PULLED, *SMALL))


def test_all_families_and_solvers_are_measured_and_the_own_settings_named(cost: Record) -> None:
    assert cost.values["family"] == ["uniform", "graded", "adaptive"]
    assert cost.values["solver"] == ("separable-newton", "bundle-newton")
    assert own(cost) == (0, 0, 2)
    held = cost.values["n_dof"] >= 0
    assert np.array_equal(cost.values["status"][:, 0] == PointStatus.OK, held)
    assert np.all(held.sum(axis=1) >= [3, 2, 3])
    assert (
        cost.values["n_dof"][0, 2] == cost.values["n_dof"][0].max()
        or cost.values["n_dof"][0, 3] < 4.3 * cost.values["n_dof"][0, 2]
    )


def test_a_guarantee_charts_the_proved_bound_above_the_error() -> None:
    cost = _measure(study_of(PULLED, *SMALL, "mesh.guarantee=true", WEAK))
    held = cost.values["status"][:, 0] == PointStatus.OK
    bound, error = (cost.values[f"error_{name}"][:, 0][held] for name in ("u_bound", "u_energy"))
    assert np.all(bound > error)
    assert np.all((bound < 1.4 * error)[error < 0.15])  # the bound is over the least that ‖u‖ can be: wide where coarse


def test_errors_fall_and_solvers_agree_on_them(cost: Record) -> None:
    for name in ("u_energy", "u_L2", "xi_L2", "u_T_L2"):
        error = cost.values[f"error_{name}"][:, 0]
        for family in error:
            finite = family[np.isfinite(family)]
            assert finite[-1] < 0.75 * finite[0]
        solved = np.isfinite(cost.values[f"error_{name}"][:, 1])
        assert cost.values[f"error_{name}"][:, 1][solved] == pytest.approx(error[solved], rel=1e-6)
    assert "error_theta_L2" not in cost.values


def test_uniform_errors_are_those_of_converge() -> None:
    study = tcstudy.load(CONFIGS / "convergence.yaml", ["mesh.levels=3"])
    cost, known = _measure(study, runs=1), converge(study).points[0]
    assert cost.attributes["reference"] == "the exact solution"
    assert cost.attributes["reference_error"] == 0.0
    for name, one in errors(known).items():
        slack = 0.15 if name.endswith("max") else 1e-2  # norms at nodes depend on the finest mesh
        assert cost.values[f"error_{name}"][0, 0, :3] == pytest.approx(one.error, rel=slack), name
    resultant, found = series(known, "friction_resultant"), cost.values["error_friction_resultant"][0, 0, :3]
    assert found == pytest.approx(np.abs(resultant.value - resultant.exact) / abs(resultant.exact), rel=1e-6)


def test_graded_meshes_that_are_uniform_are_shown_once() -> None:
    for family, kept in (("graded", "graded"), ("adaptive", "uniform")):
        study = tcstudy.load(CONFIGS / "convergence.yaml", [f"mesh={{maxh: 0.5, levels: 2, family: {family}}}"])
        cost = _measure(study, runs=1)
        assert cost.values["family"] == [kept, "adaptive"]
        assert cost.values["family"][own(cost)[0]] == family
        assert any("shown once" in note for note in cost.attributes["notes"].splitlines())


def test_meshes_of_no_family_stand_for_themselves() -> None:
    cost = _measure(study_of(PULLED, "mesh={maxh: 0.8, tolerance: 0.2}"), runs=1)
    assert cost.values["family"][-1] == "study"
    family, solver, level = own(cost)
    assert (family, solver) == (3, 0)
    assert cost.values["n_dof"][family, level] > 0
    assert level + 1 == cost.values["n_dof"].shape[1] or cost.values["n_dof"][family, level + 1] < 0
    assert cost.values["error_u_energy"][own(cost)] < 0.26  # the tolerance with a margin for the estimate
    assert cost.values["time_steps"][own(cost)] > 0.0
    listed = _measure(study_of(PULLED, "mesh={maxh: [0.8, 0.7, 0.6]}"), runs=1)
    assert own(listed) == (3, 0, 2)
    assert np.all(listed.values["time_steps"][3, 0, :3] == 0.0)


def test_the_named_solver_comes_first_and_failures_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    original = point_module.solve_contact

    def fail(problem: ContactProblem, name: str, *options: object, **more: object) -> Answer:
        answer = original(problem, name, *options, **more)  # type: ignore[arg-type]
        bad = name == "bundle-newton"
        return replace(answer, status=Status.ITERATION_LIMIT, reason="made to fail") if bad else answer

    monkeypatch.setattr(point_module, "solve_contact", fail)
    plan = "solver=bundle-newton"
    with pytest.raises(CostError, match="reference"):
        _measure(study_of(PULLED, *SMALL, plan), runs=1)
    exact = tcstudy.load(CONFIGS / "convergence.yaml", ["mesh={maxh: 0.25, levels: 2}", plan])
    cost = _measure(exact, runs=1)
    assert cost.values["solver"][0] == "bundle-newton"
    failed = (cost.values["status"] != PointStatus.OK) & (cost.values["status"] != PointStatus.NOT_RUN)
    assert failed[:, 0].any()
    assert all(cost.values["reason"][tuple(at)] == "made to fail" for at in np.argwhere(failed))
    assert np.all(cost.values["dominated_u_energy"][failed])


def test_a_scene_without_load_is_refused_and_nothing_is_written(tmp_path: Path) -> None:
    study = study_of(RECTANGLE, *SMALL)
    with pytest.raises(CostError, match=r"nothing loads this scene.*--at"):
        cost_to_file(study, (), "", 1, tmp_path / "a.nc", lambda text, left: None, ["tcstudy"])
    assert not list(tmp_path.iterdir())
