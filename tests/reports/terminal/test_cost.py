"""What is read from a file of accuracy against cost: the front, advice, tables and the chart."""

from pathlib import Path

import numpy as np
import pytest

from tcstudy.accuracy.orders import dominated
from tcstudy.data.files import collect
from tcstudy.data.reading import load_root
from tcstudy.data.records import Record
from tcstudy.data.schema import PointStatus
from tcstudy.data.store import write_record
from tcstudy.data.tables import COST_TABLE
from tcstudy.pictures import draw_picture
from tcstudy.reports.figures.accuracy import cost_panels
from tcstudy.reports.page.parts import Container
from tcstudy.reports.page.stored import read
from tcstudy.reports.page.write import cost_sections
from tcstudy.reports.terminal.accuracy import advice, front, settings
from tcstudy.reports.terminal.summary import text_of
from tests.verification.scenes import RECTANGLE, study_of

FAMILIES, SOLVERS = ("uniform", "graded"), ("separable-newton", "bundle-newton")
MEASURED = ("u_energy", "xi_L2")
N = np.array([[100, 400, 1600, 6400], [150, 600, 2400, 9600]])
ERROR = np.array([0.08, 0.04, 0.02, 0.01])
"""Uniform errors; graded ones start larger and fall twice as fast."""


def made(**more: object) -> Record:
    """Known curves: uniform e ~ t^−½ from 0.08 at 0.1 s, graded e ~ t^−1 from 0.16; the second
    solver takes twice."""
    error = np.broadcast_to(
        np.stack([ERROR, 2 * ERROR * [1, 0.5, 0.25, 0.125]])[:, None], (2, 2, 4)
    ).copy()
    fastest = np.array([0.1, 0.4, 1.6, 6.4]) * np.array([1.0, 2.0])[:, None] * np.ones((2, 1, 1))
    status = np.full((2, 2, 4), int(PointStatus.OK), dtype=np.int8)
    reason = np.full((2, 2, 4), "", dtype=object)
    status[1, 1, 3], reason[1, 1, 3] = PointStatus.NOT_CONVERGED, "it went on for ever"
    known = np.where(status == PointStatus.OK, fastest, np.nan)
    fields: dict[str, object] = {
        **{"family": FAMILIES, "solver": SOLVERS, "level": np.arange(4), "run": np.arange(3)},
        "h_max": np.array([[0.4, 0.2, 0.1, 0.05]] * 2),
        "n_dof": N.astype(np.int32),
        "n_contact": (N // 20).astype(np.int32),
        **{"status": status, "reason": reason},
        "time": fastest[..., None] * np.array([1.3, 1.0, 1.1]),
        "error_u_energy": error,
        "error_xi_L2": 2 * error,
        **{
            f"dominated_{name}": dominated(known.ravel(), error.ravel()).reshape(error.shape)
            for name in MEASURED
        },
    }
    told = {
        "reference": "the exact solution",
        "reference_error": 0.0,
        "point": "tau = 0.01",
        "notes": "Look twice.",
    }
    told |= {
        "own_family": FAMILIES[0],
        "own_solver": SOLVERS[0],
        "own_level": np.int32(3),
        "runs": np.int32(3),
    }
    return Record("cost", COST_TABLE, {**fields, **more}, told)


def write(path: Path, *changes: str, **more: object) -> Path:
    study = study_of(RECTANGLE, *changes)
    write_record(path, study, made(**more), collect(study, ["tcstudy"]))
    return path


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return write(tmp_path / "a.cost.nc")


def test_settings_and_front(file: Path) -> None:
    found = settings(load_root(file, "cost"), "u_energy")
    assert len(found) == 16
    own = next(s for s in found if s.own)
    assert (own.family, own.level, own.error) == ("uniform", 3, 0.01)
    assert (own.time, own.upper) == pytest.approx((6.4, 6.4 * 1.2))
    assert own.dominated
    # both come to 4 % in 0.4 s; before that uniform meshes err less, later graded ones
    assert [(s.family, s.level) for s in front(found)] == [
        ("uniform", 0), ("uniform", 1), ("graded", 1), ("graded", 2), ("graded", 3)
    ]  # fmt: skip
    assert {(s.family, s.solver) for s in front(found)} == {
        ("uniform", SOLVERS[0]),
        ("graded", SOLVERS[0]),
    }
    text = text_of(file)
    assert text.count("Wall time from the body") == 1
    assert all(
        words in text
        for words in ("tau = 0.01", "exact solution", "Look twice.", "9600", "6.4†", "1.6*")
    )
    assert "(2.000e-02)" not in text  # the first solver was solved there


def test_advice_names_what_is_faster_only_beyond_the_quartiles(file: Path) -> None:
    text = "; ".join(advice(settings(load_root(file, "cost"), "u_energy")))
    own = f"the study's mesh: error 1 % in 6.4 s (uniform, level 3, {SOLVERS[0]})"
    assert text.startswith(own)
    assert text.endswith("shortest time for errors of 8 to 4 %: uniform; 4 to 0.25 %: graded")
    assert "more accurate, no clear difference in time: graded, level 3: 0.25 % in 6.4 s" in text
    assert "faster and more accurate" not in text
    graded = np.array([1.0, 0.5])[:, None, None, None]
    write(file, time=made().values["time"] * graded)
    text = "; ".join(advice(settings(load_root(file, "cost"), "u_energy")))
    assert "faster and more accurate: graded, level 3: 0.25 % in 3.2 s" in text
    # the fastest run is, its quartile is not
    write(file, time=made().values["time"] * np.array([1.0, 0.95])[:, None, None, None])
    text = "; ".join(advice(settings(load_root(file, "cost"), "u_energy")))
    assert "more accurate, no clear difference in time: graded, level 3: 0.25 % in 6.1 s" in text
    assert "faster and more" not in text


def test_the_page_says_of_every_error_what_is_measured_of_it(file: Path) -> None:
    [chosen] = cost_sections(read(file), Container())[0]["parts"]
    told = {
        name: str(parts) for name, parts in zip(chosen["options"], chosen["parts"], strict=True)
    }
    assert "8 to 4 %: uniform" in told["u in energy"]
    assert "16 to 8 %: uniform" in told["ξ in L²(Γ_C)"]
    assert ("1.000e-02" in told["u in energy"], "1.000e-02" in told["ξ in L²(Γ_C)"]) == (
        True,
        False,
    )


def test_one_mesh_of_two_families_is_once_on_the_front(file: Path) -> None:
    """Its errors differ by rounding, which decides nothing; nor is either of its timings better
    than the other."""
    error = np.array([0.08, 0.08 * (1 - 1e-12), 0.04])
    assert dominated(np.array([0.10, 0.11, 0.4]), error).tolist() == [False, True, False]
    error, time = made().values["error_u_energy"].copy(), made().values["time"].copy()
    error[1, :, 3], time[1, :, 3] = error[0, :, 3] * (1 - 1e-12), 0.9 * time[0, :, 3]
    n, h = N.copy(), np.array([[0.4, 0.2, 0.1, 0.05]] * 2)
    n[1, 3] = n[0, 3]
    sizes = {"n_dof": n.astype(np.int32), "n_contact": (n // 20).astype(np.int32), "h_max": h}
    write(file, error_u_energy=error, time=time, **sizes)
    found = settings(load_root(file, "cost"), "u_energy")
    text = "; ".join(advice(found))
    assert f"error 1 % in 5.8 s (uniform, level 3, {SOLVERS[0]})" in text  # the runs of both
    assert "no other setting measured is both faster and more accurate" in text
    [own] = [s for s in found if s.own]
    assert (own.first, own.families) == (True, FAMILIES)
    assert not next(s for s in found if s.family == "graded" and s.level == 3).first
    assert "uniform, graded      3" in text_of(file)


def test_errors_that_are_rounding_are_not_ranked(file: Path) -> None:
    write(file, **{f"error_{name}": 1e-13 * made().values[f"error_{name}"] for name in MEASURED})
    first, second = advice(settings(load_root(file, "cost"), "u_energy"))
    assert first.startswith(
        "all errors are rounding (at most 1.6e-14): every mesh represents this solution exactly"
    )
    assert second == "shortest time measured: uniform, level 0, separable-newton in 0.1 s"
    draw_picture(file, file.with_name("a.svg"))


def test_estimates_and_proved_bounds_stand_beside_the_error_and_say_of_what(
    tmp_path: Path,
) -> None:
    error = made().values["error_u_energy"]
    guaranteed = {"error_u_estimate": 1.1 * error, "error_u_bound": 1.3 * error}
    file = write(tmp_path / "b.cost.nc", "mesh.guarantee=polygon", **guaranteed)
    text = text_of(file)
    (row,) = (line for line in text.splitlines() if "uniform      3" in line)
    assert row.split()[4:7] == ["1.000e-02", "1.100e-02", "1.300e-02"]
    of_polygon = "proved bound: of the relative error of u for the polygon that the mesh has"
    assert of_polygon in text
    panel = cost_panels(load_root(file), "u_energy")["unknowns"]
    bounds = [item.y for item in panel.items if item.look.get("linestyle") == "-." and item.y.size]
    assert np.array_equal(bounds, 1.3 * error[:, 0])
    assert of_polygon not in text_of(write(tmp_path / "c.cost.nc"))
