"""Sums of laws: values, primitives, kinks and symmetry of every pair of shapes, and what exponentials cost."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
import pytest

from tcstudy.scene.friction import BEND, DOWN, UP, FrictionLaw
from tcstudy.scene.histories import is_odd
from tcstudy.scene.laws import SHAPES
from tcstudy.scene.mixtures import SPLINE_ERROR, total
from tcstudy.scene.nodal_laws import NONE, times


def law(shape: str, **parameters: object) -> FrictionLaw:
    return SHAPES[shape].build(**parameters)


LAWS = (
    law("tresca", tau=2.0),
    law("slip-weakening", tau_s=3.0, tau_k=1.0, delta=0.4),
    law("exponential", a=2.0, b=0.5, delta=0.3),
    law("saw-tooth", tau=2.0, delta=0.25, teeth=3, drop=0.5, decay=0.9),
    law("piecewise-linear", points=[(0.0, 0.0), (0.1, 2.0), (float(np.nextafter(0.1, 1.0)), 0.5), (2.0, 0.7)]),
    law("piecewise-linear", points=[(-1.0, -3.0), (-0.2, -1.0), (0.3, 2.0)], odd=False),
    law("linear", k=3.0),
    NONE,
)
SLIPS = np.concatenate([np.linspace(-3.0, 3.0, 2001), *(one.kinks for one in LAWS)])


@pytest.mark.parametrize(("one", "two"), list(combinations_with_replacement(LAWS, 2)), ids=lambda one: one.name)
def test_a_sum_has_the_values_and_primitives_of_both(one: FrictionLaw, two: FrictionLaw) -> None:
    one, two = times(one, 0.3), times(two, 0.7)
    both = total(one, two)
    both.check_growth()
    assert set(both.kinks) == {*one.kinks, *two.kinks}
    assert is_odd(both) == (is_odd(one) and is_odd(two))
    for side in (-1, 1):
        np.testing.assert_allclose(both.b(SLIPS, side), one.b(SLIPS, side) + two.b(SLIPS, side), atol=1e-13)
    np.testing.assert_allclose(both.j(SLIPS), one.j(SLIPS) + two.j(SLIPS), atol=1e-13)
    assert both.omega <= one.omega + two.omega or np.isinf(one.omega + two.omega)


def test_what_jumps_up_and_down_at_one_slip_does_what_remains() -> None:
    up = law("piecewise-linear", points=[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (2.0, 1.0)])
    for height, kind in ((0.5, UP), (1.0, BEND), (1.5, DOWN)):
        down = law("piecewise-linear", points=[(0.0, height), (1.0, height), (1.0, 0.0), (2.0, 0.0)])
        assert total(up, down).kinds[-1] == kind


def test_exponentials_of_different_decay_become_a_spline_without_jumps() -> None:
    rng = np.random.default_rng(7)
    for case in range(200):
        delta, ratio = 10.0 ** rng.uniform(-6, 3), 10.0 ** rng.uniform(-2, 2) if case % 5 else 1.0 + 1e-9
        a, b, c, d = rng.uniform(0.0, 2.0, 4)
        one, two = law("exponential", a=a, b=b, delta=delta), law("exponential", a=c, b=d, delta=ratio * delta)
        both = total(one, two)
        both.check_growth()
        assert is_odd(both)
        assert np.all(both.kinds[both.kinks != 0.0] == BEND)
        s = np.concatenate([x * np.linspace(-40.0, 40.0, 501) for x in (delta, ratio * delta)])
        allowed = 2.0 * SPLINE_ERROR * (abs(a - b) + abs(c - d))  # it is measured at three places of a piece
        assert np.max(np.abs(both.b(s) - one.b(s) - two.b(s))) <= allowed
        assert both.omega <= (one.omega + two.omega) * (1.0 + 1e-3)


def test_an_exponential_too_small_to_be_seen_beside_another_may_vanish() -> None:
    """As where the strength of one edge fades out towards the joint: the faster one and the slower."""
    for tiny in 10.0 ** np.arange(-300.0, 0.0, 7.0):
        for delta in (0.3, 3.0):
            one, two = law("exponential", a=2.0, b=0.5, delta=1.0), law("exponential", a=2.0, b=1.0, delta=delta)
            both, two = total(one, times(two, tiny)), times(two, tiny)
            both.check_growth()
            assert is_odd(both)
            np.testing.assert_allclose(both.b(SLIPS), one.b(SLIPS) + two.b(SLIPS), atol=4.0 * SPLINE_ERROR)
            assert both.b(0.0) == pytest.approx(2.0 + 2.0 * tiny, rel=1e-14)


def test_exponentials_that_decay_alike_stay_one() -> None:
    one, two = law("exponential", a=2.0, b=0.5, delta=0.3), law("exponential", a=1.0, b=3.0, delta=0.3)
    both = total(one, two)
    assert list(both.kinks) == [0.0]
    np.testing.assert_allclose(both.b(SLIPS), one.b(SLIPS) + two.b(SLIPS), atol=1e-14)
