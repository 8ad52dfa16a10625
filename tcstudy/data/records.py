"""What a run hands to the store: blocks of solved points of a level, and what a level knows of its contact line.

A block is a few arrays, because a point of a long sweep costs less to solve than a record of its own costs to keep.
As a row of the journal a record is its scalars as JSON, its arrays as their bytes, and a checksum over both.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.schema import PointStatus

__all__ = ["BlockRecord", "LevelRecord", "PointStatus"]

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


Row = tuple[str, str, int, str, str, bytes, int]
"""(kind, place, level, scalars, layout, arrays, checksum)"""


def checksum(row: Row) -> int:
    """Of everything in a row but its last entry."""
    scalars, layout, arrays = row[3:6]
    return zlib.crc32(arrays, zlib.crc32(f"{row[:3]}{scalars}{layout}".encode()))


GROUPS = ("numbers", "fields", "solutions")
"""Of named arrays in a record."""


def encode(record: BlockRecord | LevelRecord) -> Row:
    """A record as a row."""
    values = vars(record)
    groups = {name: values[name] for name in GROUPS if name in values}
    arrays = {name: v for name, v in values.items() if isinstance(v, np.ndarray)}
    arrays |= {f"{group}.{name}": array for group, named in groups.items() for name, array in named.items()}
    scalars = {name: v for name, v in values.items() if name not in arrays and name not in groups and v is not None}
    kind, place = ("level", "") if isinstance(record, LevelRecord) else ("block", str(record.points[0]))
    return row_of(kind, place, record.level, scalars, arrays)


def row_of(
    kind: str, place: str, level: int, scalars: Mapping[str, Any], arrays: Mapping[str, np.ndarray[Any, Any]]
) -> Row:
    """A row: scalars as JSON (exact for floats), arrays as their bytes one after the other."""
    layout = json.dumps([(name, array.dtype.str, array.shape) for name, array in arrays.items()])
    blob = b"".join(np.ascontiguousarray(array).tobytes() for array in arrays.values())
    text = json.dumps(scalars, default=lambda numpy_scalar: numpy_scalar.item())
    row = (kind, place, int(level), text, layout, blob)
    return (*row, checksum((*row, 0)))


def decode_level(row: Row) -> LevelRecord:
    """The level record that a row was made of."""
    scalars, arrays, groups = decode(row)
    scalars["edge_names"] = tuple(scalars["edge_names"])
    return LevelRecord(**scalars, **arrays, fields=groups["fields"])


def decode_block(row: Row) -> BlockRecord:
    """The block that a row was made of."""
    scalars, arrays, groups = decode(row)
    scalars["shape"] = tuple(scalars["shape"])
    scalars["reasons"] = {int(i): words for i, words in scalars["reasons"].items()}
    named: dict[str, Any] = dict(groups)
    return BlockRecord(**scalars, **arrays, **named)


def decode(row: Row) -> tuple[dict[str, Any], dict[str, Any], dict[str, dict[str, NDArray[Any]]]]:
    """Scalars, arrays, and the arrays that stand in the groups of a row."""
    scalars, layout, blob = row[3:6]
    arrays: dict[str, Any] = {}
    groups: dict[str, dict[str, NDArray[Any]]] = {name: {} for name in GROUPS}
    start = 0
    for name, dtype, shape in json.loads(layout):
        count = int(np.prod(shape, dtype=np.int64))
        group, _, key = name.rpartition(".")
        place, key = (groups[group], key) if group else (arrays, name)
        found = np.frombuffer(blob, dtype, count, start) if count else np.empty(0, dtype)
        place[key] = found.reshape(shape)  # a view: nobody writes into a record
        start += count * np.dtype(dtype).itemsize
    return json.loads(scalars), arrays, groups
