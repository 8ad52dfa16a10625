"""The quasi-static loop of a path: the history of a load that grows and falls, of a bond that remembers nothing.

In such a history the state follows its stable branch and falls off it at folds. With the load l̃₀ + t l̃₁ the work of a
step is −∫W dt, W = l̃₁ᵀv: of a closed loop it is its area in the plane of t and W, and all of it is lost at the jumps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.history.continued import ContinuedStep, Jump, Way
from tcstudy.contact.history.problem import HistoryProblem, HistoryStep
from tcstudy.contact.path.problem import ParametricProblem
from tcstudy.contact.problem import CondensedBody
from tcstudy.scene.histories import Memory

Array = NDArray[np.float64]

MOST_CYCLES = 3
"""How often the loop is driven for it to close; the last cycle is returned."""
CLOSED = 1e-9
"""Of the largest slip, by which the end of a closed cycle may differ from its begin."""


@dataclass(frozen=True)
class Hysteresis:
    """One cycle of t, there and back.

    ways:   stable branches in order, with t in the place of shares;  jumps: falls between them, likewise
    there:  how many of these belong to the way there
    lost:   energy lost at the jumps;  area: −∮W dt, the same if the loop is closed [J/m]
    closed: the cycle ends in the solution in which it began
    reason: why the turning points were not both reached, else empty
    """

    ways: tuple[Way, ...]
    jumps: tuple[Jump, ...]
    there: int
    lost: float
    area: float
    closed: bool
    reason: str

    @property
    def complete(self) -> bool:
        """Whether both turning points were reached."""
        return not self.reason


def hysteresis(
    problem: ParametricProblem,
    v: Array,
    begin: float,
    end: float,
    max_pieces: int = 20_000,
    tolerance: float | None = None,
) -> Hysteresis:
    """The loop from the stable solution v (m,) of t = begin to end and back: the first cycle that closes.

    max_pieces, tolerance: as of a `Follower`
    Where it falls to is decided by energy descent from the fold, which is a rule, not mechanics: inertia might carry
    the body past a shallow minimum. Raises ValueError for an empty range.
    """
    if begin == end:
        raise ValueError(f"the loop begins and ends at t = {begin:g}; give it a range")
    body = CondensedBody.known(problem.A_tilde, problem.c, problem.A_error)
    history = HistoryProblem(body, problem.law, Memory("none"), tolerance=tolerance, max_pieces=max_pieces)
    load = problem.load(begin)
    last = replace(HistoryStep.virgin(problem.m), v=v, load=load, xi=problem.at(begin).xi(v) / problem.c,
                   stored=float(problem.c @ problem.law.j(v)), energy=history.energy(v, load))  # fmt: skip
    for _ in range(MOST_CYCLES):
        first, ways, jumps, there, lost, area = last, list[Way](), list[Jump](), 0, 0.0, 0.0
        for one, other in ((begin, end), (end, begin)):
            step = ContinuedStep(history, last, problem.load(other))
            reason = "" if step.run() else f"at t = {_between(step.t, one, other):g}: {step.reason}"
            for jump in step.jumps:
                jumps.append(jump._replace(ways=len(ways) + jump.ways, t=float(_between(jump.t, one, other))))
            ways += [way._replace(t=_between(way.t, one, other)) for way in step.ways]
            there = len(jumps) if other == end else there
            lost, area = lost + step.now.released, area + step.now.work
            last = step.now
            if reason:
                break
        size = max((float(np.max(np.abs(way.v))) for way in ways), default=0.0)
        closed = not reason and bool(np.max(np.abs(last.v - first.v)) <= CLOSED * size)
        if closed or reason:
            break
    return Hysteresis(tuple(ways), tuple(jumps), there, lost, area, closed, reason)


def _between(share: float | Array, begin: float, end: float) -> Array:
    return np.where(share == 1.0, end, begin + share * (end - begin))
