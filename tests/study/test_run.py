"""A study through to its file: values in their places, reuse, failures recorded, resuming after a kill."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.contact.contact import solve_contact
from tcstudy.data.records import PointStatus
from tcstudy.fem import heat_forms as heat
from tcstudy.laws.laws import Laws
from tcstudy.offline import level as level_module
from tcstudy.study import level_solver
from tests.verification.scenes import HEATED_BRACKET, RECTANGLE, levels_of, study_of

SWEPT = (
    RECTANGLE.replace("left: clamped, top: free", 'left: clamped, top: {role: traction, g: ["0.03*x", -0.01]}')
    + """
sweep: {friction.tau: [0.005, 0.01, 0.02], E: [1, 2]}
"""
)


def run(tmp_path: Path, text: str, *overrides: str) -> xr.DataTree:
    return tcstudy.run(study_of(text, *overrides), tmp_path / "out.nc", force=True)


def test_values_stand_at_their_points(tmp_path: Path) -> None:
    """Points are solved in an order of their own; each must come back under its labels."""
    tree = run(tmp_path, SWEPT)
    data = tree.to_dataset()
    assert data["status"].dims == ("tau", "E", "level")
    assert np.all(data["status"] == int(PointStatus.OK))
    assert data["tau"].values.tolist() == [0.005, 0.01, 0.02]
    study = study_of(SWEPT, "sweep={}", "friction.tau=0.02", "material.E=2")
    level = levels_of(study)[1]
    alone = solve_contact(level.condensed(study.scenes[0]).problem)
    stored = tree["level_1"]["u_T"].sel(tau=0.02, E=2)
    assert np.max(np.abs(stored.values - alone.v)) < 1e-14
    assert 0 < float(data["slip_length"].sel(tau=0.02, E=2, level=1)) < 2
    traction = tree["level_1"]["xi"].sel(tau=0.02, E=2).values
    resultant = float(traction @ tree["level_1"]["c"].values)
    assert float(data["friction_resultant"].sel(tau=0.02, E=2, level=1)) == pytest.approx(resultant, rel=1e-12)
    assert np.all(data["lambda_1"].sel(E=2) == pytest.approx(2 * data["lambda_1"].sel(E=1).values, rel=1e-10))


@pytest.mark.parametrize(("material", "ratios"), [("E: [1, 2]", 1), ("E: [1, 0.3, 7.7]", 1), ("nu: [0.2, 0.3]", 2)])
def test_one_factorisation_a_mesh_and_ratio(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, material: str, ratios: int
) -> None:
    """λ/μ makes the factor, E only scales it; a new ratio takes over the order of elimination."""
    plans = []
    original = level_module.condense
    monkeypatch.setattr(level_module, "condense", lambda *a, **k: plans.append(k["plan"]) or original(*a, **k))
    tree = run(tmp_path, SWEPT.replace("E: [1, 2]", material), "mesh.levels=2")
    assert np.all(tree["status"] == int(PointStatus.OK))
    assert len(plans) == 2 * ratios
    assert sum(plan is None for plan in plans) == 2


KNOWN = ("boundary.right={role: traction, g: [0.01, 0.02*y], pressure: 0.03}", "boundary.bore=free")


@pytest.mark.parametrize(
    "changes", [("material.alpha_T=0",), ("heat={theta: 3}", *KNOWN), ("heat={alpha: 1, theta_bar: 5}",)]
)
def test_no_heat_problem_where_none_is_needed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changes: tuple[str, ...]
) -> None:
    def refuse(self: heat.HeatForms) -> None:
        raise AssertionError("the heat matrix was assembled")

    monkeypatch.setattr(heat.HeatForms, "conduction", property(refuse))
    tree = run(tmp_path, HEATED_BRACKET, *changes)
    assert np.all(tree["status"] == int(PointStatus.OK)), tree["reason"].values


def test_a_failing_point_is_recorded_and_the_rest_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    original = level_solver.solve_block

    def fail_once(body: object, loads: object, laws: Laws, *options: object) -> object:
        if np.any(laws.scales[laws.index] == 0.01):
            raise ArithmeticError("made to fail")
        return original(body, loads, laws, *options)  # type: ignore[arg-type]

    monkeypatch.setattr(level_solver, "solve_block", fail_once)
    data = run(tmp_path, SWEPT).to_dataset()
    assert np.all(data["status"].sel(tau=0.01) == int(PointStatus.ERROR))
    assert np.all(data["status"].drop_sel(tau=0.01) == int(PointStatus.OK))
    assert str(data["reason"].sel(tau=0.01)[0, 0].item()) == "ArithmeticError: made to fail"
    assert np.all(np.isnan(data["energy"].sel(tau=0.01)))
