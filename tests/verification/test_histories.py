"""The gallery's load histories against their closed forms: the numbers that stand in the head of each study."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from tcstudy.read.study import read_study
from tcstudy.reports.terminal.summary import text_of
from tcstudy.study.history_run import execute_history
from tests.commands import CONFIGS


def followed(folder: Path, name: str, *overrides: str) -> tuple[xr.Dataset, str]:
    """The data of a shipped history and what is said of it."""
    folder.mkdir(exist_ok=True)
    execute_history(read_study(CONFIGS / name, overrides), folder / "a.nc")
    with xr.open_dataset(folder / "a.nc") as opened:
        data = opened.load()
    assert np.all(data["status"].values == 1)
    assert np.all(data["identity"].values <= 1e-14)
    return data, text_of(folder / "a.nc")


def test_rail_through_a_year(tmp_path: Path) -> None:
    """Half of the summer's way stays, the winter mirrors the summer; the second year dissipates what the first did."""
    data, said = followed(tmp_path, "rail_year.yaml", "mesh.maxh=344 mm")
    names, year = data["step_name"].values, data["cycle"].values
    ends = {name: 1e3 * data["u_T"].values[(names == name) & (year == 1), -1][0] for name in names[year == 1] if name}
    expected = {"summer": 18.555264, "autumn": 9.277632, "winter": -18.555264, "spring": -9.277632}
    for name, end in expected.items():
        assert ends[name] == pytest.approx(end, rel=2e-4), name
    a_rail = 76.70e-4 / 0.172
    spent = data["dissipated"].values * a_rail
    assert np.all(np.abs(data["closure"].values) <= 1e-10 * data["dissipated"].values.max())
    assert spent[:3].sum() == pytest.approx(4781.914, rel=1e-3)
    assert spent[year == 2].sum() == pytest.approx(2 * 9563.828, rel=1e-2)
    autumn = int(np.flatnonzero(names == "autumn")[0])
    tension = np.abs(np.cumsum((data["xi"].values[autumn] * data["c"].values)[::-1])).max() * a_rail
    assert tension == pytest.approx(386.568e3, rel=0.03)  # half a cell of 38.66 m
    assert "a closed loop: the last cycle leaves no slip behind; it dissipates 42" in said  # more than the virgin one


def test_a_rail_on_cells_longer_than_it_is_high_is_followed_to_the_end(tmp_path: Path) -> None:
    """Nodes push others on before the front comes to them: which of them turn back is a search."""
    followed(tmp_path, "rail_year.yaml", "mesh.maxh=1 m", "history.repeat=1")


def test_pipeline_walks_start_up_by_start_up(tmp_path: Path) -> None:
    """55.64603 mm a cycle at every point of the line, and nothing at 40 K."""
    data, said = followed(tmp_path, "pipeline_cycles.yaml", "history.repeat=3")
    cold = data["u_T"].values[data["step_name"].values == "shut-down"]
    walked = np.diff(cold, axis=0)
    assert walked == pytest.approx(55.64603e-3, rel=2e-4)
    assert np.ptp(walked) <= 1e-10
    assert "along its exact path" in said
    assert "walking: the last two cycles each moved the whole contact line by 55.6" in said
    steps = "history.steps=[{theta: 40 K}, {theta: 0 K}]"
    _, still = followed(tmp_path / "cool", "pipeline_cycles.yaml", steps, "history.repeat=3")
    assert "a closed loop" in still or "shakedown" in still


def test_strip_pulled_let_go_and_pulled_again(tmp_path: Path) -> None:
    """Force and dissipation at every named step; unloading is straight to the origin, and costs nothing."""
    data, _ = followed(tmp_path, "cyclic_pull.yaml", "mesh.maxh=2 mm")
    names = data["step_name"].values
    force = {str(n): 1e-3 * float(data["friction_resultant"][i]) for i, n in enumerate(names) if n}
    expected = {"pulled": 220.59121, "pushed": -110.29560, "pulled again": 220.59121, "let go": 40.107492}
    for name, value in expected.items():
        assert force[name] == pytest.approx(value, rel=6e-4), name
    spent = data["dissipated"].values
    assert spent[:6].sum() == pytest.approx(47.573517, rel=8e-4)
    assert np.all(spent[6:9] <= 1e-12)
    assert np.all(np.abs(data["closure"].values) <= 1e-8 * spent.sum())


def test_what_is_rounding_reads_0(tmp_path: Path) -> None:
    """Pulled and brought back to nothing a strip carries nothing; its table says 0, not 1e-13 kN."""
    steps = "history.steps=[{boundary.right.u_x: 0.5 mm, name: pulled}, {boundary.right.u_x: 0 mm, name: back}]"
    data, said = followed(tmp_path, "cyclic_pull.yaml", "mesh.maxh=10 mm", steps)
    row = next(line.split() for line in said.splitlines() if line.split()[:1] == ["back"])
    assert row[2:8] == ["0", "0", "0", "0", "0", "–"]
    assert float(data["friction_resultant"][-1]) != 0.0
