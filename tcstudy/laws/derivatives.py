"""Derivatives of friction laws by their parameters: complex steps through the builders and the laws' own functions.

f′(p) = Im f(p + ih)/h to the last digits, since nothing is subtracted (Squire & Trapp, SIAM Rev. 40 (1998) 110–112);
h is so small that h² is lost beside every number. What is compared is the real part.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import SHAPES

Array = NDArray[np.float64]

POINTS = "points"
_AGREE = 1e-9
"""Falls and derivatives nearer than this to each other, relative, are one."""


_STEP = 2.0**-400


def stepped(number: float) -> Any:
    """p + ih."""
    return np.complex128(complex(number, _STEP))


def derivative(numbers: Any) -> Any:
    """Of what was computed from p + ih (their shape)."""
    return np.imag(numbers) / _STEP


@dataclass(frozen=True, eq=False)
class LawSlopes:
    """Derivatives by one parameter of a law, one for all; varied: the law of p + ih.

    Where the law goes straight through a point that moves alone, the varied one has a bend that the law has not.
    """

    law: Laws
    varied: Laws

    @property
    def kinks(self) -> Array:
        """(K,) of the law's kinks [m per unit of p]."""
        return derivative(self.varied.kinks[np.searchsorted(self.varied.kinks.real, self.law.kinks)])

    def value(self, s: Array, piece: NDArray[np.intp]) -> Array:
        """∂b_k/∂p at s of the law's named pieces (shape of s) [Pa per unit of p]."""
        if len(self.varied.q) != len(self.law.q):
            low, high = self.law.ends(piece)
            s = np.clip(s, low, high)
            at = self.varied.locate(s)
            piece = at.toward(s < high)
        return derivative(self.varied.value(s, piece))

    def potential(self, s: Array) -> Array:
        """∂j/∂p at s, which is no kink that moves, or the inner side of one (shape of s) [Pa m per unit of p].

        ∫₀ˢ ∂b/∂p, and of every kink on the way, which moves by κ′, κ′(b⁻ − b⁺).
        """
        return derivative(self.varied.j(s))

    def omega(self) -> float:
        """∂ω/∂p: that of the slope at the end of a piece where b falls most; NaN where two do not agree."""
        omega, slopes = self.law.omega, self.varied.end_slopes.ravel()
        if not np.isfinite(omega) or omega == 0.0:
            return 0.0 if omega == 0.0 else float("nan")
        return agreed(-derivative(slopes[slopes.real <= -omega * (1.0 - _AGREE)]))


def agreed(changes: Array) -> float:
    """The one value that all have, to rounding; NaN where they differ."""
    size = float(np.max(np.abs(changes), initial=0.0))
    return float(changes[0]) if len(changes) and np.ptp(changes) <= _AGREE * size else float("nan")


def number_of(path: tuple[str, ...]) -> str:
    """What a key path calls a number of a law: "delta", "points.2" for the b of the third point, "points.2.s"."""
    n = next((n for n in (2, 3) if path[-n:][0] == POINTS), 1)
    return ".".join(path[-n:])


def point_of(law: Laws, parameter: str) -> int:
    """Which point of a law "points.2" or "points.2.s" means. Raises KeyError if it has none of this number."""
    made, (name, _, number) = law.made, parameter.removesuffix(".s").partition(".")
    points = made.values.get(POINTS, ()) if made and name == POINTS else ()
    if not number.isascii() or not number.isdigit() or int(number) >= len(points):
        raise KeyError(parameter)
    return int(number)


def law_slopes(law: Laws, parameter: str) -> LawSlopes:
    """Derivatives of a law by one of its parameters, by its `strength`, a factor of b, or by the b or s of a point.

    parameter: as `number_of` has it
    Raises KeyError if it has no such parameter, or if it is not known what it was made of.
    """
    made = law.made
    if made is None:
        raise KeyError(parameter)
    values, factor = dict(made.values), stepped(made.strength) if parameter == "strength" else made.strength
    if parameter.startswith(f"{POINTS}."):
        at, of_s = point_of(law, parameter), parameter.endswith(".s")
        points = [(s, np.complex128(b)) for s, b in values[POINTS]]
        s, b = points[at]
        points[at] = (stepped(s), b) if of_s else (s, stepped(b.real))
        values[POINTS] = points
    elif parameter != "strength":
        if not isinstance(values[parameter], float):
            raise KeyError(parameter)
        values[parameter] = stepped(values[parameter])
    varied = SHAPES[made.shape].builder(**values)
    return LawSlopes(law, replace(varied, b_0=varied.b_0 * factor, q=varied.q * factor, a=varied.a * factor))
