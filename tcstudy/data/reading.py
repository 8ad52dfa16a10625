"""What an existing file is, found out before the netCDF library opens it; the sweep of one that is open.

A result file ends in a seal, a SHA-256 of all bytes before it, which tells without the library that tcstudy wrote the
file and that no byte has changed since. It ignores what follows the end that a file states; a program that changes the
file cuts the seal off. A file whose seal is broken is refused; one without a seal is read, which is told, and what
fails on it is the file's fault, told in one line.
"""

from __future__ import annotations

import hashlib
import math
import os
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from enum import Enum
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from tcstudy.errors import StoreError, tell

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Unreadable(Exception):
    """The file cannot be read; the text says why."""


_MARK = b"\ntcstudy result, sha256 "
_LENGTH = len(_MARK) + 64 + 1
_BLOCK = 1 << 20


class Seal(Enum):
    """WHOLE: the file is as it was written; BROKEN: it has changed; NONE: changed, cut, or a stranger's."""

    WHOLE = "whole"
    BROKEN = "broken"
    NONE = "none"


def put_seal(file: Path) -> None:
    """Seal a finished file. Raises OSError."""
    with open(file, "rb+") as stream:
        digest = _digest(stream, os.fstat(stream.fileno()).st_size)
        stream.seek(0, os.SEEK_END)
        stream.write(_MARK + digest + b"\n")


def seal_of(file: Path) -> Seal:
    """What the seal of a regular file says. Raises OSError."""
    now = file.stat()
    return _seal_of(os.path.realpath(file), now.st_size, now.st_ino, now.st_mtime_ns)


@lru_cache(maxsize=16)
def _seal_of(file: str, size: int, *_stamp: int) -> Seal:
    """Computed once while the file stays as it is: one command opens it several times."""
    if size < _LENGTH:
        return Seal.NONE
    with open(file, "rb") as stream:
        stream.seek(size - _LENGTH)
        end = stream.read(_LENGTH)
        if not (end.startswith(_MARK) and end.endswith(b"\n")):
            return Seal.NONE
        stream.seek(0)
        return Seal.WHOLE if _digest(stream, size - _LENGTH) == end[len(_MARK) : -1] else Seal.BROKEN


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
    if not file.is_file() or not file.stat().st_size or seal_of(file) != Seal.NONE:
        return False
    try:
        return not _says_ours(_attributes(file))
    except Unreadable:
        return True


def attributes(path: Path) -> dict[str, Any]:
    """The global attributes of a complete result file. Raises StoreError if it is none, or damaged."""
    if str(path).startswith("~"):  # which netCDF would look for elsewhere
        raise StoreError(f"{path} begins with ~, which only a shell knows as a home directory; write the directory out")
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
    if (seal := seal_of(path)) == Seal.BROKEN:
        raise Unreadable("its checksum is wrong")
    if seal == Seal.NONE and not _is_netcdf(path):
        raise Unreadable("it does not begin like one")
    import netCDF4

    try:
        with netCDF4.Dataset(path) as nc:
            values = {name: nc.getncattr(name) for name in nc.ncattrs()}
    except (OSError, RuntimeError) as error:
        if seal == Seal.WHOLE:
            raise
        raise Unreadable(getattr(error, "strerror", None) or str(error)) from error
    return {name: value.tolist() if hasattr(value, "tolist") else value for name, value in values.items()}


def change_of(path: Path) -> str:
    """That another program has changed a result file since tcstudy wrote it; empty if none has.

    Raises StoreError if it is no result file.
    """
    attributes(path)
    return "" if seal_of(path) == Seal.WHOLE else f"{path} was changed since tcstudy wrote it"


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


def _is_netcdf(file: Path) -> bool:
    with open(file, "rb") as stream:
        return stream.read(8).startswith(_MAGIC)


def _says_ours(found: dict[str, Any]) -> bool:
    return FINISHED in found and str(found.get("source", "")).startswith("tcstudy")


GEOMETRIES = "geometries"
"""Global attribute of a file of a sweep over geometries: how many it has (`tcstudy.data.variants`)."""


def refuse_geometries(attributes: Mapping[Any, Any], what: str) -> None:
    """Raise StoreError for a file of several geometries where one is needed."""
    if GEOMETRIES in attributes:
        how = "take one out with tcstudy export FILE.nc --geometry --at NAME=VALUE -o ONE.nc"
        raise StoreError(f"the file has {attributes[GEOMETRIES]} geometries, and {what} is of one; {how}")


def sweep_dims(data: Any) -> list[str]:
    """Dimensions of the sweep of an opened result file (its root dataset); none where it has one point."""
    return [str(dim) for dim in data["status"].dims if dim not in ("level", "step")]


def each_point(data: Any) -> list[dict[str, int]]:
    """Index along each sweep dimension of every point, in C order."""
    dims = sweep_dims(data)
    return [dict(zip(dims, index, strict=True)) for index in product(*(range(data.sizes[d]) for d in dims))]


def by_point(values: Any, data: Any) -> NDArray[Any]:
    """(P, …) values of a variable that lies along the sweep of `data`, its points in C order."""
    dims = sweep_dims(data)
    own = values.transpose(*dims, ...)
    flat: NDArray[Any] = own.values.reshape(math.prod(own.shape[: len(dims)]), *own.shape[len(dims) :])
    return flat


def axis_names(data: Any) -> list[str]:
    """Names of the swept parameters of an opened result file (its root dataset)."""
    sweep = set(sweep_dims(data))
    return [str(name) for name in data.coords if data[name].dims and set(data[name].dims) <= sweep]


ASKED = ("force_", "work_", "section_force_", "probe_", "reaction_", "theta_mean_", "von_mises_")
"""How the names of numbers that `output.probes` and `output.quantities` ask for begin (data.on_request)."""


def asked(data: Any) -> list[str]:
    """Names of these numbers in a run's data, in the order of the file."""
    return [str(name) for name in data.data_vars if str(name).startswith(ASKED)]


def of_largest(data: Any) -> Any:
    """The table of a run with one number for what a level has once: of several geometries the largest."""
    if GEOMETRIES not in data.attrs:
        return data
    names = [name for name in ("h_max", "n_dof", "n_contact", "time_mesh", "time_assemble") if name in data]
    return data.assign({name: data[name].max([d for d in data[name].dims if d != "level"]) for name in names})
