"""Who solves the blocks of a level: this process, as many workers as pay, or a dask cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

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


def workers(study: Study, m: int, jobs: int | None = None) -> int:
    """Worker processes for a level with m contact unknowns; 1 means that this process solves it itself.

    jobs: as the user asks, None for as many as pay
    Points that are not solved in blocks leave workers nothing to do.
    """
    if not in_blocks(study) or os.name != "posix":
        return 1
    if jobs is not None:
        return jobs
    worth = int(seconds(study, m) / WORTH)
    return min(available(), worth) if worth > 1 else 1


def work_words(study: Study, levels: Sequence[LevelForecast], jobs: int | None) -> str:
    """Who will solve the contact problems, in words."""
    most = max((workers(study, level.n_contact, jobs) for level in levels), default=1)
    took = sum(seconds(study, level.n_contact) for level in levels)
    about = f"contact problems: about {took:.1g} s of one process" if took >= WORTH else ""
    who = f"solved by {most} worker processes (--jobs), or by those of a scheduler (--dask)"
    if most == 1:
        return about
    return f"{about}, {who}" if about else f"contact problems {who}"


@contextmanager
def choosing(study: Study, jobs: int | None, dask: str | None = None) -> Iterator[Choice]:
    """Who solves the blocks of each level; workers end with the context, whatever happens.

    dask: address of a scheduler, whose workers solve all of them. Raises WorkersFailed if it does not answer.
    Workers of this machine start at once where the study's levels promise to pay for them, since they take about as
    long as the first mesh.
    """
    here, cluster = Here(), Cluster(dask, jobs) if dask is not None else None
    expected = 1
    if cluster is None and (jobs is not None or seconds(study, FINE) >= 2 * WORTH):
        expected = max((workers(study, one.n_contact, jobs) for one in forecast(study)), default=1)
    pools = [Processes(expected).warm()] if expected > 1 else []

    def choose(study: Study, m: int) -> Executor:
        if cluster is not None:
            return cluster if in_blocks(study) else here
        count = workers(study, m, jobs)
        if count == 1:
            return here
        if not pools:
            pools.append(Processes(count))
        return pools[0].grow(count)

    try:
        yield choose
    finally:
        for pool in pools:
            pool.close()
        if cluster is not None:
            cluster.close()
