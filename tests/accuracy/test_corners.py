"""Corner exponents against published values and independent characteristic equations."""

from math import cos, pi, radians, sin

import pytest
from scipy.optimize import brentq

from tcstudy.accuracy.corners import CLAMPED, FREE, SLIDING, SMOOTH, corner_exponent

KAPPA = 3 - 4 * 0.3


@pytest.mark.parametrize(
    ("angle", "first", "second", "exponent"),
    [
        (90, CLAMPED, FREE, 0.7112),  # plane strain, nu = 0.3: Roessle, J. Elasticity 60 (2000); Williams (1952)
        (270, FREE, FREE, 0.5445),  # the L-shaped domain
        (360, FREE, FREE, 0.5),  # a crack
        (180, CLAMPED, FREE, 0.5),  # 1/2 ± iε
        (180, CLAMPED, SLIDING, 0.5),  # stick–slip before the law bounds it
        (180, SLIDING, FREE, 0.5),
        (90, SLIDING, SLIDING, SMOOTH),  # by reflection no corner at all
        (180, FREE, FREE, SMOOTH),
        (180, CLAMPED, CLAMPED, SMOOTH),
        (90, CLAMPED, SLIDING, SMOOTH),  # by reflection a clamped straight edge
        (45, FREE, SLIDING, SMOOTH),  # by reflection a free 90° corner
    ],
)
def test_published_exponents(angle, first, second, exponent):
    assert corner_exponent(radians(angle), first, second, KAPPA) == pytest.approx(exponent, abs=5e-5)
    assert corner_exponent(radians(angle), second, first, KAPPA) == pytest.approx(exponent, abs=5e-5)


@pytest.mark.parametrize("kappa", [1.2, 1.8, 2.6])
def test_characteristic_equations(kappa):
    """Clamped: κ sin αω = α|sin ω|;  clamped–free: 4κ sin²αω = (κ+1)² − 4α² sin²ω;  free: sin αω = −α sin ω."""
    w = 1.5 * pi
    root = brentq(lambda a: kappa * sin(a * w) + a * sin(w), 0.4, 0.9)
    assert corner_exponent(w, CLAMPED, CLAMPED, kappa) == pytest.approx(root, rel=1e-9)
    w = 0.4 * pi
    mixed = brentq(lambda a: 4 * kappa * sin(a * w) ** 2 - (kappa + 1) ** 2 + 4 * a**2 * sin(w) ** 2, 0.3, 1.2)
    assert corner_exponent(w, CLAMPED, FREE, kappa) == pytest.approx(mixed, rel=1e-9)
    w = 1.25 * pi
    free = brentq(lambda a: sin(a * w) + a * sin(w), 0.45, 0.9)
    assert corner_exponent(w, FREE, FREE, kappa) == pytest.approx(free, rel=1e-9)


def test_sliding_is_half_of_the_mirrored_corner():
    """Free–sliding over ω has the symmetric exponents of free–free over 2ω: those of sin 2αω + α sin 2ω = 0."""
    w = radians(135)
    symmetric = brentq(lambda a: sin(2 * a * w) + a * sin(2 * w), 0.45, 0.95)
    assert corner_exponent(w, FREE, SLIDING, KAPPA) == pytest.approx(symmetric, rel=1e-9)


def test_an_oblique_roller_turns_into_the_normal_one():
    angle = radians(70)
    normal = corner_exponent(angle, CLAMPED, ((0.0, 1.0),), KAPPA)
    oblique = corner_exponent(angle, CLAMPED, ((sin(0.5), cos(0.5)),), KAPPA)
    almost = corner_exponent(angle, CLAMPED, ((sin(1e-7), cos(1e-7)),), KAPPA)
    assert almost == pytest.approx(normal, abs=1e-5)
    assert oblique != pytest.approx(normal, abs=1e-3)
