"""Sizes of the meshes of a run, and roughly what its geometries and histories take, for the choice of workers.

Sizes are counted on the coarsest mesh, which takes milliseconds. Uniform refinement of a mesh with V nodes, T triangles
and the Euler characteristic χ makes T' = 4T and V' = V + E with E = V + T − χ edges; what the boundary carries
(constraints, contact unknowns) grows affinely in 2^level. Two meshes therefore tell the sizes of all. Other meshes are
made as long as they are small, and predicted from the last one made.

Times are those of results/speed.md, t = c Nᵖ for N displacement unknowns; what users are told is measured
(`study.trial`).
"""

from __future__ import annotations

from collections.abc import Sequence

from tcstudy.errors import GeometryFailed
from tcstudy.fem.boundary import constrain, contact_line
from tcstudy.fem.geometry import Geometry, build
from tcstudy.fem.meshes import SAMPLE, PlaneMesh, triangles_a_second
from tcstudy.fem.study_meshes import Meshes
from tcstudy.scene.records import Clamped, Contact, Scene
from tcstudy.scene.study import MeshPlan, Study
from tcstudy.study.jobs import (
    LevelForecast,
    Resources,
    crew,
    forecast,
    known_levels,
    predicted,
    refined,
    workers,
)
from tcstudy.study.jobs import seconds as contact_seconds

START, LEVEL = 2.0, 0.3
"""Seconds that starting takes, and a level whatever its size."""
STAGES = (4.6e-6, 1.08)
"""(c, p) of all stages of a level, from the refinement of its mesh to its loads, with a heat problem."""
STEP = 75.0
"""Times as long as a point of a block takes a step of a history (13 ms with 40 nodes, 33 ms with 133)."""
MEMORY, UNKNOWN = 270e6, 2700.0
"""Bytes of the program, and more for each unknown of the finest mesh (2.79 GB at N = 939,518)."""


def of_history(study: Study, n_dof: int, m: int) -> Resources:
    """What the steps of one point are expected to take, with so many unknowns of the body and its contact line."""
    assert study.history is not None
    each = contact_seconds(study, m) / len(study.scenes)
    return Resources(study.history.steps * STEP * each, MEMORY + UNKNOWN * n_dof)


def of_geometry(study: Study) -> Resources:
    """What all points of a geometry of a sweep are expected to take, without a look at its meshes."""
    levels, (c, p) = refined(forecast(study), study.mesh), STAGES
    spent = sum(LEVEL + c * v.n_dof**p + contact_seconds(study, v.n_contact) for v in levels)
    memory = MEMORY + UNKNOWN * max((v.n_dof for v in levels), default=0)
    return Resources(spent + meshing_seconds(study.mesh, levels), memory)


def work_words(study: Study, levels: Sequence[LevelForecast], jobs: int | None) -> str:
    """Who will do the work, in words."""
    scheduler = "or by those of a scheduler (--dask)"
    if study.variants or study.history is not None:
        if study.history is None:
            what, each = "geometries", [of_geometry(one.study) for one in study.variants if one.study is not None]
        else:
            one = study.history.of(levels)
            what, each = "histories", [of_history(study, one.n_dof, one.n_contact)] * len(study.scenes)
        if len(each) < 2 or (count := crew(each, jobs)) == 1:
            return ""
        return f"{len(each)} {what}, each whole by one of {count} worker processes (--jobs), {scheduler}"
    most = max((workers(study, level.n_contact, jobs) for level in levels), default=1)
    return f"contact problems solved by {most} worker processes (--jobs), {scheduler}" if most > 1 else ""


MOST_NODES = 5_000
"""Nodes up to which a mesh is made only to be counted; with its first refinement half a second."""


def sizes(study: Study) -> tuple[LevelForecast, ...]:
    """Sizes of the levels whose number is known beforehand.

    Raises GeometryFailed where a run would before it solves anything.
    """
    scene, plan = study.scenes[0], study.mesh
    meshes = Meshes(study)
    rough = rough_sizes(study, meshes.geometry)
    if rough[0].nodes > MOST_NODES and not plan.listed:
        return tuple(rough)
    return tuple(_nested(meshes, scene, rough) if plan.nested else _one_by_one(meshes, plan, scene, rough))


