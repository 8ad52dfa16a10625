"""Numbers as a table shows them; failures in few lines: what belongs together, ranges, an example,
a remedy."""

import numpy as np
import pytest

from tcstudy.data.schema import PointStatus
from tcstudy.reports.text import (
    Heading,
    Verdict,
    axis_unit,
    between,
    counted,
    digits_lost,
    failure_lines,
    first_largest,
    fitting,
    headed,
    label,
    labelled,
    labels,
    number,
    prefix,
    pretty,
    proved,
    quantity,
    render,
    scaled_labels,
    span,
    spelled,
    with_unit,
)


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (410.0, 2, "410"),
        (4100.0, 2, "4100"),
        (9999.0, 2, "10000"),
        (10000.0, 2, "1e+04"),
        (-41000.0, 2, "-4.1e+04"),
        (123456.0, 4, "1.235e+05"),
        (0.000123456, 3, "0.000123"),
        (1.5, 4, "1.5"),
        (float("nan"), 4, "–"),
        (float("inf"), 4, "∞"),
        (-float("inf"), 4, "−∞"),
    ],
)
def test_a_number_has_few_digits_and_no_power_below_ten_thousand(
    value: float, digits: int, text: str
) -> None:
    assert number(value, digits) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (-3, "0 s"),
        (0.4, "0 s"),
        (89.4, "89 s"),
        (90, "1 min 30 s"),
        (125, "2 min 5 s"),
        (7199, "119 min 59 s"),
        (7200, "2 h"),
        (7741, "2.2 h"),  # 2.1503
        (12600, "3.5 h"),
    ],
)
def test_a_duration_is_in_the_unit_that_suits_it(seconds: float, text: str) -> None:
    assert span(seconds) == text


def test_units_and_names_are_written_with_signs() -> None:
    assert pretty("W m-2 K-1") == "W m⁻² K⁻¹"
    assert pretty("m2") == "m²"
    assert pretty("1") == ""
    assert spelled("lambda_1, lambda and theta_bar of xi, not lambdas") == (
        "λ₁, λ and θ_bar of ξ, not lambdas"
    )
    assert (headed("u_T", "mm"), headed("ν", "1")) == ("u_T [mm]", "ν")
    assert (counted(1, "point"), counted(2, "point"), counted(0, "point")) == (
        "1 point",
        "2 points",
        "0 points",
    )


def test_numbers_that_are_read_together_have_one_unit() -> None:
    assert with_unit(0.0125, "m") == "12.5 mm"
    assert with_unit(0.25, "1") == "0.25"
    assert between(2.88e-3, 0.2, "m") == "2.88 to 200 mm"
    assert between(-0.2, 1e-3, "m") == "-200 to 1 mm"
    assert between(0.1, 0.100001, "m") == "100 mm"
    column = quantity("u_T", [1e-3, 2e-6], "m", like=[5e-6])
    assert (column.title, column.cells) == ("u_T [µm]", ["1000", "2"])
    assert quantity("u_T", [1e-3, 2e-6], "m").cells == ["1", "0.002"]


@pytest.mark.parametrize(
    ("values", "units", "unit"),
    [
        ([2e-5, -3e-5], "1", (1e-5, "10⁻⁵")),
        ([1e4], "1", (1e4, "10⁴")),
        ([9999.0], "1", (1.0, "1")),
        ([0.01], "1", (1.0, "1")),
        ([0.0099], "1", (1e-3, "10⁻³")),
        ([0.0], "1", (1.0, "1")),
        ([], "m", (1.0, "m")),
        ([-2e-3], "m", (1e-3, "mm")),
    ],
)
def test_an_axis_of_plain_numbers_far_from_one_has_a_power(
    values: list[float], units: str, unit: tuple[float, str]
) -> None:
    assert axis_unit(values, units) == pytest.approx(unit)


def test_labels_tell_different_values_apart() -> None:
    assert labels([17.78279, 17.78281, "x"]) == ["17.78279", "17.78281", "x"]
    assert labels([17.7827941, 17.7827941]) == ["17.78", "17.78"]
    assert labels([1 / 3, 2 / 3]) == ["0.3333", "0.6667"]
    assert label(0.1000000000001) == "0.1"  # within 1e-12
    assert label(0.10000000001) == "0.10000000001"
    assert label(0.00012345678) == "0.0001235"  # no rounder with more digits
    assert label(1.00004) == "1.00004"


def test_the_unit_of_a_study_comes_first() -> None:
    attrs = {"units": "Pa", "study_unit": "kPa", "study_unit_size": 1e3}
    assert scaled_labels([5e3, 2e6], attrs) == (["5", "2000"], "kPa")
    assert scaled_labels([5e3, 2e6], {"units": "Pa"}) == (["0.005", "2"], "MPa")
    assert scaled_labels([0.5, 20.0], {"units": "Pa"}) == (["0.5", "20"], "Pa")


def test_the_strongest_proof_counts() -> None:
    flags = {"unique": 0, "global_minimum": 1, "strict_minimum": 1}
    assert proved(flags) == "global"
    assert proved({**flags, "unique": 1}) == "unique"
    assert proved({**flags, "global_minimum": 2}) == "local"  # 2: not judged
    assert proved(dict.fromkeys(flags, 0), none="–") == "–"
    assert (
        proved({f"solution_{name}": flag for name, flag in flags.items()}, "solution_") == "global"
    )
    assert digits_lost(1e-6) == digits_lost(float("nan")) == ""
    assert digits_lost(2e-6).startswith("λ₁ holds to 2e-06 only")


def test_a_verdict_begins_with_a_failure_and_leaves_out_what_is_empty() -> None:
    lines = [("Answer", "a"), ("Answer", "b"), ("Solved", "1 of 2 points"), ("Trust", "")]
    verdict = Verdict.of_lines(lines)
    assert verdict.lines == [("Answer", "a"), ("Answer", "b"), ("Solved", "1 of 2 points")]
    assert verdict.sentence == "A; b. 1 of 2 points."
    assert verdict.complete
    failed = Verdict(answer=("a",), solved=("s",), reason=("r",), fix=("",), complete=False)
    assert list(failed.fields) == ["solved", "reason", "answer"]
    assert not failed.complete
    assert render([failed]).startswith("  Solved    s\n  Reason    r\n")


def test_parts_are_a_blank_line_apart() -> None:
    text = "word " * 40
    rendered = render([Heading("Title", 1), Heading("Part"), text.strip(), "  block\n  of lines"])
    title, part, words, block = rendered.rstrip("\n").split("\n\n")
    assert (title, part, block) == ("Title", "Part\n────", "  block\n  of lines")
    lines = words.split("\n")
    assert 100 < len(lines[0]) <= 110
    assert all(line.startswith("  ") for line in lines[1:])


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
