"""The journal: what was committed survives whatever happens; what is damaged or another's is set
aside."""

import contextlib
import os
import random
import re
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tcstudy.data import records as records_module
from tcstudy.data.files import StoreError
from tcstudy.data.records import BlockRecord, Journal, LevelRecord
from tcstudy.scene.study import Study
from tests.data.conftest import failed, make_block, make_level

pytestmark = pytest.mark.filterwarnings("error")
posix = pytest.mark.skipif(
    os.name == "nt", reason="kill -9 and file size limits are a matter of POSIX"
)
Record = BlockRecord | LevelRecord


def assert_same(a: Any, b: Any) -> None:
    """Equal in every field, arrays and their dtypes included."""
    if isinstance(a, Record):
        a, b = vars(a), vars(b)
    if isinstance(a, dict):
        assert a.keys() == b.keys()
        for key, value in a.items():
            assert_same(value, b[key])
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)
    else:
        assert (a, type(a)) == (b, type(b))


def partial(output: Path) -> Path:
    return output.with_name(output.name + ".partial")


def fill(output: Path, study: Study, *records: Record) -> None:
    with Journal.open(output, study) as journal:
        for record in (make_level(0, fields=True), make_level(1, fields=True), *records):
            journal.add(record)


def long(place: int, level: int = 0, m: int = 20_000) -> BlockRecord:
    """A point that takes its time to write."""
    return make_block(level, place, reasons={0: f"{place:.9f} ".rjust(17) * m})


def test_records_come_back_exactly_the_last_of_a_place(output: Path, study: Study) -> None:
    odd = {"energy": 0.1 + 0.2, "omega": float("inf"), "lambda_1": 5e-324, "iterations": 7.0}
    blocks = [
        make_block(1, *range(5, 9), fields=True),
        make_block(0, 5, numbers={name: np.array([value]) for name, value in odd.items()}),
        failed(1, 0, "ü\n'"),
    ]
    fill(output, study, failed(5, 1, "crashed"), *blocks)
    with Journal.open(output, study) as journal:
        assert journal.warnings == []
        levels = [make_level(n, fields=True) for n in range(2)]
        for record, again in zip(
            (*levels, *blocks), (*journal.levels(), *journal.blocks()), strict=True
        ):
            assert_same(record, again)


_CHILD = """
import resource, sys, time
from pathlib import Path
from tcstudy.data.files import StoreError
from tcstudy.data.records import Journal
from tests.data.conftest import make_level, make_study
from tests.data.test_journal import long
journal, mode = Journal.open(Path(sys.argv[1]), make_study()), sys.argv[2]
journal.add(make_level(0))
if mode in ("add", "wait"):
    for place in range(12):
        journal.add(long(place))
        if mode == "add":
            print(place, flush=True)
    print("added", flush=True)
    while True:  # until it is killed
        if mode == "add":
            journal.add(long(0, 1))
        else:
            time.sleep(0.1)
journal.add(long(0, m=1))
soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, hard))
for _ in range(2):
    try:
        journal.add(long(1, m=10_000))
    except StoreError as error:
        print(error)
if mode == "mended":
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    journal.add(long(1, m=10_000))
"""


@pytest.fixture
def start(output: Path) -> Iterator[Callable[[str], subprocess.Popen[str]]]:
    """Start a process that writes into the journal of `output` until it is killed."""
    started: list[subprocess.Popen[str]] = []

    def _start(mode: str) -> subprocess.Popen[str]:
        environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
        command = [sys.executable, "-c", _CHILD, str(output), mode]
        started.append(
            subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
        )
        return started[-1]

    yield _start
    for process in started:
        process.kill()
        process.communicate()


@posix
@pytest.mark.parametrize("seen", [1, 12])
def test_points_survive_kill_9_in_the_middle_of_adding(
    output: Path, study: Study, start: Callable[[str], subprocess.Popen[str]], seen: int
) -> None:
    process = start("add")
    assert process.stdout is not None
    assert all(process.stdout.readline() for _ in range(seen))
    time.sleep(random.random() * 0.02)  # somewhere within a record
    process.send_signal(signal.SIGKILL)
    process.wait()
    with Journal.open(output, study) as journal:
        assert journal.warnings == []
        on_level_0 = [block for block in journal.blocks() if block.level == 0]
        assert len(on_level_0) >= seen
        for place, block in enumerate(on_level_0):
            assert_same(block, long(place))
        assert_same(journal.levels()[0], make_level(0))
        journal.add(make_block(0, 11))


