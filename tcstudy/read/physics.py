"""Reads the sections that make up a scene beside its body: boundary, material, loads, friction,
heat.

Heat is a known temperature, or conduction with a source in ω and what edges do to it: exchange on
Γ_θ (eqs. 2, 5), a flux, a temperature that is held. An edge that exchanges heat leaves to the
section what it does not say by itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from tcstudy.errors import hint, nearest
from tcstudy.expressions.expression import SPACING, Expression, product, random_field
from tcstudy.laws.composed import EdgeLaws
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import GrowthError
from tcstudy.laws.shapes import SHAPES, LawError
from tcstudy.read.document import Node
from tcstudy.read.fields import Context, Fields, Unsound, none_after_fault, word_of
from tcstudy.scene.keys import LOADED, MOVED, OF_ALL_LAWS, law_rows, of_role, row, rows
from tcstudy.scene.records import (
    Boundary,
    Clamped,
    Contact,
    Convection,
    Edge,
    EdgeHeat,
    Free,
    Heat,
    Material,
    Rigid,
    Role,
    Scalar,
    Symmetry,
    Traction,
    exchanges,
)
from tcstudy.shapes.edges import edge_length, edge_points

ROLES = row("boundary", "role").words
KINDS = {one.word: one for one in (Clamped, Symmetry, Rigid, Traction, Contact, Convection, Free)}
ALL_KEYS = tuple(name for name in rows("boundary") if name != "role")
WAYS = (("u",), ("u_x", "u_y"), ("u_N", "u_T"))
"""How a displacement may be given: as a pair, in x and y, or in the frame of the edge."""
MOST_PLACES = 400
"""Points of a line that a random strength is made of at most."""


@none_after_fault
def read_boundary(ctx: Context, node: Node, names: tuple[str, ...] | None) -> Boundary:
    """The roles of all edges in the order of the study; None after a fault.
    names: the edges of the body, each of which has a role, as every role has an edge; None if they
    are not known"""
    remedy = f"write one EDGE: role per line; roles are {', '.join(ROLES)}"
    given = ctx.mapping(node, "edges to roles", remedy, least=0)
    roles = {edge: _role(ctx, item) for edge, item in given.items()}
    if names is not None and isinstance(node.value, Mapping):
        without = [name for name in names if name not in given]
        guessed = {
            edge: nearest(edge, without) or nearest(edge, names)
            for edge in given
            if edge not in names
        }
        for edge, near in guessed.items():
            remedy = f"did you mean {near!r}?" if near else f"the edges are {', '.join(names)}"
            ctx.at(given[edge], f"the body has no edge {edge!r}", remedy, on_key=True)
        for edge in without:
            if edge not in guessed.values():  # a misspelt edge is one fault, not two
                said = f"the edge has no role; add {edge}: free, or one of {', '.join(ROLES[:-1])}"
                ctx.at(node, said, key=f"{node.path}.{edge}")
    ctx.sound()
    if not any(isinstance(role, Contact) for role in roles.values()):
        what = "no edge is in contact, so there is no friction to study"
        ctx.at(node, what, "give the role contact to the edges that touch the foundation")
    return tuple(roles.items())


def keys_of(node: Node) -> tuple[str, ...]:
    """The keys that the role of an edge takes; all of them if it has none that is known."""
    word = node.at("role") if isinstance(node.value, Mapping) else node
    return of_role(str(word.value)) if word is not None and word.value in ROLES else ALL_KEYS


def _role(ctx: Context, node: Node) -> Role:
    if not isinstance(node.value, Mapping):
        node = replace(node, value={"role": node})
    if not (kind := word_of(ctx, node, "boundary", "role")):
        return Free()
    foreign = [key for key in ALL_KEYS if node.at(key) and key not in of_role(kind)]
    fields = Fields(ctx, node, "boundary", ("role",), (*of_role(kind), *foreign))
    for key in foreign:
        fields.fault(key, f"the role {kind} takes no {key}", _home(key), on_key=True)
    own = {"heat": read_edge_heat(ctx, fields, kind)} | fields.given({*Role.loads} - {*foreign})
    if any(isinstance(one, Expression) for one in own.get("force", ())):
        said = "a resultant is one number in x and one in y; give g for a traction that varies along the edge"
        fields.fault("force", said)
        del own["force"]
    if kind in MOVED:
        own |= _displacement(ctx, node, fields, kind)
    if kind == "rigid":
        _check_rigid(
            fields, own.get("u", (None, None)), own.get("force", (0.0, 0.0)), own.get("moment")
        )
    actions = [key for key in (*Role.loads, "spring") if key in of_role(kind)]
    if kind == "traction" and not any(fields[key] for key in actions):
        remedy = (
            "write {role: traction, g: [gx, gy]} or {role: traction, pressure: p}, or the role free"
        )
        ctx.at(node, "a traction edge needs g or pressure", remedy)
    if kind in LOADED and (support := fields["spring"]) is not None:
        spring = Fields(ctx, support, "spring")
        if isinstance(support.value, Mapping) and not spring.values:
            ctx.at(support, "says nothing", "give normal or tangential: " + ctx.example("5e9 Pa/m"))
        own["spring"] = spring.value("normal"), spring.value("tangential")
    return KINDS[kind](**own)


def _home(key: str) -> str:
    if key in HEAT_KEYS:
        return "write alpha, theta_bar and flux beside convection, and heat: {...} beside any other role"
    return (
        f"{key} belongs to the role {' or '.join(role for role in ROLES if key in of_role(role))}"
    )


def _displacement(ctx: Context, node: Node, fields: Fields, kind: str) -> dict[str, Any]:
    """What of u an edge is given, and in which frame; "free" leaves a component free, as one that
    is left out."""
    ways = [
        names for names in WAYS if names[0] in of_role(kind) and any(fields[name] for name in names)
    ]
    if len(ways) > 1:
        either = "u: [u_x, u_y], or u_x and u_y" + (", or u_N and u_T" if kind == "clamped" else "")
        ctx.at(node, "the displacement is given in two ways", f"give either {either}")
    if len(ways) != 1:
        return {}
    u = fields.value("u") if fields["u"] else tuple(map(fields.value, ways[0]))
    if kind == "clamped" and u == (None, None):
        ctx.at(node, "both components are free, so nothing is clamped; give the edge the role free")
    return {"u": u, "frame": "nt" if "u_N" in ways[0] else "xy"}


def _check_rigid(
    fields: Fields, u: tuple[Any, Any], force: tuple[float, float], moment: float | None
) -> None:
    if moment is not None and u != (None, None):
        fields.fault(
            "moment",
            "an edge that turns moves as its forces and its moment want; leave out u, or the moment",
        )
    elif any(isinstance(component, Expression) for component in u):
        fields.ctx.at(
            fields.node, "a rigid edge moves as a whole, by one number; use the role clamped"
        )
    elif None not in u:
        what = "both components are given, so nothing is left for the edge to find"
        fields.ctx.at(fields.node, what, "give the edge the role clamped, or leave a component out")
    for name, component, given in zip("xy", u, force, strict=True):
        if component is not None and given != 0.0:
            what = f"u_{name} is given, so a force in {name} would not be used"
            fields.fault("force", what, f"write 0 in its place, or leave out u_{name}")


@none_after_fault
def read_materials(
    ctx: Context, node: Node, own: Node | None, regions: tuple[str, ...] | None = None
) -> Material | None:
    """The material with those that regions have of their own; None after a fault.
    own: the section `materials`;  regions: names of the regions of the body; None if they are not known"""
    material = _material(ctx, node)
    if material is None:
        return None
    found, remedy = [], ctx.example("write {REGION: {E: 70 GPa, nu: 0.33}}")
    for name, item in ctx.mapping(own, "regions to materials", remedy).items():
        if fault := _unknown_region(name, regions):
            ctx.at(item, *fault)
        elif plane := item.at("plane"):
            ctx.at(
                plane,
                "the whole body is in plane strain or in plane stress",
                "give it under material",
            )
        elif one := _material(ctx, item, material.plane):
            found.append((name, one))
    return replace(material, regions=tuple(found))


def _unknown_region(name: str, regions: tuple[str, ...] | None) -> tuple[str, str] | None:
    if regions is None or name in regions:
        return None
    known = f"use one of {', '.join(regions)}" if regions else "add its shape under body.regions"
    return f"the body has no region {name!r}", hint(name, regions, known)


@none_after_fault
def _material(
    ctx: Context, node: Node, plane: Literal["strain", "stress"] | None = None
) -> Material:
    """The material of the plane problem; None after a fault.
    plane: the assumption for the whole body, where that is read already"""
    pairs = [pair for pair in (("E", "nu"), ("lambda", "mu")) if any(node.at(key) for key in pair)]
    fields = Fields(ctx, node, "material", (pairs or [("E", "nu")])[0] if len(pairs) < 2 else ())
    E, nu, lame = fields.value("E"), fields.value("nu"), None
    if len(pairs) == 2:
        odd = next(fields.values[key] for key in ("lambda", "mu") if fields[key])
        ctx.at(odd, "the material is given in two ways", "give either E and nu, or lambda and mu")
    elif pairs == [("lambda", "mu")]:
        lam, mu = lame = fields.value("lambda"), fields.value("mu")
        if 3 * lam + 2 * mu <= 0.0:
            remedy = f"3 lambda + 2 mu must be positive: lambda greater than {-2 * mu / 3:g}"
            fields.fault("lambda", f"{lam:g} makes the bulk modulus zero or negative", remedy)
            lam = math.nan
        E, nu = mu * (3 * lam + 2 * mu) / (lam + mu), lam / (2 * (lam + mu))
    if fields["alpha_T"] and fields["beta"]:
        ctx.at(fields.values["beta"], "both alpha_T and beta are given", "give one of the two")
    plane, alpha_T, beta, k = (
        plane or fields.value("plane"),
        *(fields.value(key) for key in ("alpha_T", "beta", "k")),
    )
    ctx.sound()
    return Material.of(E, nu, plane, k, alpha_T, beta, lame)


@none_after_fault
def read_loads(ctx: Context, node: Node | None) -> tuple[Scalar, Scalar]:
    """The body force f, zero without the section; None after a fault."""
    f: tuple[Scalar, Scalar] = (0.0, 0.0) if node is None else Fields(ctx, node, "loads").value("f")
    return f


def laws_by_edge(node: Node | None) -> dict[str, Node]:
    """The laws of the section `friction` by edge; empty where it is one law."""
    found = dict(node.children) if node and not node.at("law") else {}
    return found if any(isinstance(one.value, Mapping) for one in found.values()) else {}


@none_after_fault
def read_friction(ctx: Context, node: Node, lines: Mapping[str, Sequence[Edge]]) -> Laws | EdgeLaws:
    """The friction law, or the laws of the contact edges; None after a fault.
    lines: of each contact edge, and of all by the name "", for strengths that are random along
    them"""
    each = (laws_by_edge(node) or {"": node}).items()
    laws = [(edge, _law(ctx, own, lines.get(edge, ()))) for edge, own in each]
    ctx.sound()
    made = tuple((edge, *law) for edge, law in laws if law is not None)
    return made[0][1] if made[0][0] == "" and made[0][2] == 1.0 else EdgeLaws(made)


def _scattered(ctx: Context, fields: Fields, line: Sequence[Edge]) -> Expression:
    if not fields["scatter_length"]:
        fields.missing("scatter_length")
    if not line:
        fields.fault(
            "scatter", "the joint of a body from a file is not known beforehand; draw its outline"
        )
    ctx.sound()
    length = float(fields.value("scatter_length"))
    counts = [max(1, math.ceil(edge_length(edge) / (SPACING * length))) for edge in line]
    if sum(counts) > MOST_PLACES:
        least = 2.0 * sum(map(edge_length, line)) / MOST_PLACES
        fields.fault("scatter_length", f"is too short for the joint; write {least:.2g} m or more")
    ctx.sound()
    points = np.concatenate(
        [edge_points(edge, count) for edge, count in zip(line, counts, strict=True)]
    )
    once = np.unique(np.round(points / (1e-6 * length)), axis=0, return_index=True)[
        1
    ]  # edges share their ends
    points = points[np.sort(once)]
    return random_field(
        points, float(fields.value("scatter")), length, int(fields.value("scatter_seed"))
    )


@none_after_fault
def _law(ctx: Context, node: Node, line: Sequence[Edge]) -> tuple[Laws, Scalar]:
    name = word_of(ctx, node, "friction", "law")
    ctx.sound()
    own = (*(row("friction", key) for key in ("law", *OF_ALL_LAWS)), *law_rows(name))
    fields, shape = Fields(ctx, node, {one.name: one for one in own}), SHAPES[name]
    values, strength = fields.given(), fields.value("strength")
    if isinstance(strength, float) and strength < 0.0:
        said = f"must be 0 or more, but is {strength:g}; write a factor of 0 or more; 0 is a gap in the bond"
        fields.fault("strength", said)
    ctx.sound()
    if fields["scatter"]:
        strength = product(strength, _scattered(ctx, fields, line))
    try:
        law = shape.build(
            **{key: values[key] for key in values if key not in ("law", *OF_ALL_LAWS)}
        )
        varies = isinstance(strength, Expression)
        return law if varies or strength == 1.0 else law.times(
            strength
        ), strength if varies else 1.0
    except LawError as error:
        what, _, remedy = error.message.partition("; ")
        fields.fault(error.parameter, what, remedy or f"the law {name}: {shape.summary}")
    except GrowthError as error:
        fields.fault(
            "points", str(error), "let the last values and slopes of b have the sign of the slip"
        )
    raise Unsound


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
        ctx.at(
            node,
            "says nothing",
            "give theta, or flux, or alpha and theta_bar; without heat it is insulated",
        )
    _alone(own, "theta is held on the edge")
    return EdgeHeat(**own.given())


def _alone(fields: Fields, why: str) -> None:
    """A temperature that is known takes nothing beside it."""
    if fields["theta"] and (
        others := [key for key in fields.values if key in fields.rows and key != "theta"]
    ):
        said = f"{why}, so {', '.join(others)} would not be used; keep theta alone, or remove it"
        fields.fault("theta", said)


@none_after_fault
def read_heat(ctx: Context, node: Node | None, regions: tuple[str, ...] | None) -> Heat:
    """The heat problem; zero temperature without the section; None after a fault.
    regions: names of the regions of the body; None if they are not known"""
    if node is None:
        return Heat()
    fields = Fields(ctx, node, "heat")
    _alone(fields, "theta is the known temperature")
    if fields["theta"]:
        return Heat(**fields.given(("theta",)))
    return Heat(**fields.given((*HEAT, "q")), omega=_omega(ctx, fields["omega"], regions))


def _omega(ctx: Context, node: Node | None, regions: tuple[str, ...] | None) -> tuple[str, ...]:
    items = () if node is None or not isinstance(node.value, str | tuple) else node.entries
    if node is not None and not items:
        remedy = "write NAME or [NAME, ...] of shapes under body.regions"
        ctx.at(node, f"must name regions of the body, but is {node.kind()}", remedy)
    names = tuple(ctx.text(item, "the name of a region") for item in items)
    for i, (item, name) in enumerate(zip(items, names, strict=True)):
        if name and (fault := _unknown_region(name, regions)):
            ctx.at(item, *fault)
        elif name in names[:i]:
            ctx.at(item, f"the region {name!r} is given twice", "name each region once")
    return names


def check_heat(
    ctx: Context, root: Node, heat: Heat, boundary: Boundary, material: Material
) -> None:
    """Heat needs a conductivity and an edge that decides about temperature; what is given must act
    somewhere."""
    own = {edge: role.heat for edge, role in boundary if role.heat is not None}
    passing = {edge: role.heat or EdgeHeat() for edge, role in boundary if exchanges(role)}
    section, alpha = root.at("heat"), root.nearest("heat", "alpha")
    if heat.theta is not None or (section is None and not own):
        why = (
            "the study has no section heat" if section is None else "the temperature theta is given"
        )
        for edge in [*passing, *own][:1]:
            what = "what the edge does to heat" if edge in own else "a convection edge"
            remedy = "remove theta to compute the temperature, or what the edge says of heat"
            if edge not in own:
                remedy = "add heat: {alpha: ..., theta_bar: ...}, or make the edge free or traction"
            ctx.at(root.nearest("boundary", edge), f"{what} has no meaning, because {why}", remedy)
        return
    for key in HEAT:  # what edges leave to the section
        lacking = [edge for edge, given in passing.items() if getattr(given, key) is None]
        said = f"add {key}: {ctx.example(row('heat', key).suggestion)}"
        if section is None:
            for edge in lacking:
                what, where = (
                    "is missing, and there is no section heat to take it from",
                    ("boundary", edge, "heat"),
                )
                ctx.at(root.nearest(*where), what, said, key=".".join((*where, key)))
        elif (
            not root.at("heat", key) and (lacking or not own) and isinstance(section.value, Mapping)
        ):
            ctx.at(section, "is missing", said, key=f"heat.{key}")
    if (
        not (passing or own) and heat.q == 0.0
    ):  # no heat comes or goes: an alpha then is a doubt, no fault
        return
    places = (("material",), *(("materials", name) for name, _ in material.regions))
    for place, one in zip(places, material.all, strict=True):
        if one.k is None:
            key = f"{'.'.join(place)}.k"
            ctx.at(
                root.nearest(*place), "is missing, but heat needs it; add k: 45 W/(m*K)", key=key
            )
    if (
        not passing
        and not any(said.theta is not None for said in own.values())
        and (own or heat.alpha > 0.0)
    ):
        node, what = (
            root.nearest("boundary", *[*own][:1]),
            "and none holds a temperature: no heat can leave",
        )
        if heat.alpha > 0.0:
            node, what = alpha, "so alpha acts nowhere"
        remedy = "give the role convection to the edges that exchange heat, or give a known temperature theta"
        ctx.at(node, f"no edge has the role convection, {what}", remedy)
    elif (
        section
        and heat.alpha == 0.0
        and own
        and any(said.alpha is None for said in passing.values())
    ):
        what = "with alpha = 0 the edges that have none of their own exchange nothing"
        ctx.at(alpha, what, "give alpha > 0, or make those edges free or traction")
    elif heat.alpha == 0.0 and not own and heat.q != 0.0:
        what = "with alpha = 0 the heat of q cannot leave the body, so there is no steady state"
        ctx.at(alpha, what, "give alpha > 0, or q: 0")
