"""Friction that knows the pressure: against all states by brute force, an iteration of projections,
and closed forms of one node."""

import itertools

import numpy as np
import pytest

import tcstudy
from tcstudy.contact.pressure_friction import (
    PressureAnswer,
    PressureFriction,
    contraction_bound,
    solve_with_pressure,
)
from tcstudy.contact.problem import ContactProblem, Status
from tcstudy.laws.laws import NONE, Laws
from tcstudy.laws.shapes import unilateral

MU = 0.3


def body_on_base(
    seed: int, coefficient: Laws, coulomb: bool = True
) -> tuple[ContactProblem, PressureFriction]:
    """One to four nodes on a base that only pushes, held by bonds in their slips; cells differ."""
    rng = np.random.default_rng(seed)
    k = int(rng.integers(1, 5))
    factor = rng.normal(size=(2 * k, 2 * k))
    A_tilde = factor @ factor.T / (2 * k) + 0.5 * np.eye(2 * k)
    load = rng.normal(size=2 * k)
    load[k:] -= 0.5
    c = rng.uniform(0.5, 2.0, 2 * k)
    bond = tcstudy.law("linear", k=float(rng.uniform(0.0, 0.5)))
    laws = Laws.of([bond] * k + [unilateral()] * k, np.arange(2 * k))
    problem = ContactProblem(A_tilde, load, c, laws)
    nodes = np.arange(k)
    friction = PressureFriction(nodes, k + nodes, coefficient, np.full(k, coulomb), np.zeros(k))
    return problem, friction


def all_states(problem: ContactProblem, friction: PressureFriction, mu: float) -> list[np.ndarray]:
    """Every solution, from the linear equations of all combinations of open, stuck, slipping."""
    k = len(friction.slip)
    c, load = problem.c, problem.l_tilde
    matrix = problem.A_tilde + np.diag(
        c * problem.law.slope(np.full(2 * k, 1.0), problem.law.piece(np.full(2 * k, 1.0)))
    )
    solutions: list[np.ndarray] = []
    for states in itertools.product(("open", "stuck", -1.0, 1.0), repeat=k):
        rows, rhs, free = matrix.copy(), load.copy(), list[int]()
        for i, state in enumerate(states):
            if state == "open":
                free += [i, k + i]
            elif state != "stuck":
                free.append(i)
                if friction.coulomb[i]:  # sign μ p c_T, p = (Ãv − l̃)_N/c_N
                    share = state * mu * c[i] / c[k + i]
                    rows[i] += share * problem.A_tilde[k + i]
                    rhs[i] += share * load[k + i]
                else:
                    rhs[i] -= state * mu * c[i]
        v = np.zeros(2 * k)
        v[free] = np.linalg.solve(rows[np.ix_(free, free)], rhs[free])
        xi = load - matrix @ v
        agrees = True
        for i, state in enumerate(states):
            pressure = -xi[k + i] / c[k + i]
            if state == "open":
                agrees &= bool(v[k + i] >= 0.0)
                continue
            bound = mu * (pressure if friction.coulomb[i] else 1.0)
            agrees &= bool(pressure >= 0.0)
            agrees &= (
                bool(abs(xi[i]) <= bound * c[i]) if state == "stuck" else bool(state * v[i] >= 0.0)
            )
        if agrees and not any(np.allclose(v, other, atol=1e-9) for other in solutions):
            solutions.append(v)
    return solutions


def distance_to(solutions: list[np.ndarray], answer: PressureAnswer) -> float:
    return min((float(np.max(np.abs(v - answer.v))) for v in solutions), default=np.inf)


@pytest.mark.parametrize("mu", [0.1, 0.5, 2.0])
def test_random_bodies_end_in_a_state_that_brute_force_finds(mu: float) -> None:
    """A proof of uniqueness never meets two states; large coefficients may have several or none."""
    counts = []
    for seed in range(40):
        problem, friction = body_on_base(seed, tcstudy.law("tresca", tau=mu))
        states = all_states(problem, friction, mu)
        answer = solve_with_pressure(problem, friction)
        counts.append(len(states))
        assert answer.status == Status.CONVERGED
        assert distance_to(states, answer) < 1e-8
        assert not (answer.unique and len(states) != 1)
    assert max(counts) > 1 or mu < 2.0


def test_a_law_acts_only_where_the_body_is_pressed() -> None:
    converged = 0
    for seed in range(40):
        problem, friction = body_on_base(seed, tcstudy.law("tresca", tau=MU), coulomb=False)
        answer = solve_with_pressure(problem, friction)
        if answer.status != Status.CONVERGED:
            assert "take turns" in answer.reason
            continue
        converged += 1
        assert distance_to(all_states(problem, friction, MU), answer) < 1e-8
        is_open = answer.v[friction.opening] > 0.0
        assert np.all(answer.strengths == ~is_open)
    assert converged >= 38


def by_projections(A_tilde: np.ndarray, load: np.ndarray, mu: float) -> np.ndarray:
    """Node after node, forces are moved against their slips and put back into the cone |T| ≤ μN."""
    compliance = np.linalg.inv(A_tilde)
    k = len(load) // 2
    v = compliance @ load
    push, shear = np.zeros(k), np.zeros(k)
    for _ in range(4000):
        for i in range(k):
            new_push = max(0.0, push[i] - v[k + i] / compliance[k + i, k + i])
            v += compliance[:, k + i] * (new_push - push[i])
            push[i] = new_push
            bound = mu * push[i]
            new_shear = float(np.clip(shear[i] + v[i] / compliance[i, i], -bound, bound))
            v -= compliance[:, i] * (new_shear - shear[i])
            shear[i] = new_shear
    return v


