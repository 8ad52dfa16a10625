"""A dask scheduler and its workers as processes of this machine, to be killed."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

QUIET = {
    **os.environ,
    "DASK_DISTRIBUTED__LOGGING__DISTRIBUTED": "critical",
    "OPENBLAS_NUM_THREADS": "1",
    "PYTHONPATH": os.pathsep.join(filter(None, [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")])),
}
"""Workers run the program that is tested, not one that is installed, and find the calls of these tests."""


def free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


@dataclass
class Machines:
    """A scheduler and its workers, which have no nanny: who is killed stays dead."""

    folder: Path
    port: int = field(default_factory=free_port)
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

    def wait(self) -> None:
        """Until the scheduler listens."""
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline:
            with socket.socket() as line:
                if line.connect_ex(("127.0.0.1", self.port)) == 0:
                    return
            time.sleep(0.1)

    def close(self) -> None:
        for process in reversed(self.alive):
            process.kill()
            process.wait()
        self.alive.clear()
