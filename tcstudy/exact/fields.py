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

from tcstudy.expressions.algebra import ONE, ZERO, Term, call, number, term, variable
from tcstudy.expressions.expression import Expression, Scalar, of_tree
from tcstudy.expressions.tree import ordered
from tcstudy.scene.records import Body, Edge
from tcstudy.shapes.edges import INWARD, body_size, edge_arc, edge_at, edge_length, edge_normal, grid

Array = NDArray[np.float64]
Vector = tuple[Term, Term]

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


def normal_field(body: Body, edges: list[tuple[Edge, bool]]) -> Vector:
    """N = n on all the edges."""
    size = body_size(body)
    kinds: list[tuple[tuple[float, ...], Vector, list[Edge]]] = []
    for edge, hole in edges:
        key, vector = _normal(edge, hole, size)
        for other, _, members in kinds:
            if len(other) == len(key) and max(abs(a - b) for a, b in zip(other, key, strict=True)) <= SAME:
                members.append(edge)
                break
        else:
            kinds.append((key, vector, [edge]))
    if len(kinds) == 1:
        return kinds[0][1]
    off = [math.prod((size**-2 * _off(edge) for edge in members), start=ONE) for _, _, members in kinds]
    weights = [math.prod((D for j, D in enumerate(off) if j != i), start=ONE) for i in range(len(kinds))]
    x, y = (sum((w * n[i] for w, (_, n, _) in zip(weights, kinds, strict=True)), ZERO) for i in (0, 1))
    total = sum(weights, ZERO)
    return x / total, y / total


def _normal(edge: Edge, hole: bool, size: float) -> tuple[tuple[float, ...], Vector]:
    """What tells normals apart, relative to the body, and the normal."""
    arc = edge_arc(edge)
    if arc is None:
        x, y = edge_samples(edge, hole, 1)[1][0]
        return (float(x), float(y)), (number(x), number(y))
    sign = math.copysign(1.0, arc.sweep) * (-1.0 if hole else 1.0)
    key = (arc.center[0] / size, arc.center[1] / size, arc.radius / size, sign)
    along_x, along_y = _from(*arc.center)
    return key, (sign / arc.radius * along_x, sign / arc.radius * along_y)


def _from(x: float, y: float) -> Vector:
    """(x, y) less a point."""
    return variable("x") - x, variable("y") - y


def _off(edge: Edge) -> Term:
    """The square of the distance from an edge, or from its circle, as a term that vanishes on the edge only."""
    start, chord, at, arc = np.array(edge.start), np.subtract(edge.end, edge.start), _from(*edge.start), edge_arc(edge)

    def along(direction: Array) -> Term:
        return direction[0] * at[0] + direction[1] * at[1]

    def beyond(a: Term) -> Term:
        """a² where a is positive."""
        return call("max", ZERO, a) ** 2

    if arc is None:
        t = chord / edge_length(edge)
        ahead = along(t)
        return along(np.array([t[1], -t[0]])) ** 2 + beyond(-ahead) + beyond(ahead - edge_length(edge))
    assert edge.through is not None
    chord = chord / np.linalg.norm(chord)
    inward = np.array([-chord[1], chord[0]])
    inward *= math.copysign(1.0, float(inward @ (np.array(edge.through) - start)))
    x, y = _from(*arc.center)
    return (call("sqrt", x**2 + y**2) - arc.radius) ** 2 + beyond(-along(inward))  # the side of the chord with the arc


def kinks(of: Scalar) -> tuple[Expression, ...]:
    """Expressions that change their sign where the scalar may have a kink: at abs, min and max."""
    if not isinstance(of, Expression):
        return ()
    found = dict[Term, None]()
    for node in ordered((term(of),)):
        if isinstance(node, Term) and node.kind == "Call" and node.name in ("abs", "min", "max"):
            first, *other = node.parts
            found |= {first - b: None for b in other or [ZERO]}
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
