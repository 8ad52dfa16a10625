"""Reads what a study asks for beside its scenes: probes, derivatives, and what does not go together with the rest.

Probes lie in the body; those on a contact edge have a u_T, too.

`output.sensitivity`: the numbers by which results are differentiated exactly, which are those for which that takes no
other factorisation (`offline.slopes`): numbers in which the load is affine, of materials E, nu, alpha_T or beta and k,
α, stiffness of springs, and the numbers of friction laws. Everything else is refused with its reason.

What theory or code does not have for a feature of the scenes is refused (`check_together`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from tcstudy.laws.composed import EdgeLaws
from tcstudy.read.checks import corner_faults
from tcstudy.read.fields import Context
from tcstudy.read.node import Node
from tcstudy.read.plans import meant_number, path_of
from tcstudy.scene.fits import Sensitivity
from tcstudy.scene.keys import row
from tcstudy.scene.parameters import Number, numbers, sweepable
from tcstudy.scene.points import distinct
from tcstudy.scene.records import Body, Contact, Rigid, Scene
from tcstudy.scene.study import Exact, OutputPlan, Probe
from tcstudy.shapes.edges import body_size, edge_distance, loop_polygon, loop_size

Keys = tuple[str, ...]

NEAR = 1e-6
"""Distance from an edge that counts as on it, over the size of the body."""
NO_PAGE = "remove live: true"


def read_probes(ctx: Context, node: Node, body: Body | None, scenes: Sequence[Scene]) -> tuple[Probe, ...]:
    """The probes; one outside the body is a fault. A body from a file is not judged, and has no u_T at probes."""
    import shapely

    before, point = len(ctx.errors), replace(row("output", "probes"), kind="point")
    places = ctx.mapping(node, "names to points", "write {tip: [200 mm, 60 mm]}", named=True)
    probes = [Probe(name, ctx.value(place, point)) for name, place in places.items()]
    if body is None or body.outline is None or not scenes or len(ctx.errors) > before:
        return tuple(probes)
    inside, contact = loop_polygon(body.outline, loop_size(body.outline)), scenes[0].edges(Contact)
    for hole in body.holes:
        inside = inside.difference(loop_polygon(hole, loop_size(hole)))
    found = []
    for probe in probes:
        away = [float(edge_distance(edge, np.array([probe.at]))[0]) for edge in body.edges]
        on = [edge for edge, distance in zip(body.edges, away, strict=True) if distance <= NEAR * body_size(body)]
        if not on and not inside.covers(shapely.Point(probe.at)):
            what = f"the point ({probe.at[0]:g}, {probe.at[1]:g}) is {min(away):g} outside the body"
            ctx.errors.at(places[probe.name], what, "give a point of the body")
        found.append(replace(probe, on_contact=any(edge.name in contact for edge in on)))
    return tuple(found)


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
        if (path := path_of(word)) in found:
            ctx.errors.at(item, f"{word} is given twice", "give every number once")
        elif word and (number := named_number(ctx, item, word, root, known)):
            found[path] = number
            if path[0] == "boundary" and path[-1].startswith("u_"):  # which a corner may share with another edge
                moved = known[path].put(base, 1.0 + 2.0 * abs(float(known[path].value)))  # type: ignore[arg-type]
                for _, why in islice(corner_faults(base.body, moved.boundary), 1):
                    remedy = "free a component of one of the two edges"
                    ctx.errors.at(item, f"{'.'.join(path)} cannot change alone: {why}", remedy)
    return tuple(found.values())


def differentiable(root: Node, base: Scene, scenes: Sequence[Scene]) -> dict[Keys, Number]:
    """The numbers by which results can be differentiated, and those that have a reason why not; of materials those
    that the study gives, of laws those of all scenes."""
    found = {path: one for path, one in numbers(base) if path[0] != "friction"}
    found = {path: one for path, one in found.items() if path[0][:8] != "material" or root.at(*path)}
    for scene in distinct(scenes, "friction"):
        found |= {path: one for path, one in numbers(scene) if path[0] == "friction"}
    if root.at("history", "stiffness"):
        found["history", "stiffness"] = Number(row("history", "stiffness"), 0.0, ())
    return found


def named_number(
    ctx: Context, node: Node, word: str, root: Node, known: Mapping[Keys, Number], on_key: bool = False
) -> Sensitivity | None:
    """The number that a word names, of those that are `differentiable`; None after a fault."""
    path = path_of(word)
    if path in known and not known[path].no_number:
        return Sensitivity(word, path, ctx.cf(known[path].row.dimension))
    what, remedy = f"there is no derivative by {word}", "compare points of a sweep over it"
    if path in known:
        what, remedy = f"{what}: {known[path].no_number}", "name a single number that has an effect"
    elif path[0] in ("body", "mesh"):
        what += ": it moves the mesh"
    elif path[0] in ("material", "materials") and path[-1] in ("lambda", "mu"):
        remedy = "give the material by E and nu, and name these"
    elif path[0] == "parameters" or root.at("parameters", word):
        what, remedy = f"{what}: it may stand in any expression", "name a number of a section"
    elif path in sweepable({}, None):
        what = f"this study has no number {word} by which its solution can be differentiated"
    else:
        what, remedy = f"the study has no number {word!r}", meant_number(word, known, "use")
    ctx.errors.at(node, what, remedy, on_key=on_key)
    return None


def check_together(
    ctx: Context, root: Node, scenes: Sequence[Scene], output: OutputPlan | None, exact: Exact | None
) -> None:
    """Report what a feature of the scenes excludes and the study asks for.

    output, exact: what it asks for beside its scenes; None for what it does not, or has faults in
    """
    derived = exact is not None and exact.derived
    wanted = {"exact": exact is not None, "derived": derived, "live": output is not None and output.live}
    roles = dict(scenes[0].boundary).values() if scenes else ()
    edge = {
        "exact": ("an exact solution has no such edge", "remove exact"),
        "live": ("a live page takes none", NO_PAGE),
    }
    features: dict[str, tuple[bool, dict[str, tuple[str, str]]]] = {
        "friction differs along the contact line": (
            any(isinstance(scene.friction, EdgeLaws) for scene in distinct(scenes, "friction")),
            {"live": ("a live page takes one law", NO_PAGE)},
        ),
        "materials differ by region, where stresses jump": (
            root.child("materials") is not None,
            {
                "exact": ("an exact solution takes one material", "remove exact, or write one material"),
                "live": ("a live page takes one material", NO_PAGE),
            },
        ),
        "an edge is rigid": (any(isinstance(role, Rigid) for role in roles), edge),
        "an edge rests on springs": (any(scene.springs for scene in distinct(scenes, "boundary")), edge),
        "an edge has heat of its own": (
            any(role.heat is not None for role in roles),
            {
                "derived": ("loads are derived for the section heat only", "give the loads, or loads: given"),
                "live": ("a live page takes one alpha and one theta_bar", NO_PAGE),
            },
        ),
    }
    for feature, (has, excluded) in features.items():
        for asked, (why, remedy) in excluded.items() if has else ():
            if wanted[asked] and (node := root.child("output" if asked == "live" else "exact")):
                ctx.errors.at(node, f"{feature}, and {why}", remedy)
