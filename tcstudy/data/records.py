"""Records of a run for the store: solved points by level, and contact lines. The journal of a run.

A record of points is a block of a few arrays, because storing a record for each point of a long
sweep costs more than solving it. A row of the journal has the scalars of a record as JSON, its
arrays as bytes, and a checksum over both.

The journal stores finished points while a run goes on, in an SQLite file `<output>.partial` beside
the output. A record is in it when `add` returns, even if the process is killed. It is brought to
the disk at once unless another one was less than SYNC_SECONDS before, so that a power cut loses at
most records that the system had not written by itself. The file is locked as long as its process
lives (SQLite's exclusive mode). It is the lock of the output, which every command takes before it
looks at the output. A journal that is damaged, of another study or of other versions of the
numerics is set aside, never deleted. One without a finished point is removed when its run ends.
"""

from __future__ import annotations

import json
import os
import sqlite3
import time
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import (
    PARTIAL,
    Kind,
    Snapshot,
    program,
    remove_stale,
    special_file,
    study_sha256,
    sync_directory,
)
from tcstudy.data.schema import FileVariable
from tcstudy.errors import StoreError, shortened
from tcstudy.scene.study import Study

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LevelRecord:
    """A mesh level and its contact line.

    h_max:      largest element edge [m]
    n_dof:      number of displacement DOFs;  n_contact: number of contact DOFs, slips and openings
    arclength, x, y, c: (m,) contact nodes in order along Γ_C, and their segment lengths c_i [m]
    edge:       (m,) index into edge_names of the contact edge that a node lies on
    time_mesh, time_assemble: wall time of this level's mesh and matrices [s]
    fields:     further arrays by name: on request the mesh "node_x", "node_y" (n,), "triangle"
                (t, 3); held ends of Γ_C and joints of its edges (data.schema.HELD, JOINTS); nodes
                that may lift off (data.schema.OPENING); the boundary of a body from a CAD file
                (data.schema.RIM)
    stop:       why refinement ended on this level; empty if it went on or was not asked for
    """

    level: int
    h_max: float
    n_dof: int
    n_contact: int
    arclength: Array
    x: Array
    y: Array
    c: Array
    edge: NDArray[np.int8]
    edge_names: tuple[str, ...]
    time_mesh: float
    time_assemble: float
    fields: dict[str, NDArray[np.generic]] = field(default_factory=dict)
    stop: str = ""


@dataclass(frozen=True, eq=False)
class BlockRecord:
    """P sweep points on one level.

    shape:   extent of the sweep
    points:  (P,) places of the points in the sweep, counted in C order
    status:  (P,) PointStatus
    reasons: of the status of rows that are not OK, by row
    numbers: (P,) by variable name (see data.schema), (P, k) for values by start or solver; NaN is
             missing
    u_T, xi: (P, m) tangential displacement [m] and traction −S_T = ξ_i/c_i [Pa], NaN in rows that
             failed before; None if all did
    sticks:  (P, m) 1 where the node rests on an up-jump of the friction law, else 0; −1 where that
             is not known
    fields:  (P, n) whole-body nodal fields by name, on request; NaN in rows without
    opening, S_N, rests_N: (P, k) openings [m], normal tractions [Pa], and flags as `sticks`, of the
             nodes that may lift off; None where no edge does
    solutions: all solutions of all points, on request, by the names of data.schema.SOLUTION
    """

    level: int
    shape: tuple[int, ...]
    points: NDArray[np.intp]
    status: NDArray[np.int8]
    reasons: dict[int, str]
    numbers: dict[str, Array]
    u_T: Array | None = None
    xi: Array | None = None
    sticks: NDArray[np.int8] | None = None
    fields: dict[str, Array] = field(default_factory=dict)
    solutions: dict[str, NDArray[Any]] = field(default_factory=dict)
    opening: Array | None = None
    S_N: Array | None = None
    rests_N: NDArray[np.int8] | None = None

    def __len__(self) -> int:
        return len(self.points)

    @property
    def v(self) -> Array | None:
        """All contact unknowns (P, m): slips, then openings [m]."""
        if self.u_T is None or self.opening is None:
            return self.u_T
        return np.hstack([self.u_T, self.opening])

    def index(self, row: int) -> tuple[int, ...]:
        """Return the index of the point of a row along each dimension of the sweep."""
        if not self.shape:
            return ()
        return tuple(int(i) for i in np.unravel_index(self.points[row], self.shape))


