"""A point on the path, the cell it is in, the way to the cell's boundary, and the next cell.

In working units: stiffness divided by its mean diagonal, so that forces c·(ξ/c) and slips have the same unit, and t
times a power of two, τ, so that the load per τ is about 1. `x` (m + 1,) holds the coordinate of every node that moves
in the present cell, u_i of a free node, the force of one on a vertical side, and τ last: the end of the range of t is
the end of its piece. One node at its bound goes on into the next piece of its graph in the same sense, whatever t does:
a fold is nothing special. Several at once are a `Corner`.
"""

from __future__ import annotations

from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.path.basis_inverse import STILL, BasisInverse, SingularCellError
from tcstudy.contact.path.problem import Codes, ParametricProblem

Array = NDArray[np.float64]
Index = NDArray[np.intp]

TIE, BLURS, LARGEST_TIE = 1e-12, 64.0, 1e-9
"""Nodes this close to their bound, relative to slip and traction there, reach it together with the first one, or as
close as rounding lets their place be known: so many times ScaledBody.blur, as the motion is nearly singular where a
whole zone reaches its bounds at once; whatever rounding is, nodes farther than the last have not reached theirs."""

DRIFTED = 1e3
"""How many times farther than a tie nodes are looked at again, with the point corrected first."""

CRAWLS = 1e-4
"""A node slower than this part of the fastest one hardly knows its place on the path: a corrected point is not held
where that node has reached its bound, or rounding of its coordinate would move the point along the path."""


class Points(NamedTuple):
    """Points of the path: t (), u (m,), ξ/c (m,), l̃ − Ãu − ξ (m,), or as many rows of each."""

    t: Array
    u: Array
    traction: Array
    defect: Array


class Ray(NamedTuple):
    """A way out of a point: codes (m,), coordinates and direction (m + 1,) as in `Walk`."""

    codes: Codes
    x: Array
    dx: Array


