"""Points one by one, for tests that look at single ones: each is the row of a block."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data import store
from tcstudy.data.files import collect
from tcstudy.data.records import BlockRecord, LevelRecord
from tcstudy.data.schema import PointStatus
from tcstudy.scene.study import Study

Array = NDArray[Any]
NONE: Array = np.empty(0)


@dataclass(frozen=True, eq=False)
class PointRecord:
    """A row of a `BlockRecord`; arrays are empty if the point failed before."""

    index: tuple[int, ...]
    level: int
    status: PointStatus
    reason: str
    numbers: Mapping[str, Any]
    u_T: Array = field(default_factory=lambda: NONE)
    xi: Array = field(default_factory=lambda: NONE)
    fields: Mapping[str, Array] = field(default_factory=dict)
    sticks: Array = field(default_factory=lambda: NONE)


def one_by_one(block: BlockRecord) -> Iterator[PointRecord]:
    """The points of a block."""
    for row in range(len(block)):
        line = (block.u_T, block.xi, block.sticks)
        known = block.u_T is not None and not np.isnan(block.u_T[row]).any()
        u_T, xi, sticks = (NONE if values is None or not known else values[row] for values in line)
        numbers = {name: values[row] for name, values in block.numbers.items()}
        fields = {
            name: values[row]
            for name, values in block.fields.items()
            if not np.isnan(values[row]).all()
        }
        status = PointStatus(int(block.status[row]))
        reason = block.reasons.get(row, "")
        yield PointRecord(
            block.index(row), block.level, status, reason, numbers, u_T, xi, fields, sticks
        )


def block_of(point: PointRecord, shape: tuple[int, ...]) -> BlockRecord:
    """A point as the block of its place; shape: extent of the sweep."""
    u_T, xi, sticks = (
        values[None] if len(values) else None for values in (point.u_T, point.xi, point.sticks)
    )
    place = np.array([np.ravel_multi_index(point.index, shape) if shape else 0], dtype=np.intp)
    reasons = {0: point.reason} if point.reason else {}
    return BlockRecord(
        *(point.level, shape, place, np.array([point.status], dtype=np.int8), reasons),
        numbers={name: np.array([value], dtype=float) for name, value in point.numbers.items()},
        u_T=u_T,
        xi=xi,
        sticks=sticks,
        fields={name: values[None] for name, values in point.fields.items()},
    )


def write(
    path: Path,
    study: Study,
    levels: Sequence[LevelRecord],
    records: Sequence[BlockRecord | PointRecord],
    attributes: Mapping[str, Any] | None = None,
) -> tuple[int, int]:
    """`store.write` of blocks and points."""
    blocks = [
        block_of(one, study.shape) if isinstance(one, PointRecord) else one for one in records
    ]
    told = attributes or collect(study, ["tcstudy", "run", "study.yaml"])
    return store.write(path, store.Results(study, lambda: levels, lambda: blocks, told))
