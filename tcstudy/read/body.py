"""Reading the section `body`, and checks of the body against other sections.

A body has an outline, a rectangle or a file, holes and named regions. The checks are: no free rigid
motions, a sensible number of elements, displacements of two edges that agree at their corner, and
expressions with finite values at sample points of where they are used.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import is_dataclass, replace
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.expression import Expression, value_of
from tcstudy.laws.composed import EdgeLaws
from tcstudy.read.document import LocatedFault, Node, split_path
from tcstudy.read.fields import Context, Fields, only_key
from tcstudy.read.step import KERNEL_UNIT, same_unit, stated_units, unit_name
from tcstudy.scene.guarantee import why_no_bound
from tcstudy.scene.keys import rows
from tcstudy.scene.mesh_plan import Goal, MeshPlan
from tcstudy.scene.path_plan import PathPlan
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
from tcstudy.shapes.rigid_motions import RigidMotions, components, has_supports

SIDES = tuple(rows("sides"))
FORMATS = {".step": "mm", ".stp": "mm", ".brep": "m"}
"""Formats of geometry files and the length unit that is usual in each."""
STEP_FORMATS = (".step", ".stp")
"""Formats whose header may state the unit."""
SHAPES = ("outline", "rectangle", "file")
EDGE_EXAMPLE = "{from: [0 mm, 0 mm], edge: NAME}"
CIRCLE_EXAMPLE = "{circle: {center: [x, y], radius: r}}"

Names = tuple[str, ...]


def read_body(ctx: Context, node: Node) -> tuple[Body | None, Names | None]:
    """Return the body, None after a fault, and the names of its edges, None if not known.

    Its shape is not checked yet (see check_shape).
    """
    fault_count = len(ctx.errors)
    fields = Fields(ctx, node, "body")
    shape_keys = [key for key in SHAPES if fields[key]]
    if len(shape_keys) != 1 and len(ctx.errors) == fault_count:
        fault = f"is given by {' and '.join(shape_keys)}" if shape_keys else "has no shape"
        ctx.at(node, fault, "give exactly one of outline, rectangle, file")
    outline: Loop | None = None
    for key in SHAPES[:2]:
        if value := fields[key]:
            outline = _loop(ctx, value, key, "block")
    brep = _file(ctx, value) if (value := fields["file"]) else None
    holes = []
    for item in ctx.items(fields["holes"], "a list of holes"):
        kind, inner = only_key(ctx, item, "hole", CIRCLE_EXAMPLE)
        holes.append(_loop(ctx, inner, kind) if kind else _unknown(""))
    if brep and (value := fields["holes"]):
        fault = "holes are cut out of an outline, not of a file's face"
        ctx.at(value, fault, "cut them in the CAD file")
    remedy = "write {NAME: {circle: {center: [x, y], radius: r}}}"
    items = ctx.mapping(fields["regions"], "names to shapes", remedy, least=0, named=True)
    if BODY in items:
        fault = f"{BODY!r} is the name of what of the body no region takes"
        ctx.at(items[BODY], fault, "give the region another name", on_key=True)
    regions = tuple(_region(ctx, item, name) for name, item in items.items())
    body = Body(outline, tuple(holes), regions, brep)
    names = edge_names(body)
    has_names = len(shape_keys) == 1 and names and "" not in names
    is_sound = len(ctx.errors) == fault_count
    return body if is_sound else None, names if has_names else None


def edge_names(body: Body) -> Names:
    """Return the names of all edges, each once, in the order of the study."""
    names = list[str]()
    if body.brep:
        names += (name for name, _ in body.brep.edges)
        names += [body.brep.other] if body.brep.other else []
    names += (edge.name for edge in body.edges)
    return tuple(dict.fromkeys(names))


_check_body = lru_cache(maxsize=4096)(body_faults.check_body)  # many geometries may share a body


def check_shape(ctx: Context, body: Body, root: Node) -> bool:
    """Record the faults of the shape of the body; return whether it is sound."""
    faults = _check_body(body)
    node = root.at("body")
    written = _written_unit(ctx, [node] if faults and node else [])
    for fault in faults:
        place = root.nearest(*(split_path(fault.where) or ("body",)))
        problem = body_faults.spots_in(fault.what, *written)
        remedy = body_faults.spots_in(fault.remedy, *written)
        ctx.errors.unfit(place, fault.where, problem, remedy)
    return not faults


def _loop(ctx: Context, node: Node, kind: str, section: str = "", edge: str | None = None) -> Loop:
    """Return a loop of edges: outline, rectangle, circle or polygon.

    section: of the keys of the shape, if it is not named as the shape
    edge:    name of all edges, as in a region; None if the shape gives the names
    """
    if kind == "outline":
        return _outline(ctx, node)
    if kind == "polygon":
        points = ctx.value(node, rows("region")[kind])
        return body_faults.turned(shapes.polygon_loop(points, edge or ""))
    if section == "block" and kind == "rectangle":
        fields = Fields(ctx, node, section)
        sides = Fields(ctx, value, "sides").given() if (value := fields["edges"]) else {}
        names = tuple(sides.get(side, side) for side in SIDES)
    else:
        required = [key for key in rows(kind) if edge is None or key != "edge"]
        fields = Fields(ctx, node, kind, required, ())
        names = (str(fields.value("edge")) if edge is None else edge,) * 4
    if kind == "circle":
        center, radius = fields.value("center"), fields.value("radius")
        return shapes.circle_loop(center, radius, names[0]) if radius > 0.0 else _unknown(names[0])
    corner, width, height = map(fields.value, ("corner", "width", "height"))
    if width > 0.0 and height > 0.0:
        return shapes.rectangle_loop(corner, width, height, names)
    return _unknown(*names)


def _outline(ctx: Context, node: Node) -> Loop:
    items = ctx.items(node, "a list of edges", 2, EDGE_EXAMPLE)
    edge_fields = [Fields(ctx, item, "outline") for item in items]
    starts = [fields.value("from") for fields in edge_fields]
    names = [fields.value("edge") for fields in edge_fields]
    middles = [fields.value("through") for fields in edge_fields]
    if len(starts) == 2 and middles == [None, None]:
        remedy = "give a third edge, or an arc by `through: [x, y]`"
        ctx.at(node, "two straight edges enclose nothing", remedy)
    edges = map(Edge, starts, [*starts[1:], *starts[:1]], names, middles)
    return body_faults.turned(Loop(tuple(edges)))


def _unknown(*names: str) -> Loop:
    """Return a stand-in for a loop that could not be read, with the names of its edges."""
    nowhere = (math.nan, math.nan)
    return Loop(tuple(Edge(nowhere, nowhere, name) for name in names))


def _region(ctx: Context, node: Node, name: str) -> Region:
    kind, inner = only_key(ctx, node, "region", CIRCLE_EXAMPLE)
    return Region(name, _loop(ctx, inner, kind, edge=name) if kind else Loop(()))


def _file(ctx: Context, node: Node) -> BrepFace:
    fields = Fields(ctx, node, "file")
    path = fields.value("path")
    target = ctx.folder / path
    suffix = "." + path.rpartition(".")[2].lower()
    if path and suffix not in FORMATS:
        fault = f"{path!r} is not a geometry file"
        fields.fault("path", fault, f"give a file ending in {', '.join(FORMATS)}")
    # os.path.isfile also refuses names that the system refuses
    elif path and ctx.with_files and not os.path.isfile(target):
        remedy = "give its path relative to the folder of the study"
        fields.fault("path", f"there is no file {path!r}", remedy)
    scale = _scale(ctx, fields, target, suffix)
    remedy = "write {NAME: [[x, y], ...]}: the edge nearest to each point gets the name"
    items = ctx.mapping(fields["edges"], "names to points", remedy, least=0, named=True)
    edges = tuple((name, _points_on_edge(ctx, item)) for name, item in items.items())
    face, other_edges = fields.value("face"), fields.value("other")
    written = _written_unit(ctx, items.values())
    return BrepFace(target, face, scale, edges, other_edges, written=written)


def _points_on_edge(ctx: Context, item: Node) -> tuple[Point, ...]:
    """Return the points by which an edge of a file gets its name."""
    coordinates = item.value if isinstance(item.value, tuple) else ()
    if coordinates and not any(isinstance(part.value, tuple) for part in coordinates):
        ctx.at(item, "is one point, but must be a list of points", f"write [{item.brief()}]")
        return ()
    points: tuple[Point, ...] = ctx.value(item, replace(rows("file")["edges"], kind="points"))
    return points


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
    if unit and not all(same_unit(metres, length) for length in stated):
        names = " and ".join(map(unit_name, stated))
        fault = f"is {unit}, but the header of {path.name} says {names}"
        fields.fault("unit", fault, "remove unit: the lengths are converted by the header")
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
    for coordinate in chain.from_iterable(map(_leaves, points)):
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
"""Number of triangles above which maxh or levels is taken for a typing error."""


def supports_fault(
    motions: RigidMotions | None, boundary: Boundary, *, has_friction: bool
) -> tuple[str, str] | None:
    """Return the fault of the supports and its remedy; None if something resists every motion.

    motions:      those that neither supports nor friction resist, None of a body from a file
    has_friction: whether a contact edge has friction
    """
    if not motions or not has_supports(boundary):
        return None
    fault = "no edge is clamped and contact does not restrain rigid-body motion"
    if any(isinstance(role, Clamped) for _, role in boundary):
        fault = "the supports do not restrain rigid-body motion"
    remedy = "give an edge the role clamped, or prescribe the missing component"
    if not has_friction and any(isinstance(role, Contact) for _, role in boundary):
        remedy = f"{remedy}, or give the contact a friction law that resists it"
    return f"{fault}: it can still {motions.words}", remedy


def loose_faults(
    motions: RigidMotions | None, mesh: MeshPlan, path: PathPlan | None, is_live: bool = False
) -> Iterator[LocatedFault]:
    """Yield a fault for everything that needs λ₁ > 0, where contact alone restrains the body.

    motions: those that the supports leave, None of a body from a file
    is_live: whether a page is to solve points by itself
    """
    if not motions:
        return
    reason = f"contact alone restrains the body, which can {motions.words}, so that lambda_1 is 0"
    remedy = "leave it out, or restrain the body by supports or springs"
    if mesh.goal.proved:
        yield ("mesh", "of"), f"no bound is proved: {reason}", remedy
    elif mesh.guarantee in ("bounds", "polygon"):
        yield ("mesh", "guarantee"), f"the continuous problem has no certificate: {reason}", remedy
    if path is not None and path.complete:
        yield ("path", "complete"), f"branches cannot be proved to be all: {reason}", remedy
    if is_live:
        yield ("output", "live"), f"a live page knows supports and springs alone: {reason}", remedy


def check_goal(ctx: Context, node: Node, goal: Goal, body: Body, scenes: Sequence[Scene]) -> None:
    """Record a bound that cannot be proved, and a point of u_T that is on no contact edge.

    The point on a body from a file is checked on its mesh.
    """
    if goal.proved:
        reason = next(filter(None, map(why_no_bound, scenes)), "")
        if reason:
            ctx.at(node, f"no bound is proved of this study: {reason}")
    if goal.at is None or body.outline is None:
        return
    contact = [name for name, role in scenes[0].boundary if isinstance(role, Contact)]
    edges = [edge for edge in body.edges if edge.name in contact]
    distances = [float(edge_distance(edge, np.array([goal.at]))[0]) for edge in edges]
    distance = min(distances, default=math.inf)
    if distance > 1e-6 * body_size(body):
        x, y = goal.at
        fault = f"the point ({x:g}, {y:g}) is not on a contact edge"
        remedy = "give an edge the role contact"
        if edges:
            fault = f"{fault}, but {distance:g} away"
        if contact:
            remedy = f"give a point on {' or '.join(contact)}"
        ctx.at(node.at("u_T") or node, fault, remedy)


def check_mesh(ctx: Context, maxh: Node, plan: MeshPlan, body: Body) -> None:
    """Refuse element sizes that do not fit the body.

    The sizes on a body from a file are checked when the file is read.
    """
    if body.outline is None:
        return
    for i, fault, remedy in mesh_faults(plan, body_area(body), body_size(body), ctx.units):
        _refuse_size(ctx, maxh, i, fault, remedy)


def _refuse_size(ctx: Context, maxh: Node, number: int, fault: str, remedy: str) -> None:
    """Record that the element size of this number does not fit the body."""
    node = maxh.value[number] if isinstance(maxh.value, tuple) else maxh
    key = "mesh.maxh" if ctx.errors.refused is not None else node.path
    ctx.errors.unfit(node, key, fault, remedy)


ONE_ELEMENT = 1.5
"""Length of a straight edge over the element size, below which the mesher makes it one element."""


def check_contact_nodes(
    ctx: Context, maxh: Node, plan: MeshPlan, body: Body, boundary: Boundary
) -> None:
    """Record every size at which a contact edge is one element between two held corners.

    Such an edge has no free node. Only bodies are checked on which elements have the size `maxh`
    all along the edge: no other edge is shorter than it, none is an arc, and there are no regions.
    Other bodies are checked on their mesh.
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
            fault = (
                f"the contact edge {edge.name} of {length:g}{unit} would be one element between "
                "constrained corners, without a free node"
            )
            remedy = (
                f"choose a smaller maxh, for example {0.5 * length:.2g}{unit}, or draw short edges "
                "that stand for a curve as arcs with through"
            )
            _refuse_size(ctx, maxh, i, fault, remedy)
            break


