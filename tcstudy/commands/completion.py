"""tcstudy completion: what makes a shell complete commands, options and file names."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from tcstudy.commands.shared import OK, file_name

HELP = 'print shell completion: eval "$(tcstudy completion bash)"'
SHELLS = ("bash", "zsh", "tcsh")


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=SHELLS, help="the shell that is to complete")


def command(options: argparse.Namespace) -> int:
    import shtab

    from tcstudy.cli import parser_of_all

    parser = parser_of_all()
    for action in _actions(parser):
        if action.type in (Path, file_name):
            action.complete = shtab.FILE  # type: ignore[attr-defined]  # where shtab looks for it
    print(shtab.complete(parser, shell=options.shell))
    return OK


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """All options and arguments, those of the commands included."""
    for action in parser._actions:  # the library has no public list
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for one in action.choices.values():
                yield from _actions(one)
