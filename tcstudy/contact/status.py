"""What a method returns: the point, how good it is, and in words what happened and what to try."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

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
    """

    x: NDArray[np.float64]
    f: float
    status: Status
    reason: str
    iterations: int
    evaluations: int

    @property
    def converged(self) -> bool:
        """True if the method's own stopping test was met."""
        return self.status == Status.CONVERGED
