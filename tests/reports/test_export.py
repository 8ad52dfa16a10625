"""Exported files as other programs open them: PyVista and pandas; stresses against closed forms; memory of a table."""

from __future__ import annotations

import csv
import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.data.provenance import Provenance
from tcstudy.data.records import BlockRecord, PointStatus
from tcstudy.data.store import write
from tcstudy.errors import DrawError, UsageError
from tcstudy.reports.export_fields import stresses, von_mises, write_fields
from tcstudy.reports.export_table import write_csv, write_json
from tcstudy.reports.picture import BodyFields
from tcstudy.scene.contact_states import ContactState, node_states
from tcstudy.scene.laws import SHAPES
from tcstudy.scene.records import Material
from tcstudy.scene.study import Axis
from tests.reports.draw_cases import ALPHA, result, study

E, NU, ALPHA_T, THETA = 200e9, 0.3, 1e-5, 40.0
LAM, MU = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
STRAIN = Material(LAM, MU, (3 * LAM + 2 * MU) * ALPHA_T, 1.0, E, NU, "strain")
STRESS = Material(2 * LAM * MU / (LAM + 2 * MU), MU, E * ALPHA_T / (1 - NU), 1.0, E, NU, "stress")


def body(gradient: list[list[float]], theta: float) -> BodyFields:
    """Two triangles of either orientation with a linear displacement and one temperature."""
    x, y = np.array([0.0, 3.0, 2.0, -1.0]), np.array([0.0, 0.5, 2.0, 1.0])
    u = np.array(gradient) @ np.array([x, y])
    return BodyFields(x, y, np.array([[0, 1, 2], [0, 3, 2]]), u[0], u[1], np.full(4, theta), "K")


def test_stresses_of_closed_forms() -> None:
    sigma, energy = stresses(body([[1e-4, 0.0], [0.0, 0.0]], 0.0), STRAIN)  # uniaxial strain
    expected = [(LAM + 2 * MU) * 1e-4, LAM * 1e-4, LAM * 1e-4, 0.0, 0.0, 0.0]
    assert np.allclose(sigma, [expected, expected], rtol=1e-12, atol=1e-3)
    assert np.allclose(energy, 0.5 * (LAM + 2 * MU) * 1e-8, rtol=1e-12)
    sigma, energy = stresses(body([[0.0, 3e-4], [1e-4, 0.0]], 0.0), STRESS)  # shear and a rotation
    assert np.allclose(sigma[:, 3], MU * 4e-4, rtol=1e-12)
    assert np.allclose(energy, 0.5 * MU * 16e-8, rtol=1e-12)
    assert np.allclose(von_mises(sigma), np.sqrt(3.0) * MU * 4e-4, rtol=1e-12)


def test_stresses_of_free_expansion() -> None:
    free = ALPHA_T * THETA
    sigma, energy = stresses(body([[free, 0.0], [0.0, free]], THETA), STRESS)
    assert np.max(np.abs(sigma)) < 1e-12 * E * free
    assert np.max(np.abs(energy)) < 1e-12 * E * free**2
    plane = (1 + NU) * free
    sigma, energy = stresses(body([[plane, 0.0], [0.0, plane]], THETA), STRAIN)  # held across the plane alone
    assert np.allclose(sigma[:, 2], -E * free, rtol=1e-12)
    assert np.max(np.abs(sigma[:, [0, 1, 3]])) < 1e-12 * E * free
    assert np.allclose(energy, 0.5 * E * free**2, rtol=1e-11)
    assert np.allclose(von_mises(sigma), E * free, rtol=1e-11)


def test_states_of_nodes() -> None:
    law = SHAPES["saw-tooth"].build(tau=1.0, delta=1.0, teeth=2, drop=0.5, decay=0.9)
    kink = float(law.kinks[law.kinks > 0.0][0])
    stick, slip, _, drop, weakened = ContactState
    assert node_states(law, [0.0, 0.5, -0.5, kink, -kink, 1.5, -1.5], [1, 0, 0, 0, 0, 0, 0]).tolist() == [
        *(stick, slip, slip, drop, drop, weakened, weakened)
    ]
    smooth = SHAPES["exponential"].build(a=1.0, b=0.3, delta=0.5)
    assert node_states(smooth, [0.0, 0.2, -3.0], [1, 0, 0]).tolist() == [
        stick,
        ContactState.SOFTEN,
        ContactState.SOFTEN,
    ]
    assert node_states(SHAPES["linear"].build(k=1.0), [0.3], [0]).tolist() == [slip]