def _pinned_edges(body: Body, roles: Mapping[str, Role]) -> list[Edge]:
    """Return the contact edges whose corners are both held along them by the adjacent edges."""
    held_ends: dict[int, int] = {}
    edges: dict[int, Edge] = {}
    for before, after in (pair for loop in body.loops for pair in loop.corners):
        for edge, adjacent in ((before, after), (after, before)):
            if not isinstance(roles.get(edge.name), Contact):
                continue
            normal = edge_normal(edge, np.array([before.end]))[0]
            if _holds_along(roles.get(adjacent.name, Free()), adjacent, before.end, normal):
                held_ends[id(edge)] = held_ends.get(id(edge), 0) + 1
                edges[id(edge)] = edge
    return [edge for key, edge in edges.items() if held_ends[key] == 2]


def _holds_along(role: Role, edge: Edge, corner: Point, normal: Array) -> bool:
    """Return whether an edge holds its corner against motion along a line with this normal."""
    if isinstance(role, Rigid):  # a rigid edge moves as a whole
        return False
    directions = components(role.frame, role.u, edge_normal(edge, np.array([corner]))[0])
    along = (d_x * -normal[1] + d_y * normal[0] for d_x, d_y, _ in directions)
    return any(abs(part) > 1e-6 for part in along)


