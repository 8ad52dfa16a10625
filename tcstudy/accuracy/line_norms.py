"""Norms on the contact line Γ_C: u_T is piecewise linear on its segments, ξ constant on the S_i around its nodes.

A segment's two halves belong to the S_i of its two ends; where one end carries no unknown, both belong to the other
(method §2). So ξ is an array (s, 2) of values on half segments, and a refinement of the line halves every segment.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.nesting import NotNested

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Function = Callable[[Array, Array, Array], Array]
"""x, y (…) and normals (…, 2) → values (…)."""

_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_AT, _W = 0.5 * (1 + _GAUSS), 0.5 * _WEIGHTS


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

    def linear_from(self, ends: Array, function: Function) -> tuple[float, float]:
        """‖v − f‖ and ‖f‖ in L² for v linear on every segment."""
        exact, weight = self._sampled(function, 0.0, 1.0)
        error = ends[:, :1] * (1 - _AT) + ends[:, 1:] * _AT - exact
        return float(np.sqrt((weight * error**2).sum())), float(np.sqrt((weight * exact**2).sum()))

    def step_from(self, halves: Array, function: Function) -> tuple[float, float]:
        """‖v − f‖ and ‖f‖ in L² for v constant on half segments."""
        error = size = 0.0
        for side in (0, 1):
            exact, weight = self._sampled(function, 0.5 * side, 0.5)
            error += float((weight * (halves[:, side, None] - exact) ** 2).sum())
            size += float((weight * exact**2).sum())
        return float(np.sqrt(error)), float(np.sqrt(size))

    def at_nodes(self, function: Function) -> Array:
        """f at the contact nodes (m,)."""
        normals = np.zeros((len(self.points), 2))
        normals[self.segments] = self.normals
        x, y = self.points[self.nodes].T
        return function(x, y, normals[self.nodes])

    def _sampled(self, function: Function, start: float, share: float) -> tuple[Array, Array]:
        """Values and weights (s, q) of Gauss points on the part [start, start + share] of every segment."""
        t = (start + share * _AT)[None, :, None]
        a, b = self.points[self.segments[:, 0]][:, None], self.points[self.segments[:, 1]][:, None]
        at = a + t * (b - a)
        n = self.normals[:, :1] * (1 - t) + self.normals[:, 1:] * t
        n /= np.linalg.norm(n, axis=2, keepdims=True)
        return function(at[..., 0], at[..., 1], n), share * _W * self.lengths[:, None]


def refined_ends(ends: Array) -> Array:
    """End values (s, 2) of a piecewise linear function on the halved segments (2s, 2)."""
    middle = ends.mean(axis=1)
    return np.stack([np.column_stack([ends[:, 0], middle]), np.column_stack([middle, ends[:, 1]])], 1).reshape(-1, 2)


def refined_halves(halves: Array) -> Array:
    """Values on half segments (s, 2) of a step function, on the halves of the halved segments (2s, 2)."""
    return np.repeat(halves.ravel(), 2).reshape(-1, 2)


def check_halved(coarse: Line, fine: Line) -> None:
    """Raise NotNested unless segments 2k and 2k+1 of the fine line are segment k of the coarse one."""
    a, b = fine.segments[0::2], fine.segments[1::2]
    s = coarse.segments
    if len(fine.segments) != 2 * len(s) or not (np.array_equal(a[:, 0], s[:, 0]) and np.array_equal(b[:, 1], s[:, 1])):
        raise NotNested("the contact line of the fine mesh does not halve that of the coarse one")
