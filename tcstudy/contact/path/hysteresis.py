"""The quasi-static loop: t grows and falls slowly, the body follows its stable branch and falls off it at folds.

Along a branch dL̃/dt = −W with W = l̃₁ᵀu, so the loop needs no stress history: what is lost in it is the sum of the
energy drops at the jumps, and for a closed loop also the area −∮W dt = ∮t dW in the plane of t and its conjugate W.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.contact import nearest_minimum
from tcstudy.contact.path.follow import Follower, ParametricProblem, Path, PathStatus
from tcstudy.contact.separable.finish import extended

Array = NDArray[np.float64]

MOST_CYCLES = 3
"""How often the loop is driven for it to close; the last cycle is returned."""
BEYOND = 1e-7
"""A fall starts this far beyond the fold, relative to the range of t; the landing is traced back to the fold."""


@dataclass(frozen=True)
class Jump:
    """A fall from the end of a stable branch to another solution of the same t.

    t:      parameter;  rising: t was growing
    v_from, v_to: (m,) displacements before and after [m]
    drop:   energy lost, L̃(v_from) − L̃(v_to) [J/m];  branch: at whose end it begins
    """

    t: float
    rising: bool
    v_from: Array
    v_to: Array
    drop: float
    branch: int


@dataclass(frozen=True)
class Hysteresis:
    """One cycle of t.

    branches: stable branches in order, those of growing t first
    jumps:    falls between them
    lost:     energy lost at the jumps [J/m]
    area:     −∮W dt over the branches [J/m]; equals `lost` if the loop is closed
    closed:   the cycle ends in the solution in which it began
    complete: both turning points were reached; reason says why not
    """

    branches: tuple[Path, ...]
    jumps: tuple[Jump, ...]
    lost: float
    area: float
    closed: bool
    complete: bool
    reason: str


def hysteresis(
    problem: ParametricProblem,
    v: Array,
    t_down: float,
    t_up: float,
    follower: Follower | None = None,
) -> Hysteresis:
    """The loop between t_down and t_up > t_down, from the stable solution v of t_down: the first cycle that closes.

    Where it falls to is decided by energy descent from the fold, which is a
    rule, not mechanics: inertia might carry the body past a shallow minimum.
    Raises ValueError for an empty range, NoSolutionError if v is no solution.
    """
    if not t_down < t_up:
        raise ValueError(f"t_down = {t_down:g} must be below t_up = {t_up:g}")
    begin = np.asarray(v, dtype=float)
    for _ in range(MOST_CYCLES):
        run = _Cycle(problem, t_down, t_up, follower or Follower())
        complete = run.sweep(begin, rising=True) and run.sweep(run.v, rising=False)
        first, last = run.branches[0].u[0], run.v
        size = max(float(np.max(np.abs(branch.u))) for branch in run.branches)
        closed = complete and bool(np.max(np.abs(first - last)) <= 1e-9 * size)
        begin = last
        if closed or not complete:
            break
    lost = float(sum(jump.drop for jump in run.jumps))
    area = sum(-float(np.sum(np.diff(b.t) * 0.5 * (b.conjugate[1:] + b.conjugate[:-1]))) for b in run.branches)
    return Hysteresis(tuple(run.branches), tuple(run.jumps), lost, area, closed, complete, run.reason)


class _Cycle:
    """The branches and jumps of one cycle while it is being driven."""

    def __init__(self, problem: ParametricProblem, t_down: float, t_up: float, follower: Follower) -> None:
        self.problem, self.t_down, self.t_up, self.follower = problem, t_down, t_up, follower
        self.branches: list[Path] = []
        self.jumps: list[Jump] = []
        self.v = np.zeros(problem.m)
        self.reason = "both ends of the range of t were reached"

    def sweep(self, v: Array, rising: bool) -> bool:
        """From one end of the range to the other; False if that failed (`reason` says why)."""
        t, end = (self.t_down, self.t_up) if rising else (self.t_up, self.t_down)
        for _ in range(self.follower.max_pieces):
            branch = self._branch(v, t, end, rising)
            self.branches.append(branch)
            v, t = branch.u[-1], float(branch.t[-1])
            self.v = v
            if branch.end.status == PathStatus.RANGE_END:
                return True
            if branch.end.status != PathStatus.UNSTABLE:
                self.reason = f"at t = {t:g}: {branch.end.reason}"
                return False
            landed = self._fall(branch, rising)
            if landed is None:
                return False
            problem = self.problem.at(t)
            drop = problem.energy(v) - problem.energy(landed)
            self.jumps.append(Jump(t, rising, v, landed, drop, len(self.branches) - 1))
            v = landed
        self.reason = "more jumps than max_pieces"
        return False

    def _branch(self, v: Array, t: float, end: float, rising: bool) -> Path:
        run = replace(self.follower, t_min=min(t, end), t_max=max(t, end), stable_only=True)
        return run.follow(self.problem, v, t, "forward" if rising else "backward")

    def _fall(self, branch: Path, rising: bool) -> Array | None:
        """The solution to which the body falls from the end of a branch.

        The descent starts one piece behind the fold: at fixed t the energy falls along the unstable piece.
        """
        t = float(branch.t[-1])
        beyond = t + (1.0 if rising else -1.0) * BEYOND * (self.t_up - self.t_down)
        problem = self.problem.at(beyond)
        landed, _ = nearest_minimum(problem, self._over(branch, rising), 1e-12)
        residual = extended(problem, landed).residual
        if not self.follower.acceptance.accepts(residual, problem.xi_rounding(landed)):
            self.reason = f"no solution was found beyond the fold at t = {t:g}: residual {residual:.1e}"
            return None
        back = self._branch(landed, beyond, t, not rising)
        if back.end.status != PathStatus.RANGE_END:
            self.reason = f"the solution beyond the fold at t = {t:g} does not reach back to it: {back.end.reason}"
            return None
        return np.asarray(back.u[-1])

    def _over(self, branch: Path, rising: bool) -> Array:
        """The next vertex of the full path behind the end of a stable branch."""
        if branch.pieces == 0:
            return np.asarray(branch.u[-1])
        v, t = 0.5 * (branch.u[-1] + branch.u[-2]), 0.5 * (branch.t[-1] + branch.t[-2])
        full = Follower(max_pieces=2, tolerance=self.follower.tolerance)
        return np.asarray(full.follow(self.problem, v, float(t), "forward" if rising else "backward").u[-1])
