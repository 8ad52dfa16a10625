"""Accuracy against cost for one scene of a study: mesh families × solvers × levels, timed several times.

Errors are measured against the exact solution if the study gives one, else against an adaptive mesh with at least
FINER times the unknowns of the finest mesh measured. Every run starts from nothing (see `cost_runs`); families take
turns, so that a slow spell of the machine does not fall on one of them alone.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tcstudy.accuracy.front import dominated
from tcstudy.data.cost import MEASURES, STAGES, Cost, write_cost
from tcstudy.data.files import StoreError, check_writable
from tcstudy.data.provenance import collect
from tcstudy.data.records import PointStatus
from tcstudy.scene.records import Scene, Study
from tcstudy.study.cost_curves import Curve, first_run, time_again
from tcstudy.study.cost_errors import CostError, errors_of
from tcstudy.study.cost_runs import Progress
from tcstudy.study.locking import locking_note

__all__ = ["CostError", "cost_to_file", "measure"]

Array = NDArray[np.float64]
SOLVERS = ("separable-newton", "bundle-newton")
"""Compared beside those that the study names."""


def cost_to_file(
    study: Study, index: tuple[int, ...], point: str, runs: int, path: Path, progress: Progress, command: Sequence[str]
) -> int:
    """Measure accuracy against cost at one sweep point into a file; returns the number of solutions that failed.

    Raises CostError, StoreError if the file cannot be written, GeometryFailed if the body cannot be meshed.
    """
    problems = check_writable(path, 1_000_000)
    if problems:
        raise StoreError("; ".join(problems))
    with threadpool_limits(1, user_api="blas"):
        cost = measure(study, index, runs, progress)
    write_cost(path, study, replace(cost, point=point), collect(study, command))
    return int(np.count_nonzero((cost.status != PointStatus.OK) & (cost.status != PointStatus.NOT_RUN)))


def measure(study: Study, index: tuple[int, ...], runs: int, progress: Progress) -> Cost:
    """Errors and wall times of one sweep point on all families with all solvers.

    index: which sweep point;  runs: how often everything is timed
    Raises CostError if no mesh could be solved, GeometryFailed if the body cannot be meshed.
    """
    scene = study.scenes[int(np.ravel_multi_index(index, study.shape)) if study.shape else 0]
    names = dict.fromkeys((*study.solver.names, *SOLVERS))
    study = replace(study, solver=replace(study.solver, names=tuple(names)))
    clock = time.perf_counter()
    curves, notes = first_run(study, scene, progress)
    first = time.perf_counter() - clock
    errors, words, own_error = errors_of(study, scene, curves, progress)
    for run in range(1, runs):
        progress(f"run {run + 1} of {runs}", first * (runs - run))
        turn = run % len(curves)
        for curve in curves[turn:] + curves[:turn]:
            time_again(study, scene, curve)
    return _cost(study, scene, curves, errors, words, own_error, notes)


def _cost(
    study: Study,
    scene: Scene,
    curves: list[Curve],
    errors: dict[tuple[str, int, str], dict[str, float]],
    words: str,
    own_error: float,
    notes: list[str],
) -> Cost:
    """All curves as arrays, padded to the longest."""
    solvers = study.solver.names
    levels, runs = max(len(c.steps) for c in curves), len(curves[0].stages)
    shape = (len(curves), len(solvers), levels)
    h_max, n_dof = np.full((shape[0], levels), np.nan), np.full((shape[0], levels), -1, dtype=np.int32)
    n_contact, status = n_dof.copy(), np.zeros(shape, dtype=np.int8)
    reason = np.full(shape, "", dtype=object)
    times = np.full((*shape, runs), np.nan)
    stages = {stage: np.full(shape, np.nan) for stage in STAGES}
    measured = {m.name: np.full(shape, np.nan) for m in MEASURES if any(m.name in e for e in errors.values())}
    for f, curve in enumerate(curves):
        for level, (h, dofs, contact) in enumerate(curve.steps):
            h_max[f, level], n_dof[f, level], n_contact[f, level] = h, dofs, contact
            for name, record in curve.records[level].items():
                at = (f, solvers.index(name), level)
                status[at], reason[at] = record.status, record.reason
                own = [run[level][name] for run in curve.stages]
                times[at] = [one.total for one in own]
                best = min(own, key=lambda one: one.total)
                for stage in STAGES:
                    stages[stage][at] = getattr(best, stage)
                for measure_name, error in errors[curve.family, level, name].items():
                    if measure_name in measured:
                        measured[measure_name][at] = error
    solved = status == PointStatus.OK
    fastest = np.where(solved, np.min(times, axis=-1), np.nan)
    return Cost(
        families=tuple(c.family for c in curves),
        solvers=solvers,
        h_max=h_max,
        n_dof=n_dof,
        n_contact=n_contact,
        status=status,
        reason=reason,
        time=times,
        stages=stages,
        errors=measured,
        dominated={m: dominated(fastest.ravel(), e.ravel()).reshape(shape) for m, e in measured.items()},
        own=next((f, 0, curve.own) for f, curve in enumerate(curves) if curve.own is not None),
        reference=words,
        reference_error=own_error,
        notes=tuple(notes + _remarks(study, scene, curves)),
    )


def _remarks(study: Study, scene: Scene, curves: list[Curve]) -> list[str]:
    notes = []
    nu = scene.material.nu if scene.material.plane == "strain" else 0.0
    if (note := locking_note(nu)) is not None:
        notes.append(note)
    finest = [curve.solved[-1][study.solver.names[0]].solutions[()] for curve in curves]
    if any(solution.numbers.get("unique") == 0 for solution in finest):
        notes.append(
            "The solution is not certified to be the only one: meshes and solvers may have found different ones, "
            "which shows as an error that does not fall."
        )
    return notes
