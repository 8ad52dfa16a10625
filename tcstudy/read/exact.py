"""Reads the section `exact`: the solution that errors are measured against, and from which loads may be derived.

`loads: derived`: loads that follow from it are left out of the study, which is read with 0 in their places, and put
into its scenes. What is given although it would be derived, in the study or in its sweep, is a fault. The word
`derived` may stand in the place of a load; where an edge is held in one component only it must:
{role: clamped, u_x: derived}.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from tcstudy.exact.checks import Checks, SolutionFault
from tcstudy.exact.loads import Derivation
from tcstudy.read.checks import check_finite
from tcstudy.read.fields import Context, Fields, none_after_fault
from tcstudy.read.node import COMPONENTS, Node
from tcstudy.read.sweep import Sweep
from tcstudy.scene.keys import of_role, rows
from tcstudy.scene.points import Scenes
from tcstudy.scene.records import Body, Convection, Scene
from tcstudy.scene.study import Exact

DERIVED = "derived"
TRACTIONS = tuple(name for name in of_role("traction") if name != "heat")
OF_HEAT = (*(row.name for row in rows("heat").values() if row.affine), "omega")
"""Keys of `heat` that are derived."""
FOLLOWS = "exact.loads: derived makes it follow from the exact solution"
REMEDY = "leave it out, or remove exact.loads to give all loads yourself"


def without_loads(ctx: Context, root: Node, sweep: Sweep) -> Node:
    """The study with 0 for all loads that will be derived; those that are given are recorded as faults.

    A misspelt word asks for derived loads as well, so that it is the only fault.
    """
    word = root.at("exact", "loads")
    if word is None or word.value == "given" or not isinstance(root.value, Mapping):
        return root
    _refuse(ctx, word, root, sweep)
    sections = {key: node for key, node in root.value.items() if key != "path"}
    if loads := root.child("loads"):
        sections["loads"] = _derived(ctx, loads, ("f",), f=(replace(loads, value=0),) * 2)
    if heat := root.child("heat"):
        # that theta is given is the fault, not that alpha is not
        alone = {"alpha": 1} if heat.child("theta") and not heat.child("alpha") else {}
        sections["heat"] = _derived(ctx, heat, OF_HEAT, theta_bar=0, **alone)
    boundary = root.child("boundary")
    if boundary and isinstance(boundary.value, Mapping):
        edges = {name: _edge(ctx, edge) for name, edge in boundary.value.items()}
        sections["boundary"] = replace(boundary, value=edges)
    return replace(root, value=sections)


def _refuse(ctx: Context, word: Node, root: Node, sweep: Sweep) -> None:
    """Studies in which nothing can be derived, and swept loads."""
    if root.at("body", "file"):
        what = "the body comes from a file, whose normals are no expressions, so loads cannot be derived"
        ctx.errors.at(word, what, "give the loads, or describe the body by its outline")
    if path := root.child("path"):
        what = "a path changes a load, but loads: derived leaves none to change"
        ctx.errors.at(path, what, "remove path, or give the loads", on_key=True)
    for axis in sweep.axes:
        section, last = axis.parameter.path[0], axis.parameter.path[-1]
        if section in ("boundary", "loads") or (section == "heat" and last in OF_HEAT):
            remedy = "remove it from the sweep, or give the loads"
            ctx.errors.at(axis.node, f"{axis.key} is swept, but {FOLLOWS}", remedy, on_key=True)


def _derived(ctx: Context, node: Node, keys: tuple[str, ...], **instead: int | tuple[Node, ...]) -> Node:
    """A mapping without the keys, and other values; one that is given and not the word `derived` is a fault."""
    if not isinstance(node.value, Mapping):
        return node
    for given in (node.value[key] for key in keys if key in node.value):
        if given.value != DERIVED:
            ctx.errors.at(given, f"is given, but {FOLLOWS}", REMEDY, on_key=True)
    kept = {key: child for key, child in node.value.items() if key not in keys}
    return replace(node, value=kept | {key: replace(node, value=value) for key, value in instead.items()})


def _edge(ctx: Context, node: Node) -> Node:
    """The role of an edge with 0 for what is derived: tractions, and displacements of a clamped edge but free ones."""
    word = node.child("role") if isinstance(node.value, Mapping) else node
    if word is not node and word is not None and word.value == "clamped":
        held = {key: _held(ctx, key, child) for key, child in node.value.items()}  # type: ignore[union-attr]
        return replace(node, value=held)
    loaded = {"pressure": 0} if word is not None and word.value == "traction" else {}
    if word is node and loaded:
        node = replace(node, value={"role": node})
    return _derived(ctx, node, TRACTIONS, **loaded)


def _held(ctx: Context, key: str, node: Node) -> Node:
    """A key of a clamped edge, 0 for every displacement that is not free."""
    if key not in COMPONENTS or node.value == "free":
        return node
    if key == "u" and node.value == DERIVED:
        return replace(node, value=(replace(node, value=0),) * 2)
    if key == "u" and isinstance(node.value, tuple):
        return replace(node, value=tuple(_held(ctx, "u_x", item) for item in node.value))
    if node.value != DERIVED:
        ctx.errors.at(node, f"is given, but {FOLLOWS}", REMEDY, on_key=not node.path.endswith("]"))
    return replace(node, value=0)


def derived_scenes(
    ctx: Context, root: Node, sweep: Sweep, exact: Exact, body: Body, scenes: Sequence[Scene]
) -> Sequence[Scene]:
    """The scenes with their loads; what forbids it is recorded, once for each place."""
    checks, derivation, before = Checks(exact, body), Derivation(exact, body), len(ctx.errors)

    def sound(faults: Iterable[SolutionFault]) -> bool:
        for fault in faults:
            ctx.errors.at(root.nearest("exact", *fault.keys), fault.what, fault.remedy)
        return len(ctx.errors) == before

    if not sound((*_missing(exact, scenes), *checks.kinks())):
        return scenes
    words = [
        [f"{axis.key} = {label if isinstance(label, str) else f'{label:g}'}" for label in axis.labels]
        for axis in sweep.axes
    ]
    made = []
    points = zip(*words, strict=True) if sweep.mode == "list" else itertools.product(*words)
    for scene, point in zip(scenes, points, strict=True):
        ctx.errors.point = ", ".join(point)
        made.append(derivation.scene(scene))
        if not sound(checks.scene(made[-1])):
            break
    ctx.errors.point = ""
    return Scenes.of(made) if len(made) == len(scenes) else scenes


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


@none_after_fault
def read_exact(ctx: Context, node: Node, root: Node, body: Body | None) -> Exact:
    """The exact solution; None after a fault."""
    fields = Fields(ctx, node, "exact")
    u, theta, xi, exponent, loads = (fields.value(key) for key in ("u", "theta", "xi", "exponent", "loads"))
    exact = Exact(u, theta, xi, exponent, loads == DERIVED)
    ctx.sound()
    if body is not None:
        check_finite(ctx, root, "exact", exact, body)
    return exact
