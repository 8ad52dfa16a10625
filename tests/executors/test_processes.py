"""Worker processes: the same numbers to the bit, and nothing lost but the point that does it."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tcstudy.data.records import BlockRecord
from tcstudy.data.schema import PointStatus
from tcstudy.errors import GeometryFailed
from tcstudy.executors.processes import (
    Job,
    ProcessExecutor,
    SerialExecutor,
    WorkerDied,
    WorkersFailed,
    in_order,
)
from tcstudy.scene.study import Study
from tcstudy.study import level_solver
from tcstudy.study.run import execute, run
from tests.executors.cruel import harm, treat
from tests.verification.scenes import RECTANGLE, study_of

SWEPT = RECTANGLE + "\nsweep: {friction.tau: [0.005, 0.01, 0.02, 0.03]}\n"
TAU = 0.01
CRUEL = str(Path(__file__).with_name("cruel.py"))
ARRAYS = ("points", "status", "u_T", "xi", "sticks")


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(level_solver, "MAX_POINTS", 2)


@pytest.fixture(scope="module")
def pool() -> Iterator[ProcessExecutor]:
    with ProcessExecutor(2) as workers:
        yield workers


def solved(study: Study, executor: SerialExecutor) -> list[BlockRecord]:
    records = run(study, executor=lambda study, m: executor)
    return [record for record in records if isinstance(record, BlockRecord)]


def assert_same(some: list[BlockRecord], others: list[BlockRecord]) -> None:
    """Equal to the bit, times aside."""
    assert [(b.level, b.points[0]) for b in some] == [(b.level, b.points[0]) for b in others]
    for a, b in zip(some, others, strict=True):
        assert all(np.array_equal(getattr(a, name), getattr(b, name)) for name in ARRAYS)
        assert a.reasons == b.reasons
        assert a.numbers.keys() == b.numbers.keys()
        for name, values in a.numbers.items():
            assert name.startswith("time_") or np.array_equal(
                values, b.numbers[name], equal_nan=True
            ), name


@pytest.mark.parametrize(
    "changes",
    [
        ("solver={name: separable-newton, branch: continued}",),
        ("sweep={nu: [0.2, 0.3], E: [1, 2, 3]}", "output={fields: true}"),
        ("mesh={maxh: 0.5, levels: 2, family: adaptive}",),
    ],
)
def test_workers_find_the_same_to_the_bit(pool: ProcessExecutor, changes: tuple[str, ...]) -> None:
    study = study_of(SWEPT.replace("maxh: 0.1, levels: 3", "maxh: 0.25, levels: 2"), *changes)
    assert_same(solved(study, pool), solved(study, SerialExecutor()))


READY = "import tests.executors.cruel; from tcstudy.executors.worker import main; main()"
"""A worker that needs no time for imports when it is asked, on however busy a machine."""


@pytest.mark.parametrize(
    ("what", "words"),
    [("kill", "signal SIGKILL, perhaps for want of memory"), ("hang", "no answer within 1.5 s")],
)
def test_a_call_whose_worker_dies_is_tried_once_more_and_then_told(
    tmp_path: Path, what: str, words: str
) -> None:
    """And takes nothing along: the calls before and after it are answered, those of other workers
    too."""
    once, always = tmp_path / "once", tmp_path / "always"
    with ProcessExecutor(2, command=("-c", READY)) as workers:
        around = [workers.submit(divmod, i, 3) for i in range(6)]
        mended, lost = (
            workers.submit(Job(treat, "", 1.5), what, seen, seen == once) for seen in (once, always)
        )
        around += [workers.submit(divmod, i, 3) for i in range(6, 12)]
        assert mended.result() == int(once.read_text().split()[1])
        with pytest.raises(
            WorkerDied, match=f"^the worker process that solved this died: {words}$"
        ):
            lost.result()
        assert [call.result() for call in around] == [divmod(i, 3) for i in range(12)]
    assert len(set(once.read_text().split())) == len(set(always.read_text().split())) == 2


def test_what_a_call_raises_arrives(pool: ProcessExecutor) -> None:
    """As it was, with its keys, or in words where it cannot be packed; the worker stays."""
    with pytest.raises(GeometryFailed, match="no such body") as fault:
        pool.submit(harm, "fault").result()
    assert fault.value.keys == ("body", "file")
    with pytest.raises(RuntimeError, match="Stubborn: 1 and 2"):
        pool.submit(harm, "stubborn").result()
    with pytest.raises(MemoryError):
        pool.submit(harm, "exhaust").result()
    with pytest.raises(ZeroDivisionError):
        list(pool.map(divmod, [1, 2], [1, 0]))


def test_no_more_calls_are_under_way_than_the_executor_likes() -> None:
    sent: list[int] = []

    class Three(SerialExecutor):
        ahead = 3  # type: ignore[assignment]

    found = list[tuple[int, int]]()
    for answer in in_order(
        Three(), (sent.append(i) or Three().submit(divmod, i, 2) for i in range(9))
    ):  # type: ignore[func-returns-value]
        found.append(answer.result())
        assert len(sent) - len(found) <= 3
    assert found == [divmod(i, 2) for i in range(9)]


def test_a_point_that_kills_its_workers_is_recorded_and_the_rest_goes_on(tmp_path: Path) -> None:
    study = study_of(SWEPT, "mesh.levels=1")
    with ProcessExecutor(2, command=(CRUEL, "kill", str(TAU), str(tmp_path / "pids"))) as workers:
        found = solved(study, workers)
    [bad] = [block for block in found if 1 in block.points]
    assert (bad.points.tolist(), bad.status.tolist()) == ([1], [PointStatus.ERROR])
    assert "signal SIGKILL" in bad.reasons[0]
    assert len((tmp_path / "pids").read_text().split()) == 4  # block: 2, point: 2
    expected = solved(study, SerialExecutor())
    assert_same(found[2:], expected[1:])
    assert found[0].u_T is not None
    assert expected[0].u_T is not None
    np.testing.assert_allclose(found[0].u_T[0], expected[0].u_T[0], rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("warm", [False, True])
def test_workers_that_never_start_end_the_run(warm: bool) -> None:
    never = ("-c", "raise SystemExit(3)")
    with (
        pytest.raises(WorkersFailed, match=r"exit code 3.*--jobs 1"),
        ProcessExecutor(2, command=never) as workers,
    ):
        solved(study_of(SWEPT, "mesh.levels=1"), workers.warm() if warm else workers)


LONG = """
import signal, sys
from functools import partial
from pathlib import Path
signal.signal(signal.SIGINT, signal.default_int_handler)  # a parent in the background hands down one that is ignored
from tcstudy.read.study import read_study
from tcstudy.study import level_solver, workers
from tcstudy.study.run import execute
level_solver.MAX_POINTS = 2
workers.ProcessExecutor = partial(workers.ProcessExecutor, command=tuple(sys.argv[3:]))
class Watch:
    def begin(self, work): ...
    def level(self, record, geometry): ...
    def block(self, record): print("block", flush=True)
