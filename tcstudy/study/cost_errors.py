"""Errors of the solutions that a chart of accuracy against cost compares."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tcstudy.data.records import PointStatus
from tcstudy.fem.geometry import GeometryFailed
from tcstudy.scene.points import distinct
from tcstudy.scene.records import Goal, Scene, Study
from tcstudy.study.cost_curves import Curve, family_plan
from tcstudy.study.cost_runs import Progress, walk
from tcstudy.study.exact_energy import exact_friction_resultant
from tcstudy.study.fine_reference import FineReference
from tcstudy.study.reference import Errors, ExactReference, with_meaning
from tcstudy.study.solved_levels import SolvedLevel, empty_level, solution_of

FINER = 10
LARGEST = 1_500_000
LEAST = 2
"""Unknowns of the reference over those of the finest mesh compared with it: FINER, but less for the sake of LARGEST."""
SAME = 1e-8
"""Relative difference of two solvers' u_T that makes no difference to an error."""


class CostError(Exception):
    """Accuracy against cost cannot be measured; the text says why and what to do."""


def unmeasured(study: Study, name: str) -> str:
    """Why this error cannot be measured for the study, with the remedy; empty where nothing known speaks against it."""
    if name in ("theta_L2", "theta_H1") and all(
        scene.material.beta == 0.0 for scene in distinct(study.scenes, "material")
    ):
        return "has no meaning, because beta is 0 and temperature does not load the body; choose an error of u or xi"
    if name in ("xi_nodes", "xi_max") and study.exact is None:
        return "needs an exact solution, since the nodes of the reference are others; choose xi_L2, or give exact"
    return ""


def errors_of(
    study: Study, scene: Scene, curves: list[Curve], progress: Progress
) -> tuple[dict[tuple[str, int, str], dict[str, float]], str, float]:
    """Relative errors by (family, level, solver), what they are measured against, and the reference's own error.

    Raises CostError if there is no solution to compare with.
    """
    fine: FineReference | None = None
    words, own_error = "the exact solution", 0.0
    if study.exact is None:
        finest_dofs = max(c.finest for c in curves)
        least = max(LEAST * finest_dofs, min(FINER * finest_dofs, LARGEST))
        best, own_error = _reference(study, scene, least, progress)
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
                    errors = _of(study, scene, one, fine)
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


def _of(study: Study, scene: Scene, one: SolvedLevel, fine: FineReference | None) -> Errors:
    """Errors of one solution and what they are relative to, by measure."""
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


def _reference(study: Study, scene: Scene, least: float, progress: Progress) -> tuple[SolvedLevel, float]:
    """The solution on an adaptive mesh of at least so many unknowns, and its estimated relative error.

    Raises CostError if it is not solved, GeometryFailed if there is no mesh that is fine enough.
    """
    plan = replace(family_plan(study.mesh, "adaptive"), goal=Goal(), marking=max(study.mesh.marking, 0.7))
    step = None
    try:
        for step in walk(study, plan, scene, lambda name, level: False):
            progress(f"reference: {step.n_dof} of at least {least:.0f} dofs", None)
            if step.n_dof >= least:
                break
    except GeometryFailed:  # triangles too small for the mesher: the mesh before serves if it is fine enough
        if step is None or step.n_dof < least * LEAST / FINER:
            raise
    assert step is not None
    record = next(iter(step.records.values()))
    if record.status != PointStatus.OK:
        why = record.reason or record.status.name.lower()
        raise CostError(f"the reference, an adaptive mesh of {step.n_dof} dofs, was not solved: {why}")
    level = empty_level(study, step.level)
    return replace(level, solutions={(): solution_of(study, step.level, scene, record)}), step.estimate
