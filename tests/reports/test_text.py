"""Numbers as a table shows them."""

from __future__ import annotations

import pytest

from tcstudy.reports.text import label, labels, scaled_labels


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.4999999, "0.4999999"),  # not the bound 0.5
        (-0.4999999, "-0.4999999"),
        (0.49, "0.49"),
        (1000.4, "1000.4"),
        (1000.0, "1000"),
        (0.1 + 0.2, "0.3"),
        (17.7827941, "17.78"),
        (1.0 + 1e-9, "1.000000001"),
        (1e-5, "1e-05"),
        (0.0, "0"),
        (210e9, "2.1e+11"),
        (float("inf"), "∞"),
    ],
)
def test_a_label_is_short_unless_that_makes_a_rounder_number(value: float, shown: str) -> None:
    assert label(value) == shown


def test_labels_of_one_axis_are_told_apart() -> None:
    assert labels([1.23451, 1.23452, "steep"]) == ["1.23451", "1.23452", "steep"]
    assert labels([0.499, 0.4999999]) == ["0.499", "0.4999999"]


@pytest.mark.parametrize(
    ("values", "units", "shown"),
    [
        ([1e6, 2e6], "Pa", (["1", "2"], "MPa")),
        ([1e-5, 2e-5], "m", (["10", "20"], "µm")),
        ([100.0, 400.0], "W m-2 K-1", (["100", "400"], "W m-2 K-1")),
        ([1e-8, 1.0, 1e8], "W m-2 K-1", (["1e-08", "1", "1e+08"], "W m-2 K-1")),  # no one prefix suits all
        ([1e-5], "K-1", (["1e-05"], "K-1")),  # µK-1 would be (µK)-1
        ([1e-5], "1", (["1e-05"], "1")),
        (["0.3*x", 2e6], "Pa", (["0.3*x", "2e+06"], "Pa")),  # an expression is in Pa
    ],
)
def test_powers_of_ten_become_a_prefix_where_one_suits_all(values, units, shown) -> None:  # type: ignore[no-untyped-def]
    assert scaled_labels(values, units) == shown
