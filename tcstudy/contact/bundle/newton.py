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

from tcstudy.contact.bundle.model import INNER, Bundle, Model, Step, bounded_step, smoothly_joined
from tcstudy.contact.bundle.simplex_qp import ACTIVE
from tcstudy.contact.status import Outcome, Status

Array = NDArray[np.float64]
Oracle = Callable[[Array], tuple[float, Array, Array]]
Kind = Literal["start", "serious", "null", "short", "reset"]

M_L, M_R = 0.01, 0.5
"""Shares of the predicted decrease for a serious step and for a useful null step."""
IDENTIFY, EVERY = 1e-4, 10
"""Decrease predicted within the radius, relative to |f|, below which an exact end is tried; evaluations between two
trials."""


@dataclass(frozen=True, eq=False)
class State:
    """Where a run is.

    x, f:     centre and its value
    f0:       value at the start
    pieces:   the bundle; one of them lies at x
    lam:      (N,) multipliers that belong to `pieces`
    radius:   bound of the next step
    unit:     length of x that the run started with
    model, step: the model about x and its minimiser
    kind:     what led here
    nulls, resets: null steps and resets since the last serious step
    promised: decrease predicted at the start
    """

    x: Array
    f: float
    f0: float
    pieces: Bundle
    lam: Array
    radius: float
    unit: float
    model: Model
    step: Step
    kind: Kind = "start"
    nulls: int = 0
    resets: int = 0
    evaluations: int = 1
    factorisations: int = 0
    promised: float = 0.0

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


