"""The boundary of a triangulation as closed chains of nodes, and the contact line as a part of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.report.picture import NEAR, BodyFields, Line

Indices = NDArray[np.intp]


def boundary_edges(body: BodyFields) -> Indices:
    """(e, 2) edges that belong to one triangle only, with the body on their left."""
    x, y, t = body.x, body.y, body.triangles
    a, b, c = t[:, 0], t[:, 1], t[:, 2]
    area = (x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a])
    t = np.where((area < 0.0)[:, None], t[:, ::-1], t)
    edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    _, first, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    return edges[first[count == 1]]


def loops(edges: Indices) -> list[Indices]:
    """Closed chains of nodes (the last is the first again) that use every edge once."""
    leaving: dict[int, list[int]] = {}
    for start, end in edges.tolist():
        leaving.setdefault(start, []).append(end)
    chains = []
    for head in leaving:
        while leaving[head]:
            chain = [head]
            while leaving.get(chain[-1]):
                chain.append(leaving[chain[-1]].pop())
            chains.append(np.array(chain, dtype=np.intp))
    return chains


def contact_chains(body: BodyFields, line: Line) -> list[tuple[Indices, Indices]]:
    """Mesh nodes of every part of the contact line, and the contact node that each of them is.

    A held node beside a part carries no unknown and is not in the line, but belongs to the drawn edge; it counts as
    the contact node next to it. A ring ends with its first node.
    """
    edges = boundary_edges(body)
    after = dict(zip(edges[:, 0].tolist(), edges[:, 1].tolist(), strict=True))
    before = dict(zip(edges[:, 1].tolist(), edges[:, 0].tolist(), strict=True))
    nodes = _nearest(body, line, np.unique(edges))
    chains = []
    for part in line.parts:
        chain, index = nodes[part].tolist(), list(range(part.start, part.stop))
        cells, first, last = line.cells(part), part.start, part.stop - 1
        if line.closed(part):
            chain, index = [*chain, chain[0]], [*index, first]
        else:
            held, beyond = before.get(chain[0]), after.get(chain[-1])
            if held is not None and _reaches(body, held, chain[0], line.arclength[first] - cells[0]):
                chain, index = [held, *chain], [first, *index]
            if beyond is not None and _reaches(body, beyond, chain[-1], cells[-1] - line.arclength[last]):
                chain, index = [*chain, beyond], [*index, last]
        chains.append((np.array(chain, dtype=np.intp), np.array(index, dtype=np.intp)))
    return chains


def _nearest(body: BodyFields, line: Line, candidates: Indices) -> Indices:
    """(m,) the boundary node of the mesh at each contact node."""
    x, y = body.x[candidates], body.y[candidates]
    return np.array(
        [candidates[np.argmin((x - a) ** 2 + (y - b) ** 2)] for a, b in zip(line.x, line.y, strict=True)],
        dtype=np.intp,
    )


def _reaches(body: BodyFields, a: int, b: int, distance: float) -> bool:
    """True if two nodes are this far from each other."""
    actual = float(np.hypot(body.x[a] - body.x[b], body.y[a] - body.y[b]))
    return abs(actual - distance) <= NEAR * actual
