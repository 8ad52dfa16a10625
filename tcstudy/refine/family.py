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
from tcstudy.fem.energy_error import Pieces, contact_traction, energy_squares, pieces_of
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

    n_dof:      displacement unknowns of the level
    energy:     relative error √(Σ η_K²)/‖u_h‖ in the energy norm
    error:      what the tolerance is compared with: relative error of the goal, or in the energy norm without one
    indicators: (t,) shares of the triangles in error² (energy) or error (goal)
    value:      J(u_h) of the goal, NaN without one;  limit: estimated J(u)
    goal:       estimated |J(u) − J(u_h)|, in the unit of J
    hidden:     (s,) what segments of Γ_C beside held nodes hide of `goal`, empty for the energy norm
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
        """From the unit of J to relative errors; 0 where the error is no finite number."""
        return self.error / self.goal if self.goal > 0.0 and math.isfinite(self.error) else 0.0

    @property
    def shares(self) -> Array:
        """(t,) indicators that sum to the relative error without what end cells hide, so that
        points compare.

        Where nothing else is known to be wrong, to as much as they hide: what one zone does, others
        may.
        """
        total, hidden = float(self.indicators.sum()), float(self.hidden.sum()) * self.scale
        error = self.error if math.isfinite(self.error) and self.error > 0.0 else 1.0
        rest = error - hidden if error - hidden > ROUNDING * error else hidden
        return self.indicators * (rest / total) if total > 0.0 else self.indicators


