"""Files that are complete or not there at all; what an existing one is, and where it comes from.

A file is written aside in the same directory, brought to the disk (fsync) and renamed over the old
one, so that a crash, a full disk or a power cut leaves the old file as it was, and a reader of the
old file keeps it.

A result file ends in a seal, a SHA-256 checksum of all bytes before it. The seal shows without the
netCDF library that tcstudy wrote the file and that no byte has changed since. The netCDF library
ignores what follows the end that a file states. A program that changes the file cuts the seal off.
A file whose seal is broken is refused. One without a seal is read, with a warning.

Its global attributes are the study's text, command, versions and commit. They show which command
wrote the file and which results it holds, so that no study overwrites another or is computed twice.
Nothing of a machine is recorded: absolute paths are cut to the file name. Warnings about a result
are issued when it is computed, stored in the file, and issued again by its readers.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import platform
import re
import shlex
import shutil
import stat
import subprocess
import tempfile
import time
import warnings
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import cache, lru_cache
from importlib import metadata
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import TYPE_CHECKING, Any, BinaryIO, Literal, get_args

import numpy as np

from tcstudy.data.inspection import damage_of
from tcstudy.errors import StoreError, UserFault, printable, shortened, tell
from tcstudy.scene.study import Study, shell_name

if TYPE_CHECKING:
    import netCDF4


class Unreadable(Exception):
    """The file cannot be read; the text says why."""


_SEAL_MARK = b"\ntcstudy result, sha256 "
_SEAL_LENGTH = len(_SEAL_MARK) + 64 + 1
_READ_BYTES = 1 << 20


def put_seal(file: Path) -> None:
    """Append the seal to a file."""
    with open(file, "rb+") as stream:
        digest = _digest(stream, os.fstat(stream.fileno()).st_size)
        stream.seek(0, os.SEEK_END)
        stream.write(_SEAL_MARK + digest + b"\n")


def seal_of(file: Path) -> bool | None:
    """Return whether a file is as it was written; None if it has no seal.

    A file without a seal was changed, is cut short, or was written by another program.
    Raises OSError.
    """
    status = file.stat()
    return _seal_of(os.path.realpath(file), status.st_size, status.st_ino, status.st_mtime_ns)


@lru_cache(maxsize=16)
def _seal_of(file: str, size: int, *_stamp: int) -> bool | None:
    """Return `seal_of` a file, computed once while it stays as it is: a command opens it often."""
    with open(file, "rb") as stream:
        stream.seek(max(0, size - _SEAL_LENGTH))
        seal = stream.read(_SEAL_LENGTH)
        if not (seal.startswith(_SEAL_MARK) and seal.endswith(b"\n")):
            return None
        stream.seek(0)
        return _digest(stream, size - _SEAL_LENGTH) == seal[len(_SEAL_MARK) : -1]


def _digest(stream: BinaryIO, length: int) -> bytes:
    """Return the SHA-256 checksum of the next `length` bytes of a stream, in hexadecimal digits."""
    digest = hashlib.sha256()
    while length > 0 and (block := stream.read(min(_READ_BYTES, length))):
        digest.update(block)
        length -= len(block)
    return digest.hexdigest().encode()


ANEW = "Run the study again with --force to replace it"
AWAY = "Remove it and run the study again"
"""Remedies for a damaged file: --force replaces only what is known to be a result."""
FINISHED = "finished"
"""Global attribute set last: netCDF-4 opens a file whose writer died as if nothing were wrong."""
PARTIAL = ".partial"
"""Suffix that the journal of a run adds to the name of its output."""
_MAGIC = (b"\x89HDF\r\n\x1a\n", b"CDF")
"""First bytes of netCDF-4 files and of older netCDF files."""
_MISFITS = (LookupError, ValueError, TypeError, AttributeError, ArithmeticError, RuntimeError)
"""Exceptions that reading and drawing may raise if values do not fit together."""


@dataclass(frozen=True)
class Snapshot:
    """The file that stood at a path at some moment.

    identity: size [byte], inode number, time of the last change [ns]; None where there was no file
    """

    path: Path
    identity: tuple[int, int, int] | None

    @classmethod
    def of(cls, path: Path) -> Snapshot:
        """Return the snapshot of the file that stands at a path. Raises OSError."""
        try:
            status = os.stat(path)
        except (FileNotFoundError, NotADirectoryError):
            return cls(path, None)
        return cls(path, (status.st_size, status.st_ino, status.st_mtime_ns))

    def is_there(self) -> bool:
        """Return whether the same file, or still no file, is there unchanged."""
        return Snapshot.of(self.path) == self

    def check(self) -> None:
        """Raise StoreError if another file is there, or this one has changed."""
        if not self.is_there():
            change = "was replaced or changed by another program in the meantime"
            raise StoreError(f"{self.path} {change}; run the same command again")


def is_foreign(file: Path) -> bool:
    """Return whether a file is there that does not say it is a result of tcstudy.

    An empty file is not foreign, because losing it is no loss. Raises OSError.
    """
    if not file.is_file() or not file.stat().st_size or seal_of(file) is not None:
        return False
    try:
        return not _is_result(_attributes(file))
    except Unreadable:
        return True


def attributes(path: Path) -> dict[str, Any]:
    """Return the global attributes of a complete result file.

    Raises StoreError if it is no such file, or damaged.
    """
    if fault := _fault_of_name(path):
        raise StoreError(fault)
    try:
        values = _attributes(path)
    except Unreadable as error:
        if is_locked(path):
            fault = "is open in another program, which may be changing it. Close it there"
        else:
            fault = f"is no netCDF file or is cut short or damaged ({error}). {remedy_of(path)}"
        raise StoreError(f"{path} {fault}") from error
    except (OSError, RuntimeError) as error:
        raise StoreError(f"cannot read {path}: {_cause(error)}") from error
    if not _is_result(values):
        fault = "is unfinished (its writer stopped midway) or not made by tcstudy"
        raise StoreError(f"{path} {fault}. {remedy_of(path)}")
    return values


def _fault_of_name(path: Path) -> str:
    """Return why no result file can be at a path; empty if one may be there."""
    if path.is_dir():
        return f"{path} is a directory; name a file in it"
    if not path.exists():
        if path.with_name(path.name + PARTIAL).exists():
            remedy = "Run the study again to resume it"
            return f"{path} is not there yet: its run has not finished. {remedy}"
        return f"there is no file {path}. Run the study first, or check the name"
    if not path.is_file():
        return f"{path} is no file but a device or a pipe; name a result file"
    if path.suffix in (".yaml", ".yml"):
        return f"{path} is a study and not its results; name the .nc file that its run wrote"
    return ""


def remedy_of(path: Path) -> str:
    """Return the remedy for a file that cannot be read."""
    return AWAY if is_foreign(path) else ANEW


def is_locked(path: Path) -> bool:
    """Return whether a program has a file open to write it, as the HDF5 library locks it."""
    try:
        import fcntl
    except ImportError:  # Windows
        return False
    with open(path, "rb") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return True
    return False


def _attributes(path: Path) -> dict[str, Any]:
    """Return the global attributes of a file, read once while it stays as it is.

    Opening a file of many groups takes long, and a command needs them several times.
    """
    status = path.stat()
    stamp = (status.st_size, status.st_ino, status.st_mtime_ns, status.st_ctime_ns)
    return dict(_read_attributes(Path(os.path.realpath(path)), *stamp))


@lru_cache(maxsize=16)
def _read_attributes(path: Path, *_stamp: int) -> dict[str, Any]:
    if (seal := seal_of(path)) is False:
        raise Unreadable("its checksum is wrong")
    with open(path, "rb") as stream:
        if not stream.read(8).startswith(_MAGIC):
            raise Unreadable("it does not begin like one")
    if seal is None and (damage := _damage_of(path, *_stamp)):
        raise Unreadable(damage)
    import netCDF4

    try:
        with netCDF4.Dataset(path) as nc:
            values = {name: nc.getncattr(name) for name in nc.ncattrs()}
    except (OSError, RuntimeError, AttributeError) as error:
        if seal:
            raise
        raise Unreadable(getattr(error, "strerror", None) or str(error)) from error
    for name, value in values.items():
        if hasattr(value, "tolist"):
            values[name] = value.tolist()
    return values


@lru_cache(maxsize=16)
def _damage_of(path: Path, *_stamp: int) -> str:
    """Return `damage_of` a file, determined once while the file stays as it is."""
    return damage_of(path)


def change_of(path: Path) -> str:
    """Return that a result file was changed since tcstudy wrote it; empty if it was not.

    Raises StoreError if it is no result file.
    """
    attributes(path)
    return "" if seal_of(path) else f"{path} was changed since tcstudy wrote it"


@contextmanager
def reading(path: Path) -> Iterator[Snapshot]:
    """Read a result file within a `with` block, and yield the snapshot of it.

    Warns if the file was changed since tcstudy wrote it. Raises StoreError if it is no result file,
    if its contents do not fit together, or if another file takes its place before the end.
    """
    snapshot = Snapshot.of(path)
    if path in _OPEN_FILES:
        yield snapshot
        return
    change = change_of(path)
    if change:
        tell([change])
    misfits = (*_MISFITS, OSError, Warning) if change else _MISFITS
    _OPEN_FILES.add(path)
    with warnings.catch_warnings():
        if change:
            warnings.simplefilter("error", RuntimeWarning)
        try:
            yield snapshot
        except UserFault:
            snapshot.check()
            raise
        except misfits as error:
            snapshot.check()
            cause = f"{type(error).__name__}: {(str(error).splitlines() or [''])[0]}"
            raise StoreError(_misfit(path, change, cause)) from error
        finally:
            _OPEN_FILES.discard(path)
    snapshot.check()


def _misfit(path: Path, change: str, cause: str) -> str:
    """Return that the contents of a file do not fit together."""
    if change:
        fault = "was changed after tcstudy wrote it and does not hold what it should"
        return f"{path} {fault} ({cause}). {ANEW}"
    fault = "is as tcstudy wrote it, but its contents do not fit together"
    return f"{path} {fault} ({cause}). {ANEW}; if that does not help, it is a fault of tcstudy"


_OPEN_FILES: set[Path] = set()
"""Files within a `reading`; a second `reading` of one checks nothing again."""


def _is_result(values: dict[str, Any]) -> bool:
    return FINISHED in values and str(values.get("source", "")).startswith("tcstudy")


MAX_NAME_BYTES = 255 - 32
"""Bytes of a name of an output: file systems allow 255, and names of files beside it are longer."""
FREE_DISK_FACTOR = 3
"""Required free disk over the expected file size: the old and the new file stand side by side."""
STALE_SECONDS = 3600.0
"""Time without a new byte after which no process works on a file [s]."""
PROTECTED = "the file is write-protected"


def replace_file(
    path: Path,
    make: Callable[[Path], object],
    preserved: str = "",
    sealed: bool = True,
    seen: Snapshot | None = None,
) -> None:
    """Put the file that `make` writes aside in the place of `path`, in one step and on the disk.

    preserved: sentence on the work that is not lost if that fails, for the message
    sealed:    whether it is a result file, which ends in a seal
    seen:      the only file that may be replaced; None for any
    Raises StoreError if the file cannot be written; the old one is then untouched.
    """
    target = Path(os.path.realpath(path))
    aside = aside_of(path)
    try:
        if kind := special_file(path):
            raise StoreError(f"{path} is {kind}, no file; choose another output")
        if _is_protected(path):
            raise PermissionError(errno.EACCES, PROTECTED, str(path))
        target.parent.mkdir(parents=True, exist_ok=True)
        remove_stale(path)
        make(aside)
        if sealed:
            put_seal(aside)
        with open(aside, "rb+") as stream:
            os.fsync(stream.fileno())
        if target.exists():
            shutil.copymode(target, aside)
        if seen is not None:
            seen.check()
        os.replace(aside, target)
        sync_directory(target.parent)
    except (OSError, RuntimeError) as error:  # netCDF4 reports a full disk as RuntimeError
        remedy = "Free some space, make the place writable or choose another output"
        if preserved:
            remedy = f"{remedy}; {preserved}"
        raise StoreError(f"cannot write {path}: {_cause(error)}. {remedy}") from error
    finally:
        with suppress(OSError):
            aside.unlink(missing_ok=True)


def aside_of(path: Path) -> Path:
    """Return where this process writes the file that is to take the place of `path`."""
    target = Path(os.path.realpath(path))
    return target.with_name(f".{target.name}.{_host()}-{os.getpid()}.tmp")


def _host() -> str:
    """Return a word for this machine; processes of two machines may have the same number."""
    return f"{zlib.crc32(platform.node().encode()):08x}"


def check_writable(path: Path, expected_bytes: int | None = None) -> list[str]:
    """Return why `path` cannot take a file, as a list of at most one sentence. Leaves nothing.

    expected_bytes: size of the result file; None for a file of another kind
    """
    try:
        fault = _fault_of_output(path, expected_bytes)
    except (OSError, ValueError) as error:  # no UTF-8 text, as netCDF needs it, or a NUL character
        fault = f"cannot look at {printable(str(path))}: {_cause(error)}; choose another output"
    return [fault] if fault else []


def _fault_of_output(path: Path, expected_bytes: int | None) -> str:
    """Return why `path` cannot take a file; empty if it can."""
    longest = max(len(part.encode()) for part in (*path.parts, ""))
    if longest > MAX_NAME_BYTES:
        fault = f"has a part of {longest} bytes; names of results may have {MAX_NAME_BYTES}"
        return f"{shortened(printable(str(path)))} {fault}; choose a shorter output"
    target = Path(os.path.realpath(path))
    folder = next(parent for parent in target.parents if parent.exists())
    if path.name in ("", "..") or target.is_dir():
        return f"{path} is a directory; give the name of a file in it"
    if fault_of_name := shell_name(str(path)):  # a library would make a file or folder of it
        return f"{path} {'; '.join(fault_of_name)}"
    if kind := special_file(path):
        return f"{path} is {kind}, no file; choose another output"
    if not folder.is_dir():
        return f"{folder} is a file, so {path} cannot be made; choose another output"
    if _is_protected(path):
        return f"{path}: {PROTECTED}; make it writable or choose another output"
    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        return f"cannot write in the directory {folder}: {_cause(error)}; choose another output"
    if expected_bytes is None:
        return ""
    if is_foreign(target):
        fault = f"{path} exists and is no result file; it would be lost"
        return f"{fault}: remove it or choose another output"
    return _lack_of_space(folder, FREE_DISK_FACTOR * expected_bytes)


def _lack_of_space(folder: Path, needed_bytes: int) -> str:
    """Return that a disk has too little free space; empty if it has enough."""
    free_bytes = shutil.disk_usage(folder).free
    if free_bytes >= needed_bytes:
        return ""
    free = f"{free_bytes / 1e6:.3g} MB"
    needed = f"{needed_bytes / 1e6:.3g} MB"
    fault = f"{folder} has {free} free, but the results need {needed} while they are written"
    remedy = "free some space, choose another output or ask for less (fields: false, fewer levels)"
    return f"{fault}; {remedy}"


def _is_stream(path: Path) -> bool:
    """Return whether a path leads to an open descriptor of a process, as /dev/stdout does.

    Its links must be followed one by one: the last one ends at whatever file the descriptor has.
    """
    for _ in range(_MAX_LINKS):
        folder = os.path.realpath(path.parent)
        if _DESCRIPTORS.fullmatch(folder):
            return True
        if not path.is_symlink():
            return False
        path = Path(folder, os.readlink(path))
    return False


_DESCRIPTORS = re.compile(r"/dev/fd|/proc/(\d+|self)(/task/\d+)?/fd")
_MAX_LINKS = 40
"""Links in a row that the system follows; it refuses longer chains."""


def special_file(path: Path) -> str:
    """Return the kind of a path that is neither a file nor a folder, as "a device"; else "".

    Raises OSError where symbolic links go in a circle.
    """
    if _is_stream(path):
        return "a stream of a process"
    try:
        mode = os.stat(path).st_mode
    except (FileNotFoundError, NotADirectoryError):
        return ""
    kinds = {
        stat.S_ISFIFO: "a pipe",
        stat.S_ISSOCK: "a socket",
        stat.S_ISCHR: "a device",
        stat.S_ISBLK: "a device",
    }
    return next((name for is_kind, name in kinds.items() if is_kind(mode)), "")


def remove_stale(path: Path, has_lock: bool = False) -> None:
    """Remove the files that killed writers of `path` left beside it.

    Such a file is one of a process that has ended on this machine, one that has not grown for
    STALE_SECONDS, or, for the holder of the lock of `path`, any.
    """
    target = Path(os.path.realpath(path))
    if not target.parent.is_dir():
        return
    pattern = re.compile(rf"\.{re.escape(target.name)}\.([0-9a-f]{{8}})-([0-9]{{1,10}})\.tmp")
    for name in os.listdir(target.parent):
        match = pattern.fullmatch(name)
        if match is None:
            continue
        aside = target.with_name(name)
        with suppress(OSError):
            has_ended = match[1] == _host() and _has_ended(int(match[2]))
            if has_lock or has_ended or time.time() - aside.stat().st_mtime > STALE_SECONDS:
                aside.unlink()


def _has_ended(process: int) -> bool:
    """Return whether no process on this machine has this number."""
    if os.name == "nt":  # there a signal to a process would end it
        return False
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return True
    except PermissionError:
        pass
    return False


def sync_directory(directory: Path) -> None:
    """Bring a directory's entries to the disk, where the system can."""
    if os.name == "nt":
        return
    descriptor = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        # some network file systems cannot do that
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(descriptor)


