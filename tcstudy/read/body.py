"""Reads the section `body`: outline, rectangle or file; holes and named regions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

from tcstudy.read.fields import Context, Fields, only_key
from tcstudy.read.node import Node, put, split_path
from tcstudy.scene.keys import rows
from tcstudy.scene.records import BODY, Body, BrepFace, Edge, Loop, Region
from tcstudy.scene.units import LENGTH, UnitError, to_si
from tcstudy.shapes import edges as shapes
from tcstudy.shapes import faults as body_faults

SIDES = tuple(rows("sides"))
FORMATS = {".step": "mm", ".stp": "mm", ".brep": "m"}
"""Formats of geometry files and the length unit that is usual in each."""
REGION_SHAPES = tuple(rows("region"))
SHAPES = ("outline", "rectangle", "file")

Names = tuple[str, ...]


def read_body(ctx: Context, node: Node) -> tuple[Body | None, Names | None]:
    """The body, None after a fault, and the names of its edges, None if they are not known after a fault.

    Its shape is not checked yet (see check_shape).
    """
    before = len(ctx.errors)
    fields = Fields(ctx, node, "body")
    given = [key for key in SHAPES if fields[key]]
    if len(given) != 1 and len(ctx.errors) == before:
        what = f"is given by {' and '.join(given)}" if given else "has no shape"
        ctx.errors.at(node, what, "give exactly one of outline, rectangle, file")
    loops = [_loop(ctx, value, key, "block") for key in SHAPES[:2] if (value := fields[key])]
    brep = _file(ctx, value) if (value := fields["file"]) else None
    holes = []
    for item in ctx.items(value, "a list of holes") if (value := fields["holes"]) else ():
        kind, inner = only_key(ctx, item, "hole", "{circle: {center: [x, y], radius: r}}")
        holes.append(_loop(ctx, inner, kind) if kind else _unknown(""))
    if brep and (value := fields["holes"]):
        ctx.errors.at(value, "holes are cut out of an outline, not of a file's face", "cut them in the CAD file")
    regions: dict[str, Node] = {}
    if value := fields["regions"]:
        remedy = "write {NAME: {circle: {center: [x, y], radius: r}}}"
        regions = ctx.mapping(value, "names to shapes", remedy, least=0, named=True)
    if BODY in regions:
        what = f"{BODY!r} is the name of what of the body no region takes"
        ctx.errors.at(regions[BODY], what, "give the region another name", on_key=True)
    named = tuple(_region(ctx, item, name) for name, item in regions.items())
    body = Body(loops[-1] if loops else None, tuple(holes), named, brep)
    names = edge_names(body)
    known = len(given) == 1 and "" not in names
    return body if len(ctx.errors) == before else None, names if known else None


def edge_names(body: Body) -> Names:
    """Names of all edges, each once, in the order of the study."""
    names = [edge.name for edge in body.edges]
    if body.brep:
        names = [*(name for name, _ in body.brep.edges), *([body.brep.other] if body.brep.other else []), *names]
    return tuple(dict.fromkeys(names))


INLINE = "omega"
"""Name of the region that `heat.omega` describes in place."""


def with_named_region(root: Node) -> Node:
    """The study with the region that `heat.omega` describes in place among those of the body."""
    shape, regions = root.at("heat", "omega"), root.at("body", "regions")
    known = {} if regions is None else regions.value
    if shape is None or not isinstance(shape.value, Mapping) or not isinstance(known, Mapping) or INLINE in known:
        return root
    if (body := root.child("body")) is None or not isinstance(body.value, Mapping):
        return root
    root = put(root, ("heat", "omega"), replace(shape, value=INLINE))
    return put(root, ("body", "regions", INLINE), shape)


def check_shape(ctx: Context, body: Body, root: Node) -> bool:
    """Record what is wrong with the shape of the body where the study gives it; True if it is sound."""
    faults = _faults(body)
    for fault in faults:
        node = root.nearest(*(split_path(fault.where) or ("body",)))
        where = node.path if node.path == "heat.omega" else fault.where
        ctx.errors.unfit(node, where, fault.what, fault.remedy)
    return not faults


@lru_cache(maxsize=4096)
def _faults(body: Body) -> list[body_faults.Fault]:
    """What is wrong with the shape of a body, which many geometries may share."""
    return _oversized(body) or body_faults.check_body(body)


def _oversized(body: Body) -> list[body_faults.Fault]:
    """Holes and regions many times larger than the body, found before anything is computed with them."""

    def reach(loop: Loop) -> float:
        """Longer side of the box around the points of a loop."""
        points = [p for edge in loop.edges for p in (edge.start, edge.end, edge.through or edge.start)]
        return max((max(c) - min(c) for c in zip(*points, strict=True)), default=0.0)

    places = [(f"body.holes[{i}]", hole) for i, hole in enumerate(body.holes)]
    places += [(f"body.regions.{region.name}", region.loop) for region in body.regions]
    size, remedy = reach(body.outline) if body.outline else 0.0, "check its numbers and their units"
    large = ((place, reach(loop) / size) for place, loop in places if reach(loop) > 10.0 * size > 0.0)
    return [body_faults.Fault(place, f"it is {by:.3g} times as large as the body", remedy) for place, by in large]


def _loop(ctx: Context, node: Node, kind: str, section: str = "", edge: str | None = None) -> Loop:
    """A loop of edges: outline, rectangle, circle or polygon; of a region all edges have its name.

    section: of the keys of the shape, if not named as the shape;  edge: name of all edges, None if the shape has it
    """
    if kind == "outline":
        chain = [Fields(ctx, item, kind) for item in ctx.items(node, "a list of edges", least=2)]
        starts, names, middles = ([one.value(key) for one in chain] for key in ("from", "edge", "through"))
        if len(starts) == 2 and middles == [None, None]:
            remedy = "give a third edge, or an arc by `through: [x, y]`"
            ctx.errors.at(node, "two straight edges enclose nothing", remedy)
        edges = map(Edge, starts, [*starts[1:], *starts[:1]], names, middles)
        return body_faults.turned(Loop(tuple(edges)))
    if kind == "polygon":
        return body_faults.turned(shapes.polygon_loop(ctx.value(node, rows("region")[kind]), edge or ""))
    if section == "block" and kind == "rectangle":
        fields = Fields(ctx, node, section)
        own = Fields(ctx, value, "sides").given() if (value := fields["edges"]) else {}
        named = tuple(own.get(side, side) for side in SIDES)
    else:
        fields = Fields(ctx, node, kind, [key for key in rows(kind) if edge is None or key != "edge"], ())
        named = (str(fields.value("edge")) if edge is None else edge,) * 4
    if kind == "circle":
        center, radius = fields.value("center"), fields.value("radius")
        return shapes.circle_loop(center, radius, named[0]) if radius > 0.0 else _unknown(named[0])
    corner, width, height = (fields.value(key) for key in ("corner", "width", "height"))
    return shapes.rectangle_loop(corner, width, height, named) if width > 0.0 and height > 0.0 else _unknown(*named)


def _unknown(*names: str) -> Loop:
    """Stands for a loop that could not be read, of which only the names of the edges are known."""
    nowhere = (math.nan, math.nan)
    return Loop(tuple(Edge(nowhere, nowhere, name) for name in names))


def _region(ctx: Context, node: Node, name: str) -> Region:
    """A region given as {circle: ...}, {rectangle: ...} or {polygon: ...}."""
    kind, inner = only_key(ctx, node, "region", "{circle: {center: [x, y], radius: r}}")
    return Region(name, _loop(ctx, inner, kind, edge=name) if kind else Loop(()))


def _file(ctx: Context, node: Node) -> BrepFace:
    """A face of a geometry file, lengths in its unit: 1 in a dimensionless study that names none."""
    fields = Fields(ctx, node, "file")
    path, unit = fields.value("path"), fields.value("unit") or ""
    target, suffix = ctx.folder / path, ("." + path.rpartition(".")[2].lower())
    try:  # no system has a file whose name it refuses, or that it does not let be seen
        there = "\0" not in str(target) and target.is_file()
    except OSError:
        there = False
    if path and suffix not in FORMATS:
        fields.fault("path", f"{path!r} is not a geometry file", f"give a file ending in {', '.join(FORMATS)}")
    elif path and not there:
        fields.fault("path", f"there is no file {path!r}", "give its path relative to the folder of the study")
    try:
        scale = to_si("1", unit or FORMATS.get(suffix, "m"), LENGTH) if unit or ctx.units == "SI" else 1.0
    except UnitError as error:
        scale = math.nan
        fields.fault("unit", str(error), 'write for example "mm"')
    remedy = "write {NAME: [[x, y], ...]}: the edge nearest to each point gets the name"
    named = ctx.mapping(fields["edges"], "names to points", remedy, least=0, named=True) if fields["edges"] else {}
    points = replace(rows("file")["edges"], kind="points")
    edges = {name: ctx.value(item, points) for name, item in named.items()}
    return BrepFace(target, fields.value("face"), scale, tuple(edges.items()), fields.value("other"))
