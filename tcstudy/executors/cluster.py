"""Calls done by the workers of a dask scheduler, on this machine or on many.

It needs dask.distributed. A dask worker hands its call to a process beside it
(executors.processes). A call that kills, crashes or hangs ends that process and not the worker. It
is tried again and reported like everywhere. Dask counts a killed worker against all calls that it
had, so it must not see that. Dask only handles a machine that goes away: it gives the calls to
others. If the scheduler goes away the executor waits for it as long as at the start.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import threading
import time
import uuid
from concurrent.futures import CancelledError, ThreadPoolExecutor
from typing import Any

from tcstudy.executors.processes import (
    WORKER,
    PackedExecutor,
    ProcessExecutor,
    WorkerDied,
    WorkersFailed,
    available,
)

LOCAL = "local"
"""The address of a scheduler that is started here, with as many workers as requested."""
CONNECT = 4.0
"""Seconds in which a scheduler must answer, the first time and after it was lost."""
CLOSE = 10.0
"""Seconds in which a connection must close."""
MAX_LOSSES = 3
"""Times that a call may get lost between scheduler and workers."""
COUNT_AGE = 2.0
"""Seconds after which the workers are counted again."""


class DaskExecutor(PackedExecutor):
    """The workers of a dask scheduler."""

    def __init__(
        self, address: str, workers: int | None = None, command: tuple[str, ...] = WORKER
    ) -> None:
        """Connect to a scheduler; raises WorkersFailed.

        address: LOCAL or tcp://host:port
        workers: of a local scheduler, None for one on each processor
        command: arguments of the Python process beside a dask worker
        """
        super().__init__()
        self.address = address
        self.command = command
        self._closed = False
        self._cluster, self._client = _connect(address, workers)
        self._names = (f"{uuid.uuid4().hex[:6]}-{i}" for i in itertools.count())
        self._count_time = -COUNT_AGE
        self._ahead = 0

    @property
    def ahead(self) -> int:
        """Two calls for each thread of the workers, which come and go."""
        is_old = time.monotonic() - self._count_time > COUNT_AGE
        if is_old and self._client.status == "running":
            threads = self._client.scheduler_info(n_workers=1)["total_threads"]
            self._ahead = 2 * max(1, threads)
            self._count_time = time.monotonic()
        return self._ahead

    def run(self, call: bytes, timeout: float, name: str = "") -> bytes:
        import dask
        from distributed import KilledWorker
        from distributed.client import ClosedClientError

        no_warning = {"distributed.admin.large-graph-warning-threshold": "1 TB"}
        for _ in range(MAX_LOSSES):
            try:
                with _lock, dask.config.set(no_warning):
                    key = f"{name or 'block'} {next(self._names)}"
                    future = self._client.submit(
                        run_beside, call, timeout, self.command, key=key, pure=False
                    )
                answer: bytes = future.result()
            except KilledWorker as error:
                reason = f"{error.allowed_failures + 1} dask workers that had it died"
            except (OSError, CancelledError, asyncio.CancelledError, ClosedClientError) as error:
                reason = type(error).__name__
                self._wait_for_scheduler()
            else:
                return answer
        raise WorkerDied(f"the dask scheduler lost this {MAX_LOSSES} times: {reason}")

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = True) -> None:
        """Cancel the calls under way, and end the workers that were started here."""
        self._closed = True
        self._threads.shutdown(wait=False, cancel_futures=cancel_futures)
        if self._cluster is not None:
            executor = _beside.pop(self.command, None)
            if executor is not None:
                executor.shutdown()
        for connection in (self._client, self._cluster):
            if connection:
                with contextlib.suppress(TimeoutError):  # it ends with this process
                    connection.close(timeout=CLOSE)

    def _wait_for_scheduler(self) -> None:
        """Return when the scheduler answers again; raises WorkersFailed if it does not."""
        deadline = time.monotonic() + CONNECT + 1.0
        while self._client.status == "connecting" and not self._closed:
            if time.monotonic() >= deadline:
                break
            time.sleep(0.1)
        if self._closed:
            raise WorkerDied("the run was ended")
        if self._client.status != "running":
            remedy = "finished points are kept: start it and run again, or run without --dask"
            raise WorkersFailed(f"the dask scheduler {self.address} was lost; {remedy}")


def _connect(address: str, workers: int | None) -> tuple[Any, Any]:
    """Return the cluster if it was started here, and a client; raises WorkersFailed."""
    try:
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise WorkersFailed(
            "dask.distributed is not installed; pip install 'tcstudy[dask]'"
        ) from error

    class QuietClient(Client):
        def __del__(self) -> None:
            """Do nothing, as `shutdown` closes it.

            One that was never connected would wait for its scheduler again, and complain.
            """

    for name in ("distributed", "distributed.client"):  # errors are reported here, in one line
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        if address != LOCAL:
            _greet(address)
            return None, QuietClient(address, timeout=CONNECT, set_as_default=False)
        # without processes of dask, which would import the user's script again: each call has one
        cluster = LocalCluster(
            1, workers or available(), processes=False, dashboard_address="127.0.0.1:0"
        )
        return cluster, QuietClient(cluster, set_as_default=False)
    # also MemoryError: the answer of another service may be read as the length of an array
    except Exception as error:
        remedy = "start one with `dask scheduler`, or run without --dask"
        reason = "what answers there is something else"
        if isinstance(error, OSError | ValueError):
            reason = str(error)
        raise WorkersFailed(
            f"no dask scheduler answers at {address} ({reason}); {remedy}"
        ) from None


def _greet(address: str) -> None:
    """Shake hands with the scheduler at an address, in CONNECT seconds.

    A client of dask waits for ever for a peer that accepts the connection and is silent. Raises
    OSError if there is no answer in time, and any exception for an answer that is not dask's.
    """
    from distributed.comm import connect

    async def shake_hands() -> None:
        try:
            line = await asyncio.wait_for(connect(address, timeout=CONNECT), CONNECT)
        except TimeoutError:
            raise OSError(f"no word of dask within {CONNECT:g} s") from None
        line.abort()

    # in another thread: in a notebook this one has an event loop already
    with ThreadPoolExecutor(1) as thread:
        thread.submit(asyncio.run, shake_hands()).result()


# -- on a dask worker ------------------------------------------------------------------------------

_beside: dict[tuple[str, ...], ProcessExecutor] = {}
_lock = threading.Lock()


def run_beside(call: bytes, timeout: float, command: tuple[str, ...]) -> bytes:
    """Do a packed call in a process beside this dask worker; each of its threads has one."""
    from distributed import get_worker

    with _lock:
        if command not in _beside:
            _beside[command] = ProcessExecutor(get_worker().state.nthreads, command=command)
    return _beside[command].run(call, timeout)
