"""Expressions in x and y: their trees, their texts, and random ones.

The tree of an expression in x and y: its nodes, its value in any arithmetic, its text.

A tree may share nodes (derivatives do): every node is visited once, so the cost is the number of
different nodes, not the length of the expression written out. Nothing here recurses, so that depth does not matter.

Expressions in x and y, such as "0.3*sin(pi*x)": read from text, never executed as code.

Grammar: numbers, x, y, pi, e, the operators + - * / ** (or ^) and parentheses, and the functions of FUNCTIONS.
The text is split into these tokens, which are read by the priority of their operators into a tree that is folded over
NumPy arrays or any other arithmetic.
Left out on purpose: comparisons, names of the user's own, attribute access, complex numbers.

A random field along a line, as an expression in x and y: the same at every point of every mesh.
"""

from __future__ import annotations

import difflib
import hashlib
import math
import re
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

MAX_INTEGER_POWER = 64


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
    left, right = values
    match node.name:
        case "+":
            return left + right
        case "-":
            return left - right
        case "*":
            return left * right
        case "/":
            return left / right
    whole = type(right) is float and right.is_integer() and abs(right) <= MAX_INTEGER_POWER
    return left ** (int(right) if whole else right)


# -- text -------------------------------------------------------------------------------------------

PRIORITY = {"+": 1, "-": 1, "*": 2, "/": 2, "**": 4}
ATOM, SIGN = 5, 3


def to_text(order: Order, longest: int) -> str:
    """The tree as text that `parse` reads back, with parentheses only where the grammar needs them. What has more than
    `longest` characters ends in a hash of all nodes, so that trees of one text are one function."""
    done: dict[TreeNode, tuple[str, int]] = {}

    def inner(node: TreeNode, least: int) -> str:
        text, priority = done[node]
        return text if priority >= least else f"({text})"

    for node in order:
        if node.kind == "Number":
            text, rank = node.label, ATOM if node.value >= 0 and not node.label.startswith("-") else 0
        elif node.kind == "Coordinate":
            text, rank = node.name, ATOM
        elif node.kind == "Negative":
            text, rank = f"-{inner(node.parts[0], SIGN + 1)}", 1
        elif node.kind == "Call":
            text, rank = f"{node.name}({', '.join(done[part][0] for part in node.parts)})", ATOM
        else:
            rank = PRIORITY[node.name]
            left = inner(node.parts[0], rank + (node.name == "**"))
            right = inner(node.parts[1], rank + 1)
            sign = f" {node.name} " if rank == 1 else "^" if rank == PRIORITY["**"] else node.name
            text = f"{left}{sign}{right}"
        if len(text) > longest:  # before the texts of shared parts grow without bound
            place = {node: i for i, node in enumerate(order)}
            nodes = "\n".join(f"{one.label}{one.kind}{[place[part] for part in one.parts]}" for one in order)
            digest = hashlib.sha256(nodes.encode()).hexdigest()[:16]
            return f"{text[:60]} … [{len(order)} operations, {digest}]"
        done[node] = text, rank
    return done[order[-1]][0]


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
ALLOWED = (
    f"allowed are numbers, {', '.join(VARIABLES)}, {', '.join(CONSTANTS)}, + - * / ^ ( ) "
    f"and the functions {', '.join(FUNCTIONS)}"
)


class ExpressionError(ValueError):
    """The text is not an expression in x and y.

    offset: character of the text at which the fault was found, from 0
    """

    def __init__(self, message: str, offset: int = 0) -> None:
        super().__init__(message)
        self.offset = offset

    def __reduce__(self) -> tuple[type[ExpressionError], tuple[str, int]]:
        return type(self), (str(self), self.offset)


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
    root, (_, _, at) = _operand(tokens, 0, 0), tokens.popleft()
    if tokens:
        raise _unreadable(at)
    return Expression(text.strip(), root)


Tokens = deque[tuple[str, str, int]]
"""(kind, text, place in the expression); the last is ("end", "", …)."""


