"""Records as rows of the journal: scalars as JSON, arrays as their bytes, a checksum over both."""

from __future__ import annotations

import json
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.records import BlockRecord, LevelRecord

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
        size = int(np.prod(shape, dtype=np.int64)) * np.dtype(dtype).itemsize
        group, _, key = name.rpartition(".")
        place, key = (groups[group], key) if group else (arrays, name)
        place[key] = np.frombuffer(blob[start : start + size], dtype=dtype).reshape(shape).copy()
        start += size
    return json.loads(scalars), arrays, groups
