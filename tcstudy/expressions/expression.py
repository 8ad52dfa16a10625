"""Expressions in x and y, such as "0.3*sin(pi*x)": their texts, trees, values in any arithmetic,
and derivatives.

Grammar: numbers, x, y, pi, e, the operators + - * / ** (or ^) and parentheses, and the functions of
FUNCTIONS. The text is split into these tokens and never executed as code; Python's parser makes a
tree of them, of which the nodes named here are taken, and that is folded over NumPy arrays or any
other arithmetic. Left out on purpose: comparisons, names of the user's own, attribute access,
complex numbers.

Trees are made of terms that are computed with like numbers: derivatives, derived loads and random
fields read as their formulas. Equal terms are one object as long as one of them is in use, and
every term is visited once, so that cost is the number of different terms, not the length of the
expression written out. Nothing here recurses over terms.

Derivatives follow the rules of calculus; abs, min and max are differentiated almost everywhere, and
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

_NAMES = [
    "sin",
    "cos",
    "tan",
    "asin",
    "acos",
    "atan",
    "atan2",
    "exp",
    "log",
    "sqrt",
    "abs",
    "sinh",
    "cosh",
    "tanh",
]
FUNCTIONS: dict[str, Callable[..., Any]] = {name: getattr(np, name) for name in _NAMES}
FUNCTIONS |= {"min": np.minimum, "max": np.maximum}
NUMBER, NEGATIVE = "#", "~"
OPERATIONS = FUNCTIONS | {
    NEGATIVE: operator.neg,
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
}
OPERATIONS |= {"/": operator.truediv, "**": operator.pow}


@dataclass(frozen=True, eq=False)
class Term:
    """A part of an expression. Made by `number`, `variable`, `call` and arithmetic, numbers beside
    it being terms, too.

    name:  of a coordinate, or of what makes the term of its parts, one of OPERATIONS; NUMBER of a number
    parts: the terms that it is made of;  value: of a number

    Arithmetic simplifies: a + 0, a − a, 1·a, 0·a, a/1, a^0, a^1 and −(−a) vanish, numbers in a
    product come first. 0·a = 0 also where a has no value.
    """

    name: str
    parts: tuple[Term, ...] = ()
    value: float = 0.0
    __array_ufunc__ = None  # a NumPy number beside a term leaves the operation to it

    def __neg__(self) -> Term:
        return self.parts[0] if self.name == NEGATIVE else made(NEGATIVE, self)

    def __add__(self, other: Term | float) -> Term:
        a, b = self, term(other)
        if a is ZERO or b is ZERO:
            return b if a is ZERO else a
        return a - b.parts[0] if b.name == NEGATIVE else made("+", a, b)

    def __sub__(self, other: Term | float) -> Term:
        a, b = self, term(other)
        if a is b:
            return ZERO
        if a is ZERO or b is ZERO:
            return a if b is ZERO else -b
        return a + b.parts[0] if b.name == NEGATIVE else made("-", a, b)

    def __mul__(self, other: Term | float) -> Term:
        a, b = (term(other), self) if term(other).name == NUMBER else (self, term(other))
        if a is ZERO or b is ZERO:
            return ZERO
        if a is ONE:
            return b
        if a.name == NUMBER and b.name == "*" and b.parts[0].name == NUMBER:
            a, b = number(a.value * b.parts[0].value), b.parts[1]
        return made("*", a, b)

    def __truediv__(self, other: Term | float) -> Term:
        a, b = self, term(other)
        return a if b is ONE or a is ZERO else made("/", a, b)

    def __pow__(self, other: Term | float) -> Term:
        b = term(other)
        if b is ZERO:
            return ONE
        return self if b is ONE else made("**", self, b)

    def __rsub__(self, other: float) -> Term:
        return term(other) - self

    def __rtruediv__(self, other: float) -> Term:
        return term(other) / self

    __radd__, __rmul__ = __add__, __mul__


_TERMS: WeakValueDictionary[tuple[object, ...], Term] = WeakValueDictionary()


def made(name: str, *parts: Term, value: float = 0.0) -> Term:
    """The one term like this; the number that it is, if all its parts are numbers."""
    if parts and all(part.name == NUMBER for part in parts):
        with np.errstate(all="ignore"):  # floats, as no power of integers would ever end
            return number(float(OPERATIONS[name](*(np.float64(part.value) for part in parts))))
    return _TERMS.setdefault((name, parts, value), Term(name, parts, value))


def number(value: float) -> Term:
    """A constant."""
    return made(NUMBER, value=float(value) + 0.0)  # −0 and 0 are one constant


def variable(name: str) -> Term:
    """x or y."""
    return made(name)


def call(function: str, first: Term | float, *others: Term | float) -> Term:
    """function(arguments); min and max of several are those of the first ones and the last."""
    if function in ("min", "max"):
        return reduce(lambda a, b: made(function, a, term(b)), others, term(first))
    return made(function, term(first), *map(term, others))


def term(of: Scalar | Term) -> Term:
    """A number or an expression as a term."""
    return of if isinstance(of, Term) else of.root if isinstance(of, Expression) else number(of)


ZERO, ONE = number(0.0), number(1.0)
Order = tuple[Term, ...]
"""The terms of a tree, each once, every one after its parts; the root is the last."""


def ordered(root: Term) -> Order:
    """The terms of a tree, each once, every one after its parts."""
    done: dict[Term, None] = {}
    stack = [(root, False)]
    while stack:
        node, ready = stack.pop()
        if node in done:
            continue
        if ready:
            done[node] = None
        else:
            stack.append((node, True))
            stack.extend((child, False) for child in reversed(node.parts))
    return tuple(done)


T = TypeVar("T")

MAX_LENGTH = 2000
MAX_DEPTH = 120

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
    "name": "_{}".format,  # of which none is a word of Python
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
    """A function of x and y, made by `parse` or of a tree, by which it is equal to others.

    text: as it was read, or what it is, in words
    """

    text: str = field(compare=False)
    root: Term = field(repr=False)

    def __str__(self) -> str:
        return self.text

    def __reduce__(self) -> tuple[Callable[..., Expression], tuple[str, Any]]:
        place = {node: i for i, node in enumerate(self.order)}  # so that nothing recurses
        nodes = [(one.name, [place[part] for part in one.parts], one.value) for one in self.order]
        return _unpacked, (self.text, nodes)

    @cached_property
    def order(self) -> Order:
        """The terms, each once, every one after its parts."""
        return ordered(self.root)

    @cached_property
    def variables(self) -> frozenset[str]:
        """The variables that occur: a subset of {"x", "y"}."""
        return frozenset(node.name for node in self.order if not node.parts and node.name != NUMBER)

    @property
    def constant(self) -> float | None:
        """The value if no variable occurs (possibly not finite), else None."""
        return self.root.value if self.root.name == NUMBER else None

    def evaluate(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Values at the points (x, y), broadcast against each other; not finite where the
        expression is not."""
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        with np.errstate(all="ignore"):
            values = self.fold({"x": x, "y": y})
        return np.array(np.broadcast_to(np.asarray(values, dtype=float), x.shape))

    def bound(self, values: Mapping[str, float]) -> Expression:
        """The expression with numbers in place of names."""
        new: dict[Term, Term] = {}
        for node in self.order:
            parts = (new[part] for part in node.parts)
            new[node] = (
                number(values[node.name])
                if node.name in values
                else made(node.name, *parts, value=node.value)
            )
        return Expression(self.text, new[self.root])

    def fold(self, variables: Mapping[str, T]) -> T | float:
        """The expression in another arithmetic, that of Python's operators and NumPy's functions on
        the variables."""
        values: dict[Term, Any] = {}
        for node in self.order:
            if node.parts:
                values[node] = OPERATIONS[node.name](*(values[part] for part in node.parts))
            else:
                values[node] = node.value if node.name == NUMBER else variables[node.name]
        found: T | float = values[self.root]
        return found


