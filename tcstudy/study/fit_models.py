"""What a study says of measurements, for given numbers of it, with derivatives by these numbers.

Of a history (`history_run`) the steps are compared that were measured: one history an evaluation, and one for every
number, which is a little off, for differences. All other derivatives are exact.

Vertical: the scene is solved at every datum, each from the solution before (the way a test goes: one solve a datum),
and its results are compared; derivatives from the factor at each solution (`contact.solution.Linearised`).

Orthogonal: the path of the scene along the measured parameter t is followed once, and every datum is projected on the
curve (t, R), R = Σξ, in units of the noise of both. By the envelope theorem ∂d/∂p = −nᵀ∂(t, R)/∂p, whatever coordinate
along the curve is held fixed. On a side of the polygon (t, R) the nodes keep their pieces, and held fixed is eᵀv with e
along the side: the bordered matrix [H −l̃₁; eᵀ 0] is regular at a simple fold, where H is not. At a corner the slip of
the node that passes its kink there is held on that kink. The same beside the path of a law with exponential pieces, on
the curve itself (`contact.path.smooth`). Literature: Keller, in Rabinowitz (ed.), Applications of Bifurcation Theory
(1977) 359–384 (bordering).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.fitted import Feet, feet
from tcstudy.condense import NotPositiveDefinite
from tcstudy.contact.path.follow import Follower, Path
from tcstudy.contact.path.problem import WHOLE
from tcstudy.contact.path.smooth import CurvePoint, Goal, SmoothPath, bordered
from tcstudy.contact.problem import Status
from tcstudy.contact.solution import Linearised
from tcstudy.contact.solve import solve_contact
from tcstudy.errors import FitError, PathError, StudyError
from tcstudy.laws.composed import LawSlopes, law_slopes, number_of
from tcstudy.offline.level import Level
from tcstudy.offline.slopes import WholeBody, change_of
from tcstudy.read.scenes import SceneReader
from tcstudy.scene.histories import Keys, UnfitLaw
from tcstudy.scene.parameters import path_scene
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Direction, FitPlan, Sensitivity
from tcstudy.study.history_run import STIFFNESS, with_stiffness
from tcstudy.study.history_run import followed as followed_steps
from tcstudy.study.path_run import affine_load, followed, straightened
from tcstudy.study.point import rates_of

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
        values, number = self.values(p), [one.number.path for one in self.plan.parameters]
        columns = [
            self.scenery.rates(self.plan.scene, path[1], values) if path[0] == "parameters" else {path: 1.0}
            for path in number
        ]
        paths = list(dict.fromkeys(path for column in columns for path in column))
        matrix = np.array([[column.get(path, 0.0) for column in columns] for path in paths])
        return [Sensitivity(".".join(path), path, "") for path in paths], matrix

    def compared(self, p: Array) -> Compared:
        """The study with the numbers p against the data. Raises FitError where it has no solution."""
        scene = self.scene(p)
        if self.plan.history is not None:
            return self._vertical(*self._steps(p))
        numbers, chain = self.chain(p)
        if self.plan.compare == "vertical":
            found = self._vertical(*map(np.array, zip(*self._points(scene, numbers), strict=True)))
        else:
            found = self._orthogonal(scene, numbers)
        found = replace(found, jacobian=found.jacobian @ chain)
        if not np.all(np.isfinite(found.jacobian)):
            raise FitError("the results have no derivative at a datum: it lies on a fold; use compare: orthogonal")
        return found

    # -- at all n data: (n, 3 + m) the SCALARS and u_T, and (n, 3 + m, k) their derivatives -------------------

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
        wanted, found, scene, history = set(self.plan.at_steps), dict[int, Array](), self.scene(p), self.plan.history
        assert history is not None
        paths = [one.number.path for one in self.plan.parameters]
        plan = with_stiffness(history, dict(zip(paths, p.tolist(), strict=True)))
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
        return np.array([found[n] for n in self.plan.at_steps])

    def _points(self, scene: Scene, numbers: list[Sensitivity]) -> Iterator[tuple[Array, Array]]:
        """Of solutions, each continued from that before; the data of a profile have one load."""
        v, known, result = None, None, None
        for i in range(len(self.plan.measured[0].values)):
            loads = tuple(column.values[i] for column in self.plan.loads)
            if result is None or loads != known:
                for column, value in zip(self.plan.loads, loads, strict=True):
                    scene = path_scene(scene, column.path, value)
                problem, branch = self.level.condensed(scene).problem, "from-zero" if v is None else "continued"
                answer = solve_contact(problem, tolerance=self.tolerance, branch=branch, neighbour=v)  # type: ignore[arg-type]
                self.solves += 1
                if answer.status != Status.CONVERGED:
                    raise FitError(f"datum {i + 1} has no solution with the numbers tried: {answer.reason}")
                v, known = answer.v, loads
                here, whole, largest = (
                    Linearised.at(problem, v),
                    WholeBody(self.level, scene, v),
                    int(np.abs(v).argmax()),
                )
                moved = (rates_of(whole, one, here, change_of(self.level, scene, one)) for one in numbers)
                rates = [[dxi.sum(), np.sign(v[largest]) * dv[largest], mean, *dv] for dv, dxi, mean in moved]
                mean = self.level.temperature(scene).mean if scene.material.beta != 0.0 else 0.0
                result = np.array([problem.xi(v).sum(), np.max(np.abs(v)), mean, *v]), np.array(rates).T
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
            raise FitError("a profile of u_T over x needs a contact line of which no two nodes have the same x")
        if np.any((x < along[0] - cell[0]) | (x > along[-1] + cell[-1])):
            raise FitError(f"x = {x[np.argmax(np.abs(x - along.mean()))]:g} of the profile is not on the contact line")
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
        foot, moving = feet(data / sigma, path.curve / sigma), MovingPath(self.level, scene, given.path, path, numbers)
        sides = [(int(side), float(share)) for side, share in zip(foot.side, foot.share, strict=True)]
        if law.piecewise_linear:
            moved = moving.on_sides(sides)
        else:
            try:
                curve = SmoothPath(path, law)
                points = [curve.least(*side, _pull(datum, sigma)) for side, datum in zip(sides, data, strict=True)]
            except ValueError as error:
                raise FitError(str(error)) from error
            moved = np.stack([moving.rates(p.codes, p.v, p.t, (p.row, p.time, p.kink)) for p in points])
            foot = _on_curve(foot, points, data / sigma, sigma)
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
            load = affine_load(self.level, lambda t: path_scene(scene, column.path, t), low, high, column.name)
            problem = straightened(self.level, scene, load.problem, self.law_error, (low - reach, high + reach))
            way: Direction = "forward" if max(values) > -min(values) else "backward"
            return followed(problem, follower, "from-zero", 0.0, way, column.name)[0]
        except PathError as error:
            raise FitError(str(error)) from error


Held = tuple[Array, float, int]
"""(row, time, kink): the coordinate row·v + time·t is held, at a corner on the kink, −1 elsewhere."""


@dataclass(frozen=True, eq=False)
class MovingPath:
    """A path of a scene along a parameter (key path `along`), and the numbers by which it is differentiated."""

    level: Level
    scene: Scene
    along: tuple[str, ...]
    path: Path
    numbers: Sequence[Sensitivity]

    @cached_property
    def laws(self) -> list[LawSlopes | None]:
        """Derivatives of the law by each number, None where that is no number of it."""
        law = self.scene.one_law
        return [law_slopes(law, number_of(one.path)) if one.path[0] == "friction" else None for one in self.numbers]

    def on_sides(self, places: Sequence[tuple[int, float]]) -> Array:
        """(n, 2, k) derivatives of (t, R) by the numbers at shares of sides of the path, linear along a side."""
        path, found, known = self.path, [], dict[tuple[int, int, int], tuple[Array, Array]]()
        for place in places:
            side, share, node, held = self._held(*place)
            if (key := (side, node, held[-1])) not in known:
                codes, ends = path.codes[side].astype(np.intp), (side, side + 1)
                first, last = (self.rates(codes, path.u[k], float(path.t[k]), held) for k in ends)
                known[key] = first, last - first
            constant, along = known[key]
            found.append(constant + share * along)
        return np.array(found)

    def _held(self, side: int, share: float) -> tuple[int, float, int, Held]:
        """(side, share, node, what is held): at a corner of a side on which the node that passes its kink there slides.

        node: −1 where none does; at the ends of the path t is held
        """
        path, m = self.path, self.path.problem.m
        vertex = side + int(share == 1.0)
        if share in (0.0, 1.0) and vertex in (0, path.pieces):
            return side, share, -1, (np.zeros(m), 1.0, -1)
        changed = path.codes[vertex - 1] != path.codes[vertex] if share in (0.0, 1.0) else np.zeros(m, dtype=bool)
        for node in np.flatnonzero(changed).tolist():
            for own in (vertex - 1, vertex):
                if path.slipping[own, node]:
                    kink = int(path.problem.law.nearest_kink(np.full(m, path.u[vertex, node]))[node])
                    return own, float(vertex - own), node, (np.eye(m)[node], 0.0, kink)
        return side, share, -1, (*path.along(side), -1)

    def rates(self, codes: NDArray[np.intp], v: Array, t: float, held: Held) -> Array:
        """(2, k) ∂(t, R)/∂p at v and t, all nodes on the pieces of `codes`, row·v + time·t held, or its kink's."""
        problem, law, (row, time, kink) = self.path.problem, self.scene.one_law, held
        m, piece, at = problem.m, codes // 2, path_scene(self.scene, self.along, t)
        free, J, scale = bordered(problem, law, codes, v, (row, time))
        right = np.zeros((len(free) + 1, len(self.numbers)))
        kinks, loads = (np.zeros((m, len(self.numbers))) for _ in range(2))
        whole = WholeBody(self.level, at, v)
        for j, number in enumerate(self.numbers):
            load = whole.right_side(change_of(self.level, at, number))
            b, moving = np.zeros(m), np.zeros(m)
            if (change := self.laws[j]) is not None:
                b = change.value(v, piece)
                moving[piece < len(change.kinks)] = change.kinks[piece[piece < len(change.kinks)]]
                right[-1, j] = scale * change.kinks[kink] if kink >= 0 else 0.0
            moving[free] = 0.0
            kinks[:, j], loads[:, j] = moving, load
            right[:-1, j] = (load - problem.c * b - problem.A_tilde @ moving)[free]
        step = np.linalg.solve(J, right)
        dv = kinks
        dv[free] = step[:-1]
        dR = (loads - problem.A_tilde @ dv).sum(axis=0) + step[-1] * problem.l_1.sum()
        return np.stack([step[-1], dR])


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
