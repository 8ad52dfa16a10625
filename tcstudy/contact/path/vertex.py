"""From one cell of the path to the next, one node at a time or several at once.

One node at its bound: it goes on into the next piece of its graph; the speed of that node fixes the new direction,
whatever t does, so a fold is nothing special.

Several nodes at their bounds (ties): the cells around the vertex form a cone in which each tied node is on the near
side (A) or the far side (B) of its kink.
  1. All go over together. If the nodes are exchanged by a symmetry of the problem this is always the continuation
     (in the symmetric problem it is one event), and so a symmetric branch is kept.
  2. Otherwise each tied node gets its own time of arrival. This is a perturbation of the load for which the events
     come one by one; in the cone it need not be small. The perturbed path enters along the present ray, visits each
     cell at most once and leaves along another ray, which is a continuation of the unperturbed path. It cannot cycle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.path.dense import SingularCellError
from tcstudy.contact.path.walk import Codes, Index, Walk

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
