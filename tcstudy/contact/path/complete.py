"""Every branch of solutions over an interval of t, closed loops included, proved to be all or said why not.

`contact.all_solutions` finds all cells that may hold a solution for some t, as problems with a load that varies: slabs
of t cover the interval and every step but a proof of emptiness keeps all solutions. In a cell the solutions are one
segment (`segments`): branches are followed from those that begin at an end of the interval, loops from what is left.

Checks of every graph: every cell that a branch goes through is one that has a segment, no segment is on no branch, no
branch ends inside, and the number of solutions is odd at every t.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.all_solutions import (
    EPS,
    Equilibria,
    Limits,
    PolygonProblems,
    all_solutions,
    inverse_of,
)
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
SAME = 1e-9
"""Share of the interval within which vertices count as one."""
MOST_PIECES = 20_000
"""Of a branch to either side of where it was found."""
_CELLS = 256


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
    cuts, load = range(0, max(len(sides), 1), _CELLS), problem.load(low)
    parts = [segments(boxes, load, per_s, sides[i : i + _CELLS]) for i in cuts]
    found = Segments(*map(np.concatenate, zip(*parts, strict=True)))
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
    reason = _reason(cells.stopped, undecided or missing, edge, (low, high)) or _even(branches, (low, high))
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


class Segments(NamedTuple):
    """The solutions of n cells.

    one, none: (n,) proved to have one segment, or no solution; else a corner is within rounding, or rank is lost
    u:     (n, 2, m) displacements at both ends [m];  s: (n, 2) share of the interval there; without `one` these and
    open_end: (n, 2), whether s reaches an end of the interval there, which it then is to the bit, mean nothing
    """

    one: Flags
    none: Flags
    u: Array
    s: Array
    open_end: Flags


def segments(problems: PolygonProblems, load: Array, per_s: Array, sides: Index) -> Segments:
    """The exact segment of every cell, of which the nodes are on these sides (n, m), for loads from s = 0 to 1.

    Places τ_i on the sides and s, in units of the columns, are x with m equations N x = r: one line x = α + γ σ, σ
    along the direction of the line, about, which the last row of B = [N; γᵀ] adds; it is cut by the ends 0 and 1.
    Proof: with Y the inverse of B, ‖I − YB‖ < 0.01 bounds the error of every coordinate; `one` and `none` hold whatever
    rounding does within that.
    Sources: Cottle, Pang & Stone, The Linear Complementarity Problem (1992), §2.3 (principal pivots); Rump, Acta Numer.
    19 (2010) 287–449, §10 (verified linear systems).
    """
    (n, m), c, rows = sides.shape, problems.c, np.arange(len(sides))
    first = np.zeros(n, dtype=np.intp)
    p = problems.at(first, sides.astype(float))
    D = problems.at(first, sides.astype(float) + 1.0) - p
    M, size, scale = problems.matrix(D)
    l_1, largest = np.abs(per_s), np.abs(p) + np.abs(D)
    scale = np.concatenate([scale, np.full((n, 1), l_1.max())], axis=-1)
    N = np.concatenate([M, np.broadcast_to(-per_s[:, None], (n, m, 1))], axis=-1)
    unit = np.abs(N / scale[:, None]).max(axis=-1)
    N /= unit[..., None]
    line = np.linalg.qr((N / scale[:, None]).swapaxes(1, 2), mode="complete")[0][..., m] * scale

    def products(w: Array) -> Array:
        return np.column_stack([(size(w[:, :m]) + l_1 * w[:, m:]) / unit, np.sum(np.abs(line * w), axis=-1)])

    Y, share = inverse_of(np.concatenate([N, line[:, None]], axis=1), products, scale)
    r = (load - p[..., 0] @ problems.A - c * p[..., 1]) / unit
    off = 4.0 * (m + 8) * EPS * (np.abs(load) + largest[..., 0] @ problems.size_of_A + c * largest[..., 1]) / unit
    alpha, gamma = (Y[..., :m] @ r[..., None])[..., 0], Y[..., m]
    noise, far = (np.abs(Y[..., :m]) @ off[..., None])[..., 0], np.sqrt(m + 1.0) * scale.max(axis=-1, keepdims=True)
    terms = np.abs(alpha) + noise + far * np.abs(gamma)
    proved = np.isfinite(share)
    noise += np.where(proved, share, 0.0)[:, None] * terms.max(axis=-1, keepdims=True)
    flat, rising = far * np.abs(gamma) <= noise, gamma > 0.0
    alpha, gamma, noise = alpha / scale, gamma / scale, noise / scale
    with np.errstate(divide="ignore", invalid="ignore"):
        to_0, to_1, error = -alpha / gamma, (1.0 - alpha) / gamma, np.where(flat, 0.0, noise / np.abs(gamma))
    enter = np.where(flat, -np.inf, np.where(rising, to_0, to_1))
    leave = np.where(flat, np.inf, np.where(rising, to_1, to_0))
    out = (flat & ((alpha < -2.0 * noise) | (alpha > 1.0 + 2.0 * noise))).any(axis=-1)
    doubt = (flat & ~((alpha > 2.0 * noise) & (alpha < 1.0 - 2.0 * noise))).any(axis=-1)
    out |= (enter - error).max(axis=-1) > (leave + error).min(axis=-1)
    sure = (enter + error).max(axis=-1) < (leave - error).min(axis=-1)
    node = np.stack([np.argmax(enter, axis=-1), np.argmin(leave, axis=-1)], axis=1)
    ends = np.stack([enter[rows, node[:, 0]], leave[rows, node[:, 1]]], axis=1)
    later, sooner = enter + error, leave - error  # which facet comes first has to be sure as well
    later[rows, node[:, 0]], sooner[rows, node[:, 1]] = -np.inf, np.inf
    sure &= later.max(axis=-1) < ends[:, 0] - error[rows, node[:, 0]]
    sure &= sooner.min(axis=-1) > ends[:, 1] + error[rows, node[:, 1]]
    none, one = out & proved, sure & ~doubt & ~out & proved
    x = alpha[:, None] + gamma[:, None] * np.where(np.isfinite(ends), ends, 0.0)[..., None]
    facets = np.stack([~rising, rising], axis=1).astype(float)
    x = np.where(np.arange(m + 1) == node[..., None], facets, x)
    u = p[:, None, :, 0] + x[..., :m] * D[:, None, :, 0]
    return Segments(one, none, u, x[..., m], node == m)
