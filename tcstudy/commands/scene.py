"""The picture of a scene before any work, of a study or of what can be read of one with faults."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.errors import DrawError, GeometryFailed, StudyError
from tcstudy.read.study import body_as_given, read_study
from tcstudy.scene.records import Body
from tcstudy.scene.study import Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tcstudy.reports.figures.scene import SceneShape

SUFFIXES = (".yaml", ".yml")
"""Of studies."""
ARC_PIECES = 64


def draw_study(
    study: Any,
    target: Path | None,
    overrides: Sequence[str] = (),
    size: str | tuple[float, float] | None = None,
) -> Figure | None:
    """Draw the scene of a study, or of its file, into a file, or without one return the figure.

    Raises StudyError for a file with faults, which are marked in the picture where they are of an edge.
    """
    from tcstudy.reports.figures import scene, style

    if target is not None:
        style.check_target(target)
    look, fault = style.Look(style.size_in_inches(size) if isinstance(size, str) else size), None
    with style.styled(look):
        try:
            read = read_study(study, overrides, swept=None) if isinstance(study, Path) else study
            figure = scene.scene_figure(read.title, read, _shape(read), look)
        except StudyError as error:
            if (body := body_as_given(study, overrides)) is None or body.outline is None:
                raise
            fault = error
            figure = scene.scene_figure(f"{study.stem}: cannot be run", None, _with_faults(body, error), look)
        if target is not None:
            style.save(figure, target, look.dpi)
        if fault is not None:
            raise fault
        return style.shown(figure, look.dpi) if target is None else None


def _shape(study: Study) -> SceneShape:
    """The coarsest mesh of a study, of several geometries that of the first; its outline where it has none."""
    from tcstudy.reports.figures.scene import SceneShape

    made = [one.study for one in study.variants if one.study is not None] if study.variants else [study]
    if not made:
        raise DrawError(f"no geometry of the sweep can be made: {study.variants[0].reason}")
    try:
        return _coarsest(made[0])
    except GeometryFailed as error:
        if (body := made[0].scenes[0].body).outline is None:
            raise
        return SceneShape(_outline(body), facts=(f"no mesh: {error}",))


def _coarsest(study: Study) -> SceneShape:
    """The mesh of level 0, its sizes and its λ₁. Raises GeometryFailed."""
    from tcstudy.condense import NotPositiveDefinite
    from tcstudy.fem.meshes import Meshes
    from tcstudy.offline.level import Level
    from tcstudy.reports.figures.scene import SceneShape
    from tcstudy.reports.text import with_unit

    mesh, scene = Meshes(study).next(0), study.scenes[0]
    names = tuple(dict.fromkeys(curve.name for curve in mesh.geometry.curves))
    lambda_1, loose = None, study.history is not None and study.history.loose
    try:
        level = Level(mesh, scene, held=not loose)
        lambda_1 = None if loose else level.lambda_1(scene)
        counts = f"{level.frames.n_dof} unknowns, {level.line.m} on the contact line"
    except NotPositiveDefinite as error:
        counts = str(error)
    size = with_unit(mesh.h_max, "1" if study.units == "none" else "m", 3)
    levels = f" of {study.mesh.levels}" if study.mesh.levels > 1 else ""
    regions = tuple(region.name for region in scene.body.regions)
    return SceneShape(
        {name: mesh.points[mesh.segments[mesh.on(name)]] for name in names},
        (mesh.points, mesh.triangles, mesh.numbered(regions)),
        regions,
        lambda_1,
        (f"coarsest mesh{levels}: {counts}, longest edge {size}",),
    )


def _outline(body: Body) -> dict[str, Any]:
    """(k, 2, 2) fine straight pieces of every edge [m]."""
    from tcstudy.shapes.edges import edge_points

    found: dict[str, list[Any]] = {}
    for edge in body.edges:
        points = edge_points(edge, 1 if edge.through is None else ARC_PIECES)
        found.setdefault(edge.name, []).extend(np.stack([points[:-1], points[1:]], axis=1))
    return {name: np.array(pieces) for name, pieces in found.items()}


def _with_faults(body: Body, error: StudyError) -> SceneShape:
    """The outline of a study that cannot be run, with the faults of its edges."""
    from tcstudy.reports.figures.scene import SceneShape

    assert body.outline is not None
    faults, others = dict[str, str](), list[str]()
    for problem in error.problems:
        edge = re.match(r"boundary\.(\w+)", problem.key)
        number = re.match(r"body\.outline\[(\d+)\]", problem.key)
        meant = re.match(r"did you mean '(\w+)'", problem.remedy) if problem.key.count(".") == 1 else None
        name = meant[1] if edge and meant else edge[1] if edge else ""
        if number and int(number[1]) < len(edges := body.outline.edges):
            name = edges[-1 - int(number[1]) if body.outline.turned else int(number[1])].name
        where = f"line {problem.line}: " if problem.line else ""
        if name in {one.name for one in body.edges}:
            faults.setdefault(name, f"{where}{problem.what}")
        others.append(f"{where}{problem.key}: {problem.what}; {problem.remedy}")
    return SceneShape(_outline(body), facts=tuple(others), faults=faults)
