"""The journal's SQLite file: locked and made, or found to be of another run or damaged and set aside.

Records as rows of the journal: scalars as JSON, arrays as their bytes, a checksum over both.
"""

from __future__ import annotations

import json
import os
import sqlite3
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import StoreError, special_file
from tcstudy.data.records import BlockRecord, LevelRecord
from tcstudy.errors import shortened

SMALLEST_PAGE = 512
"""Bytes of the smallest SQLite file that holds anything."""

_TABLES = """
CREATE TABLE header (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE record (kind TEXT, place TEXT, level INTEGER, scalars TEXT NOT NULL, layout TEXT NOT NULL,
                     arrays BLOB NOT NULL, crc INTEGER NOT NULL, PRIMARY KEY (kind, place, level));
"""

# NOT INDEXED: a scan in the order of rowid streams; by the index SQLite would first sort all arrays in memory
SELECT = "SELECT kind, place, level, scalars, layout, arrays, crc FROM record NOT INDEXED WHERE kind = ? ORDER BY rowid"


class _Damaged(Exception):
    """The journal cannot be trusted; the text says why."""


_FAULTS = (sqlite3.DatabaseError, _Damaged, ValueError, TypeError, LookupError, AttributeError, OverflowError)
"""What a journal with damaged or foreign content may raise."""


def connect(path: Path, header: dict[str, str], check: Callable[[Row], None]) -> tuple[sqlite3.Connection | None, str]:
    """An open, locked journal with this header, and why it cannot be used ("" if it can).

    check: raises an error for a row that is no record of this run, whatever its checksum says; gets levels first
    """
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
        return connection, _look_into(connection, header, check)
    except _FAULTS as error:
        obstacle = _obstacle(path, error)
        if connection is not None and not obstacle:
            return connection, f"is damaged ({_line(error)})"
        if connection is not None:
            connection.close()
        raise StoreError(obstacle) from error


def _line(error: Exception) -> str:
    """The first line of an error, cut to a readable length."""
    return shortened((str(error).splitlines() or [type(error).__name__])[0], 100)


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
    if isinstance(error, sqlite3.OperationalError) and any(
        word in text for word in ("unable to open", "readonly", "full", "I/O")
    ):
        return f"cannot use the journal {path}: {text}. Make room there or choose another output"
    return ""


def _look_into(connection: sqlite3.Connection, header: dict[str, str], check: Callable[[Row], None]) -> str:
    """Make the tables of an empty journal; say why a filled one does not belong to this run."""
    tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if not tables:
        with connection:
            connection.execute("BEGIN IMMEDIATE")
            for statement in _TABLES.strip().split(";\n"):
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
    if found.get("beside") != header.get("beside"):
        return "is of a run that began from another file"
    if found != header:
        return "was made by other versions of the program"
    for kind in ("level", "block"):
        for row in connection.execute(SELECT, (kind,)):
            if checksum(row) != row[-1]:
                raise _Damaged(f"wrong checksum of {kind} {row[1]} on level {row[2]}")
            check(row)
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


Row = tuple[str, str, int, str, str, bytes, int]
"""(kind, place, level, scalars, layout, arrays, checksum)"""


def checksum(row: Row) -> int:
    """Of everything in a row but its last entry."""
    scalars, layout, arrays = row[3:6]
    return zlib.crc32(arrays, zlib.crc32(f"{row[:3]}{scalars}{layout}".encode()))


def encode(record: BlockRecord | LevelRecord) -> Row:
    """A record as a row: scalars as JSON (exact for floats), arrays as their bytes one after the other."""
    values = vars(record)
    groups = {name: values[name] for name in ("numbers", "fields") if name in values}
    arrays = {name: v for name, v in values.items() if isinstance(v, np.ndarray)}
    arrays |= {f"{group}.{name}": array for group, named in groups.items() for name, array in named.items()}
    scalars = {name: v for name, v in values.items() if name not in arrays and name not in groups and v is not None}
    kind, place = ("level", "") if isinstance(record, LevelRecord) else ("block", str(record.number))
    layout = json.dumps([(name, array.dtype.str, array.shape) for name, array in arrays.items()])
    blob = b"".join(np.ascontiguousarray(array).tobytes() for array in arrays.values())
    row = (kind, place, int(record.level), json.dumps(scalars, default=_plain), layout, blob)
    return (*row, checksum((*row, 0)))


def _plain(value: Any) -> Any:
    """A NumPy scalar as a plain one, for JSON."""
    return value.item()


def decode_level(row: Row) -> LevelRecord:
    """The level record that a row was made of."""
    scalars, arrays, groups = _decode(row)
    scalars["edge_names"] = tuple(scalars["edge_names"])
    return LevelRecord(**scalars, **arrays, fields=groups["fields"])


def decode_block(row: Row) -> BlockRecord:
    """The block that a row was made of."""
    scalars, arrays, groups = _decode(row)
    scalars["shape"] = tuple(scalars["shape"])
    scalars["reasons"] = {int(i): words for i, words in scalars["reasons"].items()}
    return BlockRecord(**scalars, **arrays, numbers=groups["numbers"], fields=groups["fields"])


def _decode(row: Row) -> tuple[dict[str, Any], dict[str, Any], dict[str, dict[str, NDArray[Any]]]]:
    """Scalars, arrays, and the arrays that stand in `numbers` and `fields` of a row."""
    scalars, layout, blob = row[3:6]
    arrays: dict[str, Any] = {}
    groups: dict[str, dict[str, NDArray[Any]]] = {"numbers": {}, "fields": {}}
    start = 0
    for name, dtype, shape in json.loads(layout):
        count = int(np.prod(shape, dtype=np.int64))
        group, _, key = name.rpartition(".")
        place, key = (groups[group], key) if group else (arrays, name)
        found = np.frombuffer(blob, dtype, count, start) if count else np.empty(0, dtype)
        place[key] = found.reshape(shape)  # a view: nobody writes into a record
        start += count * np.dtype(dtype).itemsize
    return json.loads(scalars), arrays, groups
