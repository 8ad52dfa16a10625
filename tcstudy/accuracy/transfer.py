"""Exact prolongation between the P1 spaces of uniformly refined meshes.

A uniform refinement keeps the coarse nodes with their numbers and adds one node per coarse edge. Every edge of the
fine mesh from a new node to an old one is half of the coarse edge, so the topology alone names the two parents of a
new node. On straight boundaries the new node is the midpoint, the coarse space is a subspace of the fine one and the
prolongation is exact. On a curved boundary the new node moves to the arc: the spaces are then not nested, and the
prolongation is the coarse function carried along with the moved nodes (`off_midpoint` says how far they moved).

P1 functions carried from one mesh of a body to the nodes of another, nested or not.

Points outside the mesh (beside an arc that it cuts short) get the linear function of the triangle nearest to them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.shapes.triangles import TriangleGeometry

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class NotNested(ValueError):
    """The fine mesh is no uniform refinement of the coarse one."""


@dataclass(frozen=True)
class Prolongation:
    """From a coarse mesh to its uniform refinement.

    matrix:       (n_fine, n_coarse) P: nodal values of a coarse P1 function on the fine mesh
    off_midpoint: largest distance of a new node from the midpoint of its parents, over their distance
    """

    matrix: sp.csr_array
    off_midpoint: float

    def __call__(self, values: Array) -> Array:
        """P applied to (…, n_coarse) nodal values."""
        return np.asarray((self.matrix @ values.T).T)


def prolongation(coarse_points: Array, fine_points: Array, fine_triangles: Indices) -> Prolongation:
    """P between two consecutive levels. Raises NotNested if they are not a mesh and its uniform refinement."""
    n, n_fine = len(coarse_points), len(fine_points)
    if n_fine <= n or not np.array_equal(fine_points[:n], coarse_points):
        raise NotNested("the fine mesh does not begin with the nodes of the coarse one")
    sides = np.concatenate([fine_triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    half = (sides >= n).sum(axis=1) == 1
    pairs = np.unique(np.sort(sides[half], axis=1), axis=0)
    new, counts = np.unique(pairs[:, 1], return_counts=True)
    if not np.array_equal(new, np.arange(n, n_fine)) or np.any(counts != 2):
        raise NotNested("a new node of the fine mesh does not lie between exactly two coarse nodes")
    parents = pairs[np.argsort(pairs[:, 1], kind="stable"), 0].reshape(-1, 2)
    ends = coarse_points[parents]
    moved = np.linalg.norm(fine_points[n:] - ends.mean(axis=1), axis=1)
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    rows = np.concatenate([np.arange(n), np.repeat(np.arange(n, n_fine), 2)])
    columns = np.concatenate([np.arange(n), parents.ravel()])
    entries = np.concatenate([np.ones(n), np.full(2 * len(parents), 0.5)])
    matrix = sp.csr_array((entries, (rows, columns)), shape=(n_fine, n))
    return Prolongation(matrix, float(np.max(moved / length)))


INSIDE = -1e-10
"""Least barycentric coordinate of a point that counts as inside."""


def interpolation(mesh: TriangleGeometry, at: Array) -> sp.csr_array:
    """(q, n) matrix from nodal values of a P1 function to its values at the points `at` (q, 2).

    Where `at` are the nodes of a refinement of the mesh it is the exact prolongation.
    """
    found, weights = located(mesh, at)
    rows = np.repeat(np.arange(len(at)), 3)
    columns = mesh.triangles[found].ravel()
    return sp.csr_array((weights.ravel(), (rows, columns)), shape=(len(at), len(mesh.points)))


def located(mesh: TriangleGeometry, at: Array) -> tuple[Indices, Array]:
    """The triangle (q,) that each point lies in, or that is nearest to it, and its barycentric coordinates (q, 3)."""
    from scipy.spatial import cKDTree  # here, because a run imports this module and seldom needs it

    found = cKDTree(mesh.centres).query(at)[1]
    weights = mesh.barycentric(at, found)
    lost = np.flatnonzero(weights.min(axis=1) < INSIDE)
    if len(lost):
        import shapely

        found[lost] = shapely.STRtree(shapely.polygons(mesh.corners)).nearest(shapely.points(at[lost]))
        weights[lost] = mesh.barycentric(at[lost], found[lost])
    return found, weights
