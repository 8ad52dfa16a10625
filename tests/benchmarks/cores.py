"""What a second core gives a sweep: `python -m tests.benchmarks.cores [POINTS]`, on a machine with nothing else to do.

The quickstart's body with one softening law, m ≈ 100: 40 α × 40 θ̄ × δ, by one process and by two workers in turns.
Wall times tell the ratio. CPU times bound it where other work disturbs: what the run does before its first block and
after its last one is for one core, all else for two, the run's own share in it included.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[2]
POINTS, RUNS = 51_200, 2
WORDS = (
    ("mesh", "{maxh: 2 mm, levels: 1, refine: 3}"),
    ("friction", "{law: slip-weakening, tau_s: 40 MPa, tau_k: 10 MPa, delta: 40 um}"),
)
RUN = """
import sys, time
from tcstudy.cli import main
from tcstudy.study.workshop import Workshop

work, spent = Workshop.work, 0.0

def watched(self, finished):
    global spent
    since = time.process_time()
    yield from work(self, finished)
    spent += time.process_time() - since

Workshop.work = watched
code = main(sys.argv[1:])
print(time.process_time() - spent, spent)
sys.exit(code)
"""
"""A run that says its own CPU seconds: outside and inside the time in which blocks are solved."""


@dataclass(frozen=True)
class Taken:
    """Seconds of a run: wall; CPU of its own process alone and while blocks are solved; CPU of its workers."""

    wall: float
    alone: float
    beside: float
    workers: float

    @property
    def cpu(self) -> float:
        """All CPU seconds."""
        return self.alone + self.beside + self.workers

    @property
    def shared(self) -> float:
        """Wall seconds on two cores that nothing disturbs, if the work is split evenly."""
        return self.alone + 0.5 * (self.beside + self.workers)


def run(folder: Path, jobs: int, points: int) -> Taken:
    """One run in a process of its own."""
    grid = "alpha: {linspace: [100, 400, 40]}, theta_bar: {linspace: [0, 20, 40]}"
    sweep = f"{{{grid}, friction.delta: {{linspace: [20 um, 60 um, {max(2, points // 1600)}]}}}}"
    words = [f"--set={key}={value}" for key, value in (*WORDS, ("sweep", sweep))]
    study = str(ROOT / "configs" / "quickstart.yaml")
    command = [sys.executable, "-c", RUN, "run", study, *words, f"--output={folder / 'cores.nc'}", "-q", "--force"]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    before, since = os.times(), time.perf_counter()
    done = subprocess.run(
        [*command, f"--jobs={jobs}"], env=environment, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True
    )
    wall, after = time.perf_counter() - since, os.times()
    alone, beside = (float(word) for word in done.stdout.splitlines()[-1].split())
    total = after.children_user + after.children_system - before.children_user - before.children_system
    return Taken(wall, alone, beside, max(0.0, total - alone - beside))


def main() -> None:
    """Measure in turns; the least of each counts."""
    points = int(sys.argv[1]) if len(sys.argv) > 1 else POINTS
    found: dict[int, list[Taken]] = {1: [], 2: []}
    with TemporaryDirectory() as folder:
        for _ in range(RUNS):
            for jobs, taken in found.items():
                taken.append(run(Path(folder), jobs, points))
                one = taken[-1]
                cpu = f"CPU {one.alone:.1f} alone, {one.beside:.1f} beside, {one.workers:.1f} of workers"
                print(f"--jobs {jobs}: {one.wall:6.2f} s, {cpu}; load {os.getloadavg()[0]:.1f}", flush=True)
    wall = [min(one.wall for one in taken) for taken in found.values()]
    cpu = min(one.cpu for one in found[1]) / min(one.shared for one in found[2])
    print(f"{points} points: {wall[0]:.1f} s → {wall[1]:.1f} s, {wall[0] / wall[1]:.2f} ×; by CPU times {cpu:.2f} ×")


if __name__ == "__main__":
    main()
