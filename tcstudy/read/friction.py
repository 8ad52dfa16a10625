"""Reads the section `friction`: a named shape of law with its parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tcstudy.read.fields import Context, Fields, nearest
from tcstudy.read.node import Node
from tcstudy.scene.friction import FrictionLaw, GrowthError
from tcstudy.scene.law_pieces import LawError
from tcstudy.scene.laws import SHAPES, LawParameter
from tcstudy.scene.units import LAW_DIMENSIONS, LENGTH, TRACTION

LAW_EXAMPLES = {
    "length": "40 um",
    "traction": "20 MPa",
    "stiffness": "5e9 Pa/m",
    "points": "[[0 um, 20 MPa], [40 um, 5 MPa]]",
    "numbers": "[0, 0]",
    "integer": "3",
    "none": "0.5",
}


def read_friction(ctx: Context, node: Node) -> FrictionLaw | None:
    """The friction law; None after a fault."""
    before = len(ctx.errors)
    if not isinstance(node.value, Mapping):
        ctx.errors.at(
            node,
            f"must be a mapping, but is {node.kind()}",
            ctx.example("write for example {law: tresca, tau: 20 MPa}"),
        )
        return None
    word = node.child("law")
    if word is None:
        Fields(ctx, node, "friction")
        return None
    name = ctx.choice(word, tuple(SHAPES))
    if len(ctx.errors) > before:
        return None
    parameters = SHAPES[name].parameters
    fields = Fields(ctx, node, "friction", ("law",), (p.name for p in parameters))
    for p in parameters:
        misspelt = any(nearest(key, (p.name,)) for key in fields.values if key not in _known(parameters))
        if p.required and fields[p.name] is None and not misspelt:
            example = LAW_EXAMPLES.get(p.kind, LAW_EXAMPLES[p.dimension])
            ctx.errors.at(
                node,
                f"is missing in the law {name}",
                f"add {p.name}: {ctx.example(example)}",
                key=f"{node.path}.{p.name}",
            )
    values = {p.name: _value(ctx, item, p) for p in parameters if (item := fields[p.name])}
    return _build(ctx, node, name, values) if len(ctx.errors) == before else None


def _known(parameters: tuple[LawParameter, ...]) -> tuple[str, ...]:
    return ("law", *(p.name for p in parameters))


def _build(ctx: Context, node: Node, name: str, values: dict[str, object]) -> FrictionLaw | None:
    """The law, or the fault of its parameters where the study gives them."""
    try:
        return SHAPES[name].build(**values)
    except LawError as error:
        place = node.child(error.parameter or "") or node
        what, _, remedy = error.message.partition("; ")
        ctx.errors.at(place, what, remedy or f"the law {name}: {SHAPES[name].summary}")
    except GrowthError as error:
        remedy = "let the last values and slopes of b have the sign of the slip"
        ctx.errors.at(node.child("points") or node, str(error), remedy)
    return None


def _value(ctx: Context, node: Node, parameter: LawParameter) -> object:
    """One parameter by its kind; a stand-in after a fault."""
    dimension = LAW_DIMENSIONS[parameter.dimension]
    match parameter.kind:
        case "number":
            return ctx.quantity(node, dimension)
        case "integer":
            return ctx.integer(node, 1)
        case "flag":
            return ctx.flag(node)
        case "numbers":
            entries = ctx.items(node, "a list of numbers", least=1)
            return [ctx.quantity(item, dimension) for item in entries]
        case "points":
            entries = ctx.items(node, "a list of pairs [s, b]", least=1)
            return [_point(ctx, item) for item in entries]
    raise AssertionError(parameter.kind)


def _point(ctx: Context, node: Node) -> tuple[float, float]:
    """A point [s, b] of a law: slip and traction."""
    both = ctx.pair(node, "a pair [s, b] of slip and traction", "[40 um, 5 MPa]")
    if both is None:
        return math.nan, math.nan
    return ctx.quantity(both[0], LENGTH), ctx.quantity(both[1], TRACTION)
