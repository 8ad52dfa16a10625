"""`tcstudy` on studies of every kind, as a user types it: converge, cost, and run of a path and of
a history; init."""

import json
from pathlib import Path

import netCDF4
import pytest
import xarray

from tcstudy.read.study import read_study
from tcstudy.study import stored
from tcstudy.study.history_run import execute_history
from tcstudy.study.plan import plan
from tests.commands import tcstudy_command
from tests.test_cli import STUDY

PATH = "path: {parameter: load, from: 0, to: 2, at: [0.5, 1.5]}\n"
HISTORY = """\
body: {rectangle: {width: 0.4 m, height: 0.1 m}}
boundary: {bottom: contact, left: clamped, top: free, right: free}
material: {E: 210 GPa, nu: 0.3, alpha_T: 1.2e-5 1/K}
heat: {theta: 0 K}
friction: {law: tresca, tau: 20 MPa}
mesh: {maxh: 50 mm}
history: {memory: friction, steps: [{theta: 60 K, in: 2, name: hot}, {theta: -20 K, in: 2, name: cold}], repeat: 2}
"""


def made(folder: Path, text: str) -> Path:
    (folder / "block.yaml").write_text(text)
    return folder


ALONE = STUDY.split("sweep")[0]


def test_failed_points_are_exit_code_1(tmp_path: Path) -> None:
    """No double is a solution to 1e-30."""
    words = ("--set", "solver.tolerance=1e-30")
    text = ALONE.replace("maxh: 0.3, levels: 2", "maxh: 0.6, levels: 4")
    result = tcstudy_command("converge", "block.yaml", *words, cwd=made(tmp_path, text), code=1)
    assert "inclusion_violated" in result.stderr


def test_an_exact_solution_of_another_problem_is_called_that(tmp_path: Path) -> None:
    """The block is clamped at the left, the given displacement is not."""
    exact = "exact={u: ['1 + 0.7*y + 0.1*y*sin(pi*x)*(1 - y)', '0']}"
    text = ALONE.replace("levels: 2", "levels: 3") + "sweep: {E: [1, 2]}\n"
    alone = tcstudy_command(
        "converge", "block.yaml", "--set", exact, cwd=made(tmp_path, text), code=0
    )
    said = " ".join(alone.stdout.split())
    assert "The error of u does not decrease at 2 of 2 points" in said
    assert "misses the friction law by" in said


def test_meshes_are_told_with_the_unit_of_their_table(tmp_path: Path) -> None:
    """So that 0.05 m is not sought in vain among millimetres."""
    text = ALONE.replace("units: none", "units: SI").replace(
        "width: 2, height: 1", "width: 0.2, height: 0.1"
    )
    made(tmp_path, text.replace("maxh: 0.3", "maxh: 50 mm"))
    assert "h_max [mm]" in tcstudy_command("converge", "block.yaml", cwd=tmp_path, code=0).stdout


def test_a_film_without_friction_has_no_error_of_xi(tmp_path: Path) -> None:
    """ξ is rounding there; a spring has errors of ξ although no kink gives its law a scale."""
    made(tmp_path, ALONE.replace("maxh: 0.3, levels: 2", "maxh: 0.6, levels: 4"))
    for law, has in (("{law: tresca, tau: 0}", False), ("{law: linear, k: 0.1}", True)):
        said = tcstudy_command(
            "converge", "block.yaml", "--set", f"friction={law}", "--force", cwd=tmp_path
        ).stdout
        assert "u_T in L²" in said
        assert ("ξ in L²(Γ_C) " in said) == has


def test_a_sweep_gets_one_row_of_orders_a_point(tmp_path: Path) -> None:
    """Full tables of a sweep were two thousand lines long."""
    said = {}
    made(tmp_path, STUDY.replace("maxh: 0.3, levels: 2", "maxh: 0.6, levels: 4"))
    for words in ((), ("--at", "tau=0.01"), ("-v",), ("--json",), ("--quiet",)):
        said[words] = tcstudy_command("converge", "block.yaml", *words, cwd=tmp_path, code=0).stdout
    rows = [
        line
        for line in said[()].splitlines()
        if line.split()[:1] in (["0.005"], ["0.01"], ["expected"])
    ]
    assert len(rows) == 3
    assert "Relative errors" not in said[()]
    assert "\ntau = 0.01\n" in said["--at", "tau=0.01"]
    assert "\ntau = 0.005\n" not in said["--at", "tau=0.01"]
    assert said["-v",].count("Relative errors") == 2
    assert said["--quiet",].count("\n") == 1
    slopes = json.loads(said["--json",])["values"]["slope_u_H1"]
    with xarray.open_dataset(tmp_path / "results" / "block.convergence.nc") as data:
        assert slopes == data["slope_u_H1"].values.tolist()
    assert all(f"{slope:.2f}" in row for slope, row in zip(slopes, rows[1:], strict=True))


