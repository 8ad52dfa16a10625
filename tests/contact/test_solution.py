"""Newton's method on identified pieces: back to exact solutions, never to a worse point;
derivatives at solutions."""

from dataclasses import replace

import numpy as np
import pytest

from tcstudy.contact.certificates import certify
from tcstudy.contact.problem import ContactProblem, Status
from tcstudy.contact.solution import Linearised, extended, polished
from tcstudy.contact.solve import nearest_minimum, solve_contact
from tcstudy.laws.composed import law_slopes
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import SHAPES, tresca
from tcstudy.scene.solver_plan import TOLERANCE
from tests.contact import contact_cases as cases
from tests.contact.contact_cases import ill_conditioned


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
def test_one_node(
    law: Laws, load: float, stiffness: float, start: float, slip: float, exact: bool
) -> None:
    end = polished(one_node(law, load, stiffness), np.array([start]), exact=exact)
    assert end.v[0] == pytest.approx(slip, rel=4e-15, abs=1e-15)
    assert end.v[0] == law.kinks[0] or law is not STEP
    assert (end.residual <= 1e-15) == (start != slip)


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("error", [1e-8, 1e-3])
def test_perturbed_solutions_are_restored(smooth: bool, error: float) -> None:
    """Perturbations relative to the kink spacing; every one must come back with the inclusion at
    rounding."""
    for seed in range(8):
        rng = np.random.default_rng([seed, int(smooth), 5])
        problem = cases.random_problem(rng, 40, max_kinks=9, smooth=smooth)
        solution, _ = nearest_minimum(problem, np.zeros(40), 1e-12)
        length = problem.law.s_scale or float(np.max(np.abs(solution)))
        end = polished(problem, solution + error * length * rng.normal(size=40), exact=False)
        assert cases.independent_residual(problem, end.v) <= 1e-12


def rail(m: int, strain: float = 7.2e-4) -> ContactProblem:
    """−u″ + b(u) = 0, u(0) = 0, u′(1) = strain, of m cells: a long bar that heat pushes out against
    friction 1e-3."""
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
    """From a solution rounded to doubles; a body of condition 1e17 leaves refinement no factor to
    work with.

    That is said; a written tolerance refuses.
    """
    rng, film = np.random.default_rng(7), tresca(1e-4)
    A, v = ill_conditioned(rng, 20, 1e17), rng.normal(size=20)
    problem = ContactProblem(A, A @ v + film.b(v), np.ones(20), film)
    answer = solve_contact(problem, branch="continued", neighbour=v)
    assert (answer.status, bool(answer.limited)) == (Status.CONVERGED, True)
    assert TOLERANCE < answer.inclusion_residual <= answer.rounding
    strict = solve_contact(problem, tolerance=TOLERANCE, branch="continued", neighbour=v)
    assert strict.status == Status.INCLUSION_VIOLATED
    assert "rounding alone leaves" in strict.reason


def softening(tau_s: float = 1.0, tau_k: float = 0.4, delta: float = 0.5) -> Laws:
    return SHAPES["slip-weakening"].build(tau_s=tau_s, tau_k=tau_k, delta=delta)


def test_one_spring_in_closed_form() -> None:
    """v + (1 − v/4) = l: v = (4/3)(l − 1), and with b = tau_s(1 − v/δ) v = (l − tau_s)/(1 −
    tau_s/δ)."""
    problem = ContactProblem(np.eye(1), np.array([1.2]), np.ones(1), softening(1.0, 0.0, 4.0))
    v = solve_contact(problem).v
    at = Linearised.at(problem, v)
    assert at.step(np.ones(1)) == pytest.approx([4.0 / 3.0], rel=1e-14)
    for name, exact in (
        ("tau_s", (-0.75 + 0.2 / 4.0) / 0.75**2),
        ("delta", -0.2 / (0.75 * 4.0) ** 2),
    ):
        b = law_slopes(softening(1.0, 0.0, 4.0), name).value(v, at.piece)
        assert at.step(-b) == pytest.approx([exact], rel=1e-12)
    stiffer = at.step(-v)  # (E v)' at E = 1
    assert stiffer == pytest.approx([-v[0] / 0.75], rel=1e-13)


def test_a_resting_node_moves_with_its_kink() -> None:
    """b jumps up at s = δ: the node rests there, and its neighbour feels it through A."""
    law = SHAPES["piecewise-linear"].build(points=[(0.0, 0.0), (1.0, 0.2), (1.0, 2.0), (3.0, 2.0)])
    A_tilde = np.array([[2.0, -1.0], [-1.0, 2.0]])
    problem = ContactProblem(A_tilde, np.array([2.6, 0.0]), np.ones(2), law)
    v = solve_contact(problem).v
    at = Linearised.at(problem, v)
    assert at.stuck.tolist() == [0]
    dv = at.step(np.zeros(2), np.array([1.0, 0.0]))
    assert dv == pytest.approx([1.0, 1.0 / 2.2])


def test_events_are_counted_and_folds_are_said() -> None:
    law = softening(1.0, 0.4, 0.5)
    at_kink = ContactProblem(np.eye(1) * 3.0, np.array([1.9]), np.ones(1), law)
    assert Linearised.at(at_kink, np.array([0.5])).events == 1
    about_to_slide = ContactProblem(np.eye(1) * 3.0, np.array([1.0]), np.ones(1), law)
    assert Linearised.at(about_to_slide, np.zeros(1)).events == 1
    assert Linearised.at(replace(about_to_slide, l_tilde=np.array([0.9])), np.zeros(1)).events == 0
    fold = ContactProblem(
        np.eye(1) * 1.2, np.array([1.0]), np.ones(1), law
    )  # b falls by 1.2 a length
    assert Linearised.at(fold, np.array([0.2])).singular
