"""tcstudy plan: every check that a run makes, and what the run would do."""

from __future__ import annotations

import argparse

from tcstudy.commands.shared import OK, checked, jobs_argument, length_unit, output_argument, study_arguments

HELP = "check a study and say what a run would do"


def arguments(parser: argparse.ArgumentParser) -> None:
    study_arguments(parser)
    output_argument(parser, "result file that a run would write")
    jobs_argument(parser)


def command(options: argparse.Namespace) -> int:
    study, output = checked(options)
    from tcstudy.data.provenance import already_there
    from tcstudy.reports.forecast import forecast_text
    from tcstudy.study.jobs import work_words
    from tcstudy.study.plan import plan

    forecast = plan(study)
    axes = [(axis.name, axis.labels, axis.units) for axis in study.axes]
    print(
        forecast_text(
            study.title,
            axes,
            forecast.points,
            forecast.factorisations,
            forecast.heat_solves,
            forecast.levels,
            study.mesh.levels,
            forecast.left_out,
            (*forecast.notes, *already_there(output, study)),
            str(output),
            forecast.bytes,
            study.mesh.open_ended,
            length_unit(study),
            work_words(study, forecast.levels, options.jobs),
        )
    )
    return OK
