"""Estimate the error of a goal J, and each triangle's share, on the mesh cut once more.

The same problem is solved on the mesh with every triangle cut into four.

With e = u_{h/2} − u_h, the dual solution z on the finer mesh, its interpolant I z and ξ = c b(u_T)
on slipping nodes F,

    J(u_{h/2}) − J(u_h) = a(e, z − I z) + Σ_j (z − I z)_j ξ_{h/2,j}
                        + Σ_{j∈F} (a − z)_j c_j b(u_h)_j − Σ_{i∈F} (a − z)_i ξ_{h,i},

the first three sums over nodes of the finer mesh, the last over those of the level, a = 1 for ∫ξ
and 0 otherwise, to first order: the residual of u_h weighted with what the mesh cannot represent of
z, and what lumped friction says on half the cells. Each hat function of the finer mesh gets its
part, so that what cancels between parts of the body is seen.

Numbers:          J(u) − J(u_h) falls by 2^p when h is halved: it is (J(u_{h/2}) − J(u_h))/(1 −
                  2^{−p}), part by part. p = 2 where both solutions are smooth (factor 4/3), 2λ in a
                  corner where they are like r^λ: 2 in a crack's tip, 13 where two slipping edges
                  meet at 170° (`regions`). What the parts do not sum to, the problem not being
                  linear, has 4/3. All that distinguishes u_h from u is in it: given displacements
                  between nodes, lumped friction, oscillating data, temperature, arcs
Regions:          the singular corners, and the rest of the body by the nearest corner, front or
                  point asked for. The mean of p = 2 and p = 1 is off by a third of a region's part;
                  these add like independent errors, in squares. (On an L whose clamped corner and
                  body move a front to opposite sides the change of the sum was 1/50 of the error)
Held ends:        ξ_i of a sticking node beside a held one is what its hat function sees: ∫ξ lacks
                  half a cell of traction (goals.lost), on closed forms up to 86 % of the error.
                  Taken by itself, as z jumps from 1 to 0 there, p = 1; the finer mesh lacks half of
                  it, and what it lacks less or more is added
Tears:            where b jumps or turns at a slip between two neighbours, ∫ξ is known to a cell
                  times the jump (goals.torn); half of that of the finer mesh is added
Steps:            where strength steps along an edge (goals.steps), parts have p = 1, and half a
                  cell of the finer mesh times the step, as friction that changes J, is added
Slip length:      fronts located within their cells, L_h and L_{h/2}, give the limit L; error
                  |J(u_h) − L| + the doubt of fronts that could not be located
Hidden:           what both meshes are too coarse for beside held nodes (goals.hidden_effects) is
                  added with its largest effect
Shares:           ‖u_{h/2} − u_h‖_K ‖z − I z‖_K + |a_K(lift of u_D − u_h, z)| + lumping + heat, and
                  for ∫ξ held ends and tears: unsigned, for marking only
Why not the dual weighted residual: products of recovered gradients gave 0.05 to 26 times the true
                  error. Recovery is not superconvergent on bisected meshes, and beside Γ_C given
                  displacements carried most of the error of ∫ξ, weighted with the recovered stress
                  of a dual solution that jumps there
Literature:       Ferraz-Leite & Praetorius, Computing 83 (2008) 135–162 (h–h/2); Richter & Wick, J.
                  Comput. Appl. Math. 279 (2015) 192–208 (localisation by a partition of unity)
Left out:         cusps, which count with λ = 1/2; data that oscillate within half an element, and
                  sticking zones shorter than that away from held nodes, escape both meshes
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
    """The finer level of `coarse`, with transfer of functions between both.

    parent: (t_f,) coarse triangle of each fine one
    """

    def __init__(self, coarse: Level, scene: Scene, scenes: Sequence[Scene] = ()) -> None:
        """Refine the mesh of a level, with `scene` and `scenes` as for Level.

        Raises GeometryFailed if the refined mesh is not the body.
        """
        mesh = coarse.mesh
        self.coarse = coarse
        self.level = Level(refine(mesh), scene, scenes)
        fine = self.level.mesh
        self._prolong = prolongation(mesh.n_points, fine.points, fine.triangles)
        self.parent, _ = located(mesh, fine.centres)

    def carry(self, values: Array) -> Array:
        """Return nodal values (n,) or displacements (2n,) of the level on the finer one."""
        return (self._prolong @ values.reshape(-1, self.coarse.mesh.n_points).T).T.ravel()

    def interpolated(self, values: Array) -> Array:
        """Return the level's interpolant of (n_f,) or (2n_f,) nodal values, on the finer level."""
        by_component = values.reshape(-1, self.level.mesh.n_points)
        return (self._prolong @ by_component[:, : self.coarse.mesh.n_points].T).T.ravel()

    def start(self, v: Array, u: Array) -> Array:
        """Return a contact solution v (m,) with its u (2n,) as a start on the finer level (m_f,).

        Beside held nodes the displacement given there counts.
        """
        line = self.coarse.line
        n = self.coarse.mesh.n_points
        nodes = self.level.line.nodes
        beside_held = (self._prolong @ line.nodal(np.zeros(line.m), n, 1.0))[nodes] > 0.0
        carried_u = self.level.frames.rows(self.carry(u))[nodes]
        carried_v = (self._prolong @ line.nodal(v, n))[nodes]
        return np.where(beside_held, carried_u, carried_v)

    def restricted(self, forces: Array) -> Array:
        """Return forces (n,) at nodes of the level from those at finer contact nodes (m_f,)."""
        nodal = self.level.line.nodal(forces, self.level.mesh.n_points)
        return np.asarray(self._prolong.T @ nodal)

    @cached_property
    def middles(self) -> NDArray[np.intp]:
        """Return the new node (s,) in the middle of each segment of Γ_C of the level."""
        first, second = self.level.line.segments.T
        after = np.empty(self.level.mesh.n_points, dtype=np.intp)
        after[first] = second
        return after[self.coarse.line.segments[:, 0]]

    def on_segments(self, values: Array) -> Array:
        """Return sums (s,) of (s_f,) values over the two parts of each segment of Γ_C."""
        new_nodes = self.level.line.segments.max(axis=1)
        at_new = np.bincount(new_nodes, values, minlength=self.level.mesh.n_points)
        return np.asarray(at_new[self.middles])

    def on_triangles(self, values: Array) -> Array:
        """Return sums (t,) of (t_f,) values over the parts of each triangle of the level."""
        count = len(self.coarse.mesh.triangles)
        return np.asarray(np.bincount(self.parent, values, count), dtype=float)


