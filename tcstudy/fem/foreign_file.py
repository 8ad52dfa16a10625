"""STEP and BREP files of strangers: a child process reads them first, as a bad one makes the kernel hang or crash.

The child reads the file and measures all its faces and edges, as the package will. If it ends well within its time,
the same steps are safe in this process.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

SECONDS, SECONDS_A_MEGABYTE = 5.0, 10.0
"""Processor time that the kernel may take; it reads 10 MB in about 5 s."""
MEMORY, MEMORY_A_BYTE = 2_000_000_000, 200
"""Memory that it may take [B]: a few words of a bad file make it ask for all there is."""
SLOWER = 20.0
"""Wall time over processor time on a machine that does other work; it alone counts where there is no other limit."""
PROGRAM = "import sys; from tcstudy.fem.foreign_file import examine; examine(sys.argv[1], float(sys.argv[2]))"
"""What the child runs."""
POINTS = 257
"""Places at which curves are looked at."""


def file_fault(path: Path) -> str | None:
    """What is wrong with a STEP or BREP file, None if the kernel can read it; judged once until the file changes."""
    try:
        state = path.stat()
    except OSError as error:
        return f"cannot be read ({error.strerror})"
    return _fault(str(path.resolve()), state.st_size, state.st_mtime_ns)


@lru_cache(maxsize=16)
def _fault(path: str, size: int, _changed: int) -> str | None:
    seconds = SECONDS + SECONDS_A_MEGABYTE * size / 1e6
    package = str(Path(__file__).parents[2])
    try:
        child = subprocess.run(
            [sys.executable, "-P", "-c", PROGRAM, path, str(seconds)],
            env=os.environ | {"PYTHONPATH": os.pathsep.join([package, *filter(None, [os.environ.get("PYTHONPATH")])])},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            timeout=SLOWER * seconds,
        )
    except subprocess.TimeoutExpired:
        return f"the geometry kernel did not finish reading it within {SLOWER * seconds:.0f} s"
    if child.returncode == 0:
        return None
    if child.returncode == -getattr(signal, "SIGXCPU", 0):
        return f"the geometry kernel did not finish reading it within {seconds:.0f} s of processor time"
    last = child.stderr.decode(errors="replace").strip().rpartition("\n")[2]
    if child.returncode < 0 or not last:
        return "the geometry kernel crashes on it"
    return f"cannot be read as STEP or BREP ({last.rpartition(': ')[2]})"


def examine(path: str, seconds: float) -> None:
    """Read a file and measure what is in it, within some processor time; for a process that may be lost."""
    from netgen import occ

    _limit(seconds, MEMORY + MEMORY_A_BYTE * os.path.getsize(path))
    for face in occ.OCCGeometry(path, dim=2).shape.faces:
        _ = face.mass, face.center, face.bounding_box
        for edge in face.edges:
            low, high = edge.parameter_interval
            for i in range(POINTS):
                t = low + (high - low) * i / (POINTS - 1)
                _ = edge.Value(t), edge.Tangent(t)
            _ = edge.mass, edge.center, edge.Distance(occ.Vertex(occ.Pnt(0, 0, 0)))


def _limit(seconds: float, memory: int) -> None:
    """Let this process end when it has used the given processor time from now on, or the given memory in all [B]."""
    try:
        import resource
    except ImportError:  # no such limit on Windows
        return
    used = resource.getrusage(resource.RUSAGE_SELF)
    limit = int(used.ru_utime + used.ru_stime + seconds) + 1
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
