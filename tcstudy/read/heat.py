"""Reads what a study says of heat: its section `heat`, the `heat` of edges, and whether the two and the material agree.

Heat is a known temperature, or conduction with a source in ω and what edges do to it: exchange on Γ_θ (eqs. 2, 5), a
flux, a temperature that is held. An edge that exchanges heat leaves to the section what it does not say by itself.
"""

from __future__ import annotations

from collections.abc import Mapping

from tcstudy.read.body import INLINE, REGION_SHAPES
from tcstudy.read.fields import Context, Fields, none_after_fault
from tcstudy.read.node import Node, hint
from tcstudy.scene.keys import row, rows
from tcstudy.scene.records import EdgeHeat, Heat, Material, Role, exchanges

Boundary = tuple[tuple[str, Role], ...]

EXCHANGE = tuple(name for name in rows("edge_heat") if name != "theta")
HEAT = ("alpha", "theta_bar")
"""Keys of the section `heat` that edges may give by themselves."""
HEAT_KEYS = ("heat", *EXCHANGE)
"""Keys of an edge that say what it does to heat."""


def read_edge_heat(ctx: Context, fields: Fields, kind: str) -> EdgeHeat | None:
    """What the edge does to heat by itself; None where it says nothing of it."""
    if kind == "convection":
        given = fields.given(EXCHANGE)
        return EdgeHeat(**given) if given else None
    if (node := fields["heat"]) is None:
        return None
    own = Fields(ctx, node, "edge_heat")
    if isinstance(node.value, Mapping) and not own.values:
        ctx.errors.at(node, "says nothing", "give theta, or flux, or alpha and theta_bar; without heat it is insulated")
    if own["theta"] and (others := [key for key in own.values if key in EXCHANGE]):
        what = f"theta is held on the edge, so {', '.join(others)} would not be used"
        own.fault("theta", what, "keep theta alone, or remove it", on_key=True)
    return EdgeHeat(**own.given())


@none_after_fault
def read_heat(ctx: Context, node: Node | None, regions: tuple[str, ...] | None) -> Heat:
    """The heat problem; zero temperature without the section; None after a fault.

    regions: names of the regions of the body; None if they are not known
    """
    if node is None:
        return Heat()
    if node.child("theta"):
        fields = Fields(ctx, node, "heat", ("theta",))
        if others := [key for key in fields.values if key in fields.rows and key != "theta"]:
            what = f"theta is the known temperature, so {', '.join(others)} would not be used"
            ctx.errors.once(fields.values["theta"], what, "keep theta alone, or remove it to compute the temperature")
        return Heat(**fields.given(("theta",)))
    fields = Fields(ctx, node, "heat")
    return Heat(**fields.given((*HEAT, "q")), omega=_omega(ctx, fields["omega"], regions))


def _omega(ctx: Context, node: Node | None, regions: tuple[str, ...] | None) -> tuple[str, ...]:
    """Names of the regions that make up ω; empty for the whole body."""
    if node is None:
        return ()
    if isinstance(node.value, Mapping):
        if ctx.errors.point and node.path.startswith("sweep"):
            remedy = "describe the regions under body.regions and sweep over their names"
            ctx.errors.at(node, "a shape cannot be swept, because the mesh depends on it", remedy)
        elif INLINE in (regions or ()):
            remedy = f"write omega: {INLINE}, or give the region under body.regions another name"
            ctx.errors.at(node, f"the body already has a region {INLINE!r}", remedy)
        return (INLINE,)
    items = node.value if isinstance(node.value, tuple) else (node,) if isinstance(node.value, str) else ()
    if not items:
        remedy = f"write NAME or [NAME, ...], or a shape: {', '.join(REGION_SHAPES)}"
        ctx.errors.at(node, f"must name regions of the body, but is {node.kind()}", remedy)
    names: list[str] = []
    for item in items:
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
    passing = [(edge, role.heat or EdgeHeat()) for edge, role in boundary if exchanges(role)]
    held = [edge for edge, role in boundary if role.heat is not None and role.heat.theta is not None]
    section, alpha = root.child("heat"), root.nearest("heat", "alpha")
    if heat.theta is not None or (section is None and not own):
        why = "the study has no section heat" if section is None else "the temperature theta is given"
        for edge in dict.fromkeys((*(edge for edge, _ in passing), *own)):
            what = "what the edge does to heat" if edge in own else "a convection edge"
            remedy = "remove theta to compute the temperature, or what the edge says of heat"
            if edge not in own:
                remedy = "add heat: {alpha: ..., theta_bar: ...}, or make the edge free or traction"
            ctx.errors.once(root.nearest("boundary", edge), f"{what} has no meaning, because {why}", remedy)
        return
    for key in (
        HEAT if section is not None and isinstance(section.value, Mapping) else ()
    ):  # what edges leave to the section
        if not root.at("heat", key) and (not own or any(getattr(given, key) is None for _, given in passing)):
            said = f"is missing; add {key}: {ctx.example(row('heat', key).suggestion)}"
            ctx.errors.at(root.nearest("heat"), said, key=f"heat.{key}")
    if not (passing or held or own) and heat.q == 0.0:  # no heat comes or goes: an alpha then is a doubt, no fault
        return
    places = (("material",), *(("materials", name) for name, _ in material.regions))
    for place, one in zip(places, material.all, strict=True):
        if one.k is None:
            key = f"{'.'.join(place)}.k"
            ctx.errors.once(root.nearest(*place), "is missing, but heat needs it; add k: 45 W/(m*K)", key=key)
    if not passing and not held and (own or heat.alpha > 0.0):
        node, what = root.nearest("boundary", *own[:1]), "and none holds a temperature: no heat can leave"
        if heat.alpha > 0.0:
            node, what = alpha, "so alpha acts nowhere"
        remedy = "give the role convection to the edges that exchange heat, or give a known temperature theta"
        ctx.errors.once(node, f"no edge has the role convection, {what}", remedy)
    elif section is None:
        for edge, given in passing:
            for key, example in (("alpha", "100 W/(m^2*K)"), ("theta_bar", "20 K")) if edge in own else ():
                if getattr(given, key) is None:
                    said = f"is missing, and there is no section heat to take it from; add {key}: {example}"
                    node = root.nearest("boundary", edge, "heat")
                    ctx.errors.once(node, said, key=f"boundary.{edge}.heat.{key}")
    elif heat.alpha == 0.0 and own and any(said.alpha is None for _, said in passing):
        what = "with alpha = 0 the edges that have none of their own exchange nothing"
        ctx.errors.once(alpha, what, "give alpha > 0, or make those edges free or traction")
    elif heat.alpha == 0.0 and not own and heat.q != 0.0:
        what = "with alpha = 0 the heat of q cannot leave the body, so there is no steady state"
        ctx.errors.once(alpha, what, "give alpha > 0, or q: 0")
