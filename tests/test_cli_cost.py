"""`tcstudy cost` as a user types it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
import xarray

from tcstudy.cli import main
from tests.commands import tcstudy_command
from tests.test_cli import STUDY


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "block.yaml").write_text(STUDY.replace("maxh: 0.3", "maxh: 0.6"))
    return tmp_path


def test_one_command_makes_the_chart_and_others_show_it_again(folder: Path) -> None:
    result = tcstudy_command("cost", "block.yaml", "--plot", "a.png", cwd=folder)
    assert result.returncode == 0, result.stderr
    assert "Accuracy against cost" in result.stdout
    assert "The study's own settings (uniform, level 1, separable-newton)" in result.stdout
    assert "run 2 of 5, about" in result.stderr
    assert "\r" not in result.stderr
    assert (folder / "a.png").read_bytes()[:4] == b"\x89PNG"
    file = folder / "results" / "block.cost.nc"
    with xarray.open_dataset(file) as data:
        assert data.attrs["point"] == "tau = 0.005"
        assert data.sizes["run"] == 5
    shown = tcstudy_command("show", file, cwd=folder)
    assert shown.stdout.rstrip() == result.stdout.rstrip()
    drawn = tcstudy_command("draw", file, "b.svg", "--y", "u_L2", cwd=folder)
    assert drawn.returncode == 0, drawn.stderr
    assert drawn.stdout == "b.svg: u in L², tau = 0.005\n"
    idle = tcstudy_command("draw", file, "c.svg", "--level", "1", cwd=folder)
    assert idle.returncode == 2
    assert idle.stderr == "--level: the picture of a cost file does not depend on it; leave it out\n"
    assert not (folder / "c.svg").exists()


def test_another_point(folder: Path) -> None:
    words = ("--at", "tau=0.01", "--output", "c.nc")
    result = tcstudy_command("cost", "block.yaml", *words, cwd=folder)
    assert result.returncode == 0, result.stderr
    assert "Scene: tau = 0.01. Errors of u in energy" in result.stdout


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--plot", "a.txt"), ".png"),
        (("--at", "friction.tau=0.7"), "block.yaml: no point of the study has tau = 0.7"),
        (("--at", "friction.tau=0.01", "--at", "tau=0.01"), "friction.tau and tau are one parameter; give it once"),
        (("--at", "tau=0.01", "--at", "tau=0.005"), "--at: tau is given twice"),
        (("--output", "block.yaml/a.nc"), "block.yaml"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(folder: Path, words: tuple[str, ...], message: str) -> None:
    result = tcstudy_command("cost", "block.yaml", *words, cwd=folder)
    assert result.returncode == 2
    assert message in result.stderr
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""
    assert sorted(p.name for p in folder.iterdir()) == ["block.yaml"]


def test_a_picture_without_matplotlib_is_refused_before_any_work(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.chdir(folder)
    for command in ("cost", "converge"):
        with pytest.raises(SystemExit, match="2"):
            main([command, "block.yaml", "--plot", "a.png"])
        assert 'pip install "tcstudy[plot]"' in capsys.readouterr().err
    assert sorted(p.name for p in folder.iterdir()) == ["block.yaml"]
