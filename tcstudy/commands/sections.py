"""What `tcstudy run` does with a study that has a section path, history or fit: into a file and as tables."""

from __future__ import annotations

import argparse
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from tcstudy.commands.shared import OK, SOME_FAILED, is_there, note, plotted, say

if TYPE_CHECKING:
    from tcstudy.scene.study import Study


def outside_the_sweep(options: argparse.Namespace, study: Study) -> Study:
    """The study of a path, without geometries that its sweep varies."""
    if study.variants:
        from tcstudy.read.study import read_study

        study = options.read = read_study(options.study, [*options.overrides, "sweep=null"])
    return study


def path(options: argparse.Namespace, study: Study, output: Path) -> int:
    """Follow the equilibria on the branch from rest."""
    from tcstudy.data.provenance import SHORTFALLS
    from tcstudy.data.reading import attributes
    from tcstudy.reports.terminal.path_summary import path_summary
    from tcstudy.reports.terminal.progress import PathProgress
    from tcstudy.reports.terminal.tables import wrapped
    from tcstudy.study.path_run import execute_path

    names = [axis.name for axis in study.axes]
    study = outside_the_sweep(options, study)
    if not is_there(options, "path", study, output):
        with closing(PathProgress()) as progress:
            execute_path(study, output, None if options.quiet else progress, options.words, names)
    said = (*plotted(options, output), f"data in {output}")
    say(options, output, lambda: wrapped("\n".join([path_summary(output), "", *(f"  {line}" for line in said)])))
    return SOME_FAILED if attributes(output).get(SHORTFALLS) else OK


def history(options: argparse.Namespace, study: Study, output: Path) -> int:
    """Follow the load history of every sweep point."""
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
    said = "\n".join(f"  {line}" for line in (*plotted(options, output), f"data in {output}"))
    say(options, output, lambda: wrapped(f"{history_summary(output, options.verbose)}\n{ended}\n{said}"))
    return SOME_FAILED if result.ended else OK


def fit(options: argparse.Namespace, study: Study, output: Path) -> int:
    """Find numbers of a study from measurements."""
    assert study.fit is not None
    from tcstudy.reports.terminal.fit import fit_summary
    from tcstudy.reports.terminal.tables import wrapped
    from tcstudy.study.fit import execute_fit

    if not is_there(options, "fit", study, output, data_sha256=study.fit.sha256):
        execute_fit(study, output, lambda text: note(options, text), options.words)
    said = (*plotted(options, output), f"data in {output}")
    say(options, output, lambda: wrapped("\n".join([fit_summary(output), "", *(f"  {line}" for line in said)])))
    return OK
