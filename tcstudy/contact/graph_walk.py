"""Walks over the graphs of all nodes: solutions of Av + Cζ = load while the load changes.

Load:  l + L x, L the columns by which it changes, x their coefficients
Cell:  one side of its polygon for every node. There places τ on the sides, in their lengths, have
       rates Y L dx, Y the inverse of AD_v + CD_ζ for unit lengths D of the sides.
Pivot: the node that first reaches the end of its side goes on along the next one. One column of the
       matrix changes, and Y with it (the first and the last side go on without end).
Source: J. Katzenelson, Bell Syst. Tech. J. 44 (1965) 1605–1620
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_MAX_PIVOTS = 6000
"""Most changes of side of a walk."""
_REFRESH = 25
"""Changes of side after which the inverse is made anew."""


class Sides(NamedTuple):
    """The sides of the polygons of all nodes.

    points: (m, S + 1, 2) their ends (v, ζ);  run, rise: (m, S) what they gain in v and ζ
    length: (m, S) positive sizes in which places are measured
    """

    points: Array
    run: Array
    rise: Array
    length: Array


class SolutionCurve(NamedTuple):
    """Vertices of a curve: coefficients x (T, k), v and ζ (T, m).

    sides: (T − 1, m) sides between them
    """

    x: Array
    v: Array
    zeta: Array
    sides: Index


class LostWayError(Exception):
    """A cell is singular, or there are too many."""


Heading = Callable[["GraphWalk"], tuple[Array, float]]
"""Returns the rate of x (k + 1,) in the present cell, and how far to go with it.

