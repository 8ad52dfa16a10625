"""Physical dimensions and texts such as "210 GPa": a number and a unit, converted to SI.

Units are those of pint; its registry is made when the first text with an unusual unit occurs. Left
out on purpose: units with an offset (degC), because temperatures are counted from the stress-free
state, and logarithmic units.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from decimal import Decimal, DecimalException
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from tcstudy.expressions.expression import VARIABLES, Expression, parse


@dataclass(frozen=True)
class Dimension:
    """A physical dimension as it is shown to the user and written to data.

    name:    words for messages
    si:      the SI unit for pint
    cf:      the SI unit in UDUNITS form
    example: a valid text
    """

    name: str
    si: str
    cf: str
    example: str


NONE = Dimension("a plain number", "", "1", "0.3")
LENGTH = Dimension("a length", "m", "m", "20 mm")
AREA = Dimension("an area", "m^2", "m2", "300 mm^2")
TRACTION = Dimension("a stress", "Pa", "Pa", "20 MPa")
STIFFNESS = Dimension("a traction per slip", "Pa/m", "Pa m-1", "5e9 Pa/m")
BODY_FORCE = Dimension("a force per volume", "N/m^3", "N m-3", "-77 kN/m^3")
LINE_FORCE = Dimension("a force per length", "N/m", "N m-1", "30 kN/m")
FRACTURE_ENERGY = Dimension("an energy per area", "J/m^2", "J m-2", "400 J/m^2")
MOMENT = Dimension("a moment per length", "N", "N", "20 N")
HEAT_SOURCE = Dimension("a heat source density", "W/m^3", "W m-3", "5e6 W/m^3")
HEAT_FLUX = Dimension("a heat flux", "W/m^2", "W m-2", "500 W/m^2")
HEAT_TRANSFER = Dimension("a heat transfer coefficient", "W/(m^2*K)", "W m-2 K-1", "100 W/(m^2*K)")
TEMPERATURE = Dimension("a temperature difference", "K", "K", "20 K")
CONDUCTIVITY = Dimension("a thermal conductivity", "W/(m*K)", "W m-1 K-1", "45 W/(m*K)")
EXPANSION = Dimension("a coefficient of thermal expansion", "1/K", "K-1", "12e-6 1/K")
THERMAL_STRESS = Dimension("a stress per temperature", "Pa/K", "Pa K-1", "6 MPa/K")
VELOCITY = Dimension("a velocity", "m/s", "m s-1", "0.5 m/s")

PLAIN: dict[Dimension, dict[str, float]] = {
    LENGTH: {"km": 1e3, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9},
    AREA: {"cm^2": 1e-4, "mm^2": 1e-6},
    TRACTION: {"kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "N/mm^2": 1e6},
    STIFFNESS: {
        "kPa/m": 1e3,
        "MPa/m": 1e6,
        "GPa/m": 1e9,
        "kPa/mm": 1e6,
        "MPa/mm": 1e9,
        "GPa/mm": 1e12,
        "MPa/um": 1e12,
        "N/mm^3": 1e9,
    },
    BODY_FORCE: {"kN/m^3": 1e3, "MN/m^3": 1e6},
    LINE_FORCE: {"kN/m": 1e3, "MN/m": 1e6, "N/mm": 1e3, "kN/mm": 1e6},
    FRACTURE_ENERGY: {"kJ/m^2": 1e3, "N/m": 1.0, "N/mm": 1e3},
    HEAT_SOURCE: {"kW/m^3": 1e3, "MW/m^3": 1e6},
    HEAT_FLUX: {"kW/m^2": 1e3, "MW/m^2": 1e6},
    HEAT_TRANSFER: {"kW/(m^2*K)": 1e3},
    THERMAL_STRESS: {"kPa/K": 1e3, "MPa/K": 1e6},
    VELOCITY: {"mm/s": 1e-3},
}
"""Usual units and their sizes in SI.

They are looked up before pint is imported, which takes a third of a second before its first answer.
"""

USUAL = (
    "nm",
    "um",
    "mm",
    "cm",
    "m",
    "Pa",
    "kPa",
    "MPa",
    "GPa",
    "N",
    "kN",
    "mW",
    "W",
    "kW",
    "K",
    "kg",
    "s",
    "J",
)
"""Units that are suggested when one is misspelt in upper and lower case."""

NUMBER = r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
"""A number in decimals; tried in a time that grows with its length, as is QUANTITY."""
QUANTITY = re.compile(
    rf"({NUMBER})\s*(?![eE][+-]?[0-9])((?:[A-Za-zµμΩΩ°℃℉K%]|(?<=\s)[0-9(]).*)", re.DOTALL
)
"""A number, then a unit that does not look like the end of a number such as 1e-3."""
UNIT = re.compile(r"[A-Za-zµμΩΩ°%*/^()\s0-9_-]{1,60}")
"""Signs of which units are made."""
LONGEST = 2000
"""Largest number of characters of a text that may be a number with a unit."""
SIGNS = str.maketrans(
    {**dict.fromkeys("·⋅∙×", "*"), **dict.fromkeys("−–", "-"), "∕": "/", "⁄": "/"}
)
"""Signs of products, quotients and exponents, and what ASCII has for them.

