"""Orthonormal bases for the mean of Y at a given X: splines on values or ranks, broken
lines, classes, jumps.

Splines are cubic B-splines with knots at quantiles, broken lines jump at quantiles. The constant is
in the span of every basis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.linalg import LinAlgError, solve_triangular
from scipy.stats import rankdata

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

SPLINE_PIECES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
"""Numbers of pieces of the splines that are tried."""
LINE_PIECES = (4, 8, 16, 32, 64)
"""Numbers of pieces of the broken lines that are tried."""
POINTS_PER_PIECE = 8
"""A spline has at least so many points per piece."""
POINTS_PER_LINE = 16
"""A broken line has at least so many points per piece."""
VALUES_PER_PIECE = 4
"""A basis has at least so many distinct values of X per piece."""
MAX_CLASSES = 10
"""An input of up to so many distinct values gets a class for each value."""
MIN_PIVOT = 1e-5
"""Smallest pivot of a Cholesky factor, relative to the largest, that is trusted."""
MIN_SINGULAR_VALUE = 1e-9
"""Smaller singular values, relative to the largest, count as zero."""
MIN_INDEPENDENT_SHARE = 0.02
"""A step is no candidate if less than this share of it lies outside the basis."""


@dataclass(frozen=True, eq=False)
class Ordering:
    """The points in the order of an input.

    order:      (N,) indices that sort the input
    is_apart:   (N − 1,) whether neighbours in that order differ
    end_points: number of points that lie at least between a jump and either end
    """

    order: Index
    is_apart: Flags
    end_points: int

    @classmethod
    def of(cls, x: Array) -> Ordering:
        """Return the ordering of an input (N,)."""
        order = np.argsort(x, kind="stable")
        return cls(order, np.diff(x[order]) > 0.0, max(6, int(np.sqrt(len(x))) // 2))


def constant_basis(count: int) -> Array:
    """Return the basis (N, 1) of the constants."""
    return np.full((count, 1), count**-0.5)


def class_basis(x: Array) -> Array:
    """Return the basis (N, classes) with a column for each value of x."""
    _, class_of_point, counts = np.unique(x, return_inverse=True, return_counts=True)
    basis = np.zeros((len(x), len(counts)))
    basis[np.arange(len(x)), class_of_point] = 1.0 / np.sqrt(counts[class_of_point])
    return basis


def scales(x: Array) -> tuple[Array, Array]:
    """Return the standardised values of x and its ranks divided by N."""
    return (x - x.mean()) / x.std(), np.asarray(rankdata(x) / len(x))


def spline_pieces(x: Array) -> list[int]:
    """Return the numbers of pieces of the splines that the points of x can determine."""
    by_values = len(np.unique(x)) // VALUES_PER_PIECE
    most = max(1, min(len(x) // POINTS_PER_PIECE, by_values))
    return [pieces for pieces in SPLINE_PIECES if pieces <= most]


def line_pieces(x: Array) -> list[int]:
    """Return the numbers of pieces of the broken lines that the points of x can determine."""
    by_values = len(np.unique(x)) // VALUES_PER_PIECE
    most = min(len(x) // POINTS_PER_LINE, by_values)
    return [pieces for pieces in LINE_PIECES if pieces <= most]


def spline_basis(x: Array, pieces: int) -> Array:
    """Return the basis (N, p) of the cubic splines with knots at quantiles of x."""
    knots = np.unique(np.quantile(x, np.linspace(0.0, 1.0, pieces + 1)))
    low, high = knots[0], knots[-1]
    ends = np.ones(3)
    all_knots = np.concatenate([low * ends, knots, high * ends])
    return orthonormal(BSpline.design_matrix(np.clip(x, low, high), all_knots, 3).toarray())


def line_basis(x: Array, pieces: int) -> Array:
    """Return the basis (N, p) of lines that are broken at quantiles of x, with jumps there."""
    breaks = np.unique(np.quantile(x, np.arange(1, pieces) / pieces))
    piece_of_point = np.searchsorted(breaks, x, side="right")
    steps = class_basis(piece_of_point.astype(float))
    lines = steps * x[:, None]
    lines -= steps * np.sum(steps * lines, axis=0)
    lengths = np.linalg.norm(lines, axis=0)
    is_line = lengths > MIN_PIVOT * np.ptp(x)
    return np.concatenate([steps, lines[:, is_line] / lengths[is_line]], axis=1)


def orthonormal(columns: Array) -> Array:
    """Return an orthonormal basis of the span of columns (N, p)."""
    try:
        factor = np.linalg.cholesky(columns.T @ columns)
        pivots = factor.diagonal()
        if pivots.min() > MIN_PIVOT * pivots.max():
            return np.asarray(solve_triangular(factor, columns.T, lower=True).T)
    except LinAlgError:  # the columns depend on each other: singular values tell how many do not
        pass
    left, singular_values, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, singular_values > MIN_SINGULAR_VALUE * singular_values[0]])


def with_best_step(basis: Array, residual: Array, ordering: Ordering) -> Array | None:
    """Return the basis and the step between neighbours that explains most of the residual.

    Return None if no place is left for a step.
    """
    count, order = len(residual), ordering.order
    points_left = np.arange(1, count + 1)
    fewer_points = np.minimum(points_left, count - points_left)
    sums = np.cumsum(residual[order])
    projections = np.cumsum(basis[order], axis=0)
    # squared length of the part of each step that the basis does not have
    outside = points_left - np.einsum("ij,ij->i", projections, projections)
    is_candidate = outside > MIN_INDEPENDENT_SHARE * fewer_points
    is_candidate[:-1] &= ordering.is_apart
    is_candidate &= fewer_points >= ordering.end_points
    if not np.any(is_candidate):
        return None
    gain = np.divide(sums**2, outside, out=np.zeros(count), where=is_candidate)
    step = np.zeros(count)
    step[order[: int(np.argmax(gain)) + 1]] = 1.0
    for _ in range(2):  # the second projection takes off what rounding left of the first
        step -= basis @ (basis.T @ step)
    return np.column_stack([basis, step / np.linalg.norm(step)])
