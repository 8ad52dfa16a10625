"""history_run: exact rules on plane bodies, histories that go on from their file, sweeps, bodies held by friction."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from tcstudy.contact.history.problem import HistoryStep
from tcstudy.data.records import PointStatus
from tcstudy.errors import StoreError
from tcstudy.executors import ProcessExecutor
from tcstudy.read.study import read_study_text
from tcstudy.study import history_run, workers
from tcstudy.study.history_run import execute_history

BLOCK = """
body: {rectangle: {width: 0.4 m, height: 0.1 m}}
boundary: {bottom: contact, left: clamped, top: {role: traction, g: [0, 0]}, right: free}
material: {E: 210 GPa, nu: 0.3, alpha_T: 1.2e-5 1/K}
heat: {theta: 0 K}
friction: {law: tresca, tau: 20 MPa}
mesh: {maxh: 20 mm}
"""
SOFT = BLOCK.replace("law: tresca, tau: 20 MPa", "law: slip-weakening, tau_s: 20 MPa, tau_k: 15 MPa, delta: 1 mm")


def followed(folder: Path, study: str, history: str, *overrides: str, name: str = "a.nc") -> xr.Dataset:
    """The data of a history; every energy identity holds to rounding, every step is a solution."""
    asked = read_study_text(f"{study}history: {history}\n", "study.yaml", overrides)
    execute_history(asked, folder / name)
    with xr.open_dataset(folder / name) as opened:
        data = opened.load()
    done = data["status"].values == 1
    assert np.all(data["identity"].values[done] <= 1e-14)
    assert np.all(data["inclusion_residual"].values[done] <= 1e-10)
    assert np.all(data["dissipated"].values[done] >= 0.0)
    return data


def test_a_history_goes_on_from_its_file(tmp_path: Path) -> None:
    """More cycles behind the same steps: what is there stays to the bit, and what follows is as computed at once."""
    history = (
        "{memory: elastic-plastic, stiffness: 500 GPa/m, steps: [{theta: 60 K, in: 2}, {theta: -20 K}], repeat: 1}"
    )
    followed(tmp_path, SOFT, history)
    grown = followed(tmp_path, SOFT, history.replace("repeat: 1", "repeat: 3"))
    whole = followed(tmp_path, SOFT, history.replace("repeat: 1", "repeat: 3"), name="b.nc")
    assert grown.sizes["step"] == 10
    for name in ("u_T", "kappa", "plastic", "status"):
        assert np.array_equal(grown[name].values, whole[name].values)
    assert grown["dissipated"].values == pytest.approx(whole["dissipated"].values, rel=1e-12)
    with pytest.raises(StoreError, match="another study"):
        followed(tmp_path, SOFT.replace("20 MPa", "21 MPa"), history)
    with pytest.raises(StoreError, match="other steps"):
        followed(tmp_path, SOFT, history.replace("60 K", "61 K"))


KILLED = """
import os, signal, sys, time
from pathlib import Path
from tcstudy.read.study import read_study_text
from tcstudy.study.history_run import execute_history
from tests.study.test_whole_geometries import kill_one

def stop(point, points, step, steps):
    if step == 4:
        time.sleep(1.0)  # what is done is on the disk a quarter of a second later
        os.kill(os.getpid(), signal.SIGKILL)

execute_history(read_study_text(Path(sys.argv[1]).read_text(), "study.yaml"), Path(sys.argv[2]), stop)
"""


def test_a_killed_history_keeps_its_steps(tmp_path: Path) -> None:
    """kill -9 between two steps: the next run does the others alone, and all numbers are those of a whole run."""
    text = f"{SOFT}history: {{memory: damage, steps: [{{theta: 60 K, in: 4}}, {{theta: -60 K, in: 2}}]}}\n"
    (tmp_path / "study.yaml").write_text(text, encoding="utf-8")
    words = [sys.executable, "-c", KILLED, tmp_path / "study.yaml", tmp_path / "a.nc"]
    assert subprocess.run(words, check=False).returncode == -signal.SIGKILL
    assert (tmp_path / "a.nc.partial").exists()
    assert not (tmp_path / "a.nc").exists()
    study, told = read_study_text(text, "study.yaml"), list[int]()
    summary = execute_history(study, tmp_path / "a.nc", lambda point, points, step, steps: told.append(step))
    assert (told, summary.found) == ([5, 6], 5)
    assert not list(tmp_path.glob("*.partial*"))
    execute_history(study, tmp_path / "b.nc")
    with xr.open_dataset(tmp_path / "a.nc") as a, xr.open_dataset(tmp_path / "b.nc") as b:
        for name in b.data_vars:
            assert np.array_equal(a[name].values, b[name].values, equal_nan=b[name].dtype.kind == "f"), name


SWEPT = (
    f"{SOFT}history: {{memory: friction, steps: [{{theta: 60 K, in: 3}}, {{theta: 0 K}}]}}\n"
    "sweep: {tau_s: [25 MPa, 20 MPa], alpha_T: [1e-5, 1.2e-5, 1.4e-5]}\n"
)
CRUEL = """
import os
from tcstudy.executors import worker
from tcstudy.study import history_run
follow = history_run.follow_point
def cruel(study, *given):
    first, own = study.scenes
    if 1.1 < own.material.beta / first.material.beta < 1.3 and own.friction == first.friction:
        os.kill(os.getpid(), 9)
    return follow(study, *given)
