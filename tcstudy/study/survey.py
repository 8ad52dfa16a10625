"""Estimated errors of all points of one level: what to refine, and whether to go on.

All points of a sweep share their mesh. A triangle is as important as it is to the point that needs it most: its share
of that point's relative error. A tolerance holds when it holds for every point that was solved.
"""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg
from numpy.typing import NDArray

from tcstudy.fem.estimators import (
    Strain,
    boundary_edges,
    boundary_traction,
    contact_traction,
    dirichlet_gap,
    dirichlet_residual,
    edge_residual,
    element_residual,
    energy_norm,
    product,
    strain,
)
from tcstudy.fem.heat_estimator import coupling, excess, gradient_product
from tcstudy.fem.recovery import Triangles
from tcstudy.scene.records import MeshPlan, Scene
from tcstudy.study.goals import dual, goal_value, lumping, transitions
from tcstudy.study.level import Condensed, Level
from tcstudy.study.plan import needs_heat_solve

Array = NDArray[np.float64]
Index = tuple[int, ...]


@dataclass(frozen=True)
class Estimate:
    """Estimated errors of one solution.

    n_dof:      displacement unknowns of the level
    energy:     relative error √(Σ η_K²)/‖u_h‖ in the energy norm
    value:      J(u_h) of the goal, NaN without one;  corrected: value + estimated J(u) − J(u_h)
    goal:       estimated |J(u) − J(u_h)|, in the unit of J
    error:      what the tolerance is compared with: relative error of the goal, or in the energy norm without one
    indicators: (t,) shares of the triangles in error² (energy) or error (goal)
    always:     triangles to refine whatever their share: those at ends of slip, for the slip length. It is no
                differentiable function of the solution, so that there is no dual problem: meshes are refined for the
                energy norm, and the length is known to half the cells at the ends of slip, or to its change since the
                level before if that is larger
    """

    n_dof: int
    energy: float
    value: float
    corrected: float
    goal: float
    error: float
    indicators: Array
    always: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, dtype=np.intp))


