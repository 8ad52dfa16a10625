"""Errors of P1 functions against exact ones by quadrature on the triangles (degree 5, seven points)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tcstudy.fem.meshes import PlaneMesh

Array = NDArray[np.float64]

_A, _B = (6 - np.sqrt(15)) / 21, (6 + np.sqrt(15)) / 21
_W = (9 / 40, (155 - np.sqrt(15)) / 1200, (155 + np.sqrt(15)) / 1200)
_POINTS = np.array(
    [[1 / 3, 1 / 3, 1 / 3]] + [np.roll([1 - 2 * t, t, t], i).tolist() for t in (_A, _B) for i in range(3)]
)
_WEIGHTS = np.array([_W[0]] + [_W[1]] * 3 + [_W[2]] * 3)


def l2_and_h1_errors(
    mesh: PlaneMesh, values: Array, exact: Callable[[Array, Array], Array], gradient: Callable[[Array, Array], Array]
) -> tuple[float, float]:
    """‖u − u_h‖_{L²} and |u − u_h|_{H¹}; exact(x, y) → (…), gradient(x, y) → (2, …)."""
    corners = mesh.points[mesh.triangles]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    twice = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    nodal = values[mesh.triangles]
    du, dv = nodal[:, 1] - nodal[:, 0], nodal[:, 2] - nodal[:, 0]
    slope = np.array([(b[:, 1] * du - a[:, 1] * dv) / twice, (a[:, 0] * dv - b[:, 0] * du) / twice])
    at = np.einsum("qk,tkd->tqd", _POINTS, corners)
    x, y = at[..., 0], at[..., 1]
    weight = 0.5 * twice[:, None] * _WEIGHTS
    error = nodal @ _POINTS.T - exact(x, y)
    slopes = slope[:, :, None] - gradient(x, y)
    return float(np.sqrt((weight * error**2).sum())), float(np.sqrt((weight * slopes**2).sum()))