@dataclass(frozen=True)
class BundleNewton:
    """Options of the method.

    tolerance:      predicted decrease relative to |f| (+ 10⁻³ of the decrease so far) at which to stop
    max_iterations: limit of steps, each with at most one evaluation and INNER quadratic programmes on average
    x_unit:         length by which to bound the first step (None: ‖x0‖; from f, g and G if x0 = 0)
    gamma:          weight γ of the distance in the locality measure
    base:           (n, n) B where the oracle returns the diagonals h of G = B + diag(h)
    """

    tolerance: float = 1e-11
    max_iterations: int = 500
    x_unit: float | None = None
    gamma: float = 1e-3
    base: Array | None = None

    def run(
        self,
        oracle: Oracle,
        x0: Array,
        exact: Callable[[Array, float], Array | None] | None = None,
        watch: Callable[[State], None] | None = None,
    ) -> Outcome:
        """Steps from x0 until the model promises no more decrease or their limit is met.

        exact: (x, decrease left) → the exact minimum beside x, if it is found;  watch: called with every state
        """
        first = self._evaluated(oracle, x0)
        if not first.finite:
            reason = "f, g or G is not finite at the start; start from another point"
            return Outcome(x0, float(first.f[0]), Status.NOT_FINITE, reason, 0, 1)
        state = self._first(first)
        for iteration in range(self.max_iterations + 1):
            if watch is not None:
                watch(state)
            ended = self.verdict(state)
            x, f, left = state.x, state.f, IDENTIFY * state.scale
            due = state.evaluations % EVERY == 0 if ended is None else ended[0] == Status.CONVERGED
            if exact is not None and due and state.step.decrease <= left and (found := exact(x, left)) is not None:
                x, f, ended = found, oracle(found)[0], ended or (Status.CONVERGED, "on the exact active pieces")
            if ended is None and iteration == self.max_iterations:
                reason = (
                    f"no solution within {iteration} iterations; start from a neighbouring solution, "
                    "use another solver, or allow bundle-newton more (max_iterations)"
                )
                ended = Status.ITERATION_LIMIT, reason
            if ended is not None:
                return Outcome(x, f, *ended, iteration, state.evaluations)
            state = self.step(oracle, state)
        raise AssertionError

    def _first(self, first: Bundle) -> State:
        """The state with the first direction."""
        unit, x, f, one = self.x_unit or first_unit(first), first.y[0], float(first.f[0]), np.ones(1)
        model = Model.about(x, f, first, self.gamma, spectral_norm(first, one))
        step = bounded_step(model, one, unit, unit)
        promised, used = max(step.promise, step.decrease), step.factorisations
        return State(x, f, f, first, step.lam, unit, unit, model, step, factorisations=used, promised=promised)

    def step(self, oracle: Oracle, state: State) -> State:
        """One serious, null, short or reset step (see the head of this file)."""
        if state.accuracy <= self.tolerance:
            return self._reset(state)
        length, centre = state.step.length, state.pieces.take(np.argmin(state.model.s, keepdims=True))
        new = self._evaluated(oracle, state.x + state.step.d)
        state = replace(state, evaluations=state.evaluations + 1)
        if not new.finite:
            return self._redirected(state, state.pieces, state.lam, 0.25 * length, "short")
        f, slope = float(new.f[0]), float(centre.g[0] @ state.step.d)
        ratio = (state.f - f) / state.step.decrease
        if ratio < M_L and smoothly_joined(centre, new)[0]:
            bend = 2.0 * (f - state.f - slope)  # of the parabola through f(x), its slope along d, and f(y)
            share = float(np.clip(-slope / bend, 0.1, 0.5)) if bend > 0.0 else 0.5
            return self._redirected(state, state.pieces, state.lam, share * length, "short")
        if ratio < M_L:
            radius, selected = self._radius_after_null(state, new), self._selected(state, new, state.x)
            return self._redirected(replace(state, nulls=state.nulls + 1), *selected, radius, "null")
        radius = 0.5 * min(state.radius, length) if ratio < 0.1 else state.radius
        radius = max(radius, 4.0 * length if ratio > 0.9 else 2.0 * length if ratio > 0.5 else 0.0)
        moved = replace(state, x=new.y[0], f=f, nulls=0, resets=0)
        return self._redirected(moved, *self._selected(state, new, new.y[0]), radius, "serious")

    def _evaluated(self, oracle: Oracle, y: Array) -> Bundle:
        f, g, G = oracle(y)
        g, G = np.asarray(g, dtype=float), np.asarray(G, dtype=float)
        return Bundle(y[None], np.array([f], dtype=float), g[None], G[None], self.base)

    def _redirected(self, state: State, pieces: Bundle, lam: Array, radius: float, kind: Kind) -> State:
        """The state with a new bundle and radius, and the direction that follows from them."""
        model = Model.about(state.x, state.f, pieces, self.gamma, spectral_norm(pieces, lam))
        step = bounded_step(model, lam, radius, max(radius, state.unit), state.step.shift)
        used = state.factorisations + step.factorisations
        return replace(
            state, pieces=pieces, lam=step.lam, radius=radius, model=model, step=step, kind=kind, factorisations=used
        )

    def _selected(self, state: State, new: Bundle, x: Array) -> tuple[Bundle, Array]:
        """The next bundle about x with `new` last, and multipliers for it to start from.

        A piece that is smoothly joined to the new one and farther from the centre is obsolete; beyond 2n + 5 pieces the
        oldest inactive ones leave.
        """
        pieces, lam = state.pieces, state.lam
        farther = np.linalg.norm(pieces.y - x, axis=1) >= np.linalg.norm(new.y[0] - x)
        obsolete = farther & smoothly_joined(pieces, new)
        idle = np.flatnonzero(~obsolete & (lam <= ACTIVE) & (state.model.s > 0.0))
        most = 2 * len(x) + 4
        leaving = idle[: max(0, np.count_nonzero(~obsolete) - most)]
        kept = np.setdiff1d(np.flatnonzero(~obsolete), leaving)
        lam = np.append(lam[kept], float(lam[obsolete].sum()) if len(kept) else 1.0)
        lam = lam / lam.sum() if lam.sum() > 0.0 else np.full(len(lam), 1.0 / len(lam))
        return pieces.take(kept).with_one(new), lam

    def _radius_after_null(self, state: State, new: Bundle) -> float:
        """Shorter if the new piece hardly changes the model at d, or if null steps repeat at the bound."""
        d, shortest = state.step.d, min(state.radius, state.step.length)
        alone = Model.about(state.x, state.f, new, self.gamma, state.model.curvature)
        if alone.value(d) < -M_R * state.step.decrease:
            return 0.5 * shortest
        if state.step.shift > 0.0 and state.nulls > 0:
            active = int(np.sum(state.lam > ACTIVE))
            return float(0.7 ** (1.0 / active)) * shortest  # k kinks need some k null steps
        return state.radius

    def remote(self, state: State) -> NDArray[np.bool_]:
        """(N,) active pieces whose origin is too far away to prove stationarity."""
        model = state.model
        return (state.lam > ACTIVE) & (model.curvature * model.s**2 > 1e4 * self.tolerance * state.scale)

    def _reset(self, state: State) -> State:
        """Drop the remote active pieces and look for them again within the distance that proves stationarity."""
        keep = np.flatnonzero(~self.remote(state))
        nearby = float(np.sqrt(1e4 * self.tolerance * state.scale / state.model.curvature))
        radius = 0.5 * nearby  # steps may exceed it a little; what they find must not be remote again
        state = replace(state, resets=state.resets + 1)
        return self._redirected(state, state.pieces.take(keep), np.full(len(keep), 1.0 / len(keep)), radius, "reset")

    def verdict(self, state: State) -> tuple[Status, str] | None:
        """None to go on, else why to stop; converged: predicted decrease ≤ tolerance by pieces from nearby."""
        if state.accuracy <= self.tolerance:
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


def spectral_norm(pieces: Bundle, lam: Array) -> float:
    """‖Σλ_jG_j‖₂."""
    return float(np.max(np.abs(np.linalg.eigvalsh(pieces.combined(lam)))))


def first_unit(piece: Bundle) -> float:
    """A length to begin with: ‖x0‖, else ‖g‖/‖G‖, else |f|/‖g‖; 1 where the data hold no scale at all."""
    slope, bend = float(np.linalg.norm(piece.g)), float(np.linalg.norm(piece.combined(np.ones(1))))
    for length, per in ((float(np.linalg.norm(piece.y)), 1.0), (slope, bend), (abs(float(piece.f[0])), slope)):
        if length > 0.0 and per > 0.0:
            return length / per
    return 1.0
