"""Reads the section `heat`: a known temperature, or conduction with a source in ω and exchange on Γ_θ (eqs. 2, 5)."""

from __future__ import annotations

from collections.abc import Mapping

from tcstudy.scene import walker
from tcstudy.scene.fields import Fields
from tcstudy.scene.node import Node
from tcstudy.scene.read_body import REGION_SHAPES, read_region
from tcstudy.scene.records import Body, Heat
from tcstudy.scene.units import HEAT_SOURCE, HEAT_TRANSFER, TEMPERATURE
from tcstudy.scene.walker import Context

INLINE = "omega"
"""Name of the region that `omega` describes in place."""


def read_inline_region(ctx: Context, heat: Node | None, body: Body) -> Body:
    """The body with the region that `heat.omega` describes in place, if it does."""
    node = heat.child("omega") if heat else None
    if node is None or not isinstance(node.value, Mapping):
        return body
    if any(region.name == INLINE for region in body.regions):
        remedy = f"write omega: {INLINE}, or give the region under body.regions another name"
        ctx.errors.at(node, f"the body already has a region {INLINE!r}", remedy)
        return body
    return Body(body.outline, body.holes, (*body.regions, read_region(ctx, node, INLINE)), body.brep)


def read_heat(ctx: Context, node: Node | None, regions: tuple[str, ...] | None) -> Heat | None:
    """The heat problem; zero temperature without the section; None after a fault.

    regions: names of the regions of the body; None if they are not known
    """
    if node is None:
        return Heat()
    before = len(ctx.errors)
    if node.child("theta"):
        fields = Fields(ctx, node, ("theta",), ("alpha", "theta_bar", "q", "omega"))
        others = [key for key in fields.values if key in ("alpha", "theta_bar", "q", "omega")]
        if others:
            what = f"theta is the known temperature, so {', '.join(others)} would not be used"
            ctx.errors.once(fields.values["theta"], what, "keep theta alone, or remove it to compute the temperature")
        heat = Heat(theta=fields.field("theta", TEMPERATURE))
    else:
        fields = Fields(ctx, node, ("alpha", "theta_bar"), ("q", "omega", "theta"))
        alpha = fields.quantity("alpha", HEAT_TRANSFER, "not negative")
        theta_bar, q = fields.field("theta_bar", TEMPERATURE), fields.field("q", HEAT_SOURCE)
        heat = Heat(None, alpha, theta_bar, q, _omega(ctx, fields["omega"], regions))
        if alpha == 0.0 and q != 0.0 and len(ctx.errors) == before:
            remedy = "give alpha > 0, or q: 0"
            what = "with alpha = 0 the heat of q cannot leave the body, so there is no steady state"
            ctx.errors.at(fields.values["alpha"], what, remedy)
    return heat if len(ctx.errors) == before else None


def _omega(ctx: Context, node: Node | None, regions: tuple[str, ...] | None) -> tuple[str, ...]:
    """Names of the regions that make up ω; empty for the whole body."""
    if node is None:
        return ()
    if isinstance(node.value, Mapping):
        if ctx.errors.point and node.path.startswith("sweep"):
            remedy = "describe the regions under body.regions and sweep over their names"
            ctx.errors.at(node, "a shape cannot be swept, because the mesh depends on it", remedy)
        return (INLINE,)
    if not isinstance(node.value, str) and (not isinstance(node.value, tuple) or not node.value):
        remedy = f"write NAME or [NAME, ...], or a shape: {', '.join(REGION_SHAPES)}"
        ctx.errors.at(node, f"must name regions of the body, but is {node.kind()}", remedy)
        return ()
    names = []
    for item in node.value if isinstance(node.value, tuple) else (node,):
        name = walker.text(ctx, item, "the name of a region")
        if name and regions is not None and name not in regions:
            shapes = f"one of {', '.join(REGION_SHAPES)}"
            known = (
                walker.choose(name, regions, "one of")
                if regions
                else f"add it under body.regions, or write {shapes} here"
            )
            ctx.errors.at(item, f"the body has no region {name!r}", known)
        if name in names:
            ctx.errors.at(item, f"the region {name!r} is given twice", "name each region once")
        names.append(name)
    return tuple(names)
