"""What `condense` refuses before it starts."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from tcstudy.condense.ordering import Floats, Ints, Mask


def checked_matrix(
    A: sp.csr_matrix | sp.csr_array, coordinates: ArrayLike, components: int
) -> tuple[sp.csr_matrix | sp.csr_array, Floats]:
    """The matrix in canonical form with finite entries, and coordinates that fit it."""
    coordinates = np.asarray(coordinates, dtype=np.float64)
    if coordinates.ndim != 2 or coordinates.shape[1] != 2:
        raise ValueError(f"the coordinates must have shape (nv, 2), not {coordinates.shape}")
    if components < 1 or len(coordinates) == 0:
        raise ValueError("the mesh has no nodes or the unknown no components")
    n = components * len(coordinates)
    if not sp.issparse(A) or A.format != "csr":
        raise ValueError(f"the matrix must be a scipy.sparse CSR matrix, not {type(A).__name__}")
    if A.shape != (n, n):
        raise ValueError(f"{components} components on {len(coordinates)} nodes need a ({n}, {n}) matrix, not {A.shape}")
    if not np.isfinite(coordinates).all():
        raise ValueError("the coordinates of the nodes are not finite")
    if not np.isfinite(A.data).all():
        raise ValueError("the matrix has entries that are not finite: check the material constants and the mesh")
    if not A.has_canonical_format:
        A = A.copy()
        A.sum_duplicates()
    return A, coordinates


def checked_rows(keep: ArrayLike, eliminate: ArrayLike, n: int) -> tuple[Ints, Mask]:
    """Kept rows as integers, eliminated rows as a mask; disjoint and in range."""
    eliminate = np.asarray(eliminate)
    if eliminate.dtype == bool:
        if eliminate.shape != (n,):
            raise ValueError(f"the mask of eliminated unknowns must have shape ({n},), not {eliminate.shape}")
        mask = eliminate
    else:
        mask = np.zeros(n, dtype=bool)
        mask[_rows(eliminate, n, "eliminate")] = True
    rows = _rows(np.asarray(keep), n, "keep")
    count = np.bincount(rows, minlength=n)
    if len(rows) and count.max() > 1:
        raise ValueError(f"row {int(count.argmax())} is kept twice")
    if mask[rows].any():
        raise ValueError(f"row {int(rows[mask[rows]][0])} is both kept and eliminated")
    return rows, mask


def _rows(index: Ints, n: int, name: str) -> Ints:
    if index.ndim != 1 or (len(index) and not np.issubdtype(index.dtype, np.integer)):
        raise ValueError(f"`{name}` must be a list of row numbers")
    if len(index) and not (index.min() >= 0 and index.max() < n):
        raise ValueError(f"`{name}` has row numbers outside 0..{n - 1}")
    return index.astype(np.intp)


def checked_columns(values: ArrayLike, rows: int, name: str) -> Floats:
    """Values as (rows,) or (rows, r) floats."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim not in (1, 2) or array.shape[0] != rows:
        raise ValueError(f"the {name} must have shape ({rows},) or ({rows}, r), not {array.shape}")
    return array
