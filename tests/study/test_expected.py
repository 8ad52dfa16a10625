"""Time and memory to expect: measured by a trial, near what a run takes, or unknown with the reason."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from tcstudy.read.study import read_study
from tcstudy.scene.study import Study
from tcstudy.study import expected, trial
from tcstudy.study.jobs import LevelForecast
from tcstudy.study.run import run
from tests.verification.scenes import RECTANGLE, study_of

CONFIG = Path(__file__).parents[2] / "configs" / "quickstart.yaml"
POINTS = "sweep={alpha: {linspace: [50, 500, 20]}, q: {linspace: [0.1, 0.5, 20]}}"


@pytest.mark.parametrize(
    "changes",
    [("mesh={maxh: 0.01, levels: 4}",), (POINTS,), ("mesh={maxh: [0.02, 0.01, 0.005]}",)],
    ids=["levels", "points", "list"],
)
def test_a_run_takes_half_to_twice_what_a_trial_says(changes: tuple[str, ...]) -> None:
    """CPU seconds of the points alone: large meshes, many points, a list of meshes."""
    study = read_study(CONFIG, list(changes))
    found = trial.plan_and_resources(study)[1].seconds - expected.START
    begin = time.process_time()
    with threadpool_limits(1, user_api="blas"):
        list(run(study))
    assert 0.5 < found / (time.process_time() - begin) < 2.0


@pytest.mark.parametrize(
    ("study", "why"),
    [
        (study_of(RECTANGLE, "mesh={maxh: 0.5, levels: 6, family: adaptive}"), "estimated error"),
        (study_of(RECTANGLE, "history={memory: friction, steps: [{f_x: 0.1, in: 2}]}", "loads.f=[0, 0]"), "a step"),
        (study_of(RECTANGLE, "solver=[separable-newton, bundle-newton]"), "solvers"),
    ],
    ids=["adaptive", "history", "bundle"],
)
def test_what_no_trial_tells_is_unknown(study: Study, why: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial, "stages", None)  # nothing is solved for it
    spent = trial.plan_and_resources(study)[1]
    assert math.isnan(spent.seconds)
    assert why in spent.unknown
    assert spent.memory > expected.MEMORY


def test_points_that_are_slow_on_a_coarse_mesh_are_unknown_on_a_fine_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial, "ENOUGH", 1e-6)
    for maxh, known in ((0.3, True), (0.02, False)):
        spent = trial.plan_and_resources(study_of(RECTANGLE, f"mesh={{maxh: {maxh}}}"))[1]
        assert math.isfinite(spent.seconds) == known
        assert ("do not tell" in spent.unknown) != known


def test_rates_of_levels_that_grow_as_they_say() -> None:
    rates = trial.Rates(np.array([0.05, 1e-3, 1e-5]), 1, 2.0, 16_000, 0.0)
    study = study_of(RECTANGLE)
    one, two = ([LevelForecast(0.1, 0, n_dof, 40)] for n_dof in (10_000, 100_000))
    grown = rates.seconds(study, two, 1) - rates.seconds(study, one, 1)
    assert grown == pytest.approx(1e-5 * (1e5**1.08 - 1e4**1.08))
    assert rates.seconds(study, [*one, *two], 1) == pytest.approx(
        rates.seconds(study, one, 1) + rates.seconds(study, two, 1)
    )
    assert rates.seconds(study, two, 3) > rates.seconds(study, two, 1) + grown * 0.9


def test_workers_are_chosen_by_sizes_alone() -> None:
    study = read_study(CONFIG)
    finer = replace(study, mesh=replace(study.mesh, maxh=(0.25 * study.mesh.maxh[0],)))
    one, two = expected.of_geometry(study), expected.of_geometry(finer)
    assert two.seconds > one.seconds
    assert two.memory > one.memory
