"""Files that are complete or not there at all, whatever stands in them.

A file is written aside in the same directory, brought to the disk (fsync) and renamed over the old one, so that
a crash, a full disk or a power cut leaves the old file as it was, and a reader of the old file keeps it.
"""

from __future__ import annotations

import errno
import os
import platform
import re
import shutil
import stat
import tempfile
import time
import zlib
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tcstudy.data.reading import FINISHED, is_foreign, put_seal
from tcstudy.errors import StoreError, printable, shortened

if TYPE_CHECKING:
    import netCDF4

LONGEST_NAME = 255 - 32
"""Bytes of a name, such that the names of files written beside the output remain below the 255 of file systems."""

ROOM = 3
"""Free disk that must be there, as a multiple of the expected file (old and new stand side by side)."""

STALE = 3600.0
"""Seconds without a byte more after which nobody is at work on a file."""

PROTECTED = "the file is write-protected"


def replace_file(path: Path, make: Callable[[Path], object], kept: str = "", sealed: bool = True) -> None:
    """Put the file that `make` writes aside in the place of `path`, in one step and on the disk.

    kept:   what of the work is not lost if that fails, for the message
    sealed: whether it is a result file, which ends in a seal
    Raises StoreError if the file cannot be written; the old one is then untouched.
    """
    target, aside = Path(os.path.realpath(path)), aside_of(path)
    try:
        if what := special_file(path):
            raise StoreError(f"{path} is {what}, no file; choose another output")
        if _protected(path):
            raise PermissionError(errno.EACCES, PROTECTED, str(path))
        target.parent.mkdir(parents=True, exist_ok=True)
        make(aside)
        if sealed:
            put_seal(aside)
        with open(aside, "rb+") as stream:
            os.fsync(stream.fileno())
        if target.exists():
            shutil.copymode(target, aside)
        os.replace(aside, target)
        sync_directory(target.parent)
    except (OSError, RuntimeError) as error:  # netCDF4 reports a full disk as RuntimeError
        raise StoreError(f"cannot write {path}: {_cause(error)}. {_remedy(error, target.parent, kept)}") from error
    finally:
        with suppress(OSError):
            aside.unlink(missing_ok=True)


def aside_of(path: Path) -> Path:
    """Where this process writes the file that is to take the place of `path`."""
    target = Path(os.path.realpath(path))
    host = f"{zlib.crc32(platform.node().encode()):08x}"  # processes of several machines may have one number
    return target.with_name(f".{target.name}.{host}-{os.getpid()}.tmp")


def check_writable(path: Path, expected_bytes: int | None = None) -> list[str]:
    """Why `path` could not take a result file of this size, None for any other file; empty if it can.

    Leaves nothing behind.
    """
    try:
        return _place_faults(path) or ([] if expected_bytes is None else _result_faults(path, expected_bytes))
    except OSError as error:
        return [f"cannot look at {path}: {_cause(error)}; choose another output"]


def _existing(target: Path) -> Path:
    """The innermost part of the way to a file that is there."""
    return next(p for p in target.parents if p.exists())


def _result_faults(path: Path, expected_bytes: int) -> list[str]:
    problems, target = [], Path(os.path.realpath(path))
    if is_foreign(target):
        problems.append(f"{path} exists and is no result file; it would be lost: remove it or choose another output")
    existing = _existing(target)
    free = shutil.disk_usage(existing).free
    if free < ROOM * expected_bytes:
        problems.append(
            f"{existing} has {_size(free)} free, but the results need {_size(ROOM * expected_bytes)} while they "
            "are written; free some space, choose another output or ask for less (fields: false, fewer levels)"
        )
    return problems


def _place_faults(path: Path) -> list[str]:
    if fault := _name_fault(path):
        return [fault]
    target = Path(os.path.realpath(path))
    if target.is_dir():
        return [f"{path} is a directory; give the name of a file in it"]
    if what := special_file(path):
        return [f"{path} is {what}, no file; choose another output"]
    problems = [f"{path}: {PROTECTED}; make it writable or choose another output"] if _protected(path) else []
    existing = _existing(target)
    if not existing.is_dir():
        return [*problems, f"{existing} is a file, so {path} cannot be made; choose another output"]
    try:
        with tempfile.TemporaryFile(dir=existing):
            pass
    except OSError as error:
        return [*problems, f"cannot write in the directory {existing}: {_cause(error)}; choose another output"]
    return problems


