"""What cannot be fitted: each fault with its place and a remedy, before any work."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tcstudy.errors import FitError, StudyError
from tcstudy.read.study import read_study_text
from tcstudy.study.fit import fit
from tests.study.test_fit import HEATED, heated, pulled, study_of

REFUSED = {
    ("T [K],u", "T,u"): "the heading 'T' has no unit; write T [K]",
    ("u [um]", "u [K]"): "'K' is not a unit of a length",
    ("0.5 um", "-1 um"): "fit.noise.u_T_max: must be above 0",
    ('"R [kN/m]"', '"Q [kN/m]"'): "the table has no column 'Q [kN/m]'",
    ('u_T_max: "u', 'u_Tmax: "u'): "'u_Tmax' is neither a result nor a parameter of the load; did you mean 'u_T_max'",
    ("friction.tau:", "body.rectangle.width:"): "it moves the mesh",
    (
        "alpha_T: {start: 8e-6 1/K, within: [1e-6 1/K, 1e-4 1/K]",
        "nu: {start: 0.3, within: [0, 0.6]",
    ): "between -1 and 0.5",
    ("start: 2 MPa", "start: 40 MPa"): "lies outside within",
    ("[0.2 MPa, 20 MPa]", "[-1 MPa, 20 MPa]"): "friction.tau = -1e+06: must be at least 0",
    ("mesh: {maxh: 20 mm}", "mesh: {maxh: 20 mm}\nsweep: {tau: [1 MPa, 2 MPa]}"): "but the study has a sweep",
    ("  noise", "  compare: orthogonal\n  noise"): "distances to a path need two columns",
    ("file: heated.csv", "file: warmed.csv"): "name a CSV table beside the study",
    ("\n20.000000,", "\n1e999,"): "heated.csv:2:1: 1e999 K is too large for a number",
    ("T [K],u [um],R [kN/m]\n", ""): "heated.csv:1:1: the table has no headings",
    ("T [K],u [um],R", "T [K];u [um];R"): "heated.csv:1:1: columns are separated by semicolons; write commas",
    (",", ",5,"): "has 5 entries, but the header 3, and 11 other lines likewise",
}


@pytest.mark.parametrize(("change", "said"), REFUSED.items(), ids=[said[:40] for said in REFUSED.values()])
def test_what_cannot_be_fitted_is_refused(tmp_path: Path, change: tuple[str, str], said: str) -> None:
    heated(tmp_path)
    old, new = change
    table = tmp_path / "heated.csv"
    data = table.read_text(encoding="utf-8")
    assert old in HEATED or old in data
    head, _, rows = data.partition("\n")
    data = head + "\n" + rows.replace(old, new) if old == "," else data.replace(old, new, 1)
    table.write_text("\N{BYTE ORDER MARK}" + data.replace("\n", "\r\n"), encoding="utf-8")
    text = HEATED if old == "," else HEATED.replace(old, new, 1)
    if old == "T [K],u":
        text = text.replace('theta: "T [K]"', 'theta: "T"')
    with pytest.raises(StudyError) as info:
        read_study_text(text, "heated.yaml", source=tmp_path / "heated.yaml")
    assert said in str(info.value)
    places = [(problem.line, problem.column) for problem in info.value.problems]
    assert len(set(places)) == len(places)


def test_data_of_a_path_in_no_order_and_laws_that_vary_along_the_line_are_refused(tmp_path: Path) -> None:
    """Feet on a path go forward with the data."""
    data = pulled(45)
    study_of(tmp_path, data[::-1])
    with pytest.raises(StudyError, match="the data jump to and fro"):
        study_of(tmp_path, np.random.default_rng(1).permutation(data))
    with pytest.raises(StudyError, match=r"fit.compare: a path takes one law, the same all along the contact line"):
        study_of(tmp_path, data, {"delta: 0.3 mm}": 'delta: 0.3 mm, strength: "1 + x"}'})


def test_numbers_that_nothing_depends_on_are_named(tmp_path: Path) -> None:
    text = HEATED.replace('u_T_max: "u [um]", friction_resultant: "R [kN/m]"', 'theta_mean: "T [K]"')
    text = text.replace('theta: "T [K]"', 'boundary.left.u_x: "u [um]"', 1).replace("  noise", "  # noise")
    with pytest.raises(FitError, match=r"do not depend on friction\.tau, alpha_T"):
        fit(heated(tmp_path, text))
