"""A temperature that is quadratic on triangles, near that of P1: t = θ_h + (I − P)b.

b = Σ b_e φ_e with φ_e = 4λ_iλ_j on the edges e, 0 on held ones, and P projects onto P1 in

    c(s,t) = ∫k∇s·∇t + ∫_{Γ_θ} αst,

so that t has the P1 temperature θ_h: Pt = θ_h, whatever b is. Best is b with c(θ − t, φ_e) = 0 (it
gives P2). A few steps of conjugate gradients come close, with a P1 solution in each: the matrix is
that of the φ_e less B A⁻¹Bᵀ, A that of P1, and its diagonal before is a preconditioner.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from tcstudy.fem.meshes import PlaneMesh
from tcstudy.offline.guaranteed import CORNERS, PARTS, SIDES
from tcstudy.offline.oscillation import TRIANGLE_POINTS, TRIANGLE_WEIGHTS
from tcstudy.shapes.places import located

Array = NDArray[np.float64]

STEPS = 30
"""Most steps of conjugate gradients."""
ACCURACY = 0.02
"""Residual at which they end, relative to that of θ_h."""


@dataclass(frozen=True)
class QuadraticTemperature:
    """t = Σ t_i λ_i + Σ b_e φ_e.

    nodal:   (n,) t_i [K]
    bubbles: (e,) b_e [K]
    """

    nodal: Array
    bubbles: Array

    def on_sides(self, mesh: PlaneMesh) -> Array:
        """Return b_e (t, 3) of the sides of each triangle."""
        _, edge_of_side = mesh.edges
        return self.bubbles[edge_of_side]

    def bubble_slopes(self, mesh: PlaneMesh) -> Array:
        """Return ∇Σ b_e φ_e (t, 3, 2) at the corners."""
        on_sides = self.on_sides(mesh)
        slopes = np.zeros_like(mesh.slopes)
        for side, (first, second) in enumerate(SIDES):
            height = 4.0 * on_sides[:, side, None]
            slopes[:, first] += height * mesh.slopes[:, second]
            slopes[:, second] += height * mesh.slopes[:, first]
        return slopes

    def linear_part(self, mesh: PlaneMesh) -> Array:
        """Return the corner values (t, 3) of its L² projection onto linear functions."""
        return self.nodal[mesh.triangles] + self.on_sides(mesh) @ _bubbles_of_triangle().linear

    def rest(self, mesh: PlaneMesh, rho: Array) -> tuple[float, float]:
        """Return ‖Πr‖_ρ and ‖r − Πr‖_ρ of the rest r.

        Π projects onto functions that are linear on the three parts of a triangle.

        rho: (t,) weight
        """
        weight, on_sides = rho * mesh.area, self.on_sides(mesh)
        mapped = _bubbles_of_triangle()
        in_parts, beside = (on_sides @ part for part in (mapped.in_parts, mapped.beside))
        return (
            float(np.sqrt(weight @ (in_parts**2).sum(axis=1))),
            float(np.sqrt(weight @ (beside**2).sum(axis=1))),
        )

    def less(self, other: QuadraticTemperature) -> QuadraticTemperature:
        """Return t − t' for t' on the same mesh."""
        return QuadraticTemperature(self.nodal - other.nodal, self.bubbles - other.bubbles)

    def norm(self, mesh: PlaneMesh, rho: Array) -> float:
        """Return ‖t‖_ρ.

        rho: (t,) weight
        """
        corners = self.linear_part(mesh)
        square = ((corners**2).sum(axis=1) + corners.sum(axis=1) ** 2) / 12.0
        return float(np.linalg.norm([np.sqrt(rho * mesh.area @ square), *self.rest(mesh, rho)]))

    def at(self, mesh: PlaneMesh, points: Array) -> Array:
        """Return its values (q,) at points (q, 2)."""
        triangle, weights = located(mesh, points)
        values = (self.nodal[mesh.triangles[triangle]] * weights).sum(axis=1)
        products = 4.0 * weights * np.roll(weights, -1, axis=1)
        return np.asarray(values + (self.on_sides(mesh)[triangle] * products).sum(axis=1))

    def refined(self, mesh: PlaneMesh, finer: PlaneMesh) -> QuadraticTemperature:
        """Return the same temperature on a refinement of its mesh."""
        edges, _ = finer.edges
        nodal = self.at(mesh, finer.points)
        ends = nodal[edges].mean(axis=1)
        middles = finer.points[edges].mean(axis=1)
        return QuadraticTemperature(nodal, self.at(mesh, middles) - ends)


class _Bubbles(NamedTuple):
    """The functions φ of the sides of a triangle of area 1.

    linear:   (3, 3) corner values of their linear parts, by side and corner
    in_parts: (3, 9) weighted values whose squares sum to that of Π of the rest, by side
    beside:   (3, k) the same of what Π leaves
    """

    linear: Array
    in_parts: Array
    beside: Array


@cache
def _bubbles_of_triangle() -> _Bubbles:
    corners = np.column_stack([1.0 - CORNERS.sum(axis=1), CORNERS])
    bary = np.einsum("qi,pij->pqj", TRIANGLE_POINTS, corners[PARTS]).reshape(-1, 3)
    root = np.sqrt(np.tile(TRIANGLE_WEIGHTS / 3.0, 3))[:, None]
    phi = np.column_stack([4.0 * bary[:, i] * bary[:, j] for i, j in SIDES])
    linear = np.linalg.lstsq(root * bary, root * phi, rcond=None)[0]
    rest = root * (phi - bary @ linear)
    on_part = np.kron(np.eye(3), TRIANGLE_POINTS)
    basis, _ = np.linalg.qr(root * on_part)
    in_parts = basis.T @ rest
    beside = np.linalg.qr(rest - basis @ in_parts, mode="r")
    return _Bubbles(linear.T, in_parts.T, np.asarray(beside).T)


class BubbleForm:
    """c between the φ_e of edges without a held temperature, and between them and P1."""

    def __init__(self, mesh: PlaneMesh, k: Array, alpha: Array, held: NDArray[np.bool_]) -> None:
        """k: (t,) conductivity;  alpha: (s,) of segments;  held: (s,) segments."""
        self._mesh, self._k = mesh, k
        edges, edge_of_side = mesh.edges
        self._number = edge_of_side.ravel()[mesh.sides_at(mesh.segments)]
        n_edges = len(edges)
        self._is_free = np.ones(n_edges, dtype=bool)
        self._is_free[self._number[held]] = False
        size = k * mesh.area
        products = np.einsum("tid,tjd,t->tij", mesh.slopes, mesh.slopes, size)
        first, second = SIDES.T
        mass = (np.ones((3, 3)) + np.eye(3)) / 12.0
        own = np.zeros((len(k), 3, 3))
        for one, another in ((first, second), (second, first)):
            for a, b in ((first, second), (second, first)):
                # 16 ∫λ_one λ_a k∇λ_another·∇λ_b
                own += 16.0 * mass[np.ix_(one, a)] * products[:, another[:, None], b]
        opposite = 3 - first - second
        with_p1 = (-4.0 / 3.0) * products[:, opposite]
        rows = np.repeat(edge_of_side, 3, axis=1).ravel()
        columns = np.tile(edge_of_side, (1, 3)).ravel()
        nodes = np.tile(mesh.triangles, (1, 3)).ravel()
        exchange = self._exchange = alpha * mesh.boundary.length
        number, segments = self._number, mesh.segments
        own_entries = np.concatenate([own.ravel(), 8.0 / 15.0 * exchange])
        own_rows = np.concatenate([rows, number])
        own_columns = np.concatenate([columns, number])
        p1_entries = np.concatenate([with_p1.ravel(), np.repeat(exchange / 3.0, 2)])
        p1_rows = np.concatenate([rows, np.repeat(number, 2)])
        p1_columns = np.concatenate([nodes, segments.ravel()])
        free = sp.diags_array(self._is_free.astype(float))
        own_shape, p1_shape = (n_edges, n_edges), (n_edges, mesh.n_points)
        own_matrix = sp.coo_array((own_entries, (own_rows, own_columns)), shape=own_shape)
        p1_matrix = sp.coo_array((p1_entries, (p1_rows, p1_columns)), shape=p1_shape)
        self._own = sp.csr_array(free @ own_matrix.tocsr() @ free)
        self._with_p1 = sp.csr_array(free @ p1_matrix.tocsr())

    def residual(self, theta: Array, heat: Array, inflow: Array) -> Array:
        """Return the residual (e,) of a P1 temperature (n,) against every φ_e.

        heat:   (t,) total heat of triangles
        inflow: (s, 2) of flux and surroundings in the Gauss points of segments, times half a length
        """
        _, edge_of_side = self._mesh.edges
        residual = np.bincount(
            edge_of_side.ravel(), np.repeat(heat / 3.0, 3), minlength=len(self._is_free)
        )
        residual[self._number] += 2.0 / 3.0 * inflow.sum(axis=1)
        return np.asarray(self._is_free * residual - self._with_p1 @ theta)

    def corrected(
        self, theta: Array, residual: Array, solve: Callable[[Array], Array]
    ) -> QuadraticTemperature:
        """Return t near θ of the P1 temperature θ_h (n,) with its residual (e,).

        solve: from a load (n,) to its P1 temperature (n,)
        """
        diagonal = self._own.diagonal()
        inverse = np.where(self._is_free, 1.0 / np.where(diagonal > 0.0, diagonal, 1.0), 0.0)

        def apply(b: Array) -> Array:
            return np.asarray(self._own @ b - self._with_p1 @ solve(self._with_p1.T @ b))

        bubbles = np.zeros_like(residual)
        r, z = residual, inverse * residual
        direction, square = z, float(residual @ z)
        end = ACCURACY**2 * square
        for _ in range(STEPS):
            if square <= end:
                break
            image = apply(direction)
            curvature = float(direction @ image)
            if curvature <= 0.0:  # by rounding
                break
            step = square / curvature
            bubbles = bubbles + step * direction
            r = r - step * image
            z = inverse * r
            before, square = square, float(r @ z)
            direction = z + square / before * direction
        projection = solve(self._with_p1.T @ bubbles)
        if self._is_free.all():
            # c(b − Pb, 1) = 0 however small α is
            ends = projection[self._mesh.segments].mean(axis=1)
            excess = self._exchange @ (2.0 / 3.0 * bubbles[self._number] - ends)
            projection = projection + excess / self._exchange.sum()
        return QuadraticTemperature(theta - projection, bubbles)
