"""Where a path starts: the pieces on which a given solution sits, and the ways that lead away from it.

On a vertex several ways lead away. `rays` finds two, one for either sense of t, by following a perturbed path around
the vertex. `onward` asks for less, the stable way on which t grows, and begins with a guess on which side of its kink
every node goes: where most have gone on as before that is one solve.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.path.dense import SingularCellError
from tcstudy.contact.path.problem import ParametricProblem
from tcstudy.contact.path.tableau import Tableau
from tcstudy.contact.path.vertex import Corner, along_perturbation, corner, move
from tcstudy.contact.path.walk import Codes, Units, Walk
from tcstudy.scene.study import Acceptance

Array = NDArray[np.float64]

REMEMBERED = 1e-10
"""Where a node is said to go on from where two pieces meet it stands there, as exactly as a solution is accepted."""

NEAR = 1e-8
"""A given solution may miss the exact one by this much, relative to slip and traction, or by what rounding of its
residual allows if that is more; it is corrected."""


class NoSolutionError(ValueError):
    """The given point is no solution at the given t."""


def locate(
    problem: ParametricProblem,
    units: Units,
    v: Array,
    t: float,
    ways: Array | None = None,
    tableau: Tableau | None = None,
) -> Walk:
    """A walk at the solution v of parameter t, corrected to rounding.

    ways:    (m,) sense in which nodes that stand where two pieces meet are to go along their graphs, 0 for no wish
    tableau: of another walk on the same body, which this one takes over
    Raises NoSolutionError if no solution lies within NEAR of v, or as near as rounding lets v be one.
    """
    codes = _codes(problem, units, v, t, ways)
    graph = problem.graph
    xi = (problem.load(t) - problem.A_tilde @ v) / units.stiffness
    tie = units.tie if ways is None else max(units.tie, REMEMBERED)
    for _ in range(20):
        free = graph.free[codes]
        x = np.where(free, v, xi)
        walk = Walk(problem, units, codes, x, t, tableau)
        tableau = walk.tableau
        with suppress(SingularCellError):  # where t is at rest no correction at fixed t exists
            for _ in range(3):
                walk.refine(None)
        outside = (walk.x < walk.low) | (walk.x > walk.high)
        outside &= walk.gaps() < -tie
        if not np.any(outside):
            break
        after = np.where(walk.x > walk.high, graph.after_high[codes], graph.after_low[codes])
        codes = np.where(outside, after, codes).astype(np.int32)
    u = walk.u
    moved = np.max(np.abs(u - v) / (np.abs(u) + units.slip), initial=0.0)
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


def _codes(problem: ParametricProblem, units: Units, v: Array, t: float, ways: Array | None) -> Codes:
    """First guess of the pieces: on a jump where v_i is near one and ξ_i/c_i in it, else the segment of v_i.

    With `ways`, where two pieces meet, the one in that sense.
    """
    law, graph = problem.law, problem.graph
    row = law.node_index(len(v))  # the graph has 2K + 1 codes where the law has K + 1 pieces
    codes = (2 * law.piece(v) - row).astype(np.int32)
    if not law.kinks.size:
        return codes
    near = law.nearest_kink(v)
    kink = law.kink(near)
    on = np.isfinite(kink) & (np.abs(v - kink) <= NEAR * (np.abs(v) + units.slip))
    side = np.where(on, 2 * near + 1 - row, codes).astype(np.int32)
    jumps = graph.after_high[side - 1] == side  # a side that only bends is passed over
    left, right = law.limits(near)
    margin, height = NEAR * units.traction, np.abs(right - left)
    along = np.sign(right - left) * ((problem.load(t) - problem.A_tilde @ v) / problem.c - left)  # from 0 to the height
    if ways is None:
        inside = ((along > margin) & (along < height - margin)) | (kink == v)
        inside &= (along >= -margin) & (along <= height + margin)
        return np.where(on & inside & jumps, side, codes)
    to_left = (along < -margin) | ((along <= margin) & (ways < 0.0))
    to_right = (along > height + margin) | ((along >= height - margin) & (ways >= 0.0))
    to_left, to_right = (np.where(jumps, to, way) for to, way in ((to_left, ways < 0.0), (to_right, ways >= 0.0)))
    return np.where(on, np.where(to_left, side - 1, np.where(to_right, side + 1, side)), codes)


@dataclass(frozen=True)
class Ray:
    """A way out of a point: codes, moving coordinates, t, and direction."""

    codes: Codes
    x: Array
    t: float
    dx: Array
    dt: float


def rays(walk: Walk) -> tuple[Ray, Ray]:
    """(forward, backward) ways out of the start; forward is the one along which t grows, if only one does.

    Raises SingularCellError if there is none.
    """
    at = np.flatnonzero((walk.x == walk.low) | (walk.x == walk.high))
    _any_direction(walk)
    if not len(at):
        way = here(walk)
        pair = way, replace(way, dx=-way.dx, dt=-way.dt)
    else:
        c = corner(walk, at)
        pair = _uniform(walk, c) or _perturbed(walk, c)
    return pair if pair[0].dt >= pair[1].dt else (pair[1], pair[0])


def _any_direction(walk: Walk) -> None:
    """The direction of growing t; where t stands still, that of some node."""
    try:
        move(walk, None, 1.0)
        if np.max(np.abs(walk.dx)) < 1e10 * np.max(np.abs(walk.units.load)) * len(walk.dx):
            return None
    except SingularCellError:
        pass
    for node in range(len(walk.dx)):
        try:
            return move(walk, node, 1.0)
        except SingularCellError:
            continue
    raise SingularCellError


def here(walk: Walk) -> Ray:
    """Where the walk stands, and its direction."""
    return Ray(walk.codes.copy(), walk.x.copy(), walk.t, walk.dx.copy(), walk.dt)


def _uniform(walk: Walk, c: Corner) -> tuple[Ray, Ray] | None:
    """Ways out with all tied nodes on one side: kept together, as a symmetric solution wants it."""
    found: list[Ray] = []
    for side, sign, leave in ((c.near, c.near_sign, -1.0), (c.far, c.far_sign, 1.0)):
        walk.place(c.nodes.tolist(), side.tolist())
        try:
            _any_direction(walk)
        except SingularCellError:
            continue
        speeds = sign * walk.dx[c.nodes] * leave
        if np.all(speeds >= 0.0):
            found.append(here(walk))
        elif np.all(speeds <= 0.0):
            walk.turn(-walk.dx, -walk.dt, np.abs(walk.dx))
            found.append(here(walk))
    walk.place(c.nodes.tolist(), c.near.tolist())
    return (found[0], found[1]) if len(found) == 2 else None


def _perturbed(walk: Walk, c: Corner) -> tuple[Ray, Ray]:
    """Both ends of the perturbed path through the cone at the start."""
    _any_direction(walk)
    start = here(walk)
    along_perturbation(walk, c, resting=True)
    one = here(walk)
    walk.place(c.nodes.tolist(), c.near.tolist())
    walk.turn(-start.dx, -start.dt, np.abs(start.dx))
    along_perturbation(walk, c, resting=True)
    return one, here(walk)


def depart(walk: Walk, ray: Ray) -> None:
    """Put the walk on a ray from its start."""
    walk.put(ray.codes, ray.x, ray.t)
    lead = int(np.argmax(np.abs(ray.dx)))
    move(walk, lead, float(ray.dx[lead]))


MOST_TURNS = 12
"""How often nodes are moved to the other side of their kinks at once before they are released one by one."""


def onward(walk: Walk) -> Ray | None:
    """The stable way on which t grows, from the walk's pieces and those beside them; None if none is found.

    Every node that stands on a bound goes on on its piece or on the next one, whichever it then moves along: where all
    nodes wish otherwise than guessed they are moved at once (the semismooth Newton method for this linear
    complementarity problem). With a definite matrix on all sides there is one answer. Else that one may be unstable
    where another is not: the energy of the rates is descended then, with all nodes at rest first.
    """
    at = np.flatnonzero((walk.x == walk.low) | (walk.x == walk.high))
    if not len(at):
        with suppress(SingularCellError):
            move(walk, None, 1.0)
            return _stable(walk)
        return None
    c = corner(walk, at)
    return _guessed(walk, c) or _Rates(walk, c).descended()


def _stable(walk: Walk) -> Ray | None:
    """Where the walk stands, if that way is stable."""
    walk.negatives = walk.tableau.negatives()
    return here(walk) if walk.stable else None


def _guessed(walk: Walk, c: Corner) -> Ray | None:
    """The way in the cell of the walk, or in that which all nodes wish."""
    far = np.zeros(len(c.nodes), dtype=bool)
    with suppress(SingularCellError):
        move(walk, None, 1.0)
        for _ in range(MOST_TURNS):
            speed = walk.dx[c.nodes]
            wrong = np.where(far, c.far_sign * speed < 0.0, c.near_sign * speed > 0.0)
            if not np.any(wrong):
                return _stable(walk)
            far ^= wrong
            walk.place(c.nodes[wrong].tolist(), np.where(far, c.far, c.near)[wrong].tolist())
            move(walk, None, 1.0)
    return None


@dataclass
class _Rates:
    """The energy ½ u̇ᵀÃu̇ − l̃₁ᵀu̇ + Σ ½ c b′ u̇² of rates u̇ at a corner, b′ and which signs of u̇ there are by the cell."""

    walk: Walk
    c: Corner

    def descended(self) -> Ray | None:
        """A minimum of it by an active-set method, from rest on; None where it falls without end.

        From cell to cell one node at a time, and along straight lines downhill, to the cell's stationary point or,
        where that lies uphill, away from it: a node that softens does not carry those along which it would turn back.
        """
        walk, c = self.walk, self.c
        graph, nodes = walk.graph, c.nodes
        stiff = np.stack([np.where(graph.free[k], graph.slope[k], np.where(graph.sense[k] > 0, np.inf, -np.inf))
                          for k in (c.near, c.far)])  # fmt: skip
        far = stiff[1] > stiff[0]
        walk.place(nodes.tolist(), np.where(far, c.far, c.near).tolist())
        rate = np.zeros(len(walk.dx))
        for _ in range(4 * len(nodes) + MOST_TURNS):
            try:
                move(walk, None, 1.0)
            except SingularCellError:
                return None
            sign = np.where(far, -c.far_sign, c.near_sign)  # of speeds with which a node leaves its side
            way = np.where(walk.free, walk.dx, 0.0) - rate
            stiffness = walk.units.body.A @ way + np.where(walk.free, walk.tableau.k * way, 0.0)
            uphill = float(way @ stiffness) < 0.0
            way = -way if uphill else way
            leaves = walk.free[nodes] & (sign * way[nodes] > 0.0)
            with np.errstate(divide="ignore", invalid="ignore"):
                share = np.where(leaves, np.maximum(-rate[nodes] / way[nodes], 0.0), np.inf)
            first = int(np.argmin(share))
            if share[first] >= 1.0 and not uphill:
                rate = rate + way
                push = np.where(walk.free[nodes], 0.0, sign * walk.dx[nodes])
                first = int(np.argmax(push))
                if not push[first] > 0.0:
                    return _stable(walk)
            elif np.isfinite(share[first]):
                rate = rate + share[first] * way
                rate[nodes[first]] = 0.0
            else:
                return None
            far[first] ^= True
            walk.place([int(nodes[first])], [int((c.far if far[first] else c.near)[first])])
        return None
