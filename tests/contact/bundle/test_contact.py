"""Bundle-Newton on condensed contact problems: solved to the inclusion for every kind of law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tcstudy.contact.bundle import contact_oracle, solve_with_bundle
from tcstudy.contact.problem import ContactProblem, Status
from tcstudy.contact.solve import solve_contact
from tcstudy.laws.shapes import linear, piecewise_linear, tresca
from tcstudy.scene.study import EXACT
from tests.contact import contact_cases as cases

KINDS = ("tresca", "slip-weakening", "exponential", "saw-tooth", "jumps", "linear")


def problem_of(kind: str, m: int, ratio: float, load: float) -> ContactProblem:
    """A half-plane body under an uneven load of both signs of at most `load`; a law of peak 1 that falls at ratio·λ₁.

    load: 0.9 keeps every node sticking, 1.2 is just past first slip
    """
    omega = ratio * np.pi
    d = 0.6 / omega
    law = {
        "tresca": lambda: tresca(1.0),
        "slip-weakening": lambda: cases.slip_weakening(1.0, 0.4, d),
        "exponential": lambda: cases.exponential_decay(1.0, 0.4, d),
        "saw-tooth": lambda: cases.sawtooth(1.0, 0.5 / omega, 0.4 * omega, 0.5),
        "jumps": lambda: piecewise_linear([(0, 1), (d, 0.7), (d, 0.5), (2 * d, 0.6), (2 * d, 0.3)], True, None, None),
        "linear": lambda: linear(omega),
    }[kind]()
    A_tilde, c = cases.half_laplacian(m)
    x = (np.arange(m) + 0.5) / m
    shape = np.sin(2 * np.pi * x) + 0.6 + 0.3 * np.sin(5 * np.pi * x + 1)
    return ContactProblem(A_tilde, c * load * shape / np.max(np.abs(shape)), c, law)


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


@pytest.mark.parametrize("ratio", [0.5, 8.0])
@pytest.mark.parametrize("kind", KINDS)
def test_every_law_is_solved_from_zero(kind: str, ratio: float) -> None:
    """Convex problems have the energy of separable-newton."""
    for m, load in ((20, 1.2), (30, 4.0)):
        problem = problem_of(kind, m, ratio, load)
        answer = solve_contact(problem, "bundle-newton", 1e-10, branch="from-zero")
        assert answer.status == Status.CONVERGED, answer.reason
        assert cases.independent_residual(problem, answer.v) <= 1e-10
        if kind in ("tresca", "linear"):
            assert answer.energy == pytest.approx(solve_contact(problem).energy, rel=1e-11, abs=1e-14)


def test_the_exact_solution_is_a_start_of_bundle_newton_too() -> None:
    """Two wells of one node: from zero and without friction it ends in one, beside the exact solution in the other."""
    problem = ContactProblem(np.eye(1), np.array([0.79]), np.ones(1), cases.slip_weakening(1.0, 0.2, 0.4))
    answer = solve_contact(problem, "bundle-newton", exact=np.array([0.1]))
    assert answer.energies[EXACT] == problem.energy(np.zeros(1))
    assert answer.start != EXACT
