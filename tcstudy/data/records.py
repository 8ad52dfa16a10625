"""What a run hands to the store: blocks of solved points of a level, and what a level knows of its contact line.

A block is a few arrays, because a point of a long sweep costs less to solve than a record of its own costs to keep.
As a row of the journal a record is its scalars as JSON, its arrays as their bytes, and a checksum over both.

The journal keeps finished points on the disk while a run goes on: an SQLite file `<output>.partial` beside the output.
A record is safe at most COMMIT_SECONDS after `add`: SQLite with synchronous=FULL survives a crash, kill -9 and a
power cut. The file is locked for as long as its process lives (SQLite's exclusive mode), so two runs cannot share
an output. A journal of another study, of other versions of the numerics, or a damaged one is set aside, never
deleted.
"""

from __future__ import annotations

import json
import os
import re
import sqlite3
import threading
import zlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import PARTIAL, remove_stale, special_file, sync_directory
from tcstudy.data.provenance import program, study_sha256
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
                the held ends of Γ_C and the joints of its edges if it has some (data.schema.HELD, JOINTS)
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
    sticks: (P, m) 1 where the node rests on an up-jump of the friction law, else 0; −1 where that is not known
    fields: (P, n) whole-body nodal fields by name, NaN in rows without; only if asked for
    solutions: all solutions of all points, if they are asked for: "row" (S,) of its point, growing, "energy", "stable"
            (S,), "u_T", "piece" (S, m), as in data.schema.SOLUTION
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
        return tuple(int(i) for i in np.unravel_index(self.points[row], self.shape)) if self.shape else ()

    def solutions_of(self, row: int) -> dict[str, NDArray[Any]]:
        """All solutions of a point, without "row"; empty if they are not kept."""
        own = self.solutions["row"] == row if self.solutions else None
        return {name: values[own] for name, values in self.solutions.items() if name != "row"}


Row = tuple[str, int, int, int, str, bytes, int]
"""(kind, body, place, level, scalars and layout of the arrays, arrays, checksum)"""


def checksum(row: Row) -> int:
    """Of everything in a row but its last entry."""
    return zlib.crc32(row[5], zlib.crc32(f"{row[:4]}{row[4]}".encode()))


GROUPS = ("numbers", "fields", "solutions")
"""Of named arrays in a record."""


def encode(record: BlockRecord | LevelRecord, body: int = 0) -> Row:
    """A record as a row. body: of a sweep over geometries, which it is of"""
    values = vars(record)
    groups = {name: values[name] for name in GROUPS if name in values}
    arrays = {name: v for name, v in values.items() if isinstance(v, np.ndarray)}
    arrays |= {f"{group}.{name}": array for group, named in groups.items() for name, array in named.items()}
    scalars = {name: v for name, v in values.items() if name not in arrays and name not in groups and v is not None}
    kind, place = ("level", 0) if isinstance(record, LevelRecord) else ("block", int(record.points[0]))
    return row_of(kind, body, place, record.level, scalars, arrays)


def row_of(
    kind: str, body: int, place: int, level: int, scalars: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]
) -> Row:
    """A row: scalars as JSON (exact for floats), arrays as their bytes one after the other."""
    layout = [(name, array.dtype.str, array.shape) for name, array in arrays.items()]
    text = json.dumps([dict(scalars), layout], default=lambda numpy_scalar: numpy_scalar.item())
    row = (kind, body, place, int(level), text, b"".join(map(np.ndarray.tobytes, arrays.values())))
    return (*row, checksum((*row, 0)))


def decode(row: Row) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """The scalars and the arrays of a row."""
    scalars, layout = json.loads(row[4])
    arrays, start = dict[str, NDArray[Any]](), 0
    for name, dtype, shape in layout:
        count = int(np.prod(shape, dtype=np.int64))
        found = np.frombuffer(row[5], dtype, count, start) if count else np.empty(0, dtype)
        arrays[name] = found.reshape(shape)  # a view: nobody writes into a record
        start += found.nbytes
    return scalars, arrays