def test_one_command_makes_the_chart_of_a_point_and_others_show_it_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stored, "RUNS", 2)
    made(tmp_path, STUDY.replace("maxh: 0.3", "maxh: 0.8"))
    result = tcstudy_command(
        "cost", "block.yaml", "--plot", "a.png", "--at", "tau=0.01", cwd=tmp_path, code=0
    )
    assert "  Trust     one scene: tau = 0.01; 2 runs each" in result.stdout
    answer = " ".join(result.stdout.split("  Trust")[0].split())
    assert "the study's mesh: error 40 % in" in answer
    assert "(uniform, level 1, separable-newton)" in answer
    assert "run 2 of 2, about" in result.stderr
    assert "\r" not in result.stderr
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    file = tmp_path / "results" / "block.cost.nc"
    with xarray.open_dataset(file) as data:
        assert (data.attrs["point"], data.sizes["run"]) == ("tau = 0.01", 2)
    assert tcstudy_command("show", file, cwd=tmp_path).stdout.rstrip() in result.stdout
    drawn = tcstudy_command("draw", file, "b.svg", "--y", "u_L2", cwd=tmp_path, code=0)
    assert drawn.stdout == "b.svg: u in L², tau = 0.01\n"
    idle = tcstudy_command("draw", file, "c.svg", "--level", "1", cwd=tmp_path, code=2)
    assert (
        idle.stderr == "--level: the picture of a cost file does not depend on it; leave it out\n"
    )
    assert not (tmp_path / "c.svg").exists()


def test_path_writes_a_file_a_table_and_a_picture(tmp_path: Path) -> None:
    result = tcstudy_command(
        "run", "block.yaml", "--plot", "a.png", cwd=made(tmp_path, STUDY + PATH), code=0
    )
    assert (
        result.stderr
        == "warning: a path is of one scene, that outside the sweep; the values of tau are not used\n"
    )
    assert "data in results/block-path.nc" in result.stdout
    assert "Path along load from 0 to 2" in result.stdout
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    with xarray.open_dataset(tmp_path / "results" / "block-path.nc") as data:
        assert data.sizes["solution"] == 2
        assert "tcstudy run block.yaml" in data.attrs["history"]
    shown = tcstudy_command("show", "results/block-path.nc", cwd=tmp_path)
    assert shown.stdout.partition("  warning")[0].strip() in result.stdout
    early = tcstudy_command(
        "run", "block.yaml", "--force", "--set", "path.max_pieces=1", cwd=tmp_path, code=1
    )
    assert "raise max_pieces" in early.stdout
    assert "the path has no solution at load = 1.5" in early.stdout


def test_history_writes_a_file_and_a_table_and_goes_on(tmp_path: Path) -> None:
    planned = tcstudy_command("run", "block.yaml", "--dry-run", cwd=made(tmp_path, HISTORY)).stdout
    assert "block-history.nc" in planned
    assert "output.fields" not in planned  # nothing that a history refuses is offered
    result = tcstudy_command("run", "block.yaml", cwd=tmp_path, code=0)
    assert result.stderr == ""
    assert "History of theta; memory friction" in result.stdout
    words = " ".join(result.stdout.split())
    cycle = "plastic shakedown: the last cycle leaves no net slip; it dissipates "
    assert words.count(cycle) == 1
    shown = tcstudy_command("show", "results/block-history.nc", cwd=tmp_path)
    assert shown.stdout.strip() in result.stdout
    again = tcstudy_command("run", "block.yaml", "-q", cwd=tmp_path).stdout
    assert again.startswith("results/block-history.nc: Largest slip")
    more = tcstudy_command("run", "block.yaml", "--set", "history.repeat=3", cwd=tmp_path, code=0)
    assert "held 9 steps; the others were added" in more.stderr
    wrong = tcstudy_command("converge", "block.yaml", cwd=tmp_path, code=2)
    assert "converge has no memory; use tcstudy run, or --set history=null" in wrong.stderr


def test_plan_tells_how_large_a_history_gets(tmp_path: Path) -> None:
    study = read_study(made(tmp_path, HISTORY) / "block.yaml", ["history.repeat=30"])
    execute_history(study, tmp_path / "long.nc")
    with netCDF4.Dataset(tmp_path / "long.nc") as nc:
        values = sum(v.size * v.dtype.itemsize for v in nc.variables.values() if v.dtype is not str)
    assert values < plan(study).bytes < values + 150_000


def test_the_starter_is_written_once_planned_and_solved(tmp_path: Path) -> None:
    written = tcstudy_command("init", "first.yaml", cwd=tmp_path)
    assert written.stdout.startswith("first.yaml written")
    text = (tmp_path / "first.yaml").read_text(encoding="utf-8")
    assert text.startswith("# yaml-language-server: $schema=study.schema.json\n")
    schema = tmp_path / "study.schema.json"
    assert json.loads(schema.read_text(encoding="utf-8"))["title"] == "A study of tcstudy"
    result = tcstudy_command("run", "first.yaml", "--set", "mesh.levels=2", cwd=tmp_path)
    assert "6 of 6 points, 2 levels; residual" in result.stdout
    schema.write_text("mine")
    for name, said in (
        ("first.yaml", "is there already, and is kept; name another file"),
        ("none/a.yaml", "cannot"),
    ):
        assert said in tcstudy_command("init", name, cwd=tmp_path, code=2).stderr
    tcstudy_command("init", "other.yaml", cwd=tmp_path, code=0)
    assert ((tmp_path / "first.yaml").read_text(encoding="utf-8"), schema.read_text()) == (
        text,
        "mine",
    )
