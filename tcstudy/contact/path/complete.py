"""Every branch of solutions over an interval of t, closed loops included, proved to be all or said why not.

`contact.boxes` finds all cells that may hold a solution for some t, with t as one more coordinate of its boxes: slabs
of t cover the interval and every step but a proof of emptiness keeps all solutions. In a cell the solutions are one
segment (`cell.segments`), and one that ends in a facet goes on in the cell behind it: the graph of all branches.

Checks of every graph: no segment ends where no other begins, and the number of solutions is odd at every t.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.all_solutions import Equilibria, all_solutions, is_stable
from tcstudy.contact.boxes import OVER_LOADS, Limits, PolygonProblems, reach_of
from tcstudy.contact.path.cell import Found, Segments, segments
from tcstudy.contact.path.problem import ParametricProblem
from tcstudy.contact.path.query import solutions_at
from tcstudy.contact.path.record import Path, PathStatus
from tcstudy.laws.pieces import BEND

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]
Codes = NDArray[np.int32]

SLABS = 16
"""Parts of the interval that the search begins from; each is proved, or given up, by itself."""
SAME = 1e-9
"""Share of the interval within which vertices count as one."""
MOST_CELLS = 20_000
"""To which unfinished branches are followed."""
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
        from cell to cell like what was found of unfinished branches, so that every branch known is whole.
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
    stopped, codes = bool(np.any(cells.stopped)), _codes(problem, np.unique(cells.sides, axis=0))
    listed = [all_solutions(problem.at(t), limits) if stopped or not low <= t <= high else None for t in at]
    inside = [x.sides for t, x in zip(at, listed, strict=True) if x is not None and low <= t <= high]
    if inside:
        codes = np.unique(np.concatenate([codes, _codes(problem, np.concatenate(inside))]), axis=0)
    found = _segments(problem, codes, low, high)
    if stopped:
        codes, found = _grown(problem, codes, found, low, high)
    one, undecided = found.found == Found.ONE, int(np.count_nonzero(found.found == Found.UNDECIDED))
    codes, (_, u, t, node, upper) = codes[one], (x[one] for x in found)
    t = np.where(node == problem.m, np.where(upper, high, low), t)
    row = {code.tobytes(): i for i, code in enumerate(codes)}
    link = np.full((*node.shape, 2), -1, dtype=np.intp)  # the piece behind each end, and which of its ends meets it
    for i, h in np.argwhere(node < problem.m):
        code, j = _behind(problem, codes[i], node[i, h], upper[i, h]), node[i, h]
        other = row.get(code.tobytes(), -1)
        meets = [g for g in (0, 1) if other >= 0 and node[other, g] == j]
        meets = [g for g in meets if _behind(problem, code, j, upper[other, g])[j] == codes[i, j]]
        link[i, h] = (other, meets[0]) if meets else (-2, 0)
    stable = is_stable(boxes, np.zeros(len(codes), dtype=np.intp), _sides(problem, codes), lambda_1)
    branches = []
    left = np.ones(len(codes), dtype=bool)
    open_ends = [(int(i), int(h)) for i, h in np.argwhere(link[..., 0] < 0)]
    for i, h in [*open_ends, *((i, 0) for i in range(len(codes)))]:
        if left[i]:
            branches.append(_branch(problem, i, h, link, left, (codes, u, t, stable)))
    missing = int(np.count_nonzero(link[..., 0] == -2))
    reason = _reason(cells.stopped, undecided, missing, edge, (low, high)) or _even(branches, (low, high))
    return Branches(tuple(branches), reason, int(cells.boxes.sum()), tuple(listed))


def _segments(problem: ParametricProblem, codes: Codes, low: float, high: float) -> Segments:
    """`segments` of many cells, some at a time."""
    parts = [segments(problem, codes[i : i + _CELLS], low, high) for i in range(0, max(len(codes), 1), _CELLS)]
    return Segments(*map(np.concatenate, zip(*parts, strict=True)))


def _behind(problem: ParametricProblem, code: Codes, node: int, upper: bool) -> Codes:
    """The cell behind a facet of another."""
    behind = code.copy()
    behind[node] = (problem.graph.after_high if upper else problem.graph.after_low)[code[node]]
    return behind


def _grown(
    problem: ParametricProblem, codes: Codes, found: Segments, low: float, high: float
) -> tuple[Codes, Segments]:
    """Cells and their segments with all that segments go on in, at most `MOST_CELLS`."""
    known, parts = {code.tobytes() for code in codes}, [(codes, found)]
    while len(codes) and len(known) < MOST_CELLS:
        more = dict[bytes, Codes]()
        for i, h in np.argwhere((found.node < problem.m) & (found.found == Found.ONE)[:, None]):
            behind = _behind(problem, codes[i], found.node[i, h], found.upper[i, h])
            more[behind.tobytes()] = behind
        codes = np.array([code for key, code in more.items() if key not in known], np.int32).reshape(-1, problem.m)
        found = _segments(problem, codes, low, high)
        known |= more.keys()
        parts.append((codes, found))
    all_codes, all_found = zip(*parts, strict=True)
    return np.concatenate(all_codes), Segments(*map(np.concatenate, zip(*all_found, strict=True)))


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


def _branch(
    problem: ParametricProblem, i: int, h: int, link: Index, left: Flags, found: tuple[Codes, Array, Array, Flags]
) -> Path:
    """The branch that begins at the end h of segment i, or goes through it; takes its segments from those left."""
    codes, u, t, stable = found
    way: list[tuple[int, int]] = []
    while i >= 0 and left[i]:
        left[i] = False
        way.append((i, h))
        i, h = link[i, 1 - h].tolist()
    end = PathStatus.CLOSED_LOOP if i >= 0 else PathStatus.RANGE_END if i == -1 else PathStatus.SINGULAR
    pieces, first = (np.array(x, dtype=np.intp) for x in zip(*way, strict=True))
    last = (pieces[:1], first[:1]) if i >= 0 else (pieces[-1:], 1 - first[-1:])
    t, u = (np.concatenate([x[pieces, first], x[last]]) for x in (t, u))
    return Path.through(problem, t, u, stable[pieces], codes[pieces], end)


def _kept(problem: ParametricProblem) -> Flags:
    """(m, …) places of the graph of every node that are sides of its polygon, which leaves out jumps that are none."""
    tables = problem.law.tables
    kept = np.ones((len(tables.kinks), 2 * tables.kinks.shape[1] + 1), dtype=bool)
    kept[:, 1::2] = tables.kinds != BEND
    return kept[np.zeros(problem.m, dtype=np.intp) if problem.law.one else problem.law.node_index(problem.m)]


def _codes(problem: ParametricProblem, sides: Index) -> Codes:
    """Codes within the laws' graphs of sides (n, m) of their polygons."""
    order = np.argsort(~_kept(problem), axis=-1, kind="stable")
    return np.asarray(order[np.arange(problem.m), sides] + problem.graph.first, dtype=np.int32)


def _sides(problem: ParametricProblem, codes: Codes) -> Index:
    """Sides (n, m) of the polygons, whose codes these are."""
    return np.asarray((np.cumsum(_kept(problem), axis=-1) - 1)[np.arange(problem.m), codes - problem.graph.first])


def _reason(stopped: Flags, undecided: int, missing: int, edge: Array, ends: tuple[float, float]) -> str:
    """Why the branches are not proved to be all; empty if they are."""
    if np.any(stopped):
        t = ends[0] + (ends[1] - ends[0]) * edge
        turns = np.flatnonzero(np.diff(stopped, prepend=False, append=False))
        parts = [f"{t[i]:g} to {t[j]:g}" for i, j in turns.reshape(-1, 2)]
        return f"the limit of boxes or time was met where the parameter is {', '.join(parts)}"
    if undecided or missing:
        what = "a segment through a corner of its cell, as exact symmetry makes them, or a singular piece"
        return f"{undecided or missing} cells cannot be decided within rounding ({what})"
    return ""
