"""Where a path starts: the pieces on which a given solution sits, and the ways that lead away from it.

On a vertex several ways lead away. `rays` finds two, one for either sense of t, by following a perturbed path around
the vertex. `onward` asks for less, the stable way on which t grows, and begins with a guess on which side of its kink
every node goes: where most have gone on as before that is one solve.
"""

from __future__ import annotations

from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.path.basis_inverse import BasisInverse, SingularCellError
from tcstudy.contact.path.problem import ParametricProblem
from tcstudy.contact.path.walk import Codes, Corner, Walk
from tcstudy.scene.study import Acceptance

Array = NDArray[np.float64]

REMEMBERED = 1e-10
"""Where a node is said to go on from where two pieces meet it stands there, as exactly as a solution is accepted."""

NEAR = 1e-8
"""A given solution may miss the exact one by this much, relative to slip and traction, or by what rounding of its
residual allows if that is more; it is corrected."""

ALONE, MOST_TURNS = 3, 12
"""How often the node that wishes otherwise most is moved to the other side of its kink, and until when all of them are,
before they are released one by one."""


class NoSolutionError(ValueError):
    """The given point is no solution at the given t."""


class Ray(NamedTuple):
    """A way out of a point: codes (m,), coordinates and direction (m + 1,) as in `Walk`."""

    codes: Codes
    x: Array
    dx: Array

    @classmethod
    def here(cls, walk: Walk) -> Ray:
        """Where the walk stands, and its direction."""
        return cls(walk.codes.copy(), walk.x.copy(), walk.dx.copy())


def locate(
    problem: ParametricProblem, v: Array, t: float, ways: Array | None = None, basis: BasisInverse | None = None
) -> Walk:
    """A walk at the solution v of parameter t, corrected to rounding.

    ways:  (m,) sense in which nodes that stand where two pieces meet are to go along their graphs, 0 for no wish
    basis: of another walk on the same body, which this one takes over
    Raises NoSolutionError if no solution lies within NEAR of v, or as near as rounding lets v be one, and
    SingularCellError where it is in a cell without a line.
    """
    graph, codes = problem.graph, _codes(problem, v, t, ways)
    xi = (problem.load(t) - problem.A_tilde @ v) / problem.body.stiffness
    for _ in range(20):
        walk = Walk(problem, codes, np.where(graph.free[codes], v, xi), t, basis)
        basis, m = walk.basis, walk.m
        tie = walk.tie if ways is None else max(walk.tie, REMEMBERED)
        if walk.dx[m] != 0.0:  # where t is at rest no correction at fixed t exists
            for _ in range(3):
                walk.correct(np.array([m]))
        outside = ((walk.x < walk.low) | (walk.x > walk.high))[:m] & (walk.gaps() < -tie)
        if not np.any(outside):
            break
        after = np.where(walk.x[:m] > walk.high[:m], graph.after_high[codes], graph.after_low[codes])
        codes = np.where(outside, after, codes).astype(np.int32)
    u = walk.u
    moved = np.max(np.abs(u - v) / (np.abs(u) + walk.slip), initial=0.0)
    near = max(NEAR, Acceptance().limit(problem.xi_rounding(t, v)))
    as_exact = moved <= 1e3 * NEAR or problem.at(t).inclusion_residual(v) <= problem.xi_rounding(t, v)
    if not (as_exact and walk.residual() <= near) or np.any(outside):
        raise NoSolutionError(
            f"the start is no solution at t = {t:g}: inclusion residual {problem.at(t).inclusion_residual(v):.1e}; "
            "solve the problem at this t first and start from its answer"
        )
    at = np.flatnonzero(walk.gaps() <= tie)
    upper = walk.high[at] - walk.x[at] < walk.x[at] - walk.low[at]
    walk.x[at] = np.where(upper, walk.high[at], walk.low[at])
    return walk


def _codes(problem: ParametricProblem, v: Array, t: float, ways: Array | None) -> Codes:
    """First guess of the pieces: on a jump where v_i is near one and ξ_i/c_i in it, else the segment of v_i.

    With `ways`, where two pieces meet, the one in that sense.
    """
    law, graph = problem.law, problem.graph
    row = law.node_index(len(v))  # the graph has 2K + 1 codes where the law has K + 1 pieces
    codes = (2 * law.piece(v) - row).astype(np.int32)
    if not law.kinks.size:
        return codes
    slip = problem.traction_scale * problem.c / np.diagonal(problem.A_tilde)
    near = law.nearest_kink(v)
    kink = law.kink(near)
    on = np.isfinite(kink) & (np.abs(v - kink) <= NEAR * (np.abs(v) + slip))
    side = np.where(on, 2 * near + 1 - row, codes).astype(np.int32)
    jumps = graph.after_high[side - 1] == side  # a side that only bends is passed over
    left, right = law.limits(near)
    margin, height = NEAR * problem.traction_scale, np.abs(right - left)
    along = np.sign(right - left) * ((problem.load(t) - problem.A_tilde @ v) / problem.c - left)  # from 0 to the height
    if ways is None:
        inside = ((along > margin) & (along < height - margin)) | (kink == v)
        inside &= (along >= -margin) & (along <= height + margin)
        return np.where(on & inside & jumps, side, codes)
    to_left = (along < -margin) | ((along <= margin) & (ways < 0.0))
    to_right = (along > height + margin) | ((along >= height - margin) & (ways >= 0.0))
    to_left, to_right = (np.where(jumps, to, way) for to, way in ((to_left, ways < 0.0), (to_right, ways >= 0.0)))
    return np.where(on, np.where(to_left, side - 1, np.where(to_right, side + 1, side)), codes)