Row = tuple[str, int, int, int, str, bytes, int]
"""(kind, body, place, level, scalars and layout of the arrays, arrays, checksum)"""


def with_checksum(*row: Any) -> Row:
    """Return a row of the journal with the checksum of all its items."""
    return *row, zlib.crc32(row[5], zlib.crc32(f"{row[:4]}{row[4]}".encode()))


GROUPS = ("numbers", "fields", "solutions")
"""Members of a record that hold arrays by name."""


@dataclass(frozen=True, eq=False)
class Record:
    """The results of a command other than a sweep, whose file has one group.

    kind:       the command
    tables:     variables in the order of the file; those without a value are left out
    values:     by name of a variable, (P, …) where it lies along the sweep; `edge_names` are the
                meanings of the flags of `edge`
    attributes: global ones, beside those of the study
    """

    kind: Kind
    tables: Sequence[FileVariable]
    values: Mapping[str, Any]
    attributes: Mapping[str, Any]


def encode(record: BlockRecord | LevelRecord, body: int = 0) -> Row:
    """Return a record as a row of the journal.

    Scalars become JSON, which is exact for floats, and arrays their bytes one after the other.
    body: number of the body that has the record
    """
    scalars = dict[str, Any]()
    arrays = dict[str, NDArray[Any]]()
    grouped_arrays = dict[str, NDArray[Any]]()
    for name, value in vars(record).items():
        if name in GROUPS:
            grouped_arrays |= {f"{name}.{key}": array for key, array in value.items()}
        elif isinstance(value, np.ndarray):
            arrays[name] = value
        elif value is not None:
            scalars[name] = value
    arrays |= grouped_arrays
    layout = [(name, array.dtype.str, array.shape) for name, array in arrays.items()]
    text = json.dumps([scalars, layout], default=lambda numpy_scalar: numpy_scalar.item())
    content = b"".join(array.tobytes() for array in arrays.values())
    if isinstance(record, LevelRecord):
        return with_checksum("level", body, 0, int(record.level), text, content)
    place = int(record.points[0])
    return with_checksum("block", body, place, int(record.level), text, content)


def record_of(row: Row) -> Any:
    """Return the BlockRecord or LevelRecord of a row of the journal."""
    scalars, layout = json.loads(row[4])
    arrays = dict[str, Any]()
    start = 0
    for name, dtype, shape in layout:
        group, _, key = name.rpartition(".")
        members = arrays.setdefault(group, {}) if group else arrays
        array = np.ndarray(tuple(shape), dtype, row[5], start)  # a view: nobody writes into it
        members[key] = array
        start += array.nbytes
    if row[0] == "level":
        scalars["edge_names"] = tuple(scalars["edge_names"])
        return LevelRecord(**scalars, **arrays)
    scalars["shape"] = tuple(scalars["shape"])
    scalars["reasons"] = {int(i): reason for i, reason in scalars["reasons"].items()}
    return BlockRecord(**{"numbers": {}} | scalars | arrays)


WAIT_SECONDS = 0.1
"""Time after which the lock of another process is tried again."""
SYNC_SECONDS = 0.25
"""Time after which a record is brought to the disk again, which costs some 10 ms."""
REMEDY = "choose another output"
_INSERT = "INSERT OR REPLACE INTO record VALUES (?, ?, ?, ?, ?, ?, ?)"
SELECT = "SELECT kind, body, place, level, scalars, arrays, crc FROM record"
_TABLES = (
    "CREATE TABLE record (kind TEXT, body INTEGER, place INTEGER, level INTEGER, "
    "scalars TEXT NOT NULL, arrays BLOB NOT NULL, crc INTEGER NOT NULL, "
    "PRIMARY KEY (kind, body, place, level))",
    # the index has the rows of a body in the order of rowid, so that SQLite sorts nothing
    "CREATE INDEX bodies ON record (body)",
)
_OBSTACLES = (sqlite3.SQLITE_IOERR, sqlite3.SQLITE_FULL, sqlite3.SQLITE_CANTOPEN)
_FAULTS = (sqlite3.DatabaseError, ValueError, TypeError, LookupError, AttributeError, OverflowError)
"""Exceptions that a journal with damaged or foreign content may raise."""


