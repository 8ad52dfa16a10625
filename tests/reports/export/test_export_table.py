"""Tables of sweeps, paths and charts as CSV and JSON: to the bit in pandas, failed points too, in little memory."""

from __future__ import annotations

import csv
import json
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tcstudy
from tcstudy.data.provenance import collect
from tcstudy.data.records import BlockRecord, PointStatus
from tcstudy.data.store import write
from tcstudy.errors import DrawError, UsageError
from tcstudy.read.study import read_study_text
from tcstudy.reports.export.export_table import write_table
from tcstudy.scene.study import Axis
from tests.reports.figures.draw_cases import ALPHA, FILM, study


def test_pandas_reads_the_table_to_the_bit(block: Path, tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    assert write_table(block, tmp_path / "block.csv") == 12
    table = pandas.read_csv(tmp_path / "block.csv").set_index(["E [Pa]", "theta_bar [K]", "level"])
    with tcstudy.open_results(block) as tree:
        wanted = tree.dataset[["energy", "u_T_max", "iterations"]].to_dataframe()
    assert list(table.index) == list(wanted.index)
    assert np.array_equal(table["energy [J m-1]"], wanted["energy"])
    assert np.array_equal(table["u_T_max [m]"], wanted["u_T_max"])
    assert np.array_equal(table["iterations"], wanted["iterations"])
    assert set(table["status"]) == {"ok"}
    assert "start_energy.zero [J m-1]" in table
    assert write_table(block, tmp_path / "block.json", {"E": "100 GPa", "theta_bar": 0}) == 2
    found = json.loads((tmp_path / "block.json").read_text())
    assert found["units"]["energy"] == "J m-1"
    assert [row["level"] for row in found["rows"]] == [0, 1]
    assert found["rows"][1]["energy"] == wanted["energy"].loc[(100e9, 0.0, 1)]
    assert found["rows"][1]["heat_balance"] is None


def test_failed_points_and_lists_have_rows(listed: Path, grid: Path, tmp_path: Path) -> None:
    assert write_table(listed, tmp_path / "list.csv", {"alpha": 25}) == 4
    with open(tmp_path / "list.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["tau [Pa]"] for row in rows] == ["1000000.0"] * 2 + ["20000000.0"] * 2
    write_table(grid, tmp_path / "grid.csv")
    with open(tmp_path / "grid.csv", newline="") as stream:
        last = list(csv.DictReader(stream))[-1]
    assert (last["friction"], last["status"], last["slip_length [m]"]) == ("softening", "singular", "")
    assert last["reason"] == "the stiffness matrix is singular"


def test_tables_of_histories_and_fits(tmp_path: Path) -> None:
    sections: dict[str, Any] = FILM | {"mesh": {"maxh": 0.6}}
    history = {"memory": "friction", "steps": [{"boundary.top.u_x": 0.5, "in": 2}, {"boundary.top.u_x": 0.0}]}
    of = tcstudy.Study.from_dict(sections | {"history": history, "sweep": {"E": [1, 2]}})
    tcstudy.run(of, tmp_path / "history.nc")
    assert write_table(tmp_path / "history.nc", tmp_path / "history.csv") == 8
    assert write_table(tmp_path / "history.nc", tmp_path / "history.csv", {"E": 2}) == 4
    with open(tmp_path / "history.csv", newline="") as stream:
        assert [row["E"] for row in csv.DictReader(stream)] == ["2.0"] * 4
    with pytest.raises(DrawError, match="step"):
        write_table(tmp_path / "history.nc", tmp_path / "history.csv", {"step": 2})
    rows = "\n".join(f"{0.1 * i:.1f},{0.04 * i:.2f}" for i in range(5))
    (tmp_path / "pull.csv").write_text(f"u,R\n{rows}\n")
    data = {"file": "pull.csv", "columns": {"boundary.top.u_x": "u", "friction_resultant": "R"}}
    numbers = {"E": {"start": 1.0, "within": [0.01, 10.0]}}
    text = json.dumps(sections | {"fit": {"data": data, "parameters": numbers}})
    tcstudy.run(read_study_text(text, "fit.yaml", source=tmp_path / "fit.yaml"), tmp_path / "fit.nc")
    assert write_table(tmp_path / "fit.nc", tmp_path / "fit.csv") == 5
    with open(tmp_path / "fit.csv", newline="") as stream:
        assert [float(row["datum_given"]) for row in csv.DictReader(stream)] == [0.0, 0.1, 0.2, 0.3, 0.4]
    with pytest.raises(UsageError, match="--at"):
        write_table(tmp_path / "fit.nc", tmp_path / "none.csv", {"alpha": 1})


def test_a_long_table_takes_little_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All rows at once would be 8 MB of Python's numbers."""
    n = 3_000
    monkeypatch.setattr("tcstudy.reports.export.export_table.VALUES", 2**14)
    axis = Axis("alpha", ("heat", "alpha"), tuple(range(n)), tuple(map(float, range(n))), ALPHA.units)
    plan = study("grid", (axis,))
    numbers = {"u_T_max": np.arange(n) / 7.0, "energy": -np.arange(n) / 3.0}
    none = {"u_T": None, "xi": None, "sticks": None}
    block = BlockRecord(0, plan.shape, np.arange(n), np.full(n, PointStatus.OK, dtype=np.int8), {}, numbers, **none)
    write(tmp_path / "long.nc", plan, (), [block], collect(plan, ["tcstudy"]))
    tracemalloc.start()
    assert write_table(tmp_path / "long.nc", tmp_path / "long.csv") == 2 * n
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 4e6
    with open(tmp_path / "long.csv") as stream:
        assert sum(1 for _ in stream) == 2 * n + 1
