"""The contact line Γ_C: its nodes in order, arclength, and the segment lengths c_i = meas(S_i) of method §2.

A node that carries no unknown (on the closure of Γ_D, or in a corner of Γ_C) gives its half cells to its free
neighbours, so that Σ c_i = meas(Γ_C) whatever the ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.errors import GeometryFailed
from tcstudy.fem.boundary import Frames
from tcstudy.fem.meshes import PlaneMesh

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True)
class ContactLine:
    """Contact unknowns in order along Γ_C (direction of t = (−n₂, n₁), one part after the other).

    nodes:     (m,) mesh nodes; in the local frames their tangential rows are these very numbers
    arclength: (m,) position along Γ_C, parts counted on one after the other [m]
    xy:        (m, 2) coordinates [m];  c: (m,) segment lengths [m]
    edge:      (m,) index into edge_names of the edge the node lies on
    segments:  (s, 2) all segments of Γ_C, clamped nodes included, in order;  ends: (s, 2, 2) their ends [m]
    """

    nodes: Indices
    arclength: Array
    xy: Array
    c: Array
    edge: NDArray[np.int8]
    edge_names: tuple[str, ...]
    segments: Indices
    ends: Array

    @property
    def m(self) -> int:
        """Number of contact unknowns."""
        return len(self.nodes)


def contact_line(mesh: PlaneMesh, frames: Frames, names: tuple[str, ...]) -> ContactLine:
    """Order the contact nodes of the study edges `names` and measure their segments S_i.

    Raises GeometryFailed if a piece of Γ_C has no free node at all (the mesh is too coarse there).
    """
    curves = mesh.geometry.curves
    edge_of_curve = np.array([names.index(c.name) if c.name in names else -1 for c in curves])
    edge = edge_of_curve[mesh.segment_curve]
    segments, edge = mesh.segments[edge >= 0], edge[edge >= 0]
    rank = mesh.segment_curve[edge_of_curve[mesh.segment_curve] >= 0]
    order, start = _chain(segments, rank)
    segments, edge = segments[order], edge[order]
    lengths = np.linalg.norm(mesh.points[segments[:, 1]] - mesh.points[segments[:, 0]], axis=1)
    free = ~frames.fixed[segments]
    c = _cells(mesh, segments, lengths, free)
    before = np.cumsum(lengths) - lengths
    # Each node once: as the start of its outgoing segment, or as the end of the last one of an open part.
    last = np.ones(len(segments), dtype=bool)
    last[:-1] = start[1:]
    closes = segments[:, 1] == _part_start(segments, start)
    final = np.flatnonzero(last & ~closes)
    nodes = np.concatenate([segments[:, 0], segments[final, 1]])
    at = np.concatenate([before, before[final] + lengths[final]])
    position = np.concatenate([np.arange(len(segments)), final + 0.5])
    edges = np.concatenate([edge, edge[final]])
    sort = np.argsort(position, kind="stable")
    sort = sort[~frames.fixed[nodes[sort]]]
    nodes, ends = nodes[sort], mesh.points[segments]
    on = edges[sort].astype(np.int8)
    return ContactLine(nodes, at[sort], mesh.points[nodes], c[nodes], on, names, segments, ends)


def _cells(mesh: PlaneMesh, segments: Indices, lengths: Array, free: NDArray[np.bool_]) -> Array:
    """(n,) c_i on all mesh nodes: half of each adjacent segment, a fixed end's half goes to the other end."""
    lost = np.flatnonzero(~free[:, 0] & ~free[:, 1])
    if len(lost):
        x, y = mesh.points[segments[lost[0], 0]]
        raise GeometryFailed(
            f"the contact line has no free node at ({x:g}, {y:g}), all its nodes there are held; refine the mesh, "
            "or draw short edges that stand for a curve as arcs with through"
        )
    share = np.where((free[:, 0] & free[:, 1])[:, None], 0.5, free)
    c = np.zeros(mesh.n_points)
    np.add.at(c, segments[:, 0], share[:, 0] * lengths)
    np.add.at(c, segments[:, 1], share[:, 1] * lengths)
    return c


def _chain(segments: Indices, rank: Indices) -> tuple[Indices, NDArray[np.bool_]]:
    """Order of directed segments along their chains, and which of them start a part.

    Open parts start at the node that no segment ends in; closed ones at their first segment by rank.
    """
    outgoing = {int(a): i for i, a in enumerate(segments[:, 0])}
    ends = set(segments[:, 1].tolist())
    by_rank = np.argsort(rank, kind="stable")
    heads = [int(i) for i in by_rank if int(segments[i, 0]) not in ends] + by_rank.tolist()
    seen = np.zeros(len(segments), dtype=bool)
    order: list[int] = []
    starts: list[bool] = []
    for head in heads:
        i: int | None = head
        first = True
        while i is not None and not seen[i]:
            seen[i] = True
            order.append(i)
            starts.append(first)
            first = False
            i = outgoing.get(int(segments[i, 1]))
    return np.array(order, dtype=np.intp), np.array(starts, dtype=bool)


def _part_start(segments: Indices, start: NDArray[np.bool_]) -> Indices:
    """First node of the part that each segment belongs to."""
    heads = segments[start, 0]
    return heads[np.cumsum(start) - 1]
