"""Two-double arithmetic against exact rational arithmetic."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from tcstudy.contact.extended import extended_residual, two_product, two_sum


def test_sum_is_free_of_error() -> None:
    rng = np.random.default_rng(3)
    a = rng.normal(size=200) * 10.0 ** rng.integers(-60, 60, 200)
    b = rng.normal(size=200) * 10.0 ** rng.integers(-60, 60, 200)
    for x, y, high, low in zip(a, b, *two_sum(a, b), strict=True):
        assert Fraction(high) + Fraction(low) == Fraction(x) + Fraction(y)


def test_product_is_free_of_error() -> None:
    rng = np.random.default_rng(4)
    a = rng.normal(size=200) * 10.0 ** rng.integers(-60, 60, 200)
    b = rng.normal(size=200) * 10.0 ** rng.integers(-60, 60, 200)
    for x, y, high, low in zip(a, b, *two_product(a, b), strict=True):
        assert Fraction(high) + Fraction(low) == Fraction(x) * Fraction(y)


@pytest.mark.parametrize("m", [1, 2, 3, 7, 64, 301])
def test_difference_of_large_numbers_keeps_its_digits(m: int) -> None:
    """rhs = Ãv to double precision, so that nothing but the rounding of Ãv is left of rhs − Ãv."""
    rng = np.random.default_rng(m)
    A, v = rng.normal(size=(m, m)) * 10.0 ** rng.integers(-8, 8, (m, m)), rng.normal(size=m)
    v_low = 0.5 * np.spacing(v) * rng.uniform(-1, 1, m)
    rhs = A @ v
    rows = rng.choice(m, size=min(m, 5), replace=False)
    found, _ = extended_residual(rhs, A, v, v_low)
    for i in rows:
        whole = [Fraction(x) + Fraction(y) for x, y in zip(v, v_low, strict=True)]
        exact = Fraction(rhs[i]) - sum((Fraction(a) * x for a, x in zip(A[i], whole, strict=True)), Fraction(0))
        size = float(np.abs(A[i]).max() * np.abs(v).max())
        assert abs(float(Fraction(found[i]) - exact)) <= 3e-16 * abs(float(exact)) + 1e-31 * m * size
    plain, _ = extended_residual(rhs, A, v)
    assert np.all(np.abs(plain - found) <= np.abs(A) @ np.abs(v_low) * 1.01)


def test_no_unknowns() -> None:
    assert len(extended_residual(np.zeros(0), np.zeros((0, 0)), np.zeros(0))[0]) == 0
