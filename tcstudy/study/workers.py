"""Who works in a run: this process, as many workers as pay, or a dask cluster.

What pays follows from sizes of meshes that are not made (`study.sizes`), so that nothing waits for a mesher.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import numpy as np

from tcstudy.executors import TIMEOUT, DaskExecutor, Job, ProcessExecutor, SerialExecutor, available
from tcstudy.scene.points import Scenes
from tcstudy.scene.study import Study
from tcstudy.study.sizes import LevelForecast, Resources, contact_seconds, of_geometry, of_history, predicted

T = TypeVar("T")
BlockExecutor = Callable[[Study, int], SerialExecutor]
"""(study, contact unknowns of a level) → who solves its blocks."""
FINE = 2000
"""Contact unknowns of a fine level: where these would not pay for workers no forecast is made."""
WORTH = 2.0
"""Seconds of work from which a worker is worth its start, of about half a second."""
SHARE = 0.5
"""Of the memory of this machine, for workers with a geometry or a history each."""
SLOW = 50.0
"""How many times the forecast a worker may take before it counts as hanging."""


def paying(seconds: float, jobs: int | None, start: float = 0.0) -> int:
    """Worker processes for work of so many seconds; 1 means that this process does it itself.

    jobs: as the user asks, None for as many as pay;  start: seconds that each needs before it works
    """
    if os.name != "posix":
        return 1
    if jobs is not None:
        return jobs
    worth = int(seconds / (WORTH + start))
    return min(available(), worth) if worth > 1 else 1


def for_blocks(study: Study, m: int, jobs: int | None = None) -> int:
    """The same for a level with m contact unknowns; points that are not solved in blocks leave workers nothing."""
    return paying(contact_seconds(study, m), jobs) if study.solver.in_blocks else 1


def for_calls(calls: Sequence[Resources], jobs: int | None, start: float = 0.0) -> int:
    """The same for calls, no more than this machine has the memory for unless the user asks."""
    if not calls:
        return 1
    memory = max(one.memory for one in calls)
    most = len(calls) if jobs is not None else max(1, int(SHARE * _memory() / memory))
    return max(1, min(len(calls), paying(sum(one.seconds for one in calls), jobs, start), most))


def _memory() -> float:
    """Of this machine [byte]."""
    return float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else np.inf


def hands(study: Study, levels: Sequence[LevelForecast], jobs: int | None) -> tuple[int, str]:
    """How many processes will do the work, and in words who does what; empty if this one does all."""
    scheduler = "or by those of a scheduler (--dask)"
    if not study.variants and study.history is None:
        most = max((for_blocks(study, level.n_contact, jobs) for level in levels), default=1)
        return most, f"contact problems solved by {most} worker processes (--jobs), {scheduler}" if most > 1 else ""
    if study.history is None:
        what, each = "geometries", [of_geometry(one.study) for one in study.variants if one.study is not None]
    else:
        one = study.history.of(levels)
        what, each = "histories", [of_history(study, one.n_dof, one.n_contact)] * len(study.scenes)
    if len(each) < 2 or (count := for_calls(each, jobs)) == 1:
        return 1, ""
    return count, f"{len(each)} {what}, each whole by one of {count} worker processes (--jobs), {scheduler}"


class WorkerPool:
    """Those who work in a run and end with it."""

    def __init__(self, jobs: int | None = None, dask: str | None = None) -> None:
        """jobs: worker processes, None for as many as pay;  dask: address of a scheduler whose workers do it"""
        self.jobs, self.dask = jobs, dask
        self._cluster: DaskExecutor | None = None
        self._pool: ProcessExecutor | None = None

    def early(self, study: Study) -> WorkerPool:
        """Start workers of this machine at once where the levels promise to pay for them.

        It takes as long as what a run has to do, and to import, before its first block.
        """
        promising = self.jobs is not None or contact_seconds(study, FINE) >= 2 * WORTH
        if self.dask is None and self._pool is None and promising:
            count = 1
            if study.variants or study.history is not None:
                count = min(self.jobs or 1, len(study.variants) or len(study.scenes))
            elif study.scenes[0].body.brep is None:  # which only the kernel can measure
                count = max(for_blocks(study, one.n_contact, self.jobs) for one in predicted(study))
            if count > 1:
                self._pool = ProcessExecutor(count).warm()
        return self

    def ready(self, study: Study) -> WorkerPool:
        """The same, and connected to the scheduler. Raises WorkersFailed if it does not answer."""
        if self.dask is not None and self._cluster is None:
            self._cluster = DaskExecutor(self.dask, self.jobs)
        return self.early(study)

    def blocks(self, study: Study, m: int) -> SerialExecutor:
        """Who solves the blocks of a level with m contact unknowns."""
        if self._cluster is not None:
            return self._cluster if study.solver.in_blocks else SerialExecutor()
        return self._of(for_blocks(study, m, self.jobs))

    def whole(self, calls: Sequence[Resources], start: float = 0.0) -> SerialExecutor | None:
        """Who does calls that take so much, after `start` seconds; None where this process does without."""
        if self._cluster is not None:
            return self._cluster if len(calls) > 1 else None
        count = for_calls(calls, self.jobs, start)
        return self._of(count) if count > 1 else None

    def close(self) -> None:
        """End all workers, whatever they do."""
        for executor in (self._pool, self._cluster):
            if executor is not None:
                executor.shutdown()
        self._pool = self._cluster = None

    def _of(self, count: int) -> SerialExecutor:
        if count <= 1:
            return SerialExecutor()
        self._pool = (self._pool or ProcessExecutor(count)).grow(count)
        return self._pool


def submit(
    executor: SerialExecutor, function: Callable[..., T], study: Study, *given: object, name: str, seconds: float = 0.0
) -> Future[T]:
    """Have function(study, *given) done by a worker anywhere; the file of a body, if any, travels as its content.

    seconds: that it is expected to take
    """
    brep = study.scenes[0].body.brep
    content = brep.path.read_bytes() if brep is not None else None
    job = Job(_with_file, name, max(TIMEOUT, SLOW * seconds))
    return executor.submit(job, content, function, study, *given)


def _with_file(content: bytes | None, function: Callable[..., T], study: Study, *given: object) -> T:
    """Call it with a study whose body is read from the content of its file, if it has one."""
    if content is None:
        return function(study, *given)
    with TemporaryDirectory(prefix="tcstudy-") as folder:
        body = study.scenes[0].body
        assert body.brep is not None
        path = Path(folder, body.brep.path.name)
        path.write_bytes(content)
        own = replace(body, brep=replace(body.brep, path=path))
        return function(replace(study, scenes=Scenes.of(study.scenes).on(own)), *given)
