"""A study through to its file: values in their places, reuse, failures recorded, resuming after a kill."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tcstudy
from tcstudy.contact.contact import solve_contact
from tcstudy.data.journal import COMMIT_SECONDS
from tcstudy.data.records import PointStatus
from tcstudy.fem import heat_forms as heat
from tcstudy.laws.laws import Laws
from tcstudy.offline import level as level_module
from tcstudy.study import level_solver
from tests.verification.scenes import HEATED_BRACKET, RECTANGLE, levels_of, study_of

SWEPT = (
    RECTANGLE.replace("left: clamped, top: free", 'left: clamped, top: {role: traction, g: ["0.03*x", -0.01]}')
    + """
sweep: {friction.tau: [0.005, 0.01, 0.02], E: [1, 2]}
"""
)


def run(tmp_path: Path, text: str, *overrides: str) -> xr.DataTree:
    return tcstudy.run(study_of(text, *overrides), tmp_path / "out.nc", force=True)


def test_values_stand_at_their_points(tmp_path: Path) -> None:
    """Points are solved in an order of their own; each must come back under its labels."""
    tree = run(tmp_path, SWEPT)
    data = tree.to_dataset()
    assert data["status"].dims == ("tau", "E", "level")
    assert np.all(data["status"] == int(PointStatus.OK))
    assert data["tau"].values.tolist() == [0.005, 0.01, 0.02]
    study = study_of(SWEPT, "sweep={}", "friction.tau=0.02", "material.E=2")
    level = levels_of(study)[1]
    alone = solve_contact(level.condensed(study.scenes[0]).problem)
    stored = tree["level_1"]["u_T"].sel(tau=0.02, E=2)
    assert np.max(np.abs(stored.values - alone.v)) < 1e-14
    assert 0 < float(data["slip_length"].sel(tau=0.02, E=2, level=1)) < 2
    traction = tree["level_1"]["xi"].sel(tau=0.02, E=2).values
    resultant = float(traction @ tree["level_1"]["c"].values)
    assert float(data["friction_resultant"].sel(tau=0.02, E=2, level=1)) == pytest.approx(resultant, rel=1e-12)
    assert np.all(data["lambda_1"].sel(E=2) == pytest.approx(2 * data["lambda_1"].sel(E=1).values, rel=1e-10))


@pytest.mark.parametrize(("material", "ratios"), [("E: [1, 2]", 1), ("E: [1, 0.3, 7.7]", 1), ("nu: [0.2, 0.3]", 2)])
def test_one_factorisation_a_mesh_and_ratio(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, material: str, ratios: int
) -> None:
    """λ/μ makes the factor, E only scales it; a new ratio takes over the order of elimination."""
    plans = []
    original = level_module.condense
    monkeypatch.setattr(level_module, "condense", lambda *a, **k: plans.append(k["plan"]) or original(*a, **k))
    tree = run(tmp_path, SWEPT.replace("E: [1, 2]", material), "mesh.levels=2")
    assert np.all(tree["status"] == int(PointStatus.OK))
    assert len(plans) == 2 * ratios
    assert sum(plan is None for plan in plans) == 2


KNOWN = ("boundary.right={role: traction, g: [0.01, 0.02*y], pressure: 0.03}", "boundary.bore=free")


@pytest.mark.parametrize(
    "changes", [("material.alpha_T=0",), ("heat={theta: 3}", *KNOWN), ("heat={alpha: 1, theta_bar: 5}",)]
)
def test_no_heat_problem_where_none_is_needed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changes: tuple[str, ...]
) -> None:
    def refuse(self: heat.HeatForms) -> None:
        raise AssertionError("the heat matrix was assembled")

    monkeypatch.setattr(heat.HeatForms, "conduction", property(refuse))
    tree = run(tmp_path, HEATED_BRACKET, *changes)
    assert np.all(tree["status"] == int(PointStatus.OK)), tree["reason"].values


def test_a_constant_temperature_loads_the_body(tmp_path: Path) -> None:
    known = run(tmp_path, HEATED_BRACKET, "heat={theta: 5}", *KNOWN)["level_1"]["u_T"].values
    by_air = run(tmp_path, HEATED_BRACKET, "heat={alpha: 1, theta_bar: 5}")["level_1"]["u_T"].values
    cold = run(tmp_path, HEATED_BRACKET, "heat={theta: 0}", *KNOWN)["level_1"]["u_T"].values
    assert np.array_equal(known, by_air)
    assert np.max(np.abs(known - cold)) > 1e-3


def test_a_failing_point_is_recorded_and_the_rest_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    original = level_solver.solve_block

    def fail_once(body: object, loads: object, laws: Laws, *options: object) -> object:
        if np.any(laws.scales[laws.index] == 0.01):
            raise ArithmeticError("made to fail")
        return original(body, loads, laws, *options)  # type: ignore[arg-type]

    monkeypatch.setattr(level_solver, "solve_block", fail_once)
    data = run(tmp_path, SWEPT).to_dataset()
    assert np.all(data["status"].sel(tau=0.01) == int(PointStatus.ERROR))
    assert np.all(data["status"].drop_sel(tau=0.01) == int(PointStatus.OK))
    assert str(data["reason"].sel(tau=0.01)[0, 0].item()) == "ArithmeticError: made to fail"
    assert np.all(np.isnan(data["energy"].sel(tau=0.01)))


def test_too_few_iterations_is_a_status_with_a_remedy(tmp_path: Path) -> None:
    rough = "friction={law: saw-tooth, delta: 0.002, teeth: 40, drop: 0.9, decay: 0.97}"
    options = "solver={name: bundle-newton, max_iterations: 1}"
    text = SWEPT.replace("friction.tau: [0.005, 0.01, 0.02]", "friction.tau: [0.01, 0.015, 0.02]")
    data = run(tmp_path, text, rough, options).to_dataset()
    bad = data["status"] == int(PointStatus.NOT_CONVERGED)
    assert bool(bad.any())
    reason = str(data["reason"].values[bad.values][0])
    assert "1 iterations" in reason
    assert "max_iterations" in reason


SLOW = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a parent in the background hands down one that is ignored
from pathlib import Path
from tcstudy.read.study import read_study
from tcstudy.study import level_solver
from tcstudy.study.execute import execute
level_solver.POINTS = 1
original = level_solver.solve_block
calls = 0
def slow(*a, **k):
    global calls
    calls += 1
    if calls == 6:  # five points are finished: say so, and wait for the signal
        Path(sys.argv[3]).touch()
        time.sleep(60)
    return original(*a, **k)
level_solver.solve_block = slow
try:
    execute(read_study(Path(sys.argv[1])), Path(sys.argv[2]))
except KeyboardInterrupt:
    sys.exit(130)
"""


