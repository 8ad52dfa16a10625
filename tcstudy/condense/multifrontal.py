"""Multifrontal Cholesky A = PLLᵀPᵀ with dense fronts, one BLAS3 call for each of pivot block, panel and update.

Front f holds its own unknowns e and the later ones b that they touch:
    F_ee = LLᵀ,   X = F_be L⁻ᵀ,   U = F_bb − XXᵀ,
and U is added to the parent front. The root front is left unfactorised: it is Ã of method eq. (20).
Literature: I. S. Duff and J. K. Reid, ACM Trans. Math. Softw. 9 (1983) 302-325.
Left out: pivoting (the matrix is positive definite), supernode amalgamation, parallel subtrees.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf

from tcstudy.condense.ordering import Floats, Ints
from tcstudy.condense.symbolic import EliminationPlan, front_rows

MANY_RUNS = 24  # from here on adding element by element costs less than block by block


class NotPositiveDefinite(ValueError):
    """The matrix, or its eliminated block, is not (or, to rounding, hardly) positive definite."""

    def __init__(self, what: str) -> None:
        super().__init__(
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

    index: Ints
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


def eliminate(
    A: sp.csr_matrix | sp.csr_array, plan: EliminationPlan, probes: Floats, keep_factor: bool
) -> Elimination:
    """Eliminate all fronts but the root. Raises NotPositiveDefinite at a pivot that is not positive.

    probes: (r, N) load vectors in elimination order. They are carried as r more rows behind the kept ones
    (the matrix bordered by them), which costs nearly nothing in the BLAS3 calls that are made anyway.
    """
    fronts: list[Front] = []
    updates: dict[int, Update] = {}
    start, extra = 0, len(probes)
    rows = front_rows(A, plan)
    for f, (stop, children) in enumerate(zip(plan.stops, plan.children, strict=True)):
        below = [updates.pop(c) for c in children]
        boundary, blocks = _assemble(start, stop, next(rows), below, probes)
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
    start: int, stop: int, entries: tuple[Ints, Ints, Floats], below: list[Update], probes: Floats
) -> tuple[Ints, Blocks]:
    """Boundary and blocks of the front: matrix rows start..stop, the probes, the children's Schur complements."""
    column, row, value = entries
    extra, unknowns = probes.shape
    border = np.arange(unknowns, unknowns + extra, dtype=column.dtype)
    own = column < stop
    outside = column[~own]
    splits = [int(np.searchsorted(u.index, stop)) for u in below]
    boundary = _distinct([outside, border, *(u.index[s:] for u, s in zip(below, splits, strict=True))])
    ne, nb = stop - start, len(boundary)
    blocks = Blocks(
        np.zeros((ne, ne), order="F"), np.zeros((nb, ne), order="F"), np.zeros((nb, nb), order="F")
    )
    row = row - start
    blocks.ee[column[own] - start, row[own]] = value[own]
    blocks.be[np.searchsorted(boundary, outside), row[~own]] = value[~own]
    blocks.be[nb - extra :] = probes[:, start:stop]
    for update, split in zip(below, splits, strict=True):
        to_own = update.index[:split] - start
        to_boundary = np.searchsorted(boundary, update.index[split:])
        _extend_add(blocks, update.matrix, to_own, to_boundary)
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
    """Add the lower triangle of U to the front; its leading unknowns belong to the front, the others to the boundary.

    Both index lists increase, so they fall into a few contiguous runs, and U into blocks that NumPy adds as slices.
    """
    split = len(to_own)
    own, boundary = _runs(to_own, 0), _runs(to_boundary, split)
    if len(own) + len(boundary) > MANY_RUNS:
        blocks.ee[np.ix_(to_own, to_own)] += U[:split, :split]
        blocks.be[np.ix_(to_boundary, to_own)] += U[split:, :split]
        blocks.bb[np.ix_(to_boundary, to_boundary)] += U[split:, split:]
        return
    for k, (a, b, to) in enumerate(own):
        for c, d, into in own[k:]:
            blocks.ee[into : into + d - c, to : to + b - a] += U[c:d, a:b]
        for c, d, into in boundary:
            blocks.be[into : into + d - c, to : to + b - a] += U[c:d, a:b]
    for k, (a, b, to) in enumerate(boundary):
        for c, d, into in boundary[k:]:
            blocks.bb[into : into + d - c, to : to + b - a] += U[c:d, a:b]


def _runs(target: Ints, offset: int) -> list[tuple[int, int, int]]:
    """Maximal runs of consecutive targets as (first, behind the last, first target), sources counted from offset."""
    if len(target) == 0:
        return []
    breaks = (np.flatnonzero(target[1:] - target[:-1] != 1) + 1).tolist()
    starts = [0, *breaks]
    return list(
        zip(
            [offset + s for s in starts],
            [offset + s for s in (*breaks, len(target))],
            target[starts].tolist(),
            strict=True,
        )
    )


def _factorise(blocks: Blocks) -> tuple[Floats, Floats, Floats]:
    """L, X and U of the front, in place."""
    L, failed = dpotrf(blocks.ee, lower=1, overwrite_a=1, clean=0)
    if failed:
        raise NotPositiveDefinite("a pivot is zero or negative")
    X = dtrsm(1.0, L, blocks.be, side=1, lower=1, trans_a=1, overwrite_b=1)
    U = dsyrk(-1.0, X, beta=1.0, c=blocks.bb, lower=1, overwrite_c=1)
    return L, X, U


def forward(fronts: list[Front], y: Floats) -> None:
    """y ← L⁻¹y on the eliminated rows and y_k − A_ki A_ii⁻¹ y_i on the kept ones; y: (N, r), C order, in place."""
    if y.shape[1] == 0:
        return
    for start, stop, boundary, L, X in fronts:
        # the transpose of C-ordered rows is what BLAS wants: no copy
        dtrsm(1.0, L, y[start:stop].T, side=1, lower=1, trans_a=1, overwrite_b=1)
        if len(boundary):
            y[boundary] -= X @ y[start:stop]


def backward(fronts: list[Front], y: Floats) -> None:
    """Solve Lᵀx = y on the eliminated rows with x given on the kept ones; y: (N, r), C order, in place."""
    if y.shape[1] == 0:
        return
    for start, stop, boundary, L, X in reversed(fronts):
        if len(boundary):
            y[start:stop] -= X.T @ y[boundary]
        dtrsm(1.0, L, y[start:stop].T, side=1, lower=1, overwrite_b=1)
