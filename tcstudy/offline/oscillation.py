"""Data that equilibrium elements do not have exactly: their linear parts, and what the rest can do.

A source or traction minus its L² projection onto linear functions is orthogonal to them. Against
the error e of the displacement it does no more than

    |∫_K (f − f₁)·e| ≤ (h_K/j₁₁) R_K/√2μ ‖f − f₁‖_K ‖e‖_K,      R²_K = 1 + 2/β²_K,
    |∫_E (g − g₁)·e| ≤ √(|E|/|K| t_K) R_K/√2μ ‖g − g₁‖_E ‖e‖_K,   t_K = h²_K (1/j²₁₁ + 1/j₁₁),

with μ the least of μ and λ + μ. Against the error of the temperature 1/√k stands for R_K/√2μ.

Poincaré: ‖v − v̄‖_K ≤ (h_K/j₁₁)‖∇v‖_K on a triangle.
Trace:    with v̄ = 0 and P the corner opposite to E, div((x − P)v²) integrated over K gives
          ‖v‖²_E ≤ (|E|/|K|)(‖v‖² + h_K‖v‖‖∇v‖), and Poincaré the rest.
Korn:     a rigid motion may be subtracted from e, as it is linear: then ‖∇e‖ ≤ R_K‖ε(e)‖. For the
          rotation r of e, ∇r consists of derivatives of ε, so that ‖r − r̄‖ ≤ ‖ε(e)‖/β_K with the
          inf-sup constant β_K of the divergence. A triangle is star-shaped with respect to its
          incircle (radius ρ) and lies in the concentric circle of radius R through its farthest
          corner, hence β_K ≥ ρ/√2R (1 + √(1 − ρ²/R²))^{−½}.
Literature: M. Costabel and M. Dauge, Arch. Ration. Mech. Anal. 217 (2015) 873–898, Theorem 2.3 (β);
          R. S. Laugesen and B. A. Siudeja, J. Differential Equations 249 (2010) 118–135 (j₁₁).

Norms of the rest are by quadrature of degree 15.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.expression import Scalar
from tcstudy.fem.forms import values_at
from tcstudy.fem.meshes import PlaneMesh
from tcstudy.shapes.edges import GAUSS, TriangleGeometry

Array = NDArray[np.float64]

J_11 = 3.8317059702075125
"""First positive zero of the Bessel function J₁."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
EDGE_POINTS: Array = 0.5 + 0.5 * _NODES
EDGE_WEIGHTS: Array = 0.5 * _WEIGHTS
"""Quadrature along a segment; the weights sum to 1."""
_x, _y = (axis.ravel() for axis in np.meshgrid(EDGE_POINTS, EDGE_POINTS, indexing="ij"))
TRIANGLE_POINTS: Array = np.column_stack([(1.0 - _x) * (1.0 - _y), _x * (1.0 - _y), _y])
TRIANGLE_WEIGHTS: Array = 2.0 * np.outer(EDGE_WEIGHTS, EDGE_WEIGHTS).ravel() * (1.0 - _y)
"""Quadrature in a triangle, in barycentric coordinates; the weights sum to 1."""


def poincare(mesh: TriangleGeometry) -> Array:
    """Return h_K/j₁₁ (t,) [m]."""
    return mesh.diameter / J_11


def trace_constants(mesh: PlaneMesh) -> Array:
    """Return √(|E|/|K| t_K) (s,) of the boundary segments [√m]."""
    owner = mesh.owner
    h = mesh.diameter[owner]
    ratio = mesh.boundary.length / mesh.area[owner]
    return h * np.sqrt(ratio * (1.0 / J_11**2 + 1.0 / J_11))


def korn_constants(mesh: TriangleGeometry) -> Array:
    """Return R_K (t,) with ‖∇v‖_K ≤ R_K‖ε(v)‖_K for some rigid motion less."""
    corners = mesh.corners
    opposite = np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1)
    lengths = np.hypot(opposite[..., 0], opposite[..., 1])
    perimeter = lengths.sum(axis=1)
    incentre = np.einsum("tc,tcd->td", lengths, corners) / perimeter[:, None]
    from_incentre = corners - incentre[:, None]
    outer_radius = np.hypot(from_incentre[..., 0], from_incentre[..., 1]).max(axis=1)
    ratio = 2.0 * mesh.area / perimeter / outer_radius
    beta = ratio / np.sqrt(2.0 * (1.0 + np.sqrt(1.0 - ratio**2)))
    return np.sqrt(1.0 + 2.0 / beta**2)


def linear_on_segments(
    mesh: PlaneMesh, values_of: Callable[[Array], Array], on: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Return the linear parts (k, 2, …) at the Gauss points of k segments, and ‖rest‖² (k,).

    values_of: from points (k, q, 2) to values (k, q, …);  on: (s,) the segments
    The Gauss points run from the lower node on.
    """
    first, second = np.moveaxis(mesh.points[np.sort(mesh.segments[on], axis=1)], 1, 0)
    x = EDGE_POINTS[None, :, None]
    values = values_of((1.0 - x) * first[:, None] + x * second[:, None])
    centred = EDGE_POINTS - 0.5
    mean = np.einsum("q,kq...->k...", EDGE_WEIGHTS, values)
    slope = 12.0 * np.einsum("q,kq...->k...", EDGE_WEIGHTS * centred, values)

    def linear_at(points: Array) -> Array:
        parts = [mean + offset * slope for offset in points]
        return np.stack(parts, axis=1)

    rest = np.einsum("q,kq...->k...", EDGE_WEIGHTS, (values - linear_at(centred)) ** 2)
    total = rest.reshape(len(rest), -1).sum(axis=1)
    return linear_at(GAUSS - 0.5), total * mesh.boundary.length[on]


def linear_in_triangles(mesh: TriangleGeometry, scalar: Scalar) -> tuple[Array, Array]:
    """Return the corner values (t, 3) of the linear part of a datum, and ‖rest‖²_K (t,)."""
    points = np.einsum("qc,tcd->tqd", TRIANGLE_POINTS, mesh.corners)
    values = values_at(scalar, points)
    moments = values @ (TRIANGLE_WEIGHTS[:, None] * TRIANGLE_POINTS)
    # the mass matrix of a triangle of area 1, inverted
    corner_values = moments @ (12.0 * np.eye(3) - 3.0)
    rest = (values - corner_values @ TRIANGLE_POINTS.T) ** 2 @ TRIANGLE_WEIGHTS
    return corner_values, rest * mesh.area


def mean_in_triangles(mesh: TriangleGeometry, scalar: Scalar) -> tuple[Array, Array]:
    """Return the means (t,) of a datum over triangles, and ‖rest‖²_K (t,)."""
    points = np.einsum("qc,tcd->tqd", TRIANGLE_POINTS, mesh.corners)
    values = values_at(scalar, points)
    mean = values @ TRIANGLE_WEIGHTS
    rest = (values - mean[:, None]) ** 2 @ TRIANGLE_WEIGHTS
    return mean, rest * mesh.area
