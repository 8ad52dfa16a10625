"""tcstudy run, plan: every sweep point on every level, into a netCDF file; and what that would be."""

from __future__ import annotations

import argparse
import shlex
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from tcstudy.commands.shared import (
    DASK,
    FORCE,
    JOBS,
    OK,
    SOME_FAILED,
    STUDY,
    Command,
    checked,
    is_there,
    length_unit,
    output_option,
    stored,
)

if TYPE_CHECKING:
    from tcstudy.scene.study import Study

KEPT = "finished points are kept, the same command goes on from there"
"""What becomes of the work of a run that is stopped."""


def run(options: argparse.Namespace) -> int:
    """Run a study and write its netCDF file."""
    study, output = checked(options)
    if is_there(options, "run", study, output):
        points, failed = stored(output)
        return _say(options, output, points, failed, "found before")
    from tcstudy.reports.progress import progress
    from tcstudy.study.run import execute

    with closing(progress(naming=lambda index: _named(study, index), length=length_unit(study))) as watcher:
        result = execute(study, output, watcher, options.words, options.jobs, options.dask)
    return _say(options, result.output, result.points, result.failed, "found")


def _named(study: Study, index: tuple[int, ...]) -> str:
    """The labels of a point, for what is said of failures."""
    from tcstudy.data.writer import sweep_points
    from tcstudy.reports.select_point import naming

    return naming(sweep_points(study))(index)


def _say(options: argparse.Namespace, output: Path, points: int, failed: int, found: str) -> int:
    """The summary of a run, where its data are and what could be asked next."""
    from tcstudy.reports.summary import summary

    print(summary(output))
    print(f"\n  {points - failed} of {points} solutions {found}; data in {output}")
    again = shlex.join(["tcstudy", "cost", str(options.study), *(f"--set={text}" for text in options.overrides)])
    print(f"  what accuracy costs here: {again} --plot cost.png")
    return SOME_FAILED if failed else OK


def plan(options: argparse.Namespace) -> int:
    """Every check that a run makes, and what the run would do."""
    study, output = checked(options)
    from tcstudy.data.provenance import already_there
    from tcstudy.reports.forecast import forecast_text
    from tcstudy.study.jobs import work_words
    from tcstudy.study.plan import plan as forecast_of

    forecast = forecast_of(study)
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


COMMANDS = {
    "run": Command(
        "run a study and write its netCDF file",
        (*STUDY, output_option("result file (default: results/<study>.nc)"), FORCE, JOBS, DASK),
        run,
        KEPT,
    ),
    "plan": Command(
        "check a study and say what a run would do",
        (*STUDY, output_option("result file that a run would write"), JOBS),
        plan,
    ),
}
