"""Who works in a run: this process, as many workers as pay, or a dask cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence

from tcstudy.executors import Cluster, Executor, Here, Processes, available
from tcstudy.scene.study import Study
from tcstudy.study.sizes import LevelForecast, forecast
from tcstudy.study.workshop import in_blocks

Choice = Callable[[Study, int], Executor]
"""(study, contact unknowns of a level) → who solves its blocks."""
POINT, NODE = 0.1e-3, 6e-6
"""Seconds that a point takes, and more for each contact unknown (results/online.md): a rough figure is enough."""
FINE = 2000
"""Contact unknowns of a fine level: where these would not pay for workers no forecast is made."""
WORTH = 4.0
"""Seconds of work from which a worker is worth its start, of about one."""


def seconds(study: Study, m: int) -> float:
    """About how long the contact problems of a level with m contact unknowns take one process."""
    return len(study.scenes) * (POINT + NODE * m)


def paying(seconds: float, jobs: int | None) -> int:
    """Worker processes for work of so many seconds; 1 means that this process does it itself.

    jobs: as the user asks, None for as many as pay
    """
    if os.name != "posix":
        return 1
    if jobs is not None:
        return jobs
    worth = int(seconds / WORTH)
    return min(available(), worth) if worth > 1 else 1


def workers(study: Study, m: int, jobs: int | None = None) -> int:
    """The same for a level with m contact unknowns; points that are not solved in blocks leave workers nothing."""
    return paying(seconds(study, m), jobs) if in_blocks(study) else 1


def work_words(study: Study, levels: Sequence[LevelForecast], jobs: int | None) -> str:
    """Who will solve the contact problems, in words."""
    most = max((workers(study, level.n_contact, jobs) for level in levels), default=1)
    took = sum(seconds(study, level.n_contact) for level in levels)
    about = f"contact problems: about {took:.1g} s of one process" if took >= WORTH else ""
    who = f"solved by {most} worker processes (--jobs), or by those of a scheduler (--dask)"
    if most == 1:
        return about
    return f"{about}, {who}" if about else f"contact problems {who}"


class Staff:
    """Those who work in a run and end with it."""

    def __init__(self, jobs: int | None = None, dask: str | None = None) -> None:
        """jobs: worker processes, None for as many as pay;  dask: address of a scheduler, whose workers do all instead

        Raises WorkersFailed if it does not answer.
        """
        self.jobs, self._here = jobs, Here()
        self._cluster = Cluster(dask, jobs) if dask is not None else None
        self._pool: Processes | None = None

    def early(self, study: Study) -> Staff:
        """Start workers for blocks at once where the levels promise to pay for them: it takes as long as a mesh."""
        if self._cluster is None and (self.jobs is not None or seconds(study, FINE) >= 2 * WORTH):
            count = max((workers(study, one.n_contact, self.jobs) for one in forecast(study)), default=1)
            self._of(count).warm() if count > 1 else None
        return self

    def blocks(self, study: Study, m: int) -> Executor:
        """Who solves the blocks of a level with m contact unknowns."""
        if self._cluster is not None:
            return self._cluster if in_blocks(study) else self._here
        count = workers(study, m, self.jobs)
        return self._here if count == 1 else self._of(count)

    def errands(self, count: int, seconds: float, most: int) -> Executor | None:
        """Who runs so many errands of so many seconds together; None where this process does without.

        most: workers at a time that this machine has the memory for, if it is not the user who chose their number
        """
        if self._cluster is not None:
            return self._cluster
        number = min(count, paying(seconds, self.jobs), most if self.jobs is None else count)
        return self._of(number) if number > 1 else None

    def close(self) -> None:
        """End all workers, whatever they do."""
        if self._pool is not None:
            self._pool.close()
        if self._cluster is not None:
            self._cluster.close()
        self._pool = self._cluster = None

    def _of(self, count: int) -> Processes:
        self._pool = (self._pool or Processes(count)).grow(count)
        return self._pool
