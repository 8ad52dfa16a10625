"""What a second core gives a sweep, and what memory it takes: `python -m tests.benchmarks.cores [POINTS]`.

Without POINTS, results/cores.md and results/cores.png are written, in four minutes of a machine that does nothing else.

The quickstart's body with one softening law, m ≈ 100: 40 α × 40 θ̄ × δ, by one process and by two workers in turns.
Wall times tell the ratio. CPU times bound it where other work disturbs: what the run does before its first block and
after its last one is for one core, all else for two, the run's own share in it included.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from tcstudy.reports.figures.style import INK, WIDTH, save, styled
from tests.benchmarks.panels import inches

ROOT = Path(__file__).parents[2]
RUNS, RATIOS, SIZES = 2, (25_600, 51_200, 102_400), (10**4, 10**5, 10**6)
"""Runs of each kind, and numbers of points: of the ratio and of the memory."""
PAUSE = 0.2
"""Seconds from one look at the memory to the next."""
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
"""Modules compiled once, as where the package is installed: three processes that compile them cost 0.5 s."""
ENVIRONMENT["OPENBLAS_NUM_THREADS"] = "1"
QUICK = str(ROOT / "configs" / "quickstart.yaml")
COARSE, FINE = "{maxh: 20 mm, levels: 1}", "{maxh: 2 mm, levels: 1, refine: 3}"
LAW = "friction={law: slip-weakening, tau_s: 40 MPa, tau_k: 10 MPa}"
RUN = """
import sys, time
from tcstudy.cli import main
from tcstudy.study.workers import WorkerPool  # imports little, so that workers start as early as in any run

marks = []

def marked(method):
    def call(self, *given):
        marks.append((time.process_time(), time.perf_counter()))
        return method(self, *given)
    return call

