"""Every branch of solutions over an interval of t, closed loops included, proved to be all or said why not.

`contact.boxes` finds all cells that may hold a solution for some t, with t as one more coordinate of its boxes: slabs
of t cover the interval and every step but a proof of emptiness keeps all solutions. In a cell the solutions are one
segment (`segments`): branches are followed from those that begin at an end of the interval, loops from what is left.

Checks of every graph: every cell that a branch goes through is one that has a segment, no segment is on no branch, no
branch ends inside, and the number of solutions is odd at every t.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.all_solutions import Equilibria, all_solutions
from tcstudy.contact.boxes import OVER_LOADS, Limits, PolygonProblems, reach_of
from tcstudy.contact.path.follow import Follower
from tcstudy.contact.path.problem import ParametricProblem
from tcstudy.contact.path.query import solutions_at
from tcstudy.contact.path.record import Path, PathStatus
from tcstudy.laws.pieces import BEND
from tcstudy.scene.study import Direction

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]
Codes = NDArray[np.int32]
EPS = float(np.finfo(float).eps)

SLABS = 16
"""Parts of the interval that the search begins from; each is proved, or given up, by itself."""
SAME = 1e-9
"""Share of the interval within which vertices count as one."""
MOST_PIECES = 20_000
"""Of a branch to either side of where it was found."""
_CELLS = 256


@dataclass(frozen=True, eq=False)
class Branches:
    """All branches between two values of t.

    branches: a loop has its first vertex again at the end, and the status CLOSED_LOOP
    reason: why they are not proved to be all, "" if they are;  boxes: number that was looked at
    listed: solutions at the values asked for, where they were listed by themselves
    """

    branches: tuple[Path, ...]
    reason: str
    boxes: int
    listed: tuple[Equilibria | None, ...] = ()

    @property
    def complete(self) -> bool:
        return not self.reason

    def count(self, t: float) -> int:
        """Number of solutions at t, which no vertex has."""
        return sum(len(solutions_at(branch, t)) for branch in self.branches)


def all_branches(
    problem: ParametricProblem,
    begin: float,
    end: float,
    lambda_1: float,
    limits: Limits | None = None,
    at: Sequence[float] = (),
) -> Branches:
    """Every branch for t from begin to end; limits are of each slab, and of each value.

    at: values of t whose solutions are to be known. Where the search of all branches does not answer for one, as its
        limits are met or the value is outside, the solutions there are listed by themselves; those inside are followed
        like what was found of unfinished branches, so that every branch known is whole.
    Raises ValueError for laws with exponential pieces.
    """
    law, limits = problem.law, limits or Limits()
    low, high = min(begin, end), max(begin, end)
    loads = np.stack([problem.load(low), problem.load(high)])
    reach = reach_of(problem.c, law, loads, lambda_1)
    per_s = (high - low) * problem.l_1
    boxes = PolygonProblems(problem.A_tilde, problem.c, law, np.tile(loads[0], (SLABS, 1)), reach, per_s)
    edge = np.linspace(0.0, 1.0, SLABS + 1)
    cells = boxes.search(boxes.whole(np.arange(SLABS), edge[:-1], edge[1:]), limits, OVER_LOADS)
    stopped = bool(np.any(cells.stopped))
    listed = [all_solutions(problem.at(t), limits) if stopped or not low <= t <= high else None for t in at]
    inside = [x.sides for t, x in zip(at, listed, strict=True) if x is not None and low <= t <= high]
    codes = _codes(problem, np.unique(np.concatenate([cells.sides, *inside]), axis=0))
    parts = [segments(problem, codes[i : i + _CELLS], low, high) for i in range(0, max(len(codes), 1), _CELLS)]
    found = Segments(*map(np.concatenate, zip(*parts, strict=True)))
    one, undecided = found.found == Found.ONE, int(np.count_nonzero(found.found == Found.UNDECIDED))
    codes, u, t, open_end = codes[one], found.u[one], found.t[one], found.open_end[one]
    on_branch, branches, missing = set[bytes](), list[Path](), 0
    known, follower = {code.tobytes() for code in codes}, Follower(low, high, MOST_PIECES)
    for i, h in [*np.argwhere(open_end).tolist(), *((i, 0) for i in range(len(codes)))]:
        if codes[i].tobytes() in on_branch:
            continue
        way: Direction = ("forward" if t[i, h] == low else "backward") if open_end[i, h] else "both"
        branch = follower.follow(problem, u[i, h], float(t[i, h]), way)
        through = {code.tobytes() for code in branch.codes} | {codes[i].tobytes()}
        ends = {branch.begin, branch.end} - {PathStatus.START}
        missing += len(through - known) + (len(ends) > 1 or not ends <= {PathStatus.RANGE_END, PathStatus.CLOSED_LOOP})
        on_branch |= through
        branches.append(branch)
    reason = _reason(cells.stopped, undecided or missing, edge, (low, high)) or _even(branches, (low, high))
    return Branches(tuple(branches), reason, int(cells.boxes.sum()), tuple(listed))


def _codes(problem: ParametricProblem, sides: Index) -> Codes:
    """Codes within the laws' graphs of sides (n, m) of their polygons, which leave out jumps that are none."""
    tables = problem.law.tables
    kept = np.ones((len(tables.kinks), 2 * tables.kinks.shape[1] + 1), dtype=bool)
    kept[:, 1::2] = tables.kinds != BEND
    order = np.argsort(~kept, axis=-1, kind="stable")
    row = np.zeros(problem.m, dtype=np.intp) if problem.law.one else problem.law.node_index(problem.m)
    return np.asarray(order[row, sides] + problem.graph.first, dtype=np.int32)


