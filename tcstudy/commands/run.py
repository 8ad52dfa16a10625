"""tcstudy init, run, converge, cost: what makes files, and makes them only if they are not there."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tcstudy.commands.shared import (
    MANNER,
    OK,
    SOME_FAILED,
    STUDY,
    Option,
    at,
    checked,
    command,
    count,
    fail,
    file_name,
    note,
    point_of,
    say,
    spoken,
)
from tcstudy.errors import UsageError

if TYPE_CHECKING:
    from tcstudy.data.provenance import Kind
    from tcstudy.scene.study import Study
    from tcstudy.study.workers import WorkerPool

KEPT = "finished points are kept, the same command goes on from there"
"""What becomes of the work of a run that is stopped."""
_APPEND = "keep the points of the result file and add those that the study's sweep has beside them"
_DRY_RUN = "make every check and say what a run would do, and about what it takes; writes nothing"
_JOBS = "worker processes for contact problems, geometries, histories; 1 for none (default: as many as pay)"
_DASK = "dask scheduler whose workers do that instead: tcp://host:port; local starts one with --jobs workers"
_FORCE = "compute again what the result file holds already, and replace results of another study"
FORCE = Option("--force", action="store_true", help=_FORCE)
_NEW = "the study (default: study.yaml); a file that is there is kept"
STARTER, SCHEMA = Path(__file__).with_name("starter.yaml"), "study.schema.json"


def _output(what: str) -> Option:
    return Option("-o", "--output", type=file_name, metavar="FILE", help=what)


def _plot(what: str) -> Option:
    return Option("--plot", type=file_name, metavar="PICTURE", help=f"{what}: a .png, .svg or .pdf file")


@command(
    "write a commented starter study",
    Option("file", type=file_name, nargs="?", default=Path("study.yaml"), metavar="FILE", help=_NEW),
)
def init(options: argparse.Namespace) -> int:
    """Write the starter study and say what comes next."""
    study = starter(options.file)
    print(f"{study} written; next: tcstudy run {study} --dry-run, tcstudy run {study}")
    return OK


def starter(study: Path) -> Path:
    """Write the starter study and, beside it, the schema that its first line names to editors. Raises UsageError."""
    from tcstudy.read.schema import TITLE, schema_text

    schema = study.parent / SCHEMA
    try:
        ours = not schema.exists() or TITLE in schema.read_text(encoding="utf-8", errors="replace")
        with open(study, "x", encoding="utf-8") as file:
            file.write(STARTER.read_text(encoding="utf-8").replace("study.yaml", study.name))
        if ours:
            schema.write_text(schema_text(), encoding="utf-8")
    except FileExistsError:
        fail(f"{study}: is there already, and is kept; name another file")
    except OSError as error:
        fail(f"{study}: cannot be written ({error.strerror or error}); name another file")
    return study


@command(
    "do what a study asks: solve its sweep, or follow its path or history, or find its fit; writes a netCDF file",
    *STUDY,
    _output("result file (default: results/<study>.nc; of a path results/<study>-path.nc, and so on)"),
    _plot("also draw it"),
    *MANNER,
    FORCE,
    Option("--jobs", type=count, metavar="N", help=_JOBS),
    Option("--dask", metavar="ADDRESS", help=_DASK),
    Option("--append", action="store_true", help=_APPEND),
    Option("--dry-run", action="store_true", help=_DRY_RUN),
    kept=KEPT,
)
def run(options: argparse.Namespace) -> int:
    """Do what a study asks, or say what that would be."""
    if options.dry_run:
        return _dry_run(options)
    from tcstudy.study.workers import WorkerPool

    with closing(WorkerPool(options.jobs, options.dask)) as pool:
        study, output = checked(options, at_once=lambda study: pool.early(study) if study.kind == "run" else None)
        if study.kind != "run":
            options.kept = "nothing was written"
            if study.history:
                options.kept = "finished steps are kept, the same command goes on from there"
        try:
            check_options(study.kind, options.study, options.force, options.append, options.dask)
        except UsageError as fault:
            fail(f"--{fault}")
        how = {"append": options.append, "jobs": options.jobs, "dask": options.dask, "pool": pool}
        whole = _made(options, study.kind, study, output, **how)
    asked, failed = failures(output)
    below = [*_plotted(options, output), f"data in {output}"]
    if study.kind == "run":
        below[-1:] = (f"{why}: {shlex.join(words)}" for why, words in _onward(options, output, failed))
        said = "found before" if whole else "found"
        below.insert(0, f"{asked - failed} of {asked} solutions {said}; data in {output}")
    say(options, output, ["", *(f"  {line}" for line in below)])
    return SOME_FAILED if failed else OK


def check_options(kind: Kind, study: object, force: bool, append: bool, dask: str | None) -> None:
    """Raise UsageError for options of `run` that do not go together, or not with what the study asks for."""
    if force and append:
        raise UsageError("force computes all points again, append keeps them; give one of these")
    if append and kind != "run":
        remedy = f"leave it out, or run it with --set {kind}=null"
        raise UsageError(f"append adds points of a sweep, and {study} has a section {kind}; {remedy}")
    if dask is not None and kind in ("path", "fit"):
        raise UsageError(f"dask: a {kind} has no work for others; leave it out")


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
    if not study.solver.every and not study.mesh.guarantee and not _proved_unique(output):
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
        study = options.read = outside_the_sweep(study)
    from tcstudy.data.provenance import already_there
    from tcstudy.data.store import axis_name
    from tcstudy.reports.export.table import json_text
    from tcstudy.reports.terminal.progress import expected_words, forecast_text
    from tcstudy.study.plan import hands, plan, resources

    forecast = plan(study)
    workers, work = hands(study, forecast.levels, options.jobs)
    expected = resources(study, forecast, workers)
    time = expected_words(expected, at_most=study.mesh.open_ended)
    if options.json:
        axes = [{"name": axis_name(axis), "units": axis.units, "values": axis.labels} for axis in study.axes]
        about = {"kind": "plan", "title": study.title, "output": str(output), "axes": axes}
        print(json_text({**about, "most_levels": study.mesh.levels, **asdict(forecast), **asdict(expected)}))
    elif options.quiet:
        does = forecast.asked or f"{forecast.points} × {study.mesh.levels} solutions"
        print(f"{options.study}: {does}: {time}")
    else:
        more = [f"note: {text}" for text in already_there(output, study)]
        with spoken(options):
            print(forecast_text(study, forecast, more, output, work, time))
    return OK


@command(
    "measure errors, rates and limits over the levels",
    *STUDY,
    _output("convergence file (default: results/<study>.convergence.nc)"),
    *MANNER,
    _plot("draw the errors"),
    at("the point of tables and picture (default: orders of all, picture of the first)"),
    FORCE,
)
def converge(options: argparse.Namespace) -> int:
    """Errors, rates and limits over the levels."""
    point = point_of(options)
    study, path = checked(options, "convergence")
    from tcstudy.study.convergence import without_errors

    place_of(study, point)
    if options.plot is not None and (lack := without_errors(study)):
        fail(f"--plot: there would be no errors to draw: {lack}")
    return _measured(options, "convergence", study, path, at=point)


@command(
    "chart accuracy against cost: meshes and solvers compared",
    *STUDY,
    _output("cost file (default: results/<study>.cost.nc)"),
    *MANNER,
    _plot("draw the chart"),
    at("sweep point (default: first)"),
    FORCE,
)
def cost(options: argparse.Namespace) -> int:
    """Accuracy against cost of mesh families and solvers, at one sweep point."""
    point = point_of(options)
    return _measured(options, "cost", *checked(options, "cost"), point)


def _measured(
    options: argparse.Namespace, kind: Kind, study: Study, path: Path, point: dict[str, str] | None = None, **drawn: Any
) -> int:
    """Measure, say what the file says, what was drawn and where the data are."""
    _made(options, kind, study, path, at=point)
    lines = (*_plotted(options, path, **drawn), f"data in {path}")
    say(options, path)
    for line in lines:
        note(options, line)
    return SOME_FAILED if failures(path)[1] else OK


def _made(options: argparse.Namespace, kind: Kind, study: Study, output: Path, **how: Any) -> bool:
    """Make the file, and tell what it had; whether that was all."""
    whole, there = do(kind, study, output, options.words, None if options.quiet else "", options.force, **how)
    if there:
        note(options, f"{output} {there}")
    return whole


def _plotted(options: argparse.Namespace, file: Path, **wanted: Any) -> list[str]:
    """Draw what --plot asks for; a line on what was drawn."""
    if options.plot is None:
        return []
    from tcstudy.reports.figures.draw import Wanted, picture

    return [picture(file, options.plot, Wanted(**wanted))]


def _proved_unique(output: Path) -> bool:
    """Whether a file's solutions on the finest mesh are all proved to be the only ones."""
    import netCDF4

    with netCDF4.Dataset(output) as nc:
        return "unique" in nc.variables and bool((nc["unique"][...][..., -1] == 1).all())


