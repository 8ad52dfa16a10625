"""tcstudy draw: a picture of a file of any kind."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tcstudy.commands.shared import MEAN_SLIP, OK, at_argument, error_argument, fail, point_of, response_argument

HELP = "draw a result file: a point, a path, errors, costs"
DRAWN_BY = {"run": ("at", "level"), "path": ("response",), "convergence": ("at",), "cost": ("error",)}
"""Options that a picture of each kind of file depends on."""


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE.nc")
    parser.add_argument("picture", type=Path, metavar="PICTURE", help="a .png, .svg or .pdf file")
    at_argument(parser, "which point (may be repeated)")
    parser.add_argument("--level", type=int, metavar="N", help="mesh level (default: the finest)")
    response_argument(parser)
    error_argument(parser)


def command(options: argparse.Namespace) -> int:
    from tcstudy.data.provenance import kind_of

    point = point_of(options)
    kind = kind_of(options.file)
    if point and kind in ("path", "cost"):
        fail(f"--at: the file of tcstudy {kind} has one scene and no sweep points; leave it out")
    for name in ("level", "response", "error"):
        if getattr(options, name) is not None and name not in DRAWN_BY[kind]:
            fail(f"--{name}: the picture of a {kind} file does not depend on it; leave it out")
    level = -1 if options.level is None else options.level
    print(picture(options.file, options.picture, point, level, options.response or MEAN_SLIP, options.error))
    return OK


def picture(
    file: Path, target: Path, point: Mapping[str, Any] | None, level: int, response: str, error: str | None
) -> str:
    """Draw a file of any kind; returns what was drawn. Raises StoreError, DrawError."""
    from tcstudy.data.provenance import kind_of
    from tcstudy.data.reading import reading
    from tcstudy.reports.convergence_plot import plot_convergence
    from tcstudy.reports.cost_plot import plot_cost
    from tcstudy.reports.draw import draw
    from tcstudy.reports.path_figure import draw_path

    kind = kind_of(file)
    with reading(file):
        if kind == "path":
            return draw_path(file, target, response)
        if kind == "cost":
            return plot_cost(file, target, error)
        if kind == "convergence":
            return plot_convergence(file, target, point)
        return draw(file, target, point, level)
