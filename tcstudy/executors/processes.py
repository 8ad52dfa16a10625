"""Executors that call functions here, or in processes on this machine that may die.

They are those of concurrent.futures: `submit(function, *arguments)` gives a Future. Messages to and
from another process are packed here: (function, arguments) there, (whether it returned, its result
or exception) back, so that nobody on the way needs the modules of either.

Each worker is a fresh Python process, reached through a socket: no fork, as NGSolve's threads would
not survive it, and no multiprocessing spawn, as that would run the user's script again. Only the
call that it has dies with a worker, and is tried again on a fresh one. concurrent.futures and loky
lose all calls when one worker dies; pebble does not, but spawns by multiprocessing, and its workers
outlive a parent that is killed.
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
"""Seconds that a call may take by default before its worker counts as hanging."""
MAX_CALLS = 1024
"""Calls under way."""
START_TIMEOUT = 120.0
"""Seconds that a worker may take to start."""
MAX_FAILED_STARTS = 3
"""Workers in a row that may end before they are ready; then no more are started."""
MAX_TRIES = 2
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
    """There are no workers, or no more; the text says why and what to do."""


@dataclass(frozen=True)
class Job(Generic[P, T]):
    """A function of a module, its name for people who watch, and the seconds that it may take."""

    function: Callable[P, T]
    name: str = ""
    timeout: float = TIMEOUT

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> T:
        return self.function(*args, **kwargs)


class SerialExecutor(Executor):
    """Does each call at once, in this process."""

    @property
    def ahead(self) -> int:
        """Calls to submit beside the one whose answer is waited for."""
        return 0

    def submit(self, function: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        future: Future[T] = Future()
        try:
            keep_freed_memory()
            future.set_result(function(*args, **kwargs))
        except Exception as error:  # the future raises it when its result is requested
            future.set_exception(error)
        return future


class PackedExecutor(SerialExecutor):
    """Runs calls elsewhere, while a thread waits for each.

    The future raises the exception of the call, or WorkerDied or WorkersFailed. Numbers depend on
    the call alone, to the bit. `shutdown` ends all workers at once.
    """

    def __init__(self) -> None:
        self._threads = ThreadPoolExecutor(MAX_CALLS)

    def submit(self, function: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        job = function if isinstance(function, Job) else Job(function)
        call = pickle.dumps((job.function, args, kwargs), 5)
        return self._threads.submit(self._result, job, call)

    def _result(self, job: Job[..., T], call: bytes) -> T:
        has_returned, answer = pickle.loads(self.run(call, job.timeout, job.name))
        if not has_returned:
            raise answer
        return answer

    def run(self, call: bytes, timeout: float, name: str = "") -> bytes:
        """Return the packed answer of a packed call; raises WorkerDied, WorkersFailed."""
        raise NotImplementedError


def answered(call: bytes) -> bytes:
    """Do a packed call here, and return its packed answer.

    An exception that would not survive the way becomes a RuntimeError with its words.
    """
    try:
        function, args, kwargs = pickle.loads(call)
        return pickle.dumps((True, function(*args, **kwargs)), 5)
    except Exception as error:  # the parent decides what becomes of the call
        try:
            answer = pickle.dumps((False, error))
            pickle.loads(answer)
        except Exception:
            return pickle.dumps((False, RuntimeError(f"{type(error).__name__}: {error}")))
        return answer


def in_order(executor: SerialExecutor, futures: Iterable[Future[T]]) -> Iterator[Future[T]]:
    """Yield futures of calls in their order, and submit later ones meanwhile.

    `futures` submits a call whenever it is asked for the next. No more than `executor.ahead` are
    under way or done beside the one that is yielded.
    """
    waiting: deque[Future[T]] = deque()
    for future in futures:
        waiting.append(future)
        if len(waiting) > executor.ahead:
            yield waiting.popleft()
    yield from waiting


def timed(function: Callable[..., T], *args: Any) -> tuple[T, float]:
    """Return the function's result and its wall time [s]."""
    start = time.perf_counter()
    return function(*args), time.perf_counter() - start


