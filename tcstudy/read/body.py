"""Reads the section `body`: outline, rectangle or file; holes and named regions."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tcstudy.read.fields import Context, Fields
from tcstudy.read.node import Node, deepest, is_name, split_path
from tcstudy.scene.keys import rows
from tcstudy.scene.records import BODY, Body, BrepFace, Edge, Loop, Point, Region
from tcstudy.scene.units import LENGTH, UnitError, to_si
from tcstudy.shapes import edges as shapes
from tcstudy.shapes import faults as body_faults

SIDES = tuple(rows("sides"))
FORMATS = {".step": "mm", ".stp": "mm", ".brep": "m"}
"""Formats of geometry files and the length unit that is usual in each."""
REGION_SHAPES = tuple(rows("region"))


Names = tuple[str, ...]


def read_body(ctx: Context, node: Node) -> tuple[Body | None, Names | None]:
    """The body, None after a fault, and the names of its edges, None if they are not known after a fault.

    Its shape is not checked yet (see check_shape).
    """
    before = len(ctx.errors)
    fields = Fields(ctx, node, "body")
    given = [key for key in ("outline", "rectangle", "file") if fields[key]]
    if len(given) != 1 and len(ctx.errors) == before:
        what = f"is given by {' and '.join(given)}" if given else "has no shape"
        ctx.errors.at(node, what, "give exactly one of outline, rectangle, file")
    outline = _outline(ctx, value) if (value := fields["outline"]) else None
    if value := fields["rectangle"]:
        outline = _block(ctx, value)
    brep = _file(ctx, value) if (value := fields["file"]) else None
    holes = _holes(ctx, fields["holes"])
    if brep and (value := fields["holes"]):
        ctx.errors.at(value, "holes are cut out of an outline, not of a file's face", "cut them in the CAD file")
    regions = read_regions(ctx, fields["regions"])
    body = Body(outline, holes, regions, brep)
    names = edge_names(body)
    known = len(given) == 1 and "" not in names
    return body if len(ctx.errors) == before else None, names if known else None


def edge_names(body: Body) -> Names:
    """Names of all edges, each once, in the order of the study."""
    names = [edge.name for edge in body.edges]
    if body.brep:
        names = [*(name for name, _ in body.brep.edges), *([body.brep.other] if body.brep.other else []), *names]
    return tuple(dict.fromkeys(names))


def check_shape(ctx: Context, body: Body, root: Node) -> bool:
    """Record what is wrong with the shape of the body where the study gives it; True if it is sound."""
    faults = oversized(body) or body_faults.check_body(body)
    for fault in faults:
        where = fault.where
        inline = deepest(root, ("heat", "omega"))
        if where.startswith("body.regions.omega") and isinstance(inline.value, Mapping):
            where = inline.path
        ctx.errors.unfit(deepest(root, split_path(where) or ("body",)), where, fault.what, fault.remedy)
    return not faults


def oversized(body: Body) -> list[body_faults.Fault]:
    """Holes and regions many times larger than the body, found before anything is computed with them."""
    if body.outline is None:
        return []
    places = [(f"body.holes[{i}]", hole) for i, hole in enumerate(body.holes)]
    places += [(f"body.regions.{region.name}", region.loop) for region in body.regions]
    size = _reach(body.outline)
    remedy = "check its numbers and their units"
    return [
        body_faults.Fault(place, f"it is {_reach(loop) / size:.3g} times as large as the body", remedy)
        for place, loop in places
        if _reach(loop) > 10.0 * size > 0.0
    ]


def _reach(loop: Loop) -> float:
    """Longer side of the box around the points of a loop."""
    points = [p for edge in loop.edges for p in (edge.start, edge.end, edge.through or edge.start)]
    return max(max(p[axis] for p in points) - min(p[axis] for p in points) for axis in (0, 1)) if points else 0.0


def _outline(ctx: Context, node: Node) -> Loop:
    """A chain of straight edges and arcs."""
    starts: list[Point] = []
    names: list[str] = []
    middles: list[Point | None] = []
    for item in ctx.items(node, "a list of edges", least=2):
        fields = Fields(ctx, item, "outline")
        starts.append(fields.value("from"))
        names.append(fields.value("edge"))
        middles.append(fields.value("through"))
    if len(starts) == 2 and middles == [None, None]:
        ctx.errors.at(node, "two straight edges enclose nothing", "give a third edge, or an arc by `through: [x, y]`")
    ends = [*starts[1:], *starts[:1]]
    return body_faults.turned(
        Loop(tuple(Edge(a, b, n, c) for a, b, n, c in zip(starts, ends, names, middles, strict=True)))
    )


def _block(ctx: Context, node: Node) -> Loop:
    """A rectangular body, whose edges have the names of the sides unless it gives others."""
    fields = Fields(ctx, node, "block")
    names = dict(zip(SIDES, SIDES, strict=True))
    if edges := fields["edges"]:
        names |= Fields(ctx, edges, "sides").given()
    return _rectangle(fields, tuple(names.values()))


def _rectangle(fields: Fields, names: Names) -> Loop:
    corner, width, height = fields.value("corner"), fields.value("width"), fields.value("height")
    if width > 0.0 and height > 0.0:
        return shapes.rectangle_loop(corner, width, height, names)
    return _unknown(*names)


def _unknown(*names: str) -> Loop:
    """Stands for a loop that could not be read, of which only the names of the edges are known."""
    nowhere = (math.nan, math.nan)
    return Loop(tuple(Edge(nowhere, nowhere, name) for name in names))


def _one_shape(ctx: Context, node: Node, section: str) -> tuple[str, Node] | None:
    """The only key of a shape and its value; None after a fault."""
    before = len(ctx.errors)
    fields, kinds = Fields(ctx, node, section), tuple(rows(section))
    given = [key for key in kinds if fields[key]]
    if len(given) == 1:
        return given[0], fields.values[given[0]]
    if len(ctx.errors) == before:
        ctx.errors.at(node, f"needs one shape, not {len(given)}", f"give one of {', '.join(kinds)}")
    return None


def _holes(ctx: Context, node: Node | None) -> tuple[Loop, ...]:
    holes: list[Loop] = []
    for item in ctx.items(node, "a list of holes") if node else ():
        kind, inner = _one_shape(ctx, item, "hole") or ("", item)
        if kind == "outline":
            holes.append(_outline(ctx, inner))
        else:
            holes.append(_simple_shape(ctx, kind, inner, edge=None) if kind else _unknown(""))
    return tuple(holes)


def _simple_shape(ctx: Context, kind: str, node: Node, edge: str | None) -> Loop:
    """A circle or a rectangle; with edge None it has to name its edge itself."""
    names = [name for name in rows(kind) if edge is None or name != "edge"]
    fields = Fields(ctx, node, kind, names, ())
    if edge is None:
        edge = str(fields.value("edge"))
    if kind == "circle":
        radius = fields.value("radius")
        return shapes.circle_loop(fields.value("center"), radius, edge) if radius > 0.0 else _unknown(edge)
    return _rectangle(fields, (edge,) * 4)


def read_region(ctx: Context, node: Node, name: str) -> Region:
    """A region given as {circle: ...}, {rectangle: ...} or {polygon: ...}."""
    kind, inner = _one_shape(ctx, node, "region") or ("", node)
    if kind == "polygon":
        return Region(name, body_faults.turned(shapes.polygon_loop(ctx.value(inner, rows("region")["polygon"]), name)))
    return Region(name, _simple_shape(ctx, kind, inner, edge=name) if kind else Loop(()))


def read_regions(ctx: Context, node: Node | None) -> tuple[Region, ...]:
    """The named regions of the body."""
    if node is None:
        return ()
    named = ctx.mapping(node, "names to shapes", "write {NAME: {circle: {center: [x, y], radius: r}}}", least=0)
    for name, item in named.items():
        _check_name(ctx, name, item)
        if name == BODY:
            what = f"{BODY!r} is the name of what of the body no region takes"
            ctx.errors.at(item, what, "give the region another name", on_key=True)
    return tuple(read_region(ctx, item, name) for name, item in named.items())


def _check_name(ctx: Context, name: str, item: Node) -> None:
    """Record a fault at the key unless it is a valid name."""
    if not is_name(name):
        ctx.errors.at(item, f"{name!r} is not a name", "use letters, digits and _", on_key=True)


def _file(ctx: Context, node: Node) -> BrepFace | None:
    fields = Fields(ctx, node, "file")
    value, path = fields["path"], fields.value("path")
    target, suffix = ctx.folder / path, ("." + path.rpartition(".")[2].lower())
    if path and value:
        try:  # no system has a file whose name it refuses, or that it does not let be seen
            there = "\0" not in str(target) and target.is_file()
        except OSError:
            there = False
        if suffix not in FORMATS:
            ctx.errors.at(value, f"{path!r} is not a geometry file", f"give a file ending in {', '.join(FORMATS)}")
        elif not there:
            ctx.errors.at(value, f"there is no file {path!r}", "give its path relative to the folder of the study")
    scale = _scale(ctx, fields["unit"], FORMATS.get(suffix, "m"))
    return BrepFace(target, fields.value("face"), scale, _named_points(ctx, fields["edges"]), fields.value("other"))


def _scale(ctx: Context, node: Node | None, usual: str) -> float:
    """Length of the file's unit; 1 in a dimensionless study that names none."""
    unit = ctx.text(node, "a unit of length") if node else ""
    if ctx.units == "none" and not unit:
        return 1.0
    try:
        return to_si("1", unit or usual, LENGTH)
    except UnitError as error:
        if node:
            ctx.errors.at(node, str(error), 'write for example "mm"')
        return math.nan


def _named_points(ctx: Context, node: Node | None) -> tuple[tuple[str, tuple[Point, ...]], ...]:
    """NAME: [[x, y], ...] of a geometry file."""
    if node is None:
        return ()
    remedy = "write {NAME: [[x, y], ...]}: the edge nearest to each point gets the name"
    named = ctx.mapping(node, "names to points", remedy, least=0)
    for name, item in named.items():
        _check_name(ctx, name, item)
    lists = {name: ctx.items(item, "a list of points", least=1) for name, item in named.items()}
    return tuple((name, tuple(ctx.point(entry) for entry in entries)) for name, entries in lists.items())
