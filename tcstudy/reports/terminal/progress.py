"""What work says before and while it goes on: the text of `tcstudy run --dry-run`; on a terminal or in a notebook one
line that is written again and again, with the time left; elsewhere a plain line an event."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from tcstudy.data.provenance import without_paths
from tcstudy.data.records import BlockRecord, LevelRecord
from tcstudy.data.schema import PointStatus
from tcstudy.reports.terminal.stream import Stream, visible
from tcstudy.reports.terminal.tables import TextColumn, columns_table, quantity, wrapped
from tcstudy.reports.text import counted, kind, named, number, scaled_labels, span, with_unit
from tcstudy.scene.study import Study

BAR = 30
"""Characters of the bar."""


class Progress:
    """What a run, a path, a history, a fit or a measurement of a study says of itself, on standard error unless another
    stream is given. Close it after use: that removes the line.
    """

    def __init__(self, study: Study, stream: TextIO | Stream | None = None) -> None:
        stream = stream or sys.stderr
        self._stream = stream.raw() if isinstance(stream, Stream) else stream or Stream(None)
        notebook = type(stream).__module__.startswith("ipykernel.")
        self._shown, self._width = notebook or self._stream.isatty(), 0
        self._study, self._start, self._where = study, time.monotonic(), ""
        self._failures = Counter[tuple[PointStatus, str]]()

    def event(self, text: str) -> None:
        """A line that stays."""
        self._rewrite("")
        self._stream.write(f"{visible(text)}\n")
        self._stream.flush()

    def begin(self, work: Sequence[Any]) -> None:
        """What a run has before it, as `tcstudy.study.run.LevelWork`; points of finer levels count for more."""
        self._work, self._total, done = work, sum(w.points for w in work), sum(w.done for w in work)
        self._cost, self._found = sum(w.points * w.weight for w in work), done
        self._before = self._spent = sum(w.done * w.weight for w in work)
        self._most = "" if all(w.sure for w in work) else "at most "
        said = f"{counted(work[0].points, 'point')} on {self._most}{counted(len(work), 'level')}: "
        said += f"{self._most}{counted(self._total, 'solution')}"
        self._plain(said + (f", {done} of them finished before" if done else ""))

    def level(self, record: LevelRecord, geometry: str = "") -> None:
        """A mesh is ready."""
        self._where = f"{geometry}{', ' if geometry else ''}level {record.level}"
        h = with_unit(record.h_max, "1" if self._study.units == "none" else "m", 3)
        self._plain(
            f"{self._where}: h_max = {h}, {record.n_dof} dofs, {record.n_contact} contact unknowns, meshed and "
            f"assembled in {record.time_mesh + record.time_assemble:.2g} s"
        )
        self._bar()

    def block(self, record: BlockRecord) -> None:
        """Points are finished; only the first failure of a kind is worth a line, the others are counted."""
        for row in np.flatnonzero(record.status != PointStatus.OK).tolist():
            status, reason = PointStatus(int(record.status[row])), record.reasons.get(row, "")
            self._failures[kind(status, reason)] += 1
            if self._failures[kind(status, reason)] == 1:
                name = self._name(record.index(row))
                where = f"{name}{' on ' if name else ''}level {record.level}"
                self.event(f"{where}: {named(status)}: {without_paths(reason)}")
        self._found += len(record)
        self._spent += len(record) * self._work[record.level].weight
        self._bar()

    def path(self, pieces: int, t: float) -> None:
        """Pieces of a path so far, and the present value of the parameter [SI]."""
        self._rewrite(f"{pieces} pieces, parameter at {number(t)}")

    def history(self, point: int, points: int, step: int, steps: int) -> None:
        """Which step of which point was solved last, counted from 0."""
        self._rewrite(f"point {point + 1}/{points}, " * (points > 1) + f"step {step}/{steps}")

    def cost(self, text: str, left: float | None) -> None:
        """What begins to be measured, and the seconds left, if they are known."""
        text += f", about {span(left)} left" if left is not None else ""
        self._plain(text)
        self._rewrite(f"{text} ({span(time.monotonic() - self._start)} so far)")

    def close(self) -> None:
        """Remove the line; say how many failures had none."""
        self._rewrite("")
        if silent := self._failures.total() - len(self._failures):
            reasons = "reason" if len(self._failures) == 1 else "reasons"
            self.event(f"{silent} more failed for the same {reasons}")
        self._failures.clear()

    def _bar(self) -> None:
        """How far a run is, and how long it may still take."""
        new, spent = self._spent - self._before, time.monotonic() - self._start
        share = self._spent / self._cost
        left = f", {span(spent * (self._cost - self._spent) / new)} left" if new else ""
        failed = f", {self._failures.total()} failed" if self._failures else ""
        bar = f"{'█' * int(BAR * share):░<{BAR}} {self._found} of {self._most}{self._total} solutions{failed}{left}"
        self._rewrite(f"{self._where} {bar}".lstrip())

    def _name(self, index: tuple[int, ...]) -> str:
        """The labels of a sweep point."""
        from tcstudy.data.store import sweep_points
        from tcstudy.reports.select_point import naming

        return naming(sweep_points(self._study))(index)

    def _plain(self, text: str) -> None:
        if not self._shown:
            self.event(text)

    def _rewrite(self, text: str) -> None:
        """The line anew, or empty; only a terminal and a notebook have it."""
        if self._shown and (text or self._width):
            # blanks, as a notebook knows no escape that empties a line
            self._stream.write(f"\r{visible(text):<{self._width}}" + ("" if text else "\r"))
            self._stream.flush()
            self._width = len(text)


def forecast_text(study: Study, plan: Any, more: Sequence[str], output: Path, work: str, time: str) -> str:
    """Counts, sizes, what is left out and why.

    plan: the `tcstudy.study.plan.Plan` of the study;  more: lines after its notes
    work: who solves the contact problems, in words;  time: what a run would take, in words
    """
    from tcstudy.data.store import axis_attributes, axis_name

    steps, levels = study.history.steps if study.history is not None else 0, plan.levels
    most, up_to = ("at most ", "up to ") if study.mesh.open_ended else ("", "")
    lines = [study.title, ""]
    for axis in study.axes if plan.bytes else ():
        words, units = scaled_labels(axis.labels, axis_attributes(axis))
        shown = ", ".join(words[:6])
        rest = f", … ({len(words)} values)" if len(words) > 6 else ""
        lines.append(f"  {axis_name(axis)}: {shown}{rest}" + (f" [{units}]" if units != "1" else ""))
    times = counted(steps, "step") if steps else f"{most}{counted(study.mesh.levels, 'level')}"
    solutions = counted(plan.points * (steps or study.mesh.levels), "solution")
    if plan.bytes:
        lines.append(f"  {counted(plan.points, 'point')} × {times} = {most}{solutions}")
    else:
        lines.append(f"  {plan.asked}")
    fields = counted(plan.heat_solves, "temperature field") if plan.heat_solves else "no temperature field"
    lines.append(f"  per level: {counted(plan.factorisations, 'stiffness factorisation')}, {fields}")
    lines += [f"  {work}"] * bool(work)
    lines.append("")
    columns = [
        TextColumn("level", [str(i) for i in range(len(levels))]),
        quantity("maxh", [v.h for v in levels], "1" if study.units == "none" else "m", rank=1),
        TextColumn("dofs", [_count(v.n_dof, v) for v in levels], 2),
        TextColumn("contact unknowns", [_count(v.n_contact, v) for v in levels], 3),
    ]
    lines += [columns_table(columns), ""]
    lines += [f"  left out: {text}" for text in plan.left_out]
    lines += [f"  note: {text}" for text in plan.notes]
    lines += [f"  {text}" for text in more]
    lines.append(f"  output: {output}" + (f" ({up_to}about {plan.bytes / 1e6:.2g} MB)" if plan.bytes else ""))
    lines += [f"  {time}"] * bool(time)
    return wrapped("\n".join(lines))


def expected_words(expected: Any, at_most: bool = False) -> str:
    """CPU time, cores and memory to expect, in words: rough figures. expected: a `tcstudy.study.workers.Resources`"""
    up_to, workers = "up to " if at_most else "", expected.workers
    room = f"{up_to}about {(expected.memory + workers * expected.worker_memory) / 1e9:.1g} GB"
    if expected.unknown:
        return f"time unknown: {expected.unknown}; {room}"
    wall = f", {span(expected.wall)} on {workers + 1} cores" if workers > 1 else ""
    return f"about {span(expected.seconds)} of CPU time{wall}, {room}"


def _count(value: int, level: Any) -> str:
    """A number that is counted, or predicted."""
    if level.exact:
        return str(value)
    return f"about {float(f'{value:.2g}'):.0f}"
