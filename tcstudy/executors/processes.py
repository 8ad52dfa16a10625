"""Calls done by processes on this machine, which may die without taking anything along.

Each worker is a fresh Python process (no fork: NGSolve's threads would not survive it, and no multiprocessing spawn: it
would run the user's script again), reached through a socket. What dies with a worker is the one call it has, which is
tried again on a fresh one. concurrent.futures and loky lose all calls when one worker dies; pebble does not, but spawns
by multiprocessing, and its workers outlive a parent that is killed.
"""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import socket
import subprocess
import sys
import threading
from multiprocessing.connection import Connection
from pathlib import Path

from tcstudy.executors.pool import PackedExecutor, WorkerDied, WorkersFailed

START, STARTS = 120.0, 3
"""Seconds that a worker may take to start; those in a row that end before they are ready, after which none is."""
TRIES = 2
"""Workers that may die over a call."""
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
PACKAGE = Path(__file__).parents[2]
WORKER = ("-m", "tcstudy.executors.worker")


def available() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class _Worker:
    """A process and the line to it."""

    def __init__(self, command: tuple[str, ...]) -> None:
        ours, theirs = socket.socketpair()
        with ours, theirs:
            path = os.pathsep.join(filter(None, [str(PACKAGE), os.environ.get("PYTHONPATH", "")]))
            self.process = subprocess.Popen(
                [sys.executable, "-P", *command, str(theirs.fileno())],
                env={**os.environ, **dict.fromkeys(ONE_THREAD, "1"), "PYTHONPATH": path},
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
            )
            self.line = Connection(ours.detach())

    def answer(self, timeout: float) -> bytes:
        """Its next message; EOFError or OSError if it died, TimeoutError if there is none."""
        if not self.line.poll(timeout):
            raise TimeoutError(f"no answer within {timeout:g} s")
        return self.line.recv_bytes()

    def end(self) -> str:
        """Kill it, and say how it ended if it had."""
        self.process.kill()
        self.line.close()
        code = self.process.wait()
        if code >= 0:
            return f"it ended with exit code {code}"
        with contextlib.suppress(ValueError):
            name = signal.Signals(-code).name
            return f"signal {name}" + (", perhaps for want of memory" if name == "SIGKILL" else "")
        return f"signal {-code}"


class ProcessExecutor(PackedExecutor):
    """Worker processes; they start with the first calls, as many as there are calls for, unless they are warmed."""

    def __init__(self, workers: int, timeout: float | None = None, command: tuple[str, ...] = WORKER) -> None:
        """workers: at most;  timeout: seconds for a call, None for that of its job;  command: what Python runs"""
        super().__init__()
        self.workers, self.timeout, self.command = 0, timeout, command
        self._free: queue.LifoQueue[_Worker | None] = queue.LifoQueue()  # None: one that is not started
        self._alive, self._lock, self._closed = set[_Worker](), threading.Lock(), False
        self._failed_starts, self._reason = 0, ""
        self.grow(workers)

    @property
    def ahead(self) -> int:
        return 2 * self.workers

    def grow(self, workers: int) -> ProcessExecutor:
        """Let there be at least so many workers."""
        while self.workers < workers:
            self.workers += 1
            self._free.put(None)
        return self

    def warm(self) -> ProcessExecutor:
        """Start the workers now; whoever submits calls is told of those that do not come up."""
        for _ in range(self.workers):
            self.submit(int)
        return self

    def run(self, call: bytes, timeout: float, name: str = "") -> bytes:
        worker, limit = self._free.get(), timeout if self.timeout is None else self.timeout
        try:
            for _ in range(TRIES):
                worker = self._start(worker)
                try:
                    worker.line.send_bytes(call)
                    return worker.answer(limit)
                except (EOFError, OSError) as error:
                    reason, worker = self._end(worker), None
                    reason = str(error) if isinstance(error, TimeoutError) else reason
            raise WorkerDied(f"the worker process that solved this died: {reason}")
        finally:
            self._free.put(worker)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = True) -> None:
        """End all workers at once; calls under way are lost."""
        with self._lock:
            self._closed = True
            for worker in self._alive:
                worker.process.kill()
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        for worker in [*self._alive]:
            self._end(worker)

    def _start(self, worker: _Worker | None) -> _Worker:
        """The worker, or a fresh one that is ready; raises WorkersFailed if several in a row did not come up."""
        while worker is None:
            with self._lock:
                if self._closed:
                    raise WorkerDied("the run was ended")
                if self._failed_starts >= STARTS:
                    raise WorkersFailed(f"worker processes cannot be started ({self._reason}); run with --jobs 1")
                self._alive.add(worker := _Worker(self.command))
            try:
                worker.answer(START)
                self._failed_starts = 0
            except (EOFError, OSError):
                self._reason, worker = self._end(worker), None
                self._failed_starts += 1
        return worker

    def _end(self, worker: _Worker) -> str:
        self._alive.discard(worker)
        return worker.end()