Raised digits as in W·m⁻² are made plain by NFKC.
"""

PLAIN_SIGNS = SIGNS | str.maketrans(
    {**dict.fromkeys("‐‑‒—－﹣", "-"), "＋": "+", "÷": "/", "²": "^2", "³": "^3", "π": "pi"}
)
"""Signs that look like those of numbers and expressions, and what to write for them."""
GROUPED = re.compile(
    r"(?P<sign>[+-]?)(?P<lead>[0-9]{1,3})(?P<rest>(?P<mark>[,.'’_ \u00a0\u2009\u202f])[0-9]{3}"
    r"(?:(?P=mark)[0-9]{3})*)(?![0-9])(?:(?P<point>[.,])(?P<decimals>[0-9]+))?(?P<unit>.*)"
)
"""A number whose digits stand in groups of three."""
DECIMAL_COMMA = re.compile(r"(?P<number>[+-]?[0-9]*),(?P<decimals>[0-9]+)(?P<unit>[^,]*)")
"""A number with a comma before its decimals."""


def marked_number(text: str) -> tuple[str, str] | None:
    """Return the fault of a number with marks between its digits, and the remedy.

    Such a number is 210,000 MPa. None for other texts.
    """
    text = text.strip()
    grouped = GROUPED.fullmatch(text)
    decimal = DECIMAL_COMMA.fullmatch(text)
    with_point = ""
    if decimal is not None:
        with_point = f"{decimal['number'] or 0}.{decimal['decimals']}{decimal['unit']}"
    if grouped is not None and grouped["mark"] != grouped["point"]:
        mark = grouped["mark"]
        groups = grouped["rest"]
        digits = grouped["lead"] + groups.replace(mark, "")
        decimals = f".{grouped['decimals']}" if grouped["decimals"] else ""
        without_marks = f"{grouped['sign']}{digits}{decimals}{grouped['unit']}"
        if decimal is None or grouped["point"]:
            is_plain_decimal = mark == "." and len(groups) == 4 and not decimals
            if is_plain_decimal:
                return None
            return f"{text!r} has marks between its digits", f"write {without_marks}"
        if grouped["lead"] != "0":
            fault = f"{text!r} has a comma, which may stand for thousands or for a decimal point"
            return fault, f"write {without_marks} or {with_point}"
    if decimal is not None:
        return f"{text!r} has a decimal comma", f"write a decimal point: {with_point}"
    return None


class UnitError(ValueError):
    """A text with a unit that cannot be read, or has another dimension than expected.

    Its arguments are the fault and the remedy.
    """

    def __str__(self) -> str:
        """Return both in one text."""
        return "; ".join(self.args)


def split_quantity(text: str) -> tuple[str, str] | None:
    """Return the number and the unit of a text like "210 GPa", None for one of another form."""
    if len(text) > LONGEST:
        return None
    match = QUANTITY.fullmatch(text.strip())
    return (match[1], match[2]) if match else None


def to_si(number: str, unit: str, dimension: Dimension) -> float:
    """Return the number in the SI unit of the dimension, rounded once.

    The product is taken in decimals: "40 um" is 4e-5 exactly as if the user had written it so.
    Raises UnitError.
    """
    factor = _factor(unit, dimension)
    try:
        value = float(Decimal(number) * Decimal(repr(factor)))
    except (DecimalException, OverflowError):
        value = float("inf")
    if not abs(value) < float("inf"):
        raise UnitError(
            f"{number} {unit} is too large for a number", f"write for example {dimension.example}"
        )
    return value


DIMENSIONS = tuple(value for value in list(globals().values()) if isinstance(value, Dimension))
"""All dimensions; of two with the same units the first is meant where only units are given."""


def common_unit(values: Iterable[object], dimension: Dimension) -> tuple[str, float]:
    """Return the unit in which all numbers of a study are written, and its size in SI.

    It is the SI unit if they have none in common. A zero needs no unit.
    """
    units = {str(value).lstrip("+-.0123456789eE ").rstrip() for value in values if value != 0}
    unit = units.pop() if len(units) == 1 else ""
    if not unit:
        return dimension.si, 1.0
    try:
        size = to_si("1", unit, dimension)
    except UnitError:  # a text that its reader refuses
        return dimension.si, 1.0
    return "µm" if unit == "um" else unit, size


@lru_cache(maxsize=64)
def dimensions_of(unit: str) -> Any:
    """Return the exponents of the base units of a unit in pint's words."""
    return registry().parse_units(unit or "dimensionless").dimensionality


