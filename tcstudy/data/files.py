"""Files that are complete or not there at all; what an existing one is, and where it comes from.

A file is written aside in the same directory, brought to the disk (fsync) and renamed over the old
one, so that a crash, a full disk or a power cut leaves the old file as it was, and a reader of the
old file keeps it.

A result file ends in a seal, a SHA-256 of all bytes before it, which tells without the netCDF
library that tcstudy wrote the file and that no byte has changed since. It ignores what follows the
end that a file states; a program that changes the file cuts the seal off. A file whose seal is
broken is refused; one without a seal is read, which is told.

Its global attributes are the study's text, command, versions, commit; by them it also tells which
command wrote it and which results it holds, so that two studies do not overwrite each other and
none is computed twice. Nothing of a machine is recorded: absolute paths are cut to the file name.
What one must know of a result before using it is told when it is found, kept in the file, and told
again by its readers: as a StudyWarning.
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


_MARK = b"\ntcstudy result, sha256 "
_LENGTH = len(_MARK) + 64 + 1
_BLOCK = 1 << 20


def put_seal(file: Path) -> None:
    with open(file, "rb+") as stream:
        digest = _digest(stream, os.fstat(stream.fileno()).st_size)
        stream.seek(0, os.SEEK_END)
        stream.write(_MARK + digest + b"\n")


def seal_of(file: Path) -> bool | None:
    """Whether a file is as it was written; None if it has no seal: changed, cut, or a stranger's.
    Raises OSError."""
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
    """Of the first bytes of a stream."""
    digest = hashlib.sha256()
    while length > 0 and (block := stream.read(min(_BLOCK, length))):
        digest.update(block)
        length -= len(block)
    return digest.hexdigest().encode()


ANEW = "Run the study again with --force to make it anew"
AWAY = "Remove it and run the study again"
"""What to do with a damaged file: --force replaces what is known to be a result, and nothing else."""
FINISHED = "finished"
"""Global attribute set last: netCDF-4 opens a file whose writer died as if nothing were wrong."""
PARTIAL = ".partial"
"""What the journal of a run adds to the name of its output."""
_MAGIC = (b"\x89HDF\r\n\x1a\n", b"CDF")
"""How netCDF-4 and older netCDF files begin."""
_MISFITS = (LookupError, ValueError, TypeError, AttributeError, ArithmeticError, RuntimeError)
"""What reading and drawing values that do not fit together may raise."""


@dataclass(frozen=True)
class Snapshot:
    """Which file stood at a path at a moment: the same one is there as long as `is_there`.

    identity: size [byte], number of the file, time of its last change [ns]; None where there was no file
    """

    path: Path
    identity: tuple[int, int, int] | None

    @classmethod
    def of(cls, path: Path) -> Snapshot:
        """Return which file stands at a path now. Raises OSError."""
        try:
            now = os.stat(path)
        except (FileNotFoundError, NotADirectoryError):
            return cls(path, None)
        return cls(path, (now.st_size, now.st_ino, now.st_mtime_ns))

    def is_there(self) -> bool:
        """Return whether that file, or none, is still there, unchanged."""
        return Snapshot.of(self.path) == self

    def check(self) -> None:
        """Raise StoreError if another file is there, or this one has changed."""
        if not self.is_there():
            what = "was replaced or changed by another program in the meantime"
            raise StoreError(f"{self.path} {what}; run the same command again")


def is_foreign(file: Path) -> bool:
    """Whether there is a file that does not say it is a result of tcstudy; an empty one is no loss.
    Raises OSError."""
    if not file.is_file() or not file.stat().st_size or seal_of(file) is not None:
        return False
    try:
        return not _says_ours(_attributes(file))
    except Unreadable:
        return True


def attributes(path: Path) -> dict[str, Any]:
    """The global attributes of a complete result file. Raises StoreError if it is none, or
    damaged."""
    if path.is_dir():
        raise StoreError(f"{path} is a directory; name a file in it")
    if not path.exists():
        if path.with_name(path.name + PARTIAL).exists():
            raise StoreError(
                f"{path} is not there yet: its run has not finished. Run the study again to resume it"
            )
        raise StoreError(f"there is no file {path}. Run the study first, or check the name")
    if not path.is_file():
        raise StoreError(f"{path} is no file but a device or a pipe; name a result file")
    if path.suffix in (".yaml", ".yml"):
        raise StoreError(
            f"{path} is a study and not its results; name the .nc file that its run wrote"
        )
    try:
        found = _attributes(path)
    except Unreadable as error:
        if is_locked(path):
            what = "is open in another program, which may be changing it. Close it there"
            raise StoreError(f"{path} {what}") from error
        raise StoreError(
            f"{path} is no netCDF file or is cut short or damaged ({error}). {remedy_of(path)}"
        ) from error
    except (OSError, RuntimeError) as error:
        raise StoreError(
            f"cannot read {path}: {getattr(error, 'strerror', None) or error}"
        ) from error
    if not _says_ours(found):
        raise StoreError(
            f"{path} is unfinished (its writer stopped midway) or not made by tcstudy. "
            f"{remedy_of(path)}"
        )
    return found


def remedy_of(path: Path) -> str:
    """Return what to do with a file that cannot be read."""
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
    """Return the global attributes of a file, read once while it stays as it is: opening a file of
    many groups takes long, and one command asks several times."""
    now = path.stat()
    stamp = now.st_size, now.st_ino, now.st_mtime_ns, now.st_ctime_ns
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
    return {
        name: value.tolist() if hasattr(value, "tolist") else value
        for name, value in values.items()
    }


@lru_cache(maxsize=16)
def _damage_of(path: Path, *_stamp: int) -> str:
    """Return `damage_of` a file, found out once while the file stays as it is."""
    return damage_of(path)


def change_of(path: Path) -> str:
    """That another program has changed a result file since tcstudy wrote it; empty if none has.
    Raises StoreError if it is no result file."""
    attributes(path)
    return "" if seal_of(path) else f"{path} was changed since tcstudy wrote it"


@contextmanager
def reading(path: Path) -> Iterator[Snapshot]:
    """Read one file, and no other, for the time of a `with`; gives which one it is.

    That the file has changed since tcstudy wrote it is told. Raises StoreError if the file is none,
    if its contents do not fit together, or if another one has taken its place before the end.
    """
    snapshot = Snapshot.of(path)
    if path in _READ_NOW:
        yield snapshot
        return
    change = change_of(path)
    tell([change] if change else [])
    misfits = (*_MISFITS, OSError, Warning) if change else _MISFITS
    _READ_NOW.add(path)
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
            _READ_NOW.discard(path)
    snapshot.check()


def _misfit(path: Path, change: str, cause: str) -> str:
    if change:
        what = "was changed after tcstudy wrote it and does not hold what it should"
        return f"{path} {what} ({cause}). {ANEW}"
    what = "is as tcstudy wrote it, but its contents do not fit together"
    return f"{path} {what} ({cause}). {ANEW}; if that does not help, it is a fault of tcstudy"


_READ_NOW: set[Path] = set()
"""Files that a `reading` is at, within which others say nothing more."""


def _says_ours(found: dict[str, Any]) -> bool:
    return FINISHED in found and str(found.get("source", "")).startswith("tcstudy")


LONGEST_NAME = 255 - 32
"""Bytes of a name, such that the names of files written beside the output remain below the 255 of
file systems."""
ROOM = 3
"""Free disk that must be there, as a multiple of the expected file (old and new stand side by
side)."""
STALE = 3600.0
"""Seconds without a byte more after which nobody is at work on a file."""
PROTECTED = "the file is write-protected"


def replace_file(
    path: Path,
    make: Callable[[Path], object],
    kept: str = "",
    sealed: bool = True,
    seen: Snapshot | None = None,
) -> None:
    """Put the file that `make` writes aside in the place of `path`, in one step and on the disk.

    kept:   what of the work is not lost if that fails, for the message
    sealed: whether it is a result file, which ends in a seal
    seen:   the only file that may be replaced; None for any
    Raises StoreError if the file cannot be written; the old one is then untouched.
    """
    target, aside = Path(os.path.realpath(path)), aside_of(path)
    try:
        if what := special_file(path):
            raise StoreError(f"{path} is {what}, no file; choose another output")
        if _protected(path):
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
        remedy = f"Free some space, make the place writable or choose another output{'; ' * bool(kept)}{kept}"
        raise StoreError(f"cannot write {path}: {_cause(error)}. {remedy}") from error
    finally:
        with suppress(OSError):
            aside.unlink(missing_ok=True)


def aside_of(path: Path) -> Path:
    """Where this process writes the file that is to take the place of `path`."""
    target = Path(os.path.realpath(path))
    return target.with_name(f".{target.name}.{_host()}-{os.getpid()}.tmp")


def _host() -> str:
    """Return a word for this machine: processes of several machines may have one number."""
    return f"{zlib.crc32(platform.node().encode()):08x}"


def check_writable(path: Path, expected_bytes: int | None = None) -> list[str]:
    """Why `path` could not take a result file of this size, None for any other file; empty if it
    can. Leaves nothing behind."""
    try:
        fault = _fault(path, expected_bytes)
    except (OSError, ValueError) as error:  # no UTF-8 text, as netCDF needs it, or a NUL character
        fault = f"cannot look at {printable(str(path))}: {_cause(error)}; choose another output"
    return [fault] if fault else []


def _fault(path: Path, expected_bytes: int | None) -> str:
    if (
        longest := max(len(part.encode()) for part in (*path.parts, ""))
    ) > LONGEST_NAME:  # names aside are longer
        what = f"has a part of {longest} bytes; names of results may have {LONGEST_NAME}"
        return f"{shortened(printable(str(path)))} {what}; choose a shorter output"
    target = Path(os.path.realpath(path))
    existing = next(p for p in target.parents if p.exists())
    if path.name in ("", "..") or target.is_dir():
        return f"{path} is a directory; give the name of a file in it"
    if fault := shell_name(str(path)):  # of which a library would make a file or folder
        return f"{path} {'; '.join(fault)}"
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
    free, needed = (
        f"{number / 1e6:.3g} MB"
        for number in (shutil.disk_usage(existing).free, ROOM * expected_bytes)
    )
    if shutil.disk_usage(existing).free < ROOM * expected_bytes:
        remedy = (
            "free some space, choose another output or ask for less (fields: false, fewer levels)"
        )
        return f"{existing} has {free} free, but the results need {needed} while they are written; {remedy}"
    return ""


def _is_stream(path: Path) -> bool:
    """Return whether a path leads to an open descriptor of a process, as /dev/stdout does.

    Its links must be followed one by one: the last one ends at whatever file the descriptor has.
    """
    for _ in range(_MOST_LINKS):
        folder = os.path.realpath(path.parent)
        if _DESCRIPTORS.fullmatch(folder):
            return True
        if not path.is_symlink():
            return False
        path = Path(folder, os.readlink(path))
    return False


_DESCRIPTORS = re.compile(r"/dev/fd|/proc/(\d+|self)(/task/\d+)?/fd")
_MOST_LINKS = 40
"""Links in a row that the system follows; longer chains are refused by it."""


def special_file(path: Path) -> str:
    """What stands at a path if it is neither a file nor a folder: "a device", …; empty otherwise.
    Raises OSError where symbolic links go in a circle."""
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


def remove_stale(path: Path, alone: bool = False) -> None:
    """Remove what killed writers of `path` left aside.

    That is what a process wrote that has ended on this machine, what has not grown for STALE
    seconds, or, for the holder of the lock of `path`, all of it.
    """
    target = Path(os.path.realpath(path))
    left = re.compile(rf"\.{re.escape(target.name)}\.([0-9a-f]{{8}})-([0-9]{{1,10}})\.tmp")
    for name in os.listdir(target.parent) if target.parent.is_dir() else ():
        if (parts := left.fullmatch(name)) is None:
            continue
        stale = target.with_name(name)
        with suppress(OSError):
            has_ended = parts[1] == _host() and _has_ended(int(parts[2]))
            if alone or has_ended or time.time() - stale.stat().st_mtime > STALE:
                stale.unlink()


def _has_ended(process: int) -> bool:
    """Return whether there is no process with this number on this machine."""
    if os.name == "nt":  # where looking for a process by a signal would end it
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
        if error.errno not in (
            errno.EINVAL,
            errno.ENOTSUP,
        ):  # some network file systems know no such thing
            raise
    finally:
        os.close(descriptor)


def write_dataset(
    path: Path,
    attributes: Mapping[str, Any],
    fill: Callable[[netCDF4.Dataset], None],
    kept: str = "",
    seen: Snapshot | None = None,
) -> None:
    """Write a result file, replacing an old one in one step: its global attributes, then what
    `fill` puts into it.

    kept, seen: as in `replace_file`
    Raises StoreError if it cannot be written; the old one is then untouched.
    """

    import netCDF4

    def make(aside: Path) -> None:
        # which tells of a directory without permission; netCDF4 says that of a full disk, too
        aside.touch()
        try:
            nc = netCDF4.Dataset(aside, "w", format="NETCDF4")
        except OSError as error:
            raise OSError(errno.EIO, "the netCDF library cannot make the file") from error
        with nc:
            nc.setncatts(attributes)
            fill(nc)
            nc.setncattr(FINISHED, np.int32(1))

    replace_file(path, make, kept, seen=seen)


def _protected(path: Path) -> bool:
    # by the mode, not by os.access: renaming over a file needs no right to write it, and root may
    # do anything
    return path.exists() and not path.stat().st_mode & 0o222


def _cause(error: Exception) -> str:
    return (error.strerror if isinstance(error, OSError) else None) or str(error)


# -- where a result comes from, and what it holds
# ------------------------------------------------------

CONVENTIONS = "CF-1.11"
REFERENCES = (
    "Sestak & Jovanovic, Appl. Math. Mech. 31 (2010), doi:10.3879/j.issn.1000-0887.2010.01.008"
)
PACKAGES = ("numpy", "scipy", "ngsolve", "xarray", "netCDF4", "tcstudy")
NUMERICS = ("numpy", "scipy", "ngsolve", "netgen-mesher", "tcstudy")
"""Packages whose version can change a result (meshes are equal across runs, not across
versions)."""
GIT_TIMEOUT = 5.0
"""Seconds that git may take, for example on a slow network disk."""
WARNINGS, SHORTFALLS = "warnings", "shortfalls"
"""Global attributes: the warnings as a JSON list of objects, without one if there are none; what of
a path is not as it was asked for, one sentence a line."""


@dataclass(frozen=True)
class Remark:
    """A warning as data: what it says, and of which geometry, point or level in words; of all if
    that is empty."""

    text: str
    where: str = ""

    def __str__(self) -> str:
        return f"{self.where}: {self.text}" if self.where else self.text


def remarks_of(attributes: Mapping[str, Any]) -> list[Remark]:
    """The warnings in the global attributes of a file; files from before there were any have
    none."""
    stored = [
        Remark(str(one["text"]), str(one["where"]))
        for one in json.loads(attributes.get(WARNINGS, "[]"))
    ]
    return stored + [Remark(line) for line in str(attributes.get(SHORTFALLS, "")).splitlines()]


def tell_stored(path: Path) -> None:
    """Warn of what a file keeps. Raises StoreError if it is none, or damaged."""
    tell(remarks_of(attributes(path)))


def collect(study: Study, command: Sequence[str], remarks: Sequence[Remark] = ()) -> dict[str, Any]:
    """Global attributes of a result file: those of CF, and all that is needed to repeat the run.
    command: the words of the command line;  remarks: warnings that the file keeps"""
    date = datetime.now(UTC).isoformat(timespec="seconds")
    versions = {"python": platform.python_version(), **package_versions(PACKAGES)}
    words = re.sub(
        r"^__main__\.py\b", "tcstudy", shlex.join(without_directories(command))
    )  # of python -m
    told = [{"text": without_paths(one.text), "where": one.where} for one in remarks]
    return {
        "Conventions": CONVENTIONS,
        "title": study.title or "untitled study",
        "institution": study.institution or "unspecified",
        "source": f"tcstudy {versions['tcstudy']}",
        "history": f"{date} {words}",
        "references": REFERENCES,
        "solver": " ".join(study.solver.names),
        "solver_tolerance": study.solver.aim,
        "unit_system": study.units,
        "sweep_mode": study.mode,
        **(
            {f"design_{name}": value for name, value in asdict(study.design).items()}
            if study.design
            else {}
        ),
        "study_yaml": study.text,
        "study_sha256": study_sha256(study),
        "overrides": "\n".join(without_directories(study.overrides)),
        "versions": json.dumps(versions),
        "program": program(),
        "git_commit": git_commit(study.source),
        **({WARNINGS: json.dumps(told)} if told else {}),
    }


def study_sha256(study: Study) -> str:
    """SHA-256 of all that decides the results: YAML text, overrides, and the bytes of its geometry
    files. Without overrides and geometry files it is the checksum of the YAML file."""
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
    """All of the program that can change a result, as JSON: versions of its packages and the
    content of its own."""
    return json.dumps({**package_versions(NUMERICS), "content": content_sha256()})


@cache
def content_sha256() -> str:
    """SHA-256 of this package's modules, names and texts: a version number does not change with
    every edit."""
    package, digest = Path(__file__).parents[1], hashlib.sha256()
    for file in sorted(package.rglob("*.py")):
        digest.update(
            b"\0" + file.relative_to(package).as_posix().encode() + b"\0" + file.read_bytes()
        )
    return digest.hexdigest()


def package_versions(names: Iterable[str]) -> dict[str, str]:
    """Installed versions by package name, without importing the packages; "unknown" if there is
    none."""
    return {name: _version(name) for name in names}


@cache
def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "unknown"


def git_commit(source: Path | None) -> str:
    """Commit of the checkout that holds the study file, "-dirty" if it does not hold the study as
    run."""
    if source is None:
        return "unknown"
    directory = source.resolve().parent
    commit = _git(directory, "describe", "--always", "--exclude=*", "--abbrev=40", "--dirty")
    if commit is None or commit.endswith("-dirty"):
        return commit or "unknown"
    return (
        commit
        if _git(directory, "ls-files", "--error-unmatch", "--", source.name) is not None
        else f"{commit}-dirty"
    )


def _git(directory: Path, *arguments: str) -> str | None:
    """None if git is missing, too slow or says no."""
    # GIT_OPTIONAL_LOCKS: asking for the status must not take a lock in the user's checkout
    environment = {**os.environ, "GIT_OPTIONAL_LOCKS": "0", "LC_ALL": "C"}
    try:
        done = subprocess.run(
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
    return done.stdout.strip()


def without_directories(words: Iterable[str]) -> tuple[str, ...]:
    """Words of a command or override; an absolute path, alone or after "=", is cut to its last
    part."""
    return tuple("=".join(_file_name(part) for part in word.split("=")) for word in words)


def _file_name(text: str) -> str:
    stripped = text.strip().strip("'\"")
    paths = (PurePosixPath(stripped), PureWindowsPath(stripped))
    return next((path.name for path in paths if path.is_absolute()), text)


_PATH = re.compile(r"(?<![^\s'\"(=:])(?:[A-Za-z]:)?[/\\](?:[^\s'\"/\\]+[/\\])+")


def without_paths(sentence: str) -> str:
    """A sentence with every absolute path cut to its last part (a slash within a unit stays)."""
    return _PATH.sub("", sentence)


OTHER_OUTPUT = "give another --output, or --force to replace it"
Kind = Literal["run", "path", "history", "convergence", "cost", "fit"]
CONTENT = "content"
"""Global attribute that tells the files of other commands from those of a run and of converge."""


def kind_of(path: Path) -> Kind:
    """The command whose file this is. Raises StoreError if there is no file or it is not
    complete."""
    return kind_from(attributes(path))


def kind_from(found: Mapping[str, Any]) -> Kind:
    """The command by the global attributes of its file."""
    content = found.get(CONTENT, "convergence" if "reference" in found else "run")
    return next((kind for kind in get_args(Kind) if kind == content), "run")


def holds(path: Path, kind: Kind, study: Study | None, **asked: Any) -> bool:
    """Whether the file holds what a command would compute now, complete.

    kind: the command;  study: of which, None for any;  asked: global attributes that its options decide
    Raises StoreError if the file holds something else, or is damaged.
    """
    if (
        not path.is_file() or not path.stat().st_size or is_foreign(path)
    ):  # a foreign one is told of elsewhere
        return False
    try:
        found = attributes(path)
        if change := change_of(path):
            raise StoreError(f"{change}, and nothing goes on from such a file. {ANEW}")
    except StoreError as error:
        raise StoreError(f"{error}, or give another --output") from error
    what = ""
    if (other := kind_from(found)) != kind:
        what = f"holds results of another command ({other})"
    elif study is not None and found.get("study_sha256") != study_sha256(study):
        what = "holds the results of another study, or of this one with other values"
    elif differing := [name for name, value in asked.items() if found.get(name) != value]:
        what = f"holds the results of another {'table of data' if 'data_sha256' in differing else '--at'}"
    elif found.get("program") != program():
        what = "holds this study as another version of the program or its libraries computed it"
    if what:
        raise StoreError(f"{path} {what}; {OTHER_OUTPUT}")
    return True


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