Both = tuple[Array, Array]
"""A quantity of the level and of the finer one."""


def contributions(
    goal: Goal,
    halved: Halved,
    scene: Scene,
    problems: tuple[ContactProblem, ContactProblem],
    v: Both,
    u: Both,
    z: Array,
) -> Array:
    """Return the parts (n_f,) of J(u_{h/2}) − J(u_h) at the nodes of the finer mesh.

    a has the springs of edges in it.

    problems, v: contact problems and solutions;  u: (2n_f,) displacements, on the finer mesh
    z: (2n_f,) the dual solution, extended into the body
    """
    fine = halved.level
    line = halved.coarse.line
    nodes = fine.line.nodes
    local = fine.frames.rows
    coarse_problem, fine_problem = problems
    law = fine_problem.law
    fine_v = v[1]
    weight = np.where(fine.frames.fixed, 0.0, local(z - halved.interpolated(z)))
    residual = local(fine.stiffness_times(scene, u[1] - u[0]))
    parts = np.sum((weight * residual).reshape(2, -1), axis=0)
    parts[nodes] += weight[nodes] * fine_problem.xi(fine_v)
    friction_weight = weight_of_friction(goal) - local(z)[nodes]
    friction_weight = np.where(law.sticking(fine_v), 0.0, friction_weight)
    b = law.value(local(u[0])[nodes], law.piece(fine_v))
    lumped = friction_weight * fine.line.c * b
    # on the nodes of the level, where both sums of friction all but cancel one by one
    parts[: halved.coarse.mesh.n_points] += halved.restricted(lumped)
    coarse_weight = fine.line.nodal(friction_weight, fine.mesh.n_points)[line.nodes]
    parts[line.nodes] -= coarse_weight * coarse_problem.xi(v[0])
    return parts


def shares(halved: Halved, scene: Scene, xi: Array, e: Array, z: Array) -> Array:
    """Return unsigned shares (t,) of the triangles of the level in an error.

    They are ‖e‖_K ‖z − I z‖_K, |a_K(lift of e, z)| where displacements are prescribed, lumping
    h/6 |Δξ Δz| on Γ_C, and those of the temperature (`_thermal_shares`).

    xi: (m,) tractions of the level [Pa];  e: (2n_f,) u_{h/2} − u_h;  z: (2n_f,) the dual solution
    """
    mesh = halved.level.mesh
    coarse = halved.coarse
    frames = halved.level.frames
    lam = mesh.of_material(scene, "lam")
    mu = mesh.of_material(scene, "mu")

    def work(first: Array, second: Array) -> Array:
        """Return a_K(first, second) (t,) of displacements (2n_f,) [J/m]."""
        stress = stress_of(own_strain(mesh, first), lam, mu)
        strain = own_strain(mesh, second)
        return halved.on_triangles(mesh.area * ((stress * strain) @ [1.0, 1.0, 2.0]))

    z_error = z - halved.interpolated(z)
    lift = frames.cartesian(np.where(frames.fixed, frames.rows(e), 0.0))
    total = np.sqrt(work(e, e) * work(z_error, z_error))
    total = total + np.abs(work(lift, z))
    z_T = frames.rows(z)[: mesh.n_points][coarse.line.nodes]
    # the unknown −1 of a held node gets NaN, and no lumping is counted there
    ends = coarse.line.unknowns
    xi_change = np.diff(np.append(xi, np.nan)[ends], axis=1)[:, 0]
    z_change = np.diff(np.append(z_T, np.nan)[ends], axis=1)[:, 0]
    lumped = np.nan_to_num(np.abs(coarse.line.lengths / 6.0 * xi_change * z_change))
    total += coarse.mesh.from_segments(lumped, coarse.line.which)
    if scene.material.expands:
        total += _thermal_shares(halved, scene, z)
    return total


