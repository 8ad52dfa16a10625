"""Equilibria on one branch: the piecewise-linear path of Ãu + ξ = l̃₀ + t l̃₁, ξ_i/c_i ∈ b̂(u_i), followed exactly.

For a piecewise-linear law the filled graph of b̂ is a polygonal line at every node. While every node stays on its
piece of the line, (u, ξ, t) moves along a straight line; at the end of it one node goes on to the next piece of its
graph, and the path continues in the next cell. Nothing is approximated and nothing is iterated: folds (t turns), stick,
slip, up- and down-jumps and unstable solutions all are vertices of one polygon. Several nodes at once, starts on a
vertex and pieces with a singular matrix are part of the method (vertex, tableau).

Orientation: what keeps the path from turning round is that the node that has reached its bound goes on in the same
sense along its graph. Generically the pieces then form a curve without branches, so a cell is entered at most once:
coming back to one means a closed loop or, at a bifurcation, a branch that was met before; both end the path.

Literature: Katzenelson, Bell Syst. Tech. J. 44 (1965) 1605–1620 (piecewise-linear networks); Lemke, Manage. Sci. 11
(1965) 681–689 (the variable that has left a piece drives the next one). Left out: other branches at a bifurcation,
except the one that keeps tied nodes together.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.path.dense import SingularCellError
from tcstudy.contact.path.problem import ParametricProblem
from tcstudy.contact.path.record import Path, PathEnd, PathStatus, Recorder, joined
from tcstudy.contact.path.start import Ray, depart, here, locate, onward, rays
from tcstudy.contact.path.vertex import cross, move
from tcstudy.contact.path.walk import Codes, Walk, units_of
from tcstudy.scene.study import Acceptance, Direction

__all__ = ["Follower", "ParametricProblem", "Path", "PathEnd", "PathStatus"]

Array = NDArray[np.float64]


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
        progress: Callable[[int, float], None] | None = None,
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
        units = units_of(problem)
        walk = locate(problem, units, np.asarray(v, dtype=float), t)
        try:
            ways = rays(walk)
        except SingularCellError:
            return _nowhere(problem, walk)
        chosen = {"both": ways, "forward": ways[:1], "backward": ways[1:]}[direction]
        halves: list[tuple[Recorder, Codes, PathEnd]] = []
        seen: dict[int, int] = {}
        for ray in chosen:
            run = Run(self, walk, ray, seen, progress)
            halves.append((run.record, ray.codes, run.follow()))
            if halves[-1][2].status == PathStatus.CLOSED_LOOP:
                break
        return joined(problem, halves, walk.tableau.factorisations)

    def onward(self, walk: Walk) -> Path | None:
        """The path along the stable way on which t grows from where the walk stands; None if there is none."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ray = onward(walk)
        if ray is None:
            return None
        run = Run(self, walk, ray, {}, None)
        return joined(walk.problem, [(run.record, ray.codes, run.follow())], walk.tableau.factorisations)


def _nowhere(problem: ParametricProblem, walk: Walk) -> Path:
    """A path of one vertex: the start is so degenerate that no direction exists."""
    record = Recorder()
    record.add(walk.t, walk.x, walk.codes)
    record.on_graph(walk.graph, walk.units.weight)
    record.residual.append(walk.residual())
    end = PathEnd(PathStatus.SINGULAR)
    return joined(problem, [(record, walk.codes.copy(), end)], walk.tableau.factorisations)


TOGETHER = 64
"""Vertices whose residuals are checked together."""

BLURRED = 3e-14
"""Relative error of a direction above which the matrix is factored anew."""

AIM = 0.1
"""Part of the tolerance that is worked for with fresh factorisations, as far as rounding lets it be reached."""

BACKWARD = 1e-12
"""A node that moves back more slowly than this part of the fastest one does not turn."""


class Checkpoint(NamedTuple):
    """A point of the path to which the run can return."""

    vertices: int
    at: Ray


