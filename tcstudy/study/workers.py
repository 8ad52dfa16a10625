"""Forecast the work of a run before anything is solved, and choose who does it: this process,
workers, or a dask cluster.

`predicted_sizes` needs areas and lengths alone. `counted_sizes` counts meshes while they are small,
and extrapolates from the last one counted: where h is halved, what lies in triangles grows
fourfold, what lies on edges twofold.

Times decide about workers; they are those of results/speed.md, t = c Nᵖ for N displacement
unknowns. Times that users read are measured (`study.plan`).
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, TypeVar

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
from tcstudy.scene.records import Body, Clamped, Contact, Scene
from tcstudy.scene.study import Study
from tcstudy.shapes.edges import body_area, boundary_lengths

if TYPE_CHECKING:
    from tcstudy.fem.meshes import PlaneMesh

SECONDS_PER_POINT = 0.08e-3
"""Time that a point takes to the file (results/online.md, m = 11 to 176)."""
SECONDS_PER_NODE = 2.6e-6
"""Time that it takes more for each contact unknown."""
START_SECONDS = 2.0
"""Time that the program takes to start."""
LEVEL_SECONDS = 0.3
"""Time that a level takes whatever its size."""
STAGE_SECONDS = 4.6e-6
"""c of all stages of a level, from the refinement of its mesh to its loads, with a heat problem."""
STAGE_EXPONENT = 1.08
"""p of the same."""
POINTS_PER_STEP = 75.0
"""Points of a block that take as long as a step of a history (13 ms, m = 40; 33 ms, m = 133)."""
PROGRAM_BYTES = 270e6
"""Memory of the program."""
BYTES_PER_UNKNOWN = 2700.0
"""Memory for each displacement unknown of the finest mesh (2.79 GB at N = 939,518)."""
MAX_COUNTED_NODES = 10_000
"""Nodes up to which a mesh is made only to be counted, which takes half a second."""


@dataclass(frozen=True)
class LevelForecast:
    """Sizes of a mesh level.

    h: target element size [m];  nodes: of the mesh
    n_dof: displacement DOFs;  n_contact: contact DOFs
    exact: whether they are counted, not predicted
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


def predicted_sizes(study: Study) -> tuple[LevelForecast, ...]:
    """Return sizes of the levels whose number is known beforehand, without a mesh.

    They follow from Euler's formula with equilateral triangles of edge h (Netgen's for maxh = h
    have 0.9 to 1.04 h on average). They are too low where small features, arcs or grading refine
    the mesh. Raises GeometryFailed if a file has no face.
    """
    scene, mesh = study.scenes[0], study.mesh
    area, lengths = _area_and_lengths(scene.body)
    boundary = sum(lengths.values())
    clamped = 0.0
    for name, role in scene.boundary:
        if isinstance(role, Clamped):
            clamped += lengths.get(name, 0.0)
    contact = sum(lengths.get(name, 0.0) for name in scene.edges(Contact))
    opening = sum(lengths.get(name, 0.0) for name in scene.opening_edges)
    forecasts = list[LevelForecast]()
    for i in range(1 if mesh.open_ended else mesh.levels):
        h = mesh.maxh[i] if mesh.listed else mesh.maxh[0] / 2**i
        nodes = area / (math.sqrt(3) / 4 * h**2) / 2 + boundary / h / 2 + 1
        n_dof = max(1, round(2 * nodes - 2 * clamped / h - (contact - opening) / h))
        n_contact = max(1, round((contact + opening) / h))
        forecasts.append(LevelForecast(h, round(nodes), n_dof, n_contact))
    return tuple(forecasts)


def _area_and_lengths(body: Body) -> tuple[float, dict[str, float]]:
    """Return the area of a body [m²] and the lengths of its edges by name [m]."""
    if body.brep is None:
        return body_area(body), dict(boundary_lengths(body))
    from tcstudy.fem.geometry import build

    geometry = build(body)
    lengths = dict[str, float]()
    for curve in geometry.curves:
        lengths[curve.name] = lengths.get(curve.name, 0.0) + curve.length
    return geometry.area, lengths


