"""What a run shows while it works: a bar with the time left on a terminal, one plain line per event elsewhere.

What a path shows while it works: one line that is written again and again, on a terminal only.

What a dry run shows while it makes the meshes of many geometries to count them: the same.

What `tcstudy cost` shows while it works: one line with the time left on a terminal, a line per run elsewhere.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from typing import Protocol, TextIO, TypeVar, cast

import numpy as np

from tcstudy.data.provenance import without_paths
from tcstudy.data.records import BlockRecord, LevelRecord, PointStatus
from tcstudy.reports.terminal.outlet import Outlet, raw_terminal, visible
from tcstudy.reports.text import counted, kind, named, number, span, with_unit

T = TypeVar("T")


class Work(Protocol):
    """Points of a level, those finished before, the relative cost of one, and whether the level is sure to come."""

    @property
    def points(self) -> int: ...
    @property
    def done(self) -> int: ...
    @property
    def weight(self) -> float: ...
    @property
    def sure(self) -> bool: ...


Naming = Callable[[tuple[int, ...]], str]
"""The labels of a sweep point by its index; empty where there is no sweep."""


class PlainProgress:
    """One line per level and per kind of failure, for pipes and logs."""

    def __init__(self, stream: TextIO, naming: Naming = str, length: str = "1") -> None:
        self._stream, self._naming, self._length = stream, naming, length
        self._kinds: dict[tuple[PointStatus, str], int] = {}
        self._silent = 0

    def begin(self, work: Sequence[Work]) -> None:
        """Say what is to come."""
        total, done = sum(w.points for w in work), sum(w.done for w in work)
        most = "" if all(w.sure for w in work) else "at most "
        points, levels = counted(work[0].points, "point"), counted(len(work), "level")
        said = f"{points} on {most}{levels}: {most}{counted(total, 'solution')}"
        self._say(said + (f", {done} of them finished before" if done else ""))

    def level(self, record: LevelRecord, geometry: str = "") -> None:
        """A mesh is ready."""
        size, time = with_unit(record.h_max, self._length, 3), record.time_mesh + record.time_assemble
        self._say(
            f"{geometry}{', ' if geometry else ''}level {record.level}: h_max = {size}, {record.n_dof} dofs, "
            f"{record.n_contact} contact unknowns, meshed and assembled in {time:.2g} s"
        )

    def block(self, record: BlockRecord) -> None:
        """Points are finished; only the first failure of a kind is worth a line, the others are counted."""
        for row in np.flatnonzero(record.status != PointStatus.OK):
            status, reason = PointStatus(int(record.status[row])), record.reasons.get(int(row), "")
            key = kind(status, reason)
            self._kinds[key] = self._kinds.get(key, 0) + 1
            if self._kinds[key] > 1:
                self._silent += 1
                continue
            where = f"level {record.level}"
            where = f"{name} on {where}" if (name := self._naming(record.index(int(row)))) else where
            self._say(f"{where}: {named(status)}: {without_paths(reason)}")

    def close(self) -> None:
        """Say how many failures had no line."""
        if self._silent:
            reasons = "reason" if len(self._kinds) == 1 else "reasons"
            self._say(f"{self._silent} more failed for the same {reasons}")
        self._silent = 0

    def _say(self, text: str) -> None:
        print(text, file=self._stream, flush=True)


class TerminalProgress(PlainProgress):
    """A bar with counts, elapsed time and time left; points of finer levels count for more."""

    def __init__(self, stream: TextIO, naming: Naming = str) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        super().__init__(stream, naming)
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[points]} solutions{task.fields[failed]}"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=Console(file=raw_terminal(stream)),
            transient=True,
        )

    def begin(self, work: Sequence[Work]) -> None:
        """Start the bar; finished points of an earlier run count."""
        self._weights = [w.weight for w in work]
        self._total, self._done = sum(w.points for w in work), sum(w.done for w in work)
        self._most = "" if all(w.sure for w in work) else "≤ "
        self._progress.start()
        total, done = sum(w.points * w.weight for w in work), sum(w.done * w.weight for w in work)
        self._task = self._progress.add_task("meshing", total=total, points=self._points(), failed="")
        self._progress.update(self._task, completed=done)

    def level(self, record: LevelRecord, geometry: str = "") -> None:
        """Name the level beside the bar."""
        where = f"level {record.level} ({record.n_dof} dofs)"
        self._progress.update(self._task, description=f"{geometry}, {where}" if geometry else where)

    def block(self, record: BlockRecord) -> None:
        """Move on; the first failure of a kind is printed above the bar, and all are counted in it."""
        super().block(record)
        self._done += len(record)
        advance = len(record) * self._weights[record.level]
        failed = f", {sum(self._kinds.values())} failed" if self._kinds else ""
        self._progress.update(self._task, advance=advance, points=self._points(), failed=failed)

    def _say(self, text: str) -> None:
        self._progress.console.print(visible(text), markup=False, highlight=False)

    def _points(self) -> str:
        return f"{self._done}/{self._most}{self._total}"

    def close(self) -> None:
        """Remove the bar; say how many failures had no line."""
        self._progress.stop()
        super().close()


class NotebookProgress(PlainProgress):
    """The same bar in one line of text, which a notebook writes again."""

    def begin(self, work: Sequence[Work]) -> None:
        """Start the bar."""
        self._line, self._start = StatusLine(self._stream), time.monotonic()
        super().begin(work)
        self._weights = [w.weight for w in work]
        self._whole, self._done = sum(w.points * w.weight for w in work), sum(w.done * w.weight for w in work)
        self._before = self._done

    def block(self, record: BlockRecord) -> None:
        """Move on."""
        super().block(record)
        self._done += len(record) * self._weights[record.level]
        share, spent = self._done / self._whole, time.monotonic() - self._start
        left = spent * (self._whole - self._done) / max(self._done - self._before, 1e-12 * self._whole)
        self._line.write(f"{'█' * int(30 * share):░<30} {share:.0%}, {span(left)} left")

    def close(self) -> None:
        """Remove the bar."""
        super().close()
        self._line.close()

    def _say(self, text: str) -> None:
        self._line.event(text)


def progress(stream: TextIO | None = None, naming: Naming = str, length: str = "1") -> PlainProgress:
    """The fitting kind for a stream (standard error if none is given); length is the unit of h."""
    stream = stream if stream is not None else cast(TextIO, sys.stderr or Outlet(None))
    if _is_notebook(stream):
        return NotebookProgress(stream, naming, length)
    return TerminalProgress(stream, naming) if stream.isatty() else PlainProgress(stream, naming, length)


def _is_notebook(stream: object) -> bool:
    return type(stream).__module__.startswith("ipykernel.")


class StatusLine:
    """One line of a terminal or a notebook that is written again and again; nothing elsewhere."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = raw_terminal(stream if stream is not None else sys.stderr)
        self._notebook = _is_notebook(self._stream)
        self._shown, self._open, self._width = self._notebook or self._stream.isatty(), False, 0

    def write(self, text: str) -> None:
        """Write it anew."""
        if self._shown:
            # a notebook knows no escape that empties a line
            self._stream.write(f"\r{text:<{self._width}}" if self._notebook else f"\r\x1b[K{text}")
            self._stream.flush()
            self._open, self._width = True, len(text)

    def close(self) -> None:
        """Remove the line."""
        if self._open:
            self.write("")
            self._stream.write("\r" if self._notebook else "")
            self._open = False

    def event(self, text: str) -> None:
        """A line that stays."""
        self.close()
        self._stream.write(f"{visible(text)}\n")
        self._stream.flush()

    def path(self, pieces: int, t: float) -> None:
        """Pieces of a path so far, and the present value of the parameter [SI]."""
        self.write(f"{pieces} pieces, parameter at {number(t)}")

    def history(self, point: int, points: int, step: int, steps: int) -> None:
        """Which step of which point was solved last, counted from 0."""
        where = f"point {point + 1}/{points}, " if points > 1 else ""
        self.write(f"{where}step {step}/{steps}")


class CostProgress(StatusLine):
    """What is being measured, and how long it may still take; a line each where there is no terminal."""

    def __init__(self, stream: TextIO | None = None) -> None:
        super().__init__(stream)
        self._start = time.monotonic()

    def __call__(self, text: str, left: float | None) -> None:
        """Called with what begins now and the seconds left, if they are known."""
        text = visible(text)
        if left is not None:
            text += f", about {span(left)} left"
        if not self._shown:
            self._stream.write(f"{text}\n")
            self._stream.flush()
        self.write(f"{text} ({span(time.monotonic() - self._start)} so far)")
