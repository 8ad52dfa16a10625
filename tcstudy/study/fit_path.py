"""How a path moves with numbers of its study: exact derivatives of its points, through folds.

On a side of the polygon (t, R), R = Σξ, the nodes keep their pieces, and held fixed is eᵀv with e along the side: the
bordered matrix [H −l̃₁; eᵀ 0] is regular at a simple fold, where H is not. At a corner the slip of the node that passes
its kink there is held on that kink. Literature: Keller, in Rabinowitz (ed.), Applications of Bifurcation Theory (1977)
359–384 (bordering).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.offline.level import Level
from tcstudy.offline.slopes import load_slope
from tcstudy.offline.whole_slopes import WholeBody
from tcstudy.scene.fits import Sensitivity
from tcstudy.scene.law_slopes import LawSlopes, PointSlopes, law_slopes, number_of
from tcstudy.scene.parameters import path_scene
from tcstudy.scene.records import Scene
from tcstudy.solvers.path.follow import Path

Array = NDArray[np.float64]
Laws = list[LawSlopes | PointSlopes | None]
"""Derivatives of the law by each number, None where that is no number of it."""


@dataclass(frozen=True, eq=False)
class PathPlace:
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
    def of(cls, path: Path, side: int, share: float) -> PathPlace:
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
    def _on(cls, path: Path, side: int, share: float) -> PathPlace:
        way = path.u[side + 1] - path.u[side]
        length = float(np.max(np.abs(way)))
        if length == 0.0:  # all nodes rest: t alone moves
            return cls(side, share, np.zeros(len(way)), 1.0)
        return cls(side, share, way / length)


@dataclass(frozen=True, eq=False)
class MovingPath:
    """A path of a scene along a parameter (key path `along`), and the numbers by which it is differentiated."""

    level: Level
    scene: Scene
    along: tuple[str, ...]
    path: Path
    numbers: Sequence[Sensitivity]

    def at(self, places: Sequence[PathPlace]) -> Array:
        """(n, 2, k) derivatives of (t, R) at places of the path by the numbers."""
        laws = [
            law_slopes(self.scene.one_law, number_of(one.path)) if one.path[0] == "friction" else None
            for one in self.numbers
        ]
        done = {place.key: self._at_place(laws, place) for place in {p.key: p for p in places}.values()}
        found = np.empty((len(places), 2, len(self.numbers)))
        for row, place in zip(found, places, strict=True):
            constant, along = done[place.key]
            row[:] = constant + place.share * along
        return found

    def _at_place(self, laws: Laws, place: PathPlace) -> tuple[Array, Array]:
        """(2, k) at the beginning of a side, and what is added at its end: linear in between, as v and t are."""
        first, last = (self._derivative(laws, place, place.side + end) for end in (0, 1))
        return first, last - first

    def _derivative(self, laws: Laws, place: PathPlace, vertex: int) -> Array:
        """(2, k) ∂(t, R)/∂p at a vertex of the side, the coordinate of the place held."""
        path = self.path
        problem, codes, v = path.problem, path.codes[place.side], path.u[vertex]
        free = np.flatnonzero(problem.graph.free[codes])
        t, m = float(path.t[vertex]), problem.m
        at = path_scene(self.scene, self.along, t)
        piece = (codes // 2).astype(np.intp)
        bordered = np.zeros((len(free) + 1, len(free) + 1))
        bordered[:-1, :-1] = problem.A_tilde[np.ix_(free, free)]
        bordered[np.arange(len(free)), np.arange(len(free))] += problem.c[free] * problem.graph.slope[codes[free]]
        scale = float(np.max(np.abs(bordered.diagonal()), initial=0.0)) or 1.0
        bordered[:-1, -1] = -problem.l_1[free]
        bordered[-1, :-1] = scale * place.row[free]
        bordered[-1, -1] = scale * place.time
        right = np.zeros((len(free) + 1, len(self.numbers)))
        kinks, loads = (np.zeros((m, len(self.numbers))) for _ in range(2))
        whole = WholeBody(self.level, at, v)
        for j, number in enumerate(self.numbers):
            slope = load_slope(self.level, at, number, v, whole)
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


def reversed_path(path: Path) -> Path:
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