def write_dataset(
    path: Path,
    attributes: Mapping[str, Any],
    fill: Callable[[netCDF4.Dataset], None],
    preserved: str = "",
    seen: Snapshot | None = None,
) -> None:
    """Write the attributes and the contents of a result file, replacing an old one in one step.

    fill: puts the contents into the open file
    preserved, seen: as in `replace_file`
    Raises StoreError if it cannot be written; the old one is then untouched.
    """

    import netCDF4

    def make(aside: Path) -> None:
        # this error names a missing permission; that of netCDF4 is the same as for a full disk
        aside.touch()
        try:
            nc = netCDF4.Dataset(aside, "w", format="NETCDF4")
        except OSError as error:
            raise OSError(errno.EIO, "the netCDF library cannot make the file") from error
        with nc:
            nc.setncatts(attributes)
            fill(nc)
            nc.setncattr(FINISHED, np.int32(1))

    replace_file(path, make, preserved, seen=seen)


def _is_protected(path: Path) -> bool:
    # by the mode, not by os.access: renaming over a file needs no right to write it, and root may
    # do anything
    return path.exists() and not path.stat().st_mode & 0o222


def _cause(error: Exception) -> str:
    return (error.strerror if isinstance(error, OSError) else None) or str(error)


# -- where a result comes from, and what it holds

