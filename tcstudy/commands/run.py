"""tcstudy run: all points on all levels into a netCDF file, or what another section asks for; or what that would be."""

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
    from tcstudy.study.plan import Plan
    from tcstudy.study.workers import Resources

KEPT = "finished points are kept, the same command goes on from there"
"""What becomes of the work of a run that is stopped."""
_APPEND = "keep the points of the result file and add those that the study's sweep has beside them"
_DRY_RUN = "make every check and say what a run would do, and about what it takes; writes nothing"


@command(
    "do what a study asks: solve its sweep, or follow its path or history, or find its fit; writes a netCDF file",
    *STUDY,
    shared.output_option("result file (default: results/<study>.nc; of a path results/<study>-path.nc, and so on)"),
    shared.plot_option("also draw it"),
    *MANNER,
    shared.FORCE,
    shared.JOBS,
    shared.DASK,
    Option("--append", action="store_true", help=_APPEND),
    Option("--dry-run", action="store_true", help=_DRY_RUN),
    kept=KEPT,
)
def run(options: argparse.Namespace) -> int:
    """Do what a study asks, or say what that would be."""
    if options.force and options.append:
        fail("--force computes all points again, --append keeps them; give one of these")
    if options.dry_run:
        return _dry_run(options)
    from tcstudy.study.workers import WorkerPool

    with closing(WorkerPool(options.jobs, options.dask)) as pool:
        study, output = checked(options, at_once=lambda study: pool.early(study) if study.kind == "run" else None)
        if study.kind != "run":
            _check(options, study)
        how = {"append": options.append, "jobs": options.jobs, "dask": options.dask, "pool": pool}
        first = None if options.quiet else ""
        whole, there = shared.do(study.kind, study, output, options.words, first, options.force, **how)
    if there:
        note(options, f"{output} {there}")
    asked, failed = shared.failures(output)
    below = [*shared.plotted(options, output), f"data in {output}"]
    if study.kind == "run":
        below[-1:] = (f"{why}: {shlex.join(words)}" for why, words in _onward(options, output, failed))
        said = "found before" if whole else "found"
        below.insert(0, f"{asked - failed} of {asked} solutions {said}; data in {output}")
    say(options, output, ["", *(f"  {line}" for line in below)])
    return SOME_FAILED if failed else OK


def _check(options: argparse.Namespace, study: Study) -> None:
    """Raise UsageError for options of a sweep where the study asks for something else."""
    options.kept = "nothing was written"
    if study.history:
        options.kept = "finished steps are kept, the same command goes on from there"
    if options.append:
        way = f"run it with --set {study.kind}=null"
        fail(f"--append adds points of a sweep, and {options.study} has a section {study.kind}; leave it out, or {way}")
    if options.dask is not None and study.kind != "history":
        fail(f"--dask: a {study.kind} has no work for others; leave it out")


def _onward(options: argparse.Namespace, output: Path, failed: int) -> Iterator[tuple[str, list[str]]]:
    """What fits a run as the next command, with the reason."""
    from tcstudy.study.convergence import MIN_LEVELS

    study: Study = options.read
    kept = [text for text in options.overrides if not (text.startswith("path=") and study.path is None)]
    again = [str(options.study), *(f"--set={text}" for text in kept)]
    if failed:
        yield "what failed, and why", ["tcstudy", "show", str(output), "-v"]
        return
    if study.design is not None and study.design.mode == "saltelli":
        yield "which parameter decides", ["tcstudy", "show", str(output), "--of=friction_resultant"]
    if not study.solver.every and not study.mesh.guarantee and not shared.proved_unique(output):
        from tcstudy.scene.parameters import affine_numbers

        if len(study.axes) == 1 and (axis := study.axes[0]).path in dict(affine_numbers(study.scenes[0])):
            span = f"path={{parameter: {'.'.join(axis.path)}, from: {axis.values[0]}, to: {axis.values[-1]}}}"
            yield "whether a path has other solutions", ["tcstudy", "run", *again, f"--set={span}"]
    if study.mesh.levels >= MIN_LEVELS or (study.mesh.levels > 1 and (study.mesh.listed or study.exact is not None)):
        yield "how exact these are", ["tcstudy", "converge", *again]
    elif not study.mesh.listed:
        others = [word for word in again if not word.startswith("--set=mesh.levels=")]
        yield "how exact these are", ["tcstudy", "converge", *others, f"--set=mesh.levels={MIN_LEVELS}"]
    yield "all of it on one page", ["tcstudy", "report", str(output)]


def _dry_run(options: argparse.Namespace) -> int:
    """Every check that a run makes, and what the run would do."""
    study, output = checked(options)
    if study.kind == "path":
        study = options.read = shared.outside_the_sweep(study)
    from tcstudy.data.provenance import already_there
    from tcstudy.reports.terminal.progress import expected_words, forecast_text
    from tcstudy.study.plan import hands, plan, resources

    forecast = plan(study)
    workers, work = hands(study, forecast.levels, options.jobs)
    expected = resources(study, forecast, workers)
    time = expected_words(expected, at_most=study.mesh.open_ended)
    if options.json:
        print(_plan_json(study, output, forecast, expected))
    elif options.quiet:
        does = forecast.asked or f"{forecast.points} × {study.mesh.levels} solutions"
        print(f"{options.study}: {does}: {time}")
    else:
        more = [f"note: {text}" for text in already_there(output, study)]
        with shared.spoken(options):
            print(forecast_text(study, forecast, more, output, work, time))
    return OK


def _plan_json(study: Study, output: Path, forecast: Plan, expected: Resources) -> str:
    from tcstudy.data.store import axis_name
    from tcstudy.reports.export.table import json_text

    axes = [{"name": axis_name(axis), "units": axis.units, "values": axis.labels} for axis in study.axes]
    about = {"kind": "plan", "title": study.title, "output": str(output), "axes": axes}
    return json_text({**about, "most_levels": study.mesh.levels, **asdict(forecast), **asdict(expected)})
