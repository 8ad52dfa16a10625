"""Geometries of a sweep made and solved by workers: the same file to the bit, and nothing lost but what kills."""

from __future__ import annotations

import os
import signal
from collections.abc import Sequence
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from netgen import occ

from tcstudy.data.files import StoreError
from tcstudy.data.records import BlockRecord, LevelRecord, PointStatus
from tcstudy.executors import ProcessExecutor, SerialExecutor
from tcstudy.read.study import read_study, read_study_text
from tcstudy.study import workers as who
from tcstudy.study.append import mended
from tcstudy.study.run import LevelWork, Quiet, execute, run, solve_geometry
from tcstudy.study.workers import submit
from tests.benchmarks.kills import assert_same, children
from tests.executors.test_processes import CRUEL, gone
from tests.executors.test_processes import assert_same as assert_blocks

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
sweep: {parameters.s: [2, 1, 1.5, 1.2], E: [1, 2, 3]}
"""
"""With a body that is too short for its hole."""


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of one process."""
    path = tmp_path_factory.mktemp("alone") / "out.nc"
    execute(read_study_text(BARS), path, jobs=1)
    return path


class Watch(Quiet):
    """Counts what it is told, and may do something after so many blocks."""

    def __init__(self, after: int = 0, do: object = None) -> None:
        self.work: list[LevelWork] = []
        self.levels, self.points, self.blocks, self.after, self.do = 0, 0, 0, after, do

    def begin(self, work: Sequence[LevelWork]) -> None:
        self.work += work

    def level(self, record: LevelRecord, geometry: str = "") -> None:
        self.levels += 1

    def block(self, record: BlockRecord) -> None:
        self.points += len(record)
        self.blocks += 1
        if self.blocks == self.after and callable(self.do):
            self.do()


def workers() -> list[int]:
    """Worker processes of this one, or dask's nannies' of a local cluster."""
    found = {pid: Path(f"/proc/{pid}/cmdline").read_bytes() for pid in children(os.getpid())}
    return [pid for pid, words in found.items() if b"executors.worker" in words or b"spawn_main" in words]


def kill_one() -> None:
    os.kill(workers()[0], signal.SIGKILL)


@pytest.mark.parametrize("dask", [None, "local"])
def test_workers_write_the_file_of_one_process_though_one_is_killed(
    alone: Path, tmp_path: Path, dask: str | None
) -> None:
    if dask:
        pytest.importorskip("distributed", reason="dask.distributed is not installed: pip install 'tcstudy[dask]'")
    watch = Watch(2, kill_one)
    summary = execute(read_study_text(BARS), tmp_path / "out.nc", watch, jobs=2, dask=dask)
    assert (summary.points, summary.failed) == (24, 0)
    assert (watch.levels, watch.points, sum(work.points for work in watch.work)) == (8, 24, 24)
    assert_same(alone, tmp_path / "out.nc")
    assert [one.name for one in tmp_path.iterdir()] == ["out.nc"]


@pytest.mark.parametrize("what", ["kill", "exhaust"])
def test_a_geometry_that_kills_its_workers_is_told_and_the_rest_goes_on(
    alone: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    """What was told is solved by a run that mends the file."""
    pids, path = tmp_path / "pids", tmp_path / "out.nc"
    cruel = partial(ProcessExecutor, command=(CRUEL, what, "0.015", str(pids)))
    with monkeypatch.context() as patched:
        patched.setattr(who, "ProcessExecutor", cruel)
        summary = execute(read_study_text(BARS), path, jobs=2)
    assert (summary.points, summary.failed) == (24, 6)
    survives = what == "exhaust"  # every point of the geometry is told by itself
    assert len(set(pids.read_text().split())) == (1 if survives else 2)
    with xr.open_datatree(path) as tree:
        assert np.all(tree["status"].sel(s=1.5) == PointStatus.ERROR)
        assert np.all((tree["geometry"].sel(s=1.5) == -1) == (not survives))
        told = (
            "MemoryError: Unable to allocate" if survives else "WorkerDied: the worker process that solved this died: "
        )
        assert told in str(tree["reason"].sel(s=1.5).values[0, 0])
    study = read_study_text(BARS)
    execute(study, path, jobs=2, kept=mended(path, study))
    assert_same(alone, path)


def test_a_stopped_sweep_keeps_what_workers_brought(alone: Path, tmp_path: Path) -> None:
    pids: list[int] = []

    def stop() -> None:
        pids.extend(workers())
        raise KeyboardInterrupt

    path = tmp_path / "out.nc"
    with pytest.raises(KeyboardInterrupt):
        execute(read_study_text(BARS), path, Watch(3, stop), jobs=2)
    assert {"0.nc", "1.nc"} <= {one.name for one in (tmp_path / "out.nc.geometries").iterdir()}
    assert len(pids) == 2
    assert all(gone(pid) for pid in pids)
    again = Watch()
    execute(read_study_text(BARS), path, again, jobs=2)
    assert again.points <= 12
    assert_same(alone, path)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="file size limits are a matter of POSIX")
def test_a_disk_that_fills_costs_no_geometry_that_stands(alone: Path, tmp_path: Path) -> None:
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    path = tmp_path / "out.nc"

    def fill() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, hard))

    try:
        with pytest.raises(StoreError, match=r"Make room there"):
            execute(read_study_text(BARS), path, Watch(3, fill), jobs=2)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not path.exists()
    assert {"0.nc", "1.nc"} <= {one.name for one in (tmp_path / "out.nc.geometries").iterdir()}
    again = Watch()
    execute(read_study_text(BARS), path, again, jobs=2)
    assert again.points <= 12
    assert_same(alone, path)


def test_a_body_from_a_file_travels_as_its_content(tmp_path: Path) -> None:
    occ.Rectangle(2, 1).Face().WriteStep(str(tmp_path / "plate.step"))
    body = "{file: {path: plate.step, unit: m, edges: {bottom: [[1, 0]], left: [[0, 0.5]]}, other: free}}"
    text = f"""
units: none
body: {body}
boundary: {{bottom: contact, left: clamped, free: {{role: traction, g: [0.03, -0.01]}}}}
material: {{E: 1, nu: 0.3}}
friction: {{law: tresca, tau: 0.01}}
mesh: {{maxh: 0.4}}
"""
    (tmp_path / "study.yaml").write_text(text)
    study = read_study(tmp_path / "study.yaml")
    expected = [one for one in run(study) if isinstance(one, BlockRecord)]

    class Later(SerialExecutor):
        def submit(self, *call: Any) -> Future[Any]:
            (tmp_path / "plate.step").unlink()
            return super().submit(*call)

    found = submit(Later(), solve_geometry, study, name="plate").result()
    assert_blocks([one for one in found if isinstance(one, BlockRecord)], expected)
