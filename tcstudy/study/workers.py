"""What the work of a run is, known before anything is solved, and who does it: this process,
workers, a dask cluster.

`predicted` needs areas and lengths alone; `sizes` counts meshes while they are small, and predicts
others from the last one counted: where h is halved, what lies in triangles grows fourfold, what
lies on edges twofold.

Times, which decide about workers, are those of results/speed.md, t = c Nᵖ for N displacement
unknowns; what users are told is measured (`study.plan`).
"""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import numpy as np

from tcstudy.data import schema
from tcstudy.errors import GeometryFailed
from tcstudy.executors.processes import (
    TIMEOUT,
    Job,
    PackedExecutor,
    ProcessExecutor,
    SerialExecutor,
    available,
)
from tcstudy.scene.mesh_plan import MeshPlan
from tcstudy.scene.points import Scenes
from tcstudy.scene.records import Clamped, Contact
from tcstudy.scene.study import Study
from tcstudy.shapes.edges import body_area, boundary_lengths

POINT, NODE = 0.08e-3, 2.6e-6
"""Seconds that a point takes to the file, and more for each contact unknown (results/online.md, m =
11 to 176)."""
START, LEVEL = 2.0, 0.3
"""Seconds that starting takes, and a level whatever its size."""
STAGES = (4.6e-6, 1.08)
"""(c, p) of all stages of a level, from the refinement of its mesh to its loads, with a heat
problem."""
STEP = 75.0
"""Times as long as a point of a block takes a step of a history (13 ms with 40 nodes, 33 ms with
133)."""
MEMORY, UNKNOWN = 270e6, 2700.0
"""Bytes of the program, and more for each unknown of the finest mesh (2.79 GB at N = 939,518)."""
MOST_NODES = 10_000
"""Nodes up to which a mesh is made only to be counted; half a second."""


@dataclass(frozen=True)
class LevelForecast:
    """One mesh level: element size asked for [m], mesh nodes, displacement unknowns and contact
    unknowns.

    exact: whether they are counted, else predicted
    """

    h: float
    nodes: int
    n_dof: int
    n_contact: int
    exact: bool = False


@dataclass(frozen=True)
class Resources:
    """CPU time [s] and peak memory [byte]; unknown: why the time is not known, then NaN."""

    seconds: float
    memory: float
    unknown: str = ""


def predicted(study: Study) -> tuple[LevelForecast, ...]:
    """Sizes without a mesh of the levels whose number is known beforehand. Raises GeometryFailed if
    a file has no face.

    By Euler's formula with equilateral triangles of edge h (Netgen's for maxh = h have 0.9 to 1.04
    h on average); too low where small features, arcs or grading refine the mesh.
    """
    scene, mesh = study.scenes[0], study.mesh
    if scene.body.brep is None:
        area, lengths = body_area(scene.body), dict(boundary_lengths(scene.body))
    else:
        from tcstudy.fem.geometry import build

        geometry = build(scene.body)
        area, lengths = geometry.area, dict.fromkeys((curve.name for curve in geometry.curves), 0.0)
        for curve in geometry.curves:
            lengths[curve.name] += curve.length
    held = sum(lengths.get(name, 0.0) for name, role in scene.boundary if isinstance(role, Clamped))
    contact = sum(lengths.get(name, 0.0) for name in scene.edges(Contact))
    found = []
    for i in range(1 if mesh.open_ended else mesh.levels):
        h = mesh.maxh[i] if mesh.listed else mesh.maxh[0] / 2**i
        nodes = area / (math.sqrt(3) / 4 * h**2) / 2 + sum(lengths.values()) / h / 2 + 1
        n_dof = 2 * nodes - 2 * held / h - contact / h
        found.append(
            LevelForecast(h, round(nodes), max(1, round(n_dof)), max(1, round(contact / h)))
        )
    return tuple(found)


