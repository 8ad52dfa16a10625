"""Tables of sweeps, histories and fits as CSV and JSON, and a file as one object: to the bit,
failed points too."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.data.reading import load_root, open_results
from tcstudy.errors import DrawError, UsageError
from tcstudy.reports.export import brief, write_table
from tcstudy.reports.json_values import json_text
from tests.reports.conftest import REASON, Stored


def rows_of(file: Path) -> list[dict[str, str]]:
    with open(file, newline="") as stream:
        return list(csv.DictReader(stream))


def test_pandas_reads_the_table_to_the_bit(
    stored: Stored, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pandas = pytest.importorskip("pandas")
    file = tmp_path / "block.csv"
    assert write_table(stored("block"), file) == 12
    table = pandas.read_csv(file).set_index(["theta_bar [K]", "friction", "level"])
    with tcstudy.open_results(stored("block")) as tree:
        wanted = tree.dataset[["energy", "u_T_max", "iterations"]].to_dataframe()
    assert list(table.index) == list(wanted.index)
    assert np.array_equal(table[["energy [J m-1]", "u_T_max [m]", "iterations"]], wanted)
    assert "start_energy.zero [J m-1]" in table
    assert (
        write_table(stored("block"), tmp_path / "block.json", {"friction": "weak", "theta_bar": 0})
        == 2
    )
    found = json.loads((tmp_path / "block.json").read_text())
    assert (found["units"]["energy"], [row["level"] for row in found["rows"]]) == ("J m-1", [0, 1])
    assert found["rows"][1]["energy"] == wanted["energy"].loc[(0.0, "weak", 1)]
    whole = file.read_bytes()
    monkeypatch.setattr(
        "tcstudy.reports.export.MAX_VALUES", 1
    )  # in memory at a time: the rows of one label
    write_table(stored("block"), file)
    assert file.read_bytes() == whole


def test_failed_points_and_lists_have_rows(stored: Stored, tmp_path: Path) -> None:
    assert write_table(stored("listed"), tmp_path / "list.csv", {"alpha": 25}) == 2
    assert [row["tau_s [Pa]"] for row in rows_of(tmp_path / "list.csv")] == [
        "90000000.0",
        "95000000.0",
    ]
    write_table(stored("failed"), tmp_path / "grid.csv")
    last = rows_of(tmp_path / "grid.csv")[-1]
    assert (last["friction"], last["status"], last["slip_length [m]"]) == ("weak", "singular", "")
    assert last["reason"] == REASON


def test_tables_of_histories_and_fits(stored: Stored, tmp_path: Path) -> None:
    assert write_table(stored("history"), tmp_path / "history.csv") == 6 * 17
    assert write_table(stored("history"), tmp_path / "history.csv", {"E": 50, "tau": 1}) == 17
    assert [row["E"] for row in rows_of(tmp_path / "history.csv")] == ["50.0"] * 17
    with pytest.raises(DrawError, match="step"):
        write_table(stored("history"), tmp_path / "history.csv", {"step": 2})
    assert write_table(stored("fit"), tmp_path / "fit.csv") == 60
    given = load_root(stored("fit"), "fit")["datum_given"].values.tolist()
    assert [float(row["datum_given"]) for row in rows_of(tmp_path / "fit.csv")] == given
    with pytest.raises(UsageError, match="--at"):
        write_table(stored("fit"), tmp_path / "none.csv", {"alpha": 1})


def test_one_object_has_the_numbers_of_the_file(stored: Stored) -> None:
    found = json.loads(json_text(brief(stored("failed"))))
    assert (found["kind"], found["title"]) == ("run", "A block <on> a film for $5 and $6")
    assert found["verdict"]["solved"][0].startswith("5 of 6 points, 2 levels; 1 failed")
    assert found["units"]["slip_length"] == "m"
    values = found["values"]
    with open_results(stored("failed")) as tree:
        np.testing.assert_array_equal(
            np.array(values["slip_length"], dtype=float), tree["slip_length"].values
        )
        assert values["n_dof"] == tree["n_dof"].values.tolist()
        assert found["dimensions"]["slip_length"] == ["theta_bar", "friction", "level"]
    assert (values["theta_bar"], values["friction"]) == ([0.0, 10.0, 20.0], ["plain", "weak"])
    assert values["status"] == [
        [["ok", "ok"], ["ok", "singular" if i == 4 else "ok"]] for i in range(2, 5)
    ]
    assert values["reason"][2] == [["", ""], ["", REASON]]
