"""tcstudy converge, cost: errors over the levels, and accuracy against cost; both into a file and as tables."""

from __future__ import annotations

import argparse
from contextlib import closing
from pathlib import Path

from tcstudy.commands import shared
from tcstudy.commands.shared import MANNER, OK, SOME_FAILED, STUDY, at, checked, command, fail, note, say


@command(
    "measure errors, rates and limits over the levels",
    *STUDY,
    shared.output_option("convergence file (default: results/<study>.convergence.nc)"),
    shared.FORMAT,
    *MANNER,
    shared.plot_option("draw the errors"),
    at("the point of tables and picture (default: orders of all, picture of the first)"),
    shared.FORCE,
)
def converge(options: argparse.Namespace) -> int:
    """Errors, rates and limits over the levels."""
    point = shared.point_of(options)
    study, path = checked(options, "convergence")
    from tcstudy.data.writer import sweep_points
    from tcstudy.reports.select_point import locate
    from tcstudy.reports.text import with_unit
    from tcstudy.study.convergence import converge_to_file, without_errors

    locate(sweep_points(study), point, "study")
    if options.plot is not None and (lack := without_errors(study)):
        fail(f"--plot: there would be no errors to draw: {lack}")
    if shared.is_there(options, "convergence", study, path):
        failed = shared.stored(path)[1]
    else:
        size = lambda h: with_unit(h, shared.length_unit(study), 3)  # noqa: E731
        failed = converge_to_file(study, path, lambda text: note(options, text), options.words, size)
    drawn = shared.plotted(options, path, at=point)
    return _end(options, drawn, path, failed)


@command(
    "chart accuracy against cost: meshes and solvers compared",
    *STUDY,
    shared.output_option("cost file (default: results/<study>.cost.nc)"),
    shared.FORMAT,
    *MANNER,
    shared.plot_option("draw the chart"),
    at("sweep point (default: first)"),
    shared.FORCE,
)
def cost(options: argparse.Namespace) -> int:
    """Accuracy against cost of mesh families and solvers, at one sweep point."""
    point = shared.point_of(options)
    study, path = checked(options, "cost")
    from tcstudy.data.writer import sweep_points
    from tcstudy.reports.select_point import describe, locate
    from tcstudy.reports.terminal.progress import CostProgress
    from tcstudy.study.cost import RUNS, cost_to_file

    points = sweep_points(study)
    where = locate(points, point, "study")
    words = describe(points, where)
    if shared.is_there(options, "cost", study, path, point=words, runs=RUNS):
        failed = shared.stored(path)[1]
    else:
        note(options, f"time unknown until the first of {RUNS} runs has measured it")
        with closing(CostProgress()) as bar:
            progress = (lambda what, left: None) if options.quiet else bar
            failed = cost_to_file(study, tuple(where.values()), words, RUNS, path, progress, options.words)
    drawn = shared.plotted(options, path)
    return _end(options, drawn, path, failed)


def _end(options: argparse.Namespace, drawn: list[str], path: Path, failed: int) -> int:
    """What the file says, what was drawn and where the data are."""
    say(options, path)
    for line in (*drawn, f"data in {path}"):
        note(options, line)
    return SOME_FAILED if failed else OK
