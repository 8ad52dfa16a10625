"""One step of a load history after the other: along its path, or the lowest state of its contact problem."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.history.continued import continued
from tcstudy.contact.history.problem import HistoryProblem, HistoryStep, booked, proved
from tcstudy.contact.newton import convex_step
from tcstudy.contact.problem import ContactProblem, Status
from tcstudy.contact.solve import solve_contact
from tcstudy.scene.study import Branch

Array = NDArray[np.float64]


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
    if history.branch == "continued" and not history.law.vanishes:  # else nothing is remembered, no path has a scale
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
