"""Differences of functions that are known: smooth, bent at the place or beside it, and given on one side alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tcstudy.contact.history.steps import HALFWAY, STEPS, derivative

Function = Callable[[float], float]


def both(f: Function, p: float) -> tuple[float, float]:
    """By both sides, and from above alone, at p in units of p."""
    middle = np.array([f(p)])
    above, below = (np.array([[f(p * (1.0 + way * h))] for h in (*STEPS, HALFWAY)]) for way in (1.0, -1.0))
    beside = np.concatenate([above[:2], below[:2]])
    return float(derivative(middle, beside, p)[0]), float(derivative(middle, above, p)[0])


def test_known_functions_in_any_units_and_where_both_sides_differ() -> None:
    for f, slope in ((lambda x: x**3, 27.0), (lambda x: np.sqrt(x - 2.75), 1.0), (lambda x: 7.0, 0.0)):
        for p in (3e-9, 3e9):
            assert both(lambda x, f=f, p=p: f(3.0 * x / p), p) == pytest.approx((3.0 / p * slope,) * 2, rel=1e-5)
    assert np.isnan(both(lambda x: abs(x - 1.0) + x, 1.0)[0])
    assert np.isnan(both(lambda x: float(x > 1.0), 1.0)[0])
    beside, farther = 1.0 + 0.3 * STEPS[1], 1.0 + 2.0 * STEPS[1]
    assert np.all(np.isnan(both(lambda x: max(x - beside, 0.0) + x, 1.0)))
    assert both(lambda x: max(x - farther, 0.0) + x, 1.0)[0] == pytest.approx(1.0, rel=1e-9)
