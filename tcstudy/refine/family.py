"""Estimated errors of all points of a level, and the meshes that follow from them.

All points of a sweep share their mesh: a triangle is as important as its share of the relative
error of the point that needs it most, and a tolerance holds when it holds for every point that was
solved.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.norms import located
from tcstudy.accuracy.orders import ROUNDING
from tcstudy.contact.problem import ContactProblem
from tcstudy.exact.solution import known_goal
from tcstudy.fem.energy_error import (
    ContactTraction,
    Pieces,
    contact_traction,
    energy_squares,
    opening_traction,
    pieces_of,
)
from tcstudy.fem.meshes import Meshes, PlaneMesh, refine
from tcstudy.offline.level import Level
from tcstudy.refine.goal_error import Halved, goal_error
from tcstudy.refine.goals import Hidden, goal_value, hidden_on, hidden_shares
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Exact, Study

Array = NDArray[np.float64]
Index = tuple[int, ...]


@dataclass(frozen=True)
class Estimate:
    """Estimated errors of one solution.

    n_dof:      degrees of freedom of the level
    energy:     relative error √(Σ η_K²)/‖u_h‖ in the energy norm
    error:      relative error of the goal, or in the energy norm without one; the tolerance limits
                it
    indicators: (t,) shares of the triangles in error² (energy) or error (goal)
    value:      J(u_h) of the goal, NaN without one
    limit:      estimated J(u)
    goal:       estimated |J(u) − J(u_h)|, in the unit of J
    hidden:     (s,) parts of `goal` that segments of Γ_C beside held nodes hide; empty for the
                energy norm
    """

    n_dof: int
    energy: float
    error: float
    indicators: Array
    value: float = math.nan
    limit: float = math.nan
    goal: float = math.nan
    hidden: Array = field(default_factory=lambda: np.empty(0))

    @property
    def scale(self) -> float:
        """Return the factor from the unit of J to relative errors, 0 without a finite error."""
        if not self.goal > 0.0 or not math.isfinite(self.error):
            return 0.0
        return self.error / self.goal

    @property
    def shares(self) -> Array:
        """Return indicators (t,) that sum to the relative error without its hidden part.

        Points are then comparable. Where the whole error is hidden, they sum to that: other zones
        may behave like the hidden one.
        """
        total = float(self.indicators.sum())
        if not total > 0.0:
            return self.indicators
        hidden = float(self.hidden.sum()) * self.scale
        error = self.error if math.isfinite(self.error) and self.error > 0.0 else 1.0
        visible = error - hidden if error - hidden > ROUNDING * error else hidden
        return self.indicators * (visible / total)


@dataclass
class ErrorEstimator:
    """The estimates of one level, point by point.

    level:  the solved level
    plan:   how the study refines
    before: the estimates of the level before
    scenes: all scenes to come, if known: the finer mesh of goals then shares their basis loads
    exact:  the exact solution, if the study gives one, with which goals are compared
    """

    level: Level
    plan: MeshPlan
    before: dict[Index, Estimate] = field(default_factory=dict)
    scenes: Sequence[Scene] = ()
    exact: Exact | None = None
    estimates: dict[Index, Estimate] = field(default_factory=dict)
    hopeless: bool = False
    _halved: Halved | None = None
    _pieces: Pieces | None = None

    def look(
        self, index: Index, scene: Scene, v: Array, bound: float | None = None
    ) -> dict[str, float]:
        """Estimate the error of a solution v (m,) and return its stored variables by name.

        bound: proved bound of the relative error in the energy norm, NaN for none; the tolerance of
               a proved goal limits it
        """
        goal = self.plan.goal
        estimate = self._estimate(index, scene, v)
        if goal.proved:
            if bound is None or math.isnan(bound):
                bound = math.inf
            estimate = replace(estimate, error=bound)
            self.hopeless |= self.level.law(scene).omega >= self.level.band(scene).high
        self.estimates[index] = estimate
        stored = {"error_estimate": estimate.energy}
        if goal.quantity != "energy":
            stored |= {"goal": estimate.value, "goal_estimate": estimate.goal}
        exact_value = goal.known
        if exact_value is None and self.exact is not None:
            exact_value = known_goal(goal, self.exact, scene)
        if exact_value is not None:
            stored["goal_error"] = abs(estimate.value - exact_value)
            if stored["goal_error"] > 0.0:
                stored["goal_effectivity"] = estimate.goal / stored["goal_error"]
        return stored

    # -- one solution ------------------------------------------------------------------------------

    def _estimate(self, index: Index, scene: Scene, v: Array) -> Estimate:
        goal = self.plan.goal
        n_dof = self.level.frames.n_dof
        u = self.level.displacement(scene, v)
        problem = self.level.condensed(scene).problem
        squares, norm = self.energy_squares(scene, problem, v, u)
        energy = _ratio(math.sqrt(float(squares.sum())), norm)
        if goal.quantity == "energy":
            return Estimate(n_dof, energy, energy, squares)
        if self._halved is None:
            self._halved = Halved(self.level, scene, self.scenes)
        result = goal_error(goal, self._halved, scene, problem, v, u)
        value = goal_value(goal, problem, self.level.line, v)
        coarser = self.before.get(index)
        # The extrapolated value has changed by twice `drift`. Its error falls by about three from
        # level to level, so that one half of the change is left. The spread over the orders says
        # the same of one level alone: the larger of both is enough.
        drift = 0.5 * abs(result.limit - coarser.limit) if coarser else 0.0
        error = result.error + max(result.spread, drift)
        # With J(u) − J(u_h) ~ 1/N, at least a third of the scaled error of the level before: no
        # change of sign hides more. The slip length jumps by cells, so that its error on one level
        # does not predict the next.
        if coarser and goal.quantity != "slip_length":
            coarser_error = abs(coarser.limit - coarser.value)
            error = max(error, LEAST_ERROR * coarser_error * coarser.n_dof / n_dof)
        # A goal may not depend on the solution, for example u_T where the body sticks.
        shares = result.shares if np.any(result.shares) else squares
        relative = _ratio(error, abs(value))
        return Estimate(n_dof, energy, relative, shares, value, result.limit, error, result.hidden)

    def energy_squares(
        self, scene: Scene, problem: ContactProblem, v: Array, u: Array
    ) -> tuple[Array, float]:
        """Return η_K² (t,) of the energy norm [J/m] and ‖u_h‖ [√(J/m)] of a solution.

        v: (m,) slips, then openings;  u: (2n,) displacement
        """
        level = self.level
        theta = np.zeros(level.mesh.n_points)
        if scene.material.expands:
            theta = level.temperature(scene).theta
        u_T, s_N = level.split(v)
        xi, S_N = level.split(problem.xi(v) / level.c)
        friction = contact_traction(level.mesh, level.line, scene.friction, u_T, xi, u)
        adhesion: ContactTraction | None = None
        if level.opening is not None:
            lines = level.line, level.opening
            law = scene.opening_laws
            adhesion = opening_traction(level.mesh, lines, law, s_N, S_N, u)
        self._pieces = self._pieces or pieces_of(level.mesh, scene)
        return energy_squares(self._pieces, u, theta, scene, friction, adhesion)

    # -- all solutions -----------------------------------------------------------------------------

    @property
    def error(self) -> float:
        """Return the largest error of all points, NaN if no point was solved."""
        return max((estimate.error for estimate in self.estimates.values()), default=math.nan)

    def stop(self, last: bool) -> str:
        """Return why refinement ends on this level, empty if it goes on.

        last: whether there is no further level
        """
        plan = self.plan
        error = self.error
        if math.isnan(error):
            return "no point was solved, so there is no error estimate to refine by"
        reached = f"{plan.goal.kind} relative error {error:.2g} of {plan.goal.quantity}"
        is_compared = plan.goal.quantity == "energy" or (
            bool(self.before) and self.level.mesh.level >= COMPARED
        )
        if plan.tolerance is not None and error <= plan.tolerance and (is_compared or last):
            return f"tolerance {plan.tolerance:g} met: {reached}"
        # without load, for example: shares at rounding level would refine one place for ever
        largest = max(estimate.energy for estimate in self.estimates.values())
        if plan.open_ended and largest <= ROUNDING:
            return f"nothing to refine: {reached} is rounding"
        missed = "" if plan.tolerance is None else f"tolerance {plan.tolerance:g} not met: "
        if self.hopeless:
            cause = "no bound converges where ω ≥ λ₁ of the body, as at one point at least"
            return f"{missed}{reached}, and {cause}"
        if last:
            return f"{missed}{reached} on the last level" + (", raise max_levels" if missed else "")
        n_dof = self.level.frames.n_dof
        finest_n_dof = self._halved.level.frames.n_dof if self._halved else n_dof
        if plan.open_ended and finest_n_dof > plan.max_dofs:
            size = f"{n_dof} DOFs"
            if finest_n_dof > n_dof:
                size += f" ({finest_n_dof} where its error was estimated)"
            return f"{missed}{reached} at {size}, more than max_dofs"
        return ""

    def shares(self) -> Array:
        """Return the share (t,) of each triangle in the relative error of its most important point.

        With a tolerance, points that meet it do not count. Hidden parts come on top (`hidden`).
        """
        return np.asarray(np.max([estimate.shares for estimate in self._missing()], axis=0))

    def hidden(self) -> Hidden:
        """Return the hidden parts of the relative error, each of its most important point."""
        parts = [estimate.hidden * estimate.scale for estimate in self._missing()]
        return hidden_on(self.level.mesh, self.level.line, np.max(parts, axis=0))

    def _missing(self) -> list[Estimate]:
        """Return points that miss the tolerance; all, if none does or there is no tolerance."""
        estimates = list(self.estimates.values())
        tolerance = self.plan.tolerance or 0.0
        return [estimate for estimate in estimates if estimate.error > tolerance] or estimates

    def target_ratio(self) -> float:
        """Return the sum of shares to reach on the next mesh, relative to that of this one.

        A share is expected to fall by half where its triangle is cut. The ratio is that of one step
        with the study's marking. With the tolerance of a goal it is that of several steps, because
        an estimate of a goal costs several times as much as a solution. It is no smaller than the
        tolerance needs; in the energy norm shares are squares.
        """
        one_step = 1.0 - 0.5 * self.plan.marking
        least_step = 1.0 - 0.5 * LEAST_MARKING
        tolerance = self.plan.tolerance
        quantity = self.plan.goal.quantity
        if tolerance is None or not tolerance < self.error < math.inf:
            return one_step
        needed = tolerance / self.error
        if quantity == "energy":
            return max(one_step, min(least_step, needed**2))
        return max(one_step ** STEPS[quantity], min(least_step, needed))


def marked(shares: Array, fraction: float) -> NDArray[np.bool_]:
    """Return the fewest triangles (t,) that carry this fraction of all shares (t,) (Dörfler)."""
    order = np.argsort(-shares, kind="stable")
    cumulative = np.cumsum(shares[order])
    count = int(np.searchsorted(cumulative, fraction * cumulative[-1])) + 1
    is_marked = np.zeros(len(shares), dtype=bool)
    is_marked[order[:count]] = True
    return is_marked


STEPS = {"friction_resultant": 5, "u_T": 3, "slip_length": 3}
"""Steps of the study's marking for each estimate of a goal, between few levels and small meshes.

