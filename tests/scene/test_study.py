"""The rule that says which inclusion residual makes a solution."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.contact import solve_contact
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.status import Status
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import linear, piecewise_linear, tresca
from tcstudy.scene.study import LOST, TOLERANCE, Acceptance


def test_default_goes_as_far_as_rounding() -> None:
    default = Acceptance()
    assert default.limit(1e-13) == TOLERANCE == default.aim
    assert default.limit(4e-9) == 4e-9
    assert default.accepts(1e-9, 4e-9)
    assert default.limited(1e-9, 4e-9)
    assert default.accepts(1e-11, 4e-9)
    assert not default.limited(1e-11, 4e-9)
    assert not default.accepts(5e-9, 4e-9)
    assert not default.accepts(float("nan"), 4e-9)


def test_lost_friction_is_no_solution() -> None:
    assert Acceptance().limit(0.5) == LOST
    assert not Acceptance().accepts(0.1, 0.5)


def test_written_tolerance_is_strict() -> None:
    strict = Acceptance(1e-10)
    assert strict.limit(4e-9) == strict.aim == 1e-10
    assert not strict.accepts(1e-9, 4e-9)
    assert not strict.limited(1e-9, 4e-9)


@pytest.mark.parametrize("factor", [1e-20, 1.0, 1e20])
def test_rounding_has_no_unit(factor: float) -> None:
    rng = np.random.default_rng(1)
    A = np.eye(4) + 0.1
    problem = ContactProblem(A, rng.normal(size=4), np.ones(4), tresca(0.5))
    scaled = ContactProblem(A * factor, problem.l_tilde * factor, problem.c, tresca(0.5 * factor))
    v = rng.normal(size=4)
    assert scaled.xi_rounding(v) == pytest.approx(problem.xi_rounding(v), rel=1e-12)


@pytest.mark.parametrize(
    "law",
    [piecewise_linear([(0.0, 0.05), (1.0, 1.05)], False, None, [1.0, 1.0]), linear(2.0)],
    ids=["shifted", "spring"],
)
def test_law_without_scale_and_no_load(law: Laws) -> None:
    """A straight law without corners has no scale of its own; without load the residual is that of b itself."""
    problem = ContactProblem(np.array([[2.0, -1.0], [-1.0, 3.0]]), np.zeros(2), np.ones(2), law)
    answer = solve_contact(problem)
    assert answer.status == Status.CONVERGED
    assert problem.inclusion_residual(answer.v) <= 1e-15
    assert answer.inclusion_residual <= 1e-14
    expected = -np.linalg.solve(problem.A_tilde + np.eye(2) * law.q[0], np.full(2, float(law.b(0.0))))
    assert answer.v == pytest.approx(expected, rel=1e-14)