class Run:
    """One direction of one path."""

    def __init__(
        self,
        options: Follower,
        walk: Walk,
        ray: Ray,
        seen: dict[int, int],
        progress: Callable[[int, float], None] | None,
    ) -> None:
        self.options, self.problem, self.units, self.progress = options, walk.problem, walk.units, progress
        self.walk = walk
        depart(walk, ray)
        self.outward = walk.graph.outward if options.one_way else None
        self.record = Recorder()
        self.seen, self.own = seen, [_key(ray.codes)]
        self.home, self.start_x, self.start_t = _key(ray.codes), ray.x.copy(), ray.t
        self.seen.setdefault(self.home, 0)
        self.every, self.returned, self.reached = TOGETHER, -1, 0.0
        self._store()
        self.trail = [Checkpoint(self.record.count, here(walk))]

    def _store(self) -> None:
        self.record.add(self.walk.t, self.walk.x, self.walk.codes)

    @np.errstate(divide="ignore", invalid="ignore")
    def follow(self) -> PathEnd:
        """Piece after piece until something ends the path."""
        while True:
            status = self._piece()
            if status is not None or len(self.trail) > self.every:
                try:
                    accurate = self._check()
                except SingularCellError:
                    return PathEnd(PathStatus.SINGULAR)
                if accurate is None:
                    return PathEnd(PathStatus.LOST_ACCURACY)
                if accurate and status is not None:
                    return PathEnd(status)
                if self.progress is not None:
                    self.progress(self.record.count - 1, self.walk.t)

    def _piece(self) -> PathStatus | None:
        """Follow the present piece to its end and enter the next one."""
        walk, record = self.walk, self.record
        if len(record.stable) >= self.options.max_pieces:
            return PathStatus.PIECE_LIMIT
        if self.options.stable_only and not walk.stable:
            return PathStatus.UNSTABLE
        if self.outward is not None and record.count > 1:
            speed = self.outward[walk.codes] * walk.dx
            if float(speed.min()) < -BACKWARD * float(np.abs(walk.dx).max()):
                return PathStatus.TURNS
        step, first = walk.reach()
        last = self._last_step(step)
        if last is not None:
            step, status = last
            if np.isfinite(step):
                walk.x += step * walk.dx
                end = self.options.t_max if walk.dt > 0.0 else self.options.t_min
                walk.t = self.start_t if status == PathStatus.CLOSED_LOOP else end
                if self.every == 1 and status == PathStatus.RANGE_END:
                    with suppress(SingularCellError):
                        walk.refine(None)
                record.stable.append(walk.stable)
                self._store()
            return status
        stable = walk.stable
        at = walk.arrive(step, first)
        record.stable.append(stable)
        self._store()
        before = [walk.codes.item(i) for i in at]
        try:
            cross(walk, at)
        except SingularCellError:
            return PathStatus.SINGULAR
        for node, code in zip(at, before, strict=True):
            record.changed(node, code, walk.codes.item(node))
        if len(at) > 1 or self.every == 1:
            self._settle()
        self.trail.append(Checkpoint(self.record.count, here(walk)))
        return self._entered()

    def _last_step(self, step: float) -> tuple[float, PathStatus] | None:
        """(step, status) if the path ends on this piece: back at the start, at the end of the range, or never."""
        walk = self.walk
        if len(self.own) > 1 and self.own[-1] == self.home:
            lead = int(np.argmax(np.abs(walk.dx)))
            return (self.start_x[lead] - walk.x[lead]) / walk.dx[lead], PathStatus.CLOSED_LOOP
        bound = self.options.t_max if walk.dt > 0.0 else self.options.t_min
        to_range = (bound - walk.t) / walk.dt if walk.dt != 0.0 else np.inf
        if to_range <= step and np.isfinite(to_range):
            return to_range, PathStatus.RANGE_END
        return (np.inf, PathStatus.UNBOUNDED) if not np.isfinite(step) else None

    def _entered(self) -> PathStatus | None:
        """Book the cell just entered; one that was visited before ends the path, unless it is the start's."""
        key = _key(self.walk.codes)
        self.own.append(key)
        if key in self.seen and not (key == self.home and not self._at_start()):
            return PathStatus.CLOSED_LOOP if key == self.home else PathStatus.TURNED_BACK
        self.seen[key] = len(self.own)
        return None

    def _at_start(self) -> bool:
        gap = np.abs(self.walk.x - self.start_x)
        return bool(np.all(gap <= self.walk.tie * (np.abs(self.walk.u) + self.units.slip) * self.walk.own))

    def _check(self) -> bool | None:
        """Residuals of the new vertices. True: all accurate; False: gone back to refine; None: hopeless."""
        p, record = self.problem, self.record
        first = len(record.residual)
        if first == record.count:
            return True
        u, traction = record.on_graph(self.walk.graph, self.units.weight)
        defect = p.l_0 + np.array(record.t[first:])[:, None] * p.l_1 - u @ p.A_tilde - p.c * traction
        residual = np.max(np.abs(defect) / p.c, axis=1) / self.units.traction
        record.residual += residual.tolist()
        at = first + int(residual.argmax())
        worst, noise = float(residual.max()), p.xi_rounding(record.t[at], record.u[at])
        limit = self.options.acceptance.limit(noise)
        good = min(limit, max(AIM * self.options.acceptance.aim, 0.5 * noise, self.reached))
        mark = self.trail[max(0, first + int(np.argmax(residual > good)) - self.trail[0].vertices)]
        if worst <= good or (worst <= limit and self.returned == mark.vertices):
            self.reached = 0.0 if worst <= good else 2.0 * worst
            if worst > 0.01 * good:
                self._steady()
            self.every, self.walk.tie = min(2 * self.every, TOGETHER), self.units.tie
            self.trail = [Checkpoint(record.count, here(self.walk))]
            return True
        if self.returned == mark.vertices:
            record.cut(max(1, mark.vertices))
            return None
        self._return(mark)
        self.walk.tie = max(1e-2 * self.units.tie, 1e-14)  # it may have been no tie
        self.returned, self.every, self.trail = mark.vertices, 1, [mark]
        return False

    def _settle(self) -> None:
        """Balance the point again and store it as the vertex: after tied nodes were put on their bounds, and where a
        long piece has brought the rounding of its larger loads along.

        A node that only bends there may move off its bound by rounding; one at a jump stays on it.
        """
        walk, graph = self.walk, self.walk.graph
        on_low, on_high = walk.x == walk.low, walk.x == walk.high
        beyond = np.where(on_low, graph.after_low[walk.codes], graph.after_high[walk.codes])
        keep = (on_low | on_high) & ~(graph.free[walk.codes] & graph.free[beyond])
        x = walk.x.copy()
        try:
            walk.refine(walk.held_by(np.flatnonzero(keep)))
        except SingularCellError:
            return  # the check of the residuals judges the point as it is
        walk.x = np.where(keep, x, walk.x)
        self.record.replace_last(walk.t, walk.x, walk.codes)

    def _steady(self) -> None:
        """Correct the present point and its direction; with a fresh factorisation where the old one no longer helps."""
        walk = self.walk
        if not np.any(walk.dx):
            return
        lead = int(np.argmax(np.abs(walk.dx)))
        speed = float(walk.dx[lead])
        on_low, on_high = walk.x == walk.low, walk.x == walk.high
        held = walk.held_by(np.flatnonzero(on_low | on_high))  # it must stay on its kink
        if walk.direction_defect() > BLURRED:
            walk.tableau.refactor()
        walk.refine(held)
        walk.x = np.where(on_low, walk.low, np.where(on_high, walk.high, walk.x))
        move(walk, lead, speed)

    def _return(self, mark: Checkpoint) -> None:
        """Back to a checkpoint, with a fresh factorisation."""
        for key in self.own[mark.vertices :]:
            if key != self.home:
                self.seen.pop(key, None)
        del self.own[mark.vertices :]
        self.record.cut(mark.vertices)
        self.walk.put(mark.at.codes, mark.at.x, mark.at.t)
        self.walk.tableau.refactor()
        depart(self.walk, mark.at)
        self._steady()


def _key(codes: Codes) -> int:
    return hash(codes.tobytes())
