"""How a history moves with a number p of its study: exact derivatives, carried on from step to step (forward mode).

With w = v − a and the law b(w; κ, p) of the step (memory.py), on the pieces found,

    Ã dv + c (b′ dw + ∂b/∂κ dκ + ∂b/∂p) = ∂l̃/∂p − (∂Ã/∂p) v,   dv = da + dw,

solved by `Linearised` in dw; then the memory's own update is differentiated: for a node that slides by sign σ,
    friction         b = σ τ(κ + |w|)       ∂b = σ (τ′ dκ + ∂τ),  dκ ← dκ + σ dw,  da ← dv
    elastic-plastic  k (|w| − Δp) = τ(κ + Δp)   ∂b = σ (k (τ′ dκ + ∂τ) + τ′ (|w| − Δp) dk)/(k + τ′),
                     dΔp = (k σ dw + (|w| − Δp) dk − τ′ dκ − ∂τ)/(k + τ′),  dκ ← dκ + dΔp,  dp ← dp + σ dΔp
    damage           b = τ(κ) w/κ           ∂b = w ((τ′ − τ/κ) dκ + ∂τ)/κ;   beyond κ: b = σ τ(|w|),  dκ ← σ dw

A step is taken as one contact problem: so it is when every node has moved one way in it, along a path, through a jump
or not. Else κ has grown by more than the ends of the step tell, and there is no derivative here: make more steps.

At an event (`Linearised`) both sides of the node must agree with what was found, as where a load comes back to where a
node had turned: then the derivative is that of every side. Else, and at a fold, it is NaN.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tcstudy.scene.friction import UP
from tcstudy.solvers.history.memory import NodeState
from tcstudy.solvers.history.problem import HistoryProblem, HistoryStep
from tcstudy.solvers.linearised import Linearised
from tcstudy.solvers.problem import ContactProblem

Array = NDArray[np.float64]
Index = NDArray[np.intp]

SAME = 1e-9
"""Of the largest κ, by which κ may differ from that of a step in which every node moves one way."""
AGREES = 1e-7
"""Of the terms, by which the two sides of an event may differ."""
TURNED = "a node turns back inside the step, which has no derivative here; make more steps, or write substeps: 8"
FOLD = "the step ends at a fold, where there is no derivative"
EVENT = "the step ends where a node begins to slide, comes to rest or passes a kink"


@dataclass(frozen=True)
class StepSlope:
    """What a number p does in a step, at its solution.

    right:     (m,) ∂l̃/∂p − (∂Ã/∂p) v
    virgin:    (κ, piece) → (∂τ/∂p at κ on pieces of the virgin curve, ∂/∂p of where these begin), (m,) each; None for 0
    stiffness: whether p is k of elastic-plastic memory
    """

    right: Array
    virgin: Callable[[Array, Index], tuple[Array, Array]] | None = None
    stiffness: bool = False


@dataclass(frozen=True)
class Moved:
    """(m,) derivatives of a step by one number: NaN if there is none, and why.

    v, kappa, plastic: of its `NodeState`;  xi: of its nodal forces
    """

    v: Array
    kappa: Array
    plastic: Array
    xi: Array
    reason: str = ""

    @classmethod
    def virgin(cls, m: int) -> Moved:
        """Before any load."""
        return cls(np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m))

    @classmethod
    def none(cls, m: int, reason: str) -> Moved:
        """There is none."""
        nothing = np.full(m, np.nan)
        return cls(nothing, nothing, nothing, nothing, reason)


def moved(
    body: HistoryProblem, last: HistoryStep, step: HistoryStep, before: Sequence[Moved], numbers: Sequence[StepSlope]
) -> list[Moved]:
    """Derivatives of a solved step by every number, from those of the step before."""
    if np.array_equal(step.load, last.load):
        return list(before)
    model = body.model
    w = step.state.v - model.origin(last.state)
    own, kappa = model.after(last.state, w).state, step.state.kappa
    apart = max(np.max(np.abs(own.kappa - kappa)), np.max(np.abs(own.plastic - step.state.plastic)))
    reason = TURNED if apart > SAME * float(np.max(kappa)) else ""
    at = Linearised.at(body.problem(last.state, step.load), w)
    places = _Places(body, last.state, at)
    reason = reason or (FOLD if at.singular else "")
    return [_by(body, places, old, number, old.reason or reason) for old, number in zip(before, numbers, strict=True)]


def _by(body: HistoryProblem, places: _Places, before: Moved, number: StepSlope, reason: str) -> Moved:
    at, name = places.at, body.memory.name
    if reason:
        return Moved.none(body.m, reason)
    da = {"friction": before.v, "elastic-plastic": before.plastic, "damage": np.zeros(body.m)}[name]
    kinks = places.kinks(before.kappa, number)
    piece = places.on(at.piece)
    pushed = body.A_tilde @ da
    dw = at.step(number.right - pushed - body.c * piece.change(before.kappa, number), kinks)
    pulled = body.A_tilde @ dw
    dxi = number.right - pushed - pulled
    size = float(np.max((np.abs(number.right) + np.abs(pushed) + np.abs(pulled)) / body.c))
    if not places.agree(before.kappa, number, dw, dxi, kinks, size):
        return Moved.none(body.m, EVENT)
    return Moved(da + dw, *piece.remembered(before, number, dw), dxi)


@dataclass(frozen=True)
class _Places:
    """Where the law of every node is in a step, (m,) each: at the problem of w = v − a."""

    body: HistoryProblem
    state: NodeState
    at: Linearised

    @cached_property
    def kappa(self) -> Array:
        """From which τ goes on."""
        return np.zeros(self.body.m) if self.body.memory.healing else self.state.kappa

    @cached_property
    def rows(self) -> tuple[Index, Index, Index]:
        """(first piece of τ, pieces of τ left, pieces of the law of the step)."""
        model = self.body.model
        first, left, count = np.zeros((3, self.body.m), dtype=np.intp)
        if model.unchanged:
            for (own, nodes), (_, virgin) in zip(model.laws, model.groups, strict=True):
                left[nodes], count[nodes] = len(virgin.starts), len(own.kinks) + 1
            return first, left, count
        for half in model.halves(self.state):
            left[half.nodes], first[half.nodes] = half.count, half.starts.shape[1] - half.count
            count[half.nodes] = 2 * half.count + (half.centre is not None)
        return first, left, count

    def on(self, column: Index) -> _Piece:
        """The pieces of these columns of the laws of the step."""
        first, left, count = self.rows
        mirror = count - 1 - column
        away = np.maximum(column, mirror) - (count - left)
        w = self.at.v
        sense = np.where(column == mirror, np.where(w < 0.0, -1.0, 1.0), np.sign(column - mirror))
        return _Piece(self, sense, first + np.maximum(away, 0), away < 0)

    def kinks(self, dkappa: Array, number: StepSlope) -> Array:
        """(m,) how the kinks move on which nodes rest: at w = 0 not at all, at others of friction as τ's own less κ."""
        w, found = self.at.v, np.zeros(self.body.m)
        own = self.at.rest[w[self.at.rest] != 0.0]
        if len(own):
            reached, piece = self.kappa + np.abs(w), np.zeros(self.body.m, dtype=np.intp)
            for nodes, virgin in self.body.model.groups:
                piece[nodes] = np.argmin(np.abs(virgin.starts - reached[nodes, None]), axis=1)
            starts = number.virgin(reached, piece)[1] if number.virgin else np.zeros(self.body.m)
            grown = 0.0 if self.body.memory.name == "damage" else dkappa
            found[own] = (np.sign(w) * (starts - grown))[own]
        return found

    def agree(self, dkappa: Array, number: StepSlope, dw: Array, dxi: Array, kinks: Array, size: float) -> bool:
        """Whether at every node near an event the derivative is that of both sides; size: of what ∂ξ/c is made of."""
        near = self.at.near
        if not np.any(near):
            return True
        problem: ContactProblem = self.at.problem
        law, w, force = problem.law, self.at.v, dxi / problem.c
        kink = np.asarray(law.nearest_kink(w))
        left, right = law.limits(kink)
        up = near & (law.kind_at(law.kink(kink)) == UP)
        lower = np.abs(problem.xi(w) / problem.c - left) < np.abs(problem.xi(w) / problem.c - right)
        ok = np.ones(len(w), dtype=bool)
        for column, asked in ((kink, near & (~up | lower)), (kink + 1, near & ~(up & lower))):
            slope = np.asarray(law.slope(w, column))
            change = self.on(column).change(dkappa, number)
            terms = size + np.abs(slope * dw) + np.abs(change)
            ok &= ~asked | (np.abs(force - slope * dw - change) <= AGREES * terms)
        rests = np.abs(dw - kinks) <= AGREES * float(np.max(np.abs(dw), initial=np.max(np.abs(kinks))))
        return bool(np.all(ok & (~up | rests)))


