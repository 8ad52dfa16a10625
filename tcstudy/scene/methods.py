"""How a contact problem may be solved, by name: solvers, where they start, and which solution is kept.

The one place of these names: the reader offers them, the solvers obey them, the data tell them.
"""

from __future__ import annotations

from typing import Literal, get_args

SEPARABLE, BUNDLE = SOLVERS = ("separable-newton", "bundle-newton")
"""Names that a study may give under `solver`."""

Branch = Literal["lowest", "continued", "from-zero"]
"""Which solution is stored where several are found; see `SolverPlan`."""
BRANCHES: tuple[Branch, ...] = get_args(Branch)

START_NAMES = ("zero", "frictionless", "neighbour", "escape", "exact")
"""Starts: no displacement, the solution without friction, the solution of a neighbouring problem, where these may not
have led to the least energy the convexified problem and moves of single nodes (solvers/search.py), and the exact
solution of the continuous problem where the study gives one."""
ZERO, FRICTIONLESS, NEIGHBOUR, ESCAPE, EXACT = range(len(START_NAMES))
