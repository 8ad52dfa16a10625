"""Run the commands that a guide shows and put in what they print.

`python -m tests.console README.md configs/tutorial.md` writes the output again. Blocks marked `console`
have commands behind `$`; blocks marked `yaml` behind a line "`NAME.yaml`:" are the files that they read.
"""

import os
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.commands import CONFIGS, tcstudy_command

WIDTH = 80
"""Columns of the terminal that guides show."""
BLOCK = re.compile(r"^```console\n(.*?)^```$", re.DOTALL | re.MULTILINE)
FILE = re.compile(r"^`(\w+\.yaml)`:\n\n```yaml\n(.*?)^```$", re.DOTALL | re.MULTILINE)
MACHINE = re.compile(
    r"about [\d.]+ \w+"  # forecasts
    r"|\d(?:\.\d+)?e-1\d"  # residuals at rounding level
    r"|\d+(?= segments)"  # of a path: events within rounding may be one or two
    r"|(?<=\d) +[\d.]+$(?=\n\n  Level)",  # the time of the finest mesh
    re.MULTILINE,
)
"""What differs from one machine to another."""


def printed(page: str, folder: Path) -> str:
    """Return a page with the output of its commands, run one after the other in a folder."""
    (folder / "results").mkdir()
    (folder / "configs").symlink_to(CONFIGS)
    for name, text in FILE.findall(page):
        (folder / name).write_text(text, encoding="utf-8")
    return BLOCK.sub(lambda block: f"```console\n{_session(block[1], folder)}```", page)


def without_machine(page: str) -> str:
    """Return a page without what differs from one machine to another."""
    return MACHINE.sub("#", page)


def _session(block: str, folder: Path) -> str:
    """Return the commands of a block, each with what it prints."""
    commands = [line for line in block.splitlines() if line.startswith("$ ")]
    return "".join(f"{command}\n{_output(command[2:], folder)}" for command in commands)


def _output(command: str, folder: Path) -> str:
    """Return what a command prints, or its fault; what follows its first pipe filters that."""
    program, _, filters = command.partition(" | ")
    words = shlex.split(program)[1:]
    result = tcstudy_command(*words, cwd=folder)
    output = result.stderr if result.returncode else result.stdout
    if filters:
        output = subprocess.run(
            filters, shell=True, input=output, capture_output=True, text=True, check=True
        ).stdout
    return re.sub(r"^\s*\n", "", output).rstrip() + "\n"


if __name__ == "__main__":
    os.environ["COLUMNS"] = str(WIDTH)
    for name in sys.argv[1:]:
        with tempfile.TemporaryDirectory() as scratch:
            text = printed(Path(name).read_text(encoding="utf-8"), Path(scratch))
        Path(name).write_text(text, encoding="utf-8")