With five, u_T and slip lengths end on meshes half to twice as large again
(tests.benchmarks.tolerances)."""
COMPARED = 2
"""First level on which the tolerance of a goal may be met: on coarser meshes two solutions may miss
the same fronts."""
LEAST_MARKING = 0.1
"""Smallest share of the error that a step refines: each step costs a solution."""
LEAST_ERROR = 1.0 / 3.0
"""Smallest error accepted, relative to the prediction of the level before."""


def _ratio(error: float, value: float) -> float:
    """Return error/value, and 0 for no error of a value 0."""
    if error == 0.0:
        return 0.0
    return error / value if value > 0.0 else math.inf


MAX_BISECTIONS = 12
"""Bisections of one place from level to level."""


def bisected(
    mesh: PlaneMesh, shares: Array, ratio: float, marking: float, hidden: Hidden
) -> PlaneMesh:
    """Return the next mesh: this one bisected where the shares (t,) are large.

    Bisection goes on until the sum of the shares should be `ratio` times as large. Each round marks
    triangles for the fraction `marking` of the sum, or for as much as is still needed. A part of a
    triangle gets share·(area ratio)², as with smooth solutions, so that few triangles with much of
    the error, at a held end of Γ_C or at a front, are cut several times on the way to one level.
    Hidden parts fall with the lengths of their cells.
    """
    first_total = math.nan
    elapsed = 0.0
    level = mesh.level + 1
    for _ in range(MAX_BISECTIONS):
        all_shares = shares + hidden_shares(mesh, hidden)
        total = float(all_shares.sum())
        if math.isnan(first_total):
            first_total = total
        elif total <= ENOUGH * ratio * first_total:
            break
        fraction = 0.0
        if total > 0.0:
            fraction = min(marking, 2.0 * (1.0 - ratio * first_total / total))
        finer = refine(mesh, marked(all_shares, fraction))
        elapsed += finer.time_mesh
        parent, _ = located(mesh, finer.centres)
        area_ratio = finer.area / mesh.area[parent]
        mesh = finer
        shares = shares[parent] * area_ratio**2
    return replace(mesh, level=level, time_mesh=elapsed)


ENOUGH = 1.05
"""The sum of shares that ends the rounds, relative to the one aimed at."""


class Family(Meshes):
    """The meshes of one run.

    Each mesh of an adaptive family follows from the estimates on the one before alone, so that a
    resumed run gets the same meshes.
    """

    def __init__(self, study: Study) -> None:
        """Raises GeometryFailed if the body cannot be made."""
        super().__init__(study)
        self._study = study
        self._estimator: ErrorEstimator | None = None

    def next(self, level: int) -> PlaneMesh:
        """Return the mesh of a level, after those of all levels before.

        Raises GeometryFailed if the mesher fails.
        """
        plan = self._study.mesh
        estimator = self._estimator
        if not plan.strategy.adapts or level == 0:
            return super().next(level)
        assert self.mesh is not None
        assert estimator is not None
        self.mesh = bisected(
            self.mesh,
            estimator.shares(),
            estimator.target_ratio(),
            plan.marking,
            estimator.hidden(),
        )
        return self.mesh

    def estimator(self, level: Level) -> ErrorEstimator | None:
        """Return an error estimator of a level, or None if the study estimates no errors."""
        study = self._study
        if not study.mesh.estimates:
            return None
        before = self._estimator.estimates if self._estimator is not None else {}
        self._estimator = ErrorEstimator(level, study.mesh, dict(before), study.scenes, study.exact)
        return self._estimator
