"""Recovery of gradients of P1 functions: from one value per triangle to better values at the nodes.

At every node the linear polynomial that fits the values at the centroids of the triangles around it best (area-weighted
least squares), evaluated at the node. Nodes on the boundary and nodes with few triangles use two rings of triangles, so
that the recovered gradient keeps its order up to the boundary.
Literature: Zienkiewicz & Zhu, Int. J. Numer. Methods Eng. 33 (1992) 1331–1364 (superconvergent patch recovery)
Left out:   patches do not stop at edges where the data jump; where materials do, nodes are split (energy_error.Pieces)
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.shapes.triangles import TriangleGeometry

Array = NDArray[np.float64]

ENOUGH = 4
"""Triangles that a patch of one ring needs; below it, and on the boundary, the patch has two rings."""
FLAT = 1e-6
"""Determinant of the scaled moments below which a patch is too flat for a fit and its mean is taken."""


def recovery(mesh: TriangleGeometry, segments: NDArray[np.intp]) -> sp.csr_array:
    """(n, t) the linear map from values on triangles to recovered values at nodes. segments: (s, 2) of the boundary"""
    n, patches = len(mesh.points), _patches(mesh, segments)

    def total(values: Array) -> Array:
        """(n,) sums over the triangles of each patch."""
        return np.asarray(np.bincount(node, values, minlength=n), dtype=float)

    node, triangle = np.repeat(np.arange(n), np.diff(patches.indptr)), patches.indices
    weight, offset = mesh.area[triangle], mesh.centres[triangle] - mesh.points[node]
    whole = total(weight)
    size = np.sqrt(total(weight * np.einsum("ed,ed->e", offset, offset)) / whole)
    terms = np.column_stack([np.ones(len(node)), offset / size[node, None]])
    weight = weight / whole[node]
    moments = np.array([[total(weight * a * b) for a in terms.T] for b in terms.T]).transpose(2, 0, 1)
    # The fit's value at the node is the first coefficient: the first row of the inverse moments.
    first = np.tile([1.0, 0.0, 0.0], (n, 1))  # the mean
    sound = np.linalg.det(moments) > FLAT
    first[sound] = np.linalg.solve(moments[sound], first[sound][..., None])[..., 0]
    return sp.csr_array((weight * np.einsum("ek,ek->e", terms, first[node]), triangle, patches.indptr), patches.shape)


def _patches(mesh: TriangleGeometry, segments: NDArray[np.intp]) -> sp.csr_array:
    """(n, t) pattern of the patches: one ring of triangles, two where one says too little."""
    ring = mesh.incidence
    few = np.diff(ring.indptr) < ENOUGH
    few[segments] = True
    neighbours = sp.diags_array(few.astype(float)) @ ring @ ring.T
    patches = sp.csr_array(sp.diags_array((~few).astype(float)) @ ring + neighbours @ ring)
    patches.eliminate_zeros()
    return patches
