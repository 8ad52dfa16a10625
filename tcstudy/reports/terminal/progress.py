"""Progress of work, and the text of `tcstudy run --dry-run`.

On a terminal or in a notebook progress is one line that is written again and again, with the time
left; elsewhere a plain line per event.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from tcstudy.data.files import without_paths
from tcstudy.data.records import BlockRecord, LevelRecord
from tcstudy.data.schema import PointStatus
from tcstudy.data.variables import sweep_points
from tcstudy.errors import Stream, visible
from tcstudy.reports.select_point import naming
from tcstudy.reports.text import (
    TextColumn,
    columns_table,
    counted,
    kind,
    labelled,
    named,
    number,
    prefix,
    pretty,
    quantity,
    span,
    with_unit,
)
from tcstudy.scene.study import Study

BAR = 30
"""Characters of the bar."""


class Progress:
    """Reports the progress of a study's work, by default on standard error.

    Close it after use: that removes the line.
    """

    def __init__(self, study: Study, stream: TextIO | Stream | None = None) -> None:
        stream = stream or sys.stderr
        self._stream = stream.raw() if isinstance(stream, Stream) else stream or Stream(None)
        is_notebook = type(stream).__module__.startswith("ipykernel.")
        self._shown = is_notebook or self._stream.isatty()
        self._width = 0
        self._study, self._where = study, ""
        self._start = time.monotonic()
        self._failures = Counter[tuple[PointStatus, str]]()

    def event(self, text: str) -> None:
        """Print a line that stays."""
        self._rewrite("")
        self._stream.write(f"{visible(text)}\n")
        self._stream.flush()

    def begin(self, work: Sequence[Any]) -> None:
        """Report the work of a run by level, as `tcstudy.study.run.LevelWork`.

        Points of finer levels count for more.
        """
        self._work = work
        self._found = sum(level.done for level in work)
        self._before = self._spent = sum(level.done * level.weight for level in work)
        most = "" if all(level.sure for level in work) else "at most "
        self._all = f"{most}{counted(sum(level.points for level in work), 'solution')}"
        points, levels = counted(work[0].points, "point"), counted(len(work), "level")
        finished = f", {self._found} of them finished before" if self._found else ""
        self._plain(f"{points} on {most}{levels}: {self._all}{finished}")

    def level(self, record: LevelRecord, geometry: str = "") -> None:
        """Report a mesh that is ready."""
        level = f"level {record.level}"
        self._where = f"{geometry}, {level}" if geometry else level
        h = with_unit(record.h_max, "1" if self._study.units == "none" else "m", 3)
        dofs = f"{record.n_dof} DOFs, {record.n_contact} contact DOFs"
        seconds = f"{record.time_mesh + record.time_assemble:.2g} s"
        self._plain(f"{self._where}: h_max = {h}, {dofs}, meshed and assembled in {seconds}")
        self._bar()

    def block(self, record: BlockRecord) -> None:
        """Report finished points: the first failure of each kind in a line; others are counted."""
        for row in np.flatnonzero(record.status != PointStatus.OK).tolist():
            status, reason = PointStatus(int(record.status[row])), record.reasons.get(row, "")
            failure = kind(status, reason)
            self._failures[failure] += 1
            if self._failures[failure] == 1:
                name = naming(sweep_points(self._study))(record.index(row))
                place = f"{name} on level {record.level}" if name else f"level {record.level}"
                self.event(f"{place}: {named(status)}: {without_paths(reason)}")
        self._found += len(record)
        self._spent += len(record) * self._work[record.level].weight
        self._bar()

    def path(self, pieces: int, t: float) -> None:
        """Report the segments of a path so far, and the present value of the parameter [SI]."""
        self._rewrite(f"{pieces} segments, parameter at {number(t)}")

    def history(self, point: int, points: int, step: int, steps: int) -> None:
        """Report which step of which point was solved last, counted from 0."""
        place = f"point {point + 1}/{points}, " if points > 1 else ""
        self._rewrite(f"{place}step {step}/{steps}")

    def cost(self, text: str, left: float | None) -> None:
        """Report the measurement that begins, and the seconds left, if they are known."""
        if left is not None:
            text += f", about {span(left)} left"
        self._plain(text)
        self._rewrite(f"{text} ({span(time.monotonic() - self._start)} so far)")

    def close(self) -> None:
        """Remove the line; report how many failures had none."""
        self._rewrite("")
        silent = self._failures.total() - len(self._failures)
        if silent:
            reasons = "reason" if len(self._failures) == 1 else "reasons"
            self.event(f"{silent} more failed for the same {reasons}")
        self._failures.clear()

    def _bar(self) -> None:
        """Rewrite the line with a bar, the failures, and the time left."""
        work = sum(level.points * level.weight for level in self._work)
        new = self._spent - self._before
        words = f"{self._found} of {self._all}"
        if self._failures:
            words += f", {self._failures.total()} failed"
        if new:
            seconds = (time.monotonic() - self._start) * (work - self._spent) / new
            words += f", {span(seconds)} left"
        bar = f"{'█' * int(BAR * self._spent / work):░<{BAR}}"
        self._rewrite(f"{self._where} {bar} {words}".lstrip())

    def _plain(self, text: str) -> None:
        if not self._shown:
            self.event(text)

    def _rewrite(self, text: str) -> None:
        if self._shown and (text or self._width):
            # blanks, as a notebook knows no escape that empties a line
            self._stream.write(f"\r{visible(text):<{self._width}}" + ("" if text else "\r"))
            self._stream.flush()
            self._width = len(text)


def open_progress(study: Study, first_line: str | None) -> Progress:
    """Return what shows the work on a study, after a first line; without one it is silent.

    first_line: empty for none
    """
    progress = Progress(study, Stream(None) if first_line is None else None)
    if first_line:
        progress.event(first_line)
    return progress


def forecast_text(
    study: Study, plan: Any, remarks: Sequence[str], output: Path, work: str, time: str
) -> str:
    """Return the labelled lines of a dry run and, of several levels, their table.

    plan: the `tcstudy.study.plan.Plan` of the study;  remarks: lines after its notes
    work: who solves the contact problems, in words;  time: what a run would take, in words
    """
    unit = "1" if study.units == "none" else "m"
    columns = [
        TextColumn("level", [str(i) for i in range(len(plan.levels))]),
        quantity("maxh", [v.h for v in plan.levels], unit, rank=1),
        TextColumn("DOFs", [_count(v.n_dof, v) for v in plan.levels], 2),
        TextColumn("contact DOFs", [_count(v.n_contact, v) for v in plan.levels], 3),
    ]
    table = [columns_table(columns)] if len(plan.levels) > 1 else []
    first = labelled(forecast_lines(study, plan, remarks, output, work, time))
    return "\n\n".join((study.title, first, *table))


def forecast_lines(
    study: Study, plan: Any, remarks: Sequence[str], output: Path, work: str, time: str
) -> list[tuple[str, str]]:
    """Return the work and cost of a run of a study as labelled lines.

    Arguments are those of `forecast_text`.
    """
    times = study.history.steps if study.history is not None else study.mesh.levels
    most, up_to = ("at most ", "up to ") if study.mesh.open_ended else ("", "")
    per_point = counted(times, "step" if study.history is not None else "level")
    if study.history is None:
        per_point = most + per_point
    total = most + counted(plan.points * times, "solution")
    solutions = f"{counted(plan.points, 'point')} × {per_point} = {total}"
    lines = [("Work", solutions if plan.bytes else plan.asked), ("Work", work)]
    if plan.levels:
        lines.append(("Mesh", _mesh_words(study, plan.levels)))
    lines.append(("Cost", time))
    if plan.bytes:
        lines.append(("Cost", f"{up_to}about {plan.bytes / 1e6:.2g} MB on disk"))
    lines.append(("Output", str(output)))
    notes = [*plan.notes, *remarks]
    lines.append(("Checks", f"no errors, {counted(len(notes), 'note') if notes else 'no notes'}"))
    lines += [("Left out", text) for text in plan.left_out]
    return lines + [("Note", line) for text in notes for line in text.split("\n")]


def _mesh_words(study: Study, levels: Sequence[Any]) -> str:
    """Return the sizes of the meshes and the counts of the finest."""
    unit = "1" if study.units == "none" else "m"
    sizes = [level.h for level in levels]
    words = f"maxh {with_unit(sizes[0], unit)}"
    if len(levels) > 1:
        divisor, prefixed = prefix(sizes, unit)
        ends = [number(size / divisor) for size in (sizes[0], sizes[-1])]
        words = f"maxh {' to '.join(ends)} {pretty(prefixed)}".rstrip() + "; finest"
    finest = levels[-1]
    dofs, contact = (_count(n, finest) for n in (finest.n_dof, finest.n_contact))
    return f"{words}: {dofs} DOFs, {contact} contact DOFs"


def _count(value: int, level: Any) -> str:
    """A number that is counted, or predicted."""
    return str(value) if level.exact else f"about {float(f'{value:.2g}'):.0f}"


def expected_words(expected: Any, at_most: bool = False) -> str:
    """CPU time and memory to expect, in words: rough figures. expected: a
    `tcstudy.study.workers.Resources`"""
    room = f"{'up to ' * at_most}about {expected.memory / 1e9:.1g} GB"
    if expected.unknown:
        return f"time unknown: {expected.unknown}; {room}"
    return f"about {span(expected.seconds)} of CPU time, {room}"
