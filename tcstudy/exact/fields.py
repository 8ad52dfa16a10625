"""The outward unit normal of boundary curves as expressions in x and y.

On a line n is constant, on an arc it is (x − centre)/radius. Several curves get one field that is the normal of each
on each, N = Σ w_i n_i / Σ w_i with w_i = Π_{j≠i} D_j, where D_j vanishes on curve j only (Shepard's interpolation):
what depends on n is then one expression for all of them. Off the curves N means nothing.

Where expressions bend: at the zeros of what stands in abs, and of the differences of what stands in min and max.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.derivative import Algebra, Scalar
from tcstudy.expressions.expression import Expression, of_tree
from tcstudy.expressions.tree import Call, Number, TreeNode
from tcstudy.scene.records import Body, Edge
from tcstudy.shapes.edges import INWARD, Arc, body_size, edge_arc, edge_at, edge_length, edge_normal, grid

Array = NDArray[np.float64]
Vector = tuple[TreeNode, TreeNode]

SAME = 1e-9
"""Normals that differ by less, and centres by less times the size of the body, are one."""
SAMPLES = 64


def body_edges(body: Body, names: Iterable[str] | None = None) -> list[tuple[Edge, bool]]:
    """Edges with the given names (all without), each with whether it is a hole's, so that the body is on its right."""
    assert body.outline is not None
    wanted = None if names is None else set(names)
    loops = [(body.outline, False), *((hole, True) for hole in body.holes)]
    return [(edge, hole) for loop, hole in loops for edge in loop.edges if wanted is None or edge.name in wanted]


def edge_samples(edge: Edge, hole: bool, count: int = SAMPLES) -> tuple[Array, Array]:
    """Points (n, 2) inside an edge, its ends and middle avoided, and outward unit normals there (n, 2)."""
    points = edge_at(edge, (np.arange(count) + 0.38) / count)
    normals = edge_normal(edge, points)
    return points, -normals if hole else normals


def normal_field(algebra: Algebra, body: Body, edges: list[tuple[Edge, bool]]) -> Vector:
    """N = n on all the edges."""
    size = body_size(body)
    kinds: list[tuple[tuple[float, ...], Vector, list[Edge]]] = []
    for edge, hole in edges:
        key, vector = _normal(algebra, edge, hole, size)
        for other, _, members in kinds:
            if len(other) == len(key) and max(abs(a - b) for a, b in zip(other, key, strict=True)) <= SAME:
                members.append(edge)
                break
        else:
            kinds.append((key, vector, [edge]))
    if len(kinds) == 1:
        return kinds[0][1]
    return _blended(algebra, [(vector, _off(algebra, members, size)) for _, vector, members in kinds])


def _normal(algebra: Algebra, edge: Edge, hole: bool, size: float) -> tuple[tuple[float, ...], Vector]:
    """What tells normals apart, relative to the body, and the normal."""
    arc = edge_arc(edge)
    if arc is None:
        n = edge_samples(edge, hole, 1)[1][0]
        return (float(n[0]), float(n[1])), (algebra.number(n[0]), algebra.number(n[1]))
    sign = math.copysign(1.0, arc.sweep) * (-1.0 if hole else 1.0)
    radial = _radial(algebra, arc)
    scale = algebra.number(sign / arc.radius)
    key = (arc.center[0] / size, arc.center[1] / size, arc.radius / size, sign)
    return key, (algebra.times(scale, radial[0]), algebra.times(scale, radial[1]))


def _from(algebra: Algebra, x: float, y: float) -> Vector:
    """(x, y) less a point."""
    return tuple(algebra.less(algebra.variable(name), algebra.number(at)) for name, at in (("x", x), ("y", y)))  # type: ignore[return-value]


def _radial(algebra: Algebra, arc: Arc) -> Vector:
    return _from(algebra, *arc.center)


def _along(algebra: Algebra, at: Vector, direction: Array) -> TreeNode:
    parts = (algebra.times(algebra.number(d), a) for d, a in zip(direction, at, strict=True))
    return algebra.sum(*parts)


def _square(algebra: Algebra, a: TreeNode) -> TreeNode:
    return algebra.power(a, algebra.number(2.0))


def _positive_square(algebra: Algebra, a: TreeNode) -> TreeNode:
    return _square(algebra, algebra.call("max", algebra.zero, a))


def _off(algebra: Algebra, edges: list[Edge], size: float) -> TreeNode:
    """Vanishes on the edges only, without a unit."""
    product = algebra.one
    for edge in edges:
        product = algebra.times(product, algebra.times(algebra.number(size**-2), _off_one(algebra, edge)))
    return product


def _off_one(algebra: Algebra, edge: Edge) -> TreeNode:
    start, end = np.array(edge.start), np.array(edge.end)
    at, arc, length = _from(algebra, *edge.start), edge_arc(edge), edge_length(edge)
    if arc is not None:
        radial = _radial(algebra, arc)
        radius = algebra.call("sqrt", algebra.sum(*(_square(algebra, part) for part in radial)))
        assert edge.through is not None
        chord = (end - start) / np.linalg.norm(end - start)
        inward = np.array([-chord[1], chord[0]])
        inward *= math.copysign(1.0, float(inward @ (np.array(edge.through) - start)))
        beyond = algebra.minus(_along(algebra, at, inward))  # the arc is what the circle has on this side of the chord
        off = algebra.less(radius, algebra.number(arc.radius))
        return algebra.plus(_square(algebra, off), _positive_square(algebra, beyond))
    t = (end - start) / length
    along = _along(algebra, at, t)
    return algebra.sum(
        _square(algebra, _along(algebra, at, np.array([t[1], -t[0]]))),
        _positive_square(algebra, algebra.minus(along)),
        _positive_square(algebra, algebra.less(along, algebra.number(length))),
    )


def _blended(algebra: Algebra, parts: list[tuple[Vector, TreeNode]]) -> Vector:
    weights = []
    for i in range(len(parts)):
        weight = algebra.one
        for j, (_, off) in enumerate(parts):
            weight = weight if i == j else algebra.times(weight, off)
        weights.append(weight)
    total = algebra.sum(*weights)
    sums = [algebra.sum(*(algebra.times(w, n[c]) for w, (n, _) in zip(weights, parts, strict=True))) for c in (0, 1)]
    return algebra.over(sums[0], total), algebra.over(sums[1], total)


def kinks(scalar: Scalar) -> tuple[Expression, ...]:
    """Expressions that change their sign where the scalar may have a kink: at abs, min and max."""
    if not isinstance(scalar, Expression):
        return ()
    algebra, found, done = Algebra(), dict[TreeNode, None](), dict[TreeNode, TreeNode]()
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
