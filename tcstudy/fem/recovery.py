"""Gradients of P1 functions and their recovery: from one value per triangle to better values at the nodes.

Recovery:   at every node the linear polynomial that fits the values at the centroids of the triangles around it best
            (area-weighted least squares), evaluated at the node. Nodes on the boundary and nodes with few triangles
            use two rings of triangles, so that the recovered gradient keeps its order up to the boundary
Literature: Zienkiewicz & Zhu, Int. J. Numer. Methods Eng. 33 (1992) 1331–1364 (superconvergent patch recovery)
Left out:   patches do not stop at edges where the data jump; where materials do, nodes are split (energy_error.Pieces)
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.fem.boundary import ContactLine
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.scene.records import Scene
from tcstudy.shapes.triangles import INNER, TriangleGeometry

Array = NDArray[np.float64]

GAUSS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
"""Points on a segment from 0 to 1, of weight ½ each, exact for degree 3."""
ENOUGH = 4
"""Triangles that a patch of one ring needs; below it, and on the boundary, the patch has two rings."""
FLAT = 1e-6
"""Determinant of the scaled moments below which a patch is too flat for a fit and its mean is taken."""


class BoundaryEdges(NamedTuple):
    """Of the s boundary segments, chords on arcs: length (s,), outer normal (s, 2), Gauss points (s, 2, 2)."""

    length: Array
    normal: Array
    at: Array


class ElementGeometry(TriangleGeometry):
    """What estimates need to know of a mesh's t triangles and n nodes; everything is computed once."""

    def __init__(self, mesh: PlaneMesh) -> None:
        super().__init__(mesh.points, mesh.triangles)
        self.mesh = mesh

    def of_material(self, scene: Scene, name: str) -> Array:
        """(t,) a number of the material of each triangle, 0 where it is not given."""
        found = np.zeros(len(self.mesh.triangles))
        for where, material in scene.pieces:
            found[self.mesh.inside(where)] = getattr(material, name) or 0.0
        return found

    @cached_property
    def boundary(self) -> BoundaryEdges:
        """Geometry of the boundary segments."""
        ends = self.mesh.points[self.mesh.segments]
        along = ends[:, 1] - ends[:, 0]
        length = np.linalg.norm(along, axis=1)
        normal = np.column_stack([along[:, 1], -along[:, 0]]) / length[:, None]
        return BoundaryEdges(length, normal, ends[:, None, 0] + GAUSS[None, :, None] * along[:, None])

    @cached_property
    def owner(self) -> NDArray[np.intp]:
        """(s,) the triangle at each boundary segment."""
        return self.sides_at(self.mesh.segments) // 3

    def from_segments(self, values: Array) -> Array:
        """(t,) sums of values on boundary segments (s,) over the segments of each triangle."""
        return np.asarray(np.bincount(self.owner, values, minlength=len(self.mesh.triangles)), dtype=float)

    def from_contact(self, line: ContactLine, values: Array) -> Array:
        """(t,) the same of values on the segments of Γ_C (s,)."""
        found = np.zeros(len(self.mesh.segments))
        found[line.which] = values
        return self.from_segments(found)

    @cached_property
    def inner_points(self) -> Array:
        """(t, 3, 2) points of a quadrature that is exact for degree 2, with a third of the area each [m]."""
        return np.einsum("qk,tkd->tqd", INNER, self.corners)

    def at_inner_points(self, nodal: Array) -> Array:
        """P1 functions at `inner_points`: (n,) → (t, 3)."""
        return nodal[self.mesh.triangles] @ INNER.T

    @cached_property
    def incidence(self) -> sp.csr_array:
        """(n, t) with 1 where a node is a corner of a triangle."""
        t = len(self.mesh.triangles)
        columns = np.repeat(np.arange(t), 3)
        entries = (np.ones(3 * t), (self.mesh.triangles.ravel(), columns))
        return sp.csr_array(sp.coo_array(entries, shape=(self.mesh.n_points, t)))

    @cached_property
    def recovery(self) -> sp.csr_array:
        """(n, t) the linear map from values on triangles to recovered values at nodes."""
        patches = self._patches()
        node = np.repeat(np.arange(self.mesh.n_points), np.diff(patches.indptr))
        triangle = patches.indices
        weight = self.area[triangle]
        offset = self.centres[triangle] - self.mesh.points[node]
        total = self._sum(node, weight)
        size = np.sqrt(self._sum(node, weight * np.einsum("ed,ed->e", offset, offset)) / total)
        terms = np.column_stack([np.ones(len(node)), offset / size[node, None]])
        weight = weight / total[node]
        moments = np.array([[self._sum(node, weight * a * b) for a in terms.T] for b in terms.T]).transpose(2, 0, 1)
        # The fit's value at the node is the first coefficient: the first row of the inverse moments.
        mean = np.tile([1.0, 0.0, 0.0], (self.mesh.n_points, 1))
        sound = np.linalg.det(moments) > FLAT
        first = mean.copy()
        first[sound] = np.linalg.solve(moments[sound], mean[sound][..., None])[..., 0]
        values = weight * np.einsum("ek,ek->e", terms, first[node])
        return sp.csr_array((values, triangle, patches.indptr), shape=patches.shape)

    def _sum(self, node: NDArray[np.intp], values: Array) -> Array:
        return np.asarray(np.bincount(node, values, minlength=self.mesh.n_points), dtype=float)

    def _patches(self) -> sp.csr_array:
        """(n, t) pattern of the patches: one ring of triangles, two where one says too little."""
        ring = self.incidence
        few = np.diff(ring.indptr) < ENOUGH
        few[self.mesh.segments] = True
        keep = sp.diags_array((~few).astype(float)) @ ring
        neighbours = ring[few] @ ring.T
        entries = sp.coo_array(neighbours @ ring)
        at = np.flatnonzero(few)[entries.row], entries.col
        wide = sp.csr_array(sp.coo_array((entries.data, at), shape=ring.shape))
        patches = sp.csr_array(keep + wide)
        patches.eliminate_zeros()
        return patches
