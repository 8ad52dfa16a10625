"""What a run hands to the store: blocks of solved points of a level, and what a level knows of its contact line.

A block is a few arrays, because a point of a long sweep costs less to solve than a record of its own costs to keep.

The journal keeps finished points while a run goes on, in a file `<output>.partial` beside the output: a line that says
of which study and program it is, then one record after the other, each with its length and checksum. A record is in
the file when `add` returns, so that a crash or kill -9 leaves at most a torn end, which is cut off; it is brought to
the disk at once unless others were less than SYNC_SECONDS before, so that a power cut takes no more than those that
the system had not yet written by itself. The file is locked for as long as its process lives: two runs cannot share an
output. A journal of another study or of other versions of the numerics is set aside, never deleted; of a damaged one a
copy is, and the run goes on from what stands before the damage.
"""

from __future__ import annotations

import json
import os
import shutil
import struct
import sys
import time
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.files import PARTIAL, remove_stale, special_file, sync_directory
from tcstudy.data.provenance import program, study_sha256
from tcstudy.errors import StoreError
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


Key = tuple[str, int, int, int]
"""(kind, body of a sweep over geometries, first place, level); the last record with a key counts."""
GROUPS = ("numbers", "fields", "solutions")
"""Of named arrays in a record."""
_HEAD = struct.Struct("<QQLL")
"""Before a record: bytes of its text and of its arrays, the CRC-32 of both, and that of the three before it."""


def encode(record: BlockRecord | LevelRecord, body: int = 0) -> tuple[Key, bytes]:
    """A record as it stands in the journal: its key, scalars and the layout of its arrays as JSON (exact for floats),
    then the arrays as their bytes. body: of a sweep over geometries, which it is of"""
    values = vars(record)
    groups = {name: values[name] for name in GROUPS if name in values}
    arrays = {name: v for name, v in values.items() if isinstance(v, np.ndarray)}
    arrays |= {f"{group}.{name}": array for group, named in groups.items() for name, array in named.items()}
    scalars = {name: v for name, v in values.items() if name not in arrays and name not in groups and v is not None}
    kind, place = ("level", 0) if isinstance(record, LevelRecord) else ("block", int(record.points[0]))
    key = (kind, body, place, int(record.level))
    layout = [(name, array.dtype.str, array.shape) for name, array in arrays.items()]
    text = json.dumps([key, scalars, layout], default=lambda numpy_scalar: numpy_scalar.item()).encode()
    data = text + b"".join(map(np.ndarray.tobytes, arrays.values()))
    head = struct.pack("<QQL", len(text), len(data) - len(text), zlib.crc32(data))
    return key, head + struct.pack("<L", zlib.crc32(head)) + data


Row = tuple[list[Any], bytes, int, int]
"""([key, scalars, layout of the arrays], bytes in which the arrays stand, from where, where the next record begins)"""


def row_at(stream: BinaryIO, at: int) -> Row | None:
    """The record at a place of the file; None at the end, and where it is torn. Raises ValueError if it is damaged."""
    stream.seek(at)
    if len(head := stream.read(_HEAD.size)) < _HEAD.size:
        return None
    text, arrays, of_data, of_head = _HEAD.unpack(head)
    if zlib.crc32(head[:-4]) != of_head:
        raise ValueError("wrong checksum")
    if len(data := stream.read(text + arrays)) < text + arrays:
        return None
    if zlib.crc32(data) != of_data:
        raise ValueError("wrong checksum")
    return json.loads(data[:text]), data, text, at + _HEAD.size + len(data)


def record_of(row: Row) -> Any:
    """The BlockRecord or LevelRecord that a row was made of."""
    ((kind, *_), scalars, layout), data, start, _ = row
    own = dict[str, Any]()
    for name, dtype, shape in layout:
        group, _, key = name.rpartition(".")
        array = np.ndarray(tuple(shape), dtype, data, start)  # a view: nobody writes into a record
        (own.setdefault(group, {}) if group else own)[key] = array
        start += array.nbytes
    if kind == "level":
        return LevelRecord(**scalars | {"edge_names": tuple(scalars["edge_names"])}, **own)
    reasons = {int(i): words for i, words in scalars["reasons"].items()}
    return BlockRecord(**{"numbers": {}} | scalars | {"shape": tuple(scalars["shape"]), "reasons": reasons} | own)


SYNC_SECONDS = 0.25
"""Time after which records are brought to the disk again, which costs some 10 ms."""
_OTHER = "choose another output"


