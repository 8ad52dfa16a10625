"""What a study says of measurements, for given numbers of it, with exact derivatives by these numbers.

Vertical: the scene is solved at every datum, each from the solution before (the way a test goes: one solve a datum),
and its results are compared; derivatives from the factor at each solution (`solvers.linearised`).

Orthogonal: the path of the scene along the measured parameter t is followed once, and every datum is projected on the
curve (t, R), R = Σξ, in units of the noise of both. By the envelope theorem ∂d/∂p = −nᵀ∂(t, R)/∂p, whatever coordinate
along the curve is held fixed. On a side of the polygon the nodes keep their pieces, and held fixed is eᵀv with e along
the side: the bordered matrix [H −l̃₁; eᵀ 0] is regular at a simple fold, where H is not. At a corner the slip of the
node that passes its kink there is held on that kink. Literature: Keller, in Rabinowitz (ed.), Applications of
Bifurcation Theory (1977) 359–384 (bordering).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.curve_distance import Feet, feet
from tcstudy.errors import FitError, PathError
from tcstudy.offline.level import Level
from tcstudy.offline.slopes import law_slope, load_slope
from tcstudy.offline.whole_slopes import WholeBody
from tcstudy.scene.fits import FitPlan
from tcstudy.scene.law_slopes import LawSlopes, PointSlopes, law_slopes, number_of
from tcstudy.scene.parameters import path_scene, with_number
from tcstudy.scene.records import Scene
from tcstudy.solvers.contact import solve_contact
from tcstudy.solvers.linearised import Linearised
from tcstudy.solvers.loop import Status
from tcstudy.solvers.path.follow import Follower, Path, PathStatus
from tcstudy.solvers.path.start import NoSolutionError
from tcstudy.study.path_affine import affine_load

Array = NDArray[np.float64]
WHOLE = (PathStatus.RANGE_END, PathStatus.UNBOUNDED, PathStatus.CLOSED_LOOP)
"""Ends of a path at which there is nothing more to follow."""
SCALARS = ("friction_resultant", "u_T_max", "theta_mean")
Laws = list[LawSlopes | PointSlopes | None]
"""Derivatives of the law by each number, None where that is no number of it."""


@dataclass(frozen=True, eq=False)
class Compared:
    """Results of the study at the data, in the order measured column by measured column.

    residual: (n,) in units of the noise;  jacobian: (n, k) ∂residual/∂p
    predicted: (n,) results;  foot: (n, 2) feet (t, R) of an orthogonal comparison
    curve: (c, 2) the path (t, R), folds: vertices of it at which t turns
    early: why the path ends before it has to; empty if it does not
    """

    residual: Array
    jacobian: Array
    predicted: Array
    foot: Array = field(default_factory=lambda: np.empty((0, 2)))
    curve: Array = field(default_factory=lambda: np.empty((0, 2)))
    folds: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    early: str = ""


@dataclass
class FitModel:
    """The study as a function of the numbers to find.

    noise:  (n,) of the measured columns one after the other; given_noise: of the parameter of a path
    solves: contact problems solved, or paths followed, so far
    """

    plan: FitPlan
    level: Level
    noise: Array
    given_noise: float
    tolerance: float | None = None
    solves: int = 0

    def scene(self, p: Array) -> Scene:
        """The scene with these numbers."""
        scene = self.plan.scene
        for parameter, value in zip(self.plan.parameters, p, strict=True):
            scene = with_number(scene, parameter.number, float(value))
        return scene

    def __call__(self, p: Array) -> tuple[Array, Array]:
        """Residuals and Jacobian, for the minimiser."""
        found = self.compared(p)
        return found.residual, found.jacobian

    def compared(self, p: Array) -> Compared:
        """The study with the numbers p against the data. Raises FitError where it has no solution."""
        scene = self.scene(p)
        found = self._vertical(scene) if self.plan.compare == "vertical" else self._orthogonal(scene)
        if not np.all(np.isfinite(found.jacobian)):
            raise FitError("the results have no derivative at a datum: it lies on a fold; use compare: orthogonal")
        return found

    def _vertical(self, scene: Scene) -> Compared:
        plan, v, known = self.plan, None, None
        count, k = len(plan.measured[0].values), len(plan.parameters)
        predicted, slopes = np.empty((len(plan.measured), count)), np.empty((len(plan.measured), count, k))
        for i in range(count):
            loads = tuple(column.values[i] for column in plan.loads)
            if loads != known:  # the data of a profile have one load
                for column, value in zip(plan.loads, loads, strict=True):
                    scene = path_scene(scene, column.path, value)
                v, known = self._solved(scene, v, i), loads
                values, rates = self._results(scene, v)
            for j, column in enumerate(plan.measured):
                if column.name == "u_T":
                    predicted[j, i], slopes[j, i] = self._weights[i] @ values[3:], self._weights[i] @ rates[3:]
                else:
                    at = SCALARS.index(column.name)
                    predicted[j, i], slopes[j, i] = values[at], rates[at]
        data = np.array([column.values for column in plan.measured])
        residual = (predicted - data).ravel() / self.noise
        return Compared(residual, slopes.reshape(-1, k) / self.noise[:, None], predicted.ravel())

    def _solved(self, scene: Scene, before: Array | None, i: int) -> Array:
        """The solution at a datum, continued from that before."""
        problem = self.level.condensed(scene).problem
        branch = "from-zero" if before is None else "continued"
        answer = solve_contact(problem, tolerance=self.tolerance, branch=branch, neighbour=before)  # type: ignore[arg-type]
        self.solves += 1
        if answer.status != Status.CONVERGED:
            raise FitError(f"datum {i + 1} has no solution with the numbers tried: {answer.reason}")
        return answer.v

    def _results(self, scene: Scene, v: Array) -> tuple[Array, Array]:
        """(3 + m,) the SCALARS of a solution and u_T, and (3 + m, k) their derivatives."""
        level, problem = self.level, self.level.condensed(scene).problem
        at, whole, rows = Linearised.at(problem, v), WholeBody(level, scene, v), []
        largest = int(np.argmax(np.abs(v)))
        for parameter in self.plan.parameters:
            slope = load_slope(level, scene, parameter.number, v, whole)
            b, kinks = law_slope(level, scene, parameter.number, at)
            dv = at.step(at.right_side(slope.right, b), kinks)
            dxi = slope.right - problem.A_tilde @ dv
            rows.append([dxi.sum(), np.sign(v[largest]) * dv[largest], slope.theta_mean, *dv])
        mean = level.temperature(scene).mean if scene.material.beta != 0.0 else 0.0
        return np.array([problem.xi(v).sum(), np.max(np.abs(v)), mean, *v]), np.array(rows).T

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

    def _orthogonal(self, scene: Scene) -> Compared:
        given, measured = self.plan.given[0], self.plan.measured[0]
        path = self.follow(scene)
        sigma = np.array([self.given_noise, self.noise[0]])
        curve = np.stack([path.t, path.traction @ path.problem.c], axis=1)
        data = np.stack([given.values, measured.values], axis=1)
        foot = feet(data / sigma, curve / sigma)
        jacobian = -np.einsum("nd,ndk->nk", foot.normal / sigma, self._moved(scene, path, foot))
        early = "" if path.end.status in WHOLE else path.end.reason
        found = foot.point * sigma
        return Compared(foot.distance, jacobian, found[:, 1], found, curve, path.folds, early)

    def follow(self, scene: Scene) -> Path:
        """The path from no load on, as far beyond the data again as they reach."""
        column = self.plan.given[0]
        low, high = min(0.0, *column.values), max(0.0, *column.values)
        reach = high - low
        try:
            load = affine_load(self.level, lambda t: path_scene(scene, column.path, t), low, high, column.name)
        except PathError as error:
            raise FitError(str(error)) from error
        start = solve_contact(load.problem.at(0.0), tolerance=self.tolerance, branch="from-zero")
        self.solves += 1
        if start.status != Status.CONVERGED:
            raise FitError(f"there is no solution without load to start from: {start.reason}")
        way = "forward" if max(column.values) > -min(column.values) else "backward"
        follower = Follower(low - reach, high + reach, tolerance=self.tolerance)
        try:
            path = follower.follow(load.problem, start.v, 0.0, way)  # type: ignore[arg-type]
        except NoSolutionError as error:
            raise FitError(str(error)) from error
        return path if way == "forward" else _reversed(path)

    def _moved(self, scene: Scene, path: Path, foot: Feet) -> Array:
        """(n, 2, k) derivatives of the feet (t, R) by the numbers."""
        places = [_Place.of(path, int(side), float(share)) for side, share in zip(foot.side, foot.share, strict=True)]
        laws = [
            law_slopes(scene.one_law, number_of(one.number.path)) if one.number.path[0] == "friction" else None
            for one in self.plan.parameters
        ]
        done = {place.key: self._at_place(scene, path, laws, place) for place in {p.key: p for p in places}.values()}
        found = np.empty((len(places), 2, len(self.plan.parameters)))
        for row, place in zip(found, places, strict=True):
            constant, along = done[place.key]
            row[:] = constant + place.share * along
        return found

    def _at_place(self, scene: Scene, path: Path, laws: Laws, place: _Place) -> tuple[Array, Array]:
        """(2, k) at the beginning of a side, and what is added at its end: linear in between, as v and t are."""
        first, last = (self._derivative(scene, path, laws, place, place.side + end) for end in (0, 1))
        return first, last - first

    def _derivative(self, scene: Scene, path: Path, laws: Laws, place: _Place, vertex: int) -> Array:
        """(2, k) ∂(t, R)/∂p at a vertex of the side, the coordinate of the place held."""
        problem, codes, v = path.problem, path.codes[place.side], path.u[vertex]
        free = np.flatnonzero(problem.graph.free[codes])
        t, m = float(path.t[vertex]), problem.m
        at = path_scene(scene, self.plan.given[0].path, t)
        piece = (codes // 2).astype(np.intp)
        bordered = np.zeros((len(free) + 1, len(free) + 1))
        bordered[:-1, :-1] = problem.A_tilde[np.ix_(free, free)]
        bordered[np.arange(len(free)), np.arange(len(free))] += problem.c[free] * problem.graph.slope[codes[free]]
        scale = float(np.max(np.abs(bordered.diagonal()), initial=0.0)) or 1.0
        bordered[:-1, -1] = -problem.l_1[free]
        bordered[-1, :-1] = scale * place.row[free]
        bordered[-1, -1] = scale * place.time
        right = np.zeros((len(free) + 1, len(self.plan.parameters)))
        kinks, loads = (np.zeros((m, len(self.plan.parameters))) for _ in range(2))
        whole = WholeBody(self.level, at, v)
        for j, parameter in enumerate(self.plan.parameters):
            slope = load_slope(self.level, at, parameter.number, v, whole)
            b, moving = np.zeros(m), np.zeros(m)
            if (law := laws[j]) is not None:
                b = law.value(v, piece)
                moving[piece < len(law.kinks)] = law.kinks[piece[piece < len(law.kinks)]]
                right[-1, j] = scale * law.kinks[place.kink] if place.kink >= 0 else 0.0
            moving[free] = 0.0
            kinks[:, j], loads[:, j] = moving, slope.right
            right[:-1, j] = (slope.right - problem.c * b - problem.A_tilde @ moving)[free]
        step = np.linalg.solve(bordered, right)
        dv = kinks
        dv[free] = step[:-1]
        dR = (loads - problem.A_tilde @ dv).sum(axis=0) + step[-1] * problem.l_1.sum()
        return np.stack([step[-1], dR])


def _reversed(path: Path) -> Path:
    """A path followed backward begins at its far end: told from its start on."""
    events = path.events
    last = path.pieces
    turned = replace(
        events,
        vertex=(last - events.vertex)[::-1],
        node=events.node[::-1],
        before=events.after[::-1],
        after=events.before[::-1],
    )
    return replace(
        path,
        t=path.t[::-1],
        u=path.u[::-1],
        traction=path.traction[::-1],
        residual=path.residual[::-1],
        stable=path.stable[::-1],
        first_codes=path.codes[-1],
        events=turned,
        start=last - path.start,
        begin=path.end,
        end=path.begin,
    )


@dataclass(frozen=True, eq=False)
class _Place:
    """Where on a path a foot lies, and the coordinate that is held there: row·v + time·t.

    side, share: of the polygon;  node, kink: at a corner the node that passes a kink, and the kink; −1 on a side
    """

    side: int
    share: float
    row: Array
    time: float = 0.0
    node: int = -1
    kink: int = -1

    @property
    def key(self) -> tuple[int, int]:
        """Places of one key have derivatives that differ by their share only."""
        return self.side, self.node

    @classmethod
    def of(cls, path: Path, side: int, share: float) -> _Place:
        """The place of a foot; at a corner on the side on which the node that passes its kink there slides."""
        m = path.problem.m
        if 0.0 < share < 1.0:
            return cls._on(path, side, share)
        vertex = side + int(share == 1.0)
        for k in np.flatnonzero(path.events.vertex == vertex):
            node = int(path.events.node[k])
            for own, code in ((vertex - 1, path.events.before[k]), (vertex, path.events.after[k])):
                if 0 <= own < path.pieces and path.problem.graph.free[code] and path.codes[own, node] == code:
                    row = np.zeros(m)
                    row[node] = 1.0
                    kink = int(path.problem.law.nearest_kink(np.full(m, path.u[vertex, node]))[node])
                    return cls(own, float(vertex - own), row, 0.0, node, kink)
        return cls._on(path, side, share)

    @classmethod
    def _on(cls, path: Path, side: int, share: float) -> _Place:
        way = path.u[side + 1] - path.u[side]
        length = float(np.max(np.abs(way)))
        if length == 0.0:  # all nodes rest: t alone moves
            return cls(side, share, np.zeros(len(way)), 1.0)
        return cls(side, share, way / length)
