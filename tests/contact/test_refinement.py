"""Solutions whose friction is small against the forces in the body: the digits that two doubles hold."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.active_set import extended, refined
from tcstudy.contact.certificates import certify
from tcstudy.contact.contact import solve_contact
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.status import Status
from tcstudy.laws.shapes import tresca
from tcstudy.scene.study import TOLERANCE, Acceptance
from tests.contact.ill_conditioned import body


def rail(m: int, strain: float = 7.2e-4) -> ContactProblem:
    """A long bar of stiffness 1 and length 1, held at x = 0, that a thermal strain pushes out against friction 1e-3.

    m cells; −u″ + b(u) = 0, u′(1) = strain
    """
    h = 1.0 / m
    A = (2.0 * np.eye(m) - np.eye(m, k=1) - np.eye(m, k=-1)) / h
    A[-1, -1] = 1.0 / h
    load, c = np.zeros(m), np.full(m, h)
    load[-1], c[-1] = strain, 0.5 * h
    return ContactProblem(A, load, c, tresca(1e-3))


def test_slender_bar_is_solved_although_one_double_cannot_hold_it() -> None:
    problem = rail(1600, 9.137e-4)
    answer = solve_contact(problem)
    assert answer.status == Status.CONVERGED
    assert not answer.limited
    assert answer.inclusion_residual <= TOLERANCE < extended(problem, answer.v).residual
    length = 9.137e-4 / 1e-3
    assert answer.v[-1] == pytest.approx(0.5 * 1e-3 * length**2, rel=1e-6)
    assert extended(problem, answer.v, answer.v_low).xi == pytest.approx(answer.xi, abs=0.0)
    certificate = certify(problem, answer.v, residual=answer.inclusion_residual)
    assert certificate.unique


def test_written_tolerance_is_met_or_refused() -> None:
    problem = rail(400)
    assert solve_contact(problem, tolerance=1e-14).inclusion_residual <= 1e-14
    refused = solve_contact(problem, tolerance=1e-300)
    assert refused.status != Status.CONVERGED or refused.inclusion_residual == 0.0


def test_refinement_only_ever_improves() -> None:
    rng = np.random.default_rng(5)
    for _ in range(10):
        problem = rail(60)
        v = solve_contact(problem).v * (1.0 + 1e-9 * rng.normal(size=60))
        before = extended(problem, v)
        after = refined(problem, v, 1e-13)
        assert after.residual <= before.residual
        assert after.residual <= 1e-13
        assert np.all(np.abs(after.v_low) <= 0.5 * np.spacing(np.abs(after.v)))
        assert np.all(after.v_low[after.v == 0.0] == 0.0)


@pytest.mark.parametrize("solver", ["separable-newton", "bundle-newton"])
def test_one_policy_for_both_solvers(solver: str) -> None:
    problem = rail(60)
    answer = solve_contact(problem, solver)
    assert answer.status == Status.CONVERGED
    assert Acceptance().accepts(answer.inclusion_residual, answer.rounding)


def test_what_rounding_limits_is_a_solution_by_default_only() -> None:
    """A body of condition 1e16 leaves refinement no factor to work with; that is said; a written tolerance refuses."""
    rng = np.random.default_rng(5)
    A = body(rng, 20, 1e16)
    problem = ContactProblem(A, A @ rng.normal(size=20), np.ones(20), tresca(1e-4))
    answer = solve_contact(problem)
    assert answer.status == Status.CONVERGED
    assert answer.limited
    assert TOLERANCE < answer.inclusion_residual <= answer.rounding
    strict = solve_contact(problem, tolerance=TOLERANCE)
    assert strict.status == Status.INCLUSION_VIOLATED
    assert "rounding alone leaves" in strict.reason
