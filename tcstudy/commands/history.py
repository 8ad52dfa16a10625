"""tcstudy history: the loads of a study one after the other, with friction that remembers."""

from __future__ import annotations

import argparse
from contextlib import closing

from tcstudy.commands.shared import (
    FORCE,
    MANNER,
    OK,
    SOME_FAILED,
    STUDY,
    Command,
    checked,
    fail,
    note,
    output_option,
    say,
)

KEPT = "finished steps are kept, the same command goes on from there"
"""What becomes of the work of a history that is stopped."""


def history(options: argparse.Namespace) -> int:
    """Follow the load history of every sweep point."""
    study, output = checked(options, "history")
    if study.history is None:
        remedy = "add history: {memory: friction, steps: [{theta: 60 K, in: 8}, {theta: 0 K, in: 8}]}"
        fail(f"{options.study}: history: the study has no section history; {remedy}")
    from tcstudy.reports.terminal.history_summary import history_summary
    from tcstudy.reports.terminal.progress import HistoryProgress
    from tcstudy.reports.terminal.tables import wrapped
    from tcstudy.study.history_run import execute_history

    with closing(HistoryProgress()) as progress:
        watcher = None if options.quiet else progress
        result = execute_history(study, output, watcher, options.words, options.force)
    if result.found == result.points * result.steps:
        note(options, f"{output} holds these results already; --force computes them again")
    elif result.found:
        note(options, f"{output} held {result.found} steps; the others were added")
    ended = f"\n  {result.ended} of {result.points} histories ended early" if result.ended else ""
    say(options, output, lambda: wrapped(f"{history_summary(output, options.verbose)}\n{ended}\n  data in {output}"))
    return SOME_FAILED if result.ended else OK


COMMANDS = {
    "history": Command(
        "follow loads one after the other, with friction, plastic slip or damage that remembers",
        (*STUDY, output_option("result file (default: results/<study>-history.nc)"), *MANNER, FORCE),
        history,
        kept=KEPT,
    )
}
