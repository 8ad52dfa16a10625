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
