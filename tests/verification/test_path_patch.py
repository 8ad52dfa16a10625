"""The multivalued patch test along its top displacement U: every figure of the path in closed form.

Law b = 1 − 2s up to s = 0.4, then 0.2, with G = H = 1: sticking up to U = 1, softening from (U, s) = (1, 0) back to
(0.6, 0.4), slipping from there on with s = U − 0.2.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from tcstudy.data.store import load_root
from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Study
from tcstudy.study.path_run import execute_path
from tests.verification.patch import LENGTH, SOFTENING, Case, patch_study

REQUESTED = "path: {parameter: boundary.top.u_x, from: 0, to: 1.5, at: [0.8, 0.5]}"


def path_of(text: str, folder: Path, *overrides: str) -> xr.Dataset:
    study: Study = read_study_text(text, "test", overrides)
    assert execute_path(study, folder / "path.nc") == []
    return load_root(folder / "path.nc", "path")


def patch_text(maxh: float, law: str = SOFTENING) -> str:
    return f"{patch_study(Case(law, 0.3, ()), maxh).text}\n{REQUESTED}\n"


@pytest.fixture(scope="module", params=[0.6, 0.17])
def softening(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    return path_of(patch_text(request.param), tmp_path_factory.mktemp("patch"))


def test_folds(softening: xr.Dataset) -> None:
    folds = softening["parameter"].values[softening["fold_vertex"].values]
    assert folds == pytest.approx([-0.6, -1.0, 1.0, 0.6], abs=1e-12)
    slips = softening["u_T"].values[softening["fold_vertex"].values]
    assert slips == pytest.approx(np.outer([-0.4, 0.0, 0.0, 0.4], np.ones(slips.shape[1])), abs=1e-12)
    assert softening["fold_maximum"].values.tolist() == [1, 0, 1, 0]
    assert softening["fold_stable_before"].values.tolist() == [1, 0, 1, 0]
    assert softening["fold_stable_after"].values.tolist() == [0, 1, 0, 1]


def test_all_three_solutions(softening: xr.Dataset) -> None:
    assert softening["at"].values.tolist() == [0.8, 0.5]
    assert softening["solution_count"].values.tolist() == [3, 1]
    three = softening.isel(solution=slice(0, 3))
    exact = np.outer([0.0, 0.2, 0.6], np.ones(softening.sizes["node"]))
    assert three["solution_u_T"].values == pytest.approx(exact, abs=1e-12)
    assert three["solution_xi"].values == pytest.approx(0.8 - exact, abs=1e-12)
    assert three["solution_energy"].values / LENGTH == pytest.approx([0.32, 0.34, 0.30], abs=1e-12)
    assert three["solution_stable"].values.tolist() == [1, 0, 1]
    assert three["solution_lowest"].values.tolist() == [0, 0, 1]
    assert three["solution_global_minimum"].values.tolist() == [0, 0, 1]
    assert float(softening["solution_residual"].max()) <= 1e-12


def test_hysteresis_loop(softening: xr.Dataset) -> None:
    """Lets go at U = 1 (0.5 → 0.34), grips at U = 0.6 (0.26 → 0.18), all per unit length."""
    assert int(softening["loop_closed"]) == int(softening["loop_complete"]) == 1
    assert softening["jump_parameter"].values == pytest.approx([1.0, 0.6], abs=1e-12)
    assert softening["jump_rising"].values.tolist() == [1, 0]
    assert softening["jump_drop"].values / LENGTH == pytest.approx([0.16, 0.08], abs=1e-12)
    assert float(softening["energy_lost"]) / LENGTH == pytest.approx(0.24, abs=1e-12)
    assert float(softening["loop_area"]) == pytest.approx(float(softening["energy_lost"]), abs=1e-12)
    at = softening["jump_vertex"].values
    energy = softening["loop_energy"].values
    assert energy[at] - energy[at + 1] == pytest.approx(softening["jump_drop"].values, abs=1e-12)
    assert softening["loop_u_T"].values[at + 1][:, 0] == pytest.approx([0.8, 0.0], abs=1e-12)


def test_energy_and_its_rate_along_the_path(softening: xr.Dataset) -> None:
    """E = (U − s)²/2 + j(s) and dE/dU = U − s, the reaction on the top."""
    U, s = softening["parameter"].values, softening["u_T"].values[:, 0]
    size = np.abs(s)
    j = np.where(size <= 0.4, size - size**2, 0.24 + 0.2 * (size - 0.4))
    assert softening["energy"].values == pytest.approx(LENGTH * ((U - s) ** 2 / 2 + j), abs=1e-12)
    assert softening["energy_rate"].values == pytest.approx(LENGTH * (U - s), abs=1e-12)


def test_the_lowest_solution_changes_at_the_maxwell_point(softening: xr.Dataset) -> None:
    """U²/2 = 0.02 + 0.24 + 0.2 (U − 0.6) at U = 0.2 + √0.32."""
    change = softening["lowest_begin"].values
    assert np.min(np.abs(change - (0.2 + np.sqrt(0.32)))) <= 1e-12
    assert np.array_equal(softening["lowest_end"].values[:-1], change[1:])
    assert softening["lowest_certified"].values.all()
    assert not softening["stable"].values[softening["lowest_piece"].values].tolist().count(0)


def test_contact_states_and_fronts(softening: xr.Dataset) -> None:
    meanings = softening["state"].attrs["flag_meanings"].split()
    states = [sorted({meanings[s] for s in row}) for row in softening["state"].values[int(softening["start"]) :]]
    assert states == [["stick"], ["soften"], ["weakened"]]
    for vertex, *ends in zip(*(softening[f"event_{x}"].values for x in ("vertex", "before", "after")), strict=True):
        pair = {meanings[int(end)] for end in ends}
        assert pair in ({"stick", "soften"}, {"soften", "weakened"})
        at = 1.0 if "stick" in pair else 0.6
        assert abs(float(softening["parameter"][int(vertex)])) == pytest.approx(at, abs=1e-12)
    lengths = softening["slip_length"].values[int(softening["start"]) :]
    assert lengths == pytest.approx([0.0, LENGTH, LENGTH], abs=1e-12)


def test_a_smooth_law_ends_on_its_own_graph(tmp_path: Path) -> None:
    """b = 0.2 + 0.8 exp(−5 s): U − s = b(s) has two roots beside sticking at U = 0.8, met to rounding."""
    law = "{law: exponential, a: 1, b: 0.2, delta: 0.2}"
    data = path_of(patch_text(0.6, law), tmp_path)
    slips = data["solution_u_T"].values[:3]
    assert np.ptp(slips, axis=1) == pytest.approx(np.zeros(3), abs=1e-11)
    s = slips[1:, 0]
    assert 0.8 - s == pytest.approx(0.2 + 0.8 * np.exp(-5.0 * s), abs=1e-11)
    assert data["solution_residual"].values.max() <= 1e-11
    assert data["solution_stable"].values.tolist()[:3] == [1, 0, 1]
    assert float(data["law_error"]) == 1e-3
    s_fold = 0.2 * np.log(4.0)
    folds = data["parameter"].values[data["fold_vertex"].values]
    exact = [1.0, s_fold + 0.2 + 0.8 * np.exp(-5.0 * s_fold)]  # the second where 4 exp(−5 s) = 1
    assert folds[-2:] == pytest.approx(exact, abs=2e-3)
