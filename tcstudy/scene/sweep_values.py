"""The values of one swept parameter, and the labels that stand for them in the data."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tcstudy.scene import walker
from tcstudy.scene.fields import Fields
from tcstudy.scene.node import Node
from tcstudy.scene.parameters import Parameter
from tcstudy.scene.units import Dimension
from tcstudy.scene.walker import Context

MAX_POINTS = 1_000_000


def axis_values(ctx: Context, node: Node, parameter: Parameter) -> tuple[tuple[Node, ...], tuple[str, ...]]:
    """The values of an axis, and their names if they are laws."""
    if parameter.kind == "law":
        if isinstance(node.value, Mapping) and "law" not in node.value and node.value:
            return tuple(node.value.values()), tuple(node.value)
        remedy = ctx.example("write {NAME: {law: tresca, tau: 20 MPa}, NAME: ...}")
        what = f"must be a mapping of names to laws, but is {node.kind()}"
        ctx.errors.at(node, "is a single law, not a mapping of names to laws" if node.child("law") else what, remedy)
        return (), ()
    if isinstance(node.value, tuple) and node.value:
        return node.value, ()
    if isinstance(node.value, Mapping) and parameter.kind != "text":
        return _spaced(ctx, node, parameter.dimension), ()
    example = ctx.example(parameter.dimension.example) if parameter.kind != "text" else "..."
    remedy = f"write a list such as [{example}, ...]" + (
        "" if parameter.kind == "text" else " or {linspace: [a, b, n]}"
    )
    what = "has no values" if node.value in (None, (), {}) else f"must be a list of values, but is {node.kind()}"
    ctx.errors.at(node, what, remedy)
    return (), ()


def _spaced(ctx: Context, node: Node, dimension: Dimension) -> tuple[Node, ...]:
    """{linspace: [a, b, n]} or {geomspace: [a, b, n]}: n values from a to b, both included."""
    before = len(ctx.errors)
    fields = Fields(ctx, node, (), ("linspace", "geomspace"))
    if len(fields.values) != 1 or len(ctx.errors) > before:
        if len(ctx.errors) == before:
            ctx.errors.at(node, "needs one of linspace and geomspace", "write {linspace: [a, b, n]}")
        return ()
    kind, item = next(iter(fields.values.items()))
    if not isinstance(item.value, tuple) or len(item.value) != 3:
        ctx.errors.at(item, f"must be [a, b, n], but is {item.kind()}", f"write {{{kind}: [a, b, n]}}")
        return ()
    a, b = (walker.quantity(ctx, end, dimension) for end in item.value[:2])
    n = walker.integer(ctx, item.value[2], 2, MAX_POINTS)
    if kind == "geomspace" and a * b <= 0.0:
        remedy = "give two positive numbers, or use linspace"
        ctx.errors.at(item, f"geomspace needs two ends of one sign, not {a:g} and {b:g}", remedy)
    if a == b:
        ctx.errors.at(item, "both ends are equal, so the values are repeated", "give two different ends")
    if len(ctx.errors) > before:
        return ()
    numbers = [_between(kind, a, b, i / (n - 1)) for i in range(n)]
    return tuple(Node(value, item.path, item.mark, item.key_mark) for value in numbers)


def _between(kind: str, a: float, b: float, t: float) -> float:
    """The point at t of [a, b], the ends exact; geometric spacing rounded to what logarithms give."""
    if t in (0.0, 1.0):
        return b if t else a
    if kind == "linspace":
        return float(f"{a + (b - a) * t:.15g}")
    return float(f"{math.copysign(math.exp((1 - t) * math.log(abs(a)) + t * math.log(abs(b))), a):.15g}")


def axis_labels(ctx: Context, values: tuple[Node, ...], parameter: Parameter) -> tuple[float | str, ...]:
    """Numbers in SI, or texts if any value is none."""
    if parameter.kind == "text":
        return tuple(value.text() for value in values)
    free = parameter.path[0] == "boundary" and parameter.path[-1].startswith("u_")
    if free and any(value.value == "free" for value in values):
        return tuple(value.text() for value in values)
    varies = parameter.kind == "field"
    labels = [walker.scalar(ctx, value, parameter.dimension, varies=varies) for value in values]
    if all(isinstance(label, float) for label in labels):
        return tuple(label for label in labels if isinstance(label, float))
    return tuple(value.text() for value in values)
