"""The convergence file and what is read back from it: tables, marks of failed points, the plot."""

import netCDF4
import numpy as np
import pytest

from tcstudy.data.files import collect
from tcstudy.data.schema import PointStatus
from tcstudy.data.store import write_record
from tcstudy.data.tables import VERDICTS, convergence_record
from tcstudy.errors import DrawError
from tcstudy.pictures import draw_picture
from tcstudy.read.study import read_study_text
from tcstudy.reports.figures import style
from tcstudy.reports.terminal.accuracy import _uncertain
from tcstudy.reports.terminal.summary import text_of, verdict_of

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


def series(name, order, verdict="as_expected"):
    parts = {
        "error": 0.3 * H**order,
        "size_squared": 4.0,
        "rate": np.array([NAN, order, order, order]),
        "slope": order,
    }
    parts |= {
        "slope_error": 0.01,
        "first_level": 0,
        "verdict": VERDICTS.index(verdict),
        "expected": order,
    }
    return {f"{part}_{name}": value for part, value in (parts | {"reason": "smooth"}).items()}


def numbers(status):
    parts = {"value": 5 + H, "limit": 5.0, "uncertainty": 0.01, "limit_order": 1.0, "exact": NAN}
    return {
        "status": np.array(status),
        "reason": np.array(["" if one == PointStatus.OK else "why it failed" for one in status]),
        **{f"{part}_energy": value for part, value in parts.items()},
    }


def point(status):
    errors = (
        series("u_H1", 1.0)
        | series("u_L2", 2.0, "slower")
        | series("xi_max", 0.5, "pre_asymptotic")
    )
    return numbers(status) | errors


def write(path, points, reference="none", notes=(), counts=np.zeros(4, np.int32)):  # noqa: B008
    meshes = {
        "h_max": H,
        "n_dof": 10 * counts,
        "n_contact": counts,
        "compared": np.ones(4, dtype=bool),
    }
    record = convergence_record(STUDY, [meshes | one for one in points], reference, notes)
    write_record(path, STUDY, record, collect(STUDY, ["tcstudy"]))


OK, FAILED = PointStatus.OK, PointStatus.INCLUSION_VIOLATED


@pytest.fixture
def file(tmp_path):
    points = [point((OK,) * 4), point((OK, FAILED, OK, OK))]
    write(
        tmp_path / "a.nc",
        points,
        "level 9, the finest (more)",
        ["Mind it."],
        np.arange(4, dtype=np.int32),
    )
    return tmp_path / "a.nc"


def test_the_tables(file):
    text = text_of(file, True)
    for words in ("reference: level 9, the finest", "3.000e-01", "PRE-ASYMPTOTIC", "SLOWER", "1.000 ± 0.01",
                  "5.000 ± 0.01", "Note: Mind it.", "tau = 1 MPa"):  # fmt: skip
        assert words in text
    assert text.count("(1.500e-01)") == 1  # did not converge
    assert (
        _uncertain(-4.2e-17, 0.083) == "0 ± 0.083"
    )  # no minus before a zero, no digits of rounding


def test_a_failed_level_comes_first_with_its_reason(file):
    """Orders of two points with three errors each; one of six is pre-asymptotic twice."""
    verdict = verdict_of(file)
    text = verdict.sentence
    assert text.startswith("7 of 8 solutions (2 points, 4 levels). 1 solution failed: inclusion")
    assert "why it failed" in text
    assert "2 of 6 orders are as expected or better; 2 slower than expected: u in L²" in text
    assert "no reference" not in text
    assert not verdict.complete
    lines = [line[2:12].strip() for line in text_of(file).split("\n\n")[1].split("\n")]
    assert [label for label in lines if label] == [
        "Solved",
        "Reason",
        "Answer",
        "Trust",
        "Accuracy",
    ]


def test_limits_need_three_levels(tmp_path):
    """Without a reference no order is measured, and the page says nothing else."""
    none = {"limit_energy": NAN, "uncertainty_energy": NAN}
    write(tmp_path / "a.nc", [numbers((OK,) * 4) | none] * 2)
    verdict = verdict_of(tmp_path / "a.nc")
    text = verdict.sentence
    assert text.startswith("No order is measured: there is no reference.")
    assert "no limits h → 0: they need 3 solved levels" in text.lower()
    assert text.endswith("8 of 8 solutions (2 points, 4 levels).")
    assert verdict.complete


def test_the_plot(file, tmp_path, monkeypatch):
    """Failed levels are hollow and joined to nothing; the rate of two levels is pale and dashed."""
    drawn = []
    monkeypatch.setattr(style, "save", lambda figure, *_: drawn.append(figure))
    assert "tau = 2" in draw_picture(file, tmp_path / "a.svg", at={"tau": "2 MPa"})
    with pytest.raises(DrawError, match="no point"):
        draw_picture(file, tmp_path / "b.svg", at={"tau": "3 MPa"})
    axes = next(axes for axes in drawn[0].axes if axes.get_title(loc="left").startswith("u:"))
    solid, hollow, *_ = axes.get_lines()
    assert (hollow.get_fillstyle(), hollow.get_xdata().tolist()) == ("none", [0.5])
    assert solid.get_xdata().tolist() == [1.0, 0.25, 0.125]
    with netCDF4.Dataset(file, "a") as nc:
        nc["slope_error_u_L2"][...] = np.nan
    draw_picture(file, tmp_path / "a.svg")
    pale = [line for axes in drawn[1].axes for line in axes.get_lines() if line.get_alpha() == 0.45]
    assert [line.get_linestyle() for line in pale] == ["--"]


def test_nothing_to_draw(tmp_path):
    write(tmp_path / "a.nc", [numbers((OK,) * 4)] * 2)
    assert "energy" in text_of(tmp_path / "a.nc", True)
    with pytest.raises(DrawError, match="no errors"):
        draw_picture(tmp_path / "a.nc", tmp_path / "a.png")
