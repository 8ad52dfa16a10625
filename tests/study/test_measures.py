"""What a run stores of its contact nodes: which of them stick."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import tcstudy
from tcstudy.report.picture import read_picture
from tests.verification.scenes import RECTANGLE, study_of

TWO_JUMPS = "friction={law: piecewise-linear, points: [[0, 0.004], [0.01, 0.004], [0.01, 0.012]]}"
PULLED = 'left: clamped, top: {role: traction, g: ["0.01 + 0.01*x", 0]}'


def test_sticking_nodes_are_stored_wherever_the_law_jumps_up(tmp_path: Path) -> None:
    """At u_T = 0 and at the second jump; c of the others is the slip length, and draw takes what is stored."""
    study = study_of(RECTANGLE.replace("left: clamped, top: free", PULLED), TWO_JUMPS, "mesh.levels=2")
    with tcstudy.run(study, tmp_path / "jumps.nc") as tree:
        fine = tree["level_1"].to_dataset().load()
        slip_length = float(tree["slip_length"].isel(level=1))
    sticks, u_T = fine["sticks"].values == 1, fine["u_T"].values
    assert set(np.unique(fine["sticks"])) == {0, 1}
    assert (np.abs(u_T[sticks]) == 0.01).any()
    assert np.isin(np.abs(u_T[sticks]), (0.0, 0.01)).all()
    assert not np.isin(np.abs(u_T[~sticks]), (0.0, 0.01)).any()
    assert float(fine["c"].values[~sticks].sum()) == slip_length
    line = read_picture(tmp_path / "jumps.nc").line
    assert line.sticks is not None
    np.testing.assert_array_equal(line.sticks, sticks)
