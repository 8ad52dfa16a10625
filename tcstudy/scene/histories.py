"""What a contact line remembers from one load to the next: the models by name, and which laws they are meant for.

The scene's law gives the monotone virgin curve τ(κ) = b(s > 0). Beside it a node has a state, the next step's law is
    friction         sgn(s − a) τ(κ + |s − a|)              a last slip, κ = Σ|Δv|
    elastic-plastic  ±k (|s − p| − Δp), at most τ(κ + Δp)   p plastic slip, κ = Σ|Δp|
    damage           τ(κ) s/κ for |s| ≤ κ, beyond it τ(|s|)   κ = max |v|
Literature: Ortiz & Pandolfi, Int. J. Numer. Meth. Engng 44 (1999) 1267–1282 (damage, κ the largest opening); Simo &
Hughes, Computational Inelasticity (1998) (return mapping). Here only what a study says of it; solvers/history solves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from tcstudy.scene.friction import DOWN, UP, FrictionLaw
from tcstudy.scene.nodal_laws import Law

MemoryName = Literal["friction", "elastic-plastic", "damage"]
MEMORIES: tuple[MemoryName, ...] = get_args(MemoryName)
HistoryBranch = Literal["continued", "lowest"]
HISTORY_BRANCHES: tuple[HistoryBranch, ...] = get_args(HistoryBranch)


class UnfitLaw(ValueError):
    """A memory cannot be made of this law; the text says why and what to do."""


@dataclass(frozen=True)
class Memory:
    """What every node of the contact line remembers.

    name:      one of MEMORIES
    stiffness: k of `elastic-plastic`, None for the others [Pa/m]
    healing:   `friction` only: κ starts from 0 at every step, so that the film is whole again
    """

    name: MemoryName
    stiffness: float | None = None
    healing: bool = False

    def check(self, law: Law) -> None:
        """Raise UnfitLaw unless the memory can be made of every node's law."""
        for own in [law] if isinstance(law, FrictionLaw) else [one for one, _ in law.groups]:
            if own.vanishes:
                continue
            _check_virgin(own)
            if self.name == "elastic-plastic":
                self._check_spring(own)
            elif self.name == "damage":
                _check_secant(own)

    def omega(self, omega: float) -> float:
        """Steepest fall of any step's law, from ω of the law itself: λ₁ above it proves all steps unique [Pa/m]."""
        if self.stiffness is None:
            return omega
        return self.stiffness * omega / (self.stiffness - omega)

    def _check_spring(self, law: FrictionLaw) -> None:
        """Backward Euler needs a return map with one answer: the law falls less steeply than the spring."""
        k = self.stiffness
        if k is None or not (np.isfinite(k) and k > 0.0):
            raise UnfitLaw("elastic-plastic memory needs a stiffness above 0; add stiffness: 100 MPa/mm")
        if not law.piecewise_linear:
            raise UnfitLaw(f"elastic-plastic memory needs a law of straight pieces, and {law.name} has exponential "
                           "ones; give it by its points (piecewise-linear)")  # fmt: skip
        if np.any(law.kinds[law.kinks > 0.0] == UP):
            raise UnfitLaw("elastic-plastic memory needs a law without up-jumps at s > 0; make them steep slopes")
        if not law.omega < k:
            raise UnfitLaw(f"the spring is too soft for the law: stiffness k = {k:g} Pa/m must be above the "
                           f"steepest fall h = {law.omega:g} Pa/m, or the slip of a step has several values; take a "
                           "stiffer spring or a law that falls more slowly")  # fmt: skip


def is_odd(law: FrictionLaw) -> bool:
    """Whether b(−s) = −b(s) to the bit, as every shape but a one-sided piecewise-linear one is made."""
    mirror = slice(None, None, -1)
    pieces = law.b_0 == -law.b_0[mirror], law.q == law.q[mirror], law.a == -law.a[mirror]
    anchors = (law.s_0 == -law.s_0[mirror]) | ((law.q == 0.0) & (law.a == 0.0))
    rates = (law.r == -law.r[mirror]) | (law.a == 0.0)
    return bool(np.array_equal(law.kinks, -law.kinks[mirror]) and np.all([*pieces, anchors, rates]))


def _check_virgin(law: FrictionLaw) -> None:
    """Raise UnfitLaw unless the law is odd and opposes slip everywhere."""
    if not is_odd(law):
        raise UnfitLaw(f"a history needs an odd law, b(-s) = -b(s), and {law.name} is not: what is remembered has no "
                       "sides; leave out odd: false")  # fmt: skip
    after = law.kinks[law.kinks > 0.0]
    starts = np.concatenate([[0.0], after])
    least = float(np.min(np.concatenate([law.b(starts, +1), law.b(after, -1)])))
    if least < 0.0:
        raise UnfitLaw(f"a history needs a law that opposes slip, but b falls to {least:g} Pa at s > 0 and would push; "
                       "let it end at 0")  # fmt: skip


def _check_secant(law: FrictionLaw) -> None:
    """Raise UnfitLaw where τ(κ)/κ rises: such a film would heal by being pulled."""
    ups = law.kinks[(law.kinds == UP) & (law.kinks > 0.0)]
    if len(ups):
        raise UnfitLaw(f"damage needs a law whose secant b(s)/s never rises, but b jumps up at s = {ups[0]:g} m; use "
                       "memory: friction, or a law that only falls")  # fmt: skip
    first = int(law.piece(0.0, +1))
    starts = np.concatenate([[0.0], law.kinks[law.kinks > 0.0]])
    for piece, start, end in zip(range(first, len(law.q)), starts, [*starts[1:], np.inf], strict=True):
        last = end if np.isfinite(end) else start + 40.0 / (abs(float(law.r[piece])) or 1.0)
        for s in (float(start), float(last)):
            value, slope = float(law.value(s, piece)), float(law.slope(s, piece))
            if value - slope * s < -1e-12 * max(abs(value), abs(slope * s), law.b_scale):
                raise UnfitLaw(f"damage needs a law whose secant b(s)/s never rises, but b climbs faster than its "
                               f"secant at s = {s:g} m (slope {slope:g}, secant {value / s if s else 0.0:g} Pa/m); use "
                               "memory: friction, or a law that only falls")  # fmt: skip


def jumps_down(law: Law) -> bool:
    """Whether a law of some node jumps down: then no step is proved unique by stiffness alone."""
    if isinstance(law, FrictionLaw):
        return bool(np.any(law.kinds == DOWN))
    return any(jumps_down(own) for own, _ in law.groups)