def sizes(study: Study) -> tuple[LevelForecast, ...]:
    """The same, counted on meshes that are small. Raises GeometryFailed where a run would before it
    solves anything."""
    rough, plan, scene = predicted(study), study.mesh, study.scenes[0]
    if rough[0].nodes > MOST_NODES and not plan.listed:
        return rough
    from tcstudy.fem.forms import constrain, contact_line
    from tcstudy.fem.meshes import Meshes

    held = tuple(item for item in scene.boundary if isinstance(item[1], Clamped | Contact))
    meshes, found = Meshes(study), list[LevelForecast]()
    for level, size in enumerate(rough):
        if found:
            last, before, r = found[-1], rough[level - 1], found[-1].h / size.h
            nodes, n_dof = round(last.nodes * r**2), round(last.n_dof * r**2)
            if plan.listed:  # what small features and arcs add to a mesh of a list they add to all
                nodes = size.nodes + max(0, last.nodes - before.nodes)
                n_dof = size.n_dof + max(0, last.n_dof - before.n_dof)
            size = LevelForecast(size.h, nodes, n_dof, round(last.n_contact * r))
        if size.nodes <= MOST_NODES:
            try:
                mesh = meshes.next(level)
                frames = constrain(mesh, held)
                m = contact_line(mesh, frames, scene.edges(Contact)).m
                size = LevelForecast(size.h, mesh.n_points, frames.n_dof, m, exact=True)
            except (
                GeometryFailed
            ):  # of a list, a mesh that cannot be made is a status of its points
                if level == 0 or not plan.listed:
                    raise
        found.append(size)
    return tuple(found)


def refined(levels: Sequence[LevelForecast], mesh: MeshPlan) -> tuple[LevelForecast, ...]:
    """Levels up to the bound of the unknowns, where an estimate decides about meshes after those
    that are known.

    Adaptive meshes grow about twofold from level to level, others fourfold. The contact line grows
    like N^(3/4), between the N^(1/2) of the body's other boundary and the N of meshes that are
    refined at the contact line only.
    """
    if not levels or not mesh.open_ended:
        return tuple(levels)
    growth, last = mesh.strategy.growth, levels[-1]
    most = max(1.0, mesh.max_dofs / last.n_dof)
    ratios = [
        1.0,
        *itertools.takewhile(
            lambda ratio: ratio < most, (growth**i for i in range(1, mesh.levels))
        ),
    ]
    if len(ratios) < mesh.levels:
        ratios.append(most)
    n_dofs = [round(last.n_dof * ratio) for ratio in ratios]
    return tuple(
        LevelForecast(
            last.h,
            last.nodes + (n_dof - last.n_dof) // 2,
            n_dof,
            round(last.n_contact * ratio**0.75),
        )
        for n_dof, ratio in zip(n_dofs, ratios, strict=True)
    )


def contact_seconds(study: Study, m: int) -> float:
    """About how long the contact problems of a level with m contact unknowns take one process."""
    return len(study.scenes) * (POINT + NODE * m)


def meshing_seconds(mesh: MeshPlan, levels: Sequence[LevelForecast]) -> float:
    """Seconds of this processor for the meshes that Netgen makes itself; fewer triangles than
    SAMPLE take none."""
    from tcstudy.fem import meshes

    triangles = (
        sum(2 * level.nodes for level in (levels[:1] if mesh.nested else levels)) / 4**mesh.refine
    )
    return triangles / meshes.triangles_a_second() if triangles > meshes.SAMPLE else 0.0


def of_history(study: Study, n_dof: int, m: int) -> Resources:
    """What the steps of one point are expected to take, with so many unknowns of the body and its
    contact line."""
    assert study.history is not None
    each = contact_seconds(study, m) / len(study.scenes)
    return Resources(study.history.steps * STEP * each, MEMORY + UNKNOWN * n_dof)


def of_geometry(study: Study) -> Resources:
    """What all points of a geometry of a sweep are expected to take, without a look at its
    meshes."""
    levels, (c, p) = refined(predicted(study), study.mesh), STAGES
    spent = sum(LEVEL + c * v.n_dof**p + contact_seconds(study, v.n_contact) for v in levels)
    memory = MEMORY + UNKNOWN * max(v.n_dof for v in levels)
    return Resources(spent + meshing_seconds(study.mesh, levels), memory)


