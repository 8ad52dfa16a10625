"""`tcstudy init`: what a newcomer starts from."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tcstudy.cli import main


def test_the_starter_is_planned_and_solved(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study = tmp_path / "first.yaml"
    assert main(["init", str(study)]) == 0
    assert f"{study} written" in capsys.readouterr().out
    assert study.read_text(encoding="utf-8").startswith("# yaml-language-server: $schema=study.schema.json\n")
    assert json.loads((tmp_path / "study.schema.json").read_text(encoding="utf-8"))["title"] == "A study of tcstudy"
    assert main(["run", str(study), "--dry-run"]) == 0
    assert main(["run", str(study), "--output", str(tmp_path / "out.nc"), "--set", "mesh.levels=2"]) == 0
    assert "12 of 12 solutions found" in capsys.readouterr().out


def test_init_keeps_what_is_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study, schema = tmp_path / "study.yaml", tmp_path / "study.schema.json"
    study.write_text("mine")
    schema.write_text("mine too")
    with pytest.raises(SystemExit) as stop:
        main(["init", str(study)])
    assert stop.value.code == 2
    assert "is there already, and is kept; name another file" in capsys.readouterr().err
    assert main(["init", str(tmp_path / "other.yaml")]) == 0
    assert (study.read_text(), schema.read_text()) == ("mine", "mine too")
    with pytest.raises(SystemExit) as stop:
        main(["init", str(tmp_path / "none" / "study.yaml")])
    assert stop.value.code == 2
