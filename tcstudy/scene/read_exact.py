"""Reads the section `exact`: the solution that errors are measured against, and from which loads may be derived."""

from __future__ import annotations

from tcstudy.scene import walker
from tcstudy.scene.fields import Fields
from tcstudy.scene.finite import check_finite
from tcstudy.scene.node import Node
from tcstudy.scene.records import Body, Exact
from tcstudy.scene.units import LENGTH, NONE, TEMPERATURE, TRACTION
from tcstudy.scene.walker import Context

LOADS = ("given", "derived")


def read_exact(ctx: Context, node: Node | None, root: Node, body: Body | None) -> Exact | None:
    """The exact solution; None without the section and after a fault."""
    if node is None:
        return None
    before = len(ctx.errors)
    fields = Fields(ctx, node, ("u",), ("theta", "xi", "exponent", "loads"))
    exact = Exact(
        fields.vector("u", LENGTH),
        fields.field("theta", TEMPERATURE) if fields["theta"] else None,
        fields.field("xi", TRACTION) if fields["xi"] else None,
        fields.quantity("exponent", NONE, "positive") if fields["exponent"] else None,
        (word := fields["loads"]) is not None and walker.choice(ctx, word, LOADS) == "derived",
    )
    if body is not None and len(ctx.errors) == before:
        check_finite(ctx, root, "exact", exact, body)
    return exact if len(ctx.errors) == before else None
