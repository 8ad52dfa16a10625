"""Numbers as a table shows them; failures in few lines: what belongs together, ranges, an example,
a remedy."""

import numpy as np
import pytest

from tcstudy.data.schema import PointStatus
from tcstudy.reports.text import (
    failure_lines,
    first_largest,
    fitting,
    label,
    labelled,
    prefix,
    render,
    scaled_labels,
)


def test_a_label_is_short_unless_that_makes_a_rounder_number() -> None:
    values = 0.4999999, 1000.4, 0.1 + 0.2, 17.7827941, 210e9, float("inf")
    assert [*map(label, values)] == ["0.4999999", "1000.4", "0.3", "17.78", "2.1e+11", "∞"]


@pytest.mark.parametrize(
    ("values", "units", "shown"),
    [
        ([1e-5, 2e-5], "m", (["10", "20"], "µm")),
        (
            [1e-8, 1.0, 1e8],
            "W m-2 K-1",
            (["1e-08", "1", "1e+08"], "W m-2 K-1"),
        ),  # no one prefix suits all
        ([1e-5], "K-1", (["1e-05"], "K-1")),  # µK-1 would be (µK)-1
        (["0.3*x", 2e6], "Pa", (["0.3*x", "2e+06"], "Pa")),  # an expression is in Pa
    ],
)
def test_powers_of_ten_become_a_prefix_where_one_suits_all(values, units, shown) -> None:  # type: ignore[no-untyped-def]
    assert scaled_labels(values, {"units": units}) == shown


@pytest.mark.parametrize(
    ("values", "unit"),
    [
        ([2e-3, 3e-3, 1e-13, -4e-13, 2e-14, 0.0, float("nan")], (1e-3, "mm")),
        ([4.064e-2, 2e-6, 3e-6], (1e-3, "mm")),  # not 4.064e+04 µm
        ([0.0, float("inf")], (1.0, "m")),
        ([0.99999], (1.0, "m")),  # four digits make it 1 m, not 1000 mm
    ],
)
def test_the_unit_of_a_column_fits_its_largest_value(values, unit) -> None:  # type: ignore[no-untyped-def]
    assert prefix(values, "m") == unit


BAD, ERROR = PointStatus.INCLUSION_VIOLATED, PointStatus.ERROR


def missed(residual: str, words: str, point: int) -> tuple[PointStatus, str, str, int]:
    return (BAD, f"residual {residual} after 30 steps; raise solver.tolerance", words, point)


def test_other_words_and_other_statuses_are_other_lines_the_most_frequent_first() -> None:
    limit = "the limit of {} is reached; allow more"
    failures = [(BAD, limit.format(300), "b", 1), (BAD, limit.format(400), "c", 2)]
    failures += [(ERROR, "residual 1 after 30 steps; raise solver.tolerance", "a", 0)]
    failures += [missed("2e-07", "d", 3), missed("3.0e-09", "e", 4), missed("4e-8", "f", 5)]
    failures += [missed("1e-7", "d on another level", 3)]  # of a point that is counted
    lines = failure_lines(failures)
    assert [line.split(":")[0] for line in lines] == [
        "3 points failed",
        "2 points failed",
        "1 point failed",
    ]
    assert (
        "inclusion violated: residual 3.0e-09 to 2e-07 after 30 steps (for example d)" in lines[0]
    )
    assert lines[0].endswith("; raise solver.tolerance")
    assert "the limit of 300 to 400 is reached" in lines[1]


def test_a_reason_without_a_remedy_gets_one_and_nothing_of_the_machine_is_shown() -> None:
    line = failure_lines(
        [(ERROR, "OSError: cannot read /srv/someone/deep/part.step; x", "alpha = 1", 0)]
    )[0]
    assert "someone" not in line
    assert all(words in line for words in ("part.step", "run the study again"))
    assert "coarsen the mesh" in failure_lines([(BAD, "", "a", 0)])[0]


def test_labelled_lines_stand_in_two_columns_of_80_characters() -> None:
    long = "all of it slips, " * 8
    block = labelled(
        [("Answer", "first"), ("Answer", long.strip()), ("Trust", ""), ("Solved", "3")]
    )
    first, *middle, last = block.split("\n")
    assert (first, last) == ("  Answer    first", "  Solved    3")
    assert len(middle) > 1
    assert all(line[:12].isspace() and not line[12].isspace() for line in middle)
    assert max(map(len, middle)) <= 80
    with fitting(40):
        narrow = render([labelled([("Answer", long)])])
    assert max(map(len, narrow.split("\n"))) <= 40


def test_the_largest_is_the_first_of_those_equal_but_for_rounding() -> None:
    sizes = np.array([[1.0, np.nan, 2.0 - 1e-12], [2.0, 1.5, 2.0 + 1e-12]])
    assert first_largest(sizes) == (0, 2)
    assert first_largest(1e-30 * sizes) == (0, 2)
    assert first_largest(np.array([1.0, 1.0 + 1e-6])) == (1,)
    assert first_largest(np.array([np.nan, 1.0, np.inf])) == (2,)
    assert first_largest(np.full(3, np.nan)) == (0,)
