"""tcstudy fit: numbers of a study from measurements."""

from __future__ import annotations

import argparse

from tcstudy.commands.shared import (
    FORCE,
    OK,
    STUDY,
    Command,
    Option,
    checked,
    fail,
    is_there,
    note,
    output_option,
    plot_option,
    spoken,
)


def fit(options: argparse.Namespace) -> int:
    """Find numbers of a study from measurements."""
    study, output = checked(options, "fit")
    if study.fit is None:
        remedy = "add fit: {data: {file: ..., columns: ...}, parameters: ...}"
        fail(f"{options.study}: fit: the study has no section fit; {remedy}")
    from tcstudy.reports.fit import fit_summary
    from tcstudy.reports.fit_figure import draw_fit
    from tcstudy.reports.tables import wrapped
    from tcstudy.study.fit import execute_fit

    if not is_there(options, "fit", study, output, data_sha256=study.fit.sha256):
        execute_fit(study, output, lambda text: note(options, text), options.words)
    drawn = [draw_fit(output, options.plot)] if options.plot is not None else []
    with spoken(options):
        print(wrapped("\n".join([fit_summary(output), "", *(f"  {line}" for line in (*drawn, f"data in {output}"))])))
    return OK


COMMANDS = {
    "fit": Command(
        "find numbers of a study from measurements",
        (
            *STUDY,
            output_option("result file (default: results/<study>-fit.nc)"),
            plot_option("also draw it"),
            Option("-q", "--quiet", action="store_true", help="say nothing while it works"),
            Option("-v", "--verbose", action="store_true", help="print tables whatever the width of the terminal"),
            FORCE,
        ),
        fit,
    )
}