SECTIONS = {
    "body": {"rectangle": {"width": "200 mm", "height": "100 mm"}},
    "boundary": {
        "bottom": "contact",
        "left": "clamped",
        "top": {"role": "convection", "g": ["8 MPa", 0]},
        "right": "free",
    },
    "material": {"E": "210 GPa", "nu": 0.3, "k": 45, "alpha_T": 12e-6},
    "heat": {"alpha": 100, "theta_bar": "20 K"},
    "friction": {"law": "slip-weakening", "tau_s": "4 MPa", "tau_k": "1 MPa", "delta": "5 um"},
    "mesh": {"maxh": "50 mm", "levels": 2},
    "sweep": {"E": ["100 GPa", "210 GPa", "50 GPa"], "theta_bar": ["0 K", "40 K"]},
    "output": {"fields": True},
}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "block.nc"
    tcstudy.run(tcstudy.Study.from_dict(SECTIONS), path, jobs=1)
    return path


def test_pyvista_opens_the_sweep(run: Path, tmp_path: Path) -> None:
    pyvista = pytest.importorskip("pyvista", reason="PyVista, which reads the files as ParaView does, is not installed")
    written = write_fields(run, tmp_path)
    assert (written.points, written.lacks) == (6, ())
    reader = pyvista.PVDReader(str(written.path))
    assert list(reader.time_values) == [0, 1, 2, 3, 4, 5]
    reader.set_active_time_value(3.0)  # the file has E ascending: 100 GPa, 40 K
    solid, line = reader.read()
    with tcstudy.open_results(run) as tree:
        group = tree["level_1"].dataset.sel(E=100e9, theta_bar=40.0).load()
    assert (solid.field_data["E"][0], solid.field_data["theta_bar"][0]) == (100e9, 40.0)
    assert np.array_equal(solid["u"], np.column_stack([group["u_x"], group["u_y"], 0.0 * group["u_x"]]))
    assert np.array_equal(solid["theta"], group["theta"])
    assert np.array_equal(line["u_T"], group["u_T"])
    assert np.array_equal(line["xi"], group["xi"])
    assert line.n_lines == 1
    assert line.field_data["state_meanings"][0] == "0 stick, 1 slip, 2 soften, 3 drop, 4 weakened"
    assert np.array_equal(line["state"] == 0, group["sticks"] == 1)
    for name, unit in (("stress", "Pa"), ("energy_density", "J m-3")):
        array = solid.cell_data.GetArray(name)
        assert array.GetInformation().Get(type(array).UNITS_LABEL()) == unit
    area = solid.compute_cell_sizes()["Area"]
    assert area.sum() == pytest.approx(0.02)
    check_balance(solid, np.asarray(area))


def check_balance(solid: object, area: np.ndarray) -> None:
    """The stresses do the virtual work of the known traction: for w = (x y, 0), zero on clamp and contact line,

    ∫ σ:ε(w) = ∫ σ_xx y + σ_xy x = 8 MPa · H · ∫₀ᴸ x dx.
    """
    height, length, g = 0.1, 0.2, 8e6
    centre = solid.cell_centers().points  # type: ignore[attr-defined]
    sigma = solid["stress"]  # type: ignore[index]
    work = np.sum(area * (sigma[:, 0] * centre[:, 1] + sigma[:, 3] * centre[:, 0]))
    assert work == pytest.approx(g * height * length**2 / 2, rel=0.05)


@pytest.mark.filterwarnings("ignore:numba is not installed", "ignore:No (standard_name|CRS)")  # those of maps
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_xugrid_opens_the_mesh_of_a_level(run: Path) -> None:
    xugrid = pytest.importorskip("xugrid", reason="xugrid, which reads UGRID, is not installed")
    with tcstudy.open_results(run) as tree:
        level = tree["level_1"].to_dataset()
        opened = xugrid.UgridDataset(level)
        grid = opened.grid
        assert (grid.name, grid.node_dimension, grid.face_dimension) == ("mesh", "mesh_node", "mesh_face")
        assert np.array_equal(grid.node_coordinates, np.column_stack([level["node_x"], level["node_y"]]))
        assert np.sum(grid.area) == pytest.approx(0.02)
        assert opened["u_x"].sel(E=100e9, theta_bar=40.0).sizes == {"mesh_node": grid.n_node}
        assert all(level[name].attrs["location"] == "node" for name in ("theta", "u_x", "u_y"))


def test_without_fields_and_solutions_the_lines_are_written(tmp_path: Path) -> None:
    path = result(tmp_path / "plate.nc", fields=False)
    written = write_fields(path, tmp_path / "plate", {"alpha": 100})
    assert written.points == 1
    assert "output.fields=true" in written.lacks[0]
    assert "1 of 2 points have no solution on level 1" in written.lacks[1]
    assert [file.name for file in sorted((tmp_path / "plate").iterdir())] == [
        "plate.pvd",
        "plate_0002_alpha-100_friction-tresca.vtp",
    ]
    with pytest.raises(DrawError, match="no level 7"):
        write_fields(path, tmp_path / "plate", level=7)
    with pytest.raises(DrawError, match="alpha = 3"):
        write_fields(path, tmp_path / "none", {"alpha": 3})
    assert not (tmp_path / "none").exists()