def _reason(stopped: Flags, undecided: int, edge: Array, ends: tuple[float, float]) -> str:
    """Why the branches are not proved to be all; empty if they are."""
    if np.any(stopped):
        t = ends[0] + (ends[1] - ends[0]) * edge
        turns = np.flatnonzero(np.diff(stopped, prepend=False, append=False))
        parts = [f"{t[i]:g} to {t[j]:g}" for i, j in turns.reshape(-1, 2)]
        return f"the limit of boxes or time was met where the parameter is {', '.join(parts)}"
    if undecided:
        what = "a segment through a corner of its cell, as exact symmetry makes them, or a singular piece"
        return f"{undecided} cells cannot be decided within rounding ({what})"
    return ""


def _even(branches: list[Path], ends: tuple[float, float]) -> str:
    """A value with an even number of solutions, which the degree forbids; empty if there is none.

    Between vertices nearer than `SAME` of the interval nothing is asked: their own rounding may order them otherwise.
    """
    if not branches:
        return "no solution was found"
    begin, end = (np.concatenate([branch.t[side] for branch in branches]) for side in (slice(-1), slice(1, None)))
    low, high = np.sort(np.minimum(begin, end)), np.sort(np.maximum(begin, end))
    t = np.unique(np.concatenate([low, high, ends]))
    middle = 0.5 * (t[1:] + t[:-1])[np.diff(t) > SAME * (ends[1] - ends[0])]
    count = np.searchsorted(low, middle) - np.searchsorted(high, middle)
    even = np.flatnonzero(count % 2 == 0)
    return f"{count[even[0]]} solutions were found at {middle[even[0]]:g}, which must be odd" if len(even) else ""


class Found(IntEnum):
    """What is proved of a cell: no solution, one segment, or nothing (a corner within rounding, or a lost rank)."""

    NONE = 0
    ONE = 1
    UNDECIDED = 2


class Segments(NamedTuple):
    """The solutions of n cells.

    found: (n,) of Found; where it is not ONE the rest means nothing
    u:     (n, 2, m) displacements at both ends [m];  t: (n, 2) the parameter there
    open_end: (n, 2) whether t reaches an end of its range there, which t then is to the bit
    """

    found: NDArray[np.int8]
    u: Array
    t: Array
    open_end: Flags


