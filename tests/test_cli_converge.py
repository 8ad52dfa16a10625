"""`tcstudy converge` as a user types it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import xarray

from tests.commands import tcstudy_command
from tests.test_cli import STUDY


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "block.yaml").write_text(STUDY.replace("levels: 2", "levels: 4"))
    return tmp_path


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--set", "mesh.levels=1"), "one level has no convergence"),
        (("--plot", "a.txt"), ".png"),
        (("--at", "tau=0.7"), "no point of the study has tau = 0.7"),
        (("--quiet", "--json"), "--quiet and --json exclude each other"),
        (("--plot", "a.png", "--at", "tau=0.7"), "no point of the study has tau = 0.7"),
        (("--output", "block.yaml/a.nc"), "block.yaml"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(folder: Path, words: tuple[str, ...], message: str) -> None:
    result = tcstudy_command("converge", "block.yaml", *words, cwd=folder)
    assert result.returncode == 2
    assert message in result.stderr
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""
    assert sorted(p.name for p in folder.iterdir()) == ["block.yaml"]


def test_failed_points_are_exit_code_1(folder: Path) -> None:
    """No double is a solution to 1e-30."""
    words = ("--set", "solver.tolerance=1e-30", "--set", "sweep=null")
    result = tcstudy_command("converge", "block.yaml", *words, cwd=folder)
    assert result.returncode == 1
    assert "inclusion_violated" in result.stderr


def test_an_exact_solution_of_another_problem_is_called_that(tmp_path: Path) -> None:
    """The block is clamped at the left, the given displacement is not."""
    exact = "exact={u: ['1 + 0.7*y + 0.1*y*sin(pi*x)*(1 - y)', '0']}"
    text = STUDY.replace("levels: 2", "levels: 3").split("sweep")[0] + "sweep: {E: [1, 2]}\n"
    (tmp_path / "block.yaml").write_text(text)
    alone = tcstudy_command("converge", "block.yaml", "--set", exact, cwd=tmp_path)
    assert alone.returncode == 0, alone.stderr
    assert "The error of u does not fall at 2 of 2 points" in " ".join(alone.stdout.split())


def test_meshes_are_told_with_the_unit_of_their_table(tmp_path: Path) -> None:
    """So that 0.05 m is not sought in vain among millimetres."""
    text = STUDY.replace("units: none", "units: SI").replace("width: 2, height: 1", "width: 0.2, height: 0.1")
    (tmp_path / "block.yaml").write_text(text.replace("maxh: 0.3", "maxh: 50 mm").split("sweep")[0])
    result = tcstudy_command("converge", "block.yaml", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "h_max [mm]" in result.stdout
    told = [line.split(",")[0] for line in result.stderr.splitlines() if line.startswith("level")]
    assert [line.split()[-1] for line in told] == ["mm", "mm"]


def test_a_film_without_friction_has_no_error_of_xi(tmp_path: Path) -> None:
    """ξ is rounding there; a spring has errors of ξ although no kink gives its law a scale."""
    text = STUDY.replace("levels: 2", "levels: 4").split("sweep")[0]
    (tmp_path / "block.yaml").write_text(text)
    none = tcstudy_command("converge", "block.yaml", "--set", "friction.tau=0", cwd=tmp_path).stdout
    spring = tcstudy_command(
        "converge", "block.yaml", "--set", "friction={law: linear, k: 0.1}", "--force", cwd=tmp_path
    ).stdout
    assert "u_T in L²" in none
    assert "ξ in L²(Γ_C) " not in none
    assert "ξ in L²(Γ_C) " in spring


@pytest.mark.parametrize("levels", ["mesh.levels=3", "mesh={maxh: [0.5, 0.4, 0.3, 0.25]}"])
def test_a_plot_without_errors_is_refused_before_the_work(folder: Path, levels: str) -> None:
    result = tcstudy_command("converge", "block.yaml", "--set", levels, "--plot", "a.png", cwd=folder)
    assert result.returncode == 2
    assert "--plot: there would be no errors to draw: two levels must be 4 times coarser" in result.stderr
    assert result.stderr.count("\n") == 1
    assert sorted(p.name for p in folder.iterdir()) == ["block.yaml"]


def test_a_sweep_gets_one_row_of_orders_a_point(folder: Path) -> None:
    """Full tables of a sweep were two thousand lines long."""
    said = {}
    for words in ((), ("--at", "tau=0.01"), ("-v",), ("--json",), ("--quiet",)):
        result = tcstudy_command("converge", "block.yaml", *words, cwd=folder)
        assert result.returncode == 0, result.stderr
        said[words] = result.stdout
    rows = [line for line in said[()].splitlines() if line.split()[:1] in (["0.005"], ["0.01"], ["expected"])]
    assert len(rows) == 3
    assert "Relative errors" not in said[()]
    assert "\ntau = 0.01\n" in said["--at", "tau=0.01"]
    assert "\ntau = 0.005\n" not in said["--at", "tau=0.01"]
    assert said["-v",].count("Relative errors") == 2
    assert said["--quiet",].count("\n") == 1
    points = json.loads(said["--json",])["points"]
    with xarray.open_dataset(folder / "results" / "block.convergence.nc") as data:
        slopes = [point["slope_u_H1"] for point in points]
        assert slopes == data["slope_u_H1"].values.tolist()
    assert all(f"{slope:.2f}" in row for slope, row in zip(slopes, rows[1:], strict=True))