CONVENTIONS = "CF-1.11"
REFERENCES = (
    "Sestak & Jovanovic, Appl. Math. Mech. 31 (2010), doi:10.3879/j.issn.1000-0887.2010.01.008"
)
PACKAGES = ("numpy", "scipy", "ngsolve", "xarray", "netCDF4", "tcstudy")
NUMERICS = ("numpy", "scipy", "ngsolve", "netgen-mesher", "tcstudy")
"""Packages whose version can change a result: another version may make other meshes."""
GIT_TIMEOUT = 5.0
"""Time that git may take [s], for example on a slow network disk."""
WARNINGS, SHORTFALLS = "warnings", "shortfalls"
"""Global attributes.

WARNINGS:   the warnings as a JSON list of objects; a file without warnings has no such attribute
SHORTFALLS: what a path lacks of what the study asks for, one sentence per line
"""


@dataclass(frozen=True)
class Remark:
    """A warning as data.

    where: the geometry, point or level that it is about, in words; empty if it is about all
    """

    text: str
    where: str = ""

    def __str__(self) -> str:
        return f"{self.where}: {self.text}" if self.where else self.text


def remarks_of(attributes: Mapping[str, Any]) -> list[Remark]:
    """Return the warnings in the global attributes of a file."""
    warnings_stored = json.loads(attributes.get(WARNINGS, "[]"))
    shortfalls = str(attributes.get(SHORTFALLS, "")).splitlines()
    remarks = [Remark(str(item["text"]), str(item["where"])) for item in warnings_stored]
    return remarks + [Remark(sentence) for sentence in shortfalls]


