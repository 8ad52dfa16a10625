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
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg
from numpy.typing import NDArray

from tcstudy.accuracy.transfer import located, prolongation
from tcstudy.contact.problem import ContactProblem
from tcstudy.expressions.expression import Expression
from tcstudy.fem.estimators import own_strain, stress_of
from tcstudy.fem.forms import Conductivity, Springs
from tcstudy.fem.meshes import PlaneMesh, refine_uniformly
from tcstudy.offline.level import Level
from tcstudy.refine.goals import lumping, weight_of_friction
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
        self._springs: tuple[Springs, sp.csr_array] = (), sp.csr_array((0, 0))
        self._heat: dict[tuple[tuple[float, ...], Conductivity], scipy.sparse.linalg.SuperLU] = {}

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

    def at_coarse(self, z_T: Array) -> Array:
        """(m,) values at the contact nodes of the level of (m_f,) values on the finer one."""
        return self.level.line.nodal(z_T, self.level.mesh.n_points)[self.coarse.line.nodes]

    def restricted(self, forces: Array) -> Array:
        """(n,) forces at the contact nodes of the finer level (m_f,) as those at the nodes of the level."""
        return np.asarray(self._prolong.matrix.T @ self.level.line.nodal(forces, self.level.mesh.n_points))

    def gathered(self, values: Array) -> Array:
        """(t,) sums of (t_f,) values over the parts of each triangle of the level."""
        return np.asarray(np.bincount(self.parent, values, minlength=len(self.coarse.mesh.triangles)), dtype=float)

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

    def springs(self, scene: Scene) -> sp.csr_array:
        """(2n_f, 2n_f) the springs of the edges on the finer mesh, in local rows [Pa]."""
        if self._springs[0] != scene.springs:
            self._springs = scene.springs, self.level.elastic.springs(scene.springs, self.level.frames)
        return self._springs[1]

    def dual_temperature(self, scene: Scene, z: Array) -> Array:
        """ζ (n_f,) with c(ζ, φ) = β∫φ div z for all φ: the change of a goal with the heat that goes in."""
        heat, k = self.level.heat, tuple((where, material.k or 0.0) for where, material in scene.pieces)
        alphas = {edge: alpha for edge, alpha, _ in scene.exchange}
        free = np.setdiff1d(np.arange(self.level.mesh.n_points), heat.mesh.nodes_on(*heat.held))
        key = (tuple(alphas.values()), k)
        if key not in self._heat:
            one = len({*alphas.values()}) == 1
            weighted = max(alphas.values()) * heat.robin_mass if one else heat.exchange(alphas)
            nodes, robin = heat.kept_nodes, sp.coo_array(weighted)
            at = (nodes[robin.row], nodes[robin.col])
            inside = heat.gradients.conduction(k)
            matrix = sp.csc_array(inside + sp.coo_array((robin.data, at), shape=inside.shape))[free][:, free]
            self._heat = {key: scipy.sparse.linalg.splu(matrix)}  # one factor at a time: they are large
        own = self.level.mesh.gradient(z.reshape(2, -1).T)
        beta = self.level.mesh.of_material(scene, "beta")
        dilation = beta * (own[:, 0, 0] + own[:, 1, 1]) * self.level.mesh.area / 3.0
        zeta = np.zeros(self.level.mesh.n_points)
        zeta[free] = self._heat[key].solve((self.level.mesh.incidence @ dilation)[free])
        return zeta


def _sorted_pairs(pairs: NDArray[np.intp], n: int) -> NDArray[np.intp]:
    """One number for each unordered pair of nodes."""
    return pairs.min(axis=1) * n + pairs.max(axis=1)


