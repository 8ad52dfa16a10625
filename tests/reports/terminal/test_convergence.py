"""The convergence file and what is read back from it: tables, marks of failed points, the plot."""

import json

import netCDF4
import numpy as np
import pytest

from tcstudy.data.files import StoreError
from tcstudy.data.measured import Convergence, ErrorSeries, NumberSeries, PointConvergence, write_convergence
from tcstudy.data.provenance import Provenance
from tcstudy.data.records import PointStatus
from tcstudy.data.store import open_results
from tcstudy.errors import DrawError
from tcstudy.read.study import read_study_text
from tcstudy.reports.figures import style
from tcstudy.reports.figures.draw import Wanted, picture
from tcstudy.reports.terminal.convergence import _fixed, _uncertain, convergence_report
from tests.reports.figures.draw_cases import LOOKS, off_the_page

STUDY = read_study_text("""\
title: Made-up errors
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, right: free, top: free, left: clamped}
material: {E: 1 GPa, nu: 0.25}
friction: {law: tresca, tau: 1 MPa}
mesh: {maxh: 0.5, levels: 4}
sweep: {tau: [1 MPa, 2 MPa]}
""")
H = 0.5 ** np.arange(4)
NAN = float("nan")


def series(order, verdict="as_expected"):
    error = 0.3 * H**order
    return ErrorSeries(error, 2.0, np.array([NAN, order, order, order]), order, 0.01, 0, verdict, order, "smooth")


def point(index, status):
    energy = NumberSeries(5 + H, np.array([NAN, NAN, 1, 1]), 5.0, 0.01, 1.0, NAN)
    errors = {"u_H1": series(1.0), "u_L2": series(2.0, "slower"), "xi_max": series(0.5, "pre_asymptotic")}
    return PointConvergence(index, status, errors, {"energy": energy})


OK, FAILED = PointStatus.OK, PointStatus.INCLUSION_VIOLATED


@pytest.fixture
def file(tmp_path):
    points = (point((0,), (OK,) * 4), point((1,), (OK, FAILED, OK, OK)))
    numbers = np.arange(4, dtype=np.int32)
    what = Convergence(
        H, 10 * numbers, numbers, "level 9, the finest (more)", np.ones(4, dtype=bool), points, ("Mind it.",)
    )
    write_convergence(tmp_path / "a.nc", STUDY, what, Provenance("now", (("python", "3"),), "abc"))
    return tmp_path / "a.nc"


def test_the_file(file):
    with open_results(file) as tree:
        data = tree.to_dataset().load()
    assert data["error_u_L2"].dims == ("tau", "level")
    np.testing.assert_allclose(data["error_u_L2"].values, [0.3 * H**2] * 2)
    assert data["size_squared_u_L2"].attrs["units"] == "m4"
    assert data["size_squared_u_L2"].values.tolist() == [4.0, 4.0]
    assert data["slope_xi_max"].values.tolist() == [0.5, 0.5]
    assert data["verdict_u_L2"].dtype == np.int8
    flags = dict(
        zip(data["verdict_u_L2"].attrs["flag_values"], data["verdict_u_L2"].attrs["flag_meanings"].split(), strict=True)
    )
    assert flags[int(data["verdict_u_L2"][0])] == "slower"
    assert data["status"].values.tolist() == [[1] * 4, [1, 3, 1, 1]]
    assert data["tau"].attrs["units"] == "Pa"
    assert data["value_energy"].attrs["units"] == "J m-1"
    assert data.attrs["Conventions"] == "CF-1.11"
    assert json.loads(data.attrs["versions"]) == {"python": "3"}
    for variable in data.variables.values():
        assert variable.attrs["long_name"]
        assert ("units" in variable.attrs) == (variable.dtype.kind in "fi")


