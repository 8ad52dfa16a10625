"""P1 functions carried from one mesh of a body to the nodes of another, nested or not.

A point is looked for from the triangle with the nearest centre, across the edge it lies farthest behind, until it lies
behind none. Where that leads out of the mesh (the nearest centre may be across a slot) all triangles are tried that
are large enough to reach the point. Points outside the mesh (beside an arc that the mesh cuts short) get the linear
function of the triangle that they lie outside of least.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tcstudy.accuracy.norms import Triangles

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

INSIDE = -1e-10
"""Least barycentric coordinate of a point that counts as inside."""
STEPS = 200
"""Triangles a walk may cross; from the nearest centre it is a few."""
NEARBY = 24
"""Centres tried for points whose walk leaves the mesh, whatever the size of their triangles."""


def interpolation(mesh: Triangles, at: Array) -> sp.csr_array:
    """(q, n) matrix from nodal values of a P1 function to its values at the points `at` (q, 2).

    Where `at` are the nodes of a refinement of the mesh it is the exact prolongation.
    """
    found, weights = located(mesh, at)
    rows = np.repeat(np.arange(len(at)), 3)
    columns = mesh.triangles[found].ravel()
    return sp.csr_array((weights.ravel(), (rows, columns)), shape=(len(at), len(mesh.points)))


def located(mesh: Triangles, at: Array) -> tuple[Indices, Array]:
    """The triangle (q,) that each point lies in and its barycentric coordinates there (q, 3)."""
    corners = mesh.points[mesh.triangles]
    tree = cKDTree(corners.mean(axis=1))
    found = tree.query(at)[1]
    weights = _barycentric(corners, found, at)
    found, weights, lost = _walk(mesh, corners, at, found, weights)
    if len(lost):
        point, triangle = _candidates(corners, tree, at[lost])
        tried = _barycentric(corners, triangle, at[lost][point])
        depth = np.min(tried * _altitudes(corners, triangle), axis=1)
        last = np.lexsort((depth, point))[np.cumsum(np.bincount(point, minlength=len(lost))) - 1]
        found[lost], weights[lost] = triangle[last], tried[last]
    return found, weights


def _candidates(corners: Array, tree: cKDTree, at: Array) -> tuple[Indices, Indices]:
    """(point, triangle) of all triangles that may hold a point, and of the NEARBY ones of each.

    A point in a triangle is no farther from its centre than two thirds of the longest side.
    """
    near = tree.query(at, k=min(NEARBY, len(corners)))[1].reshape(len(at), -1)
    points, triangles = [np.repeat(np.arange(len(at)), near.shape[1])], [near.ravel()]
    longest = np.max(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2), axis=1)
    size = np.frexp(longest)[1]
    for exponent in np.unique(size):
        own = np.flatnonzero(size == exponent)
        reached = cKDTree(tree.data[own]).query_ball_point(at, np.ldexp(0.67, exponent))
        points.append(np.repeat(np.arange(len(at)), [len(one) for one in reached]))
        triangles.append(own[np.concatenate(reached).astype(np.intp)])
    return np.concatenate(points), np.concatenate(triangles)


def _altitudes(corners: Array, of: Indices) -> Array:
    """Heights (q, 3) of the triangles `of` above the sides opposite to their corners."""
    a, b, c = np.moveaxis(corners[of], 1, 0)
    twice = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    return np.asarray(twice[:, None] / np.linalg.norm(np.stack([c - b, a - c, b - a], axis=1), axis=2))


def _walk(mesh: Triangles, corners: Array, at: Array, found: Indices, weights: Array) -> tuple[Indices, Array, Indices]:
    """Walk all points at once; the last result are those that left the mesh or walked too long."""
    neighbour = _neighbours(mesh.triangles)
    found = found.copy()
    active = np.flatnonzero(weights.min(axis=1) < INSIDE)
    lost: list[Indices] = []
    for _ in range(STEPS):
        if not len(active):
            break
        onward = neighbour[found[active], np.argmin(weights[active], axis=1)]
        lost.append(active[onward < 0])
        active, onward = active[onward >= 0], onward[onward >= 0]
        found[active] = onward
        weights[active] = _barycentric(corners, onward, at[active])
        active = active[weights[active].min(axis=1) < INSIDE]
    return found, weights, np.concatenate([*lost, active])


def _barycentric(corners: Array, of: Indices, at: Array) -> Array:
    """Barycentric coordinates (q, 3) of points in the triangles `of`."""
    a, b, c = np.moveaxis(corners[of], 1, 0)
    ab, ac, ap = b - a, c - a, at - a
    twice = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    second = (ap[:, 0] * ac[:, 1] - ap[:, 1] * ac[:, 0]) / twice
    third = (ab[:, 0] * ap[:, 1] - ab[:, 1] * ap[:, 0]) / twice
    return np.column_stack([1.0 - second - third, second, third])


def _neighbours(triangles: Indices) -> Indices:
    """(t, 3) triangle across the edge opposite to each corner, −1 at the boundary."""
    t = len(triangles)
    sides = np.concatenate([triangles[:, [1, 2]], triangles[:, [2, 0]], triangles[:, [0, 1]]])
    key = np.sort(sides, axis=1)
    order = np.lexsort((key[:, 1], key[:, 0]))
    same = np.all(key[order[1:]] == key[order[:-1]], axis=1)
    one, other = order[:-1][same], order[1:][same]
    across = np.full(3 * t, -1, dtype=np.intp)
    across[one], across[other] = other % t, one % t
    return across.reshape(3, t).T
