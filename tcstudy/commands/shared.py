"""Options that several commands have, and how commands print what a file holds."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from tcstudy.errors import UsageError, printable

OK = 0
SOME_FAILED = 1
BAD_INPUT = 2
"""Exit codes of commands."""
MIN_WIDTH = 40
"""Characters to which tables are fitted on a narrower terminal, too."""
MAX_PROCESSES = 4096

Option = tuple[tuple[str, ...], dict[str, Any]]
"""The arguments, by place and by name, of argparse's `add_argument`."""


class Command(NamedTuple):
    """One command: its line in the list of commands, its options, its work.

    run: takes the parsed options and returns the exit code. These have `words`, the whole command
         line; `read`, the study once it is known; and `kept`, which says what becomes of the work
         of a command that is stopped.
    """

    help: str
    options: tuple[Option, ...]
    run: Callable[[argparse.Namespace], int]


Action = Callable[[argparse.Namespace], int]
"""A function that does the work of a command and returns its exit code."""


def command(help: str, *options: Option) -> Callable[[Action], Command]:
    """Make a command of the function below it."""
    return lambda run: Command(help, options, run)


def option(*flags: str, **settings: Any) -> Option:
    return flags, settings


def fail(text: str) -> NoReturn:
    """End the command for a fault of its options; the text says what to do."""
    raise UsageError(text)


def process_count(text: str) -> int:
    """Return a number of processes, 1 or more. Raises ArgumentTypeError."""
    if not text.isascii() or not text.isdigit() or not 1 <= int(text) <= MAX_PROCESSES:
        raise argparse.ArgumentTypeError(f"{text} is no number of processes; give 1 or more")
    return int(text)


def file_to_write(text: str) -> Path:
    """Return the name of a file to write. Raises ArgumentTypeError for that of a folder."""
    if text.endswith(("/", os.sep)):  # which a Path would forget
        raise argparse.ArgumentTypeError(f"{text} is a folder; give the name of a file in it")
    return file_name(text)


def file_name(text: str) -> Path:
    """Return a path, which takes one line wherever it is printed. Raises ArgumentTypeError."""
    if not text.strip():
        raise argparse.ArgumentTypeError(f"the name {text} is empty; give the name of a file")
    if printable(text) != text:
        fault = f"the name {text} has characters that no line shows"
        raise argparse.ArgumentTypeError(f"{fault}; give the name of a file")
    return Path(text)


def choice_option(*flags: str, dest: str, help: str) -> Option:
    """Return a flag that chooses its own name for `dest`; of such flags a command takes one."""
    return option(*flags, action="store_const", dest=dest, const=flags[-1][2:], help=help)


_QUIET = "print one line with the outcome"
_VERBOSE = "print all columns and rows, whatever the width of the terminal"
_JSON = "print one JSON object instead of tables: the same numbers, not rounded, in SI units"
_QUIET_OPTION = choice_option("-q", "--quiet", dest="manner", help=_QUIET)
_VERBOSE_OPTION = choice_option("-v", "--verbose", dest="manner", help=_VERBOSE)
_JSON_OPTION = choice_option("--json", dest="manner", help=_JSON)
PRINTING = (_QUIET_OPTION, _VERBOSE_OPTION, _JSON_OPTION)
"""How a command prints what it has to say: one of these."""
_SET = "replace a value of the study, e.g. --set heat.alpha=50 (may be repeated)"
SET = option("--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides", help=_SET)
STUDY = option("study", type=file_name, metavar="STUDY.yaml")
RESULT_FILE = option("file", type=file_name, metavar="FILE.nc")


def at_option(help: str) -> Option:
    return option("--at", action="append", default=[], metavar="NAME=VALUE", help=help)


def point_of(options: argparse.Namespace) -> dict[str, str]:
    """Return the labels of the sweep point that --at names. Raises UsageError."""
    labels = dict[str, str]()
    repeated = list[str]()
    for text in options.at:
        name, mark, value = text.partition("=")
        if not mark:
            fail("--at: write NAME=VALUE, for example --at alpha=100")
        if name in labels:
            repeated.append(name)
        labels[name] = value
    if repeated:
        remedy = "keep one, as a picture or a chart is of one point"
        fail(f"--at: {repeated[0]} is given twice; {remedy}")
    return labels


def _terminal_width() -> int:
    """Return $COLUMNS, or the width of the terminal that standard output is, or 0 if it is none.

    shutil.get_terminal_size looks at descriptor 1, which is not standard output while a command
    runs (`Stream.alone`).
    """
    with suppress(ValueError):
        return max(0, int(os.environ.get("COLUMNS", ""))) or _width_of_output()
    return _width_of_output()


def _width_of_output() -> int:
    try:
        return os.get_terminal_size(sys.stdout.fileno()).columns
    except (OSError, ValueError, AttributeError):  # no terminal, in memory, closed
        return 0


@contextmanager
def fitted_tables(options: argparse.Namespace) -> Iterator[None]:
    """Fit tables to the terminal ($COLUMNS or its width) for the time of a `with`.

    Files, pipes and --verbose have all columns.
    """
    from tcstudy.reports.text import fitting

    width = _terminal_width()
    is_fitted = width > 0 and options.manner != "verbose"
    with fitting(max(width, MIN_WIDTH) if is_fitted else None):
        yield


def print_results(
    options: argparse.Namespace,
    path: Path,
    lines_below: Sequence[str] = (),
    index_variable: str | None = None,
    has_warned: bool = False,
) -> None:
    """Print what a result file holds, as requested: tables, one line, or one JSON object.

    lines_below:    printed after the tables
    index_variable: of a run of a design for them, the variable whose Sobol indices are shown
    has_warned:     whether the warnings stand on standard error already; a terminal then shows
                    them once

    Raises StoreError where the file was changed after it was written and does not hold what it
    should.
    """
    from tcstudy.data.files import attributes, reading, remarks_of, tell
    from tcstudy.reports.terminal.summary import text_of, verdict_of

    with reading(path), fitted_tables(options):
        remarks = remarks_of(attributes(path))
        if options.manner == "quiet":
            tell(remarks)
            print(f"{path}: {verdict_of(path).sentence}")
        elif options.manner == "json":
            from tcstudy.reports.export import brief
            from tcstudy.reports.json_values import json_text
            from tcstudy.reports.terminal.indices import indices_json

            results = brief(path)
            if index_variable:
                results["indices"] = indices_json(path, index_variable)
            print(json_text(results))
        else:
            point = point_of(options) if hasattr(options, "at") else None
            tables = text_of(path, options.manner == "verbose", point, index_variable)
            print("\n".join([tables.rstrip("\n"), *lines_below]))
            _print_warnings([str(remark) for remark in remarks], has_warned)


def _print_warnings(warnings: Sequence[str], has_warned: bool) -> None:
    """Print warnings below tables, or their number if they stand above them on a terminal."""
    from tcstudy.reports.text import counted, wrapped

    if warnings and has_warned and sys.stdout.isatty() and sys.stderr.isatty():
        print(f"  {counted(len(warnings), 'warning')}, see above")
        return
    for warning in warnings:
        indented = warning.replace("\n", "\n  ")
        print(wrapped(f"  warning: {indented}"))
