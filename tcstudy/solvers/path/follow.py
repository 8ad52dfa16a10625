"""All solutions along a parameter: the piecewise-linear path of Ãu + ξ = l̃₀ + t l̃₁, ξ_i/c_i ∈ b̂(u_i), followed exactly.

For a piecewise-linear law the filled graph of b̂ is a polygonal line at every node. While every node stays on its
piece of the line, (u, ξ, t) moves along a straight line; at the end of it one node goes on to the next piece of its
graph, and the path continues in the next cell. Nothing is approximated and nothing is iterated: folds (t turns), stick,
slip, up- and down-jumps and unstable solutions all are vertices of one polygon. Several nodes at once, starts on a
vertex and pieces with a singular matrix are part of the method (vertex, start, tableau).

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
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.study import Acceptance
from tcstudy.solvers.path.base import SingularCellError
from tcstudy.solvers.path.problem import ParametricProblem
from tcstudy.solvers.path.record import Path, PathEnd, PathStatus, Recorder, joined
from tcstudy.solvers.path.run import Run
from tcstudy.solvers.path.start import locate, rays
from tcstudy.solvers.path.walk import Codes, Walk, units_of

__all__ = ["Follower", "ParametricProblem", "Path", "PathEnd", "PathStatus", "follow"]

Array = NDArray[np.float64]
Direction = Literal["both", "forward", "backward"]


@dataclass(frozen=True)
class Follower:
    """Options of path following.

    t_min, t_max: the path ends where t leaves this range
    max_pieces:   pieces on either side of the start
    tolerance:    largest residual |l̃ − Ãu − ξ|/c relative to the scale of b accepted at any vertex, then strict; None
                  for the default of scene/study.py
    stable_only:  end where the branch stops being stable
    check_every:  vertices whose residuals are checked together
    """

    t_min: float = -np.inf
    t_max: float = np.inf
    max_pieces: int = 20_000
    tolerance: float | None = None
    stable_only: bool = False
    check_every: int = 32

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
        units = units_of(problem, t)
        walk = locate(problem, units, np.asarray(v, dtype=float), t)
        try:
            ways = rays(walk)
        except SingularCellError:
            return _nowhere(problem, walk)
        chosen = {"both": ways, "forward": ways[:1], "backward": ways[1:]}[direction]
        halves: list[tuple[Recorder, Codes, PathEnd]] = []
        seen: dict[int, int] = {}
        used = walk.tableau.factorisations
        for ray in chosen:
            run = Run(self, problem, units, ray, t, seen, progress)
            halves.append((run.record, ray.codes, run.follow()))
            used += run.walk.tableau.factorisations
            if halves[-1][2].status == PathStatus.CLOSED_LOOP:
                break
        return joined(problem, halves, used)


def follow(problem: ParametricProblem, v: Array, t: float, t_min: float = -np.inf, t_max: float = np.inf) -> Path:
    """The path through the solution v of parameter t in both directions, with the default options of Follower."""
    return Follower(t_min=t_min, t_max=t_max).follow(problem, v, t)


def _nowhere(problem: ParametricProblem, walk: Walk) -> Path:
    """A path of one vertex: the start is so degenerate that no direction exists."""
    record = Recorder()
    u = walk.u
    record.add(walk.t, u, walk.traction(u))
    record.residual.append(walk.residual())
    end = PathEnd.of(PathStatus.SINGULAR)
    return joined(problem, [(record, walk.codes.copy(), end)], walk.tableau.factorisations)
