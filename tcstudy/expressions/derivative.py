"""Makes trees of expressions, simplified a little; equal parts are one node.

Constants are computed; a + 0, 1·a, 0·a, a/1, a^0, a^1 and −(−a) vanish, numbers in a product are merged and come first.
0·a = 0 also where a has no value.

Derivatives of expressions as expressions, by the rules of calculus.

Equal parts are one node, also across all derivatives that one `Calculus` makes, so that a derivative has a few times as
many different nodes as the expression, however long it is when written out.
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

from tcstudy.expressions.expression import FUNCTIONS, Expression, of_tree
from tcstudy.expressions.tree import Binary, Call, Coordinate, Negative, Number, TreeNode, children, constant, ordered

Array = NDArray[np.float64]
Scalar = float | Expression


class Algebra:
    """Makes trees; equal trees are one object."""

    def __init__(self) -> None:
        self._made: dict[object, TreeNode] = {}
        self.zero, self.one = self.number(0.0), self.number(1.0)

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
        return node.value if isinstance(node, Number) else of_tree(node)

    def again(self, node: TreeNode, done: dict[TreeNode, TreeNode]) -> TreeNode:
        """A node of another tree, made of its children that are already here."""
        if isinstance(node, Number):
            return self.number(node.value)
        if isinstance(node, Coordinate):
            return self.variable(node.name)
        if isinstance(node, Negative):
            return self.minus(done[node.operand])
        if isinstance(node, Call):
            return self.call(node.function, *(done[a] for a in node.arguments))
        left, right = done[node.left], done[node.right]
        makers = {"+": self.plus, "-": self.less, "*": self.times, "/": self.over, "**": self.power}
        return makers[node.operator](left, right)

    def _only(self, key: object, make: Callable[[], TreeNode]) -> TreeNode:
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]

    # -- operations --------------------------------------------------------------------------------

    def number(self, value: float) -> TreeNode:
        """A constant."""
        value = float(value) + 0.0  # −0 and 0 are one constant
        return self._only(("number", value), lambda: Number(value))

    def variable(self, name: str) -> TreeNode:
        """x or y."""
        return self._only(("variable", name), lambda: Coordinate(name))

    def minus(self, a: TreeNode) -> TreeNode:
        """−a."""
        if isinstance(a, Number):
            return self.number(-a.value)
        if isinstance(a, Negative):
            return a.operand
        if isinstance(a, Binary) and a.operator == "*" and isinstance(a.left, Number):
            return self.times(self.number(-a.left.value), a.right)
        return self._only(("-", a), lambda: Negative(a))

    def plus(self, a: TreeNode, b: TreeNode) -> TreeNode:
        """a + b."""
        if a is self.zero:
            return b
        if b is self.zero:
            return a
        if isinstance(b, Negative):
            return self.less(a, b.operand)
        return self._binary("+", a, b)

    def less(self, a: TreeNode, b: TreeNode) -> TreeNode:
        """a − b."""
        if b is self.zero:
            return a
        if a is self.zero:
            return self.minus(b)
        if a is b:
            return self.zero
        return self.plus(a, b.operand) if isinstance(b, Negative) else self._binary("-", a, b)

    def times(self, a: TreeNode, b: TreeNode) -> TreeNode:
        """a·b, a number first."""
        if isinstance(b, Number):
            a, b = b, a
        if a is self.zero or b is self.zero:
            return self.zero
        if a is self.one:
            return b
        if isinstance(a, Number) and a.value == -1.0:
            return self.minus(b)
        if isinstance(a, Negative):
            return self.minus(self.times(a.operand, b))
        if isinstance(b, Negative):
            return self.minus(self.times(a, b.operand))
        if isinstance(b, Binary) and b.operator == "*" and isinstance(b.left, Number):
            if isinstance(a, Number):
                return self.times(self.number(a.value * b.left.value), b.right)
            return self.times(b.left, self.times(a, b.right))
        if isinstance(a, Binary) and a.operator == "*" and isinstance(a.left, Number):
            return self.times(a.left, self.times(a.right, b))
        return self._binary("*", a, b)

    def over(self, a: TreeNode, b: TreeNode) -> TreeNode:
        """a/b."""
        if b is self.one or a is self.zero:
            return a
        return self.minus(self.over(a.operand, b)) if isinstance(a, Negative) else self._binary("/", a, b)

    def power(self, a: TreeNode, b: TreeNode) -> TreeNode:
        """a to the b."""
        if b is self.zero:
            return self.one
        return a if b is self.one else self._binary("**", a, b)

    def call(self, function: str, *arguments: TreeNode) -> TreeNode:
        """function(arguments)."""
        return self._computed(self._only((function, arguments), lambda: Call(function, arguments)))

    def _binary(self, operator: str, a: TreeNode, b: TreeNode) -> TreeNode:
        return self._computed(self._only((operator, a, b), lambda: Binary(operator, a, b)))

    def _computed(self, node: TreeNode) -> TreeNode:
        """The node, or its value if it has one whatever x and y."""
        if not all(isinstance(part, Number) for part in children(node)):
            return node
        value = constant(ordered((node,)), FUNCTIONS)
        return self.number(value) if math.isfinite(value) else node

    def sum(self, *terms: TreeNode) -> TreeNode:
        """The sum of all terms."""
        total = self.zero
        for term in terms:
            total = self.plus(total, term)
        return total

    def step(self, s: TreeNode) -> TreeNode:
        """1 where s ≥ 0, 0 elsewhere."""
        raised = self._only(("+", s, self.zero), lambda: Binary("+", s, self.zero))  # atan2(0, −0) would be π
        return self.less(self.one, self.over(self.call("atan2", self.zero, raised), self.number(math.pi)))


class Calculus(Algebra):
    """An algebra whose trees can be differentiated."""

    def __init__(self) -> None:
        super().__init__()
        self._slopes: dict[tuple[str, TreeNode], TreeNode] = {}

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
        def d(part: TreeNode) -> TreeNode:
            return self._slopes[variable, part]

        if isinstance(node, Number):
            return self.zero
        if isinstance(node, Coordinate):
            return self.one if node.name == variable else self.zero
        if isinstance(node, Negative):
            return self.minus(d(node.operand))
        if isinstance(node, Call):
            return self._call_slope(node, [d(a) for a in node.arguments])
        a, b = node.left, node.right
        da, db = d(a), d(b)
        match node.operator:
            case "+":
                return self.plus(da, db)
            case "-":
                return self.less(da, db)
            case "*":
                return self.plus(self.times(da, b), self.times(a, db))
            case "/":
                return self.over(self.less(da, self.times(node, db)), b)
        return self._power_slope(node, da, db)

    def _power_slope(self, node: Binary, da: TreeNode, db: TreeNode) -> TreeNode:
        a, b = node.left, node.right
        base = exponent = self.zero
        if da is not self.zero:
            base = self.times(self.times(b, self.power(a, self.less(b, self.one))), da)
        if db is not self.zero:
            exponent = self.times(self.times(node, self.call("log", a)), db)
        return self.plus(base, exponent)

    def _call_slope(self, node: Call, slopes: list[TreeNode]) -> TreeNode:
        a, da = node.arguments[0], slopes[0]
        if all(slope is self.zero for slope in slopes):
            return self.zero
        if node.function in ("min", "max"):
            return self._choice_slope(node, slopes)
        if node.function == "atan2":
            b, db = node.arguments[1], slopes[1]
            square = self.plus(self.power(a, self.number(2.0)), self.power(b, self.number(2.0)))
            return self.over(self.less(self.times(da, b), self.times(a, db)), square)
        return self.times(self._outer(node, a), da)

    def _outer(self, node: Call, a: TreeNode) -> TreeNode:
        """f′(a) of a function of one argument."""
        two = self.number(2.0)
        square = self.power(a, two)
        match node.function:
            case "sin":
                return self.call("cos", a)
            case "cos":
                return self.minus(self.call("sin", a))
            case "tan":
                return self.plus(self.one, self.power(node, two))
            case "asin":
                return self.over(self.one, self.call("sqrt", self.less(self.one, square)))
            case "acos":
                return self.minus(self.over(self.one, self.call("sqrt", self.less(self.one, square))))
            case "atan":
                return self.over(self.one, self.plus(self.one, square))
            case "exp":
                return node
            case "log":
                return self.over(self.one, a)
            case "sqrt":
                return self.over(self.number(0.5), node)
            case "abs":
                return self.less(self.times(two, self.step(a)), self.one)
            case "sinh":
                return self.call("cosh", a)
            case "cosh":
                return self.call("sinh", a)
            case "tanh":
                return self.less(self.one, self.power(node, two))
        raise AssertionError(node.function)

    def _choice_slope(self, node: Call, slopes: list[TreeNode]) -> TreeNode:
        """min and max of two or more: the slope of the argument that is chosen."""
        sign = self.one if node.function == "max" else self.number(-1.0)
        best, slope = node.arguments[0], slopes[0]
        for other, other_slope in zip(node.arguments[1:], slopes[1:], strict=True):
            first = self.step(self.times(sign, self.less(best, other)))
            slope = self.plus(other_slope, self.times(first, self.less(slope, other_slope)))
            best = self.call(node.function, best, other)
        return slope


def value_and_gradient(scalar: Scalar, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Values (…) and gradient (2, …) of a number or an expression at points; not finite where it has none."""
    x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    if not isinstance(scalar, Expression):
        return np.full(x.shape, float(scalar)), np.zeros((2, *x.shape))
    slopes = (d.evaluate(x, y) if isinstance(d, Expression) else np.full(x.shape, d) for d in _gradient(scalar))
    return scalar.evaluate(x, y), np.array(list(slopes))


@lru_cache(maxsize=64)
def _gradient(expression: Expression) -> tuple[Scalar, Scalar]:
    algebra = Calculus()
    by_x, by_y = algebra.gradient(algebra.tree(expression))
    return algebra.scalar(by_x), algebra.scalar(by_y)
