"""The bundle-Newton method for locally Lipschitz functions with an oracle x → (f, g, G).

Problem:    min f(x), x ∈ Rⁿ;  f(x), one subgradient g ∈ ∂f(x), a symmetric G of second derivatives of the active piece
Model:      model.py (damped quadratic pieces, subgradient locality measures)
Subproblem: simplex_qp.py (dual active set on orthogonal factors)
Literature: Lukšan & Vlček, A bundle-Newton method for nonsmooth unconstrained minimization,
            Math. Programming 83 (1998) 373–391

Steps, after evaluating y = x + d with predicted decrease w:
  serious   f(y) ≤ f(x) − m_L w: y becomes the centre
  null      x stays and the piece of y joins the bundle, because its model value at d is above −m_R w or because
            another branch of f is active there
  short     f is smooth between x and y and y is no better: the step was too long. x and the bundle stay, the next
            step is shortened by quadratic interpolation (the publication's backtracking within one line search)
  reset     the model is stationary, but by pieces from too far away: they are dropped and looked for again nearby

Left out: the publication's line search over t with m_L, m_R, t_0 (every iteration tries t = 1 within a radius that
follows the success, one evaluation an iteration), bounds and linear constraints, and its absolute constants: all
tests here are relative, so that f → af and x → ax give the same iterates to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.bundle.model import (
    INNER,
    DiagonalShift,
    Hessian,
    Model,
    Piece,
    Stack,
    Step,
    assemble,
    bounded_step,
    carry,
    smoothly_joined,
)
from tcstudy.contact.bundle.simplex_qp import ACTIVE
from tcstudy.contact.loop import Outcome, Status

Array = NDArray[np.float64]

M_L, M_R = 0.01, 0.5
"""Shares of the predicted decrease for a serious step and for a useful null step."""


@dataclass(frozen=True)
class BundleNewton:
    """Options of the method; `tcstudy.contact.loop.iterate(BundleNewton(), oracle, x0)` runs it.

    tolerance:      predicted decrease relative to |f| (+ 10⁻³ of the decrease so far) at which to stop
    max_iterations: limit of steps, each with at most one evaluation and INNER quadratic programmes on average
    x_unit:         length by which to bound the first step (None: ‖x0‖; from f, g and G if x0 = 0)
    gamma:          weight γ of the distance in the locality measure
    """

    tolerance: float = 1e-11
    max_iterations: int = 500
    x_unit: float | None = None
    gamma: float = 1e-3

    def start(self, problem: Oracle, x0: Array) -> State:
        """Evaluate at x0 and take the first direction."""
        piece = evaluate(problem, x0)
        unit = self.x_unit or first_unit(piece)
        lam = np.ones(1)
        if not piece.finite:
            n, one = len(x0), np.zeros(1)
            model = Model(one, np.zeros((1, n)), one, Stack.of([np.zeros((n, n))]), one, 0.0)
            step = Step(np.zeros(n), lam, 0.0, 0.0, 0.0, 0)
        else:
            model = assemble([piece], lam, x0, piece.f, self.gamma)
            step = bounded_step(model, lam, unit, unit)
        used = step.factorisations
        promised = max(step.promise, step.decrease)
        return State(x0, piece.f, piece.f, (piece,), lam, unit, unit, promised, model, step, "start", 0, 1, used)

    def step(self, problem: Oracle, state: State) -> State:
        """One serious, null, short or reset step (see the head of this file)."""
        if self.stationary(state):
            return self.reset(state)
        new = evaluate(problem, state.x + state.step.d)
        state = replace(state, evaluations=state.evaluations + 1)
        length = state.step.length
        if not new.finite:
            return self.redirect(state, state.pieces, state.lam, 0.25 * length, "short")
        ratio = (state.f - new.f) / state.step.decrease
        serious = ratio >= M_L
        if not serious and smoothly_joined([centre(state)], new)[0]:
            return self.redirect(state, state.pieces, state.lam, interpolate(state, new) * length, "short")
        pieces, lam = self.select(state, new, serious)
        if serious:
            radius = radius_after_success(state.radius, length, ratio)
            moved = replace(state, x=new.y, f=new.f, nulls=0, resets=0)
            return self.redirect(moved, pieces, lam, radius, "serious")
        radius = self.radius_after_null(state, new)
        return self.redirect(replace(state, nulls=state.nulls + 1), pieces, lam, radius, "null")

    def redirect(self, state: State, pieces: tuple[Piece, ...], lam: Array, radius: float, kind: Kind) -> State:
        """The state with a new bundle and radius, and the direction that follows from them."""
        model = assemble(pieces, lam, state.x, state.f, self.gamma)
        step = bounded_step(model, lam, radius, max(radius, state.unit), state.step.shift)
        used = state.factorisations + step.factorisations
        # `step.lam` belongs to `pieces`, in their order
        return replace(
            state, pieces=pieces, lam=step.lam, radius=radius, model=model, step=step, kind=kind, factorisations=used
        )

    def select(self, state: State, new: Piece, serious: bool) -> tuple[tuple[Piece, ...], Array]:
        """The next bundle with `new` last, and multipliers for it to start from.

        A piece that is smoothly joined to the new one and farther from the centre is obsolete; beyond 2n + 5 pieces the
        oldest inactive ones leave.
        """
        x = new.y if serious else state.x
        farther = np.flatnonzero(np.linalg.norm([p.y - x for p in state.pieces], axis=1) >= np.linalg.norm(new.y - x))
        obsolete = np.zeros(len(state.pieces), dtype=bool)
        if len(farther):
            obsolete[farther] = smoothly_joined([state.pieces[j] for j in farther], new)
        kept = [j for j in range(len(state.pieces)) if not obsolete[j]]
        idle = [j for j in kept if state.lam[j] <= ACTIVE and state.model.s[j] > 0.0]
        leaving = set(idle[: max(0, len(kept) - 2 * len(x) - 4)])
        kept = [j for j in kept if j not in leaving]
        pieces, lam = [state.pieces[j] for j in kept], state.lam[kept]
        inherited = float(state.lam[obsolete].sum()) if len(pieces) else 1.0
        lam = np.append(lam, inherited)
        lam = lam / lam.sum() if lam.sum() > 0.0 else np.full(len(lam), 1.0 / len(lam))
        return (*pieces, new), lam

    def radius_after_null(self, state: State, new: Piece) -> float:
        """Shorter if the new piece hardly changes the model at d, or if null steps repeat at the bound."""
        d, length = state.step.d, state.step.length
        alone = carry((new,), Stack.of([new.G]), state.x, state.f, self.gamma, state.model.curvature)
        if alone.value(d) < -M_R * state.step.decrease:
            return 0.5 * min(state.radius, length)
        if state.step.shift > 0.0 and state.nulls > 0:
            active = int(np.sum(state.lam > ACTIVE))
            return float(0.7 ** (1.0 / active)) * min(state.radius, length)  # k kinks need some k null steps
        return state.radius

    def stationary(self, state: State) -> bool:
        """True if the model promises no more decrease than `tolerance`, with or without the radius."""
        return state.accuracy <= self.tolerance

    def remote(self, state: State) -> NDArray[np.bool_]:
        """(N,) active pieces whose origin is too far away to prove stationarity."""
        model = state.model
        return (state.lam > ACTIVE) & (model.curvature * model.s**2 > 1e4 * self.tolerance * state.scale)

    def reset(self, state: State) -> State:
        """Drop the remote active pieces and look for them again within the distance that proves stationarity."""
        keep = np.flatnonzero(~self.remote(state))
        pieces = tuple(state.pieces[j] for j in keep)
        nearby = float(np.sqrt(1e4 * self.tolerance * state.scale / state.model.curvature))
        radius = 0.5 * nearby  # steps may exceed it a little; what they find must not be remote again
        state = replace(state, resets=state.resets + 1)
        return self.redirect(state, pieces, np.full(len(keep), 1.0 / len(keep)), radius, "reset")

    def verdict(self, problem: Oracle, state: State) -> tuple[Status, str] | None:
        """None to go on, else why to stop; converged: predicted decrease ≤ tolerance by pieces from nearby."""
        if not state.pieces[0].finite:
            return Status.NOT_FINITE, "f, g or G is not finite at the start; start from another point"
        if self.stationary(state):
            if not np.any(self.remote(state)):
                return Status.CONVERGED, f"predicted decrease {state.accuracy:.1e} of |f|, by pieces from nearby"
            if state.resets > 10 + len(state.x):
                reason = (
                    f"the predicted decrease is {state.accuracy:.1e} of |f|, but only by pieces from too far away, and "
                    f"{state.resets} searches nearby found no others; allow a larger tolerance"
                )
                return Status.STALLED, reason
            return None
        if state.factorisations > INNER * self.max_iterations:
            reason = (
                f"{state.factorisations} quadratic programmes, more than {INNER} for each of {self.max_iterations} "
                f"iterations, at a predicted decrease of {state.accuracy:.1e} of |f|; allow more (max_iterations) or a "
                "larger tolerance"
            )
            return Status.ITERATION_LIMIT, reason
        if state.radius > 1e12 * state.unit:
            reason = f"f still falls at a distance of {state.radius:.1e}: it may be unbounded below; check its growth"
            return Status.UNBOUNDED, reason
        if state.step.decrease <= 0.0 or state.step.length <= 4 * np.finfo(float).eps * float(np.linalg.norm(state.x)):
            reason = (
                f"steps have shrunk to rounding level at a predicted decrease of {state.accuracy:.1e} of |f|; "
                "check g and G against differences of f, or allow a larger tolerance"
            )
            return Status.STALLED, reason
        return None

    def outcome(self, problem: Oracle, state: State, status: Status, reason: str, iterations: int) -> Outcome:
        """The final state as an Outcome; accuracy is the predicted decrease relative to |f|."""
        return Outcome(
            state.x, state.f, status, reason, iterations, state.evaluations, state.factorisations, state.accuracy
        )

    def line(self, state: State, iteration: int) -> str:
        """One aligned line: iteration, kind, f, predicted decrease, step length, radius, active / kept pieces."""
        active = int(np.sum(state.lam > ACTIVE))
        return (
            f"{iteration:4d} {state.kind:7s} f={state.f:+.12e} w={state.step.decrease:.2e} "
            f"|d|={state.step.length:.1e} radius={state.radius:.1e} pieces={active}/{len(state.pieces)}"
        )


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
