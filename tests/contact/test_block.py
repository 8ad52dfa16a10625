"""Blocks of points against the single solve, its certificates, and enumeration; bits; branches; failures."""

from __future__ import annotations

import numpy as np
import pytest

from tcstudy.contact.block import Answer, solve_block
from tcstudy.contact.certificates import certify
from tcstudy.contact.contact import solve_contact
from tcstudy.contact.problem import CondensedBody, ContactProblem
from tcstudy.contact.status import Status
from tcstudy.laws.composed import nodal, row_laws
from tcstudy.laws.laws import NONE, Laws
from tcstudy.scene.study import NEIGHBOUR
from tests.contact import contact_cases as cases
from tests.contact.exhaustive import least_energy, small_problem
from tests.contact.rows import block, reordered, single, solve_points, some_laws

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


@pytest.mark.parametrize(("m", "by_node"), [(2, False), (3, False), (3, True)])
def test_the_least_energy_of_all_is_found(m: int, by_node: bool) -> None:
    found = 0
    for seed in range(40):
        problem = small_problem(seed, m)
        body = CondensedBody.of(problem.A_tilde, problem.c)
        law = np.arange(m)[None] % 2 if by_node else np.zeros((1, 1), dtype=np.intp)  # the same law twice
        answers = solve_block(body, problem.l_tilde[None], Laws.of([problem.law] * 2, law))
        least = least_energy(problem)
        slack = 1e-10 * (abs(least) + float(problem.c @ np.abs(problem.law.j(answers.v[0]))))
        found += answers.energy[0] <= least + slack
        assert not answers.certificate.global_minimum[0] or answers.energy[0] <= least + slack
    assert found >= 39


def same_bits(one: Answer, other: Answer) -> bool:
    names = ("v", "xi", "inclusion_residual", "energy", "status", "start", "energies", "iterations")
    arrays = all(np.array_equal(getattr(one, n), getattr(other, n), equal_nan=True) for n in names)
    return arrays and all(
        np.array_equal(getattr(one.certificate, flag), getattr(other.certificate, flag)) for flag in FLAGS
    )


def test_a_block_is_the_same_to_the_bit_whoever_solves_it() -> None:
    body, loads, tables, law = block(44, some_laws(), 50)
    first = solve_points(body, loads, tables, law)
    assert same_bits(first, solve_points(body, loads, tables, law))
    own = np.argsort(law, kind="stable")
    used, rows = np.unique(law[own], return_inverse=True)
    alone = solve_block(body, loads[own], tables.at(used[rows].reshape(-1, 1)))
    assert same_bits(reordered([first], own), alone)


def test_laws_by_node_agree_with_laws_by_row() -> None:
    laws = some_laws()
    body, loads, tables, law = block(20, laws, 30)
    by_row = solve_block(body, loads, tables.at(law[:, None]))
    by_node = solve_block(body, loads, tables.at(np.repeat(law[:, None], body.m, axis=1)))
    np.testing.assert_allclose(by_node.energy, by_row.energy, rtol=1e-11, atol=1e-14)
    assert np.array_equal(by_node.certificate.global_minimum, by_row.certificate.global_minimum)


def test_branch_continued_begins_from_its_neighbours() -> None:
    laws = [cases.slip_weakening(1.0, 0.2, 0.05)]
    body, loads, tables, _ = block(20, laws, 1)
    rows, v = tables.at([[0]]), None
    for p, size in enumerate(np.linspace(0.2, 3.0, 12)):
        near = None if v is None else v[None]
        answers = solve_block(body, size * loads, rows, "continued", neighbours=near)
        expected = solve_contact(single(body, size * loads[0], laws[0]), branch="continued", neighbour=v)
        v = expected.v
        np.testing.assert_allclose(answers.v[0], v, atol=1e-9 * np.max(np.abs(v)))
        assert answers.start[0] == expected.start == (0 if p == 0 else NEIGHBOUR)


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


def test_a_body_without_load_or_friction_is_at_rest() -> None:
    body, loads, _, _ = block(5, [cases.spring()], 2)
    nothing = cases.spring(0.0)
    answers = solve_points(body, 0.0 * loads, Laws.of([nothing]), np.zeros(2, dtype=np.intp))
    assert np.all(answers.v == 0.0)
    assert np.all(answers.status == Status.CONVERGED)
    assert np.all(answers.certificate.unique)


def test_where_double_precision_is_not_enough_the_answer_has_a_low_part() -> None:
    """Friction 1e-8 of the load: v is kept as a sum of two doubles."""
    laws = [cases.slip_weakening(1e-8, 0.5e-8, 0.1)]
    body, loads, tables, law = block(20, laws, 3)
    loads = loads / np.max(np.abs(loads)) * np.max(body.c)
    answers = solve_points(body, loads, tables, law, 1e-10)
    assert np.all(answers.status == Status.CONVERGED)
    assert np.any(answers.v_low != 0.0)
    assert np.all(answers.inclusion_residual <= 1e-10)


def test_strengths_and_gaps_by_node_agree_with_the_single_solve() -> None:
    """Two laws of the table, strengths from 0.5 to 2 and a gap: answers, flags and margins of the nodes' laws."""
    laws = [*some_laws(), NONE]
    body, loads, _, law = block(20, laws[:-1], 12)
    index = np.repeat(law[:, None], body.m, axis=1)
    index[:, 8:14], index[:, 14:17] = (index[:, 8:14] + 1) % len(laws[:-1]), len(laws) - 1
    own = [nodal(laws, row, np.linspace(0.5, 2.0, body.m)) for row in index]
    answers = solve_block(body, loads, row_laws(own, np.ones(len(loads))))
    assert np.all(answers.status == Status.CONVERGED)
    for p in range(len(loads)):
        problem = ContactProblem(body.A_tilde, loads[p], body.c, own[p])
        expected = solve_contact(problem)
        proved = certify(problem, answers.v[p], body.lambda_1, inverse=body.inverse)
        assert answers.energy[p] <= expected.energy + TIE * abs(expected.energy)
        for flag in FLAGS:
            assert getattr(answers.certificate, flag)[p] == getattr(proved, flag), flag
        np.testing.assert_allclose(answers.certificate.margin[p], proved.margin, rtol=1e-9)
