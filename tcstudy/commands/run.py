"""tcstudy run: every sweep point on every level, into a netCDF file."""

from __future__ import annotations

import argparse
import shlex
from contextlib import closing
from pathlib import Path

from tcstudy.commands.shared import (
    OK,
    SOME_FAILED,
    checked,
    force_argument,
    is_there,
    jobs_argument,
    length_unit,
    output_argument,
    stored,
    study_arguments,
)

HELP = "run a study and write its netCDF file"
KEPT = "finished points are kept, the same command goes on from there"
"""What becomes of the work of a run that is stopped."""


def arguments(parser: argparse.ArgumentParser) -> None:
    study_arguments(parser)
    output_argument(parser, "result file (default: results/<study>.nc)")
    force_argument(parser)
    jobs_argument(parser)
    parser.set_defaults(kept=KEPT)


def command(options: argparse.Namespace) -> int:
    study, output = checked(options)
    if is_there(options, "run", study, output):
        points, failed = stored(output)
        return _say(options, output, points, failed, "found before")
    from tcstudy.data.writer import sweep_points
    from tcstudy.reports.progress import progress
    from tcstudy.reports.select_point import naming
    from tcstudy.study.run import execute

    with closing(progress(naming=naming(sweep_points(study)), length=length_unit(study))) as watcher:
        result = execute(study, output, watcher, options.words, options.jobs)
    return _say(options, result.output, result.points, result.failed, "found")


def _say(options: argparse.Namespace, output: Path, points: int, failed: int, found: str) -> int:
    """The summary of a run, where its data are and what could be asked next."""
    from tcstudy.reports.summary import summary

    print(summary(output))
    print(f"\n  {points - failed} of {points} solutions {found}; data in {output}")
    again = shlex.join(["tcstudy", "cost", str(options.study), *(f"--set={text}" for text in options.overrides)])
    print(f"  what accuracy costs here: {again} --plot cost.png")
    return SOME_FAILED if failed else OK