def _unpacked(text: str, nodes: list[tuple[str, list[int], float]]) -> Expression:
    terms = list[Term]()
    for name, parts, value in nodes:
        terms.append(made(name, *(terms[part] for part in parts), value=value))
    return Expression(text, terms[-1])


Scalar = float | Expression
"""A quantity that is one number or an expression in x and y."""


def value_of(scalar: Scalar, x: ArrayLike, y: ArrayLike) -> Array:
    """Values of a number or an expression at the points (x, y), broadcast against each other."""
    if isinstance(scalar, Expression):
        return scalar.evaluate(x, y)
    return np.full(np.broadcast_shapes(np.shape(x), np.shape(y)), float(scalar))


def scalar(of: Term, text: str = "derived") -> Scalar:
    """A number if the term is one, else an expression."""
    return of.value if of.name == NUMBER else Expression(text, of)


def parse(text: str, names: tuple[str, ...] = ()) -> Expression:
    """The expression a text stands for; raises ExpressionError with what is wrong, where, and what
    is allowed.

    names: numbers that it may have beside x and y; they are variables until it is `bound`
    """
    if len(text) > MAX_LENGTH:
        raise ExpressionError(
            f"the expression has {len(text)} characters; at most {MAX_LENGTH} are allowed"
        )
    tokens = _tokens(text, names)
    source = " ".join(tokens)
    try:
        tree = ast.parse(source, mode="eval")
    except (
        SyntaxError,
        MemoryError,
        RecursionError,
    ) as error:  # the last two of what is nested too deeply
        place = source[: (getattr(error, "offset", 0) or len(source)) - 1].count(" ")
        why = error.msg if isinstance(error, SyntaxError) else "it is nested too deeply"
        raise _unreadable(f"{why}, near {tokens[place].removeprefix('_')[:20]!r}") from None
    return Expression(text.strip(), _node(tree.body, 0))


