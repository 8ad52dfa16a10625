"""Studies spoilt at random are planned or refused in clear lines; `python -m tests.benchmarks.mutated` tries more."""

from __future__ import annotations

from tests.benchmarks.mutated import sources, survey

SEEDS = range(10_000, 10_100)


def test_no_spoilt_study_ends_in_a_traceback() -> None:
    assert len(sources()) > 5
    said: list[str] = []
    counts = survey(SEEDS, said.append)
    assert counts["badly ended"] == 0, "\n".join(said)
    assert counts["planned"] > 5  # the generator spoils neither all nor nothing
    assert counts["refused"] > 50
