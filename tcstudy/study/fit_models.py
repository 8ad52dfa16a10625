"""What a study says of measurements, for given numbers of it, with derivatives by these numbers.

Of a history (`history_run`) the steps are compared that were measured: one history an evaluation,
and one for every number, which is a little off, for differences. All other derivatives are exact.

Vertical: the scene is solved at every datum, each from the solution before (the way a test goes:
one solve a datum), and its results are compared; derivatives from the factor at each solution
(`contact.solution.Linearised`).

Orthogonal: the path of the scene along the measured parameter t is followed once, and every datum
is projected on the curve (t, R), R = Σξ, in units of the noise of both. By the envelope theorem
∂d/∂p = −nᵀ∂(t, R)/∂p, whatever coordinate along the curve is held fixed. On a side of the polygon
(t, R) the nodes keep their pieces, and held fixed is eᵀv with e along the side: the bordered matrix
[H −l̃₁; eᵀ 0] is regular at a simple fold, where H is not. At a corner the slip of the node that
passes its kink there is held on that kink. The same beside the path of a law with exponential
pieces, on the curve itself (`contact.path.smooth`). Literature: Keller, in Rabinowitz (ed.),
Applications of Bifurcation Theory (1977) 359–384 (bordering).
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
from tcstudy.contact.problem import Status
from tcstudy.contact.solution import Linearised
from tcstudy.contact.solve import solve_contact
from tcstudy.errors import FitError, PathError, StudyError
from tcstudy.laws.composed import LawSlopes, law_slopes, number_of
from tcstudy.offline.level import Level
from tcstudy.offline.slopes import WholeBody, change_of
from tcstudy.read.scenes import SceneReader
from tcstudy.scene.fit_plan import FitPlan, Sensitivity
from tcstudy.scene.histories import Keys, UnfitLaw
from tcstudy.scene.parameters import path_scene
from tcstudy.scene.path_plan import Direction
from tcstudy.scene.records import Scene
from tcstudy.scene.solver_plan import Branch
from tcstudy.study.history_run import followed as followed_steps
from tcstudy.study.path_run import affine_load, followed, straightened
from tcstudy.study.sensitivities import rates_of

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
    scenery: SceneReader
    level: Level
    noise: Array
    given_noise: float
    tolerance: float | None = None
    solves: int = 0
    law_error: float = 1e-3

    def values(self, p: Array) -> dict[Keys, float]:
        """The numbers by key path."""
        return dict(zip((one.number.path for one in self.plan.parameters), p.tolist(), strict=True))

    def scene(self, p: Array) -> Scene:
        """The scene with these numbers. Raises FitError."""
        try:
            return self.scenery.at(self.plan.scene, self.values(p))
        except StudyError as error:
            raise FitError(error.problems[0].what) from error

    def chain(self, p: Array) -> tuple[list[Sensitivity], Array]:
        """The K numbers by which results have derivatives, and (K, k) theirs by those to find:
        itself, or all that are made of a name of the study's own."""
        values, number = self.values(p), [one.number.path for one in self.plan.parameters]
        columns = [
            self.scenery.rates(self.plan.scene, path[1], values)
            if path[0] == "parameters"
            else {path: 1.0}
            for path in number
        ]
        paths = list(dict.fromkeys(path for column in columns for path in column))
        matrix = np.array([[column.get(path, 0.0) for column in columns] for path in paths])
        return [Sensitivity(".".join(path), path, "") for path in paths], matrix

    def compared(self, p: Array) -> Compared:
        """The study with the numbers p against the data. Raises FitError where it has no
        solution."""
        if self.plan.history is not None:
            return self._vertical(*self._steps(p))
        scene, (numbers, chain) = self.scene(p), self.chain(p)
        if self.plan.compare == "vertical":
            found = self._vertical(*map(np.array, zip(*self._points(scene, numbers), strict=True)))
        else:
            found = self._orthogonal(scene, numbers)
        found = replace(found, jacobian=found.jacobian @ chain)
        if not np.all(np.isfinite(found.jacobian)):
            raise FitError(
                "the results have no derivative at a datum: it lies on a fold; use compare: orthogonal"
            )
        return found

    # -- at all n data: (n, 3 + m) the SCALARS and u_T, and (n, 3 + m, k) their derivatives
    # -------------------

    def _steps(self, p: Array) -> tuple[Array, Array]:
        """Of the measured steps of the history; derivatives are differences inside the bounds."""
        middle, columns = self._followed(p), list[Array]()
        for j, one in enumerate(self.plan.parameters):
            h = DIFFERENCE * (p[j] if one.log else max(abs(p[j]), 1e-3 * (one.high - one.low)))
            q = p.copy()
            q[j] += h if p[j] + h <= one.high else -h
            columns.append((self._followed(q) - middle) / (q[j] - p[j]))
        return middle, np.stack(columns, axis=2)

    def _followed(self, p: Array) -> Array:
        """What is compared at the measured steps of the history; the rest of it is not followed."""
        wanted, found, c = self.plan.at_steps, dict[int, Array](), self.level.line.c
        assert self.plan.history is not None
        try:
            own = self.level, self.scenery, self.plan.scene, self.tolerance
            steps = followed_steps(self.plan.history, *own, self.values(p))
            for n, (step, mean) in enumerate(islice(steps, max(wanted) + 1)):
                self.solves += 1
                if not step.solved:
                    raise FitError(
                        f"step {n} cannot be compared with the numbers tried: {step.reason}"
                    )
                found[n] = np.array([c @ step.xi, np.max(np.abs(step.v)), mean, *step.v])
        except StudyError as error:
            raise FitError(error.problems[0].what) from error
        except (NotPositiveDefinite, UnfitLaw) as error:
            raise FitError(str(error)) from error
        return np.array([found[n] for n in wanted])

    def _points(self, scene: Scene, numbers: list[Sensitivity]) -> Iterator[tuple[Array, Array]]:
        """Of solutions, each continued from that before; the data of a profile have one load."""
        v, known, result = None, None, None
        for i in range(len(self.plan.measured[0].values)):
            loads = tuple(column.values[i] for column in self.plan.loads)
            if result is None or loads != known:
                for column, value in zip(self.plan.loads, loads, strict=True):
                    scene = path_scene(scene, column.path, value)
                problem = self.level.condensed(scene).problem
                branch: Branch = "from-zero" if v is None else "continued"
                answer = solve_contact(
                    problem,
                    tolerance=self.tolerance,
                    branch=branch,
                    neighbour=v,
                )
                self.solves += 1
                if answer.status != Status.CONVERGED:
                    raise FitError(
                        f"datum {i + 1} has no solution with the numbers tried: {answer.reason}"
                    )
                v, known = answer.v, loads
                here, whole, largest = (
                    Linearised.at(problem, v),
                    WholeBody(self.level, scene, v),
                    int(np.abs(v).argmax()),
                )
                moved = (
                    rates_of(whole, one, here, change_of(self.level, scene, one)) for one in numbers
                )
                rates = [
                    [dxi.sum(), np.sign(v[largest]) * dv[largest], mean, *dv]
                    for dv, dxi, mean in moved
                ]
                mean = self.level.temperature(scene).mean if scene.material.beta != 0.0 else 0.0
                result = (
                    np.array([problem.xi(v).sum(), np.max(np.abs(v)), mean, *v]),
                    np.array(rates).T,
                )
            yield result

    def _vertical(self, values: Array, rates: Array) -> Compared:
        """The results at every datum against the data."""
        found = []
        for column in self.plan.measured:
            if column.name == "u_T":
                along = np.einsum("im,im->i", self._weights, values[:, 3:])
                found.append((along, np.einsum("im,imk->ik", self._weights, rates[:, 3:])))
            else:
                at = SCALARS.index(column.name)
                found.append((values[:, at], rates[:, at]))
        predicted, slopes = (np.concatenate(part) for part in zip(*found, strict=True))
        data = np.concatenate([column.values for column in self.plan.measured])
        sigma = self.noise[: data.size]
        return Compared((predicted - data) / sigma, slopes / sigma[:, None], predicted)

    @cached_property
    def _weights(self) -> Array:
        """(n, m) u_T at the x of every datum is linear between the contact nodes beside it."""
        place, nodes = self.plan.place, self.level.line.xy[:, 0]
        assert place is not None
        order, x = np.argsort(nodes), np.array(place.values)
        along = nodes[order]
        cell = np.diff(along)
        if len(along) < 2 or not np.all(cell > 0.0):
            raise FitError(
                "a profile of u_T over x needs a contact line of which no two nodes have the same x"
            )
        if np.any((x < along[0] - cell[0]) | (x > along[-1] + cell[-1])):
            raise FitError(
                f"x = {x[np.argmax(np.abs(x - along.mean()))]:g} of the profile is not on the contact line"
            )
        weights = np.empty((len(x), len(along)))
        weights[:, order] = np.transpose([np.interp(x, along, node) for node in np.eye(len(along))])
        return weights

    # -- along the path ----------------------------------------------------------------------------

    def _orthogonal(self, scene: Scene, numbers: list[Sensitivity]) -> Compared:
        """Distances from the feet of the data, in units of the noise of both columns.

        Raises FitError where a curve is not found beside its path.
        """
        given, measured, law = self.plan.given[0], self.plan.measured[0], scene.one_law
        path = self.follow(scene)
        sigma = np.array([self.given_noise, self.noise[0]])
        data = np.stack([given.values, measured.values], axis=1)
        foot, curve = feet(data / sigma, path.curve / sigma), SmoothPath(path, law)
        sides = [*zip(foot.side.tolist(), foot.share.tolist(), strict=True)]
        moving = MovingPath(self.level, scene, given.path, curve, numbers)
        try:
            if law.piecewise_linear:
                moved = moving.on_sides(sides)
            else:
                points = [
                    curve.least(*side, _pull(datum, sigma))
                    for side, datum in zip(sides, data, strict=True)
                ]
                moved = np.stack([moving.rates(point) for point in points])
                foot = _on_curve(foot, points, data / sigma, sigma)
        except ValueError as error:
            raise FitError(str(error)) from error
        found, jacobian = foot.point * sigma, -np.einsum("nd,ndk->nk", foot.normal / sigma, moved)
        early = "" if path.end in WHOLE else path.end.reason
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
            load = affine_load(
                self.level, lambda t: path_scene(scene, column.path, t), low, high, column.name
            )
            problem = straightened(
                self.level, scene, load.problem, self.law_error, (low - reach, high + reach)
            )
            way: Direction = "forward" if max(values) > -min(values) else "backward"
            return followed(problem, follower, "from-zero", 0.0, way, column.name)[0]
        except PathError as error:
            raise FitError(str(error)) from error


