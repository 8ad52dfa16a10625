"""Expressions against NumPy; hostile and mistaken texts."""

import copy
import pickle
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tcstudy.expressions.expression import MAX_LENGTH, Expression, ExpressionError, parse

NUMPY = {
    "0.3*sin(pi*x)": lambda x, y: 0.3 * np.sin(np.pi * x),
    "asin(x/9) + acos(y/9) - atan(x) + atan2(y, x)": lambda x, y: (
        np.arcsin(x / 9) + np.arccos(y / 9) - np.arctan(x) + np.arctan2(y, x)
    ),
    "exp(-x^2 - y**2)": lambda x, y: np.exp(-(x**2) - y**2),
    "log(1 + x^2) / sqrt(2 + abs(y))": lambda x, y: np.log(1 + x**2) / np.sqrt(2 + abs(y)),
    "sinh(x) - cosh(y) + tanh(x*y)": lambda x, y: np.sinh(x) - np.cosh(y) + np.tanh(x * y),
    "min(x, y, 0.5) + 10*max(1, 2, x)": lambda x, y: (
        np.minimum(np.minimum(x, y), 0.5) + 10 * np.maximum(x, 2)
    ),
    "-x^2": lambda x, y: -(x**2),
    "2^-x": lambda x, y: 2.0**-x,
    "2^3^0.5": lambda x, y: 2.0 ** (3**0.5) + 0 * x,
    " ( x\n+ .5e1 ) * 010 ": lambda x, y: (x + 5) * 10,
    "abs(x)^1.5": lambda x, y: abs(x) ** 1.5,
}


@pytest.mark.parametrize("text", NUMPY)
def test_values_are_those_of_numpy(text: str) -> None:
    x, y = np.random.default_rng(0).uniform(-3, 3, (2, 200))
    np.testing.assert_allclose(
        parse(text).evaluate(x, y), NUMPY[text](x, y), rtol=2e-15, atol=1e-15
    )


def test_pickle_and_copy() -> None:
    expression = parse("x" + "+x" * 110)
    for twin in (pickle.loads(pickle.dumps(expression)), copy.deepcopy(expression)):
        assert twin == expression
        assert twin.evaluate(2.0, 0.0) == 222.0


HOSTILE = [
    "__import__('os')", "x.__class__", "().__class__", "lambda: 1", "lambda x: x", "[x for x in (1,)]", "x if y else 1",
    "x < y", "x == y", "x and y", "not x", "x := 1", "x, y", "sin(x=1)", "sin(*x)", "sin(**x)", "sin", "sin(x)(y)",
    "x(y)", "2(x)", "print(x)", "'x'", "f'{x}'", "True", "None", "...", "1j", "0x10", "1_000", "x // y", "x % y",
    "x @ y", "~x", "x & y", "x ** * y", "x * * y", "x)+(y", "(x", "x +", "* x", "()", "", "   ", "x;y", "x#y", "x\x00",
    "ｘ", "𝓍 + 1", "x\u200b", "²", "1e400", "9" * 1999, "(" * 1000 + "x" + ")" * 999, "(" * 900, "-" * 1999 + "x",
    "x" + "^x" * 990, "x" + "+x" * 990, "sin(" * 300 + "x" + ")" * 300, "max(" * 200 + "x" + ",1)" * 200,
    "x" * (MAX_LENGTH + 1), "(x)" * (10**6), "atan2(x)", "sin()", "sin(x, y)", "min(x)", "max()",
]  # fmt: skip


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
def test_hostile_text_is_refused_at_once(text: str) -> None:
    start = time.process_time()
    with pytest.raises(ExpressionError) as caught:
        parse(text)
    assert time.process_time() - start < 2.0
    assert 10 < len(str(caught.value)) < 600


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("2 + sim(x)", ["'sim'", "did you mean 'sin'"]),
        ("1 + z", ["unknown name 'z'", "x, y"]),
        ("x - 40 mm", ["unknown name 'mm'", "a number with a unit needs a name under parameters"]),
        ("2x", ["2*x"]),
        ("sin x", ["sin needs parentheses"]),
        ("x^^2", ["near '**'"]),
        ("π*x", ["write pi"]),
        ("x*", ["near '*'"]),
        ("(x", ["was never closed"]),
        ("x)", ["unmatched"]),
        ("y + atan2(x)", ["atan2(y, x)", "not 1"]),
    ],
)
def test_mistakes_are_named(text: str, words: list[str]) -> None:
    with pytest.raises(ExpressionError) as caught:
        parse(text)
    for word in words:
        assert word in str(caught.value)


@settings(max_examples=60, deadline=None)
@given(
    st.text(alphabet="xyepi0123456789.+-*/^(), sincoatbmrqhlgE_<'\"", max_size=60)
    | st.text(max_size=40)
)
def test_any_text_gives_an_expression_or_an_error(text: str) -> None:
    try:
        expression = parse(text)
    except ExpressionError:
        return
    assert isinstance(expression, Expression)
    assert expression.evaluate(np.array([0.5, 1.0]), 2.0).shape == (2,)
