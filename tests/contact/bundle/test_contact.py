"""Bundle-Newton on small condensed contact problems, judged by the inclusion residual."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tcstudy.contact.bundle.contact import contact_oracle, solve_with_bundle
from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.laws import Laws

Array = NDArray[np.float64]


def law(name: str, kinks: list[float], p: list[float], q: list[float], a: list[float], r: list[float]) -> Laws:
    found = Laws(name, *(np.array(x, dtype=float) for x in (kinks, [0.0] * len(p), p, q, a, r)))
    found.check_growth()
    return found


LAWS = {
    "constant": law("constant", [0], [-1, 1], [0, 0], [0, 0], [0, 0]),
    "softening": law("softening", [-1, 0, 1], [-0.3, -1, 1, 0.3], [0, -0.7, -0.7, 0], [0] * 4, [0] * 4),
    "down-jump": law("down-jump", [-1, 0, 1], [-0.4, -1, 1, 0.4], [0] * 4, [0] * 4, [0] * 4),
    "exponential": law("exponential", [0], [-0.5, 0.5], [0, 0], [-0.5, 0.5], [-2, 2]),
}


def contact_problem(m: int, shape: Laws, seed: int, s: float = 1.0, b: float = 1.0) -> ContactProblem:
    """A body like an elastic half plane (stiffness ~ |wave number|), slips of order s, tractions of order b."""
    random = np.random.default_rng(seed)
    k = np.arange(1, m + 1)
    modes = np.sqrt(2 / (m + 1)) * np.sin(np.pi * np.outer(k, k) / (m + 1))
    c = (1 + 0.2 * random.random(m)) / m
    A_tilde = (modes * (2 * np.sin(np.pi * k / (2 * (m + 1))))) @ modes * (0.8 * b / (s * m))
    load = 1.8 * np.sin(2 * np.pi * k / (m + 1)) + 0.75 + 0.45 * random.standard_normal(m)
    return ContactProblem(A_tilde, b * c * load, c, shape.scaled(1.0 / s, 1.0 / b))


@pytest.mark.parametrize("name", LAWS)
def test_oracle_agrees_with_differences_of_the_energy(name: str) -> None:
    problem = contact_problem(6, LAWS[name], 0)
    oracle, h = contact_oracle(problem), 1e-6
    v = np.random.default_rng(1).uniform(-2, 2, 6)
    f, g, G = oracle(v)
    slope = [(oracle(v + h * e)[0] - oracle(v - h * e)[0]) / (2 * h) for e in np.eye(6)]
    bend = [(oracle(v + h * e)[1] - oracle(v - h * e)[1]) / (2 * h) for e in np.eye(6)]
    assert f == problem.energy(v)
    assert np.allclose(slope, g, atol=1e-8)
    assert np.allclose(bend, problem.A_tilde + np.diag(G), atol=1e-8)


@pytest.mark.parametrize("start", ["zero", "frictionless"])
@pytest.mark.parametrize("m", [3, 8, 20])
@pytest.mark.parametrize("name", LAWS)
def test_solution_satisfies_the_inclusion(name: str, m: int, start: str) -> None:
    problem = contact_problem(m, LAWS[name], m)
    v0 = np.zeros(m) if start == "zero" else problem.frictionless()
    outcome = solve_with_bundle(problem, inclusion=None, x0=v0)
    assert outcome.converged, outcome.reason
    assert problem.inclusion_residual(outcome.x, tolerance=1e-6) <= 1e-5


def test_body_without_load_sticks_everywhere_in_any_units() -> None:
    counts = set()
    for s, b in ((1.0, 1.0), (2.0**-20, 2.0**30)):
        problem = contact_problem(6, LAWS["softening"], 4, s, b)
        unloaded = ContactProblem(problem.A_tilde, 0.0 * problem.l_tilde, problem.c, problem.law)
        outcome = solve_with_bundle(unloaded, np.zeros(6))
        assert outcome.converged, outcome.reason
        assert np.max(np.abs(outcome.x)) <= 1e-9 * s
        counts.add(outcome.iterations)
    assert len(counts) == 1


def test_convex_problem_has_the_energy_of_an_independent_solver() -> None:
    """Constant friction: exact minimisation over one node after the other (soft threshold) converges to it."""
    problem = contact_problem(12, LAWS["constant"], 5)
    v = np.zeros(12)
    diagonal = np.diag(problem.A_tilde)
    for _ in range(4000):
        for i in range(12):
            rest = problem.l_tilde[i] - problem.A_tilde[i] @ v + diagonal[i] * v[i]
            v[i] = np.sign(rest) * max(0.0, abs(rest) - problem.c[i]) / diagonal[i]
    outcome = solve_with_bundle(problem, inclusion=None, x0=np.zeros(12))
    assert outcome.f == pytest.approx(problem.energy(v), rel=1e-11)
    assert np.allclose(outcome.x, v, atol=1e-6)


@pytest.mark.parametrize(("s", "b"), [(2.0**-20, 2.0**30), (2.0**20, 2.0**-30)])
def test_units_of_slip_and_traction_do_not_matter(s: float, b: float) -> None:
    plain, other = contact_problem(8, LAWS["softening"], 2), contact_problem(8, LAWS["softening"], 2, s, b)
    first = solve_with_bundle(plain, inclusion=None, x0=np.zeros(8))
    second = solve_with_bundle(other, inclusion=None, x0=np.zeros(8))
    assert second.iterations == first.iterations
    assert np.allclose(second.x / s, first.x, rtol=0, atol=1e-9)
