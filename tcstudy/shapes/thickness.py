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

    It is ∞ where the ray −n meets no other piece, which happens beside curves drawn as polygons.
    points, normals: (n, 2), normals outward and of length 1
    boundary:        pieces (k, 2) as polygonal lines, holes included
    """
    starts = np.concatenate([piece[:-1] for piece in boundary])
    along = np.concatenate([np.diff(piece, axis=0) for piece in boundary])
    extent = float(np.max(np.ptp(starts, axis=0)))
    distances = np.full(len(points), np.inf)
    for i, (point, normal) in enumerate(zip(points, normals, strict=True)):
        # point − r n = start + s along, by Cramer's rule
        offset = starts - point
        determinant = -normal[0] * along[:, 1] + normal[1] * along[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            r = (offset[:, 0] * along[:, 1] - offset[:, 1] * along[:, 0]) / determinant
            s = (offset[:, 1] * normal[0] - offset[:, 0] * normal[1]) / determinant
        is_met = (s >= 0.0) & (s <= 1.0) & (r > OUTSIDE * extent)
        distances[i] = np.min(r[is_met], initial=np.inf)
    return distances