def test_the_tables(file):
    text = convergence_report(file)
    assert "reference: level 9, the finest" in text
    assert "3.000e-01" in text
    assert "(1.500e-01)" in text  # did not converge
    assert text.count("(1.500e-01)") == 1
    assert "PRE-ASYMPTOTIC" in text
    assert "SLOWER" in text
    assert "1.000 ± 0.01" in text
    assert "5.000 ± 0.01" in text
    assert "Note: Mind it." in text
    assert "tau = 1 MPa" in text
    assert convergence_report(file, "markdown").count("0.50") == text.count("0.50")


def test_the_plot(file, tmp_path, monkeypatch):
    """Failed levels are hollow and joined to nothing; the rate of two levels is pale and dashed."""
    drawn = []
    monkeypatch.setattr(style, "save", lambda figure, *_: drawn.append(figure))
    assert "tau = 2" in picture(file, tmp_path / "a.svg", Wanted({"tau": "2 MPa"}))
    with pytest.raises(DrawError, match="no point"):
        picture(file, tmp_path / "b.svg", Wanted({"tau": "3 MPa"}))
    axes = next(axes for axes in drawn[0].axes if axes.get_title(loc="left").startswith("u:"))
    solid, hollow, *_ = axes.get_lines()
    assert hollow.get_fillstyle() == "none"
    assert hollow.get_xdata().tolist() == [0.5]
    assert solid.get_xdata().tolist() == [1.0, 0.25, 0.125]
    assert {one.get_ylabel() for one in drawn[0].axes} == {"relative error"}
    assert axes.get_xlim()[0] < 0.75 * min(H)
    with netCDF4.Dataset(file, "a") as nc:
        nc["slope_error_u_L2"][...] = np.nan
    picture(file, tmp_path / "a.svg")
    pale = [line for axes in drawn[1].axes for line in axes.get_lines() if line.get_alpha() == 0.45]
    assert [line.get_linestyle() for line in pale] == ["--"]


def test_nothing_to_draw(tmp_path):
    points = tuple(PointConvergence((i,), (OK,) * 4, {}, point((i,), (OK,) * 4).numbers) for i in range(2))
    what = Convergence(H, np.zeros(4, np.int32), np.zeros(4, np.int32), "none", np.zeros(4, bool), points, ())
    write_convergence(tmp_path / "a.nc", STUDY, what, Provenance("now", (), "abc"))
    assert "energy" in convergence_report(tmp_path / "a.nc")
    with pytest.raises(DrawError, match="no errors"):
        picture(tmp_path / "a.nc", tmp_path / "a.png")


def test_bad_places(tmp_path):
    with pytest.raises(StoreError, match="no file"):
        convergence_report(tmp_path / "missing.nc")
    (tmp_path / "file").write_text("")
    points = (point((0,), (OK,) * 4), point((1,), (OK,) * 4))
    what = Convergence(H, np.zeros(4, np.int32), np.zeros(4, np.int32), "none", np.zeros(4, bool), points, ())
    with pytest.raises(StoreError, match="cannot write"):
        write_convergence(tmp_path / "file" / "a.nc", STUDY, what, Provenance("now", (), "abc"))


@pytest.mark.parametrize("look", LOOKS)
def test_every_text_stays_on_a_page_of_any_size(file, tmp_path, look, monkeypatch):
    drawn = []
    monkeypatch.setattr(style, "save", lambda figure, *_: drawn.append(figure))
    picture(file, tmp_path / "a.png", Wanted({"tau": "2 MPa"}, size=look.size))
    assert off_the_page(drawn[0]) == []


@pytest.mark.parametrize(
    ("value", "uncertainty", "shown"),
    [
        (-4.2e-17, 0.083, "0 ± 0.083"),
        (0.0, 0.083, "0 ± 0.083"),
        (0.0, 0.0, "0"),
        (-0.004, 0.5, "0.00 ± 0.50"),  # no minus before a zero
        (1.0, 0.01, "1.000 ± 0.010"),
    ],
)
def test_rounding_of_zero_is_zero(value, uncertainty, shown):
    assert _uncertain(value, uncertainty) == shown
    assert _fixed(-1e-4) == "0.00"
