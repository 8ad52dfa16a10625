"""Questions to a path: solutions at one t, folds, least energy; all branches of a range, proved.

Folds: a turn of t and its neighbour to which it steps back the least make one small step back. Such
pairs are taken away, smallest first, as long as they step back too little (persistence,
Edelsbrunner, Letscher & Zomorodian, Discrete Comput. Geom. 28 (2002) 511–533). So a wiggle at a
large fold goes, and the fold itself stays.

Least energy: the lower envelope of parabolas, exact up to rounding. Along a piece dL̃/dt = −W with
W = l̃₁ᵀu linear in t, so L̃ is a parabola of t there. Where two of them cross (a Maxwell point) the
lowest solution changes without a fold.

Branches: `contact.all_solutions` finds all cells that may hold a solution for some t, as problems
with a load that varies: slabs of t cover the interval, and every step but a proof of emptiness
keeps all solutions. Slabs of many boxes are searched by soft modes (contact/branch_search.py). In a
cell the solutions are one segment. Branches are followed from those that
begin at an end of the interval, loops from what is left. Checked: every cell that a branch goes
through is one that has a segment, no segment is on no branch, no branch ends inside, and the number
of solutions is odd where the interval begins, so that it is everywhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.all_solutions import Equilibria, searched, sides_of_codes, unproved
from tcstudy.contact.boxes import Limits, PolygonProblems, Segments
from tcstudy.contact.branch_search import branch_cells
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

MAX_CARRIED_RESIDUAL = 1e-9
"""Largest residual of a solution of the law itself that one of straight pieces has led to."""


def folds(path: Path, least: float) -> Index:
    """Return the vertices at which t turns and steps back by `least` or more."""
    t = path.t
    vertices = [0, *path.folds.tolist(), path.pieces]  # turns of t between the ends of the path
    while len(vertices) > 3:
        steps = np.abs(np.diff(t[vertices]))[1:-1]
        smallest = int(np.argmin(steps))
        if steps[smallest] >= least:
            break
        del vertices[smallest + 1 : smallest + 3]
    turns = vertices[1:-1]
    if len(turns) == 1 and np.abs(np.diff(t[vertices])).min() < least:
        turns = []
    return np.array(turns, dtype=np.intp)


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
    """Return all solutions of the path at t in its order; a vertex counts once.

    Along a piece on which t stands still all points are solutions of the same t: its two ends are
    returned.
    """
    low, high = _ranges(path)
    solutions = list[PathSolution]()
    last_place = -1.0
    for piece in np.flatnonzero((low <= t) & (t <= high)).tolist():
        t_begin, t_end = path.t[piece : piece + 2]
        u_begin, u_end = path.u[piece : piece + 2]
        if t_begin == t_end:
            shares = [0.0, 1.0]
        else:
            shares = [float((t - t_begin) / (t_end - t_begin))]
        for share in shares:
            stable = bool(path.stable[piece])
            place = piece + share
            if place == last_place:  # the vertex between two pieces
                stable = solutions.pop().stable and stable
            v = u_end if share == 1.0 else u_begin + share * (u_end - u_begin)
            solutions.append(PathSolution(v, stable, piece))
            last_place = place
    return solutions


def _ranges(path: Path) -> tuple[Array, Array]:
    """Return (k,) the smallest and the largest t of every piece."""
    begin = path.t[:-1]
    end = path.t[1:]
    return np.minimum(begin, end), np.maximum(begin, end)


def solutions_of(law: Laws, path: Path, t: float) -> list[PathSolution]:
    """Return the solutions of the law that the path's law approximates, from those of the path.

    Newton's method keeps each node on the same jump, or on the piece of `law` in which it lies. A
    solution that does not carry over (its residual says so) is polished on the pieces identified
    there; judge every answer by its residual.
    """
    problem = path.problem.with_law(law).at(t)
    curve = SmoothPath(path, law)
    measures_t = np.zeros(problem.m), 1.0
    solutions = list[PathSolution]()
    for solution in solutions_at(path, t):
        v = solution.v
        residual = np.inf
        point = curve.at(solution.piece, measures_t, t, v, t)
        if point is not None:
            v = point.v
            residual = problem.inclusion_residual(v)
        if not residual <= MAX_CARRIED_RESIDUAL:
            candidate = polished(problem, solution.v, exact=False)
            if candidate.residual < residual:
                v = candidate.v
        solutions.append(solution._replace(v=v))
    return solutions


MIN_INTERVAL = 1e-13
"""Shorter intervals, relative to the range of t, are vertices that differ by rounding."""


class Lowest(NamedTuple):
    """The lowest solutions of a path, by growing t, all (n,).

    piece[i] is lowest for begin[i] ≤ t ≤ end[i].
    """

    begin: Array
    end: Array
    piece: Index


def lowest(path: Path) -> Lowest:
    """Return the piece of least energy among all solutions on the path, for every t it reaches."""
    t = path.t
    energy = path.energy
    W = path.conjugate
    low, high = _ranges(path)
    values = np.unique(t)
    min_width = MIN_INTERVAL * (values[-1] - values[0])
    begins = list[float]()
    ends = list[float]()
    pieces = list[int]()
    for a, b in pairwise(values):
        candidates = np.flatnonzero((low <= a) & (high >= b))
        width = b - a
        if width <= min_width or not len(candidates):
            continue
        t_0 = t[candidates]
        W_0 = W[candidates]
        slope = (W[candidates + 1] - W_0) / (t[candidates + 1] - t_0)
        W_a = W_0 + slope * (a - t_0)
        # L̃ = e + f s + g s², s = 0 at a and 1 at b
        e = energy[candidates] - 0.5 * (W_0 + W_a) * (a - t_0)
        for s_begin, s_end, i in _envelope(e, -W_a * width, -0.5 * slope * width**2):
            piece = int(candidates[i])
            end = a + s_end * width
            if pieces and pieces[-1] == piece:
                ends[-1] = end
            else:
                begins.append(a + s_begin * width)
                ends.append(end)
                pieces.append(piece)
    return Lowest(np.array(begins), np.array(ends), np.array(pieces, dtype=np.intp))


MIN_ADVANCE = 1e-9
"""Parabolas that cross within this share behind the last crossing do not cross again."""

TOUCH = 1e-13
"""A parabola that falls below another by less than this part of their terms only touches it."""


def _envelope(e: Array, f: Array, g: Array) -> list[tuple[float, float, int]]:
    """Return (begin, end, index) of the parts of the lower envelope of e + f s + g s² in [0, 1]."""
    noise = TOUCH * float(np.max(np.abs(e) + np.abs(f) + np.abs(g)))
    begin = 0.0
    lowest_index = int(np.argmin(e - np.min(e) + f * 1e-6 + g * 1e-12))  # just behind s = 0
    parts = []
    for _ in range(2 * len(e) + 1):
        # which parabola falls below the lowest one first?
        d = e - e[lowest_index]
        h = f - f[lowest_index]
        q = g - g[lowest_index]
        root = np.sqrt(np.maximum(h * h - 4.0 * d * q, 0.0))
        half = -0.5 * (h + np.where(h >= 0.0, root, -root))
        with np.errstate(divide="ignore", invalid="ignore"):
            s = np.stack([half / q, d / half])
            falls = (h + 2.0 * q * s < 0.0) & (h * h > 4.0 * d * q)
            falls &= (s > begin + MIN_ADVANCE) & (s < 1.0)
        falls &= np.minimum(d + h + q, 0.0) < -noise
        crossing = np.where(falls, s, np.inf).min(axis=0)
        first = int(np.argmin(crossing))
        if not crossing[first] < 1.0:
            break
        end = float(crossing[first])
        parts.append((begin, end, lowest_index))
        begin = end
        lowest_index = first
    parts.append((begin, 1.0, lowest_index))
    return parts


MAX_ENTRIES_AT_ONCE = 2**20
"""Entries of the arrays of solutions that are proved together; it limits memory."""


def proved_minima(
    path: Path, low: Lowest, lambda_1: float, acceptance: Acceptance
) -> NDArray[np.bool_]:
    """Return (n,) whether the lowest solution is proved to be the global minimum of the energy.

    It is asked in the middle of every interval.

    lambda_1:   λ_min(C^{−½}ÃC^{−½}) [Pa/m]
    acceptance: tells by its residual whether something is a solution
    """
    count = len(low.piece)
    proved = np.zeros(count, dtype=bool)
    parts = 1 + count * path.problem.m // MAX_ENTRIES_AT_ONCE
    for intervals in np.array_split(np.arange(count), parts):
        t = 0.5 * (low.begin + low.end)[intervals]
        piece = low.piece[intervals]
        share = (t - path.t[piece]) / (path.t[piece + 1] - path.t[piece])
        slips = path.u[piece + 1] - path.u[piece]
        v = path.u[piece] + share[:, None] * slips
        rows = path.problem.rows(t, lambda_1)
        solved = acceptance.accepts(rows.inclusion_residual(v), rows.xi_rounding(v))
        proofs = Proofs(rows)
        proofs.prove_lowest(np.flatnonzero(solved), v)
        proved[intervals] = solved & (proofs.unique | proofs.lowest)
    return proved


# -- all branches of a range -----------------------------------------------------------------------

SLABS = 16
"""Parts of the interval that the search begins from; each is proved, or given up, separately."""

MAX_PIECES = 20_000
"""Pieces of a branch to either side of where it was found."""


@dataclass(frozen=True, eq=False)
class Branches:
    """All branches between two values of t.

    branches: a loop has its first vertex again at the end, and the status CLOSED_LOOP
    reason:   why they are not proved to be all, "" if they are
    listed:   solutions at the requested values of t that the branches do not answer for
    """

    branches: tuple[Path, ...]
    reason: str
    listed: Mapping[float, Equilibria]

    @property
    def complete(self) -> bool:
        return not self.reason

    def solutions(self, t: float) -> list[tuple[Array, bool]]:
        """Return (v (m,), stable) of all known solutions at t.

        Those of `listed` may be on branches as well.
        """
        solutions = list[tuple[Array, bool]]()
        for branch in self.branches:
            solutions += [(point.v, point.stable) for point in solutions_at(branch, t)]
        if t in self.listed:
            listed = self.listed[t]
            solutions += zip(listed.v, listed.stable.tolist(), strict=True)
        return solutions

    def complete_at(self, t: float) -> bool:
        """Return whether the solutions at a requested value are proved to be all."""
        return self.listed[t].complete if t in self.listed else self.complete


def all_branches(
    problem: ParametricProblem,
    begin: float,
    end: float,
    lambda_1: float,
    limits: Limits | None = None,
    at: Sequence[float] = (),
    known: Sequence[Path] = (),
) -> Branches:
    """Return every branch for t from begin to end.

    limits: of the search in each slab, and at each value
    at:     values of t whose solutions are requested. If the search of all branches does not answer
            for one, as its limits are met or the value is outside, the solutions there are listed.
            Those inside are followed like the segments of unfinished branches, so that every branch
            known is whole.
    known:  branches of the same problem that are listed whatever the search finds
    Raises ValueError for laws with exponential pieces.
    """
    limits = limits or Limits()
    low = min(begin, end)
    high = max(begin, end)
    problem = problem.without_narrow_pieces
    slab_ends = np.linspace(0.0, 1.0, SLABS + 1)
    middles = 0.5 * (slab_ends[1:] + slab_ends[:-1])
    load_range = (high - low) * problem.l_1
    boxes = PolygonProblems(
        problem.A_tilde,
        problem.c,
        problem.law,
        problem.load(low) + middles[:, None] * load_range,
        lambda_1,
        load_range * 0.5 / SLABS,
    )
    cells, by_modes = searched(boxes, limits, branch_cells)
    is_limited = bool(np.any(cells.stopped))
    unanswered = [t for t in at if is_limited or not low <= t <= high]
    listed = {t: known_solutions(problem.at(t), limits) for t in unanswered}

    of_modes = [found.sides for found in by_modes.values()]
    known_sides = [listed[t].sides for t in unanswered if low <= t <= high]
    if is_limited:
        side_of_code = sides_of_codes(problem.law)
        known_sides += [side_of_code[path.codes] for path in known]
    sides = np.unique(np.concatenate([cells.sides, *of_modes, *known_sides]), axis=0)
    first_load = problem.load(low)[None]
    segments = boxes.segments(np.zeros(len(sides), dtype=np.intp), sides, first_load, load_range)
    undecided = int(np.count_nonzero(~(segments.has_segment | segments.is_empty)))
    branches, missing = _followed(problem, low, high, sides, segments)

    solutions_at_low = 0
    for branch in branches:
        solutions_at_low += sum(float(t) == low for t in branch.t[[0, -1]])
    limit = ""
    if is_limited:
        t_of = low + (high - low) * slab_ends
        limit = f"boxes or time was met where the parameter is {_stopped(cells.stopped, t_of)}"
    reason = unproved(limit, undecided or missing, solutions_at_low)
    return Branches(tuple(branches), reason, listed)


def _stopped(stopped: Flags, t_of: Array) -> str:
    """Return the ranges of t of neighbouring slabs that a limit has stopped, in words."""
    changes = np.flatnonzero(np.diff(stopped, prepend=False, append=False))
    ranges = [f"{t_of[first]:g} to {t_of[last]:g}" for first, last in changes.reshape(-1, 2)]
    return ", ".join(ranges)


def _followed(
    problem: ParametricProblem, low: float, high: float, sides: Index, segments: Segments
) -> tuple[list[Path], int]:
    """Return the branches of all segments, and a count of what contradicts that they are all.

    Contradictions are cells without a segment through which a branch goes, and branches that end
    inside the range.

    sides: (n, m) cells of the segments
    """
    cells = [row.tobytes() for row in sides[segments.has_segment]]
    u = segments.u[segments.has_segment]
    s = segments.s[segments.has_segment]
    open_end = segments.open_end[segments.has_segment]
    side_of_code = sides_of_codes(problem.law)
    follower = Follower(low, high, MAX_PIECES)
    branches = list[Path]()
    on_branch = set[bytes]()
    contradictions = 0
    # first those that begin at an end of the interval, then loops
    starts = [*np.argwhere(open_end).tolist(), *([i, 0] for i in range(len(cells)))]
    for segment, segment_end in starts:
        if cells[segment] in on_branch:
            continue
        share = float(s[segment, segment_end])
        t = high if share == 1.0 else low + share * (high - low)
        direction: Direction = "both"
        if open_end[segment, segment_end]:
            direction = "forward" if t == low else "backward"
        branch = follower.follow(problem, u[segment, segment_end], t, direction)
        branch_cells = {row.tobytes() for row in side_of_code[branch.codes]} | {cells[segment]}
        ends = {branch.begin, branch.end} - {PathStatus.START}
        contradictions += len(branch_cells.difference(cells))
        is_whole = len(ends) <= 1 and ends <= {PathStatus.RANGE_END, PathStatus.CLOSED_LOOP}
        contradictions += not is_whole
        on_branch |= branch_cells
        branches.append(branch)
    return branches, contradictions
