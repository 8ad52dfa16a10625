"""Expressions in x and y: their trees, their texts, and random ones.

The tree of an expression in x and y: its nodes, its value in any arithmetic, its text.

A tree may share nodes (derivatives do): every node is visited once, so the cost is the number of
different nodes, not the length of the expression written out. Nothing here recurses, so that depth does not matter.

Expressions in x and y, such as "0.3*sin(pi*x)": read from text, never executed as code.

Grammar: numbers, x, y, pi, e, the operators + - * / ** (or ^) and parentheses, and the functions of FUNCTIONS.
The text is split into these tokens; Python's parser makes a tree of them, of which the nodes named here are taken, and
that is folded over NumPy arrays or any other arithmetic.
Left out on purpose: comparisons, names of the user's own, attribute access, complex numbers.

A random field along a line, as an expression in x and y: the same at every point of every mesh.
"""

from __future__ import annotations

import ast
import difflib
import hashlib
import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

MAX_INTEGER_POWER = 64
ARITHMETIC = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}


@dataclass(frozen=True, eq=False)
class TreeNode:
    """A part of an expression.

    kind:  "Number", "Coordinate", "Negative" (−part), "Binary" (left operator right) or "Call" (function(parts))
    name:  of the coordinate, the operator (one of + - * / **) or the function
    parts: the nodes that it is made of;  value: of a number
    """

    kind: Literal["Number", "Coordinate", "Negative", "Binary", "Call"]
    name: str = ""
    parts: tuple[TreeNode, ...] = ()
    value: float = 0.0

    @property
    def label(self) -> str:
        """The name, or the number as text."""
        return repr(float(self.value)) if self.kind == "Number" else self.name


Order = tuple[TreeNode, ...]
"""The nodes of a tree, each once, every node after its parts; the root is the last."""


def ordered(roots: Iterable[TreeNode]) -> Order:
    """The nodes of one or more trees, each once, every node after its parts."""
    done: dict[TreeNode, None] = {}
    stack = [(root, False) for root in reversed(list(roots))]
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


def applied(node: TreeNode, values: list[Any], functions: Mapping[str, Callable[..., Any]]) -> Any:
    """One node applied to the values of its parts."""
    match node.kind, node.name:
        case "Number", _:
            return np.float64(node.value)
        case "Negative", _:
            return -values[0]
        case "Call", "min" | "max":
            return reduce(functions[node.name], sorted(values, key=lambda value: type(value) is float))
        case "Call", _:
            return functions[node.name](*values)
    if node.name != "**":
        return ARITHMETIC[node.name](*values)
    left, right = values
    whole = type(right) is float and right.is_integer() and abs(right) <= MAX_INTEGER_POWER
    return left ** (int(right) if whole else right)


def to_text(order: Order, longest: int) -> str:
    """The tree as text that `parse` reads back. What has more than `longest` characters ends in a hash of all nodes, so
    that trees of one text are one function."""
    done: dict[TreeNode, str] = {}
    for node in order:
        parts = [done[part] for part in node.parts]
        if node.kind != "Call":
            alone = [part.kind in ("Coordinate", "Call") or part.label[:1].isdigit() for part in node.parts]
            parts = [text if whole else f"({text})" for text, whole in zip(parts, alone, strict=True)]
        match node.kind:
            case "Number" | "Coordinate":
                text = node.label
            case "Negative":
                text = f"-{parts[0]}"
            case "Call":
                text = f"{node.name}({', '.join(parts)})"
            case _:
                text = f" {node.name} ".replace("**", "^").join(parts)
        if len(text) > longest:  # before the texts of shared parts grow without bound
            place = {node: i for i, node in enumerate(order)}
            nodes = "\n".join(f"{one.label}{one.kind}{[place[part] for part in one.parts]}" for one in order)
            digest = hashlib.sha256(nodes.encode()).hexdigest()[:16]
            return f"{text[:60]} … [{len(order)} operations, {digest}]"
        done[node] = text
    return done[order[-1]]


T = TypeVar("T")

MAX_LENGTH = 2000
MAX_DEPTH = 120

