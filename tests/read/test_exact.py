"""The section `exact`: read into its record, faults with their place."""

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
