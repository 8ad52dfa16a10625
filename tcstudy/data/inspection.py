"""Test whether a file without a seal can be read at all, in a process beside this one.

The HDF5 library loops, crashes or asks for any amount of memory on some damaged files, and nothing
in its own process can stop it. So a file whose bytes may have changed is read once by a process
with limits of time and memory. This module is also what that process runs, by its path: it imports
nothing of tcstudy.
"""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

MIN_SECONDS = 2.5
"""CPU time that the process has for a small file [s]."""
BYTES_PER_SECOND = 4e6
"""Rate at which the process must read a large file, per CPU time [byte/s]."""
WAIT_FACTOR = 8.0
"""Wall time over CPU time after which the process is ended: the machine may be shared."""
MAX_MEMORY = 2**31
"""Address space of the process beyond the size of the file [byte]."""
MAX_EXPANSION = 2000
"""Largest size of a variable over the size of the file; compression cannot exceed it."""
MIN_SIZE = 2**16
"""File size below which MAX_EXPANSION counts this one [byte]."""
MAX_READ = 2**26
"""Size that is read of a variable, from its begin and from its end [byte]."""


def damage_of(path: Path) -> str:
    """Return why a file cannot be read, in one line; empty if it can."""
    seconds = MIN_SECONDS + path.stat().st_size / BYTES_PER_SECOND
    command = [sys.executable, "-P", __file__, os.fspath(path), str(math.ceil(seconds))]
    try:
        process = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=WAIT_FACTOR * seconds,
            # a thread of OpenBLAS takes address space, of which there is a limit
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        )
    except subprocess.TimeoutExpired:
        return "reading it does not end"
    except OSError:  # no more processes: it is read without this precaution
        return ""
    if process.returncode == 0:
        return ""
    if process.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return "reading it does not end"
    lines = process.stdout.decode(errors="replace").splitlines()
    return lines[-1] if lines else "the netCDF library fails on it"


def read_whole(path: str) -> None:
    """Read a file of tcstudy: all attributes, and of every variable the begin and the end.

    Of a file that does not say it is of tcstudy only the global attributes are read. Raises
    whatever the netCDF library raises, ValueError for a variable of impossible size.
    """
    import netCDF4

    with netCDF4.Dataset(path) as nc:
        attributes = {name: nc.getncattr(name) for name in nc.ncattrs()}
        if not str(attributes.get("source", "")).startswith("tcstudy"):
            return
        max_size = MAX_EXPANSION * max(MIN_SIZE, os.path.getsize(path))
        for group in _groups(nc):
            for name in group.ncattrs():
                group.getncattr(name)
            for variable in group.variables.values():
                variable.set_auto_mask(False)
                _read_variable(variable, max_size)


def _groups(group: Any) -> Iterator[Any]:
    yield group
    for child in group.groups.values():
        yield from _groups(child)


def _read_variable(variable: Any, max_size: int) -> None:
    for name in variable.ncattrs():
        variable.getncattr(name)
    item_bytes = 16 if variable.dtype is str else variable.dtype.itemsize
    declared = item_bytes * math.prod(variable.shape)
    if declared > max_size:
        raise ValueError(f"{variable.name} would have {declared:.3g} bytes")
    if not variable.ndim:
        variable[...]
        return
    length = variable.shape[0]
    rows = max(1, MAX_READ * length // max(1, declared))
    variable[:rows]
    if rows < length:
        variable[-rows:]


def _limit(seconds: int, size: int) -> None:
    """Limit time and memory of this process, where the system can."""
    try:
        import resource
    except ImportError:  # Windows, where only the parent watches the time
        return
    memory = MAX_MEMORY + size
    limits = {
        resource.RLIMIT_CPU: seconds,
        resource.RLIMIT_AS: memory,
        resource.RLIMIT_CORE: 0,
    }
    for resource_kind, limit in limits.items():
        with suppress(ValueError, OSError):  # a lower limit of the whole machine stays
            resource.setrlimit(resource_kind, (limit, limit))


def _main(path: str, seconds: str) -> int:
    _limit(int(seconds), os.path.getsize(path))
    try:
        read_whole(path)
    except MemoryError:
        sys.stdout.write("it asks for more memory than it can need\n")
    except Exception as error:
        text = getattr(error, "strerror", None) or str(error) or type(error).__name__
        sys.stdout.write(text.splitlines()[0] + "\n")
    else:
        return 0
    return 1


if __name__ == "__main__":
    sys.exit(_main(*sys.argv[1:]))
