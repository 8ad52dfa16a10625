"""A walk along a path: a point, its cell, the way to the cell's boundary, and the next cell.

In working units: stiffness is divided by its mean diagonal, so that forces c·(ξ/c) and slips have
the same unit, and t is multiplied by a power of two, τ = `t_unit` t, so that the load per τ is
about 1. `x` (m + 1,) holds the coordinate of every node that moves in the present cell (u_i of a
free node, the force of a held one, which is on a vertical side), and τ last. The end of the range
of t is the end of τ's piece. One node at its bound goes on into the next piece of its graph in the
same sense, whatever t does: a fold is nothing special.

Several nodes at once (ties) are a `Corner`. The cells around it form a cone in which each of these
nodes is on the near side of its kink, where it came from, or on the far one.

1. All go over together. If the nodes are exchanged by a symmetry of the problem this is always the
   continuation (in the symmetric problem it is one event), and so a symmetric branch is kept.
2. Otherwise each gets its own time of arrival. This is a perturbation of the load for which the
   events come one by one; in the cone it need not be small. The perturbed path enters along the
   present ray, visits each cell at most once and leaves along another ray, which is a continuation
   of the unperturbed path. It cannot cycle.
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

MIN_TIE = 1e-12
"""Nodes within this distance of their bounds reach them together with the first one.

Relative to slip and traction there. Nodes at rest stand on their bounds only within this.
"""

TIE_ROUNDINGS = 64.0
"""The same in units of the rounding error of a displacement (ScaledBody.blur), if larger.

The motion is nearly singular where a whole zone reaches its bounds at once.
"""

MAX_TIE = 1e-9
"""Upper limit of both: nodes farther than this have not reached their bounds."""

TIE_CHECK = 1e3
"""Nodes within this many ties of their bounds are looked at again, once the point is corrected."""

MIN_HOLDING_SPEED = 1e-4
"""A node slower than this part of the fastest does not hold a corrected point where it stands.

