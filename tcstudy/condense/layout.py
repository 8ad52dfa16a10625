"""Where everything goes, found once for all fronts: entries of the matrix, Schur complements of the children.

The boundary of a front (later unknowns that it touches) is that of its children and of its own rows. All fronts of
one level of the dissection are united at a time, node by node: one sort of (front, node) pairs in place of work for
every front.
Literature: J. W. H. Liu, SIAM Review 34 (1992) 82-109.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from zlib import crc32

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

Ints = NDArray[np.integer]
Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

WINDOW_ROWS = 1 << 13  # rows permuted at a time: bounds the memory, long enough for NumPy
WINDOW_PANELS = 1 << 17  # numbers in the panels that are set up at a time: about what a cache holds
CARRIED = 4  # rows of loads that are carried along behind the last unknown

Run = tuple[int, int, int]
"""Rows first..last−1 of a Schur complement go to consecutive places, from the third number on."""


@dataclass(frozen=True)
class Tree:
    """The dissection tree by heap label; front 0 is the root of kept unknowns.

    labels: label of every front, in elimination order
    parent: label of the front that takes over its Schur complement, for every label
    depths: of the fronts, from the leaves up
    """

    labels: Ints
    parent: Ints
    depths: list[int]


@dataclass(frozen=True)
class Group:
    """Fronts first..last−1, whose panels are set up together in `size` numbers, and the matrix entries in them."""

    first: int
    last: int
    size: int
    entries: slice


@dataclass(frozen=True)
class Layout:
    """The panel of a front is its own block, then its boundary by its own unknowns; both in Fortran order.

    boundaries: later unknowns that a front touches, by position; the carried rows are the unknowns from N on
    runs:       where its Schur complement goes: into own unknowns of the parent, into the parent's boundary
    groups:     the fronts, in order
    source:     where the entries on and right of the diagonal are in A.data, front by front
    target:     where they go in the panels of their group
    pattern:    fingerprint of the pattern of the matrix laid out (pattern_of)
    """

    boundaries: list[NDArray[np.int32]]
    runs: list[tuple[list[Run], list[Run]]]
    groups: list[Group]
    source: NDArray[np.int32]
    target: NDArray[np.int32]
    pattern: tuple[int, int, int]


def pattern_of(A: sp.csr_matrix | sp.csr_array) -> tuple[int, int, int]:
    """Number of entries, checksums of their columns and of where rows start: what matrices of one pattern share."""
    return A.nnz, crc32(A.indices.data), crc32(A.indptr.data)


@dataclass(frozen=True)
class Unknowns:
    """By position: label of the front, first position of the same node, and at that position how many the node has."""

    label: Ints
    first: Ints
    count: Ints


@dataclass(frozen=True)
class _Fronts:
    """By label. first: position of the first own unknown; own, rows: sizes of the front and of its boundary; offset: of
    the panel in its group."""

    first: Ints
    own: Ints
    rows: Ints
    offset: Ints


@dataclass(frozen=True)
class _Touched:
    """Nodes of all boundaries. keys: label·span + first position, sorted; label and node: the two parts of a key;
    width: unknowns of the node; place: of the first of them in its boundary."""

    keys: Ints
    label: Ints
    node: Ints
    width: Ints
    place: Ints


def lay_out(
    A: sp.csr_matrix | sp.csr_array,
    permutation: Ints,
    position: NDArray[np.int32],
    tree: Tree,
    unknowns: Unknowns,
    touching: tuple[Ints, Ints],
) -> Layout:
    """touching: positions i < j, the first ones of their nodes, of nodes that share an edge.

    The carried rows count as one more node, at position N, that every front touches.
    """
    span, labels = len(permutation) + 1, tree.labels
    low, high = unknowns.label[touching[0]], touching[1]
    outside = low != unknowns.label[high]
    keys = _boundaries(_distinct(low[outside] * span + high[outside]), unknowns.label, tree, span)
    carried = np.sort(labels) * span + span - 1
    keys = np.insert(keys, np.searchsorted(keys, carried), carried)
    label, node = keys // span, keys % span
    ends = np.searchsorted(label, np.arange(len(tree.parent)), side="right")
    begins = np.append(0, ends[:-1])
    width = unknowns.count[node]
    behind = np.append(0, np.cumsum(width))
    start, rows = behind[begins], behind[ends] - behind[begins]
    touched = _Touched(keys, label, node, width, behind[:-1] - start[label])

    sizes = np.bincount(unknowns.label, minlength=len(tree.parent))
    sizes_in_order = sizes[labels]
    stops = np.cumsum(sizes_in_order)
    panels = sizes_in_order * (sizes_in_order + rows[labels])
    cuts = _groups(panels.tolist())
    before = np.cumsum(panels) - panels
    first, offset = np.zeros((2, len(sizes)), dtype=np.int64)
    first[labels] = stops - sizes_in_order
    offset[labels] = before - np.repeat(before[cuts[:-1]], np.diff(cuts))
    source, target, counts = _entries(
        A, permutation, position, unknowns, _Fronts(first, sizes, rows, offset), touched, span
    )

    at = np.append(0, np.cumsum(counts))[np.append(0, stops)[cuts]].tolist()
    boundary = (np.arange(behind[-1]) + np.repeat(node - behind[:-1], width)).astype(np.int32)
    of_front = zip(start[labels].tolist(), (start + rows)[labels].tolist(), strict=True)
    totals = np.add.reduceat(panels, cuts[:-1]).tolist()
    return Layout(
        boundaries=[boundary[a:b] for a, b in of_front],
        runs=_runs(tree, touched, np.append(unknowns.label, -1), first, begins, ends, span),
        groups=[
            Group(begin, end, total, slice(a, b))
            for begin, end, total, a, b in zip(cuts[:-1], cuts[1:], totals, at[:-1], at[1:], strict=True)
        ],
        source=source,
        target=target,
        pattern=pattern_of(A),
    )


def _entries(
    A: sp.csr_matrix | sp.csr_array,
    permutation: Ints,
    position: NDArray[np.int32],
    unknowns: Unknowns,
    fronts: _Fronts,
    touched: _Touched,
    span: int,
) -> tuple[NDArray[np.int32], NDArray[np.int32], Ints]:
    """Source and target of all entries on and right of the diagonal, and how many are in every row.

    Own column c of row r: offset + (r − first)·own + c − first; of the boundary: offset + own² + (r − first)·rows
    + place.
    """
    label = unknowns.label
    first, own = fronts.first[label], fronts.own[label]
    row_in_front = np.arange(span - 1) - first
    inside = (fronts.offset[label] - first + row_in_front * own).astype(np.int32)
    outside = (fronts.offset[label] + own * own + row_in_front * fronts.rows[label]).astype(np.int32)
    stop, of_row, place = (first + own).astype(np.int32), label * span, touched.place.astype(np.int32)
    parts: list[tuple[NDArray[np.int32], NDArray[np.int32], Ints]] = []
    for source, row, column, counts in _upper_entries(A, permutation, position):
        target = inside[row] + column
        out = np.flatnonzero(column >= stop[row])
        r, c = row[out], column[out]
        node = unknowns.first[c]
        target[out] = outside[r] + place[np.searchsorted(touched.keys, of_row[r] + node)] + (c - node)
        parts.append((source, target, counts))
    sources, targets, counted = zip(*parts, strict=True)
    return np.concatenate(sources), np.concatenate(targets), np.concatenate(counted)


def _upper_entries(
    A: sp.csr_matrix | sp.csr_array, permutation: Ints, position: NDArray[np.int32]
) -> Iterator[tuple[NDArray[np.int32], Ints, Ints, Ints]]:
    """Entries on and right of the diagonal of the permuted matrix, some rows at a time.

    Where each is in A.data, its row, its column, all row by row, and the number of entries of every row.
    """
    numbered = sp.csr_array((np.arange(A.nnz, dtype=np.int32), A.indices, A.indptr), shape=A.shape)
    for start in range(0, len(permutation), WINDOW_ROWS):
        rows = numbered[permutation[start : start + WINDOW_ROWS]]
        column = position[rows.indices]
        row = np.repeat(np.arange(start, start + rows.shape[0], dtype=np.int32), np.diff(rows.indptr))
        use = np.flatnonzero(column >= row)  # leaves out what takes no part, at −1
        row = row[use]
        yield rows.data[use], row, column[use], np.bincount(row - start, minlength=rows.shape[0])


def _boundaries(keys: Ints, label: Ints, tree: Tree, span: int) -> Ints:
    """Sorted keys label·span + position of all boundaries, from those that the rows of the fronts themselves touch."""
    levels = []
    above = np.zeros(0, dtype=np.int64)
    stop = len(keys)
    for d in tree.depths:
        cut = int(np.searchsorted(keys, span << d))
        here = _distinct(np.concatenate([keys[cut:stop], above])) if len(above) else keys[cut:stop]
        levels.append(here)
        owner, unknown = here // span, here % span
        parent = tree.parent[owner]
        outside = label[unknown] != parent
        above, stop = parent[outside] * span + unknown[outside], cut
    return np.concatenate(levels[::-1]) if levels else keys


def _distinct(keys: Ints) -> Ints:
    """Sorted, each once."""
    keys = np.sort(keys)
    return keys[np.append(True, keys[1:] != keys[:-1])] if len(keys) else keys


def _groups(sizes: list[int]) -> list[int]:
    """First front of every group, and behind the last one."""
    cuts, total = [0], 0
    for f, size in enumerate(sizes):
        if total and total + size > WINDOW_PANELS:
            cuts.append(f)
            total = 0
        total += size
    return [*cuts, len(sizes)]


def _runs(
    tree: Tree, touched: _Touched, label: Ints, first: Ints, begins: Ints, ends: Ints, span: int
) -> list[tuple[list[Run], list[Run]]]:
    """Of every front: maximal runs of its boundary that are consecutive in the parent.

    label: of every position, −1 for the carried rows; begins, ends: of every boundary among all nodes touched
    """
    node, width, place = touched.node, touched.width, touched.place
    parent = tree.parent[touched.label]
    own = label[node] == parent
    to = node - first[parent]
    out = np.flatnonzero(~own & (touched.label > 0))
    to[out] = place[np.searchsorted(touched.keys, parent[out] * span + node[out])]
    breaks = np.ones(len(node), dtype=bool)
    breaks[1:] = (to[1:] != to[:-1] + width[:-1]) | (touched.label[1:] != touched.label[:-1]) | (own[1:] != own[:-1])
    at = np.flatnonzero(breaks)
    last = np.append(at[1:], len(node)) - 1
    runs = list(zip(place[at].tolist(), (place + width)[last].tolist(), to[at].tolist(), strict=True))
    before = np.append(0, np.cumsum(breaks))
    of_parent = np.append(0, np.cumsum(own[at]))
    i, k = before[begins], before[ends]
    split = i + of_parent[k] - of_parent[i]  # own unknowns of the parent come before its boundary
    cuts = np.stack([i, split, k])[:, tree.labels].tolist()
    return [(runs[a:b], runs[b:c]) for a, b, c in zip(*cuts, strict=True)]
