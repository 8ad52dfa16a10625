"""Random kills of workers and runs: `python -m tests.benchmarks.kills [KILLS] [SEED]`; 100 kills,
and 25.

A run of many small blocks with two workers, and one of many geometries, is started again and again.
At random times a worker or the run itself gets SIGKILL; a run that was killed is started again and
goes on from what it kept. The file in the end is compared with that of a run in one process that
nobody kills: every array to the bit, no point failed.

Writes results/kills.md.
"""

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from tcstudy.data.schema import PointStatus
from tcstudy.read.study import read_study
from tcstudy.study.run import execute
from tests.benchmarks.cases import publish
from tests.verification.scenes import RECTANGLE

COARSE = RECTANGLE.replace("maxh: 0.1, levels: 3", "maxh: 0.3, levels: 1")
STUDY = COARSE + "\nsweep: {friction.tau: {linspace: [0.005, 0.03, POINTS]}}\n"
WIDTHS = "body.rectangle.width: {linspace: [1.5, 2.5, POINTS]}"
GEOMETRIES = COARSE + f"\nsweep: {{{WIDTHS}, friction.tau: {{linspace: [0.005, 0.03, 5]}}}}\n"
"""The same body in many widths, each with five points, which a worker meshes and solves whole."""
RUN = """
import sys, time
from pathlib import Path
from tcstudy.errors import UserFault
from tcstudy.read.study import read_study
from tcstudy.study import level_solver
from tcstudy.study.run import execute
level_solver.MAX_POINTS = 2
class Slow:
    def begin(self, *_): print("begun", flush=True)
    def level(self, *_): ...
    def block(self, _):
        print("block", flush=True)
        time.sleep(float(sys.argv[4]))
try:
    execute(read_study(Path(sys.argv[1])), Path(sys.argv[2]), Slow(), jobs=int(sys.argv[3]))
except UserFault as fault:
    print(fault)
    sys.exit(2)
"""
PAUSE = 0.02
"""Seconds between blocks, so that kills find the run at work however fast it is."""


@dataclass
class Kills:
    """What was done: kills of workers and of runs, and how often a run was started."""

    workers: int = 0
    runs: int = 0
    starts: int = 0


def survive(folder: Path, kills: int, seed: int, points: int, text: str = STUDY) -> Kills:
    """Kill so often, let the last run end, and compare; raises AssertionError if anything was lost
    or differs.

    points: of the sweep, or its geometries
    """
    study, output, plain = folder / "study.yaml", folder / "killed.nc", folder / "plain.nc"
    study.write_text(text.replace("POINTS", str(points)))
    chance, done = random.Random(seed), Kills()
    words = [sys.executable, "-c", RUN, str(study), str(output), "2", str(PAUSE)]
    while not output.exists():
        assert done.starts < kills + 10, "runs end without a result"
        done.starts += 1
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as run:
            _one_run(run, kills, chance, done)
    execute(read_study(study), plain, jobs=1)
    assert_same(plain, output)
    return done


def _one_run(run: subprocess.Popen[str], kills: int, chance: random.Random, done: Kills) -> None:
    """One run, until it ends or is killed."""
    assert run.stdout is not None
    until = chance.randint(1, 9)  # blocks to be seen before the next kill
    for line in run.stdout:
        until -= line == "block\n"
        if until > 0 or done.workers + done.runs >= kills:
            continue
        time.sleep(chance.uniform(0.0, 2 * PAUSE))
        workers = children(run.pid)
        if chance.random() < 0.2 or not workers:
            run.kill()
            done.runs += 1
            return
        os.kill(chance.choice(workers), signal.SIGKILL)
        done.workers += 1
        until = chance.randint(5, 9)  # those that wait for the killed one, and some more
    assert run.wait() == 0, f"a run ended with {run.returncode}"


def children(parent: int) -> list[int]:
    """Its worker processes, whichever thread started them."""
    found = [
        Path(f"/proc/{parent}/task/{task}/children").read_text().split()
        for task in os.listdir(f"/proc/{parent}/task")
    ]
    return [int(pid) for pids in found for pid in pids]


def assert_same(one: Path, other: Path) -> None:
    """Whether two result files hold the same numbers, times aside."""
    with xr.open_datatree(one) as a, xr.open_datatree(other) as b:
        assert [node.path for node in a.subtree] == [node.path for node in b.subtree]
        for node in a.subtree:
            for name, values in node.data_vars.items():
                if not str(name).startswith("time"):
                    equal = np.array_equal(
                        values.values, b[node.path][name].values, equal_nan=values.dtype.kind == "f"
                    )
                    assert equal, f"{node.path}/{name} differs"
        assert np.all(a["status"].values == int(PointStatus.OK))


def main() -> None:
    kills, seed = (int(word) for word in (*sys.argv[1:], *("100", "0")[len(sys.argv) - 1 :]))
    lines = ["Two workers, kills at random:"]
    studies = (
        ("points in blocks of two", STUDY, kills, 20),
        ("geometries of five points", GEOMETRIES, kills // 4, 8),
    )
    for words, study, times, each in studies:
        with tempfile.TemporaryDirectory() as folder:
            done = survive(Path(folder), times, seed, each * times, study)
        killed = f"{done.workers} workers and {done.runs} runs killed, {done.starts} starts"
        lines.append(f"- one study of {each * times} {words}: {killed}")
    last = (
        "Nothing lost: every number is that of a run in one process, to the bit; no point failed."
    )
    publish("kills", [*lines, "", last], f" {kills} {seed}")


if __name__ == "__main__":
    main()
