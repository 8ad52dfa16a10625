"""What an existing file is: ours and whole, ours and damaged, changed, or a stranger's."""

import os
import socket
from dataclasses import replace
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray

from tcstudy.data import files as provenance_module
from tcstudy.data.files import (
    StoreError,
    attributes,
    change_of,
    check_writable,
    holds,
    is_foreign,
    reading,
    seal_of,
)
from tcstudy.data.reading import open_results
from tcstudy.scene.study import Study
from tcstudy.study.append import stored_study


def stranger(path: Path, **more: object) -> Path:
    with netCDF4.Dataset(path, "w") as nc:
        nc.setncatts({"title": "my measurements", **more})
        nc.createDimension("t", 3)
        nc.createVariable("v", "f8", ("t",))[:] = 1.0
    return path


@pytest.mark.parametrize("place", [0, 600, -60])
def test_a_flipped_byte_is_told_before_the_library_opens_the_file(
    written: Path, place: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    raw = bytearray(written.read_bytes())
    raw[place] ^= 0x40
    written.write_bytes(raw)
    monkeypatch.setattr(netCDF4, "Dataset", None)
    monkeypatch.setattr(xarray, "open_dataset", None)
    with pytest.raises(StoreError, match=r"damaged \(its checksum is wrong\)"):
        open_results(written)
    assert not is_foreign(written)


def test_a_changed_file_is_read_but_nothing_goes_on_from_it(written: Path, study: Study) -> None:
    """What fails on it is its own fault."""
    assert change_of(written) == ""
    with netCDF4.Dataset(written, "a") as nc:
        nc.setncattr("title", "edited")
    assert seal_of(written) is None
    assert attributes(written)["title"] == "edited"
    assert not is_foreign(written)
    with (
        pytest.raises(StoreError, match=r"was changed after tcstudy wrote it.*KeyError"),
        reading(written),
    ):
        raise KeyError("omega")
    for going_on in (lambda: holds(written, "run", study), lambda: stored_study(written)):
        with pytest.raises(
            StoreError, match="was changed since tcstudy wrote it, and nothing goes on from such a"
        ):
            going_on()


def test_files_of_strangers_are_not_overwritten(tmp_path: Path) -> None:
    mine = stranger(tmp_path / "mine.nc", finished=np.int32(1))
    old = stranger(tmp_path / "old.nc", source="tcstudy 0.1.0", finished=np.int32(1))  # has no seal
    classic, hdf = tmp_path / "classic.nc", tmp_path / "measured.h5"
    classic.write_bytes(b"CDF\x01" + bytes(28))
    hdf.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(2000))
    for file in (mine, classic, hdf):
        assert "exists and is no result file; it would be lost" in check_writable(file, 0)[0]
    assert check_writable(old, 0) == []


@pytest.mark.skipif(os.name == "nt", reason="pipes and sockets of POSIX")
def test_what_is_no_file_is_no_output(tmp_path: Path, study: Study) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to(tmp_path / "pipe")
    (tmp_path / "circle").symlink_to(tmp_path / "circle")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(os.path.relpath(tmp_path / "socket"))
    for name, what in (
        ("pipe", "a pipe"),
        ("link", "a pipe"),
        ("socket", "a socket"),
        ("circle", "oo many levels"),
    ):
        assert what in check_writable(tmp_path / name, 0)[0]
    assert "is a device, no file" in check_writable(Path(os.devnull), 0)[0]
    with pytest.raises(StoreError, match="is no file but a device or a pipe"):
        attributes(tmp_path / "pipe")


def test_a_file_holds_one_study_of_one_program(
    written: Path, study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert holds(written, "run", study)
    assert not holds(tmp_path / "none.nc", "run", study)
    for kind, one, asked, what in (
        (
            "run",
            replace(study, overrides=()),
            {},
            "another study, or of this one with other values",
        ),
        ("path", study, {}, r"another command \(run\)"),
        ("run", study, {"runs": 3}, "another --at"),
    ):
        with pytest.raises(
            StoreError, match=f"holds .*{what}.*; give another --output, or --force"
        ):
            holds(written, kind, one, **asked)  # type: ignore[arg-type]
    with monkeypatch.context() as patch:
        patch.setattr(provenance_module, "program", lambda: "edited")
        with pytest.raises(StoreError, match=r"another version of the program"):
            holds(written, "run", study)
    written.write_bytes(written.read_bytes().replace(b"sweep", b"swept", 1))
    with pytest.raises(StoreError, match=r"checksum is wrong.*--force"):
        holds(written, "run", study)
