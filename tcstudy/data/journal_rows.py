"""Records as rows of the journal: scalars as JSON, arrays as their bytes, a checksum over both."""

from __future__ import annotations

import json
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.records import LevelRecord, PointRecord, PointStatus

Row = tuple[str, str, int, str, str, bytes, int]
"""(kind, place, level, scalars, layout, arrays, checksum)"""


def checksum(row: Row) -> int:
    """Of everything in a row but its last entry."""
    scalars, layout, arrays = row[3:6]
    return zlib.crc32(arrays, zlib.crc32(f"{row[:3]}{scalars}{layout}".encode()))


def encode(record: PointRecord | LevelRecord) -> Row:
    """A record as a row: scalars as JSON (exact for floats), arrays as their bytes one after the other."""
    values = vars(record)
    fields = {f"fields.{name}": array for name, array in record.fields.items()}
    arrays = {name: v for name, v in values.items() if isinstance(v, np.ndarray)} | fields
    scalars = {name: v for name, v in values.items() if name not in arrays and name != "fields"}
    kind = "level" if isinstance(record, LevelRecord) else "point"
    place = "" if isinstance(record, LevelRecord) else ",".join(str(int(i)) for i in record.index)
    layout = json.dumps([(name, array.dtype.str, array.shape) for name, array in arrays.items()])
    blob = b"".join(np.ascontiguousarray(array).tobytes() for array in arrays.values())
    row = (kind, place, int(record.level), json.dumps(scalars, default=_plain), layout, blob)
    return (*row, checksum((*row, 0)))


def _plain(value: Any) -> Any:
    """A NumPy scalar as a plain one, for JSON."""
    return value.item()


def decode_level(row: Row) -> LevelRecord:
    """The level record that a row was made of."""
    scalars, arrays, fields = _decode(row)
    scalars["edge_names"] = tuple(scalars["edge_names"])
    return LevelRecord(**scalars, **arrays, fields=fields)


def decode_point(row: Row) -> PointRecord:
    """The point record that a row was made of."""
    scalars, arrays, fields = _decode(row)
    scalars["index"] = tuple(scalars["index"])
    scalars["status"] = PointStatus(scalars["status"])
    numbers = scalars["numbers"]
    scalars["numbers"] = {name: tuple(v) if isinstance(v, list) else v for name, v in numbers.items()}
    return PointRecord(**scalars, **arrays, fields=fields)


def _decode(row: Row) -> tuple[dict[str, Any], dict[str, Any], dict[str, NDArray[Any]]]:
    """Scalars, arrays and whole-body fields of a row."""
    scalars, layout, blob = row[3:6]
    arrays: dict[str, Any] = {}
    start = 0
    for name, dtype, shape in json.loads(layout):
        size = int(np.prod(shape, dtype=np.int64)) * np.dtype(dtype).itemsize
        arrays[name] = np.frombuffer(blob[start : start + size], dtype=dtype).reshape(shape).copy()
        start += size
    fields = {name[7:]: arrays.pop(name) for name in list(arrays) if name.startswith("fields.")}
    return json.loads(scalars), arrays, fields
