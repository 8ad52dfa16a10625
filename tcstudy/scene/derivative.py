"""Derivatives of expressions as expressions, by the rules of calculus.

Equal parts are one node, also across all derivatives that one `Calculus` makes, so that a derivative has a few times as
many different nodes as the expression, however long it is when written out.
abs, min, max: differentiated almost everywhere. The jump of their slope is a step that is written with atan2,
             step(s) = 1 − atan2(0, s + 0)/π, which is 1 for s ≥ 0 and 0 for s < 0 and never 0/0; at a kink the
             derivative is that of the side s > 0.
"""

from __future__ import annotations

from tcstudy.scene.algebra import Algebra
from tcstudy.scene.expression_tree import Binary, Call, Negative, Node, Number, Variable, ordered


class Calculus(Algebra):
    """An algebra whose trees can be differentiated."""

    def __init__(self) -> None:
        super().__init__()
        self._slopes: dict[tuple[str, Node], Node] = {}

    def derivative(self, root: Node, variable: str) -> Node:
        """∂/∂x or ∂/∂y of a tree that this algebra made."""
        for node in ordered((root,)):
            if (variable, node) not in self._slopes:
                self._slopes[variable, node] = self._slope(node, variable)
        return self._slopes[variable, root]

    def gradient(self, root: Node) -> tuple[Node, Node]:
        """(∂/∂x, ∂/∂y)."""
        return self.derivative(root, "x"), self.derivative(root, "y")

    def _slope(self, node: Node, variable: str) -> Node:
        def d(part: Node) -> Node:
            return self._slopes[variable, part]

        if isinstance(node, Number):
            return self.zero
        if isinstance(node, Variable):
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

    def _power_slope(self, node: Binary, da: Node, db: Node) -> Node:
        a, b = node.left, node.right
        base = exponent = self.zero
        if da is not self.zero:
            base = self.times(self.times(b, self.power(a, self.less(b, self.one))), da)
        if db is not self.zero:
            exponent = self.times(self.times(node, self.call("log", a)), db)
        return self.plus(base, exponent)

    def _call_slope(self, node: Call, slopes: list[Node]) -> Node:
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

    def _outer(self, node: Call, a: Node) -> Node:
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

    def _choice_slope(self, node: Call, slopes: list[Node]) -> Node:
        """min and max of two or more: the slope of the argument that is chosen."""
        sign = self.one if node.function == "max" else self.number(-1.0)
        best, slope = node.arguments[0], slopes[0]
        for other, other_slope in zip(node.arguments[1:], slopes[1:], strict=True):
            first = self.step(self.times(sign, self.less(best, other)))
            slope = self.plus(other_slope, self.times(first, self.less(slope, other_slope)))
            best = self.call(node.function, best, other)
        return slope