VARIABLES = ("x", "y")
CONSTANTS = {"pi": math.pi, "e": math.e}
_NAMES = ["sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "sqrt", "abs", "sinh", "cosh", "tanh"]
FUNCTIONS: dict[str, Callable[..., Any]] = {name: getattr(np, name) for name in _NAMES}
FUNCTIONS |= {"min": np.minimum, "max": np.maximum}

TOKEN = re.compile(
    r"(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z_0-9]*)|(?P<power>\*\*|\^)|(?P<mark>[-+*/(),])|(?P<space>\s+)"
)
LOOKALIKES = dict(zip("π−–·×÷²³√", ("pi", "-", "-", "*", "*", "/", "^2", "^3", "sqrt()"), strict=True))
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
    """A function of x and y; equal and hashed by its text. Made by `parse`, or by `of_tree` from a tree."""

    text: str
    root: TreeNode = field(compare=False, repr=False)

    def __str__(self) -> str:
        return self.text

    def __reduce__(self) -> tuple[Callable[..., Expression], tuple[str, Any]]:
        return _unpacked, (self.text, self.order)  # every node after its parts, so that nothing recurses

    @cached_property
    def order(self) -> Order:
        """The nodes, each once, every node after its parts."""
        return ordered((self.root,))

    @cached_property
    def variables(self) -> frozenset[str]:
        """The variables that occur: a subset of {"x", "y"}."""
        return frozenset(node.name for node in self.order if node.kind == "Coordinate")

    @cached_property
    def constant(self) -> float | None:
        """The value if no variable occurs (possibly not finite), else None."""
        return None if self.variables else float(self.fold({}, {}))

    def evaluate(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        """Values at the points (x, y), broadcast against each other; not finite where the expression is not."""
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        with np.errstate(all="ignore"):
            values = self.fold({"x": x, "y": y}, FUNCTIONS)
        return np.array(np.broadcast_to(np.asarray(values, dtype=float), x.shape))

    def bound(self, values: Mapping[str, float]) -> Expression:
        """The expression with numbers in place of names."""
        made: dict[TreeNode, TreeNode] = {}
        for node in self.order:
            named = node.kind == "Coordinate" and node.name in values
            other = replace(node, parts=tuple(made[part] for part in node.parts))
            made[node] = TreeNode("Number", value=values[node.name]) if named else other
        return of_tree(made[self.root])

    def fold(self, variables: Mapping[str, T], functions: Mapping[str, Callable[..., T]]) -> T | float:
        """The expression in another arithmetic: Python's operators on the variables, functions by name.

        Parts without a variable arrive as floats, so functions are called only with at least one T.
        min and max are called with two arguments, the first a T. A power with a constant whole exponent of at most
        MAX_INTEGER_POWER in size gets an int as exponent.
        """
        values: dict[TreeNode, Any] = {}
        for node in self.order:
            parts = [values[part] for part in node.parts]
            if node.kind == "Coordinate":
                values[node] = variables[node.name]
            elif all(type(part) is float for part in parts):  # floats, as no power of integers would ever end
                with np.errstate(all="ignore"):
                    values[node] = float(applied(node, [np.float64(part) for part in parts], FUNCTIONS))
            else:
                values[node] = applied(node, parts, functions)
        made: T | float = values[self.root]
        return made


Scalar = float | Expression
"""A quantity that is one number or an expression in x and y."""


def value_of(scalar: Scalar, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
    """Values of a number or an expression at the points (x, y), broadcast against each other."""
    if isinstance(scalar, Expression):
        return scalar.evaluate(x, y)
    return np.full(np.broadcast_shapes(np.shape(x), np.shape(y)), float(scalar))


def of_tree(root: TreeNode) -> Expression:
    """The expression of a tree, with a text that `parse` reads back unless it is longer than MAX_LENGTH."""
    return Expression(to_text(ordered((root,)), MAX_LENGTH), root)


def _unpacked(text: str, order: Order) -> Expression:
    return Expression(text, order[-1])


def parse(text: str, names: tuple[str, ...] = ()) -> Expression:
    """The expression a text stands for; raises ExpressionError with what is wrong, where, and what is allowed.

    names: numbers that it may have beside x and y; they are variables until it is `bound`
    """
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"the expression has {len(text)} characters; at most {MAX_LENGTH} are allowed")
    tokens = _tokens(text, names)
    source = " ".join(tokens)
    try:
        tree = ast.parse(source, mode="eval")
    except (SyntaxError, MemoryError, RecursionError) as error:  # the last two of what is nested too deeply
        place = source[: (getattr(error, "offset", 0) or len(source)) - 1].count(" ")
        why = error.msg if isinstance(error, SyntaxError) else "it is nested too deeply"
        raise _unreadable(f"{why}, near {tokens[place].removeprefix('_')[:20]!r}") from None
    return Expression(text.strip(), _node(tree.body, 0))


def _tokens(text: str, names: tuple[str, ...]) -> list[str]:
    """The tokens as Python writes them; unknown names, numbers beyond the floats, and two operands without an operator
    between ("2x", "sin x") are refused."""
    found, at, before = list[str](), 0, ""
    known = (*names, *VARIABLES, *CONSTANTS, *FUNCTIONS)
    while at < len(text):
        if (match := TOKEN.match(text, at)) is None:
            hint = f"write {LOOKALIKES[text[at]]} instead; " if text[at] in LOOKALIKES else ""
            raise ExpressionError(f"the character {text[at]!r} has no place in an expression; {hint}{ALLOWED}")
        kind, token, at = match.lastgroup, match.group(), match.end()
        if kind == "number" and not math.isfinite(float(token)):
            raise ExpressionError(f"the number {token[:20]} is too large for a float (at most 1.8e308)")
        if kind == "name" and token not in known:
            near = difflib.get_close_matches(token, known, n=1) or difflib.get_close_matches(token.lower(), known, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            if before[:1].isdigit():
                hint = "a number with a unit needs a name under parameters, a product its *; "
            allowed = ALLOWED.replace("numbers,", ", ".join(("numbers", *names)) + ",")
            raise ExpressionError(f"unknown name {token[:40]!r}; {hint}{allowed}")
        if before in FUNCTIONS and kind in ("number", "name"):
            raise ExpressionError(f"{before} needs parentheses: {before}({token[:20]} ...)")
        follows = before not in FUNCTIONS and (before[-1:].isalnum() or before[-1:] in ("_", ".", ")"))
        if before and follows and (kind in ("number", "name") or token == "("):
            what = f"an operator is missing between {before[:20]!r} and {token[:20]!r}"
            raise ExpressionError(f"{what}; write {before[:20]}*{token[:20]} to multiply")
        if kind != "space":
            found.append(AS_PYTHON.get(str(kind), str)(token))
            before = token
    if not found:
        raise ExpressionError(f"the expression is empty; {ALLOWED}")
    return found


def _node(node: ast.AST, depth: int) -> TreeNode:
    """Our node for one of Python's."""
    if depth > MAX_DEPTH:
        raise ExpressionError(f"the expression is nested too deeply (limit {MAX_DEPTH} levels); split or shorten it")
    match node:
        case ast.Constant(value=float(value)):
            return TreeNode("Number", value=value)
        case ast.Name(id=name) if name[1:] in CONSTANTS:
            return TreeNode("Number", value=CONSTANTS[name[1:]])
        case ast.Name(id=name) if name[1:] in FUNCTIONS:
            raise ExpressionError(f"{name[1:]} is a function: write {name[1:]}(...)")
        case ast.Name(id=name):
            return TreeNode("Coordinate", name[1:])
        case ast.UnaryOp(operand=operand):
            inner = _node(operand, depth + 1)
            return TreeNode("Negative", parts=(inner,)) if isinstance(node.op, ast.USub) else inner
        case ast.BinOp(left=left, right=right) if type(node.op) in OPERATORS:
            return TreeNode("Binary", OPERATORS[type(node.op)], (_node(left, depth + 1), _node(right, depth + 1)))
        case ast.Call(func=ast.Name(id=name), args=args) if name[1:] in FUNCTIONS:
            count, words = (2, "two arguments, atan2(y, x)") if name == "_atan2" else (1, "one argument")
            if name in ("_min", "_max"):
                count, words = max(2, len(args)), "two or more arguments"
            if len(args) != count:
                raise ExpressionError(f"{name[1:]} takes {words}, not {len(args)}")
            return TreeNode("Call", name[1:], tuple(_node(one, depth + 1) for one in args))
    raise _unreadable("a list")


def _unreadable(why: str) -> ExpressionError:
    return ExpressionError(f"the expression cannot be read ({why}); {ALLOWED}")


KEPT = 1e-8
"""Eigenvalue, of the largest, down to which modes are kept; what is left out has a variance of that order."""
SPACING = 0.5
"""Distance of the points that a field is made of, over its correlation length: covariances then are right to 1e-3."""


def random_field(points: NDArray[np.float64], scatter: float, length: float, seed: int) -> Expression:
    """A lognormal field exp(ζ g − ζ²/2) of mean 1 and coefficient of variation `scatter`, ζ² = ln(1 + scatter²).

    g is Gaussian with mean 0, variance 1 and covariance C(p, q) = exp(−|p − q|²/length²), by its Karhunen–Loève
    expansion on the points (n, 2) [m]: g(p) = Σ_k √λ_k φ_k(p) ζ_k with λ_k, φ_k the eigenpairs of C there and between
    them φ_k(p) = Σ_j C(p, p_j) φ_k(p_j)/λ_k (Nyström). ζ_k = φ_kᵀ w with one w for the seed, so that the field does not
    depend on how eigenvectors are chosen. Literature: Ghanem & Spanos, Stochastic Finite Elements (1991), ch. 2.
    """
    square = ((points[:, None] - points[None]) ** 2).sum(axis=-1)
    values, vectors = np.linalg.eigh(np.exp(-square / length**2))
    kept = values > KEPT * values[-1]
    drawn = vectors[:, kept].T @ np.random.default_rng(seed).standard_normal(len(points))
    weights = vectors[:, kept] @ (drawn / np.sqrt(values[kept]))
    zeta = math.sqrt(math.log1p(scatter**2))
    terms = [TreeNode("Number", value=-0.5 * zeta**2)]
    for (x, y), weight in zip(points.tolist(), (zeta * weights).tolist(), strict=True):
        terms.append(parse(f"{weight!r}*exp(-((x - {x!r})^2 + (y - {y!r})^2)/{length**2!r})".replace("- -", "+ ")).root)
    return of_tree(TreeNode("Call", "exp", (reduce(lambda a, b: TreeNode("Binary", "+", (a, b)), terms),)))


def product(one: Scalar, field: Expression) -> Expression:
    """A number or an expression times a field."""
    factor = one.root if isinstance(one, Expression) else TreeNode("Number", value=one)
    return of_tree(TreeNode("Binary", "*", (factor, field.root)))
