"""tcstudy run, plan, merge: all points on all levels into a netCDF file; what that would be; several files in one."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Iterator
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from tcstudy.commands import shared
from tcstudy.commands.shared import MANNER, OK, SOME_FAILED, STUDY, Option, checked, command, fail, note, say

if TYPE_CHECKING:
    from tcstudy.scene.study import Study
    from tcstudy.study.jobs import Resources, Staff
    from tcstudy.study.plan import Plan

KEPT = "finished points are kept, the same command goes on from there"
"""What becomes of the work of a run that is stopped."""
_RETRY = "keep the result file's solutions and solve again only its points without one"
_APPEND = "keep the points of the result file and add those that the study's sweep has beside them"


@command(
    "run a study and write its netCDF file",
    *STUDY,
    shared.output_option("result file (default: results/<study>.nc)"),
    *MANNER,
    shared.FORCE,
    shared.JOBS,
    shared.DASK,
    Option("--retry", choices=("failed",), help=_RETRY),
    Option("--append", action="store_true", help=_APPEND),
    kept=KEPT,
)
def run(options: argparse.Namespace) -> int:
    """Run a study and write its netCDF file."""
    if options.force and (options.append or options.retry):
        fail("--force computes all points again, --append and --retry keep them; give one of these")
    from tcstudy.study.jobs import Staff

    with closing(Staff(options.jobs, options.dask)) as staff:
        study, output = checked(options, at_once=staff.early)
        return _run(options, study, output, staff)


def _run(options: argparse.Namespace, study: Study, output: Path, staff: Staff) -> int:
    """The same with a study that was found usable, and those who work."""
    kept = None
    if options.append or options.retry:
        from tcstudy.study.grow import appended, retried

        study, kept = (appended if options.append else retried)(output, study)
    there = shared.is_there(options, "run", study, output) if kept is None else not kept.todo.any()
    if there and kept is not None:
        note(options, f"{output} {'has all these points' if options.append else 'has no failed point'}")
    if there:
        points, failed = shared.stored(output)
        return _say(options, output, points, failed, "found before")
    from tcstudy.data.writer import sweep_points
    from tcstudy.reports.select_point import naming
    from tcstudy.reports.terminal.progress import progress
    from tcstudy.study.execute import execute

    named = lambda index: naming(sweep_points(study))(index)  # noqa: E731
    with closing(progress(naming=named, length=shared.length_unit(study))) as watcher:
        result = execute(study, output, None if options.quiet else watcher, options.words, kept=kept, staff=staff)
    return _say(options, result.output, result.points, result.failed, "found")


def _say(options: argparse.Namespace, output: Path, points: int, failed: int, found: str) -> int:
    """The summary of a run, where its data are and what could be asked next."""
    onward = "".join(f"\n  {why}: {shlex.join(words)}" for why, words in _onward(options, output, failed))

    def text() -> str:
        from tcstudy.reports.terminal.summary import MOST_ROWS, summary

        return (
            f"{summary(output, None if options.verbose else MOST_ROWS)}\n\n"
            f"  {points - failed} of {points} solutions {found}; data in {output}" + onward
        )

    say(options, output, text)
    return SOME_FAILED if failed else OK


def _onward(options: argparse.Namespace, output: Path, failed: int) -> Iterator[tuple[str, list[str]]]:
    """What fits a run as the next command, with the reason."""
    study: Study = options.read
    again = [str(options.study), *(f"--set={text}" for text in options.overrides)]
    if failed:
        yield "what failed, and why", ["tcstudy", "show", str(output), "-v"]
        return
    if study.design is not None and study.design.mode == "saltelli":
        yield "which parameter decides", ["tcstudy", "sensitivity", str(output)]
    if not shared.proved_unique(output):
        from tcstudy.read.plans import affine_parameters

        if study.path is not None:
            yield "whether a path has other solutions", ["tcstudy", "path", *again]
        elif len(study.axes) == 1 and (axis := study.axes[0]).path in dict(affine_parameters(study.scenes[0])):
            span = f"path={{parameter: {'.'.join(axis.path)}, from: {axis.values[0]}, to: {axis.values[-1]}}}"
            yield "whether a path has other solutions", ["tcstudy", "path", *again, f"--set={span}"]
    if study.mesh.levels > 1:
        yield "how exact these are", ["tcstudy", "converge", *again]
    elif not study.mesh.listed:
        others = [word for word in again if not word.startswith("--set=mesh.levels=")]
        yield "how exact these are", ["tcstudy", "converge", *others, "--set=mesh.levels=3"]
    yield "all of it on one page", ["tcstudy", "report", str(output)]


@command(
    "check a study and say what a run would do",
    *STUDY,
    shared.output_option("result file that a run would write"),
    *MANNER,
    shared.JOBS,
)
def plan(options: argparse.Namespace) -> int:
    """Every check that a run makes, and what the run would do."""
    study, output = checked(options, planned=True)
    from tcstudy.data.provenance import already_there
    from tcstudy.reports.terminal.forecast import expected_words, forecast_text
    from tcstudy.study.expected import work_words

    forecast, expected = _planned(options, study)
    steps = study.history.steps if study.history is not None else 0
    time = expected_words(**asdict(expected), at_most=study.mesh.open_ended)
    if options.json:
        print(_plan_json(study, output, forecast, expected))
    elif options.quiet:
        print(f"{options.study}: {forecast.points} × {steps or study.mesh.levels} solutions: {time}")
    else:
        more = [f"note: {text}" for text in already_there(output, study)]
        work = work_words(study, forecast.levels, options.jobs)
        with shared.spoken(options):
            print(forecast_text(study, forecast, more, output, work, time))
    return OK


def _planned(options: argparse.Namespace, study: Study) -> tuple[Plan, Resources]:
    """The forecast of a study and what a run takes; of many geometries by workers where that pays."""
    from tcstudy.study.trial import plan_and_resources

    if not study.variants:
        return plan_and_resources(study)
    from tcstudy.reports.terminal.progress import PlanProgress
    from tcstudy.study.errands import plans
    from tcstudy.study.jobs import Staff

    with closing(Staff(1 if options.jobs == 1 else None)) as staff, closing(PlanProgress()) as progress:
        shown = (lambda made, _: made) if options.quiet else progress
        return plan_and_resources(study, lambda own: shown(plans(own, staff), len(own)))


def _plan_json(study: Study, output: Path, forecast: Plan, expected: Resources) -> str:
    from tcstudy.data.writer import axis_name
    from tcstudy.reports.export.brief import json_text

    axes = [{"name": axis_name(axis), "units": axis.units, "values": axis.labels} for axis in study.axes]
    about = {"kind": "plan", "title": study.title, "output": str(output), "axes": axes}
    return json_text({**about, "most_levels": study.mesh.levels, **asdict(forecast), **asdict(expected)})


@command(
    "join result files of one study that have different points of its sweep",
    Option("files", type=shared.named, nargs="+", metavar="FILE.nc"),
    Option("-o", "--output", type=shared.file_name, required=True, metavar="FILE", help="the file of all points"),
    *MANNER,
    Option("--force", action="store_true", help="replace the output if it is there"),
)
def merge(options: argparse.Namespace) -> int:
    """Join result files of one study that have different points of its sweep."""
    shared.check_manner(options)
    output = options.output
    if len(options.files) < 2:
        fail("merge joins files; name two or more, for example tcstudy merge A.nc B.nc -o C.nc")
    if output.exists() and not options.force:
        fail(f"{output} exists; give another --output, or --force to replace it")
    from tcstudy.study.grow import merge as join

    points, failed, absent = join(options.files, output, options.words)
    said = f"{points - failed} of {points} solutions of {len(options.files)} files; data in {output}"
    lacks = f"\n  not run: {absent} places of the grid, whose points no file has" if absent else ""
    say(options, output, lambda: said + lacks)
    return SOME_FAILED if failed else OK