@dataclass
class ErrorEstimator:
    """The estimates of one level, point by point.

    level:  the solved level;  plan: how the study refines
    before: the estimates of the level before
    scenes: all scenes to come, if known: what they share is then computed once on the finer mesh of goals, too
    exact:  the exact solution, if the study gives one: goals are compared with its values
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
        """Estimate the error of a solution v (m,); what is stored of it, by variable name.

        bound: of the relative error in the energy norm, NaN for none, which the tolerance of a
        proved goal is of
        """
        goal = self.plan.goal
        estimate = self._estimate(index, scene, v)
        if goal.proved:
            estimate = replace(
                estimate, error=math.inf if bound is None or math.isnan(bound) else bound
            )
            self.hopeless |= self.level.law(scene).omega >= self.level.band(scene).high
        self.estimates[index] = estimate
        stored = {"error_estimate": estimate.energy}
        if goal.quantity != "energy":
            stored |= {"goal": estimate.value, "goal_estimate": estimate.goal}
        known = (
            goal.known
            if self.exact is None or goal.known is not None
            else known_goal(goal, self.exact, scene)
        )
        if known is not None:
            stored["goal_error"] = abs(estimate.value - known)
            if stored["goal_error"] > 0.0:
                stored["goal_effectivity"] = estimate.goal / stored["goal_error"]
        return stored

    # -- one solution ------------------------------------------------------------------------------

    def _estimate(self, index: Index, scene: Scene, v: Array) -> Estimate:
        goal, n_dof = self.plan.goal, self.level.frames.n_dof
        u, problem = self.level.displacement(scene, v), self.level.condensed(scene).problem
        squares, norm = self.energy_squares(scene, problem, v, u)
        energy = _ratio(math.sqrt(float(squares.sum())), norm)
        if goal.quantity == "energy":
            return Estimate(n_dof, energy, energy, squares)
        if self._halved is None:
            self._halved = Halved(self.level, scene, self.scenes)
        found = goal_error(goal, self._halved, scene, problem, v, u)
        value, old = goal_value(goal, problem, self.level.line, v), self.before.get(index)
        # What extrapolation has changed by: its error falls by about three from level to level,
        # which leaves one half. The spread over the orders says the same of one level alone, so
        # that the larger of both is enough.
        drift = 0.5 * abs(found.limit - old.limit) if old else 0.0
        error = found.error + max(found.spread, drift)
        # A third of what the error of the level before becomes at J(u) − J(u_h) ~ 1/N: no change of
        # sign hides more. The slip length jumps by cells, so that its error on one level says
        # nothing of the next.
        if old and goal.quantity != "slip_length":
            error = max(error, LEAST_ERROR * abs(old.limit - old.value) * old.n_dof / n_dof)
        # A goal may not feel the solution, for example u_T where the body sticks.
        shares = found.shares if np.any(found.shares) else squares
        return Estimate(
            n_dof,
            energy,
            _ratio(error, abs(value)),
            shares,
            value,
            found.limit,
            error,
            found.hidden,
        )

    def energy_squares(
        self, scene: Scene, problem: ContactProblem, v: Array, u: Array
    ) -> tuple[Array, float]:
        """(t,) η_K² of the energy norm [J/m] and ‖u_h‖ [√(J/m)] of a solution v (m,) with the
        displacement u (2n,)."""
        level = self.level
        theta = (
            level.temperature(scene).theta
            if scene.material.expands
            else np.zeros(level.mesh.n_points)
        )
        friction = contact_traction(
            level.mesh, level.line, scene.friction, v, problem.xi(v) / level.line.c, u
        )
        self._pieces = self._pieces or pieces_of(level.mesh, scene)
        return energy_squares(self._pieces, u, theta, scene, friction)

    # -- all solutions -----------------------------------------------------------------------------

    @property
    def error(self) -> float:
        """The largest error of all points; NaN if no point was solved."""
        return max((e.error for e in self.estimates.values()), default=math.nan)

    def stop(self, last: bool) -> str:
        """Why refinement ends on this level, in words; empty if it goes on. last: there may be no
        further level."""
        plan, error = self.plan, self.error
        if math.isnan(error):
            return "no point was solved, so nothing says what to refine"
        reached = f"{plan.goal.kind} relative error {error:.2g} of {plan.goal.quantity}"
        compared = plan.goal.quantity == "energy" or (
            bool(self.before) and self.level.mesh.level >= COMPARED
        )
        if plan.tolerance is not None and error <= plan.tolerance and (compared or last):
            return f"tolerance {plan.tolerance:g} met: {reached}"
        # without load, say: shares of rounding would refine one place for ever
        if plan.open_ended and max(e.energy for e in self.estimates.values()) <= ROUNDING:
            return f"nothing to refine: {reached} is rounding"
        missed = "" if plan.tolerance is None else f"tolerance {plan.tolerance:g} not met: "
        if self.hopeless:
            return f"{missed}{reached}, and no bound converges where ω ≥ λ₁ of the body, as at one point at least"
        if last:
            return f"{missed}{reached} on the last level" + (", raise max_levels" if missed else "")
        n_dof = self.level.frames.n_dof
        most = self._halved.level.frames.n_dof if self._halved else n_dof
        if plan.open_ended and most > plan.max_dofs:
            where = f"{n_dof} dofs" + (
                f" ({most} where its error was estimated)" if most > n_dof else ""
            )
            return f"{missed}{reached} at {where}, more than max_dofs"
        return ""

    def shares(self) -> Array:
        """(t,) what each triangle contributes to the relative error of the point that it is most
        important to.

        With a tolerance, points that meet it do not count. What end cells hide comes on top
        (`hidden`).
        """
        return np.asarray(np.max([e.shares for e in self._missing()], axis=0))

    def hidden(self) -> Hidden:
        """What end cells hide of the relative error of the point that each is most important to."""
        parts = np.max([e.hidden * e.scale for e in self._missing()], axis=0)
        return hidden_on(self.level.mesh, self.level.line, parts)

    def _missing(self) -> list[Estimate]:
        """Points that miss the tolerance; all, if none does or there is no tolerance."""
        found = list(self.estimates.values())
        return [e for e in found if e.error > (self.plan.tolerance or 0.0)] or found

    def aim(self) -> float:
        """What the next mesh is to leave of the sum of all shares, if each falls by half where its
        triangle is cut: one step with the study's marking, or several with the tolerance of a goal,
        whose estimate is several times as dear as a solution, but no less than a tolerance needs
        (in the energy norm shares are squares).
        """
        asked, one = self.plan.tolerance, 1.0 - 0.5 * self.plan.marking
        if asked is None or not asked < self.error < math.inf:
            return one
        if self.plan.goal.quantity == "energy":
            return max(one, min(1.0 - 0.5 * LEAST_MARKING, (asked / self.error) ** 2))
        return max(
            one ** STEPS[self.plan.goal.quantity],
            min(1.0 - 0.5 * LEAST_MARKING, asked / self.error),
        )


def marked(shares: Array, fraction: float) -> NDArray[np.bool_]:
    """(t,) the fewest triangles that carry this fraction of all shares (t,) (Dörfler)."""
    order = np.argsort(-shares, kind="stable")
    carried = np.cumsum(shares[order])
    count = int(np.searchsorted(carried, fraction * carried[-1])) + 1
    found = np.zeros(len(shares), dtype=bool)
    found[order[:count]] = True
    return found


STEPS = {"friction_resultant": 5, "u_T": 3, "slip_length": 3}
"""Steps of the study's marking that one estimate of a goal is made to last for, a compromise of few
levels and small meshes: with five, u_T and slip lengths end on meshes a half to twice as large
again (tests.benchmarks.tolerances)."""
COMPARED = 2
"""First level on which the tolerance of a goal may be met: on coarser meshes two solutions may miss
the same fronts."""
LEAST_MARKING = 0.1
"""Smallest share of the error that a step refines for: steps cost a solution each, however few
triangles they add."""
LEAST_ERROR = 1.0 / 3.0
"""Smallest error that is believed, over what the level before lets expect."""


def _ratio(error: float, value: float) -> float:
    """error/value; 0 for no error at all, even of nothing."""
    if error == 0.0:
        return 0.0
    return error / value if value > 0.0 else math.inf


ROUNDS = 12
"""Bisections of one place from level to level at most."""


def bisected(
    mesh: PlaneMesh, shares: Array, aim: float, marking: float, hidden: Hidden
) -> PlaneMesh:
    """The mesh, one level on, bisected where the shares (t,) are large until their sum should be
    `aim` times as much.

    Each round marks triangles for the fraction `marking` of the sum, or for as much as is still
    needed. A part gets what smooth solutions leave it, share·(area ratio)², so that few triangles
    with much of the error, at a held end of Γ_C or at a front, are cut several times on the way to
    one level. What end cells hide goes with their lengths.
    """
    total, level, elapsed = math.nan, mesh.level + 1, 0.0
    for _ in range(ROUNDS):
        both = shares + hidden_shares(mesh, hidden)
        own = float(both.sum())
        if math.isnan(total):
            total = own
        elif own <= ENOUGH * aim * total:
            break
        fraction = min(marking, 2.0 * (1.0 - aim * total / own)) if own > 0.0 else 0.0
        finer = refine(mesh, marked(both, fraction))
        elapsed += finer.time_mesh
        of, _ = located(mesh, finer.centres)
        ratio = finer.area / mesh.area[of]
        mesh, shares = finer, shares[of] * ratio**2
    return replace(mesh, level=level, time_mesh=elapsed)


ENOUGH = 1.05
"""The sum that ends the rounds, over the sum aimed at: no round for a rest of nothing."""


class Family(Meshes):
    """The meshes of one run, each of an adaptive family after the estimates on the one before and
    from nothing else, so that a run that is resumed comes to the same meshes.
    """

    def __init__(self, study: Study) -> None:
        """Raises GeometryFailed if the body cannot be made."""
        super().__init__(study)
        self._study = study
        self._estimator: ErrorEstimator | None = None

    def next(self, level: int) -> PlaneMesh:
        """The mesh of a level, after those of all levels before. Raises GeometryFailed if the
        mesher fails."""
        plan, estimator = self._study.mesh, self._estimator
        if not plan.strategy.adapts or level == 0:
            return super().next(level)
        assert self.mesh is not None
        assert estimator is not None
        self.mesh = bisected(
            self.mesh, estimator.shares(), estimator.aim(), plan.marking, estimator.hidden()
        )
        return self.mesh

    def estimator(self, level: Level) -> ErrorEstimator | None:
        """An estimator of the errors of a level's solutions; None if the study estimates no
        errors."""
        study = self._study
        if not study.mesh.estimates:
            return None
        before = self._estimator.estimates if self._estimator is not None else {}
        self._estimator = ErrorEstimator(level, study.mesh, dict(before), study.scenes, study.exact)
        return self._estimator
