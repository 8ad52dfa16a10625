"""How many workers pay, and what plan says of it."""

from __future__ import annotations

import pytest

from tcstudy.reports.terminal.forecast import expected_words
from tcstudy.study import workers
from tcstudy.study.sizes import Resources
from tests.verification.scenes import RECTANGLE, study_of

MANY = "sweep={friction.tau: {linspace: [0.01, 0.1, 100]}, E: {linspace: [1, 2, 100]}}"


@pytest.fixture(autouse=True)
def four_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "available", lambda: 4)


@pytest.mark.parametrize(
    ("changes", "asked", "expected"),
    [
        ((), None, 1),
        ((MANY,), None, 3),
        ((MANY,), 1, 1),
        ((), 2, 2),
        ((MANY, "solver=bundle-newton"), 2, 1),
        ((MANY, "mesh={maxh: 0.1, levels: 3, estimate: true}"), 2, 2),
    ],
)
def test_as_many_workers_as_pay(changes: tuple[str, ...], asked: int | None, expected: int) -> None:
    assert workers.for_blocks(study_of(RECTANGLE, *changes), 200, asked) == expected


def test_whole_calls_get_the_workers_that_pay_and_have_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    each = [Resources(5.0, 1e9)] * 10
    assert workers.for_calls(each, None) == 4
    assert workers.for_calls(each, None, start=20.0) == 2
    assert workers.for_calls(each[:1], None) == workers.for_calls([], 8) == 1
    monkeypatch.setattr(workers, "_memory", lambda: 7e9)
    assert workers.for_calls(each, None) == 3
    assert workers.for_calls(each, 6) == 6


def test_a_forecast_says_what_workers_take_off() -> None:
    """A hundred seconds, of which eighty are shared: 20 + 80/4 pass."""
    told = Resources(100.0, 1e9, shared=80.0, workers=4, worker_memory=0.25e9)
    assert told.wall == 40.0
    assert expected_words(told) == "about 1 min 40 s of CPU time, 40 s on 5 cores, about 2 GB"
