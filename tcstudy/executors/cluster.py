"""Work done by the workers of a dask scheduler, on this machine or on many; needs dask.distributed.

A dask worker hands its task to a process beside it (executors.processes). A block that kills, crashes or hangs takes
that process along and not the worker, is tried again and told in the same words as everywhere, and dask, which may stop
answering where its workers are killed again and again, hears nothing of it. What is left to dask is a machine that goes
away: it gives the tasks to others, and counts how often. A scheduler that goes away is waited for.

A body travels once to each worker, as a task that the scheduler can have done again where a worker took it along.
"""

from __future__ import annotations

import contextlib
import itertools
import logging
import threading
import time
import uuid
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

from tcstudy.executors.processes import WORKER, Processes, available
from tcstudy.executors.protocol import Doable, T, WorkerDied, WorkersFailed, parts, whole

if TYPE_CHECKING:
    from tcstudy.online import CondensedBody

LOCAL = "local"
"""The address of a scheduler that is started here, with as many workers as asked for."""
CONNECT = 30.0
"""Seconds in which a scheduler must answer, the first time and after it was lost."""
CLOSE = 20.0
"""Seconds in which workers that were started here must end."""
LOOK = 30.0
"""Seconds after which it is asked whether a task is still at work."""
LOST = 3
"""Times that a task may get lost between scheduler and workers."""
FRESH = 2.0
"""Seconds for which the number of workers is taken as known."""
THREADS = 1024
"""Tasks under way at most."""


class Cluster:
    """The workers of a dask scheduler."""

    def __init__(
        self,
        address: str,
        jobs: int | None = None,
        worker: tuple[str, ...] = WORKER,
        connect: float = CONNECT,
    ) -> None:
        """address: LOCAL or tcp://host:port;  jobs: workers of a local one, None for one on each processor

        worker: what Python runs beside a dask worker
        connect: seconds in which the scheduler must answer. Raises WorkersFailed.
        """
        self.address, self.worker, self.connect = address, worker, connect
        self._own, self._client = _connected(address, jobs, connect)
        self._threads = ThreadPoolExecutor(THREADS)
        self._names, self._lock = (f"{uuid.uuid4().hex[:6]}-{i}" for i in itertools.count()), threading.Lock()
        self._sent: tuple[CondensedBody, Any] | None = None
        self._counted, self._ahead = -FRESH, 0
        self._closed = False

    @property
    def ahead(self) -> int:
        """Two tasks for each thread of the workers, which come and go."""
        if time.monotonic() - self._counted > FRESH and self._client.status == "running":
            self._ahead = 2 * max(1, self._client.scheduler_info(n_workers=1)["total_threads"])
            self._counted = time.monotonic()
        return self._ahead

    def submit(self, work: Doable[T], tries: int = 1) -> Future[T]:
        """Give the work to the scheduler."""
        return self._threads.submit(self._solve, work, tries)

    def close(self) -> None:
        """Cancel what is under way, and end the workers that were started here."""
        self._closed = True
        self._threads.shutdown(wait=False, cancel_futures=True)
        self._client.close(timeout=CLOSE)
        if self._own is not None:
            with contextlib.suppress(TimeoutError):  # a worker that is just starting; it ends with this process
                self._own.close(timeout=CLOSE)

    # -- one thread for each task ------------------------------------------------------------------

    def _solve(self, work: Doable[T], tries: int) -> T:
        """Try until it is done, or lost too often."""
        from distributed import KilledWorker

        for _ in range(LOST):
            try:
                return self._ask(work, tries)
            except KilledWorker as error:
                raise WorkerDied(f"{error.allowed_failures + 1} dask workers that had this died") from error
            except TimeoutError:
                reason = "its workers gave no answer"
            except _gone() as error:
                reason = f"{type(error).__name__}"
                self._wait_for_scheduler()
        raise WorkerDied(f"the dask scheduler lost this {LOST} times: {reason}")

    def _ask(self, work: Doable[T], tries: int) -> T:
        """The answer of a worker; TimeoutError if there is none."""
        body, rest = parts(work)
        with self._lock:
            sent = self._body(body) if body is not None else None
            key = f"{work.name or 'block'} {next(self._names)}"
        future = self._client.submit(solve_beside, sent, rest, tries, self.worker, key=key, pure=False)
        held = 0.0
        try:
            while True:
                try:
                    answer: T = future.result(timeout=LOOK)
                except TimeoutError:
                    at_work = any(key in keys for keys in self._client.processing().values())
                    held = held + LOOK if at_work else 0.0  # one that waits for a worker may wait for long
                    if held > tries * work.patience + LOOK:
                        raise
                else:
                    return answer
        finally:
            future.release()

    def _body(self, body: CondensedBody) -> Any:
        """The body as the scheduler knows it."""
        import dask

        if self._sent is None or self._sent[0] is not body or self._sent[1].status in ("error", "cancelled", "lost"):
            with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 TB"}):
                sent = self._client.submit(_kept, body, key=f"body {next(self._names)}", pure=False)
            self._sent = body, sent
        return self._sent[1]

    def _wait_for_scheduler(self) -> None:
        """Return when it answers again; raises WorkersFailed if it does not."""
        deadline = time.monotonic() + self.connect + 1.0
        while self._client.status == "connecting" and not self._closed and time.monotonic() < deadline:
            time.sleep(0.1)
        if self._closed:
            raise WorkerDied("the run was ended")
        if self._client.status != "running":
            remedy = "finished points are kept: start it and run again, or run without --dask"
            raise WorkersFailed(f"the dask scheduler {self.address} was lost; {remedy}")


def _gone() -> tuple[type[BaseException], ...]:
    """What is raised where the connection to the scheduler ends; asyncio's CancelledError is no Exception."""
    import asyncio

    from distributed.client import ClosedClientError

    return OSError, CancelledError, asyncio.CancelledError, ClosedClientError


def _connected(address: str, jobs: int | None, timeout: float) -> tuple[Any, Any]:
    """(the cluster if it was started here, a client). Raises WorkersFailed."""
    try:
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise WorkersFailed("dask.distributed is not installed; pip install 'tcstudy[dask]'") from error
    try:
        if address != LOCAL:
            return None, Client(address, timeout=timeout, set_as_default=False)
        own = LocalCluster(
            n_workers=jobs or available(),
            threads_per_worker=1,
            memory_limit=0,  # blocks are solved beside the workers
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            silence_logs=logging.CRITICAL,
        )
        return own, Client(own, timeout=timeout, set_as_default=False)
    except (OSError, ValueError) as error:
        remedy = "start one with `dask scheduler`, or run without --dask"
        raise WorkersFailed(f"no dask scheduler answers at {address} ({error}); {remedy}") from error


# -- on a dask worker ------------------------------------------------------------------------------

_beside: dict[tuple[str, ...], Processes] = {}
_beside_lock = threading.Lock()


def _kept(body: CondensedBody) -> CondensedBody:
    return body


def solve_beside(body: CondensedBody | None, rest: Any, tries: int, worker: tuple[str, ...]) -> Any:
    """Do work in a process beside this dask worker, one for each of its threads."""
    from distributed import get_worker

    with _beside_lock:
        if worker not in _beside:
            _beside[worker] = Processes(get_worker().state.nthreads, worker=worker)
        done = _beside[worker].submit(whole(body, rest), tries)
    return done.result()
