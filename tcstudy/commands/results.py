"""tcstudy draw, show, report, export: read result files; draw studies before any work, too."""

from __future__ import annotations

import argparse
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from tcstudy.commands.shared import (
    OK,
    PRINTING,
    RESULT_FILE,
    SET,
    Option,
    at_option,
    choice_option,
    command,
    fail,
    file_name,
    file_to_write,
    option,
    point_of,
    print_results,
)
from tcstudy.errors import StudyError, UsageError

_SUBJECT = "a study, to draw its scene, or a result file"
_PICTURE = "a .png, .svg or .pdf file (default of a study: results/<study>.scene.png)"
_AT = "which point (default: of a run that of the largest slip; may be repeated)"
_LEVEL = "mesh level (default: the finest)"
_X = "curves of a whole run over this swept parameter"
_Y = (
    "variable that the curves show, e.g. slip_length; for a path mean-slip, max-slip or "
    "friction, where edges open peel or opening; for costs an error, e.g. u_L2"
)
_BY = "a curve for each value of this swept parameter"
_OF = "variable that the map shows, e.g. u_T_max; for a point sigma_x, von_mises …"
_LAW = "the friction law of a point with all its nodes on it"
_DEFORM = "factor by which displacements of a point are drawn larger"
_ALONG = "profile of a point along a line, e.g. '0 mm,5 mm: 200 mm,5 mm'"
_SIZE = "size of the picture, e.g. 8x10cm"
PICTURE_OPTIONS = (
    option("--level", type=int, metavar="N", help=_LEVEL),
    option("--x", metavar="NAME", help=_X),
    option("--y", metavar="VARIABLE", help=_Y),
    option("--by", metavar="NAME", help=_BY),
    option("--map", metavar="NAME,NAME", help="a map over two swept parameters"),
    option("--of", metavar="VARIABLE", help=_OF),
    option("--law", action="store_true", help=_LAW),
    option("--deform", type=float, metavar="FACTOR", help=_DEFORM),
    option("--along", metavar="X,Y:X,Y", help=_ALONG),
    option("--size", metavar="WIDTHxHEIGHT", help=_SIZE),
)


@command(
    "draw a study before any work, or a result file: a point, curves, a map, a law, a path, "
    "errors, costs",
    option("file", type=file_name, metavar="FILE", help=_SUBJECT),
    option("picture", type=file_to_write, nargs="?", metavar="PICTURE", help=_PICTURE),
    SET,
    at_option(_AT),
    *PICTURE_OPTIONS,
)
def draw(options: argparse.Namespace) -> int:
    """Draw a file of any kind, or the scene of a study."""
    from tcstudy.data.files import reading, tell_stored
    from tcstudy.pictures import draw_picture, is_study_file

    is_study = is_study_file(options.file)
    target = _picture_name(options, is_study)
    time_before = _time_written(target)
    try:
        picture_options = _wanted_picture(options)
        with nullcontext() if is_study else reading(options.file):
            sentence = draw_picture(options.file, target, options.overrides, **picture_options)
            if not is_study:
                tell_stored(options.file)
        print(sentence)
    except UsageError as error:
        fail(f"--{error}")
    except StudyError:
        if _time_written(target) != time_before:
            print(f"{target}: what could be read; what is wrong stands on it", file=sys.stderr)
        raise
    return OK


def _picture_name(options: argparse.Namespace, is_study: bool) -> Path:
    """Return the file to draw into. Raises UsageError where none is named."""
    if is_study:
        return options.picture or Path("results") / f"{options.file.stem}.scene.png"
    if options.overrides:
        fail("--set: a result file keeps its study; leave it out")
    if options.picture is None:
        fail("PICTURE: name a .png, .svg or .pdf file")
    return Path(options.picture)


def _wanted_picture(options: argparse.Namespace) -> dict[str, Any]:
    """Return the options of the picture by name, as of `tcstudy.draw`. Raises UsageError."""
    from tcstudy.reports.figures.draw import pair_of

    names = [flags[0].removeprefix("--") for flags, _ in PICTURE_OPTIONS]
    values = {name: getattr(options, name) for name in names}
    if options.map is not None:
        values["map"] = pair_of(options.map)
    return {**values, "at": point_of(options) or None}