@posix
def test_a_second_run_is_refused_until_the_first_dies_whose_points_stay(
    output: Path, study: Study, start: Callable[[str], subprocess.Popen[str]], tmp_path: Path
) -> None:
    process = start("wait")
    assert process.stdout is not None
    assert process.stdout.readline() == "added\n"
    alias = tmp_path / "alias"
    alias.symlink_to(output.parent)
    for name, candidate in (
        (output, study),
        (output, replace(study, text="other")),
        (alias / output.name, study),
    ):
        with pytest.raises(StoreError, match="another run is writing to the same output"):
            Journal.open(name, candidate)
    assert not any(".old" in name for name in os.listdir(output.parent))
    process.send_signal(signal.SIGKILL)
    process.wait()
    with Journal.open(output, study) as journal:
        assert len([*journal.blocks()]) == 12


@posix
@pytest.mark.parametrize(("end", "kept"), [("mended", 2), ("dead", 1)])
def test_a_full_disk_is_reported_and_costs_no_point_before_it(
    output: Path, study: Study, start: Callable[[str], subprocess.Popen[str]], end: str, kept: int
) -> None:
    said, _ = start(end).communicate(timeout=60)
    assert len(re.findall("cannot keep finished points.*Free some space", said)) == 2
    with Journal.open(output, study) as journal:
        assert (len([*journal.blocks()]), journal.warnings) == (kept, [])


def test_a_place_that_cannot_be_written_is_one_clear_error(tmp_path: Path, study: Study) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "study.nc.partial").mkdir()
    for output in (tmp_path / "file" / "study.nc", tmp_path / "study.nc"):
        with pytest.raises(StoreError, match="hoose another output"):
            Journal.open(output, study)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"text": ""}, "another study"),
        ({"overrides": ("mesh.levels=3",)}, "other overrides"),
        ({}, "another version"),
    ],
)
def test_a_journal_of_another_study_or_program_is_set_aside_never_deleted(
    output: Path, study: Study, change: dict[str, Any], why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = replace(study, **change)
    for place, (old, new) in enumerate(((study, other), (other, study))):
        fill(output, old, make_block(0, place))
        if not change:
            monkeypatch.setattr(records_module, "program", lambda place=place: f"edited {place}")
        with Journal.open(output, new) as journal:
            assert not [*journal.blocks()]
            assert [why in one and ".partial.old" in one for one in journal.warnings] == [True]
    for place, name in enumerate(("study.nc.partial.old", "study.nc.partial.old2")):
        with contextlib.closing(sqlite3.connect(output.parent / name)) as kept:
            assert kept.execute("SELECT place FROM record WHERE kind = 'block'").fetchall() == [
                (place,)
            ]


@pytest.mark.parametrize("size", [0, 1, 100, 600, 4096, 9000, -5000])
def test_a_torn_journal_is_set_aside_and_an_empty_one_used(
    output: Path, study: Study, size: int
) -> None:
    fill(output, study, long(0, m=1000), long(1, m=1000))
    torn = partial(output).read_bytes()[:size]
    partial(output).write_bytes(torn)
    with Journal.open(output, study) as journal:
        assert not [*journal.blocks()]
        assert bool(journal.warnings) == (size != 0)
        journal.add(make_block(0, 0))
    if size:
        assert partial(output).with_name("study.nc.partial.old").read_bytes() == torn
    with Journal.open(output, study) as journal:
        assert (len([*journal.blocks()]), journal.warnings) == (1, [])


def test_no_flipped_byte_is_taken_for_a_result(output: Path, study: Study) -> None:
    """A damaged byte is either without effect on the records, or noticed; never a wrong number,
    never a crash."""
    blocks = [long(place, m=300) for place in range(2)]
    fill(output, study, *blocks)
    data = partial(output).read_bytes()
    generator, noticed = random.Random(1), 0
    for place in [*range(100), *generator.sample(range(100, len(data)), 30)]:
        damaged = bytearray(data)
        damaged[place] ^= 1 + generator.randrange(255)
        partial(output).write_bytes(damaged)
        with Journal.open(output, study) as journal:
            if journal.warnings:
                noticed += 1
                assert not [*journal.blocks()]
            else:
                for block, again in zip(blocks, journal.blocks(), strict=True):
                    assert_same(block, again)
    assert noticed > 30


def test_any_other_file_at_its_place_is_set_aside(output: Path, study: Study) -> None:
    fill(output, study, make_block(0, 0))
    future = bytearray(partial(output).read_bytes())
    future[18] = 3  # a write version of the future: SQLite opens such a file for reading only
    for content in (bytes(future), b"my notes, far from a database\n" * 100):
        partial(output).write_bytes(content)
        with Journal.open(output, study) as journal:
            assert "damaged" in journal.warnings[0]
            journal.add(make_block(0, 0))
    with contextlib.closing(sqlite3.connect(partial(output))) as foreign:
        foreign.executescript("DROP TABLE record; CREATE TABLE cats (name TEXT);")
    with Journal.open(output, study) as journal:
        assert "no such table" in journal.warnings[0]
