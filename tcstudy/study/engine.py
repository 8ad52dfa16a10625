"""Make the file of the results that a study asks for, unless the file has them.

The lock of the file is taken for the work. The file is judged before, so that a caller with nothing
to write does not wait, and again if another process has written it by then. Meshers and solvers are
imported only once there is work: their imports take longer than to answer that a file is complete.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from tcstudy.data.files import PARTIAL, Kind, Snapshot, check_writable, holds, tell_stored
from tcstudy.data.records import BlockRecord, Journal, LevelRecord, remove_finished
from tcstudy.errors import UsageError
from tcstudy.scene.study import Study
from tcstudy.study import stored
from tcstudy.study.stored import Kept, check_kind, is_finished, output_of, what_is_left

if TYPE_CHECKING:
    from tcstudy.study.workers import WorkerPool

COMPLETE = "holds these results already; --force computes them again"
COMPLETE_SWEEP = "has all these points"
"""What is said of a file that is left as it is; the second of a file to append to."""


class Display(Protocol):
    """What shows the progress of the work."""

    def event(self, text: str) -> None: ...
    def begin(self, work: Sequence[Any]) -> None: ...
    def level(self, record: LevelRecord, geometry: str = "") -> None: ...
    def block(self, record: BlockRecord) -> None: ...
    def path(self, pieces: int, t: float) -> None: ...
    def history(self, point: int, points: int, step: int, steps: int) -> None: ...
    def cost(self, text: str, left: float | None) -> None: ...
    def close(self) -> None: ...


@dataclass(frozen=True)
class SweepPoint:
    """One point of a sweep: its index, and its labels in words."""

    index: tuple[int, ...]
    words: str


@dataclass(frozen=True)
class Request:
    """The results that are asked for, and how to get them.

    output:  None for the usual file of the kind
    command: words for the history of the file
    force:   compute all again, and replace whatever the file holds
    append:  keep the points that the file has of the study with another sweep
    jobs, dask: as of `tcstudy.run`
    point:   of costs, the point whose accuracy is compared
    wait:    whether to wait for another process that writes the file; else it is refused
    """

    kind: Kind
    study: Study
    output: Path | None
    command: Sequence[str]
    force: bool = False
    append: bool = False
    jobs: int | None = None
    dask: str | None = None
    point: SweepPoint | None = None
    wait: bool = False

    def check(self) -> None:
        """Raise UsageError for options that do not go together, or not with the study."""
        if self.force and self.append:
            raise UsageError(
                "--force computes all points again, --append keeps them; give one of these"
            )
        name = str(self.study.source or "the study")
        if self.append and self.kind != "run":
            problem = f"--append adds points of a sweep, and {name} has a section {self.kind}"
            remedy = f"leave it out, or run it with --set {self.kind}=null"
            raise UsageError(f"{problem}; {remedy}")
        if self.dask is not None and self.kind in ("path", "fit"):
            raise UsageError(f"--dask: a {self.kind} has no work for others; leave it out")
        check_kind(self.study, self.kind, name)

    @property
    def attributes(self) -> dict[str, object]:
        """The attributes of the file that decide its results beside the study."""
        return deciding_attributes(self.kind, self.study, self.point)


@dataclass(frozen=True)
class ResultFile:
    """A file of results.

    was_complete: whether it had all results before, so that nothing was done
    note: what it had, in words; empty if nothing
    """

    path: Path
    was_complete: bool = False
    note: str = ""


def deciding_attributes(kind: Kind, study: Study, point: SweepPoint | None) -> dict[str, object]:
    """Return the global attributes of a file that decide its results beside the study."""
    if kind == "cost" and point is not None:
        return {"point": point.words, "runs": stored.RUNS}
    if kind == "fit" and study.fit is not None:
        return {"data_sha256": study.fit.sha256}
    return {}


def make_file(request: Request, open_display: Callable[[Study], Display]) -> ResultFile:
    """Make the file of the results, or leave a file that has them all.

    open_display: opens the display of the work on a study; called once there is work

    Raises StoreError where the file holds something else, which only `force` replaces; UsageError
    for options that do not go together, or not with what the study asks for; else as the work does.
    """
    request.check()
    kind, study = request.kind, request.study
    output = request.output or output_of(study, kind)
    if kind == "path":
        study = outside_the_sweep(study)
    may_be_complete = not (request.force or request.append)
    if may_be_complete and is_finished(study, kind, output, **request.attributes):
        if kind == "history":
            tell_stored(output)
        return ResultFile(output, True, COMPLETE)
    from tcstudy.study.workers import WorkerPool

    pool = WorkerPool(request.jobs, request.dask)
    if kind == "run" and request.dask is None:
        pool.ready(request.study)  # processes start while this one imports the mesher
    with closing(pool):
        usable_output(kind, request.study, output)
        if kind == "history":
            return _follow_history(request, output, open_display)
        return _fill(request, study, output, pool, open_display)


def usable_output(kind: Kind, study: Study, output: Path | None) -> Path:
    """Return the file for these results, where the study can be worked on and the file be written.

    output: None for the usual file. Raises UsageError with all faults.
    """
    check_kind(study, kind, str(study.source or "the study"))
    from tcstudy.study.lint import faults  # needs the mesher, a fault in the text does not

    output = output or output_of(study, kind)
    if problems := faults(study, output):
        raise UsageError("\n".join(problems))
    return output


def outside_the_sweep(study: Study) -> Study:
    """Return the study of a path, which has one scene, without the geometries of its sweep."""
    if not study.variants:
        return study
    from tcstudy.read.study import read_study_text

    kept = [text for text in study.overrides if not text.startswith("sweep")]
    name = str(study.source or "study")
    return read_study_text(study.text, name, [*kept, "sweep=null"], study.source)


def _fill(
    request: Request,
    study: Study,
    output: Path,
    pool: WorkerPool,
    open_display: Callable[[Study], Display],
) -> ResultFile:
    """Make the file under its lock, or leave it where it is complete by then.

    study: as `request.study`, of a path without its sweep
    """
    complete = ResultFile(output, True, COMPLETE_SWEEP if request.append else COMPLETE)
    seen = Snapshot.of(output)
    judged = _judge(request, study, output)
    if judged.is_complete:
        if output.with_name(output.name + PARTIAL).exists():
            remove_finished(output, judged.study)
        return complete
    with Journal.open(output, None, request.wait) as journal:
        if not seen.is_there():  # another process has written it
            if problems := check_writable(output, 0):
                raise UsageError("\n".join(problems))
            judged = _judge(request, study, output)
            if judged.is_complete:
                return complete
        if request.force:
            journal.seen = None
        with closing(open_display(judged.study)) as display:
            _work(request, judged, output, pool, journal, display)
    return ResultFile(output)


@dataclass(frozen=True)
class _Judgement:
    """What a file has of the results: all or not, the study it is then of, points kept of a run."""

    is_complete: bool
    study: Study
    kept: Kept | None = None


def _judge(request: Request, study: Study, output: Path) -> _Judgement:
    """Return what the file has. Raises StoreError where it holds something else."""
    if request.kind == "run":
        whole_study, kept = what_is_left(study, output, request.force, request.append)
        return _Judgement(not kept.todo.any(), whole_study, kept)
    is_complete = not request.force and holds(output, request.kind, study, **request.attributes)
    return _Judgement(is_complete, study)


def _work(
    request: Request,
    judged: _Judgement,
    output: Path,
    pool: WorkerPool,
    lock: Journal,
    display: Display,
) -> None:
    """Do the work of the kind and write the file."""
    study = judged.study
    command = request.command
    match request.kind:
        case "run":
            from tcstudy.study.run import execute

            execute(
                study, output, display, command, request.jobs, request.dask, judged.kept, pool, lock
            )
        case "path":
            from tcstudy.study.path_run import execute_path

            swept = [axis.name for axis in request.study.axes]
            execute_path(study, output, display.path, command, swept, lock)
        case "fit":
            from tcstudy.study.fit import fit
            from tcstudy.study.run import to_file

            to_file(output, study, command, lambda: fit(study, display.event), lock=lock)
        case "convergence":
            from tcstudy.study.convergence import converge_to_file

            converge_to_file(study, output, display.event, command, lock)
        case "cost":
            from tcstudy.study.cost import check_bilateral, cost_to_file

            assert request.point is not None
            check_bilateral(study)
            runs = stored.RUNS
            display.event(f"time unknown until the first of {runs} runs has measured it")
            index, words = request.point.index, request.point.words
            cost_to_file(study, index, words, runs, output, display.cost, command, lock)


def _follow_history(
    request: Request, output: Path, open_display: Callable[[Study], Display]
) -> ResultFile:
    """Follow the histories of a study from the steps that the file has."""
    from tcstudy.study.history_run import execute_history

    study = request.study
    with closing(open_display(study)) as display:
        summary = execute_history(
            study,
            output,
            display.history,
            request.command,
            request.force,
            request.jobs,
            request.dask,
            request.wait,
        )
    steps_per_point = 1 + (study.history.steps if study.history is not None else 0)
    if summary.resumed == summary.points * steps_per_point:
        return ResultFile(output, True, COMPLETE)
    if summary.resumed:
        return ResultFile(output, note=f"held {summary.resumed} steps; the others were added")
    return ResultFile(output)
