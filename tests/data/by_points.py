"""The journal and the store for tests, which know their points one by one: each is the block of its place."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from tcstudy.data import store
from tcstudy.data.journal import Journal
from tcstudy.data.provenance import Provenance
from tcstudy.data.records import BlockRecord, LevelRecord, PointRecord, block_of
from tcstudy.scene.study import Study

Record = BlockRecord | PointRecord | LevelRecord


def alone(record: Record, shape: tuple[int, ...]) -> BlockRecord | LevelRecord:
    """A point as the block that has its place in the sweep for a number; other records as they are."""
    if not isinstance(record, PointRecord):
        return record
    block = block_of((record,), shape)
    return replace(block, number=int(block.points[0]))


def write(
    path: Path,
    study: Study,
    levels: Sequence[LevelRecord],
    records: Sequence[Record] | Callable[[], Iterable[Record]],
    provenance: Provenance,
) -> tuple[int, int]:
    """`store.write` of points."""
    blocks = lambda: (alone(record, study.shape) for record in (records() if callable(records) else records))  # noqa: E731
    return store.write(path, study, levels, blocks, provenance)  # type: ignore[arg-type]


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
        return (point for block in self.blocks() for point in block.one_by_one())
