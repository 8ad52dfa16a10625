"""Convergence, cost and paths of studies that sweep the body: every geometry against its own study."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.cli import main
from tcstudy.data.records import PointStatus
from tcstudy.errors import GeometryFailed
from tcstudy.read.study import read_study_text
from tcstudy.reports.terminal.summary import text_of
from tests.study.test_variants import BAR, HOLED

CHOSEN = """
units: none
parameters: {H: 1}
body: {rectangle: {width: 1, height: H}}
boundary: {bottom: contact, top: clamped, left: {role: traction}, right: {role: traction}}
material: {lambda: 1.5, mu: 1}
friction: {law: slip-weakening, tau_s: 1, tau_k: 0.4, delta: 1}
mesh: {maxh: 0.5, levels: 3}
sweep: {lambda: [1.5, 3], parameters.H: [1, 0.5]}
exact: {u: ["y + (1 - 0.6*y)*(0.3 + 0.2*sin(pi*x))", "0.1*y*cos(pi*x)"], loads: derived}
"""


def test_convergence_of_every_geometry_is_that_of_its_own_study(tmp_path: Path) -> None:
    """Against the chosen solution, also where a geometry has none; the tables tell them apart."""
    tree = tcstudy.converge(read_study_text(CHOSEN), tmp_path / "all.nc")
    data = tree.to_dataset()
    assert data["h_max"].dims == ("H", "level")
    assert np.all((data["slope_u_energy"] > 0.9) & (data["slope_u_energy"] < 1.1))
    for height in (1.0, 0.5):
        changes = [f"parameters.H={height}", "sweep={lambda: [1.5, 3]}"]
        one = tcstudy.converge(read_study_text(CHOSEN, "s", changes), tmp_path / f"{height}.nc").to_dataset()
        for name in ("h_max", "n_dof", "error_u_energy", "rate_xi_L2", "limit_energy"):
            assert np.array_equal(data[name].sel(H=height), one[name], equal_nan=True), (name, height)
    told = text_of(tmp_path / "all.nc")
    rows = [line.split() for line in told.splitlines()]
    sizes = [int(data["n_dof"].sel(H=height, level=2)) for height in (1.0, 0.5)]
    assert [int(row[3]) for row in rows if len(row) == 5 and row[1] == "2"] == sizes
    listed = "sweep={mode: list, points: [{parameters.height: 10 mm}, {parameters.height: 20 mm}]}"
    lost = tcstudy.converge(read_study_text(HOLED, "s", ["mesh.levels=2", listed]), tmp_path / "lost.nc").to_dataset()
    assert lost["status"].values.tolist() == [[PointStatus.MESH_FAILED] * 2, [PointStatus.OK] * 2]
    assert np.isnan(lost["h_max"].values).tolist() == [[True, True], [False, False]]
    assert lost.attrs["notes"].startswith("refused, parameters.height = 10 mm: body.holes[0]: ")
    picture, page = tmp_path / "p.png", tmp_path / "p.html"
    tcstudy.draw(tmp_path / "all.nc", picture, at={"H": 0.5})
    tcstudy.report(tmp_path / "lost.nc", page)
    assert picture.exists()
    assert page.exists()


def test_cost_and_path_are_of_one_geometry(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Cost of that of its point, or refused with the reason; a path of the body outside the sweep."""
    study = read_study_text(CHOSEN)
    data = tcstudy.cost(study, tmp_path / "cost.nc", at={"H": 0.5}).to_dataset()
    own = data.sel(family="uniform").isel(level=slice(3))
    alone = tcstudy.converge(read_study_text(CHOSEN, "s", ["parameters.H=0.5", "sweep=null"]), tmp_path / "one.nc")
    assert np.array_equal(own["n_dof"], alone["n_dof"])
    assert "H = 0.5" in data.attrs["point"]
    with pytest.raises(GeometryFailed, match=r"the hole touches .*; name another geometry by --at"):
        tcstudy.cost(read_study_text(HOLED), tmp_path / "no.nc")
    along = BAR + "path: {parameter: boundary.right.g_x, from: 0 Pa, to: 1 MPa}\n"
    along = along.replace("law: linear, k: 0", "law: tresca, tau: 10 kPa")
    found = tcstudy.run(read_study_text(along), tmp_path / "path.nc").to_dataset()
    alone = tcstudy.run(read_study_text(along, "s", ["sweep=null"]), tmp_path / "alone.nc").to_dataset()
    assert float(found["x"].max()) == 0.2
    assert np.array_equal(found["u_T"], alone["u_T"])
    file = tmp_path / "along.yaml"
    file.write_text(along)
    assert main(["run", str(file), "--output", str(tmp_path / "path.nc")]) == 0
    said = "".join(capsys.readouterr())
    assert "the values of width, E are not used" in said
    assert "holds these results already" in said
