"""Expressions in x and y, such as "0.3*sin(pi*x)": read from text, never executed as code.

Grammar: numbers, x, y, pi, e, the operators + - * / ** (or ^) and parentheses, and the functions of FUNCTIONS.
The text is split into these tokens first, so nothing else ever reaches the Python parser; its syntax tree is
copied into a tree of our own, which is folded over NumPy arrays or any other arithmetic.
Left out on purpose: comparisons, names of the user's own, attribute access, complex numbers.
"""

from __future__ import annotations

import ast
import difflib
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tcstudy.expressions import tree
from tcstudy.expressions.tree import Order, TreeNode

T = TypeVar("T")

MAX_LENGTH = 2000
MAX_DEPTH = 120

VARIABLES = ("x", "y")
CONSTANTS = {"pi": math.pi, "e": math.e}
FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{
        name: getattr(np, name) for name in ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "sqrt")
    },
    **{name: getattr(np, name) for name in ("abs", "sinh", "cosh", "tanh")},
    **{"min": np.minimum, "max": np.maximum},
}
BINARY = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}

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
        return _unpacked, (self.text, tree.pack(self.order))

    @cached_property
    def order(self) -> Order:
        """The nodes, each once, every node after its parts."""
        return tree.ordered((self.root,))

    @cached_property
    def _below(self) -> dict[TreeNode, frozenset[str]]:
        return tree.variables(self.order)

    @cached_property
    def variables(self) -> frozenset[str]:
        """The variables that occur: a subset of {"x", "y"}."""
        return self._below[self.root]

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
        tree.MAX_INTEGER_POWER in size gets an int as exponent.
        """
        folded: T | float = tree.fold(self.order, self._below, variables, functions, FUNCTIONS)
        return folded


Scalar = float | Expression


def value_of(scalar: Scalar, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
    """Values of a number or an expression at the points (x, y), broadcast against each other."""
    if isinstance(scalar, Expression):
        return scalar.evaluate(x, y)
    return np.full(np.broadcast_shapes(np.shape(x), np.shape(y)), float(scalar))


def of_tree(root: TreeNode) -> Expression:
    """The expression of a tree, with a text that `parse` reads back unless it is longer than MAX_LENGTH."""
    return Expression(tree.to_text(tree.ordered((root,)), MAX_LENGTH), root)


def _unpacked(text: str, packed: Any) -> Expression:
    return Expression(text, tree.unpack(packed))


def parse(text: str, names: tuple[str, ...] = ()) -> Expression:
    """The expression a text stands for; raises ExpressionError with what is wrong, where, and what is allowed.

    names: numbers that it may have beside x and y; they are variables until it is `bound`
    """
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"the expression has {len(text)} characters; at most {MAX_LENGTH} are allowed")
    source, origin = _canonical(text, names)

    def offset(column: int) -> int:
        return origin[max(0, min(column, len(origin) - 1))]

    try:
        tree = ast.parse(source, mode="eval")
    except SyntaxError as error:
        at = offset((error.offset or 1) - 1)
        raise ExpressionError(f"the expression cannot be read from character {at + 1} on; {ALLOWED}", at) from None
    except (RecursionError, MemoryError):
        raise _too_deep(0) from None
    return Expression(text.strip(), _convert(tree.body, offset, 0))


def _canonical(text: str, names: tuple[str, ...]) -> tuple[str, list[int]]:
    """Known tokens only, separated by blanks, and for every character its place in the text."""
    source, origin, at, depth, signs, previous = "", [0], 0, 0, 0, ""
    while at < len(text):
        match = TOKEN.match(text, at)
        if match is None:
            hint = f"write {LOOKALIKES[text[at]]} instead; " if text[at] in LOOKALIKES else ""
            raise ExpressionError(f"the character {text[at]!r} has no place in an expression; {hint}{ALLOWED}", at)
        kind, token = str(match.lastgroup), match.group()
        if kind != "space":
            operand = kind in ("number", "name")
            word = _word(kind, token, at, names, previous) + " "
            if previous and (operand or token == "("):
                _check_neighbours(previous, token, at)
            depth += (token == "(") - (token == ")")
            signs = 0 if operand else signs + 1
            if depth > MAX_DEPTH or signs > MAX_DEPTH:
                raise _too_deep(at)
            if depth < 0:
                raise ExpressionError("there is a ) without its (; remove it or open one before", at)
            source += word
            origin[len(source) - len(word) :] = [at] * len(word) + [at + len(token)]
            previous = token
        at = match.end()
    if not source:
        raise ExpressionError(f"the expression is empty; {ALLOWED}")
    if depth:
        raise ExpressionError(f"{depth} of the parentheses ( are not closed; add ) at the end", at)
    if previous in "+-*/^**":
        raise ExpressionError(f"the expression ends with {previous}; write the operand after it or remove it", at)
    return source, origin


def _word(kind: str, token: str, at: int, names: tuple[str, ...], previous: str) -> str:
    """The token as Python writes it; unknown names and numbers beyond the floats are refused.

    previous: the token before
    """
    if kind == "number":
        value = float(token)
        if not math.isfinite(value):
            raise ExpressionError(f"the number {token[:20]} is too large for a float (at most 1.8e308)", at)
        return repr(value)
    if kind == "name":
        known = (*names, *VARIABLES, *CONSTANTS, *FUNCTIONS)
        if token not in known:
            near = difflib.get_close_matches(token, known, n=1) or difflib.get_close_matches(token.lower(), known, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            if previous[:1].isdigit():
                hint = "a number with a unit needs a name under parameters, a product its *; "
            allowed = ALLOWED.replace("numbers,", ", ".join(("numbers", *names)) + ",")
            raise ExpressionError(f"unknown name {token[:40]!r}; {hint}{allowed}", at)
    return "**" if kind == "power" else token


def _check_neighbours(previous: str, token: str, at: int) -> None:
    """Two operands without an operator between them: the usual slips are "2x" and "sin x"."""
    if previous in FUNCTIONS:
        if token != "(":
            raise ExpressionError(f"{previous} needs parentheses: {previous}({token[:20]} ...)", at)
    elif previous[0].isalnum() or previous[0] in "._)":
        raise ExpressionError(
            f"an operator is missing between {previous[:20]!r} and {token[:20]!r}; "
            f"write {previous[:20]}*{token[:20]} to multiply",
            at,
        )


def _too_deep(at: int) -> ExpressionError:
    return ExpressionError(f"the expression is nested too deeply (limit {MAX_DEPTH} levels); split or shorten it", at)


def _convert(node: ast.expr, offset: Callable[[int], int], depth: int) -> TreeNode:
    """Our own tree for a whitelisted syntax tree; anything outside the grammar is an ExpressionError."""
    at = offset(node.col_offset)
    if depth > MAX_DEPTH:
        raise _too_deep(at)
    if isinstance(node, ast.Constant) and type(node.value) is float:
        return TreeNode("Number", value=node.value)
    if isinstance(node, ast.Name):
        if node.id in FUNCTIONS:
            raise ExpressionError(f"{node.id} is a function: write {node.id}(...)", at)
        if node.id in CONSTANTS:
            return TreeNode("Number", value=CONSTANTS[node.id])
        return TreeNode("Coordinate", node.id)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.UAdd | ast.USub):
        operand = _convert(node.operand, offset, depth + 1)
        return TreeNode("Negative", parts=(operand,)) if isinstance(node.op, ast.USub) else operand
    if isinstance(node, ast.BinOp) and type(node.op) in BINARY:
        sides = tuple(_convert(side, offset, depth + 1) for side in (node.left, node.right))
        return TreeNode("Binary", BINARY[type(node.op)], sides)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        arguments = tuple(_convert(one, offset, depth + 1) for one in node.args)
        _check_count(node.func.id, len(arguments), at)
        return TreeNode("Call", node.func.id, arguments)
    raise ExpressionError(f"this is not an expression in x and y; {ALLOWED}", at)


def _check_count(name: str, given: int, at: int) -> None:
    """The number of arguments of a function."""
    if name in ("min", "max"):
        count, words = max(2, given), "two or more arguments"
    else:
        count, words = (2, "two arguments, atan2(y, x)") if name == "atan2" else (1, "one argument")
    if given != count:
        raise ExpressionError(f"{name} takes {words}, not {given}", at)
