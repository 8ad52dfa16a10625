"""tcstudy fit: numbers of a study from measurements."""

from __future__ import annotations

import argparse

from tcstudy.commands.shared import (
    FORCE,
    MANNER,
    OK,
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


def fit(options: argparse.Namespace) -> int:
    """Find numbers of a study from measurements."""
    study, output = checked(options, "fit")
    if study.fit is None:
        remedy = "add fit: {data: {file: ..., columns: ...}, parameters: ...}"
        fail(f"{options.study}: fit: the study has no section fit; {remedy}")
    from tcstudy.reports.figures.fit_figure import draw_fit
    from tcstudy.reports.terminal.fit import fit_summary
    from tcstudy.reports.terminal.tables import wrapped
    from tcstudy.study.fit import execute_fit

    if not is_there(options, "fit", study, output, data_sha256=study.fit.sha256):
        execute_fit(study, output, lambda text: note(options, text), options.words)
    drawn = [draw_fit(output, options.plot)] if options.plot is not None else []
    said = (*drawn, f"data in {output}")
    say(options, output, lambda: wrapped("\n".join([fit_summary(output), "", *(f"  {line}" for line in said)])))
    return OK


COMMANDS = {
    "fit": Command(
        "find numbers of a study from measurements",
        (
            *STUDY,
            output_option("result file (default: results/<study>-fit.nc)"),
            plot_option("also draw it"),
            *MANNER,
            FORCE,
        ),
        fit,
    )
}
