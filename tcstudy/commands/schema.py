"""tcstudy schema: the JSON Schema of a study file, for editors, or the table of its keys."""

from __future__ import annotations

import argparse

from tcstudy.commands.shared import OK

HELP = "print the JSON Schema of a study file, or the table of its keys"


def arguments(parser: argparse.ArgumentParser) -> None:
    what = "json (default): the schema, draft 2020-12; markdown: the table of keys"
    parser.add_argument("--format", choices=("json", "markdown"), default="json", help=what)


def command(options: argparse.Namespace) -> int:
    if options.format == "json":
        from tcstudy.read.schema import schema_text

        print(schema_text(), end="")
    else:
        from tcstudy.read.key_table import markdown

        print(markdown(), end="")
    return OK
