"""Enclosures of expressions on boxes, against values at random points of them."""

import numpy as np
import pytest

from tcstudy.expressions.enclosure import enclosure
from tcstudy.expressions.expression import parse, random_field

TEXTS = [
    "sin(3*x)",
    "cos(x*y)+2",
    "tan(x/4)",
    "tan(x)",
    "exp(-x^2)*y",
    "x/(2.1+y)",
    "sqrt(4+x)",
    "sqrt(x)",
    "abs(x-y)",
    "min(x,y,0.3)",
    "max(x,1-y)",
    "atan2(y,x)",
    "x^3-x",
    "(x+3)^0.5",
    "(2.1+x)^y",
    "cosh(x)*sinh(y)",
    "tanh(3*x)",
    "asin(x/4)",
    "acos(y/4)",
    "log(x+3)",
    "log(x)",
    "x**-2",
    "x**-3",
    "1/x",
    "(x-y)^2",
    "2^x",
    "atan(x)",
    "3",
    "-x*y",
]


@pytest.mark.parametrize("text", TEXTS)
def test_no_value_lies_outside(text: str) -> None:
    """Where the expression has values on the whole box; the range shrinks with the box."""
    rng = np.random.default_rng(len(text))
    expression = parse(text)
    widths = []
    for size in (0.5, 0.005):
        low = rng.uniform(-2.0, 1.5, size=(300, 2))
        high = low + rng.uniform(0.0, size, size=(300, 2))
        points = low + rng.random((200, 300, 2)) * (high - low)
        corners = np.stack([low, high, np.column_stack([low[:, 0], high[:, 1]])])
        x, y = np.moveaxis(np.concatenate([points, corners]), 2, 0)
        values = expression.evaluate(x, y)
        has_value = np.isfinite(values).all(axis=0)
        lower, upper = enclosure(expression, (low[:, 0], high[:, 0]), (low[:, 1], high[:, 1]))
        values, lower, upper = values[:, has_value], lower[has_value], upper[has_value]
        rounding = 1e-12 * (1.0 + np.abs(values))
        assert np.all((lower - rounding <= values) & (values <= upper + rounding))
        widths.append(np.median(upper - lower))
    assert widths[1] <= 0.03 * widths[0]


def test_a_division_by_an_interval_with_zero_has_no_bounds() -> None:
    box = np.array([-1.0, 0.5]), np.array([1.0, 2.0])
    lower, upper = enclosure(parse("1/x"), box, box)
    assert (lower[0], upper[0]) == (-np.inf, np.inf)
    assert (lower[1], upper[1]) == (0.5, 2.0)


def test_the_range_of_a_random_field_is_close() -> None:
    points = np.column_stack([np.linspace(0.0, 1.0, 12), np.zeros(12)])
    field = random_field(points, 0.4, 0.2, 1)
    x = np.linspace(0.0, 1.0, 401)
    y = np.zeros(400)
    lower, upper = enclosure(field, (x[:-1], x[1:]), (y, y))
    values = field.evaluate(x, 0.0 * x)
    ends = np.stack([values[:-1], values[1:]])
    assert np.all(lower <= ends.min(axis=0))
    assert np.all(ends.max(axis=0) <= upper)
    assert np.max((upper - lower) / values.max()) < 0.2