def _tokens(text: str, names: tuple[str, ...]) -> list[str]:
    """The tokens as Python writes them; unknown names, numbers beyond the floats, and two operands
    without an operator between ("2x", "sin x") are refused."""
    found, at, before = list[str](), 0, ""
    known = (*names, *VARIABLES, *CONSTANTS, *FUNCTIONS)
    while at < len(text):
        if (match := TOKEN.match(text, at)) is None:
            hint = f"write {LOOKALIKES[text[at]]} instead; " if text[at] in LOOKALIKES else ""
            raise ExpressionError(
                f"the character {text[at]!r} has no place in an expression; {hint}{ALLOWED}"
            )
        kind, token, at = match.lastgroup, match.group(), match.end()
        if kind == "number" and not math.isfinite(float(token)):
            raise ExpressionError(
                f"the number {token[:20]} is too large for a float (at most 1.8e308)"
            )
        if kind == "name" and token not in known:
            near = difflib.get_close_matches(token, known, n=1) or difflib.get_close_matches(
                token.lower(), known, n=1
            )
            hint = f"did you mean {near[0]!r}? " if near else ""
            if before[:1].isdigit():
                hint = "a number with a unit needs a name under parameters, a product its *; "
            allowed = ALLOWED.replace("numbers,", ", ".join(("numbers", *names)) + ",")
            raise ExpressionError(f"unknown name {token[:40]!r}; {hint}{allowed}")
        if before in FUNCTIONS and kind in ("number", "name"):
            raise ExpressionError(f"{before} needs parentheses: {before}({token[:20]} ...)")
        follows = before not in FUNCTIONS and (
            before[-1:].isalnum() or before[-1:] in ("_", ".", ")")
        )
        if before and follows and (kind in ("number", "name") or token == "("):
            what = f"an operator is missing between {before[:20]!r} and {token[:20]!r}"
            raise ExpressionError(f"{what}; write {before[:20]}*{token[:20]} to multiply")
        if kind != "space":
            found.append(AS_PYTHON.get(str(kind), str)(token))
            before = token
    if not found:
        raise ExpressionError(f"the expression is empty; {ALLOWED}")
    return found


def _node(node: ast.AST, depth: int) -> Term:
    """Our term for one of Python's nodes, as it is written: what parts have no value is not to
    vanish."""
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
            return made(OPERATORS[type(node.op)], _node(left, depth + 1), _node(right, depth + 1))
        case ast.Call(func=ast.Name(id=name), args=args) if name[1:] in FUNCTIONS:
            count, words = (
                (2, "two arguments, atan2(y, x)") if name == "_atan2" else (1, "one argument")
            )
            if name in ("_min", "_max"):
                count, words = max(2, len(args)), "two or more arguments"
            if len(args) != count:
                raise ExpressionError(f"{name[1:]} takes {words}, not {len(args)}")
            return call(name[1:], *(_node(one, depth + 1) for one in args))
    raise _unreadable("a list")


