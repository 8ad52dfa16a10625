"""Follow a study's path into its file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from threadpoolctl import threadpool_limits

from tcstudy.data.path_records import PathRecord
from tcstudy.data.path_store import write_path
from tcstudy.data.provenance import collect
from tcstudy.scene.study import Acceptance, Study
from tcstudy.study.path_run import Progress, follow_path

GOOD_ENDS = ("range_end", "unbounded", "closed_loop", "start")
"""Ends at which there is nothing more to follow."""


def execute_path(
    study: Study, output: Path, progress: Progress | None = None, command: Sequence[str] = ("tcstudy",)
) -> list[str]:
    """Follow the path, write its file and return what is not as it was asked for, in words.

    Raises PathError, StoreError or GeometryFailed.
    """
    with threadpool_limits(1, user_api="blas"):
        record = follow_path(study, progress)
    found = shortfalls(study, record)
    write_path(output, study, record, collect(study, command), found)
    return found


def shortfalls(study: Study, record: PathRecord) -> list[str]:
    """What a user must know beside the results: an early end, missing or inexact solutions, an incomplete loop."""
    assert study.path is not None
    ends = ((record.begin, record.curve.parameter[0]), (record.end, record.curve.parameter[-1]))
    found = [f"the path ends early, at {t:g}: {reason}" for (name, reason), t in ends if name not in GOOD_ENDS]
    solutions = record.solutions
    for t, count in zip(solutions.at, solutions.solution_count, strict=True):
        if not count:
            found.append(f"the path has no solution at {study.path.name} = {t:g}")
    judged = zip(solutions.solution_residual, solutions.solution_rounding, strict=True)
    acceptance = Acceptance(study.solver.tolerance)
    inexact = sum(not acceptance.accepts(float(residual), float(rounding)) for residual, rounding in judged)
    if inexact:
        found.append(f"{inexact} solutions miss the tolerance {acceptance.aim:g}; see solution_residual")
    if record.loop is not None and not (record.loop.loop_complete and record.loop.loop_closed):
        why = record.loop.loop_reason if not record.loop.loop_complete else "it does not end where it began"
        found.append(f"the hysteresis loop is not whole: {why}")
    return found
