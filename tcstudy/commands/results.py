"""tcstudy show, draw, report: what a result file says, as text, as a picture, as a page."""

from __future__ import annotations

import argparse

from tcstudy.commands.shared import ERROR, FILE, MEAN_SLIP, OK, RESPONSE, Command, Option, at, fail, file_name, point_of

DRAWN_BY = {"run": ("at", "level"), "path": ("response",), "convergence": ("at",), "cost": ("error",)}
"""Options that a picture of each kind of file depends on."""


def show(options: argparse.Namespace) -> int:
    """Print again what run, converge, cost or path said."""
    from tcstudy.data.provenance import kind_of
    from tcstudy.data.reading import reading
    from tcstudy.reports.convergence import convergence_report
    from tcstudy.reports.cost import cost_report
    from tcstudy.reports.path_summary import path_summary
    from tcstudy.reports.summary import summary

    reports = {"run": summary, "path": path_summary, "convergence": convergence_report, "cost": cost_report}
    with reading(options.file):
        text = reports[kind_of(options.file)](options.file).rstrip("\n")
    print(text)
    return OK


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


_PAGE = "the page (default: FILE.html)"
_WITHOUT = "leave out what makes a page large: levels, live, body or lines (may be repeated)"
COMMANDS = {
    "show": Command("print the summary of a result file", (FILE,), show),
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
