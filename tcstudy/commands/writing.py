"""tcstudy init: a study to begin with, and the schema that helps editors with it."""

from __future__ import annotations

import argparse
from pathlib import Path

from tcstudy.commands.shared import OK, Option, command, fail, file_name

SCHEMA = "study.schema.json"
_NEW = "the study (default: study.yaml); a file that is there is kept"
STARTER = f"""\
# yaml-language-server: $schema={SCHEMA}
# A block that is pushed along a film which weakens as it slips.
#
#     tcstudy run study.yaml --dry-run   checks it and says what a run would do
#     tcstudy run study.yaml             solves it; tcstudy show, draw and report read the results
#
# Numbers are SI or carry their unit (20 MPa, 40 um); a quantity that varies in space is an expression in quotes,
# "1e6*(1 + sin(pi*x))". configs/README.md lists all keys.

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
    print(f"{study} written; next: tcstudy run {study} --dry-run, tcstudy run {study}")
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