class Busy(StoreError):
    """Another process has the lock of an output."""


class Journal:
    """The journal of an output, whose lock this process has. Made by `open`.

    warnings: sentences for the user, for example that an old journal was set aside
    seen:     the file at the output when it was locked, which may be replaced; None for any file
    """

    seen: Snapshot | None = None
    _new_folders: Sequence[Path] = ()
    """Folders that were made for the journal, the innermost first."""

    def __init__(
        self, path: Path, connection: sqlite3.Connection, warnings: Sequence[str] = ()
    ) -> None:
        self.path = path
        self.warnings = [*warnings]
        self._connection = connection
        self._last_sync = -SYNC_SECONDS
        self._is_closed = False

    @classmethod
    def open(cls, output: Path, study: Study | None = None, wait: bool = False) -> Journal:
        """Take the lock of an output, before the file in its place is looked at.

        study: whose journal is begun at once; None to begin it later, or never
        wait:  whether to wait until another process that has the lock ends
        Raises Busy if another process has it, StoreError if the directory cannot be written.
        """
        path = journal_path(output)
        missing = [folder for folder in path.parents if not folder.exists()]
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StoreError(f"cannot make {path.parent}: {error.strerror}. {REMEDY}") from error
        while True:
            try:
                connection, damage = connect(path)
                break
            except Busy:
                if not wait:
                    raise
                time.sleep(WAIT_SECONDS)
        journal = cls(path, connection)
        journal._new_folders = missing
        if damage:
            journal._replace(damage)
        remove_stale(output, has_lock=True)
        sync_directory(path.parent)
        journal.seen = Snapshot.of(output)
        if study is not None:
            try:
                journal.begin(study)
            except BaseException:
                journal.close()
                raise
        return journal

    def begin(self, study: Study) -> None:
        """Resume the journal if it is of this study and these numerics, else begin a new one.

        Raises StoreError if it cannot be written.
        """
        header = _header(study)
        try:
            fault = _begin_or_check(self._connection, header)
        except _FAULTS as error:
            fault = _damage(self.path, error)
        if not fault:
            return
        if self._is_empty():
            self._restart()
        else:
            self._replace(fault)
        if fault := _begin_or_check(self._connection, header):
            raise StoreError(f"cannot start the journal {self.path}: {fault}. {REMEDY}")

    def _replace(self, fault: str) -> None:
        """Set the journal aside and lock a new one. Raises StoreError."""
        old = set_aside(self.path, self._connection)
        self.warnings.append(
            f"{self.path.name} {fault}; it is kept as {old.name} and the run starts again from "
            "the beginning"
        )
        self._connection, fault = connect(self.path)
        if fault:
            raise StoreError(f"cannot start the journal {self.path}: {fault}. {REMEDY}")

    def _restart(self) -> None:
        """Empty a journal that has no finished point."""
        with suppress(sqlite3.Error):
            self._connection.rollback()
        self._connection.execute("BEGIN EXCLUSIVE")
        self._connection.execute("DELETE FROM record")

    def _is_empty(self) -> bool:
        """Return whether this is a sound journal without a finished point."""
        try:
            tables = self._connection.execute("SELECT name FROM sqlite_master").fetchall()
            block = "SELECT 1 FROM record WHERE kind = 'block' LIMIT 1"
            return not tables or not self._connection.execute(block).fetchall()
        except sqlite3.Error:
            return False

    def belongs_to(self, study: Study) -> bool:
        """Return whether a journal that was not begun is of this study and these numerics."""
        try:
            rows = self._connection.execute(f"{SELECT} ORDER BY rowid LIMIT 1").fetchall()
        except sqlite3.Error:
            return False
        return bool(rows) and rows[0][4] == _header(study)

    def add(self, record: BlockRecord | LevelRecord, body: int = 0) -> None:
        """Store a record of a body; a second one of the same place replaces the first.

        Raises StoreError if the journal cannot be written.
        """
        is_sync_due = time.monotonic() - self._last_sync > SYNC_SECONDS
        mode = "FULL" if is_sync_due else "NORMAL"
        try:
            self._connection.execute(f"PRAGMA synchronous = {mode}")
            self._connection.execute(_INSERT, encode(record, body))
        except sqlite3.Error as error:
            fault = f"cannot keep finished points in {self.path}: {error}"
            raise StoreError(f"{fault}. Free some space; the run can then be resumed") from error
        if is_sync_due:
            self._last_sync = time.monotonic()

    def levels(self, body: int = 0) -> list[LevelRecord]:
        """Return all level records of a body, coarse to fine."""
        return sorted(self._records("level", body), key=lambda level: level.level)

    def blocks(self, body: int = 0) -> Iterator[BlockRecord]:
        """Yield all blocks of a body in the order in which they finished.

        They are read one by one, because whole-body fields may not fit into memory.
        """
        return self._records("block", body)

    def _records(self, kind: str, body: int) -> Iterator[Any]:
        where = "INDEXED BY bodies WHERE body = ? AND kind = ? ORDER BY rowid"
        return map(record_of, self._connection.execute(f"{SELECT} {where}", (body, kind)))

    def close(self) -> None:
        """Bring all to the disk and give up the lock. A second call does nothing.

        A journal with finished points stays for a later run.
        """
        if not self._is_closed and self._is_empty():
            self.discard()
        self._is_closed = True
        self._connection.close()

    def discard(self) -> None:
        """Remove the journal: only if the result file is in place, or if no point is in it."""
        if self._is_closed:
            return
        self._is_closed = True
        merge_files(self._connection)
        if os.name == "nt":  # an open file cannot be removed there
            self._connection.close()
        # removed before the lock: a process that has opened the removed file sees that it is gone
        self.path.unlink(missing_ok=True)
        self._connection.close()
        with suppress(OSError):  # they hold the output, or files of others
            for folder in self._new_folders:
                folder.rmdir()

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