def record_of(row: Row) -> Any:
    """The BlockRecord or LevelRecord that a row was made of."""
    (scalars, arrays), own = decode(row), dict[str, Any]()
    for name, array in arrays.items():
        group, _, key = name.rpartition(".")
        (own.setdefault(group, {}) if group else own)[key] = array
    if row[0] == "level":
        return LevelRecord(**scalars | {"edge_names": tuple(scalars["edge_names"])}, **own)
    reasons = {int(i): words for i, words in scalars["reasons"].items()}
    return BlockRecord(**{"numbers": {}} | scalars | {"shape": tuple(scalars["shape"]), "reasons": reasons} | own)


COMMIT_SECONDS = 0.25
"""Longest time that a finished record waits for its commit; one commit costs some 15 ms of disk."""
_INSERT = "INSERT OR REPLACE INTO record VALUES (?, ?, ?, ?, ?, ?, ?)"


class Journal:
    """The open journal of one run. Make it with `Journal.open`; safe to use from several threads.

    warnings: sentences for the user, for example that an old journal was set aside
    """

    def __init__(self, path: Path, connection: sqlite3.Connection, warnings: tuple[str, ...]) -> None:
        self.path, self.warnings = path, warnings
        self._connection = connection
        self._pending: list[Row] = []
        self._lock = threading.RLock()
        self._timer: threading.Timer | None = None
        self._error: StoreError | None = None
        self._closed = False

    @classmethod
    def open(cls, output: Path, study: Study) -> Journal:
        """Create the journal of `output`, or resume it if it is of the same study and numerics.

        Raises StoreError if another run is writing to the same output or the directory cannot be written.
        """
        path = Path(os.path.realpath(output))
        path = Path(os.path.realpath(path.with_name(path.name + PARTIAL)))
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StoreError(f"cannot make {path.parent}: {error.strerror}. choose another output") from error
        header = {"study_sha256": study_sha256(study), "program": program()}
        warnings: tuple[str, ...] = ()
        connection, why = connect(path, header)
        if why:
            kept = set_aside(path, connection)
            warnings = (f"{path.name} {why}; it is kept as {kept.name} and the run starts anew",)
            connection, why = connect(path, header)
        if connection is None or why:
            raise StoreError(f"cannot start the journal {path}: {why}. Choose another output")
        remove_stale(output, alone=True)
        sync_directory(path.parent)
        return cls(path, connection, warnings)

    def add(self, record: BlockRecord | LevelRecord | Row, body: int = 0) -> None:
        """Keep a record of a body, or a row; it is on the disk within COMMIT_SECONDS. A second one of the same place
        replaces it.

        Raises StoreError if an earlier record could not be brought to the disk; it is tried again.
        """
        row = record if isinstance(record, tuple) else encode(record, body)
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

    def levels(self, body: int = 0) -> tuple[LevelRecord, ...]:
        """All level records of a body, coarse to fine."""
        return tuple(sorted(map(record_of, self._rows("level", body)), key=lambda level: level.level))

    def blocks(self, body: int = 0) -> Iterator[BlockRecord]:
        """All its blocks as they finished, read one by one: whole-body fields need not fit into memory."""
        return map(record_of, self._rows("block", body))

    def steps(self) -> Iterator[Row]:
        """All steps of histories, as they were done."""
        return self._rows("step", 0)

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

    def _rows(self, kind: str, body: int) -> Iterator[Row]:
        with self._lock:
            self.flush()
            where = "INDEXED BY bodies WHERE body = ? AND kind = ? ORDER BY rowid"
            cursor = self._connection.execute(f"{SELECT} {where}", (body, kind))
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


SMALLEST_PAGE = 512
"""Bytes of the smallest SQLite file that holds anything."""
_TABLES = (
    "CREATE TABLE header (key TEXT PRIMARY KEY, value TEXT NOT NULL)",
    "CREATE TABLE record (kind TEXT, body INTEGER, place INTEGER, level INTEGER, scalars TEXT NOT NULL, "
    "arrays BLOB NOT NULL, crc INTEGER NOT NULL, PRIMARY KEY (kind, body, place, level))",
    "CREATE INDEX bodies ON record (body)",  # in which the rows of a body stand in the order of rowid: none are sorted
)
SELECT = "SELECT kind, body, place, level, scalars, arrays, crc FROM record"


class _Damaged(Exception):
    """The journal cannot be trusted; the text says why."""


