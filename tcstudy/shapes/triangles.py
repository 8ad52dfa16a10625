"""Triangles of a mesh: areas, gradients of P1 functions, barycentric coordinates; each once for a mesh."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

INNER = np.full((3, 3), 1 / 6) + 0.5 * np.eye(3)
"""Barycentric points of a quadrature that is exact for degree 2, with a third of the area each."""
GAUSS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
"""Points on a segment from 0 to 1, of weight ½ each, exact for degree 3."""


def doubled_areas(corners: Array) -> Array:
    """Twice the signed areas of triangles given by their corners (t, 3, 2)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


@dataclass(frozen=True, eq=False)
class TriangleGeometry:
    """points: (n, 2) nodes [m];  triangles: (t, 3), counter-clockwise"""

    points: Array
    triangles: Indices

    @cached_property
    def sides(self) -> Indices:
        """(3t, 2) nodes of the sides, the triangle on their left: side 3i + k of triangle i leads from its corner k."""
        return self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)

    @cached_property
    def edges(self) -> tuple[Indices, Indices]:
        """(e, 2) the edges, ends ascending, and (t, 3) those of every triangle in the order of `sides`."""
        edges, of = np.unique(np.sort(self.sides, axis=1), axis=0, return_inverse=True)
        return edges, of.reshape(-1, 3)

    def sides_at(self, pairs: Indices) -> Indices:
        """(s,) which of the sides leads from one node to the other of pairs (s, 2); −1 where none does."""
        n = len(self.points)
        keys, wanted = self.sides[:, 0] * n + self.sides[:, 1], pairs[:, 0] * n + pairs[:, 1]
        order = np.argsort(keys)
        found = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)]
        return np.where(keys[found] == wanted, found, -1)

    @cached_property
    def corners(self) -> Array:
        """(t, 3, 2) [m]."""
        return self.points[self.triangles]

    @cached_property
    def centres(self) -> Array:
        """(t, 2) centres of gravity [m]."""
        return np.asarray(self.corners.mean(axis=1))

    @cached_property
    def diameter(self) -> Array:
        """(t,) longest sides [m]."""
        sides = self.corners - np.roll(self.corners, 1, axis=1)
        return np.sqrt(np.max(np.sum(sides**2, axis=2), axis=1))

    @cached_property
    def area(self) -> Array:
        """(t,) [m²]."""
        return 0.5 * doubled_areas(self.corners)

    @cached_property
    def slopes(self) -> Array:
        """(t, 3, 2) gradients of the three hat functions of each triangle [1/m]."""
        opposite = np.roll(self.corners, -2, axis=1) - np.roll(self.corners, -1, axis=1)
        turned = np.stack([-opposite[..., 1], opposite[..., 0]], axis=-1)
        return turned / (2.0 * self.area)[:, None, None]

    def gradient(self, nodal: Array) -> Array:
        """∇ of P1 functions: nodal values (n,) or (n, r) → (t, 2) or (t, r, 2)."""
        return np.einsum("tk...,tkd->t...d", nodal[self.triangles], self.slopes)

    @cached_property
    def incidence(self) -> sp.csr_array:
        """(n, t) with 1 where a node is a corner of a triangle."""
        t = len(self.triangles)
        entries = np.ones(3 * t), (self.triangles.ravel(), np.repeat(np.arange(t), 3))
        return sp.csr_array(sp.coo_array(entries, shape=(len(self.points), t)))

    def barycentric(self, at: Array, of: Indices | slice = slice(None)) -> Array:
        """(q, 3) barycentric coordinates of points (q, 2), or of one, in the triangles `of`, by default all."""
        return 1.0 / 3.0 + np.einsum("tkd,td->tk", self.slopes[of], at - self.centres[of])