def counted_sizes(study: Study) -> tuple[LevelForecast, ...]:
    """Return sizes of the levels, counted on meshes that are small.

    Raises GeometryFailed where a run would before it solves anything.
    """
    predictions = predicted_sizes(study)
    plan, scene = study.mesh, study.scenes[0]
    if predictions[0].nodes > MAX_COUNTED_NODES and not plan.listed:
        return predictions
    from tcstudy.fem.meshes import Meshes

    meshes = Meshes(study)
    forecasts = list[LevelForecast]()
    for level, forecast in enumerate(predictions):
        if level > 0:
            before = predictions[level - 1]
            forecast = _extrapolated(forecast, forecasts[-1], before, plan.listed)
        if forecast.nodes <= MAX_COUNTED_NODES:
            try:
                forecast = _counted(meshes.next(level), scene, forecast.h)
            except GeometryFailed:  # in a list, a mesh that fails is a status of its points
                if level == 0 or not plan.listed:
                    raise
        forecasts.append(forecast)
    return tuple(forecasts)


def _extrapolated(
    predicted: LevelForecast, coarser: LevelForecast, predicted_coarser: LevelForecast, listed: bool
) -> LevelForecast:
    """Return the sizes of a level from those of the level before, which may be counted.

    In a list of meshes, small features and arcs add as many nodes to one mesh as to the next.
    """
    ratio = coarser.h / predicted.h
    if listed:
        nodes = predicted.nodes + max(0, coarser.nodes - predicted_coarser.nodes)
        n_dof = predicted.n_dof + max(0, coarser.n_dof - predicted_coarser.n_dof)
    else:
        nodes = round(coarser.nodes * ratio**2)
        n_dof = round(coarser.n_dof * ratio**2)
    return LevelForecast(predicted.h, nodes, n_dof, round(coarser.n_contact * ratio))


def _counted(mesh: PlaneMesh, scene: Scene, h: float) -> LevelForecast:
    from tcstudy.fem.forms import constrain, contact_line
    from tcstudy.fem.openings import opening_line

    constrained = [item for item in scene.boundary if isinstance(item[1], Clamped | Contact)]
    frames = constrain(mesh, tuple(constrained))
    line = contact_line(mesh, frames, scene.edges(Contact))
    m = line.m
    if scene.opens:
        m += opening_line(mesh, frames, line, scene.opening_edges).m
    return LevelForecast(h, mesh.n_points, frames.n_dof, m, exact=True)


def with_refinement(levels: Sequence[LevelForecast], mesh: MeshPlan) -> tuple[LevelForecast, ...]:
    """Return the levels up to the limit of the unknowns, where an estimate decides about meshes.

    Adaptive meshes grow about twofold from level to level, others fourfold. The contact line grows
    like N^(3/4), between the N^(1/2) of the body's other boundary and the N of meshes that are
    refined at the contact line only.
    """
    if not levels or not mesh.open_ended:
        return tuple(levels)
    growth = mesh.strategy.growth
    last_known = levels[-1]
    max_ratio = max(1.0, mesh.max_dofs / last_known.n_dof)
    ratios = [1.0]
    while len(ratios) < mesh.levels and growth ** len(ratios) < max_ratio:
        ratios.append(growth ** len(ratios))
    if len(ratios) < mesh.levels:
        ratios.append(max_ratio)
    forecasts = list[LevelForecast]()
    for ratio in ratios:
        n_dof = round(last_known.n_dof * ratio)
        nodes = last_known.nodes + (n_dof - last_known.n_dof) // 2
        n_contact = round(last_known.n_contact * ratio**0.75)
        forecasts.append(LevelForecast(last_known.h, nodes, n_dof, n_contact))
    return tuple(forecasts)


def contact_seconds(study: Study, m: int) -> float:
    """Return the time that one process takes for the contact problems of a level."""
    return len(study.scenes) * (SECONDS_PER_POINT + SECONDS_PER_NODE * m)


