"""One part of a load step: from the state with which it begins on, with the laws that this gives.

All in w = v − a (memory.py): the contact problem of any load, exactly, and over the shares of the step with straight
pieces in the place of exponential ones, which a path can be followed on as far as nobody takes back what it has done.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.history.problem import HistoryProblem, HistoryStep
from tcstudy.contact.path.follow import ParametricProblem, Path
from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.laws import Laws

Array = NDArray[np.float64]

ROUNDING = 1e-11
"""Part of the largest slip that rounding may seem to take back, or to be apart."""


class StepPart:
    """What a part of a step is, from the state `now` on; all in w = v − a."""

    def __init__(self, body: HistoryProblem, now: HistoryStep, begin: Array, change: Array) -> None:
        """begin, change: the loads of the step are begin + t change (m,)"""
        self.body, self.now, self.begin, self.change = body, now, begin, change
        self.origin = body.model.origin(now)
        self.w, self.pushed = now.v - self.origin, body.A_tilde @ self.origin

    @cached_property
    def law(self) -> Laws:
        """That of the part."""
        return self.body.model.next_law(self.now)

    @cached_property
    def defect(self) -> Array:
        """(m,) what rounding of the state's slips takes its forces off the graph, as the part begins with it [N/m].

        A stiff body makes much of a slip's last digit; without this no path would begin at the state.
        """
        now, body = self.now, self.body
        xi = now.load - body.A_tilde @ now.v
        size = np.abs(now.load) + np.abs(body.A_tilde) @ np.abs(now.v)
        low, high = (body.c * limit - xi for limit in self.law.interval(self.w))
        apart = np.where(np.abs(low) < np.abs(high), low, high)  # inside as outside: no vertex is gone back to for it
        rounding = 8.0 * np.sqrt(body.m) * np.finfo(float).eps * size
        return np.where(np.abs(apart) <= rounding, apart, 0.0)

    def problem(self, load: Array) -> ContactProblem:
        """That of a load."""
        return ContactProblem(
            self.body.A_tilde, load - self.pushed + self.defect, self.body.c, self.law, self.body.A_error
        )

    @cached_property
    def parametric(self) -> ParametricProblem:
        """The problem with a law of straight pieces, over the shares of the step."""
        body, linear = self.body, self.body.law.piecewise_linear
        law = self.law if linear else body.model.next_law(self.now, straight=True)
        problem = ParametricProblem(body.A_tilde, self.begin - self.pushed + self.defect, self.change, body.c, law)
        vars(problem)["body"] = body.scaled  # the same in all parts and steps
        return problem

    def first_return(self, path: Path) -> int:
        """Vertex up to which nobody takes back anything: slips, plastic slips and openings only grow."""
        model, state = self.body.model, self.now
        rounding = ROUNDING * float(np.max(np.abs(path.u)))
        done = model.done(state, path.u[0])
        for vertex in range(1, path.pieces + 1):
            following = model.done(state, path.u[vertex])
            if np.any(following < done - rounding):
                return vertex - 1
            done = np.maximum(done, following)
        return path.pieces
