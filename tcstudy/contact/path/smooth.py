"""The smooth curve beside a path whose straight pieces stand for exponential pieces of the law.

Between two events of the law itself (a node begins to slip, comes to rest, passes a kink) the
solutions are a smooth curve (v, t)(s), s = row·v + time·t. A side of the polygon beside it says
which nodes slide on which piece, and gives the first guess of

    [H −l̃₁; row time] [dv; dt] = [l̃ − Ãv − c b(v); s − row·v − time·t],   H = A_FF + diag(c b′),

Newton's method, regular at a simple fold of t too. The same matrix gives the derivative by s, and
with it the slope of a function of t and R = Σξ. Such a function is descended side after side, to
the zero of its slope between two vertices or to a corner from which it grows both ways.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

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
"""A function of (t, R) that returns the gradient (2,) of a number."""

EPS = float(np.finfo(float).eps)

MAX_NEWTON_STEPS = 40
"""Steps of Newton's method for one point of the curve."""

STALLED = 1e-10
"""Newton's method has stalled at rounding if a step of this relative size is not followed by a
smaller one."""

MAX_SIDES = 200
"""Sides of the polygon along which a goal is descended."""

ZERO_TOLERANCE = 1e-12
"""Relative accuracy of the place at which a goal is least; the goal moves by the square of it."""

MAX_FOLD_DISTANCE = 0.1
"""The law folds beside straight pieces if it does within this part of the slips over which b
changes."""

NOT_BESIDE = (
    "the curve was not found beside the path of straight pieces; "
    "begin elsewhere, or use compare: vertical"
)


class Factor(NamedTuple):
    """The bordered matrix of the nodes that slide, and its LU factors.

    free:   (n,) nodes that slide
    lu, pivots: factors of the matrix (n + 1, n + 1), as LAPACK has them
    border: stiffness by which its last row is multiplied
    """

    free: Index
    lu: Array
    pivots: Index
    border: float


@dataclass(frozen=True, eq=False)
class CurvePoint:
    """A point of the curve.

    codes:     (m,) 2k where a node slides on piece k, 2k + 1 where it is on the jump at its end
    v, t:      (m,) slips, and the parameter
    x:         (2,) t and R
    row, time: the coordinate s = row·v + time·t
    first:     (2,) derivative of x by s
    factor:    of the matrix there
    side:      side of the polygon beside it
    kink:      at a corner the one that a node passes there, −1 elsewhere
    """

    codes: Index
    v: Array
    t: float
    x: Array
    row: Array
    time: float
    first: Array
    factor: Factor
    side: int = -1
    kink: int = -1

    @property
    def s(self) -> float:
        return float(self.row @ self.v + self.time * self.t)


