"""Who works: as many workers as pay; geometries made and solved by workers give the file of one
process to the bit."""

import os
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from netgen import occ

from tcstudy.data.records import BlockRecord, LevelRecord
from tcstudy.data.schema import PointStatus
from tcstudy.executors.processes import ProcessExecutor, SerialExecutor, WorkersFailed
from tcstudy.read.study import read_study, read_study_text
from tcstudy.study import workers as who
from tcstudy.study.history_run import execute_history
from tcstudy.study.run import LevelWork, execute, run, solve_geometry
from tcstudy.study.stored import Kept
from tcstudy.study.workers import Resources, submit
from tests.benchmarks.kills import assert_same, children
from tests.executors.test_processes import CRUEL
from tests.executors.test_processes import assert_same as assert_blocks
from tests.verification.scenes import RECTANGLE, study_of

MANY = "sweep={friction.tau: {linspace: [0.01, 0.1, 100]}, E: {linspace: [1, 2, 100]}}"


@pytest.fixture
def four_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(who, "available", lambda: 4)


@pytest.mark.parametrize(
    ("changes", "asked", "expected"),
    [
        ((), None, 1),
        ((MANY,), None, 3),
        ((MANY,), 1, 1),
        ((), 2, 2),
        ((MANY, "solver=bundle-newton"), 2, 1),
        ((MANY, "mesh={maxh: 0.1, levels: 3, estimate: true}"), 2, 2),
    ],
)
@pytest.mark.usefixtures("four_processors")
def test_as_many_workers_as_pay(changes: tuple[str, ...], asked: int | None, expected: int) -> None:
    assert who.block_workers(study_of(RECTANGLE, *changes), 200, asked) == expected


@pytest.mark.usefixtures("four_processors")
def test_whole_calls_get_the_workers_that_pay_and_have_memory(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    each = [Resources(5.0, 1e9)] * 10
    assert who.call_workers(each, None) == 4
    assert who.call_workers(each, None, start=20.0) == 2
    assert who.call_workers(each[:1], None) == who.call_workers([], 8) == 1
    monkeypatch.setattr(who, "_memory", lambda: 7e9)
    assert who.call_workers(each, None) == 3
    assert who.call_workers(each, 6) == 6


BARS = """
units: none
parameters: {s: 1}
body:
  rectangle: {width: "s", height: 0.5}
  holes: [circle: {center: [0.5, 0.25], radius: 0.1, edge: bore}]
boundary: {bottom: contact, left: clamped, right: free, top: {role: traction, g: [0.03, -0.01]}, bore: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: "0.01*s"}
mesh: {maxh: 0.2, levels: 2}
sweep: {parameters.s: [2, 1, 1.5], E: [1, 2, 3]}
"""
"""With a body that is too short for its hole."""


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of one process."""
    path = tmp_path_factory.mktemp("alone") / "out.nc"
    execute(read_study_text(BARS), path, jobs=1)
    return path


class Watch:
    """Counts what it is told, and does something after so many blocks."""

    def __init__(self, after: int, do: Callable[[], None]) -> None:
        self.work: list[LevelWork] = []
        self.levels, self.points, self.blocks, self.after, self.do = 0, 0, 0, after, do

    def begin(self, work: Sequence[LevelWork]) -> None:
        self.work += work

    def level(self, record: LevelRecord, geometry: str = "") -> None:
        self.levels += 1

    def block(self, record: BlockRecord) -> None:
        self.points += len(record)
        self.blocks += 1
        if self.blocks == self.after:
            self.do()


def test_workers_write_the_file_of_one_process_though_one_is_killed(
    alone: Path, tmp_path: Path
) -> None:
    def kill() -> None:
        own = (
            pid
            for pid in children(os.getpid())
            if b"executors.worker" in Path(f"/proc/{pid}/cmdline").read_bytes()
        )
        os.kill(next(own), signal.SIGKILL)

    watch = Watch(2, kill)
    summary = execute(read_study_text(BARS), tmp_path / "out.nc", watch, jobs=2)
    assert (summary.points, summary.failed) == (18, 0)
    assert (watch.levels, watch.points, sum(work.points for work in watch.work)) == (6, 18, 18)
    assert_same(alone, tmp_path / "out.nc")
    assert [one.name for one in tmp_path.iterdir()] == ["out.nc"]


def test_a_geometry_that_kills_its_workers_is_told_and_the_rest_goes_on(
    alone: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was told is solved by a run that mends the file."""
    pids, path, study = tmp_path / "pids", tmp_path / "out.nc", read_study_text(BARS)
    with monkeypatch.context() as patched:
        patched.setattr(
            who,
            "ProcessExecutor",
            partial(ProcessExecutor, command=(CRUEL, "kill", "0.015", str(pids))),
        )
        summary = execute(study, path, jobs=2)
    assert (summary.points, summary.failed) == (18, 6)
    assert len(set(pids.read_text().split())) == 2
    with xr.open_datatree(path) as tree:
        assert np.all(tree["status"].sel(s=1.5) == PointStatus.ERROR)
        assert np.all(tree["geometry"].sel(s=1.5) == -1)
        told = str(tree["reason"].sel(s=1.5).values[0, 0])
    assert told.startswith("WorkerDied: the worker process that solved this died: ")
    execute(study, path, jobs=1, kept=Kept.of(path, study, study))
    assert_same(alone, path)


def test_a_long_history_is_not_taken_for_one_that_hangs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker may take many times what its steps are expected to take, though that be hours."""
    allowed = list[float]()

    class Asked(SerialExecutor):
        def submit(self, call: Any, *given: Any) -> Future[Any]:
            allowed.append(call.timeout)
            raise WorkersFailed("asked")

    monkeypatch.setattr(who.WorkerPool, "executor_of_calls", lambda *_: Asked())
    steps = "history={memory: friction, steps: [{f_x: 0.1, in: 50000}]}"
    for number in ("50000", "5"):
        study = study_of(RECTANGLE, steps.replace("50000", number), "loads.f=[0, 0]")
        with pytest.raises(WorkersFailed, match="asked"):
            execute_history(study, tmp_path / "out.nc", force=True)
    assert allowed[0] > 10 * allowed[1] > 0


def test_a_body_from_a_file_travels_as_its_content(tmp_path: Path) -> None:
    occ.Rectangle(2, 1).Face().WriteStep(str(tmp_path / "plate.step"))
    (tmp_path / "study.yaml").write_text(RECTANGLE)
    body = (
        "body={file: {path: plate.step, edges: {bottom: [[1, 0]], left: [[0, 0.5]]}, other: free}}"
    )
    roles = "boundary={bottom: contact, left: clamped, free: {role: traction, g: [0.03, -0.01]}}"
    study = read_study(tmp_path / "study.yaml", [body, roles, "mesh={maxh: 0.4}"])
    expected = [one for one in run(study) if isinstance(one, BlockRecord)]

    class Later(SerialExecutor):
        def submit(self, *call: Any) -> Future[Any]:
            (tmp_path / "plate.step").unlink()
            return super().submit(*call)

    found = submit(Later(), solve_geometry, study, name="plate").result()
    assert_blocks([one for one in found if isinstance(one, BlockRecord)], expected)
