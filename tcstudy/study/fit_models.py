"""Compare a study with measurements for given parameters, with derivatives by these parameters.

History (`history_run`): the measured steps are compared. An evaluation follows one history, and one
more for every parameter, slightly changed, for differences. All other derivatives are exact.

Vertical: the scene is solved at every datum, each from the solution before, as a test runs, and its
results are compared; derivatives follow from the factor at each solution
(`contact.solution.Linearised`).

Orthogonal: the path of the scene along the measured parameter t is followed once, and every datum
is projected on the curve (t, R), R = Σξ, in units of the noise of both. By the envelope theorem
∂d/∂p = −nᵀ∂(t, R)/∂p, whatever coordinate along the curve is held fixed. On a side of the polygon
(t, R) the nodes keep their pieces, and held fixed is eᵀv with e along the side: the bordered matrix
[H −l̃₁; eᵀ 0] is regular at a simple fold, where H is not. At a corner the slip of the node that
passes its kink there is held on that kink. The same applies beside the path of a law with
exponential pieces, on the curve itself (`contact.path.smooth`). Literature: Keller, in Rabinowitz
(ed.), Applications of Bifurcation Theory (1977) 359–384 (bordering).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.accuracy.fitted import Feet, feet
from tcstudy.condense import NotPositiveDefinite
from tcstudy.contact.path.follow import Follower, Path
from tcstudy.contact.path.problem import WHOLE
from tcstudy.contact.path.smooth import CurvePoint, Goal, SmoothPath
from tcstudy.contact.problem import ContactProblem, Status
from tcstudy.contact.solution import Linearised
from tcstudy.contact.solve import solve_contact
from tcstudy.errors import FitError, PathError, StudyError
from tcstudy.laws.composed import LawSlopes, law_slopes, number_of
from tcstudy.offline.level import Level
from tcstudy.offline.slopes import WholeBody, change_of
from tcstudy.read.scenes import SceneReader
from tcstudy.scene.fit_plan import RESULTS_OF_OPENINGS, FitPlan, Sensitivity
from tcstudy.scene.histories import Keys, UnfitLaw
from tcstudy.scene.parameters import path_scene
from tcstudy.scene.path_plan import Direction
from tcstudy.scene.records import Scene
from tcstudy.scene.solver_plan import Branch
from tcstudy.study.history_run import follow_steps
from tcstudy.study.path_run import affine_load, follow_branch, straightened
from tcstudy.study.sensitivities import opening_slopes, rates_of

Array = NDArray[np.float64]
RELATIVE_STEP = 1e-6
"""Step of the differences of a history, relative to the scale of the parameter."""
MIN_SCALE = 1e-3
"""Smallest scale of a parameter without logarithm, relative to its range."""
ON_CURVE = 1e-9
"""Distance of a datum from the curve, relative to the datum, up to which it lies on it."""
SCALARS = ("friction_resultant", "u_T_max", "theta_mean")


@dataclass(frozen=True, eq=False)
class Comparison:
    """Results of the study at the data, one measured column after the other.

    residual:  (n,) in units of the noise;  jacobian: (n, k) ∂residual/∂p
    predicted: (n,) results;  foot: (n, 2) feet (t, R) of an orthogonal comparison
    early:     why the path ends before it has to; empty if it does not
    path:      that of an orthogonal comparison
    """

    residual: Array
    jacobian: Array
    predicted: Array
    foot: Array = field(default_factory=lambda: np.empty((0, 2)))
    early: str = ""
    path: Path | None = None


@dataclass
class FitModel:
    """The study as a function of the parameters.

    scenery:     the scene with other values
    noise:       (n,) standard deviations of the measured columns one after the other
    given_noise: that of the parameter of a path
    solves:      contact problems solved, or paths followed, so far
    law_error:   of the straight pieces beside which the curve of a law with exponential pieces lies
    """

    plan: FitPlan
    scenery: SceneReader
    level: Level
    noise: Array
    given_noise: float
    tolerance: float | None = None
    solves: int = 0
    law_error: float = 1e-3

    def values(self, p: Array) -> dict[Keys, float]:
        """Return the parameters by key path."""
        paths = [parameter.number.path for parameter in self.plan.parameters]
        return dict(zip(paths, p.tolist(), strict=True))

    def scene(self, p: Array) -> Scene:
        """Return the scene with these parameters. Raises FitError."""
        try:
            return self.scenery.at(self.plan.scene, self.values(p))
        except StudyError as error:
            raise FitError(error.problems[0].what) from error

    def chain(self, p: Array) -> tuple[list[Sensitivity], Array]:
        """Return the K numbers by which results have derivatives, and (K, k) theirs by p.

        A parameter is such a number itself, or a name of the study that makes several.
        """
        values = self.values(p)
        columns = list[dict[Keys, float]]()
        for path in values:
            if path[0] == "parameters":
                columns.append(self.scenery.rates(self.plan.scene, path[1], values))
            else:
                columns.append({path: 1.0})
        paths = list(dict.fromkeys(path for column in columns for path in column))
        matrix = np.array([[column.get(path, 0.0) for column in columns] for path in paths])
        return [Sensitivity(".".join(path), path, "") for path in paths], matrix

    def compare(self, p: Array) -> Comparison:
        """Compare the study with the parameters p with the data.

        Raises FitError where it has no solution.
        """
        if self.plan.history is not None:
            results, rates = self._steps(p)
            return self._vertical(results, rates)
        scene = self.scene(p)
        numbers, matrix = self.chain(p)
        if self.plan.compare == "vertical":
            points = list(self._points(scene, numbers))
            results = np.array([result for result, _ in points])
            rates = np.array([rate for _, rate in points])
            comparison = self._vertical(results, rates)
        else:
            comparison = self._orthogonal(scene, numbers)
        jacobian = comparison.jacobian @ matrix
        if not np.all(np.isfinite(jacobian)):
            raise FitError(
                "the results have no derivative at a datum: it lies on a fold; "
                "use compare: orthogonal"
            )
        return replace(comparison, jacobian=jacobian)

    # -- at all n data: results (n, s + m), the s scalars and u_T, and their derivatives
    # (n, s + m, k)

    @property
    def scalars(self) -> tuple[str, ...]:
        """The names of the results that are one number."""
        if self.level.opening is None:
            return SCALARS
        return (*SCALARS, *RESULTS_OF_OPENINGS)

    def _steps(self, p: Array) -> tuple[Array, Array]:
        """Return results and derivatives at the measured steps; differences stay in the bounds."""
        results = self._results_of_steps(p)
        columns = list[Array]()
        for j, parameter in enumerate(self.plan.parameters):
            scale = p[j]
            if not parameter.log:
                scale = max(abs(p[j]), MIN_SCALE * (parameter.high - parameter.low))
            step = RELATIVE_STEP * scale
            q = p.copy()
            q[j] += step if p[j] + step <= parameter.high else -step
            columns.append((self._results_of_steps(q) - results) / (q[j] - p[j]))
        return results, np.stack(columns, axis=2)

    def _results_of_steps(self, p: Array) -> Array:
        """Return the results at the measured steps; the steps after them are not followed."""
        measured = self.plan.at_steps
        assert self.plan.history is not None
        c = self.level.line.c
        results = list[Array]()
        try:
            steps = follow_steps(
                self.plan.history,
                self.level,
                self.scenery,
                self.plan.scene,
                self.tolerance,
                self.values(p),
            )
            for n, (step, mean) in enumerate(islice(steps, max(measured) + 1)):
                self.solves += 1
                if not step.solved:
                    raise FitError(
                        f"step {n} cannot be compared with the numbers tried: {step.reason}"
                    )
                xi, S_N = self.level.split(step.xi)
                u_T, s_N = self.level.split(step.v)
                scalars = [c @ xi, np.max(np.abs(u_T)), mean, *self._of_openings(s_N, S_N)]
                results.append(np.array([*scalars, *u_T]))
        except StudyError as error:
            raise FitError(error.problems[0].what) from error
        except (NotPositiveDefinite, UnfitLaw) as error:
            raise FitError(str(error)) from error
        return np.array([results[n] for n in measured])

    def _points(self, scene: Scene, numbers: list[Sensitivity]) -> Iterator[tuple[Array, Array]]:
        """Yield results and derivatives at the data, each solution continued from that before."""
        v: Array | None = None
        previous_loads: tuple[float, ...] | None = None
        for i in range(len(self.plan.measured[0].values)):
            loads = tuple(column.values[i] for column in self.plan.loads)
            if v is None or loads != previous_loads:  # the data of a profile have one load
                for column, value in zip(self.plan.loads, loads, strict=True):
                    scene = path_scene(scene, column.path, value)
                problem = self.level.condensed(scene).problem
                branch: Branch = "from-zero" if v is None else "continued"
                answer = solve_contact(
                    problem, tolerance=self.tolerance, branch=branch, neighbour=v
                )
                self.solves += 1
                if answer.status != Status.CONVERGED:
                    raise FitError(
                        f"datum {i + 1} has no solution with the numbers tried: {answer.reason}"
                    )
                v = answer.v
                previous_loads = loads
                results = self._results(scene, problem, v)
                rates = self._rates(scene, problem, v, numbers)
            yield results, rates

    def _results(self, scene: Scene, problem: ContactProblem, v: Array) -> Array:
        mean = self.level.temperature(scene).mean if scene.material.beta != 0.0 else 0.0
        xi, force = self.level.split(problem.xi(v))
        u_T, s_N = self.level.split(v)
        S_N = force
        if self.level.opening is not None:
            S_N = force / self.level.opening.c
        scalars = [xi.sum(), np.max(np.abs(u_T)), mean, *self._of_openings(s_N, S_N)]
        return np.array([*scalars, *u_T])

    def _of_openings(self, s_N: Array, S_N: Array) -> list[float]:
        """Return RESULTS_OF_OPENINGS of openings [m] and their tractions [Pa], if there are any."""
        opening = self.level.opening
        if opening is None:
            return []
        return [float(s_N.max()), max(0.0, float(S_N.max())), float(S_N @ opening.c)]

    def _rates(
        self, scene: Scene, problem: ContactProblem, v: Array, numbers: list[Sensitivity]
    ) -> Array:
        """Return (s + m, K) derivatives of the results at one solution."""
        level = self.level
        linearised = Linearised.at(problem, v)
        body = WholeBody(level, scene, v)
        u_T, _ = level.split(v)
        largest = int(np.abs(u_T).argmax())
        rates = list[list[float]]()
        for number in numbers:
            change = change_of(level, scene, number)
            dv, dxi, dmean = rates_of(body, number, linearised, change)
            du_T, _ = level.split(dv)
            dR = level.split(dxi)[0].sum()
            scalars = [dR, np.sign(u_T[largest]) * du_T[largest], dmean]
            slopes = opening_slopes(level, linearised, dv, dxi)
            rates.append([*scalars, *slopes.values(), *du_T])
        return np.array(rates).T

    def _vertical(self, results: Array, rates: Array) -> Comparison:
        """Return the comparison of the results at every datum with the data."""
        predicted_columns = list[Array]()
        slope_columns = list[Array]()
        for column in self.plan.measured:
            if column.name == "u_T":
                first = len(self.scalars)
                u_T = results[:, first:]
                predicted_columns.append(np.einsum("im,im->i", self._weights, u_T))
                slope_columns.append(np.einsum("im,imk->ik", self._weights, rates[:, first:]))
            else:
                position = self.scalars.index(column.name)
                predicted_columns.append(results[:, position])
                slope_columns.append(rates[:, position])
        predicted = np.concatenate(predicted_columns)
        slopes = np.concatenate(slope_columns)
        data = np.concatenate([column.values for column in self.plan.measured])
        sigma = self.noise[: data.size]
        return Comparison((predicted - data) / sigma, slopes / sigma[:, None], predicted)

    @cached_property
    def _weights(self) -> Array:
        """(n, m) weights of the nodes at the x of every datum; u_T is linear between two nodes."""
        assert self.plan.place is not None
        x = np.array(self.plan.place.values)
        nodes = self.level.line.xy[:, 0]
        order = np.argsort(nodes)
        sorted_nodes = nodes[order]
        spacing = np.diff(sorted_nodes)
        if len(sorted_nodes) < 2 or not np.all(spacing > 0.0):
            raise FitError(
                "a profile of u_T over x needs a contact line of which no two nodes have the same x"
            )
        low, high = sorted_nodes[0] - spacing[0], sorted_nodes[-1] + spacing[-1]
        if np.any((x < low) | (x > high)):
            farthest = x[np.argmax(np.abs(x - sorted_nodes.mean()))]
            raise FitError(f"x = {farthest:g} of the profile is not on the contact line")
        hats = np.eye(len(sorted_nodes))
        weights = np.empty((len(x), len(sorted_nodes)))
        weights[:, order] = np.transpose([np.interp(x, sorted_nodes, hat) for hat in hats])
        return weights

    # -- along the path

    def _orthogonal(self, scene: Scene, numbers: list[Sensitivity]) -> Comparison:
        """Return the distances of the data from their feet, in units of the noise of both columns.

        Raises FitError where a curve is not found beside its path.
        """
        given = self.plan.given[0]
        measured = self.plan.measured[0]
        law = scene.one_law
        path = self.follow(scene)
        sigma = np.array([self.given_noise, self.noise[0]])
        data = np.stack([given.values, measured.values], axis=1)
        foot = feet(data / sigma, path.curve / sigma)
        places = list(zip(foot.side.tolist(), foot.share.tolist(), strict=True))
        curve = SmoothPath(path, law)
        moving = MovingPath(self.level, scene, given.path, curve, numbers)
        try:
            if law.piecewise_linear:
                rates = moving.rates_on_sides(places)
            else:
                points = [
                    curve.least(side, share, _pull(datum, sigma))
                    for (side, share), datum in zip(places, data, strict=True)
                ]
                rates = np.stack([moving.rates(point) for point in points])
                foot = _on_curve(foot, points, data / sigma, sigma)
        except ValueError as error:
            raise FitError(str(error)) from error
        feet_in_si = foot.point * sigma
        return Comparison(
            residual=foot.distance,
            jacobian=-np.einsum("nd,ndk->nk", foot.normal / sigma, rates),
            predicted=feet_in_si[:, 1],
            foot=feet_in_si,
            early="" if path.end in WHOLE else path.end.reason,
            path=path,
        )

    def follow(self, scene: Scene) -> Path:
        """Follow the path from no load on, as far beyond the data again as they reach.

        Raises FitError.
        """
        column = self.plan.given[0]
        low = min(0.0, *column.values)
        high = max(0.0, *column.values)
        within = (low - (high - low), high + (high - low))
        follower = Follower(*within, tolerance=self.tolerance)
        direction: Direction = "forward"
        if not max(column.values) > -min(column.values):
            direction = "backward"
        self.solves += 1
        try:
            load = affine_load(
                self.level, lambda t: path_scene(scene, column.path, t), low, high, column.name
            )
            problem = straightened(self.level, scene, load.problem, self.law_error, within)
            path, _ = follow_branch(problem, follower, "from-zero", 0.0, direction, column.name)
        except PathError as error:
            raise FitError(str(error)) from error
        return path


@dataclass(frozen=True, eq=False)
class MovingPath:
    """The curve of a scene along a parameter, and the numbers by which it is differentiated.

    along: key path of the parameter
    """

    level: Level
    scene: Scene
    along: tuple[str, ...]
    curve: SmoothPath
    numbers: Sequence[Sensitivity]

    @cached_property
    def laws(self) -> list[LawSlopes | None]:
        """Derivatives of the law by each number, None for a number that the law does not have."""
        law = self.scene.one_law
        slopes = list[LawSlopes | None]()
        for number in self.numbers:
            is_of_law = number.path[0] == "friction"
            slopes.append(law_slopes(law, number_of(number.path)) if is_of_law else None)
        return slopes

    def rates_on_sides(self, places: Sequence[tuple[int, float]]) -> Array:
        """Return (n, 2, k) derivatives of (t, R) by the numbers at shares of sides.

        The path is the curve itself. They are linear along a side, and at its ends those of the
        corner.
        """
        ends_of_side = dict[int, tuple[Array, Array]]()
        corner_rates = dict[int, Array]()
        rates = list[Array]()
        for side, share in places:
            if share in (0.0, 1.0):
                corner = side + int(share)
                if corner not in corner_rates:
                    corner_rates[corner] = self.rates(self.curve.vertex(corner, side))
                rates.append(corner_rates[corner])
                continue
            if side not in ends_of_side:
                ends_of_side[side] = (
                    self._rates_beside(side, side),
                    self._rates_beside(side, side + 1),
                )
            begin, end = ends_of_side[side]
            rates.append(begin + share * (end - begin))
        return np.array(rates)

    def _rates_beside(self, side: int, corner: int) -> Array:
        """Return the rates at an end of a side, as they are on the side."""
        path = self.curve.path
        t = float(path.t[corner])
        return self.rates(self.curve.beside(side, path.u[corner], t))

    def rates(self, point: CurvePoint) -> Array:
        """Return (2, k) ∂(t, R)/∂p of a point of the curve.

        Its coordinate is held, or the kink that is passed there.
        """
        problem = self.curve.path.problem
        v = point.v
        piece = point.codes // 2
        sticks = point.codes % 2 == 1
        scene = path_scene(self.scene, self.along, point.t)
        body = WholeBody(self.level, scene, v)
        loads, b, dv = np.zeros((3, problem.m, len(self.numbers)))
        held = np.zeros((1, len(self.numbers)))
        for j, (number, slopes) in enumerate(zip(self.numbers, self.laws, strict=True)):
            loads[:, j] = body.right_side(change_of(self.level, scene, number))
            if slopes is not None:
                kinks = np.append(slopes.kinks, 0.0)
                b[:, j] = slopes.value(v, piece)
                dv[:, j] = sticks * kinks[piece]
                held[0, j] = kinks[point.kink]
        free, lu, pivots, unit = point.factor
        right = (loads - problem.c[:, None] * b - problem.A_tilde @ dv)[free]
        right = np.concatenate([right, unit * held])
        solution = scipy.linalg.lapack.dgetrs(lu, pivots, right)[0]
        dv[free], dt = np.split(solution, [-1])
        dR = (loads - problem.A_tilde @ dv).sum(axis=0) + dt[0] * problem.l_1.sum()
        return np.concatenate([dt, [dR]])


def _pull(datum: Array, sigma: Array) -> Goal:
    """Return the gradient of half the squared distance from a datum, in units of sigma."""
    return lambda x: (x - datum) / sigma**2


def _on_curve(foot: Feet, points: Sequence[CurvePoint], data: Array, sigma: Array) -> Feet:
    """Return the feet of data on the curve, with the normals of those on the polygon beside it."""
    position = np.array([point.x for point in points]) / sigma
    tangent = np.array([point.first for point in points]) / sigma
    across = data - position
    normal_of_tangent = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    is_on_curve = np.linalg.norm(across, axis=1) <= ON_CURVE * np.linalg.norm(data, axis=1)
    normal = np.where(is_on_curve[:, None], normal_of_tangent, across)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)[:, None]
    is_same_side = np.sum(normal * foot.normal, axis=1) >= 0.0
    normal *= np.where(is_same_side, 1.0, -1.0)[:, None]
    distance = np.sum(across * normal, axis=1)
    return replace(foot, point=position, normal=normal, distance=distance)
