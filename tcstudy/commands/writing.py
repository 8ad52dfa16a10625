"""tcstudy init, schema, completion: what helps to write a study."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from tcstudy.commands.shared import OK, Option, command, fail, file_name, named, target

SCHEMA = "study.schema.json"
SHELLS = ("bash", "zsh", "tcsh")
_NEW = "the study (default: study.yaml); a file that is there is kept"
_FORM = "json (default): the schema, draft 2020-12; markdown: the table of keys"
STARTER = f"""\
# yaml-language-server: $schema={SCHEMA}
# A block that is pushed along a film which weakens as it slips.
#
#     tcstudy plan study.yaml      checks it and says what a run would do
#     tcstudy run study.yaml       solves it; tcstudy show, draw and report read the results
#
# Numbers are SI or carry their unit (20 MPa, 40 um); a quantity that varies in space is an expression in quotes,
# "1e6*(1 + sin(pi*x))". `tcstudy schema --format markdown` lists all keys.

title: My first study

body:                               # sides: bottom, right, top, left; outlines, holes, arcs: see configs/README.md
  rectangle: {{width: 200 mm, height: 100 mm}}

boundary:                           # one role an edge: clamped, traction, contact, convection, free
  bottom: contact                   # held down (u_N = 0), with friction along it
  left: clamped
  top: {{role: traction, g: [8 MPa, 0]}}
  right: free

material: {{E: 210 GPa, nu: 0.3, plane: strain}}
# with heat: add k: 45 W/(m*K), alpha_T: 12e-6 1/K to the material, give an edge the role convection, and
# heat: {{alpha: 100 W/(m^2*K), theta_bar: 20 K}}

friction: {{law: slip-weakening, tau_s: 4 MPa, tau_k: 1 MPa, delta: 5 um}}

mesh: {{maxh: 20 mm, levels: 3}}      # level i is the i-th uniform refinement; also tolerance: 1e-3

sweep:                              # every combination is solved
  delta: [2 um, 5 um, 10 um]        # short for friction.delta
  boundary.top.g: [[4 MPa, 0], [8 MPa, 0]]
"""


@command(
    "write a commented starter study",
    Option("file", type=file_name, nargs="?", default=Path("study.yaml"), metavar="FILE", help=_NEW),
)
def init(options: argparse.Namespace) -> int:
    """Write the starter study and say what comes next."""
    study = starter(options.file)
    print(f"{study} written; next: tcstudy plan {study}, tcstudy run {study}")
    return OK


def starter(study: Path) -> Path:
    """Write the starter study and, beside it, the schema that its first line names to editors. Raises UsageError."""
    from tcstudy.read.schema import TITLE, schema_text

    schema = study.parent / SCHEMA
    try:
        ours = not schema.exists() or TITLE in schema.read_text(encoding="utf-8", errors="replace")
        with open(study, "x", encoding="utf-8") as file:
            file.write(STARTER.replace("study.yaml", study.name))
        if ours:
            schema.write_text(schema_text(), encoding="utf-8")
    except FileExistsError:
        fail(f"{study}: is there already, and is kept; name another file")
    except OSError as error:
        fail(f"{study}: cannot be written ({error.strerror or error}); name another file")
    return study


@command(
    "print the JSON Schema of a study file, or the table of its keys",
    Option("--format", choices=("json", "markdown"), default="json", help=_FORM),
)
def schema(options: argparse.Namespace) -> int:
    """Print the JSON Schema of a study file, for editors, or the table of its keys."""
    if options.format == "json":
        from tcstudy.read.schema import schema_text as text
    else:
        from tcstudy.read.schema import markdown as text
    print(text(), end="")
    return OK


@command(
    'print shell completion: eval "$(tcstudy completion bash)"',
    Option("shell", choices=SHELLS, help="the shell that is to complete"),
)
def completion(options: argparse.Namespace) -> int:
    """Print what makes a shell complete commands, options and file names."""
    import shtab

    parser = options.parser_of()
    for action in _actions(parser):
        if action.type in (named, file_name, target):
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