Rounding of its coordinate would move the point along the path.
"""


class Ray(NamedTuple):
    """A way out of a point: codes (m,), coordinates and direction (m + 1,) as in `Walk`."""

    codes: Codes
    x: Array
    dx: Array


class Walk:
    """The present cell with its bounds and linear algebra, the present point, and the direction.

    codes: (m,) piece of every node
    x:     (m + 1,) moving coordinates
    dx:    (m + 1,) direction of travel; its length has no meaning
    basis: may be taken over from another walk on the same body
    """

    def __init__(
        self,
        problem: ParametricProblem,
        codes: Codes,
        x: Array,
        t: float,
        basis: BasisInverse | None = None,
    ) -> None:
        body = problem.body
        graph = problem.graph
        self.problem = problem
        self.graph = graph
        self.m = problem.m
        load_per_t = np.max(np.abs(problem.l_1)) / body.stiffness
        self.t_unit = float(2.0 ** np.round(np.log2(load_per_t)))
        self.weight = problem.c / body.stiffness  # from a traction to a force in working units
        self.diagonal = np.diagonal(body.A)
        self.slip_scale = problem.traction_scale * self.weight / self.diagonal
        self.usual_tie = max(MIN_TIE, min(TIE_ROUNDINGS * body.blur, MAX_TIE))
        self.tie = self.usual_tie

        self.codes = codes.copy()
        self.free = graph.free[codes]
        self.kink = graph.kink[codes]
        self.x = np.append(x, t * self.t_unit)
        unit = np.where(self.free, 1.0, self.weight)
        self.low = np.append(graph.low[codes] * unit, -np.inf)
        self.high = np.append(graph.high[codes] * unit, np.inf)

        load = problem.l_1 / (self.t_unit * body.stiffness)
        k = self.weight * graph.slope[codes]
        if basis is None:
            basis = BasisInverse(body.A, load, self.free, k)
        elif not np.array_equal(basis.load, load):
            basis.load = load
            basis.stale = True
        self.basis = basis
        basis.become(self.free, k)
        self._take_direction()

    def go_to(self, ray: Ray) -> None:
        """Go to another point and its pieces, in its direction."""
        self.place(np.arange(self.m), ray.codes)
        self.x = ray.x.copy()
        if ray.dx @ self.dx < 0.0:
            self.turn()

    def place(self, nodes: Index, codes: Codes) -> None:
        """Put nodes on other pieces, at the kinks where they stand.

        The sense of travel has no meaning afterwards.
        """
        for i, code in zip(nodes.tolist(), codes.tolist(), strict=True):
            if code != self.codes[i]:
                self._put(i, code)
        self.basis.become(self.free, self.weight * self.graph.slope[self.codes])
        self._take_direction()

    def go_over(self, i: int, code: int) -> None:
        """Let node i go over to another piece, in the same sense along its graph.

        Raises SingularCellError if no direction exists there.
        """
        sense_before = float(self.graph.sense[self.codes[i]])
        speed = self.dx[i] * sense_before * float(self.graph.sense[code])
        self._put(i, code)
        self.basis.place(i, self.free.item(i), self.weight.item(i) * self.graph.slope.item(code))
        self.basis.settle()
        self._take_direction()
        if self.dx[i] * speed < 0.0:
            self.turn()

    def _put(self, i: int, code: int) -> None:
        """Put node i on another piece, at the bound that is nearer to where it stands."""
        graph = self.graph
        free = graph.free.item(code)
        weight = self.weight.item(i)
        unit = 1.0 if free else weight
        low = graph.low.item(code) * unit
        high = graph.high.item(code) * unit
        if not self.free[i]:
            kink = self.kink.item(i)
        elif free:
            kink = self.x.item(i)
        else:
            kink = graph.kink.item(code)
        if free:
            x = kink
        else:
            # a vertical side begins with the traction of the segment that the node comes from
            old = self.codes.item(i)
            on_segment = graph.slope.item(old) * (kink - graph.anchor.item(old))
            x = weight * (graph.start.item(old) + on_segment)
        self.codes[i] = code
        self.free[i] = free
        self.kink[i] = graph.kink.item(code)
        self.low[i] = low
        self.high[i] = high
        self.x[i] = high if high - x < x - low else low

    def _take_direction(self) -> None:
        """Take the direction of the cell; speeds at rounding level are zero."""
        direction = self.basis.direction
        speed = np.abs(direction)
        self.dx = np.where(speed > STILL * speed.max(), direction, 0.0)

    def turn(self) -> None:
        """Turn to the other way along the line."""
        self.basis.direction *= -1.0
        self.dx = -self.dx

    @property
    def here(self) -> Ray:
        """Where the walk stands, and its direction."""
        return Ray(self.codes.copy(), self.x.copy(), self.dx.copy())

    @property
    def t(self) -> float:
        return self.x.item(self.m) / self.t_unit

    @property
    def u(self) -> Array:
        """(m,) displacements; held nodes sit on their kink bitwise."""
        return np.where(self.free, self.x[:-1], self.kink)

    @property
    def stable(self) -> bool:
        """Whether the cell's solutions are strict local minima.

        H is positive definite on the free nodes, no node is inside a down-jump, and t moves.
        """
        return (
            self.dx[self.m] != 0.0
            and self.basis.negatives == 0
            and self.graph.sense[self.codes].min() > 0
        )

    def points(self, x: Array, codes: Codes) -> tuple[Array, Array, Array, Array]:
        """Return t (), u (m,), ξ/c (m,) and l̃ − Ãu − ξ (m,) of coordinates and pieces.

        Many rows of coordinates and pieces give as many rows of each. What a piece does not have is
        0 in its row, so that sums take the place of choices, which are slow.
        """
        problem = self.problem
        graph = self.graph
        t = x[..., -1] / self.t_unit
        moves = graph.free[codes].astype(float)
        u = moves * x[..., :-1] + graph.kink[codes]
        on_segment = graph.start[codes] + graph.slope[codes] * (u - graph.anchor[codes])
        traction = on_segment + (1.0 - moves) * (x[..., :-1] / self.weight)
        load = problem.l_0 + t[..., None] * problem.l_1
        defect = load - u @ problem.A_tilde - problem.c * traction
        return t, u, traction, defect

    @property
    def defect(self) -> Array:
        """(m,) l̃ − Ãu − ξ at the present point."""
        return self.points(self.x, self.codes)[3]

    @property
    def scale(self) -> Array:
        """(m,) slip and traction at the nodes, in the units of their coordinates."""
        slip = np.abs(self.u) + self.slip_scale
        return np.asarray(slip * np.where(self.free, 1.0, self.diagonal))

    def gaps(self) -> Array:
        """Return (m,) the distance of every node from its nearer bound, relative to `scale`."""
        distance = np.minimum(self.high - self.x, self.x - self.low)
        return np.asarray(distance[:-1] / self.scale)

    def at_bound(self) -> Index:
        """Return the nodes that stand exactly on a bound."""
        on_bound = (self.x == self.low) | (self.x == self.high)
        return np.flatnonzero(on_bound[:-1])

    def snap(self, nodes: Index) -> None:
        """Put nodes onto the nearer one of their bounds."""
        x = self.x[nodes]
        low = self.low[nodes]
        high = self.high[nodes]
        self.x[nodes] = np.where(high - x < x - low, high, low)

    def reach(self) -> tuple[float, int]:
        """Return the step to the first bound, inf without one, and the coordinate that has it."""
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = np.maximum((self.high - self.x) / self.dx, (self.low - self.x) / self.dx)
        first = int(steps.argmin())
        if not steps[first] >= 0.0:  # also where a node rests on its bound, 0/0
            steps[self.dx == 0.0] = np.inf
            first = int(steps.argmin())
        return max(0.0, steps.item(first)), first

    def arrive(self, step: float, first: int) -> Index:
        """Advance by `step`; put the nodes that have reached a bound (or rested on one) on it.

        first: the coordinate that comes to its bound first
        Returns these nodes.
        """
        self.x += step * self.dx
        self.x[first] = self.high[first] if self.dx[first] > 0.0 else self.low[first]
        arrived = np.array([first], dtype=np.intp)
        if first == self.m:
            return arrived[:0]
        gaps = self.gaps()
        if np.count_nonzero(gaps <= TIE_CHECK * self.tie) < 2:
            return arrived
        with suppress(SingularCellError):  # are they there, or has the point drifted?
            self.correct(arrived)
            gaps = self.gaps()
        # a node at rest has come no nearer to its bound: to put it there would unbalance the point
        rests = self.dx[:-1] == 0.0
        near = gaps <= np.where(rests, min(self.tie, MIN_TIE), self.tie)
        near[first] = True
        is_nearer_high = (self.high - self.x < self.x - self.low)[:-1]
        has_just_left = np.where(is_nearer_high, self.dx[:-1] < 0.0, self.dx[:-1] > 0.0)
        arrived = np.flatnonzero(near & ~has_just_left)
        self.snap(arrived)
        return arrived

    def correct(self, nodes: Index) -> None:
        """Correct the present point once, and hold it where the fastest of `nodes` is.

        It is held where the fastest of all coordinates is if that node is slow. Only t (node m) is
        held however slow it is.
        """
        change = self.basis.correction(self.defect / self.problem.body.stiffness)
        speed = np.abs(self.dx)
        fastest = int(speed.argmax())
        held = fastest
        if len(nodes):
            candidate = int(nodes[speed[nodes].argmax()])
            is_fast = speed[candidate] > MIN_HOLDING_SPEED * speed[fastest]
            if is_fast or candidate == self.m:
                held = candidate
        direction = self.basis.direction
        change -= direction * (change[held] / direction[held])
        change[held] = 0.0
        self.x += change

    def balance(self) -> None:
        """Correct the present point once, and keep nodes on the jumps whose bounds they stand on.

        A node on a bound where its graph only bends may move off it by rounding.
        """
        graph = self.graph
        nodes = self.at_bound()
        x = self.x.copy()
        self.correct(nodes)
        codes = self.codes[nodes]
        is_low = x[nodes] == self.low[nodes]
        next_codes = np.where(is_low, graph.after_low[codes], graph.after_high[codes])
        stays = nodes[~(self.free[nodes] & graph.free[next_codes])]
        self.x[stays] = x[stays]


SINGLE_MOVES = 3
"""How often only the node that disagrees most is moved to the other side of its kink."""

LAST_JOINT_MOVE = 12
"""Until this move all nodes that disagree are moved at once; after it, one at a time again."""


class Corner:
    """Nodes (n,) of a walk that stand exactly on bounds: all that do unless they are named.

    codes: (2, n) of the near and the far piece
    out:   (2, n) sign of the speed that leads into each
    """

    def __init__(self, walk: Walk, nodes: Index | None = None) -> None:
        self.walk = walk
        self.nodes = walk.at_bound() if nodes is None else nodes
        graph = walk.graph
        near = walk.codes[self.nodes]
        is_high = walk.x[self.nodes] == walk.high[self.nodes]
        far = np.where(is_high, graph.after_high[near], graph.after_low[near])
        ahead = np.where(is_high, 1.0, -1.0)
        self.codes = np.stack([near, far])
        self.out = np.stack([-ahead, ahead * graph.sense[near] * graph.sense[far]])

    def enter(self, is_far: Flags) -> Array:
        """Go to the cell with these nodes on the far side.

        Returns (n,) the speeds at which they leave their kinks into it.
        """
        self.walk.place(self.nodes, np.where(is_far, self.codes[1], self.codes[0]))
        out = np.where(is_far, self.out[1], self.out[0])
        return np.asarray(out * self.walk.dx[self.nodes])

    def leaves(self, is_far: Flags) -> bool:
        """Return whether the line of that cell leads away from the corner; if so, face that way."""
        try:
            speeds = self.enter(is_far)
        except SingularCellError:
            return False
        if np.all(speeds <= 0.0):
            self.walk.turn()
            speeds = -speeds
        return bool(np.all(speeds >= 0.0) and np.any(speeds > 0.0))

    def go_around(self, dx: Array, from_cone: bool = False) -> None:
        """Follow the perturbed path around the corner until it leaves along a ray (rule 2).

        dx:        direction in which the path comes in, all nodes on the near side
        from_cone: begin at a point in the cone instead of far out on that ray; the perturbed path
                   followed from there in both directions gives two ways out
        """
        walk = self.walk
        n = len(self.nodes)
        is_far = np.zeros(n, dtype=bool)
        self.enter(is_far)
        if dx @ walk.dx < 0.0:
            walk.turn()
        speeds = -self.out[0] * walk.dx[self.nodes]
        typical_speed = float(np.max(np.abs(speeds), initial=0.0)) or 1.0
        golden_shares = np.modf(0.6180339887498949 * (1 + np.arange(n)))[0]
        arrival_times = 1.0 + np.arange(n) + 0.5 * golden_shares
        if from_cone:
            distance = -arrival_times * typical_speed
        else:
            distance = -arrival_times * np.where(speeds > 0.0, speeds, typical_speed)
        for _ in range(1000 + 100 * n):
            speeds = np.where(is_far, self.out[1], -self.out[0]) * walk.dx[self.nodes]
            approaches = np.where(is_far, speeds < 0.0, speeds > 0.0)
            if not np.any(approaches):
                return
            with np.errstate(divide="ignore", invalid="ignore"):
                wait = np.where(approaches, np.abs(distance / speeds), np.inf)
            i = int(np.argmin(wait))
            distance = distance + wait[i] * speeds
            distance[i] = 0.0
            is_far[i] = not is_far[i]
            walk.go_over(int(self.nodes[i]), int(self.codes[int(is_far[i]), i]))
        raise SingularCellError


def cross(walk: Walk, nodes: Index) -> None:
    """Continue beyond the vertex where these nodes stand on their bounds.

    Raises SingularCellError if no direction exists there.
    """
    if len(nodes) == 1:
        i = int(nodes[0])
        is_high = walk.x[i] == walk.high[i]
        next_codes = walk.graph.after_high if is_high else walk.graph.after_low
        walk.go_over(i, next_codes.item(walk.codes[i]))
        return
    corner = Corner(walk, nodes)
    dx_before = walk.dx
    movers = corner.out[0] * dx_before[nodes] < 0.0
    if not (np.any(movers) and corner.leaves(movers)):
        corner.go_around(dx_before)


def rays(walk: Walk) -> tuple[Ray, Ray]:
    """Return the forward and the backward way out of the start.

    Along the forward one t grows, if it grows along only one. Where nodes stand on their bounds,
    ways on which they all keep together come first, as a symmetric solution wants it. Raises
    SingularCellError if there is no way out.
    """
    corner = Corner(walk)
    all_near = np.zeros(len(corner.nodes), dtype=bool)
    exits = [walk.here for is_far in (all_near, ~all_near) if corner.leaves(is_far)]
    if len(exits) < 2:
        corner.enter(all_near)
        ahead = walk.dx
        exits = []
        for dx in (ahead, -ahead):
            corner.go_around(dx, from_cone=True)
            exits.append(walk.here)
    first, second = exits
    return (first, second) if first.dx[-1] >= second.dx[-1] else (second, first)


def outward(walk: Walk) -> Ray:
    """Return the way on which most nodes at bounds of their pieces leave them into these."""
    corner = Corner(walk)
    if np.sum(corner.out[0] * walk.dx[corner.nodes]) < 0.0:
        walk.turn()
    return walk.here


def onward(walk: Walk) -> Ray | None:
    """Return the stable way on which t grows, on the walk's pieces or those beside them, or None.

    Every node that stands on a bound goes on on its piece or on the next one, whichever it then
    moves along. Where some disagree with the guess, the one that does most is moved first (mostly
    it alone has turned back, and to move all would upset a whole zone), then all at once (the
    semismooth Newton method for this linear complementarity problem). If the matrix is definite on
    all sides there is one answer. Where nodes push each other on (cells longer than the strip is
    high) all at once may go round in a circle: then the last one is moved, which descends.
    """
    corner = Corner(walk)
    is_far = np.zeros(len(corner.nodes), dtype=bool)
    with suppress(SingularCellError):
        for move in range(LAST_JOINT_MOVE + 4 * len(is_far)):
            speed_back = -corner.enter(is_far)
            if walk.dx[-1] < 0.0:
                walk.turn()
                speed_back = -speed_back
            disagree = np.flatnonzero(speed_back > 0.0)
            if walk.dx[-1] == 0.0 or not len(disagree):
                return walk.here if walk.stable else None
            if move < SINGLE_MOVES:
                is_far[np.argmax(speed_back)] ^= True
            elif move < LAST_JOINT_MOVE:
                is_far[disagree] ^= True
            else:
                is_far[disagree[-1]] ^= True
    return None


REMEMBERED_TIE = 1e-10
"""Nodes this close to where two pieces meet stand there if the sense in which they go on is given.

