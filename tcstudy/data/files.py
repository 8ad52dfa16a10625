"""Files that are complete or not there at all, whatever stands in them; and what an existing one is.

A file is written aside in the same directory, brought to the disk (fsync) and renamed over the old one, so that
a crash, a full disk or a power cut leaves the old file as it was, and a reader of the old file keeps it.

A result file ends in a seal, a SHA-256 of all bytes before it, which tells without the netCDF library that tcstudy
wrote the file and that no byte has changed since. It ignores what follows the end that a file states; a program that
changes the file cuts the seal off. A file whose seal is broken is refused; one without a seal is read, which is told,
and what fails on it is the file's fault, told in one line.
"""

from __future__ import annotations

import errno
import hashlib
import os
import platform
import re
import shutil
import stat
import tempfile
import time
import warnings
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from tcstudy.errors import StoreError, printable, shortened, tell

if TYPE_CHECKING:
    import netCDF4


class Unreadable(Exception):
    """The file cannot be read; the text says why."""


_MARK = b"\ntcstudy result, sha256 "
_LENGTH = len(_MARK) + 64 + 1
_BLOCK = 1 << 20


def put_seal(file: Path) -> None:
    """Seal a finished file. Raises OSError."""
    with open(file, "rb+") as stream:
        digest = _digest(stream, os.fstat(stream.fileno()).st_size)
        stream.seek(0, os.SEEK_END)
        stream.write(_MARK + digest + b"\n")


def seal_of(file: Path) -> bool | None:
    """Whether a file is as it was written; None if it has no seal: changed, cut, or a stranger's. Raises OSError."""
    now = file.stat()
    return _seal_of(os.path.realpath(file), now.st_size, now.st_ino, now.st_mtime_ns)


@lru_cache(maxsize=16)
def _seal_of(file: str, size: int, *_stamp: int) -> bool | None:
    """Computed once while the file stays as it is: one command opens it several times."""
    with open(file, "rb") as stream:
        stream.seek(max(0, size - _LENGTH))
        end = stream.read(_LENGTH)
        if not (end.startswith(_MARK) and end.endswith(b"\n")):
            return None
        stream.seek(0)
        return _digest(stream, size - _LENGTH) == end[len(_MARK) : -1]


def _digest(stream: BinaryIO, length: int) -> bytes:
    """SHA-256 of the first bytes of a stream, in hexadecimal digits."""
    digest = hashlib.sha256()
    while length > 0 and (block := stream.read(min(_BLOCK, length))):
        digest.update(block)
        length -= len(block)
    return digest.hexdigest().encode()


ANEW = "Run the study again with --force to make it anew"
FINISHED = "finished"
"""Global attribute set last: netCDF-4 opens a file whose writer died as if nothing were wrong."""
PARTIAL = ".partial"
"""What the journal of a run adds to the name of its output."""
_MAGIC = (b"\x89HDF\r\n\x1a\n", b"CDF")
"""How netCDF-4 and older netCDF files begin."""
_FAULTS = (LookupError, ValueError, TypeError, AttributeError, ArithmeticError, OSError, RuntimeError, Warning)
"""What reading and drawing values that do not fit together may raise."""


def is_foreign(file: Path) -> bool:
    """Whether there is a file that does not say it is a result of tcstudy; an empty one is no loss. Raises OSError."""
    if not file.is_file() or not file.stat().st_size or seal_of(file) is not None:
        return False
    try:
        return not _says_ours(_attributes(file))
    except Unreadable:
        return True


def attributes(path: Path) -> dict[str, Any]:
    """The global attributes of a complete result file. Raises StoreError if it is none, or damaged."""
    if path.is_dir():
        raise StoreError(f"{path} is a directory; name a file in it")
    if not path.exists():
        if path.with_name(path.name + PARTIAL).exists():
            raise StoreError(f"{path} is not there yet: its run has not finished. Run the study again to resume it")
        raise StoreError(f"there is no file {path}. Run the study first, or check the name")
    if not path.is_file():
        raise StoreError(f"{path} is no file but a device or a pipe; name a result file")
    if path.suffix in (".yaml", ".yml"):
        raise StoreError(f"{path} is a study and not its results; name the .nc file that its run wrote")
    try:
        found = _attributes(path)
    except Unreadable as error:
        raise StoreError(f"{path} is no netCDF file or is cut short or damaged ({error}). {ANEW}") from error
    except (OSError, RuntimeError) as error:
        raise StoreError(f"cannot read {path}: {getattr(error, 'strerror', None) or error}") from error
    if not _says_ours(found):
        raise StoreError(f"{path} is unfinished (its writer stopped midway) or not made by tcstudy. {ANEW}")
    return found


