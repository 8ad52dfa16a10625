"""Which inclusion residual makes a solution: the one rule for every solver, path, certificate and comparison.

A tolerance that a study writes is strict. The default is TOLERANCE or what rounding of the problem allows, whichever is
larger: √m ε max_i (|l̃| + |Ã||v|)_i/c_i over the scale of b (`ContactProblem.xi_rounding`), which is what rounding v to
doubles, Ã and l̃ being doubles too, does to ξ. Where that exceeds LOST there is no friction left to solve for, and the
default goes no further.
"""

from __future__ import annotations

from dataclasses import dataclass

TOLERANCE = 1e-10
"""Largest inclusion residual by default, as long as rounding allows it."""
LOST = 1e-3
"""Rounding of ξ over the scale of b beyond which fewer than three digits of the friction are known."""


@dataclass(frozen=True)
class Acceptance:
    """The test of an inclusion residual.

    tolerance: as a study writes it, then strict; None for the default
    """

    tolerance: float | None = None

    @property
    def aim(self) -> float:
        """What is worked for: the tolerance as if there were no rounding."""
        return TOLERANCE if self.tolerance is None else self.tolerance

    def limit(self, rounding: float) -> float:
        """Largest residual of a solution.

        rounding: what rounding of the problem allows, `problem.xi_rounding(v)`
        """
        if self.tolerance is not None:
            return self.tolerance
        return max(TOLERANCE, min(rounding, LOST))

    def accepts(self, residual: float, rounding: float) -> bool:
        """Whether a point with this residual is a solution (nan is none)."""
        return residual <= self.limit(rounding)

    def limited(self, residual: float, rounding: float) -> bool:
        """Whether a point is a solution only because rounding of the problem allows no better."""
        return self.aim < residual <= self.limit(rounding)
