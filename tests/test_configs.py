"""Every shipped study is read and planned without a fault."""

from __future__ import annotations

from pathlib import Path

import pytest

from tcstudy.read.study import read_study
from tests.commands import CONFIGS, tcstudy_command

SHIPPED = sorted(CONFIGS.glob("*.yaml"))


def test_there_are_some() -> None:
    assert {"quickstart.yaml", "convergence.yaml", "manufactured.yaml"} <= {path.name for path in SHIPPED}


@pytest.mark.parametrize("config", SHIPPED, ids=lambda path: path.stem)
def test_planned(config: Path, tmp_path: Path) -> None:
    study = read_study(config)
    points = len(study.scenes)
    said = tcstudy_command("run", config, "--dry-run", cwd=tmp_path)
    assert said.returncode == 0, said.stderr
    assert points > 0
    does = {"path": "  path along ", "fit": "  fit of "}.get(study.kind, f"{points} point")
    assert does in said.stdout
    assert " GB\n" in said.stdout
    assert not list(tmp_path.iterdir())
