"""Contact edges that are not held along their normal: frames of their nodes, and the openings.

Opening: s_N = −u_N, which is not below 0 where an edge may lift off. A node of such an edge has the
         frame (t, −n), so that its local rows are (u_T, s_N) and need no change of sign. On
         straight segments s_N ≥ 0 at the nodes is s_N ≥ 0 in between
Normals: of the exact curve, the mean of both segments at a node weighted by their lengths; the gap
         between an arc and its chords is of the order h²
Ends:    a node that is held altogether has no unknown. One that is held in one direction has its
         other component, if that direction is tangential or normal; a condition along any other
         direction would couple u_T and u_N, which have laws of their own. Half cells of a component
         without an unknown go to the neighbour, as on every contact line (forms.py)
Left out: corners of two edges that are not held, rigid edges that meet one
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import GeometryFailed
from tcstudy.fem.meshes import EDGES, SMOOTH, Frames, PlaneMesh
from tcstudy.laws.composed import NO_JOINTS, Joints
from tcstudy.scene.records import Boundary, Contact, Rigid

if TYPE_CHECKING:
    from tcstudy.fem.forms import ContactLine

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

RIGHT_ANGLE = 1e-9
"""Cosine of the angle of two directions below which they are at right angles."""


@dataclass(frozen=True)
class OpeningLine:
    """Openings s_N of the nodes that may lift off, in order along Γ_C.

    nodes:        (k,) mesh nodes; in the local frames s_N is the row n + node
    arclength:    (k,) position along Γ_C, as of the contact line [m]
    xy:           (k, 2) coordinates [m]
    c:            (k,) segment lengths of the edges that may lift off [m]
    edge:         (k,) index into edge_names of the edge the node lies on
    edge_names:   of all contact edges
    which:        (s,) places of the segments that may lift off among those of the contact line
    unknowns:     (s, 2) numbers of the openings at both ends of these segments, −1 where held
    joints:       the nodes where two edges that may lift off meet
    """

    nodes: Indices
    arclength: Array
    xy: Array
    c: Array
    edge: NDArray[np.int8]
    edge_names: tuple[str, ...]
    which: Indices
    unknowns: Indices
    joints: Joints = NO_JOINTS

    @property
    def m(self) -> int:
        """Number of openings."""
        return len(self.nodes)

    @property
    def own_law(self) -> Indices:
        """Return the opening (s, 2) whose law half a segment has, as of the contact line."""
        return laws_of_halves(self.unknowns, self.joints)


def laws_of_halves(unknowns: Indices, joints: Joints) -> Indices:
    """Return the unknown (s, 2) whose law half a segment has.

    It is that of the end, or of the other one at an interface junction or a held end.
    unknowns: (s, 2) at the ends of the segments, −1 where held
    """
    other_end = unknowns[:, ::-1]
    at_joint = np.isin(unknowns, joints.node)
    to_other = at_joint & (other_end >= 0) & ~at_joint[:, ::-1]
    return np.where((unknowns < 0) | to_other, other_end, unknowns)


def opening_line(
    mesh: PlaneMesh, frames: Frames, line: ContactLine, names: tuple[str, ...]
) -> OpeningLine | None:
    """Return the openings of the contact edges `names`, None without such an edge.

    Raises GeometryFailed if a piece of these edges has no node that is free to lift off.
    """
    may_open = np.isin(line.edge_names, names)
    which = np.flatnonzero(may_open[line.segment_edge])
    if not len(which):
        return None
    segments = line.segments[which]
    edge = line.segment_edge[which]
    lengths = line.lengths[which]
    is_free = ~frames.fixed[mesh.n_points + segments]
    held = np.flatnonzero(~is_free.any(axis=1))
    if len(held):
        x, y = mesh.points[segments[held[0], 0]]
        raise GeometryFailed(
            f"no node at ({x:g}, {y:g}) is free to lift off, all are held along the normal; "
            "refine the mesh, or give that edge normal: held",
            EDGES,
        )
    halves = np.where(is_free.all(axis=1, keepdims=True), 0.5, is_free) * lengths[:, None]
    c = np.bincount(segments.ravel(), halves.ravel(), mesh.n_points)
    # each node once, as the start of its segment or as an end at which no segment starts
    begin = (np.cumsum(line.lengths) - line.lengths)[which]
    last = np.flatnonzero(~np.isin(segments[:, 1], segments[:, 0]))
    order = np.argsort(np.concatenate([np.arange(len(which)), last + 0.5]))
    nodes = np.concatenate([segments[:, 0], segments[last, 1]])[order]
    arclength = np.concatenate([begin, (begin + lengths)[last]])[order]
    node_edge = np.concatenate([edge, edge[last]])[order]
    free = ~frames.fixed[mesh.n_points + nodes]
    nodes = nodes[free]
    node_edge = node_edge[free].astype(np.int8)
    number = np.full(mesh.n_points, -1)
    number[nodes] = np.arange(len(nodes))
    unknowns = number[segments]
    end = unknowns[:, 1]
    meets = np.flatnonzero((end >= 0) & (node_edge[end] != edge))
    shares = halves[meets, 1] / c[segments[meets, 1]]
    return OpeningLine(
        nodes,
        arclength[free],
        mesh.points[nodes],
        c[nodes],
        node_edge,
        line.edge_names,
        which,
        unknowns,
        Joints(end[meets], edge[meets], shares),
    )


def with_openings(mesh: PlaneMesh, boundary: Boundary, frames: Frames) -> Frames:
    """Return the frames with (t, −n) at the nodes of contact edges that are not held.

    Raises GeometryFailed where tangential and normal component cannot be told apart.
    """
    names = [name for name, role in boundary if isinstance(role, Contact) and role.u[0] is None]
    if not names:
        return frames
    n = mesh.n_points
    on_edges = mesh.on(*names)
    segments = mesh.segments[on_edges]
    normals = mesh.end_normals[on_edges]
    sums = np.zeros((n, 2))
    weighted = mesh.boundary.length[on_edges][:, None, None] * normals
    np.add.at(sums, segments, weighted)
    is_held = frames.fixed[:n] & frames.fixed[n:]
    nodes = np.unique(segments)
    nodes = nodes[~is_held[nodes]]
    size = np.linalg.norm(sums, axis=1, keepdims=True)
    normal = np.divide(sums, size, out=np.zeros((n, 2)), where=size > 0.0)
    deviation = np.linalg.norm(normals - normal[segments], axis=2)
    is_corner = np.zeros(n, dtype=bool)
    is_corner[segments[deviation > SMOOTH]] = True
    _refuse(
        mesh,
        nodes[is_corner[nodes]],
        "two edges of the contact line that are not held meet at an angle",
        "give one of them normal: held, or let a free edge lie between them",
    )
    rigid = mesh.nodes_on(*(name for name, role in boundary if isinstance(role, Rigid)))
    _refuse(
        mesh,
        np.intersect1d(nodes, rigid),
        "a rigid edge meets a contact edge that is not held",
        "let a free edge lie between the two, or give the contact edge normal: held",
    )
    return _turned(mesh, frames, nodes, normal[nodes])


def _turned(mesh: PlaneMesh, frames: Frames, nodes: Indices, normal: Array) -> Frames:
    """Return the frames with (t, −n) at nodes, whose conditions stay.

    nodes: (k,) held in one direction at most;  normal: (k, 2) outward
    Raises GeometryFailed for a condition along a direction that is neither t nor n.
    """
    n = mesh.n_points
    one = frames.fixed[n + nodes]
    direction = np.where(one[:, None], frames.axes[nodes, :, 1], normal)
    tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
    along_normal = np.einsum("ij,ij->i", direction, normal)
    along_tangent = np.einsum("ij,ij->i", direction, tangent)
    holds_u_T = one & (np.abs(along_normal) < RIGHT_ANGLE)
    is_slanted = one & ~holds_u_T & (np.abs(along_tangent) >= RIGHT_ANGLE)
    _refuse(
        mesh,
        nodes[is_slanted],
        "a slanted guide meets a contact edge that is not held",
        "end the contact edge before it",
    )
    # the condition keeps its own direction to the last digit
    sign = np.sign(np.where(holds_u_T, along_tangent, along_normal))[:, None]
    turned_back = np.column_stack([direction[:, 1], -direction[:, 0]])
    exact_normal = sign * np.where(holds_u_T[:, None], turned_back, direction)
    t = np.column_stack([-exact_normal[:, 1], exact_normal[:, 0]])
    axes = frames.axes.copy()
    fixed = frames.fixed.copy()
    values = frames.values.copy()
    axes[nodes] = np.stack([t, -exact_normal], axis=2)
    prescribed = sign[:, 0] * values[n + nodes]
    fixed[nodes] = holds_u_T
    fixed[n + nodes] = one & ~holds_u_T
    values[nodes] = np.where(holds_u_T, prescribed, 0.0)
    values[n + nodes] = np.where(holds_u_T, 0.0, -prescribed)
    return replace(frames, axes=axes, fixed=fixed, values=values)


def _refuse(mesh: PlaneMesh, nodes: Indices, fault: str, remedy: str) -> None:
    """Raise GeometryFailed if there are nodes, with the place of the first."""
    if len(nodes):
        x, y = mesh.points[nodes[0]]
        raise GeometryFailed(f"{fault} at ({x:g}, {y:g}); {remedy}", EDGES)
