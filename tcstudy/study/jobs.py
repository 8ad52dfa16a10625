"""Who works in a run: this process, as many workers as pay, or a dask cluster.

What pays follows from sizes of meshes that are not made: predicted from areas and lengths, so that nothing waits for a
mesher.
"""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import numpy as np

from tcstudy.executors import TIMEOUT, DaskExecutor, Job, ProcessExecutor, SerialExecutor, available
from tcstudy.scene.points import Scenes
from tcstudy.scene.records import Clamped, Contact, Scene
from tcstudy.scene.study import MeshPlan, Study
from tcstudy.shapes.edges import body_area, boundary_lengths

T = TypeVar("T")
Choice = Callable[[Study, int], SerialExecutor]
"""(study, contact unknowns of a level) → who solves its blocks."""
POINT, NODE = 0.08e-3, 2.6e-6
"""Seconds that a point takes to the file, and more for each contact unknown (results/online.md, m = 11 to 176)."""
FINE = 2000
"""Contact unknowns of a fine level: where these would not pay for workers no forecast is made."""
WORTH = 2.0
"""Seconds of work from which a worker is worth its start, of about half a second."""


@dataclass(frozen=True)
class LevelForecast:
    """One mesh level: element size asked for [m], mesh nodes, displacement unknowns and contact unknowns.

    exact: whether they are counted, else predicted
    """

    h: float
    nodes: int
    n_dof: int
    n_contact: int
    exact: bool = False


def known_levels(mesh: MeshPlan) -> list[float]:
    """Element sizes of the levels whose number is known beforehand."""
    known = 1 if mesh.open_ended else mesh.levels
    return [mesh.maxh[i] if mesh.listed else mesh.maxh[0] / 2**i for i in range(known)]


def forecast(study: Study) -> tuple[LevelForecast, ...]:
    """Predicted sizes of these levels; empty for a body from a file, which is not measured here.

    Too low where small features, arcs or grading refine the mesh: `sizes` counts.
    """
    scene = study.scenes[0]
    if scene.body.brep is not None:
        return ()
    area, lengths = body_area(scene.body), boundary_lengths(scene.body)
    return tuple(predicted(scene, area, lengths, h) for h in known_levels(study.mesh))


def predicted(scene: Scene, area: float, lengths: Mapping[str, float], h: float) -> LevelForecast:
    """Euler's formula with equilateral triangles of edge h (Netgen's for maxh = h have 0.9 to 1.04 h on average).

    area: of the body [m²];  lengths: of its edges by name [m]
    """
    triangles = area / (math.sqrt(3) / 4 * h**2)
    nodes = triangles / 2 + sum(lengths.values()) / h / 2 + 1
    held = sum(lengths.get(name, 0.0) / h for name, role in scene.boundary if isinstance(role, Clamped))
    contact = sum(lengths.get(name, 0.0) / h for name in scene.edges(Contact))
    n_dof = 2 * nodes - 2 * held - contact
    return LevelForecast(h, round(nodes), max(1, round(n_dof)), max(1, round(contact)))


def refined(levels: Sequence[LevelForecast], mesh: MeshPlan) -> tuple[LevelForecast, ...]:
    """Levels up to the bound of the unknowns, where an estimate decides about meshes after those that are known.

    Adaptive meshes grow about twofold from level to level, others fourfold. The contact line grows like N^(3/4),
    between the N^(1/2) of the body's other boundary and the N of meshes that are refined at the contact line only.
    """
    if not levels or not mesh.open_ended:
        return tuple(levels)
    growth, last = mesh.strategy.growth, levels[-1]
    most = max(1.0, mesh.max_dofs / last.n_dof)
    ratios = [1.0, *itertools.takewhile(lambda ratio: ratio < most, (growth**i for i in range(1, mesh.levels)))]
    if len(ratios) < mesh.levels:
        ratios.append(most)
    n_dofs = [round(last.n_dof * ratio) for ratio in ratios]
    return tuple(
        LevelForecast(last.h, last.nodes + (n_dof - last.n_dof) // 2, n_dof, round(last.n_contact * ratio**0.75))
        for n_dof, ratio in zip(n_dofs, ratios, strict=True)
    )


def seconds(study: Study, m: int) -> float:
    """About how long the contact problems of a level with m contact unknowns take one process."""
    return len(study.scenes) * (POINT + NODE * m)


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


def workers(study: Study, m: int, jobs: int | None = None) -> int:
    """The same for a level with m contact unknowns; points that are not solved in blocks leave workers nothing."""
    return paying(seconds(study, m), jobs) if study.solver.in_blocks else 1


@dataclass(frozen=True)
class Resources:
    """CPU time [s] of one process and peak memory [byte]; unknown: why the time is not known, then NaN."""

    seconds: float
    memory: float
    unknown: str = ""


SHARE = 0.5
"""Of the memory of this machine, for workers with a geometry or a history each."""


def crew(calls: Sequence[Resources], jobs: int | None, start: float = 0.0) -> int:
    """Worker processes for calls, as many as pay and this machine has the memory for, or as the user asks.

    start: seconds that each needs before it works
    """
    if not calls:
        return 1
    memory = max(one.memory for one in calls)
    most = len(calls) if jobs is not None else max(1, int(SHARE * _memory() / memory))
    return max(1, min(len(calls), paying(sum(one.seconds for one in calls), jobs, start), most))


def _memory() -> float:
    """Of this machine [byte]."""
    return float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else np.inf


class Staff:
    """Those who work in a run and end with it."""

    def __init__(self, jobs: int | None = None, dask: str | None = None) -> None:
        """jobs: worker processes, None for as many as pay;  dask: address of a scheduler whose workers do it"""
        self.jobs, self.dask = jobs, dask
        self._cluster: DaskExecutor | None = None
        self._pool: ProcessExecutor | None = None

    def early(self, study: Study) -> Staff:
        """Start workers of this machine at once where the levels promise to pay for them.

        It takes as long as what a run has to do, and to import, before its first block.
        """
        if self.dask is None and self._pool is None and (self.jobs is not None or seconds(study, FINE) >= 2 * WORTH):
            if study.variants or study.history is not None:
                count = min(self.jobs or 1, len(study.variants) or len(study.scenes))
            else:
                count = max((workers(study, one.n_contact, self.jobs) for one in forecast(study)), default=1)
            if count > 1:
                self._pool = ProcessExecutor(count).warm()
        return self

    def ready(self, study: Study) -> Staff:
        """The same, and connected to the scheduler. Raises WorkersFailed if it does not answer."""
        if self.dask is not None and self._cluster is None:
            self._cluster = DaskExecutor(self.dask, self.jobs)
        return self.early(study)

    def blocks(self, study: Study, m: int) -> SerialExecutor:
        """Who solves the blocks of a level with m contact unknowns."""
        if self._cluster is not None:
            return self._cluster if study.solver.in_blocks else SerialExecutor()
        return self._of(workers(study, m, self.jobs))

    def whole(self, calls: Sequence[Resources], start: float = 0.0) -> SerialExecutor | None:
        """Who does calls that take so much, after `start` seconds; None where this process does without."""
        if self._cluster is not None:
            return self._cluster if len(calls) > 1 else None
        count = crew(calls, self.jobs, start)
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


SLOW = 50.0
"""How many times the forecast a worker may take before it counts as hanging."""


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
