"""The section `exact`: read into its record, faults with their place."""

import pytest

from tcstudy.errors import StudyError
from tcstudy.expressions.expression import parse
from tcstudy.read.study import read_study_text
from tcstudy.scene.study import Exact

TEXT = """\
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, right: free, top: free, left: clamped}
material: {E: 100, nu: 0.25}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.5}
"""


def test_read():
    study = read_study_text(TEXT + 'exact: {u: ["0.1*x", 0], theta: 3, xi: "2*x", exponent: 1.5}')
    assert study.exact == Exact((parse("0.1*x"), 0.0), 3.0, parse("2*x"), 1.5)
    assert read_study_text(TEXT).exact is None
    assert read_study_text(TEXT + "exact: {u: [0, 0]}").exact == Exact((0.0, 0.0))


@pytest.mark.parametrize(
    ("section", "where", "what"),
    [
        ("{theta: 1}", "7:8: exact.u", "is missing"),
        ("{u: [0]}", "7:12: exact.u", "pair"),
        ('{u: ["z", 0]}', "7:13: exact.u[0]", "unknown name 'z'"),
        ('{u: ["1/(x-1)", 0]}', "exact.u", "no finite value"),
        ("{u: [0, 0], exponent: 0}", "7:30: exact.exponent", "greater than 0"),
        ("{u: [0, 0], tetha: 0}", "7:20: exact.tetha", "unknown key"),
    ],
)
def test_faults(section, where, what):
    with pytest.raises(StudyError) as caught:
        read_study_text(TEXT + f"exact: {section}", "a.yaml")
    assert where in str(caught.value)
    assert what in str(caught.value)


def test_units():
    si = TEXT.replace("units: none\n", "").replace("E: 100", "E: 1 GPa").replace("tau: 1", "tau: 1 MPa")
    study = read_study_text(si + "exact: {u: [2 mm, 0], xi: 3 MPa}")
    assert study.exact == Exact((0.002, 0.0), None, 3e6)
    with pytest.raises(StudyError, match="a length"):
        read_study_text(si + "exact: {u: [2 K, 0]}")
