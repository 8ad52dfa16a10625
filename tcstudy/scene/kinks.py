"""Where expressions bend: at the zeros of what stands in abs, and of the differences of what stands in min and max."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.algebra import Algebra, Scalar
from tcstudy.scene.expression_tree import Call, Node, Number
from tcstudy.scene.expressions import Expression, of_tree
from tcstudy.scene.records import Body
from tcstudy.scene.sampling import INWARD, grid

Array = NDArray[np.float64]


def kinks(scalar: Scalar) -> tuple[Expression, ...]:
    """Expressions that change their sign where the scalar may have a kink: at abs, min and max."""
    if not isinstance(scalar, Expression):
        return ()
    algebra, found, done = Algebra(), dict[Node, None](), dict[Node, Node]()
    for node in scalar.order:
        done[node] = algebra.again(node, done)
        if isinstance(node, Call) and node.function == "abs":
            found[done[node.arguments[0]]] = None
        elif isinstance(node, Call) and node.function in ("min", "max"):
            parts = [done[a] for a in node.arguments]
            found |= {algebra.less(a, b): None for i, a in enumerate(parts) for b in parts[i + 1 :]}
    return tuple(of_tree(node) for node in found if not isinstance(node, Number))


def sides(bend: Expression, body: Body) -> tuple[Array, Array]:
    """Points on both sides of where `bend` changes its sign along the lines of a grid."""
    x, y, within = grid(body)
    firsts, seconds = [], []
    for axis in (0, 1):
        here, there = (np.take(within, r, axis) for r in (range(len(x) - 1), range(1, len(x))))
        both = here & there
        ends = [
            np.column_stack([np.take(c, r, axis)[both] for c in (x, y)]) for r in (range(len(x) - 1), range(1, len(x)))
        ]
        firsts.append(ends[0])
        seconds.append(ends[1])
    a, b = np.concatenate(firsts), np.concatenate(seconds)
    sign = np.sign(bend.evaluate(*a.T))
    change = sign * np.sign(bend.evaluate(*b.T)) < 0
    a, b, sign = a[change], b[change], sign[change]
    apart = INWARD * (b - a)
    for _ in range(60):
        middle = 0.5 * (a + b)
        left = np.sign(bend.evaluate(*middle.T)) == sign
        a, b = np.where(left[:, None], middle, a), np.where(left[:, None], b, middle)
    return a - apart, b + apart  # at the kink itself a slope may be neither
