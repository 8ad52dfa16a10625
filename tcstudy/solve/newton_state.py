"""One iterate of the separable Newton method with all that the next step needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tcstudy.solve.nodal_pieces import Slopes, integral, slopes
from tcstudy.solve.outcome import Status
from tcstudy.solve.problem import ContactProblem

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_ROUNDING = 64.0
"""Residuals below this many roundings of the largest terms of ξ count as rounding."""


@dataclass(frozen=True)
class SeparableState:
    """One iterate.

    v, xi:          displacements [m] and nodal friction forces ξ = l̃ − Ãv [N/m], (m,)
    slopes:         one-sided slopes at v
    piece:          (m,) smooth piece of every node, at a kink the one on its descending side
    residual:       max |descending slope|/c over the scale of b: zero at a first-order stationary point
    rounding:       the same for one rounding of the largest terms of ξ
    f:              L̃(v) [J/m]
    moved:          what the last step was, for the log
    second_order:   what the second-order test found, None while untested
    evaluations, factorisations: work so far
    slow:           steps since the last whole one, or since all nodes were moved together
    stopped:        (status, reason) if the last step could not be made
    """

    v: Array
    xi: Array
    slopes: Slopes
    piece: Index
    residual: float
    rounding: float
    f: float
    moved: str = "start"
    second_order: str | None = None
    evaluations: int = 1
    factorisations: int = 0
    slow: int = 0
    stopped: tuple[Status, str] | None = None

    @property
    def at_rounding(self) -> bool:
        """True if the residual is no more than rounding."""
        return self.residual <= _ROUNDING * self.rounding


def new_state(problem: ContactProblem, v: Array) -> SeparableState:
    """The state at v."""
    xi = problem.xi(v)
    s = slopes(problem, v, xi)
    piece = np.where(s.descent <= 0.0, problem.law.piece(v, +1), problem.law.piece(v, -1))
    terms = np.diagonal(problem.A_tilde) * np.abs(v) + np.abs(problem.l_tilde) + np.abs(xi)
    residual = _relative(problem, s.descent)
    rounding = _relative(problem, np.finfo(float).eps * terms)
    f = float(-0.5 * v @ (xi + problem.l_tilde) + problem.c @ integral(problem.law, np.zeros(problem.m), v))
    second_order = "every node rests" if np.all(s.at_rest) else None
    return SeparableState(v, xi, s, piece, residual, rounding, f, second_order=second_order)


def _relative(problem: ContactProblem, force: Array) -> float:
    """max |force_i|/c_i over the scale of b; infinite if b has no scale and the force is not zero."""
    worst = float(np.max(np.abs(force) / problem.c, initial=0.0))
    if worst == 0.0:
        return 0.0
    return worst / problem.traction_scale if problem.traction_scale > 0.0 else float("inf")