def _tokens(text: str, names: tuple[str, ...]) -> Tokens:
    """The tokens, all known and in an order that may be an expression; parentheses match."""
    found: Tokens = deque()
    at, depth, previous = 0, 0, ""
    while at < len(text):
        match = TOKEN.match(text, at)
        if match is None:
            hint = f"write {LOOKALIKES[text[at]]} instead; " if text[at] in LOOKALIKES else ""
            raise ExpressionError(f"the character {text[at]!r} has no place in an expression; {hint}{ALLOWED}", at)
        kind, token = str(match.lastgroup), match.group()
        if kind != "space":
            _check_token(kind, token, at, names, previous)
            depth += (token == "(") - (token == ")")
            if depth < 0:
                raise ExpressionError("there is a ) without its (; remove it or open one before", at)
            found.append((kind, "**" if kind == "power" else token, at))
            previous = token
        at = match.end()
    if not found:
        raise ExpressionError(f"the expression is empty; {ALLOWED}")
    if depth:
        raise ExpressionError(f"{depth} of the parentheses ( are not closed; add ) at the end", at)
    if previous in "+-*/^**":
        raise ExpressionError(f"the expression ends with {previous}; write the operand after it or remove it", at)
    found.append(("end", "", at))
    return found


def _check_token(kind: str, token: str, at: int, names: tuple[str, ...], previous: str) -> None:
    """Unknown names, numbers beyond the floats, and two operands without an operator between are refused.

    previous: the token before; the usual slips are "2x" and "sin x"
    """
    if kind == "number" and not math.isfinite(float(token)):
        raise ExpressionError(f"the number {token[:20]} is too large for a float (at most 1.8e308)", at)
    known = (*names, *VARIABLES, *CONSTANTS, *FUNCTIONS)
    if kind == "name" and token not in known:
        near = difflib.get_close_matches(token, known, n=1) or difflib.get_close_matches(token.lower(), known, n=1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        if previous[:1].isdigit():
            hint = "a number with a unit needs a name under parameters, a product its *; "
        allowed = ALLOWED.replace("numbers,", ", ".join(("numbers", *names)) + ",")
        raise ExpressionError(f"unknown name {token[:40]!r}; {hint}{allowed}", at)
    if previous in FUNCTIONS and kind in ("number", "name"):
        raise ExpressionError(f"{previous} needs parentheses: {previous}({token[:20]} ...)", at)
    follows = previous not in FUNCTIONS and (previous[:1].isalnum() or previous[:1] in ("_", ".", ")"))
    if follows and (kind in ("number", "name") or token == "("):
        what = f"an operator is missing between {previous[:20]!r} and {token[:20]!r}"
        raise ExpressionError(f"{what}; write {previous[:20]}*{token[:20]} to multiply", at)


def _operand(tokens: Tokens, least: int, depth: int) -> TreeNode:
    """The longest operand that the tokens begin with whose operators have at least this priority."""
    kind, token, at = tokens.popleft()
    if depth > MAX_DEPTH:
        what = f"the expression is nested too deeply (limit {MAX_DEPTH} levels)"
        raise ExpressionError(f"{what}; split or shorten it", at)
    if token in ("+", "-"):
        node = _operand(tokens, SIGN, depth + 1)
        node = TreeNode("Negative", parts=(node,)) if token == "-" else node
    elif kind == "number" or token in CONSTANTS:
        node = TreeNode("Number", value=CONSTANTS[token] if token in CONSTANTS else float(token))
    elif token in FUNCTIONS:
        if tokens[0][1] != "(":
            raise ExpressionError(f"{token} is a function: write {token}(...)", at)
        arguments = list[TreeNode]()
        while tokens.popleft()[1] != ")":
            empty = not arguments and tokens[0][1] == ")"
            arguments += [] if empty else [_operand(tokens, 0, depth + 1)]
            if tokens[0][1] not in (",", ")"):
                raise _unreadable(tokens[0][2])
        count, words = (2, "two arguments, atan2(y, x)") if token == "atan2" else (1, "one argument")
        if token in ("min", "max"):
            count, words = max(2, len(arguments)), "two or more arguments"
        if len(arguments) != count:
            raise ExpressionError(f"{token} takes {words}, not {len(arguments)}", at)
        node = TreeNode("Call", token, tuple(arguments))
    elif kind == "name":
        node = TreeNode("Coordinate", token)
    elif token == "(":
        node = _operand(tokens, 0, depth + 1)
        if (closing := tokens.popleft())[1] != ")":
            raise _unreadable(closing[2])
    else:
        raise _unreadable(at)
    while PRIORITY.get(tokens[0][1], -1) >= least:
        operator, depth = tokens.popleft()[1], depth + 1
        right = _operand(tokens, PRIORITY[operator] + (operator != "**"), depth + 1)
        node = TreeNode("Binary", operator, (node, right))
    return node


def _unreadable(at: int) -> ExpressionError:
    return ExpressionError(f"the expression cannot be read from character {at + 1} on; {ALLOWED}", at)


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
