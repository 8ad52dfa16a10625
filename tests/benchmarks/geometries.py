"""What many geometries cost: `python -m tests.benchmarks.geometries [PYTHON]` writes its part of
results/speed.md.

Study:   the quickstart with 1, 400 and 2,000 radii of its hole, one point and one mesh each
Figures: CPU time of whole commands, as processes of their own with one thread, and their memory
PYTHON:  the interpreter of another checkout, whose run of 400 is measured between two of this one
"""

import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from tcstudy.data import store
from tcstudy.data.files import collect
from tcstudy.data.store import Results
from tcstudy.executors.processes import keep_freed_memory
from tcstudy.read.study import read_study_text
from tcstudy.study import run as run_module
from tests.benchmarks.cases import publish_chapter

CONFIG = Path(__file__).parents[2] / "configs" / "quickstart.yaml"
COUNTS = (1, 400, 2_000)
COMMANDS = {
    "`run`": ("run", "STUDY", "--jobs", "1", "-q", "-o", "FILE"),
    "`show -q`": ("show", "FILE", "-q"),
    "`show`": ("show", "FILE"),
    "`export --csv`": ("export", "FILE", "--csv", "-o", "FILE.csv"),
    "`report`": ("report", "FILE", "-o", "FILE.html"),
}


@dataclass(frozen=True)
class Cost:
    """CPU time [s] and largest memory [MB] of a command."""

    seconds: float
    megabytes: float

    @property
    def words(self) -> str:
        """Both, as a cell of a table."""
        return f"{self.seconds:.2f} s, {self.megabytes:.0f} MB"


def study_text(count: int) -> str:
    """Return the quickstart with so many radii of its hole."""
    text = CONFIG.read_text(encoding="utf-8")
    text = re.sub(r"levels: \d+", "levels: 1", text[: text.index("sweep:")])
    radii = (5.0 + 15.0 * i / max(1, count - 1) for i in range(count))
    listed = ", ".join(f"{radius:.7g} mm" for radius in radii)
    return f"{text}sweep:\n  body.holes[0].circle.radius: [{listed}]\n"


def cost_of(words: Sequence[str], python: str = sys.executable) -> Cost:
    """Return what a command costs as a process of its own."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    # -P: the package of that interpreter, not the one in this folder
    child = [python, "-P", "-m", "tcstudy", *words]
    told = subprocess.run(
        [sys.executable, "-S", "-c", WATCH, *child],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        check=True,
        text=True,
    )
    seconds, kilobytes = told.stdout.split()[-2:]
    return Cost(float(seconds), float(kilobytes) / 1024)


WATCH = """
import os, subprocess, sys
child = subprocess.Popen(sys.argv[1:], stdout=subprocess.DEVNULL)
_, status, usage = os.wait4(child.pid, 0)
print(usage.ru_utime + usage.ru_stime, usage.ru_maxrss)
sys.exit(os.waitstatus_to_exitcode(status))
"""
"""A small process that starts a command and prints its CPU time and memory: a child of a large one
begins with the memory of its parent."""


def command(name: str, folder: Path, count: int) -> list[str]:
    """Return the words of one of COMMANDS."""
    given = {"STUDY": f"{folder}/{count}.yaml", "FILE": f"{folder}/{count}.nc"}
    return [re.sub("STUDY|FILE", lambda mark: given[mark[0]], word) for word in COMMANDS[name]]


def beside(count: int, folder: Path) -> tuple[float, float]:
    """Return CPU milliseconds a geometry that a run takes beside mesh to solve, and of them those
    of the final write."""
    since = time.process_time()
    study = read_study_text(study_text(count))
    reading = time.process_time() - since
    since, found = time.process_time(), {}
    for number, variant in enumerate(study.variants):
        assert variant.study is not None
        found[number] = run_module.solve_geometry(variant.study)
    solving = time.process_time() - since
    since = time.process_time()
    run_module.execute(study, folder / "beside.nc", jobs=1)
    whole = reading + time.process_time() - since

    def of(number: int) -> Results:
        own = study.variants[number].study or study
        levels = [one for one in found[number] if isinstance(one, run_module.LevelRecord)]
        blocks = [one for one in found[number] if isinstance(one, run_module.BlockRecord)]
        return Results(own, lambda: levels, lambda: blocks)

    about = collect(study, ("tcstudy",))
    since = time.process_time()
    whole_results = Results(study, tuple, tuple, about)
    store.write(folder / "written.nc", whole_results, {i: of(i) for i in found})
    writing = time.process_time() - since
    return 1e3 * (whole - solving) / count, 1e3 * writing / count


def lines(other: str | None) -> Iterator[str]:
    """Yield the figures."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        for count in COUNTS:
            (folder / f"{count}.yaml").write_text(study_text(count), encoding="utf-8")
        table = {row: [cost_of(command(row, folder, n)) for n in COUNTS] for row in COMMANDS}
        sizes = [(folder / f"{count}.nc").stat().st_size for count in COUNTS]
        yield f"CPU time and memory of commands, one thread; load {os.getloadavg()[0]:.0f}."
        yield ""
        yield (
            "| command | "
            + " | ".join(
                f"{count:,} {'geometry' if count == 1 else 'geometries'}" for count in COUNTS
            )
            + " |"
        )
        yield "|---" * (len(COUNTS) + 1) + "|"
        for row, costs in table.items():
            yield f"| {row} | " + " | ".join(cost.words for cost in costs) + " |"
        yield "| file | " + " | ".join(f"{size / 1e3:.0f} kB" for size in sizes) + " |"
        yield ""
        each = (sizes[1] - sizes[0]) / (COUNTS[1] - 1) / 1e3
        yield f"- a geometry of one point adds {each:.2f} kB to a file;"
        overhead, writing = beside(COUNTS[1], folder)
        yield (
            f"- beside mesh and solution a run takes {overhead:.1f} ms per geometry, reading included; "
            f"{writing:.2f} ms of it are the final write;"
        )
        if other is not None:
            words = command("`run`", folder, COUNTS[1])
            ours = [cost_of([*words, "--force"])]
            theirs = cost_of([*words[:-1], f"{folder}/theirs.nc"], other)
            ours.append(cost_of([*words, "--force"]))
            ratio = 0.5 * sum(cost.seconds for cost in ours) / theirs.seconds
            yield (
                f"- `run` of {COUNTS[1]} takes {ratio:.2f} of the time of version 0.8 ({theirs.words})."
            )


def main(arguments: Sequence[str] = ()) -> None:
    keep_freed_memory()
    other = next(iter(arguments), None)
    publish_chapter(
        "speed", "Many geometries", f"geometries{' PYTHON' if other else ''}", lines(other)
    )


if __name__ == "__main__":
    main(sys.argv[1:])
