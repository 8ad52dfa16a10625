"""tcstudy draw, show, report, export: what result files say, in any form; the scene of a study
before any work."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tcstudy.commands.shared import (
    FILE,
    MANNER,
    OK,
    STUDY,
    Option,
    at,
    command,
    fail,
    file_name,
    named,
    option,
    point_of,
    say,
)
from tcstudy.errors import StudyError, UsageError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tcstudy.data.files import Snapshot
    from tcstudy.reports.figures.scene import SceneShape
    from tcstudy.reports.figures.style import Look, Size
    from tcstudy.scene.records import Body
    from tcstudy.scene.study import Study


SUFFIXES = (".yaml", ".yml")
"""Of studies."""
_PICTURE = "a .png, .svg or .pdf file (default of a study: results/<study>.scene.png)"
_Y = "what the curves are of, e.g. slip_length; of a path mean-slip, max-slip or friction; of costs an error, e.g. u_L2"
ASKED = (
    option("--level", type=int, metavar="N", help="mesh level (default: the finest)"),
    option("--x", metavar="NAME", help="curves of a whole run over this swept parameter"),
    option("--y", metavar="NUMBER", help=_Y),
    option("--by", metavar="NAME", help="a curve for each value of this swept parameter"),
    option("--map", metavar="NAME,NAME", help="a map over two swept parameters"),
    option(
        "--of",
        metavar="NUMBER",
        help="what the map is of, e.g. u_T_max; of a point: sigma_x, von_mises …",
    ),
    option(
        "--law", action="store_true", help="the friction law of a point with all its nodes on it"
    ),
    option(
        "--deform",
        type=float,
        metavar="FACTOR",
        help="how large displacements of a point are drawn",
    ),
    option(
        "--along",
        metavar="X,Y:X,Y",
        help="profile of a point along a line, e.g. '0 mm,5 mm: 200 mm,5 mm'",
    ),
    option("--size", metavar="WIDTHxHEIGHT", help="size of the picture, e.g. 8x10cm"),
)


@command(
    "draw a study before any work, or a result file: a point, curves, a map, a law, a path, errors, costs",
    option(
        "file",
        type=named,
        metavar="FILE",
        help="a study (its scene as it is understood) or a result file",
    ),
    option("picture", type=file_name, nargs="?", metavar="PICTURE", help=_PICTURE),
    STUDY[1],
    at("which point (default: of a run that of the largest slip; may be repeated)"),
    *ASKED,
)
def draw(options: argparse.Namespace) -> int:
    """Draw a file of any kind, or the scene of a study."""
    from tcstudy.data.files import reading, tell_stored
    from tcstudy.reports.figures.draw import pair_of

    target, asked = (
        options.picture,
        {flags[0][2:]: getattr(options, flags[0][2:]) for flags, _ in ASKED},
    )
    if options.file.suffix.lower() in SUFFIXES:
        target = target or Path("results") / f"{options.file.stem}.scene.png"
    elif options.overrides or target is None:
        what = "--set: a result file keeps its study; leave it out"
        fail(what if options.overrides else "PICTURE: name a .png, .svg or .pdf file")
    before = _changed(target)
    try:
        if options.map is not None:
            asked["map"] = pair_of(options.map)
        is_study = options.file.suffix.lower() in SUFFIXES
        with nullcontext() if is_study else reading(options.file):
            words = picture(
                options.file, target, options.overrides, at=point_of(options) or None, **asked
            )
            if not is_study:
                tell_stored(options.file)
        print(words)
    except UsageError as fault:
        fail(f"--{fault}")
    except StudyError:
        if _changed(target) != before:
            print(f"{target}: what could be read; what is wrong stands on it", file=sys.stderr)
        raise
    return OK


def _changed(path: Path) -> int | None:
    """Return when a file was written, None where there is none."""
    return path.stat().st_mtime_ns if path.exists() else None


def picture(
    what: Study | Path, target: Path | None, overrides: Sequence[str] = (), **asked: Any
) -> Any:
    """Draw a result file, or a study before any work, into a file and return one line on what was
    drawn; without a file return the figure, which a notebook shows (`_repr_png_`). Raises as
    `tcstudy.draw` does.
    """
    from tcstudy.reports.figures import style
    from tcstudy.reports.figures.draw import drawn

    if target is not None:
        style.check_target(target)
    source: Snapshot | None = None
    stored = what if isinstance(what, Path) and what.suffix.lower() not in SUFFIXES else None
    if stored is not None:
        from tcstudy.data.files import Snapshot

        source = Snapshot.of(stored)
    with (
        drawn(stored, **asked) if stored else _scene(what, overrides, **asked) as (
            figure,
            words,
            look,
        )
    ):
        if target is None:
            return figure if look.into is not None else style.shown(figure, look.dpi)
        if source is not None:
            source.check()
        style.save(figure, target, look.dpi)
    return f"{target}: {words}"


@contextmanager
def _scene(
    study: Study | Path, overrides: Sequence[str], size: Size | None = None, **asked: Any
) -> Iterator[tuple[Figure, str, Look]]:
    """The figure of a study's scene, what it shows, and its looks. Raises StudyError,
    GeometryFailed: for a file with faults when the figure of its outline was used, on which edges
    at fault are marked.
    """
    from tcstudy.errors import DrawError
    from tcstudy.read.study import body_as_given, read_study
    from tcstudy.reports.figures import style
    from tcstudy.reports.figures.scene import faulty_figure, scene_figure
    from tcstudy.study.stored import check_kind

    for name in (name for name, one in asked.items() if one not in (None, False)):
        fail(f"{name}: a study that was not run has no results to draw; leave it out")
    look = style.look_of(size)
    try:
        read = read_study(study, overrides, swept=None) if isinstance(study, Path) else study
    except StudyError as error:
        if (
            not isinstance(study, Path)
            or (body := body_as_given(study, overrides)) is None
            or body.outline is None
        ):
            raise
        with style.styled(look):
            yield (
                faulty_figure(f"{study.stem}: cannot be run", body, *_told(body, error), look),
                "",
                look,
            )
        raise
    try:
        check_kind(read, read.kind, str(study if read is not study else read.title))
    except UsageError as error:
        raise DrawError(str(error)) from None
    with style.styled(look):
        yield (
            scene_figure(read, _shape(read), look),
            f"the scene of {study if study is not read else read.title}",
            look,
        )


def _told(body: Body, error: StudyError) -> tuple[dict[str, str], list[str]]:
    """What is wrong with an edge, by its name, and with the whole."""
    faults, every, names = dict[str, str](), list[str](), {one.name for one in body.edges}
    for problem in error.problems:
        edge = re.match(r"boundary\.(\w+)", problem.key)
        number = re.match(r"body\.outline\[(\d+)\]", problem.key)
        meant = (
            re.match(r"did you mean '(\w+)'", problem.remedy)
            if problem.key.count(".") == 1
            else None
        )
        name = meant[1] if edge and meant else edge[1] if edge else ""
        if number and body.outline and int(number[1]) < len(edges := body.outline.edges):
            name = edges[-1 - int(number[1]) if body.outline.turned else int(number[1])].name
        where = f"line {problem.line}: " if problem.line else ""
        if name in names:
            faults.setdefault(name, f"{where}{problem.what}")
        every.append(f"{where}{problem.key}: {problem.what}; {problem.remedy}")
    return faults, every


def _shape(study: Study) -> SceneShape:
    """The coarsest mesh of a study, of several geometries that of the first: its sizes, and its
    λ₁.

    Raises StudyError for a body of a file that a run refuses, DrawError for one that is not held.
    """
    from tcstudy.condense import NotPositiveDefinite
    from tcstudy.errors import DrawError
    from tcstudy.fem.meshes import Meshes
    from tcstudy.offline.level import Level
    from tcstudy.read.document import located
    from tcstudy.reports.figures.scene import SceneShape
    from tcstudy.reports.text import with_unit
    from tcstudy.study.lint import built_faults

    if study.variants:
        made = [one.study for one in study.variants if one.study is not None]
        if not made:
            raise DrawError(f"no geometry of the sweep can be made: {study.variants[0].reason}")
        study = made[0]
    if faults := built_faults(study):
        raise StudyError(located(study, faults))
    mesh, scene = Meshes(study).next(0), study.scenes[0]
    names = tuple(dict.fromkeys(curve.name for curve in mesh.geometry.curves))
    lambda_1, loose = None, study.history is not None and study.history.loose
    try:
        level = Level(mesh, scene, held=not loose)
        lambda_1 = None if loose else level.lambda_1(scene)
    except NotPositiveDefinite as error:
        raise DrawError(str(error)) from None
    counts = f"{level.frames.n_dof} unknowns, {level.line.m} on the contact line"
    size = with_unit(mesh.h_max, "1" if study.units == "none" else "m", 3)
    levels = f" of {study.mesh.levels}" if study.mesh.levels > 1 else ""
    regions = tuple(region.name for region in scene.body.regions)
    return SceneShape(
        {name: mesh.points[mesh.segments[mesh.on(name)]] for name in names},
        mesh.points,
        mesh.triangles,
        mesh.numbered(regions),
        regions,
        lambda_1,
        f"coarsest mesh{levels}: {counts}, longest edge {size}",
    )


_OUTPUT = "folder of the fields (default: FILE), or the table (default: FILE.csv, FILE.json)"
_POINTS = "of a run the points to list, of a convergence file the point whose tables to show"
_INDICES = "of a run with drawn points: the number whose Sobol indices to show (of mode: saltelli slip_length)"


@command(
    "print the summary of a result file",
    FILE,
    *MANNER,
    at(_POINTS),
    option("--of", metavar="NUMBER", help=_INDICES),
)
def show(options: argparse.Namespace) -> int:
    """Print again what run, converge or cost said."""
    from tcstudy.data.files import reading

    with reading(options.file):
        _show(options)
    return OK


def _show(options: argparse.Namespace) -> None:
    from tcstudy.data.files import attributes, kind_of
    from tcstudy.scene.designs import SALTELLI

    kind = kind_of(options.file)
    if point_of(options) and kind not in ("convergence", "run"):
        fail(f"--at: what is said of a {kind} is of all its points; leave it out")
    design = attributes(options.file).get("design_mode") if kind == "run" else None
    if options.of is not None and design is None:
        remedy = f"run its study with sweep: {{mode: {SALTELLI}, points: 256, PARAMETER: {{uniform: [a, b]}}}}"
        fail(f"--of: the points of {options.file} are no design for indices; {remedy}")
    say(options, options.file, of=options.of or ("slip_length" if design == SALTELLI else None))


@command(
    "make one HTML page of a result file, for any browser, offline",
    FILE,
    option("-o", "--output", type=file_name, metavar="PAGE", help="the page (default: FILE.html)"),
)
def report(options: argparse.Namespace) -> int:
    """Make one HTML page of a file of any kind."""
    from tcstudy.data.files import reading, tell_stored
    from tcstudy.reports.page.write import write_page

    target = options.output or options.file.with_suffix(".html")
    if target.suffix.lower() not in (".html", ".htm"):
        fail(f"{target}: a page's name ends in .html; choose such a name")
    with reading(options.file):
        written = write_page(options.file, target)
        tell_stored(options.file)
    print(written.words)
    return OK


TABLES = ("csv", "json")
FORMS = ("vtu", *TABLES)


def _form(flag: str, help: str) -> Option:
    return option(flag, action="store_const", dest="form", const=flag[2:], help=help)


@command(
    "write a result file for other programs: fields for ParaView, a table as CSV or JSON",
    FILE,
    _form("--vtu", "body and contact line of every point, and one PVD (ParaView)"),
    _form("--csv", "a row a point and level, columns `name [unit]`"),
    _form("--json", "the same rows as objects"),
    option("-o", "--output", type=named, metavar="TARGET", help=_OUTPUT),
    at("only points with this value (may be repeated)"),
    option("--level", type=int, metavar="N", help="mesh level of --vtu (default: the finest)"),
)
def export(options: argparse.Namespace) -> int:
    """Write a result file in another form."""
    if options.form is None:
        fail(
            "choose one form: --vtu for the fields of every point, --csv or --json for the table of points"
        )
    if options.level is not None and options.form != "vtu":
        fail("--level: a table has all levels; leave it out")
    from tcstudy.data.files import reading, tell_stored

    with reading(options.file):
        tell_stored(options.file)
        target, lines = exported(
            options.file, options.form, options.output, point_of(options), options.level
        )
    print("\n".join((f"{target}: {lines[0]}", *lines[1:])))
    return OK


def exported(
    file: Path, form: str, target: Path | None, point: Mapping[str, Any] | None, level: int | None
) -> tuple[Path, list[str]]:
    """Write a result file in one of FORMS; what was written, and what there is to say of it."""
    from tcstudy.reports.text import counted

    target = target or file.with_suffix("" if form == "vtu" else f".{form}")
    if form in TABLES:
        from tcstudy.reports.export import write_table

        if target.suffix != f".{form}":
            fail(
                f"{target}: a table of this form has a name that ends in .{form}; what else is there stays"
            )
        return target, [counted(write_table(file, target, point), "row")]
    from tcstudy.data.files import check_writable
    from tcstudy.reports.export import write_fields

    if faults := check_writable(target / file.name):
        fail("; ".join(faults))
    written = write_fields(file, target, point, -1 if level is None else level)
    return written.path, [counted(written.points, "point"), *written.lacks]
