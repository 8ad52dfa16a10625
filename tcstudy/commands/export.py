"""tcstudy export, compare: results for other programs, and what differs between two result files."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tcstudy.commands.shared import FILE, MANNER, OK, SOME_FAILED, Command, Option, at, check_manner, fail, point_of

TABLES = ("csv", "json")
FORMS = ("vtu", *TABLES)


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
    extract(options.file, {geometry_of(options.file, point_of(options)): options.output})
    print(f"{options.output}: the run of one geometry")
    return OK


def exported(
    file: Path, form: str, target: Path | None, point: Mapping[str, Any] | None, level: int | None
) -> tuple[Path, list[str]]:
    """Write a result file in one of FORMS; what was written, and what there is to say of it."""
    from tcstudy.reports.text import counted

    if form in TABLES:
        from tcstudy.reports.export.export_table import write_csv, write_json

        table = target if target is not None else file.with_suffix(f".{form}")
        if table.suffix != f".{form}":
            fail(f"{table}: a table of this form has a name that ends in .{form}; what else is there stays")
        rows = (write_csv if form == "csv" else write_json)(file, table, point)
        return table, [counted(rows, "row")]
    from tcstudy.reports.export.export_fields import write_fields

    folder = target if target is not None else file.with_suffix("")
    if folder.exists() and not folder.is_dir():
        fail(f"{folder} is a file; name a folder with -o")
    written = write_fields(file, folder, point, -1 if level is None else level)
    return written.path, [counted(written.points, "point"), *written.lacks]


def compare(options: argparse.Namespace) -> int:
    """Say what differs between two result files."""
    from tcstudy.study.compare import compare_files

    if not options.rtol >= 0.0:
        fail(f"--rtol: {options.rtol:g} is no tolerance; give 0 or more")
    check_manner(options)
    found = compare_files(options.first, options.second, options.rtol)
    if options.json:
        from tcstudy.reports.export.brief import json_text

        about = {"kind": "comparison", "equal": found.equal, "verdict": found.verdict, **asdict(found)}
        print(json_text({**about, "files": [str(file) for file in found.files]}))
    else:
        print(found.verdict if options.quiet else found.text)
    return OK if found.equal else SOME_FAILED


_OUTPUT = "folder of the fields (default: FILE), or the table (default: FILE.csv, FILE.json)"
_RTOL = "largest difference of numbers that is none, relative to the largest value of its kind (default: 1e-9)"
COMMANDS = {
    "export": Command(
        "write a result file for other programs: fields for ParaView, a table as CSV or JSON",
        (
            FILE,
            Option("--vtu", action="store_true", help="body and contact line of every point, and one PVD (ParaView)"),
            Option("--csv", action="store_true", help="a row a point and level, columns `name [unit]`"),
            Option("--json", action="store_true", help="the same rows as objects"),
            Option("--geometry", action="store_true", help="of a sweep over geometries the run of one, named by --at"),
            Option("-o", "--output", type=Path, metavar="TARGET", help=_OUTPUT),
            at("only points with this value (may be repeated)"),
            Option("--level", type=int, metavar="N", help="mesh level of --vtu (default: the finest)"),
        ),
        export,
    ),
    "compare": Command(
        "say what differs between two result files: exit code 0 for nothing, 1 for something",
        (
            Option("first", type=Path, metavar="A.nc"),
            Option("second", type=Path, metavar="B.nc"),
            Option("--rtol", type=float, default=1e-9, metavar="R", help=_RTOL),
            *MANNER,
        ),
        compare,
    ),
}
