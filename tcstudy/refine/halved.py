"""A level with every triangle cut into four, on which solutions say what those of the level still lack.

Literature: Ferraz-Leite & Praetorius, Computing 83 (2008) 135–162, on the h–h/2 error estimate, and references there

Where on the body a number J changes when every triangle is cut into four.

With e = u_{h/2} − u_h, the dual solution z on the finer mesh, its interpolant I z and ξ = c b(u_T) on slipping nodes F,

    J(u_{h/2}) − J(u_h) = a(e, z − I z) + Σ_j (z − I z)_j ξ_{h/2,j}
                        + Σ_{j∈F} (a − z)_j c_j b(u_h)_j − Σ_{i∈F} (a − z)_i ξ_{h,i},

the first three sums over nodes of the finer mesh, the last over those of the level, a = 1 for ∫ξ and 0 otherwise,
to first order: the residual of u_h on the finer mesh weighted with what the mesh cannot represent of z, and what lumped
friction says on half the cells. Each hat function of the finer mesh gets its part, signs included, with
a(e, z − I z) = Σ_j (z − I z)_j a(e, φ_j). So parts of the body may be extrapolated with orders of their own, and what
cancels between them is seen: a sum that is small by accident has large parts.

Literature: Richter & Wick, J. Comput. Appl. Math. 279 (2015) 192–208 (localisation by a partition of unity)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.transfer import located, prolongation
from tcstudy.contact.problem import ContactProblem
from tcstudy.fem.estimators import own_strain, stress_of
from tcstudy.fem.meshes import refine_uniformly
from tcstudy.offline.level import Level
from tcstudy.refine.goals import weight_of_friction
from tcstudy.scene.points import needs_heat_solve
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Goal

Array = NDArray[np.float64]


class Halved:
    """The finer level of `coarse`, and what carries functions over.

    level:  the same body on the uniformly refined mesh
    parent: (t_f,) the coarse triangle that each fine one is part of
    """

    def __init__(self, coarse: Level, scene: Scene, scenes: Sequence[Scene] = ()) -> None:
        """scene, scenes: as for Level. Raises GeometryFailed if the refined mesh is not the body."""
        mesh = coarse.mesh
        self.coarse, self.level = coarse, Level(refine_uniformly(mesh), scene, scenes)
        fine = self.level.mesh
        self._prolong = prolongation(mesh.points, fine.points, fine.triangles)
        self.parent, _ = located(mesh, fine.centres)

    def carry(self, values: Array) -> Array:
        """Nodal values (n,) or displacements (2n,) of the level as those of the finer one."""
        return self._prolong(values.reshape(-1, self.coarse.mesh.n_points)).ravel()

    def interpolated(self, values: Array) -> Array:
        """The level's interpolant of (n_f,) or (2n_f,) nodal values of the finer one, on the finer one."""
        by_component = values.reshape(-1, self.level.mesh.n_points)
        return self._prolong(by_component[:, : self.coarse.mesh.n_points]).ravel()

    def start(self, v: Array, u: Array) -> Array:
        """A contact solution v (m,) of the level, with its u (2n,), as a start on the finer one (m_f,).

        Between a held node and a free one the displacement given there counts.
        """
        line, n, nodes = self.coarse.line, self.coarse.mesh.n_points, self.level.line.nodes
        beside_held = self._prolong(line.nodal(np.zeros(line.m), n, 1.0))[nodes] > 0.0
        given = self.level.frames.rows(self.carry(u))[nodes]
        return np.where(beside_held, given, self._prolong(line.nodal(v, n))[nodes])

    def restricted(self, forces: Array) -> Array:
        """(n,) forces at the contact nodes of the finer level (m_f,) as those at the nodes of the level."""
        return np.asarray(self._prolong.matrix.T @ self.level.line.nodal(forces, self.level.mesh.n_points))

    @cached_property
    def middles(self) -> NDArray[np.intp]:
        """(s,) the new node in the middle of each segment of Γ_C of the level."""
        n = self.coarse.mesh.n_points
        ends = _sorted_pairs(self._prolong.matrix[n:].indices.reshape(-1, 2), n)
        order = np.argsort(ends)
        return n + order[np.searchsorted(ends[order], _sorted_pairs(self.coarse.line.segments, n))]

    def on_segments(self, values: Array) -> Array:
        """(s,) sums of (s_f,) values on the segments of Γ_C over the two parts of each of the level."""
        at_new = np.bincount(self.level.line.segments.max(axis=1), values, minlength=self.level.mesh.n_points)
        return np.asarray(at_new[self.middles])


def _sorted_pairs(pairs: NDArray[np.intp], n: int) -> NDArray[np.intp]:
    """One number for each unordered pair of nodes."""
    return pairs.min(axis=1) * n + pairs.max(axis=1)


