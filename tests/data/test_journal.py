"""The journal: what was committed survives whatever happens to the process."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tcstudy.data import journal as journal_module
from tcstudy.data import store
from tcstudy.data.files import StoreError
from tcstudy.data.journal import Journal
from tcstudy.data.provenance import Provenance
from tcstudy.data.records import LevelRecord, PointRecord, PointStatus, checksum
from tcstudy.scene.study import Study
from tests.data.conftest import make_level

pytestmark = pytest.mark.filterwarnings("error")


def assert_same(a: PointRecord | LevelRecord, b: PointRecord | LevelRecord) -> None:
    """Equal in every field, arrays and their dtypes included."""
    assert type(a) is type(b)
    for name, value in vars(a).items():
        other = getattr(b, name)
        if name == "fields":
            assert value.keys() == other.keys()
            pairs = [(value[key], other[key]) for key in value]
        elif isinstance(value, np.ndarray):
            pairs = [(value, other)]
        else:
            assert (value, type(value)) == (other, type(other)), name
            continue
        for x, y in pairs:
            assert x.dtype == y.dtype
            np.testing.assert_array_equal(x, y)


def partial(output: Path) -> Path:
    return output.with_name(output.name + ".partial")


def fill(output: Path, study: Study, records: list[PointRecord]) -> None:
    with Journal.open(output, study) as journal:
        for record in (make_level(0, fields=True), make_level(1, fields=True), *records):
            journal.add(record)


def test_records_come_back_exactly(
    output: Path, study: Study, new_level: Callable[..., LevelRecord], new_point: Callable[..., PointRecord]
) -> None:
    levels = [new_level(n, fields=True) for n in range(2)]
    odd = {"energy": 0.1 + 0.2, "omega": float("inf"), "lambda_1": 5e-324, "iterations": 7}
    points = [
        new_point((1, 0, 1), 1, fields=True),
        replace(new_point((0, 2, 1), 0), numbers=odd),
        replace(
            new_point((0, 0, 1), 0),
            status=PointStatus.ERROR,
            reason="ü\n'",
            u_T=np.empty(0),
            xi=np.empty(0),
            sticks=np.empty(0, dtype=np.int8),
        ),
    ]
    with Journal.open(output, study) as journal:
        assert not journal.finished
        assert journal.warnings == ()
        for record in (*reversed(levels), *points):
            journal.add(record)
    with Journal.open(output, study) as journal:
        assert journal.warnings == ()
        assert statuses(journal) == {(p.index, p.level): p.status for p in points}
        for record, again in zip((*levels, *points), (*journal.levels(), *journal.points()), strict=True):
            assert_same(record, again)


def test_a_second_record_of_a_point_replaces_the_first(
    output: Path, study: Study, new_point: Callable[..., PointRecord], new_failure: Callable[..., PointRecord]
) -> None:
    fill(
        output,
        study,
        [new_failure((0, 0, 0), 0, "crashed"), new_point((0, 0, 0), 1), new_point((0, 0, 0), 0)],
    )
    with Journal.open(output, study) as journal:
        assert statuses(journal) == {((0, 0, 0), 0): PointStatus.OK, ((0, 0, 0), 1): PointStatus.OK}


def test_numpy_scalars_may_stand_in_a_record(output: Path, study: Study, new_point: Callable[..., PointRecord]) -> None:
    numbers = {"energy": np.float64(0.1), "iterations": np.int64(3)}
    fill(output, study, [replace(new_point((0, 0, 0), 0), numbers=numbers, index=(np.int64(0),) * 3)])  # type: ignore[arg-type]
    with Journal.open(output, study) as journal:
        (point,) = journal.points()
        assert point.numbers == {"energy": 0.1, "iterations": 3}
        assert point.index == (0, 0, 0)


def test_the_journal_feeds_the_store_and_is_then_discarded(
    output: Path,
    study: Study,
    levels: tuple[LevelRecord, ...],
    points: list[PointRecord],
    provenance: Provenance,
) -> None:
    stale = output.with_name(f".{output.name}.999.tmp")
    stale.parent.mkdir()
    stale.touch()  # of a writer that was killed
    with Journal.open(output, study) as journal:
        for record in (*levels, *points):
            journal.add(record)
        store.write(output, study, journal.levels(), journal.points, provenance)
        journal.discard()
    assert os.listdir(output.parent) == [output.name]
    with store.open_results(output) as tree:
        assert [tree["energy"].values[(*p.index, p.level)] for p in points] == [p.numbers["energy"] for p in points]


def statuses(journal: Journal) -> dict[tuple[tuple[int, ...], int], PointStatus]:
    """What an earlier run left, by (index, level)."""
    return {(p.index, p.level): p.status for p in journal.points()}


_WRITER = """
import sys, time
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from conftest import long, make_level, make_point, make_study
from tcstudy.data.journal import Journal
from tcstudy.data.journal import checksum
import numpy as np
study = make_study()
journal = Journal.open(Path(sys.argv[1]), study)
journal.add(make_level(0))
journal.add(make_level(1))
mode = sys.argv[3]
for n, index in enumerate(np.ndindex(study.shape)):
    journal.add(long(make_point(index, 0), n))
    if mode == "flush":
        journal.flush()
        print(n, flush=True)
