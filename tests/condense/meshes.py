"""P1 matrices on small triangulations, in plain NumPy, for the tests of the condensation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.spatial import Delaunay

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mesh:
    """Points (nv, 2) and triangles (nt, 3)."""

    points: Array
    triangles: NDArray[np.int64]

    def nodes(self, where: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Nodes in the mask, by x then y."""
        found = np.flatnonzero(where)
        return found[np.lexsort((self.points[found, 1], self.points[found, 0]))]


def plate(n: int, hole: bool = False, grading: float = 1.0, seed: int | None = None) -> Mesh:
    """(0, 2) x (0, 1) with 2n x n cells, optionally with a hole, graded towards x = 0, or with inner nodes moved."""
    x, y = np.meshgrid(np.linspace(0, 1, 2 * n + 1) ** grading * 2, np.linspace(0, 1, n + 1), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel()])
    if seed is not None:
        inner = (points[:, 0] > 0) & (points[:, 0] < 2) & (points[:, 1] > 0) & (points[:, 1] < 1)
        shift = np.random.default_rng(seed).uniform(-0.3 / n, 0.3 / n, points.shape)
        points = points + inner[:, None] * shift
    triangles = Delaunay(points).simplices.astype(np.int64)
    corner = points[triangles]
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    triangles = triangles[np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) > 1e-3 / n**2 * (2 / n) ** (grading - 1)]
    if hole:
        centre = points[triangles].mean(axis=1)
        triangles = triangles[np.hypot(centre[:, 0] - 1.1, centre[:, 1] - 0.5) > 0.27]
        used, triangles = np.unique(triangles, return_inverse=True)
        points, triangles = points[used], triangles.reshape(-1, 3)
    return Mesh(points, triangles)


def gradients(mesh: Mesh) -> tuple[Array, Array]:
    """(nt, 3, 2) gradients of the hat functions and (nt,) areas."""
    corner = mesh.points[mesh.triangles]
    edge = np.stack([corner[:, 2] - corner[:, 1], corner[:, 0] - corner[:, 2], corner[:, 1] - corner[:, 0]], axis=1)
    twice = edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0]
    return np.stack([-edge[..., 1], edge[..., 0]], axis=-1) / twice[:, None, None], np.abs(twice) / 2


def heat(mesh: Mesh) -> sp.csr_matrix:
    """∫∇θ·∇φ."""
    g, area = gradients(mesh)
    return _assemble(mesh, np.einsum("tid,tjd,t->tij", g, g, area)[:, None, None])


def elasticity(mesh: Mesh, poisson: float = 0.3) -> sp.csr_matrix:
    """∫cε(u):ε(v), plane strain, Young's modulus 1; unknown c·nv + node."""
    lame, shear = poisson / (1 + poisson) / (1 - 2 * poisson), 0.5 / (1 + poisson)
    g, area = gradients(mesh)
    same = np.einsum("tid,tjd,t->tij", g, g, area)
    cross = np.einsum("tic,tjd,t->tcdij", g, g, area)
    return _assemble(
        mesh,
        lame * cross + shear * cross.swapaxes(1, 2) + shear * np.eye(2)[:, :, None, None] * same[:, None, None],
    )


def _assemble(mesh: Mesh, local: Array) -> sp.csr_matrix:
    """local: (nt, C, C, 3, 3)."""
    nv, components = len(mesh.points), local.shape[1]
    rows = [
        np.broadcast_to(c * nv + mesh.triangles[:, :, None], local[:, c, d].shape).ravel()
        for c in range(components)
        for d in range(components)
    ]
    columns = [
        np.broadcast_to(d * nv + mesh.triangles[:, None, :], local[:, c, d].shape).ravel()
        for c in range(components)
        for d in range(components)
    ]
    values = [local[:, c, d].ravel() for c in range(components) for d in range(components)]
    n = components * nv
    A = sp.coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(n, n)).tocsr()
    return ((A + A.T) * 0.5).tocsr()
