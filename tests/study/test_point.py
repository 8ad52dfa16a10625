"""What a run stores of its contact nodes: which of them stick."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.reports.picture import read_picture
from tcstudy.reports.terminal.summary import summary
from tests.verification.scenes import RECTANGLE, study_of

TWO_JUMPS = "friction={law: piecewise-linear, points: [[0, 0.004], [0.01, 0.004], [0.01, 0.012]]}"
PULLED = 'left: clamped, top: {role: traction, g: ["0.01 + 0.01*x", 0]}'


def test_sticking_nodes_are_stored_wherever_the_law_jumps_up(tmp_path: Path) -> None:
    """At u_T = 0 and at the second jump; c of the others is the slip length, and draw takes what is stored."""
    study = study_of(RECTANGLE.replace("left: clamped, top: free", PULLED), TWO_JUMPS, "mesh.levels=2")
    found = tcstudy.run(study, tmp_path / "jumps.nc")
    fine, slip_length = found["level_1"].to_dataset(), float(found["slip_length"].isel(level=1))
    sticks, u_T = fine["sticks"].values == 1, fine["u_T"].values
    assert set(np.unique(fine["sticks"])) == {0, 1}
    assert (np.abs(u_T[sticks]) == 0.01).any()
    assert np.isin(np.abs(u_T[sticks]), (0.0, 0.01)).all()
    assert not np.isin(np.abs(u_T[~sticks]), (0.0, 0.01)).any()
    assert float(fine["c"].values[~sticks].sum()) == pytest.approx(slip_length, rel=1e-14)
    line = read_picture(tmp_path / "jumps.nc").line
    assert line.sticks is not None
    np.testing.assert_array_equal(line.sticks, sticks)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_a_film_without_friction_has_none(tmp_path: Path, size: float) -> None:
    """Else the rounding of l̃ − Ãv would look like a traction that changes by half from level to level."""
    pulled = PULLED.replace("0.01 + 0.01*x", f"{size!r}*(1 + x)")
    study = study_of(RECTANGLE.replace("left: clamped, top: free", pulled), "friction.tau=0", "mesh.levels=2")
    found = tcstudy.run(study, tmp_path / "free.nc")
    assert found["status"].values.tolist() == [1, 1]
    assert found["friction_resultant"].values.tolist() == [0.0, 0.0]
    assert not found["level_1"]["xi"].values.any()
    assert (found["inclusion_residual"].values > 0.0).all()
    (row,) = (line.split() for line in summary(tmp_path / "free.nc").splitlines() if "unique" in line.split())
    assert (row[2], row[-1]) == ("0", "0")  # ∫ξ and its change