if mode == "wait":
    deadline = time.monotonic() + 20
    while journal._pending and time.monotonic() < deadline:  # nobody flushes: the journal does so by itself
        time.sleep(0.01)
    print("pending" if journal._pending else "committed", flush=True)
while True:
    if mode == "flush":  # go on adding until killed
        for index in np.ndindex(study.shape):
            journal.add(long(make_point(index, 1), 0))
            journal.flush()
    else:
        time.sleep(0.1)
"""


@pytest.fixture
def start(output: Path) -> Iterator[Callable[[str], subprocess.Popen[str]]]:
    """Start a process that writes into the journal of `output` until it is killed."""
    started: list[subprocess.Popen[str]] = []

    def _start(mode: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", _WRITER, str(output), str(Path(__file__).parent), mode]
        environment = {**os.environ, "PYTHONPATH": str(Path(store.__file__).parents[2])}
        started.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment))
        return started[-1]

    yield _start
    for process in started:
        process.kill()
        process.communicate()


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="kill -9 is a matter of POSIX")
@pytest.mark.parametrize("seen", [1, 5, 12])
def test_committed_points_survive_kill_9_in_the_middle_of_adding(
    output: Path,
    study: Study,
    start: Callable[[str], subprocess.Popen[str]],
    new_point: Callable[..., PointRecord],
    new_level: Callable[..., LevelRecord],
    seen: int,
    lengthened: Callable[..., PointRecord],
) -> None:
    process = start("flush")
    assert process.stdout is not None
    for _ in range(seen):
        assert process.stdout.readline()
    time.sleep(random.random() * 0.02)  # somewhere inside a commit
    process.send_signal(signal.SIGKILL)
    process.wait()
    with Journal.open(output, study) as journal:
        assert journal.warnings == ()
        on_level_0 = [p for p in journal.points() if p.level == 0]
        assert len(on_level_0) >= seen
        for n, (point, index) in enumerate(zip(on_level_0, np.ndindex(study.shape), strict=False)):
            assert_same(point, lengthened(new_point(index, 0), n))
        assert_same(journal.levels()[0], new_level(0))
        journal.add(new_point((1, 2, 1), 0))


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="kill -9 is a matter of POSIX")
def test_a_record_is_on_the_disk_soon_although_nobody_flushes(
    output: Path, study: Study, start: Callable[[str], subprocess.Popen[str]]
) -> None:
    process = start("wait")
    assert process.stdout is not None
    assert process.stdout.readline() == "committed\n"
    process.send_signal(signal.SIGKILL)
    process.wait()
    with Journal.open(output, study) as journal:
        assert len(journal.finished) == 12


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="kill -9 is a matter of POSIX")
def test_a_second_run_onto_the_same_output_is_refused_until_the_first_dies(
    output: Path, study: Study, start: Callable[[str], subprocess.Popen[str]], tmp_path: Path
) -> None:
    process = start("wait")
    assert process.stdout is not None
    assert process.stdout.readline()
    other = replace(study, text="another: study\n")
    alias = tmp_path / "alias"
    alias.symlink_to(output.parent)
    for name, candidate in ((output, study), (output, other), (alias / output.name, study)):
        with pytest.raises(StoreError, match="another run is writing to the same output"):
            Journal.open(name, candidate)
    assert not any(".old" in name for name in os.listdir(output.parent))
    process.send_signal(signal.SIGKILL)
    process.wait()
    Journal.open(output, study).close()


def test_two_journals_in_one_process_are_refused_too(output: Path, study: Study) -> None:
    with Journal.open(output, study), pytest.raises(StoreError, match="another run is writing"):
        Journal.open(output, study)
    Journal.open(output, study).close()


@pytest.mark.parametrize("change", [{"text": "other: text\n"}, {"overrides": ("mesh.levels=3",)}])
def test_a_journal_of_another_study_is_set_aside_never_deleted(
    output: Path,
    study: Study,
    new_point: Callable[..., PointRecord],
    change: dict[str, object],
) -> None:
    other = replace(study, **change)  # type: ignore[arg-type]
    for n, (old, new) in enumerate(((study, other), (other, study))):
        fill(output, old, [new_point((0, 0, n), 0)])
        with Journal.open(output, new) as journal:
            assert not journal.finished
            (warning,) = journal.warnings
            assert "another study" in warning
            assert ".partial.old" in warning
    names = sorted(os.listdir(output.parent))
    assert names == ["study.nc.partial", "study.nc.partial.old", "study.nc.partial.old2"]
    for name, n in (("study.nc.partial.old", 0), ("study.nc.partial.old2", 1)):
        with sqlite3.connect(output.parent / name) as kept:
            assert kept.execute("SELECT place FROM record WHERE kind = 'block'").fetchall() == [(str(n),)]
        kept.close()


def test_a_journal_of_other_versions_is_set_aside(
    output: Path, study: Study, new_point: Callable[..., PointRecord], monkeypatch: pytest.MonkeyPatch
) -> None:
    fill(output, study, [new_point((0, 0, 0), 0)])
    monkeypatch.setattr(journal_module, "program", lambda: "edited")
    with Journal.open(output, study) as journal:
        assert not journal.finished
        assert "other versions" in journal.warnings[0]


@pytest.mark.parametrize("size", [0, 1, 100, 4096, 9000, -5000])
def test_a_torn_journal_is_set_aside_and_an_empty_one_used(
    output: Path, study: Study, new_point: Callable[..., PointRecord], size: int, lengthened: Callable[..., PointRecord]
) -> None:
    fill(output, study, [lengthened(new_point((0, 0, i), 0), 0, 1000) for i in range(2)])
    torn = partial(output).read_bytes()[:size]
    partial(output).write_bytes(torn)
    with Journal.open(output, study) as journal:
        assert not journal.finished
        assert bool(journal.warnings) == (size != 0)
        journal.add(make_level(0))
        journal.add(new_point((0, 0, 0), 0))
    if size:
        assert partial(output).with_name("study.nc.partial.old").read_bytes() == torn
    with Journal.open(output, study) as journal:
        assert len(journal.finished) == 1
        assert not journal.warnings


def test_no_flipped_byte_is_taken_for_a_result(
    output: Path, study: Study, new_point: Callable[..., PointRecord], lengthened: Callable[..., PointRecord]
) -> None:
    """A damaged byte is either without effect on the records, or noticed; never a wrong number, never a crash."""
    points = [lengthened(new_point((0, 0, i), 0), 0, 300) for i in range(2)]
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
                assert not journal.finished
            else:
                for point, again in zip(points, journal.points(), strict=True):
                    assert_same(point, again)
    assert noticed > 30


def test_a_damaged_index_is_noticed_although_every_record_is_sound(
    output: Path, study: Study, new_point: Callable[..., PointRecord]
) -> None:
    fill(output, study, [new_point((0, 0, 0), 0)])
    database = sqlite3.connect(partial(output))
    (page,) = database.execute("SELECT rootpage FROM sqlite_master WHERE name = 'sqlite_autoindex_record_1'").fetchone()
    (size,) = database.execute("PRAGMA page_size").fetchone()
    database.close()
    damaged = bytearray(partial(output).read_bytes())
    damaged[(page - 1) * size : page * size] = bytes(size)
    partial(output).write_bytes(damaged)
    with Journal.open(output, study) as journal:
        assert "damaged" in journal.warnings[0]


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


_LIMITED = """
import resource, sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from conftest import long, make_level, make_point, make_study
from tcstudy.data.journal import Journal
from tcstudy.data.journal import checksum
from tcstudy.data.files import StoreError
from dataclasses import replace
import numpy as np
journal = Journal.open(Path(sys.argv[1]), make_study())
journal.add(make_level(0))
journal.add(make_point((0, 0, 0), 0))
journal.flush()
soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, hard))
journal.add(long(make_point((0, 0, 1), 0), 0, 10_000))
for _ in range(2):
    try:
        journal.flush()
    except StoreError as error:
        print(error)
