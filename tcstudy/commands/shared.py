"""What commands have in common: options, the study and output they work on, and how they say what a file holds."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from tcstudy.errors import UsageError, printable

if TYPE_CHECKING:
    from tcstudy.data.provenance import Kind
    from tcstudy.scene.study import Study

OK, SOME_FAILED, BAD_INPUT = 0, 1, 2
"""Exit codes of commands."""
COMPLETED = {"bash": "_shtab_compgen_files", "zsh": "_files", "tcsh": "f"}
"""How shells complete the name of a file, for shtab."""
NARROWEST = 40
"""Characters below which nothing is fitted."""


def fail(text: str) -> NoReturn:
    """End the command for a fault of its options; the text says what to do."""
    raise UsageError(text)


class Option:
    """An option or argument of a command, as argparse is told of it."""

    def __init__(self, *flags: str, **told: Any) -> None:
        self.flags, self.told = flags, told


@dataclass(frozen=True)
class Command:
    """One command: its line in the list of commands, what it takes, what it does.

    run:  gets the options (with `words`, the whole command line) and returns the exit code
    kept: what becomes of the work of a command that is stopped
    """

    help: str
    options: tuple[Option, ...]
    run: Callable[[argparse.Namespace], int]
    kept: str

    def fill(self, parser: argparse.ArgumentParser) -> None:
        """Tell the parser of the options."""
        parser.set_defaults(read=None, kept=self.kept, run=self.run)
        for option in self.options:
            action = parser.add_argument(*option.flags, **option.told)
            if option.told.get("type") in (named, file_name):
                action.complete = COMPLETED  # type: ignore[attr-defined]  # where shtab looks for it


def command(
    help: str, *options: Option, kept: str = "nothing was written"
) -> Callable[[Callable[[argparse.Namespace], int]], Command]:
    """Make a command of the function below it."""
    return lambda run: Command(help, options, run, kept)


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


_SET = "replace a value of the study, e.g. --set heat.alpha=50 (may be repeated)"
_QUIET = "print one line: what came of it"
_VERBOSE = "print all columns and rows, whatever the width of the terminal"
_JSON = "print one JSON object instead of tables: the same numbers, not rounded, in SI units"

MANNER = (
    Option("-q", "--quiet", action="store_true", help=_QUIET),
    Option("-v", "--verbose", action="store_true", help=_VERBOSE),
    Option("--json", action="store_true", help=_JSON),
)
"""How a command prints what it has to say."""
STUDY = (
    Option("study", type=named, metavar="STUDY.yaml"),
    Option("--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides", help=_SET),
)
FILE = Option("file", type=named, metavar="FILE.nc")


def at(what: str) -> Option:
    return Option("--at", action="append", default=[], metavar="NAME=VALUE", help=what)


@contextmanager
def spoken(options: argparse.Namespace) -> Iterator[None]:
    """Tables fit the terminal for the time of a `with`: $COLUMNS or its width; files, pipes and --verbose have all."""
    from tcstudy.reports.terminal.tables import fitting

    columns = os.environ.get("COLUMNS", "")
    width = int(columns) if columns.isascii() and columns.isdigit() else 0
    if not width and sys.stdout.isatty():
        width = os.get_terminal_size(sys.stdout.fileno()).columns
    with fitting(max(width, NARROWEST) if width and not options.verbose else None):
        yield


def say(options: argparse.Namespace, path: Path, below: Sequence[str] = (), of: str | None = None) -> None:
    """Print what a result file says in the manner asked for: its tables, one line, or one JSON object.

    below: lines after the tables;  of: the number whose indices are shown, of a run of a design for them

    Raises StoreError where the file was changed after it was written and does not hold what it should.
    """
    from tcstudy.data.files import attributes, reading
    from tcstudy.data.provenance import kind_of, remarks_of, tell
    from tcstudy.reports.terminal.summary import text_of, verdict_of
    from tcstudy.reports.terminal.tables import wrapped

    with reading(path):
        remarks = remarks_of(attributes(path))
        if options.quiet:
            tell(remarks)
            print(f"{path}: {verdict_of(None, kind_of(path), path)[0]}")
        elif options.json:
            from tcstudy.reports.export.table import brief, json_text
            from tcstudy.reports.terminal.indices import indices_json

            print(json_text(brief(path) | ({"indices": indices_json(path, of)} if of else {})))
        else:
            point = point_of(options) if hasattr(options, "at") else None
            with spoken(options):
                print("\n".join([text_of(path, options.verbose, point, of).rstrip("\n"), *below]))
                print("".join(wrapped(f"  warning: {one}") + "\n" for one in remarks), end="")


def note(options: argparse.Namespace, text: str) -> None:
    """A line on standard error, unless one line is all that was asked for."""
    if not options.quiet:
        print(text, file=sys.stderr, flush=True)


def check_manner(options: argparse.Namespace) -> None:
    """Raise UsageError for manners that exclude each other."""
    given = [name for name in ("quiet", "verbose", "json") if getattr(options, name, False)]
    if len(given) > 1:
        fail(f"--{given[0]} and --{given[1]} exclude each other; leave one out")


def point_of(options: argparse.Namespace) -> dict[str, str]:
    """The sweep point that --at names; raises UsageError if it cannot be read."""
    words = [text.partition("=") for text in options.at]
    if not all(mark for _, mark, _ in words):
        fail("--at: write NAME=VALUE, for example --at alpha=100")
    names = [name for name, _, _ in words]
    if twice := [name for name in names if names.count(name) > 1]:
        fail(f"--at: {twice[0]} is given twice; keep one, as a picture or a chart is of one point")
    return {name: value for name, _, value in words}


def checked(
    options: argparse.Namespace,
    kind: Kind | None = None,
    at_once: Callable[[Study], object] = id,
) -> tuple[Study, Path]:
    """The study and the file that is asked for or usual for this kind, found usable as is a picture; raises UserFault.

    The study is kept in the options, where cli finds the place of a later fault.
    kind:    of the results; None for what `run` does with the study
    at_once: called with the study as soon as it is read, before the rest of the program is imported
    """
    check_manner(options)
    from tcstudy.read.study import read_study

    study = options.read = read_study(options.study, options.overrides, swept=None if kind is None else True)
    at_once(study)
    from tcstudy.study.lint import check_kind, faults, output_of  # needs the mesher, a fault in the text does not

    kind = kind or study.kind
    check_kind(study, kind, str(options.study))
    output = options.output or output_of(study, kind)
    if problems := faults(study, output):
        fail("\n".join(problems))
    if getattr(options, "plot", None) is not None:
        from tcstudy.reports.figures.style import check_target

        check_target(options.plot)
    return study, output
