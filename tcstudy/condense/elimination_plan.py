"""The order of elimination, and where every entry of the matrix and of a Schur complement goes.

Unknowns come in blocks: the eliminated unknowns of one node, and every kept unknown alone. Blocks
are numbered in the order of elimination. Boundaries and places are found for blocks, of which a
body has a quarter as many pairs as its matrix has entries.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, TypeAlias
from zlib import crc32

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.condense.dissection import (
    EliminationTree,
    Floats,
    Ints,
    Mask,
    elimination_tree,
    nested_dissection,
)

Sparse: TypeAlias = sp.csr_matrix | sp.csr_array

LEAF_UNKNOWNS = 100
"""Unknowns of a leaf: fewer cost interpreter time, more cost flops and factor storage."""

Run = tuple[int, int, int]
"""(first, stop, target): rows first..stop−1 of a Schur complement go to rows of the parent front.

Those are consecutive, from `target` on.
"""


@dataclass(frozen=True)
class EliminationPlan:
    """The fronts in elimination order, children before parents; the last has the kept unknowns.

    The rows of a front are its inner unknowns, then its boundary. Its panel is the columns of the
    inner unknowns: the block on the diagonal, then that of the boundary, both in Fortran order.

    permutation: (N,) rows of A in elimination order, kept unknowns last
    position:    (n,) inverse of it, −1 at rows that take no part
    stops:       stops[f] is the position behind the last unknown of front f; front f starts where
                 f − 1 stops
    children:    fronts whose Schur complement front f takes over
    kept:        (m,) position among the kept, for every entry of `keep` as the caller ordered it
    boundaries:  later unknowns that a front touches, by position
    runs:        where its Schur complement goes in the parent; rows of the parent's inner unknowns
                 and of its boundary are in separate runs
    entries:     where the entries of a front begin in `source` and `target`, and where the last end
    source:      where the entries of one triangle are in A.data
    target:      where they go in the panel of their front
    pattern:     fingerprint of the pattern of the matrix (pattern_of)
    """

    permutation: Ints
    position: NDArray[np.int32]
    stops: list[int]
    children: list[list[int]]
    kept: Ints
    boundaries: list[Ints]
    runs: list[list[Run]]
    entries: list[int]
    source: Ints
    target: Ints
    pattern: tuple[int, int, int]


def pattern_of(A: Sparse) -> tuple[int, int, int]:
    """Return numbers that matrices of one pattern share.

    They are the number of entries and checksums of columns and row starts.
    """
    return A.nnz, crc32(A.indices.data), crc32(A.indptr.data)


def plan_elimination(
    A: Sparse, coordinates: Floats, components: int, keep: Ints, eliminated: Mask
) -> EliminationPlan:
    """Order the eliminated unknowns by nested dissection, the kept ones last, and lay out A.

    A is (components·nodes)², component-blocked, canonical CSR with a symmetric pattern. Where its
    blocks have different patterns, every unknown counts as a node.
    """
    nodes = len(coordinates)
    pairs = _node_pairs(A, components)
    if pairs is None:
        return plan_elimination(A, np.tile(coordinates, (components, 1)), 1, keep, eliminated)
    by_component = eliminated.reshape(components, nodes)
    active: Mask = np.any(by_component, axis=0)
    pairs = pairs.chosen(active[pairs.i] & active[pairs.j])
    order, front, tree = _ordered_nodes(coordinates, active, pairs, LEAF_UNKNOWNS // components)
    blocks = _blocks(A, by_component, order, front, keep, len(tree.parent))
    is_full: Mask = np.all(by_component, axis=0)
    in_full_nodes = is_full[pairs.i] & is_full[pairs.j]
    full = _full_entries(pairs.chosen(in_full_nodes), blocks)
    partial = _partial_entries(pairs.chosen(~in_full_nodes), blocks, components)
    single = _Entries.joined([*partial, _kept_entries(A, keep, blocks)]).by_front(blocks)
    boundaries = _boundaries(full, single, blocks, tree)
    source, target, ends = _layout(full, single, components, blocks, boundaries)
    children: list[list[int]] = [[] for _ in tree.parent]
    for child, parent in enumerate(tree.parent[:-1].tolist()):
        children[parent].append(child)
    return EliminationPlan(
        permutation=blocks.permutation,
        position=blocks.position,
        stops=blocks.stops.tolist(),
        children=children,
        kept=blocks.kept,
        boundaries=_unknowns_of(boundaries, blocks),
        runs=_runs(boundaries, blocks, tree.parent),
        entries=ends,
        source=source,
        target=target,
        pattern=pattern_of(A),
    )


# -- nodes and their order -------------------------------------------------------------------------


class _NodePairs(NamedTuple):
    """Coupled nodes i ≤ j, every node with itself, and where A.data has their entries.

    The entry of component c of i and d of j is A.data[first + c·of_i + d·of_j].
    """

    i: Ints
    j: Ints
    first: Ints
    of_i: Ints
    of_j: Ints

    def chosen(self, use: Mask) -> _NodePairs:
        return _NodePairs(*(column[use] for column in self))


def _node_pairs(A: Sparse, components: int) -> _NodePairs | None:
    """Return the pairs of nodes that the matrix couples; None if its blocks differ in pattern."""
    nodes = A.shape[0] // components
    block = A.nnz // components  # entries of all rows of one component
    if A.nnz != components * block or A.indptr[nodes] != block:
        return None
    columns = A.indices[:block]
    if np.any(A.indices.reshape(components, block) != columns):
        return None
    counts = np.diff(A.indptr)
    first = np.flatnonzero(columns < nodes)
    i = np.repeat(np.arange(nodes, dtype=np.int32), counts[:nodes])[first]
    j = columns[first]
    degree = np.bincount(i, minlength=nodes).astype(np.int32)
    if not np.array_equal(counts, np.tile(components * degree, components)):
        return None
    for d in range(1, components):
        if not np.array_equal(columns[first + d * degree[i]], j + d * nodes):
            return None
    is_upper = i <= j
    i, j, first = i[is_upper], j[is_upper], first[is_upper]
    index = np.int32 if A.nnz < 1 << 31 else np.int64
    of_i: Ints = np.full(len(i), block, dtype=index)
    return _NodePairs(i, j, first.astype(index), of_i, degree[i])


def _ordered_nodes(
    coordinates: Floats, active: Mask, pairs: _NodePairs, leaf: int
) -> tuple[Ints, Ints, EliminationTree]:
    """Return the active nodes in elimination order, the front of each, and all fronts."""
    nodes = np.flatnonzero(active)
    number = np.cumsum(active, dtype=np.int32) - 1
    edges = pairs.i != pairs.j
    i, j = number[pairs.i[edges]], number[pairs.j[edges]]
    dissection = nested_dissection(coordinates[nodes], i, j, max(1, leaf))
    tree = elimination_tree(dissection.depth)
    is_leaf = dissection.label >> dissection.depth > 0
    separators = np.flatnonzero(~is_leaf)
    # along a separator, so that what a front touches of it is contiguous
    separators = separators[np.argsort(dissection.along[separators], kind="stable")]
    order = np.concatenate([np.flatnonzero(is_leaf), separators])
    order = order[_argsort(tree.rank[dissection.label[order]])]
    return nodes[order], tree.front[dissection.label[order]], tree


def _argsort(keys: Ints) -> Ints:
    """Return a stable order; keys of 16 bits are sorted by radix."""
    fits = keys.max(initial=0) < 1 << 16
    return np.argsort(keys.astype(np.uint16) if fits else keys, kind="stable")


class _Blocks(NamedTuple):
    """Eliminated nodes, then kept unknowns, in elimination order; (B,) unless stated.

    start, width:      first position of a block, number of its unknowns
    of_node:           (nodes,) block of a node, meaningless for inactive ones
    of_position:       (N,) block of an unknown
    front_of_position: (N,) front of an unknown
    front:             front of a block
    first, stops:      (f,) first position of a front and the one behind it
    inner:             number of eliminated unknowns
    permutation, position, kept: as in EliminationPlan
    """

    start: Ints
    width: Ints
    of_node: Ints
    of_position: Ints
    front_of_position: Ints
    front: Ints
    first: Ints
    stops: Ints
    inner: int
    permutation: Ints
    position: NDArray[np.int32]
    kept: Ints


def _blocks(
    A: Sparse, by_component: Mask, order: Ints, front: Ints, keep: Ints, fronts: int
) -> _Blocks:
    """Number the unknowns of the ordered nodes, then the kept ones.

    Kept unknowns come by their first eliminated neighbour: what one subtree touches is nearly
    contiguous then. Ties are broken by row, so that the arithmetic does not depend on the order in
    which the caller wants Ã.
    """
    components, nodes = by_component.shape
    use = by_component[:, order]
    inner = (order + nodes * np.arange(components)[:, None]).T[use.T]
    position = np.full(A.shape[0], -1, dtype=np.int32)
    position[inner] = np.arange(len(inner), dtype=np.int32)
    owner, entry = _rows_of(A, keep)
    neighbours = position[A.indices[entry]]
    nearest = np.full(len(keep), len(inner))
    np.minimum.at(nearest, owner[neighbours >= 0], neighbours[neighbours >= 0])
    kept_order = np.lexsort((keep, nearest))
    position[keep[kept_order]] = len(inner) + np.arange(len(keep), dtype=np.int32)

    kept_width = np.ones(len(keep), dtype=int)
    width = np.append(use.sum(axis=0), kept_width).astype(np.int32)
    front = np.append(front, np.full(len(keep), fronts - 1)).astype(np.int32)
    front_width = np.bincount(front, width, fronts).astype(np.int32)
    stops = np.cumsum(front_width, dtype=np.int32)
    of_node = np.zeros(nodes, dtype=np.int32)
    of_node[order] = np.arange(len(order))
    return _Blocks(
        start=(np.cumsum(width) - width).astype(np.int32),
        width=width,
        of_node=of_node,
        of_position=np.repeat(np.arange(len(width), dtype=np.int32), width),
        front_of_position=np.repeat(front, width),
        front=front,
        first=stops - front_width,
        stops=stops,
        inner=len(inner),
        permutation=np.concatenate([inner, keep[kept_order]]),
        position=position,
        kept=np.argsort(kept_order, kind="stable"),
    )


def _rows_of(A: Sparse, rows: Ints) -> tuple[Ints, Ints]:
    """Return the entries of some rows: which of the rows, and where in A.data."""
    counts = A.indptr[rows + 1] - A.indptr[rows]
    owner = np.repeat(np.arange(len(rows)), counts)
    before = np.cumsum(counts) - counts
    return owner, np.arange(len(owner)) + np.repeat(A.indptr[rows] - before, counts)


# -- entries of the matrix -------------------------------------------------------------------------


class _Entries(NamedTuple):
    """Entries of one triangle of A by front: one, or those of all components of two nodes.

    column, row:       position of the first unknown, column ≤ row
    source:            where its entry is in A.data
    per_column, per_row: the increment of that for the next component of either node
    """

    column: Ints
    row: Ints
    source: Ints
    per_column: Ints
    per_row: Ints

    @staticmethod
    def joined(parts: list[_Entries]) -> _Entries:
        return _Entries(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))

    def by_front(self, blocks: _Blocks) -> _Entries:
        order = _argsort(blocks.front_of_position[self.column])
        return _Entries(*(column[order] for column in self))


def _full_entries(pairs: _NodePairs, blocks: _Blocks) -> _Entries:
    """Return the entries of nodes with all components eliminated, by front."""
    a = blocks.start[blocks.of_node[pairs.i]]
    b = blocks.start[blocks.of_node[pairs.j]]
    is_turned = a > b
    entries = _Entries(
        column=np.minimum(a, b),
        row=np.maximum(a, b),
        source=pairs.first,
        per_column=np.where(is_turned, pairs.of_j, pairs.of_i),
        per_row=np.where(is_turned, pairs.of_i, pairs.of_j),
    )
    return entries.by_front(blocks)


def _partial_entries(pairs: _NodePairs, blocks: _Blocks, components: int) -> list[_Entries]:
    """Return the entries of nodes of which some components are eliminated, one by one."""
    nodes = len(blocks.of_node)
    single = []
    for c, d in np.ndindex(components, components):
        a = blocks.position[c * nodes + pairs.i]
        b = blocks.position[d * nodes + pairs.j]
        is_first = (pairs.i != pairs.j) | (c <= d)
        is_inner = (np.minimum(a, b) >= 0) & (np.maximum(a, b) < blocks.inner)
        use = is_first & is_inner
        source = pairs.first + c * pairs.of_i + d * pairs.of_j
        single.append(_single(a[use], b[use], source[use]))
    return single


def _kept_entries(A: Sparse, keep: Ints, blocks: _Blocks) -> _Entries:
    """Return the entries in the rows of kept unknowns."""
    owner, entry = _rows_of(A, keep)
    row = blocks.position[keep][owner]
    column = blocks.position[A.indices[entry]]
    use = (column >= 0) & (column <= row)
    return _single(row[use], column[use], entry[use])


def _single(a: Ints, b: Ints, source: Ints) -> _Entries:
    none = np.zeros(len(a), dtype=np.int32)
    return _Entries(np.minimum(a, b), np.maximum(a, b), source, none, none)


# -- boundaries of fronts --------------------------------------------------------------------------


class _Boundaries(NamedTuple):
    """Later blocks that fronts touch, sorted by front, then by block.

    keys:   front·B + block;  front, block: of every key
    place:  rows of the boundary of that front before the block
    begins: (f + 1,) where the keys of a front begin
    sizes:  (f,) rows of the boundary
    """

    keys: Ints
    front: Ints
    block: Ints
    place: Ints
    begins: Ints
    sizes: Ints


def _boundaries(
    full: _Entries, single: _Entries, blocks: _Blocks, tree: EliminationTree
) -> _Boundaries:
    """Return the blocks that all fronts touch, by entries of A and by their children."""
    count, fronts = len(blocks.start), len(tree.parent)
    above = np.zeros(0, dtype=np.int64)
    by_entries = _distinct(np.append(_outer_keys(full, blocks), _outer_keys(single, blocks)))
    level = tree.level[by_entries // count]
    levels = list[Ints]()
    for d in np.unique(tree.level)[::-1]:
        touched = _distinct(np.append(by_entries[level == d], above))
        levels.append(touched)
        parent, block = tree.parent[touched // count], touched % count
        passes_on = blocks.front[block] != parent
        above = (parent * count + block)[passes_on]
    keys = np.sort(np.concatenate(levels), kind="stable")
    front, block = (quotient.astype(np.int32) for quotient in np.divmod(keys, count))
    begins = np.searchsorted(front, np.arange(fronts + 1))
    behind = np.append(0, np.cumsum(blocks.width[block]))
    place = (behind[:-1] - behind[begins[front]]).astype(np.int32)
    sizes = np.diff(behind[begins]).astype(np.int32)
    return _Boundaries(keys, front, block, place, begins, sizes)


def _outer_keys(entries: _Entries, blocks: _Blocks) -> Ints:
    """Return front·B + block of all entries below the inner unknowns of their front."""
    front = blocks.front_of_position[entries.column]
    is_outside = entries.row >= blocks.stops[front]
    block = blocks.of_position[entries.row[is_outside]]
    return front[is_outside].astype(np.int64) * len(blocks.start) + block


def _distinct(keys: Ints) -> Ints:
    keys = np.sort(keys, kind="stable")
    return keys[np.diff(keys, prepend=-1) > 0]


def _unknowns_of(boundaries: _Boundaries, blocks: _Blocks) -> list[Ints]:
    """Return the positions of the unknowns on the boundary of every front."""
    width, start = blocks.width[boundaries.block], blocks.start[boundaries.block]
    behind = np.append(0, np.cumsum(width))
    unknowns = np.arange(behind[-1]) + np.repeat(start - behind[:-1], width)
    cuts = behind[boundaries.begins].tolist()
    return [unknowns[a:b] for a, b in pairwise(cuts)]


def _runs(boundaries: _Boundaries, blocks: _Blocks, parents: Ints) -> list[list[Run]]:
    """Return, of every front, maximal runs of its boundary that are consecutive in the parent."""
    front, block, place = boundaries.front, boundaries.block, boundaries.place
    parent = parents[front]  # of 64 bits, as keys are
    is_outside = blocks.front[block] != parent
    to = blocks.start[block] - blocks.first[parent]
    up = parent[is_outside]
    keys = up * len(blocks.start) + block[is_outside]
    key = np.searchsorted(boundaries.keys, keys)
    to[is_outside] = (blocks.stops - blocks.first)[up] + place[key]
    # a run ends where places, the front, or inner unknowns of the parent do not go on
    width = blocks.width[block]
    begins_run = np.ones(len(to), dtype=bool)
    begins_run[1:] = to[1:] != (to + width)[:-1]
    begins_run[1:] |= np.diff(front) != 0
    begins_run[1:] |= is_outside[1:] != is_outside[:-1]
    starts = np.flatnonzero(begins_run)
    ends = np.append(starts, len(to))[1:] - 1
    columns = place[starts], (place + width)[ends], to[starts]
    runs = list(zip(*(column.tolist() for column in columns), strict=True))
    cuts = np.searchsorted(front[starts], np.arange(len(parents) + 1)).tolist()
    return [runs[a:b] for a, b in pairwise(cuts)]


# -- where entries go ------------------------------------------------------------------------------


def _layout(
    full: _Entries, single: _Entries, components: int, blocks: _Blocks, boundaries: _Boundaries
) -> tuple[Ints, Ints, list[int]]:
    """Return `source`, `target` and `entries` of the plan."""
    c, d = (axis.ravel() for axis in np.indices((components, components), dtype=np.int32))
    place, stride = _places(full, blocks, boundaries)
    full_target = (place[:, None] + stride[:, None] * c + d).ravel()
    full_source = full.source[:, None] + full.per_column[:, None] * c
    full_source = (full_source + full.per_row[:, None] * d).ravel()
    single_target, _ = _places(single, blocks, boundaries)

    fronts = len(blocks.stops)
    full_counts = np.bincount(blocks.front_of_position[full.column], minlength=fronts)
    single_counts = np.bincount(blocks.front_of_position[single.column], minlength=fronts)
    counts = np.column_stack([components**2 * full_counts, single_counts])
    is_single = np.repeat(np.tile([False, True], len(counts)), counts.ravel())
    source = np.empty(len(is_single), dtype=full_source.dtype)
    target = np.empty(len(is_single), dtype=np.int32)
    source[is_single] = single.source
    source[~is_single] = full_source
    target[is_single] = single_target
    target[~is_single] = full_target
    return source, target, np.append(0, np.cumsum(counts.sum(axis=1))).tolist()


def _places(entries: _Entries, blocks: _Blocks, boundaries: _Boundaries) -> tuple[Ints, Ints]:
    """Return where entries go in the panel of their front, and the length of a column there."""
    column, row = entries.column, entries.row
    front = blocks.front_of_position[column]
    first = blocks.first[front]
    width = blocks.stops[front] - first
    column_in_front = column - first
    stride = width.copy()
    place = width * column_in_front + (row - first)
    outside = np.flatnonzero(row >= blocks.stops[front])
    front, row, width = front[outside], row[outside], width[outside]
    block = blocks.of_position[row]
    keys = front.astype(np.int64) * len(blocks.start) + block
    key = np.searchsorted(boundaries.keys, keys)
    size = boundaries.sizes[front]
    stride[outside] = size
    row_in_boundary = boundaries.place[key] + (row - blocks.start[block])
    place[outside] = width**2 + size * column_in_front[outside] + row_in_boundary
    return place, stride
