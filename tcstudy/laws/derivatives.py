"""Derivatives of friction laws by their parameters: dual numbers through the builders and the laws' own functions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.laws.dual import Dual, slopes_of
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import SHAPES

Array = NDArray[np.float64]

POINTS = "points"
_AGREE = 1e-9
"""Falls and derivatives nearer than this to each other, relative, are one."""


@dataclass(frozen=True, eq=False)
class LawSlopes:
    """Derivatives by one parameter of a law, one for all; varied: the law with dual numbers.

    Where the law goes straight through a point that moves alone, the varied one has a bend that the law has not.
    """

    law: Laws
    varied: Laws

    @property
    def kinks(self) -> Array:
        """(K,) of the law's kinks [m per unit of p]."""
        return slopes_of(self.varied.kinks[np.searchsorted(self.varied.kinks, self.law.kinks)])

    def value(self, s: Array, piece: NDArray[np.intp]) -> Array:
        """∂b_k/∂p at s of the law's named pieces (shape of s) [Pa per unit of p]."""
        if len(self.varied.q) != len(self.law.q):
            low, high = self.law.ends(piece)
            s = np.clip(s, low, high)
            at = self.varied.locate(s)
            piece = at.toward(s < high)
        return slopes_of(self.varied.value(s, piece))

    def potential(self, s: Array) -> Array:
        """∂j/∂p at s, which is no kink that moves, or the inner side of one (shape of s) [Pa m per unit of p].

        ∫₀ˢ ∂b/∂p, and of every kink on the way, which moves by κ′, κ′(b⁻ − b⁺).
        """
        return slopes_of(self.varied.j(s))

    def omega(self) -> float:
        """∂ω/∂p: that of the slope at the end of a piece where b falls most; NaN where two do not agree."""
        omega, slopes = self.law.omega, self.varied.end_slopes.ravel()
        if not np.isfinite(omega) or omega == 0.0:
            return 0.0 if omega == 0.0 else float("nan")
        return agreed(-slopes_of(slopes[slopes.astype(float) <= -omega * (1.0 - _AGREE)]))


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
    values, factor = dict(made.values), np.array([Dual(made.strength, float(parameter == "strength"))], dtype=object)
    if parameter.startswith(f"{POINTS}."):
        at, of_s = point_of(law, parameter), parameter.endswith(".s")
        points = [(s, Dual(b, float(j == at and not of_s))) for j, (s, b) in enumerate(values[POINTS])]
        points[at] = (Dual(points[at][0], 1.0) if of_s else points[at][0], points[at][1])
        values[POINTS] = points
    elif parameter != "strength":
        if not isinstance(values[parameter], float):
            raise KeyError(parameter)
        values[parameter] = Dual(values[parameter], 1.0)
    varied = SHAPES[made.shape].builder(**values)
    return LawSlopes(law, replace(varied, b_0=varied.b_0 * factor, q=varied.q * factor, a=varied.a * factor))
