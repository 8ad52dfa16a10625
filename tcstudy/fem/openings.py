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

    nodes:        (k,) mesh nodes
    rows:         (k,) rows of s_N in the local frames, n + node but for the corner at which an edge
                  begins, where it is that of the node
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
    rows: Indices
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
    n = mesh.n_points
    rows = n + segments
    begins = np.isin(segments[:, 0], frames.corners)
    rows[begins, 0] -= n
    is_free = ~frames.fixed[rows]
    held = np.flatnonzero(~is_free.any(axis=1))
    if len(held):
        x, y = mesh.points[segments[held[0], 0]]
        raise GeometryFailed(
            f"no node at ({x:g}, {y:g}) is free to lift off, all are constrained along the normal; "
            "refine the mesh, or give that edge normal: held",
            EDGES,
        )
    halves = np.where(is_free.all(axis=1, keepdims=True), 0.5, is_free) * lengths[:, None]
    c = np.bincount(rows.ravel(), halves.ravel(), 2 * n)
    # each row once, at the start of its segment or at an end at which no segment starts
    begin = (np.cumsum(line.lengths) - line.lengths)[which]
    last = np.flatnonzero(~np.isin(rows[:, 1], rows[:, 0]))
    order = np.argsort(np.concatenate([np.arange(len(which)), last + 0.5]))
    row = np.concatenate([rows[:, 0], rows[last, 1]])[order]
    arclength = np.concatenate([begin, (begin + lengths)[last]])[order]
    node_edge = np.concatenate([edge, edge[last]])[order]
    free = ~frames.fixed[row]
    row = row[free]
    node_edge = node_edge[free].astype(np.int8)
    number = np.full(2 * n, -1)
    number[row] = np.arange(len(row))
    unknowns = number[rows]
    end = unknowns[:, 1]
    meets = np.flatnonzero((end >= 0) & (node_edge[end] != edge))
    shares = halves[meets, 1] / c[rows[meets, 1]]
    return OpeningLine(
        row % n,
        row,
        arclength[free],
        mesh.points[row % n],
        c[row],
        node_edge,
        line.edge_names,
        which,
        unknowns,
        Joints(end[meets], edge[meets], shares),
    )
