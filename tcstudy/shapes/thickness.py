"""How thick a plane body is behind points of its boundary."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

OUTSIDE = 1e-9
"""Distance along a ray, relative to the boundary's extent, at which it has left its own edge."""


def thickness(points: Array, normals: Array, boundary: Sequence[Array]) -> Array:
    """Return (n,) the distance from points of the boundary straight into the body and out of it.

    It is ∞ where no ray along ±n enters the body, as beside curves drawn as polygons.
    points, normals: (n, 2), unit normals of either sign
    boundary:        pieces (k, 2) as polygonal lines, holes included
    """
    distances = np.full(len(points), np.inf)
    for i, (point, normal) in enumerate(zip(points, normals, strict=True)):
        for direction in (normal, -normal):
            met = _crossings(point, direction, boundary)
            if len(met) % 2 == 1:  # a ray that begins outside leaves as often as it enters
                distances[i] = np.min(met)
    return distances


def reach(points: Array, normals: Array, pieces: Sequence[Array]) -> Array:
    """Return (n,) the distance along ±n to the nearest of some pieces, ∞ where none is met."""
    distances = np.full(len(points), np.inf)
    for i, (point, normal) in enumerate(zip(points, normals, strict=True)):
        met = [_crossings(point, direction, pieces) for direction in (normal, -normal)]
        distances[i] = np.min(np.concatenate(met), initial=np.inf)
    return distances


def _crossings(point: Array, direction: Array, pieces: Sequence[Array]) -> Array:
    """Return the distances at which a ray meets polygonal lines, without its own start."""
    starts = np.concatenate([piece[:-1] for piece in pieces])
    along = np.concatenate([np.diff(piece, axis=0) for piece in pieces])
    extent = float(np.max(np.ptp(np.concatenate(pieces), axis=0)))
    # point + r direction = start + s along, by Cramer's rule
    offset = starts - point
    determinant = direction[0] * along[:, 1] - direction[1] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        r = (offset[:, 0] * along[:, 1] - offset[:, 1] * along[:, 0]) / determinant
        s = (offset[:, 0] * direction[1] - offset[:, 1] * direction[0]) / determinant
    is_met = (s >= 0.0) & (s < 1.0) & (r > OUTSIDE * extent)
    return np.asarray(r[is_met])
