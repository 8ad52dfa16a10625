"""Finished points on the disk while a run goes on: an SQLite file `<output>.partial` beside the output.

A record is safe at most COMMIT_SECONDS after `add`: SQLite with synchronous=FULL survives a crash, kill -9 and a
power cut. The file is locked for as long as its process lives (SQLite's exclusive mode), so two runs cannot share
an output. A journal of another study, of other versions of the numerics, or a damaged one is set aside, never
deleted.
"""

from __future__ import annotations

import os
import sqlite3
import threading
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from tcstudy.data.files import PARTIAL, StoreError, remove_stale, sync_directory
from tcstudy.data.journal_file import SELECT, Row, connect, decode_block, decode_level, encode, rollback_file, set_aside
from tcstudy.data.provenance import program, study_sha256
from tcstudy.data.records import BlockRecord, LevelRecord, PointRecord, block_of, check_block, check_level
from tcstudy.data.writer import axis_problems
from tcstudy.scene.study import Study

COMMIT_SECONDS = 0.25
"""Longest time that a finished record waits for its commit; one commit costs some 15 ms of disk."""

FORMAT = "3"
"""Of the records: a journal of another format is set aside."""

_INSERT = "INSERT OR REPLACE INTO record VALUES (?, ?, ?, ?, ?, ?, ?)"


class Journal:
    """The open journal of one run. Make it with `Journal.open`; safe to use from several threads.

    finished: (level, number) of every block that an earlier run left
    warnings: sentences for the user, for example that an old journal was set aside
    """

    def __init__(
        self, path: Path, connection: sqlite3.Connection, warnings: tuple[str, ...], shape: tuple[int, ...]
    ) -> None:
        self.path, self._shape = path, shape
        self.warnings = warnings
        self.finished: frozenset[tuple[int, int]] = frozenset()
        self._connection = connection
        self._pending: list[Row] = []
        self._lock = threading.RLock()
        self._timer: threading.Timer | None = None
        self._error: StoreError | None = None
        self._closed = False

    @classmethod
    def open(cls, output: Path, study: Study, beside: str = "") -> Journal:
        """Create the journal of `output`, or resume it if it is of the same study and numerics.

        beside: digest of the file whose points the run leaves alone, if any

        Raises StoreError if another run is writing to the same output or the directory cannot be written.
        """
        problems = axis_problems(study)
        if problems:
            raise StoreError("; ".join(problems))
        path = Path(os.path.realpath(output))
        path = Path(os.path.realpath(path.with_name(path.name + PARTIAL)))
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StoreError(f"cannot make {path.parent}: {error.strerror}. choose another output") from error
        header = _header(study) | ({"beside": beside} if beside else {})
        warnings: tuple[str, ...] = ()
        connection, why = connect(path, header, _Check(study))
        if why:
            kept = set_aside(path, connection)
            warnings = (f"{path.name} {why}; it is kept as {kept.name} and the run starts anew",)
            connection, why = connect(path, header, _Check(study))
        if connection is None or why:
            raise StoreError(f"cannot start the journal {path}: {why}. Choose another output")
        remove_stale(output)
        sync_directory(path.parent)
        journal = cls(path, connection, warnings, study.shape)
        places = connection.execute("SELECT level, place FROM record WHERE kind = 'block'")
        journal.finished = frozenset((int(level), int(place)) for level, place in places)
        return journal

    def add(self, record: BlockRecord | PointRecord | LevelRecord) -> None:
        """Keep a record; it is on the disk within COMMIT_SECONDS. A second one of the same place replaces it.

        A point alone is kept as the block that has its place in the sweep for a number.

        Raises StoreError if an earlier record could not be brought to the disk; it is tried again.
        """
        if isinstance(record, PointRecord):
            alone = block_of((record,), self._shape)
            record = replace(alone, number=int(alone.points[0]))
        row = encode(record)
        with self._lock:
            if self._closed:
                raise StoreError(f"the journal {self.path} is closed")
            self._pending.append(row)
            if self._error is not None:
                self.flush()
            elif self._timer is None:
                self._timer = threading.Timer(COMMIT_SECONDS, self._flush_quietly)
                self._timer.daemon = True
                self._timer.start()

    def flush(self) -> None:
        """Bring every record to the disk. Raises StoreError if it cannot; the records stay for another try."""
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None
            if not self._pending or self._closed:
                return
            try:
                with self._connection:
                    self._connection.execute("BEGIN IMMEDIATE")
                    self._connection.executemany(_INSERT, self._pending)
            except (sqlite3.Error, OSError) as error:
                self._error = StoreError(
                    f"cannot keep finished points in {self.path}: {error}. Free some space; the run can then be resumed"
                )
                raise self._error from error
            self._pending.clear()
            self._error = None

    def levels(self) -> tuple[LevelRecord, ...]:
        """All level records, coarse to fine."""
        return tuple(sorted((decode_level(row) for row in self._rows("level")), key=lambda level: level.level))

    def blocks(self) -> Iterator[BlockRecord]:
        """All blocks as they finished, read one by one: whole-body fields need not fit into memory."""
        return (decode_block(row) for row in self._rows("block"))

    def points(self) -> Iterator[PointRecord]:
        """All points as they finished, one by one."""
        return (point for block in self.blocks() for point in block.one_by_one())

    def close(self) -> None:
        """Flush and give up the lock; the journal stays for a later run. Closing twice does no harm."""
        with self._lock:
            try:
                self.flush()
            finally:
                self._closed = True
                self._connection.close()

    def discard(self) -> None:
        """Remove the journal. Only when the netCDF file is in place."""
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
            self._pending.clear()
            self._closed = True
            if os.name == "nt":  # an open file cannot be removed there
                self._connection.close()
            # removed before the lock goes, so that no other run can get hold of the dying file
            self.path.unlink(missing_ok=True)
            self._connection.close()
            rollback_file(self.path).unlink(missing_ok=True)

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def _rows(self, kind: str) -> Iterator[Row]:
        with self._lock:
            self.flush()
            cursor = self._connection.execute(SELECT, (kind,))
        while True:
            with self._lock:
                row = cursor.fetchone()
            if row is None:
                return
            yield row

    def _flush_quietly(self) -> None:
        """The timer's flush: its error is kept for the next `add`, `flush` or `close`."""
        with suppress(StoreError):
            self.flush()


class _Check:
    """Raises an error unless a row is a record with a place in the file of this study; levels come before blocks."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self._levels: dict[int, LevelRecord] = {}

    def __call__(self, row: Row) -> None:
        if row[0] == "level":
            level = decode_level(row)
            check_level(level, self._study)
            self._levels[level.level] = level
            named = ("", level.level)
        else:
            block = decode_block(row)
            check_block(block, self._study, self._levels.get(block.level))
            named = (str(block.number), block.level)
        if row[1:3] != named:
            raise ValueError(f"a {row[0]} named {row[1]} of level {row[2]} is another")


def _header(study: Study) -> dict[str, str]:
    return {"format": FORMAT, "study_sha256": study_sha256(study), "program": program()}
