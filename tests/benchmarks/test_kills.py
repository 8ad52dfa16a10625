"""Random kills of workers and of the run itself lose nothing; `python -m tests.benchmarks.kills` does it more often."""

from __future__ import annotations

from pathlib import Path

from tests.benchmarks.kills import survive


def test_random_kills_lose_nothing(tmp_path: Path) -> None:
    done = survive(tmp_path, kills=3, seed=3, points=80)
    assert done.workers + done.runs == 3
    assert done.workers > 0
    assert done.runs > 0