try:
    execute(read_study(Path(sys.argv[1])), Path(sys.argv[2]), Watch(), jobs=2)
except KeyboardInterrupt:
    sys.exit(130)
"""


@pytest.mark.parametrize("kill", [signal.SIGINT, signal.SIGKILL])
def test_an_interrupted_run_leaves_its_points_and_no_workers(
    tmp_path: Path, kill: signal.Signals
) -> None:
    """The last block hangs; what was solved before stays, and the run goes on from there to the
    same numbers."""
    file, output, pids = tmp_path / "study.yaml", tmp_path / "out.nc", tmp_path / "pids"
    file.write_text(text := SWEPT.replace("levels: 3", "levels: 1"))
    words = [sys.executable, "-c", LONG, str(file), str(output), CRUEL, "hang", "0.03", str(pids)]
    parent = subprocess.Popen(words, start_new_session=True, stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    try:
        assert (
            parent.stdout.readline() == "block\n"
        )  # the first, which the other worker has, is solved and safe
        deadline = time.monotonic() + 120
        while not pids.exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        os.killpg(parent.pid, kill) if kill == signal.SIGINT else parent.send_signal(kill)
        assert parent.wait(30) in (-kill, 130)
        assert all(gone(int(pid)) for pid in pids.read_text().split())
    finally:  # no child outlives the test
        parent.kill()
        parent.communicate()
    assert (tmp_path / "out.nc.partial").exists()
    summary = execute(study_of(text), output)
    assert (summary.resumed, summary.failed) == (2, 0)


def gone(pid: int) -> bool:
    """Whether a process has ended, or does so soon."""
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline:
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    return False
