"""finish: from perturbed solutions back to exact ones, and never to a worse point."""

import numpy as np
import pytest

from tcstudy.contact.active_set import ActivePieces, finish, solve_on
from tcstudy.contact.contact import nearest_minimum
from tcstudy.contact.problem import ContactProblem
from tcstudy.laws.laws import Laws
from tests.contact import contact_cases as cases


def one_node(law: Laws, load: float, stiffness: float = 1.0) -> ContactProblem:
    return ContactProblem(np.array([[stiffness]]), np.array([load]), np.array([1.0]), law)


def test_known_solutions_of_one_node() -> None:
    """Ã = c = 1, b = 1 − 2s up to 0.4, then 0.2: with l̃ = 0.8 the slips 0, 0.2 and 0.6 satisfy the inclusion."""
    law = cases.slip_weakening(1.0, 0.2, 0.4)
    problem = one_node(law, 0.8)
    for start, slip in ((0.01, 0.0), (0.7, 0.6), (0.55, 0.6)):
        v, residual = finish(problem, np.array([start]))
        assert residual <= 1e-15
        assert v[0] == pytest.approx(slip, abs=1e-15)
    falling = ActivePieces(np.array([-1]), np.array([2]))
    assert solve_on(problem, falling, np.array([0.3]), 2)[0] == pytest.approx(0.2, abs=1e-15)


def test_resting_nodes_are_set_to_the_kink_bitwise() -> None:
    law = cases.linear_law("step", [0.1], [-1.0], [1.0], (0.0, 0.0))
    v, residual = finish(one_node(law, 0.3), np.array([0.1 + 1e-7]))
    assert v[0] == law.kinks[0]
    assert residual == 0.0


def test_exponential_piece_is_solved_to_rounding() -> None:
    """2 s + ½ + ½ exp(−10 s) = 1.3, solved here by bisection."""
    low, high = 0.1, 1.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if 2 * middle + 0.5 + 0.5 * np.exp(-10 * middle) < 1.3 else (low, middle)
    v, residual = finish(one_node(cases.exponential_decay(), 1.3, 2.0), np.array([0.5]))
    assert v[0] == pytest.approx(low, rel=1e-14)
    assert residual <= 1e-15


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("error", [1e-8, 1e-5, 1e-3])
def test_perturbed_solutions_are_restored(smooth: bool, error: float) -> None:
    """Perturbations relative to the kink spacing; every one must come back with the inclusion at rounding."""
    for seed in range(12):
        rng = np.random.default_rng([seed, int(smooth), 5])
        problem = cases.random_problem(rng, 40, max_kinks=9, smooth=smooth)
        solution, _ = nearest_minimum(problem, np.zeros(40), 1e-12)
        length = problem.law.s_scale or float(np.max(np.abs(solution)))
        v, residual = finish(problem, solution + error * length * rng.normal(size=40))
        assert residual <= 1e-12
        assert cases.independent_residual(problem, v) <= 1e-12


def test_a_point_is_never_made_worse() -> None:
    """Also far from any solution and with few steps, where the identification may cycle."""
    for seed in range(40):
        rng = np.random.default_rng([seed, 6])
        problem = cases.random_problem(rng, 10, smooth=seed % 2 == 1)
        v = rng.normal(size=10)
        before = problem.inclusion_residual(v)
        point, residual = finish(problem, v, newton_steps=int(rng.integers(1, 4)))
        assert residual <= before
        assert residual == problem.inclusion_residual(point)


def test_singular_pieces_return_the_start() -> None:
    """A falling piece whose slope cancels Ã exactly: Newton has no step, the point comes back unchanged."""
    law = cases.slip_weakening(1.0, 0.5, 0.5)
    v, residual = finish(one_node(law, 1.01), np.array([0.25]))
    assert v[0] == 0.25
    assert residual > 0.0
