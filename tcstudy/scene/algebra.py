"""Makes trees of expressions, simplified a little; equal parts are one node.

Constants are computed; a + 0, 1·a, 0·a, a/1, a^0, a^1 and −(−a) vanish, numbers in a product are merged and come first.
0·a = 0 also where a has no value.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from tcstudy.scene.expression_tree import Binary, Call, Negative, Node, Number, Variable, children, constant, ordered
from tcstudy.scene.expressions import FUNCTIONS, Expression, of_tree

Scalar = float | Expression


class Algebra:
    """Makes trees; equal trees are one object."""

    def __init__(self) -> None:
        self._made: dict[object, Node] = {}
        self.zero, self.one = self.number(0.0), self.number(1.0)

    def tree(self, scalar: Scalar) -> Node:
        """The tree of a number or an expression, simplified."""
        if not isinstance(scalar, Expression):
            return self.number(float(scalar))
        done: dict[Node, Node] = {}
        for node in scalar.order:
            done[node] = self.again(node, done)
        return done[scalar.root]

    def scalar(self, node: Node) -> Scalar:
        """A number if the tree is one, else an expression."""
        return node.value if isinstance(node, Number) else of_tree(node)

    def again(self, node: Node, done: dict[Node, Node]) -> Node:
        """A node of another tree, made of its children that are already here."""
        if isinstance(node, Number):
            return self.number(node.value)
        if isinstance(node, Variable):
            return self.variable(node.name)
        if isinstance(node, Negative):
            return self.minus(done[node.operand])
        if isinstance(node, Call):
            return self.call(node.function, *(done[a] for a in node.arguments))
        left, right = done[node.left], done[node.right]
        makers = {"+": self.plus, "-": self.less, "*": self.times, "/": self.over, "**": self.power}
        return makers[node.operator](left, right)

    def _only(self, key: object, make: Callable[[], Node]) -> Node:
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]

    # -- operations --------------------------------------------------------------------------------

    def number(self, value: float) -> Node:
        """A constant."""
        value = float(value) + 0.0  # −0 and 0 are one constant
        return self._only(("number", value), lambda: Number(value))

    def variable(self, name: str) -> Node:
        """x or y."""
        return self._only(("variable", name), lambda: Variable(name))

    def minus(self, a: Node) -> Node:
        """−a."""
        if isinstance(a, Number):
            return self.number(-a.value)
        if isinstance(a, Negative):
            return a.operand
        if isinstance(a, Binary) and a.operator == "*" and isinstance(a.left, Number):
            return self.times(self.number(-a.left.value), a.right)
        return self._only(("-", a), lambda: Negative(a))

    def plus(self, a: Node, b: Node) -> Node:
        """a + b."""
        if a is self.zero:
            return b
        if b is self.zero:
            return a
        if isinstance(b, Negative):
            return self.less(a, b.operand)
        return self._binary("+", a, b)

    def less(self, a: Node, b: Node) -> Node:
        """a − b."""
        if b is self.zero:
            return a
        if a is self.zero:
            return self.minus(b)
        if a is b:
            return self.zero
        return self.plus(a, b.operand) if isinstance(b, Negative) else self._binary("-", a, b)

    def times(self, a: Node, b: Node) -> Node:
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

    def over(self, a: Node, b: Node) -> Node:
        """a/b."""
        if b is self.one or a is self.zero:
            return a
        return self.minus(self.over(a.operand, b)) if isinstance(a, Negative) else self._binary("/", a, b)

    def power(self, a: Node, b: Node) -> Node:
        """a to the b."""
        if b is self.zero:
            return self.one
        return a if b is self.one else self._binary("**", a, b)

    def call(self, function: str, *arguments: Node) -> Node:
        """function(arguments)."""
        return self._computed(self._only((function, arguments), lambda: Call(function, arguments)))

    def _binary(self, operator: str, a: Node, b: Node) -> Node:
        return self._computed(self._only((operator, a, b), lambda: Binary(operator, a, b)))

    def _computed(self, node: Node) -> Node:
        """The node, or its value if it has one whatever x and y."""
        if not all(isinstance(part, Number) for part in children(node)):
            return node
        value = constant(ordered((node,)), FUNCTIONS)
        return self.number(value) if math.isfinite(value) else node

    def sum(self, *terms: Node) -> Node:
        """The sum of all terms."""
        total = self.zero
        for term in terms:
            total = self.plus(total, term)
        return total

    def step(self, s: Node) -> Node:
        """1 where s ≥ 0, 0 elsewhere."""
        raised = self._only(("+", s, self.zero), lambda: Binary("+", s, self.zero))  # atan2(0, −0) would be π
        return self.less(self.one, self.over(self.call("atan2", self.zero, raised), self.number(math.pi)))
