"""tcstudy path, history, fit: what a section of a study beside its sweep asks for, into a file and as tables."""

from __future__ import annotations

import argparse
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from tcstudy.commands import shared
from tcstudy.commands.shared import MANNER, OK, SOME_FAILED, STUDY, checked, command, fail, is_there, note, plotted, say

if TYPE_CHECKING:
    from tcstudy.scene.study import Study

KEPT = "finished steps are kept, the same command goes on from there"
"""What becomes of the work of a history that is stopped."""
EXAMPLES = {
    "path": "{parameter: theta_bar, from: 0 K, to: 40 K}",
    "history": "{memory: friction, steps: [{theta: 60 K, in: 8}, {theta: 0 K, in: 8}]}",
    "fit": "{data: {file: ..., columns: ...}, parameters: ...}",
}
_OUTPUT = {name: shared.output_option(f"result file (default: results/<study>-{name}.nc)") for name in EXAMPLES}
_PLOT = shared.plot_option("also draw it")


def _checked(options: argparse.Namespace, kind: Literal["path", "history", "fit"]) -> tuple[Study, Path]:
    """`checked`, for a command that needs a section of its name; raises UsageError for a study without."""
    study, output = checked(options, kind, swept=kind != "path")
    if getattr(study, kind) is None:
        fail(f"{options.study}: {kind}: the study has no section {kind}; add {kind}: {EXAMPLES[kind]}")
    return study, output


@command(
    "follow equilibria on the branch from rest", *STUDY, _OUTPUT["path"], _PLOT, shared.RESPONSE, *MANNER, shared.FORCE
)
def path(options: argparse.Namespace) -> int:
    """Follow the equilibria on the branch from rest."""
    study, output = _checked(options, "path")
    from tcstudy.data.path_store import stored_shortfalls
    from tcstudy.reports.terminal.path_summary import path_summary
    from tcstudy.reports.terminal.progress import PathProgress
    from tcstudy.reports.terminal.tables import wrapped
    from tcstudy.study.path_run import execute_path

    names = [axis.name for axis in study.axes]
    if study.variants:
        from tcstudy.read.study import read_study

        study = options.read = read_study(options.study, [*options.overrides, "sweep=null"])
    there = is_there(options, "path", study, output)
    if there:
        problems = stored_shortfalls(output)
    else:
        with closing(PathProgress()) as progress:
            problems = execute_path(study, output, None if options.quiet else progress, options.words, names)
    said = (*plotted(options, output, response=options.response), f"data in {output}")
    say(options, output, lambda: wrapped("\n".join([path_summary(output), "", *(f"  {line}" for line in said)])))
    return SOME_FAILED if problems else OK


@command(
    "follow loads one after the other, with friction, plastic slip or damage that remembers",
    *STUDY,
    _OUTPUT["history"],
    *MANNER,
    shared.FORCE,
    shared.JOBS,
    shared.DASK,
    kept=KEPT,
)
def history(options: argparse.Namespace) -> int:
    """Follow the load history of every sweep point."""
    study, output = _checked(options, "history")
    from tcstudy.reports.terminal.history_summary import history_summary
    from tcstudy.reports.terminal.progress import HistoryProgress
    from tcstudy.reports.terminal.tables import wrapped
    from tcstudy.study.history_run import execute_history

    with closing(HistoryProgress()) as progress:
        watcher = None if options.quiet else progress
        result = execute_history(study, output, watcher, options.words, options.force, options.jobs, options.dask)
    if result.found == result.points * result.steps:
        note(options, f"{output} holds these results already; --force computes them again")
    elif result.found:
        note(options, f"{output} held {result.found} steps; the others were added")
    ended = f"\n  {result.ended} of {result.points} histories ended early" if result.ended else ""
    say(options, output, lambda: wrapped(f"{history_summary(output, options.verbose)}\n{ended}\n  data in {output}"))
    return SOME_FAILED if result.ended else OK


@command("find numbers of a study from measurements", *STUDY, _OUTPUT["fit"], _PLOT, *MANNER, shared.FORCE)
def fit(options: argparse.Namespace) -> int:
    """Find numbers of a study from measurements."""
    study, output = _checked(options, "fit")
    assert study.fit is not None
    from tcstudy.reports.terminal.fit import fit_summary
    from tcstudy.reports.terminal.tables import wrapped
    from tcstudy.study.fit import execute_fit

    if not is_there(options, "fit", study, output, data_sha256=study.fit.sha256):
        execute_fit(study, output, lambda text: note(options, text), options.words)
    said = (*plotted(options, output), f"data in {output}")
    say(options, output, lambda: wrapped("\n".join([fit_summary(output), "", *(f"  {line}" for line in said)])))
    return OK
