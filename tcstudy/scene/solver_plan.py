"""How contact problems are solved: solvers, initial guesses, and the solution that is kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

TOLERANCE = 1e-10
"""Largest inclusion residual by default, as long as rounding allows it."""


SEPARABLE, BUNDLE = SOLVERS = ("separable-newton", "bundle-newton")
"""Names that a study may give under `solver`."""

Branch = Literal["lowest", "continued", "from-zero"]
"""Which solution is stored where several are found; see `SolverPlan`."""
BRANCHES: tuple[Branch, ...] = get_args(Branch)
ALL = "all"
"""The word for all solutions beside the lowest one."""

START_NAMES = ("zero", "frictionless", "neighbour", "escape", "exact")
"""Starts: no displacement, the solution without friction, the solution of a neighbouring problem,
where these may not have led to the least energy the convexified problem and moves of single nodes
(contact/descent.py), and the exact solution of the continuous problem where the study gives one."""
ZERO, FRICTIONLESS, NEIGHBOUR, ESCAPE, EXACT = range(len(START_NAMES))


@dataclass(frozen=True)
class SolverPlan:
    """How the contact problem is solved.

    names:            solvers; the first one's solution is stored, the others are compared with it
    tolerance:        largest inclusion residual of an accepted solution, strict; None for 1e-10 or
                      what rounding allows
    max_iterations:   iteration limit of bundle-newton, None for its own
    branch:           which solution is stored where several are found: the lowest found ("lowest":
                      starts at zero, at the frictionless solution and at the neighbouring sweep
                      point), the one that continues the neighbour's ("continued"), or the one from
                      zero ("from-zero")
    every:            whether all solutions are sought, and proved to be all, beside the lowest
                      found (branch: all)
    max_boxes, max_seconds: limits of the search for all of one point (contact/all_solutions.py)
    """

    names: tuple[str, ...] = (SEPARABLE,)
    tolerance: float | None = None
    max_iterations: int | None = None
    branch: Branch = "lowest"
    every: bool = False
    max_boxes: int = 20_000
    max_seconds: float = 60.0

    @property
    def aim(self) -> float:
        """Largest inclusion residual of a solution as if there were no rounding."""
        return TOLERANCE if self.tolerance is None else self.tolerance

    @property
    def in_blocks(self) -> bool:
        """Whether points are solved together."""
        return self.names == (SEPARABLE,)
