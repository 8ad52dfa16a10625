"""What is stated of an inclusion residual holds in rational arithmetic (2,000 problems: benchmarks/rational.py)."""

from __future__ import annotations

from decimal import Decimal, localcontext

import numpy as np
import pytest
from tests.benchmarks.rational import exact_residual, random_problem, stated, understated

from tcstudy.contact.certificates import certify
from tcstudy.contact.contact import solve_contact
from tcstudy.contact.extended import friction_defect
from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.shapes import piecewise_linear


@pytest.mark.parametrize("first", range(0, 40, 10))
def test_no_residual_is_understated(first: int) -> None:
    for seed in range(first, first + 10):
        for outcome, residual, exact in stated(random_problem(np.random.default_rng(seed))):
            assert not understated(residual, exact), (seed, outcome, residual, exact)


def test_steep_slope_beyond_a_plateau_at_0() -> None:
    """Four nodes rest beside a corner from which b rises by 1.8e12 a length: one double more holds what they carry."""
    A_tilde = np.diag([0.0198, 1.305, 7.624e-4, 4.014e-4, 0.15453])
    load = np.array([-0.00753, -0.49587, 0.015449, -1.5252e-4, -0.14794])
    c = np.array([0.35855, 0.55057, 0.04605, 6.97774, 0.0229])
    law = piecewise_linear([(-0.38, 0.0)], False, None, [0.0, 1.834e12])
    problem = ContactProblem(A_tilde, load, c, law)
    answer = solve_contact(problem)
    assert exact_residual(problem, answer.v, answer.v_low) <= answer.inclusion_residual <= 1e-15
    one_double = certify(problem, answer.v).residual
    assert exact_residual(problem, answer.v, np.zeros(5)) <= one_double <= 1e-4
    assert one_double >= 1e-8


def test_exponentials_state_their_rounding() -> None:
    """c b(v) − ξ of a decay against the same in 50 digits."""
    numbers = [np.full(50, x) for x in (0.1, 0.2, 0.0, 0.8, 7.0)]
    v, xi, c = np.linspace(0.2, 3.0, 50), np.linspace(0.0, 1.0, 50), np.full(50, 0.3)
    found, error = friction_defect(tuple(numbers), c, (v, 1e-18 * v), (xi, 0.0 * xi))
    with localcontext() as context:
        context.prec = 50
        for (s_0, b_0, _, a, r), s, load, length, given, slack in zip(
            np.array(numbers).T, v, xi, c, found, error, strict=True
        ):
            apart = Decimal(s) + Decimal(1e-18 * s) - Decimal(s_0)
            exact = Decimal(length) * (Decimal(b_0) + Decimal(a) * (-Decimal(r) * apart).exp()) - Decimal(load)
            assert abs(Decimal(given) - exact) <= Decimal(slack + 1e-16 * abs(given))
