"""Equilibria on one branch: the piecewise-linear path of Ãu + ξ = l̃₀ + t l̃₁, ξ_i/c_i ∈ b̂(u_i), followed exactly.

For a piecewise-linear law the filled graph of b̂ is a polygonal line at every node. While every node stays on its
piece of the line, (u, ξ, t) moves along a straight line; at the end of it one node goes on to the next piece of its
graph, and the path continues in the next cell. Nothing is approximated and nothing is iterated: folds (t turns), stick,
slip, up- and down-jumps and unstable solutions all are vertices of one polygon. Several nodes at once, starts on a
vertex and pieces with a singular matrix are part of the method (walk.py).

Orientation: what keeps the path from turning round is that the node that has reached its bound goes on in the same
sense along its graph. Generically the pieces then form a curve without branches, so a cell is entered at most once:
coming back to one means a closed loop or, at a bifurcation, a branch that was met before; both end the path.

Literature: Katzenelson, Bell Syst. Tech. J. 44 (1965) 1605–1620 (piecewise-linear networks); Lemke, Manage. Sci. 11
(1965) 681–689 (the variable that has left a piece drives the next one). Left out: other branches at a bifurcation,
except the one that keeps tied nodes together.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.path.basis_inverse import SingularCellError
from tcstudy.contact.path.problem import Codes, ParametricProblem, Path, PathStatus
from tcstudy.contact.path.walk import Ray, Walk, cross, locate, onward, rays
from tcstudy.scene.study import Acceptance, Direction

__all__ = ["Follower", "ParametricProblem", "Path", "PathStatus"]

Array = NDArray[np.float64]
Progress = Callable[[int, float], None]

TOGETHER, AGAIN = 64, 4
"""Vertices whose residuals are checked together, after which the point is balanced again, and where that failed."""

AIM = 0.1
"""Part of the tolerance that is worked for with fresh factorisations, as far as rounding lets it be reached."""

BACKWARD = 1e-12
"""A node that moves back more slowly than this part of the fastest one does not turn."""


@dataclass(frozen=True)
class Follower:
    """Options of path following.

    t_min, t_max: the path ends where t leaves this range
    max_pieces:   pieces on either side of the start
    tolerance:    largest residual |l̃ − Ãu − ξ|/c relative to the scale of b accepted at any vertex, then strict; None
                  for the default of scene/study.py
    stable_only:  end where the branch stops being stable
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

        direction: "forward" leaves with growing t, "backward" with falling t; "both" does both and joins them. (At a
                   start exactly on a fold both ways have the same sense of t; forward is one of them.)
        progress:  called with (pieces, t) after every check
        Raises NoSolutionError if v is no solution, ValueError for a law that is not piecewise linear or a bad range.
        """
        if not self.t_min <= t <= self.t_max:
            raise ValueError(f"the start t = {t:g} lies outside the range [{self.t_min:g}, {self.t_max:g}]")
        if not np.any(problem.l_1):
            raise ValueError("l_1 is zero: the load does not depend on t, so there is no path to follow")
        v = np.asarray(v, dtype=float)
        try:
            walk = locate(problem, v, t)
            ways = rays(walk)
        except SingularCellError:
            return Path.standing(problem, t, v, PathStatus.SINGULAR)
        first = _Half(self, walk, ways[direction == "backward"], set())
        ahead = first.follow(progress)
        if direction != "both" or ahead.end == PathStatus.CLOSED_LOOP:
            return ahead
        back = _Half(self, walk, ways[1], set(first.keys)).follow(progress)

        both: dict[str, Any] = {"start": back.pieces, "begin": back.end}
        vertices, pieces = ("t", "u", "traction", "residual"), ("stable", "codes")
        for names, backward in ((vertices, slice(None, 0, -1)), (pieces, slice(None, None, -1))):
            both |= {name: np.concatenate([getattr(back, name)[backward], getattr(ahead, name)]) for name in names}
        return replace(ahead, **both)

    def onward(self, walk: Walk) -> Path | None:
        """The path along the stable way on which t grows from where the walk stands; None if there is none."""
        ray = onward(walk)
        return None if ray is None else _Half(self, walk, ray, set()).follow()


class _Half:
    """One direction of one path.

    vertices: (x, codes) of each, the start first;  blocks: t, u, traction, residual of those that are accurate
    codes, stable: of the pieces;  keys: of the cells entered, the present one last;  known: cells that end the path
    """

    def __init__(self, options: Follower, walk: Walk, ray: Ray, known: set[bytes]) -> None:
        self.options, self.walk, self.begin = options, walk, ray
        self.end: PathStatus | None = None
        self.vertices, self.codes, self.stable = [(ray.x, ray.codes)], list[Codes](), list[bool]()
        self.keys, self.blocks = [ray.codes.tobytes()], list[tuple[Array, ...]]()
        self.others = known - {self.keys[0]}
        self.known = self.others.copy()
        walk.put(ray)
        walk.low[-1], walk.high[-1] = options.t_min * walk.size, options.t_max * walk.size

    def follow(self, progress: Progress | None = None) -> Path:
        """Some pieces at a time until something ends the path.

        If their vertices are not accurate they are followed again from a fresh inverse, each with a correction; if even
        that does not help the path ends.
        """
        walk, accept, mark = self.walk, Acceptance(self.options.tolerance), self.begin
        p, count, reached = walk.problem, TOGETHER, 0.0
        while self.end is None:
            done = len(self.stable)
            for careful in (False, True):
                count = AGAIN if careful else min(2 * count, TOGETHER)
                self.end = self._some(mark, done, count, careful)
                t, u, traction, defect = walk.points(*map(np.array, zip(*self.vertices[done:], strict=True)))
                off = np.max(np.abs(defect) / p.c, axis=1) / p.traction_scale
                at = 1 + int(off[1:].argmax()) if len(off) > 1 else 0  # the first is where it begins
                worst, good, limit = float(off[at]), AIM * accept.aim, accept.aim
                if not worst <= good:
                    noise = p.xi_rounding(float(t[at]), u[at])
                    limit = accept.limit(noise)
                    good = min(limit, max(good, 0.5 * noise, reached))
                if worst <= (limit if careful else good):
                    break
            else:
                self.end = PathStatus.LOST_ACCURACY
                self._back_to(done + int(np.argmin(np.append(off[1:] <= limit, False))))
            new = slice(min(done, 1), len(self.vertices) - done)
            self.blocks.append((t[new], u[new], traction[new], off[new]))
            reached, walk.tie = 2.0 * worst if careful else 0.0, walk.usual_tie
            if self.end is None:
                walk.balance()
                walk.straighten()
                mark = walk.here
            if progress is not None:
                progress(len(self.stable), walk.t)
        t, u, traction, off = (np.concatenate(parts) for parts in zip(*self.blocks, strict=True))
        stable, codes = np.array(self.stable, dtype=bool), np.array(self.codes, dtype=np.int32)
        begin = self.end if self.end == PathStatus.CLOSED_LOOP else PathStatus.START
        return Path(p, t, u, traction, off, stable, codes.reshape(len(codes), walk.m), 0, begin, self.end)

    def _some(self, mark: Ray, done: int, count: int, careful: bool) -> PathStatus | None:
        """A count of pieces from the mark on, which `done` led to; careful: from a fresh inverse, each corrected."""
        walk = self.walk
        try:
            if careful:
                self._back_to(done)
                walk.basis.stale = True
                walk.put(mark)
                walk.tie = max(1e-2 * walk.usual_tie, 1e-14)  # it may have been no tie
            end = None
            while end is None and len(self.stable) < done + count:
                end = self._piece(careful)
        except SingularCellError:
            return PathStatus.SINGULAR
        return end

    def _back_to(self, pieces: int) -> None:
        del self.stable[pieces:], self.codes[pieces:], self.vertices[pieces + 1 :], self.keys[pieces + 1 :]
        self.known = self.others | set(self.keys[1:])

    def _piece(self, careful: bool) -> PathStatus | None:
        """Follow the present piece to its end and enter the next one; careful: with a correction there."""
        walk, options, stable = self.walk, self.options, self.walk.stable
        if len(self.stable) >= options.max_pieces:
            return PathStatus.PIECE_LIMIT
        if options.stable_only and not stable:
            return PathStatus.UNSTABLE
        if options.one_way:
            speed = walk.graph.outward[walk.codes] * walk.dx[:-1]
            if float(speed.min()) < -BACKWARD * float(np.abs(walk.dx).max()):
                return PathStatus.TURNS
        step, first = walk.reach()
        if not np.isfinite(step):
            return PathStatus.UNBOUNDED
        at = walk.arrive(step, first)
        if first == walk.m and careful:
            walk.correct(np.array([first]))
        self._add(stable)
        if first == walk.m:
            return PathStatus.RANGE_END
        cross(walk, at)
        if len(at) > 1 or careful:
            walk.balance()
            self.vertices[-1] = walk.x.copy(), walk.codes.copy()
        key = walk.codes.tobytes()
        self.keys.append(key)
        if key == self.keys[0]:
            if np.any(np.abs(walk.x - self.begin.x)[:-1] > walk.tie * walk.scale):
                self._add(walk.stable)  # the start lies inside its cell
            self.vertices[-1] = self.begin.x, self.begin.codes
            return PathStatus.CLOSED_LOOP
        if key in self.known:
            return PathStatus.TURNED_BACK
        self.known.add(key)
        return None

    def _add(self, stable: bool) -> None:
        """The present piece, with the point at its end."""
        self.stable.append(stable)
        self.codes.append(self.walk.codes.copy())
        self.vertices.append((self.walk.x.copy(), self.codes[-1]))
