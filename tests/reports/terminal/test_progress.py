"""What a run shows: plain lines in a pipe, one line with the time left on a terminal, finer levels
for more."""

import io

import pytest

from tcstudy.data.records import BlockRecord
from tcstudy.data.schema import PointStatus
from tcstudy.reports.terminal.progress import Progress
from tcstudy.study.run import LevelWork
from tests.data.by_points import PointRecord, block_of
from tests.verification.scenes import RECTANGLE, study_of

WORK = [LevelWork(2, 1, 1.0), LevelWork(2, 0, 4.0)]


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def record(level: int, status: PointStatus, reason: str = "why") -> BlockRecord:
    return block_of(PointRecord((0,), level, status, reason, {}), (1,))


@pytest.mark.parametrize("stream", [io.StringIO, Terminal])
def test_failures_that_differ_in_numbers_have_one_line(stream: type[io.StringIO]) -> None:
    progress = Progress(study_of(RECTANGLE, "sweep={tau: [0.01, 0.02]}"), shown := stream())
    progress.begin(WORK)
    progress.block(record(0, PointStatus.OK))
    for residual in ("3.1e-9", "2e-07", "4"):
        progress.block(record(1, PointStatus.INCLUSION_VIOLATED, f"residual {residual}; coarsen"))
    progress.block(record(1, PointStatus.NOT_CONVERGED, "no solution; /srv/someone/part.step"))
    progress.close()
    progress.close()
    text = shown.getvalue()
    assert "tau = 0.01 on level 1: inclusion violated: residual 3.1e-9; coarsen\n" in text
    assert text.count("; coarsen") == text.count("2 more failed for the same reasons") == 1
    assert "someone" not in text
    assert ("\r" in text) == (stream is Terminal)


def test_the_line_weighs_levels() -> None:
    progress = Progress(study_of(RECTANGLE, "sweep={tau: [0.01, 0.02]}"), shown := Terminal())
    progress.begin(WORK)
    for done in (record(1, PointStatus.OK), record(1, PointStatus.NOT_CONVERGED)):
        progress.block(done)
    lines = [line.rstrip() for line in shown.getvalue().split("\r") if "solutions" in line]
    assert lines[0].startswith(f"{'█' * 15}{'░' * 15} 2 of 4 solutions, ")
    assert lines[1].startswith(f"{'█' * 27}{'░' * 3} 3 of 4 solutions, 1 failed, ")
    assert lines[0].endswith(" solutions, 0 s left")