The last rate is that of the load with which a walk begins, and 0.
"""


class GraphWalk:
    """A walk in a part of the graphs, first to last (m,) sides.

    A:       (m, m) matrix that no cell of the part makes singular
    load:    (m,) l
    columns: (m, k) L;  x: (k,) coefficients that the walk begins with

    v, zeta: (m,) the present point;  sides: (m,) its cell
    Raises LostWayError.
    """

    def __init__(
        self,
        sides: Sides,
        A: Array,
        c: Array,
        ends: tuple[Index, Index],
        load: Array,
        columns: Array,
        x: Array,
    ) -> None:
        self._graph = sides
        self.A, self.c = A, c
        self.first, self.last = ends
        self.node = np.arange(len(c))
        self.sides = (self.first + self.last) // 2
        share = 0.3 + 0.4 * np.mod(0.618033988749895 * (self.node + 1), 1.0)  # no two nodes alike
        self._tau = share * self._length
        self.v, self.zeta = self._point()
        # the load begins as that of this point; the walk takes what is missing from −1 to 0
        missing = load + columns @ x - A @ self.v - c * self.zeta
        self.load = load
        self.columns = np.column_stack([columns, missing])
        self.x = np.append(x, -1.0)
        self.Y = self._inverse()
        self._pivots = 0
        self._vertices = list[tuple[Array, Array, Array]]()
        self._cells = list[Index]()
        self.go(along(len(x), 0.0))

    def go(self, heading: Heading, record: bool = False) -> None:
        """Walk until the heading has no way left."""
        if record:
            self._note()
        while True:
            x_rate, way = heading(self)
            rate = self.Y @ (self.columns @ x_rate)
            to_end = self._to_ends(rate)
            turning = int(np.argmin(to_end))
            arrives = float(to_end[turning]) >= way
            self._move(rate, x_rate, min(float(to_end[turning]), way))
            is_up = bool(rate[turning] > 0.0)
            if not arrives:
                corner = self.sides[turning] + int(is_up)
                self.v[turning], self.zeta[turning] = self._graph.points[turning, corner]
            if record:
                self._cells.append(self.sides)
                self._note()
            if arrives:
                return
            self._pivot(turning, is_up)

    @property
    def curve(self) -> SolutionCurve:
        """The curve of all vertices that were recorded."""
        x, v, zeta = (np.array(column) for column in zip(*self._vertices, strict=True))
        return SolutionCurve(x[:, :-1], v, zeta, np.array(self._cells))

    def rates(self, column: int) -> Array:
        """Return (m,) dv by a coefficient in the present cell."""
        run = self._graph.run[self.node, self.sides] / self._length
        return np.asarray(run * (self.Y @ self.columns[:, column]))

    @property
    def _length(self) -> Array:
        return self._graph.length[self.node, self.sides]

    def _note(self) -> None:
        self._vertices.append((self.x, self.v, self.zeta))

    def _to_ends(self, rate: Array) -> Array:
        """Return (m,) the ways to the ends of the sides, ∞ along those that go on."""
        can_rise = (rate > 0.0) & (self.sides < self.last)
        can_fall = (rate < 0.0) & (self.sides > self.first)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            to_end = np.where(can_rise, (self._length - self._tau) / rate, np.inf)
            to_end = np.where(can_fall, -self._tau / rate, to_end)
        return np.maximum(to_end, 0.0)

    def _move(self, rate: Array, x_rate: Array, way: float) -> None:
        self._tau = self._tau + way * rate
        self.x = self.x + way * x_rate
        self.v, self.zeta = self._point()

    def _point(self) -> tuple[Array, Array]:
        """Return (v, ζ) on the graph: rounding of places is part of the residual."""
        least = np.where(self.sides == self.first, -np.inf, 0.0)
        greatest = np.where(self.sides == self.last, np.inf, 1.0)
        share = np.clip(self._tau / self._length, least, greatest)
        start = self._graph.points[self.node, self.sides]
        v = start[:, 0] + share * self._graph.run[self.node, self.sides]
        zeta = start[:, 1] + share * self._graph.rise[self.node, self.sides]
        return v, zeta

    def _pivot(self, turning: int, is_up: bool) -> None:
        """Let a node go on along its next side. Raises LostWayError."""
        self._pivots += 1
        if self._pivots > _MAX_PIVOTS:
            raise LostWayError
        self.sides = self.sides.copy()
        self.sides[turning] += 1 if is_up else -1
        place = 0.0 if is_up else float(self._graph.length[turning, self.sides[turning]])
        self._tau[turning] = place
        if self._pivots % _REFRESH:
            self.Y = self._exchanged(turning)
            return
        self.Y = self._inverse()
        start = self._graph.points[self.node, self.sides]
        load = self.load + self.columns @ self.x
        self._tau = self.Y @ (load - self.A @ start[:, 0] - self.c * start[:, 1])
        self._tau[turning] = place

    def _inverse(self) -> Array:
        run = self._graph.run[self.node, self.sides] / self._length
        rise = self._graph.rise[self.node, self.sides] / self._length
        M = self.A * run
        M[self.node, self.node] += self.c * rise
        try:
            Y = np.linalg.inv(M)
        except np.linalg.LinAlgError:
            raise LostWayError from None
        if not np.isfinite(Y).all():
            raise LostWayError
        return np.asarray(Y)

    def _exchanged(self, node: int) -> Array:
        """Return the inverse after the column of a node has changed to that of its side."""
        side = self.sides[node]
        length = self._graph.length[node, side]
        column = self.A[:, node] * (self._graph.run[node, side] / length)
        column[node] += self.c[node] * self._graph.rise[node, side] / length
        x = self.Y @ column
        pivot = x[node]
        if pivot == 0.0 or not np.isfinite(pivot):
            raise LostWayError
        row = self.Y[node] / pivot
        Y = self.Y - x[:, None] * row
        Y[node] = row
        return np.asarray(Y)


def along(coefficient: int, end: float) -> Heading:
    """Return the heading by which one coefficient of x grows or falls to an end."""

    def heading(walk: GraphWalk) -> tuple[Array, float]:
        rate = np.zeros(len(walk.x))
        way = end - float(walk.x[coefficient])
        rate[coefficient] = 1.0 if way >= 0.0 else -1.0
        return rate, abs(way)

    return heading