@lru_cache(maxsize=1024)
def _factor(unit: str, dimension: Dimension) -> float:
    """Return the size of a unit in SI; raises UnitError."""
    if unit == dimension.si:
        return 1.0
    if unit in PLAIN.get(dimension, ()):
        return PLAIN[dimension][unit]
    spelt = _in_ascii(unit)
    # Exponents have one digit: a chain of powers is a typing error and could keep the unit library
    # busy for ever.
    if not UNIT.fullmatch(spelt) or re.search(r"\d\d|\^[^A-Za-z]*\^", spelt):
        raise UnitError(f"{unit[:40]!r} is not a unit", _unknown_remedy(unit, dimension))
    units = registry()
    si_unit = dimension.si or "dimensionless"
    try:
        size = units.Quantity(1.0, units.parse_units(spelt))
        zero = units.Quantity(0.0, units.parse_units(spelt))
    except Exception:  # the parser of pint lets errors of its tokenizer and its arithmetic through
        fault = f"{unit[:40]!r} is not a known unit"
        raise UnitError(fault, _unknown_remedy(unit, dimension)) from None
    if not size.is_compatible_with(si_unit):
        fault = f"{unit!r} is not a unit of {dimension.name}{in_si(dimension)}"
        raise UnitError(fault, f"write for example {dimension.example}")
    if dimension == TEMPERATURE and zero.to("K").magnitude != 0.0:
        difference = f"delta_{units.parse_units(spelt)}".replace("degree_Celsius", "degC")
        difference = difference.replace("degree_Fahrenheit", "degF")
        remedy = f"write K or {difference}: temperatures are differences to the stress-free state"
        raise UnitError(f"{unit!r} has its own zero", remedy)
    factor = float(size.to(si_unit).magnitude)
    return float(f"{factor:.15g}")


def _in_ascii(unit: str) -> str:
    """Return a unit with the signs of ASCII, and ^ before its exponents."""
    spelt = unicodedata.normalize("NFKC", unit).translate(SIGNS).replace("**", "^")
    spelt = re.sub(r"\s+", " ", spelt)
    return re.sub(r"(?<=[A-Za-zµμ])(-?\d)\b", r"^\1", spelt)


def in_si(dimension: Dimension) -> str:
    """Return the SI unit in parentheses, for messages; empty for plain numbers."""
    return f" ({dimension.si})" if dimension.si else ""


def _unknown_remedy(unit: str, dimension: Dimension) -> str:
    usual = {name.lower(): name for name in USUAL}

    def as_usual(word: re.Match[str]) -> str:
        return usual.get(word[0].lower(), word[0])

    spelt = re.sub(r"[A-Za-zµμ]+", as_usual, unit)
    if spelt != unit:
        return f"did you mean {spelt!r}? Units are case-sensitive"
    if re.search(r"(?<![A-Za-z])([xy]|sin|cos|tan|exp|log|sqrt)(?![A-Za-z])", unit):
        return (
            "an expression has no unit and every product its *: write 2*x, not 2 x; "
            f"a quantity: {dimension.example}"
        )
    return f"units are case-sensitive: write for example {dimension.example}"


@lru_cache(maxsize=1)
def registry() -> Any:
    """Return the unit registry; pint is imported here because most studies never need it."""
    import pint

    return pint.UnitRegistry(cache_folder=None)


class Named(NamedTuple):
    """A number of a study that has a name: its value in SI and its dimension."""

    value: float
    dimension: Dimension


def units_of(expression: Expression, named: Mapping[str, Named]) -> Any:
    """Return the exponents of the base units of an expression with names in it.

    None where coordinates leave them open. Raises UnitError where units do not go together.
    """
    if expression.variables & {*VARIABLES}:
        return None
    from pint import DimensionalityError

    quantity = registry().Quantity
    quantities = {
        name: quantity(np.float64(number.value), number.dimension.si or "dimensionless")
        for name, number in named.items()
    }
    try:
        with np.errstate(all="ignore"):
            value = expression.fold(quantities)
    except DimensionalityError as error:
        actual = in_words(dimensions_of(str(error.units1)))
        needed = in_words(dimensions_of(str(error.units2)))
        remedy = (
            "give all terms the same unit, functions plain numbers; "
            "one with a unit needs a name of parameters"
        )
        raise UnitError(f"has {actual} where it needs {needed}", remedy) from None
    return getattr(value, "dimensionality", dimensions_of(""))


def in_words(dimensionality: Any) -> str:
    """Return exponents of base units as a text: length^2 time^-1."""
    words = " ".join(f"{name.strip('[]')}^{power:g}" for name, power in dimensionality.items())
    return words.replace("^1 ", " ").removesuffix("^1") or "a plain number"


_parsed = lru_cache(maxsize=4096)(parse)


def expression_of(text: str, named: Mapping[str, Named], dimension: Dimension | None) -> Expression:
    """Return an expression in x and y, its names bound to their numbers.

    dimension: that it must have, unless it is a plain number, as any number may be; None in a study
               without units
    Raises ExpressionError and UnitError.
    """
    expression = _parsed(text, tuple(named))
    if not named or expression.variables <= {*VARIABLES}:
        return expression
    if dimension is not None:
        units = units_of(expression, named)
        if units not in (None, dimensions_of(""), dimensions_of(dimension.si)):
            fault = f"{text!r} is {in_words(units)}, not {dimension.name}{in_si(dimension)}"
            raise UnitError(fault, "look at the units of its names")
    return expression.bound({name: number.value for name, number in named.items()})
