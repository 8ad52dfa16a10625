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


class FineReference:
    """A solution on a fine mesh that all others are compared with."""

    def __init__(self, fine: SolvedLevel, levels: list[SolvedLevel]) -> None:
        self._fine, self._levels = fine, levels

    def errors(self, level: int, index: tuple[int, ...], scene: Scene) -> Errors:
        """Absolute errors of a level's solution and norms of the reference; empty if there is none to compare."""
        one, fine = self._levels[level], self._fine
        own, best = one.solutions[index], fine.solutions[index]
        if own.u is None or best.u is None or not best.ok:
            return {}
        mesh, lam, mu = fine.mesh, scene.material.lam, scene.material.mu
        where = located(one.mesh, mesh.centres)
        u = [_minus(_linear(one.mesh, v, where), mesh, w) for v, w in zip(own.u, best.u, strict=True)]
        slopes = [gradient for _, gradient in u]
        found: Errors = {
            "u_energy": (mesh.energy_linear(slopes, lam, mu), mesh.energy(best.u[0], best.u[1], lam, mu)),
            "u_H1": (mesh.h1_linear(slopes), mesh.h1(*best.u)),
            "u_L2": (mesh.l2_linear(u), mesh.l2(*best.u)),
        }
        if own.theta is not None and best.theta is not None:
            theta = _minus(_linear(one.mesh, own.theta, where), mesh, best.theta)
            found |= {
                "theta_L2": (mesh.l2_linear([theta]), mesh.l2(best.theta)),
                "theta_H1": (mesh.h1_linear([theta[1]]), mesh.h1(best.theta)),
            }
        return found | self._on_line(one, own, best)

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
        """ξ of a level on both halves of the fine segments (s, 2): that of the nearest node of the same edge."""
        fine = self._fine
        a, b = np.moveaxis(fine.line.points[fine.line.segments], 1, 0)
        middles = np.stack([0.75 * a + 0.25 * b, 0.25 * a + 0.75 * b], axis=1)
        halves = np.empty(middles.shape[:2])
        names = np.array(one.segment_edges)
        of_segment = np.array(fine.segment_edges)
        at = one.line.points[one.line.nodes]
        for name in dict.fromkeys(fine.segment_edges):
            nodes = np.flatnonzero(np.isin(one.line.nodes, one.line.segments[names == name]))
            rows = of_segment == name
            nearest = cKDTree(at[nodes]).query(middles[rows])[1]
            halves[rows] = own.xi[nodes[nearest]]
        return halves


def _linear(mesh: Triangles, v: Array, where: tuple[Indices, Array]) -> tuple[Array, Array]:
    """Value and gradient of a P1 function in located points."""
    triangle, weights = where
    return np.einsum("qk,qk->q", weights, v[mesh.triangles[triangle]]), mesh.gradient(v)[triangle]


def _minus(one: tuple[Array, Array], mesh: Triangles, v: Array) -> tuple[Array, Array]:
    """One linear function for each triangle minus the P1 function v of the mesh itself."""
    return one[0] - v[mesh.triangles].mean(axis=1), one[1] - mesh.gradient(v)


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values), initial=0.0))
