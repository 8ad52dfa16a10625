"""Calls of functions as concurrent.futures has them: `submit(function, *arguments)` gives a Future.

What travels to another process is packed here: (function, arguments) there, (whether it returned, what) back, so that
nobody on the way needs the modules of either.
"""

from __future__ import annotations

import pickle
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import Any, Generic, ParamSpec, TypeVar

import numpy as np

from tcstudy.errors import UserFault

P = ParamSpec("P")
T = TypeVar("T")
TIMEOUT = 600.0
"""Seconds that a call may take before its worker counts as hanging, if nothing else is said."""
THREADS = 1024
"""Calls under way at most."""


class WorkerDied(RuntimeError):
    """A worker was killed, crashed or never answered over a call, as often as it was tried."""


class WorkersFailed(UserFault):
    """There are no workers, or none any more; says why and what to do."""


@dataclass(frozen=True)
class Job(Generic[P, T]):
    """A function of a module, with its name where people watch the work and the seconds that a call of it may take."""

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
    """Has calls done elsewhere, each waited for by a thread. The future raises what the call raised, or WorkerDied or
    WorkersFailed; numbers depend on the call alone, to the bit. `shutdown` ends all workers at once."""

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
    """Do a packed call here; an exception that would not arrive as it is becomes a RuntimeError with its words."""
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
    """Futures of calls in their order, which are asked for as they are submitted: no more than the executor likes are
    under way or wait to be taken."""
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
    """Let the C library keep up to 64 MB of freed memory in this process, once; glibc's way, without effect elsewhere.

    By default it gives an array of a block back to the system and asks for new, empty pages for the next one, which
    took a quarter of the time of a block at m = 176. Its threshold is the largest array freed so far, of at most 32 MB.
    """
    np.empty(2**25 - 2**14, dtype=np.uint8)  # never touched, so that it costs nothing