def mesh_faults(
    plan: MeshPlan, area: float, size: float, units: str
) -> Iterator[tuple[int, str, str]]:
    """Yield (number of the size, fault, remedy) of element sizes that do not fit a body.

    The number of triangles is estimated as area/(√3/4 h²)·4^(levels−1).
    area, size: of the body, [m²] and the diagonal [m];  units: of the study, "SI" or "none"
    """
    unit = " m" if units == "SI" else ""
    body = f"the body ({size:g}{unit})"
    # graded meshes have about as many elements as uniform ones; those with a tolerance stop at
    # max_dofs
    doubling = not plan.listed and not plan.open_ended
    refinements = plan.levels - 1 if doubling else 0
    for i, h in enumerate(plan.maxh):
        coarse = h * 2.0**plan.refine
        if h <= size < coarse:
            remedy = f"give refine: {math.floor(math.log2(size / h))} or less"
            yield i, f"the coarse mesh, of {coarse:g}{unit}, is larger than {body}", remedy
        if h > size:
            remedy = f"choose maxh well below it, for example {size / 10:.2g}{unit}"
            yield i, f"an element of {h:g}{unit} is larger than {body}", remedy
        triangles = area / (math.sqrt(3.0) / 4.0) / h / h * 4.0**refinements
        triangles = min(triangles, sys.float_info.max)
        if triangles > MAX_TRIANGLES:
            min_h = h * math.sqrt(triangles / MAX_TRIANGLES)
            fault = f"about 10^{math.log10(triangles):.1f} triangles are more than a study can use"
            remedy = "give fewer levels"
            if min_h <= size:
                fewer = " or fewer levels" if refinements else ""
                remedy = f"choose maxh above {min_h:.2g}{unit}{fewer}"
            yield i, fault, remedy