_FAULTS = (sqlite3.DatabaseError, _Damaged, ValueError, TypeError, LookupError, AttributeError, OverflowError)
"""What a journal with damaged or foreign content may raise."""


def connect(path: Path, header: dict[str, str]) -> tuple[sqlite3.Connection | None, str]:
    """An open, locked journal with this header, and why it cannot be used ("" if it can)."""
    connection: sqlite3.Connection | None = None
    if what := special_file(path):
        raise StoreError(f"{path} is {what}, no file. Remove it or choose another output")
    # SQLite takes a file shorter than a page for an empty one and writes over it. Only its size is looked at: to open
    # and close it here would drop the locks that this process has on it
    if path.is_file() and 0 < path.stat().st_size < SMALLEST_PAGE:
        return None, "is cut short"
    try:
        connection = sqlite3.connect(path, timeout=0.2, isolation_level=None, check_same_thread=False)
        # locked before anything is judged: what another run is writing must not be set aside
        connection.execute("PRAGMA locking_mode=EXCLUSIVE")
        connection.execute("PRAGMA synchronous=FULL")
        connection.execute("BEGIN EXCLUSIVE")
        connection.execute("COMMIT")
        return connection, _look_into(connection, header)
    except _FAULTS as error:
        obstacle = _obstacle(path, error)
        if connection is not None and not obstacle:
            line = (str(error).splitlines() or [type(error).__name__])[0]
            return connection, f"is damaged ({shortened(line, 100)})"
        if connection is not None:
            connection.close()
        raise StoreError(obstacle) from error


def _obstacle(path: Path, error: Exception) -> str:
    """What keeps a sound journal from being used; empty if the error speaks of damage."""
    if not isinstance(error, sqlite3.Error):
        return ""
    text = str(error)
    if "locked" in text:
        return f"another run is writing to the same output ({path} is locked). Wait for it or choose another output"
    # SQLite also calls a file with a damaged header read-only
    if "readonly" in text and os.access(path, os.W_OK):
        return ""
    if isinstance(error, sqlite3.OperationalError) and re.search("unable to open|readonly|full|I/O", text):
        return f"cannot use the journal {path}: {text}. Make room there or choose another output"
    return ""


def _look_into(connection: sqlite3.Connection, header: dict[str, str]) -> str:
    """Make the tables of an empty journal; say why a filled one does not belong to this run."""
    tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if not tables:
        with connection:
            connection.execute("BEGIN IMMEDIATE")
            for statement in _TABLES:
                connection.execute(statement)
            connection.executemany("INSERT INTO header VALUES (?, ?)", header.items())
        return ""
    if tables != {"header", "record"}:
        return "is not a journal of tcstudy"
    verdict = connection.execute("PRAGMA quick_check").fetchone()[0]
    if verdict != "ok":
        raise _Damaged(verdict)
    found = dict(connection.execute("SELECT key, value FROM header").fetchall())
    if found.get("study_sha256") != header["study_sha256"]:
        return "is of another study or other overrides"
    if found != header:
        return "was made by other versions of the program"
    for row in connection.execute(f"{SELECT} ORDER BY rowid"):
        if checksum(row) != row[-1]:
            raise _Damaged(f"wrong checksum of {row[0]} {row[2]} on level {row[3]}")
    # a write, because SQLite opens a file that it must not write without a word, locking or not
    connection.execute("PRAGMA user_version = 1")
    return ""


def set_aside(path: Path, connection: sqlite3.Connection | None) -> Path:
    """Rename a journal to the first free name .partial.old, .partial.old2, …"""
    number = 1
    while (kept := path.with_name(f"{path.name}.old{number if number > 1 else ''}")).exists():
        number += 1
    if connection is not None and os.name == "nt":  # an open file cannot be renamed there
        connection.close()
    # renamed before the lock goes, so that no other run can resume it in between
    try:
        os.rename(path, kept)
    except OSError as error:
        raise StoreError(f"cannot set {path} aside: {error.strerror}. Remove it or choose another output") from error
    finally:
        if connection is not None:
            connection.close()
    with suppress(FileNotFoundError):
        os.rename(rollback_file(path), rollback_file(kept))
    return kept


def rollback_file(path: Path) -> Path:
    """SQLite's own journal: it belongs to its database and must go wherever that goes."""
    return path.with_name(path.name + "-journal")
