"""Commands in processes that stop before each step: who asks lets another one run, or kills them.

A step is the open, lock, rename or removal of a file in the folder of the command, as Python's audit
events tell it, or an fsync. What the system holds changes at steps only, so that a kill after one is
a kill before the next one. Run as a program this is a server that forks a process for every command:
it has imported what commands need, and has no thread of its own, which would be missing in a fork.
"""

import importlib
import json
import os
import pkgutil
import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import tcstudy
from tests.commands import tcstudy_command

EVENTS = ("open", "sqlite3.connect", "os.rename", "os.remove", "os.rmdir", "os.mkdir")
INPUTS = (".yaml", ".json")
GUARD = 60.0
"""Wall time after which a process between two of its steps counts as one that never ends [s]."""


class Outcome(NamedTuple):
    """How a command ended: its steps, the exit code (or minus a signal), what it said.

    second: the same of the command that ran at a step; None without one
    """

    steps: list[str]
    code: int
    stderr: str
    second: int | None


class Server:
    """The process that forks."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__],
            cwd=Path(__file__).parents[2],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def run(
        self, folder: Path, words: list[str], at: int = -1, second: list[str] | None = None
    ) -> Outcome:
        """Run a command; before step `at`, run a second one to its end, or kill it if that is None."""
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.write(json.dumps([str(folder), words, at, second]) + "\n")
        self._process.stdin.flush()
        return Outcome(*json.loads(self._process.stdout.readline()))

    def close(self) -> None:
        self._process.communicate()


def _outcome(folder: str, words: list[str], at: int, second: list[str] | None) -> Outcome:
    ours, theirs = socket.socketpair()
    process = os.fork()
    if not process:
        ours.close()
        _command(folder, words, theirs)
    theirs.close()
    ours.settimeout(GUARD)
    steps: list[str] = []
    end: dict[str, Any] = {"stderr": ""}
    code_of_second = None
    with ours, ours.makefile() as lines:
        try:
            for line in lines:
                message = json.loads(line)
                if "step" not in message:
                    end = message
                    continue
                steps.append(message["step"])
                if len(steps) - 1 == at and second is None:
                    os.kill(process, signal.SIGKILL)
                elif len(steps) - 1 == at and second is not None:
                    code_of_second = _outcome(folder, second, -1, None).code
                ours.sendall(b"\n")
        except TimeoutError:
            os.kill(process, signal.SIGKILL)
        except ConnectionError:  # it was killed above
            pass
    code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    return Outcome(steps, code, end["stderr"], code_of_second)


def _command(folder: str, words: list[str], server: socket.socket) -> None:
    """Run a command and end this process."""
    code = 98
    try:
        _watch(folder, server)
        result = tcstudy_command(*words, cwd=Path(folder))
        server.sendall(json.dumps({"stderr": result.stderr}).encode() + b"\n")
        code = result.returncode
    finally:
        os._exit(code)


def _watch(folder: str, server: socket.socket) -> None:
    """Stop before every step until the server answers."""

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event not in EVENTS or not isinstance(arguments[0], str | os.PathLike):
            return
        name = os.path.relpath(os.fspath(arguments[0]), folder)
        if not name.startswith("..") and not name.endswith(INPUTS):
            stop(f"{event} {name}")

    def stop(step: str) -> None:
        server.sendall(json.dumps({"step": step}).encode() + b"\n")
        server.recv(1)

    def fsync(fd: Any) -> None:
        stop("fsync")
        system_fsync(fd)

    system_fsync, os.fsync = os.fsync, fsync
    sys.addaudithook(hook)


def _serve() -> None:
    for module in pkgutil.walk_packages(tcstudy.__path__, "tcstudy."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    for name in ("netCDF4", "pandas", "xarray", "matplotlib.pyplot", "scipy.sparse.linalg"):
        importlib.import_module(name)
    for line in sys.stdin:
        print(json.dumps(_outcome(*json.loads(line))), flush=True)


if __name__ == "__main__":
    _serve()
