"""Work done by processes on this machine, which may die without taking anything along.

Each worker is a fresh Python process (no fork: NGSolve's threads would not survive it, and no multiprocessing spawn: it
would run the user's script again), reached through a socket by a thread of its own. What dies with a worker is the one
piece of work it has; the thread starts another worker and tries again as often as it may. concurrent.futures loses
everything when one worker dies.
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
from concurrent.futures import Future
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tcstudy.executors.protocol import Doable, T, WorkerDied, WorkersFailed, parts

if TYPE_CHECKING:
    from tcstudy.online import CondensedBody

START = 120.0
"""Seconds that a worker may take to start."""
STARTS = 3
"""Workers in a row that end before they are ready, after which none is started any more."""
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
PACKAGE = Path(__file__).parents[2]
WORKER = ("-m", "tcstudy.executors.worker")


def available() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass
class _Worker:
    """A process, the line to it, and the body that it has."""

    process: subprocess.Popen[bytes]
    line: Connection
    body: CondensedBody | None = None

    def end(self) -> int:
        """Kill it; the exit code, negative for a signal."""
        self.process.kill()
        self.line.close()
        return self.process.wait()


@dataclass
class _Job:
    """Work on its way."""

    work: Doable[Any]
    tries: int
    future: Future[Any] = field(default_factory=Future)


class Processes:
    """Worker processes; they start with the first work, as many as there is work for, unless they are warmed."""

    def __init__(self, jobs: int, limit: float | None = None, worker: tuple[str, ...] = WORKER) -> None:
        """jobs: workers at most;  worker: what Python runs;  limit: seconds for work, None for its `patience`"""
        self.jobs, self.ahead = jobs, 2 * jobs
        self.limit, self.worker = limit, worker
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._threads: list[threading.Thread] = []
        self._workers: dict[threading.Thread, _Worker] = {}
        self._lock = threading.Lock()
        self._closed = False
        self._failed_starts, self._reason = 0, ""

    def warm(self) -> Processes:
        """Start the workers now; whoever gives tasks is told of those that do not come up."""
        while len(self._threads) < self.jobs:
            self._employ(early=True)
        return self

    def grow(self, jobs: int) -> Processes:
        """Let there be at least so many workers."""
        self.jobs = max(self.jobs, jobs)
        self.ahead = 2 * self.jobs
        return self

    def submit(self, work: Doable[T], tries: int = 1) -> Future[T]:
        """Give the work to the next worker that is free."""
        job = _Job(work, tries)
        self._jobs.put(job)
        if len(self._threads) < self.jobs:
            self._employ()
        return job.future

    def close(self) -> None:
        """End all workers at once; tasks under way are lost."""
        with self._lock:
            self._closed = True
            workers = list(self._workers.values())
        for worker in workers:
            worker.process.kill()
        for _ in self._threads:
            self._jobs.put(None)
        for thread in self._threads:
            thread.join()

    # -- one thread for each worker ----------------------------------------------------------------

    def _employ(self, early: bool = False) -> None:
        self._threads.append(threading.Thread(target=self._attend, args=(early,), daemon=True))
        self._threads[-1].start()

    def _attend(self, early: bool) -> None:
        """Hand tasks to one worker after the other until the executor is closed; early: start the first at once."""
        try:
            if early:
                with contextlib.suppress(Exception):  # the first task tries again, or says so
                    self._start()
            while (job := self._jobs.get()) is not None:
                if self._closed:
                    job.future.cancel()
                    continue
                try:
                    job.future.set_result(self._solve(job))
                except Exception as error:  # whoever asks for the result gets it
                    job.future.set_exception(error)
        finally:
            self._dismiss()

    def _solve(self, job: _Job) -> Any:
        """Try to have it done; each time its worker dies, on a fresh one."""
        reason = ""
        for _ in range(job.tries):
            worker = self._workers.get(threading.current_thread()) or self._start()
            limit = job.work.patience if self.limit is None else self.limit
            try:
                answer = self._ask(worker, job.work, limit)
            except TimeoutError:
                self._dismiss()
                reason = f"no answer within {limit:g} s"
            except (EOFError, OSError):
                reason = _death(self._dismiss())
            else:
                if isinstance(answer, Exception):
                    raise answer
                return answer
            if self._closed:
                break
        raise WorkerDied(f"the worker process that solved this died: {reason}")

    @staticmethod
    def _ask(worker: _Worker, work: Doable[Any], limit: float) -> Any:
        """The answer of a worker; EOFError or OSError if it died over it, TimeoutError if there is none."""
        body, message = parts(work)
        if body is not None and worker.body is not body:
            worker.line.send(body)
            worker.body = body
        worker.line.send(message)
        if not worker.line.poll(limit):
            raise TimeoutError
        return worker.line.recv()

    def _start(self) -> _Worker:
        """A fresh worker, ready; raises WorkersFailed if several in a row did not come up."""
        while not self._closed and self._failed_starts < STARTS:
            worker = self._launch()
            with contextlib.suppress(EOFError, OSError):
                if worker.line.poll(START) and worker.line.recv() == "ready":
                    self._failed_starts = 0
                    return worker
            self._failed_starts += 1
            self._reason = _death(self._dismiss())
        if self._closed:
            raise WorkerDied("the run was ended")
        raise WorkersFailed(f"worker processes cannot be started ({self._reason}); run with --jobs 1")

    def _launch(self) -> _Worker:
        ours, theirs = socket.socketpair()
        with ours, theirs:
            path = os.pathsep.join(filter(None, [str(PACKAGE), os.environ.get("PYTHONPATH", "")]))
            words = [sys.executable, "-P", *self.worker, str(theirs.fileno())]
            environment = {**os.environ, **dict.fromkeys(ONE_THREAD, "1"), "PYTHONPATH": path}
            process = subprocess.Popen(
                words, env=environment, pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL
            )
            worker = _Worker(process, Connection(ours.detach()))
        with self._lock:
            self._workers[threading.current_thread()] = worker
            if self._closed:
                process.kill()
        return worker

    def _dismiss(self) -> int:
        """End this thread's worker; its exit code."""
        with self._lock:
            worker = self._workers.pop(threading.current_thread(), None)
        return worker.end() if worker is not None else 0


def _death(code: int) -> str:
    """What an exit code says."""
    if code >= 0:
        return f"it ended with exit code {code}"
    with contextlib.suppress(ValueError):
        name = signal.Signals(-code).name
        return f"signal {name}" + (", perhaps for want of memory" if name == "SIGKILL" else "")
    return f"signal {-code}"
