"""How many workers pay, and what plan says of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tcstudy import cli
from tcstudy.study import jobs
from tests.verification.scenes import RECTANGLE, study_of

MANY = "sweep={friction.tau: {linspace: [0.01, 0.1, 100]}, E: {linspace: [1, 2, 100]}}"


@pytest.fixture(autouse=True)
def four_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jobs, "available", lambda: 4)


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
    assert jobs.workers(study_of(RECTANGLE, *changes), 200, asked) == expected


def test_plan_says_who_solves(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "study.yaml"
    file.write_text(RECTANGLE)
    assert cli.main(["plan", str(file)]) == 0
    assert "worker processes" not in capsys.readouterr().out
    assert cli.main(["plan", str(file), "--jobs", "2"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "contact problems solved by 2 worker processes (--jobs), or by those of a scheduler (--dask)" in said


def test_a_number_of_jobs_is_one_or_more(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        cli.main(["run", "study.yaml", "--jobs", "0"])
    assert "--jobs: 0 is no number of processes; give 1 or more" in capsys.readouterr().err