@dataclass
class Survey:
    """The estimates of one level, point by point.

    level:  the solved level;  plan: how the study refines
    before: the estimates of the level before
    """

    level: Level
    plan: MeshPlan
    before: dict[Index, Estimate] = field(default_factory=dict)
    estimates: dict[Index, Estimate] = field(default_factory=dict)
    _heat: dict[Hashable, scipy.sparse.linalg.SuperLU] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.triangles = Triangles(self.level.mesh)

    def look(self, index: Index, scene: Scene, condensed: Condensed, v: Array) -> dict[str, float]:
        """Estimate the error of a solution v (m,); what is stored of it, by variable name."""
        goal = self.plan.goal
        estimate = self._estimate(index, scene, condensed, v)
        self.estimates[index] = estimate
        stored = {"error_estimate": estimate.energy}
        if goal.quantity != "energy":
            stored |= {"goal": estimate.value, "goal_estimate": estimate.goal}
        if goal.known is not None:
            stored["goal_error"] = abs(estimate.value - goal.known)
            if stored["goal_error"] > 0.0:
                stored["goal_effectivity"] = estimate.goal / stored["goal_error"]
        return stored

    # -- one solution ------------------------------------------------------------------------------

    def _estimate(self, index: Index, scene: Scene, condensed: Condensed, v: Array) -> Estimate:
        level, triangles, material = self.level, self.triangles, scene.material
        u = level.displacement(scene, condensed, v)
        theta = level.temperature(scene).theta if material.beta != 0.0 else np.zeros(level.mesh.n_points)
        own = strain(triangles, u)
        xi = condensed.problem.xi(v) / level.line.c
        friction = contact_traction(triangles, level.line, scene.friction, v, xi, u)
        squares = product(triangles, own.excess, own.excess, material.lam, material.mu)
        squares += element_residual(triangles, own, theta, scene)
        squares += edge_residual(triangles, own, theta, scene, friction)
        gap = dirichlet_gap(triangles, u, scene)
        squares += dirichlet_residual(triangles, gap, scene)
        if material.beta != 0.0:
            squares += coupling(triangles, theta, scene, needs_heat_solve(scene))
        norm = energy_norm(triangles, own, material.lam, material.mu)
        energy = _ratio(math.sqrt(float(squares.sum())), norm)
        n_dof = level.frames.n_dof
        if self.plan.goal.quantity == "energy":
            return Estimate(n_dof, energy, math.nan, math.nan, math.nan, energy, squares)
        value = goal_value(self.plan.goal, condensed.problem, level.line, v)
        old, always = self.before.get(index), np.empty(0, dtype=np.intp)
        if self.plan.goal.quantity == "slip_length":
            nodes, width = transitions(level.line, condensed.problem, v)
            always = np.flatnonzero(np.any(np.isin(level.mesh.triangles, nodes), axis=1))
            shares, corrected = squares, value
            error = max(width, abs(value - old.value) if old else 0.0)
        else:
            change, shares = self._weighted(scene, condensed, v, theta, own, gap, squares)
            corrected = value + change
            error = max(abs(change) + self._drift(old, corrected), self._least(old))
        if not np.any(shares):  # the goal does not feel the solution here, for example u_T where the body sticks
            shares = squares
        return Estimate(n_dof, energy, value, corrected, error, _ratio(error, abs(value)), shares, always)

    @staticmethod
    def _drift(old: Estimate | None, corrected: float) -> float:
        """Half of what the corrected values of two levels differ by: so much may a correction be wrong."""
        return 0.5 * abs(corrected - old.corrected) if old else 0.0

    def _least(self, old: Estimate | None) -> float:
        """Half of what the error of the level before becomes at J(u) − J(u_h) ~ 1/N.

        An error that changes its sign from level to level is small by accident somewhere, and so is its estimate.
        """
        return 0.5 * abs(old.corrected - old.value) * old.n_dof / self.level.frames.n_dof if old else 0.0

    def _weighted(
        self, scene: Scene, condensed: Condensed, v: Array, theta: Array, own: Strain, gap: Array, squares: Array
    ) -> tuple[float, Array]:
        """J(u) − J(u_h) and what each triangle may contribute to it, weighted by the dual solution.

        J(u) − J(u_h) = a(u − u_h, z − z_h) + k∫∇(θ − θ_h)·∇(ζ − ζ_h)
                        + (Σ ξ_i z_i − ∫_{Γ_C} ξ_h z_h) − ∫_{Γ_D} (u_D − u_h)·σ(z)n
        with recovered gradients for exact ones; the last two are what lumping and given displacements add.
        """
        triangles, material = self.triangles, scene.material
        z_T = dual(self.plan.goal, condensed.problem, self.level.line, v)
        z = self.level.extension(scene, z_T)
        weight = strain(triangles, z)
        change = product(triangles, own.excess, weight.excess, material.lam, material.mu)
        weights = product(triangles, weight.excess, weight.excess, material.lam, material.mu)
        shares = np.sqrt(squares * weights)
        at_edges = -np.einsum("sqd,sqd->s", gap, boundary_traction(triangles, weight, scene))
        at_edges *= 0.5 * boundary_edges(triangles).length
        at_edges += lumping(triangles, self.level.line, condensed.problem.xi(v) / self.level.line.c, z_T)
        change += triangles.from_segments(at_edges)
        shares += triangles.from_segments(np.abs(at_edges))
        if material.beta != 0.0 and needs_heat_solve(scene):
            by_heat, share_of_heat = self.heat_part(scene, theta, z)
            change += by_heat
            shares += share_of_heat
        return float(change.sum()), shares

    def heat_part(self, scene: Scene, theta: Array, z: Array) -> tuple[Array, Array]:
        """(t,) β∫(θ − θ_h) div z = k∫∇(θ − θ_h)·∇(ζ − ζ_h) triangle by triangle, and bounds of its parts."""
        triangles, k = self.triangles, scene.material.k
        assert k is not None
        a, b = excess(triangles, theta), excess(triangles, self._dual_temperature(scene, z))
        bounds = np.sqrt(gradient_product(triangles, a, a) * gradient_product(triangles, b, b))
        return k * gradient_product(triangles, a, b), k * bounds

    def _dual_temperature(self, scene: Scene, z: Array) -> Array:
        """ζ with c(ζ, φ) = β∫φ div z for all φ: the change of J with the heat that goes in."""
        heat, alpha, k = self.level.heat, scene.heat.alpha, scene.material.k
        assert k is not None
        if (alpha, k) not in self._heat:
            nodes = heat.robin_nodes
            robin = sp.coo_array(heat.robin_mass)
            shape = heat.conduction.shape
            on_boundary = sp.coo_array((robin.data, (nodes[robin.row], nodes[robin.col])), shape=shape)
            matrix = sp.csc_array(k * heat.conduction + alpha * on_boundary)
            self._heat[alpha, k] = scipy.sparse.linalg.splu(matrix)
        own = self.triangles.gradient(z.reshape(2, -1).T)
        dilation = (own[:, 0, 0] + own[:, 1, 1]) * self.triangles.area / 3.0
        return self._heat[alpha, k].solve(scene.material.beta * (self.triangles.incidence @ dilation))

    # -- all solutions -----------------------------------------------------------------------------

    @property
    def error(self) -> float:
        """The largest error of all points; NaN if no point was solved."""
        return max((e.error for e in self.estimates.values()), default=math.nan)

    def stop(self, last: bool) -> str:
        """Why refinement ends on this level, in words; empty if it goes on. last: there may be no further level."""
        plan, error = self.plan, self.error
        if math.isnan(error):
            return "no point was solved, so nothing says what to refine"
        reached = f"estimated relative error {error:.2g} of {plan.goal.quantity}"
        # A goal on the first mesh may look better than it is: nothing has been compared with it yet.
        compared = plan.goal.quantity == "energy" or bool(self.before)
        if plan.tolerance is not None and error <= plan.tolerance and (compared or last):
            return f"tolerance {plan.tolerance:g} met: {reached}"
        missed = "" if plan.tolerance is None else f"tolerance {plan.tolerance:g} not met: "
        if last:
            return f"{missed}{reached} on the last level" + (", raise max_levels" if missed else "")
        if (plan.family == "adaptive" or missed) and self.level.frames.n_dof > plan.max_dofs:
            return f"{missed}{reached} at {self.level.frames.n_dof} dofs, more than max_dofs"
        return ""

    def marked(self) -> NDArray[np.bool_]:
        """(t,) triangles to refine: the fewest that carry the share `marking` of the worst point's error (Dörfler).

        With a tolerance, points that meet it do not count, and no more is marked than halving the squared error of
        what is marked is expected to need.
        """
        asked = self.plan.tolerance or 0.0
        found = list(self.estimates.values())
        missing = [e for e in found if e.error > asked] or found
        shares = np.max([_shares(e) for e in missing], axis=0)
        fraction = self.plan.marking
        if asked and math.isfinite(self.error):
            power = 2.0 if self.plan.goal.quantity == "energy" else 1.0
            fraction = min(fraction, max(LEAST_MARKING, 2.0 * (1.0 - (asked / self.error) ** power)))
        order = np.argsort(-shares, kind="stable")
        carried = np.cumsum(shares[order])
        count = int(np.searchsorted(carried, fraction * carried[-1])) + 1
        marked = np.zeros(len(shares), dtype=bool)
        marked[order[:count]] = True
        marked[np.concatenate([e.always for e in missing])] = True
        return marked


LEAST_MARKING = 0.1
"""Smallest share of the error that a step refines for: steps cost a solution each, however few triangles they add."""


def _shares(estimate: Estimate) -> Array:
    """Indicators that sum to the point's relative error, so that points compare."""
    total = float(estimate.indicators.sum())
    scale = estimate.error if math.isfinite(estimate.error) and estimate.error > 0.0 else 1.0
    return estimate.indicators * (scale / total) if total > 0.0 else estimate.indicators


def _ratio(error: float, value: float) -> float:
    """error/value; 0 for no error at all, even of nothing."""
    if error == 0.0:
        return 0.0
    return error / value if value > 0.0 else math.inf
