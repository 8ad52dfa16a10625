"""Rates, slopes and extrapolation on sequences with known order and limit."""

import numpy as np
import pytest
from scipy.stats import linregress

from tcstudy.accuracy.orders import dominated, fit, log_share, richardson, rounding_level

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


def test_richardson_finds_limit_and_order():
    found = richardson(H, 2 + 0.3 * H**1.4, ALL)
    assert found["limit"] == pytest.approx(2.0, rel=1e-12)
    assert found["limit_order"] == pytest.approx(1.4, rel=1e-9)
    uneven = np.array([1.0, 0.6, 0.25, 0.1])
    assert richardson(uneven, 2 + 0.3 * uneven**1.4, ALL[:4])["limit"] == pytest.approx(
        2.0, rel=1e-10
    )


def test_the_uncertainty_covers_the_limit():
    """With a second term of higher order, as real sequences have."""
    for seed in range(6):
        a, b, p, more = np.random.default_rng(seed).uniform([0.5, -0.4, 0.8, 0.6], [1, 0.4, 2, 1.5])
        q = 1 + a * H[:5] ** p + b * H[:5] ** (p + more)
        found = richardson(H[:5], q, ALL[:5])
        assert abs(found["limit"] - 1) <= found["uncertainty"] < abs(q[-1] - 1)


def test_numbers_without_a_limit():
    constant = richardson(H, np.full(6, 3.0), ALL)
    assert (constant["limit"], constant["uncertainty"]) == (3.0, 0.0)
    swinging = richardson(H, 1 + np.array([1, -1, 1, -1, 1, -1]) * H, ALL)
    assert (swinging["limit"], swinging["uncertainty"]) == pytest.approx((1 - H[5], H[4] + H[5]))
    assert np.isnan(swinging["limit_order"])
    assert np.isnan(richardson(H[:2], np.array([1.0, 2.0]), ALL[:2])["limit_order"])
    found = fit(H, H**2 * (1 + np.log(3 / H)), ALL)  # a logarithm in the error is told by its share
    assert found.slope == pytest.approx(2 - log_share(H[found.first_level :] / 3), rel=1e-12)


def test_what_another_run_beats_is_dominated() -> None:
    cost, error = np.random.default_rng(0).integers(0, 8, (2, 60)).astype(float)
    pairs = list(zip(cost, error, strict=True))
    expected = [any(c <= a and e <= b and (c, e) != (a, b) for c, e in pairs) for a, b in pairs]
    assert dominated(cost, error).tolist() == expected