def what_decides(kind: Kind, study: Study, at: Mapping[str, Any] | None = None) -> dict[str, object]:
    """What decides the results of a study beside it, as global attributes of their file. Raises DrawError."""
    if kind == "cost":
        from tcstudy.study.cost import RUNS

        return {"point": place_of(study, at)[0], "runs": RUNS}
    return {"data_sha256": study.fit.sha256} if kind == "fit" and study.fit is not None else {}


def do(
    kind: Kind,
    study: Study,
    output: Path,
    words: Sequence[str],
    first: str | None = None,
    force: bool = False,
    *,
    append: bool = False,
    jobs: int | None = None,
    dask: str | None = None,
    at: Mapping[str, Any] | None = None,
    pool: WorkerPool | None = None,
) -> tuple[bool, str]:
    """Make the file of a study's results; returns whether it had all of them, and what it had of them, in words.

    kind:  of the results;  words: the command, for the file's history
    first: what is said before the work, whose progress is then shown; None for silence
    append, jobs, dask, pool: as of `tcstudy.study.run`;  at: of cost, the point by its labels

    Raises StoreError where the file holds something else, which only `force` replaces; else as the work does.
    """
    from tcstudy.reports.terminal.progress import Progress

    there, swept = "holds these results already; --force computes them again", [axis.name for axis in study.axes]
    study = outside_the_sweep(study) if kind == "path" else study
    if kind == "run":
        from tcstudy.study.run import execute, what_is_left

        study, kept = what_is_left(study, output, force, append)
        if not kept.todo.any():
            return True, "has all these points" if append else there
    elif kind != "history" and not force:
        from tcstudy.data.provenance import holds

        if holds(output, kind, study, **what_decides(kind, study, at)):
            return True, there
    with closing(Progress(study)) as progress:
        shown = None if first is None else progress
        say = (lambda text: None) if shown is None else shown.event
        if first:
            say(first)
        match kind:
            case "run":
                execute(study, output, shown, words, jobs, dask, kept, pool)
            case "path":
                from tcstudy.study.path_run import execute_path

                execute_path(study, output, shown.path if shown else None, words, swept)
            case "history":
                from tcstudy.study.history_run import execute_history

                done = execute_history(study, output, shown.history if shown else None, words, force, jobs, dask)
                if done.found == done.points * done.steps:
                    return True, there
                return False, f"held {done.found} steps; the others were added" if done.found else ""
            case "fit":
                from tcstudy.study.fit import fit
                from tcstudy.study.run import to_file

                to_file(output, study, words, lambda: fit(study, say))
            case "convergence":
                from tcstudy.study.convergence import converge_to_file

                converge_to_file(study, output, say, words)
            case "cost":
                from tcstudy.study.cost import RUNS, cost_to_file

                point, index = place_of(study, at)
                say(f"time unknown until the first of {RUNS} runs has measured it")
                follow = (lambda text, left: None) if shown is None else shown.cost
                cost_to_file(study, index, point, RUNS, output, follow, words)
    return False, ""