def check_boundary(ctx: Context, node: Node, body: Body, boundary: Boundary) -> None:
    """Record every corner at which edges contradict each other, and every symmetry edge on an arc.

    On an arc u_N = 0 mirrors nothing.
    """
    for name, fault, remedy in corner_faults(body, boundary):
        ctx.at(node.nearest(name), fault, remedy)
    mirrors = {name for name, role in boundary if isinstance(role, Symmetry)}
    arcs = [edge.name for edge in body.edges if edge.through is not None]
    for name in dict.fromkeys(arcs):
        if name in mirrors:
            remedy = "use {role: clamped, u_N: 0} for a guide"
            ctx.at(node.nearest(name), "a symmetry edge is straight, but this is an arc", remedy)


def corner_faults(body: Body, boundary: Boundary) -> Iterator[tuple[str, str, str]]:
    """Yield (edge, fault, remedy) of every corner of a body at which two edges contradict.

    Their temperatures may differ, where heat without end would flow, or their displacements:
    d·u = value have no common solution u. Near-parallel directions (a smooth junction) count as
    parallel. A body from a file has no corners here.
    """
    roles = dict(boundary)
    if body.outline is None:
        return
    for edges in (pair for loop in body.loops for pair in loop.corners):
        corner_roles = (roles.get(edges[0].name, Free()), roles.get(edges[1].name, Free()))
        if fault := _temperature_fault(edges, corner_roles):
            yield fault
        if fault := _displacement_fault(edges, corner_roles):
            yield fault


