"""Named numbers of a study, and the units of expressions that are made of them.

Units are carried through an expression by its own fold: sums need equal ones, functions and exponents plain numbers.
Coordinates are numbers of metres, as in every expression in x and y: what they multiply has no units that are followed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

from tcstudy.expressions.expression import FUNCTIONS, VARIABLES, Expression, parse
from tcstudy.scene.units import Dimension, UnitError, dimensions_of, in_si


class Named(NamedTuple):
    """A number of a study that has a name: its value in SI and its dimension."""

    value: float
    dimension: Dimension


@dataclass(frozen=True)
class Carried:
    """What units a part of an expression has: exponents of the base units, None where coordinates leave that open."""

    of: Any

    def same(self, other: Carried | float) -> Carried:
        """This, of a sum."""
        two = other if isinstance(other, Carried) else Carried(dimensions_of(""))
        if self.of is None or two.of is None:
            return Carried(None)
        if self.of != two.of:
            remedy = "give all terms the same unit; a number with a unit needs a name under parameters"
            raise UnitError(f"adds or compares {self} and {two}", remedy)
        return self

    def product(self, other: Carried | float, sign: int = 1) -> Carried:
        """Of a product, or a quotient."""
        two = other.of if isinstance(other, Carried) else dimensions_of("")
        return Carried(None if self.of is None or two is None else self.of * two**sign)

    def __str__(self) -> str:
        words = " ".join(f"{name.strip('[]')}^{power:g}" for name, power in (self.of or {}).items())
        return words.replace("^1 ", " ").removesuffix("^1") or "a plain number"

    __add__ = __radd__ = __sub__ = __rsub__ = same
    __mul__ = __rmul__ = product

    def __neg__(self) -> Carried:
        return self

    def __truediv__(self, other: Carried | float) -> Carried:
        return self.product(other, -1)

    def __rtruediv__(self, other: float) -> Carried:
        return Carried(None if self.of is None else self.of**-1)

    def __pow__(self, exponent: Carried | float) -> Carried:
        if isinstance(exponent, Carried):
            return self.plain(exponent)
        return Carried(None if self.of is None else self.of**exponent)

    def __rpow__(self, base: float) -> Carried:
        return self.plain()

    def plain(self, *others: Carried | float) -> Carried:
        """This of a function that takes plain numbers only."""
        for one in (self, *others):
            if isinstance(one, Carried) and one.of not in (None, dimensions_of("")):
                what = f"takes a function or a power of a number with units ({one})"
                raise UnitError(what, "divide it by a number of the same units first")
        return self


_KEEPING: dict[str, Callable[..., Carried]] = {
    "abs": lambda one: one,
    "sqrt": lambda one: one**0.5,
    "min": Carried.same,
    "max": Carried.same,
}
_CARRYING: dict[str, Callable[..., Carried]] = {name: _KEEPING.get(name, Carried.plain) for name in FUNCTIONS}


def carried(expression: Expression, named: Mapping[str, Named]) -> Carried:
    """The units of an expression with names in it. Raises UnitError where they do not go together."""
    units = {name: Carried(dimensions_of(one.dimension.si)) for name, one in named.items()}
    found = expression.fold(units | dict.fromkeys(VARIABLES, Carried(None)), _CARRYING)
    return found if isinstance(found, Carried) else Carried(dimensions_of(""))


_parsed = lru_cache(maxsize=4096)(parse)


def expression_of(text: str, named: Mapping[str, Named], dimension: Dimension | None) -> Expression:
    """An expression in x and y, its names bound to their numbers.

    dimension: that it must have, unless it is a plain number, as any number may be; None where units are none
    Raises ExpressionError, UnitError.
    """
    found = _parsed(text, tuple(named))
    if not named or found.variables <= {*VARIABLES}:
        return found
    if dimension is not None:
        units = carried(found, named)
        if units.of not in (None, dimensions_of(""), dimensions_of(dimension.si)):
            what = f"{text!r} is {units}, not {dimension.name}{in_si(dimension)}"
            raise UnitError(what, "look at the units of its names")
    return found.bound({name: one.value for name, one in named.items()})
