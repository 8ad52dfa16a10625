"""Norms of P1 functions on a triangle mesh, and their distance from functions given by value and gradient.

    ‖v‖² = ∫v²,   |v|₁² = ∫|∇v|²,   ‖v‖_a² = a(v, v) = ∫λ(div v)² + 2μ ε(v):ε(v)

Differences of P1 functions on one mesh are integrated exactly; against a given function with the seven-point rule of
degree five on every triangle. H¹ stands for the seminorm |·|₁: it has one physical dimension, the full norm has not.

Norms on the contact line Γ_C: u_T is piecewise linear on its segments, ξ constant on the S_i around its nodes.

A segment's two halves belong to the S_i of its two ends; where one end carries no unknown, both belong to the other
(method §2). So ξ is an array (s, 2) of values on half segments, and a refinement of the line halves every segment.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Modulus = float | Array
"""λ or μ: of the whole body, or (t,) of every triangle."""
Linear = tuple[Array, Array]
"""Values at the centres (t,) and gradients (t, 2) of a function that is linear on every triangle."""
Function = Callable[[Array, Array], tuple[Array, Array]]
"""x, y (…) → value (…) and gradient (2, …)."""

_A, _B = (6 - np.sqrt(15)) / 21, (6 + np.sqrt(15)) / 21
_RULE = np.array([[1 / 3] * 3] + [np.roll([1 - 2 * t, t, t], i).tolist() for t in (_A, _B) for i in range(3)])
_WEIGHTS = np.array([9 / 40] + [(155 - np.sqrt(15)) / 1200] * 3 + [(155 + np.sqrt(15)) / 1200] * 3)
"""Radon's rule: barycentric points (7, 3) and weights (7,)."""


@dataclass(frozen=True)
class Triangles:
    """A mesh for integration: points (n, 2) [m], triangles (t, 3) counter-clockwise."""

    points: Array
    triangles: Indices

    @cached_property
    def _geometry(self) -> tuple[Array, Array]:
        """Areas (t,) and gradients of the three shape functions (t, 3, 2)."""
        corners = self.points[self.triangles]
        edge = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)  # opposite to each corner
        first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        twice = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        slopes = np.stack([-edge[..., 1], edge[..., 0]], axis=-1) / twice[:, None, None]
        return 0.5 * twice, slopes

    def gradient(self, v: Array) -> Array:
        """∇v of a P1 function (n,) on every triangle, (t, 2)."""
        return np.einsum("tk,tkd->td", v[self.triangles], self._geometry[1])

    @cached_property
    def _samples(self) -> tuple[Array, Array, Array]:
        """x, y and weights (t, 7) of the quadrature points."""
        at = np.einsum("qk,tkd->tqd", _RULE, self.points[self.triangles])
        return at[..., 0], at[..., 1], self.areas[:, None] * _WEIGHTS

    # -- norms of functions that are linear on every triangle, jumping between them or not ---------

    def linear(self, v: Array) -> Linear:
        """A P1 function (n,)."""
        return v[self.triangles].mean(axis=1), self.gradient(v)

    @property
    def areas(self) -> Array:
        """(t,) areas of the triangles."""
        return self._geometry[0]

    @cached_property
    def centres(self) -> Array:
        """(t, 2) centres of gravity of the triangles."""
        return np.asarray(self.points[self.triangles].mean(axis=1))

    @cached_property
    def _moments(self) -> Array:
        """(t, 3) ∫(x−c)², ∫(y−d)² and 2∫(x−c)(y−d) about the centres (c, d)."""
        x, y = np.moveaxis(self.points[self.triangles] - self.centres[:, None], -1, 0)
        sums = np.stack([(x * x).sum(axis=1), (y * y).sum(axis=1), 2.0 * (x * y).sum(axis=1)], axis=1)
        return np.asarray(sums * (self.areas / 12)[:, None])

    def l2(self, *parts: Linear) -> float:
        """‖v‖ over components, exact."""
        xx, yy, xy = self._moments.T
        total = 0.0
        for value, gradient in parts:
            a, b = gradient.T
            total += float(self.areas @ value**2 + xx @ a**2 + yy @ b**2 + xy @ (a * b))
        return float(np.sqrt(total))

    def h1(self, *parts: Linear) -> float:
        """|v|₁ over components, exact."""
        return float(np.sqrt(sum(float(self.areas @ (gradient**2).sum(axis=1)) for _, gradient in parts)))

    def energy(self, u_x: Linear, u_y: Linear, lam: Modulus, mu: Modulus) -> float:
        """‖u‖_a of a displacement, exact."""
        return float(np.sqrt(self.areas @ _strain_energy(u_x[1].T, u_y[1].T, lam, mu)))

    def integral(self, density: Callable[[Array, Array], Array]) -> float:
        """∫ of a function of x and y, by the seven-point rule."""
        x, y, weight = self._samples
        return float((weight * density(x, y)).sum())

    # -- distances from a given function -----------------------------------------------------------

    def l2_from(self, pairs: list[tuple[Array, Function]]) -> tuple[float, float]:
        """‖v − f‖ and ‖f‖ over all (P1 component, given function)."""
        return self._from([(v[self.triangles] @ _RULE.T, f(*self._samples[:2])[0]) for v, f in pairs])

    def h1_from(self, pairs: list[tuple[Array, Function]]) -> tuple[float, float]:
        """|v − f|₁ and |f|₁ over all (P1 component, given function)."""
        return self._from([(self.gradient(v).T[:, :, None], f(*self._samples[:2])[1]) for v, f in pairs])

    def _from(self, sampled: list[tuple[Array, Array]]) -> tuple[float, float]:
        """Norms of the difference and of the second one of pairs of functions at the quadrature points."""
        weight = self._samples[2]
        error = sum(float((weight * (v - f) ** 2).sum()) for v, f in sampled)
        return float(np.sqrt(error)), float(np.sqrt(sum(float((weight * f**2).sum()) for _, f in sampled)))

    def energy_from(self, pairs: list[tuple[Array, Function]], lam: float, mu: float) -> tuple[float, float]:
        """‖u − f‖_a and ‖f‖_a for the two components of a displacement."""
        x, y, weight = self._samples
        exact = [function(x, y)[1] for _, function in pairs]
        discrete = [self.gradient(v).T[:, :, None] for v, _ in pairs]
        error = _strain_energy(discrete[0] - exact[0], discrete[1] - exact[1], lam, mu)
        size = _strain_energy(exact[0], exact[1], lam, mu)
        return float(np.sqrt((weight * error).sum())), float(np.sqrt((weight * size).sum()))