@dataclass(frozen=True, eq=False)
class MovingPath:
    """The curve of a scene along a parameter (key path `along`), and the numbers by which it is
    differentiated."""

    level: Level
    scene: Scene
    along: tuple[str, ...]
    curve: SmoothPath
    numbers: Sequence[Sensitivity]

    @cached_property
    def laws(self) -> list[LawSlopes | None]:
        """Derivatives of the law by each number, None where that is no number of it."""
        law = self.scene.one_law
        return [
            law_slopes(law, number_of(one.path)) if one.path[0] == "friction" else None
            for one in self.numbers
        ]

    def on_sides(self, places: Sequence[tuple[int, float]]) -> Array:
        """(n, 2, k) derivatives of (t, R) by the numbers at shares of sides of a path that is the
        curve itself.

        Linear along a side; at its ends they are those of the corner.
        """
        curve, (t, u), known, found = (
            self.curve,
            (self.curve.path.t, self.curve.path.u),
            dict[float, list[Array]](),
            [],
        )
        for side, share in places:
            corner = share in (0.0, 1.0)
            if (place := side + (share if corner else 0.5)) not in known:
                ends = [
                    curve.beside(side, u[k], float(t[k])) for k in (side, side + 1) if not corner
                ]
                known[place] = [
                    self.rates(point) for point in ends or [curve.vertex(int(place), side)]
                ]
            first, last = known[place][0], known[place][-1]
            found.append(first + share * (last - first))
        return np.array(found)

    def rates(self, point: CurvePoint) -> Array:
        """(2, k) ∂(t, R)/∂p of a point whose coordinate is held, or the kink that is passed
        there."""
        problem, v, piece, rests = (
            self.curve.path.problem,
            point.v,
            point.codes // 2,
            point.codes % 2 == 1,
        )
        at, (free, lu, pivots, unit) = path_scene(self.scene, self.along, point.t), point.factor
        whole, loads, b, dv = (
            WholeBody(self.level, at, v),
            *(np.zeros((3, problem.m, len(self.numbers)))),
        )
        held = np.zeros((1, len(self.numbers)))
        for j, (number, change) in enumerate(zip(self.numbers, self.laws, strict=True)):
            loads[:, j] = whole.right_side(change_of(self.level, at, number))
            if change is not None:
                kinks = np.append(change.kinks, 0.0)
                b[:, j], dv[:, j], held[0, j] = (
                    change.value(v, piece),
                    rests * kinks[piece],
                    kinks[point.kink],
                )
        right = (loads - problem.c[:, None] * b - problem.A_tilde @ dv)[free]
        dv[free], dt = np.split(
            scipy.linalg.lapack.dgetrs(lu, pivots, np.concatenate([right, unit * held]))[0], [-1]
        )
        return np.concatenate(
            [dt, [(loads - problem.A_tilde @ dv).sum(axis=0) + dt[0] * problem.l_1.sum()]]
        )


def _pull(datum: Array, sigma: Array) -> Goal:
    """Gradient of half the squared distance from a datum, in units of sigma."""
    return lambda x: (x - datum) / sigma**2


def _on_curve(foot: Feet, points: Sequence[CurvePoint], data: Array, sigma: Array) -> Feet:
    """The feet of data on the curve beside those on the polygon, positive on the same side."""
    at = np.array([point.x for point in points]) / sigma
    along = np.array([point.first for point in points]) / sigma
    across, left = data - at, np.stack([-along[:, 1], along[:, 0]], axis=1)
    size = np.linalg.norm(across, axis=1)
    near = size <= 1e-9 * np.linalg.norm(data, axis=1)
    normal = np.where(near[:, None], left, across)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)[:, None]
    normal *= np.where(np.sum(normal * foot.normal, axis=1) >= 0.0, 1.0, -1.0)[:, None]
    return replace(foot, point=at, normal=normal, distance=np.sum(across * normal, axis=1))
