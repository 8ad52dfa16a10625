"""The seal at the end of a result file: a SHA-256 of all bytes before it.

It tells, without the netCDF library, that tcstudy wrote a file and that no byte of it has changed since: on a damaged
file the library may crash or never come back. The library ignores what follows the end that a file states; a program
that changes the file cuts the seal off.
"""

from __future__ import annotations

import hashlib
import os
from enum import Enum
from functools import lru_cache
from pathlib import Path
from typing import BinaryIO

_MARK = b"\ntcstudy result, sha256 "
_LENGTH = len(_MARK) + 64 + 1
_BLOCK = 1 << 20


class Seal(Enum):
    """WHOLE: the file is as it was written; BROKEN: it has changed; NONE: changed, cut, older, or a stranger's."""

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
    return _seal_of(os.path.realpath(file), now.st_ino, now.st_size, now.st_mtime_ns)


@lru_cache(maxsize=16)
def _seal_of(file: str, inode: int, size: int, changed: int) -> Seal:
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
