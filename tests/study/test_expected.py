"""Time and memory to expect: more for more, and near what was measured."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import pytest

from tcstudy.read.study import read_study
from tcstudy.study import expected
from tcstudy.study.jobs import LevelForecast

CONFIG = Path(__file__).parents[2] / "configs" / "quickstart.yaml"


@pytest.fixture(autouse=True)
def usual_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(expected, "slowness", lambda: 1.0)
    monkeypatch.setattr(expected, "triangles_a_second", lambda: 10_000.0)


def test_the_stages_of_the_speed_benchmark() -> None:
    """N = 939,518 takes 13.3 s from mesh to loads in results/speed.md, N = 59,006 takes 0.60 s."""
    for n_dof, seconds in ((939_518, 13.3), (59_006, 0.60)):
        assert expected._level(n_dof, 1, True) - expected.LEVEL == pytest.approx(seconds, rel=0.25)


def test_more_work_takes_longer_and_more_memory() -> None:
    study = read_study(CONFIG)
    small = [LevelForecast(0.02, 100, 203, 13)]
    large = [*small, LevelForecast(0.01, 50_000, 1e5, 300)]  # type: ignore[arg-type]
    one, two = expected.of_run(study, small, 1, 9), expected.of_run(study, large, 1, 9)
    assert expected.START < one.seconds < 10.0
    assert two.seconds > one.seconds
    assert two.memory - one.memory > 1e8
    assert expected.of_run(study, large, 5, 9).seconds > two.seconds
    listed = replace(study, mesh=replace(study.mesh, maxh=(0.02, 0.01)))
    dear = expected.of_run(listed, large, 1, 9).seconds
    assert dear > two.seconds
    coarser = replace(listed, mesh=replace(listed.mesh, refine=2))  # Netgen makes a sixteenth of the triangles
    assert dear - expected.of_run(coarser, large, 1, 9).seconds == pytest.approx(15 / 16 * 100_200 / 1e4)
    chart = [expected.of_cost(study, small, True, runs, 2).seconds for runs in (1, 5)]
    assert one.seconds < chart[0] < chart[1]


def test_the_probe_ends_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    expected.slowness.cache_clear()
    begin = time.process_time()
    assert expected.slowness() > 0.0
    assert time.process_time() - begin < 5.0