if sys.argv[3] == "mended":
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    journal.close()
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="file size limits are a matter of POSIX")
@pytest.mark.parametrize(("end", "kept"), [("mended", 2), ("dead", 1)])
def test_a_full_disk_is_reported_and_costs_no_committed_point(output: Path, study: Study, end: str, kept: int) -> None:
    command = [sys.executable, "-c", _LIMITED, str(output), str(Path(__file__).parent), end]
    environment = {**os.environ, "PYTHONPATH": str(Path(store.__file__).parents[2])}
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, env=environment)
    assert done.stdout.count("cannot keep finished points") == 2, done.stderr
    assert "Free some space" in done.stdout
    with Journal.open(output, study) as journal:
        assert len(journal.finished) == kept
        assert not journal.warnings


def test_the_timers_error_comes_with_the_next_add(
    output: Path, study: Study, new_point: Callable[..., PointRecord], lengthened: Callable[..., PointRecord]
) -> None:
    journal = Journal.open(output, study)
    journal.add(make_level(0))
    journal.add(new_point((0, 0, 0), 0))
    journal._connection.execute("PRAGMA max_page_count = 1")  # SQLite's own full disk
    journal.add(lengthened(new_point((0, 0, 1), 0), 0, 100_000))
    deadline = time.monotonic() + 5
    while journal._error is None and time.monotonic() < deadline:
        time.sleep(0.01)
    with pytest.raises(StoreError, match="cannot keep finished points"):
        journal.add(new_point((0, 1, 0), 0))
    journal._connection.execute("PRAGMA max_page_count = 1000000")
    journal.close()
    with Journal.open(output, study) as journal:
        assert len(journal.finished) == 3


