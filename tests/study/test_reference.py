"""Errors against a fine mesh: equal to nested ones where it is a refinement, near the true ones elsewhere."""

from __future__ import annotations

from pathlib import Path

import pytest

import tcstudy
from tcstudy.accuracy.transfer import prolongation
from tcstudy.scene.study import MeshPlan, Study
from tcstudy.study.cost import walk
from tcstudy.study.reference import ExactReference, FineReference
from tcstudy.study.solved_levels import SolvedLevel, solve_levels
from tests.verification.scenes import RECTANGLE, study_of

CONFIGS = Path(__file__).parents[2] / "configs"
WARM = RECTANGLE + "heat: {theta: '0.3*x*x + 0.1*y'}\n"
WARM = WARM.replace("nu: 0.3}", "nu: 0.3, alpha_T: 0.05, k: 1}")


def _say(text: str) -> None:
    """Nothing."""


@pytest.mark.parametrize("text", [RECTANGLE, WARM])
def test_nested_meshes_give_the_errors_of_exact_prolongation(text: str) -> None:
    study = study_of(text, "mesh={maxh: 0.3, levels: 4}", "boundary.top={role: traction, g: [0.02, -0.01]}")
    levels, scene = solve_levels(study, _say), study.scenes[0]
    mesh, best, reference = levels[-1].mesh, levels[-1].solutions[()], FineReference(levels[-1], nested=True)
    assert best.u is not None
    for level in (0, 1, 2):
        own, found = levels[level].solutions[()], reference.errors(levels[level], (), scene)
        values = [*own.u, *([] if own.theta is None else [own.theta])]  # type: ignore[misc]
        for coarse, fine in zip(levels[level:], levels[level + 1 :], strict=False):
            step = prolongation(coarse.mesh.points, fine.mesh.points, fine.mesh.triangles)
            values = [step(one) for one in values]
        exact = mesh.norms(
            [mesh.p1(v - w) for v, w in zip(values, [*best.u, best.theta], strict=False)],
            scene.material.lam,
            scene.material.mu,
        )
        assert ("theta_H1" in found) == (text is WARM)
        for name, error in exact.items():
            assert found[name][0] == pytest.approx(error, rel=1e-6), name
        nodes = levels[level].line.nodes  # which keep their numbers
        at = [levels[-1].line.nodes.tolist().index(node) for node in nodes]
        assert found["u_T_max"][0] == pytest.approx(abs(own.v - best.v[at]).max(), rel=1e-12)
        assert found["xi_max"][0] == pytest.approx(abs(own.xi - best.xi[at]).max(), rel=1e-12)


def test_a_solution_has_no_error_against_itself() -> None:
    levels = solve_levels(study_of(WARM, "mesh={maxh: 0.3, levels: 2}"), _say)
    scene = study_of(WARM).scenes[0]
    for name, (error, size) in FineReference(levels[1]).errors(levels[1], (), scene).items():
        assert error <= 1e-12 * size, name


SLOT = """
units: none
body:
  outline:
    - {from: [0, 0], edge: base}
    - {from: [0.995, 0], edge: slot}
    - {from: [0.995, 0.6], edge: tip}
    - {from: [1.005, 0.6], edge: slot}
    - {from: [1.005, 0], edge: base}
    - {from: [2, 0], edge: wall}
    - {from: [2, 1], edge: top}
    - {from: [0, 1], edge: wall}
boundary: {base: clamped, slot: contact, tip: free, wall: clamped, top: {role: traction, g: [0.05, -0.1]}}
material: {E: 1, nu: 0.3}
friction: {law: slip-weakening, tau_s: 0.02, tau_k: 0.01, delta: 0.5}
mesh: {maxh: 0.3, levels: 4}
"""


def test_friction_is_looked_up_on_its_own_side_of_a_slot() -> None:
    """Both sides are one edge, a thirtieth of a cell apart, and friction has opposite signs there."""
    study = study_of(SLOT)
    levels = solve_levels(study, _say)
    for level in (0, 1):
        error, size = FineReference(levels[-1]).errors(levels[level], (), study.scenes[0])["xi_L2"]
        assert error < 0.12 * size


def _solved(study: Study, plan: MeshPlan, levels: int) -> list[SolvedLevel]:
    found = []
    for step in walk(study, plan, lambda name, level: False):
        found.append(step.solved["separable-newton"])
        if len(found) == levels:
            break
    return found


def test_an_adaptive_reference_measures_the_true_error_of_uniform_meshes() -> None:
    study = tcstudy.load(CONFIGS / "convergence.yaml")
    scene = study.scenes[0]
    assert study.exact is not None
    uniform = _solved(study, MeshPlan((0.25,), 2), 2)
    fine = _solved(study, MeshPlan((0.25,), 40, "adaptive", marking=0.7), 9)[-1]
    assert fine.n_dof > 10 * uniform[-1].n_dof
    exact, reference = ExactReference(study.exact), FineReference(fine)
    for level in uniform:
        true, measured = exact.errors(level, (), scene), reference.errors(level, (), scene)
        for name, (error, _) in measured.items():
            # ξ is a step function on both meshes, and the reference's own error is not small beside it
            assert error == pytest.approx(true[name][0], rel=0.2 if name.startswith("xi") else 0.05), (
                level.n_dof,
                name,
            )
