"""Every shipped study is read and planned without a fault."""

from __future__ import annotations

from pathlib import Path

import pytest

from tcstudy.read.study import read_study
from tcstudy.study.plan import plan
from tests.test_cli import CONFIGS

SHIPPED = sorted(CONFIGS.glob("*.yaml"))


def test_there_are_some() -> None:
    assert {"quickstart.yaml", "convergence.yaml", "manufactured.yaml"} <= {path.name for path in SHIPPED}


@pytest.mark.parametrize("config", SHIPPED, ids=lambda path: path.stem)
def test_planned(config: Path) -> None:
    study = read_study(config)
    forecast = plan(study)
    assert forecast.points == len(study.scenes) > 0
    assert forecast.bytes > 0
