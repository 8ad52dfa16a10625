"""Where the probes of `output` lie: in the body, and which of them on a contact edge, where they have a u_T too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from tcstudy.read.fields import Context
from tcstudy.read.node import Node
from tcstudy.scene.records import Body, Contact, Scene
from tcstudy.scene.study import Probe
from tcstudy.shapes.edges import body_size, edge_distance, loop_polygon, loop_size

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
    edges = [edge for loop in (body.outline, *body.holes) for edge in loop.edges]
    away = [float(edge_distance(edge, np.array([probe.at]))[0]) for edge in edges]
    on = [edge for edge, distance in zip(edges, away, strict=True) if distance <= NEAR * body_size(body)]
    if not on and not inside.covers(shapely.Point(probe.at)):
        x, y = probe.at
        what = f"the point ({x:g}, {y:g}) is {min(away):g} outside the body"
        ctx.errors.at(node.child(probe.name) or node, what, "give a point of the body")
    return replace(probe, on_contact=any(edge.name in contact for edge in on))
