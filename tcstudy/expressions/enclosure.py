"""Enclosures of expressions: the range of values on boxes of x and y, by interval arithmetic.

    F(X) ⊇ {f(x) : x ∈ X},   A ∘ B = {a ∘ b : a ∈ A, b ∈ B} for every operation of the expression

The range is never too small, and too large by O(width) where a variable occurs more than once. All
up to rounding: ends are not rounded outwards. A range without a finite bound (a division by an
interval with 0, the logarithm of one) is from −∞ to ∞.

Literature: R. E. Moore, R. B. Kearfott, M. J. Cloud, Introduction to Interval Analysis, SIAM 2009.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.expressions.expression import Expression, Scalar

Array = NDArray[np.float64]


def enclosure(
    scalar: Scalar, x: tuple[Array, Array], y: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return lower and upper bounds (…) of a number or an expression on boxes.

    x, y: the ends (…) of the boxes
    """
    if not isinstance(scalar, Expression):
        value = np.full(np.shape(x[0]), float(scalar))
        return value, value
    with np.errstate(all="ignore"):
        values = scalar.fold({"x": Interval(*x), "y": Interval(*y)})
    if not isinstance(values, Interval):
        value = np.full(np.shape(x[0]), float(values))
        return value, value
    known = np.isfinite(values.lower) & np.isfinite(values.upper)
    return np.where(known, values.lower, -np.inf), np.where(known, values.upper, np.inf)


@dataclass(frozen=True, eq=False)
class Interval:
    """Intervals lower ≤ a ≤ upper (…), with the arithmetic of expressions."""

    lower: Array
    upper: Array

    def __neg__(self) -> Interval:
        return Interval(-self.upper, -self.lower)

    def __add__(self, right: Interval | float) -> Interval:
        other = _interval(right)
        return Interval(self.lower + other.lower, self.upper + other.upper)

    def __sub__(self, right: Interval | float) -> Interval:
        return self + (-_interval(right))

    def __mul__(self, right: Interval | float) -> Interval:
        other = _interval(right)
        return _hull(
            self.lower * other.lower,
            self.lower * other.upper,
            self.upper * other.lower,
            self.upper * other.upper,
        )

    def __truediv__(self, right: Interval | float) -> Interval:
        other = _interval(right)
        has_zero = (other.lower <= 0.0) & (other.upper >= 0.0)
        return _where(has_zero, self * Interval(1.0 / other.upper, 1.0 / other.lower))

    def __pow__(self, right: Interval | float) -> Interval:
        exponent = _interval(right)
        if not np.all(exponent.lower == exponent.upper):
            power: Interval = np.exp(exponent * np.log(self))
            return power
        n = float(np.ravel(exponent.lower)[0])
        if not np.all(exponent.lower == n):
            return _where(np.full(np.shape(self.lower), True), self)
        ends = _hull(self.lower**n, self.upper**n)
        has_zero = (self.lower <= 0.0) & (self.upper >= 0.0)
        if n < 0.0:
            return _where(has_zero, ends)
        if n == round(n) and round(n) % 2 == 0:
            return Interval(np.where(has_zero, 0.0, ends.lower), ends.upper)
        return ends

    __radd__, __rmul__ = __add__, __mul__

    def __rsub__(self, left: float) -> Interval:
        return _interval(left) - self

    def __rtruediv__(self, left: float) -> Interval:
        return _interval(left) / self

    def __rpow__(self, left: float) -> Interval:
        return _interval(left) ** self

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *operands: Any) -> Interval:
        """Return a function of expressions of intervals; NumPy asks for it."""
        intervals = [_interval(operand) for operand in operands]
        return RANGES[ufunc.__name__](*intervals)


def _interval(value: Any) -> Interval:
    if isinstance(value, Interval):
        return value
    number = np.asarray(value, dtype=float)
    return Interval(number, number)


