"""Points at which several nodes pass to other pieces at once (ties), and the ways that lead away from them.

The cells around the point form a cone in which each of these nodes is on the near side of its kink, where it came from,
or on the far one.
  1. All go over together. If the nodes are exchanged by a symmetry of the problem this is always the continuation
     (in the symmetric problem it is one event), and so a symmetric branch is kept.
  2. Otherwise each gets its own time of arrival. This is a perturbation of the load for which the events come one by
     one; in the cone it need not be small. The perturbed path enters along the present ray, visits each cell at most
     once and leaves along another ray, which is a continuation of the unperturbed path. It cannot cycle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.path.basis_inverse import SingularCellError
from tcstudy.contact.path.walk import Array, Index, Ray, Walk

Flags = NDArray[np.bool_]

ALONE, MOST_TURNS = 3, 12
"""How often the node that wishes otherwise most is moved to the other side of its kink, and until when all are."""


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
        """To the cell with these nodes on the far side; (n,) speeds at which they leave their kinks into it."""
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
        """Rule 2 of the module: follow the perturbed path around the corner until it leaves along a ray.

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
    """Continue beyond the vertex where the nodes `at` stand on their bounds; raises SingularCellError."""
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
    """(forward, backward) ways out of the start; forward is the one along which t grows, if only one does.

    Where nodes stand on their bounds those ways are preferred on which they all keep together, as a symmetric solution
    wants it. Raises SingularCellError if there is none.
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


def onward(walk: Walk) -> Ray | None:
    """The stable way on which t grows, from the walk's pieces and those beside them; None if none is found.

    Every node that stands on a bound goes on on its piece or on the next one, whichever it then moves along. Where some
    wish otherwise than guessed the one that does most is moved first (mostly it alone has turned back, and to move all
    would upset a whole zone), then all at once (the semismooth Newton method for this linear complementarity problem).
    With a definite matrix on all sides there is one answer. Where nodes push each other on (cells longer than the strip
    is high) all at once may go round in a circle: the energy of the rates is descended then.
    """
    corner = Corner(walk)
    far = np.zeros(len(corner.nodes), dtype=bool)
    try:
        for turn in range(MOST_TURNS):
            against = -_rising(corner, far)
            if walk.dx[-1] == 0.0:
                return None
            if not np.any(against > 0.0):
                return walk.here if walk.stable else None
            far ^= against > 0.0 if turn >= ALONE else np.arange(len(far)) == np.argmax(against)
        return _descended(corner)
    except SingularCellError:
        return None


def _rising(corner: Corner, far: Flags) -> Array:
    """`Corner.enter` with the walk in the sense in which t grows, if it moves."""
    speeds = corner.enter(far)
    if corner.walk.dx[-1] < 0.0:
        corner.walk.turn()
        return -speeds
    return speeds


def _descended(corner: Corner) -> Ray | None:
    """A minimum of the energy ½ u̇ᵀÃu̇ − l̃₁ᵀu̇ + Σ ½ c b′ u̇² of rates u̇ at a corner; None where it falls without end.

    b′, and which signs u̇ has, are those of the cell. An active-set method, from rest on: from cell to cell one node at
    a time, and along straight lines downhill, to the cell's stationary point or, where that lies uphill, away from it:
    a node that softens does not carry those along which it would turn back. Raises SingularCellError.
    """
    walk, graph, nodes = corner.walk, corner.walk.graph, corner.nodes
    rigid = np.where(graph.sense[corner.codes] > 0, np.inf, -np.inf)
    stiff = np.where(graph.free[corner.codes], graph.slope[corner.codes], rigid)
    far, rate = stiff[1] > stiff[0], np.zeros(walk.m)
    for _ in range(4 * len(nodes) + MOST_TURNS):
        _rising(corner, far)
        if walk.dx[-1] == 0.0:
            return None
        out, speed = np.where(far, corner.out[1], corner.out[0]), walk.dx[:-1] / walk.dx[-1]
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
                return walk.here if walk.stable else None
        elif np.isfinite(share[first]):
            rate = rate + share[first] * way
            rate[nodes[first]] = 0.0
        else:
            return None
        far[first] ^= True
    return None
