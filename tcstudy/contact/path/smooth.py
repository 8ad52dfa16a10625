"""The curve beside a path: where the law has exponential pieces, whose path was followed on
straight ones instead.

Between two events of the law itself (a node begins to slip, comes to rest, passes a kink) the
solutions are a smooth curve (v, t)(s), s = row·v + time·t; a side of the polygon beside it says
which nodes slide on which piece, and begins

    [H −l̃₁; row time] [dv; dt] = [l̃ − Ãv − c b(v); s − row·v − time·t],   H = A_FF + diag(c b′),

Newton's method, regular at a simple fold of t too. The same matrix gives the derivative by s, and
with it the slope of a number of t and R = Σξ: side after side down it, to the zero between two
vertices or to a corner from which both ways go up.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.optimize import brentq

from tcstudy.contact.newton import with_diagonal
from tcstudy.contact.path.problem import ParametricProblem, Path
from tcstudy.laws.laws import Laws

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Coordinate = tuple[Array, float]
"""(row, time) of s = row·v + time·t."""
Goal = Callable[[Array], Array]
"""From (t, R) to the gradient (2,) of a number."""

EPS = float(np.finfo(float).eps)
NEWTON, SIDES = 40, 200
PLACE = 1e-12
"""How exactly a place on the curve is sought where a goal is least: it moves by the square of
that."""
NEAR = 0.1
"""The law folds beside straight pieces if it does within this part of the slips over which b
changes."""
BESIDE = "the curve was not found beside the path of straight pieces; begin elsewhere, or use compare: vertical"


@dataclass(frozen=True, eq=False)
class CurvePoint:
    """A point of the curve.

    codes:     (m,) 2k where a node slides on the piece of address k, 2k + 1 on the jump at its right end
    v, t:      (m,) slips, and the parameter;  x: (2,) t and R
    row, time: the coordinate s = row·v + time·t;  first: (2,) derivative of x by s
    factor:    the nodes that slide, and of `bordered` there LU, pivots and the factor of its last row
    side:      of the polygon beside it;  kink: at a corner the one that a node passes there, −1 elsewhere
    """

    codes: Index
    v: Array
    t: float
    x: Array
    row: Array
    time: float
    first: Array
    factor: tuple[Index, Array, Index, float]
    side: int = -1
    kink: int = -1

    @property
    def s(self) -> float:
        return float(self.row @ self.v + self.time * self.t)


def bordered(
    p: ParametricProblem, law: Laws, codes: Index, v: Array, coordinate: Coordinate
) -> tuple[Index, Array, float]:
    """(the nodes that slide, [H −l̃₁; row time] with its last row times a stiffness, that) on these
    pieces."""
    free, (row, time), unit = (
        np.flatnonzero(codes % 2 == 0),
        coordinate,
        float(np.max(np.diagonal(p.A_tilde))),
    )
    slope, J = (
        law.of_nodes(free).slope(v[free], codes[free] // 2),
        np.empty((len(free) + 1, len(free) + 1)),
    )
    J[:-1, :-1], J[:-1, -1] = with_diagonal(p.A_tilde, free, p.c[free] * slope), -p.l_1[free]
    J[-1, :-1], J[-1, -1] = unit * row[free], unit * time
    return free, J, unit


@np.errstate(
    over="ignore", invalid="ignore"
)  # far off an exponential passes all numbers; such a step ends it
def on_curve(
    p: ParametricProblem,
    law: Laws,
    codes: Index,
    coordinate: Coordinate,
    s: float,
    v: Array,
    t: float,
) -> CurvePoint | None:
    """The point of a coordinate s with all nodes on these pieces, by Newton's method from (v, t);
    None if it fails."""
    row, time = coordinate
    v, before = np.where(codes % 2 == 1, law.kink(codes // 2), v), np.inf
    slip = p.traction_scale * float(np.max(p.c) / np.max(np.diagonal(p.A_tilde)))
    for _ in range(NEWTON):
        free, J, unit = bordered(p, law, codes, v, coordinate)
        own, piece, c, n = law.of_nodes(free), codes[free] // 2, p.c[free], len(free)
        off = (p.load(t) - p.A_tilde @ v)[free] - c * own.value(v[free], piece)
        lu, pivots, singular = scipy.linalg.lapack.dgetrf(J)
        if singular or not np.isfinite(lu[-1, -1]):
            return None
        step = scipy.linalg.lapack.dgetrs(
            lu, pivots, np.append(off, unit * (s - row @ v - time * t))
        )[0]
        v[free], t = v[free] + step[:-1], t + float(step[-1])
        size = float(np.max(np.abs(step[:-1]), initial=0.0)) + abs(float(step[-1]) * time)
        largest = float(np.max(np.abs(v), initial=0.0)) + abs(t * time)
        if not np.isfinite(size):
            return None
        if size <= 4.0 * EPS * largest or (
            size >= 0.5 * before and before <= 1e-10 * max(largest, slip)
        ):
            break
        before = size
    else:
        return None
    d = scipy.linalg.lapack.dgetrs(lu, pivots, np.append(np.zeros(n), unit))[0]
    R, dR = (
        (p.load(t) - p.A_tilde @ v).sum(),
        p.l_1.sum() * d[-1] - p.A_tilde[free].sum(axis=1) @ d[:-1],
    )
    return CurvePoint(
        codes, v, t, np.array([t, R]), row, time, np.array([d[-1], dR]), (free, lu, pivots, unit)
    )


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
            self.path.slipping,
            2 * self.law.piece(0.5 * (u[1:] + u[:-1])),
            2 * self.law.nearest_kink(u[1:]) + 1,
        )

    def at(
        self, side: int, coordinate: Coordinate, s: float, v: Array, t: float
    ) -> CurvePoint | None:
        """The point of a coordinate s beside a side; None if Newton's method from (v, t) ends
        nowhere."""
        found = on_curve(self.path.problem, self.law, self.codes[side], coordinate, s, v, t)
        return found and replace(found, side=side)

    def least(self, side: int, share: float, goal: Goal) -> CurvePoint:
        """Where the goal is least near a place of the polygon. Raises ValueError if the curve is
        not found there."""

        def slope(point: CurvePoint) -> float:
            return float(goal(point.x) @ point.first)

        v, t = (x[side] + share * (x[side + 1] - x[side]) for x in (self.path.u, self.path.t))
        point = self.beside(side, v, float(t))
        for _ in range(SIDES):
            sense = -int(np.sign(slope(point)))
            corner = self.vertex(point.side + (sense > 0), point.side)
            end, after = self.beside(point.side, corner.v, corner.t), point.side + sense
            if (
                sense * (end.s - point.s) < 0.0
            ):  # the curve has its corner before the polygon has it
                point = end
                continue
            if sense * slope(end) >= 0.0:
                return self._zero(slope, point, end) if end.s != point.s else end
            if not 0 <= after < self.path.pieces:
                return corner
            point = self.beside(after, corner.v, corner.t)
            if sense * slope(point) >= 0.0:
                return corner
        return point

    def beside(self, side: int, v: Array, t: float) -> CurvePoint:
        """The point of the curve beside one of a side. Raises ValueError if it is not found."""
        row, time = self.path.along(side)
        return self._found(self.at(side, (row, time), float(row @ v + time * t), v, t))

    def _found(self, point: CurvePoint | None) -> CurvePoint:
        if point is None:
            raise ValueError(BESIDE)
        return point

    def vertex(self, vertex: int, side: int) -> CurvePoint:
        """The same beside a vertex at an end of a side, on the kink that a node passes there."""
        path, law, m = self.path, self.law, self.path.problem.m
        u, t, kinks = path.u[vertex], float(path.t[vertex]), law.nearest_kink(path.u[vertex])
        if vertex in (0, path.pieces):  # there t is held
            return self._found(self.at(side, (np.zeros(m), 1.0), t, u, t))
        changed = self.codes[vertex - 1] != self.codes[vertex]
        for own in (vertex - 1, vertex):
            for node in np.flatnonzero(changed & (self.codes[own] % 2 == 0)):
                found = self.at(own, (np.eye(m)[node], 0.0), float(law.kink(kinks)[node]), u, t)
                if found is not None:
                    return replace(found, kink=int(kinks[node]))
        return self._found(None if np.any(changed) else self.beside(side, u, t))

    def _zero(
        self, slope: Callable[[CurvePoint], float], one: CurvePoint, other: CurvePoint
    ) -> CurvePoint:
        """Where a slope changes its sign between two points of a side."""
        known = {point.s: point for point in (one, other)}

        def at(s: float) -> CurvePoint:
            if s not in known:
                share = (s - one.s) / (other.s - one.s)
                v, t = one.v + share * (other.v - one.v), one.t + share * (other.t - one.t)
                known[s] = self._found(self.at(one.side, (one.row, one.time), s, v, t))
            return known[s]

        place = PLACE * max(abs(one.s), abs(other.s))
        return at(brentq(lambda s: slope(at(s)), one.s, other.s, xtol=place))


def fold_beside(path: Path, law: Laws, slip: float) -> tuple[float, Array] | None:
    """(t, v) where the law itself folds near the end of a path on straight pieces, the last one not
    stable; or None.

    Straight pieces fold at one of their own corners, a little before or after the curve does, and
    what a jump releases is of first order in that. One beyond t = 1, the end of a step, is none:
    that is the end of the step then, on the stable side. What is found is a fold only if it is a
    solution, all nodes considered. slip: over which b changes [m]
    """
    p, curve, last = path.problem, SmoothPath(path, law), path.pieces - 1
    before = max(last - 1, 0)
    try:
        point = curve.least(before, float(last > 0), lambda x: np.array([-1.0, 0.0]))
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
