"""The memories of a contact line: from the state of every node to the law of its next step, and what a step dissipates.

Each law is the derivative of min over the new internal variable of stored + dissipated energy: one step of backward
Euler is one contact problem (`Memory` in scene/histories.py has the laws). With w = v − a, a the last or the
plastic slip, and the load l̃ − Ãa, friction without softening is one law at all steps, and w has more digits than v.

friction:        j = T(κ + |w|) − T(κ), T = ∫τ; nothing is stored
elastic-plastic: j = ½ k (|w| − Δp)² + T(κ + Δp) − T(κ) with k (|w| − Δp) = τ(κ + Δp) or Δp = 0; where τ has the slope
                 q the law rises or falls by k q/(k + q)
damage:          j = ½ τ(κ) s²/κ, beyond κ ½ τ(κ) κ + T(|s|) − T(κ); dissipated R = T(κ) − ½ τ(κ) κ
Literature: scene/histories.py; energies: Freddi & Riva, Math. Eng. 7 (2025) 406.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.history.rows import HalfRows, laws_of
from tcstudy.contact.path.chords import piecewise_linear
from tcstudy.laws.laws import Laws
from tcstudy.scene.histories import Memory

Array = NDArray[np.float64]
Index = NDArray[np.intp]

NARROW = 64 * float(np.finfo(float).eps)
"""A node nearer than this to the next kink of its law, relative to its κ, has reached it."""
LAW_ERROR, FADED = 1e-4, 1e3
"""Of the straight pieces in the place of exponential ones; and decay lengths after which nothing is left of one."""
UNTOUCHED = 1e-12
"""Slips below this part of the law's scale damage nothing."""


@dataclass(frozen=True)
class NodeState:
    """What the m nodes remember.

    v:       (m,) slip [m]
    kappa:   (m,) accumulated slip, accumulated plastic slip or largest slip [m]
    plastic: (m,) plastic slip p, 0 for the other memories [m]
    """

    v: Array
    kappa: Array
    plastic: Array

    @classmethod
    def virgin(cls, m: int) -> NodeState:
        """Nothing has moved yet."""
        return cls(np.zeros(m), np.zeros(m), np.zeros(m))


class Bonds(NamedTuple):
    """What a step leaves behind: the state, and per length stored and dissipated energies (m,) [J/m²]."""

    state: NodeState
    stored: Array
    dissipated: Array


@dataclass(frozen=True)
class Virgin:
    """τ(κ) of one law: pieces (5 or 7, J) from the slips `starts` (J,) on, the first 0.

    curve: what the pieces are chords of; None where they are the law's own. A node begins on the curve itself
    """

    starts: Array
    pieces: Array
    curve: Virgin | None = None

    @classmethod
    def of(cls, law: Laws) -> Virgin:
        """The law for s > 0."""
        first = int(law.piece(0.0, +1))
        starts = np.concatenate([[0.0], law.kinks[law.kinks > 0.0]])
        return cls(starts, np.stack([part[first:] for part in law.pieces]))

    @classmethod
    def straight(cls, law: Laws) -> Virgin:
        """The same in straight pieces between points of the law, which miss it by LAW_ERROR of its scale at most."""
        own = cls.of(law)
        if law.piecewise_linear:
            return own
        reach = float(np.max(own.starts)) + FADED / float(np.min(law.rate[law.bent]))
        kinks = piecewise_linear(law, 0.5 * LAW_ERROR, reach).kinks
        starts = np.concatenate([[0.0], kinks[kinks > 0.0]])
        piece = own.piece(starts)
        b_0, q, none = own.value(starts, piece), own.pieces[2, piece].copy(), np.zeros(len(starts))
        q[:-1] = (own.value(starts[1:], piece[:-1]) - b_0[:-1]) / np.diff(starts)
        return cls(starts, np.stack([starts, b_0, q, none, none]), own)

    def piece(self, kappa: Array) -> Index:
        """(n,) the piece on which a node goes on from κ."""
        return np.searchsorted(self.starts, kappa * (1.0 + NARROW), side="right") - 1

    def value(self, kappa: Array, piece: Index) -> Array:
        """τ(κ) on the named pieces."""
        s_0, b_0, q, *decays = self.pieces[:, piece]
        apart = kappa - s_0
        return np.asarray(
            b_0 + q * apart + sum(a * np.exp(-r * apart) for a, r in zip(decays[::2], decays[1::2], strict=True))
        )

    def tau(self, kappa: Array) -> Array:
        """τ(κ), from the left at a kink."""
        own = self.curve or self
        return own.value(kappa, np.searchsorted(own.starts, kappa, side="left") - 1)

    def ahead(self, kappa: Array) -> tuple[Index, Array, Array]:
        """(count, starts, pieces) of τ beyond κ, rows filled with their last piece."""
        first = self.piece(kappa)
        column = np.minimum(first[:, None] + np.arange(len(self.starts))[None, :], len(self.starts) - 1)
        starts, pieces = np.maximum(self.starts[column], kappa[:, None]), self.pieces[:, column].copy()
        starts[:, 0] = kappa
        if self.curve is not None:
            end = np.append(self.starts, np.inf)[first + 1]
            b_0, inner = self.curve.value(kappa, self.curve.piece(kappa)), np.isfinite(end)
            there = pieces[1, :, 0] + pieces[2, :, 0] * (np.where(inner, end, kappa) - pieces[0, :, 0])
            slope = np.divide(there - b_0, end - kappa, out=pieces[2, :, 0].copy(), where=inner)
            pieces[:3, :, 0] = kappa, b_0, slope
        return len(self.starts) - first, starts, pieces

    def slid(self, kappa: Array) -> tuple[Index, Array, Array]:
        """The same of τ(κ + x) for x > 0."""
        count, starts, pieces = self.ahead(kappa)
        pieces[0] -= kappa[:, None]
        return count, starts - kappa[:, None], pieces


