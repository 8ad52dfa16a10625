"""The outward unit normal of boundary curves as expressions in x and y.

On a line n is constant, on an arc it is (x − centre)/radius. Several curves get one field that is the normal of each
on each, N = Σ w_i n_i / Σ w_i with w_i = Π_{j≠i} D_j, where D_j vanishes on curve j only (Shepard's interpolation):
what depends on n is then one expression for all of them. Off the curves N means nothing.

Where expressions bend: at the zeros of what stands in abs, and of the differences of what stands in min and max.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.derivative import Calculus, Scalar
from tcstudy.expressions.expression import Expression, of_tree
from tcstudy.expressions.tree import TreeNode
from tcstudy.scene.records import Body, Edge
from tcstudy.shapes.edges import INWARD, body_size, edge_arc, edge_at, edge_length, edge_normal, grid

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
    return points, outward(edge, hole, points)


def outward(edge: Edge, hole: bool, points: Array) -> Array:
    """(n, 2) outward unit normals of the body at points of an edge; a hole's edges have the body on their right."""
    n = edge_normal(edge, points)
    return -n if hole else n


def normal_field(c: Calculus, body: Body, edges: list[tuple[Edge, bool]]) -> Vector:
    """N = n on all the edges."""
    size = body_size(body)
    kinds: list[tuple[tuple[float, ...], Vector, list[Edge]]] = []
    for edge, hole in edges:
        key, vector = _normal(c, edge, hole, size)
        for other, _, members in kinds:
            if len(other) == len(key) and max(abs(a - b) for a, b in zip(other, key, strict=True)) <= SAME:
                members.append(edge)
                break
        else:
            kinds.append((key, vector, [edge]))
    if len(kinds) == 1:
        return kinds[0][1]
    return _blended(c, [(vector, _off(c, members, size)) for _, vector, members in kinds])


def _normal(c: Calculus, edge: Edge, hole: bool, size: float) -> tuple[tuple[float, ...], Vector]:
    """What tells normals apart, relative to the body, and the normal."""
    arc = edge_arc(edge)
    if arc is None:
        x, y = edge_samples(edge, hole, 1)[1][0]
        return (float(x), float(y)), (c.number(x), c.number(y))
    sign = math.copysign(1.0, arc.sweep) * (-1.0 if hole else 1.0)
    scale, (x, y) = c.number(sign / arc.radius), _from(c, *arc.center)
    key = (arc.center[0] / size, arc.center[1] / size, arc.radius / size, sign)
    return key, (c.times(scale, x), c.times(scale, y))


def _from(c: Calculus, x: float, y: float) -> Vector:
    """(x, y) less a point."""
    return c.less(c.variable("x"), c.number(x)), c.less(c.variable("y"), c.number(y))


def _off(c: Calculus, edges: list[Edge], size: float) -> TreeNode:
    """Vanishes on the edges only, without a unit."""
    product = c.one
    for edge in edges:
        product = c.times(product, c.times(c.number(size**-2), _off_one(c, edge)))
    return product


def _off_one(c: Calculus, edge: Edge) -> TreeNode:
    start, end = np.array(edge.start), np.array(edge.end)
    at, arc, length = _from(c, *edge.start), edge_arc(edge), edge_length(edge)

    def along(direction: Array) -> TreeNode:
        return c.sum(*(c.times(c.number(d), part) for d, part in zip(direction, at, strict=True)))

    def beyond(a: TreeNode) -> TreeNode:
        """a² where a is positive."""
        return c.square(c.call("max", c.zero, a))

    if arc is None:
        t = (end - start) / length
        across, ahead = along(np.array([t[1], -t[0]])), along(t)
        return c.sum(c.square(across), beyond(c.minus(ahead)), beyond(c.less(ahead, c.number(length))))
    assert edge.through is not None
    chord = (end - start) / np.linalg.norm(end - start)
    inward = np.array([-chord[1], chord[0]])
    inward *= math.copysign(1.0, float(inward @ (np.array(edge.through) - start)))
    radius = c.call("sqrt", c.sum(*(c.square(part) for part in _from(c, *arc.center))))
    off = c.less(radius, c.number(arc.radius))
    return c.plus(c.square(off), beyond(c.minus(along(inward))))  # the arc is the circle on this side of the chord


def _blended(c: Calculus, parts: list[tuple[Vector, TreeNode]]) -> Vector:
    weights = []
    for i in range(len(parts)):
        weight = c.one
        for j, (_, off) in enumerate(parts):
            weight = weight if i == j else c.times(weight, off)
        weights.append(weight)
    total = c.sum(*weights)
    sums = [c.sum(*(c.times(w, n[i]) for w, (n, _) in zip(weights, parts, strict=True))) for i in (0, 1)]
    return c.over(sums[0], total), c.over(sums[1], total)


def kinks(scalar: Scalar) -> tuple[Expression, ...]:
    """Expressions that change their sign where the scalar may have a kink: at abs, min and max."""
    if not isinstance(scalar, Expression):
        return ()
    c, found, done = Calculus(), dict[TreeNode, None](), dict[TreeNode, TreeNode]()
    for node in scalar.order:
        done[node] = c.again(node, done)
        parts = [done[part] for part in node.parts]
        if node.kind == "Call" and node.name == "abs":
            found[parts[0]] = None
        elif node.kind == "Call" and node.name in ("min", "max"):
            found |= {c.less(a, b): None for a, b in combinations(parts, 2)}
    return tuple(of_tree(node) for node in found if node.kind != "Number")


def sides(bend: Expression, body: Body) -> tuple[Array, Array]:
    """Points on both sides of where `bend` changes its sign along the lines of a grid."""
    x, y, within = grid(body)
    points, pairs = np.stack([x, y], axis=-1), []
    for first, second in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        both = within[first] & within[second]
        pairs.append((points[first][both], points[second][both]))
    a, b = (np.concatenate(ends) for ends in zip(*pairs, strict=True))
    sign = np.sign(bend.evaluate(*a.T))
    change = sign * np.sign(bend.evaluate(*b.T)) < 0
    a, b, sign = a[change], b[change], sign[change]
    apart = INWARD * (b - a)
    for _ in range(60):
        middle = 0.5 * (a + b)
        left = np.sign(bend.evaluate(*middle.T)) == sign
        a, b = np.where(left[:, None], middle, a), np.where(left[:, None], b, middle)
    return a - apart, b + apart  # at the kink itself a slope may be neither
