"""What a run hands to the store: blocks of solved points of a level, and what a level knows of its contact line.

A block is a few arrays, because a point of a long sweep costs less to solve than a record of its own costs to keep.
As a row of the journal a record is its scalars as JSON, its arrays as their bytes, and a checksum over both.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data.schema import FIELD_NAMES, NUMBERS, PointStatus
from tcstudy.scene.study import Study

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

    number: which block of its level;  shape: extent of the sweep
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

    number: int
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

    def __post_init__(self) -> None:
        _check_names(self.numbers.keys(), self.fields.keys())

    def __len__(self) -> int:
        return len(self.points)

    def index(self, row: int) -> tuple[int, ...]:
        """Position of a point along each dimension of the sweep."""
        return tuple(int(i) for i in np.unravel_index(self.points[row], self.shape)) if self.shape else ()

    def solutions_of(self, row: int) -> dict[str, NDArray[Any]]:
        """All solutions of a point, without "row"; empty if they are not kept."""
        own = self.solutions["row"] == row if self.solutions else None
        return {name: values[own] for name, values in self.solutions.items() if name != "row"}


SENSITIVITY = "sensitivity_"
"""How the names of derivatives begin (`tcstudy.data.on_request`)."""
ON_REQUEST = (SENSITIVITY, "probe_", "reaction_", "theta_mean_", "von_mises_")
"""How the names of all numbers on request begin (`tcstudy.data.on_request`)."""


def is_number(name: str) -> bool:
    """Whether `BlockRecord.numbers` may hold this name."""
    return name in NUMBERS or name.startswith(ON_REQUEST)


def _check_names(numbers: AbstractSet[str], fields: AbstractSet[str]) -> None:
    """Raise ValueError unless the table of variables has all names; they are compared as sets, once a record."""
    if unknown := sorted(n for n in numbers - NUMBERS if not is_number(n)) + sorted(fields - FIELD_NAMES):
        raise ValueError(f"no variable {', '.join(unknown)} in the table of the result file")


def check_block(block: BlockRecord, study: Study, level: LevelRecord | None) -> None:
    """Raise ValueError unless the points have places in the file of this study, and each its values.

    level: the record of the block's level; without one its points have no values on the contact line or the body
    """
    name = f"block {block.number} on level {block.level}"
    inside = len(block) and int(block.points.min()) >= 0 and int(block.points.max()) < math.prod(study.shape)
    if not inside or not 0 <= block.level < study.mesh.levels:
        raise ValueError(f"{name} is outside the sweep {study.shape} × {study.mesh.levels}")
    line = {"u_T": block.u_T, "xi": block.xi, "sticks": block.sticks}
    rows = (block.points, block.status, *line.values(), *block.numbers.values(), *block.fields.values())
    if any(len(values) != len(block) or values.dtype.kind not in "iuf" for values in rows if values is not None):
        raise ValueError(f"{name} has not one row of numbers for each of its points")
    if not {*block.status.tolist()} <= {*PointStatus}:
        raise ValueError(f"{name} has a status that does not exist")
    mesh = level.fields.get("node_x") if level is not None else None
    _check_width(name, line, None if level is None else level.n_contact)
    _check_width(name, block.fields, None if mesh is None else len(mesh))
    _check_width(
        name, {key: block.solutions.get(key) for key in ("u_T", "piece")}, None if level is None else level.n_contact
    )
    if len({len(values) for values in block.solutions.values()}) > 1:
        raise ValueError(f"{name} has not one row of numbers for each solution")


def _check_width(name: str, arrays: Mapping[str, np.ndarray[Any, Any] | None], width: int | None) -> None:
    """Raise ValueError unless every row has a value for each node; width: nodes of the level, None if not recorded."""
    for key, values in arrays.items():
        if values is not None and width is None:
            raise ValueError(f"{name} has {key}, but no record says on which nodes")
        if values is not None and values.shape[1:] != (width,):
            raise ValueError(f"{name} has {key} of shape {values.shape}, but the level has {width} nodes")


def check_level(level: LevelRecord, study: Study) -> None:
    """Raise ValueError unless a level belongs to the study and every array has a value for each of its nodes."""
    line = (level.arclength, level.x, level.y, level.c, level.edge)
    if {values.shape for values in line} != {(level.n_contact,)} or not 0 <= level.level < study.mesh.levels:
        raise ValueError(f"level {level.level} does not fit the study")
    numbers: list[np.ndarray[Any, Any]] = [*line, *level.fields.values()]
    mesh = [level.fields[name].shape for name in ("node_x", "node_y") if name in level.fields]
    corners = level.fields.get("triangle", np.empty((0, 3))).shape
    if any(v.dtype.kind not in "iuf" for v in numbers) or len({*mesh}) > 1 or corners[1:] != (3,):
        raise ValueError(f"the mesh of level {level.level} has not one number for each node")


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
    kind, place = ("level", "") if isinstance(record, LevelRecord) else ("block", str(record.number))
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
