"""tcstudy init: a study to begin with, and the schema that helps editors with it."""

from __future__ import annotations

import argparse
from pathlib import Path

from tcstudy.commands.shared import OK, Option, command, fail, file_name

SCHEMA = "study.schema.json"
_NEW = "the study (default: study.yaml); a file that is there is kept"
STARTER = Path(__file__).with_name("starter.yaml")


@command(
    "write a commented starter study",
    Option("file", type=file_name, nargs="?", default=Path("study.yaml"), metavar="FILE", help=_NEW),
)
def init(options: argparse.Namespace) -> int:
    """Write the starter study and say what comes next."""
    study = starter(options.file)
    print(f"{study} written; next: tcstudy run {study} --dry-run, tcstudy run {study}")
    return OK


def starter(study: Path) -> Path:
    """Write the starter study and, beside it, the schema that its first line names to editors. Raises UsageError."""
    from tcstudy.read.schema import TITLE, schema_text

    schema = study.parent / SCHEMA
    try:
        ours = not schema.exists() or TITLE in schema.read_text(encoding="utf-8", errors="replace")
        with open(study, "x", encoding="utf-8") as file:
            file.write(STARTER.read_text(encoding="utf-8").replace("study.yaml", study.name))
        if ours:
            schema.write_text(schema_text(), encoding="utf-8")
    except FileExistsError:
        fail(f"{study}: is there already, and is kept; name another file")
    except OSError as error:
        fail(f"{study}: cannot be written ({error.strerror or error}); name another file")
    return study