def _time_written(path: Path) -> int | None:
    return path.stat().st_mtime_ns if path.exists() else None


_SHOW_AT = "of a run the points to list, of a convergence file the point whose tables to show"
_SHOW_OF = (
    "for a run with sampled points: the variable whose Sobol indices to show "
    "(of mode: saltelli slip_length)"
)


@command(
    "print the summary of a result file",
    RESULT_FILE,
    *PRINTING,
    at_option(_SHOW_AT),
    option("--of", metavar="VARIABLE", help=_SHOW_OF),
)
def show(options: argparse.Namespace) -> int:
    """Print again what run, converge or cost printed."""
    from tcstudy.data.files import reading

    with reading(options.file):
        _check_show_options(options)
        print_results(options, options.file, index_variable=_index_variable(options))
    return OK


def _check_show_options(options: argparse.Namespace) -> None:
    """Raise UsageError for points of a file whose summary is of all its points."""
    from tcstudy.data.files import kind_of

    kind = kind_of(options.file)
    if point_of(options) and kind not in ("convergence", "run"):
        fail(f"--at: what is said of a {kind} is of all its points; leave it out")


def _index_variable(options: argparse.Namespace) -> str | None:
    """Return the variable whose Sobol indices are shown. Raises UsageError."""
    from tcstudy.data.files import attributes, kind_of
    from tcstudy.scene.designs import SALTELLI

    is_run = kind_of(options.file) == "run"
    design = attributes(options.file).get("design_mode") if is_run else None
    if options.of is not None and design is None:
        sweep = f"sweep: {{mode: {SALTELLI}, points: 256, PARAMETER: {{uniform: [a, b]}}}}"
        fault = f"it names a result for indices, and {options.file} has no design for them"
        fail(f"--of: {fault}; run its study with {sweep}, or take all results with --json")
    usual = "slip_length" if design == SALTELLI else None
    return options.of or usual


@command(
    "make one HTML page of a result file, for any browser, offline",
    RESULT_FILE,
    option(
        "-o", "--output", type=file_to_write, metavar="PAGE", help="the page (default: FILE.html)"
    ),
)
def report(options: argparse.Namespace) -> int:
    """Make one HTML page of a file of any kind."""
    from tcstudy.data.files import reading, tell_stored
    from tcstudy.reports.page.write import write_page

    target = options.output or options.file.with_suffix(".html")
    if target.suffix.lower() not in (".html", ".htm"):
        fail(f"{target}: a page's name ends in .html; choose such a name")
    with reading(options.file):
        page = write_page(options.file, target)
        tell_stored(options.file)
    print(page.words)
    return OK


def _form_option(flag: str, help: str) -> Option:
    return choice_option(flag, dest="form", help=help)


_EXPORT_LEVEL = "mesh level of --vtu (default: the finest)"
_TARGET = "folder of the fields (default: FILE), or the table (default: FILE.csv, FILE.json)"


@command(
    "write a result file for other programs: fields for ParaView, a table as CSV or JSON",
    RESULT_FILE,
    _form_option("--vtu", "body and contact line of every point, and one PVD (ParaView)"),
    _form_option("--csv", "one row per point and level, columns `name [unit]`"),
    _form_option("--json", "the same rows as objects"),
    option("-o", "--output", type=file_name, metavar="TARGET", help=_TARGET),
    at_option("only points with this value (may be repeated)"),
    option("--level", type=int, metavar="N", help=_EXPORT_LEVEL),
)
def export(options: argparse.Namespace) -> int:
    """Write a result file in another form."""
    if options.form is None:
        forms = "--vtu for the fields of every point, --csv or --json for the table of points"
        fail(f"choose one form: {forms}")
    if options.level is not None and options.form != "vtu":
        fail("--level: a table has all levels; leave it out")
    from tcstudy.data.files import reading, tell_stored
    from tcstudy.reports.export import write_form

    with reading(options.file):
        tell_stored(options.file)
        target, remarks = write_form(
            options.file, options.form, options.output, point_of(options), options.level
        )
    print("\n".join([f"{target}: {remarks[0]}", *remarks[1:]]))
    return OK
