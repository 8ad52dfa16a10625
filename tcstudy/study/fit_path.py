"""How a path moves with numbers of its study: exact derivatives of its points, through folds.

On a side of the polygon (t, R), R = Σξ, the nodes keep their pieces, and held fixed is eᵀv with e along the side: the
bordered matrix [H −l̃₁; eᵀ 0] is regular at a simple fold, where H is not. At a corner the slip of the node that passes
its kink there is held on that kink. The same beside the path of a law with exponential pieces, on the curve itself
(`contact.path.smooth`). Literature: Keller, in Rabinowitz (ed.), Applications of Bifurcation Theory (1977)
359–384 (bordering).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.accuracy.fitted import Feet, feet
from tcstudy.contact.path.follow import Path
from tcstudy.contact.path.smooth import CurvePoint, Goal, SmoothPath
from tcstudy.errors import FitError
from tcstudy.laws.composed import LawSlopes, law_slopes, number_of
from tcstudy.offline.level import Level
from tcstudy.offline.slopes import WholeBody, change_of
from tcstudy.scene.parameters import path_scene
from tcstudy.scene.records import Scene
from tcstudy.scene.study import Sensitivity

Array = NDArray[np.float64]
Slopes = list[LawSlopes | None]
"""Derivatives of the law by each number, None where that is no number of it."""


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

    def feet(self, data: Array, sigma: Array) -> tuple[Feet, Array]:
        """Feet of data (n, 2) in units of sigma (2,), and (n, k) derivatives of the distances by the numbers.

        Raises FitError where a curve is not found beside its path.
        """
        path, law = self.path, self.scene.one_law
        foot = feet(data / sigma, path.curve / sigma)
        sides = [(int(side), float(share)) for side, share in zip(foot.side, foot.share, strict=True)]
        if law.piecewise_linear:
            moved = self.at(sides)
        else:
            curve = SmoothPath(path, law)
            points = [
                self._least(curve, place, _distance(datum, sigma)) for place, datum in zip(sides, data, strict=True)
            ]
            moved, foot = self.of(points), _on_curve(foot, points, data / sigma, sigma)
        return foot, -np.einsum("nd,ndk->nk", foot.normal / sigma, moved)

    def _least(self, curve: SmoothPath, place: tuple[int, float], goal: Goal) -> CurvePoint:
        try:
            return curve.least(*place, goal)
        except ValueError as error:
            raise FitError(str(error)) from error

    def of(self, points: Sequence[CurvePoint]) -> Array:
        """(n, 2, k) derivatives of (t, R) at points of the curve by the numbers, their coordinates held."""
        laws = self._laws
        return np.stack([self._derivative(laws, p.codes, p.v, p.t, (p.row, p.time, p.kink)) for p in points])

    def at(self, places: Sequence[tuple[int, float]]) -> Array:
        """(n, 2, k) derivatives of (t, R) by the numbers at shares of sides of the path, linear along a side."""
        laws, path, found = self._laws, self.path, []
        known: dict[tuple[int, int, int], tuple[Array, Array]] = {}
        for place in places:
            side, share, node, held = self._held(*place)
            if (key := (side, node, held[-1])) not in known:
                codes, ends = path.codes[side].astype(np.intp), (side, side + 1)
                first, last = (self._derivative(laws, codes, path.u[k], float(path.t[k]), held) for k in ends)
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
        for k in np.flatnonzero(path.events.vertex == vertex) if share in (0.0, 1.0) else ():
            node = int(path.events.node[k])
            for own, code in ((vertex - 1, path.events.before[k]), (vertex, path.events.after[k])):
                if 0 <= own < path.pieces and path.problem.graph.free[code] and path.codes[own, node] == code:
                    kink = int(path.problem.law.nearest_kink(np.full(m, path.u[vertex, node]))[node])
                    return own, float(vertex - own), node, (np.eye(m)[node], 0.0, kink)
        return side, share, -1, (*path.along(side), -1)

    @property
    def _laws(self) -> Slopes:
        return [
            law_slopes(self.scene.one_law, number_of(one.path)) if one.path[0] == "friction" else None
            for one in self.numbers
        ]

    def _derivative(self, laws: Slopes, codes: NDArray[np.intp], v: Array, t: float, held: Held) -> Array:
        """(2, k) ∂(t, R)/∂p at v and t, all nodes on the pieces of `codes`, row·v + time·t held, or its kink's."""
        problem, law, (row, time, kink) = self.path.problem, self.scene.one_law, held
        free, m, piece = np.flatnonzero(codes % 2 == 0), problem.m, codes // 2
        at = path_scene(self.scene, self.along, t)
        bordered = np.zeros((len(free) + 1, len(free) + 1))
        bordered[:-1, :-1] = problem.A_tilde[np.ix_(free, free)]
        bordered[np.arange(len(free)), np.arange(len(free))] += problem.c[free] * law.slope(v[free], piece[free])
        scale = float(np.max(np.abs(bordered.diagonal()), initial=0.0)) or 1.0
        bordered[:-1, -1] = -problem.l_1[free]
        bordered[-1, :-1] = scale * row[free]
        bordered[-1, -1] = scale * time
        right = np.zeros((len(free) + 1, len(self.numbers)))
        kinks, loads = (np.zeros((m, len(self.numbers))) for _ in range(2))
        whole = WholeBody(self.level, at, v)
        for j, number in enumerate(self.numbers):
            load = whole.right_side(change_of(self.level, at, number))
            b, moving = np.zeros(m), np.zeros(m)
            if (change := laws[j]) is not None:
                b = change.value(v, piece)
                moving[piece < len(change.kinks)] = change.kinks[piece[piece < len(change.kinks)]]
                right[-1, j] = scale * change.kinks[kink] if kink >= 0 else 0.0
            moving[free] = 0.0
            kinks[:, j], loads[:, j] = moving, load
            right[:-1, j] = (load - problem.c * b - problem.A_tilde @ moving)[free]
        step = np.linalg.solve(bordered, right)
        dv = kinks
        dv[free] = step[:-1]
        dR = (loads - problem.A_tilde @ dv).sum(axis=0) + step[-1] * problem.l_1.sum()
        return np.stack([step[-1], dR])


def _distance(datum: Array, sigma: Array) -> Goal:
    """½ of the squared distance of a point from a datum, in units of sigma."""

    def goal(x: Array) -> tuple[float, Array, Array]:
        apart = (x - datum) / sigma
        return 0.5 * float(apart @ apart), apart / sigma, np.diag(sigma**-2.0)

    return goal


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
