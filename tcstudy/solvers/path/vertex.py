"""From one cell of the path to the next, one node at a time or several at once; and where a path starts.

One node at its bound: it goes on into the next piece of its graph; the speed of that node fixes the new direction,
whatever t does, so a fold is nothing special.

Several nodes at their bounds (ties): the cells around the vertex form a cone in which each tied node is on the near
side (A) or the far side (B) of its kink.
  1. All go over together. If the nodes are exchanged by a symmetry of the problem this is always the continuation
     (in the symmetric problem it is one event), and so a symmetric branch is kept.
  2. Otherwise each tied node gets its own time of arrival. This is a perturbation of the load for which the events
     come one by one; in the cone it need not be small. The perturbed path enters along the present ray, visits each
     cell at most once and leaves along another ray, which is a continuation of the unperturbed path. It cannot cycle.

A start is the pieces on which a given solution sits, and the two ways that lead away from it.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.solvers.path.dense import SingularCellError
from tcstudy.solvers.path.problem import ParametricProblem
from tcstudy.solvers.path.walk import Codes, Index, Units, Walk

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Corner:
    """The tied nodes and the two pieces that meet at each one's kink.

    nodes:          (n,)
    near, far:      (n,) codes of side A (the present one) and side B
    near_sign, far_sign: (n,) sign of the moving coordinate's speed when the node goes from A towards B
    """

    nodes: Index
    near: Codes
    far: Codes
    near_sign: Array
    far_sign: Array


def corner(walk: Walk, nodes: Index) -> Corner:
    """The corner at which these nodes, all exactly on a bound, stand."""
    graph = walk.graph
    near = walk.codes[nodes]
    upper = walk.x[nodes] == walk.high[nodes]
    far = np.where(upper, graph.after_high[near], graph.after_low[near]).astype(np.int32)
    near_sign = np.where(upper, 1.0, -1.0)
    turn = (graph.sense[near] * graph.sense[far]).astype(float)
    return Corner(nodes, near, far, near_sign, near_sign * turn)


def cross(walk: Walk, at: list[int]) -> None:
    """Continue the path beyond the vertex where the nodes `at` stand on their bounds; raises SingularCellError."""
    if len(at) == 1:
        node, rows = at[0], walk.graph.rows
        _, _, _, sense, after_low, after_high, *_ = rows[walk.codes.item(node)]
        upper = walk.x[node] == walk.high[node]
        far = after_high if upper else after_low
        turn = float(sense * rows[far][3])
        return _go_over(walk, node, far, turn if upper else -turn)
    c = corner(walk, np.array(at))
    movers = c.near_sign * walk.dx[at] > 0.0
    if not _together(walk, c, movers):
        along_perturbation(walk, c)
    return None


def _go_over(walk: Walk, node: int, new: int, speed: float) -> None:
    """The node goes on to another piece, its coordinate there with this speed; the inertia is counted along.

    The sign of the pivot, and with it the inertia, follows from whether t turns: at an up-jump a node that is let go
    (or held) without a fold adds (or takes) a positive eigenvalue, with a fold a negative one; a down-jump has the
    signs exchanged; between two segments one eigenvalue changes sign at a fold.
    """
    graph, old, before = walk.graph, int(walk.codes[node]), walk.dt
    if old != new:
        walk.place_one(node, new)
    move(walk, node, speed)
    if walk.dt == 0.0 or before == 0.0:
        walk.negatives = walk.tableau.negatives()
        return
    fold, was_free = walk.dt * before < 0.0, bool(graph.free[old])
    if was_free and graph.free[new]:
        walk.negatives += (-1 if graph.slope[new] > graph.slope[old] else 1) if fold else 0
    elif fold == (graph.sense[new if was_free else old] > 0):
        walk.negatives += -1 if was_free else 1


def move(walk: Walk, node: int | None, speed: float) -> None:
    """The direction in the present cell in which `node` has this speed (None: t has it)."""
    dx, dt = walk.tableau.direction(node, speed)
    size = np.abs(dx)
    largest = int(size.argmax())
    if node is not None and size.item(largest) > 100.0 * abs(speed):
        dx, dt = walk.tableau.direction(largest, float(np.sign(dx[largest])))
        size = np.abs(dx)
    walk.turn(dx, dt, size)


def _together(walk: Walk, c: Corner, movers: NDArray[np.bool_]) -> bool:
    """Try all movers on the far side at once; restores the walk and returns False if that is no continuation."""
    if not np.any(movers):
        return False
    before = walk.dx, walk.dt
    lead = np.flatnonzero(movers)[np.argmax(np.abs(walk.dx[c.nodes[movers]]))]
    try:
        walk.place(c.nodes[movers].tolist(), c.far[movers].tolist())
        move(walk, int(c.nodes[lead]), float(c.far_sign[lead]))
        speeds = walk.dx[c.nodes]
        leaves = np.where(movers, c.far_sign * speeds > 0.0, c.near_sign * speeds <= 0.0)
        if np.all(leaves):
            walk.negatives = walk.tableau.negatives()
            return True
    except SingularCellError:
        pass
    walk.place(c.nodes[movers].tolist(), c.near[movers].tolist())
    walk.dx, walk.dt = before
    return False


def along_perturbation(walk: Walk, c: Corner, resting: bool = False) -> None:
    """Rule 2 of the module: follow the perturbed path around the vertex until it leaves along a ray.

    resting: begin at a point in the cone instead of far out on the ray along which the path comes in; followed in
             both directions from there the perturbed path gives two ways out of the vertex
    """
    n = len(c.nodes)
    walk.negatives = walk.tableau.negatives()
    on_far = np.zeros(n, dtype=bool)
    speeds = c.near_sign * walk.dx[c.nodes]
    typical = float(np.max(np.abs(speeds))) or 1.0
    times = 1.0 + np.arange(n) + 0.5 * np.modf(0.6180339887498949 * (1 + np.arange(n)))[0]
    offset = -times * (typical if resting else np.where(speeds > 0.0, speeds, typical))
    for _ in range(1000 + 100 * n):
        speeds = np.where(on_far, c.far_sign, c.near_sign) * walk.dx[c.nodes]
        hits = np.where(on_far, speeds < 0.0, speeds > 0.0)
        if not np.any(hits):
            return
        with np.errstate(divide="ignore", invalid="ignore"):
            wait = np.where(hits, np.abs(offset / speeds), np.inf)
        i = int(np.argmin(wait))
        offset = offset + wait[i] * speeds
        offset[i] = 0.0
        on_far[i] = not on_far[i]
        new, speed = (c.far[i], c.far_sign[i]) if on_far[i] else (c.near[i], -c.near_sign[i])
        _go_over(walk, int(c.nodes[i]), int(new), float(speed))
    raise SingularCellError


NEAR = 1e-8
"""A given solution may miss the exact one by this much, relative to slip and traction; it is corrected."""


class NoSolutionError(ValueError):
    """The given point is no solution at the given t."""


def locate(problem: ParametricProblem, units: Units, v: Array, t: float) -> Walk:
    """A walk at the solution v of parameter t, corrected to rounding.

    Raises NoSolutionError if no solution lies within NEAR of v.
    """
    codes = _codes(problem, units, v, t)
    graph = problem.graph
    xi = (problem.load(t) - problem.A_tilde @ v) / units.stiffness
    for _ in range(20):
        free = graph.free[codes]
        x = np.where(free, v, xi)
        walk = Walk(problem, units, codes, x, t)
        with suppress(SingularCellError):  # where t is at rest no correction at fixed t exists
            for _ in range(3):
                walk.refine(None)
        outside = (walk.x < walk.low) | (walk.x > walk.high)
        outside &= walk.gaps() < -walk.tie
        if not np.any(outside):
            break
        after = np.where(walk.x > walk.high, graph.after_high[codes], graph.after_low[codes])
        codes = np.where(outside, after, codes).astype(np.int32)
    u = walk.u
    moved = np.max(np.abs(u - v) / (np.abs(u) + units.slip), initial=0.0)
    if not (moved <= 1e3 * NEAR and walk.residual() <= NEAR) or np.any(outside):
        raise NoSolutionError(
            f"the start is no solution at t = {t:g}: inclusion residual {problem.at(t).inclusion_residual(v):.1e}; "
            "solve the problem at this t first and start from its answer"
        )
    at = np.flatnonzero(walk.gaps() <= walk.tie)
    upper = walk.high[at] - walk.x[at] < walk.x[at] - walk.low[at]
    walk.x[at] = np.where(upper, walk.high[at], walk.low[at])
    return walk


def _codes(problem: ParametricProblem, units: Units, v: Array, t: float) -> Codes:
    """First guess of the pieces: on a jump where v_i is near one and ξ_i/c_i in it, else the segment of v_i."""
    law, graph = problem.law, problem.graph
    codes = (graph.first + 2 * law.piece(v)).astype(np.int32)
    if not law.kinks.size:
        return codes
    traction = (problem.load(t) - problem.A_tilde @ v) / problem.c
    near = law.nearest_kink(v)
    kink = law.kink(near)
    on = np.abs(v - kink) <= NEAR * (np.abs(v) + units.slip)
    side = np.where(np.isfinite(kink), graph.first + 2 * near + 1, codes)
    low, high = graph.low[side], graph.high[side]
    margin = NEAR * units.traction
    inside = (traction > low + margin) & (traction < high - margin) | (kink == v)
    inside &= (traction >= low - margin) & (traction <= high + margin)
    jumps = graph.after_high[side - 1] == side  # a side that only bends is passed over
    return np.where(on & inside & jumps, side, codes).astype(np.int32)


@dataclass(frozen=True)
class Ray:
    """A way out of the start: codes, moving coordinates and direction."""

    codes: Codes
    x: Array
    dx: Array
    dt: float


def rays(walk: Walk) -> tuple[Ray, Ray]:
    """(forward, backward) ways out of the start; forward is the one along which t grows, if only one does.

    Raises SingularCellError if there is none.
    """
    at = np.flatnonzero((walk.x == walk.low) | (walk.x == walk.high))
    _any_direction(walk)
    if not len(at):
        here = _ray(walk)
        pair = here, Ray(here.codes, here.x, -here.dx, -here.dt)
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


def _ray(walk: Walk) -> Ray:
    return Ray(walk.codes.copy(), walk.x.copy(), walk.dx.copy(), walk.dt)


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
            found.append(_ray(walk))
        elif np.all(speeds <= 0.0):
            walk.turn(-walk.dx, -walk.dt, np.abs(walk.dx))
            found.append(_ray(walk))
    walk.place(c.nodes.tolist(), c.near.tolist())
    return (found[0], found[1]) if len(found) == 2 else None


def _perturbed(walk: Walk, c: Corner) -> tuple[Ray, Ray]:
    """Both ends of the perturbed path through the cone at the start."""
    _any_direction(walk)
    start = _ray(walk)
    along_perturbation(walk, c, resting=True)
    one = _ray(walk)
    walk.place(c.nodes.tolist(), c.near.tolist())
    walk.turn(-start.dx, -start.dt, np.abs(start.dx))
    along_perturbation(walk, c, resting=True)
    return one, _ray(walk)


def depart(problem: ParametricProblem, units: Units, ray: Ray, t: float) -> Walk:
    """A fresh walk from the start along one ray."""
    walk = Walk(problem, units, ray.codes, ray.x, t)
    lead = int(np.argmax(np.abs(ray.dx)))
    move(walk, lead, float(ray.dx[lead]))
    return walk
