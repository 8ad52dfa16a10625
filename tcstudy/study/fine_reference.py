"""Errors of solutions against one on a much finer mesh that is no refinement of theirs.

Solutions are carried to the nodes of the fine mesh. Where that is a refinement nothing changes; elsewhere the triangles
that an edge of the coarse mesh cuts get an interpolated solution, a part of the body of order h_fine/h_coarse. The
traction is the step function of the coarse line, looked up in the middle of every half segment of the fine one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tcstudy.accuracy.locating import interpolation
from tcstudy.scene.records import Scene
from tcstudy.study.reference import Errors
from tcstudy.study.solved_levels import Solution, SolvedLevel

Array = NDArray[np.float64]


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
        carry = interpolation(one.mesh, mesh.points)
        u = np.stack([carry @ component for component in own.u])
        e = u - best.u
        found: Errors = {
            "u_energy": (mesh.energy(e[0], e[1], lam, mu), mesh.energy(best.u[0], best.u[1], lam, mu)),
            "u_H1": (mesh.h1(*e), mesh.h1(*best.u)),
            "u_L2": (mesh.l2(*e), mesh.l2(*best.u)),
        }
        if own.theta is not None and best.theta is not None:
            t = carry @ own.theta - best.theta
            found |= {"theta_L2": (mesh.l2(t), mesh.l2(best.theta)), "theta_H1": (mesh.h1(t), mesh.h1(best.theta))}
        return found | self._on_line(one, own, best, u)

    def _on_line(self, one: SolvedLevel, own: Solution, best: Solution, u: Array) -> Errors:
        assert best.u is not None
        line = self._fine.line
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


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values), initial=0.0))
