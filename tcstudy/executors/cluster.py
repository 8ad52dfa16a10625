"""Calls done by the workers of a dask scheduler, on this machine or on many; needs
dask.distributed.

A dask worker hands its call to a process beside it (executors.processes). A call that kills,
crashes or hangs takes that process along and not the worker, is tried again and told in the same
words as everywhere, and dask, which counts a killed worker against all calls that it had, hears
nothing of it. What is left to dask is a machine that goes away: it gives the calls to others. A
scheduler that goes away is waited for as long as at the start.
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
"""The address of a scheduler that is started here, with as many workers as asked for."""
CONNECT = 4.0
"""Seconds in which a scheduler must answer, the first time and after it was lost."""
CLOSE = 10.0
"""Seconds in which it must say goodbye."""
LOST = 3
"""Times that a call may get lost between scheduler and workers."""
FRESH = 2.0
"""Seconds for which the number of workers is taken as known."""


class DaskExecutor(PackedExecutor):
    """The workers of a dask scheduler."""

    def __init__(
        self, address: str, workers: int | None = None, command: tuple[str, ...] = WORKER
    ) -> None:
        """address: LOCAL or tcp://host:port;  workers: of a local one, None for one on each processor
        command: what Python runs beside a dask worker. Raises WorkersFailed."""
        super().__init__()
        self.address, self.command, self._closed = address, command, False
        self._own, self._client = _connected(address, workers)
        self._names = (f"{uuid.uuid4().hex[:6]}-{i}" for i in itertools.count())
        self._counted, self._ahead = -FRESH, 0

    @property
    def ahead(self) -> int:
        """Two calls for each thread of the workers, which come and go."""
        if time.monotonic() - self._counted > FRESH and self._client.status == "running":
            self._ahead = 2 * max(1, self._client.scheduler_info(n_workers=1)["total_threads"])
            self._counted = time.monotonic()
        return self._ahead

    def run(self, call: bytes, timeout: float, name: str = "") -> bytes:
        import dask
        from distributed import KilledWorker
        from distributed.client import ClosedClientError

        for _ in range(LOST):
            try:
                with (
                    _lock,
                    dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 TB"}),
                ):
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
        raise WorkerDied(f"the dask scheduler lost this {LOST} times: {reason}")

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = True) -> None:
        """Cancel what is under way, and end the workers that were started here."""
        self._closed = True
        self._threads.shutdown(wait=False, cancel_futures=cancel_futures)
        if self._own is not None and (beside := _beside.pop(self.command, None)) is not None:
            beside.shutdown()
        for one in filter(None, (self._client, self._own)):
            with contextlib.suppress(TimeoutError):  # it ends with this process
                one.close(timeout=CLOSE)

    def _wait_for_scheduler(self) -> None:
        """Return when it answers again; raises WorkersFailed if it does not."""
        deadline = time.monotonic() + CONNECT + 1.0
        while (
            self._client.status == "connecting" and not self._closed and time.monotonic() < deadline
        ):
            time.sleep(0.1)
        if self._closed:
            raise WorkerDied("the run was ended")
        if self._client.status != "running":
            remedy = "finished points are kept: start it and run again, or run without --dask"
            raise WorkersFailed(f"the dask scheduler {self.address} was lost; {remedy}")


def _connected(address: str, workers: int | None) -> tuple[Any, Any]:
    """(the cluster if it was started here, a client). Raises WorkersFailed."""
    try:
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise WorkersFailed(
            "dask.distributed is not installed; pip install 'tcstudy[dask]'"
        ) from error

    class QuietClient(Client):
        def __del__(self) -> None:
            """`shutdown` closes it; one that was never connected would wait for its scheduler
            again, and complain."""

    for name in ("distributed", "distributed.client"):  # what happens is said here, in one line
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        if address != LOCAL:
            _greet(address)
            return None, QuietClient(address, timeout=CONNECT, set_as_default=False)
        # without processes of dask, which would import the user's script again: calls have their
        # own
        own = LocalCluster(
            1, workers or available(), processes=False, dashboard_address="127.0.0.1:0"
        )
        return own, QuietClient(own, set_as_default=False)
    except (
        Exception
    ) as error:  # MemoryError, where the answer of something else is read as the length of an array
        remedy = "start one with `dask scheduler`, or run without --dask"
        why = (
            str(error)
            if isinstance(error, OSError | ValueError)
            else "what answers there is something else"
        )
        raise WorkersFailed(f"no dask scheduler answers at {address} ({why}); {remedy}") from None


def _greet(address: str) -> None:
    """Shake hands with what answers at an address, in CONNECT seconds.

    A client of dask waits for ever for the hand of a peer that takes the connection and is silent.
    Raises OSError if there is no answer in time, anything for one that is none of dask.
    """
    from distributed.comm import connect

    async def shake_hands() -> None:
        try:
            line = await asyncio.wait_for(connect(address, timeout=CONNECT), CONNECT)
        except TimeoutError:
            raise OSError(f"no word of dask within {CONNECT:g} s") from None
        line.abort()

    # in a thread of its own: a notebook has a loop in this one
    with ThreadPoolExecutor(1) as thread:
        thread.submit(asyncio.run, shake_hands()).result()


# -- on a dask worker ------------------------------------------------------------------------------

_beside: dict[tuple[str, ...], ProcessExecutor] = {}
_lock = threading.Lock()


def run_beside(call: bytes, timeout: float, command: tuple[str, ...]) -> bytes:
    """Do a packed call in a process beside this dask worker, one for each of its threads."""
    from distributed import get_worker

    with _lock:
        if command not in _beside:
            _beside[command] = ProcessExecutor(get_worker().state.nthreads, command=command)
    return _beside[command].run(call, timeout)