@cache
def keep_freed_memory() -> None:
    """Let the C library keep up to 64 MB of freed memory in this process.

    This has an effect on glibc only. By default it gives an array of a block back to the system and
    asks for new, empty pages for the next one, which took a quarter of the time of a block at m =
    176. Its threshold is the largest array freed so far, of at most 32 MB.
    """
    np.empty(2**25 - 2**14, dtype=np.uint8)  # never touched, so that it costs nothing


def available() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class _Worker:
    """A process and the line to it."""

    def __init__(self, command: tuple[str, ...]) -> None:
        ours, theirs = socket.socketpair()
        with ours, theirs:
            paths = [str(PACKAGE), os.environ.get("PYTHONPATH", "")]
            path = os.pathsep.join(filter(None, paths))
            self.process = subprocess.Popen(
                [sys.executable, "-P", *command, str(theirs.fileno())],
                env={**os.environ, **dict.fromkeys(ONE_THREAD, "1"), "PYTHONPATH": path},
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
            )
            self.line = Connection(ours.detach())

    def answer(self, timeout: float) -> bytes:
        """Return its next message; raises EOFError or OSError if it died, TimeoutError if late."""
        if not self.line.poll(timeout):
            raise TimeoutError(f"no answer within {timeout:g} s")
        return self.line.recv_bytes()

    def end(self) -> str:
        """Kill the process, and return how it ended."""
        self.process.kill()
        self.line.close()
        code = self.process.wait()
        if code >= 0:
            return f"it ended with exit code {code}"
        with contextlib.suppress(ValueError):
            name = signal.Signals(-code).name
            cause = ", perhaps for want of memory" if name == "SIGKILL" else ""
            return f"signal {name}{cause}"
        return f"signal {-code}"


class ProcessExecutor(PackedExecutor):
    """Worker processes.

    They start with the first calls, as many as there are calls for, or with `warm`.
    """

    def __init__(self, workers: int, command: tuple[str, ...] = WORKER) -> None:
        """Prepare the workers.

        workers: their largest number
        command: arguments of the Python process
        """
        super().__init__()
        self.workers = 0
        self.command = command
        self._free = queue.LifoQueue[_Worker | None]()  # None: a worker that is not started
        self._alive = set[_Worker]()
        self._lock = threading.Lock()
        self._closed = False
        self._failed_starts = 0
        self._reason = ""
        self.grow(workers)

    @property
    def ahead(self) -> int:
        return 2 * self.workers

    def grow(self, workers: int) -> ProcessExecutor:
        """Allow at least so many workers."""
        while self.workers < workers:
            self.workers += 1
            self._free.put(None)
        return self

    def warm(self) -> ProcessExecutor:
        """Start the workers now; later calls report those that do not start."""
        for _ in range(self.workers):
            self.submit(int)
        return self

    def run(self, call: bytes, timeout: float, name: str = "") -> bytes:
        worker = self._free.get()
        try:
            for _ in range(MAX_TRIES):
                worker = self._start(worker)
                try:
                    worker.line.send_bytes(call)
                    return worker.answer(timeout)
                except (EOFError, OSError) as error:
                    reason = self._end(worker)
                    worker = None
                    if isinstance(error, TimeoutError):
                        reason = str(error)
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
        """Return the worker, or a fresh one that is ready.

        Raises WorkersFailed if several in a row did not start.
        """
        while worker is None:
            with self._lock:
                if self._closed:
                    raise WorkerDied("the run was ended")
                if self._failed_starts >= MAX_FAILED_STARTS:
                    raise WorkersFailed(
                        f"worker processes cannot be started ({self._reason}); run with --jobs 1"
                    )
                worker = _Worker(self.command)
                self._alive.add(worker)
            try:
                worker.answer(START_TIMEOUT)
                self._failed_starts = 0
            except (EOFError, OSError):
                self._reason = self._end(worker)
                self._failed_starts += 1
                worker = None
        return worker

    def _end(self, worker: _Worker) -> str:
        self._alive.discard(worker)
        return worker.end()
