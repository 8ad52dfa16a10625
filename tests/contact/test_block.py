"""Blocks of points against the single solve, its certificates, and enumeration; bits; branches; failures."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from tcstudy.contact.block import solve_block
from tcstudy.contact.certificates import certify
from tcstudy.contact.contact import solve_contact
from tcstudy.contact.status import Status
from tests.contact import contact_cases as cases
from tests.contact.rows import block, single, solve_points, some_laws

FLAGS = ("convex", "unique", "strict_minimum", "global_minimum")
TIE = 1e-12


@pytest.mark.parametrize(("m", "points"), [(5, 60), (20, 40), (70, 24)])
def test_no_energy_is_higher_and_no_certificate_lost(m: int, points: int) -> None:
    laws = some_laws()
    body, loads, tables, law = block(m, laws, points)
    answers = solve_points(body, loads, tables, law)
    assert np.all(answers.status == Status.CONVERGED)
    for p in range(points):
        problem = single(body, loads[p], laws[law[p]])
        expected = solve_contact(problem)
        assert answers.energy[p] <= expected.energy + TIE * abs(expected.energy)
        assert cases.independent_residual(problem, answers.v[p]) <= 1e-11
        np.testing.assert_allclose(answers.energy[p], problem.energy(answers.v[p]), rtol=1e-11, atol=1e-14)
        proved = certify(problem, answers.v[p], body.lambda_1, inverse=body.inverse)
        for flag in FLAGS:
            assert getattr(answers.certificate, flag)[p] == getattr(proved, flag), flag


def test_a_block_is_the_same_to_the_bit_every_time() -> None:
    body, loads, tables, law = block(44, some_laws(), 50)
    one, other = (solve_points(pickle.loads(pickle.dumps(body)), loads, tables, law) for _ in range(2))
    for name in ("v", "xi", "inclusion_residual", "energy", "status", "start", "energies", "iterations"):
        assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True), name
    assert all(np.array_equal(getattr(one.certificate, flag), getattr(other.certificate, flag)) for flag in FLAGS)


def test_laws_by_node_agree_with_laws_by_row() -> None:
    laws = some_laws()
    body, loads, tables, law = block(20, laws, 30)
    by_row = solve_block(body, loads, tables.at(law[:, None]))
    by_node = solve_block(body, loads, tables.at(np.repeat(law[:, None], body.m, axis=1)))
    np.testing.assert_allclose(by_node.energy, by_row.energy, rtol=1e-11, atol=1e-14)
    assert np.array_equal(by_node.certificate.global_minimum, by_row.certificate.global_minimum)


def test_what_rounding_hides_is_judged_and_reported() -> None:
    """Friction 1e-30 of the load: no strict tolerance can be met, and every point says so."""
    laws = [cases.slip_weakening(1.0, 0.5, 0.1)]
    body, loads, tables, law = block(20, laws, 4)
    answers = solve_points(body, 1e30 * loads, tables, law, 1e-10)
    failed = answers.status != Status.CONVERGED
    assert np.any(failed)
    for p in range(4):
        assert bool(answers.reason[p]) == bool(failed[p])
        assert not failed[p] or not answers.certificate.global_minimum[p]