class Walk:
    """The present cell with its bounds and linear algebra, the present point, and the direction of travel.

    codes: (m,) piece of every node;  x: (m + 1,) moving coordinates;  dx: (m + 1,) direction, its length has no meaning
    basis: that of another walk on the same body may be taken over
    """

    def __init__(
        self, problem: ParametricProblem, codes: Codes, x: Array, t: float, basis: BasisInverse | None = None
    ) -> None:
        body, graph = problem.body, problem.graph
        self.problem, self.graph, self.m = problem, graph, problem.m
        self.size = float(2.0 ** np.round(np.log2(np.max(np.abs(problem.l_1)) / body.stiffness)))
        self.weight, self.diagonal = problem.c / body.stiffness, np.diagonal(body.A)
        self.slip = problem.traction_scale * self.weight / self.diagonal
        self.usual_tie = self.tie = max(TIE, min(BLURS * body.blur, LARGEST_TIE))
        load, free, k = problem.l_1 / (self.size * body.stiffness), graph.free[codes], self.weight * graph.slope[codes]
        self.codes, self.free, self.kink = codes.copy(), free, graph.kink[codes]
        unit, self.x = np.where(free, 1.0, self.weight), np.append(x, t * self.size)
        self.low, self.high = np.append(graph.low[codes] * unit, -np.inf), np.append(graph.high[codes] * unit, np.inf)
        if basis is None:
            basis = BasisInverse(body.A, load, free, k)
        elif not np.array_equal(basis.load, load):
            basis.reload(load)
        self.basis = basis
        basis.become(free, k)
        self.head()

    def put(self, ray: Ray) -> None:
        """To another point and its pieces, and on its way."""
        self.place(np.arange(self.m), ray.codes)
        self.x = ray.x.copy()
        if ray.dx @ self.dx < 0.0:
            self.turn()

    def place(self, nodes: Index, codes: Codes) -> None:
        """Put nodes on other pieces, at the kinks where they stand; the sense of travel has no meaning any more."""
        for i, code in zip(nodes.tolist(), codes.tolist(), strict=True):
            if code != self.codes[i]:
                self._put(i, code)
        self.basis.become(self.free, self.weight * self.graph.slope[self.codes])
        self.head()

    def go_over(self, i: int, code: int) -> None:
        """Node i goes over to another piece, in the same sense along its graph. Raises SingularCellError."""
        ahead = self.dx[i] * float(self.graph.sense[self.codes[i]]) * float(self.graph.sense[code])
        self._put(i, code)
        self.basis.place(i, bool(self.free[i]), self.weight.item(i) * self.graph.slope.item(code))
        self.basis.settle()
        if self.basis.way[i] * ahead < 0.0:
            self.basis.way *= -1.0
        self.head()

    def _put(self, i: int, code: int) -> None:
        g, old, free, weight = self.graph, self.codes.item(i), self.graph.free.item(code), self.weight.item(i)
        kink = self.kink.item(i) if not self.free[i] else self.x.item(i) if free else g.kink.item(code)
        # onto a vertical side: the traction it begins with is that of the segment the node comes from
        x = kink if free else weight * (g.start.item(old) + g.slope.item(old) * (kink - g.anchor.item(old)))
        unit = 1.0 if free else weight
        low, high = g.low.item(code) * unit, g.high.item(code) * unit
        self.codes[i], self.free[i], self.kink[i] = code, free, g.kink.item(code)
        self.low[i], self.high[i], self.x[i] = low, high, high if high - x < x - low else low

    def head(self) -> None:
        """The direction of the cell; speeds at rounding level are zero."""
        way, fast = self.basis.way, np.abs(self.basis.way)
        self.dx = np.where(fast > STILL * fast.max(), way, 0.0)

    def turn(self) -> None:
        """The other way along the line."""
        self.basis.way *= -1.0
        self.dx = -self.dx

    @property
    def here(self) -> Ray:
        """Where the walk stands, and its direction."""
        return Ray(self.codes.copy(), self.x.copy(), self.dx.copy())

    @property
    def t(self) -> float:
        return self.x.item(self.m) / self.size

    @property
    def u(self) -> Array:
        """(m,) displacements; held nodes sit on their kink bitwise."""
        return np.where(self.free, self.x[:-1], self.kink)

    @property
    def stable(self) -> bool:
        """Strict local minimum: positive definite on the free nodes, nobody inside a down-jump, t not at rest."""
        return self.dx[self.m] != 0.0 and self.basis.negatives == 0 and self.graph.sense[self.codes].min() > 0

    def points(self, x: Array, codes: Codes) -> Points:
        """Points from their coordinates and pieces."""
        p, t = self.problem, x[..., -1] / self.size
        u, traction = self.graph.points(codes, x[..., :-1], self.weight)
        return Points(t, u, traction, p.l_0 + t[..., None] * p.l_1 - u @ p.A_tilde - p.c * traction)

    @property
    def defect(self) -> Array:
        """l̃ − Ãu − ξ at the present point (m,)."""
        return self.points(self.x, self.codes).defect

    @property
    def scale(self) -> Array:
        """(m,) slip and traction at the nodes, in the units of their coordinates."""
        return np.asarray((np.abs(self.u) + self.slip) * np.where(self.free, 1.0, self.diagonal))

    def gaps(self) -> Array:
        """(m,) distance of every node from its nearer bound, relative to slip and traction there."""
        return np.asarray(np.minimum(self.high - self.x, self.x - self.low)[:-1] / self.scale)

    def at_bound(self) -> Index:
        """Nodes that stand exactly on a bound."""
        return np.flatnonzero(((self.x == self.low) | (self.x == self.high))[:-1])

    def snap(self, nodes: Index) -> None:
        """Onto the nearer one of their bounds."""
        x, low, high = self.x[nodes], self.low[nodes], self.high[nodes]
        self.x[nodes] = np.where(high - x < x - low, high, low)

    def reach(self) -> tuple[float, int]:
        """(step to the first bound, inf if none; the coordinate that has it)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = np.maximum((self.high - self.x) / self.dx, (self.low - self.x) / self.dx)
        first = int(steps.argmin())
        if not steps[first] >= 0.0:  # also where a node rests on its bound, 0/0
            steps[self.dx == 0.0] = np.inf
            first = int(steps.argmin())
        return max(0.0, steps.item(first)), first

    def arrive(self, step: float, first: int) -> Index:
        """Advance by `step`; nodes that have reached a bound (or rested on one) are put on it and returned.

        first: the coordinate that comes to its bound first
        """
        self.x += step * self.dx
        self.x[first] = self.high[first] if self.dx[first] > 0.0 else self.low[first]
        at = np.array([first], dtype=np.intp)
        if first == self.m:
            return at[:0]
        gaps = self.gaps()
        if np.count_nonzero(gaps <= DRIFTED * self.tie) < 2:
            return at
        with suppress(SingularCellError):  # are they there, or has the point drifted?
            self.correct(at)
            gaps = self.gaps()
        near = gaps <= self.tie
        near[first] = True
        upper = (self.high - self.x < self.x - self.low)[:-1]
        near &= ~np.where(upper, self.dx[:-1] < 0.0, self.dx[:-1] > 0.0)  # from a bound it has only just left
        self.snap(at := np.flatnonzero(near))
        return at

    def correct(self, at: Index) -> None:
        """One correction of the present point, held where the fastest of the coordinates `at` is, or the fastest of
        all where that is slow; t is held where `at` is t alone."""
        moved, speed = self.basis.moved(self.defect / self.problem.body.stiffness), np.abs(self.dx)
        lead = int(speed.argmax())
        own = int(at[speed[at].argmax()]) if len(at) else lead
        held = own if speed[own] > CRAWLS * speed[lead] or own == self.m else lead
        moved -= self.basis.way * (moved[held] / self.basis.way[held])
        moved[held] = 0.0
        self.x += moved

    def balance(self) -> None:
        """The same, held where nodes are on bounds: one that only bends there may move off it by rounding, one at a
        jump stays on it."""
        g, nodes, x = self.graph, self.at_bound(), self.x.copy()
        self.correct(nodes)
        codes = self.codes[nodes]
        behind = np.where(x[nodes] == self.low[nodes], g.after_low[codes], g.after_high[codes])
        stays = nodes[~(self.free[nodes] & g.free[behind])]
        self.x[stays] = x[stays]

    def straighten(self) -> None:
        """One correction of the direction, by the equations of the cell."""
        way = self.basis.way
        force = np.where(self.free, self.basis.k * way[:-1], way[:-1])
        off = way[self.m] * self.basis.load - self.basis.A @ np.where(self.free, way[:-1], 0.0) - force
        way += self.basis.moved(off)
        self.head()
