"""A result file is complete or not there: full disks, interrupts, readers, permissions."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import netCDF4
import pytest

from tcstudy.data import files, store
from tcstudy.data.files import StoreError, check_writable
from tcstudy.data.reading import open_results
from tcstudy.data.records import BlockRecord, LevelRecord
from tcstudy.scene.study import Study
from tests.data.by_points import write
from tests.data.conftest import make_block

pytestmark = pytest.mark.filterwarnings("error")


@pytest.mark.parametrize("step", ["fsync", "replace", "records"])
def test_a_full_disk_or_an_interrupt_leaves_the_old_file(
    written: Path,
    study: Study,
    levels: tuple[LevelRecord, ...],
    step: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before = written.read_bytes()

    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    def records() -> Iterator[BlockRecord]:
        yield make_block(0)
        if step == "records":
            raise KeyboardInterrupt

    if step != "records":
        monkeypatch.setattr(os, step, fail)
    kind, said = (
        (KeyboardInterrupt, None)
        if step == "records"
        else (StoreError, "No space left.*Free some space")
    )
    with pytest.raises(kind, match=said):
        store.write(written, store.Results(study, lambda: levels, records))
    assert written.read_bytes() == before
    assert os.listdir(written.parent) == [written.name]


_LIMITED = """
import resource, sys
from pathlib import Path
from tests.data.conftest import make_block, make_level, make_study
from tcstudy.data.files import StoreError
from tests.data.by_points import write
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), int(sys.argv[2])))
try:
    write(Path(sys.argv[1]), make_study(), [make_level(0), make_level(1)], [make_block(0)])
except StoreError as error:
    print(error)
    sys.exit(3)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="file size limits are a matter of POSIX")
@pytest.mark.parametrize("limit", [1, 20_000])
def test_a_disk_that_fills_while_netcdf_writes_leaves_the_old_file(
    written: Path, limit: int
) -> None:
    before = written.read_bytes()
    assert len(before) > limit
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    command = [sys.executable, "-c", _LIMITED, str(written), str(limit)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, env=environment)
    assert (done.returncode, done.stderr) == (3, "")
    assert re.search("cannot write.*space", done.stdout)
    assert written.read_bytes() == before
    assert os.listdir(written.parent) == [written.name]


def test_a_write_protected_file_is_not_replaced(written: Path, study: Study) -> None:
    written.chmod(0o444)
    assert any("write-protected" in problem for problem in check_writable(written, 0))
    before = written.read_bytes()
    with pytest.raises(StoreError, match="write-protected"):
        write(written, study, [], [])
    assert written.read_bytes() == before


def test_check_writable_finds_what_is_wrong_and_leaves_nothing(
    output: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert check_writable(output, 1000) == []
    assert os.listdir(tmp_path) == []
    (tmp_path / "file").touch()
    names = {
        "": "is a directory",
        "file/deep/study.nc": "is a file",
        "a\0b": "null",
        "b\udcff.nc": "utf-8",
    }
    for name, part in {**names, "x" * 245 + ".nc": "has a part of 248 bytes"}.items():
        [problem] = check_writable(tmp_path / name, 1)
        assert part in problem
        assert problem.isprintable()
        problem.encode()
    monkeypatch.setattr(files.shutil, "disk_usage", lambda _: SimpleNamespace(free=3_000_000))
    assert check_writable(output, 1_000_000) == []
    assert "3 MB free, but the results need 3.3 MB" in check_writable(output, 1_100_000)[0]


def test_files_that_are_no_finished_results_are_refused(tmp_path: Path, written: Path) -> None:
    (tmp_path / "run.nc.partial").touch()
    (tmp_path / "short.nc").write_bytes(written.read_bytes()[:-1000])
    with netCDF4.Dataset(
        tmp_path / "midway.nc", "w"
    ) as nc:  # what a dead writer leaves opens without an error
        nc.title = "midway"
    told = {
        "none": "there is no file",
        "run": "has not finished.*resume",
        "short": "cut short",
        "midway": "unfinished",
    }
    for name, why in told.items():
        with pytest.raises(StoreError, match=why):
            open_results(tmp_path / f"{name}.nc")


def test_what_killed_writers_left_goes_and_what_others_write_stays(
    output: Path, study: Study
) -> None:
    host = files.aside_of(output).name.split(".")[-2].partition("-")[0]
    output.parent.mkdir()
    dead, at_work = f".{output.name}.{host}-7.tmp", f".{output.name}.00000000-7.tmp"
    others = [f".{output.name}.excess.nc.{host}-7.tmp", f"{output.name}.7.tmp"]
    for name in (dead, at_work, *others):
        (output.parent / name).touch()
        if name != at_work:
            os.utime(output.parent / name, (0.0, 0.0))
    write(output, study, [], [])
    assert sorted(os.listdir(output.parent)) == sorted([output.name, at_work, *others])
    files.remove_stale(output, has_lock=True)
    assert sorted(os.listdir(output.parent)) == sorted([output.name, *others])
