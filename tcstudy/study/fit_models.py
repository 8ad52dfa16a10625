"""What a study says of measurements, for given numbers of it, with derivatives by these numbers.

Of a history (`history_run`) the steps are compared that were measured: one history an evaluation, and one for every
number, which is a little off, for differences. All other derivatives are exact.

Vertical: the scene is solved at every datum, each from the solution before (the way a test goes: one solve a datum),
and its results are compared; derivatives from the factor at each solution (`contact.linearised`).

Orthogonal: the path of the scene along the measured parameter t is followed once, and every datum is projected on the
curve (t, R), R = Σξ, in units of the noise of both. By the envelope theorem ∂d/∂p = −nᵀ∂(t, R)/∂p, whatever coordinate
along the curve is held fixed (`study.fit_path`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tcstudy.condense import NotPositiveDefinite
from tcstudy.contact.path.follow import Follower, Path
from tcstudy.contact.path.problem import WHOLE
from tcstudy.contact.problem import Status
from tcstudy.contact.solution import Linearised
from tcstudy.contact.solve import solve_contact
from tcstudy.errors import FitError, PathError, StudyError
from tcstudy.offline.level import Level
from tcstudy.offline.slopes import WholeBody, change_of
from tcstudy.read.scenes import Scenery
from tcstudy.scene.histories import HistoryPlan, Keys, UnfitLaw
from tcstudy.scene.parameters import path_scene
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Direction, FitPlan, Sensitivity
from tcstudy.study.fit_path import MovingPath
from tcstudy.study.history_run import STIFFNESS, with_stiffness
from tcstudy.study.history_run import followed as followed_steps
from tcstudy.study.path_run import affine_load, followed, straightened
from tcstudy.study.point import Rates, rates_of

Array = NDArray[np.float64]
DIFFERENCE = 1e-6
"""Of a number of a history, relative to its scale: one history a column of the Jacobian."""
SCALARS = ("friction_resultant", "u_T_max", "theta_mean")


@dataclass(frozen=True, eq=False)
class Compared:
    """Results of the study at the data, in the order measured column by measured column.

    residual: (n,) in units of the noise;  jacobian: (n, k) ∂residual/∂p
    predicted: (n,) results;  foot: (n, 2) feet (t, R) of an orthogonal comparison
    early: why the path ends before it has to; empty if it does not;  path: where the data lie along one
    """

    residual: Array
    jacobian: Array
    predicted: Array
    foot: Array = field(default_factory=lambda: np.empty((0, 2)))
    early: str = ""
    path: Path | None = None


@dataclass
class FitModel:
    """The study as a function of the numbers to find.

    scenery: the scene with other numbers
    noise:  (n,) of the measured columns one after the other; given_noise: of the parameter of a path
    solves: contact problems solved, or paths followed, so far
    law_error: of the straight pieces beside which the curve of a law with exponential pieces is sought
    """

    plan: FitPlan
    scenery: Scenery
    level: Level
    noise: Array
    given_noise: float
    tolerance: float | None = None
    solves: int = 0
    law_error: float = 1e-3

    def values(self, p: Array) -> dict[Keys, float]:
        """The numbers by key path, but that of a memory."""
        paths = (one.number.path for one in self.plan.parameters)
        return {path: float(value) for path, value in zip(paths, p, strict=True) if path != STIFFNESS}

    def scene(self, p: Array) -> Scene:
        """The scene with these numbers. Raises FitError."""
        try:
            return self.scenery.at(self.plan.scene, self.values(p))
        except StudyError as error:
            raise FitError(error.problems[0].what) from error

    def chain(self, p: Array) -> tuple[list[Sensitivity], Array]:
        """The K numbers by which results have derivatives, and (K, k) theirs by those to find: itself, or all
        that are made of a name of the study's own."""
        values, columns = self.values(p), list[dict[Keys, float]]()
        for one in self.plan.parameters:
            own = one.number.path[0] == "parameters"
            made = self.scenery.rates(self.plan.scene, one.number.path[1], values) if own else {one.number.path: 1.0}
            columns.append(made)
        paths = list(dict.fromkeys(path for column in columns for path in column))
        matrix = np.array([[column.get(path, 0.0) for column in columns] for path in paths])
        return [Sensitivity(".".join(path), path, "") for path in paths], matrix

    def compared(self, p: Array) -> Compared:
        """The study with the numbers p against the data. Raises FitError where it has no solution."""
        scene = self.scene(p)
        if self.plan.history is not None:
            return self._vertical(scene, [], self._steps(p))
        numbers, chain = self.chain(p)
        found = (self._vertical if self.plan.compare == "vertical" else self._orthogonal)(scene, numbers)
        found = replace(found, jacobian=found.jacobian @ chain)
        if not np.all(np.isfinite(found.jacobian)):
            raise FitError("the results have no derivative at a datum: it lies on a fold; use compare: orthogonal")
        return found

    def plan_of(self, p: Array) -> HistoryPlan | None:
        """The history with these numbers."""
        paths = [one.number.path for one in self.plan.parameters]
        return (
            with_stiffness(self.plan.history, dict(zip(paths, p.tolist(), strict=True))) if self.plan.history else None
        )

    def _steps(self, p: Array) -> dict[int, tuple[Array, Array]]:
        """What is compared at the measured steps of the history, and its derivatives: differences inside the bounds."""
        middle, columns = self._followed(p), list[dict[int, Array]]()
        for j, one in enumerate(self.plan.parameters):
            h = DIFFERENCE * (p[j] if one.log else max(abs(p[j]), 1e-3 * (one.high - one.low)))
            q = p.copy()
            q[j] += h if p[j] + h <= one.high else -h
            columns.append({n: (x - middle[n]) / (q[j] - p[j]) for n, x in self._followed(q).items()})
        return {n: (x, np.stack([column[n] for column in columns], axis=1)) for n, x in middle.items()}

    def _followed(self, p: Array) -> dict[int, Array]:
        """What is compared at the measured steps of the history; the rest of it is not followed."""
        wanted, found, plan, scene = set(self.plan.at_steps), dict[int, Array](), self.plan_of(p), self.scene(p)
        assert plan is not None
        try:
            for n, (step, mean) in enumerate(followed_steps(plan, self.level, scene, self.tolerance)):
                self.solves += 1
                if not step.solved:
                    raise FitError(f"step {n} cannot be compared with the numbers tried: {step.reason}")
                if n in wanted:
                    found[n] = np.array([self.level.line.c @ step.xi, np.max(np.abs(step.v)), mean, *step.v])
                if n >= max(wanted):
                    break
        except (NotPositiveDefinite, UnfitLaw) as error:
            raise FitError(str(error)) from error
        return found

    def _results(self, scene: Scene, v: Array, xi: Array, moved: Iterable[Rates]) -> tuple[Array, Array]:
        """(3 + m,) the SCALARS of a solution and u_T, and (3 + m, k) their derivatives."""
        largest = int(np.argmax(np.abs(v)))
        rows = [[dxi.sum(), np.sign(v[largest]) * dv[largest], mean, *dv] for dv, dxi, mean in moved]
        mean = self.level.temperature(scene).mean if scene.material.beta != 0.0 else 0.0
        return np.array([xi.sum(), np.max(np.abs(v)), mean, *v]), np.array(rows).T

    def _vertical(
        self, scene: Scene, numbers: list[Sensitivity], steps: dict[int, tuple[Array, Array]] | None = None
    ) -> Compared:
        """numbers: to differentiate by;  steps: of a history, in the place of solutions"""
        plan, v, known = self.plan, None, None
        count, k = len(plan.measured[0].values), len(numbers) if steps is None else len(plan.parameters)
        predicted, slopes = np.empty((len(plan.measured), count)), np.empty((len(plan.measured), count, k))
        for i in range(count):
            loads = tuple(column.values[i] for column in plan.loads)
            if steps is not None:
                values, rates = steps[plan.at_steps[i]]
            elif loads != known:  # the data of a profile have one load
                for column, value in zip(plan.loads, loads, strict=True):
                    scene = path_scene(scene, column.path, value)
                v, known = self._solved(scene, v, i), loads
                problem, whole = self.level.condensed(scene).problem, WholeBody(self.level, scene, v)
                here = Linearised.at(problem, v)
                moved = [rates_of(whole, one, here, change_of(self.level, scene, one)) for one in numbers]
                values, rates = self._results(scene, v, problem.xi(v), moved)
            for j, column in enumerate(plan.measured):
                if column.name == "u_T":
                    predicted[j, i], slopes[j, i] = self._weights[i] @ values[3:], self._weights[i] @ rates[3:]
                else:
                    at = SCALARS.index(column.name)
                    predicted[j, i], slopes[j, i] = values[at], rates[at]
        data = np.array([column.values for column in plan.measured])
        sigma = self.noise[: data.size]
        residual = (predicted - data).ravel() / sigma
        return Compared(residual, slopes.reshape(-1, k) / sigma[:, None], predicted.ravel())

    def _solved(self, scene: Scene, before: Array | None, i: int) -> Array:
        """The solution at a datum, continued from that before."""
        problem = self.level.condensed(scene).problem
        branch = "from-zero" if before is None else "continued"
        answer = solve_contact(problem, tolerance=self.tolerance, branch=branch, neighbour=before)  # type: ignore[arg-type]
        self.solves += 1
        if answer.status != Status.CONVERGED:
            raise FitError(f"datum {i + 1} has no solution with the numbers tried: {answer.reason}")
        return answer.v

    @cached_property
    def _weights(self) -> Array:
        """(n, m) u_T at the x of every datum is linear between the contact nodes beside it."""
        place, nodes = self.plan.place, self.level.line.xy[:, 0]
        assert place is not None
        order, x = np.argsort(nodes), np.array(place.values)
        along = nodes[order]
        cell = np.diff(along)
        if len(along) < 2 or not np.all(cell > 0.0):
            raise FitError("a profile of u_T over x needs a contact line of which no two nodes have the same x")
        if np.any((x < along[0] - cell[0]) | (x > along[-1] + cell[-1])):
            raise FitError(f"x = {x[np.argmax(np.abs(x - along.mean()))]:g} of the profile is not on the contact line")
        left = np.clip(np.searchsorted(along, x) - 1, 0, len(along) - 2)
        share = np.clip((x - along[left]) / cell[left], 0.0, 1.0)
        found = np.zeros((len(x), len(along)))
        rows = np.arange(len(x))
        found[rows, order[left]] = 1.0 - share
        found[rows, order[left + 1]] = share
        return found

    # -- along the path ----------------------------------------------------------------------------

    def _orthogonal(self, scene: Scene, numbers: list[Sensitivity]) -> Compared:
        given, measured = self.plan.given[0], self.plan.measured[0]
        path = self.follow(scene)
        sigma = np.array([self.given_noise, self.noise[0]])
        data = np.stack([given.values, measured.values], axis=1)
        foot, jacobian = MovingPath(self.level, scene, given.path, path, numbers).feet(data, sigma)
        early = "" if path.end in WHOLE else path.end.reason
        found = foot.point * sigma
        return Compared(foot.distance, jacobian, found[:, 1], found, early, path)

    def follow(self, scene: Scene) -> Path:
        """The path from no load on, as far beyond the data again as they reach."""
        column = self.plan.given[0]
        values = column.values
        low, high = min(0.0, *values), max(0.0, *values)
        reach = high - low
        follower = Follower(low - reach, high + reach, tolerance=self.tolerance)
        self.solves += 1
        try:
            load = affine_load(self.level, lambda t: path_scene(scene, column.path, t), low, high, column.name)
            problem = straightened(self.level, scene, load.problem, self.law_error, (low - reach, high + reach))
            way: Direction = "forward" if max(values) > -min(values) else "backward"
            return followed(problem, follower, "from-zero", 0.0, way, column.name)[0]
        except PathError as error:
            raise FitError(str(error)) from error
