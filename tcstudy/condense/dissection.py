"""Nested dissection of the nodes of a mesh into parts and the nodes that separate them.

Method:   all nodes are halved by rank across the longer extent of their part, again and again. Of
          the edges that a halving cuts, the fewest nodes that meet them all are the separator,
          which is eliminated after both halves.
          A. George, SIAM J. Numer. Anal. 10 (1973) 345-363; J. W. H. Liu, SIAM Review 34 (1992)
          82-109; A. Pothen & C.-J. Fan, ACM Trans. Math. Softw. 16 (1990) 303-324 (vertex cover
          from a matching)
Labels:   of a heap: 1 is the top separator, 2h and 2h + 1 are the halves below separator h
Left out: graph partitioning without coordinates.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

Ints = NDArray[np.integer]
Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


class Halving(NamedTuple):
    """Parts of nodes after `depth` halvings, and the directions of all cuts.

    depth:   number of halvings
    part:    (n,) number of the part of every node; bit d from above says which half of cut d
    upright: for every depth, (2^d,) whether the part is halved across y
    """

    depth: int
    part: NDArray[np.int32]
    upright: list[Mask]


class Dissection(NamedTuple):
    """A heap label for every node, and where a separator's nodes lie along it.

    depth: of the leaves
    label: (n,) heap label of every node
    along: (n,) coordinate along the separator, 0 in leaves
    """

    depth: int
    label: Ints
    along: Floats


class EliminationTree(NamedTuple):
    """Fronts in elimination order, the root of kept unknowns last.

    front:  front of every heap label
    parent: (f,) the front that takes over, for all but the root
    level:  (f,) depth below the top separator, −1 for the root
    rank:   rank of every heap label in elimination order
    """

    front: Ints
    parent: Ints
    level: Ints
    rank: Ints


def nested_dissection(points: Floats, i: Ints, j: Ints, leaf: int) -> Dissection:
    """Label nodes by the separators and leaves of a nested dissection.

    points: (n, 2)
    i, j:   edges of the graph of nodes
    leaf:   parts of at most this many nodes are not halved
    """
    halving = halved(points, leaf)
    depth, part = halving.depth, halving.part
    label = np.zeros(len(points), dtype=np.int64)
    along = np.zeros(len(points))
    difference = part[i] ^ part[j]
    is_cut = np.flatnonzero(difference)
    i, j = i[is_cut], j[is_cut]
    bits = np.frexp(difference[is_cut])[1]  # the highest bit that differs is the first cut
    i_is_lower = part[i] < part[j]
    lower, upper = np.where(i_is_lower, i, j), np.where(i_is_lower, j, i)
    for d, upright in enumerate(halving.upright):
        edges = np.flatnonzero(bits == depth - d)
        is_open = (label[lower[edges]] == 0) & (label[upper[edges]] == 0)
        edges = edges[is_open]
        separator = minimum_cover(lower[edges], upper[edges])
        group = part[separator] >> (depth - d)
        label[separator] = (1 << d) + group
        x, y = points[separator].T
        along[separator] = np.where(upright[group], x, y)
    is_leaf = label == 0
    label[is_leaf] = (1 << depth) + part[is_leaf]
    return Dissection(depth, label, along)


def halved(points: Floats, leaf: int) -> Halving:
    """Halve nodes by rank until no part has more than `leaf`.

    Each part is halved across its longer extent. Nodes of equal coordinates are halved like others.
    The nodes along x and along y are kept in order, part by part, so that an extent is the distance
    of two nodes.
    """
    n = len(points)
    orders = [np.argsort(x, kind="stable").astype(np.int32) for x in points.T]
    part = np.zeros(n, dtype=np.int32)
    upright = list[Mask]()
    starts = np.array([0, n])
    while np.diff(starts).max() > leaf:
        low, high = starts[:-1], starts[1:]
        sizes = high - low
        by_x, by_y = orders
        x_extent = points[by_x[high - 1], 0] - points[by_x[low], 0]
        y_extent = points[by_y[high - 1], 1] - points[by_y[low], 1]
        is_upright = y_extent > x_extent
        across = np.where(np.repeat(is_upright, sizes), by_y, by_x)
        middle = low + sizes // 2
        is_upper_place = np.arange(n) >= np.repeat(middle, sizes)
        in_upper_half = np.zeros(n, dtype=bool)
        in_upper_half[across[is_upper_place]] = True
        for order in orders:
            is_upper = in_upper_half[order]
            lower, upper = order[~is_upper], order[is_upper]
            order[~is_upper_place] = lower
            order[is_upper_place] = upper
        part = 2 * part + in_upper_half
        upright.append(is_upright)
        starts = np.append(np.column_stack([low, middle]).ravel(), n)
    return Halving(len(upright), part, upright)


def matched_columns(graph: sp.csr_array) -> Ints:
    """Return the column (n,) of each row of a graph (n, m) in a maximum matching, −1 for none.

    It is a flow of integers by Dinic's algorithm, SIAM J. Comput. 4 (1975) 507–518. SciPy's own
    matching takes minutes for some graphs of a thousand nodes.
    """
    n, m = graph.shape
    source, sink = n + m, n + m + 1
    heads = np.concatenate([graph.indices + n, np.full(m, sink), np.arange(n)])
    counts = np.concatenate([[0], np.diff(graph.indptr), np.ones(m, dtype=np.intp), [n, 0]])
    ones = np.ones(len(heads), dtype=np.int32)
    network = sp.csr_matrix((ones, heads, np.cumsum(counts)), shape=(n + m + 2, n + m + 2))
    flow = maximum_flow(network, source, sink, method="dinic").flow
    leaves_row = np.flatnonzero(flow.data[: flow.indptr[n]] > 0)
    columns = np.full(n, -1)
    columns[np.searchsorted(flow.indptr, leaves_row, side="right") - 1] = flow.indices[leaves_row]
    return np.where(columns < 0, -1, columns - n)


def minimum_cover(lower: Ints, upper: Ints) -> Ints:
    """Return the fewest nodes that meet all edges (lower, upper) between two sets of nodes.

    By König's theorem they are as many as a maximum matching of the edges has, and consist of the
    lower nodes that no alternating path from an unmatched lower node reaches and of the upper ones
    that one reaches. Edges lead up on such paths, matched ones down; they are searched from one
    more node, before all unmatched ones.
    """
    lower, a = np.unique(lower, return_inverse=True)
    upper, b = np.unique(upper, return_inverse=True)
    ones = np.ones(len(a), dtype=np.int8)
    graph = sp.csr_array((ones, (a, b)), shape=(len(lower), len(upper)))
    partner = matched_columns(graph)  # −1 of an unmatched node
    unmatched = np.flatnonzero(partner < 0)
    matched = np.flatnonzero(partner >= 0)
    back = np.full(len(upper), -1)
    back[partner[matched]] = matched
    columns = np.concatenate([graph.indices + len(lower), back[back >= 0], unmatched])
    counts = np.concatenate([[0], np.diff(graph.indptr), back >= 0, [len(unmatched)]])
    root = len(lower) + len(upper)
    ones = np.ones(len(columns), dtype=np.int8)
    paths = sp.csr_array((ones, columns, np.cumsum(counts)), shape=(root + 1, root + 1))
    is_reached = np.zeros(root + 1, dtype=bool)
    is_reached[breadth_first_order(paths, root, return_predecessors=False)] = True
    lower_cover = lower[~is_reached[: len(lower)]]
    upper_cover = upper[is_reached[len(lower) : -1]]
    return np.concatenate([lower_cover, upper_cover])


def elimination_tree(depth: int) -> EliminationTree:
    """Return the fronts of a dissection of this depth.

    The separators next above the leaves are joined to those above them: such small fronts cost
    more in calls than joining them costs in flops.
    """
    heap = np.arange(2 << depth)
    level = np.append(-1, np.log2(heap[1:]).astype(int))
    is_joined = (level == depth - 1) & (heap > 1)
    # by the last leaf below, then children before parents
    key = ((heap + 1) << (depth - level)) * (depth + 2) - level
    key[0] = np.iinfo(np.int64).max
    labels = np.argsort(key)
    labels = labels[~is_joined[labels]]
    front = np.zeros(len(heap), dtype=np.int64)
    front[labels] = np.arange(len(labels))
    front[is_joined] = front[heap[is_joined] >> 1]
    rank = np.empty(len(heap), dtype=np.int64)
    rank[np.lexsort((-heap, front))] = heap
    return EliminationTree(front, front[labels >> 1], level[labels], rank)
