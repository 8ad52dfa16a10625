"""Finished files that grow: what they have stays to the bit, only the rest is solved; what does not fit is refused."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.cli import main
from tcstudy.data.journal import COMMIT_SECONDS
from tcstudy.data.records import PointStatus
from tcstudy.laws.laws import Laws
from tcstudy.study import level_solver
from tests.verification.scenes import RECTANGLE

TEXT = RECTANGLE.replace("maxh: 0.1, levels: 3", "maxh: 0.5, levels: 2").replace(
    "left: clamped, top: free", 'left: clamped, top: {role: traction, g: ["0.03*x", -0.01]}'
)
GRID = "sweep={E: [2, 1], tau: [0.01, 0.02]}"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """The study; its tests run beside it."""
    path = tmp_path / "study.yaml"
    path.write_text(TEXT)
    return path


def study(file: Path, sweep: str = GRID, *more: str) -> tcstudy.Study:
    return tcstudy.load(file, [sweep, *more])


def same(part: xr.DataTree, whole: xr.DataTree) -> None:
    """Every value of every point of a file stands in the other, to the bit."""
    for path in ("/", "/level_0", "/level_1"):
        one, two = part[path].to_dataset(), whole[path].to_dataset()
        if path != "/":
            one, two = (d.assign_coords(root.coords) for d, root in ((one, part), (two, whole)))
        at = {name: one[name] for name in ("E", "tau")}
        for name, values in one.data_vars.items():
            other = two[name].sel({axis: at[axis] for axis in at if axis in values.dims})
            xr.testing.assert_equal(values.drop_vars(list(values.coords)), other.drop_vars(list(other.coords)))


class Counted:
    """How many points are solved."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, fail_at: float = np.nan) -> None:
        self.points = 0
        original = level_solver.solve_block

        def solve(body: object, loads: np.ndarray, laws: Laws, *options: object) -> object:
            self.points += len(loads)
            if np.any(laws.scales[laws.index] == fail_at):
                raise ArithmeticError("made to fail")
            return original(body, loads, laws, *options)  # type: ignore[arg-type]

        monkeypatch.setattr(level_solver, "solve_block", solve)


@pytest.mark.parametrize("more", ["", "output.fields=true", "solver.branch=continued"])
def test_append_solves_only_new_points(file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, more: str) -> None:
    output, options = tmp_path / "out.nc", [more] * bool(more)
    old = tcstudy.run(study(file, GRID, *options), output).tree  # the file grows
    counted = Counted(monkeypatch)
    new = study(file, "sweep={E: [2, 1, 1.5], tau: [0.01, 0.02]}", *options)
    tree = tcstudy.run(new, output, append=True)
    assert counted.points == 2 * 2
    same(old, tree)
    assert np.all(tree["status"] == int(PointStatus.OK))
    whole = tcstudy.run(new, tmp_path / "whole.nc")
    for name in ("energy", "u_T_max", "friction_resultant", "lambda_1"):
        np.testing.assert_allclose(tree[name].values, whole[name].values, rtol=1e-10)
    assert tree.attrs["history"].count("\n") == 1
    counted.points = 0
    assert tcstudy.run(new, output)["status"].identical(tree["status"])  # it holds the study's results
    assert counted.points == 0
    assert not output.with_name("out.nc.partial").exists()


def test_append_of_other_values_leaves_the_rest_of_the_grid(file: Path, tmp_path: Path) -> None:
    output = tmp_path / "out.nc"
    old = tcstudy.run(study(file), output).tree  # the file grows
    tree = tcstudy.run(study(file, "sweep={E: [4], tau: [0.03]}"), output, append=True)
    same(old, tree)
    assert tree["status"].sel(E=4, tau=0.03).values.tolist() == [1, 1]
    assert tree["status"].sel(E=4, tau=0.01).values.tolist() == [0, 0]
    assert np.isnan(tree["level_1"]["u_T"].values[2, 0]).all()
    again = tcstudy.load(file, tree.attrs["overrides"].split("\n"))  # the file says which study it holds
    filled = tcstudy.run(again, output, append=True)
    assert np.all(filled["status"] == int(PointStatus.OK))
    same(old, filled)


