"""`path: {complete: true}`: the loops that the path does not meet, in the file, the words and the picture."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from tcstudy.cli import main
from tcstudy.contact.boxes import Limits
from tcstudy.read.study import read_study
from tcstudy.study import path_run
from tcstudy.study.path_run import follow_path, shortfalls

CONFIGS = Path(__file__).parents[2] / "configs"


def test_the_pad_has_a_loop_that_the_path_does_not_meet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """m = 21: a loop from 0.718462 to 0.9406 mm, and 5, 7 and 3 equilibria."""
    file = tmp_path / "pad.nc"
    asked = ["--set", "mesh.levels=1", "--set", "path.complete=true", f"--output={file}"]
    short = ["--set", "path={parameter: boundary.plate.u_x, from: 0 mm, to: 0.95 mm, complete: true, hysteresis: true}"]
    assert main(["run", str(CONFIGS / "path.yaml"), *short, *asked[:2], f"--output={tmp_path / 'short.nc'}"]) == 0
    assert (
        "at 950 µm there are 2 stable states; slow loading ends in that of second least energy"
        in capsys.readouterr().out
    )
    assert main(["run", str(CONFIGS / "path.yaml"), *asked]) == 0
    said = capsys.readouterr().out
    assert "1 open branch and 1 closed loop; complete (proved)" in said
    assert "a closed loop from 0.7185 to 0.9406 mm that the path does not meet" in said
    assert "7 of 7 equilibria at 0.9 mm, 2 of them not on the path from the start" in said
    with xr.open_dataset(file) as data:
        [k] = np.flatnonzero(data["branch_loop"].values)
        t = data["branch_parameter"].values[data["branch_of"].values == k]
        np.testing.assert_allclose([t.min(), t.max()], [0.718462e-3, 0.9406e-3], rtol=1e-5)
        assert t[0] == t[-1]
        assert data["solution_count"].values.tolist() == [5, 7, 3]
        least = data["solution_lowest"].values.astype(bool)
        assert data["solution_global_minimum"].values[least].all()
        assert data["solution_residual"].values.max() < 1e-10
    assert main(["draw", str(file), str(tmp_path / "pad.svg")]) == 0
    assert "not met by the path" in (tmp_path / "pad.svg").read_text(encoding="utf-8")


def test_the_joint_has_thirteen_loops() -> None:
    record = follow_path(read_study(CONFIGS / "isola.yaml", ["path.hysteresis=false"]))
    assert record.values["complete"]
    assert sum(record.values["branch_loop"]) == 13
    assert record.values["solution_count"] == [69]
    assert np.count_nonzero(np.array(record.values["solution_piece"]) < 0) == 26


def test_where_the_range_is_not_proved_values_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """The loop is followed from what is listed at 0.9 mm, and what is known of each value is said."""
    monkeypatch.setattr(path_run, "LIMITS", replace(Limits(), boxes=40))
    study = read_study(CONFIGS / "path.yaml", ["mesh.levels=1", "path.complete=true", "path.hysteresis=false"])
    record = follow_path(study)
    assert not record.values["complete"]
    assert any("not proved to be all: the limit of boxes" in one for one in shortfalls(study, record))
    assert sum(record.values["branch_loop"]) == 1
    assert record.values["solution_count"] == [5, 7, 3]
    known = record.values["at_complete"]
    assert known.tolist() == [True, False, False]
    least, of = (np.array(record.values[name]) for name in ("solution_lowest", "solution_at"))
    assert record.values["solution_global_minimum"][least & (of == 0)].all()
