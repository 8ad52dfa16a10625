"""tcstudy show, draw, report: what a result file says, as text, as a picture, as a page."""

from __future__ import annotations

import argparse
from pathlib import Path

from tcstudy.commands.shared import (
    ERROR,
    FILE,
    FULL,
    MANNER,
    MEAN_SLIP,
    OK,
    RESPONSE,
    Command,
    Option,
    at,
    check_manner,
    fail,
    file_name,
    point_of,
    say,
    spoken,
)

DRAWN_BY = {"run": ("at", "level"), "path": ("response",), "convergence": ("at",), "cost": ("error",)}
"""Options that a picture of each kind of file depends on."""


def show(options: argparse.Namespace) -> int:
    """Print again what run, converge, cost or path said; of another file with data, what it is."""
    check_manner(options)
    from tcstudy.data.reading import reading
    from tcstudy.errors import StoreError

    try:
        with reading(options.file):
            _show(options, options.file)
    except StoreError:
        from tcstudy.reports.other_file import other_text

        with spoken(options):
            text = "" if options.json or options.quiet else other_text(options.file)
        if not text:
            raise
        print(text)
    return OK


def _show(options: argparse.Namespace, file: Path) -> None:
    from tcstudy.data.provenance import kind_of
    from tcstudy.reports.convergence import convergence_report
    from tcstudy.reports.cost import cost_report
    from tcstudy.reports.path_summary import path_summary
    from tcstudy.reports.summary import MOST_ROWS, summary
    from tcstudy.reports.tables import wrapped

    point, full, kind = point_of(options), options.full or options.verbose, kind_of(file)
    if (point or options.full) and kind != "convergence":
        fail("--at and --full choose tables of a file of tcstudy converge, which this is not; leave them out")
    texts = {
        "run": lambda: summary(file, None if options.verbose else MOST_ROWS),
        "path": lambda: wrapped(path_summary(file)),
        "convergence": lambda: convergence_report(file, "text", point, full),
        "cost": lambda: cost_report(file),
    }
    say(options, file, texts[kind])


def draw(options: argparse.Namespace) -> int:
    """Draw a file of any kind."""
    from tcstudy.data.provenance import kind_of
    from tcstudy.reports.draw import picture

    point = point_of(options)
    kind = kind_of(options.file)
    if point and kind in ("path", "cost"):
        fail(f"--at: the file of tcstudy {kind} has one scene and no sweep points; leave it out")
    for name in ("level", "response", "error"):
        if getattr(options, name) is not None and name not in DRAWN_BY[kind]:
            fail(f"--{name}: the picture of a {kind} file does not depend on it; leave it out")
    level = -1 if options.level is None else options.level
    print(picture(options.file, options.picture, point, level, options.response or MEAN_SLIP, options.error))
    return OK


def report(options: argparse.Namespace) -> int:
    """Make one HTML page of a file of any kind."""
    from tcstudy.reports.page import LEAVE_OUT, write_page

    if unknown := [part for part in options.without if part not in LEAVE_OUT]:
        fail(f"--without: there is no part {unknown[0]!r}; choose of {', '.join(LEAVE_OUT)}")
    target = options.output or options.file.with_suffix(".html")
    print(write_page(options.file, target, tuple(options.without)).words)
    return OK


_TABLES = "of a convergence file: the point whose tables to show"
_PAGE = "the page (default: FILE.html)"
_WITHOUT = "leave out what makes a page large: levels, live, body or lines (may be repeated)"
COMMANDS = {
    "show": Command(
        "print the summary of a result file",
        (FILE, *MANNER, at(_TABLES), FULL),
        show,
    ),
    "draw": Command(
        "draw a result file: a point, a path, errors, costs",
        (
            FILE,
            Option("picture", type=file_name, metavar="PICTURE", help="a .png, .svg or .pdf file"),
            at("which point (may be repeated)"),
            Option("--level", type=int, metavar="N", help="mesh level (default: the finest)"),
            RESPONSE,
            ERROR,
        ),
        draw,
    ),
    "report": Command(
        "make one HTML page of a result file, for any browser, offline",
        (
            FILE,
            Option("-o", "--output", type=file_name, metavar="PAGE", help=_PAGE),
            Option("--without", action="append", default=[], metavar="PART", help=_WITHOUT),
        ),
        report,
    ),
}