def _attributes(path: Path) -> dict[str, Any]:
    if (seal := seal_of(path)) is False:
        raise Unreadable("its checksum is wrong")
    with open(path, "rb") as stream:
        if not stream.read(8).startswith(_MAGIC):
            raise Unreadable("it does not begin like one")
    import netCDF4

    try:
        with netCDF4.Dataset(path) as nc:
            values = {name: nc.getncattr(name) for name in nc.ncattrs()}
    except (OSError, RuntimeError) as error:
        if seal:
            raise
        raise Unreadable(getattr(error, "strerror", None) or str(error)) from error
    return {name: value.tolist() if hasattr(value, "tolist") else value for name, value in values.items()}


def change_of(path: Path) -> str:
    """That another program has changed a result file since tcstudy wrote it; empty if none has.

    Raises StoreError if it is no result file.
    """
    attributes(path)
    return "" if seal_of(path) else f"{path} was changed since tcstudy wrote it"


def refuse_changed(path: Path) -> None:
    """Raise StoreError for a file that another program has changed: nothing goes on from it."""
    if change := change_of(path):
        raise StoreError(f"{change}, and nothing goes on from such a file. {ANEW}")


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """For the time of a `with` that reads a result file: raises StoreError if the file is none, or if something fails
    on one that has changed since tcstudy wrote it, which is told. What fails on a whole file passes as it is."""
    if not (change := change_of(path)):
        yield
        return
    tell([change])
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        try:
            yield
        except _FAULTS as error:
            cause = f"{type(error).__name__}: {(str(error).splitlines() or [''])[0]}"
            raise StoreError(
                f"{path} was changed after tcstudy wrote it and does not hold what it should ({cause}). {ANEW}"
            ) from error


def _says_ours(found: dict[str, Any]) -> bool:
    return FINISHED in found and str(found.get("source", "")).startswith("tcstudy")


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
        remedy = f"Free some space, make the place writable or choose another output{'; ' * bool(kept)}{kept}"
        raise StoreError(f"cannot write {path}: {_cause(error)}. {remedy}") from error
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
        fault = _fault(path, expected_bytes)
    except (OSError, ValueError) as error:  # no UTF-8 text, as netCDF needs it, or a NUL character
        fault = f"cannot look at {printable(str(path))}: {_cause(error)}; choose another output"
    return [fault] if fault else []


def _fault(path: Path, expected_bytes: int | None) -> str:
    if (longest := max(len(part.encode()) for part in (*path.parts, ""))) > LONGEST_NAME:  # names aside are longer
        what = f"has a part of {longest} bytes; names of results may have {LONGEST_NAME}"
        return f"{shortened(printable(str(path)))} {what}; choose a shorter output"
    target = Path(os.path.realpath(path))
    existing = next(p for p in target.parents if p.exists())
    if path.name in ("", "..") or target.is_dir():
        return f"{path} is a directory; give the name of a file in it"
    if str(path).startswith("~"):  # netCDF would write to the home directory, other libraries beside the study
        return f"{path} begins with ~, which only a shell knows as a home directory; write the directory out"
    if what := special_file(path):
        return f"{path} is {what}, no file; choose another output"
    if not existing.is_dir():
        return f"{existing} is a file, so {path} cannot be made; choose another output"
    if _protected(path):
        return f"{path}: {PROTECTED}; make it writable or choose another output"
    try:
        tempfile.TemporaryFile(dir=existing).close()
    except OSError as error:
        return f"cannot write in the directory {existing}: {_cause(error)}; choose another output"
    if expected_bytes is None:
        return ""
    if is_foreign(target):
        return f"{path} exists and is no result file; it would be lost: remove it or choose another output"
    free, needed = (f"{number / 1e6:.3g} MB" for number in (shutil.disk_usage(existing).free, ROOM * expected_bytes))
    if shutil.disk_usage(existing).free < ROOM * expected_bytes:
        remedy = "free some space, choose another output or ask for less (fields: false, fewer levels)"
        return f"{existing} has {free} free, but the results need {needed} while they are written; {remedy}"
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


def write_dataset(
    path: Path, attributes: Mapping[str, Any], fill: Callable[[netCDF4.Dataset], None], kept: str = ""
) -> None:
    """Write a result file, replacing an old one in one step: its global attributes, then what `fill` puts into it.

    kept: as in `replace_file`
    Raises StoreError if it cannot be written; the old one is then untouched.
    """

    import netCDF4

    def make(aside: Path) -> None:
        aside.touch()  # which tells of a directory without permission; netCDF4 says that of a full disk, too
        try:
            nc = netCDF4.Dataset(aside, "w", format="NETCDF4")
        except OSError as error:
            raise OSError(errno.EIO, "the netCDF library cannot make the file") from error
        with nc:
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
