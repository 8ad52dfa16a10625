"""A dask scheduler and two workers as processes of this machine: the same numbers to the bit, and nothing lost."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from tcstudy.data.records import BlockRecord, PointStatus
from tcstudy.executors import Cluster, Here, WorkersFailed
from tcstudy.study import workshop
from tcstudy.study.execute import execute
from tcstudy.study.run import run
from tests.executors.test_processes import CRUEL, SWEPT, TAU, assert_same, gone, solved
from tests.verification.scenes import study_of

pytest.importorskip("distributed", reason="dask.distributed is not installed: pip install 'tcstudy[dask]'")

MANY = SWEPT.replace("[0.005, 0.01, 0.02, 0.03]", "{linspace: [0.005, 0.03, 40]}").replace("levels: 3", "levels: 1")
QUIET = {**os.environ, "DASK_DISTRIBUTED__LOGGING__DISTRIBUTED": "critical", "OPENBLAS_NUM_THREADS": "1"}


@dataclass
class Machines:
    """A scheduler and its workers, which have no nanny: who is killed stays dead."""

    folder: Path
    port: int
    alive: list[subprocess.Popen[bytes]] = field(default_factory=list)

    @property
    def address(self) -> str:
        return f"tcp://127.0.0.1:{self.port}"

    def start(self, command: str, *words: str) -> subprocess.Popen[bytes]:
        line = [sys.executable, "-m", "dask", command, *words]
        with (self.folder / f"{command}.log").open("ab") as log:
            process = subprocess.Popen(line, env=QUIET, cwd=self.folder, stdout=log, stderr=log)
        self.alive.append(process)
        return process

    def scheduler(self) -> subprocess.Popen[bytes]:
        return self.start("scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard")

    def worker(self) -> subprocess.Popen[bytes]:
        words = ("--no-nanny", "--nthreads", "1", "--memory-limit", "0", "--no-dashboard")
        return self.start("worker", self.address, *words, "--local-directory", str(self.folder))

    def end(self) -> None:
        for process in reversed(self.alive):
            process.kill()
            process.wait()


@pytest.fixture
def machines(tmp_path: Path) -> Iterator[Machines]:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    found = Machines(tmp_path, port)
    try:
        yield found
    finally:
        found.end()


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workshop, "POINTS", 2)


def test_a_killed_worker_changes_no_bit_and_a_point_that_kills_is_told(machines: Machines, tmp_path: Path) -> None:
    """One cluster for all that it must stand: a machine that goes, a point that kills, a scheduler that goes."""
    scheduler, first, _ = machines.scheduler(), machines.worker(), machines.worker()
    cluster, study = Cluster(machines.address, connect=60.0), study_of(MANY)
    expected = solved(study, Here())
    try:
        seen: list[BlockRecord] = []
        for record in run(study, executor=lambda study, m: cluster):
            if isinstance(record, BlockRecord):
                seen.append(record)
                if len(seen) == 3:
                    first.kill()
        assert_same(seen, expected)
    finally:
        cluster.close()

    pids = tmp_path / "pids"
    cluster = Cluster(machines.address, worker=(CRUEL, "kill", str(TAU), str(pids)), connect=2.0)
    try:
        blocks = solved(study_of(SWEPT, "mesh.levels=1"), cluster)
        row = int(np.flatnonzero(blocks[0].points == 1)[0])
        assert blocks[0].status[row] == PointStatus.ERROR
        assert "signal SIGKILL" in blocks[0].reasons[row]
        assert sum(int(np.count_nonzero(block.status != PointStatus.OK)) for block in blocks) == 1
        assert len(pids.read_text().split()) == 4

        def lose() -> None:
            scheduler.kill()
            scheduler.wait()

        with pytest.raises(WorkersFailed, match=r"scheduler tcp:.* was lost.*finished points are kept"):
            after(3, run(study, executor=lambda study, m: cluster), lose)
    finally:
        cluster.close()


def after(count: int, records: Iterator[object], do: Callable[[], None]) -> None:
    """Take all records, and do something after so many."""
    for i, _ in enumerate(records):
        if i == count:
            do()


def test_a_local_cluster_writes_what_a_run_writes_and_leaves_nobody(tmp_path: Path) -> None:
    study = study_of(MANY)
    here, there = tmp_path / "here.nc", tmp_path / "there.nc"
    execute(study, here, jobs=1)
    killed: list[int] = []

    class Killer:
        """Kills the process beside a dask worker, or the worker, whichever is first, in the middle."""

        def begin(self, *_: object) -> None: ...

        def level(self, *_: object, **__: object) -> None: ...

        def block(self, _: object) -> None:
            killed.append(os.getpid())
            if len(killed) == 3:
                victims = children(os.getpid())
                os.kill(victims[0], signal.SIGKILL)
                killed[:] = [*killed, *victims]

    execute(study, there, Killer(), dask="local", jobs=2)
    import xarray as xr

    with xr.open_datatree(here) as one, xr.open_datatree(there) as other:
        for name in ("u_T", "xi", "sticks"):
            assert np.array_equal(one["level_0"][name], other["level_0"][name])
        for name in ("energy", "inclusion_residual", "status"):
            assert np.array_equal(one[name], other[name])
    assert all(gone(pid) for pid in killed if pid != os.getpid())


def children(parent: int) -> list[int]:
    """Dask's workers among the children of a process."""
    words = Path(f"/proc/{parent}/task/{parent}/children")
    found = [int(pid) for task in words.parents[1].iterdir() for pid in (task / "children").read_text().split()]
    return [pid for pid in found if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]


def test_no_scheduler_is_said_before_any_work(tmp_path: Path) -> None:
    began = time.monotonic()
    with pytest.raises(WorkersFailed, match=r"no dask scheduler answers at tcp://127\.0\.0\.1:9"):
        Cluster("tcp://127.0.0.1:9", connect=1.0)
    assert time.monotonic() - began < 60
