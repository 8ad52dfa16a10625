"""`tcstudy run` of a study with a history, as a user types it."""

from __future__ import annotations

from pathlib import Path

import netCDF4
import pytest

from tcstudy.read.study import read_study
from tcstudy.study.history_run import execute_history
from tcstudy.study.plan import plan
from tests.commands import tcstudy_command

HISTORY = """\
title: Strip to and fro
body: {rectangle: {width: 0.4 m, height: 0.1 m}}
boundary: {bottom: contact, left: clamped, top: free, right: free}
material: {E: 210 GPa, nu: 0.3, alpha_T: 1.2e-5 1/K}
heat: {theta: 0 K}
friction: {law: tresca, tau: 20 MPa}
mesh: {maxh: 50 mm}
history:
  memory: friction
  steps:
    - {theta: 60 K, in: 2, name: hot}
    - {theta: -20 K, in: 2, name: cold}
  repeat: 2
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "strip.yaml").write_text(HISTORY)
    return tmp_path


def test_history_writes_a_file_and_a_table_and_goes_on(folder: Path) -> None:
    result = tcstudy_command("run", "strip.yaml", cwd=folder)
    assert (result.returncode, result.stderr) == (0, "")
    assert "History of theta: 8 steps in 2 cycles; memory friction" in result.stdout
    assert "a closed loop: the last cycle leaves no slip behind; it dissipates " in result.stdout
    shown = tcstudy_command("show", "results/strip-history.nc", cwd=folder)
    assert shown.stdout.strip() in result.stdout
    again = tcstudy_command("run", "strip.yaml", "-q", cwd=folder)
    assert again.stdout.startswith("results/strip-history.nc: Largest slip")
    assert again.stdout.endswith("solved.\n")
    more = tcstudy_command("run", "strip.yaml", "--set", "history.repeat=3", cwd=folder)
    assert more.returncode == 0
    assert "held 9 steps; the others were added" in more.stderr
    wrong = tcstudy_command("converge", "strip.yaml", cwd=folder)
    assert (wrong.returncode, wrong.stderr.count("\n")) == (2, 1)
    assert "converge has no memory; use tcstudy run, or --set history=null" in wrong.stderr


def test_plan_tells_of_the_file_of_a_history(folder: Path) -> None:
    """Its name, how large it gets without compression; nothing that a history refuses is offered."""
    said = tcstudy_command("run", "strip.yaml", "--dry-run", cwd=folder).stdout
    assert "strip-history.nc" in said
    assert "output.fields" not in said
    study = read_study(folder / "strip.yaml", ["history.repeat=30"])
    execute_history(study, folder / "long.nc")
    with netCDF4.Dataset(folder / "long.nc") as nc:
        values = sum(v.size * v.dtype.itemsize for v in nc.variables.values() if v.dtype is not str)
    assert values < plan(study).bytes < values + 150_000
