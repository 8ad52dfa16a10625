"""Every branch of solutions over an interval of t, closed loops included, proved to be all or said why not.

`contact.boxes` finds all cells that may hold a solution for some t, with t as one more coordinate of its boxes: slabs
of t cover the interval and every step but a proof of emptiness keeps all solutions. In a cell the solutions are one
segment (`cell.segments`), and one that ends in a facet goes on in the cell behind it: the graph of all branches.

Checks of every graph: no segment ends where no other begins, and the number of solutions is odd at every t.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.all_solutions import is_stable
from tcstudy.contact.boxes import OVER_LOADS, Limits, PolygonProblems, reach_of
from tcstudy.contact.path.cell import Found, segments
from tcstudy.contact.path.problem import ParametricProblem
from tcstudy.laws.laws import Laws
from tcstudy.laws.pieces import BEND

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

SLABS = 16
"""Parts of the interval that the search begins from; each is proved, or given up, by itself."""
SAME = 1e-9
"""Share of the interval within which vertices count as one."""
_CELLS = 256


@dataclass(frozen=True, eq=False)
class Branch:
    """One branch: a polygon in (u, t) of k vertices, of a loop without its first one again at the end.

    t: (k,);  u: (k, m) [m];  stable: (pieces,) strict local minimum of L̃ inside each piece; of a loop there are k
    codes: (pieces, m) as in `ParametricProblem.graph`;  loop: whether it is closed
    """

    t: Array
    u: Array
    stable: Flags
    codes: NDArray[np.int32]
    loop: bool

    @cached_property
    def ends(self) -> tuple[Array, Array]:
        """t at both ends of every piece."""
        after = np.append(self.t[1:], self.t[:1]) if self.loop else self.t[1:]
        return self.t[: len(after)], after

    def at(self, t: float) -> tuple[Array, Index]:
        """(solutions (n, m) at t, pieces that they are on)."""
        begin, end = self.ends
        inside = np.flatnonzero((begin - t) * (end - t) < 0.0)
        share = ((t - begin[inside]) / (end - begin)[inside])[:, None]
        after = np.roll(self.u, -1, axis=0)[inside]
        return self.u[inside] + share * (after - self.u[inside]), inside


@dataclass(frozen=True, eq=False)
class Branches:
    """All branches between two values of t.

    reason: why they are not proved to be all, "" if they are;  boxes: number that was looked at
    """

    branches: tuple[Branch, ...]
    reason: str
    boxes: int

    @property
    def complete(self) -> bool:
        return not self.reason

    def count(self, t: float) -> int:
        """Number of solutions at t, which no vertex has."""
        return sum(len(branch.at(t)[1]) for branch in self.branches)


def all_branches(
    problem: ParametricProblem, begin: float, end: float, lambda_1: float, limits: Limits | None = None
) -> Branches:
    """Every branch for t from begin to end; limits are of each slab.

    Raises ValueError for laws with exponential pieces.
    """
    graph, law, limits = problem.graph, problem.law, limits or Limits()
    low, high = min(begin, end), max(begin, end)
    loads = np.stack([problem.load(low), problem.load(high)])
    reach = reach_of(problem.c, law, loads, lambda_1)
    per_s = (high - low) * problem.l_1
    boxes = PolygonProblems(problem.A_tilde, problem.c, law, np.tile(loads[0], (SLABS, 1)), reach, per_s)
    edge = np.linspace(0.0, 1.0, SLABS + 1)
    cells = boxes.search(boxes.whole(np.arange(SLABS), edge[:-1], edge[1:]), limits, OVER_LOADS)
    sides = np.unique(cells.sides, axis=0)
    codes = _codes(law, sides) + graph.first
    parts = [segments(problem, codes[i : i + _CELLS], low, high) for i in range(0, len(codes), _CELLS)]
    found, u, t, node, upper = (
        np.concatenate([getattr(part, name) for part in parts]) if parts else np.empty(0)
        for name in ("found", "u", "t", "node", "upper")
    )
    one, undecided = found == Found.ONE, int(np.count_nonzero(found == Found.UNDECIDED))
    sides, codes, u, t, node, upper = (x[one] for x in (sides, codes, u, t, node, upper))
    t = np.where(node == problem.m, np.where(upper, high, low), t)
    row = {code.tobytes(): i for i, code in enumerate(codes)}
    link = np.full((*node.shape, 2), -1, dtype=np.intp)  # the piece behind each end, and which of its ends meets it
    for i, h in np.argwhere(node < problem.m):
        code, j = codes[i].copy(), node[i, h]
        code[j] = (graph.after_high if upper[i, h] else graph.after_low)[code[j]]
        other = row.get(code.tobytes(), -1)
        meets = [g for g in (0, 1) if other >= 0 and node[other, g] == j]
        meets = [g for g in meets if (graph.after_high if upper[other, g] else graph.after_low)[code[j]] == codes[i, j]]
        link[i, h] = (other, meets[0]) if meets else (-2, 0)
    stable = is_stable(boxes, np.zeros(len(sides), dtype=np.intp), sides, lambda_1)
    branches = []
    left = np.ones(len(codes), dtype=bool)
    open_ends = [(int(i), int(h)) for i, h in np.argwhere(link[..., 0] < 0)]
    for i, h in [*open_ends, *((i, 0) for i in range(len(codes)))]:
        if left[i]:
            branches.append(_branch(i, h, link, left, (codes, u, t, stable)))
    missing = int(np.count_nonzero(link[..., 0] == -2))
    reason = _reason(cells.stopped, undecided, missing, edge, (low, high)) or _even(branches, (low, high))
    return Branches(tuple(branches), reason, int(cells.boxes.sum()))


def _even(branches: list[Branch], ends: tuple[float, float]) -> str:
    """A value with an even number of solutions, which the degree forbids; empty if there is none.

    Between vertices nearer than `SAME` of the interval nothing is asked: their own rounding may order them otherwise.
    """
    if not branches:
        return "no solution was found"
    begin, end = (np.concatenate(x) for x in zip(*(branch.ends for branch in branches), strict=True))
    low, high = np.sort(np.minimum(begin, end)), np.sort(np.maximum(begin, end))
    t = np.unique(np.concatenate([low, high, ends]))
    middle = 0.5 * (t[1:] + t[:-1])[np.diff(t) > SAME * (ends[1] - ends[0])]
    count = np.searchsorted(low, middle) - np.searchsorted(high, middle)
    even = np.flatnonzero(count % 2 == 0)
    return f"{count[even[0]]} solutions were found at {middle[even[0]]:g}, which must be odd" if len(even) else ""


def _branch(i: int, h: int, link: Index, left: Flags, found: tuple[NDArray[np.int32], Array, Array, Flags]) -> Branch:
    """The branch that begins at the end h of segment i, or goes through it; takes its segments from those left."""
    codes, u, t, stable = found
    way: list[tuple[int, int]] = []
    while i >= 0 and left[i]:
        left[i] = False
        way.append((i, h))
        i, h = link[i, 1 - h].tolist()
    loop = i >= 0
    pieces, first = (np.array(x, dtype=np.intp) for x in zip(*way, strict=True))
    t_all, u_all = t[pieces, first], u[pieces, first]
    if not loop:
        t_all = np.append(t_all, t[pieces[-1], 1 - first[-1]])
        u_all = np.concatenate([u_all, u[pieces[-1:], 1 - first[-1]]])
    return Branch(t_all, u_all, stable[pieces], codes[pieces], loop)


def _codes(law: Laws, sides: Index) -> NDArray[np.int32]:
    """Codes within a law's graph of sides (n, m) of its polygon, which leaves out jumps that are none."""
    tables = law.tables
    kept = np.ones((len(tables.kinks), 2 * tables.kinks.shape[1] + 1), dtype=bool)
    kept[:, 1::2] = tables.kinds != BEND
    order = np.argsort(~kept, axis=-1, kind="stable")
    of_node = np.zeros(sides.shape[1], dtype=np.intp) if law.one else law.node_index(sides.shape[1])
    return np.asarray(order[of_node, sides], dtype=np.int32)


def _reason(stopped: Flags, undecided: int, missing: int, edge: Array, ends: tuple[float, float]) -> str:
    """Why the branches are not proved to be all; empty if they are."""
    if np.any(stopped):
        t = ends[0] + (ends[1] - ends[0]) * edge
        parts = [f"{t[k]:g} to {t[k + 1]:g}" for k in np.flatnonzero(stopped)]
        return f"the limit of boxes or time was met where the parameter is {', '.join(parts)}"
    if undecided or missing:
        what = "a segment through a corner of its cell, as exact symmetry makes them, or a singular piece"
        return f"{undecided or missing} cells cannot be decided within rounding ({what})"
    return ""