def _unreadable(why: str) -> ExpressionError:
    return ExpressionError(f"the expression cannot be read ({why}); {ALLOWED}")


KEPT = 1e-8
"""Eigenvalue, of the largest, down to which modes are kept; what is left out has a variance of that
order."""
SPACING = 0.5
"""Distance of the points that a field is made of, over its correlation length: covariances then are
right to 1e-3."""


def random_field(
    points: NDArray[np.float64], scatter: float, length: float, seed: int
) -> Expression:
    """A lognormal field exp(ζ g − ζ²/2) of mean 1 and coefficient of variation `scatter`, ζ² = ln(1
    + scatter²).

    g is Gaussian with mean 0, variance 1 and covariance C(p, q) = exp(−|p − q|²/length²), by its
    Karhunen–Loève expansion on the points (n, 2) [m]: g(p) = Σ_k √λ_k φ_k(p) ζ_k with λ_k, φ_k the
    eigenpairs of C there and between them φ_k(p) = Σ_j C(p, p_j) φ_k(p_j)/λ_k (Nyström). ζ_k = φ_kᵀ
    w with one w for the seed, so that the field does not depend on how eigenvectors are chosen.
    Literature: Ghanem & Spanos, Stochastic Finite Elements (1991), ch. 2.
    """
    square = ((points[:, None] - points[None]) ** 2).sum(axis=-1)
    values, vectors = np.linalg.eigh(np.exp(-square / length**2))
    kept = values > KEPT * values[-1]
    drawn = vectors[:, kept].T @ np.random.default_rng(seed).standard_normal(len(points))
    weights = vectors[:, kept] @ (drawn / np.sqrt(values[kept]))
    zeta = math.sqrt(math.log1p(scatter**2))
    total, x, y = number(-0.5 * zeta**2), variable("x"), variable("y")
    for (x_j, y_j), weight in zip(points.tolist(), (zeta * weights).tolist(), strict=True):
        total = total + weight * call("exp", -((x - x_j) ** 2 + (y - y_j) ** 2) / length**2)
    return Expression("random field", call("exp", total))


def product(one: Scalar, other: Scalar) -> Scalar:
    """A number or an expression times another."""
    return scalar(term(one) * term(other), f"({one})*({other})")


# -- derivatives
# -------------------------------------------------------------------------------------


def step(s: Term) -> Term:
    """1 where s ≥ 0, 0 elsewhere: 1 − atan2(0, s + 0)/π, which is never 0/0; atan2(0, −0) alone
    would be π."""
    return 1.0 - call("atan2", ZERO, made("+", s, ZERO)) / math.pi


@lru_cache(maxsize=512)  # scenes of a sweep ask for the same ones
def derivative(of: Term, by: str) -> Term:
    """∂/∂x or ∂/∂y."""
    slopes: dict[Term, Term] = {}
    for node in ordered(of):
        slopes[node] = _slope(node, [slopes[part] for part in node.parts], by)
    return slopes[of]


def gradient(of: Term) -> tuple[Term, Term]:
    """(∂/∂x, ∂/∂y)."""
    return derivative(of, "x"), derivative(of, "y")


def _slope(node: Term, slopes: list[Term], by: str) -> Term:
    """The derivative of a node from those of its parts."""
    if not slopes:
        return ONE if node.name == by else ZERO
    if all(slope is ZERO for slope in slopes):
        return ZERO
    a, b, da, db = node.parts[0], node.parts[-1], slopes[0], slopes[-1]
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


def value_and_gradient(of: Scalar, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Values (…) and gradient (2, …) of a number or an expression at points; not finite where it
    has none."""
    slopes = _gradient(of) if isinstance(of, Expression) else (0.0, 0.0)
    return value_of(of, x, y), np.array([value_of(slope, x, y) for slope in slopes])


@lru_cache(maxsize=64)
def _gradient(expression: Expression) -> tuple[Scalar, Scalar]:
    by_x, by_y = gradient(term(expression))
    return scalar(by_x), scalar(by_y)


def is_linear(scalar: Scalar) -> bool:
    """Whether a scalar is known to be a polynomial of degree 1 at most."""
    return not isinstance(scalar, Expression) or all(
        isinstance(slope, float) for slope in _gradient(scalar)
    )
