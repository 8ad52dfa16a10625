"""Paths in closed form: the multivalued patch test along its top displacement U, and pull tests of
bonded strips.

Law b = 1 − 2s up to s = 0.4, then 0.2, with G = H = 1: sticking up to U = 1, softening from (U, s)
= (1, 0) back to (0.6, 0.4), slipping from there on with s = U − 0.2.
"""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from tcstudy.data.reading import load_root
from tcstudy.read.study import read_study_text
from tcstudy.study.path_run import execute_path
from tests.commands import CONFIGS
from tests.verification.patch import LENGTH, SOFTENING, Case, patch_study

REQUESTED = "path: {parameter: boundary.top.u_x, from: 0, to: 1.5, at: [0.8, 0.5]}"


def path_of(text: str, folder: Path, *overrides: str) -> xr.Dataset:
    execute_path(read_study_text(text, "test", overrides), folder / "path.nc")
    data = load_root(folder / "path.nc", "path")
    assert data.attrs["shortfalls"] == ""
    return data


def patch_text(maxh: float, law: str = SOFTENING) -> str:
    return f"{patch_study(Case(law, 0.3, ()), maxh).text}\n{REQUESTED}\n"


@pytest.fixture(scope="module")
def softening(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    return path_of(patch_text(0.3), tmp_path_factory.mktemp("patch"))


def test_folds_and_fronts(softening: xr.Dataset) -> None:
    at = softening["fold_vertex"].values
    assert softening["parameter"].values[at] == pytest.approx([-0.6, -1.0, 1.0, 0.6], abs=1e-12)
    slips = softening["u_T"].values[at]
    assert slips == pytest.approx(
        np.outer([-0.4, 0.0, 0.0, 0.4], np.ones(slips.shape[1])), abs=1e-12
    )
    assert softening["stable"].values[at - 1].tolist() == [1, 0, 1, 0]
    assert softening["stable"].values[at].tolist() == [0, 1, 0, 1]
    meanings = softening["state"].attrs["flag_meanings"].split()
    start = int(softening["start"])
    states = [sorted({meanings[s] for s in row}) for row in softening["state"].values[start:]]
    assert states == [["stick"], ["soften"], ["weakened"]]
    state = softening["state"].values
    for piece, node in np.argwhere(state[1:] != state[:-1]):
        pair = {meanings[k] for k in state[piece : piece + 2, node]}
        assert pair in ({"stick", "soften"}, {"soften", "weakened"})
        t = 1.0 if "stick" in pair else 0.6
        assert abs(float(softening["parameter"][piece + 1])) == pytest.approx(t, abs=1e-12)
    assert softening["slip_length"].values[start:] == pytest.approx(
        [0.0, LENGTH, LENGTH], abs=1e-12
    )


def test_all_three_solutions(softening: xr.Dataset) -> None:
    assert (softening["at"].values.tolist(), softening["solution_count"].values.tolist()) == (
        [0.8, 0.5],
        [3, 1],
    )
    three = softening.isel(solution=slice(0, 3))
    exact = np.outer([0.0, 0.2, 0.6], np.ones(softening.sizes["node"]))
    assert three["solution_u_T"].values == pytest.approx(exact, abs=1e-12)
    assert three["solution_xi"].values == pytest.approx(0.8 - exact, abs=1e-12)
    assert three["solution_energy"].values / LENGTH == pytest.approx([0.32, 0.34, 0.30], abs=1e-12)
    for name, flags in (
        ("stable", [1, 0, 1]),
        ("lowest", [0, 0, 1]),
        ("global_minimum", [0, 0, 1]),
    ):
        assert three[f"solution_{name}"].values.tolist() == flags
    assert float(softening["solution_residual"].max()) <= 1e-12


def test_hysteresis_loop(softening: xr.Dataset) -> None:
    """Lets go at U = 1 (0.5 → 0.34), grips at U = 0.6 (0.26 → 0.18), all per unit length."""
    assert int(softening["loop_closed"]) == int(softening["loop_complete"]) == 1
    assert softening["jump_parameter"].values == pytest.approx([1.0, 0.6], abs=1e-12)
    assert softening["jump_rising"].values.tolist() == [1, 0]
    assert softening["jump_drop"].values / LENGTH == pytest.approx([0.16, 0.08], abs=1e-12)
    assert float(softening["energy_lost"]) / LENGTH == pytest.approx(0.24, abs=1e-12)
    assert float(softening["loop_area"]) == pytest.approx(
        float(softening["energy_lost"]), abs=1e-12
    )
    at = softening["jump_vertex"].values
    energy = softening["loop_energy"].values
    assert energy[at] - energy[at + 1] == pytest.approx(softening["jump_drop"].values, abs=1e-12)
    assert softening["loop_u_T"].values[at + 1][:, 0] == pytest.approx([0.8, 0.0], abs=1e-12)


def test_energy_its_rate_and_the_maxwell_point(softening: xr.Dataset) -> None:
    """E = (U − s)²/2 + j(s), dE/dU = U − s, and U²/2 = 0.02 + 0.24 + 0.2 (U − 0.6) at U = 0.2 +
    √0.32."""
    U, s = softening["parameter"].values, softening["u_T"].values[:, 0]
    size = np.abs(s)
    j = np.where(size <= 0.4, size - size**2, 0.24 + 0.2 * (size - 0.4))
    assert softening["energy"].values == pytest.approx(LENGTH * ((U - s) ** 2 / 2 + j), abs=1e-12)
    assert softening["energy_rate"].values == pytest.approx(LENGTH * (U - s), abs=1e-12)
    change = softening["lowest_begin"].values
    assert np.min(np.abs(change - (0.2 + np.sqrt(0.32)))) <= 1e-12
    assert np.array_equal(softening["lowest_end"].values[:-1], change[1:])
    assert softening["lowest_certified"].values.all()
    assert softening["stable"].values[softening["lowest_piece"].values].all()


PULL = (CONFIGS / "pull_test.yaml").read_text()
MM = 1e-3


def test_a_strip_on_a_linearly_softening_film(tmp_path: Path) -> None:
    """Both folds, the greatest force, three equilibria at 0.3, 0.5 and 0.7 mm; the closed form is
    that of a bar.

    At u_x = 0.16 mm the whole softening zone lets go at once, and all of the strip is free of
    stress.
    """
    data = path_of(PULL, tmp_path)
    c, t, folds = data["c"].values, data["parameter"].values / MM, data["fold_vertex"].values
    upper, lower = sorted(folds[t[folds] > 0.0], key=lambda k: -t[k])
    assert t[[upper, lower]] == pytest.approx([0.9009152, 0.16], rel=4e-4)
    assert t[lower] == pytest.approx(0.16, rel=1e-9)
    assert data["xi"].values[[upper, lower]] @ c * MM == pytest.approx(
        [220.5912, 0.0], rel=6e-4, abs=1e-6
    )
    assert data["solution_count"].values.tolist() == [3, 3, 3]
    at = data["solution_at"].values == 1
    assert data["solution_energy"].values[at] == pytest.approx(
        [102.7213, 126.6487, 109.4400], rel=4e-4
    )
    d, s_c = 42.24e3, 48.12554
    forces = [220.5912, d * (0.5 - 0.16) / (190 - s_c), 0.0]
    assert data["solution_xi"].values[at] @ c * MM == pytest.approx(forces, rel=2e-3, abs=1e-5)
    assert data["solution_stable"].values[at].tolist() == [1, 0, 1]
    assert (int(data["loop_complete"]), int(data["loop_closed"])) == (1, 1)
    assert (float(data["energy_lost"]), len(folds)) == (
        pytest.approx(float(data["loop_area"]), rel=1e-6),
        4,
    )
    state = data["state"].values
    assert np.count_nonzero(state[lower] != state[lower - 1]) >= 0.95 * s_c / 190 * len(c)


COARSE = PULL.replace("maxh: 1 mm", "maxh: 4 mm")


def test_a_million_times_as_large(tmp_path: Path) -> None:
    """The same pieces and solutions, but for Netgen's own tolerance, a length: 1e-7 of the strip,
    less of km."""
    ratio, accuracy = 1e6, 1e-6
    data, scaled = path_of(COARSE, tmp_path), path_of(COARSE.replace(" mm", " km"), tmp_path)
    assert scaled.sizes["piece"] == data.sizes["piece"]
    for name, power in (
        ("parameter", 1),
        ("u_T", 1),
        ("xi", 0),
        ("energy", 2),
        ("solution_energy", 2),
    ):
        values = ratio**power * data[name].values
        bound = (accuracy if name != "xi" else 10.0 * accuracy) * np.max(np.abs(values))
        assert np.max(np.abs(scaled[name].values - values)) <= bound, name
    for name in (
        "stable",
        "state",
        "fold_vertex",
        "lowest_piece",
        "lowest_certified",
        "solution_stable",
    ):
        assert np.array_equal(scaled[name].values, data[name].values), name