def rays(walk: Walk) -> tuple[Ray, Ray]:
    """(forward, backward) ways out of the start; forward is the one along which t grows, if only one does.

    Where nodes stand on their bounds those ways are preferred on which they all keep together, as a symmetric solution
    wants it. Raises SingularCellError if there is none.
    """
    c = walk.corner(walk.at_bound)
    n = len(c.nodes)
    found = [Ray.here(walk) for far in (np.zeros(n, dtype=bool), np.ones(n, dtype=bool)) if walk.leaves(c, far)]
    if not n or len(found) < 2:
        walk.place(c.nodes, c.codes[0])
        found, ahead = [], walk.dx
        for sense in (1.0, -1.0):
            walk.place(c.nodes, c.codes[0])
            walk.along(sense * ahead)
            walk.around(c, resting=True)
            found.append(Ray.here(walk))
    one, other = found
    return (one, other) if one.dx[-1] >= other.dx[-1] else (other, one)


def onward(walk: Walk) -> Ray | None:
    """The stable way on which t grows, from the walk's pieces and those beside them; None if none is found.

    Every node that stands on a bound goes on on its piece or on the next one, whichever it then moves along. Where some
    wish otherwise than guessed the one that does most is moved first (mostly it alone has turned back, and to move all
    would upset a whole zone), then all at once (the semismooth Newton method for this linear complementarity problem).
    With a definite matrix on all sides there is one answer. Else that one may be unstable where another is not: the
    energy of the rates is descended then, with all nodes at rest first.
    """
    c = walk.corner(walk.at_bound)
    far = np.zeros(len(c.nodes), dtype=bool)
    with suppress(SingularCellError):
        for turn in range(MOST_TURNS):
            if not _t_grows(walk, c, far):
                break
            against = -c.on(far)[1] * walk.dx[c.nodes]
            if not np.any(against > 0.0):
                if walk.stable:
                    return Ray.here(walk)
                break
            far ^= against > 0.0 if turn >= ALONE else np.arange(len(far)) == np.argmax(against)
    return _descended(walk, c) if len(c.nodes) else None


def _t_grows(walk: Walk, c: Corner, far: NDArray[np.bool_]) -> bool:
    """Whether t moves in the cell with these nodes on the far side; then so that it grows."""
    walk.place(c.nodes, c.on(far)[0])
    if walk.dx[-1] < 0.0:
        walk.turn()
    return bool(walk.dx[-1] != 0.0)


def _descended(walk: Walk, c: Corner) -> Ray | None:
    """A minimum of the energy ½ u̇ᵀÃu̇ − l̃₁ᵀu̇ + Σ ½ c b′ u̇² of rates u̇ at a corner; None where it falls without end.

    b′, and which signs u̇ has, are those of the cell. An active-set method, from rest on: from cell to cell one node at
    a time, and along straight lines downhill, to the cell's stationary point or, where that lies uphill, away from it:
    a node that softens does not carry those along which it would turn back.
    """
    graph, nodes = walk.graph, c.nodes
    rigid = np.where(graph.sense[c.codes] > 0, np.inf, -np.inf)
    stiff = np.where(graph.free[c.codes], graph.slope[c.codes], rigid)
    far = stiff[1] > stiff[0]
    rate = np.zeros(walk.m)
    for _ in range(4 * len(nodes) + MOST_TURNS):
        try:
            if not _t_grows(walk, c, far):
                return None
        except SingularCellError:
            return None
        out, speed = c.on(far)[1], walk.dx[:-1] / walk.dx[-1]
        way = np.where(walk.free, speed, 0.0) - rate
        stiffness = walk.basis.A @ way + np.where(walk.free, walk.basis.k * way, 0.0)
        uphill = float(way @ stiffness) < 0.0
        way = -way if uphill else way
        leaves = walk.free[nodes] & (out * way[nodes] < 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(leaves, np.maximum(-rate[nodes] / way[nodes], 0.0), np.inf)
        first = int(np.argmin(share))
        if share[first] >= 1.0 and not uphill:
            rate = rate + way
            push = np.where(walk.free[nodes], 0.0, -out * speed[nodes])
            first = int(np.argmax(push))
            if not push[first] > 0.0:
                return Ray.here(walk) if walk.stable else None
        elif np.isfinite(share[first]):
            rate = rate + share[first] * way
            rate[nodes[first]] = 0.0
        else:
            return None
        far[first] ^= True
    return None
