"""Follow one branch of equilibria exactly: Ãu + ξ = l̃₀ + t l̃₁, ξ_i/c_i ∈ b̂(u_i), as t varies.

For a piecewise-linear law the filled graph of b̂ is a polygonal line at every node. While every
node stays on its piece of the line, (u, ξ, t) moves along a straight line; at the end of it one
node goes on to the next piece of its graph, and the path continues in the next cell. Nothing is
approximated and nothing is iterated: folds (t turns), stick, slip, up- and down-jumps and unstable
solutions all are vertices of one polygon. Several nodes at once, starts on a vertex and pieces with
a singular matrix are part of the method (walk.py).

Orientation: the node that has reached its bound goes on in the same sense along its graph. This
keeps the path from turning round. Generically the pieces then form a curve without branches, so a
cell is entered at most once. To come back to one means a closed loop or, at a bifurcation, a branch
that was met before; both end the path.

Literature: Katzenelson, Bell Syst. Tech. J. 44 (1965) 1605–1620 (piecewise-linear networks);
Lemke, Manage. Sci. 11 (1965) 681–689 (the variable that has left a piece drives the next one).
Left out: other branches at a bifurcation, except the one that keeps tied nodes together.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.path.basis_inverse import SingularCellError
from tcstudy.contact.path.problem import Codes, ParametricProblem, Path, PathStatus
from tcstudy.contact.path.walk import Ray, Walk, cross, locate, onward, outward, rays
from tcstudy.contact.solution import Acceptance
from tcstudy.scene.path_plan import Direction

__all__ = ["Follower", "ParametricProblem", "Path", "PathStatus"]

Array = NDArray[np.float64]
Progress = Callable[[int, float], None]

MAX_UNCHECKED = 64
"""Vertices whose residuals are checked together; after that the point is balanced again."""

MAX_REPEATED = 4
"""Vertices that are followed again where their residuals were too large."""

AIM = 0.1
"""Residuals are kept below this part of the tolerance, as far as rounding lets them."""

MIN_REPEATED_TIE = 1e-14
"""Ties are narrower when vertices are followed again, but no narrower than this."""

BACKWARD = 1e-12
"""A node that moves back more slowly than this part of the fastest one does not turn."""


class Piece(NamedTuple):
    """A piece of the path.

    codes:     (m,) pieces of the nodes
    stable:    whether its solutions are strict local minima
    x:         (m + 1,) coordinates of its end
    end_codes: (m,) pieces by which x is to be read
    """

    codes: Codes
    stable: bool
    x: Array
    end_codes: Codes


class Vertices(NamedTuple):
    """t (n,), u (n, m), ξ/c (n, m) and residuals (n,), as in `Path`."""

    t: Array
    u: Array
    traction: Array
    residual: Array


@dataclass(frozen=True)
class Follower:
    """Options of path following.

    t_min, t_max: the path ends where t leaves this range
    max_pieces:   largest number of pieces on either side of the start
    tolerance:    largest residual |l̃ − Ãu − ξ|/c relative to the scale of b that is accepted at a
                  vertex, then strict; None for the default of contact/solution.py
    stable_only:  end with the first piece that is not stable
    one_way:      end where a node turns back towards slip 0 on a piece that lies on one side of it
    """

    t_min: float = -np.inf
    t_max: float = np.inf
    max_pieces: int = 20_000
    tolerance: float | None = None
    stable_only: bool = False
    one_way: bool = False

    def follow(
        self,
        problem: ParametricProblem,
        v: Array,
        t: float,
        direction: Direction = "both",
        progress: Progress | None = None,
    ) -> Path:
        """Return the path through the solution v of parameter t.

        direction: "forward" leaves with growing t, "backward" with falling t; "both" does both and
                   joins them. At a start exactly on a fold both ways have the same sense of t;
                   forward is one of them.
        progress:  called with (pieces, t) after every check
        Raises NoSolutionError if v is no solution, and ValueError for a law that is not piecewise
        linear, a load that does not depend on t, or a start outside the range.
        """
        if not self.t_min <= t <= self.t_max:
            raise ValueError(
                f"the start t = {t:g} lies outside the range [{self.t_min:g}, {self.t_max:g}]"
            )
        if not np.any(problem.l_1):
            raise ValueError(
                "l_1 is zero: the load does not depend on t, so there is no path to follow"
            )
        v = np.asarray(v, dtype=float)
        problem = problem.without_narrow_pieces
        try:
            walk = locate(problem, v, t)
            forward, backward = rays(walk)
        except SingularCellError:
            return Path.standing(problem, t, v, PathStatus.SINGULAR)
        first = backward if direction == "backward" else forward
        ahead = Track(self, walk, first, set()).follow(progress)
        if direction != "both" or ahead.end == PathStatus.CLOSED_LOOP:
            return ahead
        visited = {codes.tobytes() for codes in ahead.codes}
        return _joined(Track(self, walk, backward, visited).follow(progress), ahead)

    def onward(self, walk: Walk, falling: bool = False) -> Path | None:
        """Return the path along the stable way on which t grows from the walk, None without one.

        falling: without such a way, return the piece on which the walk stands if t falls along it
        """
        here = walk.here
        ray = onward(walk)
        if ray is not None:
            return Track(self, walk, ray, set()).follow()
        with suppress(SingularCellError):
            walk.go_to(here)
            if falling:
                follower = replace(self, t_min=-np.inf)
                path = Track(follower, walk, outward(walk), set()).follow()
                if path.end == PathStatus.UNSTABLE:
                    return path
        return None


def _joined(back: Path, ahead: Path) -> Path:
    """Return two paths from one start as one; the one back is turned round."""
    return replace(
        ahead,
        t=np.concatenate([back.t[:0:-1], ahead.t]),
        u=np.concatenate([back.u[:0:-1], ahead.u]),
        traction=np.concatenate([back.traction[:0:-1], ahead.traction]),
        residual=np.concatenate([back.residual[:0:-1], ahead.residual]),
        stable=np.concatenate([back.stable[::-1], ahead.stable]),
        codes=np.concatenate([back.codes[::-1], ahead.codes]),
        start=back.pieces,
        begin=back.end,
    )


class Track:
    """A path in one direction while it is followed, some pieces at a time until something ends it.

    If the vertices of these pieces are not accurate, they are followed again from a fresh inverse,
    each with a correction. If even that does not help, the path ends.

    begin:   ray along which it leaves
    barred:  cells that end it, as bytes of their codes
    visited: these and the cells that it has been in
    """

    def __init__(self, follower: Follower, walk: Walk, begin: Ray, barred: set[bytes]) -> None:
        self.follower = follower
        self.walk = walk
        self.begin = begin
        self.barred = barred
        self.visited = barred.copy()
        self.acceptance = Acceptance(follower.tolerance)
        self.pieces = list[Piece]()
        self.corrected_residual = 0.0  # that corrections have left before, doubled
        walk.go_to(begin)
        walk.low[-1] = follower.t_min * walk.t_unit
        walk.high[-1] = follower.t_max * walk.t_unit

    def follow(self, progress: Progress | None = None) -> Path:
        """Follow the path to its end, and return it."""
        walk = self.walk
        begin = self.begin
        parts = [self._vertices([Piece(begin.codes, True, begin.x, begin.codes)])]
        last_good = begin
        count = MAX_UNCHECKED
        end = None
        while end is None:
            done = len(self.pieces)
            count = min(2 * count, MAX_UNCHECKED)
            end = self._advance(count)
            vertices = self._vertices(self.pieces[done:])
            is_repeated = not self._is_accurate(vertices)
            if is_repeated:
                count = MAX_REPEATED
                end = self._repeat(count, done, last_good)
                vertices = self._vertices(self.pieces[done:])
                if not self._is_accurate(vertices, corrected=True):
                    end = PathStatus.LOST_ACCURACY
                    del self.pieces[done:]
            if len(self.pieces) > done:
                parts.append(vertices)
            walk.tie = walk.usual_tie
            if is_repeated:  # later pieces are not followed again for what corrections leave
                self.corrected_residual = 2.0 * float(parts[-1].residual.max())
            if end is None:
                walk.balance()
                last_good = walk.here
            if progress is not None:
                progress(len(self.pieces), walk.t)
        return self._path(parts, end)

    def _path(self, parts: list[Vertices], end: PathStatus) -> Path:
        """Return the path; slips that are beyond a ray by rounding are put onto it."""
        law = self.walk.problem.law
        codes = np.array([piece.codes for piece in self.pieces], dtype=np.int32)
        return Path(
            problem=self.walk.problem,
            t=np.concatenate([part.t for part in parts]),
            u=law.admissible(np.concatenate([part.u for part in parts])),
            traction=np.concatenate([part.traction for part in parts]),
            residual=np.concatenate([part.residual for part in parts]),
            stable=np.array([piece.stable for piece in self.pieces], dtype=bool),
            codes=codes.reshape(-1, self.walk.m),
            start=0,
            begin=end if end == PathStatus.CLOSED_LOOP else PathStatus.START,
            end=end,
        )

    def _vertices(self, pieces: list[Piece]) -> Vertices:
        """Return the ends of pieces and their residuals."""
        problem = self.walk.problem
        x = np.array([piece.x for piece in pieces]).reshape(-1, problem.m + 1)
        codes = np.array([piece.end_codes for piece in pieces], dtype=np.int32)
        t, u, traction, defect = self.walk.points(x, codes.reshape(-1, problem.m))
        residual = np.max(np.abs(defect) / problem.c, axis=1) / problem.traction_scale
        return Vertices(t, u, traction, residual)

    def _is_accurate(self, vertices: Vertices, corrected: bool = False) -> bool:
        """Return whether no residual is too large; more is allowed where all are corrected."""
        if not len(vertices.t):
            return True
        worst = int(vertices.residual.argmax())
        residual = float(vertices.residual[worst])
        good = AIM * self.acceptance.aim
        if residual <= good:
            return True
        noise = self.walk.problem.xi_rounding(float(vertices.t[worst]), vertices.u[worst])
        limit = self.acceptance.limit(noise)
        if corrected:
            return residual <= limit
        return residual <= min(limit, max(good, 0.5 * noise, self.corrected_residual))

    def _repeat(self, count: int, done: int, last_good: Ray) -> PathStatus | None:
        """Follow the pieces after `done` again, from a fresh inverse and with corrections."""
        del self.pieces[done:]
        cells = {piece.codes.tobytes() for piece in self.pieces}
        self.visited = self.barred | cells | {last_good.codes.tobytes()}
        self.walk.basis.stale = True
        try:
            self.walk.go_to(last_good)
        except SingularCellError:
            return PathStatus.SINGULAR
        # what was taken for a tie may have been none
        self.walk.tie = max(1e-2 * self.walk.usual_tie, MIN_REPEATED_TIE)
        return self._advance(count, correcting=True)

    def _advance(self, count: int, correcting: bool = False) -> PathStatus | None:
        """Follow a number of pieces; return why the path ends, None if it goes on.

        correcting: correct the point at the end of each piece
        """
        try:
            for _ in range(count):
                end = self._step(correcting)
                if end is not None:
                    return end
        except SingularCellError:
            return PathStatus.SINGULAR
        return None

    def _step(self, correcting: bool) -> PathStatus | None:
        """Follow one piece, and cross into the next cell.

        Raises SingularCellError if no direction exists there.
        """
        walk = self.walk
        pieces = self.pieces
        stable = walk.stable
        if len(pieces) >= self.follower.max_pieces:
            return PathStatus.PIECE_LIMIT
        ends_unstable = self.follower.stable_only and not stable
        if self.follower.one_way and not ends_unstable and self._turns_back():
            return PathStatus.TURNS
        step, first = walk.reach()
        if not np.isfinite(step):
            return PathStatus.UNBOUNDED
        is_range_end = first == walk.m
        if is_range_end and step == 0.0 and not pieces:
            # a piece without length would be a second solution there
            return PathStatus.RANGE_END
        arrived = walk.arrive(step, first)
        codes = walk.codes.copy()
        if is_range_end and correcting:
            walk.correct(np.array([first]))
        pieces.append(Piece(codes, stable, walk.x.copy(), codes))
        if ends_unstable:
            return PathStatus.UNSTABLE
        if is_range_end:
            return PathStatus.RANGE_END
        cross(walk, arrived)
        if len(arrived) > 1 or correcting:
            walk.balance()
            pieces[-1] = Piece(codes, stable, walk.x.copy(), walk.codes.copy())
        return self._visit()

    def _turns_back(self) -> bool:
        """Return whether a node moves towards slip 0 on a piece that lies on one side of it."""
        outward_speed = self.walk.graph.outward[self.walk.codes] * self.walk.dx[:-1]
        return float(outward_speed.min()) < -BACKWARD * float(np.abs(self.walk.dx).max())

    def _visit(self) -> PathStatus | None:
        """Enter the present cell among those visited; a cell that was visited ends the path."""
        walk = self.walk
        begin = self.begin
        cell = walk.codes.tobytes()
        if cell == begin.codes.tobytes():
            distance = np.abs(walk.x - begin.x)[:-1]
            if np.any(distance > walk.tie * walk.scale):  # the start lies inside the piece
                self.pieces.append(Piece(begin.codes, walk.stable, begin.x, begin.codes))
            self.pieces[-1] = self.pieces[-1]._replace(x=begin.x, end_codes=begin.codes)
            return PathStatus.CLOSED_LOOP
        if cell in self.visited:
            return PathStatus.TURNED_BACK
        self.visited.add(cell)
        return None
