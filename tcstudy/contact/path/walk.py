"""A point on the path, the cell it is in, the way to the cell's boundary, and the next cell; and
where a walk begins.

In working units: stiffness divided by its mean diagonal, so that forces c·(ξ/c) and slips have the
same unit, and t times a power of two, τ, so that the load per τ is about 1. `x` (m + 1,) holds the
coordinate of every node that moves in the present cell, u_i of a free node, the force of one on a
vertical side, and τ last: the end of the range of t is the end of its piece. One node at its bound
goes on into the next piece of its graph in the same sense, whatever t does: a fold is nothing
special.

Several at once (ties) are a `Corner`. The cells around it form a cone in which each of these nodes
is on the near side of its kink, where it came from, or on the far one.
  1. All go over together. If the nodes are exchanged by a symmetry of the problem this is always
    the continuation
     (in the symmetric problem it is one event), and so a symmetric branch is kept.
  2. Otherwise each gets its own time of arrival. This is a perturbation of the load for which the
    events come one by
     one; in the cone it need not be small. The perturbed path enters along the present ray, visits
     each cell at most
     once and leaves along another ray, which is a continuation of the unperturbed path. It cannot
     cycle.
"""

from __future__ import annotations

from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.path.basis_inverse import STILL, BasisInverse, SingularCellError
from tcstudy.contact.path.problem import Codes, ParametricProblem
from tcstudy.contact.solution import Acceptance

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

TIE, BLURS, LARGEST_TIE = 1e-12, 64.0, 1e-9
"""Nodes this close to their bound, relative to slip and traction there, reach it together with the
first one, or as close as rounding lets their place be known: so many times ScaledBody.blur, as the
motion is nearly singular where a whole zone reaches its bounds at once; whatever rounding is, nodes
farther than the last have not reached theirs. Nodes at rest stand on their bounds only within the
first."""

DRIFTED = 1e3
"""How many times farther than a tie nodes are looked at again, with the point corrected first."""

CRAWLS = 1e-4
"""A node slower than this part of the fastest one hardly knows its place on the path: a corrected
point is not held where that node has reached its bound, or rounding of its coordinate would move
the point along the path."""


class Ray(NamedTuple):
    """A way out of a point: codes (m,), coordinates and direction (m + 1,) as in `Walk`."""

    codes: Codes
    x: Array
    dx: Array