def meshing_seconds(mesh: MeshPlan, levels: Sequence[LevelForecast]) -> float:
    """Return the time of this processor for the meshes that Netgen makes itself.

    Fewer triangles than SAMPLE take none.
    """
    from tcstudy.fem import meshes

    meshed = levels[:1] if mesh.nested else levels
    triangles = sum(2 * level.nodes for level in meshed) / 4**mesh.refine
    if triangles <= meshes.SAMPLE:
        return 0.0
    return triangles / meshes.triangles_a_second()


def history_resources(study: Study, n_dof: int, m: int) -> Resources:
    """Return what the steps of one point take.

    n_dof: displacement DOFs;  m: contact DOFs
    """
    assert study.history is not None
    seconds_per_point = contact_seconds(study, m) / len(study.scenes)
    seconds = study.history.steps * POINTS_PER_STEP * seconds_per_point
    return Resources(seconds, PROGRAM_BYTES + BYTES_PER_UNKNOWN * n_dof)


def geometry_resources(study: Study) -> Resources:
    """Return what all points of a geometry of a sweep take, without a look at its meshes."""
    levels = with_refinement(predicted_sizes(study), study.mesh)
    seconds = 0.0
    for level in levels:
        stages = LEVEL_SECONDS + STAGE_SECONDS * level.n_dof**STAGE_EXPONENT
        seconds += stages + contact_seconds(study, level.n_contact)
    max_dofs = max(level.n_dof for level in levels)
    return Resources(
        seconds + meshing_seconds(study.mesh, levels),
        PROGRAM_BYTES + BYTES_PER_UNKNOWN * max_dofs,
    )


def expected_bytes(study: Study, levels: Sequence[LevelForecast] | None = None) -> int:
    """Return the rough size of the result file, its largest where an estimate decides about meshes.

    levels: sizes of those that are known, None to predict them
    """
    if study.variants:
        return _bytes_of_geometries(study)
    try:
        levels = predicted_sizes(study) if levels is None else levels
    except GeometryFailed:  # which is reported elsewhere
        levels = ()
    if study.history is not None:
        from tcstudy.data.tables import history_variables

        n_contact = study.history.of(levels).n_contact
        sizes = {"step": study.history.steps + 1, "node": n_contact}
        variables = history_variables(study)
        return schema.expected_bytes(study, ()) + schema.bytes_of(study, variables, sizes)
    counts = [(level.n_contact, level.nodes) for level in with_refinement(levels, study.mesh)]
    return schema.expected_bytes(study, counts)


def _bytes_of_geometries(study: Study) -> int:
    """Return the size of the file of a sweep over geometries."""
    geometries = [variant.study for variant in study.variants if variant.study is not None]
    shared = schema.shared_bytes(geometries[0], [(0, 0)] * study.mesh.levels)
    total = shared
    for geometry in geometries:
        options = "\n".join(geometry.overrides).encode()
        total += len(options) + expected_bytes(geometry) - shared
    return total


# -- who does the work

T = TypeVar("T")
BlockExecutor = Callable[[Study, int], SerialExecutor]
"""(study, contact DOFs of a level) → who solves its blocks."""
MIN_SECONDS_PER_WORKER = 2.0
"""Work from which a worker is worth its start, which takes about half a second."""
MEMORY_SHARE = 0.5
"""Share of the memory of this machine for workers that have a geometry or a history each."""
MAX_DELAY = 50.0
"""Multiple of the forecast that a worker may take before it counts as hanging."""


def worker_count(seconds: float, jobs: int | None, start: float = 0.0) -> int:
    """Return the number of worker processes for work; 1: this process does it itself.

    seconds: of the work;  jobs: as the user asks, None for as many as pay
    start:   seconds that each worker needs before it works
    """
    if os.name != "posix":
        return 1
    if jobs is not None:
        return jobs
    worth = int(seconds / (MIN_SECONDS_PER_WORKER + start))
    return min(available(), worth) if worth > 1 else 1


def block_workers(study: Study, m: int, jobs: int | None = None) -> int:
    """Return the number of workers for the blocks of a level with m contact DOFs.

    Points that are not solved in blocks leave workers nothing.
    """
    if not study.in_blocks:
        return 1
    return worker_count(contact_seconds(study, m), jobs)


