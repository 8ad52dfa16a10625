"""Expressions in x and y, such as "0.3*sin(pi*x)": parsing, values and derivatives.

Grammar: numbers, x, y, pi, e, the operators + - * / ** (or ^) and parentheses, and the functions of
FUNCTIONS. The text is split into these tokens and never executed as code. Python's parser makes a
tree of them, and only the nodes named here are accepted. The tree is folded over NumPy arrays or
any other arithmetic. Left out on purpose: comparisons, names of the user's own, attribute access,
complex numbers.

Trees are made of terms that are computed with like numbers, so that derivatives, derived loads and
random fields read as their formulas. Equal terms are one object as long as one of them is in use,
and every term is visited once. The cost is the number of different terms, not the length of the
expression written out. Nothing here recurses over terms.

Derivatives follow the rules of calculus. abs, min and max are differentiated almost everywhere, and
at a kink s = 0 the derivative is that of the side s > 0.
"""

from __future__ import annotations

import ast
import difflib
import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, reduce
from typing import Any, TypeVar
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

NUMBER = "#"
NEGATIVE = "~"
_NUMPY_NAMES = (
    *("sin", "cos", "tan", "asin", "acos", "atan", "atan2"),
    *("exp", "log", "sqrt", "abs", "sinh", "cosh", "tanh"),
)
FUNCTIONS: dict[str, Callable[..., Any]] = {name: getattr(np, name) for name in _NUMPY_NAMES}
FUNCTIONS |= {"min": np.minimum, "max": np.maximum}
OPERATIONS = FUNCTIONS | {
    NEGATIVE: operator.neg,
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "**": operator.pow,
}


@dataclass(frozen=True, eq=False)
class Term:
    """A node of an expression: a number, a variable, or an operation on right terms.

    `number`, `variable`, `call` and arithmetic make terms. A number beside a term becomes one, too.

    name:  NUMBER for a number, x or y for a variable, else a key of OPERATIONS
    parts: the operands;  value: of a number

    Arithmetic simplifies: a + 0, a − a, 1·a, 0·a, a/1, a^0, a^1 and −(−a) vanish, numbers in a
    product come first. 0·a = 0 also where a has no value.
    """

    name: str
    parts: tuple[Term, ...] = ()
    value: float = 0.0
    __array_ufunc__ = None  # a NumPy number beside a term leaves the operation to it

    def __neg__(self) -> Term:
        if self.name == NEGATIVE:
            return self.parts[0]
        return made(NEGATIVE, self)

    def __add__(self, right: Term | float) -> Term:
        summand = term(right)
        if self is ZERO:
            return summand
        if summand is ZERO:
            return self
        if summand.name == NEGATIVE:
            return self - summand.parts[0]
        return made("+", self, summand)

    def __sub__(self, right: Term | float) -> Term:
        subtrahend = term(right)
        if self is subtrahend:
            return ZERO
        if subtrahend is ZERO:
            return self
        if self is ZERO:
            return -subtrahend
        if subtrahend.name == NEGATIVE:
            return self + subtrahend.parts[0]
        return made("-", self, subtrahend)

    def __mul__(self, right: Term | float) -> Term:
        a, b = self, term(right)
        if b.name == NUMBER:
            a, b = b, a
        if a is ZERO or b is ZERO:
            return ZERO
        if a is ONE:
            return b
        if a.name == NUMBER and b.name == "*" and b.parts[0].name == NUMBER:
            a, b = number(a.value * b.parts[0].value), b.parts[1]
        return made("*", a, b)

    def __truediv__(self, right: Term | float) -> Term:
        divisor = term(right)
        if divisor is ONE or self is ZERO:
            return self
        return made("/", self, divisor)

    def __pow__(self, right: Term | float) -> Term:
        exponent = term(right)
        if exponent is ZERO:
            return ONE
        if exponent is ONE:
            return self
        return made("**", self, exponent)

    def __rsub__(self, left: float) -> Term:
        return term(left) - self

    def __rtruediv__(self, left: float) -> Term:
        return term(left) / self

    __radd__, __rmul__ = __add__, __mul__


_TERMS: WeakValueDictionary[tuple[object, ...], Term] = WeakValueDictionary()


