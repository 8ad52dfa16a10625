"""Pictures of result files, and of studies before any work, for the commands and for Python.

The scene of a study needs a mesh, which reports must not make: it is made here.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tcstudy.errors import DrawError, Problem, StudyError, UsageError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tcstudy.reports.figures.scene import SceneShape
    from tcstudy.reports.figures.style import Look, Size
    from tcstudy.scene.records import Body
    from tcstudy.scene.study import Study

STUDY_SUFFIXES = (".yaml", ".yml")

Drawing = tuple["Figure", str, "Look"]
"""A figure, what it shows in words, and its looks."""


def is_study_file(path: Path) -> bool:
    """Return whether a file is a study by its name."""
    return path.suffix.lower() in STUDY_SUFFIXES


def draw_picture(
    subject: Study | Path, target: Path | None, overrides: Sequence[str] = (), **options: Any
) -> Any:
    """Draw a result file, or a study before any work, and return one line on what was drawn.

    Without a target nothing is written, and the figure is returned, which a notebook shows
    (`_repr_png_`).
    overrides: changes of a study file
    options:   as of `tcstudy.draw`, which says, too, what is raised
    """
    from tcstudy.data.files import Snapshot
    from tcstudy.reports.figures import style

    if target is not None:
        style.check_target(target)
    is_result = isinstance(subject, Path) and not is_study_file(subject)
    seen = Snapshot.of(subject) if isinstance(subject, Path) and is_result else None
    with _drawing(subject, overrides, options) as (figure, words, look):
        if target is None:
            return figure if look.into is not None else style.shown(figure, look.dpi)
        if seen is not None:
            seen.check()
        style.save(figure, target, look.dpi)
    return f"{target}: {words}"


def _drawing(
    subject: Study | Path, overrides: Sequence[str], options: Mapping[str, Any]
) -> AbstractContextManager[Drawing]:
    from tcstudy.reports.figures.draw import drawn

    if isinstance(subject, Path) and not is_study_file(subject):
        return drawn(subject, **options)
    return _scene_drawing(subject, overrides, **options)


@contextmanager
def _scene_drawing(
    subject: Study | Path, overrides: Sequence[str], size: Size | None = None, **options: Any
) -> Iterator[Drawing]:
    """Yield the drawing of a study's scene.

    Raises StudyError, GeometryFailed. A file with faults yields its outline first, on which the
    edges at fault are marked, and raises them after that was used.
    """
    from tcstudy.read.study import read_study
    from tcstudy.reports.figures import style
    from tcstudy.reports.figures.scene import scene_figure
    from tcstudy.study.stored import check_kind

    for option, value in options.items():
        if value not in (None, False):
            fault = "a study that was not run has no results to draw"
            raise UsageError(f"{option}: {fault}; leave it out")
    look = style.look_of(size)
    if isinstance(subject, Path):
        name = str(subject)
        try:
            study = read_study(subject, overrides, swept=None)
        except StudyError as error:
            yield from _faulty_drawing(subject, overrides, error, look)
            raise
    else:
        study = subject
        name = study.title
    try:
        check_kind(study, study.kind, name)
    except UsageError as error:
        raise DrawError(str(error)) from None
    with style.styled(look):
        yield scene_figure(study, _shape(study), look), f"the scene of {name}", look


def _faulty_drawing(
    path: Path, overrides: Sequence[str], error: StudyError, look: Look
) -> Iterator[Drawing]:
    """Yield the outline of a study with faults, or nothing where no outline can be read."""
    from tcstudy.read.study import body_as_given
    from tcstudy.reports.figures import style
    from tcstudy.reports.figures.scene import faulty_figure

    body = body_as_given(path, overrides)
    if body is None or body.outline is None:
        return
    sentences = [_sentence(problem) for problem in error.problems]
    title = f"{path.stem}: cannot be run"
    with style.styled(look):
        yield faulty_figure(title, body, _edge_faults(body, error), sentences, look), "", look


def _place(problem: Problem) -> str:
    return f"line {problem.line}: " if problem.line else ""


def _sentence(problem: Problem) -> str:
    return f"{_place(problem)}{problem.key}: {problem.what}; {problem.remedy}"


def _edge_faults(body: Body, error: StudyError) -> dict[str, str]:
    """Return the first fault of every edge that has one, by the name of the edge."""
    names = {edge.name for edge in body.edges}
    faults = dict[str, str]()
    for problem in error.problems:
        name = _edge_at_fault(body, problem)
        if name in names:
            faults.setdefault(name, f"{_place(problem)}{problem.what}")
    return faults


def _edge_at_fault(body: Body, problem: Problem) -> str:
    """Return the name of the edge that a problem is about, empty if it is about none."""
    if corner := re.match(r"body\.outline\[(\d+)\]", problem.key):
        number = int(corner[1])
        edges = body.outline.edges if body.outline is not None else ()
        if body.outline is not None and number < len(edges):
            return edges[-1 - number if body.outline.turned else number].name
    edge = re.match(r"boundary\.(\w+)", problem.key)
    if edge is None:
        return ""
    if problem.key.count(".") == 1:  # the name itself may be at fault
        meant = re.match(r"did you mean '(\w+)'", problem.remedy)
        if meant is not None:
            return meant[1]
    return edge[1]


def _shape(study: Study) -> SceneShape:
    """Return the coarsest mesh of a study, of several geometries that of the first, with its λ₁.

    Raises StudyError for a body of a file that a run refuses, DrawError for one that is not held.
    """
    from tcstudy.condense import NotPositiveDefinite
    from tcstudy.fem.meshes import Meshes
    from tcstudy.offline.level import Level
    from tcstudy.read.document import located
    from tcstudy.reports.figures.scene import SceneShape
    from tcstudy.reports.text import with_unit
    from tcstudy.study.lint import built_faults

    if study.variants:
        study = _first_geometry(study)
    if faults := built_faults(study):
        raise StudyError(located(study, faults))
    mesh = Meshes(study).next(0)
    scene = study.scenes[0]
    try:
        level = Level(mesh, scene)
        lambda_1 = level.lambda_1(scene) if level.is_held(scene) else None
    except NotPositiveDefinite as error:
        raise DrawError(str(error)) from None
    counts = f"{level.frames.n_dof} unknowns, {level.line.m} on the contact line"
    size = with_unit(mesh.h_max, "1" if study.units == "none" else "m", 3)
    levels = f" of {study.mesh.levels}" if study.mesh.levels > 1 else ""
    edge_names = tuple(dict.fromkeys(curve.name for curve in mesh.geometry.curves))
    regions = tuple(region.name for region in scene.body.regions)
    return SceneShape(
        segments={name: mesh.points[mesh.segments[mesh.on(name)]] for name in edge_names},
        points=mesh.points,
        triangles=mesh.triangles,
        region=mesh.numbered(regions),
        regions=regions,
        lambda_1=lambda_1,
        sizes=f"coarsest mesh{levels}: {counts}, largest edge {size}",
    )


def _first_geometry(study: Study) -> Study:
    """Return the study of the first geometry of a sweep that can be made. Raises DrawError."""
    for variant in study.variants:
        if variant.study is not None:
            return variant.study
    raise DrawError(f"no geometry of the sweep can be made: {study.variants[0].reason}")
