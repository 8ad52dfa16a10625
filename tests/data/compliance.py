"""What the compliance checker says of a file, for the files that are not those of runs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest


def cf_faults(file: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> tuple[str, set[str]]:
    """The report of cf:1.11 if it found anything, and the names of checks that the checker itself stumbled in."""
    runner: Any = pytest.importorskip("compliance_checker.runner")
    runner.CheckSuite.load_all_available_checkers()
    report = folder / "report.txt"
    passed, _ = runner.ComplianceChecker.run_checker(
        ds_loc=str(file),
        checker_names=["cf:1.11"],
        verbose=0,
        criteria="strict",
        output_filename=str(report),
        output_format="text",
    )
    text = report.read_text() + "".join(capsys.readouterr())
    clean = passed and "All tests passed!" in text
    return "" if clean else text, set(re.findall(r"cf:1\.11\.(\w+)", text))
