"""Blocks of points against the single solve and bits; laws by node against one law and
enumeration."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from tcstudy.contact.certificates import certify
from tcstudy.contact.problem import ContactProblem, Status
from tcstudy.contact.solve import solve_contact
from tcstudy.laws.composed import nodal
from tcstudy.laws.laws import NONE
from tcstudy.laws.shapes import tresca
from tests.contact import contact_cases as cases
from tests.contact.contact_cases import block, solve_points, some_laws
from tests.contact.exhaustive import energy, small_problem
from tests.contact.random_polygons import by_brute_force

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
        np.testing.assert_allclose(
            answers.energy[p], problem.energy(answers.v[p]), rtol=1e-11, atol=1e-14
        )
        proved = certify(problem, answers.v[p], body.lambda_1, inverse=body.inverse)
        for flag in FLAGS:
            assert getattr(answers.certificate, flag)[p] == getattr(proved, flag), flag


def test_a_block_is_the_same_to_the_bit_every_time() -> None:
    body, loads, tables, law = block(44, some_laws(), 30)
    one, other = (
        solve_points(pickle.loads(pickle.dumps(body)), loads, tables, law) for _ in range(2)
    )
    for name in (
        "v",
        "xi",
        "inclusion_residual",
        "energy",
        "status",
        "start",
        "energies",
        "iterations",
    ):
        assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True), name
    assert all(
        np.array_equal(getattr(one.certificate, flag), getattr(other.certificate, flag))
        for flag in FLAGS
    )


def test_all_nodes_alike_are_one_law() -> None:
    law = cases.sawtooth()
    assert nodal([law, cases.sawtooth()], [0, 1, 0]) is law
    assert nodal([law], [0, 0], 0.0) == NONE
    assert np.array_equal(nodal([law], [0, 0, 0], 2.0).b_0, 2.0 * law.b_0)
    with pytest.raises(ValueError, match="strength"):
        nodal([law], [0, 0], [1.0, -1.0])


@pytest.mark.parametrize("m", [2, 3])
def test_the_least_energy_of_all_is_found_with_a_law_of_its_own_at_every_node(m: int) -> None:
    convex = 0
    for seed in range(25):
        problem = small_problem(seed, m)
        rng = np.random.default_rng([seed, m])
        shared = [problem.law, cases.slip_weakening(1.0, 0.3, 0.4), tresca(0.7)]
        index, beta = (
            rng.integers(0, 3, m),
            np.where(rng.random(m) < 0.2, 0.0, rng.uniform(0.3, 2.0, m)),
        )
        sigma, a = (
            rng.uniform(0.5, 2.0, m),
            np.where(rng.random(m) < 0.5, 0.0, 0.1 * rng.normal(size=m)),
        )
        problem = replace(problem, law=nodal(shared, index, beta, sigma, a))
        solutions = by_brute_force(problem)[0]
        least = float(np.min(energy(problem, solutions)))
        answer = solve_contact(problem)
        assert answer.status == Status.CONVERGED
        proved = certify(problem, answer.v)
        above = least + 1e-9 * (abs(least) + float(problem.c @ np.abs(problem.law.j(answer.v))))
        # j counts from 0 here and there, so that both energies have one zero
        assert least - 1e-9 * (abs(least) + 1.0) <= answer.energy <= above
        assert not proved.unique or len(solutions) == 1
        convex += proved.convex
    assert convex > 0


def test_a_field_of_falls_is_sharper_than_its_largest() -> None:
    """One steep node in forty on a body that its neighbours hold: λ₁ − max ω < 0, yet every load
    has one solution."""
    A_tilde, c = cases.half_laplacian(40)
    steep = cases.slip_weakening(1.0, 0.5, 0.5 / (1.5 * np.pi))  # ω = 1.5 λ₁
    law = nodal([steep, tresca(1.0)], np.where(np.arange(40) == 3, 0, 1))
    problem = ContactProblem(A_tilde, 1.4 * c, c, law)
    proved = certify(problem, solve_contact(problem).v)
    assert proved.lambda_1 - proved.omega < 0.0 < proved.margin
    assert (proved.convex, proved.unique) == (True, True)
    fall = np.where(np.arange(40) == 3, 1.5 * np.pi, 0.0)
    least = np.linalg.eigvalsh(A_tilde / np.sqrt(np.outer(c, c)) - np.diag(fall))[0]
    np.testing.assert_allclose(proved.margin, least, rtol=1e-9)