As exactly as a solution is accepted; relative as MIN_TIE.
"""

MAX_MISS = 1e-8
"""A given solution may miss the exact one by this much, and is corrected.

Relative to slip and traction there. It may miss it by what rounding of its residual allows, if that
is more.
"""

MAX_SHIFT = 1e3 * MAX_MISS
"""The correction may move a node by this much, relative to its slip."""

MAX_RELOCATIONS = 20
"""How often nodes that a correction moves beyond their pieces are put on the next ones."""


class NoSolutionError(ValueError):
    """The given point is no solution at the given t."""


def locate(
    problem: ParametricProblem,
    v: Array,
    t: float,
    senses: Array | None = None,
    basis: BasisInverse | None = None,
) -> Walk:
    """Return a walk at the solution v of parameter t, corrected to rounding.

    senses: (m,) sense in which nodes that stand where two pieces meet go on along their graphs, 0
            where it is free
    basis:  taken over from another walk on the same body
    Raises NoSolutionError if no solution lies within MAX_MISS of v, or as near as rounding lets v
    be one, and SingularCellError where it is in a cell without a line.
    """
    graph = problem.graph
    m = problem.m
    at_t = problem.at(t)
    codes = _first_codes(problem, v, t, senses)
    force = at_t.xi(v) / problem.body.stiffness
    for _ in range(MAX_RELOCATIONS):
        walk = Walk(problem, codes, np.where(graph.free[codes], v, force), t, basis)
        basis = walk.basis
        tie = walk.tie if senses is None else max(walk.tie, REMEMBERED_TIE)
        if walk.dx[m] != 0.0:  # where t is at rest no correction at fixed t exists
            for _ in range(3):
                walk.correct(np.array([m]))
        is_outside = walk.gaps() < -tie
        if not np.any(is_outside):
            break
        is_above = walk.x[:m] > walk.high[:m]
        next_codes = np.where(is_above, graph.after_high[codes], graph.after_low[codes])
        codes = np.where(is_outside, next_codes, codes)
    u = walk.u
    residual = at_t.inclusion_residual(v)
    rounding = problem.xi_rounding(t, v)
    shift = np.max(np.abs(u - v) / (np.abs(u) + walk.slip_scale), initial=0.0)
    miss = np.max(np.abs(walk.defect) / problem.c) / problem.traction_scale
    is_near = shift <= MAX_SHIFT or residual <= rounding
    is_balanced = miss <= max(MAX_MISS, Acceptance().limit(rounding))
    if not (is_near and is_balanced) or np.any(is_outside):
        raise NoSolutionError(
            f"the start is no solution at t = {t:g}: inclusion residual {residual:.1e}; "
            "solve the problem at this t first and start from its answer"
        )
    walk.snap(np.flatnonzero(walk.gaps() <= tie))
    return walk


def _first_codes(problem: ParametricProblem, v: Array, t: float, senses: Array | None) -> Codes:
    """Return a first guess of the pieces.

    A node is on a jump if v_i is near one and ξ_i/c_i in it, else on the segment of v_i. Where two
    pieces meet it is on the one in the sense of `senses`, else on that of v_i beside the kink.
    """
    law = problem.law
    graph = problem.graph
    row = law.node_index(len(v))  # the graph has 2K + 1 codes where the law has K + 1 pieces
    codes = (2 * law.piece(v) - row).astype(np.int32)
    if not law.kinks.size:
        return codes
    nearest = law.nearest_kink(v)
    kink = law.kink(nearest)
    b_left, b_right = law.limits(nearest)
    slip_scale = problem.traction_scale * problem.c / np.diagonal(problem.A_tilde)
    is_on_kink = np.isfinite(kink) & (np.abs(v - kink) <= MAX_MISS * (np.abs(v) + slip_scale))
    side = np.where(is_on_kink, 2 * nearest + 1 - row, codes).astype(np.int32)
    is_jump = graph.after_high[side - 1] == side  # a side that only bends is passed over

    margin = MAX_MISS * problem.traction_scale
    height = np.abs(b_right - b_left)
    # from 0 at the left to the height at the right
    climbed = np.sign(b_right - b_left) * (problem.at(t).xi(v) / problem.c - b_left)
    sense = np.sign(v - kink) if senses is None else np.where(senses < 0.0, -1.0, 1.0)
    is_ray = np.isinf(height)
    if np.any(is_ray):  # it is climbed from its upper end, and has no lower one
        climbed = np.where(is_ray, problem.at(t).xi(v) / problem.c - b_right, climbed)
        height = np.where(is_ray, 0.0, height)
    is_below = (climbed < -margin) | ((climbed <= margin) & (sense < 0.0))
    is_below &= ~is_ray
    is_above = (climbed > height + margin) | ((climbed >= height - margin) & (sense > 0.0))
    to_left = np.where(is_jump, is_below, sense < 0.0)
    to_right = np.where(is_jump, is_above, sense >= 0.0)
    kink_codes = np.where(to_left, side - 1, np.where(to_right, side + 1, side))
    return np.where(is_on_kink, kink_codes, codes).astype(np.int32)
