"""What a run shows while it works: a bar with the time left on a terminal, one plain line per event elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TextIO

from tcstudy.data.records import LevelRecord, PointRecord, PointStatus


class PlainProgress:
    """One line per level and per failed point, for pipes and logs."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def begin(self, total: int, done: int, warnings: Sequence[str]) -> None:
        """Say what is to come."""
        for warning in warnings:
            self._say(f"warning: {warning}")
        self._say(f"{total} points on all levels" + (f", {done} of them finished before" if done else ""))

    def level(self, record: LevelRecord) -> None:
        """A mesh is ready."""
        self._say(_level_line(record))

    def point(self, record: PointRecord) -> None:
        """A point is finished; only a failure is worth a line."""
        if record.status != PointStatus.OK:
            self._say(_failure_line(record))

    def close(self) -> None:
        """Nothing is open."""

    def _say(self, text: str) -> None:
        print(text, file=self._stream, flush=True)


class TerminalProgress:
    """A bar with counts, elapsed time and time left."""

    def __init__(self, stream: TextIO) -> None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            TextColumn,
            TimeElapsedColumn,
            TimeRemainingColumn,
        )

        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=Console(file=stream),
            transient=True,
        )

    def begin(self, total: int, done: int, warnings: Sequence[str]) -> None:
        """Start the bar; finished points of an earlier run count."""
        self._progress.start()
        for warning in warnings:
            self._progress.console.print(f"warning: {warning}", markup=False, highlight=False)
        self._task = self._progress.add_task("points", total=total, completed=done)

    def level(self, record: LevelRecord) -> None:
        """Name the level beside the bar."""
        self._progress.update(self._task, description=f"level {record.level} ({record.n_dof} dofs)")

    def point(self, record: PointRecord) -> None:
        """Move on; a failure is printed above the bar."""
        if record.status != PointStatus.OK:
            self._progress.console.print(_failure_line(record), markup=False, highlight=False)
        self._progress.advance(self._task)

    def close(self) -> None:
        """Remove the bar."""
        self._progress.stop()


def progress(stream: TextIO = sys.stderr) -> PlainProgress | TerminalProgress:
    """The fitting kind for a stream."""
    return TerminalProgress(stream) if stream.isatty() else PlainProgress(stream)


def _level_line(record: LevelRecord) -> str:
    return (
        f"level {record.level}: h = {record.h_max:.3g}, {record.n_dof} dofs, {record.n_contact} contact unknowns, "
        f"meshed and assembled in {record.time_mesh + record.time_assemble:.2g} s"
    )


def _failure_line(record: PointRecord) -> str:
    return f"point {record.index} on level {record.level}: {record.status.name.lower()}: {record.reason}"