def test_a_closed_journal_takes_nothing(output: Path, study: Study, new_point: Callable[..., PointRecord]) -> None:
    journal = Journal.open(output, study)
    journal.close()
    journal.close()
    with pytest.raises(StoreError, match="is closed"):
        journal.add(new_point((0, 0, 0), 0))


def test_a_place_that_cannot_be_written_is_one_clear_error(tmp_path: Path, study: Study) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match="hoose another output"):
        Journal.open(tmp_path / "file" / "study.nc", study)
    (tmp_path / "study.nc.partial").mkdir()
    with pytest.raises(StoreError, match="hoose another output"):
        Journal.open(tmp_path / "study.nc", study)


def test_axes_that_the_store_would_refuse_are_refused_before_the_work(output: Path, study: Study) -> None:
    bad = replace(study, axes=(replace(study.axes[0], name="xi", path=("xi",)),))
    with pytest.raises(StoreError, match="name of a result"):
        Journal.open(output, bad)


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("scalars", b"\xff\xfe"),
        ("scalars", "[]"),
        ("scalars", '{"index": [9, 9, 9], "level": 0, "status": 1, "reason": "", "numbers": {}}'),
        ("layout", '[["u_T", "<f8", [99]]]'),
        ("arrays", "text"),
        ("place", "text"),
        ("place", "7"),
        ("level", 1),
        ("crc", "text"),
    ],
)
def test_a_record_that_is_none_sets_the_journal_aside(
    output: Path, study: Study, new_point: Callable[..., PointRecord], column: str, value: object
) -> None:
    """Whatever its checksum says: the store would refuse it only after all the work."""
    fill(output, study, [new_point((0, 0, 0), 0)])
    with contextlib.closing(sqlite3.connect(partial(output))) as database:
        database.execute(f"UPDATE record SET {column} = ? WHERE kind = 'block'", (value,))
        found = "SELECT kind, place, level, scalars, layout, arrays, crc FROM record WHERE kind = 'block'"
        row = list(database.execute(found).fetchone())
        if column != "crc":
            with contextlib.suppress(TypeError):
                database.execute("UPDATE record SET crc = ? WHERE kind = 'block'", (checksum(tuple(row)),))
        database.commit()
    with Journal.open(output, study) as journal:
        assert not journal.finished
        assert "is damaged" in journal.warnings[0]
        assert "\n" not in journal.warnings[0]