def expected_bytes(study: Study, levels: Sequence[LevelForecast] | None = None) -> int:
    """Rough size of the result file, the most to expect where an estimate decides about meshes.

    levels: sizes of those that are known, None to predict them
    """
    if study.variants:
        own = [one.study for one in study.variants if one.study is not None]
        shared = schema.shared_bytes(own[0], [(0, 0)] * study.mesh.levels)
        options = sum(len("\n".join(one.overrides).encode()) for one in own)
        return shared + options + sum(expected_bytes(one) - shared for one in own)
    try:
        levels = predicted(study) if levels is None else levels
    except GeometryFailed:  # which is said elsewhere
        levels = ()
    if study.history is not None:
        from tcstudy.data.tables import history_variables

        sizes = {"step": study.history.steps + 1, "node": study.history.of(levels).n_contact}
        return schema.expected_bytes(study, ()) + schema.bytes_of(
            study, history_variables(study), sizes
        )
    return schema.expected_bytes(
        study, [(level.n_contact, level.nodes) for level in refined(levels, study.mesh)]
    )


# -- who does it
# ------------------------------------------------------------------------------------

T = TypeVar("T")
BlockExecutor = Callable[[Study, int], SerialExecutor]
"""(study, contact unknowns of a level) → who solves its blocks."""
WORTH = 2.0
"""Seconds of work from which a worker is worth its start, of about half a second."""
SHARE = 0.5
"""Of the memory of this machine, for workers with a geometry or a history each."""
SLOW = 50.0
"""How many times the forecast a worker may take before it counts as hanging."""


def paying(seconds: float, jobs: int | None, start: float = 0.0) -> int:
    """Worker processes for work of so many seconds; 1 means that this process does it itself.
    jobs: as the user asks, None for as many as pay;  start: seconds that each needs before it works"""
    if os.name != "posix":
        return 1
    if jobs is not None:
        return jobs
    worth = int(seconds / (WORTH + start))
    return min(available(), worth) if worth > 1 else 1


def for_blocks(study: Study, m: int, jobs: int | None = None) -> int:
    """The same for a level with m contact unknowns; points that are not solved in blocks leave
    workers nothing."""
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
    return (
        float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")
        if hasattr(os, "sysconf")
        else np.inf
    )


class WorkerPool:
    """Those who work in a run and end with it."""

    def __init__(self, jobs: int | None = None, dask: str | None = None) -> None:
        """jobs: worker processes, None for as many as pay;  dask: address of a scheduler whose workers do it"""
        self.jobs, self.dask = jobs, dask
        self._cluster: PackedExecutor | None = None
        self._pool: ProcessExecutor | None = None

    def ready(self, study: Study) -> WorkerPool:
        """The same, connected to the scheduler, or with workers of this machine where the levels
        promise to pay.

        These take as long to start as what a run has to do, and to import, before its first block.
        Raises WorkersFailed if the scheduler does not answer.
        """
        if self.dask is not None:
            from tcstudy.executors.cluster import DaskExecutor

            self._cluster = self._cluster or DaskExecutor(self.dask, self.jobs)
        elif self._pool is None:
            count = 1
            if study.variants or study.history is not None:
                count = min(self.jobs or 1, len(study.variants) or len(study.scenes))
            elif study.scenes[0].body.brep is None:  # which only the kernel can measure
                count = max(for_blocks(study, one.n_contact, self.jobs) for one in predicted(study))
            if count > 1:
                self._pool = ProcessExecutor(count).warm()
        return self

    def blocks(self, study: Study, m: int) -> SerialExecutor:
        """Who solves the blocks of a level with m contact unknowns."""
        if self._cluster is not None:
            return self._cluster if study.solver.in_blocks else SerialExecutor()
        return self._of(for_blocks(study, m, self.jobs))

    def whole(self, calls: Sequence[Resources], start: float = 0.0) -> SerialExecutor | None:
        """Who does calls that take so much, after `start` seconds; None where this process does
        without."""
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
    executor: SerialExecutor,
    function: Callable[..., T],
    study: Study,
    *given: object,
    name: str,
    seconds: float = 0.0,
) -> Future[T]:
    """Have function(study, *given) done by a worker anywhere; the file of a body, if any, travels
    as its content.

    seconds: that it is expected to take
    """
    brep = study.scenes[0].body.brep
    content = brep.path.read_bytes() if brep is not None else None
    job = Job(_with_file, name, max(TIMEOUT, SLOW * seconds))
    return executor.submit(job, content, function, study, *given)


def _with_file(
    content: bytes | None, function: Callable[..., T], study: Study, *given: object
) -> T:
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
