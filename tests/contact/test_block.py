"""Blocks of points against the single solve, its certificates, and bits; failures."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from tcstudy.contact.certificates import certify
from tcstudy.contact.problem import ContactProblem, Status
from tcstudy.contact.solve import solve_contact
from tests.contact import contact_cases as cases
from tests.contact.rows import block, solve_points, some_laws

FLAGS = ("convex", "unique", "strict_minimum", "global_minimum")


@pytest.mark.parametrize(("m", "points"), [(5, 40), (70, 18)])
def test_no_energy_is_higher_and_no_certificate_lost(m: int, points: int) -> None:
    laws = some_laws()
    body, loads, tables, law = block(m, laws, points)
    answers = solve_points(body, loads, tables, law)
    assert np.all(answers.status == Status.CONVERGED)
    for p in range(points):
        problem = ContactProblem(body.A_tilde, loads[p], body.c, laws[law[p]])
        expected = solve_contact(problem)
        assert answers.energy[p] <= expected.energy + 1e-12 * abs(expected.energy)
        assert cases.independent_residual(problem, answers.v[p]) <= 1e-11
        np.testing.assert_allclose(answers.energy[p], problem.energy(answers.v[p]), rtol=1e-11, atol=1e-14)
        proved = certify(problem, answers.v[p], body.lambda_1, inverse=body.inverse)
        for flag in FLAGS:
            assert getattr(answers.certificate, flag)[p] == getattr(proved, flag), flag


def test_a_block_is_the_same_to_the_bit_every_time() -> None:
    body, loads, tables, law = block(44, some_laws(), 30)
    one, other = (solve_points(pickle.loads(pickle.dumps(body)), loads, tables, law) for _ in range(2))
    for name in ("v", "xi", "inclusion_residual", "energy", "status", "start", "energies", "iterations"):
        assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True), name
    assert all(np.array_equal(getattr(one.certificate, flag), getattr(other.certificate, flag)) for flag in FLAGS)