@pytest.mark.parametrize(
    "change",
    [
        {"u_T": np.zeros((1, 4))},
        {"xi": np.zeros((1, 6))},
        {"sticks": np.zeros((1, 4), dtype=np.int8)},
        {"fields": {"theta": np.zeros((1, 3))}},
        {"status": np.array([99], dtype=np.int8)},
    ],
)
def test_values_that_do_not_fit_the_nodes_of_their_level_set_the_journal_aside(
    output: Path, study: Study, new_point: Callable[..., PointRecord], change: dict[str, object]
) -> None:
    """Whatever their checksum says."""
    fill(output, study, [new_point((0, 0, 0), 0)])
    with Journal.open(output, study) as journal:
        assert len(journal.finished) == 1
        journal.add(replace(next(journal.blocks()), **change))  # type: ignore[arg-type]
    with Journal.open(output, study) as journal:
        assert not journal.finished
        assert "is damaged" in journal.warnings[0]


@pytest.mark.parametrize("lost", ["level", "block"])
def test_values_on_a_level_without_a_record_set_the_journal_aside(
    output: Path, study: Study, new_point: Callable[..., PointRecord], lost: str
) -> None:
    fill(output, study, [new_point((0, 0, 0), 0)])
    with contextlib.closing(sqlite3.connect(partial(output))) as database:
        database.execute("DELETE FROM record WHERE kind = ?", (lost,))
        database.commit()
    with Journal.open(output, study) as journal:
        assert bool(journal.warnings) == (lost == "level")  # points that are lost are solved again


@pytest.mark.skipif(os.name == "nt", reason="pipes and symbolic links of POSIX")
def test_a_journal_is_a_file_wherever_its_link_points(
    output: Path, study: Study, new_point: Callable[..., PointRecord], tmp_path: Path
) -> None:
    output.parent.mkdir()
    partial(output).symlink_to(tmp_path / "far.partial")
    fill(output, study, [new_point((0, 0, 0), 0)])
    assert partial(output).is_symlink()
    with Journal.open(output, study) as journal:
        assert len(journal.finished) == 1
    partial(output).unlink()
    os.mkfifo(partial(output))
    with pytest.raises(StoreError, match="is a pipe, no file"):
        Journal.open(output, study)
