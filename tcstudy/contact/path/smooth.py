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

from tcstudy.contact.newton import with_diagonal
from tcstudy.contact.path.problem import ParametricProblem, Path
from tcstudy.laws.laws import Laws

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Coordinate = tuple[Array, float]
"""(row, time) of s = row·v + time·t."""
Goal = Callable[[Array], tuple[float, Array, Array]]
"""From (t, R) to a number, its gradient (2,) and its second derivatives (2, 2)."""

EPS = float(np.finfo(float).eps)
NEWTON, HALVINGS, CORNERS = 40, 40, 12
BEYOND = 1e-12
"""Part of the largest slip, or of the scale of b, by which rounding may take a node off its piece."""
ARRIVED = 1e-5
"""Steps below this part of the largest slip need not gain, which rounding hides, and end when they get no shorter."""
NEAR = 0.1
"""The law folds beside straight pieces if it does within this part of the slips over which b changes."""
BESIDE = "the curve was not found beside the path of straight pieces; begin elsewhere, or use compare: vertical"


@dataclass(frozen=True, eq=False)
class CurvePoint:
    """A point of the curve.

    codes:     (m,) 2k where a node slides on the piece of address k, 2k + 1 on the jump at its right end
    v, t:      (m,) slips, and the parameter;  x: (2,) t and R
    row, time: the coordinate s = row·v + time·t;  first, second: (2,) derivatives of x by s
    side:      of the polygon beside it
    node, kink: at a corner the node that passes a kink there, and the kink; −1 elsewhere
    """

    codes: Index
    v: Array
    t: float
    x: Array
    row: Array
    time: float
    first: Array
    second: Array
    side: int = -1
    node: int = -1
    kink: int = -1

    @property
    def s(self) -> float:
        return float(self.row @ self.v + self.time * self.t)

    @property
    def size(self) -> float:
        """Of the coordinate."""
        return float(np.max(np.abs(self.v)) or 1.0) if self.time == 0.0 else abs(self.t) or 1.0


