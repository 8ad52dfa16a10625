"""Every branch of solutions over an interval of t, closed loops included, proved to be all or said why not.

`contact.all_solutions` finds all cells that may hold a solution for some t, as problems with a load that varies: slabs
of t cover the interval and every step but a proof of emptiness keeps all solutions. In a cell the solutions are one
segment: branches are followed from those that begin at an end of the interval, loops from what is left.

Checks of every graph: every cell that a branch goes through is one that has a segment, no segment is on no branch, no
branch ends inside, and the number of solutions is odd where the interval begins, so that it is everywhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.all_solutions import Equilibria, Limits, PolygonProblems, all_solutions
from tcstudy.contact.path.follow import Follower
from tcstudy.contact.path.problem import ParametricProblem, Path, PathStatus
from tcstudy.contact.path.query import solutions_at
from tcstudy.laws.pieces import BEND
from tcstudy.scene.study import Direction

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

SLABS = 16
"""Parts of the interval that the search begins from; each is proved, or given up, by itself."""
MOST_PIECES = 20_000
"""Of a branch to either side of where it was found."""


@dataclass(frozen=True, eq=False)
class Branches:
    """All branches between two values of t.

    branches: a loop has its first vertex again at the end, and the status CLOSED_LOOP
    reason: why they are not proved to be all, "" if they are
    listed: solutions at the values asked for for which the branches do not answer
    """

    branches: tuple[Path, ...]
    reason: str
    listed: Mapping[float, Equilibria]

    @property
    def complete(self) -> bool:
        return not self.reason

    def solutions(self, t: float) -> list[tuple[Array, bool]]:
        """(v (m,), stable) of all that are known at t; those listed by themselves may be on branches as well."""
        known = [(one.v, one.stable) for branch in self.branches for one in solutions_at(branch, t)]
        one = self.listed.get(t)
        return known if one is None else [*known, *zip(one.v, one.stable.tolist(), strict=True)]

    def complete_at(self, t: float) -> bool:
        """Whether these are proved to be all at a value that was asked for."""
        return self.listed[t].complete if t in self.listed else self.complete


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
    limits, low, high = limits or Limits(), min(begin, end), max(begin, end)
    edge, per_s = np.linspace(0.0, 1.0, SLABS + 1), (high - low) * problem.l_1
    loads = problem.load(low) + 0.5 * (edge[1:] + edge[:-1])[:, None] * per_s
    boxes = PolygonProblems(problem.A_tilde, problem.c, problem.law, loads, lambda_1, per_s * 0.5 / SLABS)
    cells = boxes.search(limits)
    stopped = bool(np.any(cells.stopped))
    listed = {t: all_solutions(problem.at(t), limits) for t in at if stopped or not low <= t <= high}
    inside = [x.sides for t, x in listed.items() if low <= t <= high]
    sides = np.unique(np.concatenate([cells.sides, *inside]), axis=0)
    found = boxes.segments(np.zeros(len(sides), dtype=np.intp), sides, problem.load(low)[None], per_s)
    one, undecided = found.one, int(np.count_nonzero(~(found.one | found.none)))
    keys, u, s, open_end = [row.tobytes() for row in sides[one]], found.u[one], found.s[one], found.open_end[one]
    on_branch, branches, missing = set[bytes](), list[Path](), 0
    follower, side_of = Follower(low, high, MOST_PIECES), _sides(problem)
    for i, h in [*np.argwhere(open_end).tolist(), *((i, 0) for i in range(len(keys)))]:
        if keys[i] in on_branch:
            continue
        t = high if s[i, h] == 1.0 else low + float(s[i, h]) * (high - low)
        way: Direction = ("forward" if t == low else "backward") if open_end[i, h] else "both"
        branch = follower.follow(problem, u[i, h], t, way)
        through = {row.tobytes() for row in side_of[branch.codes]} | {keys[i]}
        ends = {branch.begin, branch.end} - {PathStatus.START}
        missing += len(through.difference(keys))
        missing += len(ends) > 1 or not ends <= {PathStatus.RANGE_END, PathStatus.CLOSED_LOOP}
        on_branch |= through
        branches.append(branch)
    count = sum(float(t) == low for branch in branches for t in branch.t[[0, -1]])
    reason = _reason(cells.stopped, undecided or missing, edge, (low, high))
    reason = reason or ("" if count % 2 else f"{count} solutions were found at {low:g}, which must be odd")
    return Branches(tuple(branches), reason, listed)


def _sides(problem: ParametricProblem) -> Index:
    """Side of its polygon that every code of the laws' graph is; the polygons leave out jumps that are none."""
    kinds = problem.law.tables.kinds
    kept = np.ones((len(kinds), 2 * kinds.shape[1] + 1), dtype=bool)
    kept[:, 1::2] = kinds != BEND
    return np.asarray((np.cumsum(kept, axis=-1) - 1).ravel(), dtype=np.intp)


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