def failures(output: Path) -> tuple[int, int]:
    """How many solutions a file was to have, and how many are not as they were asked for: points that failed, histories
    that ended early, sentences on a path."""
    import netCDF4
    import numpy as np

    from tcstudy.data.provenance import SHORTFALLS
    from tcstudy.data.schema import PointStatus

    with netCDF4.Dataset(output) as nc:
        if "status" not in nc.variables:
            return 1, len(str(getattr(nc, SHORTFALLS, "")).splitlines())
        if "step" in nc.dimensions:
            return int(nc["reason"].size), int(np.count_nonzero(nc["reason"][...] != ""))
        status = nc["status"][...]
        asked = status[status != PointStatus.NOT_RUN]
        return int(asked.size), int((asked != PointStatus.OK).sum())


def outside_the_sweep(study: Study) -> Study:
    """The study of a path, which is of one scene, without geometries that its sweep varies."""
    if not study.variants:
        return study
    from tcstudy.read.study import read_study_text

    overrides = [*(text for text in study.overrides if not text.startswith("sweep")), "sweep=null"]
    return read_study_text(study.text, str(study.source or "study"), overrides, study.source)


def place_of(study: Study, at: Mapping[str, Any] | None) -> tuple[str, tuple[int, ...]]:
    """A sweep point by its labels: in words, and its index. Raises DrawError."""
    from tcstudy.data.store import sweep_points
    from tcstudy.reports.select_point import describe, locate

    points = sweep_points(study)
    where = locate(points, at, "study")
    return describe(points, where), tuple(where.values())
