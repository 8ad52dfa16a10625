"""How far a number J is off, and where: by the same problem on the mesh with every triangle cut
into four.

With e = u_{h/2} − u_h, the dual solution z on the finer mesh, its interpolant I z and ξ = c b(u_T)
on slipping nodes F,

    J(u_{h/2}) − J(u_h) = a(e, z − I z) + Σ_j (z − I z)_j ξ_{h/2,j}
                        + Σ_{j∈F} (a − z)_j c_j b(u_h)_j − Σ_{i∈F} (a − z)_i ξ_{h,i},

the first three sums over nodes of the finer mesh, the last over those of the level, a = 1 for ∫ξ
and 0 otherwise, to first order: the residual of u_h weighted with what the mesh cannot represent of
z, and what lumped friction says on half the cells. Each hat function of the finer mesh gets its
part, so that what cancels between parts of the body is seen.

Numbers:    J(u) − J(u_h) falls by 2^p when h is halved: it is (J(u_{h/2}) − J(u_h))/(1 − 2^{−p}), part by part. p = 2
            where both solutions are smooth (factor 4/3), 2λ in a corner where they are like r^λ: 2
            in a crack's tip, 13
            where two slipping edges meet at 170° (`regions`). What the parts do not sum to, the
            problem not being
            linear, has 4/3. All that distinguishes u_h from u is in it: given displacements between
            nodes, lumped
            friction, oscillating data, temperature, arcs
Regions:    the singular corners, and the rest of the body by the nearest corner, front or point asked for. The mean of
            p = 2 and p = 1 is off by a third of a region's part; these add like independent errors,
            in squares. (On an
            L whose clamped corner and body move a front to opposite sides the change of the sum was
            1/50 of the error)
Held ends:  ξ_i of a sticking node beside a held one is what its hat function sees: ∫ξ lacks half a cell of traction
            (goals.lost), on closed forms up to 86 % of the error. Taken by itself, as z jumps from
            1 to 0 there, p = 1;
            the finer mesh lacks half of it, and what it lacks less or more is added
Tears:      where b jumps or turns at a slip between two neighbours, ∫ξ is known to a cell times the jump (goals.torn);
            half of that of the finer mesh is added
Steps:      where strength steps along an edge (goals.steps), parts have p = 1, and half a cell of the finer mesh times
            the step, as friction that changes J, is added
Slip length: fronts located within their cells, L_h and L_{h/2}, give the limit L; error |J(u_h) −
L| + the doubt of
            fronts that could not be located
Hidden:     what both meshes are too coarse for beside held nodes (goals.hidden_effects) is added with its largest
            effect
Shares:     ‖u_{h/2} − u_h‖_K ‖z − I z‖_K + |a_K(lift of u_D − u_h, z)| + lumping + heat, and for ∫ξ held ends and
            tears: unsigned, for marking only
Why not the dual weighted residual: products of recovered gradients gave 0.05 to 26 times the true
error. Recovery is
            not superconvergent on bisected meshes, and beside Γ_C given displacements carried most
            of the error of ∫ξ,
            weighted with the recovered stress of a dual solution that jumps there
Literature: Ferraz-Leite & Praetorius, Computing 83 (2008) 135–162 (h–h/2); Richter & Wick, J.
Comput. Appl. Math. 279
            (2015) 192–208 (localisation by a partition of unity)
Left out:   cusps, which count with λ = 1/2; data that oscillate within half an element, and sticking zones shorter
            than that away from held nodes, escape both meshes
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.accuracy.corners import sticking_near, vertices
from tcstudy.accuracy.norms import located, prolongation
from tcstudy.contact.problem import ContactProblem, Status
from tcstudy.contact.solve import solve_contact
from tcstudy.fem.energy_error import own_strain, stress_of
from tcstudy.fem.meshes import refine
from tcstudy.offline.level import Level
from tcstudy.refine.goals import (
    dual,
    fronts,
    goal_value,
    hidden_effects,
    lost,
    slip_length,
    steps,
    torn,
    weight_of_friction,
)
from tcstudy.scene.mesh_plan import Goal
from tcstudy.scene.points import needs_heat_solve
from tcstudy.scene.records import Scene

Array = NDArray[np.float64]


class Halved:
    """The finer level of `coarse`, and what carries functions over; parent: (t_f,) coarse triangle
    of each fine one."""

    def __init__(self, coarse: Level, scene: Scene, scenes: Sequence[Scene] = ()) -> None:
        """scene, scenes: as for Level. Raises GeometryFailed if the refined mesh is not the
        body."""
        mesh = coarse.mesh
        self.coarse, self.level = coarse, Level(refine(mesh), scene, scenes)
        fine = self.level.mesh
        self._prolong = prolongation(mesh.n_points, fine.points, fine.triangles)
        self.parent, _ = located(mesh, fine.centres)

    def carry(self, values: Array) -> Array:
        """Nodal values (n,) or displacements (2n,) of the level as those of the finer one."""
        return (self._prolong @ values.reshape(-1, self.coarse.mesh.n_points).T).T.ravel()

    def interpolated(self, values: Array) -> Array:
        """The level's interpolant of (n_f,) or (2n_f,) nodal values of the finer one, on the finer
        one."""
        by_component = values.reshape(-1, self.level.mesh.n_points)
        return (self._prolong @ by_component[:, : self.coarse.mesh.n_points].T).T.ravel()

    def start(self, v: Array, u: Array) -> Array:
        """A contact solution v (m,) of the level, with its u (2n,), as a start on the finer one
        (m_f,); beside held nodes the displacement given there counts.
        """
        line, n, nodes = self.coarse.line, self.coarse.mesh.n_points, self.level.line.nodes
        beside_held = (self._prolong @ line.nodal(np.zeros(line.m), n, 1.0))[nodes] > 0.0
        given = self.level.frames.rows(self.carry(u))[nodes]
        return np.where(beside_held, given, (self._prolong @ line.nodal(v, n))[nodes])

    def restricted(self, forces: Array) -> Array:
        """(n,) forces at the contact nodes of the finer level (m_f,) as those at the nodes of the
        level."""
        return np.asarray(self._prolong.T @ self.level.line.nodal(forces, self.level.mesh.n_points))

    @cached_property
    def middles(self) -> NDArray[np.intp]:
        """(s,) the new node in the middle of each segment of Γ_C of the level."""
        after, (first, second) = (
            np.empty(self.level.mesh.n_points, dtype=np.intp),
            self.level.line.segments.T,
        )
        after[first] = second
        return after[self.coarse.line.segments[:, 0]]

    def on_segments(self, values: Array) -> Array:
        """(s,) sums of (s_f,) values on the segments of Γ_C over the two parts of each of the
        level."""
        at_new = np.bincount(
            self.level.line.segments.max(axis=1), values, minlength=self.level.mesh.n_points
        )
        return np.asarray(at_new[self.middles])


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
    """(n_f,) parts of J(u_{h/2}) − J(u_h) at the nodes of the finer mesh; a has the springs of
    edges in it.

    problems, v: contact problems and solutions;  u: (2n_f,) displacements, on the finer mesh
    z: (2n_f,) the dual solution, extended into the body
    """
    fine, line, xi = halved.level, halved.coarse.line, problems[1].xi(v[1])
    nodes, local, law = fine.line.nodes, fine.frames.rows, problems[1].law
    rest = np.where(fine.frames.fixed, 0.0, local(z - halved.interpolated(z)))
    by_node = np.sum(
        (rest * local(fine.stiffness_times(scene, u[1] - u[0]))).reshape(2, -1), axis=0
    )
    by_node[nodes] += rest[nodes] * xi
    lacks = np.where(law.sticking(v[1]), 0.0, weight_of_friction(goal) - local(z)[nodes])
    lumped = lacks * fine.line.c * law.value(local(u[0])[nodes], law.piece(v[1]))
    # on the nodes of the level, where both sums of friction all but cancel one by one
    by_node[: halved.coarse.mesh.n_points] += halved.restricted(lumped)
    by_node[line.nodes] -= fine.line.nodal(lacks, fine.mesh.n_points)[line.nodes] * problems[0].xi(
        v[0]
    )
    return by_node


def shares(halved: Halved, scene: Scene, xi: Array, e: Array, z: Array) -> Array:
    """(t,) what each triangle of the level may contribute to an error, unsigned: ‖e‖_K ‖z − I z‖_K,
    |a_K(lift of e, z)| where displacements are given, lumping h/6 |Δξ Δz| on Γ_C, and k‖∇(θ_{h/2} −
    θ_h)‖_K ‖∇(ζ − I ζ)‖_K with the dual temperature ζ, or |β∫_K(θ_{h/2} − θ_h) div z| of a known θ.

    xi: (m,) tractions of the level [Pa];  e: (2n_f,) u_{h/2} − u_h;  z: (2n_f,) the dual solution
    """
    mesh, coarse, frames = halved.level.mesh, halved.coarse, halved.level.frames
    lam, mu = (mesh.of_material(scene, name) for name in ("lam", "mu"))

    def gathered(values: Array) -> Array:
        """(t,) sums of (t_f,) values over the parts of each triangle of the level."""
        return np.asarray(
            np.bincount(halved.parent, values, len(coarse.mesh.triangles)), dtype=float
        )

    def work(a: Array, b: Array) -> Array:
        """(t,) a_K(a, b) of displacements (2n_f,) [J/m]."""
        a, b = own_strain(mesh, a), own_strain(mesh, b)
        return gathered(mesh.area * ((stress_of(a, lam, mu) * b) @ [1.0, 1.0, 2.0]))

    rest, lift = (
        z - halved.interpolated(z),
        frames.cartesian(np.where(frames.fixed, frames.rows(e), 0.0)),
    )
    found = np.sqrt(work(e, e) * work(rest, rest)) + np.abs(work(lift, z))
    z_T = frames.rows(z)[: mesh.n_points][coarse.line.nodes]
    xi_step, z_step = (
        np.diff(np.append(x, np.nan)[coarse.line.unknowns], axis=1)[:, 0] for x in (xi, z_T)
    )
    lumped = np.nan_to_num(np.abs(coarse.line.lengths / 6.0 * xi_step * z_step))
    found += coarse.mesh.from_segments(lumped, coarse.line.which)
    if scene.material.expands:
        slope = mesh.gradient(z.reshape(2, -1).T)
        dilation = mesh.of_material(scene, "beta") * mesh.area * (slope[:, 0, 0] + slope[:, 1, 1])
        w = halved.level.temperature(scene).theta - halved.carry(coarse.temperature(scene).theta)
        if needs_heat_solve(
            scene
        ):  # c(ζ, φ) = β∫φ div z for all φ: the change of a goal with the heat that goes in
            zeta = halved.level.temperatures.response(scene, mesh.incidence @ dilation / 3.0)
            k, both = (
                mesh.of_material(scene, "k") * mesh.area,
                (w, zeta - halved.interpolated(zeta)),
            )
            found += np.sqrt(
                math.prod(gathered(k * np.sum(mesh.gradient(one) ** 2, axis=1)) for one in both)
            )
        else:
            found += np.abs(gathered(dilation * w[mesh.triangles].mean(axis=1)))
    return found


ACCEPTED = 1e-6
"""Inclusion residual up to which the finer solution is good enough for an estimate."""


@dataclass(frozen=True)
class GoalError:
    """What is estimated of one solution.

    limit:  estimated J(u);  error: what |J(u) − J(u_h)| is by that limit, in the unit of J, infinite where the finer
            problem failed
    spread: by how much the limit changes with the order it is extrapolated with
    shares: (t,) what each triangle may contribute to the error
    hidden: (s,) what the segments of Γ_C hide of it, in the unit of J: part of `error`
    """

    limit: float
    error: float
    spread: float
    shares: Array
    hidden: Array


def goal_error(
    goal: Goal, halved: Halved, scene: Scene, problem: ContactProblem, v: Array, u: Array
) -> GoalError:
    """Error of the goal of a solution v (m,) with the displacement u (2n,).

    The finer problem starts from v and stays in its basin, so that another solution of the same
    load is not compared.
    """
    fine, line, mesh = halved.level, halved.coarse.line, halved.coarse.mesh
    finer = fine.condensed(scene).problem
    answer = solve_contact(
        finer, tolerance=ACCEPTED, branch="continued", neighbour=halved.start(v, u)
    )
    value, w = goal_value(goal, problem, line, v), answer.v
    if answer.status != Status.CONVERGED:
        return GoalError(
            value, np.inf, 0.0, np.zeros(len(mesh.triangles)), np.zeros(len(line.segments))
        )
    better, z_T = fine.displacement(scene, w), np.zeros(fine.line.m)
    with suppress(scipy.linalg.LinAlgError):  # a turning point
        z_T = dual(goal, finer, fine.line, w)
    z = fine.extension(scene, z_T)
    carried = halved.carry(u)
    parts = contributions(goal, halved, scene, (problem, finer), (v, w), (carried, better), z)
    marking = shares(halved, scene, problem.xi(v) / line.c, better - carried, z)
    hidden = halved.on_segments(hidden_effects(goal, fine.line, finer, w, better, z_T))
    # steps of the law, moved by half a cell of the finer level
    lacks = np.max(np.abs(weight_of_friction(goal) - z_T[fine.line.unknowns]), axis=1)
    stepped = halved.on_segments(0.5 * fine.line.lengths * steps(fine.line, finer, w) * lacks)
    marking += mesh.from_segments(stepped, line.which)
    stick, found = problem.law.sticking(v), fronts(line, problem, v)
    at = [line.ends[front.segment].mean(axis=0) for front in found]
    places = np.array(at + ([np.array(goal.at)] if goal.at is not None else [])).reshape(-1, 2)
    factors, region = regions(halved, scene, stick, places, stepped > 0.0)
    change = goal_value(goal, finer, fine.line, w) - value
    # what is known apart from the parts of the change: the limit over J(u_h) without them, and
    # their own doubt
    apart, doubt, loose = 0.0, float(hidden.sum() + stepped.sum()), 0.0
    if goal.quantity == "slip_length":
        own, (length, unsure) = slip_length(line, problem, v)[0], slip_length(fine.line, finer, w)
        apart, change, doubt = own - value, length - own, doubt + unsure
        for front in found:  # half of the cell: what the nodes leave open
            around = np.flatnonzero(
                np.any(np.isin(mesh.triangles, line.segments[front.segment]), axis=1)
            )
            marking[around] += 0.5 * front.width / len(around)
    elif goal.quantity == "friction_resultant":
        missing = lost(line, problem, v)
        gained = missing - halved.on_segments(lost(fine.line, finer, w))
        parts[halved.middles] -= gained
        apart, change = float(missing.sum()), change - float(gained.sum())
        loose = float(np.abs(2.0 * gained - missing).sum())
        doubt += float(torn(fine.line, finer, w).sum())
        marking += mesh.from_segments(np.abs(missing) + torn(line, problem, v), line.which)
    # the rest of the change by parts, each with the factor of its place
    nonlinear = change - float(parts.sum())
    spread = DIFFERENCE * math.hypot(*np.bincount(region, parts).tolist(), nonlinear) + loose
    rest = apart + (float(factors @ parts) + SMOOTH * nonlinear)
    return GoalError(value + rest, abs(rest) + doubt, spread, marking, hidden)


SMOOTH, FIRST, DIFFERENCE = 4.0 / 3.0, 2.0, 1.0 / 3.0
"""1/(1 − 2^{−p}) for p = 2 and for p = 1, and by how much their mean differs from the first."""


def regions(
    halved: Halved,
    scene: Scene,
    sticks: NDArray[np.bool_],
    more: Array,
    stepped: NDArray[np.bool_] | None = None,
) -> tuple[Array, NDArray[np.intp]]:
    """(n_f,) of the nodes of the finer mesh: factors from what they contribute to a change to its
    part of J(u) − J(u_h), and regions, from 0 on, whose contributions go by one order.

    Regions are every singular corner with the triangles that touch it, and the nodes nearest to one end of a curve.
    sticks:  (m,) whether the contact nodes stick;  more: (k, 2) other places with nodes of their own, beside curve ends
    stepped: (s,) segments of Γ_C of the level on which the law steps
    """
    coarse, fine, line = halved.coarse.mesh, halved.level.mesh, halved.coarse.line
    factors = np.full(fine.n_points, SMOOTH)
    near = sticking_near([line.edge_names[i] for i in line.edge], line.xy, sticks)
    known = vertices(coarse.geometry.corners, scene, near)  # with λ of u ~ r^λ; 1/2 in a cusp
    at = {
        int(np.argmin(np.linalg.norm(coarse.points - one.at, axis=1))): float(
            np.nan_to_num(one.exponent, nan=0.5)
        )
        for one in known
    }
    places = np.concatenate([coarse.points[list(at)], more])
    region = np.argmin(np.linalg.norm(fine.points[:, None] - places[None], axis=2), axis=1)
    for node, exponent in at.items():
        if exponent < 1.0:
            around = fine.triangles[np.any(coarse.triangles == node, axis=1)[halved.parent]]
            factors[around] = np.maximum(factors[around], 1.0 / (1.0 - 2.0 ** (-2.0 * exponent)))
            region[around] = region.max() + 1
    if stepped is not None and np.any(stepped):
        around = np.concatenate([halved.middles[stepped], line.segments[stepped].ravel()])
        factors[around] = np.maximum(factors[around], FIRST)
        region[around] = region.max() + 1
    return factors, region
