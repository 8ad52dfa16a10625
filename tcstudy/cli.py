"""Command line: the commands, and what becomes of faults, interrupts and missing memory."""

from __future__ import annotations

import argparse
import gc
import sys
import warnings
from collections.abc import Callable, Sequence
from importlib import metadata
from typing import Any, NoReturn

from tcstudy.commands import results, run
from tcstudy.commands.shared import BAD_INPUT, OK, file_name, named
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
"""By their words."""
COMPLETED = {"bash": "_shtab_compgen_files", "zsh": "_files", "tcsh": "f"}
"""How shells complete the name of a file, for shtab."""
FORMER = {
    "plan": "tcstudy run STUDY.yaml --dry-run",
    **dict.fromkeys(
        ("path", "history", "fit"), "tcstudy run STUDY.yaml, which does what the study asks"
    ),
    "sensitivity": "tcstudy show FILE.nc, which has the indices of a design",
    **dict.fromkeys(
        ("merge", "compare"), "xarray's work: see 'Files that grow' in results/README.md"
    ),
    "schema": "tcstudy init, which writes study.schema.json beside the starter",
    "completion": "shtab's work: see 'Completion' in results/commands.md",
}
"""What to type in place of commands that there were."""
NO_ROOM, INTERRUPTED = 3, 130

_EPILOG = (
    "exit codes: 0 all points solved, 1 some points failed, 2 bad study or usage, 3 no memory or no room for what is "
    "printed, 130 interrupted"
)
RARE = 50_000
"""Objects after which cycles are looked for; every 700, as is usual, takes a tenth of the second of
imports."""
_NEEDED = 1 << 28
"""Bytes that the mesher and the solvers ask for at once; where these are not to be had, memory is
what is short."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code; raises SystemExit for bad usage and bad
    studies."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    gc.set_threshold(RARE)
    with guarded_streams() as out, warnings.catch_warnings():
        warnings.simplefilter("always", StudyWarning)
        warnings.showwarning = _shown(warnings.showwarning)
        try:
            code = _command(arguments, out)
        except SystemExit as stop:
            if stop.code:
                raise
            code = OK
        out.flush()
        if is_lost(out):
            print(f"standard output: {out.lost}; what was to be printed is lost", file=sys.stderr)
            code = code or NO_ROOM
    return code


def _command(arguments: list[str], out: Stream) -> int:
    if now := FORMER.get("".join(arguments[:1])):
        print(f"tcstudy: {arguments[0]} is now: {now}", file=sys.stderr)
        raise SystemExit(BAD_INPUT)
    options = parser_of().parse_args(arguments)
    options.words = ["tcstudy", *arguments]
    try:
        with out.alone():
            return int(options.run(options))
    except UserFault as fault:
        said = str(fault)
        if options.read is not None:  # the study, in which it has its place
            from tcstudy.study.lint import fault_in

            said = fault_in(options.read, fault, str(options.study))
        print(said, file=sys.stderr)
        raise SystemExit(BAD_INPUT) from None
    except KeyboardInterrupt:
        print(f"interrupted; {options.kept}", file=sys.stderr)
        return INTERRUPTED
    except Exception as error:
        if not _memory_is_short(error):
            raise
        kept = options.kept
        print(
            f"there is not enough memory; {kept}. Free some, or ask for less (coarser meshes)",
            file=sys.stderr,
        )
        return NO_ROOM


def _shown(otherwise: Callable[..., None]) -> Callable[..., None]:
    """Return how warnings are shown: those of a study on standard error, and once.

    Those of libraries are for who works on the program, and asks for them (python -W): every
    solution is judged by its residual, and values that are not finite become a fault or a failed
    point with its reason.
    """
    told = set[str]()

    def show(message: Warning | str, category: type[Warning], *more: Any, **named: Any) -> None:
        if not issubclass(category, StudyWarning):
            if sys.warnoptions:
                otherwise(message, category, *more, **named)
        elif (text := f"warning: {visible(str(message))}") not in told:
            told.add(text)
            print(text, file=sys.stderr, flush=True)

    return show


def _memory_is_short(error: Exception) -> bool:
    """Whether an error comes of missing memory; a library may call it by any name, so it is
    tried."""
    if isinstance(error, MemoryError):
        return True
    try:
        bytearray(_NEEDED)
    except MemoryError:
        return True
    return False


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{self.prog}: {printable(message)}; see {self.prog} --help\n")


def parser_of() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="tcstudy",
        description="Parametric studies of thermoelastic contact with nonmonotone, multivalued friction.",
        epilog=_EPILOG,
    )
    parser.add_argument(
        "--version", action="version", version=f"tcstudy {metadata.version('tcstudy')}"
    )
    parsers = parser.add_subparsers(
        title="commands", required=True, metavar="COMMAND", dest="command"
    )
    for name, one in COMMANDS.items():
        own = parsers.add_parser(name, help=one.help, epilog=_EPILOG)
        own.set_defaults(read=None, kept="nothing was written", run=one.run)
        said = any(told.get("action") == "store_const" for _, told in one.options)
        choice = (
            own.add_mutually_exclusive_group() if said else own
        )  # how a command prints, or which form it writes
        for flags, told in one.options:
            action = (choice if told.get("action") == "store_const" else own).add_argument(
                *flags, **told
            )
            if told.get("type") in (named, file_name):
                action.complete = COMPLETED  # type: ignore[attr-defined]  # where shtab looks for it
    return parser
