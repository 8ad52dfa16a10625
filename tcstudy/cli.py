"""The command line: its parser, and what becomes of faults, interrupts and missing memory."""

from __future__ import annotations

import argparse
import gc
import sys
import warnings
from collections.abc import Callable, Sequence
from importlib import metadata
from typing import Any, NoReturn

from tcstudy.commands import results, run
from tcstudy.commands.shared import BAD_INPUT, OK, Command, file_name, file_to_write
from tcstudy.errors import (
    Stream,
    StudyWarning,
    UserFault,
    guarded_streams,
    is_lost,
    printable,
    visible,
)

LISTED = (
    run.run,
    run.converge,
    run.cost,
    results.show,
    results.draw,
    results.report,
    results.export,
    run.init,
)
COMMANDS = {command.run.__name__: command for command in LISTED}
"""The commands by name, in the order of help."""
FILE_COMPLETION = {"bash": "_shtab_compgen_files", "zsh": "_files", "tcsh": "f"}
"""How shells complete the name of a file, for shtab."""
FORMER_COMMANDS = {
    "plan": "tcstudy run STUDY.yaml --dry-run",
    **dict.fromkeys(
        ("path", "history", "fit"),
        "tcstudy run STUDY.yaml, which runs sweeps, paths, histories and fits",
    ),
    "sensitivity": "tcstudy show FILE.nc, which has the indices of a design",
    **dict.fromkeys(
        ("merge", "compare"), "xarray's work: see 'Combine and compare files' in results/README.md"
    ),
    "schema": "tcstudy init, which writes study.schema.json beside the starter",
    "completion": "shtab's work: see 'Completion' in results/commands.md",
}
"""What to type in place of a former command."""
NO_ROOM = 3
INTERRUPTED = 130
"""Exit codes of commands that end early."""

_DESCRIPTION = "Parametric studies of thermoelastic contact with nonmonotone, multivalued friction."
_EPILOG = (
    "exit codes: 0 all points solved, 1 some points failed, 2 invalid study or usage, 3 too "
    "little memory or "
    "space for the output, 130 interrupted"
)
OBJECTS_PER_COLLECTION = 50_000
"""New objects after which the garbage collector looks for cycles.

With its usual 700 it takes a tenth of the second of imports.
"""
BYTES_NEEDED = 1 << 28
"""Bytes that the mesher and the solvers ask for at once.

Where these cannot be had, an error comes of missing memory.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    argv: the words after `tcstudy`; None for those of this process
    Raises SystemExit for bad usage and bad studies.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    gc.set_threshold(OBJECTS_PER_COLLECTION)
    with guarded_streams() as out, warnings.catch_warnings():
        warnings.simplefilter("always", StudyWarning)
        warnings.showwarning = _warning_printer(warnings.showwarning)
        try:
            code = _run_command(words, out)
        except SystemExit as stop:
            if stop.code:
                raise
            code = OK
        out.flush()
        if is_lost(out):
            print(f"standard output: {out.lost}; what was to be printed is lost", file=sys.stderr)
            code = code or NO_ROOM
    return code


def _run_command(words: list[str], out: Stream) -> int:
    """Run one command and return its exit code; faults and interrupts are printed in one line."""
    options = _parse(words)
    try:
        with out.alone():
            return int(options.run(options))
    except UserFault as fault:
        print(_fault_text(fault, options), file=sys.stderr)
        raise SystemExit(BAD_INPUT) from None
    except KeyboardInterrupt:
        print(f"interrupted; {options.kept}", file=sys.stderr)
        return INTERRUPTED
    except Exception as error:
        if not _is_memory_short(error):
            raise
        remedy = "Free some, or ask for less (coarser meshes)"
        print(f"there is not enough memory; {options.kept}. {remedy}", file=sys.stderr)
        return NO_ROOM


def _parse(words: list[str]) -> argparse.Namespace:
    """Return the options of a command line. Raises SystemExit."""
    name = words[0] if words else ""
    if name in FORMER_COMMANDS:
        print(f"tcstudy: {name} is now: {FORMER_COMMANDS[name]}", file=sys.stderr)
        raise SystemExit(BAD_INPUT)
    options = parser_of().parse_args(words)
    options.words = ["tcstudy", *words]
    return options


def _fault_text(fault: UserFault, options: argparse.Namespace) -> str:
    """Return the text of a fault, with its place in the study once that is read."""
    if options.read is None:
        return str(fault)
    from tcstudy.study.lint import fault_in

    return fault_in(options.read, fault, str(options.study))


def _warning_printer(print_other: Callable[..., None]) -> Callable[..., None]:
    """Return a function that prints every warning of a study on standard error, once.

    Warnings of libraries are printed by `print_other` for those who work on the program and ask for
    them (python -W). Others miss nothing: every solution is judged by its residual, and values that
    are not finite become a fault or a failed point with its reason.
    """
    printed = set[str]()

    def print_warning(
        message: Warning | str, category: type[Warning], *place: Any, **stream: Any
    ) -> None:
        if not issubclass(category, StudyWarning):
            if sys.warnoptions:
                print_other(message, category, *place, **stream)
            return
        text = f"warning: {visible(str(message))}"
        if text not in printed:
            printed.add(text)
            print(text, file=sys.stderr, flush=True)

    return print_warning


def _is_memory_short(error: Exception) -> bool:
    """Return whether an error comes of missing memory.

    A library may call it by any name, so memory is asked for.
    """
    if isinstance(error, MemoryError):
        return True
    try:
        bytearray(BYTES_NEEDED)
    except MemoryError:
        return True
    return False


class _Parser(argparse.ArgumentParser):
    """A parser whose faults take one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{self.prog}: {printable(message)}; see {self.prog} --help\n")


def parser_of() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = _Parser(prog="tcstudy", description=_DESCRIPTION, epilog=_EPILOG)
    version = f"tcstudy {metadata.version('tcstudy')}"
    parser.add_argument("--version", action="version", version=version)
    parsers = parser.add_subparsers(
        title="commands", required=True, metavar="COMMAND", dest="command"
    )
    for name, command in COMMANDS.items():
        command_parser = parsers.add_parser(name, help=command.help, epilog=_EPILOG)
        command_parser.set_defaults(read=None, kept="nothing was written", run=command.run)
        _add_options(command_parser, command)
    return parser


def _add_options(parser: argparse.ArgumentParser, command: Command) -> None:
    """Add the options of a command; of those that choose a manner or a form one may be given."""
    choices: Any = None
    for flags, settings in command.options:
        target: Any = parser
        if settings.get("action") == "store_const":
            choices = choices or parser.add_mutually_exclusive_group()
            target = choices
        action = target.add_argument(*flags, **settings)
        if settings.get("type") in (file_name, file_to_write):
            action.complete = FILE_COMPLETION  # where shtab looks for it
