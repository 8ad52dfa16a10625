"""Elimination order of the mesh nodes: geometric nested dissection.

Every part of the mesh is halved across its longer extent; the nodes of one half that touch the other are the separator
and are eliminated after both halves. Literature: A. George, SIAM J. Numer. Anal. 10 (1973) 345-363;
J. W. H. Liu, SIAM Review 34 (1992) 82-109. Left out: graph partitioning without coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

Ints = NDArray[np.integer]
Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


def node_graph(A: sp.csr_matrix | sp.csr_array, nodes: int, active: Mask) -> tuple[Ints, Ints]:
    """Edges (i, j), i < j, between active nodes that any pair of their components couples.

    A is (components·nodes)², component-blocked, canonical CSR with a symmetric pattern.
    """
    rows: Ints = np.repeat(np.arange(nodes, dtype=np.int32), np.diff(A.indptr[: nodes + 1]))
    columns = A.indices[: A.indptr[nodes]]
    if not _blocks_share_pattern(A, nodes, rows, columns):
        rows, columns = _folded_pattern(A, nodes)
    use = (columns > rows) & (columns < nodes)
    i, j = rows[use], columns[use]
    use = active[i] & active[j]
    return i[use], j[use]


def _blocks_share_pattern(A: sp.csr_matrix | sp.csr_array, nodes: int, rows: Ints, columns: Ints) -> bool:
    """True if all component blocks have one pattern (the usual case): the first block is the node graph then."""
    components = A.shape[0] // nodes
    counts = np.diff(A.indptr)
    for c in range(1, components):
        block = slice(A.indptr[c * nodes], A.indptr[(c + 1) * nodes])
        if not np.array_equal(counts[c * nodes : (c + 1) * nodes], counts[:nodes]):
            return False
        if not np.array_equal(A.indices[block], columns):
            return False
    first = columns < nodes
    for c in range(1, components):
        here = (columns >= c * nodes) & (columns < (c + 1) * nodes)
        if not np.array_equal(rows[here], rows[first]):
            return False
        if not np.array_equal(columns[here] - c * nodes, columns[first]):
            return False
    return True


def _folded_pattern(A: sp.csr_matrix | sp.csr_array, nodes: int) -> tuple[Ints, Ints]:
    """Union of the patterns of all component blocks."""
    rows = np.repeat(np.arange(A.shape[0]), np.diff(A.indptr)) % nodes
    ones = np.ones(len(rows), dtype=np.int8)
    folded = sp.coo_array((ones, (rows, A.indices % nodes)), shape=(nodes, nodes)).tocsr()
    return np.repeat(np.arange(nodes, dtype=np.int32), np.diff(folded.indptr)), folded.indices


def nested_dissection(coordinates: Floats, i: Ints, j: Ints, active: Mask, leaf: int) -> NDArray[np.int64]:
    """Heap label of every active node: 1 the top separator, 2h and 2h+1 the halves below separator h; 0 if inactive.

    coordinates: (nv, 2); (i, j): edges of the graph of active nodes; leaf: parts this small are not cut.
    """
    label = np.zeros(len(active), dtype=np.int64)
    part = np.where(active, 0, -1).astype(np.int32)
    orders = [np.argsort(coordinates[:, axis], kind="stable") for axis in (0, 1)]
    orders = [order[active[order]] for order in orders]
    parts, depth = 1, 0
    while True:
        counts = np.bincount(part[orders[0]], minlength=parts)
        if counts.max(initial=0) <= leaf:
            break
        left = _left_halves(coordinates, orders, part, counts)
        separator = _separators(left, part, i, j, parts)
        label[separator] = (1 << depth) + part[separator]
        part = np.where(part >= 0, 2 * part + ~left, -1).astype(np.int32)
        part[separator] = -1
        orders = [order[~separator[order]] for order in orders]
        inside = ~(separator[i] | separator[j])  # every edge between the halves has an end in the separator
        i, j = i[inside], j[inside]
        parts, depth = 2 * parts, depth + 1
    rest = part >= 0
    label[rest] = (1 << depth) + part[rest]
    return label


def _left_halves(coordinates: Floats, orders: Sequence[Ints], part: Ints, counts: Ints) -> Mask:
    """Mark the lower half (by rank, so equal coordinates do no harm) of every part along its longer extent."""
    ends = np.cumsum(counts)
    starts = ends - counts
    narrow = len(counts) < 1 << 16  # a stable sort of 16-bit keys is a radix sort
    filled = counts > 0
    extent = np.zeros((2, len(counts)))
    by_part = []
    for axis, order in enumerate(orders):
        key = part[order]
        order = order[np.argsort(key.astype(np.uint16) if narrow else key, kind="stable")]
        x = coordinates[:, axis]
        extent[axis, filled] = x[order[ends[filled] - 1]] - x[order[starts[filled]]]
        by_part.append(order)
    lower = np.arange(ends[-1]) - np.repeat(starts, counts) < np.repeat(counts // 2, counts)
    along_y = np.repeat(extent[1] > extent[0], counts)
    left = np.zeros(len(part), dtype=bool)
    for axis, order in enumerate(by_part):
        chosen = along_y == bool(axis)
        left[order[chosen]] = lower[chosen]
    return left


def _separators(left: Mask, part: Ints, i: Ints, j: Ints, parts: int) -> Mask:
    """Nodes of one half with a neighbour in the other, from whichever half has fewer of them, for every part."""
    from_left = left[i]
    cut = from_left != left[j]
    i, j, from_left = i[cut], j[cut], from_left[cut]
    sides = []
    for ends in (np.where(from_left, i, j), np.where(from_left, j, i)):
        side = np.zeros(len(part), dtype=bool)
        side[ends] = True
        sides.append(np.flatnonzero(side))
    fewer = np.bincount(part[sides[0]], minlength=parts) <= np.bincount(part[sides[1]], minlength=parts)
    separator = np.zeros(len(part), dtype=bool)
    for side, wanted in zip(sides, (fewer, ~fewer), strict=True):
        separator[side[wanted[part[side]]]] = True
    return separator