WorkerPool.blocks, WorkerPool.close = marked(WorkerPool.blocks), marked(WorkerPool.close)
code = main(sys.argv[1:])
spent = marks[1][0] - marks[0][0]
print(time.process_time() - spent, spent, marks[1][1] - marks[0][1])
sys.exit(code)
"""
"""A run that says its CPU seconds outside and inside the time in which blocks are solved, and that time."""


@dataclass(frozen=True)
class Taken:
    """Seconds of a run: wall; of that its blocks; CPU of its own process without and with blocks, of workers."""

    wall: float
    blocks: float
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


def changes(mesh: str, alphas: int, surroundings: int, deltas: int) -> list[str]:
    """What makes the quickstart the study that is measured, a sweep of so many values each."""
    grid = f"alpha: {{linspace: [100, 400, {alphas}]}}, theta_bar: {{linspace: [0, 20, {surroundings}]}}"
    return [f"mesh={mesh}", LAW, f"sweep={{{grid}, friction.delta: {{linspace: [20 um, 60 um, {deltas}]}}}}"]


def run(folder: Path, jobs: int, points: int) -> Taken:
    """One run in a process of its own."""
    words = [f"--set={change}" for change in changes(FINE, 40, 40, max(2, points // 1600))]
    command = [sys.executable, "-c", RUN, "run", QUICK, *words, f"--output={folder / 'cores.nc'}", "-q", "--force"]
    before, since = os.times(), time.perf_counter()
    done = subprocess.run(
        [*command, f"--jobs={jobs}"], env=ENVIRONMENT, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True
    )
    wall, after = time.perf_counter() - since, os.times()
    alone, beside, blocks = (float(word) for word in done.stdout.splitlines()[-1].split())
    total = after.children_user + after.children_system - before.children_user - before.children_system
    return Taken(wall, blocks, alone, beside, max(0.0, total - alone - beside))


@dataclass(frozen=True)
class Ratio:
    """What a second core gives: wall seconds of one process, of two workers; ratio of the blocks alone, by CPU."""

    one: float
    two: float
    blocks: float
    cpu: float


def ratio(points: int) -> Ratio:
    """One process and two workers in turns, the least of each."""
    found: dict[int, list[Taken]] = {1: [], 2: []}
    with TemporaryDirectory() as folder:
        for _ in range(RUNS):
            for jobs, taken in found.items():
                taken.append(run(Path(folder), jobs, points))
                one = taken[-1]
                cpu = f"CPU {one.alone:.1f} alone, {one.beside:.1f} beside, {one.workers:.1f} of workers"
                print(f"--jobs {jobs}: {one.wall:6.2f} s, {cpu}; load {os.getloadavg()[0]:.1f}", flush=True)
    wall = [min(one.wall for one in taken) for taken in found.values()]
    blocks = [min(one.blocks for one in taken) for taken in found.values()]
    cpu = min(one.cpu for one in found[1]) / min(one.shared for one in found[2])
    own = Ratio(*wall, blocks[0] / blocks[1], cpu)
    print(f"{points} points: {own}", flush=True)
    return own


def held(process: int) -> float:
    """Bytes that a process and those below it hold, shared pages counted once (Linux)."""
    found, waiting = 0.0, [process]
    while waiting:
        at = Path("/proc") / str(waiting.pop())
        try:
            rollup = (at / "smaps_rollup").read_text(encoding="utf-8")
            waiting += [int(word) for word in (at / "task" / at.name / "children").read_text(encoding="utf-8").split()]
        except OSError:  # it has just ended
            continue
        found += 1024.0 * sum(int(line.split()[1]) for line in rollup.splitlines() if line.startswith("Pss:"))
    return found


def memory(points: int) -> tuple[float, float]:
    """(wall seconds, largest number of bytes held) of a run with two workers, m = 11."""
    side = round(points ** (1.0 / 3.0))
    words = [f"--set={change}" for change in changes(COARSE, side, side, side)]
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "tcstudy", "run", QUICK, *words, f"--output={Path(folder) / 'm.nc'}", "-q"]
        since, most = time.perf_counter(), 0.0
        running = subprocess.Popen([*command, "--jobs=2"], env=ENVIRONMENT, cwd=ROOT, stdout=subprocess.PIPE)
        while running.poll() is None:
            most = max(most, held(running.pid))
            time.sleep(PAUSE)
        assert running.returncode == 0
        return time.perf_counter() - since, most


def report(ratios: dict[int, Ratio], sizes: dict[int, tuple[float, float]]) -> Iterator[str]:
    """The text of results/cores.md."""
    yield "Made by `python -m tests.benchmarks.cores`, with `cores.png`, on 2 processors; one BLAS thread a process."
    yield "Whole commands: start, meshing, solving, file. Blocks: from the first given to the last written,"
    yield "what workers wait for at their start included. By CPU times: what two undisturbed cores could give at most."
    yield ""
    yield "| points, m ≈ 100 | one process [s] | two workers [s] | ratio | of the blocks | by CPU times |"
    yield "|---|---|---|---|---|---|"
    for points, x in ratios.items():
        yield f"| {points:,} | {x.one:.1f} | {x.two:.1f} | {x.one / x.two:.2f} | {x.blocks:.2f} | {x.cpu:.2f} |"
    yield ""
    yield "| points, m = 11, two workers | time [s] | largest memory of all processes [MB] |"
    yield "|---|---|---|"
    for points, (seconds, most) in sizes.items():
        yield f"| {points:,} | {seconds:.1f} | {most / 1e6:.0f} |"


def draw(ratios: dict[int, Ratio], sizes: dict[int, tuple[float, float]], target: Path) -> None:
    """Speed-up of two workers, and memory, over the number of points."""
    with styled():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(WIDTH, 3.0))
        wide = 0.5 * WIDTH - 1.0
        left = inches(figure, 0.62, 0.52, wide, 2.1)
        left.plot(list(ratios), [x.one / x.two for x in ratios.values()], "o-", color="#0072b2", label="whole commands")
        left.plot(list(ratios), [x.blocks for x in ratios.values()], "D-", color="#009e73", label="their blocks")
        left.plot(list(ratios), [x.cpu for x in ratios.values()], "s:", color=INK, label="by CPU times", linewidth=1.0)
        left.set(xscale="log", ylim=(1.0, 2.0), xlabel="points, m ≈ 100", ylabel="two workers against one process")
        left.set_xticks(list(ratios), [f"{points:,}" for points in ratios])
        left.minorticks_off()
        left.legend(frameon=False, loc="lower right")
        left.set_title("Speed-up")
        right = inches(figure, 0.5 * WIDTH + 0.62, 0.52, wide, 2.1)
        right.plot(list(sizes), [most / 1e6 for _, most in sizes.values()], "o-", color="#0072b2")
        right.set(xscale="log", ylim=(0.0, None), xlabel="points, m = 11", ylabel="MB, all processes")
        right.set_title("Memory")
        save(figure, target)


def main() -> None:
    """One ratio, or all that is written."""
    if len(sys.argv) > 1:
        ratio(int(sys.argv[1]))
        return
    ratios = {points: ratio(points) for points in RATIOS}
    sizes = {}
    for points in SIZES:
        sizes[points] = memory(points)
        print(f"{points} points: {sizes[points][0]:.1f} s, {sizes[points][1] / 1e6:.0f} MB", flush=True)
    text = "\n".join(report(ratios, sizes)) + "\n"
    (ROOT / "results" / "cores.md").write_text(text, encoding="utf-8")
    draw(ratios, sizes, ROOT / "results" / "cores.png")
    print(text, end="")


if __name__ == "__main__":
    main()
