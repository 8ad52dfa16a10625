"""Paths with a law at every node: one law to the bit, a change of variables, films side by side, enumeration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tcstudy.contact.certificates import certify
from tcstudy.contact.path.follow import ParametricProblem, PathStatus
from tcstudy.contact.path.piecewise_linear_approximation import piecewise_linear
from tcstudy.contact.path.query import solutions_of
from tcstudy.laws.composed import nodal
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import tresca
from tests.contact import contact_cases as cases
from tests.contact.path.cases import follow, softening_line


@pytest.mark.parametrize("law", [cases.slip_weakening(1.0, 0.2, 0.02), cases.sawtooth(1.0, 0.03, 5.0, 0.5)])
def test_slips_measured_by_a_scale_and_an_origin_of_every_node_change_nothing(law: Laws) -> None:
    """w solves Aw + c b(w) = t l; u = σw + a then solves (A/σσ)(u − a) + c β b((u − a)/σ) = t l/σ with β = 1/σ."""
    m, rng = 30, np.random.default_rng(7)
    plain = replace(softening_line(m), law=law)
    sigma, a = np.exp(rng.normal(size=m)), 0.1 * rng.normal(size=m)
    A = plain.A_tilde / sigma[:, None] / sigma
    laws = nodal([law], np.zeros(m, dtype=int), 1.0 / sigma, sigma, a)
    moved = ParametricProblem(0.5 * (A + A.T), A @ a, plain.l_1 / sigma, plain.c, laws)
    path, other = follow(plain, np.zeros(m), 0.0, 0.0, 2.0), follow(moved, a, 0.0, 0.0, 2.0)
    assert other.end == path.end == PathStatus.RANGE_END
    assert other.pieces == path.pieces > 2 * m
    assert np.array_equal(other.stable, path.stable)
    np.testing.assert_allclose(other.t, path.t, atol=1e-10)
    np.testing.assert_allclose(other.u, path.u * sigma + a, atol=1e-10)


def test_straight_stand_ins_and_newton_steps_take_every_node_to_its_own_law() -> None:
    m = 20
    laws = nodal([cases.exponential_decay(1.0, 0.4, 0.1), tresca(0.6)], np.arange(m) // 12, np.linspace(0.5, 1.5, m))
    assert isinstance(laws, Laws)
    true = softening_line(m).with_law(laws)
    straight = true.with_law(laws.mapped(lambda law: piecewise_linear(law, 1e-2, 2.0)))
    path = follow(straight, np.zeros(m), 0.0, 0.0, 1.4)
    found = solutions_of(laws, path, 1.1)
    assert found
    for solution in found:
        assert solution.residual <= 1e-12
        assert certify(true.at(1.1), solution.v).strict_minimum == solution.stable
