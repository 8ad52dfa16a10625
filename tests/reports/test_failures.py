"""Failures in few lines: what belongs together, the range of what differs, an example, a remedy."""

from __future__ import annotations

from tcstudy.data.records import PointStatus
from tcstudy.reports.failures import Failure, failure_lines, kind

BAD, ERROR = PointStatus.INCLUSION_VIOLATED, PointStatus.ERROR


def missed(residual: str, point: str, iterations: int = 30) -> Failure:
    return Failure(BAD, f"residual {residual} after {iterations} steps; raise solver.tolerance", point)


def test_numbers_that_differ_become_a_range() -> None:
    lines = failure_lines([missed("2e-07", "E = 1"), missed("3.0e-09", "E = 2"), missed("4e-8", "E = 3")])
    assert lines == [
        "3 solutions failed: inclusion violated: residual 3.0e-09 to 2e-07 after 30 steps; raise solver.tolerance "
        "(for example E = 1)"
    ]


def test_one_point_is_no_plural() -> None:
    assert failure_lines([missed("2e-07", "E = 1")]) == [
        "1 solution failed: inclusion violated: residual 2e-07 after 30 steps; raise solver.tolerance (E = 1)"
    ]


def test_other_words_and_other_statuses_are_other_lines_the_most_frequent_first() -> None:
    failures = [
        Failure(ERROR, "residual 1 after 30 steps; raise solver.tolerance", "a"),
        Failure(BAD, "the limit of 300 is reached; allow more", "b"),
        Failure(BAD, "the limit of 400 is reached; allow more", "c"),
        missed("1", "d"),
    ]
    lines = failure_lines(failures)
    assert [line.split(":")[0] for line in lines] == ["2 solutions failed", "1 solution failed", "1 solution failed"]
    assert "the limit of 300 to 400 is reached" in lines[0]


def test_digits_of_a_name_are_no_number() -> None:
    assert kind(BAD, "edge_1 of u₂ at 5") == kind(BAD, "edge_1 of u₂ at -7.5e+3")
    assert kind(BAD, "edge_1 is bad") != kind(BAD, "edge_2 is bad")


def test_a_reason_without_a_remedy_gets_one_and_nothing_of_the_machine_is_shown() -> None:
    line = failure_lines([Failure(ERROR, "OSError: cannot read /home/someone/deep/part.step; x", "alpha = 1")])[0]
    assert "someone" not in line
    assert "part.step" in line
    assert "run the study again" in line
    assert "coarsen the mesh" in failure_lines([Failure(BAD, "", "a")])[0]
