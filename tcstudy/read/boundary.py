"""Reads the section `boundary`: one role for each edge."""

from __future__ import annotations

from collections.abc import Mapping

from tcstudy.read.fields import Context, Fields, nearest
from tcstudy.read.node import COMPONENTS, Node
from tcstudy.scene.keys import of_role, row, rows
from tcstudy.scene.records import Clamped, Contact, Convection, Free, Role, Scalar, Traction
from tcstudy.scene.units import LENGTH

ROLES = row("boundary", "role").words
KEYS = {role: of_role(role) for role in ROLES}
ALL_KEYS = tuple(name for name in rows("boundary") if name != "role")
FRAMES: tuple[tuple[str, str, str], ...] = (("xy", "u_x", "u_y"), ("nt", "u_N", "u_T"))

Boundary = tuple[tuple[str, Role], ...]


def read_boundary(ctx: Context, node: Node, names: tuple[str, ...] | None) -> Boundary | None:
    """The roles of all edges in the order of the study; None after a fault.

    names: the edges of the body; None if they are not known
    """
    before = len(ctx.errors)
    if not isinstance(node.value, Mapping):
        remedy = f"write one EDGE: role per line; roles are {', '.join(ROLES)}"
        ctx.errors.at(node, f"must be a mapping of edges to roles, but is {node.kind()}", remedy)
        return None
    roles = {edge: _role(ctx, item) for edge, item in node.value.items()}
    if names is not None:
        _check_edges(ctx, node, node.value, names)
    if not any(isinstance(role, Contact) for role in roles.values()) and len(ctx.errors) == before:
        remedy = "give the role contact to the edges that touch the foundation"
        ctx.errors.at(node, "no edge is in contact, so there is no friction to study", remedy)
    return tuple(roles.items()) if len(ctx.errors) == before else None


def keys_of(node: Node) -> tuple[str, ...]:
    """The keys that the role of an edge takes; all of them if it has none that is known."""
    word = node.child("role") if isinstance(node.value, Mapping) else node
    return KEYS.get(str(word.value), ALL_KEYS) if word is not None else ALL_KEYS


def _check_edges(ctx: Context, node: Node, given: Mapping[str, Node], names: tuple[str, ...]) -> None:
    """Every edge has a role and every role an edge; a misspelt edge is one fault, not two."""
    without = [name for name in names if name not in given]
    guessed = set()
    for edge, item in given.items():
        if edge not in names:
            near = nearest(edge, without) or nearest(edge, names)
            guessed.add(near)
            remedy = f"did you mean {near!r}?" if near else f"the edges are {', '.join(names)}"
            ctx.errors.at(item, f"the body has no edge {edge!r}", remedy, on_key=True)
    for edge in without:
        if edge not in guessed:
            remedy = f"add {edge}: free, or one of {', '.join(ROLES[:-1])}"
            ctx.errors.at(node, "the edge has no role", remedy, key=f"{node.path}.{edge}")


def _role(ctx: Context, node: Node) -> Role:
    """The role of one edge, given as a word or a mapping."""
    if not isinstance(node.value, Mapping):
        return _build(ctx, node, ctx.choice(node, ROLES), None)
    word = node.child("role")
    if word is None:
        Fields(ctx, node, "boundary")
        return Free()
    before = len(ctx.errors)
    kind = ctx.choice(word, ROLES)
    if len(ctx.errors) > before:
        return Free()
    foreign = [key for key in ALL_KEYS if key in node.value and key not in KEYS[kind]]
    for key in foreign:
        ctx.errors.at(node.value[key], f"the role {kind} takes no {key}", _home(key), on_key=True)
    return _build(ctx, node, kind, Fields(ctx, node, "boundary", ("role",), (*KEYS[kind], *foreign)))


def _home(key: str) -> str:
    """Where a key of another role belongs."""
    if key in COMPONENTS:
        given = "u: [a, free]" if key == "u" else f"{key}: a"
        return f"a held displacement is {{role: clamped, {given}}}, which leaves what is not given free of traction"
    return "give the edge the role traction or convection, which take g and pressure"


def _build(ctx: Context, node: Node, kind: str, fields: Fields | None) -> Role:
    if kind == "contact":
        return Contact()
    if kind == "free":
        return Free()
    if kind == "clamped":
        return _clamped(ctx, node, fields) if fields else Clamped()
    if kind == "traction" and (fields is None or not (fields["g"] or fields["pressure"])):
        remedy = "write {role: traction, g: [gx, gy]} or {role: traction, pressure: p}, or the role free"
        if fields is None or len(fields.values) == 1:
            ctx.errors.at(node, "a traction edge needs g or pressure", remedy)
        return Traction()
    record = Traction if kind == "traction" else Convection
    if fields is None:
        return record()
    return record(fields.vector("g"), fields.field("pressure"))


def _clamped(ctx: Context, node: Node, fields: Fields) -> Clamped:
    """Prescribed displacement: u, or components in x and y or in the edge's frame; "free" leaves one free."""
    given = [frame for frame in FRAMES if fields[frame[1]] or fields[frame[2]]]
    whole = fields["u"]
    if len(given) + (whole is not None) > 1:
        remedy = "give either u: [u_x, u_y], or u_x and u_y, or u_N and u_T"
        ctx.errors.at(node, "the displacement is given in two ways", remedy)
        return Clamped()
    if given:
        frame, *keys = given[0]
        parts = [_component(ctx, value) if (value := fields[key]) else None for key in keys]
        result = Clamped((parts[0], parts[1]), "nt" if frame == "nt" else "xy")
    elif whole:
        both = ctx.pair(whole, "a pair of displacements", "[0 mm, free]")
        result = Clamped((_component(ctx, both[0]), _component(ctx, both[1]))) if both else Clamped()
    else:
        result = Clamped()
    if result.u == (None, None):
        ctx.errors.at(node, "both components are free, so nothing is clamped", "give the edge the role free")
    return result


def _component(ctx: Context, node: Node) -> Scalar | None:
    """One displacement component; None for the word free."""
    if node.value == "free":
        return None
    return ctx.scalar(node, LENGTH, varies=True)