@dataclass(frozen=True)
class MemoryModel:
    """A memory of a body's contact line.

    memory: which one;  law: of the scene, whose s > 0 is the virgin curve;  m: nodes
    Raises UnfitLaw if the memory cannot be made of the law.
    """

    memory: Memory
    law: Laws
    m: int

    def __post_init__(self) -> None:
        self.memory.check(self.law)

    @cached_property
    def laws(self) -> list[tuple[Laws, Index]]:
        """Every law with its nodes."""
        return self.law.groups(self.m)

    @cached_property
    def groups(self) -> list[tuple[Index, Virgin]]:
        """The nodes of every law with its virgin curve."""
        return [(nodes, Virgin.of(own)) for own, nodes in self.laws]

    @cached_property
    def straight(self) -> list[tuple[Index, Virgin]]:
        """The same in straight pieces."""
        return [(nodes, Virgin.straight(own)) for own, nodes in self.laws]

    @cached_property
    def omega(self) -> Array:
        """(m,) steepest fall of any step's law [Pa/m]."""
        found = np.empty(self.m)
        for own, nodes in self.laws:
            found[nodes] = self.memory.omega(own.omega)
        return found

    @property
    def remembers(self) -> bool:
        """False where every way leads back as well."""
        return self.memory.name != "none"

    @cached_property
    def unchanged(self) -> bool:
        """True if the law in w = v − a is the scene's own at every step: nothing softens, or nothing is remembered."""
        flat = all(len(own.starts) == 1 and not np.any(own.pieces[2:4]) for _, own in self.groups)
        return not self.remembers or (flat and self.memory.name == "friction")

    def origin(self, state: NodeState) -> Array:
        """(m,) a: slips from which w is counted [m]."""
        none = np.zeros(self.m)
        return {"friction": state.v, "elastic-plastic": state.plastic}.get(self.memory.name, none)

    def next_law(self, state: NodeState, straight: bool = False) -> Laws:
        """The law of w = v − a in the step from this state, or straight pieces in its place."""
        straight = straight and not self.law.piecewise_linear
        if self.unchanged and not straight:
            return self.law
        return laws_of(self.halves(state, straight), self.m, self.omega, self.law.b_scale)

    def halves(self, state: NodeState, straight: bool = False) -> list[HalfRows]:
        """That law for w > 0."""
        rows = {"friction": _sliding, "elastic-plastic": self._yielding, "damage": _damaged}[self.memory.name]
        halves = []
        for nodes, virgin in self.straight if straight else self.groups:
            halves += rows(virgin, nodes, state.kappa[nodes])
        return halves

    def _yielding(self, virgin: Virgin, nodes: Index, kappa: Array) -> list[HalfRows]:
        """Elastic to τ(κ)/k, then on along the virgin curve, whose slopes q become k q/(k + q)."""
        k = self._stiffness
        count, starts, pieces = virgin.slid(kappa)
        tau = pieces[1] + pieces[2] * (starts - pieces[0])
        turned = np.stack([starts + tau / k, tau, k * pieces[2] / (k + pieces[2]), 0.0 * tau, 0.0 * tau])
        halves = []
        for some, centre in ((tau[:, 0] > 0.0, k), (tau[:, 0] <= 0.0, None)):
            if np.any(some):
                slope = None if centre is None else np.full(int(np.count_nonzero(some)), centre)
                halves.append(HalfRows(nodes[some], count[some], turned[0][some], turned[:, some], slope))
        return halves

    @property
    def _stiffness(self) -> float:
        assert self.memory.stiffness is not None
        return self.memory.stiffness

    def done(self, state: NodeState, w: Array) -> Array:
        """(m,) what cannot be undone since the state: slip, plastic slip, or |v| beyond κ [m]."""
        if not self.remembers:
            return np.zeros(self.m)
        if self.memory.name == "friction":
            return np.abs(w)
        if self.memory.name == "damage":
            return np.maximum(np.abs(w) - state.kappa, 0.0)
        return self._flow(state, w)[0]

    def after(self, state: NodeState, w: Array) -> Bonds:
        """What the step to v = a + w leaves behind."""
        v, stored, plastic = self.origin(state) + w, np.zeros(self.m), state.plastic
        if not self.remembers:
            return Bonds(NodeState(v, state.kappa, plastic), self.law.j(v), stored)
        if self.memory.name == "damage":
            return self._broken(state, v)
        flow = np.abs(w)
        if self.memory.name == "elastic-plastic":
            flow, force = self._flow(state, w)
            stored, plastic = 0.5 * force**2 / self._stiffness, plastic + np.sign(w) * flow
        kappa = state.kappa + flow
        return Bonds(NodeState(v, kappa, plastic), stored, self.law.integral(state.kappa, kappa))

    def _flow(self, state: NodeState, w: Array) -> tuple[Array, Array]:
        """(Δp, force), (m,) each, of the return map: from the piece on which |w| lies."""
        flow, force = np.zeros(self.m), np.zeros(self.m)
        k = self._stiffness
        for nodes, virgin in self.groups:
            count, starts, pieces = virgin.slid(state.kappa[nodes])
            tau = pieces[1] + pieces[2] * (starts - pieces[0])
            size, column = np.abs(w[nodes]), np.arange(starts.shape[1])
            passed = np.count_nonzero((size[:, None] > starts + tau / k) & (column < count[:, None]), axis=1)
            row, at = np.arange(len(nodes)), np.maximum(passed - 1, 0)
            q, begin, t = pieces[2][row, at], starts[row, at], tau[row, at]
            beyond = size - (begin + t / k)
            flow[nodes] = np.where(passed > 0, begin + beyond * k / (k + q), 0.0)
            force[nodes] = np.where(passed > 0, t + beyond * k * q / (k + q), k * size)
        return flow, force

    def _broken(self, state: NodeState, v: Array) -> Bonds:
        """Secants grow softer where |v| has passed κ; R(κ) = T(κ) − ½ τ(κ) κ."""
        least = UNTOUCHED * (self.law.s_scale or float(np.max(np.abs(v), initial=0.0)))
        reached = np.maximum(state.kappa, np.abs(v))
        kappa = np.where(reached > np.maximum(state.kappa, least), reached, state.kappa)
        tau, before = self.law.b(kappa, -1), self.law.b(state.kappa, -1)
        tau, before = np.where(kappa > 0.0, tau, 0.0), np.where(state.kappa > 0.0, before, 0.0)
        lost = self.law.integral(state.kappa, kappa) - 0.5 * (tau * kappa - before * state.kappa)
        secant = tau / np.where(kappa > 0.0, kappa, 1.0)
        grown = np.where(kappa > state.kappa, np.maximum(lost, 0.0), 0.0)
        return Bonds(NodeState(v, kappa, state.plastic), 0.5 * secant * v**2, grown)


def _sliding(virgin: Virgin, nodes: Index, kappa: Array) -> list[HalfRows]:
    """±τ(κ + |w|): an up-jump at the last slip, then the law's own tail."""
    return [HalfRows(nodes, *virgin.slid(kappa))]


def _damaged(virgin: Virgin, nodes: Index, kappa: Array) -> list[HalfRows]:
    """The secant to (κ, τ(κ)), then the virgin curve; the virgin law itself where nothing has slipped."""
    touched = kappa > 0.0
    halves = []
    if not np.all(touched):
        whole = np.flatnonzero(~touched)
        halves.append(HalfRows(nodes[whole], *virgin.slid(np.zeros(len(whole)))))
    if np.any(touched):
        nodes, kappa = nodes[touched], kappa[touched]
        halves.append(HalfRows(nodes, *virgin.ahead(kappa), virgin.tau(kappa) / kappa))
    return halves
