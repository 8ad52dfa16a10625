"""Sweeps whose points are drawn or stand in a table: values, labels, what is refused."""

from pathlib import Path

import numpy as np
import pytest

from tcstudy.data.reading import places_in
from tcstudy.data.variables import sweep_points
from tcstudy.errors import StoreError, StudyError
from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Study
from tcstudy.study.append import merge_studies

BASE = """
body: {rectangle: {width: 2 m, height: 1 m}}
boundary: {bottom: contact, left: clamped, top: free, right: free}
material: {E: 1 GPa, nu: 0.3}
friction: {law: slip-weakening, tau_s: 2 MPa, tau_k: 1 MPa, delta: 1 mm}
mesh: {maxh: 0.5 m}
"""


def swept(text: str, source: Path | None = None) -> Study:
    return read_study_text(f"{BASE}sweep: {text}\n", "test", (), source)


def drawn(mode: str, points: int = 8, seed: int = 7) -> Study:
    said = f"tau_s: {{lognormal: {{median: 2 MPa, sigma: 0.1}}}}, nu: {{choice: [0.2, 0.3]}}, points: {points}"
    return swept(f"{{mode: {mode}, seed: {seed}, {said}}}")


def test_drawn_points_are_a_list_whose_coordinates_know_their_distribution() -> None:
    study = drawn("latin-hypercube")
    assert (study.mode, study.shape) == ("list", (8,))
    tau, nu = study.axes
    assert [float(scene.friction.interval(0.0)[1]) for scene in study.scenes] == list(tau.labels)
    assert ([scene.material.nu for scene in study.scenes], {*nu.labels}) == (
        list(nu.labels),
        {0.2, 0.3},
    )
    data = sweep_points(study)
    assert data["tau_s"].attrs["distribution"] == "lognormal(median=2000000, sigma=0.1)"
    assert (data["nu"].attrs["distribution"], data["tau_s"].attrs["units"]) == (
        "choice(0.2, 0.3)",
        "Pa",
    )
    named = "friction: {a: {law: tresca, tau: 1 MPa}, b: {law: tresca, tau: 2 MPa}}"
    laws = swept(f"{{mode: random, points: 6, {named}, nu: {{uniform: [0, 0.4]}}}}")
    assert ({*laws.axes[0].labels}, laws.axes[0].distribution) == ({"a", "b"}, "choice(a, b)")


def test_a_design_grows_by_its_own_points_only() -> None:
    old, new = drawn("sobol"), drawn("sobol", 16)
    assert merge_studies(old, new) is new
    assert places_in(new, old).tolist() == list(range(8))
    with pytest.raises(StoreError, match="not the first of this design; keep mode, seed"):
        merge_studies(old, drawn("sobol", 16, seed=8))


OF_TWO = "E: {normal: {mean: 2 GPa, sigma: 1 MPa}}, tau_s: {normal: {mean: 2 MPa, sigma: 1 kPa}}, points: "


def test_drawn_numbers_are_correlated_by_pairs() -> None:
    study = swept(f'{{mode: sobol, {OF_TWO}500, correlation: {{"tau_s, material.E": -0.7}}}}')
    assert np.corrcoef([axis.labels for axis in study.axes])[0, 1] == pytest.approx(-0.7, abs=0.02)


def test_points_stand_in_a_table_and_then_in_the_study(tmp_path: Path) -> None:
    table = "\N{BYTE ORDER MARK}E [GPa], friction.delta [um],boundary.top.pressure\n# measured\n1,500,0\n\n"
    (tmp_path / "points.csv").write_text(table + '2e0, 700,"1 MPa"\n', encoding="utf-8")
    text = (
        BASE.replace("top: free", "top: {role: traction, g: [0, 0]}")
        + "sweep: {points: points.csv}\n"
    )
    study = read_study_text(text, "test", ("sweep.points=points.csv",), tmp_path / "study.yaml")
    labels = [axis.labels for axis in study.axes]
    assert (study.mode, labels) == ("list", [(1e9, 2e9), (5e-4, 7e-4), (0.0, 1e6)])
    again = read_study_text(study.text, "elsewhere", study.overrides)
    assert ([axis.labels for axis in again.axes], list(again.scenes)) == (
        labels,
        list(study.scenes),
    )


@pytest.mark.parametrize(
    ("table", "what"),
    [
        ("E [GPa],nu\n1,0.2\n2\n", "points.csv:3:1: has 1 entries, but the header 2"),
        ("E [GPa],nu\n1,\n", "points.csv:2:3: sweep.nu: is empty"),
        (
            "E [GPa],nu\n1,0.7\n",
            "points.csv:2:3: sweep.nu: must lie between -1 and 0.5, but is 0.7; write",
        ),
        ("E [GPa],nu\n1 MPa,0.2\n", "points.csv:2:1: sweep.E: '1 MPa' has a unit beside"),
        ("E [m],nu\n1,0.2\n", "points.csv:1:1: E: 'm' is not a unit of a stress"),
        ("E,  nuu\n1,0.2\n", "points.csv:1:5: the study has no parameter 'nuu'"),
        ("E;nu\n1;0.2\n", "points.csv:1:1: columns are separated by semicolons; write commas"),
        (
            "E,nu\n1,0.2\n2,0.2\n1.0,0.2\n",
            "points.csv:4:1: sweep.E: the point of the value 1.0 is repeated",
        ),
        ("E,E\n1,2\n", "points.csv:1:3: the heading 'E' stands twice"),
        (
            "friction\nsoft\n",
            "points.csv:2:1: sweep.friction: must be a mapping, but is the text 'soft'",
        ),
        ('E,nu\n"1,0.2\n', "points.csv:2:1: a quote is not"),
        ("E,nu\n", "points.csv has no data"),
        ("E,material.E\n1,2\n", "points.csv:1:3: sweeps the same parameter as 'E'"),
    ],
)
def test_every_fault_of_a_table_has_its_line_and_column(
    tmp_path: Path, table: str, what: str
) -> None:
    (tmp_path / "points.csv").write_text(table, encoding="utf-8")
    with pytest.raises(StudyError) as caught:
        swept("{points: points.csv}", tmp_path / "study.yaml")
    assert what in str(caught.value)
    assert len(caught.value.problems) == 1