def _temperature_fault(
    edges: tuple[Edge, Edge], roles: tuple[Role, Role]
) -> tuple[str, str, str] | None:
    """Return (edge, fault, remedy) if edges prescribe different temperatures at a corner."""
    x, y = edges[0].end
    temperatures = list[float]()
    for role in roles:
        if role.heat and role.heat.theta is not None:
            temperatures.append(float(value_of(role.heat.theta, x, y)))
    if len(temperatures) < 2:
        return None
    difference = abs(temperatures[0] - temperatures[1])
    if not difference > 1e-9 * max(map(abs, temperatures)):
        return None
    names = f"{edges[0].name} and {edges[1].name}"
    fault = f"{names} prescribe different temperatures at their corner ({x:g}, {y:g})"
    convection = "{alpha: ..., theta_bar: ...}"
    remedy = f"make them agree there, or let one of them exchange heat: {convection}"
    return edges[1].name, fault, remedy


def _displacement_fault(
    edges: tuple[Edge, Edge], roles: tuple[Role, Role]
) -> tuple[str, str, str] | None:
    """Return (edge, fault, remedy) if the edges prescribe different displacements of a corner."""
    corner = edges[0].end
    rows = list[tuple[float, float, float]]()
    for edge, role in zip(edges, roles, strict=True):
        normal = edge_normal(edge, np.array([corner]))[0]
        for d_1, d_2, value in components(role.frame, role.u, normal):
            rows.append((d_1, d_2, float(value_of(value, *corner))))
    # an expression without a value is refused elsewhere
    if len(rows) < 2 or not np.all(np.isfinite(rows)):
        return None
    d, values = np.array(rows)[:, :2], np.array(rows)[:, 2]
    u = np.linalg.lstsq(d, values, rcond=1e-6)[0]
    if not np.max(np.abs(d @ u - values)) > 1e-9 * np.max(np.abs(values)):
        return None
    clamped = edges[1] if isinstance(roles[1], Clamped) else edges[0]
    names = f"{edges[0].name} and {edges[1].name}"
    place = f"their common corner ({corner[0]:g}, {corner[1]:g})"
    fault = f"{names} prescribe different displacements at {place}"
    return clamped.name, fault, "make them agree there, or free a component"