def _name_fault(path: Path) -> str:
    """Why no file can have this name, or why none beside it can have the longer names of what is written aside."""
    shown = printable(str(path))
    if path.name in ("", ".."):
        return f"{shown} is a directory; give the name of a file in it"
    if shown.startswith("~"):  # netCDF would write to the home directory, other libraries beside the study
        return f"{shown} begins with ~, which only a shell knows as a home directory; write the directory out"
    if "\0" in str(path):
        return f"{shown} has a NUL character, as no file name can; choose another output"
    try:
        longest = max(len(part.encode()) for part in path.parts)
    except UnicodeEncodeError:
        return f"{shown} is no UTF-8 text, as netCDF needs it; choose another output"
    if longest > LONGEST_NAME:
        what = f"has a part of {longest} bytes; names of results may have {LONGEST_NAME}"
        return f"{shortened(shown)} {what}; choose a shorter output"
    return ""


def special_file(path: Path) -> str:
    """What stands at a path if it is neither a file nor a folder: "a device", …; empty otherwise.

    Raises OSError where symbolic links go in a circle.
    """
    try:
        mode = os.stat(path).st_mode
    except (FileNotFoundError, NotADirectoryError):
        return ""
    kinds = {stat.S_ISFIFO: "a pipe", stat.S_ISSOCK: "a socket", stat.S_ISCHR: "a device", stat.S_ISBLK: "a device"}
    return next((name for is_kind, name in kinds.items() if is_kind(mode)), "")


def remove_stale(path: Path, alone: bool = False) -> None:
    """Remove what killed writers of `path` left aside: what has not grown for STALE seconds, or, for the holder of the
    lock of `path`, all of it."""
    target = Path(os.path.realpath(path))
    left = re.compile(rf"\.{re.escape(target.name)}\.[0-9a-f]{{8}}-[0-9]{{1,10}}\.tmp")
    for name in os.listdir(target.parent) if target.parent.is_dir() else ():
        stale = target.with_name(name)
        with suppress(OSError):
            if left.fullmatch(name) and (alone or time.time() - stale.stat().st_mtime > STALE):
                stale.unlink()


def sync_directory(directory: Path) -> None:
    """Bring a directory's entries to the disk, where the system can."""
    if os.name == "nt":
        return
    descriptor = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # some network file systems know no such thing
            raise
    finally:
        os.close(descriptor)


def new_dataset(file: Path) -> netCDF4.Dataset:
    """A new netCDF-4 file, open for writing; raises OSError."""
    import netCDF4

    file.touch()  # a directory without permission is told here; below, netCDF4 says "permission" of a full disk, too
    try:
        return netCDF4.Dataset(file, "w", format="NETCDF4")
    except OSError as error:
        raise OSError(errno.EIO, "the netCDF library cannot make the file") from error


def write_dataset(
    path: Path, attributes: Mapping[str, Any], fill: Callable[[netCDF4.Dataset], None], kept: str = ""
) -> None:
    """Write a result file, replacing an old one in one step: its global attributes, then what `fill` puts into it.

    kept: as in `replace_file`
    Raises StoreError if it cannot be written; the old one is then untouched.
    """

    def make(aside: Path) -> None:
        with new_dataset(aside) as nc:
            nc.setncatts(attributes)
            fill(nc)
            nc.setncattr(FINISHED, np.int32(1))

    remove_stale(path)
    replace_file(path, make, kept)


def _protected(path: Path) -> bool:
    # by the mode, not by os.access: renaming over a file needs no right to write it, and root may do anything
    return path.exists() and not path.stat().st_mode & 0o222


def _cause(error: Exception) -> str:
    return (error.strerror if isinstance(error, OSError) else None) or str(error)


def _remedy(error: Exception, directory: Path, kept: str) -> str:
    """What the user can do; a netCDF error has no errno, so the disk itself is asked."""
    remedy = "Choose another output"
    if isinstance(error, OSError) and error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        remedy = "Make the place writable or choose another output"
    else:
        with suppress(OSError):
            free = _size(shutil.disk_usage(directory).free)
            remedy = f"Free some space ({free} left; a quota may be lower) or choose another output"
    return f"{remedy}; {kept}" if kept else remedy


def _size(number: float) -> str:
    for unit in ("B", "kB", "MB", "GB"):
        if number < 1000:
            return f"{number:.3g} {unit}"
        number /= 1000
    return f"{number:.3g} TB"