def made(name: str, *parts: Term, value: float = 0.0) -> Term:
    """Return the one term with this name and these parts.

    If all parts are numbers, it is the number that they give.
    """
    if parts and all(part.name == NUMBER for part in parts):
        operands = [np.float64(part.value) for part in parts]
        with np.errstate(all="ignore"):  # floats, as no power of integers would ever end
            return number(float(OPERATIONS[name](*operands)))
    return _TERMS.setdefault((name, parts, value), Term(name, parts, value))


def number(value: float) -> Term:
    """Return the term of a constant."""
    return made(NUMBER, value=float(value) + 0.0)  # −0 and 0 are one constant


def variable(name: str) -> Term:
    """Return the term of x or y."""
    return made(name)


def call(function: str, first: Term | float, *further: Term | float) -> Term:
    """Return the term function(arguments).

    min and max of several arguments are taken pairwise, from the left.
    """
    if function in ("min", "max"):
        return reduce(lambda a, b: made(function, a, term(b)), further, term(first))
    return made(function, term(first), *map(term, further))


def term(scalar: Scalar | Term) -> Term:
    """Return a number or an expression as a term."""
    if isinstance(scalar, Term):
        return scalar
    if isinstance(scalar, Expression):
        return scalar.root
    return number(scalar)


ZERO = number(0.0)
ONE = number(1.0)
Order = tuple[Term, ...]
"""The terms of a tree, each once, every one after its parts; the root is the last."""


def ordered(root: Term) -> Order:
    """Return the terms of a tree, each once, every one after its parts."""
    visited: dict[Term, None] = {}
    stack = [(root, False)]
    while stack:
        node, parts_visited = stack.pop()
        if node in visited:
            continue
        if parts_visited:
            visited[node] = None
        else:
            stack.append((node, True))
            stack.extend((part, False) for part in reversed(node.parts))
    return tuple(visited)


T = TypeVar("T")

MAX_LENGTH = 2000
"""Largest number of characters of an expression."""
MAX_DEPTH = 120
"""Largest number of nested operations and functions."""

VARIABLES = ("x", "y")
CONSTANTS = {"pi": math.pi, "e": math.e}
TOKEN = re.compile(
    r"(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z_0-9]*)|(?P<power>\*\*|\^)|(?P<mark>[-+*/(),])|(?P<space>\s+)"
)
LOOKALIKES = dict(
    zip("π−–·×÷²³√", ("pi", "-", "-", "*", "*", "/", "^2", "^3", "sqrt()"), strict=True)
)
AS_PYTHON: dict[str, Callable[[str], str]] = {
    "number": lambda word: repr(float(word)),
    "name": "_{}".format,  # never a keyword of Python
    "power": lambda _: "**",
}
OPERATORS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}
ALLOWED = (
    f"allowed are numbers, {', '.join(VARIABLES)}, {', '.join(CONSTANTS)}, + - * / ^ ( ) "
    f"and the functions {', '.join(FUNCTIONS)}"
)


class ExpressionError(ValueError):
    """The text is not an expression in x and y."""


