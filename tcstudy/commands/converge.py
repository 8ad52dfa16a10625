"""tcstudy converge: errors, rates and limits over the levels, into a file and as tables."""

from __future__ import annotations

import argparse
import sys

from tcstudy.commands.shared import (
    OK,
    SOME_FAILED,
    at_argument,
    checked,
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

HELP = "measure errors, rates and limits over the levels"


def arguments(parser: argparse.ArgumentParser) -> None:
    study_arguments(parser)
    output_argument(parser, "convergence file (default: results/<study>.convergence.nc)")
    format_argument(parser)
    plot_argument(parser, "draw the errors")
    at_argument(parser, "point of the plot (default: first)")
    force_argument(parser)


def command(options: argparse.Namespace) -> int:
    point = point_of(options)
    if point and options.plot is None:
        fail("--at: names the point of the picture, but there is none; add --plot PICTURE")
    study, path = checked(options, "convergence")
    from tcstudy.data.writer import sweep_points
    from tcstudy.reports.convergence import convergence_report
    from tcstudy.reports.convergence_plot import plot_convergence
    from tcstudy.reports.select_point import locate
    from tcstudy.reports.style import check_target
    from tcstudy.study.convergence import converge_to_file, without_errors

    if options.plot is not None:
        check_target(options.plot)
        locate(sweep_points(study), point, "study")
        if lack := without_errors(study):
            fail(f"--plot: there would be no errors to draw: {lack}")
    there = is_there(options, "convergence", study, path)
    failed = stored(path)[1] if there else converge_to_file(study, path, _say, options.words)
    print(convergence_report(path, options.format), end="")
    if options.plot is not None:
        print(plot_convergence(path, options.plot, point), file=sys.stderr)
    print(f"data in {path}", file=sys.stderr)
    return SOME_FAILED if failed else OK


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
