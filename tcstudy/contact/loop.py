"""What a solver returns: the point, how good it is, and in words what happened and what to try.

The one loop that runs every iterative method of this package.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray


class Status(IntEnum):
    """Why a run ended. Only CONVERGED is a solution; everything else carries a reason."""

    CONVERGED = 0
    ITERATION_LIMIT = 1
    STALLED = 2
    NOT_FINITE = 3
    UNBOUNDED = 4
    NOT_POSITIVE_DEFINITE = 5
    INCLUSION_VIOLATED = 6


@dataclass(frozen=True)
class Outcome:
    """Result of one run.

    x:              the last iterate, (n,)
    f:              objective there
    status:         why the run ended
    reason:         one sentence for the user: what happened and, on failure, what to try
    iterations:     steps taken
    evaluations:    evaluations of the objective (a line-search trial counts as one)
    factorisations: dense matrix factorisations
    accuracy:       the stopping quantity at x, in the units that the method documents
    """

    x: NDArray[np.float64]
    f: float
    status: Status
    reason: str
    iterations: int
    evaluations: int
    factorisations: int = 0
    accuracy: float = float("nan")

    @property
    def converged(self) -> bool:
        """True if the method's own stopping test was met."""
        return self.status == Status.CONVERGED


class Method(Protocol):
    """An immutable record of options that knows how to start, step and stop.

    `start` evaluates the problem at x0; `step` returns the next state and must leave the old one untouched;
    `verdict` returns None to go on or (status, reason) to stop; `outcome` packs the final state;
    `line` is one aligned log line about a state.
    """

    @property
    def max_iterations(self) -> int: ...
    def start(self, problem: Any, x0: NDArray[np.float64]) -> Any: ...
    def step(self, problem: Any, state: Any) -> Any: ...
    def verdict(self, problem: Any, state: Any) -> tuple[Status, str] | None: ...
    def outcome(self, problem: Any, state: Any, status: Status, reason: str, iterations: int) -> Outcome: ...
    def line(self, state: Any, iteration: int) -> str: ...


def iterate(method: Method, problem: Any, x0: NDArray[np.float64], log: Callable[[str], None] | None = None) -> Outcome:
    """Run `method` on `problem` from x0 until its verdict or its iteration limit.

    log: called with one aligned line an iteration (numerics never print by themselves).
    """
    state = method.start(problem, np.array(x0, dtype=float))
    for iteration in range(method.max_iterations + 1):
        if log is not None:
            log(method.line(state, iteration))
        verdict = method.verdict(problem, state)
        if verdict is not None:
            return method.outcome(problem, state, *verdict, iteration)
        if iteration < method.max_iterations:
            state = method.step(problem, state)
    reason = (
        f"no solution within {method.max_iterations} iterations; start from a neighbouring solution, "
        "use another solver, or allow bundle-newton more (max_iterations)"
    )
    return method.outcome(problem, state, Status.ITERATION_LIMIT, reason, method.max_iterations)
