"""Rates and slopes on sequences with known order."""

import numpy as np
import pytest
from scipy.stats import linregress

from tcstudy.accuracy.orders import dominated, fit, log_share, rounding_level

H = 0.5 ** np.arange(6)
ALL = np.ones(6, dtype=bool)


def test_only_asymptotic_levels_are_fitted_and_unsettled_ones_whole():
    scattered = H**2 * np.exp([0.02, -0.03, 0.01, 0.02, -0.01, 0.03])
    found, expected = fit(H, scattered, ALL), linregress(np.log(H), np.log(scattered))
    assert found.slope == pytest.approx(expected.slope, rel=1e-12)
    assert found.slope_error == pytest.approx(expected.stderr, rel=1e-10)
    swinging = fit(H, H * np.array([1, 2, 1, 2, 1, 2]), ALL)
    assert (swinging.first_level, swinging.settled) == (0, False)
    error = H**2 + np.array([5, 0.5, 0, 0, 0, 0])
    found = fit(H, error, ALL)
    assert (found.first_level, found.settled, found.slope) == (
        2,
        True,
        pytest.approx(2.0, rel=1e-12),
    )


def test_errors_that_grow_like_rounding_are_rounding():
    """As on patch tests, eps/h²: beyond 1e-11 on fine meshes they used to be rates of −2; seven
    times more are none."""
    h = 0.5 ** np.arange(3, 10)
    error, usable = 12 * np.finfo(float).eps / h**2, np.ones(7, dtype=bool)
    assert error[-1] > 1e-11
    assert fit(h, error, usable, rounding_level(h)).exact
    assert fit(h, 7 * error, usable, rounding_level(h)).slope == pytest.approx(-2.0)
    levelled = fit(h, np.maximum(1e-6 * h**2, error), usable, rounding_level(h))
    assert (levelled.slope, levelled.exact) == (pytest.approx(2.0), False)
    for short in (fit(H, np.full(6, np.nan), ALL), fit(H[:1], np.ones(1), ALL[:1])):
        assert np.isnan(short.slope)


def test_a_logarithm_is_told_by_its_share() -> None:
    found = fit(H, H**2 * (1 + np.log(3 / H)), ALL)
    assert found.slope == pytest.approx(2 - log_share(H[found.first_level :] / 3), rel=1e-12)


def test_what_another_run_beats_is_dominated() -> None:
    cost, error = np.random.default_rng(0).integers(0, 8, (2, 60)).astype(float)
    pairs = list(zip(cost, error, strict=True))
    expected = [any(c <= a and e <= b and (c, e) != (a, b) for c, e in pairs) for a, b in pairs]
    assert dominated(cost, error).tolist() == expected