def _hull(*values: Array) -> Interval:
    """Return the smallest intervals with some values; without bounds where one is not a number."""
    stacked = np.stack(np.broadcast_arrays(*values))
    unknown = np.isnan(stacked).any(axis=0)
    return _where(unknown, Interval(stacked.min(axis=0), stacked.max(axis=0)))


def _where(unknown: NDArray[np.bool_], values: Interval) -> Interval:
    """Return intervals that have no bounds where they are unknown."""
    return Interval(
        np.where(unknown, -np.inf, values.lower), np.where(unknown, np.inf, values.upper)
    )


def _rising(function: Callable[[Array], Array]) -> Callable[[Interval], Interval]:
    def range_of(a: Interval) -> Interval:
        return _hull(function(a.lower), function(a.upper))

    return range_of


def _sin(a: Interval) -> Interval:
    return _wave(a, np.sin, 0.5 * math.pi)


def _cos(a: Interval) -> Interval:
    return _wave(a, np.cos, 0.0)


def _wave(a: Interval, function: Callable[[Array], Array], crest: float) -> Interval:
    """Return the range of a sine with a crest at an argument and every 2π from there."""

    def holds(place: float) -> NDArray[np.bool_]:
        period = 2.0 * math.pi
        holds_one: NDArray[np.bool_] = np.floor((a.upper - place) / period) >= np.ceil(
            (a.lower - place) / period
        )
        return holds_one

    ends = _hull(function(a.lower), function(a.upper))
    upper = np.where(holds(crest), 1.0, ends.upper)
    return Interval(np.where(holds(crest + math.pi), -1.0, ends.lower), upper)


def _tan(a: Interval) -> Interval:
    has_pole = np.floor(a.upper / math.pi - 0.5) >= np.ceil(a.lower / math.pi - 0.5)
    return _where(has_pole, _rising(np.tan)(a))


def _absolute(a: Interval) -> Interval:
    ends = _hull(np.abs(a.lower), np.abs(a.upper))
    has_zero = (a.lower <= 0.0) & (a.upper >= 0.0)
    return Interval(np.where(has_zero, 0.0, ends.lower), ends.upper)


def _cosh(a: Interval) -> Interval:
    absolute = _absolute(a)
    return Interval(np.cosh(absolute.lower), np.cosh(absolute.upper))


def _atan2(y: Interval, x: Interval) -> Interval:
    """Return the angles of boxes: of the corners, or all where a box meets the cut x ≤ 0, y = 0."""
    corners = [np.arctan2(b, a) for a in (x.lower, x.upper) for b in (y.lower, y.upper)]
    hull = _hull(*corners)
    meets_cut = (x.lower <= 0.0) & (y.lower <= 0.0) & (y.upper >= 0.0)
    return Interval(
        np.where(meets_cut, -math.pi, hull.lower), np.where(meets_cut, math.pi, hull.upper)
    )


def _minimum(a: Interval, b: Interval) -> Interval:
    return Interval(np.minimum(a.lower, b.lower), np.minimum(a.upper, b.upper))


def _maximum(a: Interval, b: Interval) -> Interval:
    return Interval(np.maximum(a.lower, b.lower), np.maximum(a.upper, b.upper))


RANGES: dict[str, Callable[..., Interval]] = {
    "sin": _sin,
    "cos": _cos,
    "tan": _tan,
    "arcsin": _rising(np.arcsin),
    "arccos": _rising(np.arccos),
    "arctan": _rising(np.arctan),
    "arctan2": _atan2,
    "exp": _rising(np.exp),
    "log": _rising(np.log),
    "sqrt": _rising(np.sqrt),
    "absolute": _absolute,
    "sinh": _rising(np.sinh),
    "cosh": _cosh,
    "tanh": _rising(np.tanh),
    "minimum": _minimum,
    "maximum": _maximum,
}
"""Ranges of the functions of expressions, by their names in NumPy."""
