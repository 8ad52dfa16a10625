"""Adaptive families and tolerances through a whole run: what is stored, when it ends, and
resuming."""

import re
from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.data.records import BlockRecord, Journal, LevelRecord
from tcstudy.refine import family as error_estimator
from tcstudy.refine.family import Family, bisected
from tcstudy.refine.goals import hidden_shares
from tcstudy.reports.terminal.summary import text_of
from tcstudy.shapes.edges import doubled_areas
from tcstudy.study import level_solver
from tcstudy.study.run import execute, run
from tests.data.by_points import one_by_one
from tests.verification.goal_scenes import front_study
from tests.verification.scenes import RECTANGLE, study_of

PULLED = RECTANGLE.replace(
    "left: clamped, top: free", 'left: clamped, top: {role: traction, g: ["0.03*x", -0.01]}'
)
SWEPT = PULLED + "\nsweep: {tau: [0.005, 0.01, 0.02]}\n"


def test_a_tolerance_holds_at_every_point_and_levels_not_needed_are_not_there(
    tmp_path: Path,
) -> None:
    study = study_of(SWEPT, "mesh={maxh: 0.5, tolerance: 0.02, of: friction_resultant}")
    tree = tcstudy.run(study, tmp_path / "out.nc")
    assert tree["error_estimate"].dims == ("tau", "level")
    assert np.all(np.diff(tree["error_estimate"].max("tau").values) < 0)
    relative = np.abs(tree["goal_estimate"] / tree["goal"]).max("tau").values
    assert relative[-1] <= 0.02 < relative[1:-1].min()
    assert tree.sizes["level"] == len(relative) < study.mesh.levels
    assert f"level_{len(relative)}" not in tree.children
    assert str(tree["stop"].values[-1]).startswith("tolerance 0.02 met: estimated relative error")
    assert tree["goal"].attrs["units"] == tree["friction_resultant"].attrs["units"]
    assert tree["goal"].values == pytest.approx(tree["friction_resultant"].values, rel=1e-12)
    assert "stopped: tolerance 0.02 met: estimated relative error" in text_of(tmp_path / "out.nc")


@pytest.mark.parametrize(
    ("mesh", "why"),
    [
        (
            "{maxh: 0.5, tolerance: 1e-6, max_levels: 3}",
            "tolerance 1e-06 not met: .* on the last level",
        ),
        (
            "{maxh: 0.5, levels: 30, family: adaptive, max_dofs: 200}",
            "^estimated .* more than max_dofs",
        ),
        ("{maxh: 0.5, tolerance: 0.3, family: uniform}", "tolerance 0.3 met"),
        ("{maxh: 0.5, levels: 20, family: adaptive}", "nothing to refine"),
    ],
)
def test_why_refinement_ended(mesh: str, why: str) -> None:
    text = RECTANGLE if why.startswith("nothing") else PULLED  # a body without load
    levels = [r for r in run(study_of(text, f"mesh={mesh}")) if isinstance(r, LevelRecord)]
    assert re.search(why, levels[-1].stop), levels[-1].stop
    assert all(level.stop == "" for level in levels[:-1])
    assert (
        levels[-1].level == levels[-2].level
    )  # the last record says again what the level is, and why it is the last


def test_a_resumed_run_comes_to_the_same_meshes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where it stopped within a level: what was solved before is estimated again, not
    solved."""
    monkeypatch.setattr(
        level_solver, "MAX_ESTIMATED_POINTS", 1
    )  # blocks of one point, so that a level has three
    study = study_of(
        SWEPT, "mesh={maxh: 0.5, levels: 3, family: adaptive, goal: friction_resultant}"
    )
    whole = tcstudy.run(study, tmp_path / "whole.nc")
    output, records = tmp_path / "out.nc", list(run(study))
    fourth = [i for i, record in enumerate(records) if isinstance(record, BlockRecord)][3]
    with Journal.open(output, study) as journal:
        for record in records[: fourth + 1]:
            journal.add(record)
    assert execute(study, output).resumed == 4
    with tcstudy.open_results(output) as tree:
        for name in ("n_dof", "energy", "goal", "error_estimate", "goal_estimate"):
            assert np.array_equal(tree[name].values, whole[name].values), name
        assert tree["stop"].values.tolist() == whole["stop"].values.tolist()


def test_when_no_point_is_solved_refinement_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ArithmeticError("made to fail")

    monkeypatch.setattr(error_estimator.ErrorEstimator, "look", fail)
    records = list(run(study_of(PULLED, "mesh={maxh: 0.5, levels: 4, family: adaptive}")))
    (point,) = [p for r in records if isinstance(r, BlockRecord) for p in one_by_one(r)]
    assert point.reason == "ArithmeticError: made to fail"
    assert isinstance(records[-1], LevelRecord)
    assert records[-1].stop == "no point was solved, so there is no error estimate to refine by"


def test_parts_with_much_of_the_error_are_cut_several_times_and_what_an_end_cell_hides_is_halved_with_it() -> (
    None
):
    mesh = Family(front_study(0.4, 0.1)).next(0)
    shares = np.full(len(mesh.triangles), 1e-6)
    shares[7] = 1.0
    at, own = (
        mesh.points[mesh.triangles[7]].mean(axis=0),
        doubled_areas(mesh.points[mesh.triangles])[7],
    )
    finer = bisected(mesh, shares, 0.1, 0.5, [])
    parts = finer.points[finer.triangles]
    inside = np.linalg.norm(parts.mean(axis=1) - at, axis=1) < 0.2 * np.sqrt(own)
    assert finer.level == 1
    assert np.all(
        doubled_areas(parts)[inside] < own / 6.0
    )  # four halvings of its share, so of the area at least three
    assert len(finer.triangles) < 1.5 * len(mesh.triangles)
    node, curve = mesh.segments[0, 0], mesh.segment_curve[0]
    hidden = [(int(node), int(curve), 1.0 / float(mesh.boundary.length[0]))]
    finer = bisected(mesh, np.full(len(mesh.triangles), 1e-6), 0.2, 0.5, hidden)
    assert 0.1 < hidden_shares(finer, hidden).sum() <= 0.25
    assert np.count_nonzero(hidden_shares(finer, hidden)) == 1
    assert len(finer.triangles) < len(mesh.triangles) + 40
