"""Numbers that carry a derivative: x + x′ε with ε² = 0.

A dual number goes through a computation as its value does and takes the derivative along, exactly:
(xy)′ = x′y + xy′, (x/y)′ = (x′ − (x/y)y′)/y, (xⁿ)′ = n xⁿ⁻¹ x′. Builders of laws take them, and arrays of them
(dtype object) stand for the numbers of a law.

Literature: Griewank & Walther, Evaluating Derivatives, SIAM 2008, ch. 3 (forward mode).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


class Dual(float):
    """A number with its derivative; compared and shown as the number alone."""

    slope: float

    def __new__(cls, value: float, slope: float = 0.0) -> Dual:
        self = super().__new__(cls, value)
        self.slope = slope
        return self

    def __add__(self, other: float) -> Dual:
        return Dual(float(self) + float(other), self.slope + slope_of(other))

    def __sub__(self, other: float) -> Dual:
        return Dual(float(self) - float(other), self.slope - slope_of(other))

    def __rsub__(self, other: float) -> Dual:
        return Dual(float(other) - float(self), -self.slope)

    def __mul__(self, other: float) -> Dual:
        return Dual(float(self) * float(other), self.slope * float(other) + float(self) * slope_of(other))

    def __truediv__(self, other: float) -> Dual:
        value = float(self) / float(other)
        return Dual(value, (self.slope - value * slope_of(other)) / float(other))

    def __rtruediv__(self, other: float) -> Dual:
        return Dual(float(other)) / self

    def __pow__(self, n: int) -> Dual:  # type: ignore[override]
        return Dual(float(self) ** n, n * float(self) ** (n - 1) * self.slope if n else 0.0)

    def __neg__(self) -> Dual:
        return Dual(-float(self), -self.slope)

    def __abs__(self) -> Dual:
        return -self if self < 0.0 else self

    __radd__, __rmul__ = __add__, __mul__


def slope_of(number: object) -> float:
    """The derivative that a number carries; 0 of a plain one."""
    return number.slope if isinstance(number, Dual) else 0.0


def slopes_of(numbers: Any) -> NDArray[np.float64]:
    """The derivatives that numbers carry (their shape)."""
    numbers = np.array(numbers, dtype=object)
    return np.array([slope_of(x) for x in numbers.ravel().tolist()], dtype=float).reshape(numbers.shape)


_exp = np.frompyfunc(lambda x: Dual(np.exp(float(x)), np.exp(float(x)) * slope_of(x)), 1, 1)
_expm1 = np.frompyfunc(lambda x: Dual(np.expm1(float(x)), np.exp(float(x)) * slope_of(x)), 1, 1)


def exp(x: Any) -> Any:
    """e^x of numbers, dual ones among them."""
    return _exp(x) if x.dtype == object else np.exp(x)


def expm1(x: Any) -> Any:
    """e^x − 1."""
    return _expm1(x) if x.dtype == object else np.expm1(x)