MAX_REMOVALS = 20
"""Number of other runs that may end, and remove their journal, while this one opens it."""
MIN_DATABASE = 512
"""Size of the smallest database [byte]; SQLite overwrites a shorter file, whatever it is."""


def journal_path(output: Path) -> Path:
    """Return the file of the journal of an output, links followed."""
    path = Path(os.path.realpath(output))
    return Path(os.path.realpath(path.with_name(path.name + PARTIAL)))


def _header(study: Study) -> str:
    return json.dumps({"study_sha256": study_sha256(study), "program": program()})


def remove_finished(output: Path, study: Study) -> None:
    """Remove the journal of a study whose file is complete.

    A run leaves it that is killed after it has written the file. The journal of another study, or
    of a run that goes on, stays.
    """
    if journal_path(output).exists():
        with suppress(StoreError), Journal.open(output) as journal:
            if journal.belongs_to(study):
                journal.discard()


def connect(path: Path) -> tuple[sqlite3.Connection, str]:
    """Return an open, locked journal, and its damage in words ("" for none).

    Raises Busy, StoreError.
    """
    if kind := special_file(path):
        raise StoreError(f"{path} is {kind}, no file. Remove it or {REMEDY}")
    for _ in range(MAX_REMOVALS):
        connection: sqlite3.Connection | None = None
        try:
            # an existing file is not opened here, because closing it would give up its lock
            with suppress(FileExistsError):
                os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o666))
            inode = os.stat(path).st_ino
            if 0 < path.stat().st_size < MIN_DATABASE:
                return sqlite3.connect(":memory:"), "is damaged (too short for a journal)"
            connection = sqlite3.connect(path, timeout=0.2, isolation_level=None)
            for statement in _LOCKING:
                connection.execute(statement)
            if _is_at(path, inode):
                return connection, ""
        except FileNotFoundError:  # removed by the run that had it, perhaps with its folder
            path.parent.mkdir(parents=True, exist_ok=True)
        except (*_FAULTS, OSError) as error:
            # the error of a file that its run has removed meanwhile means nothing
            if connection is None or _is_at(path, inode):
                damage = _damage(path, error)
                if connection is not None and damage:
                    return connection, damage
                fault = f"cannot use the journal {path}: {error}"
                raise StoreError(f"{fault}. Make room there or {REMEDY}") from error
        if connection is not None:
            connection.close()
    raise StoreError(f"{path} is removed again and again by other programs; {REMEDY}")


