"""Errors of solutions against one on a much finer mesh that is no refinement of theirs.

On every fine triangle a solution counts as the linear function that it is at its centre. Where the fine mesh is a
refinement that is exact; elsewhere it is wrong beyond the coarse edge that cuts a triangle, by as much as the gradient
jumps there, to either side alike. (Interpolation at the fine nodes would smooth these jumps, which are the error: with
h_fine = h/4 it lost 27 % of it in the energy norm.) The displacement of the line is that at its fine nodes, the
traction the step function of the coarse line, looked up in the middle of every half of the fine segments.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tcstudy.accuracy.locating import interpolation, located
from tcstudy.accuracy.norms import Triangles
from tcstudy.scene.records import Scene
from tcstudy.study.reference import Errors
from tcstudy.study.solved_levels import Solution, SolvedLevel

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


Linear = tuple[Array, Array]
"""A function that is linear on every triangle: values at the centres (t,) and gradients (t, 2)."""


class FineReference:
    """Solutions on a fine mesh that all others are compared with."""

    def __init__(self, fine: SolvedLevel, levels: list[SolvedLevel]) -> None:
        self._fine, self._levels = fine, levels
        self._known: dict[tuple[int, ...], tuple[list[Linear], dict[str, float]]] = {}

    def errors(self, level: int, index: tuple[int, ...], scene: Scene) -> Errors:
        """Absolute errors of a level's solution and norms of the reference; empty if there is none to compare."""
        return self.errors_of(self._levels[level], index, scene)

    def errors_of(self, one: SolvedLevel, index: tuple[int, ...], scene: Scene) -> Errors:
        """The same for a level that is not in the list."""
        own, best = one.solutions[index], self._fine.solutions[index]
        if own.u is None or best.u is None or not best.ok:
            return {}
        mesh, lam, mu = self._fine.mesh, scene.material.lam, scene.material.mu
        parts, sizes = self._reference(index, scene)
        where = located(one.mesh, mesh.centres)
        components = [*own.u, own.theta] if own.theta is not None and len(parts) == 3 else list(own.u)
        e = [_minus(_linear(one.mesh, v, where), part) for v, part in zip(components, parts, strict=False)]
        slopes = [gradient for _, gradient in e]
        found = {
            "u_energy": mesh.energy_linear(slopes[:2], lam, mu),
            "u_H1": mesh.h1_linear(slopes[:2]),
            "u_L2": mesh.l2_linear(e[:2]),
        }
        if len(e) == 3:
            found |= {"theta_L2": mesh.l2_linear(e[2:]), "theta_H1": mesh.h1_linear(slopes[2:])}
        return {name: (error, sizes[name]) for name, error in found.items()} | self._on_line(one, own, best)

    def number(self, name: str, index: tuple[int, ...] = ()) -> float:
        """A number of the reference, as in the result file."""
        return self._fine.solutions[index].numbers[name]

    def _reference(self, index: tuple[int, ...], scene: Scene) -> tuple[list[Linear], dict[str, float]]:
        """u and θ of the reference, and their norms; worked out once."""
        if index not in self._known:
            best, mesh = self._fine.solutions[index], self._fine.mesh
            assert best.u is not None
            sizes = {
                "u_energy": mesh.energy(best.u[0], best.u[1], scene.material.lam, scene.material.mu),
                "u_H1": mesh.h1(*best.u),
                "u_L2": mesh.l2(*best.u),
            }
            components = list(best.u)
            if best.theta is not None:
                sizes |= {"theta_L2": mesh.l2(best.theta), "theta_H1": mesh.h1(best.theta)}
                components.append(best.theta)
            parts = [(v[mesh.triangles].mean(axis=1), mesh.gradient(v)) for v in components]
            self._known[index] = parts, sizes
        return self._known[index]

    def _on_line(self, one: SolvedLevel, own: Solution, best: Solution) -> Errors:
        assert own.u is not None
        assert best.u is not None
        line = self._fine.line
        nodes = np.unique(line.segments)
        carry, u = interpolation(one.mesh, line.points[nodes]), np.zeros((2, len(line.points)))
        u[:, nodes] = [carry @ component for component in own.u]
        best_ends, best_halves = line.tangential(*best.u), line.halves(best.xi)
        ends, halves = line.tangential(*u), self._steps(one, own)
        return {
            "u_T_L2": (line.linear_norm(ends - best_ends), line.linear_norm(best_ends)),
            "u_T_max": (_largest(ends - best_ends), _largest(best_ends)),
            "xi_L2": (line.step_norm(halves - best_halves), line.step_norm(best_halves)),
        }

    def _steps(self, one: SolvedLevel, own: Solution) -> Array:
        """ξ of a level on both halves of the fine segments (s, 2): that of the nearest node of the same curve.

        Of the curve and not of the edge, which may be both sides of a slot thinner than a cell.
        """
        fine = self._fine
        a, b = np.moveaxis(fine.line.points[fine.line.segments], 1, 0)
        middles = np.stack([0.75 * a + 0.25 * b, 0.25 * a + 0.75 * b], axis=1)
        halves = np.empty(middles.shape[:2])
        at = one.line.points[one.line.nodes]
        for curve in np.unique(fine.segment_curve):
            nodes = np.flatnonzero(np.isin(one.line.nodes, one.line.segments[one.segment_curve == curve]))
            rows = fine.segment_curve == curve
            nearest = cKDTree(at[nodes]).query(middles[rows])[1]
            halves[rows] = own.xi[nodes[nearest]]
        return halves


def _linear(mesh: Triangles, v: Array, where: tuple[Indices, Array]) -> Linear:
    """Values and gradients of a P1 function in located points."""
    triangle, weights = where
    return np.einsum("qk,qk->q", weights, v[mesh.triangles[triangle]]), mesh.gradient(v)[triangle]


def _minus(one: Linear, other: Linear) -> Linear:
    return one[0] - other[0], one[1] - other[1]


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values), initial=0.0))
