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
    shape = np.shape(x[0])
    image = _image(scalar, Interval(*x), Interval(*y))
    is_bounded = np.isfinite(image.lower) & np.isfinite(image.upper)
    lower = np.where(is_bounded, image.lower, -np.inf)
    upper = np.where(is_bounded, image.upper, np.inf)
    return np.broadcast_to(lower, shape), np.broadcast_to(upper, shape)


def _image(scalar: Scalar, x: Interval, y: Interval) -> Interval:
    """Return F(X), of one number where the scalar does not vary."""
    if not isinstance(scalar, Expression):
        return _interval(scalar)
    with np.errstate(all="ignore"):
        return _interval(scalar.fold({"x": x, "y": y}))


@dataclass(frozen=True, eq=False)
class Interval:
    """Intervals lower ≤ a ≤ upper (…), with the arithmetic of expressions."""

    lower: Array
    upper: Array

    @property
    def has_zero(self) -> NDArray[np.bool_]:
        """Whether 0 is in the interval."""
        return np.asarray((self.lower <= 0.0) & (self.upper >= 0.0))

    def __neg__(self) -> Interval:
        return Interval(-self.upper, -self.lower)

    def __add__(self, right: Interval | float) -> Interval:
        addend = _interval(right)
        return Interval(self.lower + addend.lower, self.upper + addend.upper)

    def __sub__(self, right: Interval | float) -> Interval:
        return self + (-_interval(right))

    def __mul__(self, right: Interval | float) -> Interval:
        factor = _interval(right)
        return _hull(
            self.lower * factor.lower,
            self.lower * factor.upper,
            self.upper * factor.lower,
            self.upper * factor.upper,
        )

    def __truediv__(self, right: Interval | float) -> Interval:
        divisor = _interval(right)
        inverse = Interval(1.0 / divisor.upper, 1.0 / divisor.lower)
        return _where(divisor.has_zero, self * inverse)

    def __pow__(self, right: Interval | float) -> Interval:
        exponent = _interval(right)
        if not np.all(exponent.lower == exponent.upper):
            power: Interval = np.exp(exponent * np.log(self))
            return power
        n = float(np.ravel(exponent.lower)[0])
        if not np.all(exponent.lower == n):
            return _where(np.full(np.shape(self.lower), True), self)
        return _power(self, n)

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


def _power(base: Interval, n: float) -> Interval:
    """Return aⁿ: it is monotone beside 0, where an even power has its least value or a pole."""
    ends = _hull(base.lower**n, base.upper**n)
    if n < 0.0:
        return _where(base.has_zero, ends)
    is_even = n == round(n) and round(n) % 2 == 0
    return Interval(np.where(base.has_zero, 0.0, ends.lower), ends.upper) if is_even else ends


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
    ends = _hull(function(a.lower), function(a.upper))
    has_crest = _meets(a, crest, 2.0 * math.pi)
    has_trough = _meets(a, crest + math.pi, 2.0 * math.pi)
    return Interval(np.where(has_trough, -1.0, ends.lower), np.where(has_crest, 1.0, ends.upper))


def _meets(a: Interval, place: float, period: float) -> NDArray[np.bool_]:
    """Return whether intervals contain `place` or a point any number of periods from there."""
    before, after = (a.lower - place) / period, (a.upper - place) / period
    return np.asarray(np.floor(after) >= np.ceil(before))


def _tan(a: Interval) -> Interval:
    has_pole = _meets(a, 0.5 * math.pi, math.pi)
    return _where(has_pole, _rising(np.tan)(a))


def _absolute(a: Interval) -> Interval:
    ends = _hull(np.abs(a.lower), np.abs(a.upper))
    return Interval(np.where(a.has_zero, 0.0, ends.lower), ends.upper)


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
