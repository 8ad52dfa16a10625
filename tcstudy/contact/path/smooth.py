"""The curve beside a path: where the law has exponential pieces, whose path was followed on straight ones instead.

Between two events of the law itself (a node begins to slip, comes to rest, passes a kink) the solutions are a smooth
curve (v, t)(s), s = row·v + time·t; a side of the polygon beside it says which nodes slide on which piece, and begins

    [H −l̃₁; row time] [dv; dt] = [l̃ − Ãv − c b(v); s − row·v − time·t],   H = A_FF + diag(c b′),

Newton's method, regular at a simple fold of t too. The same matrix gives both derivatives by s, and with them the point
of the curve where a number of t and R = Σξ is least: Newton's method again, one step after the other shortened until
it gains. Where it leaves the smooth piece, the corner decides: it is the point, or the next piece goes down from it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tcstudy.contact.path.record import Path
from tcstudy.laws.laws import Laws

Array = NDArray[np.float64]
Goal = Callable[[Array], tuple[float, Array, Array]]
"""From (t, R) to a number, its gradient (2,) and its second derivatives (2, 2)."""

NEWTON, HALVINGS, CORNERS = 40, 40, 12
BEYOND = 1e-12
"""Part of the largest slip, or of the scale of b, by which rounding may take a node off its piece."""
ARRIVED = 1e-6
"""Steps below this part of the largest slip need not gain, which rounding hides, and end when they get no shorter."""
BESIDE = "the curve was not found beside the path of straight pieces; begin elsewhere, or use compare: vertical"


@dataclass(frozen=True, eq=False)
class CurvePoint:
    """A point of the curve.

    side:      of the polygon beside it
    codes:     (m,) 2k where a node slides on the piece of address k, 2k + 1 on the jump at its right end
    v, t:      (m,) slips, and the parameter;  x: (2,) t and R
    row, time: the coordinate s = row·v + time·t;  first, second: (2,) derivatives of x by s
    node, kink: at a corner the node that passes a kink there, and the kink; −1 elsewhere
    """

    side: int
    codes: NDArray[np.intp]
    v: Array
    t: float
    x: Array
    row: Array
    time: float
    first: Array
    second: Array
    node: int = -1
    kink: int = -1


@dataclass(frozen=True, eq=False)
class SmoothPath:
    """The curve of a law beside a path on straight pieces in its place, which have its kinks."""

    path: Path
    law: Laws

    @cached_property
    def codes(self) -> NDArray[np.intp]:
        """(K, m) pieces of the law itself on all sides, as in `CurvePoint`."""
        u = self.path.u
        return np.where(
            self.path.slipping, 2 * self.law.piece(0.5 * (u[1:] + u[:-1])), 2 * self.law.nearest_kink(u[1:]) + 1
        )

    @cached_property
    def corners(self) -> NDArray[np.intp]:
        """Vertices at which a node changes its piece of the law itself, the ends of the path among them."""
        changes = np.flatnonzero(np.any(self.codes[1:] != self.codes[:-1], axis=1)) + 1
        return np.concatenate([[0], changes, [self.path.pieces]])

    def at(self, side: int, coordinate: tuple[Array, float], s: float, v: Array, t: float) -> CurvePoint | None:
        """The point of a coordinate s beside a side, by Newton's method from (v, t); None if that ends nowhere."""
        p, law, codes, (row, time) = self.path.problem, self.law, self.codes[side], coordinate
        free = np.flatnonzero(codes % 2 == 0)
        v = np.where(codes % 2 == 1, law.kink(codes // 2), v)
        piece, c = codes[free] // 2, p.c[free]
        A, l_1 = p.A_tilde[np.ix_(free, free)], p.l_1[free]
        scale = float(np.max(np.abs(A.diagonal()), initial=0.0)) or 1.0
        before = np.inf
        for _ in range(NEWTON):
            J = np.block([[A + np.diag(c * law.slope(v[free], piece)), -l_1[:, None]],
                          [scale * row[None, free], np.full((1, 1), scale * time)]])  # fmt: skip
            off = (p.load(t) - p.A_tilde @ v)[free] - c * law.value(v[free], piece)
            factor = scipy.linalg.lu_factor(J, check_finite=False)
            step = scipy.linalg.lu_solve(factor, np.append(off, scale * (s - row @ v - time * t)), check_finite=False)
            v[free], t = v[free] + step[:-1], t + float(step[-1])
            size = float(np.max(np.abs(step[:-1]), initial=0.0)) + abs(float(step[-1])) * time
            largest = float(np.max(np.abs(v), initial=0.0)) + abs(t) * time
            if not np.isfinite(size) or size <= 4.0 * np.finfo(float).eps * largest or size == 0.0:
                break
            if size >= 0.5 * before and before <= 1e-10 * largest:
                break
            before = size
        else:
            return None
        if not np.isfinite(size):
            return None
        ahead = np.zeros(len(free) + 1)
        ahead[-1] = scale
        one = scipy.linalg.lu_solve(factor, ahead)
        bend = law.bend(v[free], piece)
        two = scipy.linalg.lu_solve(factor, np.append(-c * bend * one[:-1] ** 2, 0.0))
        weight = p.A_tilde[free].sum(axis=1)
        x = np.array([t, (p.load(t) - p.A_tilde @ v).sum()])
        first, second = (np.array([d[-1], d[-1] * p.l_1.sum() - weight @ d[:-1]]) for d in (one, two))
        return CurvePoint(side, codes, v, t, x, row, time, first, second)

    def least(self, side: int, share: float, goal: Goal) -> CurvePoint:
        """Where the goal is least near a place of the polygon. Raises ValueError if the curve is not found there."""
        v, t = (x[side] + share * (x[side + 1] - x[side]) for x in (self.path.u, self.path.t))
        point, seen = self._beside(side, v, float(t)), set[int]()
        for _ in range(CORNERS):
            point, vertex = self._down(point, goal)
            if vertex is None:
                return point
            corner, ways = self._corner(vertex)
            both = zip(ways, (-1.0, 1.0), strict=True)
            down = [way for way, out in both if way and out * float(goal(way.x)[1] @ way.first) < 0.0]
            if not down or vertex in seen:
                return corner
            seen.add(vertex)
            point = down[0]
        return point

    def _beside(self, side: int, v: Array, t: float) -> CurvePoint:
        row, time = self.path.along(side)
        found = self.at(side, (row, time), float(row @ v + time * t), v, t)
        if found is None:
            raise ValueError(BESIDE)
        return found

    def _down(self, point: CurvePoint, goal: Goal) -> tuple[CurvePoint, int | None]:
        """(the least point of the smooth piece, None), or (a point, the corner beyond which the goal is less)."""
        last = np.inf
        for _ in range(NEWTON):
            value, gradient, bend = goal(point.x)
            slope = float(gradient @ point.first)
            curvature = float(point.first @ bend @ point.first + gradient @ point.second)
            if curvature <= 0.0:
                curvature = float(point.first @ bend @ point.first) or abs(slope) / (1e-2 * _size(point))
            step = -slope / curvature
            if abs(step) <= ARRIVED * _size(point) and abs(step) >= 0.5 * last:
                return point, None
            last = abs(step)
            for _ in range(HALVINGS):
                s = float(point.row @ point.v + point.time * point.t) + step
                new = self.at(point.side, (point.row, point.time), s, point.v, point.t)
                if new is not None and (abs(step) <= ARRIVED * _size(point) or goal(new.x)[0] <= value):
                    break
                step *= 0.5
            else:
                return point, None
            if self._left(new):
                after = int(np.searchsorted(self.corners, point.side, side="right"))
                return point, int(self.corners[after if step > 0.0 else after - 1])
            point = new
            if abs(step) <= np.finfo(float).eps * _size(point):
                break
        return point, None

    def _left(self, point: CurvePoint) -> bool:
        """Whether a node is not on its piece, or the point before the path's beginning or beyond its end."""
        p, law, v, codes = self.path.problem, self.law, point.v, point.codes
        free, slack = codes % 2 == 0, BEYOND * float(np.max(np.abs(v), initial=0.0))
        (low, high), limits = law.ends(codes // 2), law.limits(codes // 2)
        off = free & ((v < low - slack) | (v > high + slack))
        xi, slack = (p.load(point.t) - p.A_tilde @ v) / p.c, BEYOND * law.b_scale
        off |= ~free & ((xi < np.minimum(*limits) - slack) | (xi > np.maximum(*limits) + slack))
        ways = ((0, 0, 1.0), (self.path.pieces - 1, -1, -1.0))
        beyond = [side == point.side and way * self._passed(side, end, point) < 0.0 for side, end, way in ways]
        return bool(np.any(off)) or any(beyond)

    def _passed(self, side: int, end: int, point: CurvePoint) -> float:
        row, time = self.path.along(side)
        return float(row @ (point.v - self.path.u[end]) + time * (point.t - self.path.t[end]))

    def _corner(self, vertex: int) -> tuple[CurvePoint, list[CurvePoint | None]]:
        """The corner beside a vertex, and the same as the end of one smooth piece and the beginning of the next."""
        path, law, m = self.path, self.law, self.path.problem.m
        sides = [side for side in (vertex - 1, vertex) if 0 <= side < path.pieces]
        if len(sides) == 1:  # of the path: there t is held
            end = self.at(sides[0], (np.zeros(m), 1.0), float(path.t[vertex]), path.u[vertex], float(path.t[vertex]))
            if end is None:
                raise ValueError(BESIDE)
            inner = self._beside(sides[0], end.v, end.t)
            return end, [None, inner] if vertex == 0 else [inner, None]
        changed = self.codes[vertex - 1] != self.codes[vertex]
        for side in sides:
            for node in np.flatnonzero(changed & (self.codes[side] % 2 == 0)):
                row, kink = np.zeros(m), int(law.nearest_kink(path.u[vertex])[node])
                row[node] = 1.0
                s = float(law.kink(np.array(kink)))
                found = self.at(side, (row, 0.0), s, path.u[vertex], float(path.t[vertex]))
                if found is not None:
                    corner = replace(found, node=int(node), kink=kink)
                    return corner, [self._beside(one, corner.v, corner.t) for one in sides]
        raise ValueError(BESIDE)


def _size(point: CurvePoint) -> float:
    """Of the coordinate at a point."""
    return float(np.max(np.abs(point.v)) or 1.0) if point.time == 0.0 else abs(point.t) or 1.0
