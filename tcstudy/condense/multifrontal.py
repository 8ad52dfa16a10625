"""Multifrontal Cholesky A = PLLᵀPᵀ with dense fronts, one BLAS3 call for each of pivot block, panel and update.

Front f holds its own unknowns e and the later ones b that they touch:
    F_ee = LLᵀ,   X = F_be L⁻ᵀ,   U = F_bb − XXᵀ,
and U is added to the parent front. The root front is left unfactorised: it is Ã of method eq. (20).
Literature: I. S. Duff and J. K. Reid, ACM Trans. Math. Softw. 9 (1983) 302-325.
Left out: pivoting (the matrix is positive definite), supernode amalgamation, parallel subtrees.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf

from tcstudy.condense.ordering import Floats, Ints
from tcstudy.condense.symbolic import EliminationPlan, FrontEntries, front_entries

MANY_RUNS = 24  # from here on adding element by element costs less than block by block


class NotPositiveDefinite(ValueError):
    """The matrix, or its eliminated block, is not (or, to rounding, hardly) positive definite."""


def not_held(what: str) -> NotPositiveDefinite:
    """The error with its likely causes."""
    return NotPositiveDefinite(
        f"the matrix is not positive definite: {what}. Likely causes: the body, or a part of it, is not held "
        "(nothing clamps it, or a boundary name is misspelt); a Poisson ratio ≥ 0.5 or a modulus ≤ 0; a heat "
        "problem without heat exchange"
    )


class Front(NamedTuple):
    """Columns start..stop of the factor: L on the diagonal (lower triangle valid), X at the rows `boundary`."""

    start: int
    stop: int
    boundary: Ints
    L: Floats
    X: Floats


class Update(NamedTuple):
    """Schur complement that a front hands to its parent: positions and matrix (lower triangle valid)."""

    boundary: Ints
    matrix: Floats


class Blocks(NamedTuple):
    """A front under assembly: own block, boundary by own, boundary block (lower triangles valid)."""

    ee: Floats
    be: Floats
    bb: Floats


@dataclass(frozen=True)
class Elimination:
    """What is left at the root.

    fronts: the factor (empty if not kept)
    root:   (m, m), Ã in its lower triangle, in elimination order
    loads:  (m, r) the probes g condensed like loads, g_k − A_ki A_ii⁻¹ g_i
    energy: (r,) g_iᵀ A_ii⁻¹ g_i
    """

    fronts: list[Front]
    root: Floats
    loads: Floats
    energy: Floats


def eliminate(A: sp.csr_matrix | sp.csr_array, plan: EliminationPlan, probes: Floats, keep_factor: bool) -> Elimination:
    """Eliminate all fronts but the root. Raises NotPositiveDefinite at a pivot that is not positive.

    probes: (r, N) load vectors in elimination order. They are carried as r more rows behind the kept ones
    (the matrix bordered by them), which costs nearly nothing in the BLAS3 calls that are made anyway.
    """
    fronts: list[Front] = []
    updates: dict[int, Update] = {}
    local = np.empty(sum(probes.shape), dtype=np.intp)
    start, extra = 0, len(probes)
    entries = front_entries(A, plan)
    for f, (stop, children) in enumerate(zip(plan.stops, plan.children, strict=True)):
        below = [updates.pop(c) for c in children]
        boundary, blocks = _assemble(start, stop, next(entries), below, probes, local)
        if f == len(plan.stops) - 1:
            return Elimination(fronts, blocks.ee, blocks.be.T, -blocks.bb.diagonal())
        if stop > start:
            L, X, U = _factorise(blocks)
            updates[f] = Update(boundary, U)
            if keep_factor:
                fronts.append(Front(start, stop, boundary[:-extra], L, X[:-extra]))
        else:
            updates[f] = Update(boundary, blocks.bb)
        start = stop
    raise AssertionError("the plan has no root front")


def _assemble(
    start: int, stop: int, entries: FrontEntries, below: list[Update], probes: Floats, local: Ints
) -> tuple[Ints, Blocks]:
    """Boundary and blocks of the front: matrix rows start..stop, the probes, the children's Schur complements.

    local: work space, (N + r,); the number of an unknown within the boundary of the front at hand.
    """
    column, row, value = entries.column, entries.row - np.int32(start), entries.value
    own = column < stop
    outside = ~own
    behind = column[outside]
    extra, unknowns = probes.shape
    border = np.arange(unknowns, unknowns + extra, dtype=np.int32)
    splits = [int(u.boundary.searchsorted(np.int32(stop))) for u in below]
    boundary = _distinct([behind, border, *(u.boundary[s:] for u, s in zip(below, splits, strict=True))])
    ne, nb = stop - start, len(boundary)
    local[boundary] = np.arange(nb)
    blocks = Blocks(np.zeros((ne, ne), order="F"), np.zeros((nb, ne), order="F"), np.zeros((nb, nb), order="F"))
    blocks.ee[column[own] - start, row[own]] = value[own]
    blocks.be[local[behind], row[outside]] = value[outside]
    blocks.be[nb - extra :] = probes[:, start:stop]
    for update, split in zip(below, splits, strict=True):
        _extend_add(blocks, update.matrix, update.boundary[:split] - start, local[update.boundary[split:]])
    return boundary, blocks


def _distinct(parts: list[Ints]) -> Ints:
    """Sorted distinct entries of all parts (np.unique without its overhead: called once a front)."""
    merged = np.concatenate(parts)
    merged.sort()
    new = np.empty(len(merged), dtype=bool)
    new[0] = True
    np.not_equal(merged[1:], merged[:-1], out=new[1:])
    return merged[new]


def _extend_add(blocks: Blocks, U: Floats, to_own: Ints, to_boundary: Ints) -> None:
    """Add the lower triangle of U to the front; its leading unknowns are the front's own, the others the boundary's.

    Both index lists increase and fall into a few contiguous runs, and U into blocks that are added as slices.
    """
    split = len(to_own)
    own, boundary = _runs(to_own, 0), _runs(to_boundary, split)
    if len(own) + len(boundary) > MANY_RUNS:
        blocks.ee[np.ix_(to_own, to_own)] += U[:split, :split]
        blocks.be[np.ix_(to_boundary, to_own)] += U[split:, :split]
        blocks.bb[np.ix_(to_boundary, to_boundary)] += U[split:, split:]
        return
    for k, (first, last, columns) in enumerate(own):
        for a, b, rows in own[k:]:
            target = blocks.ee[rows, columns]
            target += U[a:b, first:last]
        for a, b, rows in boundary:
            target = blocks.be[rows, columns]
            target += U[a:b, first:last]
    for k, (first, last, columns) in enumerate(boundary):
        for a, b, rows in boundary[k:]:
            target = blocks.bb[rows, columns]
            target += U[a:b, first:last]


def _runs(target: Ints, offset: int) -> list[tuple[int, int, slice]]:
    """Maximal runs of consecutive targets: (first, behind the last) source, counted from offset, and the targets."""
    if len(target) == 0:
        return []
    breaks = (np.flatnonzero(target[1:] - target[:-1] != 1) + 1).tolist()
    bounds = [0, *breaks, len(target)]
    starts = target[bounds[:-1]].tolist()
    return [
        (offset + a, offset + b, slice(to, to + b - a))
        for a, b, to in zip(bounds[:-1], bounds[1:], starts, strict=True)
    ]


def _factorise(blocks: Blocks) -> tuple[Floats, Floats, Floats]:
    """L, X and U of the front, in place."""
    L, failed = dpotrf(blocks.ee, lower=1, overwrite_a=1, clean=0)
    if failed:
        raise not_held("a pivot is zero or negative")
    X = dtrsm(1.0, L, blocks.be, side=1, lower=1, trans_a=1, overwrite_b=1)
    U = dsyrk(-1.0, X, beta=1.0, c=blocks.bb, lower=1, overwrite_c=1)
    return L, X, U


def forward(fronts: Sequence[Front], y: Floats) -> None:
    """y ← L⁻¹y on the eliminated rows and y_k − A_ki A_ii⁻¹ y_i on the kept ones; y: (N, r), C order, in place."""
    if y.shape[1] == 0:
        return
    for start, stop, boundary, L, X in fronts:
        # the transpose of C-ordered rows is what BLAS wants: no copy
        dtrsm(1.0, L, y[start:stop].T, side=1, lower=1, trans_a=1, overwrite_b=1)
        if len(boundary):
            y[boundary] -= X @ y[start:stop]


def backward(fronts: Sequence[Front], y: Floats) -> None:
    """Solve Lᵀx = y on the eliminated rows with x given on the kept ones; y: (N, r), C order, in place."""
    if y.shape[1] == 0:
        return
    for start, stop, boundary, L, X in reversed(fronts):
        if len(boundary):
            y[start:stop] -= X.T @ y[boundary]
        dtrsm(1.0, L, y[start:stop].T, side=1, lower=1, overwrite_b=1)
