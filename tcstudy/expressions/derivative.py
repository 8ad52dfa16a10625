"""Derivatives of expressions as expressions, by the rules of calculus, simplified a little.

Constants are computed; a + 0, 1·a, 0·a, a/1, a^0, a^1 and −(−a) vanish, numbers in a product are merged and come first.
0·a = 0 also where a has no value. Equal parts are one node, also across all derivatives that one `Calculus` makes, so
that a derivative has a few times as many different nodes as the expression, however long it is when written out.
abs, min, max: differentiated almost everywhere. The jump of their slope is a step that is written with atan2,
             step(s) = 1 − atan2(0, s + 0)/π, which is 1 for s ≥ 0 and 0 for s < 0 and never 0/0; at a kink the
             derivative is that of the side s > 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tcstudy.expressions.expression import Expression, of_tree
from tcstudy.expressions.tree import TreeNode, ordered

Array = NDArray[np.float64]
Scalar = float | Expression


class Calculus:
    """Makes trees and their derivatives; equal trees are one object."""

    def __init__(self) -> None:
        self._made: dict[object, TreeNode] = {}
        self._slopes: dict[tuple[str, TreeNode], TreeNode] = {}
        self.zero, self.one, self.two = self.number(0.0), self.number(1.0), self.number(2.0)

    def tree(self, scalar: Scalar) -> TreeNode:
        """The tree of a number or an expression, simplified."""
        if not isinstance(scalar, Expression):
            return self.number(float(scalar))
        done: dict[TreeNode, TreeNode] = {}
        for node in scalar.order:
            done[node] = self.again(node, done)
        return done[scalar.root]

    def scalar(self, node: TreeNode) -> Scalar:
        """A number if the tree is one, else an expression."""
        return node.value if node.kind == "Number" else of_tree(node)

    def again(self, node: TreeNode, done: dict[TreeNode, TreeNode]) -> TreeNode:
        """A node of another tree, made of its parts that are already here."""
        parts = [done[part] for part in node.parts]
        match node.kind:
            case "Number":
                return self.number(node.value)
            case "Coordinate":
                return self.variable(node.name)
            case "Negative":
                return self.minus(*parts)
            case "Call":
                return self.call(node.name, *parts)
        makers = {"+": self.plus, "-": self.less, "*": self.times, "/": self.over, "**": self.power}
        return makers[node.name](*parts)

    def _only(self, node: TreeNode) -> TreeNode:
        """The one node like this."""
        return self._made.setdefault((node.kind, node.name, node.parts, node.value), node)

    # -- operations --------------------------------------------------------------------------------

    def number(self, value: float) -> TreeNode:
        """A constant."""
        return self._only(TreeNode("Number", value=float(value) + 0.0))  # −0 and 0 are one constant

    def variable(self, name: str) -> TreeNode:
        """x or y."""
        return self._only(TreeNode("Coordinate", name))

    def minus(self, a: TreeNode) -> TreeNode:
        """−a."""
        if a.kind == "Number":
            return self.number(-a.value)
        if a.kind == "Negative":
            return a.parts[0]
        if self._scaled(a):
            return self.times(self.number(-a.parts[0].value), a.parts[1])
        return self._only(TreeNode("Negative", parts=(a,)))

    @staticmethod
    def _scaled(a: TreeNode) -> bool:
        """Whether a tree is a number times another."""
        return a.kind == "Binary" and a.name == "*" and a.parts[0].kind == "Number"

    def plus(self, a: TreeNode, b: TreeNode) -> TreeNode:
        """a + b."""
        if a is self.zero:
            return b
        if b is self.zero:
            return a
        return self.less(a, b.parts[0]) if b.kind == "Negative" else self._binary("+", a, b)

    def less(self, a: TreeNode, b: TreeNode) -> TreeNode:
        """a − b."""
        if b is self.zero:
            return a
        if a is self.zero:
            return self.minus(b)
        if a is b:
            return self.zero
        return self.plus(a, b.parts[0]) if b.kind == "Negative" else self._binary("-", a, b)

    def times(self, a: TreeNode, b: TreeNode) -> TreeNode:
        """a·b, a number first."""
        if b.kind == "Number":
            a, b = b, a
        if a is self.zero or b is self.zero:
            return self.zero
        if a is self.one:
            return b
        if a.kind == "Number" and a.value == -1.0:
            return self.minus(b)
        if a.kind == "Negative":
            return self.minus(self.times(a.parts[0], b))
        if b.kind == "Negative":
            return self.minus(self.times(a, b.parts[0]))
        if self._scaled(b):
            factor, rest = b.parts
            if a.kind == "Number":
                return self.times(self.number(a.value * factor.value), rest)
            return self.times(factor, self.times(a, rest))
        if self._scaled(a):
            return self.times(a.parts[0], self.times(a.parts[1], b))
        return self._binary("*", a, b)

    def over(self, a: TreeNode, b: TreeNode) -> TreeNode:
        """a/b."""
        if b is self.one or a is self.zero:
            return a
        return self.minus(self.over(a.parts[0], b)) if a.kind == "Negative" else self._binary("/", a, b)

    def power(self, a: TreeNode, b: TreeNode) -> TreeNode:
        """a to the b."""
        if b is self.zero:
            return self.one
        return a if b is self.one else self._binary("**", a, b)

    def square(self, a: TreeNode) -> TreeNode:
        """a²."""
        return self.power(a, self.two)

    def call(self, function: str, *arguments: TreeNode) -> TreeNode:
        """function(arguments)."""
        return self._computed(TreeNode("Call", function, arguments))

    def _binary(self, operator: str, a: TreeNode, b: TreeNode) -> TreeNode:
        return self._computed(TreeNode("Binary", operator, (a, b)))

    def _computed(self, node: TreeNode) -> TreeNode:
        """The one node like this, or its value if it has one whatever x and y."""
        if not all(part.kind == "Number" for part in node.parts):
            return self._only(node)
        value = float(Expression("", node).fold({}, {}))
        return self.number(value) if math.isfinite(value) else self._only(node)

    def sum(self, *terms: TreeNode) -> TreeNode:
        """The sum of all terms."""
        total = self.zero
        for term in terms:
            total = self.plus(total, term)
        return total

    def step(self, s: TreeNode) -> TreeNode:
        """1 where s ≥ 0, 0 elsewhere."""
        raised = self._only(TreeNode("Binary", "+", (s, self.zero)))  # atan2(0, −0) would be π
        return self.less(self.one, self.over(self.call("atan2", self.zero, raised), self.number(math.pi)))

    # -- derivatives -------------------------------------------------------------------------------

    def derivative(self, root: TreeNode, variable: str) -> TreeNode:
        """∂/∂x or ∂/∂y of a tree that this algebra made."""
        for node in ordered((root,)):
            if (variable, node) not in self._slopes:
                self._slopes[variable, node] = self._slope(node, variable)
        return self._slopes[variable, root]

    def gradient(self, root: TreeNode) -> tuple[TreeNode, TreeNode]:
        """(∂/∂x, ∂/∂y)."""
        return self.derivative(root, "x"), self.derivative(root, "y")

    def _slope(self, node: TreeNode, variable: str) -> TreeNode:
        slopes = [self._slopes[variable, part] for part in node.parts]
        match node.kind, node.name:
            case "Number", _:
                return self.zero
            case "Coordinate", name:
                return self.one if name == variable else self.zero
            case "Negative", _:
                return self.minus(*slopes)
            case "Call", _:
                return self._call_slope(node, slopes)
        (a, b), (da, db) = node.parts, slopes
        match node.name:
            case "+":
                return self.plus(da, db)
            case "-":
                return self.less(da, db)
            case "*":
                return self.plus(self.times(da, b), self.times(a, db))
            case "/":
                return self.over(self.less(da, self.times(node, db)), b)
        base = exponent = self.zero
        if da is not self.zero:
            base = self.times(self.times(b, self.power(a, self.less(b, self.one))), da)
        if db is not self.zero:
            exponent = self.times(self.times(node, self.call("log", a)), db)
        return self.plus(base, exponent)

    def _call_slope(self, node: TreeNode, slopes: list[TreeNode]) -> TreeNode:
        a, da = node.parts[0], slopes[0]
        if all(slope is self.zero for slope in slopes):
            return self.zero
        if node.name in ("min", "max"):
            return self._choice_slope(node, slopes)
        if node.name == "atan2":
            b, db = node.parts[1], slopes[1]
            square = self.plus(self.square(a), self.square(b))
            return self.over(self.less(self.times(da, b), self.times(a, db)), square)
        return self.times(OUTER[node.name](self, a, node), da)

    def _choice_slope(self, node: TreeNode, slopes: list[TreeNode]) -> TreeNode:
        """min and max of two or more: the slope of the argument that is chosen."""
        sign = self.one if node.name == "max" else self.number(-1.0)
        best, slope = node.parts[0], slopes[0]
        for other, other_slope in zip(node.parts[1:], slopes[1:], strict=True):
            first = self.step(self.times(sign, self.less(best, other)))
            slope = self.plus(other_slope, self.times(first, self.less(slope, other_slope)))
            best = self.call(node.name, best, other)
        return slope


OUTER: dict[str, Callable[[Calculus, TreeNode, TreeNode], TreeNode]] = {
    "sin": lambda c, a, _: c.call("cos", a),
    "cos": lambda c, a, _: c.minus(c.call("sin", a)),
    "tan": lambda c, _, f: c.plus(c.one, c.square(f)),
    "asin": lambda c, a, _: c.over(c.one, c.call("sqrt", c.less(c.one, c.square(a)))),
    "acos": lambda c, a, _: c.minus(c.over(c.one, c.call("sqrt", c.less(c.one, c.square(a))))),
    "atan": lambda c, a, _: c.over(c.one, c.plus(c.one, c.square(a))),
    "exp": lambda _, __, f: f,
    "log": lambda c, a, _: c.over(c.one, a),
    "sqrt": lambda c, _, f: c.over(c.number(0.5), f),
    "abs": lambda c, a, _: c.less(c.times(c.two, c.step(a)), c.one),
    "sinh": lambda c, a, _: c.call("cosh", a),
    "cosh": lambda c, a, _: c.call("sinh", a),
    "tanh": lambda c, _, f: c.less(c.one, c.square(f)),
}
"""f′(a) of the functions of one argument: by the argument a and f(a)."""


def value_and_gradient(scalar: Scalar, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Values (…) and gradient (2, …) of a number or an expression at points; not finite where it has none."""
    x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    if not isinstance(scalar, Expression):
        return np.full(x.shape, float(scalar)), np.zeros((2, *x.shape))
    slopes = (d.evaluate(x, y) if isinstance(d, Expression) else np.full(x.shape, d) for d in _gradient(scalar))
    return scalar.evaluate(x, y), np.array(list(slopes))


@lru_cache(maxsize=64)
def _gradient(expression: Expression) -> tuple[Scalar, Scalar]:
    calculus = Calculus()
    by_x, by_y = calculus.gradient(calculus.tree(expression))
    return calculus.scalar(by_x), calculus.scalar(by_y)
