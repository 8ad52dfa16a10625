"""Accuracy against cost for one scene of a study: mesh families × solvers × levels, timed several times.

Errors are measured against the exact solution if the study gives one, else against an adaptive mesh with at least
FINER times the unknowns of the finest mesh measured. Every run starts from nothing (`cost_curves`); families take
turns, so that a slow spell of the machine does not fall on one of them alone.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tcstudy.accuracy.rates import dominated
from tcstudy.data.files import check_writable
from tcstudy.data.measured import COST_TABLE, MEASURES, STAGES
from tcstudy.data.provenance import collect, tell
from tcstudy.data.records import PointStatus
from tcstudy.data.store import Record, missing, write_record
from tcstudy.errors import CostError, GeometryFailed, StoreError
from tcstudy.exact.numbers import exact_friction_resultant
from tcstudy.laws.composed import EdgeLaws
from tcstudy.scene.families import TO_TOLERANCE
from tcstudy.scene.study import SOLVERS, Goal, Study
from tcstudy.study.cost_curves import CostCurve, Progress, family_plan, first_run, time_again, walk
from tcstudy.study.lint import warnings
from tcstudy.study.reference import Errors, ExactReference, FineReference, with_meaning
from tcstudy.study.solved_levels import SolvedLevel

Array = NDArray[np.float64]


def cost_to_file(
    study: Study, index: tuple[int, ...], point: str, runs: int, path: Path, progress: Progress, command: Sequence[str]
) -> int:
    """Measure accuracy against cost at one sweep point into a file; returns the number of solutions that failed.

    Raises CostError, StoreError if the file cannot be written, GeometryFailed if the body cannot be meshed.
    """
    if problems := check_writable(path, 1_000_000):
        raise StoreError("; ".join(problems))
    tell(remarks := warnings(at_point(study, index)))
    with threadpool_limits(1, user_api="blas"):
        cost = measure(study, index, runs, progress)
    cost = replace(cost, attributes={**cost.attributes, "point": point})
    write_record(path, study, cost, collect(study, command, remarks=remarks))
    return int(np.count_nonzero(~np.isin(cost.values["status"], (PointStatus.OK, PointStatus.NOT_RUN))))


def measure(study: Study, index: tuple[int, ...], runs: int, progress: Progress) -> Record:
    """Errors and wall times of one sweep point on all families with all solvers.

    index: which sweep point;  runs: how often everything is timed
    Raises CostError if no mesh could be solved, GeometryFailed if the body cannot be meshed.
    """
    study = at_point(study, index)
    (scene,) = study.scenes
    what = "materials differ by region" if scene.material.regions else "friction differs along the contact line"
    if (scene.material.regions or isinstance(scene.friction, EdgeLaws)) and study.mesh.goal.quantity != "energy":
        raise CostError(f"{what}, and errors of goals are not estimated then; set mesh.goal=energy")
    names = dict.fromkeys((*study.solver.names, *SOLVERS))
    study = replace(study, solver=replace(study.solver, names=tuple(names)))
    clock = time.perf_counter()
    curves, notes = first_run(study, progress)
    first = time.perf_counter() - clock
    errors, words, own_error = errors_of(study, curves, progress)
    for run in range(1, runs):
        progress(f"run {run + 1} of {runs}", first * (runs - run))
        turn = run % len(curves)
        for curve in curves[turn:] + curves[:turn]:
            time_again(study, curve)
    return _cost(study, curves, errors, words, own_error, notes)


def _cost(
    study: Study,
    curves: list[CostCurve],
    errors: dict[tuple[str, int, str], dict[str, float]],
    words: str,
    own_error: float,
    notes: list[str],
) -> Record:
    """All curves as arrays, padded to the longest."""
    solvers, runs = study.solver.names, len(curves[0].stages)
    levels = max(len(curve.steps) for curve in curves)
    sizes = {"family": len(curves), "solver": len(solvers), "level": levels, "run": runs}
    measured = [m.name for m in MEASURES if any(m.name in one for one in errors.values())]
    wanted = {f"{what}_{name}" for what in ("error", "dominated") for name in measured}
    table = [v for v in COST_TABLE if v.name in wanted or not v.name.startswith(("error_", "dominated_"))]
    values: dict[str, Any] = {v.name: missing(v, tuple(sizes[dim] for dim in v.dims)) for v in table}
    values |= {"family": [curve.family for curve in curves], "solver": solvers}
    values |= {"level": np.arange(levels), "run": np.arange(runs)}
    values["reason"][:] = ""
    for f, curve in enumerate(curves):
        for level, by_solver in enumerate(curve.solved):
            for name, size in zip(("h_max", "n_dof", "n_contact"), curve.steps[level], strict=True):
                values[name][f, level] = size
            for solver, one in by_solver.items():
                at, own = (f, solvers.index(solver), level), [run[level][solver] for run in curve.stages]
                best, found = min(own, key=lambda one: one.total), one.solutions[()]
                told = {"status": found.status, "reason": found.reason, "time": [one.total for one in own]}
                told |= {f"time_{stage}": getattr(best, stage) for stage in STAGES}
                told |= {f"error_{name}": error for name, error in errors[curve.family, level, solver].items()}
                for name in told.keys() & values.keys():
                    values[name][at] = told[name]
    if any(curve.solved[-1][solvers[0]].solutions[()].numbers.get("unique") == 0 for curve in curves):
        notes = [
            *notes,
            "The solution is not certified to be the only one: meshes and solvers may have found different ones, "
            "which shows as an error that does not fall.",
        ]
    fastest = np.where(values["status"] == PointStatus.OK, np.min(values["time"], axis=-1), np.nan)
    for name in measured:
        error = values[f"error_{name}"]
        values[f"dominated_{name}"] = dominated(fastest.ravel(), error.ravel()).reshape(error.shape)
    chosen = next(curve for curve in curves if curve.own is not None)
    attributes = {
        "reference": words,
        "reference_error": float(own_error),
        "own_family": chosen.family,
        "own_solver": solvers[0],
        "own_level": np.int32(chosen.own or 0),
        "runs": np.int32(runs),
        "notes": "\n".join(notes),
    }
    return Record("cost", COST_TABLE, values, attributes)


FINER = 10
LARGEST = 1_500_000
LEAST = 2
"""Unknowns of the reference over those of the finest mesh compared with it: FINER, but less for the sake of LARGEST."""
RUNS = 5
"""How often everything is timed."""
SAME = 1e-8
"""Relative difference of two solvers' u_T that makes no difference to an error."""


