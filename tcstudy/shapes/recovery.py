"""Recovery of gradients of P1 functions: from one value per triangle to better ones at the nodes.

At every node the linear polynomial is taken that fits the values at the centroids of the triangles
around it best (area-weighted least squares). Nodes on the boundary and with few triangles use two
rings of triangles, so that the gradient keeps its order up to the boundary.

Literature: Zienkiewicz & Zhu, Int. J. Numer. Methods Eng. 33 (1992) 1331–1364 (superconvergent
            patch recovery)
Left out:   patches do not stop at edges where the data jump; where materials do, nodes are split
            (fem/energy_error.py, Pieces)
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.shapes.edges import TriangleGeometry

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MIN_TRIANGLES = 4
"""Triangles that a patch of one ring needs; with fewer it has two rings."""
MIN_DETERMINANT = 1e-6
"""Determinant of the scaled moments below which a patch, too flat for a fit, takes its mean."""


def recovery_matrix(mesh: TriangleGeometry, boundary: Indices) -> sp.csr_array:
    """Return the linear map (n, t) from values on triangles to recovered values at nodes.

    boundary: nodes on the boundary, whose patches have two rings of triangles
    """
    n = len(mesh.points)
    patches = _patches(mesh, boundary)
    node = np.repeat(np.arange(n), np.diff(patches.indptr))
    triangle = patches.indices

    def total(values: Array) -> Array:
        """Return sums (n,) over the triangles of each patch."""
        return np.asarray(np.bincount(node, values, minlength=n), dtype=float)

    weight = mesh.area[triangle]
    offset = mesh.centres[triangle] - mesh.points[node]
    patch_area = total(weight)
    size = np.sqrt(total(weight * np.einsum("ed,ed->e", offset, offset)) / patch_area)
    terms = np.column_stack([np.ones(len(node)), offset / size[node, None]])
    weight = weight / patch_area[node]
    rows = [[total(weight * a * b) for a in terms.T] for b in terms.T]
    moments = np.array(rows).transpose(2, 0, 1)
    # The value of the fit at the node is its first coefficient: the first row of the inverse
    # moments. Flat patches keep the mean.
    first_row = np.tile([1.0, 0.0, 0.0], (n, 1))
    fits = np.linalg.det(moments) > MIN_DETERMINANT
    first_row[fits] = np.linalg.solve(moments[fits], first_row[fits][..., None])[..., 0]
    entries = weight * np.einsum("ek,ek->e", terms, first_row[node])
    return sp.csr_array((entries, triangle, patches.indptr), patches.shape)


def _patches(mesh: TriangleGeometry, boundary: Indices) -> sp.csr_array:
    """Return a matrix (n, t) with entries where a triangle belongs to the patch of a node."""
    ring = mesh.incidence
    two_rings = np.diff(ring.indptr) < MIN_TRIANGLES
    two_rings[boundary] = True
    neighbours = sp.diags_array(two_rings.astype(float)) @ ring @ ring.T
    one_ring = sp.diags_array((~two_rings).astype(float)) @ ring
    patches = sp.csr_array(one_ring + neighbours @ ring)
    patches.eliminate_zeros()
    return patches
