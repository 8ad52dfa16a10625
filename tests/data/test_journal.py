"""The journal: what was committed survives whatever happens to the process."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tcstudy.data import store
from tcstudy.data.files import StoreError
from tcstudy.data.records import LevelRecord, PointStatus
from tcstudy.scene.study import Study
from tests.data.by_points import PointJournal as Journal
from tests.data.by_points import PointRecord
from tests.data.conftest import failed, long, make_level, make_point

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


def test_records_come_back_exactly(output: Path, study: Study) -> None:
    levels = [make_level(n, fields=True) for n in range(2)]
    odd = {"energy": 0.1 + 0.2, "omega": float("inf"), "lambda_1": 5e-324, "iterations": 7}
    points = [
        make_point((1, 0, 1), 1, fields=True),
        replace(make_point((0, 2, 1), 0), numbers=odd),
        replace(
            make_point((0, 0, 1), 0),
            status=PointStatus.ERROR,
            reason="ü\n'",
            u_T=np.empty(0),
            xi=np.empty(0),
            sticks=np.empty(0, dtype=np.int8),
        ),
    ]
    with Journal.open(output, study) as journal:
        assert not [*journal.blocks()]
        assert journal.warnings == ()
        for record in (*reversed(levels), *points):
            journal.add(record)
    with Journal.open(output, study) as journal:
        assert journal.warnings == ()
        assert statuses(journal) == {(p.index, p.level): p.status for p in points}
        for record, again in zip((*levels, *points), (*journal.levels(), *journal.points()), strict=True):
            assert_same(record, again)


def test_a_second_record_of_a_point_replaces_the_first(output: Path, study: Study) -> None:
    fill(
        output,
        study,
        [failed((0, 0, 0), 0, "crashed"), make_point((0, 0, 0), 1), make_point((0, 0, 0), 0)],
    )
    with Journal.open(output, study) as journal:
        assert statuses(journal) == {((0, 0, 0), 0): PointStatus.OK, ((0, 0, 0), 1): PointStatus.OK}


def statuses(journal: Journal) -> dict[tuple[tuple[int, ...], int], PointStatus]:
    """What an earlier run left, by (index, level)."""
    return {(p.index, p.level): p.status for p in journal.points()}


_WRITER = """
import sys, time
from pathlib import Path
sys.path.insert(0, str(Path(sys.argv[2]).parents[1]))
from tests.data.conftest import long, make_level, make_point, make_study
from tests.data.by_points import PointJournal as Journal
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
    output: Path, study: Study, start: Callable[[str], subprocess.Popen[str]], seen: int
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
            assert_same(point, long(make_point(index, 0), n))
        assert_same(journal.levels()[0], make_level(0))
        journal.add(make_point((1, 2, 1), 0))


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
        assert len([*journal.blocks()]) == 12


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


_LIMITED = """
import resource, sys
from pathlib import Path
sys.path.insert(0, str(Path(sys.argv[2]).parents[1]))
from tests.data.conftest import long, make_level, make_point, make_study
from tests.data.by_points import PointJournal as Journal
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
        assert len([*journal.blocks()]) == kept
        assert not journal.warnings


def test_a_place_that_cannot_be_written_is_one_clear_error(tmp_path: Path, study: Study) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match="hoose another output"):
        Journal.open(tmp_path / "file" / "study.nc", study)
    (tmp_path / "study.nc.partial").mkdir()
    with pytest.raises(StoreError, match="hoose another output"):
        Journal.open(tmp_path / "study.nc", study)
