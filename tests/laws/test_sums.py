"""Sums of laws: values, primitives, kinks and symmetry of every pair of shapes, and what
exponentials cost."""

from itertools import combinations_with_replacement

import numpy as np
import pytest

from tcstudy.contact.certificates import bends_below_tangent, least_slopes, value_range
from tcstudy.laws.composed import piecewise_linear, total
from tcstudy.laws.laws import NONE, Laws
from tcstudy.laws.pieces import BEND
from tcstudy.laws.shapes import SHAPES
from tcstudy.scene.histories import is_odd


def law(shape: str, **parameters: object) -> Laws:
    return SHAPES[shape].build(**parameters)


LAWS = (
    law("tresca", tau=2.0),
    law("slip-weakening", tau_s=3.0, tau_k=1.0, delta=0.4),
    law("exponential", a=2.0, b=0.5, delta=0.3),
    law("saw-tooth", tau=2.0, delta=0.25, teeth=3, drop=0.5, decay=0.9),
    law(
        "piecewise-linear",
        points=[(0.0, 0.0), (0.1, 2.0), (float(np.nextafter(0.1, 1.0)), 0.5), (2.0, 0.7)],
    ),
    law("piecewise-linear", points=[(-1.0, -3.0), (-0.2, -1.0), (0.3, 2.0)], odd=False),
    law("linear", k=3.0),
    NONE,
)
SLIPS = np.concatenate([np.linspace(-3.0, 3.0, 2001), *(one.kinks for one in LAWS)])


@pytest.mark.parametrize(
    ("one", "two"), list(combinations_with_replacement(LAWS, 2)), ids=lambda one: one.name
)
def test_a_sum_has_the_values_and_primitives_of_both(one: Laws, two: Laws) -> None:
    one, two = one.times(0.3), two.times(0.7)
    both = total(one, two)
    both.check_growth()
    assert {*one.kinks, *two.kinks} <= set(both.kinks)
    assert is_odd(both) == (is_odd(one) and is_odd(two))
    for side in (-1, 1):
        np.testing.assert_allclose(
            both.b(SLIPS, side), one.b(SLIPS, side) + two.b(SLIPS, side), atol=1e-13
        )
    np.testing.assert_allclose(both.j(SLIPS), one.j(SLIPS) + two.j(SLIPS), atol=1e-13)
    assert both.omega <= one.omega + two.omega or np.isinf(one.omega + two.omega)


def test_exponentials_of_different_decay_add_up_exactly() -> None:
    rng = np.random.default_rng(7)
    for case in range(60):
        delta, ratio = (
            10.0 ** rng.uniform(-6, 3),
            10.0 ** rng.uniform(-2, 2) if case % 5 else 1.0 + 1e-9,
        )
        a, b, c, d = rng.uniform(0.0, 2.0, 4)
        one, two = (
            law("exponential", a=a, b=b, delta=delta),
            law("exponential", a=c, b=d, delta=ratio * delta),
        )
        both = total(one, two)
        both.check_growth()
        assert is_odd(both)
        assert np.all(both.kinds[both.kinks != 0.0] == BEND)
        s = np.concatenate([x * np.linspace(-40.0, 40.0, 501) for x in (delta, ratio * delta)])
        np.testing.assert_allclose(both.b(s), one.b(s) + two.b(s), rtol=0.0, atol=1e-13)
        np.testing.assert_allclose(
            both.j(s), one.j(s) + two.j(s), rtol=1e-12, atol=1e-13 * delta * ratio
        )
        assert both.omega >= -np.min(both.slope(s, both.piece(s))) * (1.0 - 1e-12)


TWO = total(
    law("exponential", a=2.0, b=0.5, delta=0.3), law("exponential", a=0.4, b=1.4, delta=0.05)
)
"""Falls and rises again: b″ changes its sign, b′ too."""


def test_chords_of_two_exponentials_miss_them_by_the_tolerance_at_most() -> None:
    chords = piecewise_linear(TWO, 1e-3, 3.0)
    assert is_odd(chords)
    assert (
        1e-4 * TWO.b_scale
        < np.max(np.abs(chords.b(SLIPS) - TWO.b(SLIPS)))
        <= (1.0 + 1e-9) * 1e-3 * TWO.b_scale
    )


def test_a_law_without_exponentials_and_a_body_without_slip_have_chords() -> None:
    """Beside an exponential law there may be one with the kink 0 alone, and no load at all."""
    tresca = law("tresca", tau=0.05)
    assert piecewise_linear(tresca, 1e-4, 0.0) is tresca
    at_rest = piecewise_linear(TWO, 1e-3, 0.0)
    np.testing.assert_array_equal(at_rest.interval(0.0), TWO.interval(0.0))
    with pytest.raises(ValueError, match="s_max must be finite and not negative, not inf"):
        piecewise_linear(TWO, 1e-3, np.inf)


def test_bounds_hold_for_two_exponentials() -> None:
    """Of the bend below a tangent, and of b and b′ over a box, against many samples."""
    rng = np.random.default_rng(11)
    v = rng.uniform(-0.6, 0.6, 40)
    low, high = v - rng.uniform(0.01, 0.8, 40), v + rng.uniform(0.01, 0.8, 40)
    s = np.linspace(low, high, 2001)
    inside = np.abs(s - v) > 1e-6
    below = TWO.j(v) + TWO.b(v) * (s - v) - TWO.j(s)
    sampled = np.max(
        np.where(inside, 2.0 * below / np.where(inside, s - v, 1.0) ** 2, -np.inf), axis=0
    )
    bound = bends_below_tangent(TWO, v, TWO.b(v), low, high)[0]
    assert np.all(bound >= sampled - 1e-6)
    assert np.median(bound - sampled) < 0.05 * np.median(np.abs(sampled))
    least, largest = value_range(TWO, low, high)
    assert np.all((least <= TWO.b(s).min(axis=0)) & (largest >= TWO.b(s).max(axis=0)))
    assert np.all(least_slopes(TWO, low, high) <= TWO.slope(s, TWO.piece(s)).min(axis=0) + 1e-12)
