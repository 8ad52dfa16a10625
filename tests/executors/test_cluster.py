"""A dask scheduler and two workers as processes of this machine: the same numbers to the bit, and
nothing lost."""

import contextlib
import itertools
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tcstudy.data.records import BlockRecord
from tcstudy.data.schema import PointStatus
from tcstudy.executors.cluster import CLOSE, CONNECT, DaskExecutor
from tcstudy.executors.processes import SerialExecutor, WorkersFailed
from tcstudy.study import level_solver
from tcstudy.study.run import run
from tests.executors.test_processes import CRUEL, SWEPT, TAU, assert_same, solved
from tests.verification.scenes import RECTANGLE, study_of

pytest.importorskip(
    "distributed", reason="dask.distributed is not installed: pip install 'tcstudy[dask]'"
)

QUIET = {
    **os.environ,
    "DASK_DISTRIBUTED__LOGGING__DISTRIBUTED": "critical",
    "OPENBLAS_NUM_THREADS": "1",
    "PYTHONPATH": os.pathsep.join(
        filter(None, [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")])
    ),
}
"""Workers run the program that is tested, not one that is installed, and find the calls of these
tests."""
MANY = SWEPT.replace("[0.005, 0.01, 0.02, 0.03]", "{linspace: [0.005, 0.03, 40]}").replace(
    "levels: 3", "levels: 1"
)


class Machines:
    """A scheduler and its workers as processes, to be killed; they have no nanny: who is killed
    stays dead."""

    def __init__(self, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = int(free.getsockname()[1])
        self.folder, self.address, self.alive = (
            folder,
            f"tcp://127.0.0.1:{self.port}",
            list[subprocess.Popen[bytes]](),
        )

    def start(self, command: str, *words: str) -> subprocess.Popen[bytes]:
        line = [sys.executable, "-m", "dask", command, "--no-dashboard", *words]
        with (self.folder / f"{command}.log").open("ab") as log:
            self.alive.append(
                subprocess.Popen(line, env=QUIET, cwd=self.folder, stdout=log, stderr=log)
            )
        return self.alive[-1]

    def scheduler(self) -> subprocess.Popen[bytes]:
        process = self.start("scheduler", "--host", "127.0.0.1", "--port", str(self.port))
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline:
            with socket.socket() as line:
                if line.connect_ex(("127.0.0.1", self.port)) == 0:
                    break
            time.sleep(0.1)
        return process

    def worker(self) -> subprocess.Popen[bytes]:
        words = (
            "--no-nanny",
            "--nthreads",
            "1",
            "--memory-limit",
            "0",
            "--local-directory",
            str(self.folder),
        )
        return self.start("worker", self.address, *words)


@pytest.fixture
def machines(tmp_path: Path) -> Iterator[Machines]:
    found = Machines(tmp_path)
    yield found
    for process in reversed(found.alive):
        process.kill()
        process.wait()


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(level_solver, "MAX_POINTS", 2)


def test_a_killed_worker_changes_no_bit_and_a_point_that_kills_is_told(
    machines: Machines, tmp_path: Path
) -> None:
    """One cluster for all that it must stand: a machine that goes, a point that kills, a scheduler
    that goes."""
    scheduler, first, _ = machines.scheduler(), machines.worker(), machines.worker()
    study, seen = study_of(MANY), list[BlockRecord]()
    with DaskExecutor(machines.address) as cluster:
        for record in run(study, executor=lambda study, m: cluster):
            if isinstance(record, BlockRecord):
                seen.append(record)
                if len(seen) == 3:
                    first.kill()
    assert_same(seen, solved(study, SerialExecutor()))

    pids = tmp_path / "pids"
    with DaskExecutor(machines.address, command=(CRUEL, "kill", str(TAU), str(pids))) as cluster:
        blocks = solved(study_of(SWEPT, "mesh.levels=1"), cluster)
        [bad] = [block for block in blocks if 1 in block.points]
        assert bad.status.tolist() == [PointStatus.ERROR]
        assert "signal SIGKILL" in bad.reasons[0]
        assert sum(int(np.count_nonzero(block.status != PointStatus.OK)) for block in blocks) == 1
        assert len(pids.read_text().split()) == 4

        records = run(study, executor=lambda study, m: cluster)
        list(itertools.islice(records, 3))
        scheduler.kill()
        scheduler.wait()
        with pytest.raises(
            WorkersFailed, match=r"scheduler tcp:.* was lost.*finished points are kept"
        ):
            list(records)


def test_a_local_cluster_starts_in_a_script_that_is_not_guarded_and_leaves_nobody(
    tmp_path: Path,
) -> None:
    """No process imports the script again, neither of dask nor of worker processes; blocks and
    geometries."""
    swept = (
        RECTANGLE.replace("maxh: 0.1, levels: 3", "maxh: 0.5")
        + "sweep: {body.rectangle.width: [1, 2, 3]}\n"
    )
    (tmp_path / "points.yaml").write_text(MANY)
    (tmp_path / "geometries.yaml").write_text(swept)
    script = tmp_path / "script.py"
    script.write_text(
        "import tcstudy\nprint('imported')\n"
        "for name, jobs in (('points', 2), ('geometries', 1)):\n"
        "    one = tcstudy.run(f'{name}.yaml', 'here.nc', jobs=jobs, force=True)\n"
        "    two = tcstudy.run(f'{name}.yaml', 'there.nc', jobs=2, dask='local', force=True)\n"
        "    assert one['energy'].equals(two['energy'])\n"
    )
    done = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert (done.returncode, done.stdout) == (0, "imported\n"), done.stderr


TIMED = """
import sys, time
import distributed  # whose import takes its time on a busy machine
from tcstudy.cli import main
from tcstudy.executors import cluster
cluster.CONNECT = 1.0
began = time.monotonic()
try:
    sys.exit(main(sys.argv[1:]))
finally:
    print(time.monotonic() - began)
"""


HTTP = b"HTTP/1.1 400 Bad Request\r\nConnection: close\r\n\r\n"


@pytest.mark.parametrize("answer", [b"", HTTP, None], ids=["nobody", "http", "silence"])
def test_no_scheduler_is_said_in_one_line_before_any_work(
    tmp_path: Path, answer: bytes | None
) -> None:
    """Nobody there (an empty answer), something else, which once was said to want memory, or a peer
    that takes the connection and says nothing."""
    (tmp_path / "study.yaml").write_text(SWEPT)
    with socket.create_server(("127.0.0.1", 0)) as other:
        address = f"tcp://127.0.0.1:{other.getsockname()[1]}"
        if answer:  # the same to everybody

            def serve() -> None:
                with contextlib.suppress(OSError):
                    while True:
                        with other.accept()[0] as line:
                            line.sendall(answer)

            threading.Thread(target=serve, daemon=True).start()
        elif answer is not None:
            other.close()
        words = [sys.executable, "-c", TIMED, "run", "study.yaml", "--dask", address]
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=240)
        assert float(done.stdout) < CONNECT + CLOSE + 20.0
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"study.yaml: no dask scheduler answers at {address} (")
    assert line.endswith("start one with `dask scheduler`, or run without --dask")