def test_pandas_reads_the_table_to_the_bit(run: Path, tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    assert write_csv(run, tmp_path / "block.csv") == 12
    table = pandas.read_csv(tmp_path / "block.csv").set_index(["E [Pa]", "theta_bar [K]", "level"])
    with tcstudy.open_results(run) as tree:
        wanted = tree.dataset[["energy", "u_T_max", "iterations"]].to_dataframe()
    assert list(table.index) == list(wanted.index)
    assert np.array_equal(table["energy [J m-1]"], wanted["energy"])
    assert np.array_equal(table["u_T_max [m]"], wanted["u_T_max"])
    assert np.array_equal(table["iterations"], wanted["iterations"])
    assert set(table["status"]) == {"ok"}
    assert "start_energy.zero [J m-1]" in table
    assert write_json(run, tmp_path / "block.json", {"E": "100 GPa", "theta_bar": 0}) == 2
    found = json.loads((tmp_path / "block.json").read_text())
    assert found["units"]["energy"] == "J m-1"
    assert [row["level"] for row in found["rows"]] == [0, 1]
    assert found["rows"][1]["energy"] == wanted["energy"].loc[(100e9, 0.0, 1)]
    assert found["rows"][1]["heat_balance"] is None


def test_failed_points_and_lists_have_rows(listed: Path, grid: Path, tmp_path: Path) -> None:
    assert write_csv(listed, tmp_path / "list.csv", {"alpha": 25}) == 4
    with open(tmp_path / "list.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["tau [Pa]"] for row in rows] == ["1000000.0"] * 2 + ["20000000.0"] * 2
    write_csv(grid, tmp_path / "grid.csv")
    with open(tmp_path / "grid.csv", newline="") as stream:
        last = list(csv.DictReader(stream))[-1]
    assert (last["friction"], last["status"], last["slip_length [m]"]) == ("softening", "singular", "")
    assert last["reason"] == "the stiffness matrix is singular"


def test_tables_of_paths_and_charts(tmp_path: Path) -> None:
    sides = {"left": "free", "right": "free"}
    sections = {
        "units": "none",
        "body": {"rectangle": {"width": 2.0, "height": 1.0}},
        "boundary": {"bottom": "contact", "top": {"role": "clamped", "u_x": 0.3, "u_y": 0}} | sides,
        "material": {"E": 1.0, "nu": 0.3},
        "friction": {"law": "tresca", "tau": 0.1},
        "mesh": {"maxh": 0.6, "levels": 3},
        "path": {"parameter": "boundary.top.u_x", "from": 0, "to": 0.5},
    }  # fmt: skip
    along = tcstudy.path(tcstudy.Study.from_dict(sections), tmp_path / "path.nc")
    assert write_csv(tmp_path / "path.nc", tmp_path / "path.csv") == along.sizes["vertex"]
    errors = tcstudy.converge(tcstudy.Study.from_dict(sections), tmp_path / "errors.nc")
    assert write_csv(tmp_path / "errors.nc", tmp_path / "errors.csv") == errors.sizes["level"]
    for call in (write_csv, write_fields):
        with pytest.raises(UsageError, match=r"--at|--vtu"):
            call(tmp_path / "path.nc", tmp_path / "none.csv", {"alpha": 1})


def test_a_long_table_takes_little_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All rows at once would be 8 MB of Python's numbers."""
    n = 3_000
    monkeypatch.setattr("tcstudy.reports.export_table.VALUES", 2**14)
    axis = Axis("alpha", ("heat", "alpha"), tuple(range(n)), tuple(map(float, range(n))), ALPHA.units)
    plan = study("grid", (axis,))
    numbers = {"u_T_max": np.arange(n) / 7.0, "energy": -np.arange(n) / 3.0}
    none = {"u_T": None, "xi": None, "sticks": None}
    block = BlockRecord(0, 0, plan.shape, np.arange(n), np.full(n, PointStatus.OK, dtype=np.int8), {}, numbers, **none)
    write(tmp_path / "long.nc", plan, (), [block], Provenance("now", (), "abc"))
    tracemalloc.start()
    assert write_csv(tmp_path / "long.nc", tmp_path / "long.csv") == 2 * n
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 4e6
    with open(tmp_path / "long.csv") as stream:
        assert sum(1 for _ in stream) == 2 * n + 1
