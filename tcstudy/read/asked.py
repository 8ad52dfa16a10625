"""Reads what a study asks for beside its scenes: probes, derivatives, and what does not go together with the rest.

Probes lie in the body; those on a contact edge have a u_T, too.

`output.sensitivity`: the numbers by which results are differentiated exactly, which are those for which that takes no
other factorisation (`offline.slopes`): numbers in which the load is affine, of materials E, nu, alpha_T or beta and k,
α, stiffness of springs, and the numbers of friction laws. Everything else is refused with its reason.

A scene with one of the FEATURES is refused what its theory or its code does not have: one line a fault.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from tcstudy.laws.composed import EdgeLaws
from tcstudy.read.checks import corner_faults
from tcstudy.read.fields import Context
from tcstudy.read.node import Node, holds
from tcstudy.read.plans import meant_number, path_of
from tcstudy.scene.fits import Sensitivity
from tcstudy.scene.keys import row
from tcstudy.scene.parameters import Number, affine_numbers, numbers, sweepable
from tcstudy.scene.points import distinct
from tcstudy.scene.records import Body, Contact, Rigid, Scene
from tcstudy.scene.study import Exact, OutputPlan, Probe
from tcstudy.shapes.edges import body_size, edge_distance, loop_polygon, loop_size

Keys = tuple[str, ...]

NEAR = 1e-6
"""Distance from an edge that counts as on it, over the size of the body."""


def read_probes(ctx: Context, node: Node, body: Body | None, scenes: Sequence[Scene]) -> tuple[Probe, ...]:
    """The probes; one outside the body is a fault. A body from a file is not judged, and has no u_T at probes."""
    if not isinstance(node.value, Mapping) or not node.value:
        ctx.errors.at(node, f"must name points, but is {node.kind()}", "write {tip: [200 mm, 60 mm]}")
        return ()
    before = len(ctx.errors)
    names = [ctx.name(replace(place, value=name), "a name") for name, place in node.value.items()]
    found = [Probe(name, ctx.point(place)) for name, place in zip(names, node.value.values(), strict=True)]
    if body is None or body.outline is None or not scenes or len(ctx.errors) > before:
        return tuple(found)
    return tuple(_placed(ctx, node, probe, body, scenes[0].edges(Contact)) for probe in found)


def _placed(ctx: Context, node: Node, probe: Probe, body: Body, contact: tuple[str, ...]) -> Probe:
    """The probe, on an edge or inside of all."""
    import shapely

    assert body.outline is not None
    inside = loop_polygon(body.outline, loop_size(body.outline))
    for hole in body.holes:
        inside = inside.difference(loop_polygon(hole, loop_size(hole)))
    away = [float(edge_distance(edge, np.array([probe.at]))[0]) for edge in body.edges]
    on = [edge for edge, distance in zip(body.edges, away, strict=True) if distance <= NEAR * body_size(body)]
    if not on and not inside.covers(shapely.Point(probe.at)):
        x, y = probe.at
        what = f"the point ({x:g}, {y:g}) is {min(away):g} outside the body"
        ctx.errors.at(node.child(probe.name) or node, what, "give a point of the body")
    return replace(probe, on_contact=any(edge.name in contact for edge in on))


REMEDY = "compare points of a sweep over it"


def read_sensitivity(
    ctx: Context, node: Node, root: Node, base: Scene | None, scenes: Sequence[Scene], exact: Exact | None
) -> tuple[Sensitivity, ...]:
    """The numbers by name or key path, each once.

    base: the scene without the sweep;  exact: the exact solution, whose derived loads would have to follow
    """
    if base is None:
        return ()
    if exact is not None and exact.derived:
        what = "the loads are derived from the exact solution and would change with the number"
        ctx.errors.at(node, what, "give the loads, or remove sensitivity")
        return ()
    known = differentiable(root, base, scenes)
    found: dict[Keys, Sensitivity] = {}
    for item in node.value if isinstance(node.value, tuple) else (node,):
        word = ctx.text(item, "the name of a number")
        path = path_of(word)
        if path in found:
            ctx.errors.at(item, f"{word} is given twice", "give every number once")
        elif word and (number := named_number(ctx, item, word, root, known)):
            found[path] = number
            _check_corner(ctx, item, base, path)
    return tuple(found.values())


def named_number(
    ctx: Context, node: Node, word: str, root: Node, known: Mapping[Keys, Number], on_key: bool = False
) -> Sensitivity | None:
    """The number that a word names, of those that are `differentiable`; None after a fault."""
    path = path_of(word)
    if path not in known or known[path].no_number:
        what, remedy = _why_not(root, word, path, known)
        ctx.errors.at(node, what, remedy, on_key=on_key)
        return None
    place = path[:2] if path[0] == "materials" else ("material",)
    heat_grows = not holds(root, (*place, "beta"))  # with E, as β follows from alpha_T
    return Sensitivity(word, path, ctx.cf(known[path].row.dimension), heat_grows)


def differentiable(root: Node, base: Scene, scenes: Sequence[Scene]) -> dict[Keys, Number]:
    """The numbers by which results can be differentiated, and those that have a reason why not; of materials those
    that the study gives, of laws those of all scenes."""
    found = {path: one for path, one in numbers(base) if path[0] != "friction"}
    found = {path: one for path, one in found.items() if path[0][:8] != "material" or holds(root, path)}
    for scene in distinct(scenes, "friction"):
        found |= {path: one for path, one in numbers(scene) if path[0] == "friction"}
    if holds(root, ("history", "stiffness")):
        found["history", "stiffness"] = Number(row("history", "stiffness"), 0.0, ())
    return found


def _why_not(root: Node, word: str, path: Keys, known: Mapping[Keys, Number]) -> tuple[str, str]:
    """What is wrong with a name, and the remedy."""
    if path in known:
        return f"there is no derivative by {word}: {known[path].no_number}", "name a single number that has an effect"
    if path[0] in ("body", "mesh"):
        return f"there is no derivative by {word}: it moves the mesh", REMEDY
    if path[0] in ("material", "materials") and path[-1] in ("lambda", "mu"):
        return f"there is no derivative by {word}", "give the material by E and nu, and name these"
    if path[0] == "parameters" or holds(root, ("parameters", word)):
        return f"there is no derivative by {word}: it may stand in any expression", "name a number of a section"
    if path in sweepable({}, None):
        return f"this study has no number {word} by which its solution can be differentiated", REMEDY
    return f"the study has no number {word!r}", meant_number(word, known, "use")


def _check_corner(ctx: Context, item: Node, base: Scene, path: Keys) -> None:
    """A prescribed displacement that a corner shares with another edge cannot change alone."""
    if path[0] != "boundary" or not path[-1].startswith("u_"):
        return
    one = dict(affine_numbers(base))[path]
    moved = one.put(base, 1.0 + 2.0 * abs(float(one.value)))  # type: ignore[arg-type]
    for _, why in islice(corner_faults(base.body, moved.boundary), 1):
        ctx.errors.at(item, f"{'.'.join(path)} cannot change alone: {why}", "free a component of one of the two edges")


Why = tuple[str, str]
"""Why something is excluded, what to do."""


def _one(what: str) -> dict[str, Why]:
    """Exclusions of a scene that has several of what others have one of."""
    return {
        "exact": (f"an exact solution takes one {what}", f"remove exact, or write one {what}"),
        "live": (f"a live page takes one {what}", "remove live: true"),
    }


OF_BODY: dict[str, Why] = {
    "exact": ("an exact solution has no such edge", "remove exact"),
    "live": ("a live page takes none", "remove live: true"),
}
"""Of a body that not its material alone makes stiff."""

FEATURES: tuple[tuple[str, Callable[[Node, Sequence[Scene]], bool], dict[str, Why]], ...] = (
    (
        "friction differs along the contact line",
        lambda _, scenes: any(isinstance(scene.friction, EdgeLaws) for scene in distinct(scenes, "friction")),
        {"live": _one("law")["live"]},
    ),
    (
        "materials differ by region, where stresses jump",
        lambda root, _: root.child("materials") is not None,
        _one("material"),
    ),
    (
        "an edge is rigid",
        lambda _, scenes: bool(scenes) and any(isinstance(role, Rigid) for _, role in scenes[0].boundary),
        OF_BODY,
    ),
    (
        "an edge rests on springs",
        lambda _, scenes: any(scene.springs for scene in distinct(scenes, "boundary")),
        OF_BODY,
    ),
    (
        "an edge has heat of its own",
        lambda _, scenes: bool(scenes) and scenes[0].heat_by_edge,
        {
            "derived": ("loads are derived for the section heat only", "give the loads, or loads: given"),
            "live": ("a live page takes one alpha and one theta_bar", "remove live: true"),
        },
    ),
)


def check_together(
    ctx: Context,
    root: Node,
    scenes: Sequence[Scene],
    output: OutputPlan | None,
    exact: Exact | None,
) -> None:
    """Report what a feature of the scenes excludes and the study asks for.

    output, exact: what it asks for beside its scenes; None for what it does not, or has faults in
    """
    wanted = {
        "exact": ("exact", exact is not None),
        "derived": ("exact", bool(exact and exact.derived)),
        "live": ("output", bool(output and output.live)),
    }
    for feature, has, excluded in FEATURES:
        if not any(wanted[what][1] for what in excluded) or not has(root, scenes):
            continue
        for what, (why, remedy) in excluded.items():
            section, there = wanted[what]
            if there and (node := root.child(section)):
                ctx.errors.at(node, f"{feature}, and {why}", remedy)
