"""Contents of one picture, read from a result file: arrays in the units of the file, and the study.

Every result file has the text of its study. Where it can be read again, pictures and pages can say
what an edge does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from tcstudy.data.bodies import StoredBody
from tcstudy.data.reading import open_root, sweep_dims, unmasked
from tcstudy.data.schema import JOINTS, STICKS
from tcstudy.laws.composed import NO_JOINTS, EdgeLaws, Joints, law_along
from tcstudy.laws.laws import Laws
from tcstudy.reports.rounding import SHARE, Floors, floors, stored_study
from tcstudy.reports.select_point import (
    Value,
    axis_symbols,
    check_solved,
    describe,
    level_number,
    locate,
    of_largest_slip,
)
from tcstudy.scene.contact_states import ContactState, NormalState, node_states, normal_states
from tcstudy.scene.records import Clamped, Edge, Free, Material, Role, Scene
from tcstudy.scene.study import Study
from tcstudy.shapes.edges import edge_points

Array = NDArray[np.float64]

NEAR = 1e-6
"""Relative difference up to which two lengths are equal."""


@dataclass(frozen=True)
class LineFields:
    """The contact line at one point of the sweep, m nodes in order.

    arclength, x, y, c: position, coordinates and segment lengths c_i [length_units]
    edge:   (m,) index into edge_names;  joints: the nodes where one of them ends and another begins
    u_T:    (m,) tangential displacement [length_units]
    xi:     (m,) traction ξ = −S_T [traction_units]
    sticks: (m,) nodes that stick on an up-jump of the law
    section: (m,) force of the section at every node, and its units, if it was requested
    """

    arclength: Array
    x: Array
    y: Array
    c: Array
    edge: NDArray[np.intp]
    edge_names: tuple[str, ...]
    u_T: Array
    xi: Array
    sticks: NDArray[np.bool_]
    length_units: str
    traction_units: str
    joints: Joints = NO_JOINTS
    section: tuple[Array, str] | None = None

    @property
    def parts(self) -> list[slice]:
        """Ranges of nodes along which the line goes straight on.

        Between two of them there is a gap or a corner without unknown: the nodes are then closer to
        each other than their arclengths say, or farther apart.
        """
        chord = np.hypot(np.diff(self.x), np.diff(self.y))
        step = np.diff(self.arclength)
        cuts = np.flatnonzero(np.abs(chord - step) > NEAR * step) + 1
        ends = [0, *cuts.tolist(), len(self.arclength)]
        return [slice(a, b) for a, b in pairwise(ends)]

    @property
    def along_x(self) -> tuple[float, float] | None:
        """(sign, x at s = 0) of a line that is straight along x, where x = x_0 ± s.

        None for any other line.
        """
        if len(self.arclength) < 2:
            return None
        room = NEAR * float(self.c.sum())
        sign = 1.0 if self.x[-1] > self.x[0] else -1.0
        start = self.x - sign * self.arclength
        is_straight = max(np.ptp(self.y), np.ptp(start)) <= room
        return (sign, float(start[0])) if is_straight else None

    def beyond(self, part: slice) -> tuple[float, float]:
        """Return the length of the segments of the outermost nodes of a part beyond them.

        0 at a free end, a whole element beside a constrained node [length_units].
        """
        s, c = self.arclength[part], self.c[part]
        if len(s) == 1:
            return 0.5 * float(c[0]), 0.5 * float(c[0])
        half_first = 0.5 * (s[1] - s[0])
        half_last = 0.5 * (s[-1] - s[-2])
        return float(c[0] - half_first), float(c[-1] - half_last)

    def cells(self, part: slice) -> Array:
        """Return (n + 1,) ends of the segments S_i around the n nodes of a part [length_units]."""
        s, (at_start, at_end) = self.arclength[part], self.beyond(part)
        middles = 0.5 * (s[1:] + s[:-1])
        return np.concatenate([[s[0] - at_start], middles, [s[-1] + at_end]])

    def held(self, part: slice) -> tuple[bool, bool]:
        """Return whether a part begins and ends at a constrained node, which is no unknown."""
        if self.closed(part) or part.stop - part.start == 1:
            return False, False
        room = NEAR * float(self.c[part].sum())
        at_start, at_end = self.beyond(part)
        return abs(at_start) > room, abs(at_end) > room

    def closed(self, part: slice) -> bool:
        """Return whether the part is a ring.

        The segment of its first node then reaches back to the last one, in a chord.
        """
        at_start, at_end = self.beyond(part)
        ends = np.array([[self.x[i], self.y[i]] for i in (part.start, part.stop - 1)])
        chord = float(np.hypot(*(ends[1] - ends[0])))
        length = float(np.ptp(self.arclength[part]))
        if part.stop - part.start <= 2 or chord >= (1.0 - NEAR) * length:
            return False
        missing = abs(chord - at_start - at_end)
        return max(missing, abs(at_start - at_end)) <= NEAR * chord

    def steps(self, part: slice) -> tuple[Array, NDArray[np.intp]]:
        """Return ends of intervals along the part, and the contact node of each interval.

        They are the segments S_i; in a ring the first one comes in two halves, at the start and at
        the end.
        """
        nodes, cells = np.arange(part.start, part.stop), self.cells(part)
        if not self.closed(part):
            return cells, nodes
        start = self.arclength[part.start]
        end = start + self.c[part].sum()
        return np.concatenate([[start], cells[1:], [end]]), np.append(nodes, part.start)


@dataclass(frozen=True)
class Openings:
    """The nodes of contact edges that may open, at one point of the sweep.

    line:   their places, with the opening in place of u_T and S_N in place of ξ
    states: (k,) NormalState of each
    """

    line: LineFields
    states: NDArray[np.int8]

    @property
    def s_N(self) -> Array:
        """(k,) openings, the distance from the foundation [length_units]."""
        return self.line.u_T

    @property
    def S_N(self) -> Array:
        """(k,) normal stresses, positive in tension [traction_units]."""
        return self.line.xi


@dataclass(frozen=True)
class BodyFields:
    """The whole body: a mesh of n nodes and t triangles, displacement, temperature.

    xy, u:  (n, 2) coordinates and displacement [length units]
    theta:  (n,) temperature, None if the file has none
    region: (t,) index of the material of a triangle, 0 for that of the body
    """

    xy: Array
    triangles: NDArray[np.intp]
    u: Array
    theta: Array | None
    theta_units: str
    region: NDArray[np.int8]


ARC_POINTS = 24
"""Points of a drawn arc."""
MAX_DISTANCE = 0.3
"""Distance of a side of the mesh from its edge, which may bend, in lengths of the side."""


@dataclass(frozen=True)
class NamedEdge:
    """An edge of the body.

    role:   in a word
    loop:   that it belongs to, 0 for the outline
    line:   (n, 2) points
    loaded: whether a traction acts on it
    """

    name: str
    role: str
    loop: int
    line: Array
    loaded: bool = False


@dataclass(frozen=True)
class Picture:
    """One solved point of a sweep on one level.

    values:  the numbers of the point, a dataset
    point:   its labels in words
    edges:   those of the body with their roles, of contact alone where the study has no outline
    sources: outlines (n, 2) of heated regions [length units]
    held:    (parts, 2) u_T at both ends of every part of the line, NaN where it is not prescribed
             or not in the file
    scene:   of the point, None if the study in the file cannot be read
    symbols: of the parameters of the point, by name
    openings: of edges that may open, None without any
    """

    values: Any
    point: str
    level: int
    line: LineFields
    body: BodyFields | None
    edges: tuple[NamedEdge, ...] = ()
    sources: tuple[Array, ...] = ()
    held: Any = ()
    scene: Scene | None = None
    symbols: Mapping[str, str] = field(default_factory=dict)
    openings: Openings | None = None

    @property
    def title(self) -> str:
        """The title of the study."""
        return str(self.values.attrs["title"])

    @property
    def words(self) -> str:
        """The point and its level in words."""
        return f"{self.point or self.title}, level {self.level}"


def read_picture(path: Path, point: Mapping[str, Value] | None = None, level: int = -1) -> Picture:
    """Return the contents of a picture of one point, by default that of the largest slip.

    Raises StoreError if `path` is not a complete result file, DrawError if it does not have the
    point or the point was not solved.
    """
    with open_root(path) as root:
        where = locate(root, point) if point else of_largest_slip(root)
        number = level_number(root, level)
        check_solved(root, where, number)
        place, words = _place(root, where), describe(root, where)
        symbols = axis_symbols(root)
        point_alone = root.isel({dim: [index] for dim, index in where.items()}).load()
    with unmasked(path) as nc:
        body, point_of_body = StoredBody.at(nc, place)
        study = stored_study(body.about)
        group = body.dataset(number, body.cut(point_of_body))
    scene = None if study is None else study.scenes[point_of_body]
    study_alone = None if study is None or scene is None else replace(study, scenes=(scene,))
    sizes = floors(point_alone, study_alone)
    line = contact_line(group)
    return Picture(
        values=point_alone.isel(dict.fromkeys(where, 0)).isel(level=number),
        point=words,
        level=number,
        line=_without_rounding(line, sizes, number),
        body=body_fields(group, lambda theta: sizes.cleared("theta", theta, number, 0)),
        edges=tuple(named_edges(study, group) or contact_edges(line, group)),
        sources=tuple(sources(study)),
        held=_held_slips(line, group),
        scene=scene,
        symbols=symbols,
        openings=_openings(scene, group, sizes, number),
    )


def _openings(scene: Scene | None, group: Any, sizes: Floors, level: int) -> Openings | None:
    """Return the openings of one point with 0 in place of rounding, None without any."""
    if "opening" not in group:
        return None
    line = opening_line(group)
    line = replace(
        line,
        u_T=sizes.cleared("opening", line.u_T, level, 0),
        xi=sizes.cleared("S_N", line.xi, level, 0),
    )
    return Openings(line, opening_states(scene, group, line.u_T, line.sticks))


def _held_slips(line: LineFields, group: Any) -> Array:
    """Return u_T at both ends of every part of a line; NaN where no constrained node is."""
    held_u_T: Any = group["held_u_T"].values if "held_u_T" in group else []
    return np.append(held_u_T, np.nan)[ends_held(line, group)]


def _without_rounding(line: LineFields, sizes: Floors, level: int) -> LineFields:
    """Return the contact line of one point with 0 in place of rounding, whose sizes these are."""
    section = line.section
    if section:
        force, units = section
        section = sizes.cleared("section_force", force, level, 0), units
    return replace(
        line,
        u_T=sizes.cleared("u_T", line.u_T, level, 0),
        xi=sizes.cleared("xi", line.xi, level, 0),
        section=section,
    )


def _place(root: Any, where: Mapping[str, int]) -> int:
    """Return the number of a point in the sweep, from its index along each dimension."""
    dims = sweep_dims(root)
    if not dims:
        return 0
    index, sizes = [where[dim] for dim in dims], [root.sizes[dim] for dim in dims]
    return int(np.ravel_multi_index(index, sizes))


def ends_held(line: LineFields, group: Any) -> list[tuple[int, int]]:
    """Return which stored constrained end (data.schema.HELD) each end of every part is.

    −1 for an end that is none of them.
    """
    if "held_arclength" not in group:
        return [(-1, -1)] * len(line.parts)
    stored = group["held_arclength"].values
    room = NEAR * float(line.c.sum())
    ends = list[tuple[int, int]]()
    for part in line.parts:
        cells, (is_first_held, is_last_held) = line.cells(part), line.held(part)
        at_start = np.flatnonzero(np.abs(stored - cells[0]) <= room)
        at_end = np.flatnonzero(np.abs(stored - cells[-1]) <= room)
        # where two parts meet in one held corner, the end of the one is stored before the start of
        # the other
        start = int(at_start[-1]) if is_first_held and len(at_start) else -1
        end = int(at_end[0]) if is_last_held and len(at_end) else -1
        ends.append((start, end))
    return ends


def contact_line(group: Any) -> LineFields:
    """Return the contact line of a level or a path, with slip and traction of all its points."""
    section = None
    N = group.get("section_force")
    if N is not None and not np.isnan(N.values).any():
        section = N.values, str(N.attrs["units"])
    sticks = np.zeros(0, dtype=bool)
    if "sticks" in group:
        sticks = group["sticks"].values == STICKS
    fields = {name: group[name].values for name in ("arclength", "x", "y", "c", "u_T", "xi")}
    return LineFields(
        **fields,
        edge=group["edge"].values.astype(np.intp),
        edge_names=_edge_names(group),
        sticks=sticks,
        length_units=str(group["u_T"].attrs["units"]),
        traction_units=str(group["xi"].attrs["units"]),
        joints=joints_of(group),
        section=section,
    )


def opening_line(group: Any) -> LineFields:
    """Return the nodes of a level that may open, with openings as u_T and S_N as ξ."""
    arclength, x, y = (group[f"opening_{name}"].values for name in ("arclength", "x", "y"))
    rests = np.zeros(0, dtype=bool)
    if "rests_N" in group:
        rests = group["rests_N"].values == STICKS
    return LineFields(
        arclength=arclength,
        x=x,
        y=y,
        c=group["c_N"].values,
        edge=group["opening_edge"].values.astype(np.intp),
        edge_names=_edge_names(group),
        u_T=group["opening"].values,
        xi=group["S_N"].values,
        sticks=rests,
        length_units=str(group["opening"].attrs["units"]),
        traction_units=str(group["S_N"].attrs["units"]),
        joints=_joints_of_openings(group),
    )


def _joints_of_openings(group: Any) -> Joints:
    """Return the joints of contact edges by their number among the nodes that may open."""
    joints = joints_of(group)
    at_joints = group["arclength"].values[np.asarray(joints.node, dtype=np.intp)]
    arclength = group["opening_arclength"].values
    is_opening = np.isin(at_joints, arclength)
    is_opening &= np.isin(joints.edge, group["opening_edge"].values)  # else the other one is held
    if not is_opening.any():
        return NO_JOINTS
    nodes = np.searchsorted(arclength, at_joints[is_opening])
    return Joints(nodes, *(np.asarray(part)[is_opening] for part in joints[1:]))


def opening_states(
    scene: Scene | None, group: Any, s_N: Array, rests: NDArray[np.bool_]
) -> NDArray[np.int8]:
    """Return (…, k) NormalState of the nodes of a level that may open.

    Without the laws of the study a node is closed where it rests, and open elsewhere.
    """
    if scene is None:
        return np.where(rests, NormalState.CLOSED, NormalState.OPEN).astype(np.int8)
    names = _edge_names(group)
    xy = np.stack([group["opening_x"].values, group["opening_y"].values], axis=1)
    edge, joints = group["opening_edge"].values, _joints_of_openings(group)
    law = law_along(scene.opening_laws, names, edge, xy, joints)
    return normal_states(law, s_N, rests)


def _edge_names(group: Any) -> tuple[str, ...]:
    return tuple(str(group["edge"].attrs.get("flag_meanings", "")).split())


def body_fields(
    group: Any, cleared_theta: Callable[[Array], Array] = lambda theta: theta
) -> BodyFields | None:
    """Return the fields of the whole body, None if the file has none for this point.

    cleared_theta: puts 0 in place of the rounding of temperatures
    """
    if not {"node_x", "triangle", "u_x", "u_y"} <= set(group.variables):
        return None
    u = np.column_stack([group["u_x"].values, group["u_y"].values])
    if not np.isfinite(u).all():
        return None
    triangles, theta = group["triangle"].values.astype(np.intp), group.get("theta")
    has_theta = theta is not None and np.isfinite(theta.values).all()
    region = np.zeros(len(triangles), dtype=np.int8)
    return BodyFields(
        xy=np.column_stack([group["node_x"].values, group["node_y"].values]),
        triangles=triangles,
        u=u,
        theta=cleared_theta(theta.values) if has_theta else None,
        theta_units=str(theta.attrs["units"]) if theta is not None else "1",
        region=group["region"].values if "region" in group else region,
    )


def edge_laws(friction: Laws | EdgeLaws) -> tuple[tuple[str, Laws, Any], ...]:
    """Return (edge, law, strength) of each edge; edge is "" where all have the same friction."""
    return friction.laws if isinstance(friction, EdgeLaws) else (("", friction, 1.0),)


def law_of_nodes(friction: Laws | EdgeLaws, group: Any) -> Laws:
    """Return the law of the contact line of a stored level, or of its nodes."""
    xy = np.stack([group["x"].values, group["y"].values], axis=1)
    return law_along(friction, _edge_names(group), group["edge"].values, xy, joints_of(group))


def states_of(
    friction: Laws | EdgeLaws | None, group: Any, u_T: Array, sticks: Any
) -> NDArray[np.int8]:
    """Return (…, m) ContactState of the nodes of a stored level; without a law, stick and slip."""
    if friction is None:
        return np.where(sticks, ContactState.STICK, ContactState.SLIP).astype(np.int8)
    return np.asarray(node_states(law_of_nodes(friction, group), u_T, sticks))


def joints_of(group: Any) -> Joints:
    """Return the nodes shared by two contact edges."""
    if "joint_node" not in group:
        return NO_JOINTS
    return Joints(*(group[variable.name].values for variable in JOINTS))


def at_rest(study: Study | None) -> bool:
    """Return whether all prescribed displacements are 0, so that constrained ends do not slip."""
    if study is None:
        return False
    for scene in study.scenes:
        for _, role in scene.boundary:
            if isinstance(role, Clamped) and any(u not in (None, 0.0) for u in role.u):
                return False
    return True


def outline(study: Study | None) -> list[NamedEdge]:
    """Return the edges with their roles; empty without an outline (a body from a file)."""
    if study is None or study.scenes[0].body.outline is None:
        return []
    scene = study.scenes[0]
    roles = dict(scene.boundary)
    edges = list[NamedEdge]()
    for number, loop in enumerate((scene.body.outline, *scene.body.holes)):
        for edge in loop.edges if loop is not None else ():
            role = roles.get(edge.name, Free())
            line = _polyline(edge)
            edges.append(NamedEdge(edge.name, role.word, number, line, is_loaded(role)))
    return edges


def named_edges(study: Study | None, group: Any) -> list[NamedEdge]:
    """Return the edges of the body with their roles: those of its outline in the study, or those
    of a body from a CAD file as a level of the result file has them."""
    return outline(study) or rim_edges(study, group)


def rim_edges(study: Study | None, group: Any) -> list[NamedEdge]:
    """Return the pieces of the stored boundary (data.schema.RIM) with their roles."""
    if study is None or "rim_edge" not in group:
        return []
    segments = np.stack([group["rim_x"].values, group["rim_y"].values], axis=-1)
    edge_of_segment = group["rim_edge"].values
    rings = sorted(polylines(segments), key=lambda ring: -shapely.Polygon(ring).area)
    loop_of_point = {tuple(point): number for number, ring in enumerate(rings) for point in ring}
    edges = list[NamedEdge]()
    for number, name in enumerate(str(group["rim_edge"].attrs["flag_meanings"]).split()):
        role = dict(study.scenes[0].boundary)[name]
        for line in polylines(segments[edge_of_segment == number]):
            loop = loop_of_point[tuple(line[0])]
            edges.append(NamedEdge(name, role.word, loop, line, is_loaded(role)))
    return edges


def is_loaded(role: Role) -> bool:
    """Return whether an edge of this role carries a traction or a resultant."""
    return role.loaded


def polylines(segments: Array) -> list[Array]:
    """Return lines (n, 2) of segments (k, 2, 2) that continue each other.

    A ring ends where it begins.
    """
    merged = shapely.line_merge(shapely.multilinestrings(segments), directed=True)
    return [shapely.get_coordinates(line) for line in shapely.get_parts(merged)]


def contact_edges(line: LineFields, group: Any) -> list[NamedEdge]:
    """Return the parts of a contact line between constrained ends, named after their edges."""
    xy, ends = np.column_stack([line.x, line.y]), np.zeros((0, 2))
    if "held_x" in group:
        ends = np.column_stack([group["held_x"].values, group["held_y"].values])
    edges = list[NamedEdge]()
    for part, (start, end) in zip(line.parts, ends_held(line, group), strict=True):
        nodes = xy[part]
        back_to_start = nodes[: int(line.closed(part))]
        held_start, held_end = ends[start : start + 1], ends[end : end + 1]
        points = np.concatenate([held_start, nodes, held_end, back_to_start])
        indices = [k for k in line.edge[part] if k < len(line.edge_names)]
        names = dict.fromkeys(line.edge_names[k] for k in indices)
        edges.append(NamedEdge(", ".join(names), "contact", 0, points))
    return edges


def sources(study: Study | None) -> list[Array]:
    """Return outlines (n, 2) of the regions that are heated."""
    if study is None or not any(scene.heat.q != 0.0 for scene in study.scenes):
        return []
    scene = study.scenes[0]
    outlines = list[Array]()
    for region in scene.body.regions:
        if region.name in scene.heat.omega:
            outlines.append(np.concatenate([_polyline(edge) for edge in region.loop.edges]))
    return outlines


def _polyline(edge: Edge) -> Array:
    return edge_points(edge, 1 if edge.through is None else ARC_POINTS - 1)


def nearest(segments: Array, named: Sequence[NamedEdge]) -> NDArray[np.int8]:
    """Return (k,) index of the named edge on which each segment (k, 2, 2) of the rim lies.

    −1 for a segment on none of them.
    """
    if not named:
        return np.full(len(segments), -1, dtype=np.int8)
    middles = shapely.points(segments.mean(axis=1))
    lines = [shapely.LineString(edge.line) for edge in named]
    distance = np.array([shapely.distance(middles, line) for line in lines])
    length = np.hypot(*(segments[:, 1] - segments[:, 0]).T)
    is_near = distance.min(axis=0) < MAX_DISTANCE * length
    return np.where(is_near, np.argmin(distance, axis=0), -1).astype(np.int8)


# -- stresses: constant in triangles, as P1 elements have them; recovered


def stresses(body: BodyFields, material: Material) -> tuple[Array, Array]:
    """Return stress (t, 6) and elastic energy density ½ σ : c⁻¹ σ (t,) of triangles [Pa, J/m³].

    Components stand in the order xx, yy, zz, xy, yz, xz.
    """
    constants = [(m.lam, m.mu, m.beta, m.nu, m.E) for m in material.all]
    lam, mu, beta, nu, E = np.array(constants)[body.region].T
    e_xx, e_yy, e_xy = _strains(body)
    theta = 0.0 if body.theta is None else np.mean(body.theta[body.triangles], axis=1)
    lateral = lam * (e_xx + e_yy) - beta * theta
    sigma = np.zeros((len(e_xx), 6))
    sigma[:, 0] = lateral + 2.0 * mu * e_xx
    sigma[:, 1] = lateral + 2.0 * mu * e_yy
    sigma[:, 2] = lateral if material.plane == "strain" else 0.0
    sigma[:, 3] = 2.0 * mu * e_xy
    trace = np.sum(sigma[:, :3], axis=1)
    return sigma, 0.5 * ((1.0 + nu) * _square(sigma) - nu * trace**2) / E


def _strains(body: BodyFields) -> tuple[Array, Array, Array]:
    """Return the strains e_xx, e_yy, e_xy (t,) of triangles with linear displacements."""
    x, y = np.moveaxis(body.xy[body.triangles], -1, 0)
    b = np.roll(y, -1, axis=1) - np.roll(y, 1, axis=1)
    d = np.roll(x, 1, axis=1) - np.roll(x, -1, axis=1)
    # its sign depends on the order of the corners, as that of b and d does
    twice_area = np.sum(x * b, axis=1)
    u, v = np.moveaxis(body.u[body.triangles], -1, 0)
    e_xx = np.sum(u * b, axis=1) / twice_area
    e_yy = np.sum(v * d, axis=1) / twice_area
    gamma_xy = (np.sum(u * d, axis=1) + np.sum(v * b, axis=1)) / twice_area
    return e_xx, e_yy, 0.5 * gamma_xy


def _square(sigma: Array) -> Array:
    """Return σ : σ of stresses (…, 6); shear stresses count twice."""
    normal, shear = sigma[..., :3], sigma[..., 3:]
    return np.asarray(np.sum(normal**2, axis=-1) + 2.0 * np.sum(shear**2, axis=-1))


def von_mises(sigma: Array) -> Array:
    """Return √(3/2 s : s) of the deviators s of stresses (…, 6)."""
    deviator = sigma.copy()
    deviator[..., :3] -= np.mean(sigma[..., :3], axis=-1, keepdims=True)
    return np.asarray(np.sqrt(1.5 * _square(deviator)))


def principal(sigma: Array, sign: float) -> Array:
    """Return the larger (sign 1) or smaller (−1) in-plane principal stress of stresses (…, 6)."""
    x, y, shear = sigma[..., 0], sigma[..., 1], sigma[..., 3]
    radius = np.hypot(0.5 * (x - y), shear)
    return np.asarray(0.5 * (x + y) + sign * radius)


def stress_floor(body: BodyFields, material: Material, sigma: Array) -> float:
    """Return the size below which components of stresses (…, 6) of one body are rounding.

    Strains are differences of displacements over an element, and thermal strains are subtracted.
    """
    sides = body.xy[body.triangles] - body.xy[np.roll(body.triangles, 1, axis=1)]
    shortest = float(np.hypot(sides[..., 0], sides[..., 1]).min())
    stiffest = max(m.lam + 2.0 * m.mu for m in material.all)
    summed = stiffest * float(np.abs(body.u).max()) / shortest
    if body.theta is not None:
        hottest = float(np.abs(body.theta).max())
        summed += max(abs(m.beta) for m in material.all) * hottest
    rounding = STRESS_ROUNDINGS * float(np.finfo(float).eps) * summed
    return max(rounding, SHARE * float(np.abs(sigma).max()))


STRESS_ROUNDINGS = 64.0
"""Rounding errors of a displacement that the stress of an element may contain."""


COMPONENTS: dict[str, tuple[str, Callable[[Array], Array]]] = {
    "sigma_x": ("σ_x", lambda sigma: sigma[..., 0]),
    "sigma_y": ("σ_y", lambda sigma: sigma[..., 1]),
    "tau_xy": ("τ_xy", lambda sigma: sigma[..., 3]),
    "von_mises": ("von Mises' stress", von_mises),
    "sigma_1": ("larger principal stress σ_1", lambda sigma: principal(sigma, 1.0)),
    "sigma_2": ("smaller principal stress σ_2", lambda sigma: principal(sigma, -1.0)),
}
"""Components of stresses (…, 6) that a picture may show: label and formula."""


def recovered(body: BodyFields, material: Material) -> tuple[Array, float]:
    """Return stress (r, n, 6) at the nodes of each of the r regions, and its relative error in L².

    It is 0 at nodes outside a region. The stress of P1 elements jumps from triangle to triangle. σ*
    is the mean of those around a node, by their areas, within one material, across which stresses
    may jump. The error is estimated as ‖σ* − σ_h‖ / ‖σ*‖ (Zienkiewicz and Zhu 1987).
    """
    sigma, _ = stresses(body, material)
    corners, region = body.triangles, body.region.astype(np.intp)
    a, b, c = body.xy[corners.T]
    sides = np.stack([b - a, c - a], axis=-1)
    area = 0.5 * np.abs(np.linalg.det(sides))
    shape = region.max() + 1, len(body.xy)
    mean, weight = np.zeros((*shape, 6)), np.zeros((*shape, 1))
    for corner in corners.T:
        np.add.at(mean, (region, corner), area[:, None] * sigma)
        np.add.at(weight, (region, corner), area[:, None])
    mean /= np.where(weight > 0.0, weight, 1.0)

    def square(linear: Array) -> float:
        """Return ∫ |d|² of stresses d (t, 3, 6) given at corners."""
        corner_sums = np.sum(linear**2, axis=1) + np.sum(linear, axis=1) ** 2
        shear_twice = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
        return float(np.sum(area[:, None] / 12.0 * corner_sums * shear_twice))

    at_corners = mean[region[:, None], corners]
    size = square(at_corners)
    if not size > 0.0:
        return mean, 0.0
    return mean, float(np.sqrt(square(at_corners - sigma[:, None]) / size))
