"""Dense, badly conditioned bodies: nothing runs into the iteration limit, and a failure would name its own reason."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.contact import solve_contact
from tcstudy.contact.convex_step import convex_step
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.status import Status
from tcstudy.laws.shapes import linear, piecewise_linear, tresca
from tests.contact.ill_conditioned import FAMILIES, Family, body


@pytest.mark.parametrize("seed", range(5))
def test_tresca_on_a_dense_body(seed: int) -> None:
    """Strictly convex, condition 1e7: descent alone settled one node a step and gave up after 300."""
    m, rng = 200, np.random.default_rng([seed, 200])
    A = body(rng, m, 1e7)
    load = A @ rng.normal(size=m) * 0.5 + rng.normal(size=m)
    answer = solve_contact(ContactProblem(A, load, np.ones(m), tresca(2.0)))
    assert answer.status == Status.CONVERGED, answer.reason
    assert answer.inclusion_residual <= 1e-10
    assert answer.iterations <= 40


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
def test_random_laws(family: Family) -> None:
    for m, seeds in ((20, 6), (100, 2)):
        for seed in range(seeds):
            rng = np.random.default_rng([seed, m])
            problem = family.problem(rng, m, 10.0 ** rng.uniform(2.0, 8.0))
            answer = solve_contact(problem)
            assert answer.status == Status.CONVERGED, (m, seed, answer.reason)
            assert not answer.limited


def test_convex_model_of_a_convex_law_is_the_problem() -> None:
    """Slopes that rise and fall but stay positive, and jumps, seen from anywhere: one step is the solution."""
    law = piecewise_linear(
        [(-1.0, -2.0), (0.0, -0.5), (0.0, 0.3), (0.4, 1.5), (2.0, 1.7), (2.0, 2.0)], False, None, [0.5, 0.0]
    )
    rng = np.random.default_rng(2)
    A, c = body(rng, 30, 1e4), rng.uniform(0.5, 2.0, 30)
    problem = ContactProblem(A, A @ rng.normal(size=30) + rng.normal(size=30), c, law)
    for start in (np.zeros(30), rng.normal(size=30), np.full(30, 5.0)):
        found = convex_step(problem, start)
        assert found is not None
        assert problem.inclusion_residual(found) <= 1e-5


def test_model_of_a_spring_is_a_linear_system() -> None:
    found = convex_step(ContactProblem(np.eye(2), np.ones(2), np.ones(2), linear(1.0)), np.zeros(2))
    assert found is not None
    assert found == pytest.approx([0.5, 0.5], rel=1e-14)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_model_has_no_unit(unit: float) -> None:
    rng = np.random.default_rng(4)
    A = body(rng, 25, 1e6)
    problem = ContactProblem(A, A @ rng.normal(size=25), np.ones(25), tresca(0.5))
    scaled = ContactProblem(A / unit, problem.l_tilde, problem.c, tresca(0.5))
    plain, other = convex_step(problem, np.zeros(25)), convex_step(scaled, np.zeros(25))
    assert plain is not None
    assert other is not None
    assert other / unit == pytest.approx(plain, rel=1e-6, abs=1e-9)
