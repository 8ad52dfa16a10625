"""tcstudy show, draw, report, export: what result files say, in any form."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from tcstudy.commands import shared
from tcstudy.commands.shared import FILE, MANNER, OK, at, command, fail, option, point_of
from tcstudy.errors import StudyError, UsageError

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
    option("--of", metavar="NUMBER", help=_INDICES),
)
def show(options: argparse.Namespace) -> int:
    """Print again what run, converge or cost said."""
    from tcstudy.data.files import attributes
    from tcstudy.data.provenance import kind_of
    from tcstudy.scene.designs import SALTELLI

    kind = kind_of(options.file)
    if point_of(options) and kind not in ("convergence", "run"):
        fail(f"--at: what is said of a {kind} is of all its points; leave it out")
    design = attributes(options.file).get("design_mode") if kind == "run" else None
    if options.of is not None and design is None:
        remedy = f"run its study with sweep: {{mode: {SALTELLI}, points: 256, PARAMETER: {{uniform: [a, b]}}}}"
        fail(f"--of: the points of {options.file} are no design for indices; {remedy}")
    shared.say(options, options.file, of=options.of or ("slip_length" if design == SALTELLI else None))
    return OK


@command(
    "draw a study before any work, or a result file: a point, curves, a map, a law, a path, errors, costs",
    option("file", type=shared.named, metavar="FILE", help="a study (its scene as it is understood) or a result file"),
    option("picture", type=shared.file_name, nargs="?", metavar="PICTURE", help=_PICTURE),
    shared.STUDY[1],
    at("which point (may be repeated)"),
    option("--level", type=int, metavar="N", help="mesh level (default: the finest)"),
    option("--x", metavar="NAME", help="curves of a whole run over this swept parameter"),
    option("--y", metavar="NUMBER", help=_Y),
    option("--by", metavar="NAME", help="a curve for each value of this swept parameter"),
    option("--map", metavar="NAME,NAME", help="a map over two swept parameters"),
    option("--of", metavar="NUMBER", help="what the map is of, e.g. u_T_max; of a point: sigma_x, von_mises …"),
    option("--law", action="store_true", help="the friction law of a point with all its nodes on it"),
    option("--deform", type=float, metavar="FACTOR", help="how large displacements of a point are drawn"),
    option("--along", metavar="X,Y:X,Y", help="profile of a point along a line, e.g. '0 mm,5 mm: 200 mm,5 mm'"),
    option("--size", metavar="WIDTHxHEIGHT", help="size of the picture, e.g. 8x10cm"),
)
def draw(options: argparse.Namespace) -> int:
    """Draw a file of any kind, or the scene of a study."""
    from tcstudy.commands.scene import SUFFIXES, draw_study
    from tcstudy.reports.figures.draw import Wanted, picture

    asked = {one.name: getattr(options, one.name, None) for one in fields(Wanted) if one.name != "at"}
    given = {name: value for name, value in asked.items() if value is not None and value is not False}
    target = options.picture
    if options.file.suffix.lower() in SUFFIXES:
        if idle := [name for name in given if name != "size"]:
            fail(f"--{idle[0]}: a study that was not run has no results to draw; leave it out")
        target = target or Path("results") / f"{options.file.stem}.scene.png"
        try:
            draw_study(options.file, target, options.overrides, options.size)
        except StudyError:
            if target.exists():
                print(f"{target}: what could be read; what is wrong stands on it", file=sys.stderr)
            raise
        print(f"{target}: the scene of {options.file}")
        return OK
    if options.overrides or target is None:
        what = "--set: a result file keeps its study; leave it out"
        fail(what if options.overrides else "PICTURE: name a .png, .svg or .pdf file")
    if options.map is not None:
        given["map"] = tuple(name.strip() for name in options.map.split(","))
        if len(given["map"]) != 2 or not all(given["map"]):
            fail("--map: name two swept parameters, for example --map alpha,theta_bar")
    try:
        print(picture(options.file, target, Wanted(**given | {"at": point_of(options)})))
    except UsageError as fault:
        fail(f"--{fault}")
    return OK


@command(
    "make one HTML page of a result file, for any browser, offline",
    FILE,
    option("-o", "--output", type=shared.file_name, metavar="PAGE", help="the page (default: FILE.html)"),
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


def _form(flag: str, help: str) -> shared.Option:
    return option(flag, action="store_const", dest="form", const=flag[2:], help=help)


@command(
    "write a result file for other programs: fields for ParaView, a table as CSV or JSON",
    FILE,
    _form("--vtu", "body and contact line of every point, and one PVD (ParaView)"),
    _form("--csv", "a row a point and level, columns `name [unit]`"),
    _form("--json", "the same rows as objects"),
    option("-o", "--output", type=shared.named, metavar="TARGET", help=_OUTPUT),
    at("only points with this value (may be repeated)"),
    option("--level", type=int, metavar="N", help="mesh level of --vtu (default: the finest)"),
)
def export(options: argparse.Namespace) -> int:
    """Write a result file in another form."""
    if options.form is None:
        fail("choose one form: --vtu for the fields of every point, --csv or --json for the table of points")
    if options.level is not None and options.form != "vtu":
        fail("--level: a table has all levels; leave it out")
    target, lines = exported(options.file, options.form, options.output, point_of(options), options.level)
    print("\n".join((f"{target}: {lines[0]}", *lines[1:])))
    return OK


def exported(
    file: Path, form: str, target: Path | None, point: Mapping[str, Any] | None, level: int | None
) -> tuple[Path, list[str]]:
    """Write a result file in one of FORMS; what was written, and what there is to say of it."""
    from tcstudy.data.provenance import tell_stored
    from tcstudy.reports.text import counted

    tell_stored(file)
    target = target or file.with_suffix("" if form == "vtu" else f".{form}")
    if form in TABLES:
        from tcstudy.reports.export.table import write_table

        if target.suffix != f".{form}":
            fail(f"{target}: a table of this form has a name that ends in .{form}; what else is there stays")
        return target, [counted(write_table(file, target, point), "row")]
    from tcstudy.data.files import check_writable
    from tcstudy.reports.export.fields import write_fields

    if faults := check_writable(target / file.name):
        fail("; ".join(faults))
    written = write_fields(file, target, point, -1 if level is None else level)
    return written.path, [counted(written.points, "point"), *written.lacks]
