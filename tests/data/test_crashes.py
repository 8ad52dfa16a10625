"""Two writers, kills and damage at every step of a command, as the tests of SQLite try them."""

import os
import random
import signal
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import netCDF4
import numpy as np
import pytest

from tests.data.steps import Server
from tests.data.test_damage import STUDY, SWEEPS

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="forks processes")

QUIET = ["-q", "--jobs", "1"]
APPEND_A = ["run", "a.yaml", "--append", *QUIET, "-o", "old.nc"]
APPEND_B = ["run", "b.yaml", "--append", *QUIET, "-o", "old.nc"]
FORCE_C = ["run", "c.yaml", "--force", *QUIET, "-o", "old.nc"]
TABLES = 6000
"""Bytes at the begin of a small file that hold the tables of HDF5."""


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    server = Server()
    yield server
    server.close()


@pytest.fixture(scope="module")
def old(server: Server, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The results of one point of the body that all studies but c have."""
    folder = tmp_path_factory.mktemp("old")
    _put_inputs(folder)
    assert server.run(folder, ["run", "old.yaml", *QUIET, "-o", "old.nc"]).code == 0
    return (folder / "old.nc").read_bytes()


def _put_inputs(folder: Path, old: bytes = b"") -> Path:
    """Put the studies, and the results of one, into a folder that is made where it is not there."""
    folder.mkdir(exist_ok=True)
    for name, sweep in SWEEPS.items():
        stiffer = STUDY.replace("5 MPa", "50 MPa") if name == "c" else STUDY
        (folder / f"{name}.yaml").write_text(f"{stiffer}sweep: {{theta_bar: {sweep}}}\n")
    (folder / "levels.yaml").write_text(STUDY.replace("levels: 1", "levels: 3"))
    if old:
        (folder / "old.nc").write_bytes(old)
    return folder


def _places(steps: list[str]) -> list[int]:
    """Return the numbers of steps but those that look at the folder or repeat the step before."""
    is_new = [step != before for before, step in pairwise(["", *steps])]
    return [i for i, step in enumerate(steps) if is_new[i] and not step.endswith(" .")]


Contents = tuple[str, dict[str, str]]


def _contents(file: Path) -> Contents:
    """Return study and values of a result file as text, without the times that the work took."""
    with netCDF4.Dataset(file) as nc:
        names = [name for name in nc.variables if not name.startswith("time_")]
        values = {name: str(np.asarray(nc[name][...]).tolist()) for name in names}
        return nc.getncattr("study_yaml"), values


@pytest.mark.parametrize("second", [APPEND_B, FORCE_C])
def test_a_second_writer_at_any_step_leaves_what_an_order_of_both_leaves(
    server: Server, old: bytes, tmp_path: Path, second: list[str]
) -> None:
    """Where one of both refuses, the file is what the other one alone leaves."""
    folder = _put_inputs(tmp_path)

    def file_after(*order: list[str]) -> Contents:
        (folder / "old.nc").write_bytes(old)
        for words in order:
            assert server.run(folder, words).code in (0, 2)
        return _contents(folder / "old.nc")

    first_alone, second_alone = file_after(APPEND_A), file_after(second)
    both, swapped = file_after(APPEND_A, second), file_after(second, APPEND_A)
    allowed = {
        (0, 0): [both, swapped],
        (0, 2): [first_alone],
        # refused before its work, or when it reads what the second one has replaced
        (2, 0): [second_alone, both],
    }
    (folder / "old.nc").write_bytes(old)
    places = _places(server.run(folder, APPEND_A).steps)
    files = set(os.listdir(folder))
    seen = set()
    for at in places:
        (folder / "old.nc").write_bytes(old)
        outcome = server.run(folder, APPEND_A, at, second)
        codes = outcome.code, outcome.second
        assert codes in allowed, (outcome.steps[at], outcome.stderr)
        assert _contents(folder / "old.nc") in allowed[codes], outcome.steps[at]
        assert set(os.listdir(folder)) == files, outcome.steps[at]
        seen.add(codes)
    assert len(seen) > 1  # some steps are before the lock is taken, some after


@pytest.mark.parametrize(
    ("words", "output"),
    [
        (["run", "a.yaml", *QUIET, "-o", "new.nc"], "new.nc"),
        (["converge", "levels.yaml", "-q", "-o", "new.nc"], "new.nc"),
        (["report", "old.nc", "-o", "page.html"], "page.html"),
    ],
)
def test_after_a_kill_at_any_step_the_same_command_leaves_inputs_and_outputs_only(
    server: Server, old: bytes, tmp_path: Path, words: list[str], output: str
) -> None:
    whole = _put_inputs(tmp_path / "whole", old)
    places = _places(server.run(whole, words).steps)
    assert len(places) > 4
    folder = _put_inputs(tmp_path / "killed", old)
    for at in places:
        (folder / output).unlink(missing_ok=True)
        outcome = server.run(folder, words, at)
        assert outcome.code == -signal.SIGKILL
        left = set(os.listdir(folder)) - set(os.listdir(whole))
        known = (f"{output}.partial", f".{output}.")  # the journal and the file aside
        assert not {name for name in left if not name.startswith(known)}, outcome.steps[at]
        if words[0] != "run" and at != places[-1]:  # the next kill finds what this one left
            continue
        assert server.run(folder, words).code == 0, outcome.steps[at]
        assert set(os.listdir(folder)) == set(os.listdir(whole)), outcome.steps[at]
        if output.endswith(".nc"):
            assert _contents(folder / output) == _contents(whole / output), outcome.steps[at]


def test_damaged_files_without_a_seal_are_read_or_refused_in_one_line(
    server: Server, old: bytes, tmp_path: Path
) -> None:
    """The end is cut; or, where the tables of HDF5 stand, bytes are zeroed or a bit is flipped.

    The server ends a process that reads without end, as HDF5 itself does with some of them.
    """
    chance = random.Random(2)
    whole = old[: old.rindex(b"\ntcstudy result")]
    kinds = ("cut", "zeroed", "flipped", "cut") * 3
    codes = []
    for kind in kinds:
        damaged = bytearray(whole)
        place = chance.randrange(len(whole) if kind == "cut" else TABLES)
        if kind == "cut":
            del damaged[place:]
        elif kind == "zeroed":
            damaged[place : place + 64] = bytes(64)
        else:
            damaged[place] ^= 1 << chance.randrange(8)
        (tmp_path / "damaged.nc").write_bytes(damaged)
        outcome = server.run(tmp_path, ["show", "damaged.nc"])
        assert outcome.code in ((2,) if kind == "cut" else (0, 2)), (kind, place, outcome.stderr)
        codes.append(outcome.code)
    assert codes.count(2) > kinds.count("cut")