@pytest.mark.parametrize("mu", [0.2, 0.8])
def test_twenty_nodes_agree_with_an_iteration_of_projections(mu: float) -> None:
    rng = np.random.default_rng(3)
    k = 20
    factor = rng.normal(size=(2 * k, 2 * k))
    A_tilde = factor @ factor.T / (2 * k) + np.eye(2 * k)
    load = rng.normal(size=2 * k)
    load[k:] -= 1.0
    laws = Laws.of([NONE] * k + [unilateral()] * k, np.arange(2 * k))
    nodes = np.arange(k)
    friction = PressureFriction(
        nodes, k + nodes, tcstudy.law("tresca", tau=mu), np.full(k, True), np.zeros(k)
    )
    answer = solve_with_pressure(ContactProblem(A_tilde, load, np.ones(2 * k), laws), friction)
    assert answer.status == Status.CONVERGED
    np.testing.assert_allclose(answer.v, by_projections(A_tilde, load, mu), atol=1e-9)
    is_slipping = (answer.v[:k] != 0.0) & (answer.pressure > 0.0)
    assert np.any(is_slipping)
    assert np.any(answer.v[k:] > 0.0)


def block(pull: float, push: float, coefficient: Laws) -> PressureAnswer:
    """A block on springs of 2 N/m along and 5 N/m across, with a cell of 0.5 m."""
    laws = Laws.of([NONE, unilateral()], [0, 1])
    problem = ContactProblem(np.diag([2.0, 5.0]), np.array([pull, -push]), np.full(2, 0.5), laws)
    row = np.arange(1)
    friction = PressureFriction(row, row + 1, coefficient, np.array([True]), np.zeros(1))
    return solve_with_pressure(problem, friction)


def test_a_block_sticks_slips_and_lifts_as_the_closed_form_says() -> None:
    constant = tcstudy.law("tresca", tau=MU)
    assert block(MU * 10.0 - 1e-9, 10.0, constant).v[0] == 0.0
    slipping = block(4.0, 10.0, constant)
    assert slipping.v == pytest.approx([(4.0 - MU * 10.0) / 2.0, 0.0], rel=1e-12)
    assert slipping.pressure == pytest.approx([20.0], rel=1e-12)
    lifted = block(4.0, -10.0, constant)
    assert lifted.v == pytest.approx([2.0, 2.0], rel=1e-12)
    assert lifted.strengths == [0.0]


def test_a_coefficient_that_falls_with_the_slip() -> None:
    """2 s + 10 (0.5 − 0.3 s/δ) = 5.6 with δ = 3 m while it falls; behind that μ = 0.2."""
    weakening = tcstudy.law("slip-weakening", tau_s=0.5, tau_k=0.2, delta=3.0)
    assert block(4.9, 10.0, weakening).v[0] == 0.0
    assert block(5.6, 10.0, weakening).v[0] == pytest.approx(0.6, rel=1e-12)
    behind = block(9.0, 10.0, weakening)
    assert behind.v[0] == pytest.approx(3.5, rel=1e-12)
    assert np.isnan(behind.contraction)
    assert not behind.unique


def test_friction_begins_where_the_last_step_ended() -> None:
    """From a slip of 1 m the block holds between 2·1 ∓ μN and slips back below."""
    laws = Laws.of([NONE, unilateral()], [0, 1])
    row = np.arange(1)
    friction = PressureFriction(
        row, row + 1, tcstudy.law("tresca", tau=MU), np.array([True]), np.ones(1)
    )
    for pull, slip in ((1.0, 1.0), (-1.0 + 1e-9, 1.0), (-3.0, 0.0), (5.0, 1.0), (6.0, 1.5)):
        problem = ContactProblem(
            np.diag([2.0, 5.0]), np.array([pull, -10.0]), np.full(2, 0.5), laws
        )
        answer = solve_with_pressure(problem, friction)
        assert answer.v[0] == pytest.approx(slip, abs=1e-12)


def test_small_and_large_coefficients_approach_no_friction_and_sticking() -> None:
    for seed in range(10):
        problem, friction = body_on_base(seed, tcstudy.law("tresca", tau=1e-9))
        free = tcstudy.solve(problem)
        assert solve_with_pressure(problem, friction).v == pytest.approx(free.v, abs=1e-7)
        problem, friction = body_on_base(seed, tcstudy.law("tresca", tau=1e6))
        answer = solve_with_pressure(problem, friction)
        pressed = answer.pressure > 1e-3
        assert np.all(np.abs(answer.v[friction.slip][pressed]) < 1e-12)


def test_a_contraction_is_proved_for_small_coefficients_only() -> None:
    for seed in range(20):
        problem, friction = body_on_base(seed, tcstudy.law("tresca", tau=0.01))
        small = contraction_bound(problem, friction)
        assert 0.0 < small < 1.0
        problem, friction = body_on_base(seed, tcstudy.law("tresca", tau=1.0))
        assert contraction_bound(problem, friction) == pytest.approx(100.0 * small, rel=1e-9)
