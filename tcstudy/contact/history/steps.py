"""One step of a load history after the other: along its path, or by a contact problem for each of its parts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.contact import Answer, solve_contact
from tcstudy.contact.history.continued import continued
from tcstudy.contact.history.problem import Energies, HistoryProblem, HistoryStep, booked, proved
from tcstudy.contact.loop import Status
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.separable.convex_step import convex_step
from tcstudy.contact.separable.pieces import slopes

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
        return replace(last, energies=Energies(), parts=0, iterations=0, jumps=0, jumped=np.zeros(body.m, dtype=bool))
    if body.follows_paths:
        return continued(body, last, load)
    change, now = load - last.load, last
    energies, parts, iterations, count = Energies(), 0, 0, body.substeps or 1
    for part in range(1, count + 1):
        target = load if part == count else last.load + (part / count) * change
        now = descended(body, now, target)
        energies, parts, iterations = energies + now.energies, parts + now.parts, iterations + now.iterations
        if not now.solved:
            break
    return replace(now, energies=energies, parts=parts, iterations=iterations)


def descended(body: HistoryProblem, last: HistoryStep, load: Array) -> HistoryStep:
    """One contact problem: from the last state by descent, or the lowest of all starts."""
    problem = body.problem(last.state, load)
    w = last.state.v - body.model.origin(last.state)
    lowest = body.branch == "lowest" and not (body.convex or body.monotone)
    answer = solve_contact(problem, tolerance=body.tolerance, branch="lowest" if lowest else "continued", neighbour=w)
    if answer.status == Status.NOT_POSITIVE_DEFINITE:
        answer = _held_by_friction(body, problem, w, answer)
    step = booked(body, last, load, answer)
    return proved(body, problem, answer, step) if step.solved else step


def _held_by_friction(body: HistoryProblem, problem: ContactProblem, w: Array, failed: Answer) -> Answer:
    """The same from the minimum of the convex model, for a body that lies loose while all its nodes slide."""
    law = problem.law
    xi = problem.xi(w)
    piece = np.where(slopes(problem, w, xi).descent <= 0.0, law.piece(w, +1), law.piece(w, -1))
    found = convex_step(problem, w, piece)
    if found is None:
        return failed
    answer = solve_contact(problem, tolerance=body.tolerance, branch="continued", neighbour=found[0])
    return replace(answer, iterations=answer.iterations + failed.iterations)
