"""tcstudy init, run, converge, cost: what makes files, and makes them only if they are not
there."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tcstudy.commands import shared
from tcstudy.commands.shared import (
    MANNER,
    OK,
    SOME_FAILED,
    STUDY,
    Option,
    command,
    fail,
    file_name,
    option,
)

if TYPE_CHECKING:
    from tcstudy.data.files import Kind, Snapshot
    from tcstudy.reports.terminal.progress import Progress
    from tcstudy.scene.study import Study
    from tcstudy.study.stored import Kept

KEPT = {
    "run": "finished points are kept, the same command goes on from there",
    "history": "finished steps are kept, the same command goes on from there",
}
"""What becomes of the work that is stopped, by what a study asks for."""
_APPEND = "keep the points of the result file and add those that the study's sweep has beside them"
_DRY_RUN = "make every check and say what a run would do, and about what it takes; writes nothing"
_JOBS = "worker processes for contact problems, geometries, histories; 1 for none (default: as many as pay)"
_DASK = "dask scheduler whose workers do that instead: tcp://host:port; local starts one with --jobs workers"
_FORCE = "compute again what the result file holds already, and replace results of another study"
FORCE = option("--force", action="store_true", help=_FORCE)
_NEW = "the study (default: study.yaml); a file that is there is kept"
STARTER, SCHEMA = Path(__file__).with_name("starter.yaml"), "study.schema.json"


def _output(what: str) -> Option:
    return option("-o", "--output", type=file_name, metavar="FILE", help=what)


def _plot(what: str) -> Option:
    return option(
        "--plot", type=file_name, metavar="PICTURE", help=f"{what}: a .png, .svg or .pdf file"
    )


@command(
    "write a commented starter study",
    option(
        "file", type=file_name, nargs="?", default=Path("study.yaml"), metavar="FILE", help=_NEW
    ),
)
def init(options: argparse.Namespace) -> int:
    """Write the starter study and say what comes next."""
    study = starter(options.file)
    print(f"{study} written; next: tcstudy run {study} --dry-run, tcstudy run {study}")
    return OK


def starter(study: Path) -> Path:
    """Write the starter study and, beside it, the schema that its first line names to editors.
    Raises UsageError."""
    from tcstudy.read.schema import TITLE, schema_text
    from tcstudy.scene.study import shell_name

    if fault := shell_name(str(study)):
        fail(f"{study} {'; '.join(fault)}")
    from tcstudy.data.files import Snapshot
    from tcstudy.errors import StoreError

    nothing = Snapshot(study, None)
    if not nothing.is_there():
        fail(f"{study}: is there already, and is kept; name another file")
    if not study.parent.is_dir():
        fail(f"{study}: cannot be written (there is no folder {study.parent}); name another file")
    schema = study.parent / SCHEMA
    text = STARTER.read_text(encoding="utf-8").replace("study.yaml", study.name)
    try:
        ours = not schema.exists() or TITLE in schema.read_text(encoding="utf-8", errors="replace")
        _put_text(study, text, nothing)
    except (OSError, StoreError) as error:
        fail(f"{study}: cannot be written ({error}); name another file")
    try:
        if ours:
            _put_text(schema, schema_text())
    except StoreError as error:
        study.unlink()  # the two belong together
        fail(str(error))
    return study


def _put_text(path: Path, text: str, seen: Snapshot | None = None) -> None:
    """Write a text file in one step; seen: as of `replace_file`. Raises StoreError."""
    from tcstudy.data.files import replace_file

    def write(aside: Path) -> None:
        aside.write_text(text, encoding="utf-8")

    replace_file(path, write, sealed=False, seen=seen)


@command(
    "do what a study asks: solve its sweep, or follow its path or history, or find its fit; writes a netCDF file",
    *STUDY,
    _output(
        "result file (default: results/<study>.nc; of a path results/<study>-path.nc, and so on)"
    ),
    _plot("also draw it"),
    *MANNER,
    FORCE,
    option("--jobs", type=shared.count, metavar="N", help=_JOBS),
    option("--dask", metavar="ADDRESS", help=_DASK),
    option("--append", action="store_true", help=_APPEND),
    option("--dry-run", action="store_true", help=_DRY_RUN),
)
def run(options: argparse.Namespace) -> int:
    """Do what a study asks, or say what that would be."""
    study = _read(options)
    if options.dry_run:
        return _dry_run(options, study)
    return _made(
        options, study.kind, study, append=options.append, jobs=options.jobs, dask=options.dask
    )


@command(
    "measure errors, rates and limits over the levels",
    *STUDY,
    _output("convergence file (default: results/<study>.convergence.nc)"),
    *MANNER,
    _plot("draw the errors"),
    shared.at("the point of tables and picture (default: orders of all, picture of the first)"),
    FORCE,
)
def converge(options: argparse.Namespace) -> int:
    """Errors, rates and limits over the levels."""
    point, study = shared.point_of(options), _read(options, swept=True)
    return _made(options, "convergence", study, point, at=point)


@command(
    "chart accuracy against cost: meshes and solvers compared",
    *STUDY,
    _output("cost file (default: results/<study>.cost.nc)"),
    *MANNER,
    _plot("draw the chart"),
    shared.at("sweep point (default: first)"),
    FORCE,
)
def cost(options: argparse.Namespace) -> int:
    """Accuracy against cost of mesh families and solvers, at one sweep point."""
    return _made(options, "cost", _read(options, swept=True), at=shared.point_of(options))


def _read(options: argparse.Namespace, swept: bool | None = None) -> Study:
    """The study, kept in the options, where cli finds the place of a later fault; a picture of it
    can be drawn."""
    from tcstudy.read.study import read_study

    study: Study = read_study(options.study, options.overrides, swept=swept)
    options.read = study
    if options.plot is not None:
        from tcstudy.reports.figures.style import check_target

        check_target(options.plot)
    return study


def _made(
    options: argparse.Namespace,
    kind: Kind,
    study: Study,
    drawn: Mapping[str, Any] | None = None,
    **how: Any,
) -> int:
    """Make the file, draw what --plot asks for, and say what the file says and where it is."""
    options.kept = KEPT.get(kind, options.kept)
    quiet = options.manner == "quiet"
    output, _, there = do(
        kind, study, options.output, options.words, None if quiet else "", options.force, **how
    )
    if there and not quiet:
        print(f"{output} {there}", file=sys.stderr, flush=True)
    below = [f"data in {output}"]
    if options.plot is not None:
        from tcstudy.commands.results import picture

        below.insert(0, str(picture(output, options.plot, at=drawn)))
    shared.say(options, output, ["", *(f"  {line}" for line in below)], warned=not there)
    return SOME_FAILED if shortfalls(output) else OK


def _dry_run(options: argparse.Namespace, study: Study) -> int:
    output = usable(study.kind, study, options.output)
    if study.kind == "path":
        study = options.read = outside_the_sweep(study)
    from tcstudy.data.files import already_there
    from tcstudy.reports.json_values import json_text
    from tcstudy.reports.terminal.progress import expected_words, forecast_lines, forecast_text
    from tcstudy.reports.text import facts_by_label
    from tcstudy.study.plan import hands, plan, resources

    forecast = plan(study)
    workers, work = hands(study, forecast.levels, options.jobs)
    expected = resources(study, forecast, workers)
    time = expected_words(expected, at_most=study.mesh.open_ended)
    more = already_there(output, study)
    if options.manner == "json":
        about = {
            "kind": "plan",
            "title": study.title,
            "output": str(output),
            "most_levels": study.mesh.levels,
        }
        lines = forecast_lines(study, forecast, more, output, work, time)
        verdict = facts_by_label(lines)
        print(json_text({**about, "verdict": verdict, **asdict(forecast), **asdict(expected)}))
    elif options.manner == "quiet":
        print(
            f"{options.study}: {forecast.asked or f'{forecast.points} × {study.mesh.levels} solutions'}: {time}"
        )
    else:
        with shared.spoken(options):
            print(forecast_text(study, forecast, more, output, work, time))
    return OK


# -- what the commands and the public functions do
# ---------------------------------------------------------------------


def usable(kind: Kind, study: Study, output: Path | None) -> Path:
    """The file that is asked for or usual for these results, where they can be. Raises UsageError
    with all faults."""
    from tcstudy.study.stored import check_kind, output_of

    check_kind(study, kind, str(study.source or "the study"))
    from tcstudy.study.lint import faults  # needs the mesher, a fault in the text does not

    output = output or output_of(study, kind)
    if problems := faults(study, output):
        fail("\n".join(problems))
    return output


def do(
    kind: Kind,
    study: Study,
    output: Path | None,
    words: Sequence[str],
    first: str | None = None,
    force: bool = False,
    *,
    append: bool = False,
    jobs: int | None = None,
    dask: str | None = None,
    at: Mapping[str, Any] | None = None,
    wait: bool = False,
) -> tuple[Path, bool, str]:
    """Make the file of a study's results; returns its name, whether it had all of them, and what it
    had, in words.

    The lock of the file is taken for the work. What is there is judged before, so that nobody waits
    who has nothing to write, and again if the file is another one by then.

    kind:  of the results;  words: the command, for the file's history
    first: what is said before the work, whose progress is then shown; None for silence
    append, jobs, dask: as of `tcstudy.run`;  at: of convergence and cost, a point by its labels
    wait:  for another process that writes the file, which is refused otherwise

    Raises StoreError where the file holds something else, which only `force` replaces; UsageError
    for options that do not go together, or not with what the study asks for; else as the work does.
    """
    if force and append:
        fail("--force computes all points again, --append keeps them; give one of these")
    if append and kind != "run":
        remedy = f"leave it out, or run it with --set {kind}=null"
        fail(
            f"--append adds points of a sweep, and {study.source or 'the study'} has a section {kind}; {remedy}"
        )
    if dask is not None and kind in ("path", "fit"):
        fail(f"--dask: a {kind} has no work for others; leave it out")
    from tcstudy.study.stored import check_kind, is_finished, output_of

    check_kind(study, kind, str(study.source or "the study"))
    output = output or output_of(study, kind)
    point, index = place_of(study, at) if at or kind == "cost" else ("", ())
    swept = [axis.name for axis in study.axes]
    asked = outside_the_sweep(study) if kind == "path" else study
    decisive = what_decides(kind, study, at)
    there = "holds these results already; --force computes them again"
    if not (force or append) and is_finished(asked, kind, output, **decisive):
        if kind == "history":
            from tcstudy.data.files import tell_stored

            tell_stored(output)
        return output, True, there
    from tcstudy.study.workers import WorkerPool

    pool = WorkerPool(jobs, dask)
    at_once = kind == "run" and dask is None  # which takes as long as what is imported from here on
    with closing(pool.ready(study) if at_once else pool):
        output = usable(kind, study, output)
        study = asked
        if kind == "history":
            return _follow_history(study, output, words, first, force, jobs, dask, wait)
        from tcstudy.data.files import PARTIAL, Snapshot, check_writable

        there = "has all these points" if append else there
        look = partial(_look, kind, study, output, force, append, at)
        snapshot = Snapshot.of(output)
        whole, study, kept = look()
        if whole and not output.with_name(output.name + PARTIAL).exists():
            return output, True, there
        from tcstudy.data.records import Journal, remove_finished

        if whole:
            remove_finished(output, study)
            return output, True, there
        with Journal.open(output, None, wait) as journal:
            if not snapshot.is_there():
                if problems := check_writable(output, 0):
                    fail("\n".join(problems))
                whole, study, kept = look()
                if whole:
                    return output, True, there
            if force:
                journal.seen = None
            with closing(_progress(study, first)) as progress:
                match kind:
                    case "run":
                        from tcstudy.study.run import execute

                        execute(study, output, progress, words, jobs, dask, kept, pool, journal)
                    case "path":
                        from tcstudy.study.path_run import execute_path

                        execute_path(study, output, progress.path, words, swept, journal)
                    case "fit":
                        from tcstudy.study.fit import fit
                        from tcstudy.study.run import to_file

                        find = partial(fit, study, progress.event)
                        to_file(output, study, words, find, lock=journal)
                    case "convergence":
                        from tcstudy.study.convergence import converge_to_file

                        converge_to_file(study, output, progress.event, words, journal)
                    case "cost":
                        from tcstudy.study.cost import cost_to_file
                        from tcstudy.study.stored import RUNS

                        progress.event(
                            f"time unknown until the first of {RUNS} runs has measured it"
                        )
                        cost_to_file(
                            study, index, point, RUNS, output, progress.cost, words, journal
                        )
    return output, False, ""


def _look(
    kind: Kind,
    study: Study,
    output: Path,
    force: bool,
    append: bool,
    at: Mapping[str, Any] | None,
) -> tuple[bool, Study, Kept | None]:
    """Return whether a file has all that is asked for, of which study it then is, and what of a run
    it keeps. Raises StoreError where it holds something else."""
    if kind == "run":
        from tcstudy.study.stored import what_is_left

        whole_study, kept = what_is_left(study, output, force, append)
        return not kept.todo.any(), whole_study, kept
    from tcstudy.data.files import holds

    whole = not force and holds(output, kind, study, **what_decides(kind, study, at))
    return whole, study, None


def _progress(study: Study, first: str | None) -> Progress:
    """Return what shows the progress of the work, after a first line; it is silent without one."""
    from tcstudy.errors import Stream
    from tcstudy.reports.terminal.progress import Progress

    progress = Progress(study, Stream(None) if first is None else None)
    if first:
        progress.event(first)
    return progress


def _follow_history(
    study: Study,
    output: Path,
    words: Sequence[str],
    first: str | None,
    force: bool,
    jobs: int | None,
    dask: str | None,
    wait: bool,
) -> tuple[Path, bool, str]:
    """Do what `do` does, of a history, which goes on with the steps that a file has."""
    from tcstudy.study.history_run import execute_history

    with closing(_progress(study, first)) as progress:
        done = execute_history(study, output, progress.history, words, force, jobs, dask, wait)
    steps = done.points * (1 + (study.history.steps if study.history is not None else 0))
    if done.resumed == steps:
        return output, True, "holds these results already; --force computes them again"
    held = f"held {done.resumed} steps; the others were added" if done.resumed else ""
    return output, False, held


def what_decides(
    kind: Kind, study: Study, at: Mapping[str, Any] | None = None
) -> dict[str, object]:
    """What decides the results of a study beside it, as global attributes of their file. Raises
    DrawError."""
    if kind == "cost":
        from tcstudy.study.stored import RUNS

        return {"point": place_of(study, at)[0], "runs": RUNS}
    return {"data_sha256": study.fit.sha256} if kind == "fit" and study.fit is not None else {}


def shortfalls(output: Path) -> int:
    """Return how many solutions of a file are not as they were asked for: points that failed,
    histories that ended early, sentences on a path."""
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


def outside_the_sweep(study: Study) -> Study:
    """The study of a path, which is of one scene, without geometries that its sweep varies."""
    if not study.variants:
        return study
    from tcstudy.read.study import read_study_text

    overrides = [*(text for text in study.overrides if not text.startswith("sweep")), "sweep=null"]
    return read_study_text(study.text, str(study.source or "study"), overrides, study.source)


def place_of(study: Study, at: Mapping[str, Any] | None) -> tuple[str, tuple[int, ...]]:
    """A sweep point by its labels: in words, and its index. Raises DrawError."""
    from tcstudy.data.variables import sweep_points
    from tcstudy.reports.select_point import describe, locate

    points = sweep_points(study)
    where = locate(points, at)
    return describe(points, where), tuple(where.values())
