"""tcstudy init, run, converge, cost: make files, and only those that are not there."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tcstudy.commands.shared import (
    OK,
    PRINTING,
    SET,
    SOME_FAILED,
    STUDY,
    Option,
    at_option,
    command,
    file_to_write,
    fitted_tables,
    option,
    point_of,
    print_results,
    process_count,
)

if TYPE_CHECKING:
    from tcstudy.data.files import Kind
    from tcstudy.scene.study import Study
    from tcstudy.study.plan import Plan

KEPT_WORK = {
    "run": "finished points are kept, the same command goes on from there",
    "history": "finished steps are kept, the same command goes on from there",
}
"""What becomes of work that is stopped, by the kind of its results."""
_NEW = "the study (default: study.yaml); a file that is there is kept"
_RUN_OUTPUT = (
    "result file (default: results/<study>.nc; of a path results/<study>-path.nc, and so on)"
)
_APPEND = "keep the points of the result file and add those that the study's sweep has beside them"
_DRY_RUN = "make every check and say what a run would do, and about what it takes; writes nothing"
_JOBS = (
    "worker processes for contact problems, geometries, histories; 1 for none "
    "(default: as many as pay)"
)
_DASK = (
    "run the work on the workers of this dask scheduler: tcp://host:port; "
    "local starts one with --jobs workers"
)
_FORCE = "compute again what the result file holds already, and replace results of another study"
FORCE = option("--force", action="store_true", help=_FORCE)
_CONVERGE_AT = "the point of tables and picture (default: orders of all, picture of the first)"


def _output_option(help: str) -> Option:
    return option("-o", "--output", type=file_to_write, metavar="FILE", help=help)


def _plot_option(help: str) -> Option:
    formats = "a .png, .svg or .pdf file"
    return option("--plot", type=file_to_write, metavar="PICTURE", help=f"{help}: {formats}")


@command(
    "write a commented starter study",
    option(
        "file",
        type=file_to_write,
        nargs="?",
        default=Path("study.yaml"),
        metavar="FILE",
        help=_NEW,
    ),
)
def init(options: argparse.Namespace) -> int:
    """Write the starter study and say what comes next."""
    from tcstudy.study.starter import write_starter

    study = write_starter(options.file)
    print(f"{study} written; next: tcstudy run {study} --dry-run, tcstudy run {study}")
    return OK


WORK_OPTIONS = (
    option("--jobs", type=process_count, metavar="N", help=_JOBS),
    option("--dask", metavar="ADDRESS", help=_DASK),
    option("--append", action="store_true", help=_APPEND),
    option("--dry-run", action="store_true", help=_DRY_RUN),
)
"""Who does the work of a run, and how much of it."""


@command(
    "run a study: sweep, equilibrium path, load history or fit; writes a netCDF file",
    STUDY,
    SET,
    _output_option(_RUN_OUTPUT),
    _plot_option("also draw it"),
    *PRINTING,
    FORCE,
    *WORK_OPTIONS,
)
def run(options: argparse.Namespace) -> int:
    """Run a study, or print the work that it would take."""
    study = _read_study(options)
    if options.dry_run:
        return _dry_run(options, study)
    return _make_results(
        options,
        study.kind,
        study,
        append=options.append,
        jobs=options.jobs,
        dask=options.dask,
    )


@command(
    "measure errors, rates and limits over the levels",
    STUDY,
    SET,
    _output_option("convergence file (default: results/<study>.convergence.nc)"),
    *PRINTING,
    _plot_option("draw the errors"),
    at_option(_CONVERGE_AT),
    FORCE,
)
def converge(options: argparse.Namespace) -> int:
    """Measure errors, rates and limits over the levels."""
    point = point_of(options)
    study = _read_study(options, swept=True)
    return _make_results(options, "convergence", study, point, drawn_point=point)


@command(
    "chart accuracy against cost: meshes and solvers compared",
    STUDY,
    SET,
    _output_option("cost file (default: results/<study>.cost.nc)"),
    *PRINTING,
    _plot_option("draw the chart"),
    at_option("sweep point (default: first)"),
    FORCE,
)
def cost(options: argparse.Namespace) -> int:
    """Measure accuracy against cost of mesh families and solvers at one sweep point."""
    study = _read_study(options, swept=True)
    return _make_results(options, "cost", study, point_of(options))


def _read_study(options: argparse.Namespace, swept: bool | None = None) -> Study:
    """Read the study, and check that its picture can be drawn.

    The study is kept in the options, where cli finds the place of a later fault.
    """
    from tcstudy.read.study import read_study

    study: Study = read_study(options.study, options.overrides, swept=swept)
    options.read = study
    if options.plot is not None:
        from tcstudy.reports.figures.style import check_target

        check_target(options.plot)
    return study


def _make_results(
    options: argparse.Namespace,
    kind: Kind,
    study: Study,
    point: Mapping[str, Any] | None = None,
    drawn_point: Mapping[str, Any] | None = None,
    **work_options: Any,
) -> int:
    """Make the file, draw the picture of --plot, and print what the file holds and where it is."""
    from tcstudy.reports.select_point import sweep_point
    from tcstudy.reports.terminal.progress import open_progress
    from tcstudy.study.engine import Request, SweepPoint, make_file

    options.kept = KEPT_WORK.get(kind, options.kept)
    is_quiet = options.manner == "quiet"
    chosen = SweepPoint(*sweep_point(study, point)) if point or kind == "cost" else None
    request = Request(
        kind,
        study,
        options.output,
        options.words,
        force=options.force,
        point=chosen,
        **work_options,
    )
    results = make_file(request, partial(open_progress, first_line=None if is_quiet else ""))
    if results.note and not is_quiet:
        print(f"{results.path} {results.note}", file=sys.stderr, flush=True)
    lines_below = ["", f"  data in {results.path}"]
    if options.plot is not None:
        from tcstudy.pictures import draw_picture

        lines_below.insert(1, f"  {draw_picture(results.path, options.plot, at=drawn_point)}")
    print_results(options, results.path, lines_below, has_warned=not results.note)
    return SOME_FAILED if _count_shortfalls(results.path) else OK


def _count_shortfalls(output: Path) -> int:
    """Return how many solutions of a file are not as requested.

    These are points that failed, histories that ended early, and sentences on a path.
    """
    import netCDF4
    import numpy as np

    from tcstudy.data.files import SHORTFALLS
    from tcstudy.data.schema import PointStatus

    with netCDF4.Dataset(output) as nc:
        if "status" not in nc.variables:
            return len(str(getattr(nc, SHORTFALLS, "")).splitlines())
        if "step" in nc.dimensions:
            return int(np.count_nonzero(nc["reason"][...] != ""))
        status = nc["status"][...]
        return int(np.count_nonzero((status != PointStatus.OK) & (status != PointStatus.NOT_RUN)))


def _dry_run(options: argparse.Namespace, study: Study) -> int:
    """Print what a run would do and take."""
    from tcstudy.study.engine import outside_the_sweep, usable_output

    output = usable_output(study.kind, study, options.output)
    if study.kind == "path":
        study = outside_the_sweep(study)
        options.read = study
    from tcstudy.data.files import already_there
    from tcstudy.reports.terminal.progress import expected_words, forecast_lines, forecast_text
    from tcstudy.study.plan import hands, plan, resources

    forecast = plan(study)
    workers, work = hands(study, forecast.levels, options.jobs)
    expected = resources(study, forecast, workers)
    time = expected_words(expected, at_most=study.mesh.open_ended)
    notes = already_there(output, study)
    if options.manner == "json":
        lines = forecast_lines(study, forecast, notes, output, work, time)
        _print_plan_json(study, output, lines, asdict(forecast) | asdict(expected))
    elif options.manner == "quiet":
        print(f"{options.study}: {_work_in_words(study, forecast)}: {time}")
    else:
        with fitted_tables(options):
            print(forecast_text(study, forecast, notes, output, work, time))
    return OK


def _print_plan_json(
    study: Study, output: Path, lines: list[tuple[str, str]], numbers: Mapping[str, Any]
) -> None:
    from tcstudy.reports.json_values import json_text
    from tcstudy.reports.text import facts_by_label

    plan: dict[str, Any] = {"kind": "plan", "title": study.title, "output": str(output)}
    plan |= {"most_levels": study.mesh.levels, "verdict": facts_by_label(lines)}
    print(json_text(plan | dict(numbers)))


def _work_in_words(study: Study, forecast: Plan) -> str:
    return forecast.asked or f"{forecast.points} × {study.mesh.levels} solutions"
