"""Named numbers of a study, and the units of expressions that are made of them.

Units are carried through an expression by its own fold over pint's quantities: sums need equal ones, functions and
exponents plain numbers. Coordinates are numbers of metres, as in every expression in x and y: where they occur, units
are not followed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from tcstudy.expressions.expression import FUNCTIONS, VARIABLES, Expression, parse
from tcstudy.scene.units import Dimension, UnitError, dimensions_of, in_si, registry

KEEPING = ("abs", "sqrt", "min", "max")
"""Functions of numbers with units."""


class Named(NamedTuple):
    """A number of a study that has a name: its value in SI and its dimension."""

    value: float
    dimension: Dimension


def units_of(expression: Expression, named: Mapping[str, Named]) -> Any:
    """Exponents of the base units of an expression with names in it; None where coordinates leave them open.

    Raises UnitError where units do not go together.
    """
    if expression.variables & {*VARIABLES}:
        return None
    from pint import DimensionalityError

    def plain(name: str) -> Callable[..., Any]:
        def of(*values: Any) -> Any:
            for one in values:
                if not getattr(one, "dimensionless", True):
                    what = f"takes a function or a power of a number with units ({in_words(one.dimensionality)})"
                    raise UnitError(what, "divide it by a number of the same units first")
            return FUNCTIONS[name](*values)

        return of

    functions = {name: function if name in KEEPING else plain(name) for name, function in FUNCTIONS.items()}
    quantity = registry().Quantity
    given = {name: quantity(np.float64(one.value), one.dimension.si or "dimensionless") for name, one in named.items()}
    try:
        with np.errstate(all="ignore"):
            return getattr(expression.fold(given, functions), "dimensionality", dimensions_of(""))
    except DimensionalityError as error:
        one, two = (in_words(dimensions_of(str(unit))) for unit in (error.units1, error.units2))
        remedy = "give all terms the same unit; a number with a unit needs a name under parameters"
        raise UnitError(f"adds or compares {one} and {two}", remedy) from None


def in_words(dimensionality: Any) -> str:
    """Exponents of base units as a text: length^2 time^-1."""
    words = " ".join(f"{name.strip('[]')}^{power:g}" for name, power in dimensionality.items())
    return words.replace("^1 ", " ").removesuffix("^1") or "a plain number"


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
        units = units_of(found, named)
        if units not in (None, dimensions_of(""), dimensions_of(dimension.si)):
            what = f"{text!r} is {in_words(units)}, not {dimension.name}{in_si(dimension)}"
            raise UnitError(what, "look at the units of its names")
    return found.bound({name: one.value for name, one in named.items()})