def tell_stored(path: Path) -> None:
    """Issue the warnings stored in a file. Raises StoreError if it is no result, or damaged."""
    tell(remarks_of(attributes(path)))


def collect(study: Study, command: Sequence[str], remarks: Sequence[Remark] = ()) -> dict[str, Any]:
    """Return the global attributes of a result file: those of CF, and all that repeat the run.

    command: the words of the command line;  remarks: warnings to store
    """
    date = datetime.now(UTC).isoformat(timespec="seconds")
    versions = {"python": platform.python_version(), **package_versions(PACKAGES)}
    command_line = shlex.join(without_directories(command))
    command_line = re.sub(r"^__main__\.py\b", "tcstudy", command_line)  # of python -m
    values: dict[str, Any] = {
        "Conventions": CONVENTIONS,
        "title": study.title or "untitled study",
        "institution": study.institution or "unspecified",
        "source": f"tcstudy {versions['tcstudy']}",
        "history": f"{date} {command_line}",
        "references": REFERENCES,
        "solver": " ".join(study.solver.names),
        "solver_tolerance": study.solver.aim,
        "unit_system": study.units,
        "sweep_mode": study.mode,
    }
    if study.design:
        values |= {f"design_{name}": value for name, value in asdict(study.design).items()}
    values |= {
        "study_yaml": study.text,
        "study_sha256": study_sha256(study),
        "overrides": "\n".join(without_directories(study.overrides)),
        "versions": json.dumps(versions),
        "program": program(),
        "git_commit": git_commit(study.source),
    }
    if remarks:
        items = [{"text": without_paths(r.text), "where": r.where} for r in remarks]
        values[WARNINGS] = json.dumps(items)
    return values


