"""Exported fields as other programs open them: PyVista and xugrid; stresses against closed
forms."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.errors import DrawError
from tcstudy.reports.export import write_fields
from tcstudy.reports.picture import BodyFields, principal, recovered, stresses, von_mises
from tcstudy.scene.records import Material
from tests.reports.conftest import Stored

E, NU, ALPHA_T, THETA = 200e9, 0.3, 1e-5, 40.0
LAM, MU = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
STRAIN = Material(LAM, MU, (3 * LAM + 2 * MU) * ALPHA_T, 1.0, E, NU, "strain")
STRESS = Material(2 * LAM * MU / (LAM + 2 * MU), MU, E * ALPHA_T / (1 - NU), 1.0, E, NU, "stress")


def body(gradient: list[list[float]], theta: float) -> BodyFields:
    """Two triangles of either orientation with a linear displacement and one temperature."""
    xy = np.array([[0.0, 0.0], [3.0, 0.5], [2.0, 2.0], [-1.0, 1.0]])
    triangles = np.array([[0, 1, 2], [0, 3, 2]])
    return BodyFields(
        xy, triangles, xy @ np.array(gradient).T, np.full(4, theta), "K", np.zeros(2, dtype=np.int8)
    )


def test_stresses_of_closed_forms() -> None:
    sigma, energy = stresses(body([[1e-4, 0.0], [0.0, 0.0]], 0.0), STRAIN)  # uniaxial strain
    expected = [(LAM + 2 * MU) * 1e-4, LAM * 1e-4, LAM * 1e-4, 0.0, 0.0, 0.0]
    assert np.allclose(sigma, [expected, expected], rtol=1e-12, atol=1e-3)
    assert np.allclose(energy, 0.5 * (LAM + 2 * MU) * 1e-8, rtol=1e-12)
    sigma, energy = stresses(body([[0.0, 3e-4], [1e-4, 0.0]], 0.0), STRESS)  # shear and a rotation
    assert np.allclose(sigma[:, 3], MU * 4e-4, rtol=1e-12)
    assert np.allclose(energy, 0.5 * MU * 16e-8, rtol=1e-12)
    assert np.allclose(von_mises(sigma), np.sqrt(3.0) * MU * 4e-4, rtol=1e-12)
    # free expansion, and held across the plane alone
    free = ALPHA_T * THETA
    sigma, energy = stresses(body([[free, 0.0], [0.0, free]], THETA), STRESS)
    assert np.max(np.abs(sigma)) < 1e-12 * E * free
    assert np.max(np.abs(energy)) < 1e-12 * E * free**2
    plane = (1 + NU) * free
    sigma, energy = stresses(body([[plane, 0.0], [0.0, plane]], THETA), STRAIN)
    assert np.allclose(sigma[:, 2], -E * free, rtol=1e-12)
    assert np.max(np.abs(sigma[:, [0, 1, 3]])) < 1e-12 * E * free
    assert np.allclose(energy, 0.5 * E * free**2, rtol=1e-11)
    assert np.allclose(von_mises(sigma), E * free, rtol=1e-11)


def test_recovered_stresses_are_exact_where_they_are_constant_and_jump_between_materials() -> None:
    plate = body([[1e-4, 0.0], [0.0, 0.0]], 0.0)
    sigma, error = recovered(plate, STRAIN)
    assert np.allclose(sigma[0], stresses(plate, STRAIN)[0][0], rtol=1e-12)
    assert error < 1e-12
    assert np.allclose(principal(sigma[0], 1.0), (LAM + 2 * MU) * 1e-4, rtol=1e-12)
    assert np.allclose(principal(sigma[0], -1.0), LAM * 1e-4, rtol=1e-12)
    soft = replace(STRAIN, lam=LAM / 2, mu=MU / 2)
    two = replace(STRAIN, regions=(("soft", soft),))
    sigma, error = recovered(replace(plate, region=np.array([0, 1], dtype=np.int8)), two)
    assert np.allclose(sigma[0, [0, 1, 2], 0], (LAM + 2 * MU) * 1e-4, rtol=1e-12)
    assert np.allclose(sigma[1, [0, 3, 2], 0], (LAM + 2 * MU) / 2 * 1e-4, rtol=1e-12)
    assert error < 1e-12
    bent = replace(plate, u=plate.u + 1e-4 * np.array([[0, 0], [1, 0], [0, 0], [0, 0]]))
    sigma, error = recovered(bent, STRAIN)
    constant = stresses(bent, STRAIN)[0]
    area = np.array([2.5, 2.0])
    assert np.allclose(sigma[0, 0], area @ constant / area.sum(), rtol=1e-12)
    assert 0.01 < error < 1.0


def test_pyvista_opens_the_sweep(stored: Stored, tmp_path: Path) -> None:
    pyvista = pytest.importorskip(
        "pyvista", reason="PyVista, which reads the files as ParaView does, is not installed"
    )
    written = write_fields(stored("block"), tmp_path)
    assert (written.points, written.lacks) == (6, ())
    reader = pyvista.PVDReader(str(written.path))
    assert list(reader.time_values) == [0, 1, 2, 3, 4, 5]
    reader.set_active_time_value(3.0)
    solid, line = reader.read()
    with tcstudy.open_results(stored("block")) as tree:
        group = tree["level_1"].dataset.sel(theta_bar=10.0, friction="weak").load()
    assert (solid.field_data["theta_bar"][0], solid.field_data["friction"][0]) == (10.0, "weak")
    assert np.array_equal(
        solid["u"], np.column_stack([group["u_x"], group["u_y"], 0.0 * group["u_x"]])
    )
    assert np.array_equal(solid["theta"], group["theta"])
    assert all(np.array_equal(line[name], group[name]) for name in ("u_T", "xi"))
    assert line.n_lines == 1
    assert line.field_data["state_meanings"][0] == "0 stick, 1 slip, 2 soften, 3 drop, 4 weakened"
    assert np.array_equal(line["state"] == 0, group["sticks"] == 1)
    for name, unit in (("stress", "Pa"), ("energy_density", "J m-3")):
        array = solid.cell_data.GetArray(name)
        assert array.GetInformation().Get(type(array).UNITS_LABEL()) == unit
    area = np.asarray(solid.compute_cell_sizes()["Area"])
    assert area.sum() == pytest.approx(0.02)
    # the stresses do the virtual work of the known traction: for the interpolant w of (x y, 0),
    # which is zero on clamp and contact line, ∫ σ:ε(w) = ∫ σ_xx ∂w/∂x + σ_xy ∂w/∂y = 3 MPa · L · ½
    # H²
    corners, sigma = solid.points[solid.cells_dict[5]], solid["stress"]
    w = corners[..., 0] * corners[..., 1]
    corners[..., 2] = 1.0
    slope = np.linalg.solve(corners, w[..., None])[..., 0]
    work = np.sum(area * (sigma[:, 0] * slope[:, 0] + sigma[:, 3] * slope[:, 1]))
    assert work == pytest.approx(3e6 * 0.2 * 0.1**2 / 2, rel=1e-8)


@pytest.mark.filterwarnings(
    "ignore:numba is not installed", "ignore:No (standard_name|CRS)"
)  # those of maps
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_xugrid_opens_the_mesh_of_a_level(stored: Stored) -> None:
    xugrid = pytest.importorskip("xugrid", reason="xugrid, which reads UGRID, is not installed")
    with tcstudy.open_results(stored("block")) as tree:
        level = tree["level_1"].to_dataset()
        opened = xugrid.UgridDataset(level)
        grid = opened.grid
        assert (grid.name, grid.node_dimension, grid.face_dimension) == (
            "mesh",
            "mesh_node",
            "mesh_face",
        )
        assert np.array_equal(
            grid.node_coordinates, np.column_stack([level["node_x"], level["node_y"]])
        )
        assert np.sum(grid.area) == pytest.approx(0.02)
        assert opened["u_x"].sel(friction="weak", theta_bar=10.0).sizes == {
            "mesh_node": grid.n_node
        }


def test_without_fields_and_solutions_the_lines_are_written(stored: Stored, tmp_path: Path) -> None:
    written = write_fields(stored("listed"), tmp_path / "plate", {"alpha": 100})
    assert written.points == 1
    assert "output.fields=true" in written.lacks[0]
    names = [file.name for file in sorted((tmp_path / "plate").iterdir())]
    assert names == ["listed.pvd", "listed_0001_alpha-100_tau_s-9e+07.vtp"]
    failed = write_fields(stored("failed"), tmp_path / "failed", {"theta_bar": 20})
    assert (failed.points, failed.lacks) == (1, ("1 of 2 points have no solution on level 1",))
    with pytest.raises(DrawError, match="no level 7"):
        write_fields(stored("failed"), tmp_path / "plate", level=7)
    with pytest.raises(DrawError, match="theta_bar = 3"):
        write_fields(stored("failed"), tmp_path / "none", {"theta_bar": 3})
    assert not (tmp_path / "none").exists()


def test_openings_are_lines_of_their_own(stored: Stored, tmp_path: Path) -> None:
    written = write_fields(stored("arm"), tmp_path)
    collection = written.path.read_text(encoding="utf-8")
    assert 'part="2" name="openings" file="arm_0000_openings.vtp"' in collection
    text = (tmp_path / "arm_0000_openings.vtp").read_text(encoding="utf-8")
    assert all(f'Name="{name}"' in text for name in ("opening", "S_N", "c_N", "state"))
    meanings = "0 closed, 1 elastic, 2 softening, 3 open"
    assert " ".join(map(str, meanings.encode())) in text
    write_fields(stored("block"), tmp_path)
    assert not list(tmp_path.glob("block*openings*"))
