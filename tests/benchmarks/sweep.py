"""What a sweep costs beyond its first point, and a large scene against one factorisation of its stiffness matrix."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tcstudy.offline.level import Level
from tcstudy.study.point import solve_point
from tests.benchmarks.stages import Clock, _ngsolve_matrix, finest, study_of

SWEEPS = {
    "10 α × 10 θ̄ × 10 laws": (10, 10, 10),
    "α alone": (1000, 1, 1),
}
COUNTS = (1, 3, 10, 30, 100, 300, 1000)
LEVELS, MAXH = 5, "mesh.maxh=10.5 mm"
RUNS = 5
SOLVED = 40
LARGE = 7
LARGE_RUNS = 2


def sweep_text(alphas: int, surroundings: int, laws: int) -> str:
    """The sweep section for the quickstart body."""
    named = ", ".join(
        f"l{i}: {{law: slip-weakening, tau_s: {30 + 2 * i} MPa, tau_k: 10 MPa, delta: 40 um}}" for i in range(laws)
    )
    alpha, theta_bar = np.geomspace(1.0, 1e4, alphas).tolist(), np.linspace(20.0, -20.0, surroundings).tolist()
    return f"sweep={{alpha: {alpha}, theta_bar: {theta_bar}, friction: {{{named}}}}}"


def shape_of(kind: str, points: int) -> tuple[int, int, int]:
    """How a number of points is spread over α, θ̄ and laws."""
    if kind == "α alone":
        return points, 1, 1
    spread = {1: (1, 1, 1), 3: (3, 1, 1), 10: (10, 1, 1), 30: (10, 3, 1), 100: (10, 10, 1), 300: (10, 10, 3)}
    return spread.get(points, (10, 10, 10))


def measure(progress: Callable[[str], None]) -> xr.Dataset:
    """(kind, count, run) CPU times to condense a whole sweep, mesh excluded, and what a solve costs on average."""
    times = np.full((len(SWEEPS), len(COUNTS), RUNS), np.nan)
    solve = np.full(RUNS, np.nan)
    mesh = finest(study_of(LEVELS, MAXH))
    studies = {(k, n): study_of(LEVELS, MAXH, sweep_text(*shape_of(k, n))) for k in SWEEPS for n in COUNTS}
    first = studies["α alone", 1].scenes[0]
    Level(mesh, first).condensed(first)  # what is loaded once, is loaded
    for run in range(RUNS):
        for i, kind in enumerate(SWEEPS):
            for j, points in enumerate(COUNTS):
                study = studies[kind, points]
                clock = Clock()
                level = Level(mesh, study.scenes[0], study.scenes)
                for scene in study.scenes:
                    level.condensed(scene)
                    level.temperature(scene)
                times[i, j, run] = clock()
        places = range(0, len(study.scenes), len(study.scenes) // SOLVED)
        clock()
        for place in places:
            solve_point(study, level, place)
        solve[run] = clock() / len(places)
        cold, whole = times[0, 0, run], times[0, -1, run]
        progress(f"sweep, run {run + 1}: 1000 points cost {whole / cold:.2f} cold points, a solve {solve[run]:.3f} s")
    return xr.Dataset(
        {
            "sweep_time": (("kind", "count", "sweep_run"), times, {"units": "s", "long_name": "CPU time of a sweep"}),
            "solve_time": ("sweep_run", solve, {"units": "s", "long_name": "contact solve and certificate of a point"}),
        },
        {"kind": list(SWEEPS), "count": list(COUNTS)},
        {"sweep_n_dof": level.frames.n_dof},
    )


def measure_large(progress: Callable[[str], None]) -> xr.Dataset:
    """A scene of 20 points against NGSolve's factorisation, each in a process of its own."""
    rows: dict[str, list[float]] = {"large_time": [], "large_factor_time": [], "large_memory": []}
    n_dof = 0.0
    for _ in range(LARGE_RUNS):
        n_dof, cpu, memory = _in_process(_twenty_points)
        rows["large_time"].append(cpu)
        rows["large_memory"].append(memory)
        rows["large_factor_time"].append(_in_process(_one_factor)[0])
        progress(
            f"20 points on {n_dof:.0f} unknowns: {cpu / rows['large_factor_time'][-1]:.2f} factorisations, "
            f"{memory:.2f} GB"
        )
    units = {"large_memory": "GB"}
    data = {name: ("large_run", values, {"units": units.get(name, "s")}) for name, values in rows.items()}
    return xr.Dataset(data, attrs={"large_n_dof": int(n_dof)})


def _in_process(work: Callable[[Any], None]) -> tuple[float, ...]:
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=work, args=(sender,))
    process.start()
    answer = receiver.recv()
    process.join()
    return tuple(answer)


def _twenty_points(sender: Any) -> None:
    """(n_dof, CPU time from mesh to certificates, peak memory in GB)."""
    study = study_of(LARGE, "sweep={alpha: {geomspace: [100, 1000, 4]}, theta_bar: {linspace: [-20, 20, 5]}}")
    clock = Clock()
    level = Level(finest(study), study.scenes[0], study.scenes)
    neighbour = None
    for place in range(len(study.scenes)):
        record = solve_point(study, level, place, neighbour)
        if record.status[0] != 1 or record.u_T is None:
            raise RuntimeError(record.reasons[0])
        neighbour = record.u_T[0]
    sender.send((level.frames.n_dof, clock(), _peak_memory()))


def _peak_memory() -> float:
    """Most memory that this process has held [GB]; NaN where the system does not say (getrusage has the parent's)."""
    status = Path("/proc/self/status")
    if not status.exists():
        return float("nan")
    line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
    return float(line.split()[1]) * 1024 / 1e9


def _one_factor(sender: Any) -> None:
    """CPU time of one sparsecholesky factorisation."""
    study = study_of(LARGE)
    mesh = finest(study)
    form, free = _ngsolve_matrix(mesh, study.scenes[0], Level(mesh, study.scenes[0]).frames.fixed)
    clock = Clock()
    form.mat.Inverse(free, inverse="sparsecholesky")
    sender.send((clock(),))
