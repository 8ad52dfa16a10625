"""What commands have in common: options, the study and output they work on, the work, unless its results are there."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from tcstudy.errors import UsageError, printable

if TYPE_CHECKING:
    from tcstudy.data.provenance import Kind
    from tcstudy.scene.study import Study
    from tcstudy.study.workers import WorkerPool

OK, SOME_FAILED, BAD_INPUT = 0, 1, 2
"""Exit codes of commands."""
COMPLETED = {"bash": "_shtab_compgen_files", "zsh": "_files", "tcsh": "f"}
"""How shells complete the name of a file, for shtab."""
NARROWEST = 40
"""Characters below which nothing is fitted."""


def fail(text: str) -> NoReturn:
    """End the command for a fault of its options; the text says what to do."""
    raise UsageError(text)


class Option:
    """An option or argument of a command, as argparse is told of it."""

    def __init__(self, *flags: str, **told: Any) -> None:
        self.flags, self.told = flags, told


@dataclass(frozen=True)
class Command:
    """One command: its line in the list of commands, what it takes, what it does.

    run:  gets the options (with `words`, the whole command line) and returns the exit code
    kept: what becomes of the work of a command that is stopped
    """

    help: str
    options: tuple[Option, ...]
    run: Callable[[argparse.Namespace], int]
    kept: str

    def fill(self, parser: argparse.ArgumentParser) -> None:
        """Tell the parser of the options."""
        parser.set_defaults(read=None, kept=self.kept, run=self.run)
        for option in self.options:
            action = parser.add_argument(*option.flags, **option.told)
            if option.told.get("type") in (named, file_name):
                action.complete = COMPLETED  # type: ignore[attr-defined]  # where shtab looks for it


def command(
    help: str, *options: Option, kept: str = "nothing was written"
) -> Callable[[Callable[[argparse.Namespace], int]], Command]:
    """Make a command of the function below it."""
    return lambda run: Command(help, options, run, kept)


def count(text: str) -> int:
    """A number of things, 1 or more."""
    if not text.isascii() or not text.isdigit() or not 1 <= int(text) <= 4096:
        raise argparse.ArgumentTypeError(f"{text} is no number of processes; give 1 or more")
    return int(text)


def file_name(text: str) -> Path:
    """The name of a file to write; a Path would forget that the text named a folder."""
    if text.endswith(("/", os.sep)):
        raise argparse.ArgumentTypeError(f"{text} is a folder; give the name of a file in it")
    return named(text)


def named(text: str) -> Path:
    """A path, which takes one line wherever it is named."""
    if not text.strip() or printable(text) != text:
        what = "has characters that no line shows" if text.strip() else "is empty"
        raise argparse.ArgumentTypeError(f"the name {text} {what}; give the name of a file")
    return Path(text)


_SET = "replace a value of the study, e.g. --set heat.alpha=50 (may be repeated)"
_FORCE = "compute again what the result file holds already, and replace results of another study"
_JOBS = "worker processes for contact problems, geometries, histories; 1 for none (default: as many as pay)"
_DASK = "dask scheduler whose workers do that instead: tcp://host:port; local starts one with --jobs workers"

_QUIET = "print one line: what came of it"
_VERBOSE = "print all columns and rows, whatever the width of the terminal"
_JSON = "print one JSON object instead of tables: the same numbers, not rounded, in SI units"

MANNER = (
    Option("-q", "--quiet", action="store_true", help=_QUIET),
    Option("-v", "--verbose", action="store_true", help=_VERBOSE),
    Option("--json", action="store_true", help=_JSON),
)
"""How a command prints what it has to say."""
STUDY = (
    Option("study", type=named, metavar="STUDY.yaml"),
    Option("--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides", help=_SET),
)
FILE = Option("file", type=named, metavar="FILE.nc")
FORCE = Option("--force", action="store_true", help=_FORCE)
DASK = Option("--dask", metavar="ADDRESS", help=_DASK)
JOBS = Option("--jobs", type=count, metavar="N", help=_JOBS)


def output_option(what: str) -> Option:
    return Option("-o", "--output", type=file_name, metavar="FILE", help=what)


def plot_option(what: str) -> Option:
    return Option("--plot", type=file_name, metavar="PICTURE", help=f"{what}: a .png, .svg or .pdf file")


def at(what: str) -> Option:
    return Option("--at", action="append", default=[], metavar="NAME=VALUE", help=what)


@contextmanager
def spoken(options: argparse.Namespace) -> Iterator[None]:
    """Tables fit the terminal for the time of a `with`: $COLUMNS or its width; files, pipes and --verbose have all."""
    from tcstudy.reports.terminal.tables import fitting

    columns = os.environ.get("COLUMNS", "")
    width = int(columns) if columns.isascii() and columns.isdigit() else 0
    if not width and sys.stdout.isatty():
        width = os.get_terminal_size(sys.stdout.fileno()).columns
    with fitting(max(width, NARROWEST) if width and not options.verbose else None):
        yield


def say(options: argparse.Namespace, path: Path, below: Sequence[str] = (), of: str | None = None) -> None:
    """Print what a result file says in the manner asked for: its tables, one line, or one JSON object.

    below: lines after the tables;  of: the number whose indices are shown, of a run of a design for them

    Raises StoreError where the file was changed after it was written and does not hold what it should.
    """
    from tcstudy.data.files import attributes, reading
    from tcstudy.data.provenance import kind_of, remarks_of, tell
    from tcstudy.reports.terminal.summary import text_of, verdict_of
    from tcstudy.reports.terminal.tables import wrapped

    with reading(path):
        remarks = remarks_of(attributes(path))
        if options.quiet:
            tell(remarks)
            print(f"{path}: {verdict_of(None, kind_of(path), path)[0]}")
        elif options.json:
            from tcstudy.reports.export.table import brief, json_text
            from tcstudy.reports.terminal.indices import indices_json

            print(json_text(brief(path) | ({"indices": indices_json(path, of)} if of else {})))
        else:
            point = point_of(options) if hasattr(options, "at") else None
            with spoken(options):
                print("\n".join([text_of(path, options.verbose, point, of).rstrip("\n"), *below]))
                print("".join(wrapped(f"  warning: {one}") + "\n" for one in remarks), end="")


def note(options: argparse.Namespace, text: str) -> None:
    """A line on standard error, unless one line is all that was asked for."""
    if not options.quiet:
        print(text, file=sys.stderr, flush=True)


def check_manner(options: argparse.Namespace) -> None:
    """Raise UsageError for manners that exclude each other."""
    given = [name for name in ("quiet", "verbose", "json") if getattr(options, name, False)]
    if len(given) > 1:
        fail(f"--{given[0]} and --{given[1]} exclude each other; leave one out")


def point_of(options: argparse.Namespace) -> dict[str, str]:
    """The sweep point that --at names; raises UsageError if it cannot be read."""
    words = [text.partition("=") for text in options.at]
    if not all(mark for _, mark, _ in words):
        fail("--at: write NAME=VALUE, for example --at alpha=100")
    names = [name for name, _, _ in words]
    if twice := [name for name in names if names.count(name) > 1]:
        fail(f"--at: {twice[0]} is given twice; keep one, as a picture or a chart is of one point")
    return {name: value for name, _, value in words}


def checked(
    options: argparse.Namespace,
    kind: Kind | None = None,
    at_once: Callable[[Study], object] = id,
) -> tuple[Study, Path]:
    """The study and the file that is asked for or usual for this kind, found usable as is a picture; raises UserFault.

    The study is kept in the options, where cli finds the place of a later fault.
    kind:    of the results; None for what `run` does with the study
    at_once: called with the study as soon as it is read, before the rest of the program is imported
    """
    check_manner(options)
    from tcstudy.read.study import read_study

    study = options.read = read_study(options.study, options.overrides, swept=None if kind is None else True)
    at_once(study)
    from tcstudy.study.lint import check_kind, faults, output_of  # needs the mesher, a fault in the text does not

    kind = kind or study.kind
    check_kind(study, kind, str(options.study))
    output = options.output or output_of(study, kind)
    if problems := faults(study, output):
        fail("\n".join(problems))
    if getattr(options, "plot", None) is not None:
        from tcstudy.reports.figures.style import check_target

        check_target(options.plot)
    return study, output


def plotted(options: argparse.Namespace, file: Path, **wanted: Any) -> list[str]:
    """Draw what --plot asks for; a line on what was drawn."""
    if options.plot is None:
        return []
    from tcstudy.reports.figures.draw import Wanted, picture

    return [picture(file, options.plot, Wanted(**wanted))]


def proved_unique(output: Path) -> bool:
    """Whether a file's solutions on the finest mesh are all proved to be the only ones."""
    import netCDF4

    with netCDF4.Dataset(output) as nc:
        return "unique" in nc.variables and bool((nc["unique"][...][..., -1] == 1).all())


def what_decides(kind: Kind, study: Study, at: Mapping[str, Any] | None = None) -> dict[str, object]:
    """What decides the results of a study beside it, as global attributes of their file. Raises DrawError."""
    if kind == "cost":
        from tcstudy.study.cost import RUNS

        return {"point": _point(study, at)[0], "runs": RUNS}
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

                point, index = _point(study, at)
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


def _point(study: Study, at: Mapping[str, Any] | None) -> tuple[str, tuple[int, ...]]:
    """A sweep point by its labels: in words, and its index. Raises DrawError."""
    from tcstudy.data.store import sweep_points
    from tcstudy.reports.select_point import describe, locate

    points = sweep_points(study)
    where = locate(points, at, "study")
    return describe(points, where), tuple(where.values())