history_run.follow_point = cruel
worker.main()
"""


def test_workers_find_the_same_histories_and_one_that_kills_them_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the bit; what was broken is followed again by the next run."""
    study, told = read_study_text(f"{SWEPT}output: {{sensitivity: [friction.delta]}}\n", "study.yaml"), []
    execute_history(study, tmp_path / "a.nc", jobs=1)
    with monkeypatch.context() as patched:
        patched.setattr(workers, "ProcessExecutor", partial(ProcessExecutor, command=("-c", CRUEL)))
        summary = execute_history(study, tmp_path / "b.nc", lambda *at: told.append(at), jobs=2)
    assert (summary.points, summary.ended) == (6, 1)
    assert [point for point, *_ in told] == [0, 1, 2, 3, 4, 5]
    with xr.open_dataset(tmp_path / "a.nc") as a:
        assert a["u_T"].dims == ("tau_s", "alpha_T", "step", "node")
        own = followed(tmp_path, SOFT, SWEPT.partition("history: ")[2].partition("\n")[0], name="one.nc")
        assert np.array_equal(a["u_T"].sel(tau_s=20e6, alpha_T=1.2e-5).values, own["u_T"].values)
    with xr.open_dataset(tmp_path / "b.nc") as b:
        reasons = b["reason"].transpose("tau_s", "alpha_T").values.ravel()
        assert sum("signal SIGKILL" in str(reason) for reason in reasons) == 1
        assert np.count_nonzero(b["status"].values == PointStatus.ERROR) == 1
    summary = execute_history(study, tmp_path / "b.nc", jobs=2)
    assert (summary.ended, summary.found) == (0, 25)
    with xr.open_dataset(tmp_path / "a.nc") as a, xr.open_dataset(tmp_path / "b.nc") as b:
        assert a.drop_attrs().equals(b.drop_attrs())


def test_a_step_that_breaks_down_ends_its_history_and_no_sweep(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The steps before stay; the next run tries again and finds what an undisturbed one finds."""
    study, steps, begun = read_study_text(SWEPT, "study.yaml"), history_run.history, []

    def broken(*given: Any) -> Iterator[HistoryStep]:
        begun.append(given)
        for n, step in enumerate(steps(*given)):
            if len(begun) == 2 and n == 2:
                raise RuntimeError("no such state")
            yield step

    execute_history(study, tmp_path / "a.nc", jobs=1)
    with monkeypatch.context() as patched:
        patched.setattr(history_run, "history", broken)
        summary = execute_history(study, tmp_path / "b.nc", jobs=1)
    assert (summary.points, summary.ended) == (6, 1)
    with xr.open_dataset(tmp_path / "b.nc") as b:
        found = b["status"].transpose("tau_s", "alpha_T", "step").values.reshape(6, 5)
        reasons = b["reason"].transpose("tau_s", "alpha_T").values.ravel()
    assert np.count_nonzero(found == PointStatus.OK) == 27
    assert found[1].tolist() == [PointStatus.OK] * 2 + [PointStatus.ERROR] + [PointStatus.NOT_RUN] * 2
    assert str(reasons[1]) == "RuntimeError: no such state"
    assert execute_history(study, tmp_path / "b.nc", jobs=1).found == 27
    with xr.open_dataset(tmp_path / "a.nc") as a, xr.open_dataset(tmp_path / "b.nc") as b:
        assert a.drop_attrs().equals(b.drop_attrs())


def test_a_step_without_solution_ends_the_history(tmp_path: Path) -> None:
    """A loose strip pulled harder than friction holds: the steps before stay, the reason is told."""
    loose = BLOCK.replace("left: clamped", "left: free").replace("law: tresca, tau: 20 MPa", "law: tresca, tau: 1 MPa")
    study = loose.replace("right: free", "right: {role: traction, g: [0, 0]}")
    steps = "[{boundary.right.g_x: 3 MPa, in: 3}, {boundary.right.g_x: 6 MPa, in: 3}, {boundary.right.g_x: 0 MPa}]"
    data = followed(tmp_path, study, f"{{memory: friction, steps: {steps}}}")
    status = data["status"].values.tolist()
    assert status[:4] == [1, 1, 1, 1]
    assert status[4] > 1
    assert status[5:] == [0, 0, 0]
    assert data["reason"].item()
    assert np.all(np.isnan(data["u_T_max"].values[5:]))
