"""Journals torn, flipped, edited, of another study or none at all: set aside, never deleted or believed."""

from __future__ import annotations

import contextlib
import os
import random
import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest

from tcstudy.data import journal as journal_module
from tcstudy.scene.study import Study
from tests.data.by_points import PointJournal as Journal
from tests.data.conftest import long, make_level, make_point
from tests.data.test_journal import assert_same, fill, partial


@pytest.mark.parametrize("change", [{"text": "other: text\n"}, {"overrides": ("mesh.levels=3",)}])
def test_a_journal_of_another_study_is_set_aside_never_deleted(
    output: Path, study: Study, change: dict[str, object]
) -> None:
    other = replace(study, **change)  # type: ignore[arg-type]
    for n, (old, new) in enumerate(((study, other), (other, study))):
        fill(output, old, [make_point((0, 0, n), 0)])
        with Journal.open(output, new) as journal:
            assert not [*journal.blocks()]
            (warning,) = journal.warnings
            assert "another study" in warning
            assert ".partial.old" in warning
    names = sorted(os.listdir(output.parent))
    assert names == ["study.nc.partial", "study.nc.partial.old", "study.nc.partial.old2"]
    for name, n in (("study.nc.partial.old", 0), ("study.nc.partial.old2", 1)):
        with sqlite3.connect(output.parent / name) as kept:
            assert kept.execute("SELECT place FROM record WHERE kind = 'block'").fetchall() == [(str(n),)]
        kept.close()


def test_a_journal_of_other_versions_is_set_aside(output: Path, study: Study, monkeypatch: pytest.MonkeyPatch) -> None:
    fill(output, study, [make_point((0, 0, 0), 0)])
    monkeypatch.setattr(journal_module, "program", lambda: "edited")
    with Journal.open(output, study) as journal:
        assert not [*journal.blocks()]
        assert "other versions" in journal.warnings[0]


@pytest.mark.parametrize("size", [0, 1, 100, 4096, 9000, -5000])
def test_a_torn_journal_is_set_aside_and_an_empty_one_used(output: Path, study: Study, size: int) -> None:
    fill(output, study, [long(make_point((0, 0, i), 0), 0, 1000) for i in range(2)])
    torn = partial(output).read_bytes()[:size]
    partial(output).write_bytes(torn)
    with Journal.open(output, study) as journal:
        assert not [*journal.blocks()]
        assert bool(journal.warnings) == (size != 0)
        journal.add(make_level(0))
        journal.add(make_point((0, 0, 0), 0))
    if size:
        assert partial(output).with_name("study.nc.partial.old").read_bytes() == torn
    with Journal.open(output, study) as journal:
        assert len([*journal.blocks()]) == 1
        assert not journal.warnings


def test_no_flipped_byte_is_taken_for_a_result(output: Path, study: Study) -> None:
    """A damaged byte is either without effect on the records, or noticed; never a wrong number, never a crash."""
    points = [long(make_point((0, 0, i), 0), 0, 300) for i in range(2)]
    fill(output, study, points)
    data = partial(output).read_bytes()
    generator = random.Random(1)
    noticed = 0
    for place in [*range(100), *generator.sample(range(100, len(data)), 60)]:
        damaged = bytearray(data)
        damaged[place] ^= 1 + generator.randrange(255)
        partial(output).write_bytes(damaged)
        with Journal.open(output, study) as journal:
            if journal.warnings:
                noticed += 1
                assert not [*journal.blocks()]
            else:
                for point, again in zip(points, journal.points(), strict=True):
                    assert_same(point, again)
    assert noticed > 30


def test_a_damaged_header_that_looks_read_only_is_set_aside(output: Path, study: Study) -> None:
    Journal.open(output, study).close()
    damaged = bytearray(partial(output).read_bytes())
    damaged[18] = 3  # a write version of the future: SQLite opens such a file for reading only
    partial(output).write_bytes(damaged)
    with Journal.open(output, study) as journal:
        assert "damaged" in journal.warnings[0]


def test_any_other_file_at_its_place_is_set_aside(output: Path, study: Study) -> None:
    output.parent.mkdir()
    partial(output).write_text("my notes, far from a database\n" * 100)
    with Journal.open(output, study) as journal:
        assert "damaged" in journal.warnings[0]
    foreign = sqlite3.connect(partial(output))
    foreign.executescript("DROP TABLE record; CREATE TABLE cats (name TEXT);")
    foreign.close()
    with Journal.open(output, study) as journal:
        assert "not a journal" in journal.warnings[0]


@pytest.mark.parametrize(
    ("column", "value"),
    [("scalars", b"\xff\xfe"), ("scalars", "[]"), ("arrays", "text"), ("place", "7"), ("level", 1), ("crc", "text")],
)
def test_a_record_that_is_none_sets_the_journal_aside(output: Path, study: Study, column: str, value: object) -> None:
    fill(output, study, [make_point((0, 0, 0), 0)])
    with contextlib.closing(sqlite3.connect(partial(output))) as database:
        database.execute(f"UPDATE record SET {column} = ? WHERE kind = 'block'", (value,))
        database.commit()
    with Journal.open(output, study) as journal:
        assert not [*journal.blocks()]
        assert "is damaged" in journal.warnings[0]
        assert "\n" not in journal.warnings[0]