def _thermal_shares(halved: Halved, scene: Scene, z: Array) -> Array:
    """Return the shares (t,) of the temperature's error.

    They are k‖∇(θ_{h/2} − θ_h)‖_K ‖∇(ζ − I ζ)‖_K with the dual temperature ζ, where heat is solved
    for, and |β∫_K(θ_{h/2} − θ_h) div z| of a known θ.
    """
    mesh = halved.level.mesh
    fine = halved.level
    coarse = halved.coarse
    slope = mesh.gradient(z.reshape(2, -1).T)
    divergence = slope[:, 0, 0] + slope[:, 1, 1]
    dilation = mesh.of_material(scene, "beta") * mesh.area * divergence
    theta_error = fine.temperature(scene).theta - halved.carry(coarse.temperature(scene).theta)
    if not needs_heat_solve(scene):
        return np.abs(halved.on_triangles(dilation * theta_error[mesh.triangles].mean(axis=1)))
    # c(ζ, φ) = β∫φ div z for all φ: the change of a goal with the heat input
    zeta = fine.temperatures.response(scene, mesh.incidence @ dilation / 3.0)
    conductance = mesh.of_material(scene, "k") * mesh.area

    def square(theta: Array) -> Array:
        """Return ∫_K k |∇θ|² (t,)."""
        return halved.on_triangles(conductance * np.sum(mesh.gradient(theta) ** 2, axis=1))

    return np.sqrt(square(theta_error) * square(zeta - halved.interpolated(zeta)))


ACCEPTED = 1e-6
"""Inclusion residual up to which the finer solution serves an estimate."""


@dataclass(frozen=True)
class GoalError:
    """The estimated error of the goal of one solution.

    limit:  estimated J(u)
    error:  |J(u) − J(u_h)| with that limit, in the unit of J, infinite where the finer problem
            failed
    spread: change of the limit with the order of the extrapolation
    shares: (t,) largest contributions of the triangles to the error
    hidden: (s,) parts of `error` that segments of Γ_C hide, in the unit of J
    """

    limit: float
    error: float
    spread: float
    shares: Array
    hidden: Array


