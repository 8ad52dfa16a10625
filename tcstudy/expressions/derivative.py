"""Derivatives of expressions as expressions, by the rules of calculus.

abs, min and max are differentiated almost everywhere; at a kink s = 0 the derivative is that of the side s > 0.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tcstudy.expressions.algebra import ONE, ZERO, Term, call, scalar, step, term
from tcstudy.expressions.expression import Expression, Scalar, value_of
from tcstudy.expressions.tree import TreeNode, ordered

Array = NDArray[np.float64]


@lru_cache(maxsize=512)  # scenes of a sweep ask for the same ones
def derivative(of: Term, variable: str) -> Term:
    """∂/∂x or ∂/∂y."""
    slopes: dict[TreeNode, Term] = {}
    for node in ordered((of,)):
        assert isinstance(node, Term)
        slopes[node] = _slope(node, [slopes[part] for part in node.parts], variable)
    return slopes[of]


def gradient(of: Term) -> tuple[Term, Term]:
    """(∂/∂x, ∂/∂y)."""
    return derivative(of, "x"), derivative(of, "y")


def _slope(node: Term, slopes: list[Term], variable: str) -> Term:
    """The derivative of a node from those of its parts."""
    if not slopes:
        return ONE if node.name == variable else ZERO
    if all(slope is ZERO for slope in slopes):
        return ZERO
    a, b, da, db = node.parts[0], node.parts[-1], slopes[0], slopes[-1]
    match node.kind, node.name:
        case "Negative", _:
            return -da
        case _, "+":
            return da + db
        case _, "-":
            return da - db
        case _, "*":
            return da * b + a * db
        case _, "/":
            return (da - node * db) / b
        case _, "**":
            return b * a ** (b - 1.0) * da + node * call("log", a) * db
        case _, "atan2":
            return (da * b - a * db) / (a**2 + b**2)
        case _, "min":
            return db + step(-(a - b)) * (da - db)
        case _, "max":
            return db + step(a - b) * (da - db)
    return OUTER[node.name](a, node) * da


OUTER: dict[str, Callable[[Term, Term], Term]] = {
    "sin": lambda a, _: call("cos", a),
    "cos": lambda a, _: -call("sin", a),
    "tan": lambda _, f: 1.0 + f**2,
    "asin": lambda a, _: 1.0 / call("sqrt", 1.0 - a**2),
    "acos": lambda a, _: -(1.0 / call("sqrt", 1.0 - a**2)),
    "atan": lambda a, _: 1.0 / (1.0 + a**2),
    "exp": lambda _, f: f,
    "log": lambda a, _: 1.0 / a,
    "sqrt": lambda _, f: 0.5 / f,
    "abs": lambda a, _: 2.0 * step(a) - 1.0,
    "sinh": lambda a, _: call("cosh", a),
    "cosh": lambda a, _: call("sinh", a),
    "tanh": lambda _, f: 1.0 - f**2,
}
"""f′(a) of the functions of one argument: by the argument a and f(a)."""


def value_and_gradient(of: Scalar, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Values (…) and gradient (2, …) of a number or an expression at points; not finite where it has none."""
    slopes = _gradient(of) if isinstance(of, Expression) else (0.0, 0.0)
    return value_of(of, x, y), np.array([value_of(slope, x, y) for slope in slopes])


@lru_cache(maxsize=64)
def _gradient(expression: Expression) -> tuple[Scalar, Scalar]:
    by_x, by_y = gradient(term(expression))
    return scalar(by_x), scalar(by_y)


def is_linear(scalar: Scalar) -> bool:
    """Whether a scalar is known to be a polynomial of degree 1 at most."""
    return not isinstance(scalar, Expression) or all(isinstance(slope, float) for slope in _gradient(scalar))
