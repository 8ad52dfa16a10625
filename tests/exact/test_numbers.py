"""Where stick turns into slip on a chosen solution."""

import pytest

from tcstudy.exact.solution import exact_slip_length
from tcstudy.read.study import read_study_text


@pytest.mark.parametrize(
    ("u_x", "law", "expected"),
    [
        ("max(0, x - 0.3)", "{law: tresca, tau: 1}", 0.7),
        ("max(0, 0.2 - x) - max(0, x - 0.3)", "{law: tresca, tau: 1}", 0.9),
        ("x - 0.25", "{law: tresca, tau: 1}", 1.0),  # passes 0 at one point
        ("0*x", "{law: tresca, tau: 1}", 0.0),
        ("0*x", "{law: linear, k: 1}", 1.0),  # a law without a jump never sticks
        (
            "0.1 + max(0, x - 0.5)",
            "{law: piecewise-linear, points: [[0, 1], [0.1, 1], [0.1, 2]], odd: true}",
            0.5,
        ),
        (
            "0.1 + max(0, x - 0.5)",
            "{law: piecewise-linear, points: [[0, 2], [0.1, 2], [0.1, 1]], odd: true}",
            1.0,
        ),
    ],
)
def test_slip_length_by_hand(u_x: str, law: str, expected: float) -> None:
    """Sticking is resting on an up-jump of b, at 0 or elsewhere; a down-jump does not hold."""
    study = read_study_text(
        "units: none\nbody: {rectangle: {width: 1, height: 1}}\n"
        "boundary: {bottom: contact, right: free, top: clamped, left: free}\nmaterial: {E: 1, nu: 0.3}\n"
        f'friction: {law}\nmesh: {{maxh: 0.5}}\nexact: {{u: ["{u_x}", 0]}}\n'
    )
    assert study.exact is not None
    assert exact_slip_length(study.exact, study.scenes[0]) == pytest.approx(expected, abs=1e-12)
