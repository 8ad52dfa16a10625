"""Reads the section `body`: outline, rectangle or file; holes and named regions; and what must hold
across sections: no free rigid motions, a sensible number of elements, corners where two edges
prescribe displacements that agree, and expressions, which must have a finite value where they are
used, at sample points.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import is_dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.expression import Expression, value_of
from tcstudy.laws.composed import EdgeLaws
from tcstudy.read.document import Node, split_path
from tcstudy.read.fields import Context, Fields, only_key
from tcstudy.read.step import KERNEL_UNIT, same_unit, stated_units, unit_name
from tcstudy.scene.guarantee import why_no_bound
from tcstudy.scene.keys import rows
from tcstudy.scene.mesh_plan import Goal, MeshPlan
from tcstudy.scene.records import (
    BODY,
    Body,
    Boundary,
    BrepFace,
    Clamped,
    Contact,
    Edge,
    Free,
    Loop,
    Point,
    Region,
    Rigid,
    Role,
    Scalar,
    Scene,
    Symmetry,
)
from tcstudy.scene.units import LENGTH, UnitError, split_quantity, to_si
from tcstudy.shapes import edges as shapes
from tcstudy.shapes import faults as body_faults
from tcstudy.shapes.edges import (
    body_area,
    body_size,
    edge_distance,
    edge_length,
    edge_normal,
    edge_points,
    inside,
)

SIDES = tuple(rows("sides"))
FORMATS = {".step": "mm", ".stp": "mm", ".brep": "m"}
"""Formats of geometry files and the length unit that is usual in each."""
STEP_FORMATS = (".step", ".stp")
"""Those whose header may state the unit."""
SHAPES = ("outline", "rectangle", "file")
AN_EDGE = "{from: [0 mm, 0 mm], edge: NAME}"

Names = tuple[str, ...]


def read_body(ctx: Context, node: Node) -> tuple[Body | None, Names | None]:
    """The body, None after a fault, and the names of its edges, None if they are not known after a
    fault. Its shape is not checked yet (see check_shape)."""
    before = len(ctx.errors)
    fields = Fields(ctx, node, "body")
    given = [key for key in SHAPES if fields[key]]
    if len(given) != 1 and len(ctx.errors) == before:
        what = f"is given by {' and '.join(given)}" if given else "has no shape"
        ctx.at(node, what, "give exactly one of outline, rectangle, file")
    loops = [_loop(ctx, value, key, "block") for key in SHAPES[:2] if (value := fields[key])]
    brep = _file(ctx, value) if (value := fields["file"]) else None
    holes = []
    for item in ctx.items(fields["holes"], "a list of holes"):
        kind, inner = only_key(ctx, item, "hole", "{circle: {center: [x, y], radius: r}}")
        holes.append(_loop(ctx, inner, kind) if kind else _unknown(""))
    if brep and (value := fields["holes"]):
        ctx.at(
            value,
            "holes are cut out of an outline, not of a file's face",
            "cut them in the CAD file",
        )
    remedy = "write {NAME: {circle: {center: [x, y], radius: r}}}"
    regions = ctx.mapping(fields["regions"], "names to shapes", remedy, least=0, named=True)
    if BODY in regions:
        what = f"{BODY!r} is the name of what of the body no region takes"
        ctx.at(regions[BODY], what, "give the region another name", on_key=True)
    named = tuple(_region(ctx, item, name) for name, item in regions.items())
    body = Body(loops[-1] if loops else None, tuple(holes), named, brep)
    names = edge_names(body)
    known = len(given) == 1 and names and "" not in names
    return body if len(ctx.errors) == before else None, names if known else None


def edge_names(body: Body) -> Names:
    """Names of all edges, each once, in the order of the study."""
    names = [edge.name for edge in body.edges]
    if body.brep:
        names = [
            *(name for name, _ in body.brep.edges),
            *([body.brep.other] if body.brep.other else []),
            *names,
        ]
    return tuple(dict.fromkeys(names))


_check_body = lru_cache(maxsize=4096)(body_faults.check_body)  # many geometries may share a body


def check_shape(ctx: Context, body: Body, root: Node) -> bool:
    """Record what is wrong with the shape of the body where the study gives it; True if it is
    sound."""
    faults = _check_body(body)
    given = root.at("body")
    written = _written_unit(ctx, [given] if faults and given else [])
    for fault in faults:
        place = root.nearest(*(split_path(fault.where) or ("body",)))
        what = body_faults.spots_in(fault.what, *written)
        remedy = body_faults.spots_in(fault.remedy, *written)
        ctx.errors.unfit(place, fault.where, what, remedy)
    return not faults


def _loop(ctx: Context, node: Node, kind: str, section: str = "", edge: str | None = None) -> Loop:
    """A loop of edges: outline, rectangle, circle or polygon; of a region all edges have its name.

    section: of the keys of the shape, if not named as the shape;  edge: name of all edges, None if the shape has it
    """
    if kind == "outline":
        chain = [Fields(ctx, item, kind) for item in ctx.items(node, "a list of edges", 2, AN_EDGE)]
        starts, names, middles = (
            [one.value(key) for one in chain] for key in ("from", "edge", "through")
        )
        if len(starts) == 2 and middles == [None, None]:
            ctx.at(
                node,
                "two straight edges enclose nothing",
                "give a third edge, or an arc by `through: [x, y]`",
            )
        edges = map(Edge, starts, [*starts[1:], *starts[:1]], names, middles)
        return body_faults.turned(Loop(tuple(edges)))
    if kind == "polygon":
        return body_faults.turned(
            shapes.polygon_loop(ctx.value(node, rows("region")[kind]), edge or "")
        )
    if section == "block" and kind == "rectangle":
        fields = Fields(ctx, node, section)
        own = Fields(ctx, value, "sides").given() if (value := fields["edges"]) else {}
        named = tuple(own.get(side, side) for side in SIDES)
    else:
        fields = Fields(
            ctx, node, kind, [key for key in rows(kind) if edge is None or key != "edge"], ()
        )
        named = (str(fields.value("edge")) if edge is None else edge,) * 4
    if kind == "circle":
        center, radius = fields.value("center"), fields.value("radius")
        return shapes.circle_loop(center, radius, named[0]) if radius > 0.0 else _unknown(named[0])
    corner, width, height = (fields.value(key) for key in ("corner", "width", "height"))
    return (
        shapes.rectangle_loop(corner, width, height, named)
        if width > 0.0 and height > 0.0
        else _unknown(*named)
    )


def _unknown(*names: str) -> Loop:
    """Stands for a loop that could not be read, of which only the names of the edges are known."""
    nowhere = (math.nan, math.nan)
    return Loop(tuple(Edge(nowhere, nowhere, name) for name in names))


def _region(ctx: Context, node: Node, name: str) -> Region:
    kind, inner = only_key(ctx, node, "region", "{circle: {center: [x, y], radius: r}}")
    return Region(name, _loop(ctx, inner, kind, edge=name) if kind else Loop(()))


def _file(ctx: Context, node: Node) -> BrepFace:
    fields = Fields(ctx, node, "file")
    path = fields.value("path")
    target, suffix = ctx.folder / path, ("." + path.rpartition(".")[2].lower())
    if path and suffix not in FORMATS:
        fields.fault(
            "path",
            f"{path!r} is not a geometry file",
            f"give a file ending in {', '.join(FORMATS)}",
        )
    elif (
        path and ctx.with_files and not os.path.isfile(target)
    ):  # False of one whose name a system refuses, too
        fields.fault(
            "path",
            f"there is no file {path!r}",
            "give its path relative to the folder of the study",
        )
    scale = _scale(ctx, fields, target, suffix)
    remedy = "write {NAME: [[x, y], ...]}: the edge nearest to each point gets the name"
    named = ctx.mapping(fields["edges"], "names to points", remedy, least=0, named=True)
    points = replace(rows("file")["edges"], kind="points")
    edges = dict[str, Any]()
    for name, item in named.items():
        single = isinstance(item.value, tuple) and not any(
            isinstance(one.value, tuple) for one in item.value
        )
        if single and item.value:
            ctx.at(item, "is one point, but must be a list of points", f"write [{item.brief()}]")
        edges[name] = () if single and item.value else ctx.value(item, points)
    return BrepFace(
        target,
        fields.value("face"),
        scale,
        tuple(edges.items()),
        fields.value("other"),
        written=_written_unit(ctx, named.values()),
    )


def _scale(ctx: Context, fields: Fields, path: Path, suffix: str) -> float:
    """Return the length of one unit of the file as the kernel gives it [m]; NaN after a fault.

    The header of a STEP file decides: the kernel converts its lengths to millimetres, so that
    `unit` is for files that state none. Dimensionless studies take the numbers of the file.
    """
    unit = fields.value("unit") or ""
    try:
        metres = to_si("1", unit, LENGTH) if unit else math.nan
    except UnitError as error:
        fields.fault("unit", str(error), 'write for example "mm"')
        return math.nan
    states_unit = ctx.with_files and suffix in STEP_FORMATS
    stated = stated_units(path) if states_unit else ()
    if unit and not all(same_unit(metres, one) for one in stated):
        names = " and ".join(unit_name(one) for one in stated)
        what = f"is {unit}, but the header of {path.name} says {names}"
        fields.fault("unit", what, "remove unit: the lengths are converted by the header")
        return math.nan
    if ctx.units == "none" and not unit:
        return KERNEL_UNIT / stated[0] if len(stated) == 1 else 1.0
    if stated:
        return KERNEL_UNIT
    return metres if unit else to_si("1", FORMATS.get(suffix, "m"), LENGTH)


def _written_unit(ctx: Context, points: Iterable[Node]) -> tuple[str, float]:
    """Return the unit of the first coordinate of some points with a unit, and its length [m]."""
    if ctx.units == "none":
        return "", 1.0
    for coordinate in (one for point in points for one in _leaves(point)):
        parts = split_quantity(coordinate.value) if isinstance(coordinate.value, str) else None
        if parts is None:
            continue
        try:
            return parts[1], to_si("1", parts[1], LENGTH)
        except UnitError:
            continue
    return "m", 1.0


def _leaves(node: Node) -> Iterator[Node]:
    """Yield the values in lists and sections within each other."""
    value = node.value
    items = tuple(value.values()) if isinstance(value, Mapping) else value
    if not isinstance(items, tuple):
        yield node
        return
    for item in items:
        yield from _leaves(item)


Array = NDArray[np.float64]

MAX_TRIANGLES = 2e7
"""More triangles than this are taken for a typing error of maxh or levels."""
ARC_PIECES = 32


def supports(boundary: Boundary) -> tuple[object, ...]:
    """What of the boundary decides about rigid motions: which components are held on which
    edges."""
    held = ((edge, role.frame, *(u is None for u in role.held)) for edge, role in boundary)
    return tuple(one for one in held if one[2:] != (True, True))


class BoundaryPiece(NamedTuple):
    """Some points (n, 2) of a boundary curve with its unit normals (n, 2) there, and the name of
    the edge."""

    name: str
    points: Array
    normals: Array


def supports_fault(body: Body, boundary: Boundary) -> tuple[str, str] | None:
    """What is wrong with the supports and what to do; None if they hold the body, or if it is from
    a file."""
    if body.outline is None:
        return None
    points = [edge_points(edge, 1 if edge.through is None else ARC_PIECES) for edge in body.edges]
    pieces = [
        BoundaryPiece(edge.name, at, edge_normal(edge, at))
        for edge, at in zip(body.edges, points, strict=True)
    ]
    return support_fault(pieces, boundary, body.outline.edges[0].start, body_size(body))


def support_fault(
    pieces: Sequence[BoundaryPiece],
    boundary: Boundary,
    centre: Point,
    size: float,
    accuracy: float = 1e-9,
) -> tuple[str, str] | None:
    """What is wrong and what to do if u given on Γ_D and u_N = 0 on Γ_C leave a plane rigid motion;
    else None.

    centre: any point of the body;  size: its diagonal;  accuracy: of the normals, as far as they are known
    """
    roles = dict(boundary)
    if not any(isinstance(role, Clamped | Contact) for role in roles.values()):
        return None
    rows = [
        row for piece in pieces for row in _constraints(piece, roles.get(piece.name), centre, size)
    ]
    _, singular, motions = np.linalg.svd(np.array(rows).reshape(-1, 3), full_matrices=True)
    rank = int(np.sum(singular > accuracy * singular[0])) if len(singular) else 0
    if rank == 3:
        return None
    clamped = any(isinstance(role, Clamped) for role in roles.values())
    what = (
        "the supports do not hold the body"
        if clamped
        else "no edge is clamped and contact does not hold the body"
    )
    remedy = "give an edge the role clamped, or prescribe the missing component"
    return f"{what}: it can still {_motion(motions[rank:], centre, size)}", remedy


def _constraints(
    piece: BoundaryPiece, role: Role | None, centre: Point, size: float
) -> Iterator[list[float]]:
    """Rows d·r(p) = 0 of a curve for the rigid motions r = (a − cη, b + cξ), (ξ, η) = (p −
    centre)/size."""
    if role is None:
        return
    if isinstance(role, Rigid) and role.moment is None:  # what is tied does not turn
        for x, y in piece.points[1:] - piece.points[0]:
            yield from (
                [0.0, 0.0, s / size] for s, u in zip((-y, x), role.u, strict=True) if u is None
            )
    for (x, y), n in zip(piece.points, piece.normals, strict=True):
        xi, eta = (x - centre[0]) / size, (y - centre[1]) / size
        yield from (
            [d_x, d_y, d_y * xi - d_x * eta]
            for d_x, d_y, _ in _components(role.frame, role.held, n)
        )


def _components(
    frame: str, given: tuple[Scalar | None, Scalar | None], n: Array
) -> Iterator[tuple[float, float, Scalar]]:
    """(d₁, d₂, value) of every component that is given, in x and y or along the normal n and the
    tangent."""
    n_x, n_y = map(float, n)
    directions = ((1.0, 0.0), (0.0, 1.0)) if frame == "xy" else ((n_x, n_y), (-n_y, n_x))
    return ((*d, value) for d, value in zip(directions, given, strict=True) if value is not None)


def _motion(motions: Array, centre: Point, size: float) -> str:
    if len(motions) > 1:
        return f"move in {len(motions)} ways"
    a, b, c = motions[0]
    if abs(c) < 1e-6:
        return f"slide along {'x' if abs(b) < 1e-6 else 'y' if abs(a) < 1e-6 else f'({a:.3g}, {b:.3g})'}"
    at = (centre[0] - size * b / c, centre[1] + size * a / c)
    x, y = (0.0 if abs(v) <= 1e-9 * size else v for v in at)  # rounding is no coordinate
    return f"turn about ({x:.3g}, {y:.3g})"


def check_goal(ctx: Context, node: Node, goal: Goal, body: Body, scenes: Sequence[Scene]) -> None:
    """A bound must be proved; the point of u_T must lie on a contact edge (of a body from a file,
    see its mesh)."""
    if goal.proved and (why := next(filter(None, map(why_no_bound, scenes)), "")):
        ctx.at(node, f"no bound is proved of this study: {why}")
    if goal.at is None or body.outline is None:
        return
    contact = [name for name, role in scenes[0].boundary if isinstance(role, Contact)]
    edges = [edge for edge in body.edges if edge.name in contact]
    away = (
        min(float(edge_distance(edge, np.array([goal.at]))[0]) for edge in edges)
        if edges
        else math.inf
    )
    if away > 1e-6 * body_size(body):
        x, y = goal.at
        remedy = (
            f"give a point on {' or '.join(contact)}"
            if contact
            else "give an edge the role contact"
        )
        what = f"the point ({x:g}, {y:g}) is not on a contact edge" + (
            f", but {away:g} away" if edges else ""
        )
        ctx.at(node.at("u_T") or node, what, remedy)


def check_mesh(ctx: Context, maxh: Node, plan: MeshPlan, body: Body) -> None:
    """Refuse element sizes that do not fit the body (one from a file is judged when the file is
    read)."""
    if body.outline is None:
        return
    for i, what, remedy in mesh_faults(plan, body_area(body), body_size(body), ctx.units):
        node = maxh.value[i] if isinstance(maxh.value, tuple) else maxh
        ctx.errors.unfit(
            node, "mesh.maxh" if ctx.errors.refused is not None else node.path, what, remedy
        )


ONE_ELEMENT = 1.5
"""Length of a straight edge over the element size, below which the mesher makes it one element."""


def check_contact_nodes(
    ctx: Context, maxh: Node, plan: MeshPlan, body: Body, boundary: Boundary
) -> None:
    """Record every size at which a contact edge is one element between two corners that are held,
    so that it has no free node.

    Only where the size of elements is `maxh` all along the edge: no other edge is shorter than it,
    none is an arc, and there are no regions. Other bodies are judged on their mesh.
    """
    curved = any(edge.through is not None for edge in body.edges)
    if body.outline is None or body.regions or curved or plan.refine:
        return
    unit = " m" if ctx.units == "SI" else ""
    shortest = min(map(edge_length, body.edges)) * (1.0 - 1e-9)
    pinned = _pinned_edges(body, dict(boundary))
    for i, size in enumerate(plan.maxh):
        for edge in pinned:
            length = edge_length(edge)
            if length >= ONE_ELEMENT * size or shortest < min(size, length) * (1.0 - 1e-6):
                continue
            what = (
                f"the contact edge {edge.name} of {length:g}{unit} would be one element between "
                "corners that are held, without a free node"
            )
            remedy = (
                f"choose a smaller maxh, for example {0.5 * length:.2g}{unit}, or draw short edges "
                "that stand for a curve as arcs with through"
            )
            node = maxh.value[i] if isinstance(maxh.value, tuple) else maxh
            key = "mesh.maxh" if ctx.errors.refused is not None else node.path
            ctx.errors.unfit(node, key, what, remedy)
            break


def _pinned_edges(body: Body, roles: Mapping[str, Role]) -> list[Edge]:
    """Return the contact edges both of whose corners are held along them by the edges beside."""
    ends: dict[int, int] = {}
    edges: dict[int, Edge] = {}
    for before, after in (pair for loop in body.loops for pair in loop.corners):
        for edge, other in ((before, after), (after, before)):
            if not isinstance(roles.get(edge.name), Contact):
                continue
            normal = edge_normal(edge, np.array([before.end]))[0]
            if _holds_along(roles.get(other.name, Free()), other, before.end, normal):
                ends[id(edge)] = ends.get(id(edge), 0) + 1
                edges[id(edge)] = edge
    return [edge for key, edge in edges.items() if ends[key] == 2]


def _holds_along(role: Role, edge: Edge, at: Point, normal: Array) -> bool:
    """Return whether an edge holds its end against motion along a line with this normal."""
    if isinstance(role, Rigid):  # which moves as a whole
        return False
    directions = _components(role.frame, role.u, edge_normal(edge, np.array([at]))[0])
    along = (d_x * -normal[1] + d_y * normal[0] for d_x, d_y, _ in directions)
    return any(abs(part) > 1e-6 for part in along)


def mesh_faults(
    plan: MeshPlan, area: float, size: float, units: str
) -> Iterator[tuple[int, str, str]]:
    """(number of the size, what, remedy) of all that give no sensible number of triangles,
    area/(√3/4 h²)·4^(levels−1).

    area, size: of the body, [m²] and the diagonal [m];  units: of the study, "SI" or "none"
    """
    unit = " m" if units == "SI" else ""
    body = f"the body ({size:g}{unit})"
    # graded meshes have about as many elements as uniform ones; those with a tolerance stop at
    # max_dofs
    doubling = not plan.listed and not plan.open_ended
    refinements = plan.levels - 1 if doubling else 0
    for i, h in enumerate(plan.maxh):
        if h <= size < h * 2.0**plan.refine:
            remedy = f"give refine: {math.floor(math.log2(size / h))} or less"
            yield (
                i,
                f"the coarse mesh, of {h * 2.0**plan.refine:g}{unit}, is larger than {body}",
                remedy,
            )
        if h > size:
            remedy = f"choose maxh well below it, for example {size / 10:.2g}{unit}"
            yield i, f"an element of {h:g}{unit} is larger than {body}", remedy
        triangles = min(
            area / (math.sqrt(3.0) / 4.0) / h / h * 4.0**refinements, sys.float_info.max
        )
        if triangles > MAX_TRIANGLES:
            least = h * math.sqrt(triangles / MAX_TRIANGLES)
            larger = f"choose maxh above {least:.2g}{unit}" + (
                " or fewer levels" if refinements else ""
            )
            remedy = larger if least <= size else "give fewer levels"
            yield (
                i,
                f"about 10^{math.log10(triangles):.1f} triangles are more than a study can use",
                remedy,
            )


def check_boundary(ctx: Context, node: Node, body: Body, boundary: Boundary) -> None:
    """Record every corner at which edges contradict each other, and every symmetry edge that is an
    arc, where u_N = 0 mirrors nothing."""
    for name, what, remedy in corner_faults(body, boundary):
        ctx.at(node.nearest(name), what, remedy)
    mirrors = {name for name, role in boundary if isinstance(role, Symmetry)}
    for name in dict.fromkeys(
        edge.name for edge in body.edges if edge.through is not None and edge.name in mirrors
    ):
        remedy = "use {role: clamped, u_N: 0} for a guide"
        ctx.at(node.nearest(name), "a symmetry edge is straight, but this is an arc", remedy)


def corner_faults(body: Body, boundary: Boundary) -> Iterator[tuple[str, str, str]]:
    """(edge, what, remedy) of every corner of a polygon body at which d·u = value have no common
    solution u, or two
    edges hold different temperatures, where heat without end would flow.
    Near-parallel directions (a smooth junction) count as parallel."""
    roles = dict(boundary)
    for edge, following in (
        (pair for loop in body.loops for pair in loop.corners) if body.outline else ()
    ):
        (x, y), own, rows = edge.end, [roles.get(one.name, Free()) for one in (edge, following)], []
        for one, role in zip((edge, following), own, strict=True):
            directions = _components(role.frame, role.u, edge_normal(one, np.array([edge.end]))[0])
            rows += [(d_1, d_2, float(value_of(value, x, y))) for d_1, d_2, value in directions]
        theta = [
            float(value_of(r.heat.theta, x, y)) for r in own if r.heat and r.heat.theta is not None
        ]
        if len(theta) == 2 and abs(theta[0] - theta[1]) > 1e-9 * max(map(abs, theta)):
            what = f"{edge.name} and {following.name} hold different temperatures at their corner ({x:g}, {y:g})"
            remedy = "make them agree there, or let one of them exchange heat: {alpha: ..., theta_bar: ...}"
            yield following.name, what, remedy
        if len(rows) < 2 or not np.all(
            np.isfinite(rows)
        ):  # an expression without a value is refused elsewhere
            continue
        d, values = np.array(rows)[:, :2], np.array(rows)[:, 2]
        u = np.linalg.lstsq(d, values, rcond=1e-6)[0]
        if np.max(np.abs(d @ u - values)) > 1e-9 * np.max(np.abs(values)):
            clamped = following if isinstance(own[1], Clamped) else edge
            what = f"{edge.name} and {following.name} prescribe different displacements at their common corner"
            yield (
                clamped.name,
                f"{what} ({x:g}, {y:g})",
                "make them agree there, or free a component",
            )


EDGE_POINTS = 64


def check_finite(ctx: Context, root: Node, section: str, value: Any, body: Body) -> None:
    """Record every expression of a section with a value that is not finite at a sample point of its
    edges or the body.

    Samples cannot see every singularity between them; a load that is not finite after all is a
    failed point.
    """
    if body.outline is None:
        return
    parts = (
        value
        if section == "boundary"
        else [("f", value)]
        if section == "loads"
        else vars(value).items()
    )
    for key, part in parts:
        for expression in _in(part):
            edges = [key] if section == "boundary" else [edge.name for edge in body.edges]
            points = [_on_edges(body, name) for name in edges] + (
                [] if section == "boundary" else [inside(body)]
            )
            fault = _value_fault(expression, np.concatenate(points))
            if fault is not None:
                ctx.at(root.nearest(section, key), *fault)


def _value_fault(expression: Expression, points: Array) -> tuple[str, str] | None:
    """Return what is wrong with the values of an expression at some points, and the remedy."""
    name = f"the expression {str(expression)!r}"
    if at := _first(expression, points, -math.inf):
        remedy = "change it so that it is finite wherever it is used"
        return f"{name} has no finite value at {at}", remedy
    values = expression.evaluate(*points.T)
    largest = float(np.max(np.abs(values), initial=0.0))
    if largest <= body_faults.LARGEST:
        return None
    remedy = "check its numbers and their units"
    return f"{name} reaches {largest:.3g}, which is too large to compute with", remedy


def _first(of: Scalar, points: Array, least: float) -> str:
    """The first of some points, in words, at which a number or an expression is less than `least`
    or not finite."""
    values = value_of(of, *points.T)
    bad = points[~(np.isfinite(values) & (values >= least))]
    return f"({bad[0, 0]:g}, {bad[0, 1]:g})" if len(bad) else ""


def check_laws(
    ctx: Context, root: Node, friction: EdgeLaws, boundary: Iterable[tuple[str, Role]], body: Body
) -> None:
    """Every contact edge has a law and every law a contact edge; strengths are 0 or more at sample
    points of the edges.

    A strength that is negative between them is a failed point.
    """
    contact = [name for name, role in boundary if isinstance(role, Contact)]
    given = [edge for edge, _, _ in friction.laws if edge]
    wrong = [edge for edge in given if edge not in contact]
    for edge in wrong:
        remedy = f"the contact edges are {', '.join(contact)}"
        ctx.at(root.nearest("friction", edge), f"{edge!r} is no contact edge", remedy)
    if given and not wrong and (without := [edge for edge in contact if edge not in given]):
        remedy = f"add {without[0]}: {{law: ...}}; without friction {{law: linear, k: 0}}"
        ctx.at(root.nearest("friction"), f"the contact edge {without[0]} has no law", remedy)
    for edge, _, strength in friction.laws if body.outline is not None else ():
        for name in [edge] if edge in contact else contact if not edge else []:
            if at := _first(strength, _on_edges(body, name), 0.0):
                what, remedy = (
                    f"the strength is negative or not finite at {at}",
                    'bound it, for example "max(0, ...)"',
                )
                ctx.at(root.nearest("friction", *filter(None, (edge, "strength"))), what, remedy)


def _in(value: Any) -> Iterator[Expression]:
    if isinstance(value, Expression):
        yield value
    elif isinstance(value, tuple) or is_dataclass(value):
        for item in value if isinstance(value, tuple) else vars(value).values():
            yield from _in(item)


def _on_edges(body: Body, name: str) -> Array:
    return np.concatenate([edge_points(e, EDGE_POINTS) for e in body.edges if e.name == name])