_LOCKING = (
    "PRAGMA locking_mode = EXCLUSIVE",
    "PRAGMA journal_mode = WAL",
    "BEGIN EXCLUSIVE",
    # this writes, because SQLite opens a write-protected file without an error
    "PRAGMA user_version = 1",
)
"""Statements that lock a journal."""


def _is_at(path: Path, inode: int) -> bool:
    """Return whether the file with this inode number is at a path."""
    try:
        return os.stat(path).st_ino == inode
    except OSError:
        return False


def _damage(path: Path, error: Exception) -> str:
    """Return the damage of a journal that an error reports; empty if the error is an obstacle.

    Raises Busy if another process has the lock.
    """
    code = getattr(error, "sqlite_errorcode", 0) & 0xFF
    if code == sqlite3.SQLITE_BUSY:
        fault = f"another run is writing to the same output ({path} is locked)"
        raise Busy(f"{fault}. Wait for it or {REMEDY}") from error
    # SQLite also calls a file with a damaged header read-only
    is_forbidden = code == sqlite3.SQLITE_READONLY and not os.access(path, os.W_OK)
    if is_forbidden or code in _OBSTACLES or isinstance(error, OSError):
        return ""
    line = (str(error).splitlines() or [type(error).__name__])[0]
    return f"is damaged ({shortened(line, 100)})"


def _begin_or_check(connection: sqlite3.Connection, header: str) -> str:
    """Begin an empty journal, or return why a filled one is not of this run ("" if it is).

    Raises one of _FAULTS if it is damaged.
    """
    if not connection.execute("SELECT name FROM sqlite_master").fetchall():
        for statement in _TABLES:
            connection.execute(statement)
    if not connection.execute("SELECT 1 FROM record LIMIT 1").fetchall():
        connection.execute(_INSERT, with_checksum("header", 0, 0, 0, header, b""))
    verdict = connection.execute("PRAGMA quick_check").fetchone()[0]
    if verdict != "ok":
        raise ValueError(verdict)
    rows = connection.execute(f"{SELECT} ORDER BY rowid")
    if next(rows)[4] != header:
        return "is of another study, other overrides or another version of the program"
    for row in rows:
        if with_checksum(*row[:-1]) != row:
            raise ValueError(f"wrong checksum of {row[0]} {row[2]} on level {row[3]}")
    connection.execute("COMMIT")
    return ""


def merge_files(connection: sqlite3.Connection) -> None:
    """Bring all of a sound journal into its one file, and remove SQLite's files beside it."""
    with suppress(sqlite3.Error):
        connection.rollback()
        connection.execute("PRAGMA journal_mode = DELETE")


def set_aside(path: Path, connection: sqlite3.Connection) -> Path:
    """Rename a journal to the first free name .partial.old, .partial.old2, …"""
    old = path.with_name(f"{path.name}.old")
    number = 1
    while old.exists():
        number += 1
        old = path.with_name(f"{path.name}.old{number}")
    merge_files(connection)
    if os.name == "nt":  # an open file cannot be renamed there
        connection.close()
    # renamed before the lock is given up, so that no other run can resume it in between
    try:
        os.rename(path, old)
    except OSError as error:
        fault = f"cannot set {path} aside: {error.strerror}"
        raise StoreError(f"{fault}. Remove it or {REMEDY}") from error
    finally:
        connection.close()
    return old
