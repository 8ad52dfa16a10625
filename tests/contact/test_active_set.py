"""Newton's method on identified pieces: from perturbed solutions back to exact ones, never to a worse point."""

import numpy as np
import pytest

from tcstudy.contact.certificates import certify
from tcstudy.contact.problem import ContactProblem, Status
from tcstudy.contact.solution import extended, polished
from tcstudy.contact.solve import nearest_minimum, solve_contact
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import tresca
from tcstudy.scene.study import TOLERANCE
from tests.contact import contact_cases as cases
from tests.contact.ill_conditioned import body


def one_node(law: Laws, load: float, stiffness: float = 1.0) -> ContactProblem:
    return ContactProblem(np.array([[stiffness]]), np.array([load]), np.array([1.0]), law)


STEP = cases.linear_law("step", [0.1], [-1.0], [1.0], (0.0, 0.0))
FALLING = cases.slip_weakening(1.0, 0.2, 0.4)


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize(
    ("law", "load", "stiffness", "start", "slip"),
    [
        (FALLING, 0.8, 1.0, 0.01, 0.0),
        (FALLING, 0.8, 1.0, 0.7, 0.6),
        (FALLING, 0.8, 1.0, 0.55, 0.6),
        (STEP, 0.3, 1.0, 0.1 + 1e-7, 0.1),  # on the kink to the bit
        # 2 s + ½ + ½ exp(−10 s) = 1.3
        (cases.exponential_decay(), 1.3, 2.0, 0.5, 0.39519573750922377),
        # a falling piece whose slope cancels Ã: Newton has no step
        (cases.slip_weakening(1.0, 0.5, 0.5), 1.01, 1.0, 0.25, 0.25),
    ],
)
def test_one_node(law: Laws, load: float, stiffness: float, start: float, slip: float, exact: bool) -> None:
    end = polished(one_node(law, load, stiffness), np.array([start]), exact=exact)
    assert end.v[0] == pytest.approx(slip, rel=4e-15, abs=1e-15)
    assert end.v[0] == law.kinks[0] or law is not STEP
    assert (end.residual <= 1e-15) == (start != slip)


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("error", [1e-8, 1e-3])
def test_perturbed_solutions_are_restored(smooth: bool, error: float) -> None:
    """Perturbations relative to the kink spacing; every one must come back with the inclusion at rounding."""
    for seed in range(8):
        rng = np.random.default_rng([seed, int(smooth), 5])
        problem = cases.random_problem(rng, 40, max_kinks=9, smooth=smooth)
        solution, _ = nearest_minimum(problem, np.zeros(40), 1e-12)
        length = problem.law.s_scale or float(np.max(np.abs(solution)))
        end = polished(problem, solution + error * length * rng.normal(size=40), exact=False)
        assert cases.independent_residual(problem, end.v) <= 1e-12


def rail(m: int, strain: float = 7.2e-4) -> ContactProblem:
    """−u″ + b(u) = 0, u(0) = 0, u′(1) = strain, of m cells: a long bar that heat pushes out against friction 1e-3."""
    h = 1.0 / m
    A = (2.0 * np.eye(m) - np.eye(m, k=1) - np.eye(m, k=-1)) / h
    A[-1, -1] = 1.0 / h
    load, c = np.zeros(m), np.full(m, h)
    load[-1], c[-1] = strain, 0.5 * h
    return ContactProblem(A, load, c, tresca(1e-3))


def test_slender_bar_is_solved_although_one_double_cannot_hold_it() -> None:
    problem = rail(1600, 9.137e-4)
    answer = solve_contact(problem)
    assert (answer.status, bool(answer.limited)) == (Status.CONVERGED, False)
    assert answer.inclusion_residual <= TOLERANCE < extended(problem, answer.v).residual
    length = 9.137e-4 / 1e-3
    assert answer.v[-1] == pytest.approx(0.5 * 1e-3 * length**2, rel=1e-6)
    assert extended(problem, answer.v, answer.v_low).xi == pytest.approx(answer.xi, abs=0.0)
    assert certify(problem, answer.v, residual=answer.inclusion_residual).unique


def test_written_tolerance_is_met_or_refused() -> None:
    assert solve_contact(rail(200), tolerance=1e-14).inclusion_residual <= 1e-14
    refused = solve_contact(rail(200), tolerance=1e-300)
    assert refused.status != Status.CONVERGED or refused.inclusion_residual == 0.0


def test_what_rounding_limits_is_a_solution_by_default_only() -> None:
    """A body of condition 1e16 leaves refinement no factor to work with; that is said; a written tolerance refuses."""
    rng = np.random.default_rng(5)
    A = body(rng, 20, 1e16)
    problem = ContactProblem(A, A @ rng.normal(size=20), np.ones(20), tresca(1e-4))
    answer = solve_contact(problem)
    assert (answer.status, bool(answer.limited)) == (Status.CONVERGED, True)
    assert TOLERANCE < answer.inclusion_residual <= answer.rounding
    strict = solve_contact(problem, tolerance=TOLERANCE)
    assert strict.status == Status.INCLUSION_VIOLATED
    assert "rounding alone leaves" in strict.reason
