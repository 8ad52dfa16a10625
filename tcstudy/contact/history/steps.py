"""A load history one step after the other, the loop that a load drives to and fro, and derivatives of histories.

A step goes along its path (continued.py), or to the lowest state of its contact problem.

Loop: of a bond that remembers nothing the state follows its stable branch and falls off it at folds. With the load
l̃₀ + t l̃₁ the work of a step is −∫W dt, W = l̃₁ᵀv: of a closed loop it is its area in the plane of t and W, and all of
it is lost at the jumps.

Derivatives by one number p are differences of whole histories, which are exact to rounding. A history is smooth in p
but for events, where one-sided derivatives differ. With D± = ±(f(p ± h) − f(p))/h at two steps h the part of D⁺ − D⁻
that stays as h → 0 is such a difference; what falls like h is curvature, which D at both steps gives on either side,
also where an event lies between the steps of the other one. Of the values that either step gives that is taken which
errs least. Where a number can only grow, or only fall, D is looked at on one side, at three steps: for a smooth f they
lie on a line. What errs by more than AGREES is NaN.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.history.continued import ContinuedStep, Jump, Way, continued
from tcstudy.contact.history.memory import MemoryModel
from tcstudy.contact.history.problem import HistoryProblem, HistoryStep, booked, proved
from tcstudy.contact.newton import convex_step
from tcstudy.contact.path.problem import ParametricProblem
from tcstudy.contact.problem import CondensedBody, ContactProblem, Status
from tcstudy.contact.solve import solve_contact
from tcstudy.scene.histories import Memory
from tcstudy.scene.study import Branch

Array = NDArray[np.float64]

MOST_CYCLES = 3
"""How often the loop is driven for it to close; the last cycle is returned."""
CLOSED = 1e-9
"""Of the largest slip, by which the end of a closed cycle may differ from its begin."""
STEPS = (1e-4, 1e-5)
"""Of a number, relative to its scale."""
HALFWAY = 0.5 * (STEPS[0] + STEPS[1])
"""The third step where there is but one side."""
AGREES, SMALL = 2e-6, 1e-2
"""Of a derivative, or of this part of f per scale if that is more, by which it may err."""


def history(problem: HistoryProblem, loads: Iterable[Array], start: HistoryStep | None = None) -> Iterator[HistoryStep]:
    """The steps to these loads l̃ (m,), one after the other; a step that fails is the last.

    start: the step after which to begin, by default the virgin body without loads
    """
    last = HistoryStep.virgin(problem.body.m) if start is None else start
    for load in loads:
        last = next_step(problem, last, np.asarray(load, dtype=float))
        yield last
        if not last.solved:
            return


def next_step(history: HistoryProblem, last: HistoryStep, load: Array) -> HistoryStep:
    """The step from `last` to a load; loads that do not change change nothing, to the bit."""
    if np.array_equal(load, last.load):
        return last.unchanged()
    if (
        history.branch == "continued" and not history.model.law.vanishes
    ):  # else nothing is remembered, no path has a scale
        return continued(history, last, load)
    return lowest(history, last, load)


def lowest(history: HistoryProblem, last: HistoryStep, load: Array) -> HistoryStep:
    """The state of least energy that is found of the step's one contact problem in w = v − a.

    A body that lies loose while all its nodes slide is solved from the minimum of the convex model.
    """
    body, tolerance, a = history.body, history.tolerance, history.model.origin(last)
    problem = ContactProblem.on(body, load - body.A_tilde @ a if np.any(a) else load, history.model.next_law(last))
    branch: Branch = "continued" if history.convex or history.monotone else "lowest"
    answer = solve_contact(problem, tolerance=tolerance, branch=branch, neighbour=last.v - a)
    failed = answer.status == Status.NOT_POSITIVE_DEFINITE
    if failed and (begin := convex_step(problem, last.v - a)) is not None:
        again = solve_contact(problem, tolerance=tolerance, branch="continued", neighbour=begin)
        answer = replace(again, iterations=again.iterations + answer.iterations)
    step = booked(history, last, load, answer)
    return proved(history, problem, answer, step) if step.solved else step


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
    history = HistoryProblem(
        body, MemoryModel(Memory("none"), problem.law, problem.m), tolerance=tolerance, max_pieces=max_pieces
    )
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


def derivative(middle: Array, beside: Array, scale: float) -> Array:
    """(n,) df/dp from f (n,) at p and f beside it; NaN where there is none.

    beside: (4, n) at p + STEPS and at p − STEPS times the scale of p; or (3, n) at p + STEPS and HALFWAY, scale < 0
            where p can only fall
    """
    one, other = STEPS
    if len(beside) == 4:
        h = np.array(STEPS)[:, None] * scale
        plus, minus = (beside[:2] - middle) / h, (middle - beside[2:]) / h
        (far, near), apart = 0.5 * (plus + minus), plus - minus
        above, below = ((side[0] - side[1]) * other / (one - other) for side in (plus, -minus))
        bend = np.array([0.0 * above, above + below, 2.0 * above, 2.0 * below])
        values, errors = np.array([far, *(near + 0.0 * bend)]), np.array([apart[0], *(apart[1] - bend)])
    else:
        far, near, between = (beside - middle) / (np.array([*STEPS, HALFWAY])[:, None] * scale)
        values = ((one * near - other * far) / (one - other))[None]
        errors = (between - 0.5 * (far + near))[None]
    errors = np.where(np.isfinite(errors), np.abs(errors), np.inf)
    at = np.argmin(errors, axis=0), np.arange(errors.shape[1])
    value, error = values[at], errors[at]
    return np.where(error <= AGREES * np.maximum(np.abs(value), SMALL * np.abs(middle / scale)), value, np.nan)
