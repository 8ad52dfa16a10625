"""Reads what a study says of heat: its section `heat`, the `heat` of edges, and whether the two and the material agree.

Heat is a known temperature, or conduction with a source in ω and what edges do to it: exchange on Γ_θ (eqs. 2, 5), a
flux, a temperature that is held. An edge that exchanges heat leaves to the section what it does not say by itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from tcstudy.expressions.expression import Expression
from tcstudy.read.body import REGION_SHAPES, read_region
from tcstudy.read.fields import Context, Fields, none_after_fault
from tcstudy.read.node import Node, deepest, hint
from tcstudy.scene.keys import rows
from tcstudy.scene.records import Body, EdgeHeat, Heat, Material, Point, Role, Scalar, exchanges
from tcstudy.shapes.faults import snapped

Boundary = tuple[tuple[str, Role], ...]

EXCHANGE = tuple(name for name in rows("edge_heat") if name != "theta")
HEAT_KEYS = ("heat", *EXCHANGE)
"""Keys of an edge that say what it does to heat."""


def read_edge_heat(ctx: Context, fields: Fields, kind: str) -> EdgeHeat | None:
    """What the edge does to heat by itself; None where it says nothing of it."""
    if kind == "convection":
        given = fields.given(EXCHANGE)
        return EdgeHeat(**given) if given else None
    node = fields["heat"]
    if node is None:
        return None
    own = Fields(ctx, node, "edge_heat")
    if isinstance(node.value, Mapping) and not own.values:
        ctx.errors.at(node, "says nothing", "give theta, or flux, or alpha and theta_bar; without heat it is insulated")
    others = [key for key in own.values if key in EXCHANGE]
    if own["theta"] and others:
        what = f"theta is held on the edge, so {', '.join(others)} would not be used"
        ctx.errors.at(own.values["theta"], what, "keep theta alone, or remove it", on_key=True)
    return EdgeHeat(**own.given())


INLINE = "omega"
"""Name of the region that `omega` describes in place."""


def read_inline_region(ctx: Context, heat: Node | None, body: Body) -> Body:
    """The body with the region that `heat.omega` describes in place, if it does, and all regions on what they meet."""
    node = heat.child("omega") if heat else None
    if node is None or not isinstance(node.value, Mapping):
        return snapped(body) if body.regions else body
    if any(region.name == INLINE for region in body.regions):
        remedy = f"write omega: {INLINE}, or give the region under body.regions another name"
        ctx.errors.at(node, f"the body already has a region {INLINE!r}", remedy)
        return body
    return snapped(replace(body, regions=(*body.regions, read_region(ctx, node, INLINE))))


def needed_of_heat(boundary: Node | None) -> tuple[str, ...]:
    """The keys of `heat` that edges leave to it; both where no edge says anything of heat by itself."""
    edges = boundary.value if boundary and isinstance(boundary.value, Mapping) else {}
    words = {edge: node.child("role") if isinstance(node.value, Mapping) else node for edge, node in edges.items()}
    convection = {edge for edge, word in words.items() if word is not None and word.value == "convection"}
    places = {edge: node if edge in convection else node.child("heat") for edge, node in edges.items()}
    said = {edge: {*EXCHANGE} & {*p.value} for edge, p in places.items() if p and isinstance(p.value, Mapping)}
    if not any(given or edge not in convection for edge, given in said.items()):
        return ("alpha", "theta_bar")
    exchanging = [said.get(edge, set()) for edge in edges if edge in convection or said.get(edge, set()) - {"flux"}]
    return tuple(key for key in ("alpha", "theta_bar") if any(key not in given for given in exchanging))


@none_after_fault
def read_heat(
    ctx: Context,
    node: Node | None,
    regions: tuple[str, ...] | None,
    required: tuple[str, ...] = ("alpha", "theta_bar"),
) -> Heat:
    """The heat problem; zero temperature without the section; None after a fault.

    regions:  names of the regions of the body; None if they are not known
    required: keys that edges leave to the section
    """
    if node is None:
        return Heat()
    if node.child("theta"):
        fields = Fields(ctx, node, "heat", ("theta",))
        others = [key for key in fields.values if key in fields.rows and key != "theta"]
        if others:
            what = f"theta is the known temperature, so {', '.join(others)} would not be used"
            ctx.errors.once(fields.values["theta"], what, "keep theta alone, or remove it to compute the temperature")
        return Heat(**fields.given(("theta",)))
    fields = Fields(ctx, node, "heat", required)
    return Heat(**fields.given(("alpha", "theta_bar", "q")), omega=_omega(ctx, fields["omega"], regions))


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
        name = ctx.text(item, "the name of a region")
        if name and regions is not None and name not in regions:
            shape = f"add it under body.regions, or write one of {', '.join(REGION_SHAPES)} here"
            remedy = hint(name, regions, f"use one of {', '.join(regions)}" if regions else shape)
            ctx.errors.at(item, f"the body has no region {name!r}", remedy)
        if name in names:
            ctx.errors.at(item, f"the region {name!r} is given twice", "name each region once")
        names.append(name)
    return tuple(names)


def check_heat(ctx: Context, root: Node, heat: Heat, boundary: Boundary, material: Material) -> None:
    """Heat needs a conductivity and an edge that decides about temperature; what is given must act somewhere."""
    own = [edge for edge, role in boundary if role.heat is not None]
    passing = [edge for edge, role in boundary if exchanges(role)]
    section = root.child("heat")
    if heat.theta is not None or (section is None and not own):
        for edge in dict.fromkeys((*passing, *own)):
            node = deepest(root, ("boundary", edge))
            why = "the study has no section heat" if section is None else "the temperature theta is given"
            remedy = "add heat: {alpha: ..., theta_bar: ...}, or make the edge free or traction"
            if section is not None and edge in own:
                remedy = "remove theta to compute the temperature, or what the edge says of heat"
            what = "what the edge does to heat" if edge in own else "a convection edge"
            ctx.errors.once(node, f"{what} has no meaning, because {why}", remedy)
        return
    held = [edge for edge, role in boundary if role.heat is not None and role.heat.theta is not None]
    if not (passing or held or own) and heat.q == 0.0:  # no heat comes or goes: an alpha then is a doubt, no fault
        return
    places = (("material",), *(("materials", name) for name, _ in material.regions))
    for place, one in zip(places, material.all, strict=True):
        if one.k is None:
            node = deepest(root, place)
            ctx.errors.once(node, "is missing, but heat needs it", "add k: 45 W/(m*K)", key=f"{'.'.join(place)}.k")
    if not passing and not held and (own or heat.alpha > 0.0):
        node = deepest(root, ("heat", "alpha") if heat.alpha > 0.0 else ("boundary", own[0]))
        remedy = "give the role convection to the edges that exchange heat, or give a known temperature theta"
        what = "so alpha acts nowhere" if heat.alpha > 0.0 else "and none holds a temperature: no heat can leave"
        ctx.errors.once(node, f"no edge has the role convection, {what}", remedy)
        return
    _check_section(ctx, root, heat, boundary, bool(own))


def _check_section(ctx: Context, root: Node, heat: Heat, boundary: Boundary, own: bool) -> None:
    """α of the section heat: it acts somewhere, and where it is 0 nothing needs it."""
    section, node = root.child("heat"), deepest(root, ("heat", "alpha"))
    if section is None:
        examples = {"alpha": "alpha: 100 W/(m^2*K)", "theta_bar": "theta_bar: 20 K"}
        for edge, role in boundary:
            for key, example in examples.items() if exchanges(role) and role.heat is not None else ():
                if getattr(role.heat, key) is None:
                    what = "is missing, and there is no section heat to take it from"
                    place = deepest(root, ("boundary", edge, "heat"))
                    ctx.errors.once(place, what, f"add {example}", key=f"boundary.{edge}.heat.{key}")
        return
    users = [role for _, role in boundary if exchanges(role) and (role.heat is None or role.heat.alpha is None)]
    if own and users and heat.alpha == 0.0:
        what = "with alpha = 0 the edges that have none of their own exchange nothing"
        ctx.errors.once(node, what, "give alpha > 0, or make those edges free or traction")
    elif not own and heat.alpha == 0.0 and heat.q != 0.0:
        what = "with alpha = 0 the heat of q cannot leave the body, so there is no steady state"
        ctx.errors.once(node, what, "give alpha > 0, or q: 0")


def value_at(scalar: Scalar, at: Point) -> float:
    """A number, or the value of an expression at a point."""
    return float(scalar.evaluate(at[0], at[1])) if isinstance(scalar, Expression) else float(scalar)


def check_held(ctx: Context, node: Node, body: Body, boundary: Boundary) -> None:
    """Record every corner at which two edges hold different temperatures: heat without end would flow there."""
    held = {name: role.heat.theta for name, role in boundary if role.heat and role.heat.theta is not None}
    if body.outline is None or len(held) < 2:
        return
    for edge, following in (pair for loop in body.loops for pair in loop.corners):
        if edge.name == following.name or not {edge.name, following.name} <= {*held}:
            continue
        (x, y), (a, b) = edge.end, (value_at(held[name], edge.end) for name in (edge.name, following.name))
        if abs(a - b) > 1e-9 * max(abs(a), abs(b)):
            what = f"{edge.name} and {following.name} hold different temperatures at their corner ({x:g}, {y:g})"
            remedy = "make them agree there, or let one of them exchange heat: {alpha: ..., theta_bar: ...}"
            ctx.errors.once(deepest(node, (following.name,)), what, remedy)
