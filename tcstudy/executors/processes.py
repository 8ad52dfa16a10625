"""Calls of functions as concurrent.futures has them, `submit(function, *arguments)` gives a Future;
done here, or by processes on this machine, which may die without taking anything along.

What travels to another process is packed here: (function, arguments) there, (whether it returned,
what) back, so that nobody on the way needs the modules of either.

Each worker is a fresh Python process (no fork: NGSolve's threads would not survive it, and no
multiprocessing spawn: it would run the user's script again), reached through a socket. What dies
with a worker is the one call it has, which is tried again on a fresh one. concurrent.futures and
loky lose all calls when one worker dies; pebble does not, but spawns by multiprocessing, and its
workers outlive a parent that is killed.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Generic, ParamSpec, TypeVar

import numpy as np

from tcstudy.errors import UserFault

P = ParamSpec("P")
T = TypeVar("T")
TIMEOUT = 600.0
"""Seconds that a call may take before its worker counts as hanging, if nothing else is said."""
THREADS = 1024
"""Calls under way at most."""
START, STARTS = 120.0, 3
"""Seconds that a worker may take to start; those in a row that end before they are ready, after
which none is."""
TRIES = 2
"""Workers that may die over a call."""
ONE_THREAD = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)
PACKAGE = Path(__file__).parents[2]
WORKER = ("-m", "tcstudy.executors.worker")


class WorkerDied(RuntimeError):
    """A worker was killed, crashed or never answered over a call, as often as it was tried."""


class WorkersFailed(UserFault):
    """There are no workers, or none any more; says why and what to do."""


@dataclass(frozen=True)
class Job(Generic[P, T]):
    """A function of a module, with its name where people watch the work and the seconds that a call
    of it may take."""

    function: Callable[P, T]
    name: str = ""
    timeout: float = TIMEOUT

    def __call__(self, *given: P.args, **named: P.kwargs) -> T:
        return self.function(*given, **named)


class SerialExecutor(Executor):
    """Does each call at once, in this process.

    ahead: calls that an executor likes to have beside the one whose answer is waited for
    """

    @property
    def ahead(self) -> int:
        return 0

    def submit(self, function: Callable[P, T], /, *given: P.args, **named: P.kwargs) -> Future[T]:
        future: Future[T] = Future()
        try:
            keep_freed_memory()
            future.set_result(function(*given, **named))
        except Exception as error:  # whoever asks for the result gets it
            future.set_exception(error)
        return future


class PackedExecutor(SerialExecutor):
    """Has calls done elsewhere, each waited for by a thread. The future raises what the call
    raised, or WorkerDied or WorkersFailed; numbers depend on the call alone, to the bit. `shutdown`
    ends all workers at once."""

    def __init__(self) -> None:
        self._threads = ThreadPoolExecutor(THREADS)

    def submit(self, function: Callable[P, T], /, *given: P.args, **named: P.kwargs) -> Future[T]:
        job = function if isinstance(function, Job) else Job(function)
        return self._threads.submit(self._there, job, pickle.dumps((job.function, given, named), 5))

    def _there(self, job: Job[..., T], call: bytes) -> T:
        returned, answer = pickle.loads(self.run(call, job.timeout, job.name))
        if not returned:
            raise answer
        return answer

    def run(self, call: bytes, timeout: float, name: str = "") -> bytes:
        """The packed answer of a packed call. Raises WorkerDied, WorkersFailed."""
        raise NotImplementedError


def answered(call: bytes) -> bytes:
    """Do a packed call here; an exception that would not arrive as it is becomes a RuntimeError
    with its words."""
    try:
        function, given, named = pickle.loads(call)
        return pickle.dumps((True, function(*given, **named)), 5)
    except Exception as error:  # the parent decides what becomes of the call
        try:
            pickle.loads(packed := pickle.dumps((False, error)))
        except Exception:
            return pickle.dumps((False, RuntimeError(f"{type(error).__name__}: {error}")))
        return packed


def in_order(executor: SerialExecutor, futures: Iterable[Future[T]]) -> Iterator[Future[T]]:
    """Futures of calls in their order, which are asked for as they are submitted: no more than the
    executor likes are under way or wait to be taken."""
    waiting: deque[Future[T]] = deque()
    for future in futures:
        waiting.append(future)
        if len(waiting) > executor.ahead:
            yield waiting.popleft()
    yield from waiting


def timed(function: Callable[..., T], *given: Any) -> tuple[T, float]:
    """(what it returns, wall time [s] of whoever does it)."""
    start = time.perf_counter()
    return function(*given), time.perf_counter() - start


@cache
def keep_freed_memory() -> None:
    """Let the C library keep up to 64 MB of freed memory in this process, once; glibc's way,
    without effect elsewhere.

    By default it gives an array of a block back to the system and asks for new, empty pages for the
    next one, which took a quarter of the time of a block at m = 176. Its threshold is the largest
    array freed so far, of at most 32 MB.
    """
    np.empty(2**25 - 2**14, dtype=np.uint8)  # never touched, so that it costs nothing


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
    """Worker processes; they start with the first calls, as many as there are calls for, unless
    they are warmed."""

    def __init__(self, workers: int, command: tuple[str, ...] = WORKER) -> None:
        """workers: at most;  command: what Python runs"""
        super().__init__()
        self.workers, self.command = 0, command
        self._free: queue.LifoQueue[_Worker | None] = (
            queue.LifoQueue()
        )  # None: one that is not started
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
        worker = self._free.get()
        try:
            for _ in range(TRIES):
                worker = self._start(worker)
                try:
                    worker.line.send_bytes(call)
                    return worker.answer(timeout)
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
        """The worker, or a fresh one that is ready; raises WorkersFailed if several in a row did
        not come up."""
        while worker is None:
            with self._lock:
                if self._closed:
                    raise WorkerDied("the run was ended")
                if self._failed_starts >= STARTS:
                    raise WorkersFailed(
                        f"worker processes cannot be started ({self._reason}); run with --jobs 1"
                    )
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
