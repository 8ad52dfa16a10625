"""Follow a history of the unknowns that have a law (contact/without_law.py).

The energy of the others and the work of loads on them are known beforehand, and are equal.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.history.memory import HistoryProblem, HistoryStep
from tcstudy.contact.history.steps import history
from tcstudy.contact.problem import CondensedBody
from tcstudy.contact.without_law import Elimination

Array = NDArray[np.float64]
STATE = ("v", "kappa", "plastic", "xi", "dissipation")
"""Values of a step by unknown, beside its load and what has jumped."""


def fast_history(
    problem: HistoryProblem, loads: Sequence[Array], start: HistoryStep | None = None
) -> Iterator[HistoryStep]:
    """Yield the steps of `history`, found without the unknowns that have no law.

    For a body that contact alone holds, and for one without openings, these stay.
    """
    lawful = LawfulHistory.of(problem)
    if lawful is None:
        yield from history(problem, loads, start)
        return
    last_load = np.zeros(problem.body.m) if start is None else start.load
    kept_start = None if start is None else lawful.kept_step(start)
    kept_loads = [lawful.elimination.load(load) for load in loads]
    steps = history(lawful.problem, kept_loads, kept_start)
    for step, load in zip(steps, loads, strict=False):
        if not step.solved:  # it has come so far on its way
            load = lawful.load_of(step, last_load, load)
        yield lawful.full_step(step, load, last_load)
        last_load = load


@dataclass(frozen=True)
class LawfulHistory:
    """The rows of a history that have a law.

    problem: of these rows
    """

    problem: HistoryProblem
    elimination: Elimination

    @classmethod
    def of(cls, full: HistoryProblem) -> LawfulHistory | None:
        """Return the rows of a problem with openings, None if all have a law or none has."""
        body, model = full.body, full.model
        elimination = Elimination.of(body.A_tilde, model.law, body.blocks, body.loose)
        if elimination is None:
            return None
        rows = elimination.rows
        kept_body = CondensedBody.known(
            elimination.kept,
            body.c[rows],
            body.A_error,
            elimination.blocks(body.blocks),
            lambda_1=body.lambda_1,
            loose=False,
        )
        names = None if model.names is None else model.names[rows]
        kept_model = replace(model, law=model.law.of_nodes(rows), m=len(rows), names=names)
        return cls(replace(full, body=kept_body, model=kept_model), elimination)

    def kept_step(self, step: HistoryStep) -> HistoryStep:
        """Return a step of all rows as one of those with a law."""
        elimination = self.elimination
        rows = elimination.rows
        state = {name: getattr(step, name)[rows] for name in STATE}
        energy = step.energy - elimination.energy(step.load)
        return replace(step, **state, load=elimination.load(step.load), energy=energy)

    def load_of(self, step: HistoryStep, begin: Array, end: Array) -> Array:
        """Return the load (m,) between two that is nearest to that of a step on kept rows."""
        kept_begin = self.elimination.load(begin)
        way = self.elimination.load(end) - kept_begin
        share = float(way @ (step.load - kept_begin)) / (float(way @ way) or 1.0)
        return begin + share * (end - begin)

    def full_step(self, step: HistoryStep, load: Array, last_load: Array) -> HistoryStep:
        """Return a step of all rows from that of the rows with a law.

        load, last_load: (m,) of all rows, and that of the step before [N/m]
        """
        elimination = self.elimination
        state: dict[str, Any] = {name: elimination.spread(getattr(step, name)) for name in STATE}
        state["v"] = elimination.displacements(step.v, load)
        jumped = np.broadcast_to(step.jumped, len(elimination.rows))
        energy = elimination.energy(load)
        return replace(
            step,
            **state,
            load=load,
            jumped=elimination.spread(jumped),
            energy=step.energy + energy,
            work=step.work + energy - elimination.energy(last_load),
        )