@np.errstate(over="ignore", invalid="ignore")  # far off an exponential passes all numbers; such a step ends it
def on_curve(
    p: ParametricProblem, law: Laws, codes: Index, coordinate: Coordinate, s: float, v: Array, t: float
) -> CurvePoint | None:
    """The point of a coordinate s with all nodes on these pieces, by Newton's method from (v, t); None if it fails."""
    row, time = coordinate
    free = np.flatnonzero(codes % 2 == 0)
    v = np.where(codes % 2 == 1, law.kink(codes // 2), v)
    own, piece, c, n = law.of_nodes(free), codes[free] // 2, p.c[free], len(free)
    unit, before = float(np.max(np.diagonal(p.A_tilde))), np.inf
    slip = p.traction_scale * float(np.max(p.c)) / unit
    J = np.empty((n + 1, n + 1))
    for _ in range(NEWTON):
        J[:n, :n], J[:n, n] = with_diagonal(p.A_tilde, free, c * own.slope(v[free], piece)), -p.l_1[free]
        J[n, :n], J[n, n] = unit * row[free], unit * time
        off = (p.load(t) - p.A_tilde @ v)[free] - c * own.value(v[free], piece)
        lu, pivots, singular = scipy.linalg.lapack.dgetrf(J)
        if singular or not np.isfinite(lu[-1, -1]):
            return None
        step = scipy.linalg.lapack.dgetrs(lu, pivots, np.append(off, unit * (s - row @ v - time * t)))[0]
        v[free], t = v[free] + step[:-1], t + float(step[-1])
        size = float(np.max(np.abs(step[:-1]), initial=0.0)) + abs(float(step[-1]) * time)
        largest = float(np.max(np.abs(v), initial=0.0)) + abs(t * time)
        if not np.isfinite(size):
            return None
        if size <= 4.0 * EPS * largest or (size >= 0.5 * before and before <= 1e-10 * max(largest, slip)):
            break
        before = size
    else:
        return None
    one = scipy.linalg.lapack.dgetrs(lu, pivots, np.append(np.zeros(n), unit))[0]
    bend = -c * own.bend(v[free], piece) * one[:-1] ** 2
    two = scipy.linalg.lapack.dgetrs(lu, pivots, np.append(bend, 0.0))[0]
    weight, growth = p.A_tilde[free].sum(axis=1), float(p.l_1.sum())
    x = np.array([t, (p.load(t) - p.A_tilde @ v).sum()])
    first, second = (np.array([d[-1], d[-1] * growth - weight @ d[:-1]]) for d in (one, two))
    return CurvePoint(codes, v, t, x, row, time, first, second)


@dataclass(frozen=True, eq=False)
class SmoothPath:
    """The curve of a law beside a path on straight pieces in its place, which have its kinks."""

    path: Path
    law: Laws

    @cached_property
    def codes(self) -> Index:
        """(K, m) pieces of the law itself on all sides, as in `CurvePoint`."""
        u = self.path.u
        return np.where(
            self.path.slipping, 2 * self.law.piece(0.5 * (u[1:] + u[:-1])), 2 * self.law.nearest_kink(u[1:]) + 1
        )

    @cached_property
    def corners(self) -> Index:
        """Vertices at which a node changes its piece of the law itself, the ends of the path among them."""
        changes = np.flatnonzero(np.any(self.codes[1:] != self.codes[:-1], axis=1)) + 1
        return np.concatenate([[0], changes, [self.path.pieces]])

    def at(self, side: int, coordinate: Coordinate, s: float, v: Array, t: float) -> CurvePoint | None:
        """The point of a coordinate s beside a side; None if Newton's method from (v, t) ends nowhere."""
        found = on_curve(self.path.problem, self.law, self.codes[side], coordinate, s, v, t)
        return found and replace(found, side=side)

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
            slope, straight = float(gradient @ point.first), float(point.first @ bend @ point.first)
            curvature = straight + float(gradient @ point.second)
            if curvature <= 0.0:
                curvature = straight or abs(slope) / (1e-2 * point.size)
            step = -slope / curvature
            if abs(step) <= ARRIVED * point.size and abs(step) >= 0.5 * last:
                return point, None
            last = abs(step)
            for _ in range(HALVINGS):
                new = self.at(point.side, (point.row, point.time), point.s + step, point.v, point.t)
                if new is not None and (abs(step) <= ARRIVED * point.size or goal(new.x)[0] <= value):
                    break
                step *= 0.5
            else:
                return point, None
            if self._left(new):
                after = int(np.searchsorted(self.corners, point.side, side="right"))
                return point, int(self.corners[after if step > 0.0 else after - 1])
            point = new
            if abs(step) <= EPS * point.size:
                break
        return point, None

    def _left(self, point: CurvePoint) -> bool:
        """Whether a node is not on its piece, or the point before the path's beginning or beyond its end."""
        p, law, v, codes, path = self.path.problem, self.law, point.v, point.codes, self.path
        free, slack = codes % 2 == 0, BEYOND * float(np.max(np.abs(v), initial=0.0))
        (low, high), limits = law.ends(codes // 2), law.limits(codes // 2)
        off = free & ((v < low - slack) | (v > high + slack))
        xi, slack = (p.load(point.t) - p.A_tilde @ v) / p.c, BEYOND * law.b_scale
        off |= ~free & ((xi < np.minimum(*limits) - slack) | (xi > np.maximum(*limits) + slack))
        row, time = path.along(point.side)
        first, last = (row @ (v - path.u[k]) + time * (point.t - path.t[k]) for k in (0, -1))
        before, beyond = point.side == 0 and first < 0.0, point.side == path.pieces - 1 and last > 0.0
        return bool(np.any(off) or before or beyond)

    def _corner(self, vertex: int) -> tuple[CurvePoint, list[CurvePoint | None]]:
        """The corner beside a vertex, and the same as the end of one smooth piece and the beginning of the next."""
        path, law, m = self.path, self.law, self.path.problem.m
        u, t, sides = path.u[vertex], float(path.t[vertex]), range(max(vertex - 1, 0), min(vertex + 1, path.pieces))
        if len(sides) == 1:  # of the path: there t is held
            end = self.at(sides[0], (np.zeros(m), 1.0), t, u, t)
            if end is None:
                raise ValueError(BESIDE)
            inner = self._beside(sides[0], end.v, end.t)
            return end, [None, inner] if vertex == 0 else [inner, None]
        changed, kinks = self.codes[vertex - 1] != self.codes[vertex], np.asarray(law.nearest_kink(u))
        for side in sides:
            for node in np.flatnonzero(changed & (self.codes[side] % 2 == 0)):
                found = self.at(side, (np.eye(m)[node], 0.0), float(law.kink(kinks)[node]), u, t)
                if found is not None:
                    corner = replace(found, node=int(node), kink=int(kinks[node]))
                    return corner, [self._beside(one, corner.v, corner.t) for one in sides]
        raise ValueError(BESIDE)


def fold_beside(path: Path, law: Laws, slip: float) -> tuple[float, Array] | None:
    """(t, v) where the law itself folds near the end of a path on straight pieces, the last one not stable; or None.

    Straight pieces fold at one of their own corners, a little before or after the curve does, and what a jump releases
    is of first order in that. One beyond t = 1, the end of a step, is none: that is the end of the step then, on the
    stable side. What is found is a fold only if it is a solution, all nodes considered.
    slip: over which b changes [m]
    """
    p, curve, last, bend = path.problem, SmoothPath(path, law), path.pieces - 1, np.zeros((2, 2))
    before = max(last - 1, 0)
    try:
        point = curve.least(before, float(last > 0), lambda x: (-float(x[0]), np.array([-1.0, 0.0]), bend))
    except ValueError:
        return None
    if point.t > 1.0:  # the step ends before
        way = path.u[last] - path.u[before]
        held = curve.at(before, (np.zeros(p.m), 1.0), 1.0, point.v - way, 1.0)
        if held is None:
            return None
        point = held
    apart = 64.0 * EPS * float(np.max(np.abs(p.load(point.t))) / np.max(np.abs(p.l_1)))
    near = np.max(np.abs(point.v - path.u[last])) <= NEAR * slip
    return (point.t, point.v) if near and point.t > path.t[0] + apart else None
