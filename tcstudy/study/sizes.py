"""Sizes of the meshes of a run, and what its work takes, known before anything is solved.

`predicted` needs areas and lengths alone; `sizes` counts on meshes that take milliseconds. Uniform refinement of a mesh
with V nodes, T triangles and the Euler characteristic χ makes T' = 4T and V' = V + E with E = V + T − χ edges; what the
boundary carries (constraints, contact unknowns) grows affinely in 2^level, so that two meshes tell the sizes of all.
Other meshes are counted while they are small, and predicted from the last one counted.

Times, which decide about workers, are those of results/speed.md, t = c Nᵖ for N displacement unknowns; what users are
told is measured (`study.plan`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tcstudy.data import schema
from tcstudy.errors import GeometryFailed
from tcstudy.scene.records import Clamped, Contact, Scene
from tcstudy.scene.study import MeshPlan, Study
from tcstudy.shapes.edges import body_area, boundary_lengths

if TYPE_CHECKING:
    from tcstudy.fem.meshes import Meshes, PlaneMesh

POINT, NODE = 0.08e-3, 2.6e-6
"""Seconds that a point takes to the file, and more for each contact unknown (results/online.md, m = 11 to 176)."""
START, LEVEL = 2.0, 0.3
"""Seconds that starting takes, and a level whatever its size."""
STAGES = (4.6e-6, 1.08)
"""(c, p) of all stages of a level, from the refinement of its mesh to its loads, with a heat problem."""
STEP = 75.0
"""Times as long as a point of a block takes a step of a history (13 ms with 40 nodes, 33 ms with 133)."""
MEMORY, UNKNOWN = 270e6, 2700.0
"""Bytes of the program, and more for each unknown of the finest mesh (2.79 GB at N = 939,518)."""
MOST_NODES = 5_000
"""Nodes up to which a mesh is made only to be counted; with its first refinement half a second."""


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


@dataclass(frozen=True)
class Resources:
    """CPU time [s] of one process and peak memory [byte]; unknown: why the time is not known, then NaN.

    shared:  seconds of these that worker processes take off this one
    workers: processes that will do it, 1 for this one alone;  worker_memory: peak of each of them [byte]
    """

    seconds: float
    memory: float
    unknown: str = ""
    shared: float = 0.0
    workers: int = 1
    worker_memory: float = 0.0

    @property
    def wall(self) -> float:
        """Seconds that pass with these workers."""
        return self.seconds - self.shared * (1.0 - 1.0 / self.workers)


def predicted(study: Study) -> tuple[LevelForecast, ...]:
    """Sizes without a mesh of the levels whose number is known beforehand. Raises GeometryFailed if a file has no face.

    By Euler's formula with equilateral triangles of edge h (Netgen's for maxh = h have 0.9 to 1.04 h on average); too
    low where small features, arcs or grading refine the mesh.
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
        found.append(LevelForecast(h, round(nodes), max(1, round(n_dof)), max(1, round(contact / h))))
    return tuple(found)


def sizes(study: Study) -> tuple[LevelForecast, ...]:
    """The same, counted on meshes that are small.

    Raises GeometryFailed where a run would before it solves anything.
    """
    rough, plan, scene = predicted(study), study.mesh, study.scenes[0]
    if rough[0].nodes > MOST_NODES and not plan.listed:
        return rough
    from tcstudy.fem.meshes import Meshes

    meshes, found = Meshes(study), list[LevelForecast]()
    if plan.nested:
        return tuple(_nested(meshes, scene, rough))
    for level, guess in enumerate(rough):
        size = _grown(found[-1], rough[level - 1], guess, plan.listed) if found else guess
        if size.nodes <= MOST_NODES:
            try:
                size = _counted(meshes.next(level), scene, guess.h)
            except GeometryFailed:  # of a list, a mesh that cannot be made is a status of its points
                if level == 0 or not plan.listed:
                    raise
        found.append(size)
    return tuple(found)