def bordered(
    problem: ParametricProblem, law: Laws, codes: Index, v: Array, coordinate: Coordinate
) -> tuple[Index, Array, float]:
    """Return the nodes that slide, [H −l̃₁; row time], and the factor of its last row [Pa].

    codes: pieces on which the nodes are, as in `CurvePoint`
    """
    free = np.flatnonzero(codes % 2 == 0)
    row, time = coordinate
    border = float(np.max(np.diagonal(problem.A_tilde)))
    slope = law.of_nodes(free).slope(v[free], codes[free] // 2)
    matrix = np.empty((len(free) + 1, len(free) + 1))
    matrix[:-1, :-1] = with_diagonal(problem.A_tilde, free, problem.c[free] * slope)
    matrix[:-1, -1] = -problem.l_1[free]
    matrix[-1, :-1] = border * row[free]
    matrix[-1, -1] = border * time
    return free, matrix, border


# far from the curve an exponential exceeds all numbers; such a step ends the iteration
@np.errstate(over="ignore", invalid="ignore")
def on_curve(
    problem: ParametricProblem,
    law: Laws,
    codes: Index,
    coordinate: Coordinate,
    s: float,
    v: Array,
    t: float,
) -> CurvePoint | None:
    """Return the point of a coordinate s with all nodes on these pieces.

    Newton's method begins at (v, t). None if it fails.
    """
    row, time = coordinate
    v = np.where(codes % 2 == 1, law.kink(codes // 2), v)
    slip = problem.traction_scale * float(np.max(problem.c) / np.max(np.diagonal(problem.A_tilde)))
    previous_size = np.inf
    for _ in range(MAX_NEWTON_STEPS):
        free, matrix, border = bordered(problem, law, codes, v, coordinate)
        lu, pivots, singular = scipy.linalg.lapack.dgetrf(matrix)
        if singular or not np.isfinite(lu[-1, -1]):
            return None
        b = law.of_nodes(free).value(v[free], codes[free] // 2)
        force = (problem.load(t) - problem.A_tilde @ v)[free]
        residual = np.append(force - problem.c[free] * b, border * (s - row @ v - time * t))
        step = scipy.linalg.lapack.dgetrs(lu, pivots, residual)[0]
        t_step = float(step[-1])
        v[free] += step[:-1]
        t += t_step
        size = float(np.max(np.abs(step[:-1]), initial=0.0)) + abs(t_step * time)
        largest = float(np.max(np.abs(v), initial=0.0)) + abs(t * time)
        if not np.isfinite(size):
            return None
        is_stalled = size >= 0.5 * previous_size and previous_size <= STALLED * max(largest, slip)
        if size <= 4.0 * EPS * largest or is_stalled:
            break
        previous_size = size
    else:
        return None
    along_s = np.append(np.zeros(len(free)), border)
    rates = scipy.linalg.lapack.dgetrs(lu, pivots, along_s)[0]
    t_rate = rates[-1]
    R = (problem.load(t) - problem.A_tilde @ v).sum()
    R_rate = problem.l_1.sum() * t_rate - problem.A_tilde[free].sum(axis=1) @ rates[:-1]
    return CurvePoint(
        codes=codes,
        v=v,
        t=t,
        x=np.array([t, R]),
        row=row,
        time=time,
        first=np.array([t_rate, R_rate]),
        factor=Factor(free, lu, pivots, border),
    )


@dataclass(frozen=True, eq=False)
class SmoothPath:
    """The curve of a law beside a path on straight pieces that stand for it and have its kinks."""

    path: Path
    law: Laws

    @cached_property
    def codes(self) -> Index:
        """(K, m) pieces of the law itself on all sides, as in `CurvePoint`."""
        u = self.path.u
        segment = 2 * self.law.piece(0.5 * (u[1:] + u[:-1]))
        jump = 2 * self.law.nearest_kink(u[1:]) + 1
        return np.where(self.path.slipping, segment, jump)

    def at(
        self, side: int, coordinate: Coordinate, s: float, v: Array, t: float
    ) -> CurvePoint | None:
        """Return the point of a coordinate s beside a side.

        None if Newton's method from (v, t) ends nowhere.
        """
        problem = self.path.problem
        point = on_curve(problem, self.law, self.codes[side], coordinate, s, v, t)
        return None if point is None else replace(point, side=side)

    def least(self, side: int, share: float, goal: Goal) -> CurvePoint:
        """Return the point where the goal is least near a place of the polygon.

        Raises ValueError if the curve is not found there.
        """

        def slope(point: CurvePoint) -> float:
            return float(goal(point.x) @ point.first)

        u = self.path.u
        t = self.path.t
        v = u[side] + share * (u[side + 1] - u[side])
        point = self.beside(side, v, float(t[side] + share * (t[side + 1] - t[side])))
        for _ in range(MAX_SIDES):
            sense = -int(np.sign(slope(point)))
            corner = self.vertex(point.side + (sense > 0), point.side)
            end = self.beside(point.side, corner.v, corner.t)
            if sense * (end.s - point.s) < 0.0:
                point = end  # the curve has its corner before the polygon has it
                continue
            if sense * slope(end) >= 0.0:
                return end if end.s == point.s else self._zero(slope, point, end)
            next_side = point.side + sense
            if not 0 <= next_side < self.path.pieces:
                return corner
            point = self.beside(next_side, corner.v, corner.t)
            if sense * slope(point) >= 0.0:
                return corner
        return point

    def beside(self, side: int, v: Array, t: float) -> CurvePoint:
        """Return the point of the curve beside one of a side.

        Raises ValueError if it is not found.
        """
        row, time = self.path.along(side)
        s = float(row @ v + time * t)
        return _required(self.at(side, (row, time), s, v, t))

    def vertex(self, vertex: int, side: int) -> CurvePoint:
        """Return the point beside a vertex at an end of a side.

        It is on the kink that a node passes there. Raises ValueError if it is not found.
        """
        path = self.path
        u = path.u[vertex]
        t = float(path.t[vertex])
        m = path.problem.m
        if vertex in (0, path.pieces):  # there t is held
            return _required(self.at(side, (np.zeros(m), 1.0), t, u, t))
        changes = self.codes[vertex - 1] != self.codes[vertex]
        if not np.any(changes):
            return self.beside(side, u, t)
        nearest = self.law.nearest_kink(u)
        kink_slip = self.law.kink(nearest)
        for neighbour in (vertex - 1, vertex):
            slides = self.codes[neighbour] % 2 == 0
            for node in np.flatnonzero(changes & slides):
                measures_node = np.eye(m)[node], 0.0
                point = self.at(neighbour, measures_node, float(kink_slip[node]), u, t)
                if point is not None:
                    return replace(point, kink=int(nearest[node]))
        raise ValueError(NOT_BESIDE)

    def _zero(
        self, slope: Callable[[CurvePoint], float], begin: CurvePoint, end: CurvePoint
    ) -> CurvePoint:
        """Return where a slope changes its sign between two points of a side."""
        points = {point.s: point for point in (begin, end)}

        def at(s: float) -> CurvePoint:
            if s not in points:
                share = (s - begin.s) / (end.s - begin.s)
                v = begin.v + share * (end.v - begin.v)
                t = begin.t + share * (end.t - begin.t)
                points[s] = _required(self.at(begin.side, (begin.row, begin.time), s, v, t))
            return points[s]

        tolerance = ZERO_TOLERANCE * max(abs(begin.s), abs(end.s))
        return at(brentq(lambda s: slope(at(s)), begin.s, end.s, xtol=tolerance))


def _required(point: CurvePoint | None) -> CurvePoint:
    """Return the point; raises ValueError without one."""
    if point is None:
        raise ValueError(NOT_BESIDE)
    return point


def fold_beside(path: Path, law: Laws, slip: float) -> tuple[float, Array] | None:
    """Return (t, v) where the law itself folds near the end of a path, or None.

    The path has straight pieces, the last one not stable. Straight pieces fold at one of their own
    corners, a little before or after the curve does, and what a jump releases is of first order in
    that. A fold beyond t = 1, the end of a step, is none: then the end of the step on the stable
    side is returned. The result is a fold only if it is a solution, all nodes considered.

    slip: over which b changes [m]
    """
    problem = path.problem
    curve = SmoothPath(path, law)
    last = path.pieces - 1
    before = max(last - 1, 0)
    try:
        point = curve.least(before, float(last > 0), lambda _: np.array([-1.0, 0.0]))
    except ValueError:
        return None
    if point.t > 1.0:  # the step ends before
        slips = path.u[last] - path.u[before]
        end = curve.at(before, (np.zeros(problem.m), 1.0), 1.0, point.v - slips, 1.0)
        if end is None:
            return None
        point = end
    largest_load = np.max(np.abs(problem.load(point.t)))
    t_rounding = 64.0 * EPS * float(largest_load / np.max(np.abs(problem.l_1)))
    is_near = np.max(np.abs(point.v - path.u[last])) <= MAX_FOLD_DISTANCE * slip
    if is_near and point.t > path.t[0] + t_rounding:
        return point.t, point.v
    return None
