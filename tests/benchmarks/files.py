"""What a result file costs: seconds, memory and bytes of the writer for sweeps of 3 to a million points.

`python -m tests.benchmarks.files [POINTS]` prints one row for each number of points; blocks are made up, no problem is
solved. Journal: from the records to the disk; file: from the journal to the sealed netCDF file; memory: the most that
the process held beside what it held before the first record.
"""

from __future__ import annotations

import multiprocessing
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tcstudy.data import schema
from tcstudy.data.journal import Journal
from tcstudy.data.provenance import Provenance
from tcstudy.data.records import BlockRecord, LevelRecord, PointStatus
from tcstudy.data.store import write
from tcstudy.scene.study import Axis, MeshPlan, OutputPlan, SolverPlan, Study

SIZES = (3, 36, 10_000, 1_000_000)
M = 11
BLOCK = 1024
PROVENANCE = Provenance("2026-01-02T03:04:05+00:00 tcstudy run", (("tcstudy", "0.1"),), "unknown")


def made_up_study(points: int) -> Study:
    """α × θ̄ × δ, as many of each as the cube root of the number of points allows; one level."""
    n = max(1, round(points ** (1 / 3)))
    counts = (points, 1, 1) if n**3 != points else (n, n, n)
    paths = (("heat", "alpha"), ("heat", "theta_bar"), ("friction", "delta"))
    labels = [tuple(np.linspace(1.0, 2.0, count).tolist()) for count in counts]
    named = zip(paths, labels, ("W m-2 K-1", "K", "m"), strict=True)
    axes = tuple(Axis(path[-1], path, one, one, units) for path, one, units in named)
    return Study(
        title="Made up", text="title: Made up\n", source=None, units="SI", mode="grid", axes=axes, scenes=(),
        mesh=MeshPlan((0.1,), 1), solver=SolverPlan(), output=OutputPlan(),
    )  # fmt: skip


def made_up_level() -> LevelRecord:
    s = np.linspace(0.0, 1.0, M)
    return LevelRecord(0, 0.1, 500, M, s, s, 0.0 * s, np.full(M, 1.0 / M), np.zeros(M, np.int8), ("film",), 1.0, 1.0)


def made_up_blocks(study: Study) -> Iterator[BlockRecord]:
    """Blocks in the order of a run: points of one law together, so that they lie a stride apart in the sweep."""
    count = int(np.prod(study.shape))
    order = np.arange(count).reshape(study.shape).transpose(2, 0, 1).ravel()
    kinds = {v.name: v for v in schema.ROOT if v.name in schema.NUMBERS}
    rng = np.random.default_rng(1)
    for number, start in enumerate(range(0, count, BLOCK)):
        points = order[start : start + BLOCK]
        p, smooth = len(points), points / count
        numbers: dict[str, Any] = {}
        for k, v in enumerate(kinds.values()):
            if v.dims[-1] == "start":
                numbers[v.name] = np.column_stack([smooth + i for i in range(len(schema.START_NAMES))])
            elif v.dtype == "f8":
                numbers[v.name] = np.sin(smooth * (k + 1)) + 1e-9 * rng.random(p)
            else:
                numbers[v.name] = np.floor(2.0 * rng.random(p) ** 4)
        line = np.sin(np.add.outer(smooth, np.arange(M)))
        yield BlockRecord(
            number, 0, study.shape, points.astype(np.intp), np.full(p, int(PointStatus.OK), np.int8), {}, numbers,
            line, line**2, (line > 0.5).astype(np.int8),
        )  # fmt: skip


def measured(points: int) -> tuple[float, float, float, int, int]:
    """(seconds of the journal, seconds of the file, memory [B], bytes of the journal, bytes of the file)."""
    study, levels = made_up_study(points), (made_up_level(),)
    with tempfile.TemporaryDirectory() as directory:
        output = Path(directory) / "made-up.nc"
        journal = Journal.open(output, study)
        write(output, made_up_study(1), levels, [], PROVENANCE)  # what is loaded once, is loaded
        before = peak_memory()
        start = time.perf_counter()
        made = 0.0
        journal.add(levels[0])
        blocks = made_up_blocks(study)
        while True:
            making = time.perf_counter()
            block = next(blocks, None)
            made += time.perf_counter() - making
            if block is None:
                break
            journal.add(block)
        journal.flush()
        kept = time.perf_counter()
        write(output, study, journal.levels(), journal.blocks, PROVENANCE)
        done = time.perf_counter()
        size = journal.path.stat().st_size
        journal.discard()
        return kept - start - made, done - kept, peak_memory() - before, size, output.stat().st_size


def peak_memory() -> float:
    """Most memory that this process has held [B]; NaN where the system does not say."""
    status = Path("/proc/self/status")
    if not status.exists():
        return float("nan")
    line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
    return float(line.split()[1]) * 1024


def main(arguments: list[str]) -> None:
    print("points     journal [s]  file [s]  memory [MB]  journal [kB]  file [kB]")
    for points in [int(a) for a in arguments] or SIZES:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            journal, file, memory, kept, size = pool.apply(measured, (points,))
        print(f"{points:<9} {journal:12.2f} {file:9.2f} {memory / 1e6:12.0f} {kept / 1e3:13.0f} {size / 1e3:10.1f}")


if __name__ == "__main__":
    main(sys.argv[1:])
