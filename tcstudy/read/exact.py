"""Reads the section `exact`: the solution that errors are measured against, and from which loads may be derived.

`loads: derived`: loads that follow from it are left out of the study, which is read with 0 in their places, and put
into its scenes. What is given although it would be derived, in the study or in its sweep, is a fault. The word
`derived` may stand in the place of a load; where an edge is held in one component only it must:
{role: clamped, u_x: derived}.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from tcstudy.exact.checks import Checks, SolutionFault
from tcstudy.exact.loads import Derivation
from tcstudy.read.checks import check_finite
from tcstudy.read.fields import Context, Fields, none_after_fault
from tcstudy.read.node import COMPONENTS, Node, deepest
from tcstudy.read.sweep import Sweep
from tcstudy.scene.keys import of_role, rows
from tcstudy.scene.points import Scenes
from tcstudy.scene.records import Body, Convection, Scene
from tcstudy.scene.study import Exact

DERIVED = "derived"
TRACTIONS = tuple(name for name in of_role("traction") if name != "heat")
OF_HEAT = (*(row.name for row in rows("heat").values() if row.affine), "omega")
"""Keys of `heat` that are derived."""
REMEDY = "leave it out, or remove exact.loads to give all loads yourself"


def without_loads(ctx: Context, root: Node, sweep: Sweep) -> Node:
    """The study with 0 for all loads that will be derived; those that are given are recorded as faults.

    A misspelt word asks for derived loads as well, so that it is the only fault.
    """
    section = root.child("exact")
    word = section.child("loads") if section else None
    if word is None or word.value == "given" or not isinstance(root.value, Mapping):
        return root
    _refuse(ctx, root, sweep)
    sections = {key: node for key, node in root.value.items() if key != "path"}
    if loads := root.child("loads"):
        sections["loads"] = _with(_stripped(ctx, loads, ("f",)), "f", (replace(loads, value=0),) * 2)
    if heat := root.child("heat"):
        sections["heat"] = _with(_stripped(ctx, heat, OF_HEAT), "theta_bar", 0)
        if heat.child("theta") and not heat.child("alpha"):  # that theta is given is the fault, not that alpha is not
            sections["heat"] = _with(sections["heat"], "alpha", 1)
    boundary = root.child("boundary")
    if boundary and isinstance(boundary.value, Mapping):
        edges = {name: _edge(ctx, edge) for name, edge in boundary.value.items()}
        sections["boundary"] = replace(boundary, value=edges)
    return replace(root, value=sections)


def _refuse(ctx: Context, root: Node, sweep: Sweep) -> None:
    """Studies in which nothing can be derived, and swept loads."""
    here = deepest(root, ("exact", "loads"))
    if deepest(root, ("body", "file")).path == "body.file":
        what = "the body comes from a file, whose normals are no expressions, so loads cannot be derived"
        ctx.errors.at(here, what, "give the loads, or describe the body by its outline")
    if path := root.child("path"):
        what = "a path changes a load, but loads: derived leaves none to change"
        ctx.errors.at(path, what, "remove path, or give the loads", on_key=True)
    for axis in sweep.axes:
        section, last = axis.parameter.path[0], axis.parameter.path[-1]
        if section in ("boundary", "loads") or (section == "heat" and last in OF_HEAT):
            what = f"{axis.key} is swept, but exact.loads: derived makes it follow from the exact solution"
            ctx.errors.at(axis.node, what, "remove it from the sweep, or give the loads", on_key=True)


def _given(ctx: Context, node: Node) -> None:
    what = "is given, but exact.loads: derived makes it follow from the exact solution"
    ctx.errors.at(node, what, REMEDY, on_key=not node.path.endswith("]"))


def _stripped(ctx: Context, node: Node, keys: tuple[str, ...]) -> Node:
    """A mapping without the keys; a value that is not the word `derived` is a fault."""
    if not isinstance(node.value, Mapping):
        return node
    for key in keys:
        if (given := node.child(key)) and given.value != DERIVED:
            _given(ctx, given)
    return replace(node, value={key: child for key, child in node.value.items() if key not in keys})


def _with(node: Node, key: str, value: int | tuple[Node, ...]) -> Node:
    """A mapping with one more key, at the place of the mapping."""
    if not isinstance(node.value, Mapping):
        return node
    return replace(node, value={**node.value, key: replace(node, value=value)})


def _edge(ctx: Context, node: Node) -> Node:
    """The role of an edge with 0 for what is derived."""
    loaded = node.value == "traction"
    if isinstance(node.value, Mapping):
        role = node.child("role")
        if role is not None and role.value == "clamped":
            return replace(node, value=dict(_components(ctx, node)))
        node, loaded = _stripped(ctx, node, TRACTIONS), role is not None and role.value == "traction"
    elif loaded:
        node = replace(node, value={"role": node})
    return _with(node, "pressure", 0) if loaded else node


def _components(ctx: Context, node: Node) -> Iterator[tuple[str, Node]]:
    """The keys of a clamped edge, 0 for every displacement that is not free."""
    assert isinstance(node.value, Mapping)
    for key, child in node.value.items():
        if key not in COMPONENTS:
            yield key, child
        elif key == "u" and child.value == DERIVED:
            yield key, replace(child, value=(replace(child, value=0),) * 2)
        elif key == "u" and isinstance(child.value, tuple):
            yield key, replace(child, value=tuple(_component(ctx, item) for item in child.value))
        else:
            yield key, _component(ctx, child)


def _component(ctx: Context, node: Node) -> Node:
    if node.value == "free":
        return node
    if node.value != DERIVED:
        _given(ctx, node)
    return replace(node, value=0)


def derived_scenes(
    ctx: Context, root: Node, sweep: Sweep, exact: Exact, body: Body, scenes: Sequence[Scene]
) -> Sequence[Scene]:
    """The scenes with their loads; what forbids it is recorded, once for each place."""
    checks, derivation = Checks(exact, body), Derivation(exact, body)
    before = len(ctx.errors)
    for fault in (*_missing(exact, scenes), *checks.kinks()):
        _record(ctx, root, fault)
    if len(ctx.errors) > before:
        return scenes
    made = []
    for scene, point in zip(scenes, _points(sweep), strict=True):
        ctx.errors.point = point
        made.append(derivation.scene(scene))
        for fault in checks.scene(made[-1]):
            _record(ctx, root, fault)
        if len(ctx.errors) > before:
            break
    ctx.errors.point = ""
    return Scenes.of(made) if len(made) == len(scenes) else scenes


def _record(ctx: Context, root: Node, fault: SolutionFault) -> None:
    ctx.errors.at(deepest(root, ("exact", *fault.keys)), fault.what, fault.remedy)


def _missing(exact: Exact, scenes: Sequence[Scene]) -> Iterator[SolutionFault]:
    """A temperature that the loads need and the study does not give; α = 0."""
    if exact.theta is None:
        beta = any(scene.material.expands for scene in scenes)
        if beta or scenes[0].edges(Convection):
            why = "beta makes it load the body" if beta else "there are convection edges"
            yield SolutionFault((), f"theta is missing: {why}", 'add theta: "...", or theta: 0')
    elif scenes[0].edges(Convection) and any(scene.heat.alpha == 0.0 for scene in scenes):
        what = "with alpha = 0 no theta_bar can be derived: no heat passes convection edges"
        yield SolutionFault(("theta",), what, "give alpha > 0, or make the edges free or traction")


def _points(sweep: Sweep) -> Iterator[str]:
    """The swept values of every point in words."""
    words = [
        [f"{axis.key} = {label if isinstance(label, str) else f'{label:g}'}" for label in axis.labels]
        for axis in sweep.axes
    ]
    points = zip(*words, strict=True) if sweep.mode == "list" else itertools.product(*words)
    return map(", ".join, points)


@none_after_fault
def read_exact(ctx: Context, node: Node, root: Node, body: Body | None) -> Exact:
    """The exact solution; None after a fault."""
    before = len(ctx.errors)
    fields = Fields(ctx, node, "exact")
    u, theta, xi, exponent = (fields.value(key) for key in ("u", "theta", "xi", "exponent"))
    exact = Exact(u, theta, xi, exponent, fields.value("loads") == DERIVED)
    if body is not None and len(ctx.errors) == before:
        check_finite(ctx, root, "exact", exact, body)
    return exact
