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


@dataclass(frozen=True, eq=False)
class PointSlopes:
    """Derivatives of a law through points (s_j, b_j) by one b_i: the hat function of the point, times a factor.

    It is not taken from the pieces of the law, which has none for a point on the straight line of its neighbours.

    kinks: (K,) 0, since only b moves;  s: (n,) of the points;  at: i;  odd: whether b is given for s ≥ 0 and mirrored
    """

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
        return PointSlopes(np.zeros(len(law.kinks)), slips, at, made.values["odd"], made.strength)
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