def counting(study: Study) -> Resources:
    """What `sizes` takes for the meshes that it makes. Raises GeometryFailed if a file has no such face."""
    made = [level for level in rough_sizes(study) if level.nodes <= MOST_NODES]
    return Resources(meshing_seconds(study.mesh, made), MEMORY)


def meshing_seconds(mesh: MeshPlan, levels: Sequence[LevelForecast]) -> float:
    """Seconds of this processor for the meshes that Netgen makes itself; fewer triangles than SAMPLE take none."""
    triangles = sum(2 * level.nodes for level in (levels[:1] if mesh.nested else levels)) / 4**mesh.refine
    return triangles / triangles_a_second() if triangles > SAMPLE else 0.0


def rough_sizes(study: Study, geometry: Geometry | None = None) -> list[LevelForecast]:
    """Predicted sizes without a mesh, of a body from a file as well. Raises GeometryFailed if there is no such face."""
    geometry = geometry or build(study.scenes[0].body)
    lengths: dict[str, float] = {}
    for curve in geometry.curves:
        lengths[curve.name] = lengths.get(curve.name, 0.0) + curve.length
    return [predicted(study.scenes[0], geometry.area, lengths, h) for h in known_levels(study.mesh)]


def _nested(meshes: Meshes, scene: Scene, rough: list[LevelForecast]) -> list[LevelForecast]:
    """Uniform refinements of one mesh, exactly."""
    coarse = meshes.next(0)
    first = _counted(coarse, scene, rough[0].h)
    if len(rough) == 1:
        return [first]
    second = _counted(meshes.next(1), scene, rough[1].h)
    nodes, triangles = first.nodes, len(coarse.triangles)
    euler = first.nodes - (second.nodes - first.nodes) + triangles  # a new node for every edge
    fixed = [2 * one.nodes - one.n_dof for one in (first, second)]
    found = []
    for level, one in enumerate(rough):
        n_dof = 2 * nodes - fixed[0] - (fixed[1] - fixed[0]) * (2**level - 1)
        n_contact = first.n_contact + (second.n_contact - first.n_contact) * (2**level - 1)
        found.append(LevelForecast(one.h, nodes, n_dof, n_contact, exact=True))
        nodes, triangles = 2 * nodes + triangles - euler, 4 * triangles
    return found


def _one_by_one(meshes: Meshes, plan: MeshPlan, scene: Scene, rough: list[LevelForecast]) -> list[LevelForecast]:
    """Counted as long as the meshes are small; a mesh of a list that cannot be made is a status of its points."""
    found: list[LevelForecast] = []
    for level, guess in enumerate(rough):
        size = guess
        if found:
            size = _other(found[-1], rough[level - 1], guess) if plan.listed else _finer(found[-1], guess.h)
        if size.nodes <= MOST_NODES:
            try:
                size = _counted(meshes.next(level), scene, guess.h)
            except GeometryFailed:
                if level == 0 or not plan.listed:
                    raise
        found.append(size)
    return found


def _counted(mesh: PlaneMesh, scene: Scene, h: float) -> LevelForecast:
    held = tuple(item for item in scene.boundary if isinstance(item[1], Clamped | Contact))
    frames = constrain(mesh, held)
    line = contact_line(mesh, frames, scene.edges(Contact))
    return LevelForecast(h, mesh.n_points, frames.n_dof, line.m, exact=True)


def _finer(known: LevelForecast, h: float) -> LevelForecast:
    """The next graded mesh: graded alike."""
    r = known.h / h
    nodes, n_dof, n_contact = round(known.nodes * r**2), round(known.n_dof * r**2), round(known.n_contact * r)
    return LevelForecast(h, nodes, n_dof, n_contact)


def _other(known: LevelForecast, rough: LevelForecast, guess: LevelForecast) -> LevelForecast:
    """The next mesh of a list: as predicted, and what arcs and small features added to another mesh.

    known, rough: the sizes of that mesh as they are known, and as they were predicted
    """
    nodes = guess.nodes + max(0, known.nodes - rough.nodes)
    n_dof = guess.n_dof + max(0, known.n_dof - rough.n_dof)
    return LevelForecast(guess.h, nodes, n_dof, round(known.n_contact * rough.h / guess.h))
