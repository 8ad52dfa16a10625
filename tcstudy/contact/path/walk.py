"""A point on the path, the cell it is in, the way to the cell's boundary, and the next cell.

In working units: stiffness divided by its mean diagonal, so that forces c·(ξ/c) and slips have the same unit, and t
times a power of two, τ, so that the load per τ is about 1. `x` (m + 1,) holds the coordinate of every node that moves
in the present cell, u_i of a free node, the force of one on a vertical side, and τ last: the end of the range of t is
the end of its piece.

One node at its bound goes on into the next piece of its graph in the same sense, whatever t does: a fold is nothing
special. Several at once (ties): the cells around the vertex form a cone in which each tied node is on the near side of
its kink, where it came from, or on the far one.
  1. All go over together. If the nodes are exchanged by a symmetry of the problem this is always the continuation
     (in the symmetric problem it is one event), and so a symmetric branch is kept.
  2. Otherwise each tied node gets its own time of arrival. This is a perturbation of the load for which the events
     come one by one; in the cone it need not be small. The perturbed path enters along the present ray, visits each
     cell at most once and leaves along another ray, which is a continuation of the unperturbed path. It cannot cycle.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.path.basis_inverse import STILL, BasisInverse, SingularCellError
from tcstudy.contact.path.problem import LawGraph, ParametricProblem

Array = NDArray[np.float64]
Codes = NDArray[np.int32]
Index = NDArray[np.intp]

TIE = 1e-12
"""Nodes this close to their bound, relative to slip and traction there, reach it together with the first one, or as
close as rounding of the problem lets their place be known (ScaledBody.blur)."""

BLURS = 64.0
"""Where a whole zone reaches its bounds at once its motion is nearly singular, and rounding that much larger."""

LARGEST_TIE = 1e-9
"""Whatever rounding is, nodes farther from their bound have not reached it."""

DRIFTED = 1e3
"""How many times farther than a tie nodes are looked at again, with the point corrected first."""

SLOW = 1e-4
"""A node slower than this part of the fastest one hardly knows its place on the path: a corrected point is not held
where that node has reached its bound, or rounding of its coordinate would move the point along the path."""


@dataclass(frozen=True)
class Corner:
    """n nodes where two pieces of their graphs meet.

    nodes: (n,);  codes: (2, n) of the near and the far piece;  out: (2, n) sign of the speed that leads into each
    """

    nodes: Index
    codes: Codes
    out: Array

    def on(self, far: NDArray[np.bool_]) -> tuple[Codes, Array]:
        """(codes, out) (n,) with these nodes on the far side, the others on the near one."""
        return np.where(far, self.codes[1], self.codes[0]), np.where(far, self.out[1], self.out[0])


class Walk:
    """The present cell with its bounds and linear algebra, the present point, and the direction of travel.

    codes: (m,) piece of every node;  x: (m + 1,) moving coordinates;  dx: (m + 1,) direction, its length has no meaning
    basis: that of another walk on the same body may be taken over
    """

    def __init__(
        self, problem: ParametricProblem, codes: Codes, x: Array, t: float, basis: BasisInverse | None = None
    ) -> None:
        body = problem.body
        self.problem, self.stiffness, self.m = problem, body.stiffness, problem.m
        self.graph: LawGraph = problem.graph
        self.size = float(2.0 ** np.round(np.log2(np.max(np.abs(problem.l_1)) / body.stiffness)))
        self.load, self.weight = problem.l_1 / (self.size * body.stiffness), problem.c / body.stiffness
        self.diagonal, self.traction = np.diagonal(body.A), problem.traction_scale
        self.slip = self.traction * self.weight / self.diagonal
        self.usual_tie = self.tie = max(TIE, min(BLURS * body.blur, LARGEST_TIE))
        self.range = np.array([-np.inf, np.inf])
        free, k = self.graph.free[codes], self.weight * self.graph.slope[codes]
        if basis is None:
            basis = BasisInverse(body.A, self.load, free, k)
        elif not np.array_equal(basis.load, self.load):
            basis.reload(self.load)
        self.basis = basis
        self.put(codes, np.append(x, t * self.size))

    def put(self, codes: Codes, x: Array) -> None:
        """To another point and its pieces."""
        graph = self.graph
        self.codes, self.x = codes.copy(), x.copy()
        self.free, self.kink = graph.free[codes], graph.kink[codes]
        unit, self.own = np.where(self.free, 1.0, self.weight), np.where(self.free, 1.0, self.diagonal)
        ends = self.range * self.size
        self.low, self.high = np.append(graph.low[codes] * unit, ends[0]), np.append(graph.high[codes] * unit, ends[1])
        self.basis.become(self.free, self.weight * graph.slope[codes])
        self._head()

    def place(self, nodes: Index, codes: Codes) -> None:
        """Put nodes on other pieces, at the kinks where they stand; the sense of travel has no meaning any more."""
        for i, code in zip(nodes.tolist(), codes.tolist(), strict=True):
            if code != self.codes[i]:
                self._put(i, code)
        self.basis.become(self.free, self.weight * self.graph.slope[self.codes])
        self._head()

    def go_over(self, i: int, code: int) -> None:
        """Node i goes over to another piece, in the same sense along its graph. Raises SingularCellError."""
        sense = self.graph.sense
        turn = float(sense[self.codes[i]]) * float(sense[code])
        ahead = turn * self.dx[i]
        self._put(i, code)
        self.basis.place(i, bool(self.free[i]), self.weight.item(i) * self.graph.slope.item(code))
        if self.basis.stale:
            self.basis.settle()
            turn = self.basis.way[i] * ahead
        if turn < 0.0:
            self.basis.way *= -1.0
        self._head()

    def _put(self, i: int, code: int) -> None:
        g, old, free, weight = self.graph, self.codes.item(i), self.graph.free.item(code), self.weight.item(i)
        kink = self.kink.item(i) if not self.free[i] else self.x.item(i) if free else g.kink.item(code)
        # onto a vertical side: the traction it begins with is that of the segment the node comes from
        x = kink if free else weight * (g.start.item(old) + g.slope.item(old) * (kink - g.anchor.item(old)))
        unit, own = (1.0, 1.0) if free else (weight, self.diagonal.item(i))
        low, high = g.low.item(code) * unit, g.high.item(code) * unit
        self.codes[i], self.free[i], self.kink[i], self.own[i] = code, free, g.kink.item(code), own
        self.low[i], self.high[i], self.x[i] = low, high, high if high - x < x - low else low

    def _head(self) -> None:
        """The direction of the cell; speeds at rounding level are zero."""
        way = self.basis.way
        fast = np.abs(way)
        self.dx = np.where(fast > STILL * fast.item(fast.argmax()), way, 0.0)

    def turn(self) -> None:
        """The other way along the line."""
        self.basis.way *= -1.0
        self.dx = -self.dx

    def along(self, dx: Array) -> None:
        """In the sense of another direction."""
        if dx @ self.dx < 0.0:
            self.turn()

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

    @property
    def at_bound(self) -> Index:
        """Nodes that stand exactly on a bound."""
        return np.flatnonzero(((self.x == self.low) | (self.x == self.high))[:-1])

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
        at = np.flatnonzero(near)
        self.x[at] = np.where(upper[at], self.high[at], self.low[at])
        return at

    def gaps(self) -> Array:
        """(m,) distance of every node from its nearer bound, relative to slip and traction there."""
        return np.asarray(np.minimum(self.high - self.x, self.x - self.low)[:-1] / self.scale)

    @property
    def scale(self) -> Array:
        """(m,) slip and traction at the nodes, in the units of their coordinates."""
        return np.asarray((np.abs(self.u) + self.slip) * self.own)

    def defect(self) -> Array:
        """l̃ − Ãu − ξ at the present point, working units (m,)."""
        p, (u, traction) = self.problem, self.graph.points(self.codes, self.x[:-1], self.weight)
        return (p.load(self.t) - p.A_tilde @ u - p.c * traction) / self.stiffness

    def residual(self) -> float:
        """Largest defect per length, relative to the scale of b."""
        return float(np.max(np.abs(self.defect()) / self.weight)) / self.traction

    def correct(self, at: Index) -> None:
        """One correction of the present point, held where the fastest of the coordinates `at` is, or the fastest of
        all where that is slow; t is held where `at` is t alone."""
        moved, speed = self.basis.moved(self.defect()), np.abs(self.dx)
        lead = int(speed.argmax())
        own = int(at[speed[at].argmax()]) if len(at) else lead
        held = own if speed[own] > SLOW * speed[lead] or own == self.m else lead
        moved -= self.basis.way * (moved[held] / self.basis.way[held])
        moved[held] = 0.0
        self.x += moved

    def balance(self) -> None:
        """The same, held where nodes are on bounds: one that only bends there may move off it by rounding, one at a
        jump stays on it."""
        g, nodes, x = self.graph, self.at_bound, self.x.copy()
        self.correct(nodes)
        codes = self.codes[nodes]
        behind = np.where(x[nodes] == self.low[nodes], g.after_low[codes], g.after_high[codes])
        stays = nodes[~(self.free[nodes] & g.free[behind])]
        self.x[stays] = x[stays]

    def straighten(self) -> None:
        """One correction of the direction, by the equations of the cell."""
        way = self.basis.way
        force = np.where(self.free, self.basis.k * way[:-1], way[:-1])
        off = way[self.m] * self.load - self.basis.A @ np.where(self.free, way[:-1], 0.0) - force
        way += self.basis.moved(off)
        self._head()

    def corner(self, nodes: Index) -> Corner:
        """That at which these nodes, all exactly on a bound, stand."""
        g, near = self.graph, self.codes[nodes]
        upper = self.x[nodes] == self.high[nodes]
        far = np.where(upper, g.after_high[near], g.after_low[near]).astype(np.int32)
        ahead = np.where(upper, 1.0, -1.0)
        return Corner(nodes, np.stack([near, far]), np.stack([-ahead, ahead * g.sense[near] * g.sense[far]]))

    def leaves(self, c: Corner, far: NDArray[np.bool_]) -> bool:
        """Whether the line of the cell with these nodes on the far side leads away from the corner; then that way."""
        codes, out = c.on(far)
        try:
            self.place(c.nodes, codes)
        except SingularCellError:
            return False
        out = out * self.dx[c.nodes]
        if np.all(out <= 0.0):
            self.turn()
            out = -out
        return bool(np.all(out >= 0.0) and np.any(out > 0.0))

    def cross(self, at: Index) -> None:
        """Continue beyond the vertex where the nodes `at` stand on their bounds; raises SingularCellError."""
        if len(at) == 1:
            i, code = int(at[0]), self.codes.item(at[0])
            after = self.graph.after_high if self.x[i] == self.high[i] else self.graph.after_low
            return self.go_over(i, after.item(code))
        c = self.corner(at)
        before, movers = self.dx, c.out[0] * self.dx[at] < 0.0
        if np.any(movers) and self.leaves(c, movers):
            return None
        self.place(c.nodes, c.codes[0])
        self.along(before)
        return self.around(c)

    def around(self, c: Corner, resting: bool = False) -> None:
        """Rule 2 of the module: follow the perturbed path around the vertex until it leaves along a ray.

        resting: begin at a point in the cone instead of far out on the ray along which the path comes in; followed in
                 both directions from there the perturbed path gives two ways out of the vertex
        """
        n = len(c.nodes)
        far = np.zeros(n, dtype=bool)
        speeds = -c.out[0] * self.dx[c.nodes]
        typical = float(np.max(np.abs(speeds), initial=0.0)) or 1.0
        times = 1.0 + np.arange(n) + 0.5 * np.modf(0.6180339887498949 * (1 + np.arange(n)))[0]
        offset = -times * (typical if resting else np.where(speeds > 0.0, speeds, typical))
        for _ in range(1000 + 100 * n):
            speeds = np.where(far, c.out[1], -c.out[0]) * self.dx[c.nodes]
            hits = np.where(far, speeds < 0.0, speeds > 0.0)
            if not np.any(hits):
                return
            with np.errstate(divide="ignore", invalid="ignore"):
                wait = np.where(hits, np.abs(offset / speeds), np.inf)
            i = int(np.argmin(wait))
            offset = offset + wait[i] * speeds
            offset[i], far[i] = 0.0, not far[i]
            self.go_over(int(c.nodes[i]), int(c.codes[int(far[i]), i]))
        raise SingularCellError
