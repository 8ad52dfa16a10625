"""tcstudy show, draw, report, export: what result files say, in any form."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from tcstudy.commands import shared
from tcstudy.commands.shared import FILE, MANNER, OK, Option, at, check_manner, command, fail, point_of
from tcstudy.errors import StoreError, StudyError, UsageError

_OUTPUT = "folder of the fields (default: FILE), or the table (default: FILE.csv, FILE.json)"
_POINTS = "of a run the points to list, of a convergence file the point whose tables to show"
_Y = "what the curves are of, e.g. slip_length; of a path mean-slip, max-slip or friction; of costs an error, e.g. u_L2"
_PICTURE = "a .png, .svg or .pdf file (default of a study: results/<study>.scene.png)"
_INDICES = "of a run with drawn points: the number whose Sobol indices to show (of mode: saltelli slip_length)"


@command(
    "print the summary of a result file",
    FILE,
    *MANNER,
    at(_POINTS),
    Option("--of", metavar="NUMBER", help=_INDICES),
)
def show(options: argparse.Namespace) -> int:
    """Print again what run, converge, cost or path said; of another file with data, what it is."""
    check_manner(options)
    from tcstudy.data.files import attributes
    from tcstudy.data.provenance import kind_of
    from tcstudy.scene.designs import SALTELLI

    try:
        kind = kind_of(options.file)
        if point_of(options) and kind not in ("convergence", "run"):
            fail(f"--at: what is said of a {kind} is of all its points; leave it out")
        design = attributes(options.file).get("design_mode") if kind == "run" else None
        if options.of is not None and design is None:
            remedy = f"run its study with sweep: {{mode: {SALTELLI}, points: 256, PARAMETER: {{uniform: [a, b]}}}}"
            fail(f"--of: the points of {options.file} are no design for indices; {remedy}")
        shared.say(options, options.file, of=options.of or ("slip_length" if design == SALTELLI else None))
    except StoreError:
        from tcstudy.reports.terminal.summary import other_text

        with shared.spoken(options):
            text = "" if options.json or options.quiet else other_text(options.file)
        if not text:
            raise
        print(text)
    return OK


@command(
    "draw a study before any work, or a result file: a point, curves, a map, a law, a path, errors, costs",
    Option("file", type=shared.named, metavar="FILE", help="a study (its scene as it is understood) or a result file"),
    Option("picture", type=shared.file_name, nargs="?", metavar="PICTURE", help=_PICTURE),
    shared.STUDY[1],
    at("which point (may be repeated)"),
    Option("--level", type=int, metavar="N", help="mesh level (default: the finest)"),
    Option("--x", metavar="NAME", help="curves of a whole run over this swept parameter"),
    Option("--y", metavar="NUMBER", help=_Y),
    Option("--by", metavar="NAME", help="a curve for each value of this swept parameter"),
    Option("--map", metavar="NAME,NAME", help="a map over two swept parameters"),
    Option("--of", metavar="NUMBER", help="what the map is of, e.g. u_T_max; of a point: sigma_x, von_mises …"),
    Option("--law", action="store_true", help="the friction law of a point with all its nodes on it"),
    Option("--deform", type=float, metavar="FACTOR", help="how large displacements of a point are drawn"),
    Option("--along", metavar="X,Y:X,Y", help="profile of a point along a line, e.g. '0 mm,5 mm: 200 mm,5 mm'"),
    Option("--size", metavar="WIDTHxHEIGHT", help="size of the picture, e.g. 8x10cm"),
)
def draw(options: argparse.Namespace) -> int:
    """Draw a file of any kind."""
    from tcstudy.commands.scene import SUFFIXES
    from tcstudy.reports.figures.draw import Wanted, picture

    if options.file.suffix.lower() in SUFFIXES:
        return _draw_study(options)
    if options.overrides:
        fail("--set: a result file keeps its study; leave it out")
    if options.picture is None:
        fail("PICTURE: name a .png, .svg or .pdf file")
    given = {one.name: getattr(options, one.name) for one in fields(Wanted) if one.name in options and one.name != "at"}
    if options.map is not None:
        names = tuple(name.strip() for name in options.map.split(","))
        if len(names) != 2 or not all(names):
            fail("--map: name two swept parameters, for example --map alpha,theta_bar")
        given["map"] = names
    try:
        print(picture(options.file, options.picture, Wanted(**given | {"at": point_of(options)})))
    except UsageError as fault:
        fail(f"--{fault}")
    return OK


def _draw_study(options: argparse.Namespace) -> int:
    """Draw the scene of a study."""
    from tcstudy.commands.scene import draw_study

    names = ("level", "x", "y", "by", "map", "of", "law", "deform", "along")
    if given := [name for name in names if getattr(options, name)]:
        fail(f"--{given[0]}: a study that was not run has no results to draw; leave it out")
    target = options.picture or Path("results") / f"{options.file.stem}.scene.png"
    try:
        draw_study(options.file, target, options.overrides, options.size)
    except StudyError:
        if target.exists():
            print(f"{target}: what could be read; what is wrong stands on it", file=sys.stderr)
        raise
    print(f"{target}: the scene of {options.file}")
    return OK


@command(
    "make one HTML page of a result file, for any browser, offline",
    FILE,
    Option("-o", "--output", type=shared.file_name, metavar="PAGE", help="the page (default: FILE.html)"),
)
def report(options: argparse.Namespace) -> int:
    """Make one HTML page of a file of any kind."""
    from tcstudy.reports.page.write import write_page

    target = options.output or options.file.with_suffix(".html")
    if target.suffix.lower() not in (".html", ".htm"):
        fail(f"{target}: a page's name ends in .html; choose such a name")
    print(write_page(options.file, target).words)
    return OK


TABLES = ("csv", "json")
FORMS = ("vtu", *TABLES)


@command(
    "write a result file for other programs: fields for ParaView, a table as CSV or JSON",
    FILE,
    Option("--vtu", action="store_true", help="body and contact line of every point, and one PVD (ParaView)"),
    Option("--csv", action="store_true", help="a row a point and level, columns `name [unit]`"),
    Option("--json", action="store_true", help="the same rows as objects"),
    Option("--geometry", action="store_true", help="of a sweep over geometries the run of one, named by --at"),
    Option("-o", "--output", type=shared.named, metavar="TARGET", help=_OUTPUT),
    at("only points with this value (may be repeated)"),
    Option("--level", type=int, metavar="N", help="mesh level of --vtu (default: the finest)"),
)
def export(options: argparse.Namespace) -> int:
    """Write a result file in another form."""
    if options.geometry:
        return _geometry(options)
    forms = [form for form in FORMS if getattr(options, form)]
    if len(forms) != 1:
        fail("choose one form: --vtu for the fields of every point, --csv or --json for the table of points")
    if options.level is not None and forms != ["vtu"]:
        fail("--level: a table has all levels; leave it out")
    target, lines = exported(options.file, forms[0], options.output, point_of(options), options.level)
    print("\n".join((f"{target}: {lines[0]}", *lines[1:])))
    return OK


def _geometry(options: argparse.Namespace) -> int:
    """Write the run of one geometry of a sweep over several."""
    from tcstudy.data.variants import extract
    from tcstudy.reports.select_point import geometry_of

    if options.output is None or options.output.exists():
        fail(f"{options.output} exists; name another file" if options.output else "--geometry: name the file with -o")
    extract(options.file, geometry_of(options.file, point_of(options)), options.output)
    print(f"{options.output}: the run of one geometry")
    return OK


def exported(
    file: Path, form: str, target: Path | None, point: Mapping[str, Any] | None, level: int | None
) -> tuple[Path, list[str]]:
    """Write a result file in one of FORMS; what was written, and what there is to say of it."""
    from tcstudy.data.provenance import tell_stored
    from tcstudy.reports.text import counted

    tell_stored(file)
    if form in TABLES:
        from tcstudy.reports.export.table import write_table

        table = target if target is not None else file.with_suffix(f".{form}")
        if table.suffix != f".{form}":
            fail(f"{table}: a table of this form has a name that ends in .{form}; what else is there stays")
        return table, [counted(write_table(file, table, point), "row")]
    from tcstudy.data.files import check_writable
    from tcstudy.reports.export.fields import write_fields

    folder = target if target is not None else file.with_suffix("")
    if folder.exists() and not folder.is_dir():
        fail(f"{folder} is a file; name a folder with -o")
    if faults := check_writable(folder / file.name):
        fail("; ".join(faults))
    written = write_fields(file, folder, point, -1 if level is None else level)
    return written.path, [counted(written.points, "point"), *written.lacks]
