"""Derivatives of expressions against hand-derived ones and against central differences."""

import numpy as np
import pytest

from tcstudy.exact.gradient import value_and_gradient
from tcstudy.expressions.expression import parse

X, Y = np.array([0.3, 0.8, 1.7]), np.array([0.6, 0.25, 1.1])


@pytest.mark.parametrize(
    ("text", "dx", "dy"),
    [
        ("3*x - y/2 + 7", lambda x, y: 3 + 0 * x, lambda x, y: -0.5 + 0 * x),
        ("x^3*y^2", lambda x, y: 3 * x**2 * y**2, lambda x, y: 2 * x**3 * y),
        ("sin(2*x)*exp(-y)", lambda x, y: 2 * np.cos(2 * x) * np.exp(-y), lambda x, y: -np.sin(2 * x) * np.exp(-y)),
        ("1/(x^2+y^2)", lambda x, y: -2 * x / (x**2 + y**2) ** 2, lambda x, y: -2 * y / (x**2 + y**2) ** 2),
        ("atan2(y, x)", lambda x, y: -y / (x**2 + y**2), lambda x, y: x / (x**2 + y**2)),
        ("max(0, x - 1)^2 + min(y, 1)", lambda x, y: 2 * np.maximum(0, x - 1), lambda x, y: (y < 1) * 1.0),
        ("2^x + x^y", lambda x, y: np.log(2) * 2**x + y * x ** (y - 1), lambda x, y: np.log(x) * x**y),
    ],
)  # fmt: skip
def test_known_derivatives(text, dx, dy):
    value, slope = value_and_gradient(parse(text), X, Y)
    np.testing.assert_allclose(value, parse(text).evaluate(X, Y), rtol=1e-15)
    np.testing.assert_allclose(slope, [dx(X, Y), dy(X, Y)], rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize(
    "text",
    ["tan(x*y)", "asin(x/3)", "acos(y/3)", "atan(x - y)", "log(x + y)", "sqrt(x*y)", "sinh(x)*cosh(y)", "tanh(x*y)",
     "abs(x - y)^3", "-(x - 2)^-3", "5 - x", "3/x - (-y)", "atan2(1, x) + atan2(y, 2)", "x^0 + x^0.75"],
)  # fmt: skip
def test_every_function_against_differences(text):
    expression, h = parse(text), 1e-5
    slope = value_and_gradient(expression, X, Y)[1]
    dx = (expression.evaluate(X + h, Y) - expression.evaluate(X - h, Y)) / (2 * h)
    dy = (expression.evaluate(X, Y + h) - expression.evaluate(X, Y - h)) / (2 * h)
    np.testing.assert_allclose(slope, [dx, dy], rtol=1e-7, atol=1e-8)


def test_numbers_and_constants_have_no_slope():
    for scalar in (2.5, parse("2 + 0.5")):
        value, slope = value_and_gradient(scalar, X, Y)
        assert value.tolist() == [2.5] * 3
        assert not slope.any()
        assert slope.shape == (2, 3)
