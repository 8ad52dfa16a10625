"""Reading the sections of a scene beside its body: boundary, material, loads, friction, heat.

Heat is a known temperature, or conduction with a source in ω and conditions on edges. The
conditions are convection on Γ_θ (eqs. 2, 5), a prescribed flux, or a prescribed temperature. A
convection edge takes from the section the values that it does not give itself.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from tcstudy.errors import hint, nearest
from tcstudy.expressions.expression import SPACING, Expression, product, random_field
from tcstudy.laws.composed import EdgeLaws
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import GrowthError
from tcstudy.laws.shapes import RIGID, SHAPES, LawError, one_sided
from tcstudy.read.document import Node
from tcstudy.read.fields import Context, Fields, Unsound, none_after_fault, word_of
from tcstudy.scene.keys import (
    LOADED,
    MOVED,
    law_rows,
    of_all_laws,
    of_opening,
    of_role,
    parameter_names,
    row,
    rows,
)
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
ROLE_RECORDS = {
    record.word: record
    for record in (Clamped, Symmetry, Rigid, Traction, Contact, Convection, Free)
}
ALL_KEYS = tuple(name for name in rows("boundary") if name != "role")
DISPLACEMENT_KEYS = (("u",), ("u_x", "u_y"), ("u_N", "u_T"))
"""Keys that give a displacement: as a pair, in x and y, or in the frame of the edge."""
MAX_RANDOM_POINTS = 400
"""Largest number of points of a line at which a random strength is drawn."""


@none_after_fault
def read_boundary(
    ctx: Context, node: Node, names: tuple[str, ...] | None, adhesive: Collection[str] = ()
) -> Boundary:
    """Return the roles of all edges in the order of the study; None after a fault.

    names:    the edges of the body, each of which needs a role; None if they are not known
    adhesive: edges that open by a law of the section `adhesion`
    """
    remedy = f"write one EDGE: role per line; roles are {', '.join(ROLES)}"
    items = ctx.mapping(node, "edges to roles", remedy, least=0)
    roles = {edge: _role(ctx, item) for edge, item in items.items()}
    for edge in adhesive:
        if isinstance(roles.get(edge), Contact):
            roles[edge] = _adhesive(ctx, items[edge])
    if names is not None and isinstance(node.value, Mapping):
        _compare_edges(ctx, node, items, names)
    ctx.sound()
    if not any(isinstance(role, Contact) for role in roles.values()):
        fault = "no edge is in contact, so there is no friction to study"
        ctx.at(node, fault, "give the role contact to the edges that touch the foundation")
    return tuple(roles.items())


def _compare_edges(
    ctx: Context, node: Node, items: Mapping[str, Node], names: tuple[str, ...]
) -> None:
    """Record roles of edges that the body does not have, and edges of the body without a role."""
    without_role = [name for name in names if name not in items]
    misspelt = set[str]()
    for edge, item in items.items():
        if edge in names:
            continue
        near = nearest(edge, without_role) or nearest(edge, names)
        remedy = f"did you mean {near!r}?" if near else f"the edges are {', '.join(names)}"
        ctx.at(item, f"the body has no edge {edge!r}", remedy, on_key=True)
        if near:
            misspelt.add(near)
    for edge in without_role:
        if edge not in misspelt:  # a misspelt edge is one fault, not two
            remedy = f"add {edge}: free, or one of {', '.join(ROLES[:-1])}"
            ctx.at(node, "the edge has no role", remedy, key=f"{node.path}.{edge}")


def keys_of(node: Node) -> tuple[str, ...]:
    """Return the keys that the role of an edge takes; all keys if the role is not known."""
    word = node.at("role") if isinstance(node.value, Mapping) else node
    if word is None or word.value not in ROLES:
        return ALL_KEYS
    return of_role(str(word.value))


def _role(ctx: Context, node: Node) -> Role:
    if not isinstance(node.value, Mapping):
        node = replace(node, value={"role": node})
    kind = word_of(ctx, node, "boundary", "role")
    if not kind:
        return Free()
    keys = of_role(kind)
    foreign = [key for key in ALL_KEYS if node.at(key) and key not in keys]
    fields = Fields(ctx, node, "boundary", ("role",), (*keys, *foreign))
    for key in foreign:
        fields.fault(key, f"the role {kind} takes no {key}", _home(key), on_key=True)
    values: dict[str, Any] = {"heat": read_edge_heat(ctx, fields, kind)}
    values |= fields.given({*Role.loads} - {*foreign})
    if kind == "contact" and fields["normal"]:
        values["normal"] = fields.value("normal")
    if any(isinstance(component, Expression) for component in values.get("force", ())):
        fault = "a resultant is one number in x and one in y"
        fields.fault("force", fault, "give g for a traction that varies along the edge")
        del values["force"]
    if kind in MOVED:
        values |= _displacement(ctx, node, fields, kind)
    if kind == "rigid":
        u = values.get("u", (None, None))
        force = values.get("force", (0.0, 0.0))
        _check_rigid(fields, u, force, values.get("moment"))
    actions = [key for key in (*Role.loads, "spring") if key in keys]
    if kind == "traction" and not any(fields[key] for key in actions):
        choices = "{role: traction, g: [gx, gy]} or {role: traction, pressure: p}"
        remedy = f"write {choices}, or the role free"
        ctx.at(node, "a traction edge needs g or pressure", remedy)
    if kind in LOADED and fields["spring"] is not None:
        values["spring"] = _spring(ctx, fields["spring"])
    return ROLE_RECORDS[kind](**values)


def _adhesive(ctx: Context, node: Node) -> Contact:
    """Return the role of an edge that opens by a law; it is a fault if it gives `normal` too."""
    normal = node.at("normal")
    if normal and normal.value in row("boundary", "normal").words:
        fault = "adhesion has a law for this edge, which decides what it does along its normal"
        remedy = "leave out normal, or name other edges: adhesion: {EDGE: {law: ...}}"
        ctx.at(normal, fault, remedy)
    return Contact(normal="adhesive")


def _spring(ctx: Context, node: Node) -> tuple[Any, Any]:
    """Return the normal and the tangential stiffness of the springs of an edge."""
    fields = Fields(ctx, node, "spring")
    if isinstance(node.value, Mapping) and not fields.values:
        ctx.at(node, "says nothing", "give normal or tangential: " + ctx.example("5e9 Pa/m"))
    return fields.value("normal"), fields.value("tangential")


def _home(key: str) -> str:
    """Return where a key of an edge belongs, in words."""
    if key in HEAT_KEYS:
        convection = "write alpha, theta_bar and flux beside convection"
        return f"{convection}, and heat: {{...}} beside any other role"
    roles = [role for role in ROLES if key in of_role(role)]
    return f"{key} belongs to the role {' or '.join(roles)}"


def _displacement(ctx: Context, node: Node, fields: Fields, kind: str) -> dict[str, Any]:
    """Return the displacement of an edge and its frame; empty if it has none.

    A component that is left out, or "free", is None.
    """
    known_keys = of_role(kind)
    options = [keys for keys in DISPLACEMENT_KEYS if keys[0] in known_keys]
    used = [keys for keys in options if any(fields[key] for key in keys)]
    if len(used) > 1:
        in_frame = ", or u_N and u_T" if kind == "clamped" else ""
        remedy = f"give either u: [u_x, u_y], or u_x and u_y{in_frame}"
        ctx.at(node, "the displacement is given in two ways", remedy)
    if len(used) != 1:
        return {}
    u = fields.value("u") if fields["u"] else tuple(map(fields.value, used[0]))
    if kind == "clamped" and u == (None, None):
        ctx.at(node, "both components are free, so nothing is clamped; give the edge the role free")
    return {"u": u, "frame": "nt" if "u_N" in used[0] else "xy"}


def _check_rigid(
    fields: Fields, u: tuple[Any, Any], force: tuple[float, float], moment: float | None
) -> None:
    if moment is not None and u != (None, None):
        fault = "an edge that turns moves as its forces and its moment want"
        fields.fault("moment", fault, "leave out u, or the moment")
    elif any(isinstance(component, Expression) for component in u):
        fault = "a rigid edge moves as a whole, by one number"
        fields.ctx.at(fields.node, fault, "use the role clamped")
    elif None not in u:
        fault = "both components are given, so nothing is left for the edge to find"
        remedy = "give the edge the role clamped, or leave a component out"
        fields.ctx.at(fields.node, fault, remedy)
    for axis, displacement, component in zip("xy", u, force, strict=True):
        if displacement is not None and component != 0.0:
            fault = f"u_{axis} is given, so a force in {axis} would not be used"
            fields.fault("force", fault, f"write 0 in its place, or leave out u_{axis}")


@none_after_fault
def read_materials(
    ctx: Context, node: Node, materials: Node | None, regions: tuple[str, ...] | None = None
) -> Material | None:
    """Return the material with those of the regions; None after a fault.

    materials: the section of the materials of regions
    regions:   names of the regions of the body; None if they are not known
    """
    material = _material(ctx, node)
    if material is None:
        return None
    by_region = list[tuple[str, Material]]()
    remedy = ctx.example("write {REGION: {E: 70 GPa, nu: 0.33}}")
    for name, item in ctx.mapping(materials, "regions to materials", remedy).items():
        if fault := _unknown_region(name, regions):
            ctx.at(item, *fault)
        elif plane := item.at("plane"):
            conflict = "the whole body is in plane strain or in plane stress"
            ctx.at(plane, conflict, "give it under material")
        elif region_material := _material(ctx, item, material.plane):
            by_region.append((name, region_material))
    return replace(material, regions=tuple(by_region))


def _unknown_region(name: str, regions: tuple[str, ...] | None) -> tuple[str, str] | None:
    if regions is None or name in regions:
        return None
    remedy = f"use one of {', '.join(regions)}" if regions else "add its shape under body.regions"
    return f"the body has no region {name!r}", hint(name, regions, remedy)


@none_after_fault
def _material(
    ctx: Context, node: Node, plane: Literal["strain", "stress"] | None = None
) -> Material:
    """Return the material of the plane problem; None after a fault.

    plane: the assumption for the whole body, if it is read already
    """
    has_lame = any(node.at(key) for key in ("lambda", "mu"))
    has_young = any(node.at(key) for key in ("E", "nu"))
    required = ("lambda", "mu") if has_lame else ("E", "nu")
    fields = Fields(ctx, node, "material", () if has_lame and has_young else required)
    E, nu = fields.value("E"), fields.value("nu")
    lame: tuple[float, float] | None = None
    if has_lame and has_young:
        lame_node = next(fields.values[key] for key in ("lambda", "mu") if fields[key])
        remedy = "give either E and nu, or lambda and mu"
        ctx.at(lame_node, "the material is given in two ways", remedy)
    elif has_lame:
        lam, mu = lame = fields.value("lambda"), fields.value("mu")
        if 3 * lam + 2 * mu <= 0.0:
            remedy = f"3 lambda + 2 mu must be positive: lambda greater than {-2 * mu / 3:g}"
            fields.fault("lambda", f"{lam:g} makes the bulk modulus zero or negative", remedy)
            lam = math.nan
        E = mu * (3 * lam + 2 * mu) / (lam + mu)
        nu = lam / (2 * (lam + mu))
    if fields["alpha_T"] and fields["beta"]:
        ctx.at(fields.values["beta"], "both alpha_T and beta are given", "give one of the two")
    plane = plane or fields.value("plane")
    alpha_T, beta, k = map(fields.value, ("alpha_T", "beta", "k"))
    ctx.sound()
    return Material.of(E, nu, plane, k, alpha_T, beta, lame)


@none_after_fault
def read_loads(ctx: Context, node: Node | None) -> tuple[Scalar, Scalar]:
    """Return the body force f, zero without the section; None after a fault."""
    f: tuple[Scalar, Scalar] = (0.0, 0.0) if node is None else Fields(ctx, node, "loads").value("f")
    return f


def laws_by_edge(node: Node | None) -> dict[str, Node]:
    """Return the laws of a section of laws by edge; empty if it is one law."""
    if not node or node.at("law"):
        return {}
    laws = dict(node.children)
    return laws if any(isinstance(law.value, Mapping) for law in laws.values()) else {}


NO_SHEAR = SHAPES["linear"].build(k=0.0)
"""The friction of an edge that opens and has no law."""


def with_no_shear(friction: Laws | EdgeLaws | None, opening: Collection[str]) -> Laws | EdgeLaws:
    """Return the friction with a law that vanishes for edges that open and have none.

    friction: None where the study has no such section
    """
    if friction is None:
        return NO_SHEAR
    if isinstance(friction, Laws):
        return friction
    edges = {edge for edge, _, _ in friction.laws}
    without_law = [] if "" in edges else [edge for edge in opening if edge not in edges]
    return EdgeLaws((*friction.laws, *((edge, NO_SHEAR, 1.0) for edge in without_law)))


def contact_edges(root: Node) -> list[str]:
    """Return the edges that a study names contact, as its text has them."""
    roles = root.at("boundary")
    contact = list[str]()
    for name, role in roles.children.items() if roles else ():
        word = (role.at("role") or role).value
        if "contact" in (role.value, word):
            contact.append(name)
    return contact


def adhesive_edges(root: Node) -> tuple[str, ...]:
    """Return the contact edges that have a law in the section `adhesion`, by the text."""
    section = root.at("adhesion")
    if section is None:
        return ()
    by_edge = laws_by_edge(section)
    return tuple(edge for edge in contact_edges(root) if not by_edge or edge in by_edge)


def opening_edges(root: Node) -> tuple[str, ...]:
    """Return the contact edges that may lift off the foundation, by the text of the study."""
    adhesive = adhesive_edges(root)
    opening = list[str]()
    for edge in contact_edges(root):
        normal = root.at("boundary", edge, "normal")
        if edge in adhesive or (normal and normal.value == "unilateral"):
            opening.append(edge)
    return tuple(opening)


def not_held(root: Node) -> tuple[Node, ...]:
    """Return the places at which a study lets contact edges move along their normals."""
    places = [root.nearest("adhesion")] if adhesive_edges(root) else []
    for edge in contact_edges(root):
        normal = root.at("boundary", edge, "normal")
        if normal is not None and normal.value != "held":
            places.append(normal)
    return tuple(places)


def has_no_friction(root: Node) -> bool:
    """Return whether a study may leave out friction: all its contact edges may lift off."""
    contact = contact_edges(root)
    return bool(contact) and set(contact) == set(opening_edges(root))


@none_after_fault
def read_laws(
    ctx: Context, node: Node, lines: Mapping[str, Sequence[Edge]], section: str = "friction"
) -> Laws | EdgeLaws:
    """Return the law of a section, or the laws of the contact edges; None after a fault.

    lines: of each contact edge, and of all by the name "", for strengths that are random along them
    """
    nodes = laws_by_edge(node) or {"": node}
    laws = {edge: _law(ctx, item, lines.get(edge, ()), section) for edge, item in nodes.items()}
    ctx.sound()
    edge_laws = tuple((edge, *law) for edge, law in laws.items() if law is not None)
    edge, law, strength = edge_laws[0]
    return law if edge == "" and strength == 1.0 else EdgeLaws(edge_laws)


def _random_strength(ctx: Context, fields: Fields, line: Sequence[Edge]) -> Expression:
    if not fields["scatter_length"]:
        fields.missing("scatter_length")
    if not line:
        fault = "the joint of a body from a file is not known beforehand"
        fields.fault("scatter", fault, "draw its outline")
    ctx.sound()
    length = float(fields.value("scatter_length"))
    counts = [max(1, math.ceil(edge_length(edge) / (SPACING * length))) for edge in line]
    if sum(counts) > MAX_RANDOM_POINTS:
        min_length = 2.0 * sum(map(edge_length, line)) / MAX_RANDOM_POINTS
        remedy = f"write {min_length:.2g} m or more"
        fields.fault("scatter_length", "is too short for the joint", remedy)
    ctx.sound()
    points = np.concatenate(list(map(edge_points, line, counts)))
    # edges share their ends
    rounded = np.round(points / (1e-6 * length))
    _, first_index = np.unique(rounded, axis=0, return_index=True)
    points = points[np.sort(first_index)]
    scatter = float(fields.value("scatter"))
    return random_field(points, scatter, length, int(fields.value("scatter_seed")))


@none_after_fault
def _law(ctx: Context, node: Node, line: Sequence[Edge], section: str) -> tuple[Laws, Scalar]:
    """Return the law of an edge and the factor of its strength that varies along the edge."""
    name = word_of(ctx, node, section, "law")
    ctx.sound()
    common_keys = ("law", *of_all_laws(section))
    law_keys = (*(row(section, key) for key in common_keys), *law_rows(name, section))
    fields = Fields(ctx, node, {key.name: key for key in law_keys})
    names = parameter_names(name, section)
    values = fields.given()
    strength = fields.value("strength")
    if isinstance(strength, float) and strength < 0.0:
        fault = f"must be 0 or more, but is {strength:g}"
        fields.fault("strength", fault, "write a factor of 0 or more; 0 is a gap in the bond")
    ctx.sound()
    if fields["scatter"]:
        strength = product(strength, _random_strength(ctx, fields, line))
    of_shape = {names[key]: value for key, value in values.items() if key in names}
    law = _built(fields, name, of_shape, section)
    if section == "adhesion":
        closing = fields.value("closing")
        law = one_sided(law, RIGID if isinstance(closing, str) else closing)
    if isinstance(strength, Expression):
        return law, strength
    return (law if strength == 1.0 else law.times(strength)), 1.0


def _built(fields: Fields, name: str, values: Mapping[str, Any], section: str) -> Laws:
    """Return a law of the slip; after a fault, in words of the section, raise Unsound."""
    shape = SHAPES[name]
    in_words = of_opening if section == "adhesion" else str
    try:
        return shape.build(**values)
    except LawError as error:
        fault, _, remedy = in_words(error.message).partition("; ")
        remedy = remedy or f"the law {name}: {in_words(shape.summary)}"
        fields.fault(in_words(error.parameter), fault, remedy)
    except GrowthError as error:
        remedy = in_words("let the last values and slopes of b have the sign of the slip")
        fields.fault("points", in_words(str(error)), remedy)
    raise Unsound


CONVECTION_KEYS = tuple(name for name in rows("edge_heat") if name != "theta")
SHARED_KEYS = ("alpha", "theta_bar")
"""Keys of the section `heat` that an edge may give itself."""
HEAT_KEYS = ("heat", *CONVECTION_KEYS)
"""Keys of an edge about heat."""


def read_edge_heat(ctx: Context, fields: Fields, kind: str) -> EdgeHeat | None:
    """Return the heat condition of an edge; None if the edge gives none."""
    if kind == "convection":
        values = fields.given(CONVECTION_KEYS)
        return EdgeHeat(**values) if values else None
    node = fields["heat"]
    if node is None:
        return None
    heat_fields = Fields(ctx, node, "edge_heat")
    if isinstance(node.value, Mapping) and not heat_fields.values:
        remedy = "give theta, or flux, or alpha and theta_bar; without heat it is insulated"
        ctx.at(node, "says nothing", remedy)
    _check_theta_alone(heat_fields, "theta is prescribed on the edge")
    return EdgeHeat(**heat_fields.given())


def _check_theta_alone(fields: Fields, reason: str) -> None:
    """Record keys beside a known temperature, which have no effect."""
    unused = [key for key in fields.values if key in fields.rows and key != "theta"]
    if fields["theta"] and unused:
        fault = f"{reason}, so {', '.join(unused)} would not be used"
        fields.fault("theta", fault, "keep theta alone, or remove it")


@none_after_fault
def read_heat(ctx: Context, node: Node | None, regions: tuple[str, ...] | None) -> Heat:
    """Return the heat problem, of zero temperature without the section; None after a fault.

    regions: names of the regions of the body; None if they are not known
    """
    if node is None:
        return Heat()
    fields = Fields(ctx, node, "heat")
    _check_theta_alone(fields, "theta is the known temperature")
    if fields["theta"]:
        return Heat(**fields.given(("theta",)))
    values = fields.given((*SHARED_KEYS, "q"))
    return Heat(**values, omega=_omega(ctx, fields["omega"], regions))


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
    """Record a heat problem without a conductivity, without a steady state, or without effect.

    Computed heat needs a conductivity and an edge that decides about temperature. Every value must
    have an effect.
    """
    conditions = {edge: role.heat for edge, role in boundary if role.heat is not None}
    convection = {edge: role.heat or EdgeHeat() for edge, role in boundary if exchanges(role)}
    if heat.theta is not None or (root.at("heat") is None and not conditions):
        _check_no_edge_heat(ctx, root, convection, conditions)
        return
    _check_shared_keys(ctx, root, convection, conditions)
    # without heat an alpha without effect is a warning, not a fault
    if not (convection or conditions) and heat.q == 0.0:
        return
    _check_conductivity(ctx, root, material)
    _check_outlet(ctx, root, heat, convection, conditions)


def _check_no_edge_heat(
    ctx: Context,
    root: Node,
    convection: Mapping[str, EdgeHeat],
    conditions: Mapping[str, EdgeHeat],
) -> None:
    """Record an edge with heat where no heat problem is solved."""
    reason = "the temperature theta is given"
    if root.at("heat") is None:
        reason = "the study has no section heat"
    for edge in [*convection, *conditions][:1]:
        subject = "a convection edge"
        remedy = "add heat: {alpha: ..., theta_bar: ...}, or make the edge free or traction"
        if edge in conditions:
            subject = "what the edge does to heat"
            remedy = "remove theta to compute the temperature, or what the edge says of heat"
        node = root.nearest("boundary", edge)
        ctx.at(node, f"{subject} has no meaning, because {reason}", remedy)


def _check_shared_keys(
    ctx: Context,
    root: Node,
    convection: Mapping[str, EdgeHeat],
    conditions: Mapping[str, EdgeHeat],
) -> None:
    """Record keys that convection edges leave to the section `heat`, which does not give them."""
    section = root.at("heat")
    for key in SHARED_KEYS:
        lacking = [edge for edge, values in convection.items() if getattr(values, key) is None]
        remedy = f"add {key}: {ctx.example(row('heat', key).suggestion)}"
        if section is None:
            for edge in lacking:
                path = ("boundary", edge, "heat")
                fault = "is missing, and there is no section heat to take it from"
                ctx.at(root.nearest(*path), fault, remedy, key=".".join((*path, key)))
            continue
        is_needed = bool(lacking) or not conditions
        if is_needed and isinstance(section.value, Mapping) and not root.at("heat", key):
            ctx.at(section, "is missing", remedy, key=f"heat.{key}")


def _check_conductivity(ctx: Context, root: Node, material: Material) -> None:
    """Record materials without a conductivity."""
    paths = (("material",), *(("materials", name) for name, _ in material.regions))
    for path, part in zip(paths, material.all, strict=True):
        if part.k is None:
            fault = "is missing, but heat needs it"
            key = f"{'.'.join(path)}.k"
            ctx.at(root.nearest(*path), fault, "add k: 45 W/(m*K)", key=key)


def _check_outlet(
    ctx: Context,
    root: Node,
    heat: Heat,
    convection: Mapping[str, EdgeHeat],
    conditions: Mapping[str, EdgeHeat],
) -> None:
    """Record a heat problem whose edges do not decide about the temperature."""
    alpha = root.nearest("heat", "alpha")
    is_held = any(condition.theta is not None for condition in conditions.values())
    if not convection and not is_held and (conditions or heat.alpha > 0.0):
        node = root.nearest("boundary", *[*conditions][:1])
        effect = "and no edge prescribes a temperature: no heat can leave"
        if heat.alpha > 0.0:
            node = alpha
            effect = "so alpha acts nowhere"
        convect = "give the role convection to the edges that exchange heat"
        remedy = f"{convect}, or give a known temperature theta"
        ctx.at(node, f"no edge has the role convection, {effect}", remedy)
        return
    if heat.alpha != 0.0:
        return
    needs_alpha = any(condition.alpha is None for condition in convection.values())
    if root.at("heat") and conditions and needs_alpha:
        fault = "with alpha = 0 the edges that have none of their own exchange nothing"
        ctx.at(alpha, fault, "give alpha > 0, or make those edges free or traction")
    elif not conditions and heat.q != 0.0:
        fault = "with alpha = 0 the heat of q cannot leave the body, so there is no steady state"
        ctx.at(alpha, fault, "give alpha > 0, or q: 0")
