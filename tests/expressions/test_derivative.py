"""Derivatives as expressions: against forward mode, by hand, twice, and what stays small."""

import numpy as np
import pytest

from tcstudy.exact.solution import kinks
from tcstudy.expressions.expression import Expression, derivative, parse, term, value_and_gradient

X, Y = np.array([0.3, 0.8, 1.7]), np.array([0.6, 0.25, 1.1])


def slope(text: str, variables: str) -> Expression:
    """One derivative after the other."""
    node = term(parse(text))
    for variable in variables:
        node = derivative(node, variable)
    return Expression("slope", node)


TEXTS = (
    *(
        "3*x - y/2 + 7",
        "x^3*y^2",
        "sin(2*x)*exp(-y)",
        "1/(x^2+y^2)",
        "atan2(y, x)",
        "2^x + x^y",
        "tan(x*y)",
    ),
    *(
        "asin(x/3)",
        "acos(y/3)",
        "atan(x - y)",
        "log(x + y)",
        "sqrt(x*y)",
        "sinh(x)*cosh(y)",
        "tanh(x*y)",
    ),
    *(
        "abs(x - y)^3",
        "-(x - 2)^-3",
        "5 - x",
        "3/x - (-y)",
        "atan2(1, x) + atan2(y, 2)",
        "x^0 + x^0.75",
        "-x*-y",
    ),
    *(
        "max(0, x - 1)^2 + min(y, 1)",
        "max(x, y, 1)*min(x*y, 2, x)",
        "abs(x - 1)*abs(y)",
        "cos(x)^2/(1 + y)",
    ),
)


@pytest.mark.parametrize("text", TEXTS)
@pytest.mark.parametrize("before", ["", "x", "y"])
def test_derivatives_agree_with_differences_and_commute(text: str, before: str) -> None:
    """First and second ones, as expressions and by numbers."""
    function, h = slope(text, before) if before else parse(text), 1e-5
    found = np.array([slope(text, before + variable).evaluate(X, Y) for variable in "xy"])
    steps = [(h, 0.0), (0.0, h)]
    differences = [
        (function.evaluate(X + i, Y + j) - function.evaluate(X - i, Y - j)) / (2 * h)
        for i, j in steps
    ]
    np.testing.assert_allclose(found, differences, rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(value_and_gradient(function, X, Y)[1], found, rtol=1e-12, atol=1e-13)
    other = [slope(text, variable + before).evaluate(X, Y) for variable in "xy"]
    np.testing.assert_allclose(found, other, rtol=1e-11, atol=1e-12)


def test_kinks_are_where_slopes_jump_and_one_side_is_taken_there() -> None:
    for text, at, side in (
        ("abs(x)", -0.0, 1.0),
        ("abs(x)", -1e-300, -1.0),
        ("max(x, 2*x)", 0.0, 1.0),
    ):
        assert float(slope(text, "x").evaluate(at, 0.0)) == side
    assert kinks(parse("sin(x)*y")) == kinks(2.0) == ()
    found = kinks(parse("abs(x - 1) + max(0, y, x) + min(y, 3)"))
    values = sorted(float(bend.evaluate(4.0, 1.0)) for bend in found)
    assert values == sorted([3.0, -1.0, -3.0, -2.0])


def test_a_derivative_shares_its_parts() -> None:
    """A long singular field: its second derivatives, written out a megabyte, have a few hundred
    different nodes."""
    text = "((x-1)^2+y^2)^0.75 * " + " * ".join(
        f"(cos({i}*atan2(y, x-1)) + sin(x*y + {i}))" for i in range(1, 11)
    )
    twice = slope(text, "xy")
    assert len(twice.order) < 1500
    h = 1e-5
    once = slope(text, "x")
    expected = (once.evaluate(X, Y + h) - once.evaluate(X, Y - h)) / (2 * h)
    np.testing.assert_allclose(
        twice.evaluate(X, Y), expected, rtol=1e-7, atol=1e-7 * np.max(np.abs(expected))
    )
