"""tcstudy path: all solutions along one parameter, through folds."""

from __future__ import annotations

import argparse
from contextlib import closing

from tcstudy.commands.shared import (
    FORCE,
    MANNER,
    MEAN_SLIP,
    OK,
    RESPONSE,
    SOME_FAILED,
    STUDY,
    Command,
    checked,
    fail,
    is_there,
    note,
    output_option,
    plot_option,
    say,
)


def path(options: argparse.Namespace) -> int:
    """Follow all solutions along one parameter."""
    study, output = checked(options, "path", swept=False)
    if study.path is None:
        remedy = "add path: {parameter: theta_bar, from: 0 K, to: 40 K}"
        fail(f"{options.study}: path: the study has no section path; {remedy}")
    from tcstudy.data.path_store import stored_shortfalls
    from tcstudy.reports.figures.path_figure import draw_path
    from tcstudy.reports.terminal.path_summary import path_summary
    from tcstudy.reports.terminal.progress import PathProgress
    from tcstudy.reports.terminal.tables import wrapped
    from tcstudy.study.path_run import execute_path

    there = is_there(options, "path", study, output)
    if study.axes:
        names = ", ".join(axis.name for axis in study.axes)
        note(options, f"note: a path is of one scene, that outside the sweep; the values of {names} are not used")
    if there:
        problems = stored_shortfalls(output)
    else:
        with closing(PathProgress()) as progress:
            problems = execute_path(study, output, None if options.quiet else progress, options.words)
    drawn = [draw_path(output, options.plot, options.response or MEAN_SLIP)] if options.plot is not None else []
    said = (*drawn, *problems, f"data in {output}")
    say(options, output, lambda: wrapped("\n".join([path_summary(output), "", *(f"  {line}" for line in said)])))
    return SOME_FAILED if problems else OK


COMMANDS = {
    "path": Command(
        "follow all solutions along one parameter",
        (
            *STUDY,
            output_option("result file (default: results/<study>-path.nc)"),
            plot_option("also draw it"),
            RESPONSE,
            *MANNER,
            FORCE,
        ),
        path,
    )
}
