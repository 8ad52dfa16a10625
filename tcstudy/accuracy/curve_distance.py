"""Distances of measured points to a polygon that may turn back in both coordinates, such as a path through folds.

Points come in the order of a test, so their feet must not go back along the polygon. Among all sequences of sides that
do not, dynamic programming finds the one of least Σ d²: exact, at n·K operations for n points and K sides. (The order
within one side is left alone: feet of neighbours may change places by less than a side.)

The distance is signed: positive on the left of the direction of travel, at a corner of that of both its sides, so that
rounding, which chooses one of them, decides nothing. By the envelope theorem its derivative by any
parameter of the curve is −nᵀ ∂(curve)/∂p at the foot, n the unit vector from foot to point, whatever coordinate along
the curve is held fixed. Left out: several measured coordinates beside the parameter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Feet:
    """Feet of n points on a polygon.

    side:     (n,) the side that a foot lies on;  share: (n,) where on it, 0 … 1
    point:    (n, 2) the feet;  distance: (n,) signed;  normal: (n, 2) with point − foot = distance × normal, length 1
    """

    side: Index
    share: Array
    point: Array
    distance: Array
    normal: Array


def feet(points: Array, corners: Array) -> Feet:
    """Feet of points (n, 2) in their order on the polygon of K + 1 corners (K + 1, 2), K ≥ 1."""
    begin, way = corners[:-1], np.diff(corners, axis=0)
    length = np.sum(way**2, axis=1)
    apart = points[:, None, :] - begin[None, :, :]
    share = np.clip(np.sum(apart * way, axis=2) / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
    square = np.sum((apart - share[:, :, None] * way) ** 2, axis=2)
    side = _in_order(square)
    rows = np.arange(len(points))
    own = share[rows, side]
    foot = begin[side] + own[:, None] * way[side]
    across = points - foot
    distance = np.sqrt(square[rows, side])
    lefts = np.stack([-way[:, 1], way[:, 0]], axis=1)
    lefts /= np.maximum(np.linalg.norm(lefts, axis=1), np.finfo(float).tiny)[:, None]
    left, last = lefts[side], len(way) - 1
    other = np.clip(
        side + (own == 1.0) - (own == 0.0), 0, last
    )  # the other side of a corner, which is as near as its own
    sign = np.where(np.sum(across * (left + lefts[other]), axis=1) >= 0.0, 1.0, -1.0)
    near = distance <= 1e-12 * np.maximum(np.max(np.abs(points), axis=1), np.sqrt(np.max(length)))
    normal = np.where(near[:, None], left, across / np.where(near, 1.0, sign * distance)[:, None])
    return Feet(side, own, foot, sign * distance, normal)


def _in_order(square: Array) -> Index:
    """(n,) sides of least sum of squares (n, K) that never go back."""
    n, K = square.shape
    total, came = square[0], np.zeros((n, K), dtype=np.intp)
    for i in range(1, n):
        least = np.minimum.accumulate(total)
        first = np.concatenate([[True], total[1:] < least[:-1]])  # the latest side that set the minimum
        came[i] = np.maximum.accumulate(np.where(first, np.arange(K), 0))
        total = least + square[i]
    side = np.empty(n, dtype=np.intp)
    side[-1] = int(np.argmin(total))
    for i in range(n - 1, 0, -1):
        side[i - 1] = came[i, side[i]]
    return side