def errors_of(
    study: Study, curves: list[CostCurve], progress: Progress
) -> tuple[dict[tuple[str, int, str], dict[str, float]], str, float]:
    """Relative errors by (family, level, solver), what they are measured against, and the reference's own error.

    Raises CostError if there is no solution to compare with.
    """
    fine: FineReference | None = None
    words, own_error = "the exact solution", 0.0
    if study.exact is None:
        finest_dofs = max(c.steps[-1][1] for c in curves)
        least = max(LEAST * finest_dofs, min(FINER * finest_dofs, LARGEST))
        best, own_error = _reference(study, least, progress)
        fine = FineReference(best, [])
        words = f"adaptive mesh of {best.n_dof} dofs, with an estimated error of {100 * own_error:.2g} % in energy"
    found, sizes, finest = {}, {}, 0
    for curve in curves:
        for level, by_solver in enumerate(curve.solved):
            progress(f"errors of {curve.family}, level {level}", None)
            known: list[tuple[SolvedLevel, Errors]] = []
            for name, one in by_solver.items():
                errors = next((e for other, e in known if _same(one, other)), None)
                if errors is None:
                    errors = _of(study, one, fine)
                    known.append((one, errors))
                found[curve.family, level, name] = errors
                if one.n_dof > finest and errors:
                    finest, sizes = one.n_dof, {measure: size for measure, (_, size) in errors.items()}
    relative = {
        key: {measure: e / sizes[measure] for measure, (e, _) in errors.items() if sizes.get(measure, 0.0) > 0.0}
        for key, errors in found.items()
    }
    if not any(relative.values()):
        remedy = "give it a load, for example by --set, or name a sweep point that has one by --at"
        raise CostError(f"nothing loads this scene: its solution is zero, and errors have no size; {remedy}")
    return relative, words, own_error


def _same(one: SolvedLevel, other: SolvedLevel) -> bool:
    """Whether two solvers found the same solution on one mesh."""
    a, b = one.solutions[()], other.solutions[()]
    if a.u is None or b.u is None:
        return False
    return float(np.max(np.abs(a.v - b.v), initial=0.0)) <= SAME * float(np.max(np.abs(a.v), initial=0.0))


def _of(study: Study, one: SolvedLevel, fine: FineReference | None) -> Errors:
    """Errors of one solution and what they are relative to, by measure."""
    scene = study.scenes[0]
    if fine is None:
        assert study.exact is not None
        reference = ExactReference(study.exact, [one])
        exact = {"friction_resultant": exact_friction_resultant(scene, reference.xi(scene))}
        found = reference.errors(0, (), scene)
    else:
        exact = {name: fine.number(name) for name in ("energy", "friction_resultant")}
        found = fine.errors_of(one, (), scene)
    for name, value in exact.items():
        if math.isfinite(value):
            found[name] = (abs(one.solutions[()].numbers.get(name, math.nan) - value), abs(value))
    return with_meaning(found, scene)


def _reference(study: Study, least: float, progress: Progress) -> tuple[SolvedLevel, float]:
    """The solution on an adaptive mesh of at least so many unknowns, and its estimated relative error.

    Raises CostError if it is not solved, GeometryFailed if there is no mesh that is fine enough.
    """
    plan = replace(family_plan(study.mesh, TO_TOLERANCE), goal=Goal(), marking=max(study.mesh.marking, 0.7))
    step = None
    try:
        for step in walk(study, plan, lambda name, level: False):
            progress(f"reference: {step.n_dof} of at least {least:.0f} dofs", None)
            if step.n_dof >= least:
                break
    except GeometryFailed:  # triangles too small for the mesher: the mesh before serves if it is fine enough
        if step is None or step.n_dof < least * LEAST / FINER:
            raise
    assert step is not None
    name, found = next(iter(step.solutions.items()))
    if found.status != PointStatus.OK:
        why = found.reason or found.status.name.lower()
        raise CostError(f"the reference, an adaptive mesh of {step.n_dof} dofs, was not solved: {why}")
    return step.solved(study)[name], step.estimate


def at_point(study: Study, index: tuple[int, ...]) -> Study:
    """The study of one point of the sweep alone, on its own geometry.

    Raises GeometryFailed with the reason where the geometry is refused.
    """
    row = place = int(np.ravel_multi_index(index, study.shape))
    if study.variants:
        variant = next(one for one in study.variants if place in one.places)
        if variant.study is None:
            remedy = "name another geometry by --at, or take this one out of the sweep"
            raise GeometryFailed(f"{variant.words}: {variant.reason}; {remedy}", ("sweep",))
        study, row = variant.study, int(np.flatnonzero(variant.places == place)[0])
    return replace(study, scenes=(study.scenes[row],), axes=())
