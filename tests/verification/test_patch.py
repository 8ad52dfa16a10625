"""Multivalued patch test: every solution in closed form is reproduced to rounding on unstructured,
turned meshes."""

import numpy as np
import pytest

from tcstudy.contact.solution import polished
from tcstudy.contact.solve import solve_contact
from tests.verification.patch import CASES, HEIGHT, SOFTENING, Case, exact_energy, patch_study
from tests.verification.scenes import levels_of


@pytest.mark.parametrize(("maxh", "degrees"), [(0.6, 0.0), (0.17, 37.0)])
@pytest.mark.parametrize(
    "case", CASES, ids=lambda c: f"{'soft' if c.law == SOFTENING else 'drop'}-U{c.U}"
)
def test_every_solution_satisfies_the_inclusion(case: Case, maxh: float, degrees: float) -> None:
    """All are solutions, nothing between them is, and both solvers find one."""
    study = patch_study(case, maxh, degrees)
    [level], scene = levels_of(study), study.scenes[0]
    problem = (condensed := level.condensed(scene)).problem
    assert problem.c.sum() == pytest.approx(1.3, rel=1e-12)
    for slip in case.slips:
        v = np.full(problem.m, slip)
        assert problem.inclusion_residual(v, tolerance=1e-12) < 1e-12
        energy = problem.energy(v) + condensed.constant
        assert energy == pytest.approx(exact_energy(case, study, slip), abs=1e-12)
        turn = np.radians(degrees)
        depth = level.mesh.points @ [-np.sin(turn), np.cos(turn)]
        along = slip + (case.U - slip) * depth / HEIGHT
        exact = np.concatenate([np.cos(turn) * along, np.sin(turn) * along])
        assert np.max(np.abs(level.displacement(scene, v) - exact)) < 1e-12
    assert problem.inclusion_residual(np.full(problem.m, max(case.slips) + 0.05)) > 1e-3
    for solver in ("separable-newton", "bundle-newton"):
        answer = solve_contact(problem, solver)
        assert answer.status == 0, answer.reason
        assert answer.inclusion_residual < 1e-10
        assert min(np.max(np.abs(answer.v - slip)) for slip in case.slips) < 1e-11


def test_the_unstable_solution_is_reached_from_nearby() -> None:
    """s = 0.2 is a maximum along uniform slip: minimisers avoid it, Newton on the active pieces
    does not."""
    case = Case(SOFTENING, 0.8, (0.0, 0.2, 0.6))
    study = patch_study(case, 0.35)
    problem = levels_of(study)[0].condensed(study.scenes[0]).problem
    end = polished(problem, np.full(problem.m, 0.23), exact=False)
    assert end.residual < 1e-12
    assert np.max(np.abs(end.v - 0.2)) < 1e-12
    energies = [exact_energy(case, study, s) / 1.3 for s in case.slips]
    assert energies == pytest.approx(
        [0.32, 0.34, 0.30], abs=1e-15
    )  # the published figures of the unit block
