"""Adaptive families and tolerances through a whole run: what is stored, when it ends, and resuming."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.data.journal import Journal
from tcstudy.data.records import BlockRecord, LevelRecord
from tcstudy.refine import error_estimator
from tcstudy.reports.terminal.summary import summary
from tcstudy.study import level_solver
from tcstudy.study.run import execute, run
from tests.data.by_points import one_by_one
from tests.verification.scenes import RECTANGLE, study_of

PULLED = RECTANGLE.replace("left: clamped, top: free", 'left: clamped, top: {role: traction, g: ["0.03*x", -0.01]}')
SWEPT = PULLED + "\nsweep: {tau: [0.005, 0.01, 0.02]}\n"


def test_an_adaptive_run_stores_its_estimates(tmp_path: Path) -> None:
    tree = tcstudy.run(study_of(SWEPT, "mesh={maxh: 0.5, levels: 5, family: adaptive}"), tmp_path / "out.nc")
    assert np.all(tree["status"] == 1)
    estimate = tree["error_estimate"]
    assert estimate.dims == ("tau", "level")
    assert np.all(estimate.values > 0)
    assert np.all(np.diff(estimate.max("tau").values) < 0)
    assert tree["stop"].values.tolist()[:-1] == [""] * 4
    assert str(tree["stop"].values[-1]).startswith("estimated relative error")
    assert "goal" not in tree
    text = summary(tmp_path / "out.nc")
    assert "est. rel. error" in text
    assert "stopped: estimated relative error" in text


def test_a_body_without_load_is_not_refined(tmp_path: Path) -> None:
    idle = study_of(RECTANGLE, "mesh={maxh: 0.5, levels: 20, family: adaptive}")
    tree = tcstudy.run(idle, tmp_path / "out.nc")
    assert np.count_nonzero(tree["status"] == 1) == 1
    assert str(tree["stop"].values[0]).startswith("nothing to refine")


def test_a_tolerance_holds_at_every_point_and_levels_not_needed_are_not_there(tmp_path: Path) -> None:
    study = study_of(SWEPT, "mesh={maxh: 0.5, tolerance: 0.01, of: friction_resultant}")
    tree = tcstudy.run(study, tmp_path / "out.nc")
    relative = np.abs(tree["goal_estimate"] / tree["goal"]).max("tau").values
    assert relative[-1] <= 0.01
    assert np.all(relative[1:-1] > 0.01)
    assert tree.sizes["level"] == len(relative) < study.mesh.levels
    assert f"level_{len(relative)}" not in tree.children
    assert str(tree["stop"].values[-1]).startswith("tolerance 0.01 met: estimated relative error")
    assert tree["goal"].attrs["units"] == tree["friction_resultant"].attrs["units"]
    assert tree["goal"].values == pytest.approx(tree["friction_resultant"].values, rel=1e-12)


@pytest.mark.parametrize(
    ("mesh", "why"),
    [
        ("{maxh: 0.5, tolerance: 1e-6, max_levels: 3}", "tolerance 1e-06 not met: .* on the last level"),
        ("{maxh: 0.5, tolerance: 1e-6, max_dofs: 200}", "tolerance 1e-06 not met: .* more than max_dofs"),
        ("{maxh: 0.5, levels: 30, family: adaptive, max_dofs: 200}", "^estimated .* more than max_dofs"),
        ("{maxh: 0.5, tolerance: 0.3, family: uniform}", "tolerance 0.3 met"),
        ("{maxh: 0.5, tolerance: 0.15, family: graded}", "tolerance 0.15 met"),
    ],
)
def test_why_refinement_ended(mesh: str, why: str) -> None:
    levels = [r for r in run(study_of(PULLED, f"mesh={mesh}")) if isinstance(r, LevelRecord)]
    assert re.search(why, levels[-1].stop), levels[-1].stop
    assert all(level.stop == "" for level in levels[:-1])
    assert levels[-1].level == levels[-2].level  # the last record says again what the level is, and why it is the last


@pytest.mark.parametrize(
    ("mesh", "kept"),
    [
        ("levels: 3, family: adaptive, goal: friction_resultant", 4),
        ("tolerance: 3e-3, of: friction_resultant", 7),
    ],
)
def test_a_resumed_run_comes_to_the_same_meshes(
    tmp_path: Path, mesh: str, kept: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where it stopped within a level: what was solved before is estimated again, not solved."""
    monkeypatch.setattr(level_solver, "ESTIMATED", 1)  # blocks of one point, so that a level has three
    study = study_of(SWEPT, f"mesh={{maxh: 0.5, {mesh}}}")
    whole = tcstudy.run(study, tmp_path / "whole.nc")
    output = tmp_path / "out.nc"
    with Journal.open(output, study) as journal:
        count = 0
        for record in run(study):
            journal.add(record)
            count += isinstance(record, BlockRecord)
            if count == kept:
                break
    result = execute(study, output)
    assert result.resumed == kept
    with tcstudy.open_results(output) as tree:
        for name in ("n_dof", "energy", "goal", "error_estimate"):
            assert np.array_equal(tree[name].values, whole[name].values), name
        assert np.array_equal(tree["goal_estimate"].values, whole["goal_estimate"].values)
        assert tree["stop"].values.tolist() == whole["stop"].values.tolist()


def test_when_no_point_is_solved_refinement_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ArithmeticError("made to fail")

    monkeypatch.setattr(error_estimator.ErrorEstimator, "look", fail)
    records = list(run(study_of(PULLED, "mesh={maxh: 0.5, levels: 4, family: adaptive}")))
    points = [p for r in records if isinstance(r, BlockRecord) for p in one_by_one(r)]
    assert len(points) == 1
    assert points[0].reason == "ArithmeticError: made to fail"
    assert isinstance(records[-1], LevelRecord)
    assert records[-1].stop == "no point was solved, so nothing says what to refine"
