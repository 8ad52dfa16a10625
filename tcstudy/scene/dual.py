"""Numbers that carry a derivative: x + x′ε with ε² = 0.

A dual number goes through a computation as its value does and takes the derivative along, exactly:
(xy)′ = x′y + xy′, (x/y)′ = (x′ − (x/y)y′)/y, (xⁿ)′ = n xⁿ⁻¹ x′. Only what builders of laws do with numbers is here.

Literature: Griewank & Walther, Evaluating Derivatives, SIAM 2008, ch. 3 (forward mode).
"""

from __future__ import annotations


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

    __radd__, __rmul__ = __add__, __mul__


def slope_of(number: object) -> float:
    """The derivative that a number carries; 0 of a plain one."""
    return number.slope if isinstance(number, Dual) else 0.0
