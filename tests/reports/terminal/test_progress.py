"""What a run shows: plain lines in a pipe, a bar that weighs finer levels more on a terminal."""

from __future__ import annotations

import io
import tempfile
from pathlib import Path

import numpy as np
import pytest

from tcstudy.data.records import BlockRecord, PointStatus
from tcstudy.read.study import read_study_text
from tcstudy.reports.terminal.progress import PlainProgress, TerminalProgress
from tcstudy.study.execute import execute
from tcstudy.study.run import LevelWork
from tests.data.by_points import PointRecord, block_of
from tests.study.test_variants import HOLED

WORK = [LevelWork(2, 1, 1.0), LevelWork(2, 0, 4.0)]


def record(level: int, status: PointStatus, reason: str = "why") -> BlockRecord:
    point = PointRecord((0,), level, status, reason, {}, np.empty(0), np.empty(0))
    return block_of((point,), (1,))


@pytest.mark.parametrize("kind", [PlainProgress, TerminalProgress])
def test_only_failures_are_lines(kind: type[PlainProgress] | type[TerminalProgress]) -> None:
    stream = io.StringIO()
    progress = kind(stream, lambda index: f"alpha = {index[0]}")
    progress.begin(WORK)
    progress.block(record(0, PointStatus.OK))
    progress.block(record(1, PointStatus.NOT_CONVERGED))
    progress.close()
    text = stream.getvalue()
    assert "alpha = 0 on level 1: not converged: why" in text
    assert "level 0: " not in text


@pytest.mark.parametrize("kind", [PlainProgress, TerminalProgress])
def test_failures_that_differ_in_numbers_have_one_line(kind: type[PlainProgress] | type[TerminalProgress]) -> None:
    stream = io.StringIO()
    progress = kind(stream)
    progress.begin(WORK)
    for residual in ("3.1e-9", "2e-07", "4"):
        progress.block(record(1, PointStatus.INCLUSION_VIOLATED, f"residual {residual}; coarsen"))
    progress.block(record(1, PointStatus.NOT_CONVERGED, "no solution; /srv/someone/part.step"))
    progress.close()
    progress.close()
    text = stream.getvalue()
    assert text.count("; coarsen") == 1
    assert text.count("2 more failed for the same reasons") == 1
    assert "someone" not in text


def test_the_bar_weighs_levels() -> None:
    progress = TerminalProgress(io.StringIO())
    progress.begin(WORK)
    task = progress._progress.tasks[0]
    assert (task.total, task.completed, task.fields["points"]) == (10.0, 1.0, "1/4")
    progress.block(record(1, PointStatus.OK))
    assert (task.completed, task.fields["points"], task.fields["failed"]) == (5.0, "2/4", "")
    progress.block(record(1, PointStatus.NOT_CONVERGED))
    assert (task.completed, task.fields["points"], task.fields["failed"]) == (9.0, "3/4", ", 1 failed")
    progress.close()


@pytest.mark.parametrize("kind", [PlainProgress, TerminalProgress])
def test_a_geometry_is_named(kind: type[PlainProgress] | type[TerminalProgress]) -> None:
    """Of a real sweep, whose first geometry has no mesh: it is told after the beginning."""
    stream = io.StringIO()
    progress = kind(stream)
    with tempfile.TemporaryDirectory() as folder:
        execute(read_study_text(HOLED), Path(folder) / "out.nc", progress)
    if isinstance(progress, TerminalProgress):
        assert progress._progress.tasks[0].description.startswith("parameters.height = 30 mm, level 0")
    else:
        lines = stream.getvalue().splitlines()
        assert lines[0] == "3 points on 1 level: 3 solutions"
        assert "mesh failed: body.holes[0]: the hole touches" in lines[1]
        assert lines[1].endswith("; keep holes inside, or draw the outline around the notch")
        named = [f"parameters.height = {height} mm, level 0: h" for height in (20, 30)]
        assert [line.partition("_max")[0] for line in lines[2:]] == named
    progress.close()