@dataclass(frozen=True)
class Expression:
    """A function of x and y, made by `parse` or from a tree; equal if the trees are.

    text: as it was read, or a name for a function that was computed
    """

    text: str = field(compare=False)
    root: Term = field(repr=False)

    def __str__(self) -> str:
        return self.text

    def __reduce__(self) -> tuple[Callable[..., Expression], tuple[str, Any]]:
        # a list of nodes with positions of their parts, so that nothing recurses
        position = {node: i for i, node in enumerate(self.order)}
        nodes = []
        for node in self.order:
            nodes.append((node.name, [position[part] for part in node.parts], node.value))
        return _unpacked, (self.text, nodes)

    @cached_property
    def order(self) -> Order:
        """The terms, each once, every one after its parts."""
        return ordered(self.root)

    @cached_property
    def variables(self) -> frozenset[str]:
        """The variables that occur: a subset of {"x", "y"}."""
        leaves = [node.name for node in self.order if not node.parts]
        return frozenset(leaves) - {NUMBER}

    @property
    def constant(self) -> float | None:
        """The value if no variable occurs (possibly not finite), else None."""
        return self.root.value if self.root.name == NUMBER else None

    def evaluate(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the values at the points (x, y), broadcast against each other.

        They are not finite where the expression is not.
        """
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        with np.errstate(all="ignore"):
            values = np.asarray(self.fold({"x": x, "y": y}), dtype=float)
        return np.array(np.broadcast_to(values, x.shape))

    def bound(self, values: Mapping[str, float]) -> Expression:
        """Return the expression with numbers in place of names."""
        replacement: dict[Term, Term] = {}
        for node in self.order:
            if node.name in values:
                replacement[node] = number(values[node.name])
            else:
                parts = [replacement[part] for part in node.parts]
                replacement[node] = made(node.name, *parts, value=node.value)
        return Expression(self.text, replacement[self.root])

    def fold(self, variables: Mapping[str, T]) -> T | float:
        """Return the expression in another arithmetic.

        The variables need Python's operators and NumPy's functions.
        """
        values: dict[Term, Any] = {}
        for node in self.order:
            if node.parts:
                operands = [values[part] for part in node.parts]
                values[node] = OPERATIONS[node.name](*operands)
            elif node.name == NUMBER:
                values[node] = node.value
            else:
                values[node] = variables[node.name]
        result: T | float = values[self.root]
        return result


def _unpacked(text: str, nodes: list[tuple[str, list[int], float]]) -> Expression:
    terms: list[Term] = []
    for name, positions, value in nodes:
        parts = [terms[position] for position in positions]
        terms.append(made(name, *parts, value=value))
    return Expression(text, terms[-1])


Scalar = float | Expression
"""A quantity that is one number or an expression in x and y."""


def value_of(scalar: Scalar, x: ArrayLike, y: ArrayLike) -> Array:
    """Return the values of a number or an expression at the points (x, y), broadcast."""
    if isinstance(scalar, Expression):
        return scalar.evaluate(x, y)
    return np.full(np.broadcast_shapes(np.shape(x), np.shape(y)), float(scalar))


def scalar(root: Term, text: str = "derived") -> Scalar:
    """Return the number that a term is, else an expression."""
    if root.name == NUMBER:
        return root.value
    return Expression(text, root)


def parse(text: str, names: tuple[str, ...] = ()) -> Expression:
    """Return the expression of a text.

    names: further names allowed beside x and y; they are variables until the expression is `bound`

    Raises ExpressionError, which says what is wrong, where, and what is allowed.
    """
    if len(text) > MAX_LENGTH:
        raise ExpressionError(
            f"the expression has {len(text)} characters; at most {MAX_LENGTH} are allowed"
        )
    tokens = _tokens(text, names)
    source = " ".join(tokens)
    try:
        tree = ast.parse(source, mode="eval")
    except SyntaxError as error:
        column = error.offset or len(source)
        raise _unreadable_near(error.msg, tokens, source, column) from None
    except (MemoryError, RecursionError):
        raise _unreadable_near("it is nested too deeply", tokens, source, len(source)) from None
    return Expression(text.strip(), _node(tree.body, 0))


def _tokens(text: str, names: tuple[str, ...]) -> list[str]:
    """Return the tokens as Python writes them.

    Raises ExpressionError for unknown names, numbers beyond the floats, and two operands without an
    operator between them ("2x", "sin x").
    """
    tokens: list[str] = []
    position = 0
    previous = ""
    while position < len(text):
        match = TOKEN.match(text, position)
        if match is None:
            raise _misplaced(text[position])
        kind = str(match.lastgroup)
        token = match.group()
        position = match.end()
        if kind == "number" and not math.isfinite(float(token)):
            raise ExpressionError(
                f"the number {token[:20]} is too large for a float (at most 1.8e308)"
            )
        if kind == "name":
            _check_name(token, names, previous)
        _check_neighbours(previous, kind, token)
        if kind != "space":
            tokens.append(AS_PYTHON.get(kind, str)(token))
            previous = token
    if not tokens:
        raise ExpressionError(f"the expression is empty; {ALLOWED}")
    return tokens


def _misplaced(character: str) -> ExpressionError:
    hint = ""
    if character in LOOKALIKES:
        hint = f"write {LOOKALIKES[character]} instead; "
    return ExpressionError(
        f"the character {character!r} has no place in an expression; {hint}{ALLOWED}"
    )


def _check_name(name: str, names: tuple[str, ...], previous: str) -> None:
    """Raise ExpressionError with a hint for a name that is not known."""
    known_names = (*names, *VARIABLES, *CONSTANTS, *FUNCTIONS)
    if name in known_names:
        return
    similar = difflib.get_close_matches(name, known_names, n=1)
    if not similar:
        similar = difflib.get_close_matches(name.lower(), known_names, n=1)
    hint = f"did you mean {similar[0]!r}? " if similar else ""
    if previous[:1].isdigit():
        hint = "a number with a unit needs a name under parameters, a product its *; "
    numbers = ", ".join(("numbers", *names))
    allowed = ALLOWED.replace("numbers,", f"{numbers},")
    raise ExpressionError(f"unknown name {name[:40]!r}; {hint}{allowed}")


def _check_neighbours(previous: str, kind: str, token: str) -> None:
    """Raise ExpressionError for two operands without an operator between them."""
    begins_operand = kind in ("number", "name")
    if previous in FUNCTIONS:
        if begins_operand:
            raise ExpressionError(f"{previous} needs parentheses: {previous}({token[:20]} ...)")
        return
    ends_operand = previous[-1:].isalnum() or previous[-1:] in ("_", ".", ")")
    if previous and ends_operand and (begins_operand or token == "("):
        raise ExpressionError(
            f"an operator is missing between {previous[:20]!r} and {token[:20]!r}; "
            f"write {previous[:20]}*{token[:20]} to multiply"
        )


def _node(node: ast.AST, depth: int) -> Term:
    """Return the term of a node of Python's tree, without simplification.

    Simplification would hide parts that have no value.
    """
    if depth > MAX_DEPTH:
        raise ExpressionError(
            f"the expression is nested too deeply (limit {MAX_DEPTH} levels); split or shorten it"
        )
    match node:
        case ast.Constant(value=float(value)):
            return number(value)
        case ast.Name(id=name) if name[1:] in CONSTANTS:
            return number(CONSTANTS[name[1:]])
        case ast.Name(id=name) if name[1:] in FUNCTIONS:
            raise ExpressionError(f"{name[1:]} is a function: write {name[1:]}(...)")
        case ast.Name(id=name):
            return variable(name[1:])
        case ast.UnaryOp(operand=operand):
            inner = _node(operand, depth + 1)
            return made(NEGATIVE, inner) if isinstance(node.op, ast.USub) else inner
        case ast.BinOp(left=left, right=right) if type(node.op) in OPERATORS:
            operator_name = OPERATORS[type(node.op)]
            return made(operator_name, _node(left, depth + 1), _node(right, depth + 1))
        case ast.Call(func=ast.Name(id=name), args=arguments) if name[1:] in FUNCTIONS:
            _check_argument_count(name[1:], len(arguments))
            return call(name[1:], *(_node(argument, depth + 1) for argument in arguments))
    raise _unreadable("a list")


def _check_argument_count(function: str, count: int) -> None:
    if function in ("min", "max"):
        is_right = count >= 2
        expected = "two or more arguments"
    elif function == "atan2":
        is_right = count == 2
        expected = "two arguments, atan2(y, x)"
    else:
        is_right = count == 1
        expected = "one argument"
    if not is_right:
        raise ExpressionError(f"{function} takes {expected}, not {count}")


def _unreadable(why: str) -> ExpressionError:
    return ExpressionError(f"the expression cannot be read ({why}); {ALLOWED}")


def _unreadable_near(why: str, tokens: list[str], source: str, column: int) -> ExpressionError:
    """Return the error for the token at a column of the source, counted from 1."""
    token = tokens[source[: column - 1].count(" ")]
    return _unreadable(f"{why}, near {token.removeprefix('_')[:20]!r}")


MIN_EIGENVALUE = 1e-8
"""Modes with a smaller eigenvalue, relative to the largest, are left out.

The variance that is lost is of that order.
"""
SPACING = 0.5
"""Distance of the points of a random field over its correlation length.

Covariances are then right to 1e-3.
"""


def random_field(
    points: NDArray[np.float64], scatter: float, length: float, seed: int
) -> Expression:
    """Return a lognormal field exp(ζ g − ζ²/2) of mean 1.

    Its coefficient of variation is `scatter`, ζ² = ln(1 + scatter²). g is Gaussian with mean 0,
    variance 1 and covariance C(p, q) = exp(−|p − q|²/length²). Its Karhunen–Loève expansion on the
    points (n, 2) [m] is g(p) = Σ_k √λ_k φ_k(p) ζ_k with λ_k, φ_k the eigenpairs of C there, and
    between them φ_k(p) = Σ_j C(p, p_j) φ_k(p_j)/λ_k (Nyström). ζ_k = φ_kᵀ w with one w for the
    seed, so that the field does not depend on how eigenvectors are chosen.
    Literature: Ghanem & Spanos, Stochastic Finite Elements (1991), ch. 2.
    """
    squared_distance = ((points[:, None] - points[None]) ** 2).sum(axis=-1)
    eigenvalues, eigenvectors = np.linalg.eigh(np.exp(-squared_distance / length**2))
    is_kept = eigenvalues > MIN_EIGENVALUE * eigenvalues[-1]
    modes = eigenvectors[:, is_kept]
    amplitudes = modes.T @ np.random.default_rng(seed).standard_normal(len(points))
    weights = modes @ (amplitudes / np.sqrt(eigenvalues[is_kept]))

    zeta = math.sqrt(math.log1p(scatter**2))
    x = variable("x")
    y = variable("y")
    exponent = number(-0.5 * zeta**2)
    for (x_j, y_j), weight in zip(points.tolist(), (zeta * weights).tolist(), strict=True):
        covariance = call("exp", -((x - x_j) ** 2 + (y - y_j) ** 2) / length**2)
        exponent = exponent + weight * covariance
    return Expression("random field", call("exp", exponent))


def product(first: Scalar, second: Scalar) -> Scalar:
    """Return the product of two numbers or expressions."""
    return scalar(term(first) * term(second), f"({first})*({second})")


# -- derivatives


def step(s: Term) -> Term:
    """Return the term that is 1 where s ≥ 0 and 0 elsewhere.

    It is 1 − atan2(0, s + 0)/π, which is never 0/0; atan2(0, −0) alone would be π.
    """
    return 1.0 - call("atan2", ZERO, made("+", s, ZERO)) / math.pi


@lru_cache(maxsize=512)  # scenes of a sweep ask for the same ones
def derivative(root: Term, variable: str) -> Term:
    """Return ∂/∂x or ∂/∂y of a term."""
    slopes: dict[Term, Term] = {}
    for node in ordered(root):
        part_slopes = [slopes[part] for part in node.parts]
        slopes[node] = _slope(node, part_slopes, variable)
    return slopes[root]


def gradient(root: Term) -> tuple[Term, Term]:
    """Return (∂/∂x, ∂/∂y) of a term."""
    return derivative(root, "x"), derivative(root, "y")


def _slope(node: Term, part_slopes: list[Term], variable: str) -> Term:
    """Return the derivative of a node from those of its parts."""
    if not part_slopes:
        return ONE if node.name == variable else ZERO
    if all(slope is ZERO for slope in part_slopes):
        return ZERO
    a, b = node.parts[0], node.parts[-1]
    da, db = part_slopes[0], part_slopes[-1]
    match node.name:
        case "~":
            return -da
        case "+":
            return da + db
        case "-":
            return da - db
        case "*":
            return da * b + a * db
        case "/":
            return (da - node * db) / b
        case "**":
            return b * a ** (b - 1.0) * da + node * call("log", a) * db
        case "atan2":
            return (da * b - a * db) / (a**2 + b**2)
        case "min":
            return db + step(-(a - b)) * (da - db)
        case "max":
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


def value_and_gradient(function: Scalar, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Return the values (…) and the gradient (2, …) of a number or an expression at points.

    They are not finite where the function has none.
    """
    slopes: tuple[Scalar, Scalar] = (0.0, 0.0)
    if isinstance(function, Expression):
        slopes = _gradient(function)
    values = value_of(function, x, y)
    return values, np.array([value_of(slope, x, y) for slope in slopes])


@lru_cache(maxsize=64)
def _gradient(expression: Expression) -> tuple[Scalar, Scalar]:
    by_x, by_y = gradient(term(expression))
    return scalar(by_x), scalar(by_y)


def is_linear(scalar: Scalar) -> bool:
    """Return whether a scalar is known to be a polynomial of degree 1 at most."""
    if not isinstance(scalar, Expression):
        return True
    return all(isinstance(slope, float) for slope in _gradient(scalar))
