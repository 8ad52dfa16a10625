"""Where points lie in a triangle mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.shapes.edges import TriangleGeometry

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

INSIDE = -1e-10
"""Smallest barycentric coordinate of a point that counts as inside."""


def located(mesh: TriangleGeometry, points: Array) -> tuple[Indices, Array]:
    """Return the triangle (q,) of each point and its barycentric coordinates (q, 3).

    It is the triangle in which the point lies, or the nearest one.
    """
    from scipy.spatial import cKDTree  # here, because a run imports this module and seldom needs it

    triangle = cKDTree(mesh.centres).query(points)[1]
    weights = mesh.barycentric(points, triangle)
    elsewhere = np.flatnonzero(weights.min(axis=1) < INSIDE)
    if len(elsewhere):
        import shapely

        tree = shapely.STRtree(shapely.polygons(mesh.corners))
        triangle[elsewhere] = tree.nearest(shapely.points(points[elsewhere]))
        weights[elsewhere] = mesh.barycentric(points[elsewhere], triangle[elsewhere])
    return triangle, weights