def _nested(meshes: Meshes, scene: Scene, rough: Sequence[LevelForecast]) -> Iterator[LevelForecast]:
    """Uniform refinements of one mesh, exactly."""
    coarse = meshes.next(0)
    first = _counted(coarse, scene, rough[0].h)
    second = _counted(meshes.next(1), scene, rough[1].h) if len(rough) > 1 else first
    nodes, triangles = first.nodes, len(coarse.triangles)
    euler = first.nodes - (second.nodes - first.nodes) + triangles  # a new node for every edge
    fixed = [2 * one.nodes - one.n_dof for one in (first, second)]
    for level, one in enumerate(rough):
        n_dof = 2 * nodes - fixed[0] - (fixed[1] - fixed[0]) * (2**level - 1)
        n_contact = first.n_contact + (second.n_contact - first.n_contact) * (2**level - 1)
        yield LevelForecast(one.h, nodes, n_dof, n_contact, exact=True)
        nodes, triangles = 2 * nodes + triangles - euler, 4 * triangles


def _counted(mesh: PlaneMesh, scene: Scene, h: float) -> LevelForecast:
    from tcstudy.fem.boundary import constrain, contact_line

    held = tuple(item for item in scene.boundary if isinstance(item[1], Clamped | Contact))
    frames = constrain(mesh, held)
    line = contact_line(mesh, frames, scene.edges(Contact))
    return LevelForecast(h, mesh.n_points, frames.n_dof, line.m, exact=True)


def _grown(known: LevelForecast, rough: LevelForecast, guess: LevelForecast, listed: bool) -> LevelForecast:
    """The mesh after one that is known; rough, guess: that one and this as they are predicted.

    What small features and arcs add to a mesh of a list they add to all; graded meshes grow by the same factors.
    """
    n_contact = round(known.n_contact * rough.h / guess.h)
    if not listed:
        r = (rough.h / guess.h) ** 2
        return LevelForecast(guess.h, round(known.nodes * r), round(known.n_dof * r), n_contact)
    nodes, n_dof = (max(0, getattr(known, name) - getattr(rough, name)) for name in ("nodes", "n_dof"))
    return LevelForecast(guess.h, guess.nodes + nodes, guess.n_dof + n_dof, n_contact)


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


def contact_seconds(study: Study, m: int) -> float:
    """About how long the contact problems of a level with m contact unknowns take one process."""
    return len(study.scenes) * (POINT + NODE * m)


def meshing_seconds(mesh: MeshPlan, levels: Sequence[LevelForecast]) -> float:
    """Seconds of this processor for the meshes that Netgen makes itself; fewer triangles than SAMPLE take none."""
    from tcstudy.fem import meshes

    triangles = sum(2 * level.nodes for level in (levels[:1] if mesh.nested else levels)) / 4**mesh.refine
    return triangles / meshes.triangles_a_second() if triangles > meshes.SAMPLE else 0.0


def of_history(study: Study, n_dof: int, m: int) -> Resources:
    """What the steps of one point are expected to take, with so many unknowns of the body and its contact line."""
    assert study.history is not None
    each = contact_seconds(study, m) / len(study.scenes)
    return Resources(study.history.steps * STEP * each, MEMORY + UNKNOWN * n_dof)


def of_geometry(study: Study) -> Resources:
    """What all points of a geometry of a sweep are expected to take, without a look at its meshes."""
    levels, (c, p) = refined(predicted(study), study.mesh), STAGES
    spent = sum(LEVEL + c * v.n_dof**p + contact_seconds(study, v.n_contact) for v in levels)
    memory = MEMORY + UNKNOWN * max(v.n_dof for v in levels)
    return Resources(spent + meshing_seconds(study.mesh, levels), memory)


def expected_bytes(study: Study, levels: Sequence[LevelForecast] | None = None) -> int:
    """Rough size of the result file, the most to expect where an estimate decides about meshes.

    levels: sizes of those that are known, None to predict them
    """
    if study.variants:
        return sum(expected_bytes(one.study) for one in study.variants if one.study is not None)
    try:
        levels = predicted(study) if levels is None else levels
    except GeometryFailed:  # which is said elsewhere
        levels = ()
    if study.history is not None:
        from tcstudy.data.tables import history_bytes

        return history_bytes(study, study.history.of(levels).n_contact)
    return schema.expected_bytes(study, [(level.n_contact, level.nodes) for level in refined(levels, study.mesh)])