class Journal:
    """The open journal of one run. Make it with `Journal.open`.

    warnings: sentences for the user, for example that an old journal was set aside
    """

    def __init__(self, path: Path, stream: BinaryIO, start: int) -> None:
        """start: where the first record stands. Raises OSError."""
        self.path, self.warnings = path, list[str]()
        self._stream, self._end, self._synced = stream, start, -SYNC_SECONDS
        self._at = dict[tuple[str, int], dict[tuple[int, int], int]]()
        try:
            while (row := row_at(stream, self._end)) is not None:
                self._keep(tuple(row[0][0]), row[-1])
        except ValueError:
            shutil.copyfile(path, kept := free_name(path))
            what = f"{path.name} is damaged; it is kept as {kept.name} and the run goes on from what stands before that"
            self.warnings.append(what)
        stream.truncate(self._end)

    @classmethod
    def open(cls, output: Path, study: Study) -> Journal:
        """Create the journal of `output`, or resume it if it is of the same study and numerics.

        Raises StoreError if another run is writing to the same output or the directory cannot be written.
        """
        path = Path(os.path.realpath(output))
        path = Path(os.path.realpath(path.with_name(path.name + PARTIAL)))
        header = json.dumps({"study_sha256": study_sha256(study), "program": program()}).encode() + b"\n"
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            stream, kept = _locked(path), None
            if stream.read(len(header)) not in (b"", header):
                if os.name == "nt":  # an open file cannot be renamed there
                    stream.close()
                os.rename(path, kept := free_name(path))  # before the lock goes: no other run can resume it in between
                stream.close()
                stream = _locked(path)
            if not os.fstat(stream.fileno()).st_size:
                stream.write(header)
            journal = cls(path, stream, len(header))
            remove_stale(output, alone=True)
            sync_directory(path.parent)
        except OSError as error:
            raise StoreError(f"cannot use the journal {path}: {error.strerror}. Make room there or {_OTHER}") from error
        if kept is not None:
            why = "is of another study, other overrides or another version of the program"
            journal.warnings.append(f"{path.name} {why}; it is kept as {kept.name} and the run starts anew")
        return journal

    def add(self, record: BlockRecord | LevelRecord, body: int = 0) -> None:
        """Keep a record of a body; a second one of the same place replaces it. Raises StoreError if it cannot."""
        key, data = encode(record, body)
        left = memoryview(data)
        try:
            while left:
                left = left[self._stream.write(left) :]
        except OSError as error:
            with suppress(OSError):
                self._stream.truncate(self._end)
            raise self._fault(error) from error
        self._keep(key, self._end + len(data))
        if time.monotonic() - self._synced > SYNC_SECONDS:
            self.flush()

    def flush(self) -> None:
        """Bring every record to the disk. Raises StoreError if it cannot."""
        try:
            os.fsync(self._stream.fileno())
        except OSError as error:
            raise self._fault(error) from error
        self._synced = time.monotonic()

    def _fault(self, error: OSError) -> StoreError:
        what = f"cannot keep finished points in {self.path}: {error.strerror}"
        return StoreError(f"{what}. Free some space; the run can then be resumed")

    def _keep(self, key: Key, end: int) -> None:
        """Remember where the next record stands."""
        of_body = self._at.setdefault(key[:2], {})
        of_body.pop(key[2:], None)  # their order is that of the file
        of_body[key[2:]], self._end = self._end, end

    def levels(self, body: int = 0) -> tuple[LevelRecord, ...]:
        """All level records of a body, coarse to fine."""
        return tuple(sorted(self._records("level", body), key=lambda level: level.level))

    def blocks(self, body: int = 0) -> Iterator[BlockRecord]:
        """All its blocks as they finished, read one by one: whole-body fields need not fit into memory."""
        return self._records("block", body)

    def _records(self, kind: str, body: int) -> Iterator[Any]:
        for at in [*self._at.get((kind, body), {}).values()]:
            row = row_at(self._stream, at)
            assert row is not None
            yield record_of(row)

    def close(self) -> None:
        """Bring all to the disk and give up the lock; the journal stays for a later run. Twice does no harm."""
        if not self._stream.closed:
            with self._stream:
                self.flush()

    def discard(self) -> None:
        """Remove the journal. Only when the netCDF file is in place."""
        if os.name == "nt":  # an open file cannot be removed there
            self._stream.close()
        self.path.unlink(missing_ok=True)  # before the lock goes, so that no other run can get hold of the dying file
        self._stream.close()

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


def _locked(path: Path) -> BinaryIO:
    """The file, locked before anything is judged: what another run is writing must not be set aside. Raises OSError."""
    if what := special_file(path):
        raise StoreError(f"{path} is {what}, no file. Remove it or {_OTHER}")
    while True:
        stream = path.open("a+b", buffering=0)
        stream.seek(0)
        try:
            if sys.platform == "win32":
                import msvcrt

                msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)
            else:
                import fcntl

                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except (BlockingIOError, PermissionError) as error:
            stream.close()
            what = f"another run is writing to the same output ({path} is locked)"
            raise StoreError(f"{what}. Wait for it or {_OTHER}") from error
        if path.exists() and os.path.samestat(os.fstat(stream.fileno()), path.stat()):
            return stream
        stream.close()  # the run that had it has removed it meanwhile


def free_name(path: Path) -> Path:
    """The first of .partial.old, .partial.old2, … that is free."""
    number = 1
    while (kept := path.with_name(f"{path.name}.old{number if number > 1 else ''}")).exists():
        number += 1
    return kept
