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
        law, pieces = self.law, np.arange(len(self.q))
        if not np.isfinite(law.omega) or law.omega == 0.0:
            return 0.0 if law.omega == 0.0 else float("nan")
        own = []
        for shift in (0, 1):
            at = np.clip(pieces - 1 + shift, 0, max(len(law.kinks) - 1, 0))
            far = (pieces == 0) if shift == 0 else (pieces == len(law.kinks))
            s = np.where(far, np.inf, law.kinks[at]) if len(law.kinks) else np.full(len(pieces), np.inf)
            moved = np.where(far, 0.0, self.kinks[at]) if len(law.kinks) else np.zeros(len(pieces))
            apart = np.where(np.isinf(s), 0.0, s - law.s_0)
            decay = np.where(np.isinf(s), 0.0, np.exp(-law.r * apart))
            turn = self.a * law.r + law.a * self.r - law.a * law.r * (self.r * apart + law.r * (moved - self.s_0))
            own.append((law.q - law.a * law.r * decay, -(self.q - turn * decay)))
        slope, change = (np.concatenate(part) for part in zip(*own, strict=True))
        return agreed(change[slope <= -law.omega * (1.0 - 1e-9)])


@dataclass(frozen=True, eq=False)
class PointSlopes:
    """Derivatives of a law through points (s_j, b_j) by one b_i: the hat function of the point, times a factor.

    It is not taken from the pieces of the law, which has none for a point on the straight line of its neighbours.

    kinks: (K,) 0, since only b moves;  s: (n,) of the points;  at: i;  odd: whether b is given for s ≥ 0 and mirrored
    """

    law: FrictionLaw
    kinks: Array
    s: Array
    at: int
    odd: bool
    factor: float

    def value(self, s: ArrayLike, piece: ArrayLike) -> Array:
        """∂b/∂b_i at s (shape of s)."""
        s = np.asarray(s, dtype=float)
        x = np.abs(s) if self.odd else s
        i, own = self.at, self.s[self.at]
        left = self.s[i - 1] if i else -np.inf
        right = self.s[i + 1] if i + 1 < len(self.s) else np.inf
        rise = np.where(np.isinf(left), 1.0, (x - left) / (own - left if own > left > -np.inf else 1.0))
        fall = np.where(np.isinf(right), 1.0, (right - x) / (right - own if np.inf > right > own else 1.0))
        below, above = (x < own) & (left < own), (x >= own) & (right > own)
        hat = np.where(below, np.maximum(rise, 0.0), np.where(above, np.maximum(fall, 0.0), 0.0))
        return self.factor * np.asarray(np.where(s < 0.0, -hat, hat) if self.odd else hat)

    def potential(self, s: ArrayLike) -> Array:
        """∂j/∂b_i at s: the integral of the hat from 0 (shape of s)."""
        x, at = np.abs(s) if self.odd else np.asarray(s, dtype=float), self.s
        return self.factor * (self._from_left(x, at) - self._from_left(np.zeros_like(x), at))

    def _from_left(self, x: Array, at: Array) -> Array:
        """The primitive of the hat that is 0 on its left, or at its point where it has no left."""
        i, own, last = self.at, at[self.at], len(at) - 1
        left, right = at[max(i - 1, 0)], at[min(i + 1, last)]
        rise = np.minimum(x - own, 0.0)
        if i > 0:
            rise = np.clip(x - left, 0.0, own - left) ** 2 / (2.0 * (own - left)) if own > left else 0.0 * x
        fall = np.maximum(x - own, 0.0)
        if i < last:
            y = np.clip(x - own, 0.0, right - own)
            fall = y - y**2 / (2.0 * (right - own)) if right > own else 0.0 * x
        return np.asarray(rise + fall)

    def omega(self) -> float:
        """∂ω/∂b_i: NaN where the fall is not between two neighbouring points."""
        law, at = self.law, self.s
        if not np.isfinite(law.omega) or law.omega == 0.0:
            return 0.0 if law.omega == 0.0 else float("nan")
        left, right = law.kinks[:-1], law.kinks[1:]
        change = []
        for k in np.flatnonzero(law.q[1:-1] <= -law.omega * (1.0 - 1e-9)):
            x, y = sorted(np.abs([left[k], right[k]])) if self.odd else (left[k], right[k])
            between = bool(np.any((at > x) & (at < y)))
            change.append(np.nan if between else (self._on(x, at) - self._on(y, at)) / (y - x))
        return agreed(self.factor * np.array(change))

    def _on(self, x: float, at: Array) -> float:
        """1 at the point, 0 at the others."""
        return float(x == at[self.at])


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
        at, points = point_of(law, parameter), made.values[POINTS]
        slips = np.array([s for s, _ in points], dtype=float)
        return PointSlopes(law, np.zeros(len(law.kinks)), slips, at, made.values["odd"], made.strength)
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
