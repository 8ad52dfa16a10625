"""What many points on one body cost: `python -m tests.benchmarks.online` writes results/online.md.

Body:    the quickstart's at several mesh sizes, m = 11 to 352 contact nodes
Sweeps:  1,000 points each: softening with 10 δ, and the quickstart's four laws
Figures: CPU time of one thread, least of two, for the whole (loads, solve, certificates, journal, netCDF), once a
         level is assembled and its body condensed, and for solve and certificates alone, as workers
         do them
"""

import os
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import scipy.linalg

import tcstudy
from tcstudy.contact.problem import CondensedBody
from tcstudy.data.files import collect
from tcstudy.data.records import Journal
from tcstudy.data.store import Results, write
from tcstudy.executors.processes import keep_freed_memory
from tcstudy.laws.laws import Laws
from tcstudy.scene.study import Study
from tcstudy.study.run import stages
from tests.benchmarks.cases import publish
from tests.contact.contact_cases import solve_points

CONFIG = Path(__file__).parents[2] / "configs" / "quickstart.yaml"
LEVELS, RUNS = (0, 1, 2, 4, 5), 2


def studies() -> dict[str, Study]:
    """The sweeps as studies of the quickstart's body."""
    mesh = ["mesh.maxh=18.5 mm", f"mesh.levels={max(LEVELS) + 1}"]
    softening = "friction={law: slip-weakening, tau_s: 40 MPa, tau_k: 10 MPa}"
    alphas, deltas = (
        "alpha: {linspace: [100, 400, 10]}",
        "friction.delta: {linspace: [20 um, 60 um, 10]}",
    )
    grid = f"sweep={{{alphas}, theta_bar: {{linspace: [0, 20, 10]}}, {deltas}}}"
    four = ("sweep.alpha={linspace: [100, 400, 10]}", "sweep.theta_bar={linspace: [0, 20, 25]}")
    changes = {"softening": (softening, grid), "four laws": four}
    return {name: tcstudy.load(CONFIG, [*mesh, *own]) for name, own in changes.items()}


def measure(study: Study, level: int) -> tuple[int, float, float, float]:
    """(m, CPU ms a point to the file, of solve and certificates, and of one Cholesky factorisation
    of Ã)."""
    whole = solve = factor = np.inf
    for _ in range(RUNS):
        stage = next(islice(stages(study), level, None))
        assert stage.level is not None
        assert stage.record is not None
        stage.level.condensed(study.scenes[0])
        since = time.process_time()
        with (
            TemporaryDirectory() as folder,
            Journal.open(Path(folder) / "whole.nc", study) as journal,
        ):
            for record in (stage.record, *stage.blocks):
                journal.add(record)
            words = collect(study, ("tcstudy",))
            write(Path(folder) / "whole.nc", Results(study, journal.levels, journal.blocks, words))
            journal.discard()
        whole = min(whole, time.process_time() - since)
        problems = [stage.level.condensed(scene).problem for scene in study.scenes]
        body = CondensedBody.of(problems[0].A_tilde, problems[0].c)
        laws = {id(p.law): p.law for p in problems}
        law = np.array([list(laws).index(id(p.law)) for p in problems])
        loads, table = np.array([p.l_tilde for p in problems]), Laws.of(list(laws.values()))
        since = time.process_time()
        solve_points(body, loads, table, law)
        solve, since = min(solve, time.process_time() - since), time.process_time()
        scipy.linalg.cholesky(body.A_tilde, lower=True)
        factor = min(factor, time.process_time() - since)
    return body.m, 1e3 * whole / len(problems), 1e3 * solve / len(problems), 1e3 * factor


def lines() -> Iterator[str]:
    found = {name: [measure(study, level) for level in LEVELS] for name, study in studies().items()}

    def table(rows: list[list[str]]) -> Iterator[str]:
        yield from (
            "",
            head,
            "|---" * (len(LEVELS) + 1) + "|",
            *("| " + " | ".join(row) + " |" for row in rows),
        )

    head = "| sweep | " + " | ".join(f"m = {m}" for m, *_ in found["softening"]) + " |"
    load = f"load {os.getloadavg()[0]:.0f} on {os.cpu_count()} processors"
    yield f"CPU ms per point of one thread, shorter of two runs; {load}."
    yield "1,000 points at once, solve and certificates. potrf: one Cholesky factorisation of Ã."
    solves = [[name, *(f"{solve:.2f}" for _, _, solve, _ in own)] for name, own in found.items()]
    yield from table([*solves, ["potrf", *(f"{factor:.3f}" for *_, factor in found["softening"])]])
    yield from (
        "",
        "From the condensed body to the finished file (loads, solve, certificates, journal, netCDF):",
    )
    yield from table(
        [[name, *(f"{whole:.2f}" for _, whole, _, _ in own)] for name, own in found.items()]
    )


def main() -> None:
    keep_freed_memory()  # as whoever solves the blocks of a study does
    publish("online", lines())


if __name__ == "__main__":
    main()
