"""`solver: {branch: all}`: every solution of every point in the file, its proofs, limits, growth,
table and map."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.contact.all_solutions import all_solutions
from tcstudy.reports.terminal.summary import verdict_of
from tests.verification.scenes import BRITTLE, QUICKSTART, quickstart_problems

SWEEP = "sweep={boundary.end.g: [[2 MPa, 0], [20 MPa, 0]], theta_bar: [10 K, 0 K, 12 K]}"


def study(
    *more: str, sweep: str = SWEEP, law: str = f"{{law: piecewise-linear, points: {BRITTLE}}}"
) -> tcstudy.Study:
    law = f"friction={law}"
    return tcstudy.load(QUICKSTART, ["mesh.levels=1", "solver={branch: all}", law, sweep, *more])


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("every") / "all.nc"
    tcstudy.run(study(), path).close()
    return path


def test_the_file_has_every_solution_and_its_proofs(file: Path) -> None:
    with xr.open_datatree(file) as tree:
        root, line = tree.to_dataset().isel(level=0), tree["level_0"]
        problems = quickstart_problems(SWEEP.removeprefix("sweep="))
        shape = root["status"].shape
        assert root["complete"].values.all()
        for place, problem in enumerate(problems):
            g, theta = np.unravel_index(place, shape)
            at = root.isel(g=g, theta_bar=theta)
            own = line["solution_point"].values == np.ravel_multi_index((g, theta), shape)
            found = all_solutions(problem)
            assert int(at["solutions"]) == len(found) == own.sum()
            assert (
                int(at["stable_solutions"])
                == found.stable.sum()
                == line["solution_stable"].values[own].sum()
            )
            np.testing.assert_allclose(
                line["solution_u_T"].values[own], found.v, rtol=1e-9, atol=1e-15
            )
            np.testing.assert_array_equal(line["solution_piece"].values[own], found.sides)
            assert float(at["energy"]) == pytest.approx(
                line["solution_energy"].values[own].min(), rel=1e-9
            )
            assert int(at["global_minimum"]) == 1
            assert int(at["unique"]) == (len(found) == 1)
        assert np.all(root["solutions"].values % 2 == 1)
        assert root["solutions"].values.max() == 11


def test_limits_and_polygons_are_told_and_claim_nothing(tmp_path: Path) -> None:
    few = tcstudy.run(study("solver.max_boxes=1"), tmp_path / "few.nc")
    complete, count = few["complete"].values.ravel(), few["solutions"].values.ravel()
    assert set(complete) == {0, 1}
    assert np.all(count[complete == 1] == 1)
    assert "all equilibria proved at 1 of 6 (1 each)" in verdict_of(tmp_path / "few.nc").trust
    law = "{law: exponential, a: 40 MPa, b: 10 MPa, delta: 5 um}"
    found = tcstudy.run(
        study(sweep="sweep={boundary.end.g: [[20 MPa, 0]]}", law=law), tmp_path / "decay.nc"
    )
    assert found["complete"].values.ravel().tolist() == [2]
    assert (
        verdict_of(tmp_path / "decay.nc")
        .trust[1]
        .endswith("of the piecewise-linear approximations of exponential laws")
    )


def test_a_file_that_grows_keeps_them(file: Path, tmp_path: Path) -> None:
    path = tmp_path / "grown.nc"
    tcstudy.run(
        study(sweep="sweep={boundary.end.g: [[2 MPa, 0]], theta_bar: [10 K, 0 K, 12 K]}"), path
    )
    more = "sweep={boundary.end.g: [[20 MPa, 0]], theta_bar: [10 K, 0 K, 12 K]}"
    grown = tcstudy.run(study(sweep=more), path, append=True)
    with xr.open_datatree(file) as whole:
        for name in (
            "solution_point",
            "solution_piece",
            "solution_energy",
            "solution_u_T",
            "solution_stable",
        ):
            np.testing.assert_allclose(
                grown["level_0"][name], whole["level_0"][name], rtol=1e-9, atol=1e-15
            )