def _strain_energy(grad_x: Array, grad_y: Array, lam: Modulus, mu: Modulus) -> Array:
    """λ(div u)² + 2μ ε:ε from the gradients (2, …) of both components."""
    divergence = grad_x[0] + grad_y[1]
    shear = grad_x[1] + grad_y[0]
    density: Array = lam * divergence**2 + 2 * mu * (grad_x[0] ** 2 + grad_y[1] ** 2 + 0.5 * shear**2)
    return density


LineFunction = Callable[[Array, Array, Array], Array]
"""x, y (…) and normals (…, 2) → values (…)."""

_GAUSS, _LINE_WEIGHTS = np.polynomial.legendre.leggauss(5)
_AT, _W = 0.5 * (1 + _GAUSS), 0.5 * _LINE_WEIGHTS


@dataclass(frozen=True)
class Line:
    """The contact line of one mesh.

    points:   (n, 2) mesh nodes;  segments: (s, 2) nodes of its segments, in order
    normals:  (s, 2, 2) outward unit normals of the exact curve at both ends of every segment
    nodes:    (m,) mesh nodes with an unknown;  c: (m,) lengths of their S_i [m]
    """

    points: Array
    segments: Indices
    normals: Array
    nodes: Indices
    c: Array

    @property
    def next_to_held(self) -> NDArray[np.bool_]:
        """(m,) contact nodes with a neighbour on the line that carries no unknown."""
        free = np.zeros(len(self.points), dtype=bool)
        free[self.nodes] = True
        ends = self.segments[~free[self.segments].all(axis=1)]
        return np.isin(self.nodes, ends)

    @property
    def lengths(self) -> Array:
        """Lengths of the segments (s,) [m]."""
        ends = self.points[self.segments]
        return np.asarray(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))

    def tangential(self, u_x: Array, u_y: Array) -> Array:
        """u_T = u·t at both ends of every segment (s, 2), t = (−n₂, n₁)."""
        n = self.normals
        return np.asarray(-n[..., 1] * u_x[self.segments] + n[..., 0] * u_y[self.segments])

    def halves(self, xi: Array) -> Array:
        """ξ on both halves of every segment (s, 2) from its values at the contact nodes (m,)."""
        at = np.full(len(self.points), np.nan)
        at[self.nodes] = xi
        both = at[self.segments]
        return np.where(np.isnan(both), both[:, ::-1], both)

    def linear_norm(self, ends: Array) -> float:
        """L² norm of a function that is linear on every segment, from its end values (s, 2)."""
        a, b = ends.T
        return float(np.sqrt(self.lengths @ (a**2 + a * b + b**2) / 3))

    def step_norm(self, halves: Array) -> float:
        """L² norm of a function that is constant on half segments (s, 2)."""
        return float(np.sqrt(0.5 * self.lengths @ (halves**2).sum(axis=1)))

    def nodal_norm(self, values: Array) -> float:
        """(Σ c_i v_i²)^½ of values at the contact nodes (m,)."""
        return float(np.sqrt(self.c @ values**2))

    def linear_from(self, ends: Array, function: LineFunction) -> tuple[float, float]:
        """‖v − f‖ and ‖f‖ in L² for v linear on every segment."""
        exact, weight = self._sampled(function, 0.0, 1.0)
        error = ends[:, :1] * (1 - _AT) + ends[:, 1:] * _AT - exact
        return float(np.sqrt((weight * error**2).sum())), float(np.sqrt((weight * exact**2).sum()))

    def step_from(self, halves: Array, function: LineFunction) -> tuple[float, float]:
        """‖v − f‖ and ‖f‖ in L² for v constant on half segments."""
        error = size = 0.0
        for side in (0, 1):
            exact, weight = self._sampled(function, 0.5 * side, 0.5)
            error += float((weight * (halves[:, side, None] - exact) ** 2).sum())
            size += float((weight * exact**2).sum())
        return float(np.sqrt(error)), float(np.sqrt(size))

    def at_nodes(self, function: LineFunction) -> Array:
        """f at the contact nodes (m,)."""
        normals = np.zeros((len(self.points), 2))
        normals[self.segments] = self.normals
        x, y = self.points[self.nodes].T
        return function(x, y, normals[self.nodes])

    def _sampled(self, function: LineFunction, start: float, share: float) -> tuple[Array, Array]:
        """Values and weights (s, q) of Gauss points on the part [start, start + share] of every segment."""
        t = (start + share * _AT)[None, :, None]
        a, b = self.points[self.segments[:, 0]][:, None], self.points[self.segments[:, 1]][:, None]
        at = a + t * (b - a)
        n = self.normals[:, :1] * (1 - t) + self.normals[:, 1:] * t
        n /= np.linalg.norm(n, axis=2, keepdims=True)
        return function(at[..., 0], at[..., 1], n), share * _W * self.lengths[:, None]
