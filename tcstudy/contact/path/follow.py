"""Equilibria on one branch: the piecewise-linear path of Ãu + ξ = l̃₀ + t l̃₁, ξ_i/c_i ∈ b̂(u_i), followed exactly.

For a piecewise-linear law the filled graph of b̂ is a polygonal line at every node. While every node stays on its
piece of the line, (u, ξ, t) moves along a straight line; at the end of it one node goes on to the next piece of its
graph, and the path continues in the next cell. Nothing is approximated and nothing is iterated: folds (t turns), stick,
slip, up- and down-jumps and unstable solutions all are vertices of one polygon. Several nodes at once, starts on a
vertex and pieces with a singular matrix are part of the method (walk, start).

Orientation: what keeps the path from turning round is that the node that has reached its bound goes on in the same
sense along its graph. Generically the pieces then form a curve without branches, so a cell is entered at most once:
coming back to one means a closed loop or, at a bifurcation, a branch that was met before; both end the path.

Literature: Katzenelson, Bell Syst. Tech. J. 44 (1965) 1605–1620 (piecewise-linear networks); Lemke, Manage. Sci. 11
(1965) 681–689 (the variable that has left a piece drives the next one). Left out: other branches at a bifurcation,
except the one that keeps tied nodes together.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.path.basis_inverse import SingularCellError
from tcstudy.contact.path.problem import ParametricProblem
from tcstudy.contact.path.record import Path, PathStatus
from tcstudy.contact.path.start import Ray, locate, onward, rays
from tcstudy.contact.path.walk import Codes, Walk
from tcstudy.scene.study import Acceptance, Direction

__all__ = ["Follower", "ParametricProblem", "Path", "PathStatus"]

Array = NDArray[np.float64]
Progress = Callable[[int, float], None]

TOGETHER = 64
"""Vertices whose residuals are checked together, after which the point is balanced again."""

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

    @property
    def acceptance(self) -> Acceptance:
        """The test that every vertex passes."""
        return Acceptance(self.tolerance)

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
        halves: list[_Half] = []
        for ray in {"both": ways, "forward": ways[:1], "backward": ways[1:]}[direction]:
            halves.append(_Half(self, walk, ray, set(halves[0].keys) if halves else set()))
            halves[-1].follow(progress)
            if halves[-1].end == PathStatus.CLOSED_LOOP:
                break
        return _joined(walk, halves)

    def onward(self, walk: Walk) -> Path | None:
        """The path along the stable way on which t grows from where the walk stands; None if there is none."""
        ray = onward(walk)
        if ray is None:
            return None
        half = _Half(self, walk, ray, set())
        half.follow()
        return _joined(walk, [half])


class _Half:
    """One direction of one path.

    rows: blocks of t, u, traction, residual of the vertices;  codes, stable: of the pieces
    keys: of the cells, the present one last;  known: cells that end the path
    """

    def __init__(self, options: Follower, walk: Walk, ray: Ray, known: set[bytes]) -> None:
        self.options, self.walk, self.start, self.end = options, walk, ray, PathStatus.SINGULAR
        self.codes, self.stable, self.keys = list[Codes](), list[bool](), [ray.codes.tobytes()]
        self.others = known - {self.keys[0]}
        self.known, self.rows = self.others.copy(), [self._vertices([(ray.x, ray.codes)])]
        walk.range = np.array([options.t_min, options.t_max])
        walk.put(ray.codes, ray.x)
        walk.along(ray.dx)

    def follow(self, progress: Progress | None = None) -> None:
        """Some pieces at a time until something ends the path.

        If their vertices are not accurate they are followed again with a fresh inverse, one by one; if even that does
        not help the path ends.
        """
        walk, acceptance, mark = self.walk, self.options.acceptance, self.start
        status: PathStatus | None = None
        done, every, again, reached = 0, TOGETHER, False, 0.0
        while status is None:
            points = list[tuple[Array, Codes]]()
            try:
                while status is None and len(points) < every:
                    status = self._piece(points, every == 1)
            except SingularCellError:
                status = PathStatus.SINGULAR
            new = self._vertices(points or [(mark.x, mark.codes)])
            at = int(np.argmax(new[3]))
            worst, good, limit = float(new[3][at]), AIM * acceptance.aim, acceptance.aim
            if not worst <= good:
                noise = walk.problem.xi_rounding(float(new[0][at]), new[1][at])
                limit = acceptance.limit(noise)
                good = min(limit, max(good, 0.5 * noise, reached))
            accurate = not points or worst <= (limit if again else good)
            if accurate and points:
                self.rows.append(new)
                done, reached = done + len(points), 0.0 if worst <= good else 2.0 * worst
                every, walk.tie = min(2 * every, TOGETHER), walk.usual_tie
            elif not accurate:
                del self.stable[done:], self.codes[done:], self.keys[done + 1 :]
                status = PathStatus.LOST_ACCURACY if again else None
            try:
                if status is None and accurate:
                    if worst > good:
                        walk.basis.refactor()
                    walk.balance()
                    walk.straighten()
                    mark = Ray.here(walk)
                elif status is None:
                    self.known, every = self.others | set(self.keys[1:]), 1
                    walk.put(mark.codes, mark.x)
                    walk.basis.refactor()
                    walk.along(mark.dx)
                    walk.tie = max(1e-2 * walk.usual_tie, 1e-14)  # it may have been no tie
            except SingularCellError:
                return
            again = not accurate
            if progress is not None:
                progress(len(self.stable), walk.t)
        self.end = status

    def _piece(self, points: list[tuple[Array, Codes]], each: bool) -> PathStatus | None:
        """Follow the present piece to its end, a point more, and enter the next one; each: with a correction."""
        walk, options, stable = self.walk, self.options, self.walk.stable
        if len(self.stable) >= options.max_pieces:
            return PathStatus.PIECE_LIMIT
        if options.stable_only and not stable:
            return PathStatus.UNSTABLE
        if options.one_way and self.stable:
            speed = walk.graph.outward[walk.codes] * walk.dx[:-1]
            if float(speed.min()) < -BACKWARD * float(np.abs(walk.dx).max()):
                return PathStatus.TURNS
        home, (step, first) = len(self.keys) > 1 and self.keys[-1] == self.keys[0], walk.reach()
        if home:
            walk.x, at = self.start.x.copy(), np.empty(0, dtype=np.intp)
        elif not np.isfinite(step):
            return PathStatus.UNBOUNDED
        else:
            at = walk.arrive(step, first)
            if first == walk.m and each:
                walk.correct(np.array([first]))
        self.stable.append(stable)
        self.codes.append(walk.codes.copy())
        points.append((walk.x.copy(), self.codes[-1]))
        if home or first == walk.m:
            return PathStatus.CLOSED_LOOP if home else PathStatus.RANGE_END
        walk.cross(at)
        if len(at) > 1 or each:
            walk.balance()
            points[-1] = walk.x.copy(), walk.codes.copy()
        key = walk.codes.tobytes()
        self.keys.append(key)
        if key == self.keys[0]:
            gap = np.abs(walk.x - self.start.x)[:-1]
            if not np.all(gap <= walk.tie * walk.scale):
                return None
            points[-1] = self.start.x, self.start.codes
            return PathStatus.CLOSED_LOOP
        if key in self.known:
            return PathStatus.TURNED_BACK
        self.known.add(key)
        return None

    def _vertices(self, points: list[tuple[Array, Codes]]) -> tuple[Array, Array, Array, Array]:
        """(t (n,), u (n, m), ξ/c (n, m), residual (n,)) of points of the walk."""
        p, walk = self.walk.problem, self.walk
        x, codes = (np.array(rows) for rows in zip(*points, strict=True))
        t, (u, traction) = x[:, -1] / walk.size, walk.graph.points(codes, x[:, :-1], walk.weight)
        defect = p.l_0 + t[:, None] * p.l_1 - u @ p.A_tilde - p.c * traction
        return t, u, traction, np.max(np.abs(defect) / p.c, axis=1) / walk.traction


def _joined(walk: Walk, halves: list[_Half]) -> Path:
    """The path from its forward half and, if there is one, the backward half (reversed and put in front)."""
    ahead, back = halves[0], halves[1] if len(halves) > 1 else None
    (t, u, traction, residual), codes, stable = _columns(ahead), ahead.codes, ahead.stable
    begin: PathStatus = ahead.end if ahead.end == PathStatus.CLOSED_LOOP else PathStatus.START
    if back is not None:
        both = zip(_columns(back), _columns(ahead), strict=True)
        t, u, traction, residual = (np.concatenate([before[:0:-1], after]) for before, after in both)
        codes, stable, begin = [*back.codes[::-1], *codes], [*back.stable[::-1], *stable], back.end
    return Path(
        walk.problem,
        t,
        u,
        traction,
        residual,
        np.array(stable, dtype=bool),
        np.array(codes, dtype=np.int32).reshape(len(codes), walk.m),
        len(back.codes) if back is not None else 0,
        begin,
        ahead.end,
        walk.basis.factorisations,
    )


def _columns(half: _Half) -> list[Array]:
    return [np.concatenate(column) for column in zip(*half.rows, strict=True)]
