"""λ₁, the uniqueness threshold of the body: published figures, refinement, uncondensed eigenproblem, lost digits."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.certificates import certify
from tcstudy.contact.problem import CondensedBody, ContactProblem, least_eigenpair
from tcstudy.contact.solve import solve_block
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import slip_weakening
from tests.verification.scenes import RECTANGLE, levels_of, study_of


def test_converges_to_the_published_value() -> None:
    """0.4162, 0.4143, 0.4136, 0.4134 for h = 0.1 … 0.0125 on the 2×1 rectangle clamped at the left (E = 1, ν = 0.3)."""
    study = study_of(RECTANGLE, "mesh.levels=4")
    values = np.array([level.lambda_1(study.scenes[0]) for level in levels_of(study)])
    assert np.all(np.diff(values) < 0)
    assert values == pytest.approx([0.4162, 0.4143, 0.4136, 0.4134], abs=2.5e-4)


SLANTED = """
units: none
body: {outline: [{from: [0, 0], edge: bottom}, {from: [2, 0], edge: right}, {from: [2.4, 1], edge: top},
                 {from: [0.3, 1], edge: left}]}
boundary: {bottom: contact, left: {role: traction, spring: {normal: 1}},
           right: {role: traction, spring: {normal: 1}}, top: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.3}
"""


def test_stiff_springs_cost_no_more_digits_than_is_said() -> None:
    """Springs across slanted edges: beyond 1e8 λ₁ changes by less than 1e-7, all else is rounding."""
    found = {}
    for k in (1e8, 1e10, 1e11, 1e12, 1e13):
        springs = (f"boundary.{edge}.spring.normal={k!r}" for edge in ("left", "right"))
        study = study_of(SLANTED, *springs)
        level = levels_of(study)[0]
        found[k] = level.lambda_1(study.scenes[0]), level.condensed(study.scenes[0]).problem.A_error
    reference, error = found[1e8]
    assert error < 1e-7
    for value, error in found.values():
        assert abs(value / reference - 1.0) <= error + 1e-7
    assert found[1e12][1] > 1e-6
    assert abs(found[1e13][0] / reference - 1.0) > 1e-6


def test_proofs_do_not_lean_on_lost_digits() -> None:
    """One node, λ₁ = 1: a film that falls by 0.99 is proved unique only where λ₁ is known to 1 %."""
    law, load = slip_weakening(1.0, 0.01, 1.0), np.array([1.005])
    for error, unique in ((0.0, True), (1e-3, True), (0.02, False)):
        problem = ContactProblem(np.array([[1.0]]), load, np.ones(1), law, error)
        proof = certify(problem, np.zeros(1), 1.0)
        body = CondensedBody.of(np.array([[1.0]]), np.ones(1), error)
        laws = Laws.of([law], np.zeros((1, 1)))
        block = solve_block(body, load[None], laws).certificate
        assert proof.convex == block.convex[0] == unique
        assert proof.unique == block.unique[0] == unique
        assert proof.lambda_1_error == error
        assert (proof.margin > 0.0) == unique


def test_eigenpair_of_a_stiffness_with_contrast() -> None:
    """Ã = Q diag(1, 1e13, …) Qᵀ with its digits: the residual tells what the eigenvalue solver loses."""
    Q = np.linalg.qr(np.random.default_rng(1).normal(size=(6, 6)))[0]
    A = (Q * 10.0 ** np.array([0, 13, 13, 12, 12, 13])) @ Q.T
    A = 0.5 * (A + A.T)
    value, _, error = least_eigenpair(A, np.ones(6))
    exact = 1.0 / np.linalg.eigvalsh(np.linalg.inv(A))[-1]
    assert abs(value - exact) <= 2.0 * error * value
    assert error > 1e-6
    assert least_eigenpair(np.diag([2.0, 3.0]), np.ones(2))[2] <= 1e-15