def test_finished_points_survive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed in the middle, the run leaves its points; the next one solves only the others, to the same values."""
    study_file, output = tmp_path / "study.yaml", tmp_path / "out.nc"
    study_file.write_text(SWEPT.replace("levels: 3", "levels: 2"))
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    reached = tmp_path / "reached"
    words = [sys.executable, "-c", SLOW, str(study_file), str(output), str(reached)]
    process = subprocess.Popen(words, env=environment)
    partial = tmp_path / "out.nc.partial"
    try:
        deadline = time.monotonic() + 60
        while not reached.exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(COMMIT_SECONDS + 0.5)  # a record is safe so long after it was made
        process.send_signal(signal.SIGKILL)
        assert process.wait(30) == -signal.SIGKILL
    finally:  # no child outlives the test
        process.kill()
        process.wait()
    assert partial.exists()
    assert not output.exists()
    from tcstudy.study.execute import execute

    study = tcstudy.load(study_file)
    monkeypatch.setattr(level_solver, "POINTS", 1)
    summary = execute(study, output)
    assert summary.resumed == 5
    assert summary.points == 12
    assert not partial.exists()
    resumed = tcstudy.open_results(output).load()
    whole = tcstudy.run(study, tmp_path / "whole.nc")
    for name in ("energy", "u_T_max", "friction_resultant"):
        assert np.array_equal(resumed[name].values, whole[name].values)
    assert np.array_equal(resumed["level_1"]["u_T"].values, whole["level_1"]["u_T"].values)


def test_fields_are_kept_on_request(tmp_path: Path) -> None:
    tree = run(tmp_path, HEATED_BRACKET, "output={fields: true}")
    group = tree["level_1"]
    study = study_of(HEATED_BRACKET)
    scene, level = study.scenes[0], levels_of(study)[1]
    condensed = level.condensed(scene)
    u = level.displacement(scene, solve_contact(condensed.problem).v)
    n = level.mesh.n_points
    assert np.max(np.abs(group["u_x"].values - u[:n])) < 1e-14
    assert np.max(np.abs(group["u_y"].values - u[n:])) < 1e-14
    assert np.max(np.abs(group["theta"].values - level.temperature(scene).theta)) < 1e-14
