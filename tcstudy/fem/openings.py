"""The openings s_N = −u_N of contact edges that may lift off, along Γ_C.

On straight segments s_N ≥ 0 at the nodes is s_N ≥ 0 in between; the gap between an arc and its
chords is of the order h². Half cells of a node without this unknown go to the neighbour, as on
every contact line (forms.py). The frames of the nodes are those of opening_frames.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import GeometryFailed
from tcstudy.fem.forms import ContactLine, laws_of_halves
from tcstudy.fem.meshes import EDGES, Frames, PlaneMesh
from tcstudy.laws.composed import NO_JOINTS, Joints

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


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


def opening_line(
    mesh: PlaneMesh, frames: Frames, line: ContactLine, names: tuple[str, ...]
) -> OpeningLine:
    """Return the openings of the contact edges `names`, at least one.

    Raises GeometryFailed if a piece of these edges has no node that is free to lift off.
    """
    may_open = np.isin(line.edge_names, names)
    which = np.flatnonzero(may_open[line.segment_edge])
    segments = line.segments[which]
    edge = line.segment_edge[which]
    lengths = line.lengths[which]
    is_free = ~frames.fixed[mesh.n_points + segments]
    held = np.flatnonzero(~is_free.any(axis=1))
    if len(held):
        x, y = mesh.points[segments[held[0], 0]]
        raise GeometryFailed(
            f"no node at ({x:g}, {y:g}) is free to lift off, all are constrained along the normal; "
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
