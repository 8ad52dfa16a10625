"""Bundle-Newton on condensed contact problems of every law kind: solved to the inclusion, and at what count."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tcstudy.contact.bundle.contact import contact_oracle, solve_with_bundle
from tcstudy.contact.contact import solve_contact
from tcstudy.contact.problem import ContactProblem
from tcstudy.contact.status import Status
from tcstudy.laws.laws import Laws
from tcstudy.scene.study import EXACT
from tests.contact import contact_cases as cases

Array = NDArray[np.float64]

KINDS = ("tresca", "slip-weakening", "exponential", "saw-tooth", "jumps", "linear")
TOLERANCE = 1e-10


def law_of(kind: str, ratio: float, lambda_1: float) -> Laws:
    """A law with peak 1 that falls by 0.6 (saw-tooth: 0.2 in a down-jump after each tooth) at the slope ratio·λ₁.

    tresca does not depend on the ratio; linear rises with that slope; saw-tooth and jumps fall in down-jumps, so the
    ratio sets their slip scale only.
    """
    omega = ratio * lambda_1
    d = 0.6 / omega
    if kind == "tresca":
        return cases.linear_law(kind, [0.0], [-1.0], [1.0], (0.0, 0.0))
    if kind == "slip-weakening":
        return cases.slip_weakening(1.0, 0.4, d)
    if kind == "exponential":
        return cases.exponential_decay(1.0, 0.4, d)
    if kind == "saw-tooth":
        return cases.sawtooth(1.0, 0.5 / omega, 0.4 * omega, 0.5)
    if kind == "jumps":
        left, right = [-0.3, -0.5, -1.0, 0.7, 0.6], [-0.6, -0.7, 1.0, 0.5, 0.3]
        return cases.linear_law(kind, [-2 * d, -d, 0.0, d, 2 * d], left, right, (0.0, 0.0))
    return cases.spring(omega)


def problem_of(kind: str, m: int, ratio: float, load: float) -> ContactProblem:
    """A half-plane body under an uneven load of both signs whose largest value is `load` times the peak of b.

    load: 0.9 keeps every node sticking, 1.2 is just past first slip
    """
    A_tilde, c = cases.half_laplacian(m)
    x = (np.arange(m) + 0.5) / m
    shape = np.sin(2 * np.pi * x) + 0.6 + 0.3 * np.sin(5 * np.pi * x + 1)
    return ContactProblem(A_tilde, c * load * shape / np.max(np.abs(shape)), c, law_of(kind, ratio, np.pi))


@pytest.mark.parametrize("kind", KINDS)
def test_oracle_agrees_with_differences_of_the_energy(kind: str) -> None:
    problem, h = problem_of(kind, 6, 2.0, 2.0), 1e-6
    oracle = contact_oracle(problem)
    v = np.random.default_rng(1).uniform(-2, 2, 6)
    f, g, diagonal = oracle(v)
    slope = [(oracle(v + h * e)[0] - oracle(v - h * e)[0]) / (2 * h) for e in np.eye(6)]
    bend = [(oracle(v + h * e)[1] - oracle(v - h * e)[1]) / (2 * h) for e in np.eye(6)]
    assert f == problem.energy(v)
    assert np.allclose(slope, g, atol=1e-8)
    assert np.allclose(bend, problem.A_tilde + np.diag(diagonal), atol=1e-7)


def test_convex_problem_has_the_energy_of_an_independent_solver() -> None:
    """Constant friction: exact minimisation over one node after the other (soft threshold) converges to it."""
    problem = problem_of("tresca", 12, 1.0, 2.0)
    v, diagonal = np.zeros(12), np.diag(problem.A_tilde)
    for _ in range(4000):
        for i in range(12):
            rest = problem.l_tilde[i] - problem.A_tilde[i] @ v + diagonal[i] * v[i]
            v[i] = np.sign(rest) * max(0.0, abs(rest) - problem.c[i]) / diagonal[i]
    outcome = solve_with_bundle(problem, np.zeros(12), inclusion=None)
    assert outcome.f == pytest.approx(problem.energy(v), rel=1e-11)
    assert np.allclose(outcome.x, v, atol=1e-6)


def test_units_do_not_matter_and_a_body_without_load_sticks() -> None:
    plain = problem_of("slip-weakening", 8, 2.0, 2.0)
    first = solve_with_bundle(plain, np.zeros(8), inclusion=None)
    for s, b in ((2.0**-20, 2.0**30), (2.0**20, 2.0**-30)):
        other = cases.rescaled(plain, s, b, 1.0)
        second = solve_with_bundle(other, np.zeros(8), inclusion=None)
        assert second.iterations == first.iterations
        assert np.allclose(second.x * s, first.x, rtol=0, atol=1e-9)
        unloaded = solve_with_bundle(replace(other, l_tilde=0.0 * other.l_tilde), np.zeros(8))
        assert unloaded.converged, unloaded.reason
        assert np.max(np.abs(unloaded.x)) <= 1e-9 / s


@pytest.mark.parametrize("ratio", [0.5, 2.0, 8.0])
@pytest.mark.parametrize("kind", KINDS)
def test_every_law_is_solved_from_zero(kind: str, ratio: float) -> None:
    """Convex problems have the energy of separable-newton."""
    for m, load in ((20, 1.2), (20, 2.0), (30, 4.0), (50, 0.9)):
        problem = problem_of(kind, m, ratio, load)
        answer = solve_contact(problem, "bundle-newton", TOLERANCE, branch="from-zero")
        assert answer.status == Status.CONVERGED, answer.reason
        assert cases.independent_residual(problem, answer.v) <= TOLERANCE
        if kind in ("tresca", "linear"):
            assert answer.energy == pytest.approx(solve_contact(problem).energy, rel=1e-11, abs=1e-14)


def test_iteration_limit_is_a_status_with_a_reason() -> None:
    problem = problem_of("slip-weakening", 50, 8.0, 1.2)
    outcome = solve_with_bundle(problem, np.zeros(50), max_iterations=5)
    assert outcome.status == Status.ITERATION_LIMIT
    assert "max_iterations" in outcome.reason


def test_the_exact_solution_is_a_start_of_bundle_newton_too() -> None:
    """Two wells of one node: from zero and without friction it ends in one, beside the exact solution in the other."""
    problem = ContactProblem(np.eye(1), np.array([0.79]), np.ones(1), cases.slip_weakening(1.0, 0.2, 0.4))
    answer = solve_contact(problem, "bundle-newton", exact=np.array([0.1]))
    assert answer.energies[EXACT] == problem.energy(np.zeros(1))
    assert answer.start != EXACT