Both = tuple[Array, Array]
"""Of the level and of the finer one."""


def contributions(
    goal: Goal,
    halved: Halved,
    scene: Scene,
    problems: tuple[ContactProblem, ContactProblem],
    v: Both,
    u: Both,
    z: Array,
) -> Array:
    """(n_f,) parts of J(u_{h/2}) − J(u_h) at the nodes of the finer mesh; a has the springs of edges in it.

    problems, v: contact problems and solutions;  u: (2n_f,) displacements, on the finer mesh
    z: (2n_f,) the dual solution, extended into the body
    """
    fine, line, xi = halved.level, halved.coarse.line, problems[1].xi(v[1])
    nodes, local, law = fine.line.nodes, fine.frames.rows, problems[1].law
    rest = np.where(fine.frames.fixed, 0.0, local(z - halved.interpolated(z)))
    by_node = np.sum((rest * local(fine.stiffness_times(scene, u[1] - u[0]))).reshape(2, -1), axis=0)
    by_node[nodes] += rest[nodes] * xi
    lacks = np.where(law.sticking(v[1]), 0.0, weight_of_friction(goal) - local(z)[nodes])
    lumped = lacks * fine.line.c * law.value(local(u[0])[nodes], law.piece(v[1]))
    # on the nodes of the level, where both sums of friction all but cancel one by one
    by_node[: halved.coarse.mesh.n_points] += halved.restricted(lumped)
    by_node[line.nodes] -= fine.line.nodal(lacks, fine.mesh.n_points)[line.nodes] * problems[0].xi(v[0])
    return by_node


def shares(halved: Halved, scene: Scene, xi: Array, e: Array, z: Array) -> Array:
    """(t,) what each triangle of the level may contribute to an error, unsigned: ‖e‖_K ‖z − I z‖_K, |a_K(lift of e, z)|
    where displacements are given, lumping h/6 |Δξ Δz| on Γ_C, and k‖∇(θ_{h/2} − θ_h)‖_K ‖∇(ζ − I ζ)‖_K with the dual
    temperature ζ, or |β∫_K(θ_{h/2} − θ_h) div z| of a known θ.

    xi: (m,) tractions of the level [Pa];  e: (2n_f,) u_{h/2} − u_h;  z: (2n_f,) the dual solution
    """
    mesh, coarse, frames = halved.level.mesh, halved.coarse, halved.level.frames
    lam, mu = (mesh.of_material(scene, name) for name in ("lam", "mu"))

    def gathered(values: Array) -> Array:
        """(t,) sums of (t_f,) values over the parts of each triangle of the level."""
        return np.asarray(np.bincount(halved.parent, values, len(coarse.mesh.triangles)), dtype=float)

    def work(a: Array, b: Array) -> Array:
        """(t,) a_K(a, b) of displacements (2n_f,) [J/m]."""
        a, b = own_strain(mesh, a), own_strain(mesh, b)
        return gathered(mesh.area * ((stress_of(a, lam, mu) * b) @ [1.0, 1.0, 2.0]))

    rest, lift = z - halved.interpolated(z), frames.cartesian(np.where(frames.fixed, frames.rows(e), 0.0))
    found = np.sqrt(work(e, e) * work(rest, rest)) + np.abs(work(lift, z))
    z_T = frames.rows(z)[: mesh.n_points][coarse.line.nodes]
    xi_step, z_step = (np.diff(np.append(x, np.nan)[coarse.line.unknowns], axis=1)[:, 0] for x in (xi, z_T))
    lumped = np.nan_to_num(np.abs(coarse.line.lengths / 6.0 * xi_step * z_step))
    found += coarse.mesh.from_segments(lumped, coarse.line.which)
    if scene.material.expands:
        slope = mesh.gradient(z.reshape(2, -1).T)
        dilation = mesh.of_material(scene, "beta") * mesh.area * (slope[:, 0, 0] + slope[:, 1, 1])
        w = halved.level.temperature(scene).theta - halved.carry(coarse.temperature(scene).theta)
        if needs_heat_solve(scene):  # c(ζ, φ) = β∫φ div z for all φ: the change of a goal with the heat that goes in
            zeta = halved.level.temperatures.response(scene, mesh.incidence @ dilation / 3.0)
            k, both = mesh.of_material(scene, "k") * mesh.area, (w, zeta - halved.interpolated(zeta))
            found += np.sqrt(math.prod(gathered(k * np.sum(mesh.gradient(one) ** 2, axis=1)) for one in both))
        else:
            found += np.abs(gathered(dilation * w[mesh.triangles].mean(axis=1)))
    return found
