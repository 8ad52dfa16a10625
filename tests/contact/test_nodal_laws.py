"""Laws by node: one law to the bit, enumeration of small problems, the field ω(x), films and gaps in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tcstudy.contact.certificates import certify
from tcstudy.contact.contact import solve_contact
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.status import Status
from tcstudy.laws.composed import nodal
from tcstudy.laws.laws import NONE, Laws
from tcstudy.laws.shapes import tresca
from tcstudy.scene.study import SOLVERS
from tests.contact import contact_cases as cases
from tests.contact.exhaustive import energy, small_problem
from tests.contact.random_polygons import by_brute_force

Array = NDArray[np.float64]


def in_two_rows(problem: ContactProblem) -> ContactProblem:
    """The same problem with its law twice in a table, every second node having the second."""
    law = problem.law
    assert isinstance(law, Laws)
    return replace(problem, law=Laws.of((law, law, NONE), np.arange(problem.m) % 2))


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("smooth", [False, True])
def test_one_law_given_by_node_is_that_law(solver: str, smooth: bool) -> None:
    for seed in range(4):
        problem = cases.random_problem(np.random.default_rng([seed, 3]), 44 if solver == SOLVERS[0] else 12, 7, smooth)
        one, two = solve_contact(problem, solver), solve_contact(in_two_rows(problem), solver)
        np.testing.assert_allclose(two.v, one.v, rtol=1e-11, atol=1e-11 * np.max(np.abs(one.v)))
        assert two.energy == pytest.approx(one.energy, rel=1e-12)
        proved, again = certify(problem, one.v), certify(in_two_rows(problem), one.v)
        flags = ("residual", "omega", "convex", "unique", "strict_minimum", "global_minimum")
        assert all(getattr(proved, flag) == getattr(again, flag) for flag in flags)
        np.testing.assert_allclose(again.margin, proved.margin, rtol=1e-9)


def test_all_nodes_alike_are_one_law() -> None:
    law = cases.sawtooth()
    assert nodal([law, cases.sawtooth()], [0, 1, 0]) is law
    assert nodal([law], [0, 0], 0.0) == NONE
    twice = nodal([law], [0, 0, 0], 2.0)
    assert isinstance(twice, Laws)
    assert np.array_equal(twice.b_0, 2.0 * law.b_0)
    with pytest.raises(ValueError, match="strength"):
        nodal([law], [0, 0], [1.0, -1.0])


@pytest.mark.parametrize("m", [2, 3])
def test_the_least_energy_of_all_is_found_with_a_law_of_its_own_at_every_node(m: int) -> None:
    found, convex = 0, 0
    for seed in range(30):
        problem = small_problem(seed, m)
        rng = np.random.default_rng([seed, m])
        shared = [problem.law, cases.slip_weakening(1.0, 0.3, 0.4), tresca(0.7)]
        index, beta = rng.integers(0, 3, m), np.where(rng.random(m) < 0.2, 0.0, rng.uniform(0.3, 2.0, m))
        sigma, a = rng.uniform(0.5, 2.0, m), np.where(rng.random(m) < 0.5, 0.0, 0.1 * rng.normal(size=m))
        law = nodal(shared, index, beta, sigma, a)
        problem = replace(problem, law=law)
        solutions = by_brute_force(problem)[0]
        least = float(np.min(energy(problem, solutions)))
        answer = solve_contact(problem)
        assert answer.status == Status.CONVERGED
        proved = certify(problem, answer.v)
        above = least + 1e-9 * (abs(least) + float(problem.c @ np.abs(law.j(answer.v))))
        # j counts from 0 here and there, so that both energies have one zero
        assert answer.energy >= least - 1e-9 * (abs(least) + 1.0)
        found += answer.energy <= above
        assert not proved.unique or len(solutions) == 1
        assert not proved.global_minimum or answer.energy <= above
        convex += proved.convex
    assert found >= 29
    assert convex > 0


def test_a_field_of_falls_is_sharper_than_its_largest() -> None:
    """One steep node in forty on a body that its neighbours hold: λ₁ − max ω < 0, yet every load has one solution."""
    A_tilde, c = cases.half_laplacian(40)
    steep = cases.slip_weakening(1.0, 0.5, 0.5 / (1.5 * np.pi))  # ω = 1.5 λ₁
    law = nodal([steep, tresca(1.0)], np.where(np.arange(40) == 3, 0, 1))
    problem = ContactProblem(A_tilde, 1.4 * c, c, law)
    proved = certify(problem, solve_contact(problem).v)
    assert proved.lambda_1 - proved.omega < 0.0 < proved.margin
    assert proved.convex
    assert proved.unique
    weight = np.sqrt(np.outer(c, c))
    fall = np.where(np.arange(40) == 3, 1.5 * np.pi, 0.0)
    np.testing.assert_allclose(proved.margin, np.linalg.eigvalsh(A_tilde / weight - np.diag(fall))[0], rtol=1e-9)


def bar(n: int, stiffness: float, length: float) -> tuple[Array, Array]:
    """(Ã, c) of n cells of a bar with both ends free but for a spring far softer than the friction on it."""
    h = length / n
    A = stiffness / h * (2.0 * np.eye(n + 1) - np.eye(n + 1, k=1) - np.eye(n + 1, k=-1))
    A[0, 0] = A[-1, -1] = stiffness / h
    A[0, 0] += 1e-9 * stiffness
    c = np.full(n + 1, h)
    c[[0, -1]] = 0.5 * h
    return A, c


def test_two_films_and_a_gap_have_the_closed_form() -> None:
    """A bar pulled at its end slips over film 2, the gap and part of film 1: P = τ₂ℓ₂ + τ₁ℓ, N linear, u quadratic."""
    n, length, D, pull = 400, 4.0, 100.0, 2.5
    A_tilde, c = bar(n, D, length)
    x = np.linspace(0.0, length, n + 1)
    index = np.where(x < 2.0 - 1e-9, 0, np.where(x < 3.0 - 1e-9, 1, 2))
    law = nodal([tresca(1.0), tresca(5.0), tresca(2.0)], index, np.where(index == 1, 0.0, 1.0))
    load = np.zeros(n + 1)
    load[-1] = pull
    answer = solve_contact(ContactProblem(A_tilde, load, c, law))
    slipped = float(c[(answer.v > 1e-12)].sum())
    front = 2.0 - (pull - 2.0 * 1.0)  # τ₂ = 2 on [3, 4], none on [2, 3], τ₁ = 1 on [front, 2]
    assert slipped == pytest.approx(length - front, abs=2 * c[1])
    gone = 2.0 - front
    end = (0.5 * gone**2 * 1.0 + gone * 1.0 * 1.0 + (gone * 1.0 + 0.5 * 2.0)) / D
    assert answer.v[-1] == pytest.approx(end, rel=0.02)
