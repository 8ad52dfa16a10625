"""Read all of a file that has no whole seal in a process of its own, where a crash or a hang of the library is told.

`python -m tcstudy.data.probe FILE` prints the global attributes as JSON.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

SECONDS = 60.0
"""For reading; an ordinary file takes a fraction of one."""
_SLACK, _FACTOR = 100_000_000, 1000
"""A file may state so many bytes, and so many times its size, of values (compressed ones, or never written)."""
_SLAB = 1 << 26
"""Bytes above which a variable is read piece by piece."""


class Unreadable(Exception):
    """The file cannot be read; the text says why."""


def probe(file: Path) -> dict[str, Any]:
    """The global attributes of a file all of which can be read. Raises Unreadable, OSError."""
    now = file.stat()
    return _probe(os.path.realpath(file), now.st_ino, now.st_size, now.st_mtime_ns)


@lru_cache(maxsize=16)
def _probe(file: str, inode: int, size: int, changed: int) -> dict[str, Any]:  # noqa: ARG001
    command = [sys.executable, "-m", __name__, file]
    environment = {**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONWARNINGS": "ignore"}
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, timeout=SECONDS, env=environment, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise Unreadable("the netCDF library does not come to an end with it") from error
    if done.returncode not in (0, 1):
        raise Unreadable("the netCDF library crashes on it")
    try:
        answer = json.loads(done.stdout)
    except ValueError as error:
        raise Unreadable("the netCDF library cannot read it") from error
    if done.returncode:
        raise Unreadable(str(answer))
    return dict(answer)


def read_all(file: str) -> dict[str, Any]:
    """The global attributes, after every attribute and every value of the file has been read once."""
    import netCDF4

    with netCDF4.Dataset(file) as nc:
        nc.set_auto_maskandscale(False)
        groups = list(_groups(nc))
        stated = sum(int(v.size) * _bytes_of(v) for group in groups for v in group.variables.values())
        if stated > _SLACK + _FACTOR * os.path.getsize(file):
            raise Unreadable(f"it states {stated:.2g} bytes of values, which it cannot hold")
        for group in groups:
            plain_attributes(group)
            for variable in group.variables.values():
                plain_attributes(variable)
                _read(variable)
        return plain_attributes(nc)


def plain_attributes(holder: Any) -> dict[str, Any]:
    """The attributes of a dataset, group or variable by name, as JSON can hold them."""
    values = {name: holder.getncattr(name) for name in holder.ncattrs()}
    return {name: value.tolist() if hasattr(value, "tolist") else value for name, value in values.items()}


def _groups(group: Any) -> Iterator[Any]:
    yield group
    for inner in group.groups.values():
        yield from _groups(inner)


def _bytes_of(variable: Any) -> int:
    return 8 if variable.dtype is str else int(variable.dtype.itemsize)


def _read(variable: Any) -> None:
    if int(variable.size) * _bytes_of(variable) <= _SLAB or not variable.ndim:
        variable[...]
        return
    for i in range(variable.shape[0]):
        variable[i]


def _main(file: str) -> int:
    try:
        answer, code = json.dumps(read_all(file), default=str), 0
    except Exception as error:  # whatever it is called, the file is at fault
        text = (error.strerror if isinstance(error, OSError) else None) or f"{error}"
        answer, code = json.dumps(text.splitlines()[0] if text else type(error).__name__), 1
    print(answer)
    return code


if __name__ == "__main__":
    raise SystemExit(_main(sys.argv[1]))
