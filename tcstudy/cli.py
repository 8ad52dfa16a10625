"""Command line: which module has which command, and what becomes of faults, interrupts and missing memory."""

from __future__ import annotations

import argparse
import difflib
import gc
import shlex
import sys
import warnings
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any, NoReturn

from tcstudy.commands.shared import BAD_INPUT, OK
from tcstudy.errors import StudyWarning, UserFault, printable
from tcstudy.reports.terminal.stream import guarded_streams, is_lost

MODULES = {
    **dict.fromkeys(("run", "converge", "cost"), "run"),
    **dict.fromkeys(("show", "draw", "report", "export"), "results"),
    "init": "run",
}
"""Which module of `commands` has which command, in the order of the list."""
FORMER = {
    "plan": "tcstudy run {} --dry-run",
    **dict.fromkeys(("path", "history", "fit"), "tcstudy run {}, which does what the study asks"),
    "sensitivity": "tcstudy show {}, which has the indices of a design",
    **dict.fromkeys(("merge", "compare"), "xarray's work: see 'Files that grow' in results/README.md"),
    "schema": "tcstudy init, which writes study.schema.json beside the starter",
    "completion": "shtab's work: see 'Commands' in README.md",
}
"""What to type in place of commands that there were; {} for what stood after them."""
NO_ROOM, INTERRUPTED = 3, 130

_EPILOG = (
    "exit codes: 0 all points solved, 1 some points failed, 2 bad study or usage, 3 no memory or no room for what is "
    "printed, 130 interrupted"
)
RARE = 50_000
"""Objects after which cycles are looked for; every 700, as is usual, takes a tenth of the second of imports."""
_NEEDED = 1 << 28
"""Bytes that the mesher and the solvers ask for at once; where these are not to be had, memory is what is short."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code; raises SystemExit for bad usage and bad studies."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    gc.set_threshold(RARE)
    with guarded_streams() as out, warnings.catch_warnings():
        warnings.simplefilter("always", StudyWarning)
        warnings.showwarning = _shown(warnings.showwarning)
        try:
            code = _command(arguments)
        except SystemExit as stop:
            if stop.code:
                raise
            code = OK
        out.flush()
        if is_lost(out):
            print(f"standard output: {out.lost}; what was to be printed is lost", file=sys.stderr)
            code = code or NO_ROOM
    return code


def _command(arguments: list[str]) -> int:
    """What the words ask for."""
    named = arguments[0] if arguments and arguments[0] in MODULES else None
    if named is None and arguments and not arguments[0].startswith("-"):
        word = arguments[0]
        if word in FORMER:
            rest = printable(shlex.join(arguments[1:])) or "FILE"
            print(f"tcstudy: {word} is now: {FORMER[word].format(rest)}", file=sys.stderr)
            raise SystemExit(BAD_INPUT)
        near = difflib.get_close_matches(word.lower(), MODULES, n=1, cutoff=0.55)
        remedy = f"did you mean {near[0]!r}?" if near else f"use one of {', '.join(MODULES)}"
        if word.endswith((".yaml", ".yml", ".nc")):
            remedy = f"did you mean tcstudy {'show' if word.endswith('.nc') else 'run'} {word}?"
        print(f"tcstudy: there is no command {word!r}; {remedy}", file=sys.stderr)
        raise SystemExit(BAD_INPUT)
    options = parser_of(named).parse_args(arguments)
    options.words, options.parser_of = ["tcstudy", *arguments], parser_of
    try:
        return int(options.run(options))
    except UserFault as fault:
        print(_said(options, fault), file=sys.stderr)
        raise SystemExit(BAD_INPUT) from None
    except KeyboardInterrupt:
        print(f"interrupted; {options.kept}", file=sys.stderr)
        return INTERRUPTED
    except Exception as error:
        if not _memory_is_short(error):
            raise
        kept = options.kept
        print(f"there is not enough memory; {kept}. Free some, or ask for less (coarser meshes)", file=sys.stderr)
        return NO_ROOM


def _shown(otherwise: Callable[..., None]) -> Callable[..., None]:
    """How warnings are shown: those of a study in one line on standard error, and once."""
    told = set[str]()

    def show(message: Warning | str, category: type[Warning], *more: Any, **named: Any) -> None:
        if not issubclass(category, StudyWarning):
            otherwise(message, category, *more, **named)
        elif (text := f"warning: {printable(str(message))}") not in told:
            told.add(text)
            print(text, file=sys.stderr, flush=True)

    return show


def _said(options: argparse.Namespace, fault: UserFault) -> str:
    """A fault with its place in the study, where the command had read one."""
    if options.read is None:
        return str(fault)
    from tcstudy.study.lint import fault_in

    return fault_in(options.read, fault, str(options.study))


def _memory_is_short(error: Exception) -> bool:
    """Whether an error comes of missing memory; a library may call it by any name, so it is tried."""
    if isinstance(error, MemoryError):
        return True
    try:
        bytearray(_NEEDED)
    except MemoryError:
        return True
    return False


class _Parser(argparse.ArgumentParser):
    """Bad usage is said in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{self.prog}: {printable(message)}; see {self.prog} --help\n")


def parser_of(named: str | None = None) -> argparse.ArgumentParser:
    """The parser with one command, or with all of them, of which only one is needed to do it."""
    parser = _Parser(
        prog="tcstudy",
        description="Parametric studies of thermoelastic contact with nonmonotone, multivalued friction.",
        epilog=_EPILOG,
    )
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND", dest="command")
    for name in MODULES if named is None else (named,):
        command = getattr(import_module(f"tcstudy.commands.{MODULES[name]}"), name)
        command.fill(commands.add_parser(name, help=command.help, epilog=_EPILOG))
    parser.add_argument("--version", action="version", version=f"tcstudy {_version()}" if named is None else "")
    return parser


def _version() -> str:
    from importlib import metadata

    return metadata.version("tcstudy")
