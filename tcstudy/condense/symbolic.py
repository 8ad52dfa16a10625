"""What is eliminated when: the fronts of the multifrontal method and the permuted rows of the matrix that they read.

Literature: I. S. Duff and J. K. Reid, ACM Trans. Math. Softw. 9 (1983) 302-325;
J. W. H. Liu, SIAM Review 34 (1992) 82-109.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.condense.ordering import Floats, Ints, Mask, nested_dissection, node_graph

LEAF_UNKNOWNS = 160  # smaller leaves cost interpreter time, larger ones cost flops and factor storage
WINDOW_ROWS = 1 << 13  # rows permuted at a time: bounds the memory, long enough for NumPy


@dataclass(frozen=True)
class EliminationPlan:
    """The fronts in elimination order (children before parents); the last one is the root of kept unknowns.

    permutation: (N,) rows of A in elimination order, kept unknowns last
    position:    (n,) inverse of it, −1 at rows that take no part
    stops:       stops[f] is the position behind the last unknown of front f; front f starts where f−1 stops
    children:    fronts whose Schur complement front f takes over
    kept:        (m,) position among the kept, for every entry of `keep` as the caller ordered it
    """

    permutation: Ints
    position: NDArray[np.int32]
    stops: list[int]
    children: list[tuple[int, ...]]
    kept: Ints

    def is_for(self, keep: Ints, eliminated: Mask) -> bool:
        """Whether these are the rows that it keeps, in this order, and eliminates."""
        m = len(self.kept)
        inner, kept = self.permutation[: len(self.permutation) - m], self.permutation[len(self.permutation) - m :]
        if len(eliminated) != len(self.position) or not np.array_equal(kept[self.kept], keep):
            return False
        return len(inner) == np.count_nonzero(eliminated) and bool(eliminated[inner].all())


def plan_elimination(
    A: sp.csr_matrix | sp.csr_array, coordinates: Floats, keep: Ints, eliminated: Mask
) -> EliminationPlan:
    """Order the eliminated unknowns by nested dissection of their nodes, the kept ones behind them."""
    nodes = len(coordinates)
    components = A.shape[0] // nodes
    by_component = eliminated.reshape(components, nodes)
    active: Mask = np.any(by_component, axis=0)
    i, j = node_graph(A, nodes, active)
    label = nested_dissection(coordinates, i, j, active, max(1, LEAF_UNKNOWNS // components))
    heap = _postorder(int(label.max(initial=0)))
    rank = np.zeros(int(label.max(initial=0)) + 1, dtype=np.int64)
    rank[heap] = np.arange(len(heap))

    order, front = _order_nodes(coordinates, np.flatnonzero(active), rank[label[active]], len(heap))
    unknowns = (order[:, None] + nodes * np.arange(components)).ravel()
    use = eliminated[unknowns]
    unknowns, front = unknowns[use], np.repeat(front, components)[use]
    position = np.full(A.shape[0], -1, dtype=np.int32)
    position[unknowns] = np.arange(len(unknowns), dtype=np.int32)
    kept_order = _order_kept(A, keep, position)
    position[keep[kept_order]] = len(unknowns) + np.arange(len(keep), dtype=np.int32)

    stops = np.cumsum(np.bincount(front, minlength=len(heap))).tolist()
    return EliminationPlan(
        permutation=np.concatenate([unknowns, keep[kept_order]]),
        position=position,
        stops=[*stops, len(unknowns) + len(keep)],
        children=_children(heap),
        kept=np.argsort(kept_order, kind="stable"),
    )


def _postorder(largest: int) -> list[int]:
    """Heap labels 1..largest, children before parents."""
    out: list[int] = []
    stack = [1]
    while stack:  # node, right, left: the reverse of the order wanted
        h = stack.pop()
        if h <= largest:
            out.append(h)
            stack += (2 * h, 2 * h + 1)
    return out[::-1]


def _children(heap: list[int]) -> list[tuple[int, ...]]:
    """Fronts below every front; the root of kept unknowns stands above the top separator."""
    front = {h: f for f, h in enumerate(heap)}
    below = [tuple(front[c] for c in (2 * h, 2 * h + 1) if c in front) for h in heap]
    return [*below, (front[1],) if heap else ()]


def _order_nodes(coordinates: Floats, nodes: Ints, rank: Ints, fronts: int) -> tuple[Ints, Ints]:
    """Nodes by front and, within it, along its longer extent, so that a boundary meets few contiguous runs of it."""
    x = coordinates[nodes]
    order = np.argsort(rank, kind="stable")
    sizes = np.bincount(rank, minlength=fronts)
    filled = sizes > 0
    starts = (np.cumsum(sizes) - sizes)[filled]
    along_y = np.zeros(fronts, dtype=bool)
    if len(starts):
        extent = np.maximum.reduceat(x[order], starts) - np.minimum.reduceat(x[order], starts)
        along_y[filled] = extent[:, 1] > extent[:, 0]
    order = np.lexsort((np.where(along_y[rank], x[:, 1], x[:, 0]), rank))
    return nodes[order], rank[order]


def _order_kept(A: sp.csr_matrix | sp.csr_array, keep: Ints, position: NDArray[np.int32]) -> Ints:
    """Kept unknowns by their first eliminated neighbour: what one subtree touches is nearly contiguous then.

    Ties go by row, so that the arithmetic does not depend on the order in which the caller wants Ã.
    """
    counts = np.diff(A.indptr)[keep]
    columns, owner = _gather(A.indptr[keep], counts)
    neighbours = position[A.indices[columns]]
    first = np.full(len(keep), np.iinfo(np.int32).max, dtype=np.int32)
    known = neighbours >= 0
    np.minimum.at(first, owner[known], neighbours[known])
    return np.lexsort((keep, first))


def _gather(starts: Ints, counts: Ints) -> tuple[Ints, Ints]:
    """Concatenate the ranges starts[k] + 0..counts[k]−1; also return k for every entry."""
    owner = np.repeat(np.arange(len(counts), dtype=np.int32), counts)
    offset = starts.astype(np.intp) - (np.cumsum(counts) - counts)
    return np.arange(len(owner)) + np.repeat(offset, counts), owner


class FrontEntries(NamedTuple):
    """Entries of A in the rows of a front, on and right of the diagonal; row and column are positions."""

    column: NDArray[np.int32]
    row: NDArray[np.int32]
    value: Floats


def front_entries(A: sp.csr_matrix | sp.csr_array, plan: EliminationPlan) -> Iterator[FrontEntries]:
    """The entries for every front in turn; the rows of many fronts are permuted at a time."""
    stops = np.asarray(plan.stops)
    first, start = 0, 0
    while first < len(stops):
        last = max(first + 1, int(np.searchsorted(stops, start + WINDOW_ROWS, side="right")))
        stop = int(stops[last - 1])
        rows = plan.permutation[start:stop]
        entries, owner = _gather(A.indptr[rows], A.indptr[rows + 1] - A.indptr[rows])
        column = plan.position[A.indices[entries]]
        row = owner + np.int32(start)
        use = column >= row  # leaves out what takes no part, at −1
        column, row, value = column[use], row[use], A.data[entries[use]]
        cuts = np.searchsorted(row, stops[first:last].astype(np.int32)).tolist()
        for a, b in zip([0, *cuts[:-1]], cuts, strict=True):
            yield FrontEntries(column[a:b], row[a:b], value[a:b])
        first, start = last, stop
