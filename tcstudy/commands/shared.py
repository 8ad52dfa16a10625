"""What commands have in common: options, and how they say what a file holds."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from tcstudy.errors import UsageError, printable

OK, SOME_FAILED, BAD_INPUT = 0, 1, 2
"""Exit codes of commands."""
NARROWEST = 40
"""Characters below which nothing is fitted."""

Option = tuple[tuple[str, ...], dict[str, Any]]
"""An option or argument of a command, as argparse is told of it."""


class Command(NamedTuple):
    """One command: its line in the list of commands, what it takes, what it does.

    run: gets the options and returns the exit code; they have `words`, the whole command line,
    `read`, the study once
         it is known, and `kept`, what becomes of the work of a command that is stopped
    """

    help: str
    options: tuple[Option, ...]
    run: Callable[[argparse.Namespace], int]


def command(
    help: str, *options: Option
) -> Callable[[Callable[[argparse.Namespace], int]], Command]:
    """Make a command of the function below it."""
    return lambda run: Command(help, options, run)


def option(*flags: str, **told: Any) -> Option:
    return flags, told


def fail(text: str) -> NoReturn:
    """End the command for a fault of its options; the text says what to do."""
    raise UsageError(text)


def count(text: str) -> int:
    """A number of things, 1 or more."""
    if not text.isascii() or not text.isdigit() or not 1 <= int(text) <= 4096:
        raise argparse.ArgumentTypeError(f"{text} is no number of processes; give 1 or more")
    return int(text)


def file_name(text: str) -> Path:
    """The name of a file to write; a Path would forget that the text named a folder."""
    if text.endswith(("/", os.sep)):
        raise argparse.ArgumentTypeError(f"{text} is a folder; give the name of a file in it")
    return named(text)


def named(text: str) -> Path:
    """A path, which takes one line wherever it is named."""
    if not text.strip() or printable(text) != text:
        what = "has characters that no line shows" if text.strip() else "is empty"
        raise argparse.ArgumentTypeError(f"the name {text} {what}; give the name of a file")
    return Path(text)


def _manner(*flags: str, help: str) -> Option:
    return option(*flags, action="store_const", dest="manner", const=flags[-1][2:], help=help)


MANNER = (
    _manner("-q", "--quiet", help="print one line: what came of it"),
    _manner(
        "-v", "--verbose", help="print all columns and rows, whatever the width of the terminal"
    ),
    _manner(
        "--json",
        help="print one JSON object instead of tables: the same numbers, not rounded, in SI units",
    ),
)
"""How a command prints what it has to say: one of these."""
_SET = "replace a value of the study, e.g. --set heat.alpha=50 (may be repeated)"
STUDY = (
    option("study", type=named, metavar="STUDY.yaml"),
    option("--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides", help=_SET),
)
FILE = option("file", type=named, metavar="FILE.nc")


def at(what: str) -> Option:
    return option("--at", action="append", default=[], metavar="NAME=VALUE", help=what)


def point_of(options: argparse.Namespace) -> dict[str, str]:
    """The sweep point that --at names; raises UsageError if it cannot be read."""
    words = [text.partition("=") for text in options.at]
    if not all(mark for _, mark, _ in words):
        fail("--at: write NAME=VALUE, for example --at alpha=100")
    names = [name for name, _, _ in words]
    if twice := [name for name in names if names.count(name) > 1]:
        fail(f"--at: {twice[0]} is given twice; keep one, as a picture or a chart is of one point")
    return {name: value for name, _, value in words}


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
def spoken(options: argparse.Namespace) -> Iterator[None]:
    """Tables fit the terminal for the time of a `with`: $COLUMNS or its width; files, pipes and
    --verbose have all."""
    from tcstudy.reports.text import fitting

    width = _terminal_width()
    with fitting(max(width, NARROWEST) if width and options.manner != "verbose" else None):
        yield


def say(
    options: argparse.Namespace,
    path: Path,
    below: Sequence[str] = (),
    of: str | None = None,
    warned: bool = False,
) -> None:
    """Print what a result file says in the manner asked for: its tables, one line, or one JSON
    object.

    below:  lines after the tables;  of: the number whose indices are shown, of a run of a design for them
    warned: whether the warnings stand on standard error already; a terminal then shows them once

    Raises StoreError where the file was changed after it was written and does not hold what it
    should.
    """
    from tcstudy.data.files import attributes, reading, remarks_of, tell
    from tcstudy.reports.terminal.summary import text_of, verdict_of
    from tcstudy.reports.text import counted, wrapped

    with reading(path), spoken(options):
        remarks = remarks_of(attributes(path))
        if options.manner == "quiet":
            tell(remarks)
            print(f"{path}: {verdict_of(path).sentence}")
        elif options.manner == "json":
            from tcstudy.reports.export import brief
            from tcstudy.reports.json_values import json_text
            from tcstudy.reports.terminal.indices import indices_json

            print(json_text(brief(path) | ({"indices": indices_json(path, of)} if of else {})))
        else:
            point = point_of(options) if hasattr(options, "at") else None
            print(
                "\n".join(
                    [text_of(path, options.manner == "verbose", point, of).rstrip("\n"), *below]
                )
            )
            if remarks and warned and sys.stdout.isatty() and sys.stderr.isatty():
                print(f"  {counted(len(remarks), 'warning')}, see above")
                return
            notes = [str(one).replace("\n", "\n  ") for one in remarks]
            print("".join(wrapped(f"  warning: {one}") + "\n" for one in notes), end="")
