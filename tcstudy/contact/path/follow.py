"""Equilibria on one branch: the piecewise-linear path of Ãu + ξ = l̃₀ + t l̃₁, ξ_i/c_i ∈ b̂(u_i),
followed exactly.

For a piecewise-linear law the filled graph of b̂ is a polygonal line at every node. While every
node stays on its piece of the line, (u, ξ, t) moves along a straight line; at the end of it one
node goes on to the next piece of its graph, and the path continues in the next cell. Nothing is
approximated and nothing is iterated: folds (t turns), stick, slip, up- and down-jumps and unstable
solutions all are vertices of one polygon. Several nodes at once, starts on a vertex and pieces with
a singular matrix are part of the method (walk.py).

Orientation: what keeps the path from turning round is that the node that has reached its bound goes
on in the same sense along its graph. Generically the pieces then form a curve without branches, so
a cell is entered at most once: coming back to one means a closed loop or, at a bifurcation, a
branch that was met before; both end the path.

Literature: Katzenelson, Bell Syst. Tech. J. 44 (1965) 1605–1620 (piecewise-linear networks); Lemke,
Manage. Sci. 11 (1965) 681–689 (the variable that has left a piece drives the next one). Left out:
other branches at a bifurcation, except the one that keeps tied nodes together.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

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

TOGETHER, AGAIN = 64, 4
"""Vertices whose residuals are checked together, after which the point is balanced again, and where
that failed."""

AIM = 0.1
"""Part of the tolerance that is worked for with fresh factorisations, as far as rounding lets it be
reached."""

BACKWARD = 1e-12
"""A node that moves back more slowly than this part of the fastest one does not turn."""


class Piece(NamedTuple):
    """Codes (m,) and stability of a piece, and its end: coordinates (m + 1,) by the pieces `on`
    (m,)."""

    codes: Codes
    stable: bool
    x: Array
    on: Codes


@dataclass(frozen=True)
class Follower:
    """Options of path following.

    t_min, t_max: the path ends where t leaves this range
    max_pieces:   pieces on either side of the start
    tolerance:    largest residual |l̃ − Ãu − ξ|/c relative to the scale of b accepted at any vertex, then strict; None
                  for the default of scene/study.py
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
        """The path through the solution v of parameter t.

        direction: "forward" leaves with growing t, "backward" with falling t; "both" does both and
        joins them. (At a
                   start exactly on a fold both ways have the same sense of t; forward is one of
                   them.)
        progress:  called with (pieces, t) after every check
        Raises NoSolutionError if v is no solution, ValueError for a law that is not piecewise linear or a bad range.
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
            ways = rays(walk)
        except SingularCellError:
            return Path.standing(problem, t, v, PathStatus.SINGULAR)
        ahead = self.way(walk, ways[direction == "backward"], set(), progress)
        if direction != "both" or ahead.end == PathStatus.CLOSED_LOOP:
            return ahead
        back = self.way(walk, ways[1], {codes.tobytes() for codes in ahead.codes}, progress)
        both: dict[str, Any] = {"start": back.pieces, "begin": back.end}
        vertices, pieces = ("t", "u", "traction", "residual"), ("stable", "codes")
        for names, backward in ((vertices, slice(None, 0, -1)), (pieces, slice(None, None, -1))):
            both |= {
                name: np.concatenate([getattr(back, name)[backward], getattr(ahead, name)])
                for name in names
            }
        return replace(ahead, **both)

    def onward(self, walk: Walk, falling: bool = False) -> Path | None:
        """The path along the stable way on which t grows from where the walk stands; None if there
        is none.

        falling: else the piece on which the walk stands, if t falls along it
        """
        here, way = walk.here, onward(walk)
        if way is not None:
            return self.way(walk, way, set())
        with suppress(SingularCellError):
            walk.put(here)
            path = replace(self, t_min=-np.inf).way(walk, outward(walk), set()) if falling else None
            return path if path and path.end == PathStatus.UNSTABLE else None
        return None

    def way(
        self, walk: Walk, begin: Ray, others: set[bytes], progress: Progress | None = None
    ) -> Path:
        """One direction, some pieces at a time until something ends the path; others: cells that
        do.

        If their vertices are not accurate they are followed again from a fresh inverse, each with a
        correction; if even that does not help the path ends.
        """
        p, accept, count, reached = walk.problem, Acceptance(self.tolerance), TOGETHER, 0.0
        pieces, known, mark, end = list[Piece](), others.copy(), begin, None
        walk.put(begin)
        walk.low[-1], walk.high[-1] = self.t_min * walk.size, self.t_max * walk.size
        found = [self._judged(walk, [Piece(begin.codes, True, begin.x, begin.codes)])]
        while end is None:
            done = len(pieces)
            for careful in (False, True):
                count = AGAIN if careful else min(2 * count, TOGETHER)
                try:
                    if careful:
                        del pieces[done:]
                        known = (
                            others
                            | {piece.codes.tobytes() for piece in pieces}
                            | {mark.codes.tobytes()}
                        )
                        walk.basis.stale = True
                        walk.put(mark)
                        walk.tie = max(1e-2 * walk.usual_tie, 1e-14)  # it may have been no tie
                    end = self._some(walk, begin, pieces, known, count, careful)
                except SingularCellError:
                    end = PathStatus.SINGULAR
                if len(pieces) == done:
                    break
                new = self._judged(walk, pieces[done:])
                at, good, limit = int(new[3].argmax()), AIM * accept.aim, accept.aim
                worst = float(new[3][at])
                if not worst <= good:
                    noise = p.xi_rounding(float(new[0][at]), new[1][at])
                    limit = accept.limit(noise)
                    good = min(limit, max(good, 0.5 * noise, reached))
                if worst <= (limit if careful else good):
                    found.append(new)
                    break
            else:
                end = PathStatus.LOST_ACCURACY
                del pieces[done:]
            walk.tie = walk.usual_tie
            if careful:  # later pieces are not followed again for what remains after corrections
                reached = 2.0 * float(found[-1][3].max())
            if end is None:
                walk.balance()
                mark = walk.here
            if progress is not None:
                progress(len(pieces), walk.t)
        t, u, traction, off = (np.concatenate(parts) for parts in zip(*found, strict=True))
        stable = np.array([piece.stable for piece in pieces], dtype=bool)
        codes = np.array([piece.codes for piece in pieces], dtype=np.int32).reshape(-1, walk.m)
        begun = end if end == PathStatus.CLOSED_LOOP else PathStatus.START
        return Path(p, t, u, traction, off, stable, codes, 0, begun, end)

    def _judged(self, walk: Walk, pieces: list[Piece]) -> tuple[Array, ...]:
        """t, u, ξ/c and the residuals at the ends of pieces, as `Path` has them."""
        x, on = (
            np.array(column)
            for column in zip(*((piece.x, piece.on) for piece in pieces), strict=True)
        )
        *point, defect = walk.points(x, on)
        return *point, np.max(np.abs(defect) / walk.problem.c, axis=1) / walk.problem.traction_scale

    def _some(
        self,
        walk: Walk,
        begin: Ray,
        pieces: list[Piece],
        known: set[bytes],
        count: int,
        careful: bool,
    ) -> PathStatus | None:
        """A count of pieces more; careful: with a correction at the end of each. Raises
        SingularCellError."""
        start = begin.codes.tobytes()
        for _ in range(count):
            stable = walk.stable
            if len(pieces) >= self.max_pieces:
                return PathStatus.PIECE_LIMIT
            falls = self.stable_only and not stable
            if self.one_way and not falls:
                speed = walk.graph.outward[walk.codes] * walk.dx[:-1]
                if float(speed.min()) < -BACKWARD * float(np.abs(walk.dx).max()):
                    return PathStatus.TURNS
            step, first = walk.reach()
            if not np.isfinite(step):
                return PathStatus.UNBOUNDED
            if (
                first == walk.m and step == 0.0 and not pieces
            ):  # one without length would be a second solution there
                return PathStatus.RANGE_END
            at, codes = walk.arrive(step, first), walk.codes.copy()
            if first == walk.m and careful:
                walk.correct(np.array([first]))
            pieces.append(Piece(codes, stable, walk.x.copy(), codes))
            if first == walk.m or falls:
                return PathStatus.UNSTABLE if falls else PathStatus.RANGE_END
            cross(walk, at)
            if len(at) > 1 or careful:
                walk.balance()
                pieces[-1] = Piece(codes, stable, walk.x.copy(), walk.codes.copy())
            key = walk.codes.tobytes()
            if key == start:
                if np.any(np.abs(walk.x - begin.x)[:-1] > walk.tie * walk.scale):
                    pieces.append(
                        Piece(begin.codes, walk.stable, begin.x, begin.codes)
                    )  # the start lies inside it
                pieces[-1] = pieces[-1]._replace(x=begin.x, on=begin.codes)
                return PathStatus.CLOSED_LOOP
            if key in known:
                return PathStatus.TURNED_BACK
            known.add(key)
        return None
