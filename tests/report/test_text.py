"""Numbers as a table shows them."""

from __future__ import annotations

import pytest

from tcstudy.report.text import label, labels


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
