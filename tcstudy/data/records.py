"""What a run hands to the store: blocks of solved points of a level, and what a level knows of its
contact line.

A block is a few arrays, because a point of a long sweep costs less to solve than a record of its
own costs to keep. As a row of the journal a record is its scalars as JSON, its arrays as their
bytes, and a checksum over both.

The journal keeps finished points while a run goes on, in an SQLite file `<output>.partial` beside
the output. A record is in it when `add` returns, whatever becomes of the process. It is brought to
the disk at once unless others were less than SYNC_SECONDS before, so that a power cut takes at most
those that the system had not written by itself. The file is locked for as long as its process lives
(SQLite's exclusive mode): it is the lock of the output, which every command takes before it looks
at what is there. A journal of another study, of other versions of the numerics, or a damaged one is
set aside, never deleted; one without a finished point goes when its run ends.
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
    """One mesh level.

    h_max:      longest element edge [m];  n_dof: displacement unknowns;  n_contact: contact unknowns m
    arclength, x, y, c: (m,) contact nodes in order along Γ_C, and their segment lengths c_i [m]
    edge:       (m,) index into edge_names of the contact edge that a node lies on
    time_mesh, time_assemble: wall time of this level's mesh and matrices [s]
    fields:     mesh arrays for whole-body fields if they are asked for: "node_x", "node_y" (n,), "triangle" (t, 3), and
                the held ends of Γ_C and the joints of its edges if it has some (data.schema.HELD,
                JOINTS); of a body from a CAD file its boundary (data.schema.RIM)
    stop:       why refinement ended on this level, in words; empty if it went on or there was nothing to decide
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
    """P sweep points on one level, kept together.

    shape:  extent of the sweep
    points: (P,) places of the points in the sweep, counted in C order
    status: (P,) PointStatus;  reasons: row → words, of those that are not OK
    numbers: (P,) by variable name (see data.schema), (P, k) where there is one for each start or solver; NaN is missing
    u_T, xi: (P, m) tangential displacement [m] and traction −S_T = ξ_i/c_i [Pa], NaN in rows that failed before; None
            if all did
    sticks: (P, m) 1 where the node rests on an up-jump of the friction law, else 0; −1 where that
    is not known fields: (P, n) whole-body nodal fields by name, NaN in rows without; only if asked
    for solutions: all solutions of all points, if they are asked for, by the names of
    data.schema.SOLUTION
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

    def __len__(self) -> int:
        return len(self.points)

    def index(self, row: int) -> tuple[int, ...]:
        """Position of a point along each dimension of the sweep."""
        return (
            tuple(int(i) for i in np.unravel_index(self.points[row], self.shape))
            if self.shape
            else ()
        )


Row = tuple[str, int, int, int, str, bytes, int]
"""(kind, body, place, level, scalars and layout of the arrays, arrays, checksum)"""


def checked(*row: Any) -> Row:
    """A row with its checksum, that of all before it."""
    return *row, zlib.crc32(row[5], zlib.crc32(f"{row[:4]}{row[4]}".encode()))


GROUPS = ("numbers", "fields", "solutions")
"""Of named arrays in a record."""


@dataclass(frozen=True, eq=False)
class Record:
    """What a command other than a sweep finds: what its file holds, which has one group.

    kind:       the command;  tables: variables in the order of the file; those without a value are left out
    values:     by name of a variable, (P, …) where it lies along the sweep; edge_names are those of `edge`
    attributes: global ones, beside those that the study has
    """

    kind: Kind
    tables: Sequence[FileVariable]
    values: Mapping[str, Any]
    attributes: Mapping[str, Any]


def encode(record: BlockRecord | LevelRecord, body: int = 0) -> Row:
    """A record as a row: scalars as JSON (exact for floats), arrays as their bytes one after the
    other. body: of a sweep over geometries, which it is of"""
    values = vars(record)
    groups = {name: values[name] for name in GROUPS if name in values}
    arrays = {name: v for name, v in values.items() if isinstance(v, np.ndarray)}
    arrays |= {
        f"{group}.{name}": array for group, named in groups.items() for name, array in named.items()
    }
    scalars = {
        name: v
        for name, v in values.items()
        if name not in arrays and name not in groups and v is not None
    }
    layout = [(name, array.dtype.str, array.shape) for name, array in arrays.items()]
    text = json.dumps([scalars, layout], default=lambda numpy_scalar: numpy_scalar.item())
    kind, place = (
        ("level", 0) if isinstance(record, LevelRecord) else ("block", int(record.points[0]))
    )
    return checked(
        kind,
        body,
        place,
        int(record.level),
        text,
        b"".join(map(np.ndarray.tobytes, arrays.values())),
    )


def record_of(row: Row) -> Any:
    """The BlockRecord or LevelRecord that a row was made of."""
    (scalars, layout), own, start = json.loads(row[4]), dict[str, Any](), 0
    for name, dtype, shape in layout:
        group, _, key = name.rpartition(".")
        array = np.ndarray(
            tuple(shape), dtype, row[5], start
        )  # a view: nobody writes into a record
        (own.setdefault(group, {}) if group else own)[key] = array
        start += array.nbytes
    if row[0] == "level":
        return LevelRecord(**scalars | {"edge_names": tuple(scalars["edge_names"])}, **own)
    reasons = {int(i): words for i, words in scalars["reasons"].items()}
    return BlockRecord(
        **{"numbers": {}} | scalars | {"shape": tuple(scalars["shape"]), "reasons": reasons} | own
    )


WAIT_SECONDS = 0.1
"""Time after which the lock of another process is tried again."""
SYNC_SECONDS = 0.25
"""Time after which a record is brought to the disk again, which costs some 10 ms."""
OTHER = "choose another output"
_INSERT = "INSERT OR REPLACE INTO record VALUES (?, ?, ?, ?, ?, ?, ?)"
SELECT = "SELECT kind, body, place, level, scalars, arrays, crc FROM record"
_TABLES = (
    "CREATE TABLE record (kind TEXT, body INTEGER, place INTEGER, level INTEGER, scalars TEXT NOT NULL, "
    "arrays BLOB NOT NULL, crc INTEGER NOT NULL, PRIMARY KEY (kind, body, place, level))",
    # in which the rows of a body stand in the order of rowid: none are sorted
    "CREATE INDEX bodies ON record (body)",
)
_OBSTACLES = (sqlite3.SQLITE_IOERR, sqlite3.SQLITE_FULL, sqlite3.SQLITE_CANTOPEN)
_FAULTS = (sqlite3.DatabaseError, ValueError, TypeError, LookupError, AttributeError, OverflowError)
"""What a journal with damaged or foreign content may raise."""


class Busy(StoreError):
    """Another process has the lock of an output."""


class Journal:
    """The journal of one output, whose lock this process has. Make it with `open`.

    warnings: sentences for the user, for example that an old journal was set aside
    seen:     what stands in place of the output since it is locked, and may be replaced; None if anything may be
    """

    seen: Snapshot | None = None
    _made: Sequence[Path] = ()
    """Folders that were made for the journal, the innermost first."""

    def __init__(
        self, path: Path, connection: sqlite3.Connection, warnings: Sequence[str] = ()
    ) -> None:
        self.path, self.warnings = path, [*warnings]
        self._connection, self._synced, self._closed = connection, -SYNC_SECONDS, False

    @classmethod
    def open(cls, output: Path, study: Study | None = None, wait: bool = False) -> Journal:
        """Take the lock of an output, before anything that stands in its place is judged.

        study: whose journal is begun at once; None where `begin` does it later, or nothing
        wait:  until another process that has the lock ends
        Raises Busy if another process has it, StoreError if the directory cannot be written.
        """
        path = journal_path(output)
        missing = [folder for folder in path.parents if not folder.exists()]
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StoreError(f"cannot make {path.parent}: {error.strerror}. {OTHER}") from error
        while True:
            try:
                connection, damage = connect(path)
                break
            except Busy:
                if not wait:
                    raise
                time.sleep(WAIT_SECONDS)
        journal = cls(path, connection)
        journal._made = missing
        if damage:
            journal._replace(damage)
        remove_stale(output, alone=True)
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
        """Resume the journal if it is of this study and these numerics, else begin it anew.

        Raises StoreError if it cannot be written.
        """
        header = _header(study)
        try:
            why = _look_into(self._connection, header)
        except _FAULTS as error:
            why = _damage(self.path, error)
        if why and self._is_empty():
            self._restart()
        elif why:
            self._replace(why)
        if why and (why := _look_into(self._connection, header)):
            raise StoreError(f"cannot start the journal {self.path}: {why}. {OTHER}")

    def _replace(self, why: str) -> None:
        """Set the journal aside and lock a new one. Raises StoreError."""
        kept = set_aside(self.path, self._connection)
        self.warnings.append(
            f"{self.path.name} {why}; it is kept as {kept.name} and the run starts anew"
        )
        self._connection, why = connect(self.path)
        if why:
            raise StoreError(f"cannot start the journal {self.path}: {why}. {OTHER}")

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
        """Return whether the journal, which was not begun, is of this study and these numerics."""
        try:
            rows = self._connection.execute(f"{SELECT} ORDER BY rowid LIMIT 1").fetchall()
        except sqlite3.Error:
            return False
        return bool(rows) and rows[0][4] == _header(study)

    def add(self, record: BlockRecord | LevelRecord, body: int = 0) -> None:
        """Keep a record of a body; a second one of the same place replaces it. Raises StoreError if
        it cannot."""
        due = time.monotonic() - self._synced > SYNC_SECONDS
        try:
            self._connection.execute(f"PRAGMA synchronous = {'FULL' if due else 'NORMAL'}")
            self._connection.execute(_INSERT, encode(record, body))
        except sqlite3.Error as error:
            what = f"cannot keep finished points in {self.path}: {error}"
            raise StoreError(f"{what}. Free some space; the run can then be resumed") from error
        self._synced = time.monotonic() if due else self._synced

    def levels(self, body: int = 0) -> list[LevelRecord]:
        """All level records of a body, coarse to fine."""
        return sorted(self._records("level", body), key=lambda level: level.level)

    def blocks(self, body: int = 0) -> Iterator[BlockRecord]:
        """All its blocks as they finished, read one by one: whole-body fields need not fit into
        memory."""
        return self._records("block", body)

    def _records(self, kind: str, body: int) -> Iterator[Any]:
        where = "INDEXED BY bodies WHERE body = ? AND kind = ? ORDER BY rowid"
        return map(record_of, self._connection.execute(f"{SELECT} {where}", (body, kind)))

    def close(self) -> None:
        """Bring all to the disk and give up the lock; a journal with finished points stays for a
        later run. Twice does no harm."""
        if not self._closed and self._is_empty():
            self.discard()
        self._closed = True
        self._connection.close()

    def discard(self) -> None:
        """Remove the journal. Only when the netCDF file is in place, or where no point is in it."""
        if not self._closed:
            self._closed = True
            alone(self._connection)
            if os.name == "nt":  # an open file cannot be removed there
                self._connection.close()
            # removed before the lock goes; who has opened the dying file sees that it is not there
            self.path.unlink(missing_ok=True)
            self._connection.close()
            with suppress(OSError):  # they hold the output, or what others have put there
                for folder in self._made:
                    folder.rmdir()

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


MAX_REMOVALS = 20
"""Times that another run may end, and remove its journal, while this one opens it."""
LEAST = 512
"""Bytes of the smallest database: SQLite begins what is shorter anew, whatever it is."""


def journal_path(output: Path) -> Path:
    """Return the file of the journal of an output, links followed."""
    path = Path(os.path.realpath(output))
    return Path(os.path.realpath(path.with_name(path.name + PARTIAL)))


def _header(study: Study) -> str:
    return json.dumps({"study_sha256": study_sha256(study), "program": program()})


def remove_finished(output: Path, study: Study) -> None:
    """Remove the journal of a study whose file is complete, which a run leaves that is killed after
    it has written the file. One of another study, or at work, stays."""
    if journal_path(output).exists():
        with suppress(StoreError), Journal.open(output) as journal:
            if journal.belongs_to(study):
                journal.discard()


def connect(path: Path) -> tuple[sqlite3.Connection, str]:
    """Return an open, locked journal, and why it is damaged ("" if it is not).

    Raises Busy, StoreError.
    """
    if what := special_file(path):
        raise StoreError(f"{path} is {what}, no file. Remove it or {OTHER}")
    for _ in range(MAX_REMOVALS):
        connection: sqlite3.Connection | None = None
        try:
            # made here, and never opened where it is there: closing it would give up its lock
            with suppress(FileExistsError):
                os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o666))
            number = os.stat(path).st_ino
            if 0 < path.stat().st_size < LEAST:
                return sqlite3.connect(":memory:"), "is damaged (too short for a journal)"
            connection = sqlite3.connect(path, timeout=0.2, isolation_level=None)
            for statement in (
                "PRAGMA locking_mode = EXCLUSIVE",
                "PRAGMA journal_mode = WAL",
                "BEGIN EXCLUSIVE",
                # a write, because SQLite opens a file that it must not write without a word
                "PRAGMA user_version = 1",
            ):
                connection.execute(statement)
            if _is_at(path, number):
                return connection, ""
        except FileNotFoundError:  # removed by the run that had it, perhaps with its folder
            path.parent.mkdir(parents=True, exist_ok=True)
        except (*_FAULTS, OSError) as error:
            # an error of a file that its run has removed meanwhile says nothing
            if connection is None or _is_at(path, number):
                damage = _damage(path, error)
                if connection is not None and damage:
                    return connection, damage
                raise StoreError(
                    f"cannot use the journal {path}: {error}. Make room there or {OTHER}"
                ) from error
        if connection is not None:
            connection.close()
    raise StoreError(f"{path} is removed again and again by other programs; {OTHER}")


def _is_at(path: Path, number: int) -> bool:
    """Return whether the file with this number is at a path."""
    try:
        return os.stat(path).st_ino == number
    except OSError:
        return False


def _damage(path: Path, error: Exception) -> str:
    """Return what an error says of damage in a journal; empty for an obstacle.

    Raises Busy where another process has the lock.
    """
    code = getattr(error, "sqlite_errorcode", 0) & 0xFF
    if code == sqlite3.SQLITE_BUSY:
        what = f"another run is writing to the same output ({path} is locked)"
        raise Busy(f"{what}. Wait for it or {OTHER}") from error
    # SQLite also calls a file with a damaged header read-only
    is_forbidden = code == sqlite3.SQLITE_READONLY and not os.access(path, os.W_OK)
    if is_forbidden or code in _OBSTACLES or isinstance(error, OSError):
        return ""
    line = (str(error).splitlines() or [type(error).__name__])[0]
    return f"is damaged ({shortened(line, 100)})"


def _look_into(connection: sqlite3.Connection, header: str) -> str:
    """Begin an empty journal; say why a filled one is not of this run. Raises one of _FAULTS if it
    is damaged."""
    if not connection.execute("SELECT name FROM sqlite_master").fetchall():
        for statement in _TABLES:
            connection.execute(statement)
    if not connection.execute("SELECT 1 FROM record LIMIT 1").fetchall():
        connection.execute(_INSERT, checked("header", 0, 0, 0, header, b""))
    if (verdict := connection.execute("PRAGMA quick_check").fetchone()[0]) != "ok":
        raise ValueError(verdict)
    rows = connection.execute(f"{SELECT} ORDER BY rowid")
    if next(rows)[4] != header:
        return "is of another study, other overrides or another version of the program"
    for row in rows:
        if checked(*row[:-1]) != row:
            raise ValueError(f"wrong checksum of {row[0]} {row[2]} on level {row[3]}")
    connection.execute("COMMIT")
    return ""


def alone(connection: sqlite3.Connection) -> None:
    """Let all of a journal stand in its one file, without SQLite's own beside it, so far as it is
    sound."""
    with suppress(sqlite3.Error):
        connection.rollback()
        connection.execute("PRAGMA journal_mode = DELETE")


def set_aside(path: Path, connection: sqlite3.Connection) -> Path:
    """Rename a journal to the first free name .partial.old, .partial.old2, …"""
    number = 1
    while (kept := path.with_name(f"{path.name}.old{number if number > 1 else ''}")).exists():
        number += 1
    alone(connection)
    if os.name == "nt":  # an open file cannot be renamed there
        connection.close()
    # renamed before the lock goes, so that no other run can resume it in between
    try:
        os.rename(path, kept)
    except OSError as error:
        raise StoreError(
            f"cannot set {path} aside: {error.strerror}. Remove it or {OTHER}"
        ) from error
    finally:
        connection.close()
    return kept