def goal_error(
    goal: Goal, halved: Halved, scene: Scene, problem: ContactProblem, v: Array, u: Array
) -> GoalError:
    """Return the error of the goal of a solution v (m,) with the displacement u (2n,).

    The finer problem starts from v and stays in its basin: solutions of two branches are not
    compared.
    """
    fine = halved.level
    line = halved.coarse.line
    mesh = halved.coarse.mesh
    finer_problem = fine.condensed(scene).problem
    start = halved.start(v, u)
    finer = solve_contact(finer_problem, tolerance=ACCEPTED, branch="continued", neighbour=start)
    value = goal_value(goal, problem, line, v)
    w = finer.v
    if finer.status != Status.CONVERGED:
        no_shares = np.zeros(len(mesh.triangles))
        nothing_hidden = np.zeros(len(line.segments))
        return GoalError(value, np.inf, 0.0, no_shares, nothing_hidden)
    finer_u = fine.displacement(scene, w)
    z_T = np.zeros(fine.line.m)
    with suppress(scipy.linalg.LinAlgError):  # a turning point
        z_T = dual(goal, finer_problem, fine.line, w)
    z = fine.extension(scene, z_T)
    carried_u = halved.carry(u)
    problems = problem, finer_problem
    parts = contributions(goal, halved, scene, problems, (v, w), (carried_u, finer_u), z)
    marking = shares(halved, scene, problem.xi(v) / line.c, finer_u - carried_u, z)
    effects = hidden_effects(goal, fine.line, finer_problem, w, finer_u, z_T)
    hidden = halved.on_segments(effects)
    # steps of the law, moved by half a cell of the finer level
    end_weights = np.abs(weight_of_friction(goal) - z_T[fine.line.unknowns])
    step_sizes = steps(fine.line, finer_problem, w)
    stepped = halved.on_segments(0.5 * fine.line.lengths * step_sizes * np.max(end_weights, axis=1))
    marking += mesh.from_segments(stepped, line.which)
    slip_fronts = fronts(line, problem, v)
    places = [line.ends[front.segment].mean(axis=0) for front in slip_fronts]
    if goal.at is not None:
        places.append(np.array(goal.at))
    sticks = problem.law.sticking(v)
    other_places = np.array(places).reshape(-1, 2)
    factors, region = regions(halved, scene, sticks, other_places, stepped > 0.0)
    change = goal_value(goal, finer_problem, fine.line, w) - value
    # corrections that are known apart from the parts of the change: their sum, and their doubt
    correction = 0.0
    doubt = float(hidden.sum() + stepped.sum())
    loose = 0.0
    if goal.quantity == "slip_length":
        located_length, _ = slip_length(line, problem, v)
        finer_length, length_doubt = slip_length(fine.line, finer_problem, w)
        correction = located_length - value
        change = finer_length - located_length
        doubt = doubt + length_doubt
        for front in slip_fronts:  # half of the cell, which the nodes leave open
            ends = line.segments[front.segment]
            around = np.flatnonzero(np.any(np.isin(mesh.triangles, ends), axis=1))
            marking[around] += 0.5 * front.width / len(around)
    elif goal.quantity == "friction_resultant":
        missing = lost(line, problem, v)
        gained = missing - halved.on_segments(lost(fine.line, finer_problem, w))
        parts[halved.middles] -= gained
        correction = float(missing.sum())
        change = change - float(gained.sum())
        loose = float(np.abs(2.0 * gained - missing).sum())
        doubt += float(torn(fine.line, finer_problem, w).sum())
        marking += mesh.from_segments(np.abs(missing) + torn(line, problem, v), line.which)
    # the remaining change by parts, each with the factor of its region
    nonlinear = change - float(parts.sum())
    spread = DIFFERENCE * math.hypot(*np.bincount(region, parts).tolist(), nonlinear) + loose
    correction = correction + (float(factors @ parts) + SMOOTH * nonlinear)
    return GoalError(value + correction, abs(correction) + doubt, spread, marking, hidden)


SMOOTH = 4.0 / 3.0
"""1/(1 − 2^{−p}) for p = 2."""
FIRST = 2.0
"""1/(1 − 2^{−p}) for p = 1."""
DIFFERENCE = 1.0 / 3.0
"""Difference of their mean from either."""


def regions(
    halved: Halved,
    scene: Scene,
    sticks: NDArray[np.bool_],
    other_places: Array,
    stepped: NDArray[np.bool_] | None = None,
) -> tuple[Array, NDArray[np.intp]]:
    """Return the factors and the regions (n_f,) of the nodes of the finer mesh.

    A factor leads from the part of a node in a change to its part of J(u) − J(u_h). Regions,
    counted from 0, have contributions of one order: the triangles at a singular corner, or the
    nodes nearest to one place.

    sticks:       (m,) whether the contact nodes stick
    other_places: (k, 2) places with regions of their own, beside ends of curves
    stepped:      (s,) segments of Γ_C of the level on which the law steps
    """
    coarse = halved.coarse.mesh
    fine = halved.level.mesh
    line = halved.coarse.line
    factors = np.full(fine.n_points, SMOOTH)
    edge_of_node = [line.edge_names[edge] for edge in line.edge]
    near = sticking_near(edge_of_node, line.xy, sticks)
    exponents = dict[int, float]()  # λ of u ~ r^λ by node; 1/2 in a cusp
    for vertex in vertices(coarse.geometry.corners, scene, near):
        node = int(np.argmin(np.linalg.norm(coarse.points - vertex.at, axis=1)))
        exponents[node] = float(np.nan_to_num(vertex.exponent, nan=0.5))
    places = np.concatenate([coarse.points[list(exponents)], other_places])
    distances = np.linalg.norm(fine.points[:, None] - places[None], axis=2)
    region = np.argmin(distances, axis=1)
    for node, exponent in exponents.items():
        if exponent < 1.0:
            touches = np.any(coarse.triangles == node, axis=1)
            around = fine.triangles[touches[halved.parent]]
            factor = 1.0 / (1.0 - 2.0 ** (-2.0 * exponent))
            factors[around] = np.maximum(factors[around], factor)
            region[around] = region.max() + 1
    if stepped is not None and np.any(stepped):
        stepped_nodes = line.segments[stepped].ravel()
        around = np.concatenate([halved.middles[stepped], stepped_nodes])
        factors[around] = np.maximum(factors[around], FIRST)
        region[around] = region.max() + 1
    return factors, region
