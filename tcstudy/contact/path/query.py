"""Questions to a path: its solutions at one t, those of the true smooth law, folds, the least
energy proved; and every branch of solutions over an interval of t, closed loops included, proved to
be all or said why not.

Folds: a turn of t and its neighbour that comes back the least are one small step back: such pairs
are taken away, smallest first, as long as they step back too little (persistence, Edelsbrunner,
Letscher & Zomorodian, Discrete Comput. Geom. 28 (2002) 511–533). So a wiggle at a large fold goes,
and the fold itself stays.

Least energy: the lower envelope of parabolas, exact up to rounding. Along a piece dL̃/dt = −W with
W = l̃₁ᵀu linear in t, so L̃ is a parabola of t there; where two of them cross (a Maxwell point) the
lowest solution changes without a fold.

Branches: `contact.all_solutions` finds all cells that may hold a solution for some t, as problems
with a load that varies: slabs of t cover the interval and every step but a proof of emptiness keeps
all solutions. In a cell the solutions are one segment: branches are followed from those that begin
at an end of the interval, loops from what is left. Checked: every cell that a branch goes through
is one that has a segment, no segment is on no branch, no branch ends inside, and the number of
solutions is odd where the interval begins, so that it is everywhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.all_solutions import (
    Equilibria,
    Limits,
    PolygonProblems,
    sides_of_codes,
    unproved,
)
from tcstudy.contact.certificates import Proofs
from tcstudy.contact.path.follow import Follower
from tcstudy.contact.path.problem import ParametricProblem, Path, PathStatus
from tcstudy.contact.path.smooth import SmoothPath
from tcstudy.contact.solution import Acceptance, polished
from tcstudy.contact.solve import known_solutions
from tcstudy.laws.laws import Laws
from tcstudy.scene.path_plan import Direction

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Flags = NDArray[np.bool_]

CARRIED = 1e-9
"""A solution of straight pieces has led to one of the law itself if the residual is no larger."""


def folds(path: Path, least: float) -> Index:
    """Vertices at which t turns and steps back by this much or more."""
    t, left = path.t, [0, *path.folds.tolist(), path.pieces]
    while len(left) > 3:
        steps = np.abs(np.diff(t[left]))[1:-1]
        at = int(np.argmin(steps))
        if steps[at] >= least:
            break
        del left[at + 1 : at + 3]
    none = len(left) == 3 and np.abs(np.diff(t[left])).min() < least
    return np.array([] if none else left[1:-1], dtype=np.intp)


class PathSolution(NamedTuple):
    """One solution on a path.

    v:      (m,) displacements [m]
    stable: strict local minimum of L̃ (at a vertex: on both sides)
    piece:  index of the piece of the path that holds it
    """

    v: Array
    stable: bool
    piece: int


def solutions_at(path: Path, t: float) -> list[PathSolution]:
    """All solutions of the path at t in its order; a vertex counts once.

    Along a piece on which t stands still all points are solutions of the same t: its two ends are
    returned.
    """
    low, high = np.minimum(path.t[:-1], path.t[1:]), np.maximum(path.t[:-1], path.t[1:])
    found, last = list[PathSolution](), -1.0
    for piece in np.flatnonzero((low <= t) & (t <= high)).tolist():
        (t_0, t_1), (begin, end) = path.t[piece : piece + 2], path.u[piece : piece + 2]
        for s in (0.0, 1.0) if t_0 == t_1 else (float((t - t_0) / (t_1 - t_0)),):
            before = (
                found.pop().stable if piece + s == last else True
            )  # the vertex between two pieces
            v, last = end if s == 1.0 else begin + s * (end - begin), piece + s
            found.append(PathSolution(v, before and bool(path.stable[piece]), piece))
    return found


def solutions_of(law: Laws, path: Path, t: float) -> list[PathSolution]:
    """The solutions of the law that the path's law approximates, by Newton's method from those of
    the path.

    Each node keeps its place: on the same jump, or on the piece of `law` in which it lies. A
    solution that does not carry over (its residual says so) is polished on the pieces identified
    there; judge every answer by its residual.
    """
    problem, curve, found = (
        path.problem.with_law(law).at(t),
        SmoothPath(path, law),
        list[PathSolution](),
    )
    for solution in solutions_at(path, t):
        point = curve.at(solution.piece, (np.zeros(problem.m), 1.0), t, solution.v, t)
        v, residual = (
            (solution.v, np.inf)
            if point is None
            else (point.v, problem.inclusion_residual(point.v))
        )
        if (
            not residual <= CARRIED
            and (other := polished(problem, solution.v, exact=False)).residual < residual
        ):
            v = other.v
        found.append(solution._replace(v=v))
    return found


SHORT = 1e-13
"""Intervals below this part of the range of t are vertices that differ by rounding."""


class Lowest(NamedTuple):
    """The lowest solutions of a path, by growing t: piece[i] is lowest for begin[i] ≤ t ≤ end[i],
    all (n,)."""

    begin: Array
    end: Array
    piece: Index


def lowest(path: Path) -> Lowest:
    """The piece of least energy among all solutions on the path, for every t that it reaches."""
    values, (t, energy, w) = np.unique(path.t), (path.t, path.energy, path.conjugate)
    low, high = np.minimum(t[:-1], t[1:]), np.maximum(t[:-1], t[1:])
    found: list[tuple[float, float, int]] = []
    for a, b in pairwise(values):
        k = np.flatnonzero((low <= a) & (high >= b))
        if b - a <= SHORT * (values[-1] - values[0]) or not len(k):
            continue
        slope = (w[k + 1] - w[k]) / (t[k + 1] - t[k])
        at_a = w[k] + slope * (a - t[k])
        e = energy[k] - 0.5 * (w[k] + at_a) * (
            a - t[k]
        )  # L̃ = e + f s + g s², s = 0 at a and 1 at b
        for s_0, s_1, i in _envelope(e, -at_a * (b - a), -0.5 * slope * (b - a) ** 2):
            begin, end, piece = a + s_0 * (b - a), a + s_1 * (b - a), int(k[i])
            if found and found[-1][2] == piece:
                begin = found.pop()[0]
            found.append((begin, end, piece))
    columns = list(zip(*found, strict=True)) or [(), (), ()]
    return Lowest(np.array(columns[0]), np.array(columns[1]), np.array(columns[2], dtype=np.intp))


def _envelope(e: Array, f: Array, g: Array) -> list[tuple[float, float, int]]:
    """(from, to, which) of the lower envelope of e + f s + g s² on 0 ≤ s ≤ 1."""
    noise = 1e-13 * float(np.max(np.abs(e) + np.abs(f) + np.abs(g)))
    s, parts, now = 0.0, [], int(np.argmin(e - np.min(e) + f * 1e-6 + g * 1e-12))
    for _ in range(2 * len(e) + 1):
        d, h, q = (
            e - e[now],
            f - f[now],
            g - g[now],
        )  # which others fall through zero first beyond s?
        root = np.sqrt(np.maximum(h * h - 4.0 * d * q, 0.0))
        half = -0.5 * (h + np.where(h >= 0.0, root, -root))
        with np.errstate(divide="ignore", invalid="ignore"):
            x = np.stack([half / q, d / half])
            falls = (h + 2.0 * q * x < 0.0) & (h * h > 4.0 * d * q) & (x > s + 1e-9) & (x < 1.0)
        falls &= np.minimum(d + h + q, 0.0) < -noise  # a branch that only touches is no change
        x = np.where(falls, x, np.inf).min(axis=0)
        which = int(np.argmin(x))
        if not x[which] < 1.0:
            break
        parts.append((s, float(x[which]), now))
        s, now = float(x[which]), which
    return [*parts, (s, 1.0, now)]


AT_ONCE = 2**20
"""Entries of the arrays of solutions that are proved together."""


def proved_minima(
    path: Path, low: Lowest, lambda_1: float, acceptance: Acceptance
) -> NDArray[np.bool_]:
    """(n,) whether the lowest solution in the middle of every interval is proved to have the least
    energy of all.

    lambda_1: λ_min(C^{−½}ÃC^{−½}) [Pa/m];  acceptance: which residual makes a solution
    """
    proved = np.zeros(len(low.piece), dtype=bool)
    for own in np.array_split(np.arange(len(proved)), 1 + len(proved) * path.problem.m // AT_ONCE):
        t, k = 0.5 * (low.begin + low.end)[own], low.piece[own]
        share = (t - path.t[k]) / (path.t[k + 1] - path.t[k])
        v = path.u[k] + share[:, None] * (path.u[k + 1] - path.u[k])
        rows = path.problem.rows(t, lambda_1)
        solved, proofs = (
            acceptance.accepts(rows.inclusion_residual(v), rows.xi_rounding(v)),
            Proofs(rows),
        )
        proofs.prove_lowest(np.flatnonzero(solved), v)
        proved[own] = solved & (proofs.unique | proofs.lowest)
    return proved


# -- all branches of a range
# -------------------------------------------------------------------------------------------

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
        """(v (m,), stable) of all that are known at t; those listed by themselves may be on
        branches as well."""
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

    at: values of t whose solutions are to be known. Where the search of all branches does not
    answer for one, as its
        limits are met or the value is outside, the solutions there are listed by themselves; those
        inside are followed
        like what was found of unfinished branches, so that every branch known is whole.
    Raises ValueError for laws with exponential pieces.
    """
    limits, low, high = limits or Limits(), min(begin, end), max(begin, end)
    problem = problem.without_narrow_pieces
    edge, per_s = np.linspace(0.0, 1.0, SLABS + 1), (high - low) * problem.l_1
    loads = problem.load(low) + 0.5 * (edge[1:] + edge[:-1])[:, None] * per_s
    boxes = PolygonProblems(
        problem.A_tilde, problem.c, problem.law, loads, lambda_1, per_s * 0.5 / SLABS
    )
    cells = boxes.search(limits)
    stopped = bool(np.any(cells.stopped))
    listed = {
        t: known_solutions(problem.at(t), limits) for t in at if stopped or not low <= t <= high
    }
    inside = [x.sides for t, x in listed.items() if low <= t <= high]
    sides = np.unique(np.concatenate([cells.sides, *inside]), axis=0)
    found = boxes.segments(
        np.zeros(len(sides), dtype=np.intp), sides, problem.load(low)[None], per_s
    )
    one, undecided = found.one, int(np.count_nonzero(~(found.one | found.none)))
    keys, u, s, open_end = (
        [row.tobytes() for row in sides[one]],
        found.u[one],
        found.s[one],
        found.open_end[one],
    )
    on_branch, branches, missing = set[bytes](), list[Path](), 0
    follower, side_of = Follower(low, high, MOST_PIECES), sides_of_codes(problem.law)
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
    count, limit = sum(float(t) == low for branch in branches for t in branch.t[[0, -1]]), ""
    if stopped:
        t_of, turns = (
            low + (high - low) * edge,
            np.flatnonzero(np.diff(cells.stopped, prepend=False, append=False)),
        )
        parts = [f"{t_of[i]:g} to {t_of[j]:g}" for i, j in turns.reshape(-1, 2)]
        limit = f"boxes or time was met where the parameter is {', '.join(parts)}"
    reason = unproved(limit, undecided or missing, count)
    return Branches(tuple(branches), reason, listed)