EDGE_POINTS = 64


def check_finite(ctx: Context, root: Node, section: str, value: Any, body: Body) -> None:
    """Record every expression of a section that is not finite at a sample point.

    Sample points are on the edge of a role, or on all edges and in the body. A singularity between
    them is not seen. A load that is not finite after all fails its point.
    """
    if body.outline is None:
        return
    parts: Iterable[tuple[str, Any]] = vars(value).items() if is_dataclass(value) else value
    if section == "loads":
        parts = [("f", value)]
    for key, part in parts:
        for expression in _expressions(part):
            if section == "boundary":
                points = _on_edges(body, key)
            else:
                on_edges = [_on_edges(body, edge.name) for edge in body.edges]
                points = np.concatenate([*on_edges, inside(body)])
            fault = _value_fault(expression, points)
            if fault is not None:
                ctx.at(root.nearest(section, key), *fault)


def _value_fault(expression: Expression, points: Array) -> tuple[str, str] | None:
    """Return the fault of the values of an expression at some points, and the remedy."""
    name = f"the expression {str(expression)!r}"
    if place := _first_below(expression, points, -math.inf):
        remedy = "change it so that it is finite wherever it is used"
        return f"{name} has no finite value at {place}", remedy
    values = expression.evaluate(*points.T)
    largest = float(np.max(np.abs(values), initial=0.0))
    if largest <= body_faults.LARGEST:
        return None
    remedy = "check its numbers and their units"
    return f"{name} reaches {largest:.3g}, which is too large to compute with", remedy


def _first_below(scalar: Scalar, points: Array, least: float) -> str:
    """Return the first point, in words, at which a scalar is below `least` or not finite."""
    values = value_of(scalar, *points.T)
    bad = points[~(np.isfinite(values) & (values >= least))]
    return f"({bad[0, 0]:g}, {bad[0, 1]:g})" if len(bad) else ""


def check_laws(
    ctx: Context,
    root: Node,
    section: str,
    laws: EdgeLaws,
    boundary: Iterable[tuple[str, Role]],
    body: Body,
) -> None:
    """Record contact edges without a law, laws of other edges, and negative strengths.

    Strengths are checked at sample points of the edges. A strength that is negative between them
    fails its point. Without a law of its own an edge does not adhere.
    """
    contact = [name for name, role in boundary if isinstance(role, Contact)]
    edges_with_law = [edge for edge, _, _ in laws.laws if edge]
    misplaced = [edge for edge in edges_with_law if edge not in contact]
    for edge in misplaced:
        remedy = f"the contact edges are {', '.join(contact)}"
        ctx.at(root.nearest(section, edge), f"{edge!r} is no contact edge", remedy)
    without_law = [edge for edge in contact if edge not in edges_with_law]
    if section == "friction" and edges_with_law and without_law and not misplaced:
        edge = without_law[0]
        remedy = f"add {edge}: {{law: ...}}; without friction {{law: linear, k: 0}}"
        ctx.at(root.nearest(section), f"the contact edge {edge} has no law", remedy)
    if body.outline is None:
        return
    for edge, _, strength in laws.laws:
        path = (section, edge, "strength") if edge else (section, "strength")
        for name in contact:
            if edge not in ("", name):
                continue
            if place := _first_below(strength, _on_edges(body, name), 0.0):
                fault = f"the strength is negative or not finite at {place}"
                ctx.at(root.nearest(*path), fault, 'bound it, for example "max(0, ...)"')


def _expressions(value: Any) -> Iterator[Expression]:
    """Yield the expressions in a value, in tuples and records within each other."""
    if isinstance(value, Expression):
        yield value
    elif isinstance(value, tuple) or is_dataclass(value):
        for item in value if isinstance(value, tuple) else vars(value).values():
            yield from _expressions(item)


def _on_edges(body: Body, name: str) -> Array:
    """Return sample points on the edges of a name."""
    return np.concatenate([edge_points(e, EDGE_POINTS) for e in body.edges if e.name == name])
