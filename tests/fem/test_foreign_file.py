"""Geometry files that make the kernel hang or crash cost a child process, not this one."""

from __future__ import annotations

from pathlib import Path

import pytest
from netgen import occ

from tcstudy.fem import foreign_file
from tcstudy.fem.foreign_file import file_fault

HANGS = """DBRep_DrawableShape

CASCADE Topology V1, (c) Matra-Datavision
Locations 0
Curve2ds 2000000000
1 0 0 1 0
"""


def test_a_file_that_keeps_the_kernel_busy_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(foreign_file, "SECONDS", 1.0)
    bad = tmp_path / "a.brep"
    bad.write_text(HANGS)
    fault = file_fault(bad)
    assert fault is not None
    assert "did not finish reading it within" in fault


def test_a_sound_file_is_sound_and_judged_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    good = tmp_path / "plate.step"
    occ.Rectangle(2, 1).Face().WriteStep(str(good))
    assert file_fault(good) is None
    monkeypatch.setattr(foreign_file.subprocess, "run", None)
    assert file_fault(good) is None


def test_a_file_that_makes_the_child_crash_is_named_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "b.brep"
    file.write_text(HANGS)
    monkeypatch.setattr(foreign_file, "PROGRAM", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    assert file_fault(file) == "the geometry kernel crashes on it"


@pytest.mark.parametrize("text", ["", "hello", "DBRep_DrawableShape\n"])
def test_a_file_without_a_shape_is_no_traceback(text: str, tmp_path: Path) -> None:
    file = tmp_path / "c.brep"
    file.write_text(text)
    fault = file_fault(file)
    assert fault is not None
    assert "\n" not in fault
