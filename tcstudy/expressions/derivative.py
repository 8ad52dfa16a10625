"""Derivatives of expressions as expressions, of trees that are computed with like numbers.

Trees that are computed with like numbers, simplified a little: what derivatives and derived loads are made of.

Constants are computed; a + 0, a − a, 1·a, 0·a, a/1, a^0, a^1 and −(−a) vanish, numbers in a product come first.
0·a = 0 also where a has no value. Equal terms are one object as long as one of them is in use, so that a derivative has
a few times as many different nodes as the expression, however long it is when written out.

Derivatives of expressions as expressions, by the rules of calculus.

abs, min and max are differentiated almost everywhere; at a kink s = 0 the derivative is that of the side s > 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tcstudy.expressions.expression import FUNCTIONS, Expression, Scalar, TreeNode, applied, of_tree, ordered, value_of


class Term(TreeNode):
    """A node, simplified, with the operations of arithmetic; numbers beside it are terms, too."""

    parts: tuple[Term, ...]
    __array_ufunc__ = None  # a NumPy number beside a term leaves the operation to it

    def __neg__(self) -> Term:
        if self.kind == "Negative":
            return self.parts[0]
        return number(-self.value) if self.kind == "Number" else _only("Negative", "", self)

    def __add__(self, other: Term | float) -> Term:
        a, b = self, term(other)
        if a is ZERO or b is ZERO:
            return b if a is ZERO else a
        return a - b.parts[0] if b.kind == "Negative" else _computed("Binary", "+", a, b)

    def __sub__(self, other: Term | float) -> Term:
        a, b = self, term(other)
        if a is b:
            return ZERO
        if a is ZERO or b is ZERO:
            return a if b is ZERO else -b
        return a + b.parts[0] if b.kind == "Negative" else _computed("Binary", "-", a, b)

    def __mul__(self, other: Term | float) -> Term:
        a, b = (term(other), self) if term(other).kind == "Number" else (self, term(other))
        if a is ZERO or b is ZERO:
            return ZERO
        if a is ONE:
            return b
        if a.kind == "Number" and b.kind == "Binary" and b.name == "*" and b.parts[0].kind == "Number":
            a, b = number(a.value * b.parts[0].value), b.parts[1]
        return _computed("Binary", "*", a, b)

    def __truediv__(self, other: Term | float) -> Term:
        a, b = self, term(other)
        return a if b is ONE or a is ZERO else _computed("Binary", "/", a, b)

    def __pow__(self, other: Term | float) -> Term:
        b = term(other)
        if b is ZERO:
            return ONE
        return self if b is ONE else _computed("Binary", "**", self, b)

    def __rsub__(self, other: float) -> Term:
        return term(other) - self

    def __rtruediv__(self, other: float) -> Term:
        return term(other) / self

    __radd__, __rmul__ = __add__, __mul__


_TERMS: WeakValueDictionary[tuple[object, ...], Term] = WeakValueDictionary()


def _only(kind: str, name: str, *parts: Term, value: float = 0.0) -> Term:
    """The one term like this."""
    return _TERMS.setdefault((kind, name, parts, value), Term(kind, name, parts, value))  # type: ignore[arg-type]


def _computed(kind: str, name: str, *parts: Term) -> Term:
    """The one term like this, or its value if it has one whatever x and y."""
    made = _only(kind, name, *parts)
    if not all(part.kind == "Number" for part in parts):
        return made
    with np.errstate(all="ignore"):
        value = float(applied(made, [np.float64(part.value) for part in parts], FUNCTIONS))
    return number(value) if math.isfinite(value) else made


def number(value: float) -> Term:
    """A constant."""
    return _only("Number", "", value=float(value) + 0.0)  # −0 and 0 are one constant


def variable(name: str) -> Term:
    """x or y."""
    return _only("Coordinate", name)


def call(function: str, *arguments: Term | float) -> Term:
    """function(arguments); min and max of several are those of the first ones and the last."""
    first, *others = map(term, arguments)
    if function in ("min", "max"):
        for other in others:
            first = _computed("Call", function, first, other)
        return first
    return _computed("Call", function, first, *others)


def step(s: Term) -> Term:
    """1 where s ≥ 0, 0 elsewhere: 1 − atan2(0, s + 0)/π, which is never 0/0; atan2(0, −0) alone would be π."""
    return 1.0 - call("atan2", ZERO, _only("Binary", "+", s, ZERO)) / math.pi


ZERO, ONE = number(0.0), number(1.0)


def term(of: Scalar | Term) -> Term:
    """A number or an expression as a term."""
    if isinstance(of, Term):
        return of
    if not isinstance(of, Expression):
        return number(of)
    made: dict[TreeNode, Term] = {}
    for node in of.order:
        parts = [made[part] for part in node.parts]
        match node.kind:
            case "Number":
                made[node] = number(node.value)
            case "Coordinate":
                made[node] = variable(node.name)
            case "Call":
                made[node] = call(node.name, *parts)
            case _:
                made[node] = applied(node, parts, {})
    return made[of.root]


def scalar(of: Term) -> Scalar:
    """A number if the term is one, else an expression."""
    return of.value if of.kind == "Number" else of_tree(of)


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
