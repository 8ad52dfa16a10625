"""Reads a sweep whose points are drawn: `mode: random`, `latin-hypercube`, `sobol` or `saltelli`.

Every parameter has a distribution; what comes out are the same axes that a list of points has, read together. A drawn
point that the study cannot have is refused like a written one, before any work: left out, it would bend the
distribution that the user asked for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tcstudy.read.fields import Context, Fields
from tcstudy.read.node import Node
from tcstudy.scene import keys as table
from tcstudy.scene.designs import ENDS, PARAMETERS, SALTELLI, Cube, Design, Distribution, count, cube
from tcstudy.scene.parameters import NUMBERS, WHOLE, Parameter
from tcstudy.scene.units import NONE


@dataclass(frozen=True)
class DrawnAxis:
    """The values of one parameter, and what stands in the data for them.

    names:        of laws; empty for other values
    distribution: in words
    """

    values: tuple[Node, ...]
    names: tuple[str, ...]
    distribution: str


def read_design(ctx: Context, node: Node, mode: str, most: int, d: int) -> Design | None:
    """How many points are drawn, and from which seed; None after a fault."""
    before = len(ctx.errors)
    points, seed = node.child("points"), node.child("seed")
    if points is None:
        ctx.errors.at(node, "is missing", "say how many are drawn: points: 500", key=f"{node.path}.points")
        return None
    n = ctx.integer(points, 1, most)
    start = ctx.value(seed, table.row("sweep", "seed")) if seed is not None else 0
    if len(ctx.errors) == before and count(mode, n, d) > most:
        what = f"{n} × ({d} + 2) points of {mode} are more than {most}"
        ctx.errors.at(points, what, "draw fewer points, or leave parameters out")
    return Design(mode, n, start) if len(ctx.errors) == before else None


def draw(ctx: Context, design: Design, items: Mapping[str, tuple[Node, Parameter]]) -> dict[str, DrawnAxis]:
    """The drawn values by key; only those whose distribution could be read."""
    read = {key: _read(ctx, node, parameter, design.mode) for key, (node, parameter) in items.items()}
    if not items or any(found is None for found in read.values()):
        return {}
    u = cube(design, len(items))
    return {key: _at(items[key][0], found, u[:, j]) for j, (key, found) in enumerate(read.items()) if found}


Choice = dict[str, Node] | tuple[Node, ...]


def _read(ctx: Context, node: Node, parameter: Parameter, mode: str) -> Distribution | Choice | None:
    """The distribution of a parameter, or the values that are equally likely; None after a fault."""
    if parameter.is_whole and isinstance(node.value, Mapping) and node.value and not parameter.is_one(node.value):
        found: Choice | Distribution | None = dict(node.value)
    elif not isinstance(node.value, Mapping) or parameter.is_whole:
        shape = (
            f"{{NAME: {{{WHOLE[parameter.row.kind][0]}: ...}}, NAME: ...}}"
            if parameter.is_whole
            else "{uniform: [a, b]} or {choice: [a, b]}"
        )
        ctx.errors.at(node, f"must be a distribution, but is {node.kind()}", f"with mode: {mode} write {shape}")
        return None
    else:
        found = _named(ctx, node, parameter)
    if mode == SALTELLI and found is not None and not isinstance(found, Distribution):
        remedy = "give it a distribution of numbers, or write one study for each value"
        ctx.errors.at(node, f"a choice has no indices by mode: {SALTELLI}", remedy)
        return None
    return found


def _named(ctx: Context, node: Node, parameter: Parameter) -> Distribution | Choice | None:
    """{NAME: its numbers}."""
    before = len(ctx.errors)
    fields = Fields(ctx, node, "distribution")
    if len(fields.values) != 1 or len(ctx.errors) > before:
        if len(ctx.errors) == before:
            ctx.errors.at(node, f"needs one of {', '.join(table.rows('distribution'))}", "write {uniform: [a, b]}")
        return None
    kind, item = next(iter(fields.values.items()))
    if kind == "choice":
        entries = ctx.items(item, "a list of values", least=1)
        return entries or None
    dimension = parameter.row.dimension
    if parameter.row.kind not in NUMBERS:
        ctx.errors.at(item, f"{parameter.path[-1]} is no single number", "write {choice: [..., ...]}")
        return None
    names = PARAMETERS[kind]
    if names == ENDS:
        both = ctx.pair(item, "two ends [a, b]", "[1, 2]")
        numbers = tuple(ctx.quantity(end, dimension) for end in both) if both else ()
    else:
        inner = Fields(ctx, item, kind, names)
        plain = kind == "lognormal"
        numbers = tuple(inner.value(name, NONE if plain and name == "sigma" else dimension) for name in names)
    if len(ctx.errors) > before:
        return None
    found = Distribution(kind, tuple(zip(names, numbers, strict=True)))
    if any(found.fault):
        ctx.errors.at(item, *found.fault)
        return None
    return found


def _at(node: Node, found: Distribution | Choice | None, u: Cube) -> DrawnAxis:
    """The values at points in (0, 1)."""
    if isinstance(found, Distribution):
        values = tuple(Node(value, node.path, node.mark, node.key_mark) for value in found.at(u).tolist())
        return DrawnAxis(values, (), str(found))
    assert found is not None
    entries = tuple(found.values()) if isinstance(found, dict) else found
    which = np.minimum((u * len(entries)).astype(int), len(entries) - 1).tolist()
    names = tuple(found) if isinstance(found, dict) else ()
    said = ", ".join(names or [entry.text() for entry in entries])
    return DrawnAxis(tuple(entries[i] for i in which), tuple(names[i] for i in which if names), f"choice({said})")
