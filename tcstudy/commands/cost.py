"""tcstudy cost: accuracy against cost of mesh families and solvers, at one sweep point."""

from __future__ import annotations

import argparse
import sys
from contextlib import closing

from tcstudy.commands.shared import (
    OK,
    SOME_FAILED,
    at_argument,
    checked,
    error_argument,
    fail,
    force_argument,
    format_argument,
    is_there,
    output_argument,
    plot_argument,
    point_of,
    stored,
    study_arguments,
)

HELP = "chart accuracy against cost: meshes and solvers compared"


def arguments(parser: argparse.ArgumentParser) -> None:
    study_arguments(parser)
    output_argument(parser, "cost file (default: results/<study>.cost.nc)")
    parser.add_argument("--runs", type=int, default=5, metavar="N", help="how often everything is timed (default: 5)")
    format_argument(parser)
    plot_argument(parser, "draw the chart")
    at_argument(parser, "sweep point (default: first)")
    error_argument(parser)
    force_argument(parser)


def command(options: argparse.Namespace) -> int:
    from tcstudy.data.cost import MEASURES

    names = [measure.name for measure in MEASURES]
    if options.error is not None and options.error not in names:
        fail(f"--error: there is no error {options.error!r}; choose one of {', '.join(names)}")
    if options.runs < 1:
        fail(f"--runs: {options.runs} runs measure nothing; give 1 or more")
    point = point_of(options)
    study, path = checked(options, "cost")
    from tcstudy.data.writer import sweep_points
    from tcstudy.reports.cost import cost_report
    from tcstudy.reports.cost_plot import plot_cost
    from tcstudy.reports.progress import CostProgress
    from tcstudy.reports.select_point import describe, locate
    from tcstudy.reports.style import check_target
    from tcstudy.study.cost import cost_to_file, unmeasured

    with closing(CostProgress()) as progress:
        if options.plot is not None:
            check_target(options.plot)
        points = sweep_points(study)
        where = locate(points, point, "study")
        words = describe(points, where)
        if options.error is not None and (lack := unmeasured(study, options.error)):
            fail(f"--error: {options.error} {lack}")
        if is_there(options, "cost", study, path, point=words, runs=options.runs):
            failed = stored(path)[1]
        else:
            failed = cost_to_file(study, tuple(where.values()), words, options.runs, path, progress, options.words)
    print(cost_report(path, options.format, options.error), end="")
    if options.plot is not None:
        print(plot_cost(path, options.plot, options.error), file=sys.stderr)
    print(f"data in {path}", file=sys.stderr)
    return SOME_FAILED if failed else OK
