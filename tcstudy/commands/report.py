"""tcstudy report: one HTML page of a file of any kind."""

from __future__ import annotations

import argparse
from pathlib import Path

from tcstudy.commands.shared import OK, fail, file_name

HELP = "make one HTML page of a result file, for any browser, offline"


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE.nc")
    parser.add_argument("-o", "--output", type=file_name, metavar="PAGE", help="the page (default: FILE.html)")
    what = "leave out what makes a page large: levels, live, body or lines (may be repeated)"
    parser.add_argument("--without", action="append", default=[], metavar="PART", help=what)


def command(options: argparse.Namespace) -> int:
    from tcstudy.reports.page import LEAVE_OUT, write_page

    unknown = [part for part in options.without if part not in LEAVE_OUT]
    if unknown:
        fail(f"--without: there is no part {unknown[0]!r}; choose of {', '.join(LEAVE_OUT)}")
    target = options.output or options.file.with_suffix(".html")
    print(write_page(options.file, target, tuple(options.without)).words)
    return OK
