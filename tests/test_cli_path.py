"""`tcstudy run` of a study with a path, as a user types it."""

from __future__ import annotations

from pathlib import Path

import pytest
import xarray as xr

from tests.commands import tcstudy_command
from tests.test_cli import STUDY

PATH = STUDY + "path: {parameter: load, from: 0, to: 2, at: [0.5, 1.5]}\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "block.yaml").write_text(PATH)
    return tmp_path


def test_path_writes_a_file_a_table_and_a_picture(folder: Path) -> None:
    result = tcstudy_command("run", "block.yaml", "--plot", "a.png", cwd=folder)
    assert result.returncode == 0, result.stderr
    assert result.stderr == "warning: a path is of one scene, that outside the sweep; the values of tau are not used\n"
    assert "data in results/block-path.nc" in result.stdout
    assert "Path along load from 0 to 2" in result.stdout
    assert (folder / "a.png").read_bytes()[:4] == b"\x89PNG"
    with xr.open_dataset(folder / "results" / "block-path.nc") as data:
        assert data.sizes["solution"] == 2
        assert "tcstudy run block.yaml" in data.attrs["history"]
    shown = tcstudy_command("show", "results/block-path.nc", cwd=folder)
    assert shown.returncode == 0
    assert shown.stdout.partition("  warning")[0].strip() in result.stdout
    assert tcstudy_command("draw", "results/block-path.nc", "b.svg", cwd=folder).returncode == 0
    assert (folder / "b.svg").exists()


def test_an_early_end_is_exit_code_1(folder: Path) -> None:
    result = tcstudy_command("run", "block.yaml", "--set", "path.max_pieces=1", cwd=folder)
    assert result.returncode == 1, result.stderr
    assert "raise max_pieces" in result.stdout
    assert "the path has no solution at load = 1.5" in result.stdout


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("--append",), "--append adds points of a sweep, and block.yaml has a section path; leave it out, or run"),
        (("--dask", "local"), "--dask: a path has no work for others; leave it out"),
        (("--plot", "a.gif"), "a.gif: a picture's name ends in .png, .svg, .pdf"),
        (("--output", "block.yaml/a.nc"), "block.yaml is a file"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(folder: Path, words: tuple[str, ...], line: str) -> None:
    result = tcstudy_command("run", "block.yaml", *words, cwd=folder)
    assert result.returncode == 2
    assert line in result.stderr
    assert result.stderr.count("\n") == 1
    assert "Traceback" not in result.stderr
    assert sorted(p.name for p in folder.iterdir()) == ["block.yaml"]


@pytest.mark.parametrize("mesh", ["{maxh: 0.3, levels: 2, family: adaptive}", "{maxh: 0.3, tolerance: 0.2}"])
def test_a_study_with_a_path_runs_on_adaptive_meshes(folder: Path, mesh: str) -> None:
    """A run needs no path; the path, which is of one mesh, says which meshes to give it."""
    asked = ("block.yaml", "--set", f"mesh={mesh}")
    assert tcstudy_command("run", *asked, "--set", "path=null", cwd=folder).returncode == 0
    result = tcstudy_command("run", *asked, cwd=folder)
    assert result.returncode == 2
    assert "block.yaml: path: the path is of one mesh, and adaptive meshes follow from the solutions of a run" in (
        result.stderr
    )
    remedy = ("--set", "mesh={maxh: 0.3, levels: 2}")
    assert remedy[1].split("=")[0] in result.stderr
    assert tcstudy_command("run", *asked[:1], *remedy, cwd=folder).returncode == 0