def study_sha256(study: Study) -> str:
    """Return the SHA-256 checksum of all that decides the results.

    That is the YAML text, the overrides, and the bytes of the geometry files. Without overrides and
    geometry files it is the checksum of the YAML file.
    """
    digest = hashlib.sha256(study.text.encode())
    for override in study.overrides:
        digest.update(b"\0" + override.encode())
    bodies = (scene.body.brep for scene in study.scenes[:1])
    for path in sorted({brep.path for brep in bodies if brep is not None}):
        digest.update(b"\0" + path.name.encode() + b"\0")
        if path.is_file():
            digest.update(path.read_bytes())
    return digest.hexdigest()


def program() -> str:
    """Return all of the program that can change a result, as JSON: package versions and content."""
    return json.dumps({**package_versions(NUMERICS), "content": content_sha256()})


@cache
def content_sha256() -> str:
    """Return the SHA-256 checksum of this package's modules, of their names and texts.

    A version number does not change with every edit.
    """
    package = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for file in sorted(package.rglob("*.py")):
        name = file.relative_to(package).as_posix()
        digest.update(b"\0" + name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def package_versions(names: Iterable[str]) -> dict[str, str]:
    """Return the installed versions by package name, "unknown" if a package is not installed.

    The packages are not imported.
    """
    return {name: _version(name) for name in names}


@cache
def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "unknown"


def git_commit(source: Path | None) -> str:
    """Return the commit of the checkout of the study file, with "-dirty" if the file differs.

    A file that is not in the checkout differs, too. Without a checkout it is "unknown".
    """
    if source is None:
        return "unknown"
    directory = source.resolve().parent
    commit = _git(directory, "describe", "--always", "--exclude=*", "--abbrev=40", "--dirty")
    if commit is None or commit.endswith("-dirty"):
        return commit or "unknown"
    is_tracked = _git(directory, "ls-files", "--error-unmatch", "--", source.name) is not None
    return commit if is_tracked else f"{commit}-dirty"


def _git(directory: Path, *arguments: str) -> str | None:
    """Return the output of git; None if git is missing, too slow or fails."""
    # GIT_OPTIONAL_LOCKS: asking for the status must not take a lock in the user's checkout
    environment = {**os.environ, "GIT_OPTIONAL_LOCKS": "0", "LC_ALL": "C"}
    try:
        process = subprocess.run(
            ["git", "-C", str(directory), *arguments],
            capture_output=True,
            text=True,
            timeout=GIT_TIMEOUT,
            env=environment,
            stdin=subprocess.DEVNULL,
            check=True,
        )
    except (OSError, subprocess.SubprocessError, UnicodeDecodeError):
        return None
    return process.stdout.strip()


def without_directories(words: Iterable[str]) -> tuple[str, ...]:
    """Return words of a command with every absolute path cut to its last part.

    A path may stand alone or after "=".
    """
    return tuple("=".join(map(_file_name, word.split("="))) for word in words)


def _file_name(text: str) -> str:
    stripped = text.strip().strip("'\"")
    paths = (PurePosixPath(stripped), PureWindowsPath(stripped))
    return next((path.name for path in paths if path.is_absolute()), text)


_PATH = re.compile(r"(?<![^\s'\"(=:])(?:[A-Za-z]:)?[/\\](?:[^\s'\"/\\]+[/\\])+")


def without_paths(sentence: str) -> str:
    """Return a sentence with every absolute path cut to its last part; a unit keeps its slash."""
    return _PATH.sub("", sentence)


OTHER_OUTPUT = "give another --output, or --force to replace it"
Kind = Literal["run", "path", "history", "convergence", "cost", "fit"]
CONTENT = "content"
"""Global attribute with the command that wrote the file; runs and old convergence files lack it."""


def kind_of(path: Path) -> Kind:
    """Return the command that wrote a file. Raises StoreError if it is no complete result file."""
    return kind_from(attributes(path))


def kind_from(attributes: Mapping[str, Any]) -> Kind:
    """Return the command that wrote a file, by its global attributes."""
    content = attributes.get(CONTENT, "convergence" if "reference" in attributes else "run")
    return next((kind for kind in get_args(Kind) if kind == content), "run")


def holds(path: Path, kind: Kind, study: Study | None, **decisive: Any) -> bool:
    """Return whether a file holds the complete results that a command would compute.

    kind: the command;  study: None for any;  decisive: global attributes that its options decide
    Raises StoreError if the file holds something else, or is damaged.
    """
    # a foreign file is reported elsewhere
    if not path.is_file() or not path.stat().st_size or is_foreign(path):
        return False
    try:
        values = attributes(path)
        if change := change_of(path):
            raise StoreError(f"{change}, and nothing goes on from such a file. {ANEW}")
    except StoreError as error:
        raise StoreError(f"{error}, or give another --output") from error
    if difference := _difference(values, kind, study, decisive):
        raise StoreError(f"{path} {difference}; {OTHER_OUTPUT}")
    return True


def _difference(
    values: Mapping[str, Any], kind: Kind, study: Study | None, decisive: Mapping[str, Any]
) -> str:
    """Return how the results of a file differ from those of a command; empty if they do not."""
    kind_there = kind_from(values)
    if kind_there != kind:
        return f"holds results of another command ({kind_there})"
    if study is not None and values.get("study_sha256") != study_sha256(study):
        return "holds the results of another study, or of this one with other values"
    differing = [name for name, value in decisive.items() if values.get(name) != value]
    if "data_sha256" in differing:
        return "holds the results of another table of data"
    if differing:
        return "holds the results of another --at"
    if values.get("program") != program():
        return "holds this study as another version of the program or its libraries computed it"
    return ""


def already_there(path: Path, study: Study) -> list[str]:
    """Return notes on results that a run of the study would find in its output.

    A history has none: it goes on with what it finds.
    """
    if study.kind == "history":
        return []
    decisive = {"data_sha256": study.fit.sha256} if study.fit else {}
    try:
        is_there = holds(path, study.kind, study, **decisive)
    except StoreError as error:
        return [f"a run would stop here: {error}"]
    if not is_there:
        return []
    return [f"{path} holds these results already; a run ends at once, --force computes them again"]