@dataclass(frozen=True)
class _Piece:
    """The law of every node on one piece: σ, the piece of τ, and whether it is the straight piece through w = 0."""

    places: _Places
    sense: Array
    piece: Index
    inner: NDArray[np.bool_]

    @cached_property
    def tau(self) -> tuple[Array, Array, Array, Array]:
        """(κ at which τ is, τ there, τ′, plastic slip Δp), (m,) each."""
        places, memory = self.places, self.places.body.memory
        w, kappa = np.abs(places.at.v), places.kappa
        flow, where = np.zeros(len(w)), kappa + w
        if memory.name == "elastic-plastic":
            flow = np.where(self.inner, 0.0, places.body.model.done(places.state, places.at.v))
            where = kappa + flow
        elif memory.name == "damage":
            where = np.where(self.inner, kappa, w)
        value, slope = np.empty((2, len(w)))
        for nodes, virgin in places.body.model.groups:
            x, piece = where[nodes], self.at_piece[nodes]
            value[nodes] = virgin.value(x, piece)
            s_0, _, q, a, r = virgin.pieces[:, piece]
            slope[nodes] = q - a * r * np.exp(-r * (x - s_0))
        return where, value, slope, flow

    @cached_property
    def at_piece(self) -> Index:
        """The piece of τ; of a secant that which ends at κ."""
        if self.places.body.memory.name != "damage":
            return self.piece
        found = self.piece.copy()
        for nodes, virgin in self.places.body.model.groups:
            before = np.searchsorted(virgin.starts, self.places.kappa[nodes], side="left") - 1
            found[nodes] = np.where(self.inner[nodes], before, self.piece[nodes])
        return found

    def _explicit(self, number: StepSlope) -> Array:
        return number.virgin(self.tau[0], self.at_piece)[0] if number.virgin else np.zeros(len(self.sense))

    def change(self, dkappa: Array, number: StepSlope) -> Array:
        """(m,) ∂b at fixed w [Pa per unit of p]."""
        memory, w = self.places.body.memory, self.places.at.v
        kappa, tau, slope, flow = self.tau
        dtau = self._explicit(number)
        if memory.name == "friction":
            return np.asarray(self.sense * (dtau + (0.0 if memory.healing else slope * dkappa)))
        if memory.name == "damage":
            safe = np.where(self.inner, kappa, 1.0)
            secant = w * ((slope - tau / safe) * dkappa + dtau) / safe
            return np.asarray(np.where(self.inner, secant, self.sense * dtau))
        k, dk = float(memory.stiffness or 0.0), float(number.stiffness)
        yields = (k * (slope * dkappa + dtau) + slope * (np.abs(w) - flow) * dk) / (k + slope)
        return np.asarray(np.where(self.inner, w * dk, self.sense * yields))

    def remembered(self, before: Moved, number: StepSlope, dw: Array) -> tuple[Array, Array]:
        """(dκ, d(plastic)) after the step."""
        memory, w = self.places.body.memory, self.places.at.v
        _, _, slope, flow = self.tau
        if memory.name == "friction":
            none = 0.0 * dw
            return (none if memory.healing else before.kappa + np.sign(w) * dw), before.plastic
        if memory.name == "damage":
            grown = (np.abs(w) > self.places.kappa) & ~self.inner
            return np.where(grown, np.sign(w) * dw, before.kappa), before.plastic
        k, dk = float(memory.stiffness or 0.0), float(number.stiffness)
        dtau = self._explicit(number)
        change = (k * self.sense * dw + (np.abs(w) - flow) * dk - slope * before.kappa - dtau) / (k + slope)
        change = np.where(self.inner, 0.0, change)
        return before.kappa + change, before.plastic + self.sense * change
