"""The state of a bundle-Newton run, and the small rules that lead from one state to the next.

Literature: Lukšan & Vlček, Math. Programming 83 (1998) 373–391; see bundle_newton.py
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tcstudy.solvers.bundle.metric import DiagonalShift, Hessian, combine
from tcstudy.solvers.bundle.model import Model, Piece, Step

Array = NDArray[np.float64]
Oracle = Callable[[Array], tuple[float, Array, Hessian]]
Kind = Literal["start", "serious", "null", "short", "reset"]


@dataclass(frozen=True)
class State:
    """Where a run is.

    x, f:     centre and its value
    f0:       value at the start
    pieces:   the bundle; one of them lies at x
    lam:      (N,) multipliers that belong to `pieces`
    radius:   bound of the next step
    unit:     length of x that the run started with
    promised: decrease predicted at the start
    model, step: the model about x and its minimiser
    kind:     what led here
    nulls, resets: null steps and resets since the last serious step
    """

    x: Array
    f: float
    f0: float
    pieces: tuple[Piece, ...]
    lam: Array
    radius: float
    unit: float
    promised: float
    model: Model
    step: Step
    kind: Kind
    nulls: int
    evaluations: int
    factorisations: int
    resets: int = 0

    @property
    def scale(self) -> float:
        """What the predicted decrease is compared with: |f| and a share of the decrease so far, if not both are 0."""
        return abs(self.f) + 1e-3 * (self.f0 - self.f) or self.promised

    @property
    def accuracy(self) -> float:
        """Predicted decrease relative to `scale`."""
        predicted = max(self.step.decrease, self.step.promise)
        if predicted == 0.0:
            return 0.0
        return predicted / self.scale if self.scale > 0.0 else float("inf")


def evaluate(problem: Oracle, y: Array) -> Piece:
    """The oracle's answer at y as a piece."""
    f, g, G = problem(y)
    hessian = G if isinstance(G, DiagonalShift) else np.asarray(G, dtype=float)
    return Piece(y, float(f), np.asarray(g, dtype=float), hessian)


def first_unit(piece: Piece) -> float:
    """A length to begin with: ‖x0‖, else ‖g‖/‖G‖, else |f|/‖g‖; 1 where the data hold no scale at all."""
    slope, bend = float(np.linalg.norm(piece.g)), float(np.linalg.norm(piece.G))
    if piece.finite:
        for length, per in ((float(np.linalg.norm(piece.y)), 1.0), (slope, bend), (abs(piece.f), slope)):
            if length > 0.0 and per > 0.0:
                return length / per
    return 1.0


def centre(state: State) -> Piece:
    """The piece that lies at x."""
    return state.pieces[int(np.argmin(state.model.s))]


def interpolate(state: State, new: Piece) -> float:
    """Step fraction in [0.1, 0.5] at the minimum of the parabola through f(x), its slope along d, and f(y)."""
    slope = float(centre(state).g @ state.step.d)
    bend = 2.0 * (new.f - state.f - slope)
    return float(np.clip(-slope / bend, 0.1, 0.5)) if bend > 0.0 else 0.5


def radius_after_success(radius: float, length: float, ratio: float) -> float:
    """Longer after a well-predicted decrease, shorter after a poor one."""
    if ratio > 0.9:
        return max(radius, 4.0 * length)
    if ratio > 0.5:
        return max(radius, 2.0 * length)
    return 0.5 * min(radius, length) if ratio < 0.1 else radius


def aggregate(state: State) -> Piece:
    """Σλ_j (f_j, g_j, ρ_jG_j, s_j) at the centre: one piece that gives the same direction as the whole bundle."""
    lam, model = state.lam, state.model
    value = state.f + float(lam @ model.c)
    hessian = combine([p.G for p in state.pieces], lam * model.rho)
    return Piece(state.x, value, lam @ model.A, hessian, float(lam @ model.s))
