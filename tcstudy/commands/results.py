"""tcstudy show, report, export: what result files say, in any form."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tcstudy.commands import shared
from tcstudy.commands.shared import FILE, MANNER, OK, at, command, fail, option, point_of

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
    from tcstudy.data.files import attributes, kind_of
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
    from tcstudy.data.files import tell_stored
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
