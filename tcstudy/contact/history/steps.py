"""One step of a load history after the other: along its path, or the lowest state of its contact problem."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.block import Answer
from tcstudy.contact.contact import solve_contact
from tcstudy.contact.convex_step import convex_step
from tcstudy.contact.history.continued import continued
from tcstudy.contact.history.problem import HistoryProblem, HistoryStep, booked, proved
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.status import Status
from tcstudy.scene.study import Branch

Array = NDArray[np.float64]


def history(
    body: HistoryProblem,
    loads: Iterable[Array],
    start: HistoryStep | None = None,
) -> Iterator[HistoryStep]:
    """The steps to these loads l̃ (m,), one after the other; a step that fails is the last.

    start: the step after which to begin, by default the virgin body without loads
    """
    last = HistoryStep.virgin(body.m) if start is None else start
    for load in loads:
        last = next_step(body, last, np.asarray(load, dtype=float))
        yield last
        if not last.solved:
            return


def next_step(body: HistoryProblem, last: HistoryStep, load: Array) -> HistoryStep:
    """The step from `last` to a load; loads that do not change change nothing, to the bit."""
    if np.array_equal(load, last.load):
        return last.unchanged()
    if body.branch == "continued" and not body.law.vanishes:  # else nothing is remembered, and no path has a scale
        return continued(body, last, load)
    return lowest(body, last, load)


def lowest(body: HistoryProblem, last: HistoryStep, load: Array) -> HistoryStep:
    """The state of least energy that is found of the step's one contact problem."""
    problem = body.problem(last, load)
    w = last.v - body.model.origin(last)
    branch: Branch = "continued" if body.convex or body.monotone else "lowest"
    answer = solve_contact(problem, tolerance=body.tolerance, branch=branch, neighbour=w)
    if answer.status == Status.NOT_POSITIVE_DEFINITE:
        answer = _held_by_friction(body, problem, w, answer)
    step = booked(body, last, load, answer)
    return proved(body, problem, answer, step) if step.solved else step


def _held_by_friction(body: HistoryProblem, problem: ContactProblem, w: Array, failed: Answer) -> Answer:
    """The same from the minimum of the convex model, for a body that lies loose while all its nodes slide."""
    found = convex_step(problem, w)
    if found is None:
        return failed
    answer = solve_contact(problem, tolerance=body.tolerance, branch="continued", neighbour=found)
    return replace(answer, iterations=answer.iterations + failed.iterations)
