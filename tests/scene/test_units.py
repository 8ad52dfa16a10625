"""Texts with units: the SI value, rounded once, and what is refused."""

import subprocess
import sys

import pytest

from tcstudy.scene import units
from tcstudy.scene.units import UnitError, split_quantity, to_si


def test_value_in_si() -> None:
    for text, dimension, value in (
        ("210 GPa", units.TRACTION, 210e9),
        ("1 N/mm^2", units.TRACTION, 1e6),
        ("40 um", units.LENGTH, 40e-6),
        ("40 µm", units.LENGTH, 40e-6),
        ("1 inch", units.LENGTH, 0.0254),
        ("100 W/m**2/K", units.HEAT_TRANSFER, 100.0),
        ("12 um/(m*K)", units.EXPANSION, 12e-6),
        ("30 %", units.NONE, 0.3),
        ("200 W·m⁻²·K⁻¹", units.HEAT_TRANSFER, 200.0),
        ("40 \u03bcm", units.LENGTH, 40e-6),  # the Greek letter; above the micro sign
    ):
        assert (
            to_si(*(split_quantity(text) or ("", "")), dimension) == value
        )  # exact: as if written in SI


def test_what_is_not_a_quantity() -> None:
    for text in ("1e-3", "5", "5*x", "1e9*x", "sin(x)", "-x", "(2) m", "3 - 1", "1.5e3", "", "2^3"):
        assert split_quantity(text) is None


@pytest.mark.parametrize(
    ("text", "dimension", "message", "remedy"),
    [
        ("5 kg", units.TRACTION, "'kg' is not a unit of a stress (Pa)", "write for example 20 MPa"),
        ("5 mpa", units.TRACTION, "'mpa' is not a known unit", "did you mean 'MPa'"),
        ("5 zork", units.LENGTH, "'zork' is not a known unit", "write for example 20 mm"),
        (
            "20 °C",
            units.TEMPERATURE,
            "'°C' has its own zero",
            "write K or delta_degC: temperatures are",
        ),
        ("5 x", units.LENGTH, "'x' is not a known unit", "write 2*x, not 2 x"),
        ("5 m¹²³", units.LENGTH, "is not a unit", "write for example"),
        ("1e99999999999999999999 m", units.LENGTH, "too large", "write for example"),
    ],
)
def test_refused(text: str, dimension: units.Dimension, message: str, remedy: str) -> None:
    with pytest.raises(UnitError) as info:
        to_si(*split_quantity(text), dimension)  # type: ignore[misc]
    assert message in str(info.value)
    assert remedy in info.value.args[1]


@pytest.mark.parametrize(
    ("text", "fault", "remedy"),
    [
        ("210,000 MPa", "may stand for thousands or for", "write 210000 MPa or 210.000 MPa"),
        ("1,5 mm", "has a decimal comma", "write a decimal point: 1.5 mm"),
        (",5 mm", "has a decimal comma", "write a decimal point: 0.5 mm"),
        ("0,125 m", "has a decimal comma", "write a decimal point: 0.125 m"),
        ("1.234.567 Pa", "has marks between its digits", "write 1234567 Pa"),
        ("1.250,5 m", "has marks between its digits", "write 1250.5 m"),
        ("-1,234,567.5 Pa", "has marks between its digits", "write -1234567.5 Pa"),
        ("12'000 N", "has marks between its digits", "write 12000 N"),
    ],
)
def test_marks_between_digits(text: str, fault: str, remedy: str) -> None:
    marked = units.marked_number(text)
    assert marked is not None
    assert fault in marked[0]
    assert marked[1] == remedy


def test_plain_numbers_have_no_marks() -> None:
    for text in ("12 mm", "1.000 m", "210.000 MPa", "1e-3", "2*x", "[1, 2]"):
        assert units.marked_number(text) is None


@pytest.mark.parametrize(
    ("values", "unit", "size"),
    [
        (["1 mm", "20 mm", 0], "mm", 1e-3),
        (["1 um"], "µm", 1e-6),
        (["2 inch"], "inch", 0.0254),
        (["1 mm", "1 m"], "m", 1.0),
        ([0], "m", 1.0),
        (["5 zork"], "m", 1.0),  # its reader refuses it
    ],
)
def test_common_unit_of_numbers(values: list[object], unit: str, size: float) -> None:
    assert units.common_unit(values, units.LENGTH) == (unit, size)


def test_temperatures_are_differences_in_any_prefix() -> None:
    assert to_si("5", "mK", units.TEMPERATURE) == 5e-3
    assert to_si("5", "delta_degC", units.TEMPERATURE) == 5.0


NAMED = {"L": units.Named(0.2, units.LENGTH), "F": units.Named(3.0, units.LINE_FORCE)}


def test_expressions_with_names_that_have_units() -> None:
    length = units.expression_of("2*L", NAMED, units.LENGTH)
    assert length.evaluate(0.0, 0.0) == 0.4
    assert units.expression_of("F/L", NAMED, units.TRACTION).evaluate(0.0, 0.0) == 3.0 / 0.2
    assert units.expression_of("L/L", NAMED, units.LENGTH).evaluate(0.0, 0.0) == 1.0
    # coordinates leave the dimension open
    assert units.expression_of("L*x", NAMED, units.TRACTION).evaluate(2.0, 0.0) == 0.4
    # a study without units has no dimensions
    assert units.expression_of("L+F", {**NAMED, "F": NAMED["L"]}, None).evaluate(0.0, 0.0) == 0.4
    assert units.units_of(units.parse("L*x", ("L",)), NAMED) is None
    assert units.in_words(units.units_of(units.parse("L*L", ("L",)), NAMED)) == "length^2"
    assert units.in_words(units.units_of(units.parse("L/L", ("L",)), NAMED)) == "a plain number"


def test_expressions_whose_units_do_not_fit() -> None:
    with pytest.raises(UnitError) as info:
        units.expression_of("2*L", NAMED, units.TRACTION)
    assert info.value.args[0] == "'2*L' is length, not a stress (Pa)"
    with pytest.raises(UnitError) as info:
        units.expression_of("L + F", NAMED, units.LENGTH)
    assert info.value.args[0] == "has length where it needs mass time^-2"
    assert "give all terms the same unit" in info.value.args[1]


def test_reading_imports_no_mesher_and_no_units_without_need() -> None:
    code = "import sys, tcstudy.read.study; print({'ngsolve', 'xarray', 'pint', 'scipy'} & {*sys.modules})"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "set()"


def test_units_that_need_no_parser_are_what_the_parser_says() -> None:
    for dimension in units.DIMENSIONS:
        for unit, factor in {**units.PLAIN.get(dimension, {}), dimension.si: 1.0}.items():
            quantity = units.registry().Quantity(1.0, unit or "dimensionless")
            assert float(f"{quantity.to(dimension.si or 'dimensionless').magnitude:.15g}") == factor
