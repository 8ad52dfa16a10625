"""Derivatives of friction laws by their parameters.

A number that carries a derivative (`scene.dual`) goes through the builder of a law (`scene.laws`) as its value does. So
every number that a law is made of is known with its derivative, and with them those of b and of its kinks:

    ∂b_k/∂p (s) = b0′ + q′(s − s0) − q s0′ + (a′ − a r′(s − s0) + a r s0′) exp(−r (s − s0)).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tcstudy.scene.dual import Dual, slope_of
from tcstudy.scene.friction import FrictionLaw
from tcstudy.scene.laws import SHAPES

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LawSlopes:
    """Derivatives by one parameter of the numbers of a law, shapes as there: kinks (K,), pieces (K+1,)."""

    law: FrictionLaw
    kinks: Array
    s_0: Array
    b_0: Array
    q: Array
    a: Array
    r: Array

    def value(self, s: ArrayLike, piece: ArrayLike) -> Array:
        """∂b_k/∂p at s of the named pieces (shape of s) [Pa per unit of p]."""
        law, k = self.law, np.asarray(piece)
        apart = np.asarray(s, dtype=float) - law.s_0[k]
        value: Array = self.b_0[k] + self.q[k] * apart - law.q[k] * self.s_0[k]
        if law.piecewise_linear and not np.any(self.a):
            return value
        factor = self.a[k] - law.a[k] * (self.r[k] * apart - law.r[k] * self.s_0[k])
        return value + factor * np.exp(-law.r[k] * apart)

    def potential(self, s: ArrayLike) -> Array:
        """∂j/∂p at s, which is no kink that moves, or the inner side of one (shape of s) [Pa m per unit of p].

        ∫₀ˢ ∂b/∂p, and of every kink on the way, which moves by κ′, κ′(b⁻ − b⁺).
        """
        law, s = self.law, np.asarray(s, dtype=float)
        sign, found = np.where(s < 0.0, -1.0, 1.0), np.zeros_like(s)
        ends = np.concatenate([[-np.inf], law.kinks, [np.inf]])
        for k in range(len(law.q)):
            x, y = (
                np.clip(np.clip(ends[k + i], np.minimum(s, 0.0), np.maximum(s, 0.0)), *ends[k : k + 2]) for i in (0, 1)
            )
            inside = y > x
            found += np.where(inside, sign * self._integral(k, np.where(inside, x, 0.0), np.where(inside, y, 0.0)), 0.0)
        for kink, moved, jump in zip(law.kinks, self.kinks, law.b_left - law.b_right, strict=True):
            found += np.where((sign * kink > 0.0) & (sign * kink < np.abs(s)), sign * moved * jump, 0.0)
        return found

    def _integral(self, k: int, x: Array, y: Array) -> Array:
        """∫_x^y ∂b_k/∂p."""
        law, u, v = self.law, x - self.law.s_0[k], y - self.law.s_0[k]
        value = (self.b_0[k] - law.q[k] * self.s_0[k]) * (y - x) + 0.5 * self.q[k] * (v - u) * (v + u)
        r = law.r[k]
        if r == 0.0 or (law.a[k] == 0.0 and self.a[k] == 0.0):
            return np.asarray(value)
        first, second = self.a[k] + law.a[k] * r * self.s_0[k], law.a[k] * self.r[k]
        fall = -np.exp(-r * u) * np.expm1(-r * (y - x))  # e^{-ru} - e^{-rv}
        ramp = u * np.exp(-r * u) - v * np.exp(-r * v)
        return np.asarray(value + first / r * fall - second * (ramp / r + fall / r**2))

    def omega(self) -> float:
        """∂ω/∂p: that of the slope at the end of a piece where b falls most; NaN where two do not agree."""
        law = self.law
        if not np.isfinite(law.omega) or law.omega == 0.0:
            return 0.0 if law.omega == 0.0 else float("nan")
        own, ends = [], np.concatenate([[-np.inf], law.kinks, [np.inf]])
        moves = np.concatenate([[0.0], self.kinks, [0.0]])
        for s, moved in ((ends[:-1], moves[:-1]), (ends[1:], moves[1:])):
            apart = np.where(np.isinf(s), 0.0, s - law.s_0)
            decay = np.where(np.isinf(s), 0.0, np.exp(-law.r * apart))
            turn = self.a * law.r + law.a * self.r - law.a * law.r * (self.r * apart + law.r * (moved - self.s_0))
            own.append((law.q - law.a * law.r * decay, -(self.q - turn * decay)))
        slope, change = (np.concatenate(part) for part in zip(*own, strict=True))
        return agreed(change[slope <= -law.omega * (1.0 - 1e-9)])


@dataclass(frozen=True, eq=False)
class PointSlopes:
    """Derivatives of a law through points (s_j, b_j) by one b_i: the law through (s_j, δ_ij), a hat, times a factor.

    It is not taken from the pieces of the law, which has none for a point on the straight line of its neighbours.

    kinks: (K,) 0, since only b moves;  s: (n,) of the points;  factor: of b
    """

    law: FrictionLaw
    kinks: Array
    s: Array
    hat: FrictionLaw
    factor: float

    def value(self, s: ArrayLike, piece: ArrayLike) -> Array:
        """∂b/∂b_i at s (shape of s), at a jump on its outer side where the law is odd."""
        s = np.asarray(s, dtype=float)
        mirrored = (s < 0.0) & self._odd
        return self.factor * np.where(mirrored, self.hat.b(s, -1), self.hat.b(s, +1))

    def potential(self, s: ArrayLike) -> Array:
        """∂j/∂b_i at s: the integral of the hat from 0 (shape of s)."""
        return self.factor * self.hat.j(s)

    @property
    def _odd(self) -> bool:
        assert self.law.made is not None
        return bool(self.law.made.values["odd"])

    def omega(self) -> float:
        """∂ω/∂b_i: NaN where the fall is not between two neighbouring points."""
        law = self.law
        if not np.isfinite(law.omega) or law.omega == 0.0:
            return 0.0 if law.omega == 0.0 else float("nan")
        steepest = np.flatnonzero(law.q[1:-1] <= -law.omega * (1.0 - 1e-9))
        left, right = law.kinks[:-1][steepest], law.kinks[1:][steepest]
        ends = np.sort(np.abs([left, right]), axis=0) if self._odd else np.array([left, right])
        between = np.any((self.s[:, None] > ends[0]) & (self.s[:, None] < ends[1]), axis=0)
        middle = 0.5 * (left + right)
        slope = self.hat.slope(middle, self.hat.piece(middle))
        return agreed(self.factor * np.where(between, np.nan, -slope))


def agreed(changes: Array) -> float:
    """The one value that all have, to rounding; NaN where they differ."""
    size = float(np.max(np.abs(changes), initial=0.0))
    return float(changes[0]) if len(changes) and np.ptp(changes) <= 1e-9 * size else float("nan")


POINTS = "points"


def number_of(path: tuple[str, ...]) -> str:
    """What a key path calls a number of a law: "delta", "points.2" for the b of the third point."""
    return ".".join(path[-2:]) if path[-2] == POINTS else path[-1]


def point_of(law: FrictionLaw, parameter: str) -> int:
    """Which point of a law "points.2" means. Raises KeyError if it has none of this number."""
    made, (name, _, number) = law.made, parameter.partition(".")
    points = made.values.get(POINTS, ()) if made and name == POINTS else ()
    if not number.isascii() or not number.isdigit() or int(number) >= len(points):
        raise KeyError(parameter)
    return int(number)


def law_slopes(law: FrictionLaw, parameter: str) -> LawSlopes | PointSlopes:
    """Derivatives of a law by one of its parameters, by its `strength`, a factor of b, or by the b of a point.

    parameter: as `number_of` has it
    Raises KeyError if it has no such parameter, or if it is not known what it was made of.
    """
    made = law.made
    if made is None:
        raise KeyError(parameter)
    if parameter == "strength":
        zero, share = np.zeros(len(law.q)), 1.0 / made.strength
        return LawSlopes(law, np.zeros(len(law.kinks)), zero, law.b_0 * share, law.q * share, law.a * share, zero)
    if parameter.startswith(f"{POINTS}."):
        at, slips, odd = point_of(law, parameter), [s for s, _ in made.values[POINTS]], made.values["odd"]
        alone = not (odd and at == 0 and slips[1:2] == [0.0])  # of two points at 0 an odd law has the second only
        points = [(s, float(alone and j == at)) for j, s in enumerate(slips)]
        hat = SHAPES[made.shape].builder(points=points, odd=odd, slope=None, slopes=None)
        return PointSlopes(law, np.zeros(len(law.kinks)), np.array(slips), hat, made.strength)
    value = made.values[parameter]
    if not isinstance(value, float):
        raise KeyError(parameter)
    varied = SHAPES[made.shape].builder(**{**made.values, parameter: Dual(value, 1.0)})

    def slopes(name: str) -> Array:
        column: list[Any] = getattr(varied, name).tolist()
        return np.array([slope_of(x) for x in column])

    factor = made.strength
    b_0, q, a = (factor * slopes(name) for name in ("b_0", "q", "a"))
    return LawSlopes(law, slopes("kinks"), slopes("s_0"), b_0, q, a, slopes("r"))