def call_workers(calls: Sequence[Resources], jobs: int | None, start: float = 0.0) -> int:
    """Return the number of workers for calls.

    Unless the user asks for them, there are no more than this machine has the memory for.
    """
    if not calls:
        return 1
    count = worker_count(sum(call.seconds for call in calls), jobs, start)
    if jobs is None and count > 1:
        memory = max(call.memory for call in calls)
        count = min(count, max(1, int(MEMORY_SHARE * _memory() / memory)))
    return max(1, min(len(calls), count))


def _memory() -> float:
    """Return the memory of this machine [byte]."""
    if not hasattr(os, "sysconf"):
        return math.inf
    return float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")


class WorkerPool:
    """The workers of a run, which end with it."""

    def __init__(self, jobs: int | None = None, dask: str | None = None) -> None:
        """Start no worker yet.

        jobs: worker processes, None for as many as pay
        dask: address of a scheduler whose workers do the work
        """
        self.jobs = jobs
        self.dask = dask
        self._cluster: PackedExecutor | None = None
        self._pool: ProcessExecutor | None = None

    def ready(self, study: Study) -> WorkerPool:
        """Return the pool itself, connected to the scheduler, or with workers started if they pay.

        Workers start while a run does what comes before its first block, and imports take as long.
        Raises WorkersFailed if the scheduler does not answer.
        """
        if self.dask is not None:
            from tcstudy.executors.cluster import DaskExecutor

            self._cluster = self._cluster or DaskExecutor(self.dask, self.jobs)
        elif self._pool is None:
            count = self._expected_workers(study)
            if count > 1:
                self._pool = ProcessExecutor(count).warm()
        return self

    def _expected_workers(self, study: Study) -> int:
        if study.variants or study.history is not None:
            return min(self.jobs or 1, len(study.variants) or len(study.scenes))
        if study.scenes[0].body.brep is not None:  # which only the kernel can measure
            return 1
        levels = predicted_sizes(study)
        return max(block_workers(study, level.n_contact, self.jobs) for level in levels)

    def executor_of_blocks(self, study: Study, m: int) -> SerialExecutor:
        """Return who solves the blocks of a level with m contact DOFs."""
        if self._cluster is not None:
            return self._cluster if study.in_blocks else SerialExecutor()
        return self._of(block_workers(study, m, self.jobs))

    def executor_of_calls(
        self, calls: Sequence[Resources], start: float = 0.0
    ) -> SerialExecutor | None:
        """Return who does calls, which begin after `start` seconds; None for this process."""
        if self._cluster is not None:
            return self._cluster if len(calls) > 1 else None
        count = call_workers(calls, self.jobs, start)
        return self._of(count) if count > 1 else None

    def close(self) -> None:
        """End all workers, whatever they do."""
        for executor in (self._pool, self._cluster):
            if executor is not None:
                executor.shutdown()
        self._pool = None
        self._cluster = None

    def _of(self, count: int) -> SerialExecutor:
        if count <= 1:
            return SerialExecutor()
        self._pool = (self._pool or ProcessExecutor(count)).grow(count)
        return self._pool


def submit(
    executor: SerialExecutor,
    function: Callable[..., T],
    study: Study,
    *arguments: object,
    name: str,
    seconds: float = 0.0,
) -> Future[T]:
    """Submit function(study, *arguments) to a worker anywhere.

    The file of a body, if any, travels as its content.
    seconds: that the call is expected to take
    """
    brep = study.scenes[0].body.brep
    content = brep.path.read_bytes() if brep is not None else None
    job = Job(_with_file, name, max(TIMEOUT, MAX_DELAY * seconds))
    return executor.submit(job, content, function, study, *arguments)


def _with_file(
    content: bytes | None, function: Callable[..., T], study: Study, *arguments: object
) -> T:
    """Call a function with a study whose body is read from the content of its file, if any."""
    if content is None:
        return function(study, *arguments)
    with TemporaryDirectory(prefix="tcstudy-") as folder:
        body = study.scenes[0].body
        assert body.brep is not None
        path = Path(folder, body.brep.path.name)
        path.write_bytes(content)
        copy = replace(body, brep=replace(body.brep, path=path))
        return function(replace(study, scenes=Scenes.of(study.scenes).on(copy)), *arguments)