def segments(problem: ParametricProblem, codes: NDArray[np.integer], t_min: float, t_max: float) -> Segments:
    """The exact segment of every cell, t between t_min and t_max.

    codes: (n, m) code of a piece that every node's law has, as `ParametricProblem.graph` counts them
    Coordinates x_i (u_i of a free node, the force of a held one) and t, in units y of their pieces, obey m equations
    N y = r: one line y = α + γ s, s along the direction of the line, about, which the last row of B = [N; γᵀ] adds;
    it is cut by the ends of the pieces. Proof: with Y the inverse of B, ‖I − YB‖ < 0.01 bounds the error of every
    coordinate; ONE and NONE hold whatever rounding does within that.
    Sources: Cottle, Pang & Stone, The Linear Complementarity Problem (1992), §2.3 (principal pivots); Rump, Acta Numer.
    19 (2010) 287–449, §10 (verified linear systems).
    """
    graph, A, c, m, n = problem.graph, problem.A_tilde, problem.c, problem.m, len(codes)
    rows, free, kink, length = np.arange(n), graph.free[codes], graph.kink[codes], t_max - t_min
    moves, b_slope, anchor, start = free.astype(float), graph.slope[codes], graph.anchor[codes], graph.start[codes]
    slope, unit = np.where(free, c * b_slope, 1.0), np.where(free, 1.0, c)  # bounds of a held node are tractions
    low, high = graph.low[codes] * unit, graph.high[codes] * unit
    typical = problem.traction_scale * c * np.where(free, 1.0 / np.diagonal(A), 1.0)
    width = np.where(np.isfinite(high - low), high - low, typical)
    base = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high - width, 0.0))
    fixed, load = moves * base + kink, problem.load(t_min)
    N = np.empty((n, m, m + 1))
    N[..., :m], N[..., m] = A * (moves * width)[:, None, :], -problem.l_1 * length
    N[:, np.arange(m), np.arange(m)] += slope * width
    r = load - fixed @ A - moves * c * (start - b_slope * anchor) - slope * base
    size = np.abs(problem.l_0) + (abs(t_min) + length) * np.abs(problem.l_1) + np.abs(fixed) @ np.abs(A)
    size += np.abs(moves * c * start) + np.abs(moves * slope * anchor) + np.abs(slope * base)
    scale = np.abs(N).max(axis=-1)
    N, r, size = N / scale[..., None], r / scale, size / scale
    B = np.concatenate([N, np.linalg.qr(N.swapaxes(1, 2), mode="complete")[0][..., None, :, m]], axis=1)
    Y = np.linalg.pinv(B) if n else B
    rho = np.abs(np.eye(m + 1) - Y @ B).sum(axis=-1).max(axis=-1)
    rho += 2 * m * EPS * (np.abs(Y) @ np.abs(B)).sum(axis=-1).max(axis=-1)
    alpha, gamma = (Y[..., :m] @ r[..., None])[..., 0], Y[..., m]
    noise = (np.abs(Y[..., :m]) @ (4 * m * EPS * size)[..., None])[..., 0]
    noise += (rho / (1 - np.minimum(rho, 0.5)))[:, None] * (np.abs(alpha) + np.abs(gamma)).max(axis=-1, keepdims=True)
    low, high, base, width = (
        np.concatenate([x, np.full((n, 1), of_t)], axis=-1)
        for x, of_t in ((low, t_min), (high, t_max), (base, t_min), (width, length))
    )
    first, last = (low - base) / width, (high - base) / width
    flat, rising = np.abs(gamma) <= noise, gamma > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        to_first, to_last, error = (first - alpha) / gamma, (last - alpha) / gamma, noise / np.abs(gamma)
    enter = np.where(flat, -np.inf, np.where(rising, to_first, to_last))
    leave, error = np.where(flat, np.inf, np.where(rising, to_last, to_first)), np.where(flat, 0.0, error)
    out = (flat & ((alpha < first - 2 * noise) | (alpha > last + 2 * noise))).any(axis=-1)
    doubt = (flat & ~((alpha > first + 2 * noise) & (alpha < last - 2 * noise))).any(axis=-1)
    out |= (enter - error).max(axis=-1) > (leave + error).min(axis=-1)
    sure = (enter + error).max(axis=-1) < (leave - error).min(axis=-1)
    node = np.stack([np.argmax(enter, axis=-1), np.argmin(leave, axis=-1)], axis=1)
    s = np.stack([enter[rows, node[:, 0]], leave[rows, node[:, 1]]], axis=1)
    later, sooner = enter + error, leave - error  # which facet comes first has to be sure as well
    later[rows, node[:, 0]], sooner[rows, node[:, 1]] = -np.inf, np.inf
    sure &= later.max(axis=-1) < s[:, 0] - error[rows, node[:, 0]]
    sure &= sooner.min(axis=-1) > s[:, 1] + error[rows, node[:, 1]]
    decided = np.where(out, Found.NONE, np.where(sure & ~doubt, Found.ONE, Found.UNDECIDED))
    ends = alpha[:, None] + gamma[:, None] * np.where(np.isfinite(s), s, 0.0)[..., None]
    # the slip of the node that ends its piece is that end to the bit
    facets = np.stack([np.where(rising, low, high), np.where(rising, high, low)], axis=1)
    x = np.where(np.arange(m + 1) == node[..., None], facets, base[:, None] + width[:, None] * ends)
    u, t = np.where(free[:, None], x[..., :m], kink[:, None]), x[..., m]
    return Segments(np.where(rho < 0.01, decided, Found.UNDECIDED).astype(np.int8), u, t, node == m)
