"""The journal and the store for tests, which know their points one by one: each is the block of its place."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tcstudy.data import store
from tcstudy.data.journal import Journal
from tcstudy.data.provenance import collect
from tcstudy.data.records import BlockRecord, LevelRecord, PointStatus
from tcstudy.scene.study import Study

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PointRecord:
    """One sweep point on one level.

    index:   position of the point in the sweep (along each data dimension)
    status, reason: what came of it; reason is "" for OK
    numbers: results by variable name (data.schema.NUMBERS), tuples where there is one for each start or solver;
             missing ones are NaN in the data
    u_T, xi: (m,) tangential displacement [m] and traction −S_T = ξ_i/c_i [Pa]; empty if the point failed before
    sticks:  (m,) 1 where the node rests on an up-jump of the friction law, else 0; empty if that is not known
    fields:  whole-body nodal fields by name ("theta", "u_x", "u_y"), only if asked for
    solutions: as in BlockRecord, without "row"
    """

    index: tuple[int, ...]
    level: int
    status: PointStatus
    reason: str
    numbers: dict[str, float | tuple[float, ...]]
    u_T: Array
    xi: Array
    fields: dict[str, Array] = field(default_factory=dict)
    sticks: NDArray[np.int8] = field(default_factory=lambda: np.empty(0, dtype=np.int8))
    solutions: dict[str, NDArray[Any]] = field(default_factory=dict)


def one_by_one(block: BlockRecord) -> Iterator[PointRecord]:
    """The points of a block as records of their own."""
    empty: Array = np.empty(0)
    for row in range(len(block)):
        known = block.u_T is not None and not np.isnan(block.u_T[row]).any()
        numbers = {
            name: float(values[row]) if values.ndim == 1 else tuple(values[row].tolist())
            for name, values in block.numbers.items()
        }
        yield PointRecord(
            index=block.index(row),
            level=block.level,
            status=PointStatus(int(block.status[row])),
            reason=block.reasons.get(row, ""),
            numbers=numbers,
            u_T=block.u_T[row] if known and block.u_T is not None else empty,
            xi=block.xi[row] if known and block.xi is not None else empty,
            fields={n: values[row] for n, values in block.fields.items() if not np.isnan(values[row]).all()},
            sticks=block.sticks[row] if known and block.sticks is not None else np.empty(0, dtype=np.int8),
            solutions=block.solutions_of(row),
        )


def block_of(points: Sequence[PointRecord], shape: tuple[int, ...]) -> BlockRecord:
    """Points of one level as a block; shape: extent of the sweep. Raises ValueError for a point outside it."""
    for p in points:
        if len(p.index) != len(shape) or not all(0 <= i < n for i, n in zip(p.index, shape, strict=True)):
            raise ValueError(f"point {p.index}, level {p.level} is outside the sweep {shape}")
    m = max((len(p.u_T) for p in points), default=0)
    names = dict.fromkeys(name for p in points for name in p.numbers)
    fields = {name: array for p in points for name, array in p.fields.items()}

    def stacked(values: Sequence[NDArray[Any]], size: int, missing: float, dtype: type = float) -> NDArray[Any]:
        rows: NDArray[Any] = np.full((len(values), size), missing, dtype=dtype)
        for row, value in zip(rows, values, strict=True):
            if len(value):
                row[:] = value
        return rows

    def column(name: str) -> Array:
        values = [p.numbers.get(name) for p in points]
        width = max((len(v) for v in values if isinstance(v, tuple)), default=0)
        missing: object = (np.nan,) * width if width else np.nan
        return np.array([missing if v is None else v for v in values], dtype=float)

    every = [(row, p.solutions) for row, p in enumerate(points) if p.solutions]
    solutions = {name: np.concatenate([own[name] for _, own in every]) for name in every[0][1]} if every else {}
    if every:
        solutions["row"] = np.repeat([row for row, _ in every], [len(own["energy"]) for _, own in every])

    return BlockRecord(
        level=points[0].level,
        shape=shape,
        points=np.array([np.ravel_multi_index(p.index, shape) if shape else 0 for p in points], dtype=np.intp),
        status=np.array([int(p.status) for p in points], dtype=np.int8),
        reasons={row: p.reason for row, p in enumerate(points) if p.reason},
        numbers={name: column(name) for name in names},
        u_T=stacked([p.u_T for p in points], m, np.nan) if m else None,
        xi=stacked([p.xi for p in points], m, np.nan) if m else None,
        sticks=stacked([p.sticks for p in points], m, -1, np.int8) if m else None,
        fields={
            name: stacked([p.fields.get(name, np.empty(0)) for p in points], len(array), np.nan)
            for name, array in fields.items()
        },
        solutions=solutions,
    )


Record = BlockRecord | PointRecord | LevelRecord


def alone(record: Record, shape: tuple[int, ...]) -> BlockRecord | LevelRecord:
    """A point as the block that has its place in the sweep for a number; other records as they are."""
    if not isinstance(record, PointRecord):
        return record
    return block_of((record,), shape)


def write(
    path: Path,
    study: Study,
    levels: Sequence[LevelRecord],
    records: Sequence[Record] | Callable[[], Iterable[Record]],
    attributes: Mapping[str, Any] | None = None,
) -> tuple[int, int]:
    """`store.write` of points."""
    blocks = lambda: (alone(record, study.shape) for record in (records() if callable(records) else records))  # noqa: E731
    return store.write(path, study, levels, blocks, attributes or collect(study, ["tcstudy", "run", "study.yaml"]))  # type: ignore[arg-type]


class PointJournal(Journal):
    """A journal of points."""

    shape: tuple[int, ...] = ()

    @classmethod
    def open(cls, output: Path, study: Study) -> PointJournal:
        journal = super().open(output, study)
        assert isinstance(journal, PointJournal)
        journal.shape = study.shape
        return journal

    def add(self, record: Record) -> None:
        super().add(alone(record, self.shape))

    def points(self) -> Iterator[PointRecord]:
        return (point for block in self.blocks() for point in one_by_one(block))