def test_a_run_solves_again_what_broke_down(file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    output = tmp_path / "out.nc"
    with monkeypatch.context() as patch:
        Counted(patch, fail_at=0.02)
        old = tcstudy.run(study(file), output).tree  # the file grows
    assert old["status"].values[:, :, 0].tolist() == [[1, int(PointStatus.ERROR)]] * 2
    counted = Counted(monkeypatch)
    tree = tcstudy.run(study(file), output)
    assert counted.points == 2 * 2
    assert np.all(tree["status"] == int(PointStatus.OK))
    assert set(tree["reason"].values.ravel()) == {""}
    solved = [path.to_dataset().isel(tau=[0]) for path in (old, tree)]
    xr.testing.assert_equal(*solved)
    assert np.array_equal(old["level_1"]["u_T"].values[:, 0], tree["level_1"]["u_T"].values[:, 0])
    before = output.read_bytes()
    tcstudy.run(study(file), output)
    assert counted.points == 2 * 2
    assert output.read_bytes() == before


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--append", "--set", "material.nu=0.2"], "material.nu: 0.3 | 0.2"),
        (["--append", "--set", "mesh={maxh: 0.5, tolerance: 0.1}"], "mesh.tolerance: not given | 0.1"),
        (["--append", "--force"], "give one of these"),
        (["--append", "--output", "none.nc"], "there is no file"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(
    file: Path, capsys: pytest.CaptureFixture[str], words: Sequence[str], said: str
) -> None:
    output = file.with_name("out.nc")
    sweep = ["--set", "sweep.E=[2, 1]"]
    text = TEXT + "sweep: {E: [1], tau: [0.01, 0.02]}\n"
    file.write_text(text)
    assert main(["run", str(file), *sweep, "--output", str(output)]) == 0
    before = output.read_bytes()
    capsys.readouterr()
    words = [str(file.with_name(word)) if word.endswith(".nc") else word for word in words]
    outputs = [] if "--output" in words else ["--output", str(output)]
    with pytest.raises(SystemExit) as stop:
        main(["run", str(file), *sweep, *outputs, *words])
    assert stop.value.code == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert said in line
    assert output.read_bytes() == before
    assert {path.name for path in file.parent.iterdir()} == {"study.yaml", "out.nc"}


PAUSED = """
import sys, time
from pathlib import Path
from tcstudy import cli
from tcstudy.data import store
from tcstudy.study import level_solver
level_solver.POINTS = 1
place, reached, calls = sys.argv[1], Path(sys.argv[2]), 0
module = {"solve_block": level_solver, "define": store}[place]
original = getattr(module, place)
def pausing(*words, **more):
    global calls
    calls += 1
    if calls == 3:  # in the middle: say so, and wait for the signal
        reached.touch()
        time.sleep(60)
    return original(*words, **more)
setattr(module, place, pausing)
cli.main(sys.argv[3:])
"""


def killed(tmp_path: Path, place: str, *words: str) -> None:
    """Run a command until its third call of a function, then kill -9."""
    reached = tmp_path / "reached"
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    process = subprocess.Popen([sys.executable, "-c", PAUSED, place, str(reached), *words], env=environment)
    try:
        deadline = time.monotonic() + 120
        while not reached.exists() and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.05)
        assert reached.exists()
        time.sleep(COMMIT_SECONDS + 0.5)  # a record is safe so long after it was made
    finally:
        process.kill()
        assert process.wait(30) == -signal.SIGKILL
    reached.unlink()


@pytest.mark.parametrize(("how", "place"), [("append", "solve_block"), ("append", "define"), ("retry", "solve_block")])
def test_killed_it_leaves_the_old_file_and_goes_on(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str, place: str
) -> None:
    output = tmp_path / "out.nc"
    file.write_text(TEXT + "sweep: {E: [2, 1], tau: [0.01, 0.02]}\n")
    with monkeypatch.context() as patch:
        Counted(patch, fail_at=0.02 if how == "retry" else np.nan)
        old = tcstudy.run(file, output).tree  # the file grows
    if how == "append":
        file.write_text(TEXT + "sweep: {E: [2, 1], tau: [0.01, 0.02, 0.03]}\n")
    before = output.read_bytes()
    option = ["--append"] if how == "append" else []
    killed(tmp_path, place, "run", str(file), "--output", str(output), "--jobs", "1", *option)
    assert output.read_bytes() == before
    assert output.with_name("out.nc.partial").exists()
    monkeypatch.setattr("tcstudy.study.level_solver.POINTS", 1)
    counted = Counted(monkeypatch)
    tree = tcstudy.run(file, output, append=how == "append", jobs=1)
    assert counted.points == (2 if place == "solve_block" else 0)  # two of four were finished
    assert np.all(tree["status"] == int(PointStatus.OK))
    rows = {"tau": [0]} if how == "retry" else {"tau": [0, 1]}
    xr.testing.assert_equal(old.to_dataset().isel(rows), tree.to_dataset().isel(rows))
    assert {path.name for path in tmp_path.iterdir()} == {"study.yaml", "out.nc"}
