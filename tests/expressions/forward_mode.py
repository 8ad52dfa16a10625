"""An independent engine to check derivatives against: (value, ∂/∂x, ∂/∂y) carried through every operation.

No difference quotient and no symbolic growth: the derivative of a node is computed from those of its children by the
rules of calculus, to rounding. At a kink (abs, min, max) it is that of one side.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tcstudy.expressions.expression import Expression

Array = NDArray[np.float64]


def forward_mode(scalar: float | Expression, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Values (…) and gradient (2, …) of a number or an expression at points; not finite where it has none."""
    x, y = (np.array(a, dtype=float) for a in np.broadcast_arrays(x, y))
    if not isinstance(scalar, Expression):
        return np.full(x.shape, float(scalar)), np.zeros((2, *x.shape))
    one, zero = np.ones(x.shape), np.zeros(x.shape)
    variables = {"x": _Dual(x, np.array([one, zero])), "y": _Dual(y, np.array([zero, one]))}
    with np.errstate(all="ignore"):
        folded = scalar.fold(variables, _FUNCTIONS)
    if not isinstance(folded, _Dual):
        return np.full(x.shape, float(folded)), np.zeros((2, *x.shape))
    return folded.value, folded.slope


@dataclass(frozen=True, eq=False)
class _Dual:
    """A value (…) and its gradient (2, …)."""

    value: Array
    slope: Array

    __array_ufunc__ = None  # a NumPy number on the left must leave the operation to us

    def __neg__(self) -> _Dual:
        return _Dual(-self.value, -self.slope)

    def __add__(self, other: _Dual | float) -> _Dual:
        b = _dual(other, self)
        return _Dual(self.value + b.value, self.slope + b.slope)

    __radd__ = __add__

    def __sub__(self, other: _Dual | float) -> _Dual:
        return self + -_dual(other, self)

    def __rsub__(self, other: float) -> _Dual:
        return -self + other

    def __mul__(self, other: _Dual | float) -> _Dual:
        b = _dual(other, self)
        return _Dual(self.value * b.value, self.slope * b.value + self.value * b.slope)

    __rmul__ = __mul__

    def __truediv__(self, other: _Dual | float) -> _Dual:
        b = _dual(other, self)
        quotient = self.value / b.value
        return _Dual(quotient, (self.slope - quotient * b.slope) / b.value)

    def __rtruediv__(self, other: float) -> _Dual:
        return _dual(other, self) / self

    def __pow__(self, exponent: _Dual | float) -> _Dual:
        if isinstance(exponent, _Dual):
            return _exp(exponent * _log(self))
        if exponent == 0:
            return _dual(1.0, self)
        return _Dual(self.value**exponent, exponent * self.value ** (exponent - 1) * self.slope)

    def __rpow__(self, base: float) -> _Dual:
        return _Dual(base**self.value, np.log(base) * base**self.value * self.slope)


def _dual(value: _Dual | float, like: _Dual) -> _Dual:
    if isinstance(value, _Dual):
        return value
    return _Dual(np.full_like(like.value, value), np.zeros_like(like.slope))


def _chain(function: Callable[..., Any], derivative: Callable[[Array], Any]) -> Callable[[_Dual], _Dual]:
    return lambda u: _Dual(function(u.value), derivative(u.value) * u.slope)


_exp = _chain(np.exp, np.exp)
_log = _chain(np.log, lambda v: 1 / v)


def _atan2(a: _Dual | float, b: _Dual | float) -> _Dual:
    like = a if isinstance(a, _Dual) else b
    assert isinstance(like, _Dual)
    y, x = _dual(a, like), _dual(b, like)
    square = x.value**2 + y.value**2
    return _Dual(np.arctan2(y.value, x.value), (x.value * y.slope - y.value * x.slope) / square)


def _choose(first: Callable[[Array, Array], Any]) -> Callable[[_Dual, _Dual | float], _Dual]:
    def chosen(a: _Dual, b: _Dual | float) -> _Dual:
        other = _dual(b, a)
        take = first(a.value, other.value)
        return _Dual(np.where(take, a.value, other.value), np.where(take, a.slope, other.slope))

    return chosen


_FUNCTIONS: dict[str, Callable[..., _Dual]] = {
    "sin": _chain(np.sin, np.cos),
    "cos": _chain(np.cos, lambda v: -np.sin(v)),
    "tan": _chain(np.tan, lambda v: 1 / np.cos(v) ** 2),
    "asin": _chain(np.arcsin, lambda v: 1 / np.sqrt(1 - v**2)),
    "acos": _chain(np.arccos, lambda v: -1 / np.sqrt(1 - v**2)),
    "atan": _chain(np.arctan, lambda v: 1 / (1 + v**2)),
    "atan2": _atan2,
    "exp": _exp,
    "log": _log,
    "sqrt": _chain(np.sqrt, lambda v: 0.5 / np.sqrt(v)),
    "abs": _chain(np.abs, np.sign),
    "sinh": _chain(np.sinh, np.cosh),
    "cosh": _chain(np.cosh, np.sinh),
    "tanh": _chain(np.tanh, lambda v: 1 - np.tanh(v) ** 2),
    "min": _choose(np.less_equal),
    "max": _choose(np.greater_equal),
}