class Walk:
    """The present cell with its bounds and linear algebra, the present point, and the direction of
    travel.

    codes: (m,) piece of every node;  x: (m + 1,) moving coordinates;  dx: (m + 1,) direction, its length has no meaning
    basis: that of another walk on the same body may be taken over
    """

    def __init__(
        self,
        problem: ParametricProblem,
        codes: Codes,
        x: Array,
        t: float,
        basis: BasisInverse | None = None,
    ) -> None:
        body, graph = problem.body, problem.graph
        self.problem, self.graph, self.m = problem, graph, problem.m
        self.size = float(2.0 ** np.round(np.log2(np.max(np.abs(problem.l_1)) / body.stiffness)))
        self.weight, self.diagonal = problem.c / body.stiffness, np.diagonal(body.A)
        self.slip = problem.traction_scale * self.weight / self.diagonal
        self.usual_tie = self.tie = max(TIE, min(BLURS * body.blur, LARGEST_TIE))
        load, free, k = (
            problem.l_1 / (self.size * body.stiffness),
            graph.free[codes],
            self.weight * graph.slope[codes],
        )
        self.codes, self.free, self.kink = codes.copy(), free, graph.kink[codes]
        unit, self.x = np.where(free, 1.0, self.weight), np.append(x, t * self.size)
        self.low, self.high = (
            np.append(graph.low[codes] * unit, -np.inf),
            np.append(graph.high[codes] * unit, np.inf),
        )
        if basis is None:
            basis = BasisInverse(body.A, load, free, k)
        elif not np.array_equal(basis.load, load):
            basis.load, basis.stale = load, True
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
        """Put nodes on other pieces, at the kinks where they stand; the sense of travel has no
        meaning any more."""
        for i, code in zip(nodes.tolist(), codes.tolist(), strict=True):
            if code != self.codes[i]:
                self._put(i, code)
        self.basis.become(self.free, self.weight * self.graph.slope[self.codes])
        self.head()

    def go_over(self, i: int, code: int) -> None:
        """Node i goes over to another piece, in the same sense along its graph. Raises
        SingularCellError."""
        ahead = self.dx[i] * float(self.graph.sense[self.codes[i]]) * float(self.graph.sense[code])
        self._put(i, code)
        self.basis.place(i, self.free.item(i), self.weight.item(i) * self.graph.slope.item(code))
        self.basis.settle()
        self.head()
        if self.dx[i] * ahead < 0.0:
            self.turn()

    def _put(self, i: int, code: int) -> None:
        g, old, free, weight = (
            self.graph,
            self.codes.item(i),
            self.graph.free.item(code),
            self.weight.item(i),
        )
        kink = (
            self.kink.item(i) if not self.free[i] else self.x.item(i) if free else g.kink.item(code)
        )
        # onto a vertical side: the traction it begins with is that of the segment the node comes
        # from
        x = (
            kink
            if free
            else weight * (g.start.item(old) + g.slope.item(old) * (kink - g.anchor.item(old)))
        )
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
        """Strict local minimum: positive definite on the free nodes, nobody inside a down-jump, t
        not at rest."""
        return (
            self.dx[self.m] != 0.0
            and self.basis.negatives == 0
            and self.graph.sense[self.codes].min() > 0
        )

    def points(self, x: Array, codes: Codes) -> tuple[Array, Array, Array, Array]:
        """t (), u (m,), ξ/c (m,) and l̃ − Ãu − ξ (m,) from coordinates and pieces, or as many rows
        of each.

        What a piece does not have is 0 in its row, so that sums take the place of choices, which
        are slow.
        """
        p, g, t = self.problem, self.graph, x[..., -1] / self.size
        moves = g.free[codes].astype(float)
        u = moves * x[..., :-1] + g.kink[codes]
        on_segment = g.start[codes] + g.slope[codes] * (u - g.anchor[codes])
        traction = on_segment + (1.0 - moves) * (x[..., :-1] / self.weight)
        return t, u, traction, p.l_0 + t[..., None] * p.l_1 - u @ p.A_tilde - p.c * traction

    @property
    def defect(self) -> Array:
        """l̃ − Ãu − ξ at the present point (m,)."""
        return self.points(self.x, self.codes)[3]

    @property
    def scale(self) -> Array:
        """(m,) slip and traction at the nodes, in the units of their coordinates."""
        return np.asarray((np.abs(self.u) + self.slip) * np.where(self.free, 1.0, self.diagonal))

    def gaps(self) -> Array:
        """(m,) distance of every node from its nearer bound, relative to slip and traction
        there."""
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
        """Advance by `step`; nodes that have reached a bound (or rested on one) are put on it and
        returned.

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
        # a node at rest has come no nearer to its bound: to put it there would unbalance the point
        rests = self.dx[:-1] == 0.0
        near = gaps <= np.where(rests, min(self.tie, TIE), self.tie)
        near[first] = True
        upper = (self.high - self.x < self.x - self.low)[:-1]
        near &= ~np.where(
            upper, self.dx[:-1] < 0.0, self.dx[:-1] > 0.0
        )  # from a bound it has only just left
        self.snap(at := np.flatnonzero(near))
        return at

    def correct(self, at: Index) -> None:
        """One correction of the present point, held where the fastest of the coordinates `at` is,
        or the fastest of all where that is slow; t is held where `at` is t alone."""
        moved, speed = self.basis.moved(self.defect / self.problem.body.stiffness), np.abs(self.dx)
        lead = int(speed.argmax())
        own = int(at[speed[at].argmax()]) if len(at) else lead
        held = own if speed[own] > CRAWLS * speed[lead] or own == self.m else lead
        moved -= self.basis.way * (moved[held] / self.basis.way[held])
        moved[held] = 0.0
        self.x += moved

    def balance(self) -> None:
        """The same, held where nodes are on bounds: one that only bends there may move off it by
        rounding, one at a jump stays on it."""
        g, nodes, x = self.graph, self.at_bound(), self.x.copy()
        self.correct(nodes)
        codes = self.codes[nodes]
        behind = np.where(x[nodes] == self.low[nodes], g.after_low[codes], g.after_high[codes])
        stays = nodes[~(self.free[nodes] & g.free[behind])]
        self.x[stays] = x[stays]


ALONE, MOST_TURNS = 3, 12
"""How often the node that wishes otherwise most is moved to the other side of its kink, and until
when all are."""


class Corner:
    """Where nodes (n,) of a walk stand exactly on bounds, all that do unless they are named.

    codes: (2, n) of the near and the far piece;  out: (2, n) sign of the speed that leads into each
    """

    def __init__(self, walk: Walk, nodes: Index | None = None) -> None:
        self.walk, self.nodes = walk, walk.at_bound() if nodes is None else nodes
        g, near = walk.graph, walk.codes[self.nodes]
        upper = walk.x[self.nodes] == walk.high[self.nodes]
        far = np.where(upper, g.after_high[near], g.after_low[near])
        ahead = np.where(upper, 1.0, -1.0)
        self.codes = np.stack([near, far])
        self.out = np.stack([-ahead, ahead * g.sense[near] * g.sense[far]])

    def enter(self, far: Flags) -> Array:
        """To the cell with these nodes on the far side; (n,) speeds at which they leave their kinks
        into it."""
        self.walk.place(self.nodes, np.where(far, self.codes[1], self.codes[0]))
        return np.asarray(np.where(far, self.out[1], self.out[0]) * self.walk.dx[self.nodes])

    def leaves(self, far: Flags) -> bool:
        """Whether the line of that cell leads away from the corner; then that way."""
        try:
            speeds = self.enter(far)
        except SingularCellError:
            return False
        if np.all(speeds <= 0.0):
            self.walk.turn()
            speeds = -speeds
        return bool(np.all(speeds >= 0.0) and np.any(speeds > 0.0))

    def around(self, dx: Array, resting: bool = False) -> None:
        """Rule 2 of the module: follow the perturbed path around the corner until it leaves along a
        ray.

        dx:      along which the path comes in, all nodes on the near side
        resting: begin at a point in the cone instead of far out on that ray; followed in both directions from there
                 the perturbed path gives two ways out
        """
        walk, n, far = self.walk, len(self.nodes), np.zeros(len(self.nodes), dtype=bool)
        self.enter(far)
        if dx @ walk.dx < 0.0:
            walk.turn()
        speeds = -self.out[0] * walk.dx[self.nodes]
        typical = float(np.max(np.abs(speeds), initial=0.0)) or 1.0
        times = 1.0 + np.arange(n) + 0.5 * np.modf(0.6180339887498949 * (1 + np.arange(n)))[0]
        offset = -times * (typical if resting else np.where(speeds > 0.0, speeds, typical))
        for _ in range(1000 + 100 * n):
            speeds = np.where(far, self.out[1], -self.out[0]) * walk.dx[self.nodes]
            hits = np.where(far, speeds < 0.0, speeds > 0.0)
            if not np.any(hits):
                return
            with np.errstate(divide="ignore", invalid="ignore"):
                wait = np.where(hits, np.abs(offset / speeds), np.inf)
            i = int(np.argmin(wait))
            offset = offset + wait[i] * speeds
            offset[i], far[i] = 0.0, not far[i]
            walk.go_over(int(self.nodes[i]), int(self.codes[int(far[i]), i]))
        raise SingularCellError


def cross(walk: Walk, at: Index) -> None:
    """Continue beyond the vertex where the nodes `at` stand on their bounds; raises
    SingularCellError."""
    if len(at) == 1:
        i, code = int(at[0]), walk.codes[at[0]]
        after = walk.graph.after_high if walk.x[i] == walk.high[i] else walk.graph.after_low
        return walk.go_over(i, after.item(code))
    corner, before = Corner(walk, at), walk.dx
    movers = corner.out[0] * before[at] < 0.0
    if not (np.any(movers) and corner.leaves(movers)):
        corner.around(before)
    return None


def rays(walk: Walk) -> tuple[Ray, Ray]:
    """(forward, backward) ways out of the start; forward is the one along which t grows, if only
    one does.

    Where nodes stand on their bounds those ways are preferred on which they all keep together, as a
    symmetric solution wants it. Raises SingularCellError if there is none.
    """
    corner = Corner(walk)
    near = np.zeros(len(corner.nodes), dtype=bool)
    found = [walk.here for far in (near, ~near) if corner.leaves(far)]
    if len(found) < 2:
        corner.enter(near)
        ahead, found = walk.dx, []
        for dx in (ahead, -ahead):
            corner.around(dx, resting=True)
            found.append(walk.here)
    one, other = found
    return (one, other) if one.dx[-1] >= other.dx[-1] else (other, one)


def outward(walk: Walk) -> Ray:
    """The way on which most nodes that stand on bounds of their pieces leave them into these."""
    corner = Corner(walk)
    if np.sum(corner.out[0] * walk.dx[corner.nodes]) < 0.0:
        walk.turn()
    return walk.here


def onward(walk: Walk) -> Ray | None:
    """The stable way on which t grows, from the walk's pieces and those beside them; None if none
    is found.

    Every node that stands on a bound goes on on its piece or on the next one, whichever it then
    moves along. Where some wish otherwise than guessed the one that does most is moved first
    (mostly it alone has turned back, and to move all would upset a whole zone), then all at once
    (the semismooth Newton method for this linear complementarity problem). With a definite matrix
    on all sides there is one answer. Where nodes push each other on (cells longer than the strip is
    high) all at once may go round in a circle: the energy of the rates is descended then.
    """
    corner = Corner(walk)
    far = np.zeros(len(corner.nodes), dtype=bool)
    with suppress(SingularCellError):
        for turn in range(MOST_TURNS + 4 * len(far)):
            against = -corner.enter(far)
            if walk.dx[-1] < 0.0:
                walk.turn()
                against = -against
            wrong = np.flatnonzero(against > 0.0)
            if walk.dx[-1] == 0.0 or not len(wrong):
                return walk.here if walk.stable else None
            alone = np.argmax(against) if turn < ALONE else wrong[-1]
            far[wrong if ALONE <= turn < MOST_TURNS else alone] ^= True
    return None


REMEMBERED = 1e-10
"""Where a node is said to go on from where two pieces meet it stands there, as exactly as a
solution is accepted."""

NEAR = 1e-8
"""A given solution may miss the exact one by this much, relative to slip and traction, or by what
rounding of its residual allows if that is more; it is corrected."""


class NoSolutionError(ValueError):
    """The given point is no solution at the given t."""


def locate(
    problem: ParametricProblem,
    v: Array,
    t: float,
    ways: Array | None = None,
    basis: BasisInverse | None = None,
) -> Walk:
    """A walk at the solution v of parameter t, corrected to rounding.

    ways:  (m,) sense in which nodes that stand where two pieces meet are to go along their graphs, 0 for no wish
    basis: of another walk on the same body, which this one takes over
    Raises NoSolutionError if no solution lies within NEAR of v, or as near as rounding lets v be one, and
    SingularCellError where it is in a cell without a line.
    """
    graph, m, at_t = problem.graph, problem.m, problem.at(t)
    codes, force = _codes(problem, v, t, ways), at_t.xi(v) / problem.body.stiffness
    for _ in range(20):
        walk = Walk(problem, codes, np.where(graph.free[codes], v, force), t, basis)
        basis, tie = walk.basis, walk.tie if ways is None else max(walk.tie, REMEMBERED)
        for _ in range(
            3 if walk.dx[m] != 0.0 else 0
        ):  # where t is at rest no correction at fixed t exists
            walk.correct(np.array([m]))
        outside = walk.gaps() < -tie
        if not np.any(outside):
            break
        after = np.where(
            walk.x[:m] > walk.high[:m], graph.after_high[codes], graph.after_low[codes]
        )
        codes = np.where(outside, after, codes)
    u, residual, rounding = walk.u, at_t.inclusion_residual(v), problem.xi_rounding(t, v)
    moved = np.max(np.abs(u - v) / (np.abs(u) + walk.slip), initial=0.0)
    missed = np.max(np.abs(walk.defect) / problem.c) / problem.traction_scale
    near = (moved <= 1e3 * NEAR or residual <= rounding) and missed <= max(
        NEAR, Acceptance().limit(rounding)
    )
    if not near or np.any(outside):
        raise NoSolutionError(
            f"the start is no solution at t = {t:g}: inclusion residual {residual:.1e}; "
            "solve the problem at this t first and start from its answer"
        )
    walk.snap(np.flatnonzero(walk.gaps() <= tie))
    return walk


def _codes(problem: ParametricProblem, v: Array, t: float, ways: Array | None) -> Codes:
    """First guess of the pieces: on a jump where v_i is near one and ξ_i/c_i in it, else the
    segment of v_i.

    Where two pieces meet, the one in the sense of `ways`, without it that of v_i beside the kink.
    """
    law, graph = problem.law, problem.graph
    row = law.node_index(len(v))  # the graph has 2K + 1 codes where the law has K + 1 pieces
    codes = (2 * law.piece(v) - row).astype(np.int32)
    if not law.kinks.size:
        return codes
    near = law.nearest_kink(v)
    kink, (left, right) = law.kink(near), law.limits(near)
    slip, margin = (
        problem.traction_scale * problem.c / np.diagonal(problem.A_tilde),
        NEAR * problem.traction_scale,
    )
    on = np.isfinite(kink) & (np.abs(v - kink) <= NEAR * (np.abs(v) + slip))
    side = np.where(on, 2 * near + 1 - row, codes).astype(np.int32)
    jumps = graph.after_high[side - 1] == side  # a side that only bends is passed over
    height = np.abs(right - left)
    along = np.sign(right - left) * (problem.at(t).xi(v) / problem.c - left)  # from 0 to the height
    way = np.sign(v - kink) if ways is None else np.where(ways < 0.0, -1.0, 1.0)
    to_left = np.where(jumps, (along < -margin) | ((along <= margin) & (way < 0.0)), way < 0.0)
    to_right = np.where(
        jumps, (along > height + margin) | ((along >= height - margin) & (way > 0.0)), way >= 0.0
    )
    return np.where(
        on, np.where(to_left, side - 1, np.where(to_right, side + 1, side)), codes
    ).astype(np.int32)