@dataclass(frozen=True)
class Pair:
    """The solutions of one scene on a level and on the finer one.

    problems, v: contact problems and solutions of both;  u: (2n_f,) displacements of both, on the finer mesh
    z_T:         (m_f,) the dual solution of the goal
    """

    goal: Goal
    halved: Halved
    scene: Scene
    problems: tuple[ContactProblem, ContactProblem]
    v: tuple[Array, Array]
    u: tuple[Array, Array]
    z_T: Array

    @cached_property
    def z(self) -> Array:
        """(2n_f,) z_T extended into the body."""
        return self.halved.level.extension(self.scene, self.z_T)

    def contributions(self) -> Array:
        """(n_f,) parts of J(u_{h/2}) − J(u_h) at the nodes of the finer mesh; a has the springs of edges in it."""
        halved, fine = self.halved, self.halved.level
        nodes, local, z, law = fine.line.nodes, fine.frames.rows, self.z, self.problems[1].law
        rest = np.where(fine.frames.fixed, 0.0, local(z - halved.interpolated(z)))
        e = self.u[1] - self.u[0]
        forces = local(_nodal_forces(halved.level.mesh, e, self.scene))
        if self.scene.springs:
            forces += halved.springs(self.scene) @ local(e)
        by_node = np.sum((rest * forces).reshape(2, -1), axis=0)
        by_node[nodes] += rest[nodes] * self.problems[1].xi(self.v[1])
        lacks = weight_of_friction(self.goal) - local(z)[nodes]
        slips = ~law.sticking(self.v[1])
        lumped = lacks * fine.line.c * law.value(local(self.u[0])[nodes], law.piece(self.v[1]))
        # on the nodes of the level, where both sums of friction all but cancel one by one
        by_node[: halved.coarse.mesh.n_points] += halved.restricted(np.where(slips, lumped, 0.0))
        own = halved.at_coarse(np.where(slips, lacks, 0.0)) * self.problems[0].xi(self.v[0])
        by_node[halved.coarse.line.nodes] -= own
        return by_node

    def shares(self) -> Array:
        """(t,) what each triangle of the level may contribute to the error."""
        halved, scene, frames, line = self.halved, self.scene, self.halved.level.frames, self.halved.coarse.line
        e, z = self.u[1] - self.u[0], self.z
        moved, rest, dual = (own_strain(halved.level.mesh, w) for w in (e, z - halved.interpolated(z), z))
        lift = own_strain(halved.level.mesh, frames.cartesian(np.where(frames.fixed, frames.rows(e), 0.0)))
        energies = (halved.gathered(_work(halved.level.mesh, a, a, scene)) for a in (moved, rest))
        found = np.sqrt(math.prod(energies))
        found += np.abs(halved.gathered(_work(halved.level.mesh, lift, dual, scene)))
        xi = self.problems[0].xi(self.v[0]) / line.c
        lumped = np.abs(lumping(line, xi, halved.at_coarse(self.z_T)))
        found += halved.coarse.mesh.from_segments(lumped, line.which)
        return found + self._heat_shares() if scene.material.expands else found

    def _heat_shares(self) -> Array:
        """(t,) k‖∇(θ_{h/2} − θ_h)‖_K ‖∇(ζ − I_h ζ)‖_K, or |β∫_K(θ_{h/2} − θ_h) div z| of a known θ."""
        halved, scene, mesh, z = self.halved, self.scene, self.halved.level.mesh, self.z
        known = scene.heat.theta
        if known is not None and not isinstance(known, Expression):
            return np.zeros(len(halved.coarse.mesh.triangles))
        e = halved.level.temperature(scene).theta - halved.carry(halved.coarse.temperature(scene).theta)
        if not needs_heat_solve(scene):
            slope = mesh.gradient(z.reshape(2, -1).T)
            mean = e[mesh.triangles].mean(axis=1)
            work = mesh.of_material(scene, "beta") * mesh.area * mean * (slope[:, 0, 0] + slope[:, 1, 1])
            return np.abs(halved.gathered(work))
        zeta, k = halved.dual_temperature(scene, z), mesh.of_material(scene, "k") * mesh.area
        pair = (np.sum(mesh.gradient(w) ** 2, axis=1) for w in (e, zeta - halved.interpolated(zeta)))
        return np.sqrt(math.prod(halved.gathered(k * square) for square in pair))


def _work(mesh: PlaneMesh, a: Array, b: Array, scene: Scene) -> Array:
    """(t,) ∫_K a:c b of strains that are constant on K (t, 3) [J/m]."""
    stress = stress_of(a, *(mesh.of_material(scene, name) for name in ("lam", "mu")))
    return mesh.area * ((stress * b) @ np.array([1.0, 1.0, 2.0]))


def _nodal_forces(mesh: PlaneMesh, u: Array, scene: Scene) -> Array:
    """(2n,) a(u, φ_j) of the hat functions in x and y [N/m]."""
    stress = stress_of(own_strain(mesh, u), *(mesh.of_material(scene, name) for name in ("lam", "mu")))
    rows = stress[:, [[0, 2], [2, 1]]] * mesh.area[:, None, None]
    forces = np.einsum("tcd,tkd->ctk", rows, mesh.slopes)
    at, n = mesh.triangles.ravel(), mesh.n_points
    return np.concatenate([np.bincount(at, force.ravel(), minlength=n) for force in forces])
